"""The augmented system of a followed event, and special points on curves that are known."""

from __future__ import annotations

import math

import numpy as np
import pytest
from contbranch.models.axisymmetric.conditions import FoldCondition, Surface
from contbranch.models.axisymmetric.event_problem import EventProblem
from contbranch.models.axisymmetric.meetings import Turn
from contbranch.models.axisymmetric.special import located
from contbranch.models.axisymmetric.two_parameters import follow_event

import contbranch as cb
from contbranch.contact.family import family_of
from contbranch.continuation import Options, Point, Problem, trace_curve
from contbranch.control import DISPLACEMENT, LOAD
from contbranch.models.axisymmetric.problem import ControlReached, Resolution

CONTACT = cb.Contact.reduced(cb.Gauss, tabor=2.0, sign=-1)
EVENTS = {(e.name, e.control): e for e in cb.trace(CONTACT, accuracy=1e-9).events if e.kind == "fold"}


def augmented(name: str, control: str, fine: bool = True) -> tuple[EventProblem, np.ndarray]:
    """The augmented system of a fold in the Tabor coefficient, and the state of the fold."""
    place = EVENTS[name, control].origin.raw.place
    problem = place.problem
    family = family_of(CONTACT, "tabor", 1.0)
    size = math.sqrt(problem.inner(place.x, place.x))
    surface = Surface(family, problem.scale, problem.equations.coordinate.power, Resolution(1e-7, 12), size)
    condition = FoldCondition(family, LOAD if control == "load" else DISPLACEMENT)
    mesh, contact = problem.equations.mesh, problem.equations.contact
    made = EventProblem(surface, mesh, contact, condition, place.direction, fine=fine)
    return made, made.joined(place.x, place.u)


@pytest.mark.parametrize("name", ["squeeze-out", "wetting"])
def test_the_fold_solves_the_augmented_system(name):
    problem, x = augmented(name, "load")
    residual = problem.residual(x, 0.0)
    assert np.abs(residual[:-1]).max() < 1e-11
    assert abs(residual[-1]) < 1e-9


@pytest.mark.parametrize(("name", "control"), [("squeeze-out", "load"), ("wetting", "displacement")])
def test_the_jacobian_is_the_derivative_of_the_residual(name, control):
    """At an equilibrium that is no fold, along smooth directions, against central differences of the residual."""
    problem, x = augmented(name, control)
    tau = problem.mesh.nodes
    h, u = problem.split(x + np.append(np.zeros(tau.size), 0.05))
    x = problem.joined(problem.member(0.02).solve_at(h, u), u)
    linear = problem.linearise(x, 0.02)
    for direction, rate in ((np.append(np.exp(-(tau**2)), 0.3), 0.0), (np.zeros(x.size), 1.0)):
        step = 1e-5
        there, back = (problem.residual(x + s * direction, 0.02 + s * rate) for s in (step, -step))
        expected = (there - back) / (2 * step)
        found = linear.jacobian @ direction + rate * linear.parameter_derivative
        np.testing.assert_allclose(found[:-1], expected[:-1], atol=1e-6)
        assert found[-1] == pytest.approx(expected[-1], rel=2e-4)


def test_any_event_of_the_curve_can_be_followed():
    """The states of one displacement, as an event: they are those that `solve` finds."""
    found = EVENTS["wetting", "load"]
    family = family_of(CONTACT, "tabor", 1.0)
    reached = ControlReached(DISPLACEMENT, found.displacement)
    curve = follow_event(family, found.origin.raw.place, reached, (1.8,), 1e-8)
    assert curve.complete
    point = next(point for point in curve.points if point.value == 1.8)
    states = cb.solve(cb.Contact.reduced(cb.Gauss, 1.8, -1), displacement=found.displacement, accuracy=1e-8).states
    nearest = min(states, key=lambda state: abs(state.load - point.numbers[0]))
    np.testing.assert_allclose(
        point.numbers, (nearest.load, found.displacement, nearest.contact_radius, nearest.central_gap), atol=1e-7
    )


class Circle(Problem):
    """X² + p² = 1: p turns round at x = 0."""

    def residual(self, x, p):
        return np.array([x[0] ** 2 + p**2 - 1.0])

    def jacobian(self, x, p):
        return np.array([[2.0 * x[0]]])

    def parameter_derivative(self, x, p):
        return np.array([2.0 * p])


class Swallowtail(Problem):
    """The folds of p = x³ − q x, p' = 0, as a curve 3 x² = q: they merge in a cusp at the origin."""

    def residual(self, x, p):
        return np.array([3.0 * x[0] ** 2 - p])

    def jacobian(self, x, p):
        return np.array([[6.0 * x[0]]])

    def parameter_derivative(self, x, p):
        return np.array([-1.0])


@pytest.mark.parametrize(("problem", "start", "q"), [(Circle(), 0.6, 1.0), (Swallowtail(), 0.3, 0.0)])
def test_turning_points_are_located_to_rounding(problem, start, q):
    p = 0.8 if isinstance(problem, Circle) else 3 * start**2
    curve = trace_curve(problem, [start], p, (p - 1e-3, p + 1e-3), Options(first_step=0.1))
    near = curve.points[len(curve.points) // 2]
    assert isinstance(near, Point)
    point, uncertainty = located(near, Turn().value)
    assert point.parameter == pytest.approx(q, abs=1e-14)
    assert point.x[0] == pytest.approx(0.0, abs=1e-9)
    assert uncertainty < 1e-9
