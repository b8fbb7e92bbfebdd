"""Fits of force curves as instruments record them: legs, pauses, faults, ranges; truth by JKR's and Hertz' formulas."""

import math
import re
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import contbranch as cb
from contbranch.measure import fit as fitting

ROOT = Path(__file__).parents[1]
if str(ROOT) not in sys.path:
    sys.path.append(str(ROOT))  # the scripts in studies/ are not installed

from studies.fit_faults import BEYOND, Contact, deviations, make  # noqa: E402

JPK = Path(__file__).parent / "reference" / "force_curves" / "fmt-jpk-fd_spot3-0192.jpk-force"
# A bead with a pull-off of 24 nN, pressed by 60 nN, and one without adhesion, pressed by 200 nN to a depth of 60 nm.
STICKY, BARE = Contact(0.01, 0.005, 1000.0, 1.0, 60.0), Contact(0.01, 0.0, 1000.0, 5.0, 200.0)
POINT, BASELINE, TILT = 30.0, 2.0, 0.01
COUNT = 250
NOISE = np.random.default_rng(1).standard_normal(2 * COUNT)
UP, DOWN = slice(COUNT), slice(COUNT, None)


def places(contact):
    """Positions of the piezo from the contact point on both legs."""
    way = np.linspace(-80.0, contact.at(contact.top), COUNT)
    return np.append(way, way[::-1])


def curve_of(contact, retract=None, change=lambda place, force: force, noise=0.2):
    """Approach and retraction, which may be another contact's, begun at the same force; a fault changes the force."""
    place, other = places(contact), retract or contact
    begin = other.at(contact.top) - contact.at(contact.top)
    force = np.append(contact.force(place[UP], False), other.force(place[DOWN] + begin, True))
    force = change(place, force) + BASELINE + TILT * (place + POINT) + noise * NOISE
    return cb.ForceCurve(place + POINT, force, contact.spring, np.repeat([0, 1], COUNT))


def part_of(curve, kept):
    return cb.ForceCurve(curve.piezo[kept], curve.force[kept], curve.spring, curve.retract[kept].astype(int))


def fitted(curve, contact, factor=2.0, **settings):
    """The fit, from a start that is off by a factor."""
    values = {"radius": contact.radius, "modulus": factor * contact.modulus}
    if not contact.work_of_adhesion:
        return cb.fit(curve, cb.Contact.physical(**values), "modulus", **settings)
    values |= {"interaction": "maugis-dugdale", "work_of_adhesion": contact.work_of_adhesion / factor, "range": 0.5}
    return cb.fit(curve, cb.Contact.physical(**values), **{"law": "jkr"} | settings)


def assert_known(fit, **true):
    """True values are determined, to 10 %, and within four errors."""
    for name, value in true.items():
        assert name in fit.determined, fit.message
        assert abs(fit.values[name] - value) < 4 * fit.errors[name], (name, fit.values[name], fit.errors[name])
        assert fit.errors[name] < 0.1 * abs(value)


@pytest.fixture(scope="module")
def sticky():
    return curve_of(STICKY)


@pytest.fixture(scope="module")
def bare():
    return curve_of(BARE)


# -- legs -------------------------------------------------------------------------------------------------------------
def test_legs_that_differ_are_fitted_each_by_itself():
    stiffer = replace(STICKY, modulus=1.4 * STICKY.modulus)
    fit = fitted(curve_of(STICKY, stiffer), STICKY)
    assert fit.leg == "each"
    assert (fit.legs["approach"].leg, fit.legs["retract"].leg) == ("approach", "retract")
    assert_known(fit.legs["approach"], modulus=STICKY.modulus)
    assert_known(fit.legs["retract"], modulus=stiffer.modulus, work_of_adhesion=STICKY.work_of_adhesion)
    assert fit.values["modulus"] == fit.legs["approach"].values["modulus"]
    assert fit.values["work_of_adhesion"] == fit.legs["retract"].values["work_of_adhesion"]
    assert fit.contact.modulus == pytest.approx(fit.values["modulus"])
    assert fit.contact.interaction.work_of_adhesion == pytest.approx(fit.values["work_of_adhesion"])
    assert fit.errors["work_of_adhesion"] == fit.legs["retract"].errors["work_of_adhesion"]
    assert np.isfinite(fit.fitted[UP]).mean() > 0.98 < np.isfinite(fit.fitted[DOWN]).mean()  # few are within jumps
    share = re.search(r"the modulus of the retraction differs by \+(\d+) %", fit.message)
    assert int(share[1]) == pytest.approx(40, abs=5)
    document = fit.document()
    assert document["leg"] == "each"
    assert document["legs"]["retract"]["values"] == fit.legs["retract"].values
    assert document["legs"]["approach"].keys() == {"values", "errors", "determined", "rms"}


