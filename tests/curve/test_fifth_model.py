"""A model that the package does not know: a parabola on an elastic foundation, w = p/k at each radius.

With k stiffer than the law every element has one gap for its height, and an element of height g0 = r²/(2R) − d takes
the area 2πR dg0. So F(d) = 2πR ∫ p dg0 from g0 = −d on, dF/dd = 2πR p(apex): the load folds where the pressure at the
apex vanishes, at F = 2πR v(g) with v the energy per area at the gap there, and a spring's where it is −K/(2πR).
"""

import math
from dataclasses import dataclass

import matplotlib.pyplot as plt
import numpy as np
import pytest
from scipy.integrate import quad
from scipy.optimize import brentq

import contbranch as cb
from contbranch.curve.problem import EquilibriumProblem, Rates, Succession, Values, Work, oriented
from contbranch.results.profile import Profile

STIFFNESS, RING = 40.0, 2 * math.pi
# Long-ranged repulsion, short-ranged attraction: the film squeezes out while it repels, and the contact wets again.
FAR, NEAR, REACH, SHORT = 2 / 3, 1 / 3, 1.0, 0.25


class Film(EquilibriumProblem):
    """Displacement w of the apex against the far field's, from first touch on (p = 0): k w = p(w − d), or w = d."""

    def __init__(self, contact, touching=False):
        self.contact, self.law, self.touching = contact, contact.interaction, touching
        self.area, self.scale, self.work = RING * contact.tip.radius, 1.0, Work(unknowns=1)
        self.touch = float(self.law.evaluate(0.0).pressure) / STIFFNESS

    @property
    def parameter_range(self):
        return (0.0, math.inf) if self.touching else (-math.inf, 0.0)

    def apex(self, x, p):
        """Gap and response there."""
        gap = 0.0 if self.touching else x[0] - p - self.touch
        return gap, self.law.evaluate(gap)

    def residual(self, x, p):
        return x - (p + self.touch if self.touching else self.apex(x, p)[1].pressure / STIFFNESS)

    def jacobian(self, x, p):
        return np.array([[1.0 if self.touching else 1.0 - self.slope(x, p)]])

    def parameter_derivative(self, x, p):
        return np.array([-1.0 if self.touching else self.slope(x, p)])

    def slope(self, x, p):
        return -self.apex(x, p)[1].stiffness / STIFFNESS

    def start(self, control):
        far = self.law.reach(1e-12)
        x = np.array([float(self.law.evaluate(far).pressure) / STIFFNESS])
        return oriented(self, x, x[0] - far - self.touch, (np.zeros(1), 1.0))

    def before(self, control, value):
        return None

    def values(self, x, p):
        gap, here = self.apex(x, p)
        load = self.area * float(here.energy + STIFFNESS * x[0] ** 2 / 2)
        radius = math.sqrt(2 * self.contact.tip.radius * max(p, 0.0)) if self.touching else 0.0
        return Values(load, p + self.touch, radius, float(gap), self.energy(float(gap), max(p, 0.0)))

    def energy(self, gap, pressed):
        """∫ F dd: in closed form for exponentials, whose products are exponentials."""
        work = [(-t.work_of_adhesion * math.exp(-gap / t.range), 1 / t.range) for t in self.law.terms]
        v, p = sum(w for w, _ in work), sum(w * q for w, q in work)
        tail = sum(w / q for w, q in work)
        squares = sum(a * s * b * t / (s + t) for a, s in work for b, t in work)
        apart = tail + v * p / STIFFNESS - squares / (2 * STIFFNESS) + p**3 / (6 * STIFFNESS**2)
        d = self.touch + pressed
        return self.area * (apart + v * pressed + STIFFNESS * (d**3 - self.touch**3) / 6)

    def rates(self, x, p, x_rate, p_rate):
        gap = 0.0 if self.touching else x_rate[0] - p_rate
        radius = self.values(x, p).contact_radius
        spread = self.contact.tip.radius * p_rate / radius if radius > 0 else math.inf if self.touching else 0.0
        return Rates(self.area * STIFFNESS * x[0] * p_rate, p_rate, spread, gap)

    def unstable(self, x, p):
        return 0

    def profile(self, x, p):
        gaps = np.append(np.zeros(20 * self.touching), self.apex(x, p)[0] + np.geomspace(1e-9, 5.0, 200))
        own = np.asarray(self.law.evaluate(gaps).pressure)
        r = np.sqrt(2 * self.contact.tip.radius * np.maximum(gaps - own / STIFFNESS + p + self.touch, 0.0))
        wall = np.zeros_like(r)
        if self.touching:
            r[:20] = np.linspace(0.0, self.values(x, p).contact_radius, 20)
            wall[:20] = STIFFNESS * (p - r[:20] ** 2 / (2 * self.contact.tip.radius))
        return Profile(r, gaps, own + wall, wall)

    def successor(self, name, points):
        contact = Film(self.contact, True)
        start = oriented(contact, np.array([self.touch]), 0.0, (np.zeros(1), 1.0))
        return None if self.touching else Succession("touch", points[-1], (start,))

    def member(self, contact, tolerance=None):
        return Film(contact, self.touching)


