"""What people call: plain functions, checks at the first call, limits, callbacks, diagrams, tables, files."""

from __future__ import annotations

import math
import sys

import numpy as np
import pytest
from continuation_problems import Bratu, circle, pitchfork
from matplotlib.figure import Figure
from scipy import sparse
from scipy.sparse.linalg import LinearOperator

import contbranch as cb
from contbranch.continuation import (
    BranchPoint,
    Crossing,
    Outcome,
    Problem,
    StopAt,
    load_curve,
    other_solutions,
    switch_branch,
    trace_curve,
    trace_folds,
)
from contbranch.errors import InputError, ModelError


def cubic(x, p):
    """An S with folds at x = ∓1, p = ±2."""
    return p + x**3 - 3 * x


class Cubic(Problem):
    def residual(self, x, p):
        return cubic(x, p)


def brackets(x, p):
    """Two equations, as a list."""
    return [p - x[0] ** 2, x[1] - x[0]]


def test_a_function_and_a_problem_give_the_same_curve():
    one = trace_curve(cubic, [-2.5], 8.125, (-10.0, 10.0))
    other = trace_curve(Cubic(), [-2.5], 8.125, (-10.0, 10.0))
    assert one.status == "complete"
    assert sorted(fold.parameter for fold in one.folds) == pytest.approx([-2.0, 2.0], abs=1e-12)
    assert np.array_equal(one.x, other.x)


@pytest.mark.parametrize("x0", [-2.5, [-2.5], np.array([-2.5])])
@pytest.mark.parametrize("returned", [lambda v: v[0], lambda v: list(v), lambda v: np.array(v), lambda v: tuple(v)])
def test_one_equation_may_return_a_number(x0, returned):
    curve = trace_curve(
        lambda x, p: returned(cubic(x, p)), x0, 8.125, (-10.0, 10.0), jacobian=lambda x, p: 3 * x**2 - 3
    )
    assert len(curve.folds) == 2
    assert curve.x.shape == (len(curve.points), 1)


@pytest.mark.parametrize(
    "make",
    [np.array, list, sparse.csr_array, sparse.csc_matrix, sparse.coo_array, lambda m: LinearOperator((2, 2), m.dot)],
)
def test_jacobians_of_every_kind(make):
    calls = []

    def jacobian(x, p):
        calls.append(p)
        return make(np.array([[-2 * x[0], 0.0], [-1.0, 1.0]]))

    def slope(x, p):
        return [1.0, 0.0]

    curve = trace_curve(brackets, [1.0, 1.0], 1.0, (-1.0, 2.0), jacobian=jacobian, parameter_derivative=slope)
    (fold,) = curve.folds
    assert abs(fold.parameter) < 1e-12
    assert calls


class Duck:
    def residual(self, x, p):
        return p - x


@pytest.mark.parametrize(
    ("wrong", "said"), [(Cubic, "Cubic(...)"), (Duck, "Duck(...)"), (Duck(), "Problem"), (3.0, "3.0"), ("f", "'f'")]
)
def test_what_is_no_function_is_refused_at_once(wrong, said):
    for use in (
        lambda: trace_curve(wrong, [0.0], 0.0, (-1.0, 1.0)),
        lambda: other_solutions(wrong, 0.0, [], [[0.0]]),
    ):
        with pytest.raises(TypeError) as refused:
            use()
        assert said in str(refused.value)


def test_derivatives_belong_to_functions():
    with pytest.raises(TypeError, match="own methods"):
        trace_curve(Cubic(), [-2.5], 8.125, (-10.0, 10.0), jacobian=lambda x, p: 3 * x**2 - 3)


def column(x, p):
    return np.array(brackets(x, p))[:, None]


