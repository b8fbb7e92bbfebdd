"""User events: located to machine precision on the curve, pairs within a step included, with errors that hold."""

from __future__ import annotations

import math

import numpy as np
import pytest
from continuation_problems import Bratu, graph

from contbranch.continuation import (
    Crossing,
    Event,
    EventPoint,
    Extremum,
    Happening,
    Metric,
    Options,
    Outcome,
    Problem,
    TangentCrossing,
    trace_curve,
)
from contbranch.continuation.segment import Segment
from contbranch.continuation.walk import point_on

SPACING = 5 * math.pi / 12


class Spiral(Problem):
    """x = (cos p, sin p) e^(p/10), with the two components as observables."""

    def residual(self, x, p):
        return x - np.array([math.cos(p), math.sin(p)]) * math.exp(p / 10)

    def jacobian(self, x, p):
        return np.eye(2)

    def observables(self, x, p):
        return {"abscissa": x[0], "ordinate": x[1], "product": x[0] * x[1]}


def test_a_point_found_in_a_part_of_a_step_has_its_place_in_the_whole():
    """Cubics of parts are closer to the curve: a fraction of a part is no affine function of that of the whole."""
    curve = trace_curve(Spiral(), [1.0, 0.0], 0.0, (0.0, 10.0), options=Options(largest_parameter_step=0.1))
    metric, (begin, end) = Metric(1.0, 1.0), curve.points[3:5]
    whole = Segment(begin, end, metric)
    middle = point_on(whole, 0.5, Options())[0]
    point = point_on(Segment(begin, middle, metric), 0.5, Options())[0]
    theta = whole.foot(point.x, point.parameter, 0.25)
    assert abs(theta - 0.25) > 1e-5
    assert point_on(whole, theta, Options())[0].parameter == pytest.approx(point.parameter, abs=1e-13)


def test_crossings_of_a_component():
    crossing = Crossing(lambda x, p: x[0], name="axis")
    curve = trace_curve(Spiral(), [1.0, 0.0], 0.0, (0.0, 10.0), events=[crossing])
    found = curve.named("axis")
    assert [event.parameter for event in found] == pytest.approx([(k + 0.5) * math.pi for k in range(3)], abs=1e-13)
    for event in found:
        assert curve.points[event.index] is event.point
        assert event.point.label == "axis"
        assert event.observables["ordinate"] == event.x[1]
        nearest = min(abs(event.parameter - (k + 0.5) * math.pi) for k in range(3))
        assert nearest <= event.error < 1e-12
    assert list(curve.parameter) == sorted(curve.parameter)


def test_extrema_of_an_observable():
    """(cos p e^(p/10))' = 0 at tan p = 1/10; the product is extremal at tan 2p = -10."""
    events = [Extremum("abscissa"), Extremum("product", name="largest product")]
    curve = trace_curve(Spiral(), [1.0, 0.0], 0.0, (0.0, 10.0), events=events)
    expected = [math.atan(0.1) + k * math.pi for k in range(4) if math.atan(0.1) + k * math.pi < 10]
    assert [e.parameter for e in curve.named("extremum of abscissa")] == pytest.approx(expected, abs=1e-9)
    expected = [p for k in range(9) if 0 < (p := (k * math.pi - math.atan(10)) / 2) < 10]
    assert [e.parameter for e in curve.named("largest product")] == pytest.approx(expected, abs=1e-9)


def test_extremum_of_a_component_by_its_tangent():
    event = TangentCrossing(lambda x, p, tangent_x, tangent_p: tangent_x[0], name="turn")
    curve = trace_curve(Spiral(), [1.0, 0.0], 0.0, (0.0, 10.0), events=[event])
    expected = [math.atan(0.1) + k * math.pi for k in range(4) if math.atan(0.1) + k * math.pi < 10]
    assert [e.parameter for e in curve.named("turn")] == pytest.approx(expected, abs=1e-9)


@pytest.mark.parametrize("gap", [1e-1, 1e-2, 1e-3, 1e-5])
@pytest.mark.parametrize("place", [0.21, 0.5, 0.83])
def test_pair_of_crossings_within_a_step(gap, place):
    """(p - place)² = gap² has the same sign at both ends of a longer step."""
    event = Crossing(lambda x, p: (x[0] - place) ** 2 - gap**2, name="pair")
    curve = trace_curve(graph(lambda x: x, lambda x: 1.0), [0.0], 0.0, (0.0, 1.0), events=[event])
    assert [e.parameter for e in curve.named("pair")] == pytest.approx([place - gap, place + gap], abs=1e-10)


