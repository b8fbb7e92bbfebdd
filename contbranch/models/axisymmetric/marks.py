"""Folds along a traced curve, checked against the tangents of all its points."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from contbranch.continuation import Point
from contbranch.control import Control

from .problem import ContactProblem

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
        sign = 0
        pending: list[Mark] = []
        for row, point in enumerate(points):
            if row in own:
                pending.append(own[row])
                continue
            here = along[row][which]
            if here == 0:
                continue
            odd = sign != 0 and here != sign
            if odd and len(pending) % 2 == 0:
                pending = pending[:-1] or [Mark(row, name, point)]
            elif not odd and len(pending) % 2 == 1:
                pending = pending[:-1]
            kept += pending
            pending, sign = [], here
        kept += pending
    return sorted(kept, key=lambda mark: mark.row)