@pytest.mark.parametrize(
    ("f", "how", "said"),
    [
        (column, {}, r"^f has the shape \(2, 1\): return \(2,\).*ravel"),
        (lambda x, p: [p], {}, r"\(1,\).*\(2,\)"),
        (lambda x, p: p - x[0], {}, r"the shape \(1,\).*\(2,\)|the shape \(\).*\(2,\)"),
        (brackets, {"jacobian": lambda x, p: np.ones((2, 3))}, r"^jacobian .*\(2, 3\).*\(2, 2\)"),
        (brackets, {"jacobian": lambda x, p: sparse.eye_array(3)}, r"^jacobian .*\(3, 3\).*\(2, 2\)"),
        (brackets, {"parameter_derivative": lambda x, p: [[1.0], [0.0]]}, r"^parameter_derivative .*\(2, 1\).*ravel"),
    ],
)
def test_shapes_are_checked_at_the_first_call(f, how, said):
    with pytest.raises(InputError, match=said):
        trace_curve(f, [1.0, 1.0], 1.0, (-1.0, 2.0), **how)


def test_shapes_of_a_problem_are_checked():
    class Column(Problem):
        def residual(self, x, p):
            return column(x, p)

    with pytest.raises(InputError, match=r"Column\.residual has the shape \(2, 1\)"):
        trace_curve(Column(), [1.0, 1.0], 1.0, (-1.0, 2.0))


def test_complex_numbers_are_not_cut():
    curve = trace_curve(lambda x, p: p - np.sqrt(x + 0j), [1.0], 1.0, (0.0, 2.0))
    assert curve.outcome is Outcome.EVALUATION_FAILED
    assert "complex" in curve.message


def test_a_function_may_write_over_its_result_and_its_argument():
    out, matrix = np.empty(1), np.empty((1, 1))

    def f(x, p):
        out[:] = cubic(x, p)
        x[:] = math.nan
        return out

    def jacobian(x, p):
        matrix[:] = 3 * x**2 - 3
        return matrix

    for how in ({}, {"jacobian": jacobian}):
        curve = trace_curve(f, [-2.5], 8.125, (-10.0, 10.0), **how)
        assert sorted(fold.parameter for fold in curve.folds) == pytest.approx([-2.0, 2.0], abs=1e-12)


@pytest.mark.parametrize("part", ["residual", "jacobian", "sparse", "derivative"])
def test_a_problem_that_writes_over_its_result_is_refused(part):
    class Buffer(Problem):
        def __init__(self):
            self.out, self.matrix, self.slope = np.empty(2), np.empty((2, 2)), np.empty(2)
            self.sparse = sparse.csc_array(np.ones((2, 2)))

        def residual(self, x, p):
            target = self.out if part == "residual" else np.empty(2)
            target[:] = brackets(x, p)
            return target

        def jacobian(self, x, p):
            matrix = np.array([[-2 * x[0], 0.0], [-1.0, 1.0]])
            if part == "sparse":
                self.sparse.data[:] = matrix.T.ravel()
                return self.sparse
            if part != "jacobian":
                return matrix
            self.matrix[:] = matrix
            return self.matrix

        def parameter_derivative(self, x, p):
            target = self.slope if part == "derivative" else np.empty(2)
            target[:] = [1.0 + 1e-9 * x[0], 0.0]
            return target

    with pytest.raises(InputError, match=r"Buffer writes .*copy"):
        trace_curve(Buffer(), [1.0, 1.0], 1.0, (-1.0, 2.0))


def test_a_problem_that_is_nothing_but_a_buffer_is_refused():
    class Buffer(Problem):
        out = np.empty(1)

        def residual(self, x, p):
            self.out[:] = p - x
            return self.out

    with pytest.raises(InputError, match="Buffer writes"):
        trace_curve(Buffer(), [0.5], 0.0, (-1.0, 1.0))


def test_a_problem_may_return_a_constant_or_what_it_has_kept():
    class Kept(Problem):
        matrix, slope = -np.eye(1), np.ones(1)
        last = None

        def residual(self, x, p):
            if self.last is None or self.last[0] != (x[0], p):
                self.last = (x[0], p), p - x
            return self.last[1]

        def jacobian(self, x, p):
            return self.matrix

        def parameter_derivative(self, x, p):
            return self.slope

    assert trace_curve(Kept(), [0.5], 0.0, (-1.0, 1.0)).status == "complete"


