"""Going on with any contact set where one disc of contact, followed by another model, is no longer all there is."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from contbranch.contact.interactions import Interaction
from contbranch.contact.tips import Tip
from contbranch.continuation import CorrectionError, Point
from contbranch.curve.problem import Work, alike, oriented, rates_of, values_of
from contbranch.errors import ModelError

from .constraints import begun
from .disc import Disc
from .equations import Setting, rings
from .law import BandedLaw
from .layout import Region
from .meshing import order_for, surrounded
from .newton import resolved, solved
from .panels import Grid
from .problem import RingProblem

__all__ = ["taken_over"]


def taken_over(
    tip: Tip,
    interaction: Interaction | None,
    accuracy: float,
    disc: Disc,
    work: Work,
    regained: Callable[[Disc], Point] | None = None,
) -> Point:
    """The same state with free boundaries, from which any contact set may follow.

    Parameters
    ----------
    tip, interaction : Tip, Interaction or None
        Reduced units.
    accuracy : float
        Error allowed to events, relative to max(1, |value|).
    disc : Disc
    work : Work
        In which what is spent on the whole curve is counted.
    regained : callable, optional
        What takes over again where there is one disc of contact, or none.

    Raises
    ------
    ModelError
        If the state is not found, or its contact set is not right.
    """
    setting = Setting(tip, BandedLaw(interaction), accuracy, work, regained)
    around, a = Region(False, setting.law.outermost), disc.radius
    regions, inside = ((Region(True, 0), around), np.array([a])) if a > 0 else ((around,), np.zeros(0))
    radii, order = disc.radii[disc.radii > a], order_for(setting.tolerance)
    layout, panels, edges = surrounded(regions, tip.extent, inside, radii, order)
    problem = RingProblem(setting, layout, panels)
    x = np.concatenate([disc.pressure(Grid(panels, edges, layout.bounded).r), edges])
    held = (np.zeros(x.size), 1.0)
    try:
        point = oriented(problem, *solved(problem, x, disc.displacement, held), held)
        point = begun(resolved(point, (np.zeros(len(edges)), 1.0)))
    except CorrectionError as error:
        raise ModelError(f"the state was not found with free boundaries {error.detail}") from error
    found = rings(point)
    if found.margins(point.x, point.parameter)["breach"] <= 0:
        raise ModelError("the state handed over is not admissible")
    return point if alike(values_of(point), rates_of(point), disc.along) else point.turned()