@pytest.mark.parametrize("contact", [STICKY, BARE], ids=["sticky", "bare"])
def test_legs_of_one_elastic_contact_are_fitted_at_once(contact):
    fit = fitted(curve_of(contact), contact)
    assert (fit.leg, fit.legs, fit.document()["legs"]) == ("both", None, None)
    assert "baseline_retract" not in fit.values
    assert_known(fit, modulus=contact.modulus, contact_point=POINT)


@pytest.mark.parametrize("leg", ["approach", "retract", "both"])
def test_a_leg_that_is_asked_for_is_the_one_that_is_fitted(sticky, leg):
    fit = fitted(sticky, STICKY, leg=leg)
    assert (fit.leg, fit.legs) == (leg, None)
    for own, other in ((UP, "retract"), (DOWN, "approach")):
        share = np.isfinite(fit.fitted[own]).mean()  # all but those within the jump
        assert share == 0.0 if leg == other else share > 0.98
    assert_known(fit, work_of_adhesion=STICKY.work_of_adhesion, modulus=STICKY.modulus)


def test_a_leg_that_is_missing_is_an_input_error(sticky):
    approach, retraction = part_of(sticky, ~sticky.retract), part_of(sticky, sticky.retract)
    for curve, leg, words in (
        (approach, "retract", "leg: retract; the curve has no retraction"),
        (approach, "both", "leg: both; the curve has no retraction"),
        (retraction, "approach", "leg: approach; the curve has no approach"),
        (sticky, "retraction", "leg: 'retraction'; must be one of"),
    ):
        with pytest.raises(cb.InputError, match=words):
            fitted(curve, STICKY, leg=leg)
    with pytest.raises(cb.InputError, match="baseline: 'two'; must be one of"):
        fitted(sticky, STICKY, baseline="two")


def test_a_retraction_alone_is_fitted_like_any_curve(sticky):
    fit = fitted(part_of(sticky, sticky.retract), STICKY)
    assert (fit.leg, [jump.name for jump in fit.jumps]) == ("retract", ["pull-off"])
    assert_known(fit, work_of_adhesion=STICKY.work_of_adhesion, modulus=STICKY.modulus, contact_point=POINT)


@pytest.mark.parametrize("contact", [STICKY, BARE], ids=["sticky", "bare"])
def test_legs_that_drag_sets_apart_have_baselines_of_their_own(contact):
    drag = 3.0
    curve = curve_of(contact, change=lambda place, force: force + np.repeat([drag, -drag], COUNT))
    fit, one = (fitted(curve, contact, leg=leg, baseline=kind) for leg, kind in (("auto", "auto"), ("both", "one")))
    assert fit.leg == "both"
    assert {"baseline_retract", "tilt_retract"} <= fit.values.keys()
    assert not {"baseline_retract", "tilt_retract"} & one.values.keys()
    assert_known(fit, modulus=contact.modulus, baseline=BASELINE + drag, contact_point=POINT)
    assert fit.values["baseline_retract"] == pytest.approx(BASELINE - drag, abs=0.1)
    assert fit.errors["modulus"] < one.errors["modulus"] / 5


