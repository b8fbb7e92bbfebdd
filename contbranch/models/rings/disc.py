"""One disc of contact, or none: states that the model of a disc and that with free boundaries hand to each other."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from contbranch.arrays import Array
from contbranch.continuation import Point
from contbranch.curve.problem import Rates, rates_of, values_of

from .equations import rings

__all__ = ["ALONE", "Disc", "disc_of"]

# Where all inequalities hold by this margin, whatever the accuracy, the model of a disc takes over again.
ALONE = 3e-3


@dataclass(frozen=True)
class Disc:
    """A state with one disc of contact, or none, reduced units.

    Attributes
    ----------
    radius, central_gap, displacement : float
    radii : array
        Where panels end that resolve the pressure outside of the contact, increasing.
    pressure : callable
        Total pressure at radii, inside of the contact and outside.
    along : Rates
        Rates of its values along the curve.
    """

    radius: float
    central_gap: float
    displacement: float
    radii: Array
    pressure: Callable[[Array], Array]
    along: Rates


def disc_of(point: Point) -> Disc | None:
    """What the model of a disc needs of a state; None where the contact set is another."""
    problem = rings(point)
    if not problem.layout.single:
        return None
    fields = problem.fields(point.x, point.parameter)
    _, displacement, radius, gap, _ = values_of(point)
    ends = fields.grid.breaks[:, 1]
    along = rates_of(point)
    radii = ends[np.isfinite(ends) & (ends > radius)]
    return Disc(radius, gap, displacement, radii, lambda r: fields.grid.interpolate(fields.pressure, r), along)
