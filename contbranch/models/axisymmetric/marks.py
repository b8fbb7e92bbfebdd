"""Folds along a traced curve, checked against the tangents of all its points."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from contbranch.continuation import CorrectionError, Point
from contbranch.control import DISPLACEMENT, Control
from contbranch.errors import ModelError

from .piece import piece_between, zero_between
from .problem import ContactProblem, FoldEvent

__all__ = ["Mark", "confirmed", "ordered", "signs"]

# Folds farther apart than this share of the distance between the rows beside them are in the order of their places.
APART = 1e-3


@dataclass(frozen=True)
class Mark:
    """A row of the curve at which something happens."""

    row: int
    name: str
    point: Point


def signs(points: Sequence[Point], controls: Sequence[Control]) -> list[tuple[int, ...]]:
    """Signs of the change of what each control controls along the curve, at every point; 0 where there is none."""
    found = []
    for point in points:
        problem = point.problem
        assert isinstance(problem, ContactProblem)
        rates = problem.rates(point.x, point.parameter, point.tangent_x, point.tangent_parameter)
        found.append(tuple(int(np.sign(control.weighted(*rates))) for control in controls))
    return found


def confirmed(points: Sequence[Point], marks: Sequence[Mark], controls: Sequence[Control]) -> list[Mark]:
    """The marks with folds made to agree with the tangents: a load fold is where the rate of the load changes sign.

    Where a mesh was changed close to a fold, the fold may have been reported on both meshes or on neither. Two marks
    of one control with no point between them are a pair of folds only if the signs on both sides are the same.

    Rows that are folds themselves, of whichever control, have no say: they are located coarsely, and of folds that all
    but coincide (as in stiff films) one control's rate is as uncertain there as the other's.
    """
    names = [control.kind for control in controls]
    kept = [mark for mark in marks if mark.name not in names]
    folds = {mark.row for mark in marks if mark.name in names}
    along = signs(points, controls)
    for which, name in enumerate(names):
        own = {mark.row: mark for mark in marks if mark.name == name}
        sign, last = 0, 0
        pending: list[Mark] = []
        for row in range(len(points)):
            if row in own:
                pending.append(own[row])
            if row in folds:
                continue
            here = along[row][which]
            if here == 0:
                continue
            odd = sign != 0 and here != sign
            if odd and len(pending) % 2 == 0:
                pending = pending[:-1] or [_between(points, last, row, name, controls[which])]
            elif not odd and len(pending) % 2 == 1:
                pending = pending[:-1]
            kept += pending
            pending, sign, last = [], here, row
        kept += pending
    return ordered(points, sorted(kept, key=lambda mark: mark.row), controls)


def _unmarked(points: Sequence[Point], first: int, last: int, nearest: int, control: Control) -> Point:
    """A fold that was not marked, between two rows; the nearest row where the curve cannot be followed there."""
    event = FoldEvent(control, name=control.kind)
    values = [event.value(point) for point in points[first : last + 1]]
    changes = [first + k for k in range(len(values) - 1) if (values[k] > 0) != (values[k + 1] > 0)]
    if not changes:
        return points[nearest]
    try:
        place = zero_between(*piece_between(points[changes[0]], points[changes[0] + 1]), event)
        observables = place.problem.observables(place.x, place.u)
    except (CorrectionError, ModelError, np.linalg.LinAlgError):
        return points[nearest]
    tangent_x, tangent_parameter = place.direction
    return replace(
        points[nearest],
        x=place.x,
        parameter=place.u,
        tangent_x=tangent_x,
        tangent_parameter=tangent_parameter,
        problem=place.problem,
        observables=observables,
    )


def _between(points: Sequence[Point], first: int, last: int, name: str, control: Control) -> Mark:
    """A fold seen between two rows only by its sign: at the row between them, or of them, closest to it."""

    def distance(row: int) -> float:
        point = points[row]
        problem = point.problem
        assert isinstance(problem, ContactProblem)
        return abs(control.weighted(*problem.rates(point.x, point.parameter, point.tangent_x, point.tangent_parameter)))

    row = min(range(first + 1, last + 1), key=distance)
    return Mark(row, name, _unmarked(points, first, last, row, control))


def ordered(
    points: Sequence[Point],
    marks: Sequence[Mark],
    controls: Sequence[Control],
    places: Sequence[float] | None = None,
) -> list[Mark]:
    """The marks with pairs of neighbouring folds, one of the displacement, in the order that theory allows.

    With the displacement fixed, the slope dF/dd (plus the stiffness of a spring) is something finite minus
    c²/λ, where the eigenvalue λ of the second variation vanishes at the displacement fold. Where the slope has the same
    sign s on both sides of the pair, its zero therefore lies where λ has the sign s: on the more stable side of the
    displacement fold if s > 0. The Morse indices at the rows beside the pair, by inertia, tell which side that is,
    however close the folds are; their places do not where they agree to rounding.

    Parameters
    ----------
    places : sequence of float
        The parameters of the marks, if known better than by their points.
    """
    result = list(marks)
    where = [mark.point.parameter for mark in marks] if places is None else list(places)
    names: dict[str, Control] = {control.kind: control for control in controls}
    taken = {mark.row for mark in marks}
    for k in range(len(result) - 1):
        here, there = result[k], result[k + 1]
        kinds = {here.name, there.name}
        if there.row - here.row > 1 or len(kinds) != 2 or "displacement" not in kinds or not kinds <= set(names):
            continue
        before, after = here.row - 1, there.row + 1
        if before < 0 or after >= len(points) or taken & {before, after}:
            continue
        step = abs(points[after].parameter - points[before].parameter)
        if abs(where[k + 1] - where[k]) > APART * step:
            continue
        other = names[next(iter(kinds - {"displacement"}))]
        slope = [_slope_sign(points[row], other) for row in (before, after)]
        index = [_index(points[row]) for row in (before, after)]
        if slope[0] != slope[1] or slope[0] == 0 or abs(index[1] - index[0]) != 1:
            continue
        displacement_last = (slope[0] > 0) == (index[1] > index[0])
        if displacement_last != (there.name == "displacement"):
            result[k], result[k + 1] = replace(there, row=here.row), replace(here, row=there.row)
    return result


def _slope_sign(point: Point, control: Control) -> int:
    """Sign of the change of what is controlled with the displacement, along the curve."""
    along = signs([point], [control, DISPLACEMENT])[0]
    return along[0] * along[1]


def _index(point: Point) -> int:
    """Morse index under displacement control by inertia."""
    problem = point.problem
    assert isinstance(problem, ContactProblem)
    return problem.equations.unstable_modes(problem.fields(point.x, point.parameter))
