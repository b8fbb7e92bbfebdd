"""Folds and Morse indices of all controls from one angle, on random curves whose folds are known beforehand.

The slopes F' and d' are polynomials with given roots: a fold of load or displacement is where it was put, that of a
spring is a root of F' + K d', computed to 40 digits. The index at fixed displacement is counted by Poincaré's rule,
fold by fold, and a spring adds one where dF/dd + K < 0; neither knows an angle.
"""

from dataclasses import dataclass
from functools import cache, cached_property
from itertools import pairwise

import mpmath
import numpy as np
import pytest

from contbranch.control import DISPLACEMENT, LOAD, Control
from contbranch.curve.angle import Turning
from contbranch.curve.events import FoldEvent
from contbranch.curve.problem import EquilibriumProblem, Rates, Succession, Values, Work, oriented
from contbranch.curve.refine import refine
from contbranch.curve.trace import Request, trace
from contbranch.results.profile import Profile

SPRINGS = tuple(Control("spring", stiffness) for stiffness in (0.01, 0.3, 1.0, 4.0, 200.0))
# Folds of one control keep a distance from each other; directions at the ends of arcs, from those of folds.
APART, CLEAR = 2e-3, 0.02
# Folds of different controls are told apart if their places differ by more than some roundings.
ROUNDED = 4e-15


@dataclass(frozen=True)
class Slope:
    """A polynomial given by its leading coefficient and its roots; its signs are exact."""

    lead: float
    roots: tuple[float, ...]

    def __call__(self, s):
        value = self.lead
        for root in self.roots:
            value *= s - root
        return value

    @cached_property
    def polynomial(self):
        return np.polynomial.Polynomial(self.lead * np.polynomial.polynomial.polyfromroots(self.roots))

    @cached_property
    def integral(self):
        return self.polynomial.integ()


@dataclass(frozen=True)
class Arc:
    """A smooth part of a curve: the slopes of load and displacement over a parameter from 0 to 1."""

    load: Slope
    displacement: Slope

    def along(self, control, s):
        return control.weighted(self.load(s), self.displacement(s))

    @cached_property
    def turning_points(self):
        """Folds of the displacement, and by how much the index changes there: up where dF/dd goes from −∞ to +∞."""
        places = sorted(root for root in self.displacement.roots if 0 < root < 1)
        return [
            (s, 1 if self.load(s) * (self.displacement(s + 1e-14) - self.displacement(s - 1e-14)) > 0 else -1)
            for s in places
        ]

    @cache  # noqa: B019
    def folds(self, control):
        """All roots of F' + K d', complex ones included."""
        if control.kind != "spring":
            return list((self.load if control.kind == "load" else self.displacement).roots)
        sum_ = self.load.polynomial + control.stiffness * self.displacement.polynomial
        with mpmath.workdps(40):
            return [
                float(mpmath.findroot(lambda s: self.load(s) + control.stiffness * self.displacement(s), z.real))
                if abs(z.imag) < 1e-6
                else complex(z)
                for z in sum_.roots()
            ]

    def is_clear(self, control):
        """Whether its folds can be told from each other, and lie off the ends."""
        near = [z for z in self.folds(control) if -0.2 < z.real < 1.2]
        gaps = [abs(a - b) for k, a in enumerate(near) for b in near[:k]]
        lonely = all(gap > APART for gap in gaps)
        return lonely and all(abs(sine(self, control, s)) > CLEAR for s in (0.0, 1.0))


def sine(arc, control, s):
    """Sine of the angle between (d', F') and the direction of a control's folds."""
    return arc.along(control, s) / np.hypot(arc.load(s), arc.displacement(s))


def turn(before, after):
    """Sine and cosine of the turn in the corner between two arcs, positive against the clock."""
    (d, f), (e, g) = ((arc.displacement(s), arc.load(s)) for arc, s in ((before, 1.0), (after, 0.0)))
    size = np.hypot(d, f) * np.hypot(e, g)
    return (d * g - f * e) / size, (d * e + f * g) / size