def test_a_touch_that_does_not_cross_is_no_event():
    event = Crossing(lambda x, p: (x[0] - 0.5) ** 2 + 1e-6, name="none")
    curve = trace_curve(graph(lambda x: x, lambda x: 1.0), [0.0], 0.0, (0.0, 1.0), events=[event])
    assert curve.events == ()


def test_several_events_in_one_step_are_in_order():
    events = [Crossing(lambda x, p, k=k: x[0] - k, name=f"at {k}") for k in (0.512, 0.51, 0.511)]
    curve = trace_curve(graph(lambda x: x, lambda x: 1.0), [0.0], 0.0, (0.0, 1.0), events=events)
    assert [event.kind for event in curve.events] == ["at 0.51", "at 0.511", "at 0.512"]
    assert np.all(np.diff(curve.parameter) > 0)


def test_event_between_start_and_both_ends_is_found_backwards_too():
    event = Crossing(lambda x, p: x[0] - 0.25, name="behind")
    curve = trace_curve(graph(lambda x: x, lambda x: 1.0), [0.5], 0.5, (0.0, 1.0), events=[event])
    (found,) = curve.named("behind")
    assert found.parameter == pytest.approx(0.25, abs=1e-14)
    assert curve.parameter[found.index] == found.parameter
    assert found.point.tangent_parameter > 0
    assert np.all(np.diff(curve.parameter) > 0)


def test_own_event_class_and_curve_of_many_unknowns():
    class Height(Event):
        name = "height"

        def value(self, point):
            return float(point.x.max()) - 2.0

    curve = trace_curve(Bratu(100), np.zeros(100), 0.0, (0.0, 4.0), Options(edge_tolerance=0.1), events=[Height()])
    (event,) = curve.named("height")
    assert event.x.max() == pytest.approx(2.0, abs=1e-12)
    assert np.abs(Bratu(100).residual(event.x, event.parameter)).max() < 1e-8


def test_an_event_that_finds_its_own_happenings():
    """Passages of the spiral's angle through multiples of 5π/12, counted at the ends of a step instead of by signs."""

    class Ticks(Event):
        name = "tick"

        def value(self, point):
            return math.remainder(math.atan2(point.x[1], point.x[0]), 2 * math.pi)

        def happenings(self, segment, previous, options):
            begin = segment.begin.parameter / SPACING
            turned = math.remainder(self.value(segment.end) - self.value(segment.begin), 2 * math.pi) / SPACING
            found = []
            for k in range(math.floor(begin) + 1, math.floor(begin + turned) + 1):
                share = (k - begin) / turned
                point, _ = point_on(segment, share, options)
                found.append(Happening(share, EventPoint(point, 1e-3, 1e-3, name=self.name), terminal=k == 7))
            return found

    curve = trace_curve(Spiral(), [1.0, 0.0], 0.0, (0.0, 10.0), Options(largest_parameter_step=0.3), events=[Ticks()])
    assert [e.parameter for e in curve.named("tick")] == pytest.approx(SPACING * np.arange(1, 8), abs=1e-2)
    assert curve.outcome is Outcome.STOPPED_AT_EVENT


def test_failing_event_keeps_the_part_traced():
    def fails(x, p):
        if p > 0.5:
            raise ValueError("not there")
        return 1.0

    curve = trace_curve(graph(lambda x: x, lambda x: 1.0), [0.0], 0.0, (0.0, 1.0), events=[Crossing(fails)])
    assert curve.outcome is Outcome.EVALUATION_FAILED
    assert "not there" in curve.message
    assert 0.4 < curve.parameter[-1] <= 0.5


@pytest.mark.parametrize(("width", "aside"), [(0.1, 0), (0.01, 0), (1e-4, 0), (0.02, 10), (0.01, 10), (1e-4, 10)])
def test_three_zeros_within_a_step(width, aside):
    """A crossing hides no pair, neither around it nor beside it."""
    middle, other = 0.437, 0.437 + aside * width
    zeros = [middle, other - width, other + width]

    def cubic(x, p):
        return (p - zeros[0]) * (p - zeros[1]) * (p - zeros[2])

    curve = trace_curve(graph(lambda p: p, lambda p: 1.0), [0.0], 0.0, (0.0, 1.0), events=[Crossing(cubic, "zero")])
    assert [one.parameter for one in curve.named("zero")] == pytest.approx(sorted(zeros), abs=1e-12)
