"""Stiff attraction without force at contact: the steep front travels with the mesh, and the limits are JKR's.

Pull-off tends to −3π/2 (K. L. Johnson, K. Kendall, A. D. Roberts, Proc. R. Soc. A 324, 301 (1971)), first touch to the
state of JKR whose central pressure is zero, a³ = π/2 and F = −4π/3 (reduced units).
"""

import math
from itertools import pairwise

import numpy as np
import pytest
from followed import tracked

import contbranch as cb
from contbranch.control import DISPLACEMENT

PULL_OFF, TOUCH = -1.5 * math.pi, -4.0 / 3.0 * math.pi
# (excess of pull-off, of touch) μ_T² over JKR's, measured from μ_T = 12 to 1000: A ln μ_T + B.
LAW = {cb.Gauss: ((0.209, 0.254), (0.276, 0.58)), cb.VanDerWaals: ((0.362, 0.060), (0.475, 0.26))}


class Ramp(cb.Interaction):
    def shape(self, x):
        left = np.maximum(1 - x / 2, 0.0)
        return left**2, -left, np.where(x < 2, 0.5, 0.0)


class Hat(cb.Interaction):
    """A pressure that grows linearly up to x = 1 and falls to zero at x = 2."""

    def shape(self, x):
        near, rest = x < 1, np.maximum(2 - x, 0.0)
        bends = np.where(near, -1.0, np.where(x < 2, 1.0, 0.0))
        return np.where(near, 1 - x * x / 2, rest**2 / 2), np.where(near, -x, -rest), bends


def test_limits_of_jkr():
    law, tabor = cb.Gauss, 32.0
    diagram = cb.trace(cb.Contact.reduced(law, tabor=tabor), modes=0)
    assert diagram.status == "complete", diagram.message
    assert_jkr_is_the_only_fold(diagram)
    assert len(diagram.branches[0].load) <= 130
    found = diagram.thresholds["pull_off_load"], diagram.thresholds["touch_load"]
    for value, limit, (slope, offset) in zip(found, (PULL_OFF, TOUCH), LAW[law], strict=True):
        excess = (value / limit - 1.0) * tabor**2
        assert excess == pytest.approx(slope * math.log(tabor) + offset, rel=0.03)
    assert max(max(event.error.values()) for event in diagram.events) < 5e-6
    # a naive dense code without contact, whose nodes move with the front
    (touch,) = (event for event in diagram.events if event.kind == "touch")
    assert touch.load == pytest.approx(-4.195077187, abs=1e-6)
    assert touch.displacement == pytest.approx(-1.352008439, abs=3e-7)


def assert_jkr_is_the_only_fold(diagram):
    """Loads fall through the touch, far from the one load fold beyond it, JKR's pull-off: nothing is a fold there."""
    folds = [fold for fold in diagram.folds("load") if fold.load < -1.0]
    assert [fold.name for fold in folds] == ["pull-off"]
    assert folds[0].load == pytest.approx(PULL_OFF, rel=2e-3)


def test_very_stiff_attraction():
    """At μ_T = 500 the excess over JKR's limits is a hundred-thousandth; folds of both controls wind into contact."""
    diagram = cb.trace(cb.Contact.reduced(cb.VanDerWaals, tabor=500.0), modes=0)
    assert diagram.status == "complete", diagram.message
    assert_jkr_is_the_only_fold(diagram)
    assert len(diagram.branches[0].load) <= 150
    for name, limit, (slope, offset) in zip(
        ("pull_off_load", "touch_load"), (PULL_OFF, TOUCH), LAW[cb.VanDerWaals], strict=True
    ):
        excess = (slope * math.log(500.0) + offset) / 500.0**2
        assert diagram.thresholds[name] / limit - 1.0 == pytest.approx(excess, abs=1e-7)
    indices = diagram.branches[0].unstable_displacement
    assert indices[0] == indices[-1] == 0
    assert indices.max() >= 3
    assert sum(1 for _ in diagram.folds("load")) % 2 == 1  # under load it is unstable far away, and stable in contact


def test_meshes_end_where_rounding_begins():
    """What is asked below rounding is given some thousand unknowns, not as many as there are rounds for."""
    track = tracked(cb.Contact.reduced(cb.Gauss, tabor=32.0, sign=-1), 1e-6)
    for row in (25, 36, 80):
        point, problem = track.points[row], track.problem(row)
        sharper, x = problem.resolved(point.x, point.parameter, 0.0, 1000)
        assert problem.size < sharper.size < 2000
        assert sharper.relative_error(x, point.parameter) < 1e-10