@pytest.mark.parametrize("direction", ["forward", "backward"])
def test_one_direction(direction):
    whole = trace_curve(cubic, [-2.5], 8.125, (-10.0, 10.0))
    half = trace_curve(cubic, [-2.5], 8.125, (-10.0, 10.0), direction=direction)
    start = [point.label for point in whole.points].index("start")
    expected = whole.points[start:] if direction == "forward" else whole.points[: start + 1]
    assert half.parameter == pytest.approx([point.parameter for point in expected], abs=1e-12)
    left, followed = half.ends if direction == "forward" else half.ends[::-1]
    assert (left.outcome, followed.outcome) == (Outcome.ONE_DIRECTION, Outcome.REACHED_EDGE)
    assert half.status == "complete"
    assert np.all([point.tangent_parameter > 0 for point in half.points if point.label == "start"])


@pytest.mark.parametrize("direction", ["forward", "backward"])
def test_a_closed_curve_in_one_direction(direction):
    curve = trace_curve(circle(), [0.8], 0.6, (-2.0, 2.0), direction=direction)
    assert curve.closed
    assert curve.status == "complete"
    assert len(curve.folds) == 2


def test_an_unknown_direction_is_refused():
    with pytest.raises(InputError, match="'up'"):
        trace_curve(cubic, [-2.5], 8.125, (-10.0, 10.0), direction="up")


def exponential(x, p):
    return p * np.exp(-x) - 1.0


@pytest.mark.parametrize("limit", [1.0, 3.0])
def test_a_limit_of_the_norm_ends_the_curve(limit):
    curve = trace_curve(exponential, [0.0], 1.0, (1.0, math.inf), norm_limit=limit)
    assert curve.ends[1].outcome is Outcome.NORM_LIMIT
    assert "norm" in curve.message
    assert curve.status == "complete"
    assert curve.x[-2, 0] <= limit < curve.x[-1, 0]


def test_a_limit_of_time_ends_the_curve_with_what_there_is():
    def slow(x, p):
        if x[0] > 2.0:
            for _ in range(200_000):
                pass
        return p - np.sin(x)

    curve = trace_curve(slow, [0.0], 0.0, (-2.0, 2.0), time_limit=0.3, direction="forward")
    assert curve.outcome is Outcome.TIME_LIMIT
    assert curve.status == "incomplete"
    assert "time limit" in curve.message
    assert len(curve.points) > 1


def test_a_limit_of_time_before_the_start_is_found():
    curve = trace_curve(exponential, [5.0], 1.0, (1.0, 2.0), time_limit=1e-9)
    assert curve.outcome is Outcome.TIME_LIMIT
    assert curve.points == ()


@pytest.mark.parametrize("name", ["time_limit", "norm_limit"])
@pytest.mark.parametrize("value", [0.0, -1.0, math.nan])
def test_limits_are_positive(name, value):
    with pytest.raises(InputError, match=name):
        trace_curve(cubic, [-2.5], 8.125, (-10.0, 10.0), **{name: value})


def test_the_callback_sees_every_point():
    seen = []
    curve = trace_curve(cubic, [-2.5], 8.125, (-10.0, 10.0), callback=seen.append)
    assert len(seen) == len(curve.points) - 1  # all but the start
    assert sorted(point.parameter for point in [*seen, *[p for p in curve.points if p.label == "start"]]) == sorted(
        curve.parameter
    )
    assert [point.label for point in seen].count("fold") == 2


def test_a_callback_stops_the_curve():
    def enough(point):
        if point.label == "fold":
            raise cb.Stop

    curve = trace_curve(cubic, [-2.5], 8.125, (-10.0, 10.0), callback=enough)
    assert curve.outcome is Outcome.INTERRUPTED
    assert len(curve.folds) == 1


@pytest.mark.parametrize("kind", [ZeroDivisionError, KeyboardInterrupt])
def test_what_a_callback_raises_is_passed_on_with_what_there_is(kind):
    def fails(point):
        if point.label == "fold":
            raise kind

    with pytest.raises(kind) as raised:
        trace_curve(cubic, [-2.5], 8.125, (-10.0, 10.0), callback=fails)
    assert len(raised.value.partial.folds) == 1
    assert raised.value.partial.status == "incomplete"


