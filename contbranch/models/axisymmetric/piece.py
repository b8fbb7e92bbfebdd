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
    """Two neighbouring rows as points of one problem, on the mesh of the first, with tangents along the piece.

    First touch is a row of the side without contact; towards the contact it is a point of the other side.
    """
    problem = begin.problem
    other = end.problem
    assert isinstance(problem, ContactProblem)
    assert isinstance(other, ContactProblem)
    contact = problem.equations.contact or other.equations.contact
    if contact and not problem.equations.contact:
        # From first touch into contact: the row belongs to the side without.
        begin = _touching(begin, problem.in_contact())
    if contact and not other.equations.contact:
        end = _touching(end, other.in_contact())
    problem, other = begin.problem, end.problem
    assert isinstance(problem, ContactProblem)
    assert isinstance(other, ContactProblem)
    mesh, there = problem.equations.mesh, other.equations.mesh
    if there is not mesh:
        x = problem.solve_at(there.interpolate(end.x, mesh.nodes), end.parameter)
        end = replace(end, x=x, tangent_x=there.interpolate(end.tangent_x, mesh.nodes))
    end = replace(end, problem=problem)
    return _along(begin, begin, end), _along(end, begin, end)


def _touching(point: Point, problem: ContactProblem) -> Point:
    """A point at first touch as one of the side in contact."""
    tangent = problem.direction(point.x, point.parameter)
    return replace(point, problem=problem, tangent_x=tangent[0], tangent_parameter=tangent[1])


def _along(point: Point, begin: Point, end: Point) -> Point:
    """The point with its tangent towards the end of the piece."""
    problem = begin.problem
    ahead = problem.inner(end.x - begin.x, point.tangent_x)
    size = math.sqrt(problem.inner(end.x, end.x)) + 1e-300
    ahead += size * size * (end.parameter - begin.parameter) * point.tangent_parameter
    return (
        point if ahead >= 0 else replace(point, tangent_x=-point.tangent_x, tangent_parameter=-point.tangent_parameter)
    )


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
