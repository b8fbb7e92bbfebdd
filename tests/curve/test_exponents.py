"""Critical exponents: of closed forms, and of traced contacts against solutions computed anew."""

from __future__ import annotations

import numpy as np
import pytest

import contbranch as cb
from contbranch import watch
from contbranch.curve.exponents import crossover_excess, fitted_window
from contbranch.results.diagram import LocalExponent


def power(kappa, prefactor, count=40):
    excess = np.geomspace(1e-4, 1e3, count)
    return LocalExponent(excess, prefactor * excess**kappa, np.full(count, kappa), np.zeros(count))


@pytest.mark.parametrize("kappa", [1 / 3, 0.5, 0.6])
def test_a_power_law_is_fitted_exactly(kappa):
    window = fitted_window(power(kappa, 2.5), 1e-2, 10.0)
    assert window.kappa == pytest.approx(kappa, rel=1e-12)
    assert window.prefactor == pytest.approx(2.5, rel=1e-12)
    assert window.kappa_error < 1e-7
    assert 1e-2 <= window.start < window.stop <= 10.0


def test_the_uncertainty_of_a_window_covers_the_local_exponents():
    excess = np.geomspace(1e-3, 1e2, 60)
    order = np.sqrt(excess) / (1 + excess) ** 0.1
    kappa = 0.5 - 0.1 * excess / (1 + excess)
    window = fitted_window(LocalExponent(excess, order, kappa, 0 * excess), 1e-2, 10.0)
    inside = (excess >= 1e-2) & (excess <= 10.0)
    assert window.kappa_error >= np.ptp(kappa[inside]) / 2
    assert kappa[inside].min() <= window.kappa <= kappa[inside].max()
    assert fitted_window(power(0.5, 1.0), 1e-2, 1.2e-2) is None


def test_crossover_of_a_cubic_normal_form():
    # F = c2 q²/2 + c3 q³/6: both terms of q(Δ) are equal where √(2Δ/c2) = c3 Δ/(3 c2²).
    second, third = 1.7, -0.4
    excess = crossover_excess(second, third)
    assert np.sqrt(2 * excess / second) == pytest.approx(abs(third) * excess / (3 * second**2), rel=1e-12)
    assert crossover_excess(second, 0.0) is None


@pytest.fixture(scope="module")
def attraction():
    contact = cb.Contact.reduced(cb.Exponential, 1.0)
    return contact, cb.trace(contact, accuracy=1e-10, modes=0)


def pull_off(diagram, control="load"):
    return next(event for event in diagram.folds(control) if event.name == "pull-off")


def test_exponent_is_one_half_at_a_fold(attraction):
    _, diagram = attraction
    event = pull_off(diagram)
    local = diagram.local_exponent(event)
    assert (np.diff(local.excess) > 0).all()
    smallest = np.flatnonzero(local.excess < 1e-3)
    assert len(smallest) >= 2
    # κ_local = 1/2 + O(√ΔF)
    crossover = event.exponent.crossover_load
    bound = local.error + 0.5 * np.sqrt(local.excess / crossover)
    assert (np.abs(local.kappa - 0.5)[smallest] <= bound[smallest]).all()
    assert event.exponent.kappa == 0.5
    assert event.exponent.order_parameter == "contact_radius"
    # and drifts towards 1/3 far away
    assert local.kappa[-1] < 0.45
    assert local.kappa[-1] > 0.3


def test_a_local_exponent_is_kept_as_far_as_it_goes(attraction, monkeypatch):
    contact, known = attraction
    whole = known.local_exponent(pull_off(known))
    diagram = cb.trace(contact, accuracy=known.accuracy, modes=0)  # whose exponents nobody has asked for
    event = pull_off(diagram)
    with watch.patient(1e-9):
        assert len(diagram.local_exponent(event).excess) == 0
    samples = iter(range(5))  # whoever waits has had enough after some

    def tired():
        if next(samples, None) is None:
            raise watch.Interruption

    monkeypatch.setattr("contbranch.continuation.newton.check", tired)
    with watch.watched():
        part = diagram.local_exponent(event)
    assert 0 < len(part.excess) < len(whole.excess)

    def stopped():
        raise KeyboardInterrupt

    monkeypatch.setattr("contbranch.continuation.newton.check", stopped)
    with pytest.raises(KeyboardInterrupt):  # while it is saved, too
        diagram.known_exponents()
    np.testing.assert_array_equal(part.kappa, whole.kappa[: len(part.kappa)])


