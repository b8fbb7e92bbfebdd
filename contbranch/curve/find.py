"""Equilibria that a followed curve does not reach, by deflated Newton's method at one value of a control."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from contextlib import suppress
from itertools import pairwise

import numpy as np

from contbranch.arrays import Array
from contbranch.continuation import CorrectionError, Linearisation, Point, Problem
from contbranch.continuation.deflation import search
from contbranch.continuation.newton import correct_start, tangent_at
from contbranch.continuation.walk import adapted
from contbranch.control import Control
from contbranch.curve.events import Reached
from contbranch.curve.problem import EquilibriumProblem, Search, equilibrium
from contbranch.curve.refine import OPTIONS, Found, refine
from contbranch.curve.solve import Crossing
from contbranch.curve.track import Track
from contbranch.watch import INTERRUPTIONS, caught

__all__ = ["HeldProblem", "disconnected"]

# Rows from which the search starts in each representation.
ROWS = 6
# States closer than this multiple of their errors are one.
APART = 3.0


class HeldProblem(Problem):
    """``F(x, u) = 0`` and ``w·(F, d) = p`` for the state (x, u) of one discretisation.

    Parameters
    ----------
    problem : EquilibriumProblem
    control : Control
    size : float
        What the norm of x is measured in; u counts by itself.
    """

    def __init__(self, problem: EquilibriumProblem, control: Control, size: float = 1.0) -> None:
        self.problem, self.control, self.size = problem, control, size

    def residual(self, x: Array, p: float) -> Array:
        """Residuals of equilibrium and control, (n + 1,); infinite where numbers overflow."""
        state, u = x[:-1], float(x[-1])
        try:
            values = self.problem.values(state, u)
            residual = self.problem.residual(state, u)
        except ArithmeticError:
            return np.full_like(x, np.inf)
        return np.append(residual, self.control.weighted(values.load, values.displacement) - p)

    def linearise(self, x: Array, p: float) -> Linearisation:
        """Residual and Jacobian, (n + 1, n + 1); the parameter enters the last equation alone."""
        residual, state, u = self.residual(x, p), x[:-1], float(x[-1])
        if not np.isfinite(residual).all():
            return Linearisation(residual, np.empty((0, 0)), residual)
        _, jacobian, slope = self.problem.linearise(state, u)
        along = self.problem.rates(state, u, np.zeros_like(state), 1.0)
        load, displacement = self.problem.gradients(state, u)
        first, second = self.control.weights
        held = np.append(first * load + second * displacement, self.control.weighted(along.load, along.displacement))
        whole = np.vstack([np.column_stack([np.asarray(jacobian), slope]), held])
        return Linearisation(residual, whole, np.append(np.zeros_like(state), -1.0))

    def inner(self, u: Array, v: Array) -> float:
        """The problem's own in units of the size, plus the product of the parameters."""
        return self.problem.inner(u[:-1], v[:-1]) / self.size**2 + float(u[-1] * v[-1])


def disconnected(
    track: Track, known: Sequence[Crossing], control: Control, value: float, accuracy: float
) -> list[Found] | None:
    """Equilibria at a value of a control that are not among the known ones; None where the model offers no search.

    If the computation is interrupted, those found so far.

    Parameters
    ----------
    track : Track
        From whose rows to search, in each representation that it passes.
    known : sequence of Crossing
        What the curve has at this value.
    """
    found: list[Found] = []
    joints = [0, *sorted({*track.onward, *track.gaps}), len(track.points) - 1]
    with np.errstate(over="ignore", invalid="ignore", divide="ignore"):  # trial states may be anything
        for first, last in pairwise(joints):
            first += first in track.gaps  # behind which a piece begins with its own row
            points = [track.onward.get(first, track.points[first]), *track.points[first + 1 : last + 1]]
            offer = equilibrium(points[0]).search(points)
            if offer is None:
                return None
            held, target = HeldProblem(offer.problem, control, offer.size), control.target(value)
            own = [one.found.point for one in known if first <= max(one.piece, 0) < last]
            try:
                for x in search(held, target, [_carried(held, point, target) for point in own], _starts(points, offer)):
                    other = _settled(offer.problem, x, Reached(control, target), accuracy)
                    if other is not None and not any(_same(other, one) for one in [*(k.found for k in known), *found]):
                        found.append(other)
            except INTERRUPTIONS as error:
                caught(error)
                break
    return found


def _on(problem: EquilibriumProblem, point: Point) -> Array:
    """State and parameter of a point on another discretisation."""
    return np.append(equilibrium(point).carried(point.x, point.x, point.parameter, problem), point.parameter)


def _starts(points: Sequence[Point], offer: Search) -> Iterator[Array]:
    """States of the curve, and those that the model offers."""
    for k in sorted({round(k * (len(points) - 1) / (ROWS - 1)) for k in range(ROWS)}):
        yield _on(offer.problem, points[k])
    for x, u in offer.starts:
        yield np.append(x, u)


def _carried(held: HeldProblem, point: Point, target: float) -> Array:
    """A known state on the discretisation of the search."""
    x = _on(held.problem, point)
    with suppress(CorrectionError):  # next to a fold it may not be found there
        return correct_start(held, x, target)[0]
    return x


def _settled(problem: EquilibriumProblem, x: Array, event: Reached, accuracy: float) -> Found | None:
    """What was found, to the accuracy asked; None where that is not to be had: a state of the discretisation, not of
    the contact, is no equilibrium after all."""
    if not _admissible(problem, x[:-1], float(x[-1])):
        return None
    try:
        tangent_x, tangent, _ = tangent_at(problem, x[:-1], float(x[-1]))
        point = Point(problem, x[:-1], float(x[-1]), tangent_x, tangent)
        point, _ = adapted(point, problem.metric(point.x), OPTIONS)  # with the fronts that it has, as the curve's rows
        found = refine(point, event, accuracy)
    except (CorrectionError, np.linalg.LinAlgError):
        return None  # an artefact of the coarse discretisation: it does not survive refinement
    point = found.point
    own = equilibrium(point)
    if found.relative_error() > accuracy or not _admissible(own, point.x, point.parameter):
        return None
    return found


def _admissible(problem: EquilibriumProblem, x: Array, p: float) -> bool:
    """Whether a state is one that its representation stands for."""
    low, high = problem.parameter_range
    return low <= p <= high and min(problem.margins(x, p).values(), default=math.inf) >= 0.0


def _same(one: Found, other: Found) -> bool:
    """Whether two states are one, as far as their errors tell."""
    pairs = zip(one.numbers, other.numbers, one.error, other.error, strict=True)
    return all(abs(a - b) <= APART * (c + d) for a, b, c, d in pairs)