@dataclass(frozen=True)
class Foundation:
    name = "foundation"

    def problem(self, contact, accuracy):
        return Film(contact)


def contact(reach=REACH):
    law = cb.Exponential(-FAR, reach) + cb.Exponential(NEAR, SHORT)
    return cb.Contact(tip=cb.Parabola(1.0), interaction=law, modulus=1.0)


def v(g, reach=REACH):
    return FAR * math.exp(-g / reach) - NEAR * math.exp(-g / SHORT)


def p(g, reach=REACH):
    return FAR / reach * math.exp(-g / reach) - NEAR / SHORT * math.exp(-g / SHORT)


def rest(reach=REACH):
    """The gap without pressure."""
    return math.log(NEAR / SHORT / FAR * reach) / (1 / SHORT - 1 / reach)


def load(d):
    """F(d) from the local law by quadrature over the heights."""
    pressure = lambda h: STIFFNESS * -h if h < -p(0) / STIFFNESS else p(brentq(lambda g: g - p(g) / STIFFNESS - h, 0, 60))  # noqa: E731
    return RING * quad(pressure, -d, 40, epsabs=1e-12, limit=400, points=(-p(0) / STIFFNESS, 0.5, 2, 6))[0]


@pytest.fixture(scope="module")
def diagram():
    return cb.trace(contact(), model=Foundation(), control=cb.Spring(2.0), accuracy=1e-10)


def test_traced_with_exact_folds_and_indices(diagram):
    assert (diagram.status, diagram.model.kind) == ("complete", "foundation")
    squeezed, wetted = list(diagram.folds("load"))
    assert (squeezed.name, squeezed.load, squeezed.displacement, squeezed.central_gap) == pytest.approx(
        ("squeeze-out", RING * v(rest()), -rest(), rest()), abs=1e-9)
    assert (wetted.name, wetted.load, wetted.displacement) == pytest.approx(("wetting", RING * v(0), 0.0), abs=1e-9)
    assert wetted.contact_radius == pytest.approx(math.sqrt(-2 * p(0) / STIFFNESS), abs=1e-9)
    touch = next(event for event in diagram.events if event.kind == "touch")
    assert touch.displacement == pytest.approx(p(0) / STIFFNESS, abs=1e-12)
    held = brentq(lambda g: RING * p(g) + 2.0, 0.0, rest(), xtol=1e-15)
    spring = RING * (v(held) + p(held) ** 2 / 2 / STIFFNESS), p(held) / STIFFNESS - held
    known = [spring, (RING * (v(0) + 2 / RING * 2 / RING / 2 / STIFFNESS), -2 / RING / STIFFNESS)]
    for event, (force, d) in zip(list(diagram.folds("spring")), known, strict=True):
        assert (event.load, event.displacement) == pytest.approx((force, d), abs=1e-9)
    assert not list(diagram.folds("displacement"))
    branch = diagram.branches[0]
    inside = (branch.displacement > -rest()) & (branch.displacement < 0.0)
    others = np.setdiff1d(np.arange(len(inside)), [int(event.position) for event in diagram.events])
    np.testing.assert_array_equal(branch.unstable_load[others], inside[others])
    assert not np.any(branch.unstable_displacement)
    assert branch.load[::7] == pytest.approx([load(d) for d in branch.displacement[::7]], abs=1e-8)


def test_solved_and_all_found(diagram):
    state = cb.solve(contact(), displacement=-0.1, model=Foundation())
    assert (state.load, state.profile.gap[0]) == pytest.approx((load(-0.1), state.central_gap), abs=1e-8)
    found = cb.find_all(contact(), load=2.3, model=Foundation())
    assert [load(s.displacement) for s in found.states] == pytest.approx([2.3] * 3, abs=1e-8)
    assert [s.unstable_load for s in found.states] == [0, 1, 0]


def test_looped():
    loop = cb.hysteresis(contact(), model=Foundation(), accuracy=1e-9)
    squeezed, wetted = RING * v(rest()), RING * v(0)
    ahead = math.sqrt(2 * (v(rest()) - v(0)) / STIFFNESS)
    behind = brentq(lambda d: load(d) - wetted, -3, -rest())
    assert [j.to.displacement for j in loop.jumps] == pytest.approx([ahead, behind], abs=1e-7)
    lost = squeezed * (ahead + rest()) - quad(load, -rest(), ahead, points=(p(0) / STIFFNESS,))[0]
    assert loop.jumps[0].dissipated == pytest.approx(lost, abs=1e-6)
    assert not cb.hysteresis(contact(), model=Foundation(), control="displacement").jumps


def test_followed(diagram):
    followed = cb.follow(next(diagram.folds("load")), vary="interaction[1].range", to=2.0)
    assert followed.status == "complete"
    for reach, force, d in zip(*(followed.curve[k] for k in ("interaction[1].range", "load", "displacement")), strict=True):
        assert (force, d) == pytest.approx((RING * v(rest(reach), reach), -rest(reach)), abs=1e-9)


def test_drawn_saved_and_loaded(diagram, tmp_path):
    plt.close(diagram.plot(x="load", y="central_gap"))
    diagram.save(tmp_path / "foundation.h5")
    assert cb.load(tmp_path / "foundation.h5") == diagram
