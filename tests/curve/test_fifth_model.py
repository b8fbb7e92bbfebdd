"""A model that the package does not know: a parabola on an elastic foundation, w = p/k at each radius.

With k stiffer than the law every element has one gap for its height g0 = r²/(2R) − d, and takes the area 2πR dg0. So
F(d) = 2πR ∫ p dg0 from g0 = −d on and dF/dd = 2πR p(apex): the load folds where the pressure at the apex vanishes, at
F = 2πR v with v the energy per area at the gap there, and a spring where that pressure is −K/(2πR).
"""

import math

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.optimize import brentq

import contbranch as cb
from contbranch.curve.problem import EquilibriumProblem, Rates, Succession, Values, Work, oriented
from contbranch.results.profile import Profile

K, RING = 40.0, 2 * math.pi


class Film(EquilibriumProblem):
    """Deformation w at the apex for the displacement d behind first touch: k w = p(w − d), in contact w = d."""

    def __init__(self, contact, touching=False):
        self.contact, self.law, self.touching = contact, contact.interaction, touching
        self.radius, self.scale, self.work = contact.tip.radius, self.law.range, Work(unknowns=1)
        self.touch = float(self.law.evaluate(0.0).pressure) / K

    @property
    def parameter_range(self):
        return (0.0, math.inf) if self.touching else (-math.inf, 0.0)

    def gap(self, x, p):
        return 0.0 if self.touching else float(x[0] - p - self.touch)

    def residual(self, x, p):
        return x - (p + self.touch if self.touching else float(self.law.evaluate(self.gap(x, p)).pressure) / K)

    def jacobian(self, x, p):
        return np.array([[1.0 + (0.0 if self.touching else float(self.law.evaluate(self.gap(x, p)).stiffness) / K)]])

    def parameter_derivative(self, x, p):
        return np.array([-1.0]) if self.touching else 1.0 - self.jacobian(x, p)[0]

    def start(self, control):
        x = self.law.evaluate(far := self.law.reach(1e-12)).pressure / K * np.ones(1)
        return oriented(self, x, x[0] - far - self.touch, (np.zeros(1), 1.0))

    def values(self, x, p):
        gap, pressed, d = self.gap(x, p), max(p, 0.0), max(p, 0.0) + self.touch
        work = [(-t.work_of_adhesion * math.exp(-gap / t.range), 1 / t.range) for t in self.law.terms]
        v, pressure = (sum(w * q**k for w, q in work) for k in (0, 1))
        squares = sum(a * s * b * t / (s + t) for a, s in work for b, t in work)
        apart = sum(w / q for w, q in work) + (v * pressure - squares / 2) / K + pressure**3 / (6 * K**2)
        load, energy = v + K * x[0] ** 2 / 2, apart + v * pressed + K * (d**3 - self.touch**3) / 6
        load, energy = (float(RING * self.radius * value) for value in (load, energy))
        return Values(load, float(p) + self.touch, math.sqrt(2 * self.radius * pressed), gap, energy)

    def rates(self, x, p, x_rate, p_rate):
        radius = self.values(x, p).contact_radius
        wider = self.radius / radius if radius > 0 else math.inf if self.touching else 0.0
        return Rates(RING * self.radius * K * x[0] * p_rate, p_rate, wider * p_rate, float(x_rate[0] - p_rate))

    def unstable(self, x, p):
        return 0

    def profile(self, x, p):
        gaps = np.append(np.zeros(20 * self.touching), self.gap(x, p) + np.geomspace(1e-9, 5.0, 200))
        own = np.asarray(self.law.evaluate(gaps).pressure)
        r = np.sqrt(2 * self.radius * np.maximum(gaps - own / K + p + self.touch, 0.0))
        r[gaps == 0.0] = np.linspace(0.0, self.values(x, p).contact_radius, np.count_nonzero(gaps == 0.0))
        wall = np.where(gaps == 0.0, K * (p - r**2 / (2 * self.radius)), 0.0)
        return Profile(r, gaps, own + wall, wall)

    def successor(self, name, points):
        start = oriented(Film(self.contact, True), np.array([self.touch]), 0.0, (np.zeros(1), 1.0))
        return None if self.touching else Succession("touch", points[-1], (start,))

    def member(self, contact, tolerance=None):
        return Film(contact, self.touching)


class Foundation:
    name = "foundation"

    def problem(self, contact, accuracy):
        return Film(contact)


# Repulsion of long range, attraction of short range: p = A e^(−g) − B e^(−4g) for the law's range 1.
LAW, A, B = cb.Exponential(-2 / 3, 1.0) + cb.Exponential(1 / 3, 0.25), 2 / 3, 4 / 3
CONTACT, MODEL = cb.Contact(tip=cb.Parabola(1.0), interaction=LAW, modulus=1.0), Foundation()
REST = math.log(B / A) / 3
EVEN = RING * (A * math.exp(-REST) - B / 4 * math.exp(-4 * REST))
WETTED, TOUCH = RING * (A - B / 4), (A - B) / K