def test_normal_form_and_local_exponent_against_solutions(attraction):
    contact, diagram = attraction
    event = pull_off(diagram)
    exponent, local = event.exponent, diagram.local_exponent(event)
    for excess in (1e-4, 1e-3):
        state = cb.solve(contact, load=event.load + excess, accuracy=1e-11)
        moved = state.contact_radius - event.contact_radius
        leading = exponent.prefactor * np.sqrt(excess)
        share = np.sqrt(excess / exponent.crossover_load)
        assert moved == pytest.approx(leading, rel=1.5 * share + 1e-5)
        # the next term of the expansion has the size that the crossover says
        assert abs(moved / leading - 1) == pytest.approx(share, rel=0.1)
    # κ_local by differences of solutions
    for k in (len(local.excess) // 2, len(local.excess) - 6):
        excess = local.excess[k]
        radii = [
            cb.solve(contact, load=event.load + excess * f, accuracy=1e-11).contact_radius - event.contact_radius
            for f in (np.exp(-0.02), 1.0, np.exp(0.02))
        ]
        assert local.order_parameter[k] == pytest.approx(radii[1], rel=1e-6)
        slope = np.log(radii[2] / radii[0]) / 0.04
        assert local.kappa[k] == pytest.approx(slope, abs=2e-5 + local.error[k])


def test_displacement_fold_has_its_own_normal_form(attraction):
    contact, diagram = attraction
    event = pull_off(diagram, "displacement")
    excess = 1e-4
    states = cb.solve(contact, displacement=event.displacement + excess, accuracy=1e-11).states
    radii = sorted(state.contact_radius for state in states if state.contact_radius > event.contact_radius)
    assert len(states) == 3  # jump-in lies above: far away, unstable, in contact
    moved = radii[0] - event.contact_radius
    share = np.sqrt(excess / event.exponent.crossover_load)
    assert moved == pytest.approx(event.exponent.prefactor * np.sqrt(excess), rel=1.5 * share)


def test_a_fold_without_contact_is_measured_by_the_central_gap():
    contact = cb.Contact.reduced(cb.Gauss, 1.0, -1)
    diagram = cb.trace(contact, accuracy=1e-10)
    event = next(event for event in diagram.folds("load") if event.name == "squeeze-out")
    assert event.exponent.order_parameter == "central_gap"
    branch = diagram.branches[0]
    # c2 = d²F/dg² from F at displaced states on either side: F(g0 ± q) = F0 − q²/prefactor²
    excess = 1e-4
    state = cb.solve(contact, load=event.load - excess, near=branch.state(0), accuracy=1e-11)
    apart = min(
        (s for s in state.states if s.contact_radius == 0), key=lambda s: abs(s.central_gap - event.central_gap)
    )
    moved = abs(apart.central_gap - event.central_gap)
    share = np.sqrt(excess / event.exponent.crossover_load)
    assert moved == pytest.approx(event.exponent.prefactor * np.sqrt(excess), rel=2 * share + 1e-4)
    local = diagram.local_exponent(event)
    assert local.kappa[0] == pytest.approx(0.5, abs=0.02 + local.error[0])


def test_continuous_onset_has_the_exponent_one_half():
    contact = cb.Contact.reduced(cb.Exponential, 1.0, -1)
    diagram = cb.trace(contact, accuracy=1e-10)
    touch = next(event for event in diagram.events if event.kind == "touch")
    local = diagram.local_exponent(touch)
    assert len(local.kappa) > 5
    small = local.excess < 1e-3
    assert small.any()
    assert (np.abs(local.kappa - 0.5)[small] <= local.error[small] + 0.02).all()
    # against solutions: a ∝ (F − F_t)^(1/2)
    loads = [cb.solve(contact, contact_radius=a, accuracy=1e-11).load - touch.load for a in (1e-3, 2e-3)]
    assert np.log(loads[1] / loads[0]) / np.log(2.0) == pytest.approx(2.0, abs=0.01)


def test_windowed_fit_measures_the_crossover(attraction):
    _, diagram = attraction
    event = pull_off(diagram)
    window, local = event.exponent.window, diagram.local_exponent(event)
    inside = (local.excess >= window.start) & (local.excess <= window.stop)
    assert local.kappa[inside].min() - 1e-9 <= window.kappa <= local.kappa[inside].max() + 1e-9
    assert window.kappa < 0.5
    assert window.kappa_error > 0


@pytest.mark.parametrize(("law", "tabor"), [(cb.Gauss, 20.0)])
def test_samples_far_from_a_stiff_film_are_those_of_states_found_there(law, tabor):
    """The discretisation of the fold does not serve a film that is squeezed far beyond."""
    contact = cb.Contact.reduced(law, tabor, -1)
    diagram = cb.trace(contact, modes=0)
    fold = next(event for event in diagram.folds("load") if event.name == "squeeze-out")
    local = diagram.local_exponent(fold)
    assert local.excess[-1] > 15.0
    states = cb.find_all(contact, load=fold.load - local.excess[-1]).states
    films = [abs(s.central_gap - fold.central_gap) for s in states if s.contact_radius == 0.0]
    assert min(abs(film / local.order_parameter[-1] - 1) for film in films) < 1e-5