# -- pauses and faults ------------------------------------------------------------------------------------------------
@pytest.mark.parametrize("named", [True, False], ids=["named", "unnamed"])
def test_a_pause_is_left_out_and_that_is_said(bare, named):
    """The force relaxes while the piezo holds; the retraction begins where the approach has ended."""
    held = 90
    top = bare.force[COUNT - 1] - 40.0 * (1.0 - np.exp(-np.linspace(0.0, 4.0, held)))
    piezo, force = np.insert(bare.piezo, COUNT, np.full(held, bare.piezo.max())), np.insert(bare.force, COUNT, top)
    words = np.repeat(["approach", "pause", "retract"], [COUNT, held, COUNT])
    fit = fitted(cb.ForceCurve(piezo, force, BARE.spring, words if named else None), BARE)
    told = re.search(r"The pause of (\d+) samples is left out", fit.message)
    assert int(told[1]) == pytest.approx(held, abs=0 if named else 6)  # the last samples before it and the first behind
    assert np.isnan(fit.fitted[COUNT : COUNT + held]).all()
    assert fit.pause.sum() == int(told[1])
    assert fit.leg == "both"
    assert_known(fit, modulus=BARE.modulus, contact_point=POINT)


def test_positions_in_steps_tell_a_contact_point_no_better_than_the_steps(bare):
    step = 6.0
    curve = cb.ForceCurve(step * np.floor(bare.piezo / step), bare.force, BARE.spring, bare.retract.astype(int))
    fit, fine = fitted(curve, BARE), fitted(bare, BARE)
    assert fine.errors["contact_point"] < step / math.sqrt(12) <= fit.errors["contact_point"]
    assert_known(fit, modulus=BARE.modulus)
    assert abs(fit.values["contact_point"] - POINT) < 4 * fit.errors["contact_point"]


def test_dropouts_and_spikes_are_left_out_and_that_is_said(sticky):
    force = sticky.force.copy()
    dropped, spikes = [COUNT - 10, COUNT + 20], [5, 120, 220, 450]
    assert (force[dropped] > 20.0).all()
    force[dropped], force[spikes] = 0.0, force[spikes] + [60.0, -80.0, 50.0, -70.0]
    fit = fitted(cb.ForceCurve(sticky.piezo, force, STICKY.spring, sticky.retract.astype(int)), STICKY)
    assert f"Left out as dropouts or spikes: {len(dropped + spikes)} of" in fit.message
    assert np.isnan(fit.fitted[dropped + spikes]).all()
    assert np.isnan(fit.fitted).sum() <= len(dropped + spikes) + 4  # and samples within jumps
    assert_known(fit, work_of_adhesion=STICKY.work_of_adhesion, modulus=STICKY.modulus, contact_point=POINT)


@pytest.mark.parametrize("kind", ["tether", "steps"])
def test_what_holds_a_contact_after_the_pull_off_is_left_out(kind):
    """A tether of 4 nN that ends 25 nm behind the pull-off, or a part that lets go there after one of 9 nN."""
    end = STICKY.branch[0][0]

    def held(place, force):
        behind = (np.arange(place.size) >= COUNT) & (place < end) & (place > end - 25.0)
        near = behind & (place > end - 12.0) & (kind == "steps")
        return force - 4.0 * behind - 5.0 * near

    curve = curve_of(STICKY, change=held)
    fit = fitted(curve, STICKY)
    assert "The contact comes off in several steps, or a tether holds it" in fit.message
    behind = end - (curve.piezo[DOWN] - POINT)
    assert np.isnan(fit.fitted[DOWN][(behind > 1.0) & (behind < 24.0)]).all()
    assert_known(fit, work_of_adhesion=STICKY.work_of_adhesion, modulus=STICKY.modulus)


def test_adhesion_that_a_contact_without_a_law_cannot_have_is_left_out_and_said():
    """A retraction that is held by up to 15 nN below the contact point."""

    def sticking(place, force):
        return force - 15.0 * (np.arange(place.size) >= COUNT) * np.exp(-(((place + 15.0) / 6.0) ** 2))

    fit = fitted(curve_of(BARE, change=sticking), BARE)
    assert re.search(r"The retraction shows adhesion \(-1[45]\.?\d* nN\), of which this contact has none", fit.message)
    assert np.isnan(fit.fitted[DOWN]).any()
    assert np.isfinite(fit.fitted[UP]).all()
    assert_known(fit, modulus=BARE.modulus)