def p(g):
    return A * math.exp(-g) - B * math.exp(-4 * g)


def load(d):
    p_at = lambda h: -K * h if h < -TOUCH else p(brentq(lambda g: g - p(g) / K - h, 0, 60, xtol=1e-14))  # noqa: E731
    return RING * quad(p_at, -d, 40, epsabs=1e-12, limit=400, points=(-TOUCH, 0.5, 2, 6))[0]


@pytest.fixture(scope="module")
def diagram():
    return cb.trace(CONTACT, model=MODEL, control=cb.Spring(2.0), accuracy=1e-10)


def test_traced_with_exact_folds_and_indices(diagram):
    assert (diagram.status, diagram.model.kind, len(diagram.events)) == ("complete", "foundation", 6)
    g = brentq(lambda g: RING * p(g) + 2.0, 0.0, REST, xtol=1e-15)
    spring = RING * (A * math.exp(-g) - B / 4 * math.exp(-4 * g) + p(g) ** 2 / 2 / K), p(g) / K - g
    behind = WETTED + 2 / RING / K, -2 / RING / K
    known = {"load": [(EVEN, -REST), (WETTED, 0.0)], "spring": [spring, behind], "displacement": []}
    for control, places in known.items():
        found = [(event.load, event.displacement) for event in diagram.folds(control)]
        assert np.ravel(found) == pytest.approx(np.ravel(places), abs=1e-9)
    assert [event.name for event in diagram.folds("load")] == ["squeeze-out", "wetting"]
    assert diagram.thresholds["wetting_radius"] == pytest.approx(math.sqrt(-2 * TOUCH), abs=1e-9)
    assert diagram.thresholds["touch_displacement"] == pytest.approx(TOUCH, abs=1e-12)
    branch = diagram.branches[0]
    rows = np.setdiff1d(np.arange(len(branch.load)), [int(event.position) for event in diagram.events])
    d = branch.displacement[rows]
    np.testing.assert_array_equal(branch.unstable_load[rows], (d > -REST) & (d < 0))
    np.testing.assert_array_equal(branch.unstable_spring[rows], (spring[1] < d) & (d < behind[1]))
    assert not np.any(branch.unstable_displacement)
    assert branch.load[rows[::9]] == pytest.approx([load(one) for one in d[::9]], abs=1e-8)


def test_solved_looped_followed_drawn_saved_and_loaded(diagram, tmp_path):
    state = cb.solve(CONTACT, displacement=-0.1, model=MODEL)
    assert (state.load, state.profile.gap[0]) == pytest.approx((load(-0.1), state.central_gap), abs=1e-8)
    found = cb.find_all(CONTACT, load=2.3, model=MODEL).states
    assert [(load(s.displacement), s.unstable_load) for s in found] == [(pytest.approx(2.3), k) for k in (0, 1, 0)]
    out, back = cb.hysteresis(CONTACT, model=MODEL, accuracy=1e-9).jumps
    ahead = math.sqrt(2 * (EVEN - WETTED) / RING / K)
    assert (out.to.displacement, load(back.to.displacement)) == pytest.approx((ahead, WETTED), abs=1e-8)
    assert out.dissipated == pytest.approx(EVEN * (ahead + REST) - quad(load, -REST, ahead)[0], abs=1e-7)
    followed = cb.follow(next(diagram.folds("load")), vary="interaction[1].work_of_adhesion", to=0.6)
    assert followed.status == "complete"
    for work, force in zip(followed.curve["interaction[1].work_of_adhesion"], followed.curve["load"], strict=True):
        g = math.log(4 * work / A) / 3
        assert force == pytest.approx(RING * (A * math.exp(-g) - work * math.exp(-4 * g)), abs=1e-9)
    diagram.plot(x="load", y="central_gap")
    diagram.save(tmp_path / "foundation.h5")
    assert cb.load(tmp_path / "foundation.h5") == diagram


@pytest.mark.parametrize("more", [1e-6, 1e-4, 0.0])
def test_folds_right_behind_first_touch_and_at_it(more):
    """Where both laws pull alike the load is least at first touch; a little more attraction, and a little behind it."""
    law = cb.Exponential(0.8 + more, 1.0) + cb.Exponential(more - 0.2, 0.25)
    contact = cb.Contact(tip=cb.Parabola(1.0), interaction=law, modulus=1.0)
    diagram = cb.trace(contact, model=MODEL, accuracy=1e-9)
    (fold,), branch = diagram.folds("load"), diagram.branches[0]
    assert (diagram.status, diagram.message, fold.name) == ("complete", "", "pull-off")
    assert (fold.load, fold.displacement) == pytest.approx((-RING * (0.6 + 2 * more), 0.0), abs=1e-9)
    assert diagram.thresholds["touch_displacement"] == pytest.approx(-5 * more / K, abs=1e-12)
    assert not np.any(branch.unstable_load[branch.displacement > 1e-8])
    assert np.all(branch.unstable_load[branch.displacement < -1e-4])
    assert cb.hysteresis(contact, model=MODEL, accuracy=1e-9).status == "complete"
