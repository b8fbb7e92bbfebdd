"""Folds at tiny contact radii, solved at given radii.

The contact coordinate y = a^m of a tiny contact is smaller than the rounding of a state that is corrected together with
it, so that positions along the curve cannot tell such a fold from first touch. The radius can: at a given one the state
follows from Newton's method, and the rates of load and displacement (`ContactProblem.rates`) keep their digits.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from contbranch.continuation import CorrectionError, Outcome
from contbranch.continuation.locate import find_root
from contbranch.control import Control

from .mesh import Mesh
from .problem import TINY, ContactProblem

__all__ = ["TinyFold", "fold_at_tiny_radius", "graded", "is_tiny"]

Array = NDArray[np.float64]

# Where its place says no radius, a fold is sought from this share of the innermost panel.
LEAST = 1e-7
# A fold is sought at radii below that of the parameter TINY if its place says less than this share of it.
SMALL = 1e-4
# The bracket around a fold is widened by this factor, at most so many times.
WIDER, WIDENINGS = 2.0, 30
# Relative offset of the radius by which slope and noise of the rate at the fold are found.
ASIDE = 1e-4
# The innermost panel is shorter than this share of the radius, each next one longer by this factor; if those are too
# many panels, by a larger one: the tinier the radius, the less what happens on its scale matters.
SHARE, GRADING, PANELS = 0.5, 4.0, 8


@dataclass(frozen=True)
class TinyFold:
    """State and parameter at a fold, the tangent per parameter, and what rounding leaves open of the parameter."""

    x: Array
    u: float
    direction: tuple[Array, float]
    uncertainty: float


def is_tiny(problem: ContactProblem, u: float) -> bool:
    """Whether a parameter belongs to a contact so small that its radius is the better coordinate."""
    return problem.equations.contact and u < SMALL * TINY


def graded(problem: ContactProblem, x: Array, u: float) -> tuple[ContactProblem, Array]:
    """The problem on panels graded down to the radius at a parameter, and the solution there.

    The gap's answer s = (2/π) arccos(a/r) to a rigid motion varies on the scale of the radius a; on panels far longer
    the radius of a fold has a relative error that further panels farther out do not cure.
    """
    mesh = problem.equations.mesh
    length = SHARE * problem.equations.coordinate.radius(problem.coordinate(u))
    if not 0.0 < length < mesh.innermost:
        return problem, x
    count = min(PANELS, math.ceil(math.log(mesh.innermost / length) / math.log(GRADING)))
    inner = mesh.innermost * (length / mesh.innermost) ** (np.arange(count, 0, -1) / count)
    return problem.on(Mesh(np.concatenate([[0.0], inner, mesh.edges[1:]]), mesh.order), x, u)


def fold_at_tiny_radius(problem: ContactProblem, x: Array, u: float, control: Control) -> TinyFold:
    """The fold under a control nearest to a state, at a radius below that of the parameter TINY.

    Raises
    ------
    CorrectionError
        If the rate of what is controlled has one sign at all these radii.
    """
    coordinate = problem.equations.coordinate
    known = [(u, x)] if u > 0.0 else [(0.0, problem.solve_at(x, 0.0))]

    def state(radius: float) -> tuple[Array, float]:
        here = problem.parameter(coordinate.of(radius, 0.0))
        start, near = min(known, key=lambda one: abs(one[0] - here))
        found = problem.solve_at(near + (here - start) * problem.direction(near, start)[0], here)
        known.append((here, found))
        return found, here

    def rate(radius: float) -> float:
        found, here = state(radius)
        return control.weighted(*problem.rates(found, here, *problem.direction(found, here)))

    largest = coordinate.radius(problem.coordinate(TINY))
    first = coordinate.radius(problem.coordinate(max(u, 0.0)))
    low = high = min(max(first, LEAST * problem.equations.mesh.innermost), largest)
    inner = outer = rate(low)
    for _ in range(WIDENINGS):
        if inner * outer <= 0.0:
            break
        low, high = low / WIDER, min(high * WIDER, largest)
        inner, outer = rate(low), rate(high)
    else:
        message = f"(The rate of the {control.kind} has one sign at contact radii from {low:.2g} to {high:.2g}.)"
        raise CorrectionError(Outcome.STEP_TOO_SMALL, message)
    radius = low if low == high else find_root(rate, (low, inner), (high, outer), 0.0, 1e-13)
    found, here = state(radius)
    below, at, above = (rate(radius * (1 + k * ASIDE)) for k in (-1, 0, 1))
    # Away from its zero the rate is all but linear in the radius: what bends it is noise (or counts as such).
    noise = abs(at) + abs(above - 2 * at + below) / 2
    steepness = abs(above - below) / (2 * ASIDE * radius)
    open_radius = noise / steepness if steepness > 0.0 else math.inf
    farther = problem.parameter(coordinate.of(min(radius + open_radius, largest), 0.0))
    return TinyFold(found, here, problem.direction(found, here), farther - here)