def test_a_curve_that_begins_in_contact_has_no_baseline_and_that_is_said():
    curve = curve_of(BARE, noise=0.01)
    fit = fitted(part_of(curve, curve.piezo > POINT + BARE.at(0.05 * BARE.top)), BARE)
    assert "There is no baseline in the data" in fit.message
    assert_known(fit, modulus=BARE.modulus, contact_point=POINT)
    assert "no baseline" not in fitted(curve, BARE).message


# -- ranges -----------------------------------------------------------------------------------------------------------
def test_samples_out_of_a_range_are_left_out(bare):
    """Those of an indentation or a force; samples without contact stay."""
    force = BARE.force(bare.piezo - POINT, True)
    depth = bare.piezo - POINT - force / BARE.spring
    for settings, number, limit in (
        ({"max_indentation": "30 nm"}, depth, 30.0),
        ({"max_force": "0.08 uN"}, force, 80.0),
    ):
        fit = fitted(bare, BARE, **settings)
        assert np.isnan(fit.fitted[number > 1.05 * limit]).all()
        assert np.isfinite(fit.fitted[number < 0.95 * limit]).all()
        assert np.isnan(fit.residuals[number > 1.05 * limit]).all()
        assert_known(fit, modulus=BARE.modulus, contact_point=POINT)
    fit = fitted(bare, BARE, min_force=20.0)
    assert np.isnan(fit.fitted[(force > 2.0) & (force < 19.0)]).all()
    assert np.isfinite(fit.fitted[(force > 21.0) | (depth < -1.0)]).all()
    assert_known(fit, modulus=BARE.modulus)


def test_a_least_force_below_zero_leaves_out_the_stronger_attraction(sticky):
    force = STICKY.force(sticky.piezo - POINT, True)
    force[UP] = STICKY.force(sticky.piezo[UP] - POINT, False)
    fit = fitted(sticky, STICKY, min_force=-12.0)
    assert np.isnan(fit.fitted[force < -13.0]).all()
    assert np.isfinite(fit.fitted[force > 1.0]).all()
    assert_known(fit, modulus=STICKY.modulus, work_of_adhesion=STICKY.work_of_adhesion)


def test_laws_are_compared_within_a_range(sticky):
    fit = fitted(sticky, STICKY, max_force=30.0, law="compare")
    force = STICKY.force(sticky.piezo - POINT, True)
    assert np.isnan(fit.fitted[force > 32.0]).all()
    assert {"jkr", "dmt"} <= {one.law for one in fit.laws}


def test_a_range_hides_what_it_leaves_out():
    """A body that is three times as stiff from a depth of 30 nm on."""

    def stiffening(place, force):
        depth = place - force / BARE.spring
        return force + 0.5 * BARE.spring * np.maximum(depth - 30.0, 0.0)

    curve = curve_of(BARE, change=stiffening)
    whole, fit = fitted(curve, BARE, leg="approach"), fitted(curve, BARE, leg="approach", max_indentation=25.0)
    assert_known(fit, modulus=BARE.modulus)
    assert whole.values["modulus"] > 1.1 * BARE.modulus


@pytest.mark.parametrize(
    ("settings", "words"),
    [
        ({"max_indentation": "5 nN"}, "max_indentation: .*nN"),
        ({"max_force": "5 nm"}, "max_force: .*nm"),
        ({"min_force": "a lot"}, "min_force: .*a lot"),
        ({"max_indentation": -3.0}, "max_indentation: -3"),
        ({"max_force": 0.0}, "max_force: 0"),
    ],
)
def test_a_range_that_cannot_be_used_is_an_input_error(bare, settings, words):
    with pytest.raises(cb.InputError, match=words):
        fitted(bare, BARE, **settings)