def test_rates_and_indices_of_moving_meshes():
    """Rates are the differences of what is computed, and every row has the index that its eigenvalues have.

    On the way to contact load and displacement change by 1e-5 in all: what their rates leave out makes folds. Every
    third row is looked at.
    """
    track = tracked(cb.Contact.reduced(cb.Gauss, tabor=290.0), 1e-6)
    held = track.hodograph.rows(DISPLACEMENT)
    moving = 0
    for row, point in list(enumerate(track.points[:-1]))[::3]:
        problem, x, p = track.problem(row), point.x, point.parameter
        if {row, row - 1} & {mark.row for mark in track.marks}:
            continue
        assert problem.unstable(x, p) == held[row]
        step = 1e-5 / problem.metric(x).norm(problem, point.tangent_x, point.tangent_parameter)
        ahead, behind = (
            np.array(problem.values(x + s * point.tangent_x, p + s * point.tangent_parameter)[:2])
            for s in (step, -step)
        )
        rates = np.array(problem.rates(x, p, point.tangent_x, point.tangent_parameter)[:2])
        difference = (ahead - behind) / (2 * step)
        assert rates == pytest.approx(difference, abs=1e-3 * np.abs(difference).max())
        moving += problem.moves
    assert moving > 15


@pytest.mark.parametrize(
    ("law", "strongest", "spreads"),
    # The largest pressure that a film bears, and that at which contact spreads in it: p g + v(g) = v(0), times z0/|Δγ|.
    [(cb.Gauss, math.exp(-0.5), 0.4512580), (cb.VanDerWaals, 3.0 * math.sqrt(3.0) / 8.0, 0.5)],
)
def test_limits_of_stiff_films(law, strongest, spreads):
    """A stiff film hardly changes Hertz's pressure, F = π³ p³/6: it is squeezed out and wets by that at its centre."""
    tabor = 40.0
    diagram = cb.trace(cb.Contact.reduced(law, tabor=tabor, sign=-1), accuracy=1e-4, modes=0)
    assert diagram.status == "complete", diagram.message
    assert len(diagram.branches[0].load) <= 130
    found = {fold.name: float(fold.load) for fold in diagram.folds("load")}
    for name, share, allowed in (("squeeze-out", strongest, 1.0), ("wetting", spreads, 12.0)):
        excess = found[name] / (math.pi**3 / 6.0 * (share * tabor) ** 3) - 1.0
        assert 0.0 < excess * tabor**2 < allowed


def test_films_under_cones_stay():
    """The pressure of a cone at its apex, ln(2c/ℓ)/2 with ℓ ~ 1/(2 μ_T²), reaches a law's largest, μ_T, at e^(4μ_T)."""
    laws = {tabor: cb.Exponential(-1.0, 1.0 / tabor) for tabor in (4.0, 5.0, 12.0)}
    found = {tabor: cb.trace(cb.Contact(cb.Cone(1.0), law), accuracy=1e-4, modes=0) for tabor, law in laws.items()}
    near, far = (found[tabor].thresholds["touch_load"] * tabor**4 / math.exp(4 * tabor) for tabor in (4.0, 5.0))
    assert near == pytest.approx(far, rel=0.1)
    stays, branch = found[12.0], found[12.0].branches[0]
    assert (stays.status, branch.load[-1], branch.contact_radius[-1]) == ("complete", pytest.approx(10.0), 0.0)
    assert "The film stays" in stays.message
    ridden = branch.displacement[-1] + branch.central_gap[-1]  # Sneddon's cone: F = (2/π) d²
    assert branch.load[-1] == pytest.approx(2 / math.pi * ridden**2, rel=0.2)