def pitchfork_at_zero():
    curve = trace_curve(pitchfork(), [0.0], -1.0, (-1.0, 1.0))
    return curve, curve.branch_points[0]


def test_tangents_of_a_branch_point():
    _, point = pitchfork_at_zero()
    (_, along), (across, _) = point.tangents[0], point.tangents[1]
    assert along != 0
    assert abs(across[0]) > 0
    alone = BranchPoint(point.point, 0.0, 0.0)
    assert [len(alone.tangents), alone.tangents[0][1]] == [1, along]


def test_events_stops_and_callbacks_on_the_other_curve():
    curve, point = pitchfork_at_zero()
    seen, level = [], Crossing(lambda x, p: x[0] - 0.5, name="level")
    (branch,) = switch_branch(curve, point, (-1.0, 1.0), events=[level], callback=seen.append)
    (event,) = branch.named("level")
    assert event.parameter == pytest.approx(0.25, abs=1e-12)
    assert branch.points[event.index] is event.point
    assert len(seen) >= len(branch.points) - 3
    high = StopAt(predicate=lambda one: abs(one.x[0]) > 0.6)
    (branch,) = switch_branch(curve, point, (-1.0, 1.0), stop=high)
    assert [end.outcome for end in branch.ends] == [Outcome.STOPPED_BY_PREDICATE] * 2
    (branch,) = switch_branch(curve, point, (-1.0, 1.0), norm_limit=0.6)
    assert [end.outcome for end in branch.ends] == [Outcome.NORM_LIMIT] * 2
    (branch,) = switch_branch(curve, point, (-1.0, 1.0), time_limit=1e-9)
    assert branch.outcome is Outcome.TIME_LIMIT


def test_what_a_callback_raises_on_the_other_curve():
    def fails(point):
        if abs(point.x[0]) > 0.5:
            raise ZeroDivisionError

    curve, point = pitchfork_at_zero()
    with pytest.raises(ZeroDivisionError) as raised:
        switch_branch(curve, point, (-1.0, 1.0), callback=fails)
    (branch,) = raised.value.partial
    assert branch.status == "incomplete"


def family(q):
    return lambda x, p: p + q * x - x**3 / 3


def test_events_stops_and_callbacks_on_a_curve_of_folds():
    fold = trace_curve(family(1.0), [-3.0], 6.0, (-6.0, 6.0)).folds[0]
    seen, level = [], Crossing(lambda z, q: z[1] - 0.5, name="p = 1/2")
    folds = trace_folds(family, fold, 1.0, (-0.5, 2.0), events=[level], callback=seen.append)
    (event,) = folds.curve.named("p = 1/2")
    assert event.parameter == pytest.approx(0.75 ** (2 / 3), abs=1e-9)  # p = 2/3 q^(3/2)
    assert len(folds.cusps) == 1
    assert len(seen) == len(folds.curve.points) - 1
    forward = trace_folds(family, fold, 1.0, (-0.5, 2.0), direction="forward")
    assert not forward.cusps
    assert list(forward.q) == sorted(forward.q)
    ended = trace_folds(family, fold, 1.0, (-0.5, 2.0), stop=StopAt(predicate=lambda point: point.parameter > 1.5))
    assert Outcome.STOPPED_BY_PREDICATE in [end.outcome for end in ended.curve.ends]
    late = trace_folds(family, fold, 1.0, (-0.5, 2.0), time_limit=1e-9)
    assert late.curve.outcome is Outcome.TIME_LIMIT


def test_a_family_that_gives_something_else_is_refused():
    fold = trace_curve(family(1.0), [-3.0], 6.0, (-6.0, 6.0)).folds[0]
    with pytest.raises(TypeError, match="function"):
        trace_folds(lambda q: q, fold, 1.0, (-0.5, 2.0))