def test_a_range_that_leaves_few_samples_is_an_input_error(bare):
    pressed = part_of(bare, bare.piezo > POINT + BARE.at(0.05 * BARE.top))
    with pytest.raises(cb.InputError, match=r"max_force: 0.001; leaves \d+ samples in contact"):
        fitted(pressed, BARE, max_force=1e-3)


# -- the minimum ------------------------------------------------------------------------------------------------------
@pytest.mark.parametrize("contact", [STICKY, BARE], ids=["sticky", "bare"])
@pytest.mark.parametrize("factor", [1e-3, 1e3])
def test_a_start_far_off_leads_to_the_minimum_that_the_truth_leads_to(contact, factor):
    curve = curve_of(contact)
    fit, known = (fitted(curve, contact, factor=one) for one in (factor, 1.0))
    assert fit.determined == known.determined
    for name, value in known.values.items():
        assert abs(fit.values[name] - value) < 0.05 * known.errors[name], name
    assert_known(fit, modulus=contact.modulus)


@pytest.mark.parametrize("each", ["one", "each"])
def test_derivatives_in_closed_form_are_those_of_differences(bare, monkeypatch, each):
    found = []
    concluded = fitting.concluded
    monkeypatch.setattr(fitting, "concluded", lambda *given: found.append(given[:2]) or concluded(*given))
    fitted(bare, BARE, leg="both", baseline=each)
    minimiser, minimum = found[0]
    assert len(minimum.problem.names) == (4 if each == "one" else 6)
    for k, name in enumerate(minimum.problem.names):
        step = 1e-4 * np.eye(minimum.x.size)[k]
        ends = minimum.x + step, minimum.x - step
        high, low = (minimiser.model(minimum.problem, x, minimum.comparison)[0] for x in ends)
        slopes = (high - low) / 2e-4 / minimum.spread
        assert np.abs(minimum.slopes[: slopes.size, k] - slopes).max() < 5e-3 * np.abs(slopes).max(), name


@pytest.mark.parametrize("kind", ["dropouts", "repeated", "tilted", "begins-in-contact"])
def test_no_value_that_is_determined_is_beyond_five_errors(kind):
    for seed in range(10):
        case = make(kind, seed % 3 == 0 and kind != "begins-in-contact", np.random.default_rng((7, seed)))
        fit = case.fitted()
        assert fit.determined or kind == "begins-in-contact", seed
        assert max(deviations(case, fit).values(), default=0.0) < BEYOND, (seed, fit.message)


# -- a measured curve -------------------------------------------------------------------------------------------------
def test_a_measured_approach_has_the_modulus_of_a_plain_least_squares_fit():
    """F = 4/3 E √R δ^1.5 + b + t z with δ = z − F/K − z₀: all but z₀ is linear."""
    pytest.importorskip("afmformats", reason="afmformats, which reads JPK's files, is missing")
    curve = cb.read_force_curve(JPK)
    own = curve.leg(False)
    piezo, force = curve.piezo[own], curve.force[own]
    tip = piezo - force / curve.spring

    def left(begin):
        columns = np.array([np.maximum(tip - begin, 0.0) ** 1.5, np.ones(tip.size), piezo - piezo[0]]).T
        size = np.linalg.norm(columns, axis=0)
        found = np.linalg.lstsq(columns / size, force, rcond=None)[0] / size
        return float(np.sum((columns @ found - force) ** 2)), 0.75 * found[0] / math.sqrt(2500.0)

    tried = np.linspace(tip[0], tip.max(), 202)[1:-1]
    best = min(tried, key=lambda begin: left(begin)[0])
    step = tried[1] - tried[0]
    _, modulus = min(left(begin) for begin in np.linspace(best - step, best + step, 41))
    fit = cb.fit(curve, cb.Contact.physical(radius=2500.0, modulus="1 kPa"), "modulus", leg="approach")
    assert "modulus" in fit.determined
    assert fit.values["modulus"] == pytest.approx(modulus, rel=0.1)
