"""The piece of curve between two rows, as points of one problem."""

from __future__ import annotations

import math
from dataclasses import replace

from contbranch.continuation import Event, Metric, Point, find_root
from contbranch.continuation.segment import Segment
from contbranch.continuation.walk import point_on

from .locate import OPTIONS, Place
from .problem import ContactProblem

__all__ = ["piece_between", "place_of", "zero_between"]


def piece_between(begin: Point, end: Point) -> tuple[Point, Point]:
    """Two neighbouring rows as points of one problem, on the mesh of the first.

    First touch is a row of the side without contact; towards the contact it is a point of the other side.
    """
    problem, other = begin.problem, end.problem
    assert isinstance(problem, ContactProblem)
    assert isinstance(other, ContactProblem)
    if other.equations.contact and not problem.equations.contact:
        problem = problem.in_contact()
        tangent = problem.direction(begin.x, begin.parameter)
        begin = replace(begin, problem=problem, tangent_x=tangent[0], tangent_parameter=tangent[1])
    mesh, own = problem.equations.mesh, other.equations.mesh
    if own is not mesh:
        x = problem.solve_at(own.interpolate(end.x, mesh.nodes), end.parameter)
        end = replace(end, x=x, tangent_x=own.interpolate(end.tangent_x, mesh.nodes))
    return begin, replace(end, problem=problem)


def place_of(point: Point) -> Place:
    """A point as a place."""
    problem = point.problem
    assert isinstance(problem, ContactProblem)
    return Place(problem, point.x, point.parameter, (point.tangent_x, point.tangent_parameter))


def zero_between(begin: Point, end: Point, event: Event, tolerance: float = 1e-8) -> Place:
    """Where an event vanishes between two points of `piece_between`, to a share of the piece.

    Where both values have one sign, which differences between two meshes can cause, the end with the smaller one.
    """
    problem = begin.problem
    assert isinstance(problem, ContactProblem)
    first, last = event.value(begin), event.value(end)
    if (first > 0) == (last > 0):
        return place_of(begin if abs(first) < abs(last) else end)
    segment = Segment(begin, end, Metric(math.sqrt(problem.inner(end.x, end.x)) + problem.scale, 1.0))
    share = find_root(lambda s: event.value(point_on(segment, s, OPTIONS)[0]), (0.0, first), (1.0, last), tolerance)
    return place_of(point_on(segment, share, OPTIONS)[0])
