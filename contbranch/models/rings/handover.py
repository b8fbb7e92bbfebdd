"""Going on with any contact set where one disc of contact, followed by another model, is no longer all there is."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from contbranch.arrays import Array
from contbranch.contact.interactions import Interaction
from contbranch.contact.tips import Tip
from contbranch.continuation import CorrectionError, Point
from contbranch.curve.problem import Rates, Work, oriented
from contbranch.errors import ModelError

from .constraints import begun
from .equations import Setting, rings
from .law import BandedLaw
from .layout import Region
from .meshing import order_for, surrounded
from .newton import resolved, solved
from .panels import Grid
from .problem import RingProblem

__all__ = ["Disc", "taken_over"]


@dataclass(frozen=True)
class Disc:
    """A state with one disc of contact, or none, reduced units.

    Attributes
    ----------
    radius, displacement : float
    radii : array
        Where panels end that resolve the pressure outside of the contact, increasing.
    pressure : callable
        Total pressure at radii, inside of the contact and outside.
    along : Rates
        Rates of its values along the curve.
    """

    radius: float
    displacement: float
    radii: Array
    pressure: Callable[[Array], Array]
    along: Rates


def taken_over(tip: Tip, interaction: Interaction | None, accuracy: float, disc: Disc, work: Work) -> Point:
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

    Raises
    ------
    ModelError
        If the state is not found, or its contact set is not right.
    """
    setting = Setting(tip, BandedLaw(interaction), accuracy, work)
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
    # Load, displacement and contact radius change as they did before.
    values = found.values(point.x, point.parameter)
    own = found.rates(point.x, point.parameter, point.tangent_x, point.tangent_parameter)
    scale = np.array([max(1.0, abs(values.load)), max(1.0, abs(values.displacement)), 1.0])
    return point if float((np.array(own[:3]) / scale) @ (np.array(disc.along[:3]) / scale)) >= 0 else point.turned()