@pytest.mark.parametrize("jacobian", [None, lambda x, p: 3 * x**2 - 3])
def test_other_solutions(jacobian):
    """x³ − 3 x + p at p = 0: 0 and ±√3."""
    found = other_solutions(cubic, 0.0, [[0.0]], [[0.5], [-0.5]], jacobian=jacobian)
    assert sorted(float(x[0]) for x in found) == pytest.approx([-math.sqrt(3), math.sqrt(3)], abs=1e-9)
    assert other_solutions(Cubic(), 0.0, [[0.0], *found], [[0.5], 2.0]) == []
    assert len(other_solutions(cubic, 0.0, [], [3.0, -3.0, 0.1])) == 3


def s_shaped():
    return trace_curve(cubic, [-2.5], 8.125, (-10.0, 10.0), stability=True)


def dashed(axes):
    return [line for line in axes.lines if line.get_linestyle() == "--"]


def test_a_plot_follows_the_curve_between_its_points():
    """The cubic through points and tangents is far closer to it than its chords; ends of the parts are events."""
    curve = s_shaped()
    figure = curve.plot()
    assert isinstance(figure, Figure)
    (axes,) = figure.axes
    assert (axes.get_xlabel(), axes.get_ylabel()) == ("p", "x[0]")
    parts = [line for line in axes.lines if line.get_linestyle() in ("-", "--") and len(line.get_xdata())]
    p, x = np.concatenate([line.get_xydata() for line in parts]).T
    assert np.abs(cubic(x, p)).max() < 0.1
    chords = (curve.x[1:, 0] + curve.x[:-1, 0]) / 2, (curve.parameter[1:] + curve.parameter[:-1]) / 2
    assert np.abs(cubic(*chords)).max() > 10 * np.abs(cubic(x, p)).max()
    ends = [p for line in dashed(axes) for p in line.get_xdata()[[0, -1]]]
    assert sorted(ends) == pytest.approx([-10.0, -2.0, 2.0, 10.0])
    assert {text.get_text() for text in axes.get_legend().get_texts()} == {"unstable", "fold"}


def test_several_curves_in_one_diagram():
    trivial = trace_curve(pitchfork(), [0.0], -1.0, (-1.0, 1.0), stability=True)
    (branch,) = switch_branch(trivial, trivial.branch_points[0], (-1.0, 1.0), stability=True)
    axes = Figure().add_subplot()
    axes.set_xlabel("λ")
    assert trivial.plot(ax=axes, label="trivial") is axes.figure
    branch.plot(ax=axes, color="red", linewidth=3)
    assert axes.get_xlabel() == "λ"
    labels = [text.get_text() for text in axes.get_legend().get_texts()]
    assert sorted(labels) == ["branch point", "trivial", "unstable"]
    assert len(dashed(axes)) == 1
    thick = [line for line in axes.lines if line.get_linewidth() == 3]
    assert {line.get_color() for line in thick} == {"red"}
    assert {line.get_linestyle() for line in thick} == {"-"}


class Watched(Problem):
    def residual(self, x, p):
        return cubic(x, p)

    def observables(self, x, p):
        return {"square": float(x[0] ** 2)}


def test_quantities_of_a_plot():
    curve = trace_curve(Watched(), [-2.5], 8.125, (-10.0, 10.0))
    (axes,) = curve.plot(x=0, y=lambda x, p: 2 * p).axes
    assert axes.get_xlabel() == "x[0]"
    drawn = max(axes.lines, key=lambda line: len(line.get_xdata())).get_xydata()
    assert drawn[0] == pytest.approx([curve.x[0, 0], 2 * curve.parameter[0]])
    assert len(drawn) > 10 * len(curve.points)
    (axes,) = curve.plot(y="square").axes
    drawn = max(axes.lines, key=lambda line: len(line.get_xdata())).get_xydata()
    assert sorted(set(drawn[:, 1])) == pytest.approx(sorted(set(curve.x[:, 0] ** 2)))
    with pytest.raises(KeyError):
        curve.plot(y="nothing")


def test_a_plot_of_a_curve_without_points():
    curve = trace_curve(lambda x, p: math.nan, 1.0, 0.0, (0.0, 1.0))
    assert not curve.points
    assert isinstance(curve.plot(), Figure)


