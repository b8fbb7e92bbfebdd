"""Folds along a traced curve, checked against the tangents of all its points."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from contbranch.continuation import CorrectionError, Point
from contbranch.control import Control
from contbranch.errors import ModelError

from .piece import piece_between, zero_between
from .problem import ContactProblem, FoldEvent

__all__ = ["Mark", "confirmed", "signs"]


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
    """
    names = [control.kind for control in controls]
    kept = [mark for mark in marks if mark.name not in names]
    along = signs(points, controls)
    for which, name in enumerate(names):
        own = {mark.row: mark for mark in marks if mark.name == name}
        sign, last = 0, 0
        pending: list[Mark] = []
        for row in range(len(points)):
            if row in own:
                pending.append(own[row])
                continue
            here = along[row][which]
            if here == 0:
                continue
            odd = sign != 0 and here != sign
            if odd and len(pending) % 2 == 0:
                pending = pending[:-1] or [Mark(row, name, _unmarked(points, last, row, controls[which]))]
            elif not odd and len(pending) % 2 == 1:
                pending = pending[:-1]
            kept += pending
            pending, sign, last = [], here, row
        kept += pending
    return sorted(kept, key=lambda mark: mark.row)


def _unmarked(points: Sequence[Point], first: int, last: int, control: Control) -> Point:
    """A fold that was not marked, between two rows; the last one where the curve cannot be followed between them."""
    event = FoldEvent(control, name=control.kind)
    values = [event.value(point) for point in points[first : last + 1]]
    changes = [first + k for k in range(len(values) - 1) if (values[k] > 0) != (values[k + 1] > 0)]
    if not changes:
        return points[last]
    try:
        place = zero_between(*piece_between(points[changes[0]], points[changes[0] + 1]), event)
        observables = place.problem.observables(place.x, place.u)
    except (CorrectionError, ModelError, np.linalg.LinAlgError):
        return points[last]
    tangent_x, tangent_parameter = place.direction
    return replace(
        points[last],
        x=place.x,
        parameter=place.u,
        tangent_x=tangent_x,
        tangent_parameter=tangent_parameter,
        problem=place.problem,
        observables=observables,
    )