@pytest.mark.parametrize(
    ("law", "tabor", "stays"),
    [(cb.InverseSquare, 12.0, True), (cb.MaugisDugdale, 12.0, True), (cb.InverseSquare, 1.0, False)],
)
def test_films_under_cones_with_rounded_apexes_stay(law, tabor, stays):
    """A hyperboloid of slope 1 (radius 1): the pressure at its apex grows by 1/4 with every factor e of the load."""
    radii = np.linspace(0.0, 8.0, 40)
    hyperboloid = cb.Profile(tuple(radii), tuple(radii**2 / (1.0 + np.sqrt(1.0 + radii**2))))
    diagram = cb.trace(cb.Contact(hyperboloid, law(-1.0, 1 / tabor)), accuracy=1e-3, modes=0)
    assert (diagram.status, list(diagram.folds())) == ("complete", [])
    assert ("The film stays" in diagram.message) is stays
    assert (diagram.branches[0].contact_radius[-1] > 0.0) == (not stays)


def test_a_new_front_does_not_turn_the_curve_round():
    """Under r⁶ a film gives way on a ring, which becomes the front: to where it wets again there is but one way."""
    said = []

    def enough(fraction, text):
        if text not in said[-1:]:  # what was said last is said again now and then, as the clock has it
            said.append(text)
        if text.startswith("load") and len(said) > 60:
            raise cb.Stop

    contact = cb.Contact(cb.PowerLaw(6.0, 1.0), cb.VanDerWaals(-1.0, 1 / 16))
    diagram = cb.trace(contact, accuracy=1e-3, modes=0, progress=enough)
    rows, folds = diagram.branches[0], {(e.name, e.control): round(e.position) for e in diagram.folds()}
    top, last = folds["squeeze-out", "load"], folds.get(("wetting", "displacement"), len(rows) - 1)
    assert last - top > 20
    assert (np.diff(rows.load[top : last + 1]) < 0.0).all()
    assert (np.diff(rows.displacement[top + 1 : last + 1]) < 0.0).all()


def test_far_from_the_film_nothing_is_said_of_it():
    """Long before the tip is pressed upon the film the pressure below it is a power of the load."""
    diagram = cb.trace(cb.Contact(cb.Cone(1.0), cb.InverseSquare(-1.0, 30.0)), accuracy=1e-4, max_load=5.0, modes=0)
    assert diagram.thresholds["touch_load"] > 5.0


def test_kink_under_cone():
    """Next to where a law ends, meshes stay as long as the interaction is felt: F → 2π ∫ p r dr of the bare tip."""

    tabor = 30.0
    branch = cb.trace(cb.Contact(cb.Cone(1.0), Ramp(-1.0, 1 / tabor)), accuracy=1e-4, modes=0).branches[0]
    depth = 2 / tabor + branch.displacement
    early = (depth > 0.0) & (depth < 0.02 / tabor)
    assert branch.load[early] == pytest.approx(math.pi / 6 * tabor**2 * depth[early] ** 3, rel=0.05, abs=1e-9)


def test_folds_at_loads_of_a_hundred_millions():
    """There the load changes by 1e4 times what the displacement does, and both all but rest together."""
    diagram = cb.trace(cb.Contact(cb.Cone(1.0), cb.VanDerWaals(-1.0, 0.1)), modes=0)
    assert diagram.status == "complete", diagram.message
    assert [event.name for event in diagram.folds()] == ["squeeze-out", "squeeze-out", "wetting", "wetting"]
    for one, other in zip(diagram.folds("load"), diagram.folds("displacement"), strict=True):
        assert one.load == pytest.approx(other.load, rel=1e-9)


@pytest.mark.parametrize(("exponent", "tabor", "allowed"), [(1.5, 10.0, 0.05), (1.999, 40.0, 0.004)])
def test_touch_under_power_laws(exponent, tabor, allowed):
    """A stiff film that does not soften bears the pressure of a bare contact, with its p(0) at the centre.

    With zeta = k tⁿ (E = 1): π p = k n aⁿ⁻¹/(n − 1) and F = 2 k n aⁿ⁺¹/(n + 1).
    """
    tip = cb.PowerLaw(exponent, 1.0)
    range_ = tip.reduced_scales(1.0)[1] / tabor
    diagram = cb.trace(cb.Contact(tip, cb.Exponential(-1.0, range_), 1.0), accuracy=1e-4, modes=0)
    assert diagram.status == "complete", diagram.message
    k = float(tip.transform(np.float64(1.0)))
    radius = (math.pi / range_ * (exponent - 1) / (k * exponent)) ** (1 / (exponent - 1))
    bare = 2 * k * exponent * radius ** (exponent + 1) / (exponent + 1)
    assert 0.0 < diagram.thresholds["touch_load"] / bare - 1.0 < allowed


