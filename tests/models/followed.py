"""Curves of the axisymmetric model with the problems that solved their rows."""

from __future__ import annotations

from collections.abc import Callable
from itertools import pairwise

import numpy as np
from ring_collocation import Array, integral

from contbranch.contact.contact import Contact
from contbranch.continuation import Point
from contbranch.control import LOAD, Control
from contbranch.curve.outcome import RawCurve
from contbranch.curve.rows import raw_curve
from contbranch.curve.trace import Request, trace
from contbranch.curve.track import Track
from contbranch.models.axisymmetric import Axisymmetric
from contbranch.models.axisymmetric.laying import Functions
from contbranch.models.axisymmetric.problem import ContactProblem
from contbranch.models.axisymmetric.regions import layout_of, radii_of


def tracked(contact: Contact, accuracy: float) -> Track:
    """Rows of a reduced contact's curve without its modes, and without what is made of them: events are not located."""
    return trace(Axisymmetric().problem(contact, accuracy), Request(accuracy, modes=0))


class Followed:
    """Rows (points, each with its problem) and the raw result of a reduced contact's curve."""

    def __init__(self, contact, accuracy: float, tolerance: float | None = None, control: Control = LOAD, **asked):
        problem = Axisymmetric().problem(contact, accuracy)
        if tolerance is not None:
            problem = problem.rows_within(tolerance)
        request = Request(accuracy, control, **asked)
        self.track: Track = trace(problem, request)
        self.curve: RawCurve = raw_curve(self.track, request)
        self.points = self.track.points
        self.problem = self.track.problem


def virial(point: Point) -> tuple[float, float]:
    """Energy of the interaction, and ∫ g p d²r, integrated over the regions in real space."""
    problem = point.problem
    assert isinstance(problem, ContactProblem)
    equations, fields = problem.seen(point.x, point.parameter)
    state, law, mesh, a = Functions(equations, fields), equations.law, equations.mesh, fields.rim.radius
    surface = pressed = 0.0
    places = np.concatenate([[0.0], radii_of(equations, fields), state.ends[-1:]])
    for region, (low, high) in zip(layout_of(equations).regions, pairwise(places), strict=False):

        def gap(r: Array, rests: bool = region.rests, index: int = region.index) -> Array:
            floating = mesh.interpolate(fields.gap, np.sqrt(np.maximum(r * r - a * a, 0.0)))
            return np.full(len(r), law.levels[index]) if rests else floating

        def energy(r: Array, index: int = region.index, gap: Callable[[Array], Array] = gap) -> Array:
            return r * law.evaluate(index, gap(r)).energy

        def work(r: Array, gap: Callable[[Array], Array] = gap) -> Array:
            return r * gap(r) * state.pressure(r)

        ends = [low, *state.ends[(state.ends > low) & (state.ends < high)], high]
        surface += 2 * np.pi * integral(energy, ends)
        pressed += 2 * np.pi * integral(work, ends)
    return surface, pressed