class Drawn(EquilibriumProblem):
    """One arc of a curve."""

    parameter_range = (0.0, 1.0)

    def __init__(self, arcs, number, origin, index):
        self.arcs, self.number, self.origin, self.index = arcs, number, origin, index
        self.arc, self.scale, self.work = arcs[number], 1.0, Work()

    def residual(self, x, p):
        return x - p

    def jacobian(self, x, p):
        return np.eye(1)

    def start(self, control):
        return oriented(self, np.zeros(1), 0.0, (np.ones(1), 1.0))

    def values(self, x, p):
        return Values(
            self.origin[0] + self.arc.load.integral(p),
            self.origin[1] + self.arc.displacement.integral(p),
            0.0,
            1.0,
            0.0,
        )

    def rates(self, x, p, x_rate, p_rate):
        return Rates(p_rate * self.arc.load(p), p_rate * self.arc.displacement(p), 0.0, 0.0)

    def unstable(self, x, p):
        return self.index + sum(change for s, change in self.arc.turning_points if s < p)

    def profile(self, x, p):
        return Profile(*np.zeros((4, 1)))

    def successor(self, name, points):
        if self.number + 1 == len(self.arcs):
            return None
        following = self.arcs[self.number + 1]
        index = self.unstable(points[-1].x, 1.0)
        if self.arc.displacement(1.0) * following.displacement(0.0) < 0:
            index += 1 if turn(self.arc, following)[0] < 0 else -1
        origin = self.values(points[-1].x, 1.0)[:2]
        return Succession("", points[-1], (Drawn(self.arcs, self.number + 1, origin, index).start(LOAD),))


def drawn(arcs):
    """The first problem of a curve; its index starts so high that it is never negative."""
    lowest, problem = 0, Drawn(arcs, 0, (0.0, 0.0), 0)
    while True:
        lowest = min(
            lowest, *(problem.unstable(None, s + 1e-15) for s in (0.0, *(s for s, _ in problem.arc.turning_points))), 0
        )
        end = oriented(problem, np.ones(1), 1.0, (np.ones(1), 1.0))
        joint = problem.successor("edge", [end])
        if joint is None:
            return Drawn(arcs, 0, (0.0, 0.0), -lowest)
        problem = joint.starts[0].problem


def expected(arcs, controls):
    """Folds in order along the curve: (number of the arc + place, control)."""
    found = []
    for number, arc in enumerate(arcs):
        if number:
            before = arcs[number - 1]
            passed = []
            for control in controls:
                u, v = before.along(control, 1.0), arc.along(control, 0.0)
                u, v = (
                    u / np.hypot(before.load(1.0), before.displacement(1.0)),
                    v / np.hypot(arc.load(0.0), arc.displacement(0.0)),
                )
                if u * v < 0:  # the chord between the two directions crosses that of the folds at this share
                    passed.append((u / (u - v), control))
            found += [(float(number), control) for _, control in sorted(passed, key=lambda one: one[0])]
        own = [
            (number + s, control)
            for control in controls
            for s in arc.folds(control)
            if isinstance(s, float) and 0 < s < 1
        ]
        found += sorted(own, key=lambda one: one[0])
    return found


def slope(rng, hairpin):
    """A random slope, with the root of a hairpin."""
    roots = list(rng.uniform(0.03, 0.97, rng.integers(0, 4)))
    if len(roots) > 1 and rng.random() < 0.5:  # a cluster, well within one step
        roots[1:] = roots[0] + np.cumsum(10 ** rng.uniform(-2.6, -1.5, len(roots) - 1))
    roots += [*rng.choice([-1, 1], 1) * rng.uniform(1.2, 2.0, 1), *hairpin]
    steepest = max(abs(Slope(1.0, tuple(roots))(s)) for s in np.linspace(0, 1, 33))
    return Slope(float(rng.choice([-1, 1]) * 10 ** rng.uniform(-0.5, 0.5) / steepest), tuple(map(float, roots)))


def random_arcs(rng):
    """One to three arcs whose folds can be told from each other."""
    arcs = []
    for _ in range(rng.integers(1, 4)):
        while True:
            place = rng.uniform(0.1, 0.9, 1 if rng.random() < 0.4 else 0)
            gap = rng.choice([-1, 1]) * 10 ** rng.uniform(-10.5, -9.1)
            arc = Arc(slope(rng, place), slope(rng, place + gap))
            if arcs and turn(arcs[-1], arc)[1] <= np.cos(0.85 * np.pi):
                continue
            if all(arc.is_clear(control) for control in (LOAD, DISPLACEMENT, *SPRINGS)):
                places = sorted(z for c in (LOAD, DISPLACEMENT, *SPRINGS) for z in arc.folds(c) if isinstance(z, float))
                if all(b - a > ROUNDED for a, b in pairwise(places)):
                    break
        arcs.append(arc)
    return arcs