def test_a_film_under_a_bump_is_squeezed_out_on_a_ring():
    """The film around a contact ends below a bump of the profile: there the disc's own radius turns round twice.

    A curve that took the radius for a coordinate would go back and forth between two folds.
    """
    radii = np.linspace(0.0, 10.0, 61)
    heights = radii**2 / 2 * (1 - 0.1 * np.exp(-(((radii - 5.0) / 0.5) ** 2)))
    contact = cb.Contact(cb.Profile(tuple(radii), tuple(heights)), cb.VanDerWaals(-1.0, 0.25))
    said = set()

    def progress(fraction, text):
        said.add(text)  # not how often: the clock has the same said again
        if len(said) > 95:  # the ring lies behind
            raise cb.Stop

    diagram = cb.trace(contact, accuracy=1e-4, max_load=1500.0, modes=0, progress=progress)
    ring = next(event for event in diagram.events if event.kind == "topology")
    loads = [fold.load for fold in diagram.folds("load")]
    assert np.diff(np.sort(loads)).min() > 1e-3
    assert ring.load < max(loads)


def test_a_front_stays_on_the_mesh():
    """Far outside of a soft layered contact under a flat tip meshes end sooner than the front that they began with."""
    contact = cb.Contact(cb.PowerLaw(3.0, 1.0), cb.Layered(-1.0, 1.0 / 0.3, 4.0))
    said = set()

    def enough(fraction, text):
        said.add(text)  # not how often: the clock has the same said again
        if len(said) > 60:
            raise cb.Stop

    diagram = cb.trace(contact, accuracy=1e-8, modes=0, progress=enough)
    assert len(diagram.branches[0].load) > 60, diagram.message
    names = [fold.name for fold in diagram.folds("load")]
    assert len(names) > 8
    assert all(one.split("-")[0] != other.split("-")[0] for one, other in pairwise(names))


def test_a_kink_that_is_lost_again_leaves_no_mesh_that_ends_within_it():
    """Where a stiff film begins to bear, it is but just as wide as counts; its energy is convex: load only grows."""

    def stop(_, text):
        if not text.endswith("contact 0"):
            raise cb.Stop

    contact = cb.Contact(cb.PowerLaw(2.332, 1.0), Ramp(-1.0, 1.0 / 29.8))
    branch = cb.trace(contact, accuracy=1e-6, modes=0, progress=stop).branches[0]
    assert branch.load[0] < 1e-3
    assert branch.load[-1] > 1e4
    assert (np.diff(branch.load) > -1e-9).all()
    assert not branch.unstable_displacement.any()


# Folds of the displacement and first touch of laws with two kinks, by collocation of the pressure with the elliptic
# kernel, panels ending at both kinks and made finer there until nothing changes.
TWO_KINKS = {
    "a hat": (Hat(1.0, 1.42), "fold", -1.68119912, -2.535342352241),
    "ramps, the outer one first": (Ramp(0.5, 1.0) + Ramp(0.5, 0.5), "fold", -2.73399162, -1.720008898724),
    "ramps, the inner one first": (Ramp(-0.7, 1.0) + Ramp(-0.3, 2.0), "touch", 12.164569703, 3.422194173),
}


@pytest.mark.parametrize("name", TWO_KINKS)
def test_laws_with_two_kinks(name):
    """Both are edges of panels with which the mesh moves."""
    law, kind, load, displacement = TWO_KINKS[name]
    diagram = cb.trace(cb.Contact(cb.Parabola(1.0), law), modes=0, time_limit=60.0)
    assert diagram.status == "complete", diagram.message
    events = diagram.folds("displacement") if kind == "fold" else [e for e in diagram.events if e.kind == kind]
    event = min(events, key=lambda event: abs(event.load - load))
    assert abs(event.load - load) <= 3 * event.error["load"]
    assert abs(event.displacement - displacement) <= 3 * event.error["displacement"]


def test_which_kink_leads_does_not_depend_on_the_order_of_laws():
    one, other = Ramp(0.5, 1.0), Ramp(0.5, 2.0)
    assert (one + other).kink == (other + one).kink == pytest.approx(4.0)
    assert sorted(Hat(1.0, 0.5).kinks) == pytest.approx([0.5, 1.0])