def test_a_table_of_the_points():
    curve = trace_curve(Watched(), [-2.5], 8.125, (-10.0, 10.0), stability=True)
    assert all(curve.points[event.index] is event.point for event in curve.events)
    table = curve.to_dataframe()
    assert list(table.columns) == ["parameter", "x[0]", "square", "unstable", "event"]
    assert list(table["parameter"]) == list(curve.parameter)
    assert list(table["square"]) == list(curve.x[:, 0] ** 2)
    assert [table["event"][fold.index] for fold in curve.folds] == ["fold", "fold"]
    assert list(trace_curve(cubic, [-2.5], 8.125, (-10.0, 10.0)).to_dataframe().columns) == [
        "parameter",
        "x[0]",
        "event",
    ]


def test_a_table_without_pandas(monkeypatch):
    monkeypatch.setitem(sys.modules, "pandas", None)
    with pytest.raises(InputError, match=r"contbranch\[tables\]"):
        s_shaped().to_dataframe()


def same(one, other):
    """Whether two curves have the same numbers."""
    assert np.array_equal(one.x, other.x)
    assert np.array_equal(one.parameter, other.parameter)
    assert [point.label for point in one.points] == [point.label for point in other.points]
    assert [dict(point.observables) for point in one.points] == [dict(point.observables) for point in other.points]
    assert [point.determinant_sign for point in one.points] == [point.determinant_sign for point in other.points]
    assert (one.status, one.message, one.closed, one.outcome) == (
        other.status,
        other.message,
        other.closed,
        other.outcome,
    )
    for a, b in zip(one.events, other.events, strict=True):
        assert type(a) is type(b)
        assert (a.kind, a.parameter, a.error, a.state_error, a.index) == (
            b.kind,
            b.parameter,
            b.error,
            b.state_error,
            b.index,
        )
    for a, b in ((one.unstable, other.unstable), (one.eigenvalues, other.eigenvalues)):
        assert (a is None) == (b is None)
        assert a is None or np.array_equal(a, b)


def test_a_file_has_the_whole_curve(tmp_path):
    for curve in (
        trace_curve(Watched(), [-2.5], 8.125, (-10.0, 10.0), stability=True),
        trace_curve(circle(), [0.8], 0.6, (-2.0, 2.0), events=[Crossing(lambda x, p: p, name="zero")]),
        trace_curve(Bratu(20), np.zeros(20), 0.0, (0.0, 4.0)),
        trace_curve(lambda x, p: math.nan, 1.0, 0.0, (0.0, 1.0)),
        pitchfork_at_zero()[0],
    ):
        curve.save(tmp_path / "curve.npz")
        again = load_curve(str(tmp_path / "curve.npz"))
        same(curve, again)
        for event in again.events:
            assert again.points[event.index] is event.point
        for one, other in zip(curve.folds, again.folds, strict=True):
            assert np.array_equal(one.null_vector, other.null_vector)
            assert one.curvature == other.curvature
        for one, other in zip(curve.branch_points, again.branch_points, strict=True):
            assert (one.type, one.scales) == (other.type, other.scales)
            assert all(np.array_equal(a[0], b[0]) for a, b in zip(one.tangents, other.tangents, strict=True))
        assert isinstance(again.plot(), Figure)
        assert len(again.to_dataframe()) == len(curve.points)


def test_a_curve_from_a_file_has_no_equations(tmp_path):
    pitchfork_at_zero()[0].save(tmp_path / "curve.npz")
    curve = load_curve(tmp_path / "curve.npz")
    with pytest.raises(ModelError, match="trace it again"):
        switch_branch(curve, curve.branch_points[0], (-1.0, 1.0))


@pytest.mark.parametrize("content", [None, b"", b"p,x\n1,2\n", "arrays", "damaged"])
def test_what_is_no_file_of_a_curve(content, tmp_path):
    path = tmp_path / "curve.npz"
    if content == "arrays":
        np.savez(path, x=np.ones(3))
    elif content == "damaged":
        s_shaped().save(path)
        path.write_bytes(path.read_bytes()[:-200])
    elif content is not None:
        path.write_bytes(content)
    with pytest.raises(InputError, match=r"curve\.npz"):
        load_curve(path)