def check(arcs, spring):
    controls = (LOAD, DISPLACEMENT, spring)
    track = trace(drawn(arcs), Request(1e-8, control=spring))
    folds = [mark for mark in track.marks if mark.kind == "fold"]
    known = expected(arcs, controls)
    places = [mark.point.problem.number + mark.point.parameter for mark in folds]
    assert [mark.control.kind for mark in folds] == [control.kind for _, control in known], (places, known)
    for mark, place, (where, control) in zip(folds, places, known, strict=True):
        assert abs(place - where) < 0.02
        if mark.row not in track.onward:
            found = refine(mark.point, FoldEvent(control), 1e-10)
            assert found.point.problem.number + found.point.parameter == pytest.approx(where, abs=2e-9)
    # between two folds every piece has the index that the curve has between their true places
    rows = [0, *(mark.row for mark in folds), len(track.points) - 1]
    ends = [0.0, *(where for where, _ in known), float(len(arcs))]
    first = drawn(arcs)
    for control in controls:
        pieces, rising = track.hodograph.pieces(control)
        level = indices_between(first, ends, control, controls, known)
        for (a, b), (index, sign) in zip(pairwise(rows), level, strict=True):
            assert set(pieces[a:b]) <= {index}, (control, a, b)
            assert set(rising[a:b]) <= {sign}


def indices_between(first, ends, control, controls, known):
    """Index under a control, and the sign of its change, in the middle between neighbouring folds."""
    problems = [first]
    while (
        joint := problems[-1].successor("edge", [oriented(problems[-1], np.ones(1), 1.0, (np.ones(1), 1.0))])
    ) is not None:
        problems.append(joint.starts[0].problem)
    found = []
    for low, high in pairwise(ends):
        middle = (low + high) / 2
        number = min(int(middle), len(problems) - 1)
        problem, s = problems[number], middle - number
        if low == high:
            found.append((0, 0))  # one corner
            continue
        held, own = problem.arc.displacement(s), problem.arc.along(control, s)
        found.append((problem.unstable(None, s) + (held * own < 0), 1 if own > 0 else -1))
    return found


@pytest.mark.parametrize("seed", range(200))
def test_every_fold_is_found_once_in_order_with_its_index(seed):
    rng = np.random.default_rng(seed)
    arcs = random_arcs(rng)
    check(arcs, SPRINGS[seed % 5])


class Corner(Drawn):
    """Two straight arcs of which the second all but comes back; the index there says how the curve turns."""

    def __init__(self, arcs, number, index, change):
        super().__init__(arcs, number, (0.0, 0.0), index)
        self.change = change

    def successor(self, name, points):
        following = Corner(self.arcs, 1, self.index + self.change, 0).start(LOAD)
        return None if self.number else Succession("", points[-1], (following,))


@pytest.mark.parametrize("short", [-0.05, -1e-9, 1e-9, 0.05])
@pytest.mark.parametrize("clockwise", [False, True])
def test_the_index_tells_how_a_curve_turns_back(short, clockwise):
    arcs = [Arc(Slope(np.sin(phi), ()), Slope(np.cos(phi), ())) for phi in (0.3, 0.3 + np.pi + short)]
    spring = SPRINGS[2]
    track = trace(Corner(arcs, 0, 1, 1 if clockwise else -1), Request(1e-8, control=spring))
    kinds = ["load", "spring", "displacement"] if clockwise else ["displacement", "spring", "load"]
    assert [mark.control.kind for mark in track.marks] == kinds
    for turns in track.hodograph.turns.values():
        assert turns[-1] - turns[0] == (-1 if clockwise else 1)
    for control in (LOAD, DISPLACEMENT, spring):
        assert track.hodograph.pieces(control)[0][[0, -1]].tolist() == [1, 2 if clockwise else 0]


@pytest.mark.parametrize("control", [LOAD, DISPLACEMENT, SPRINGS[2]], ids=["load", "displacement", "spring"])
@pytest.mark.parametrize("sense", [1, -1], ids=["forwards", "backwards"])
def test_a_row_before_the_fold_just_left_has_passed_it_once_more(control, sense):
    """On another discretisation a row may come to lie there: no index changes without a fold of its own."""

    def rates(held):
        """Rates of load and displacement with which what is controlled changes at a rate."""
        along = np.array([-1.0, 1.0 / control.stiffness]) if control.stiffness else np.array([0.0, 1.0])
        across = np.array([0.0, 1.0]) if control == DISPLACEMENT else np.array([1.0, 0.0])
        along = np.array([1.0, 0.0]) if control == DISPLACEMENT else along / np.linalg.norm(along)
        assert control.weighted(*along) == pytest.approx(0.0, abs=1e-15)
        return sense * (along + held * across / control.weighted(*across))

    turning = Turning([control], *rates(-0.2))
    assert turning.row(*rates(-0.1)) == []
    turning.fold(control)
    assert turning.row(*rates(-1e-4)) == [control]
    assert turning.row(*rates(-0.1)) == []
    index, rising = turning.hodograph(0).pieces(control)
    np.testing.assert_array_equal(rising, sense * np.array([-1, -1, 1, -1]))
    assert index[0] == index[1] == index[3] != index[2]
