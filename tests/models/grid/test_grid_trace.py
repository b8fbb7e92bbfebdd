"""Curves on lattices against the axisymmetric model, which shares nothing with them but the law and the tip."""

from __future__ import annotations

import warnings
from functools import cache

import numpy as np
import pytest

import contbranch as cb
from contbranch.results.diagram import Diagram, Event

REPULSION = cb.Contact.reduced("gauss", tabor=1.0, sign=-1)
ATTRACTION = cb.Contact.reduced("exponential", tabor=1.0)


@cache
def traced(contact: cb.Contact, cell: float, grid: int, kind: str = "free", control: str = "load") -> Diagram:
    model = cb.FreeSpace(cell=cell, grid=grid) if kind == "free" else cb.Periodic(cell=cell, grid=grid)
    return cb.trace(contact, control=control, model=model)


@cache
def exact(contact: cb.Contact) -> Diagram:
    """The axisymmetric model to 1e-8."""
    return cb.trace(contact, accuracy=1e-8)


def pairs(diagram: Diagram, reference: Diagram) -> list[tuple[Event, Event]]:
    """Events of a diagram with those of the same name in the reference."""
    found = []
    for event in diagram.events:
        same = [e for e in reference.events if (e.kind, e.control, e.name) == (event.kind, event.control, event.name)]
        found += [(event, same[0])] if len(same) == 1 else []
    return found


def test_both_folds_of_the_repulsion_in_free_space() -> None:
    diagram, reference = traced(REPULSION, 8.0, 128), exact(REPULSION)
    assert diagram.status == "complete"
    # The film has no contact line: spectral accuracy. The contact's fold: 0.5 % asked, 0.01 % found.
    assert diagram.thresholds["squeeze_out_load"] == pytest.approx(reference.thresholds["squeeze_out_load"], rel=1e-7)
    assert diagram.thresholds["wetting_load"] == pytest.approx(reference.thresholds["wetting_load"], rel=1e-3)
    assert diagram.thresholds["touch_load"] == pytest.approx(reference.thresholds["touch_load"], rel=1e-5)
    assert set(diagram.thresholds) == set(reference.thresholds)
    assert {e.verdict for e in diagram.events if e.kind == "fold"} == {"stays", "averaged"}


def test_morse_indices_along_the_curve() -> None:
    branch = traced(REPULSION, 8.0, 128).branches[0]
    # Stable film, one unstable mode between squeeze-out and wetting, stable contact.
    changes = [int(branch.unstable_load[0])]
    for value in branch.unstable_load:
        if value != changes[-1]:
            changes.append(int(value))
    assert changes == [0, 1, 0]
    between = branch.unstable_load == 1
    assert branch.unstable_displacement[~between].max() == 0


@pytest.mark.parametrize(("contact", "grid"), [(REPULSION, 64), (REPULSION, 128), (ATTRACTION, 64)])
def test_error_estimates_are_honest(contact: cb.Contact, grid: int) -> None:
    cell = 8.0 if contact is REPULSION else 12.0
    ratios = []
    for event, reference in pairs(traced(contact, cell, grid), exact(contact)):
        for name in ("load", "displacement", "contact_radius"):
            true = abs(getattr(event, name) - getattr(reference, name))
            if true > 1e-6:
                ratios.append(true / event.error[name])
    assert len(ratios) >= 8
    assert np.quantile(ratios, 0.8) < 1.0
    assert max(ratios) < 3.0
    assert np.median(ratios) > 0.01


def test_warm_points_are_cheap() -> None:
    branch = traced(REPULSION, 8.0, 128).branches[0]
    assert branch.fft_pairs is not None
    assert np.median(branch.fft_pairs) <= 40
    assert traced(REPULSION, 8.0, 128).cost.fft_pairs >= branch.fft_pairs.sum()


def test_energy_is_the_integral_of_the_load() -> None:
    """dV/dd = F: over a smooth stretch the trapezoidal rule is right to its own error."""
    for kind in ("free", "periodic"):
        branch = traced(REPULSION, 8.0, 64, kind).branches[0]
        k = np.flatnonzero(branch.contact_radius == 0.0)[:20]
        steps = np.diff(branch.displacement[k])
        work = 0.5 * (branch.load[k][1:] + branch.load[k][:-1]) * steps
        curvature = np.abs(
            np.gradient(np.gradient(branch.load[k], branch.displacement[k]), branch.displacement[k])
        ).max()
        assert np.abs(np.diff(branch.energy[k]) - work).max() < curvature * np.abs(steps).max() ** 3 / 6.0 + 1e-6


def test_periodic_values_approach_free_space_with_the_cell() -> None:
    """Images act through the pressure's second moment: the shift of the fold falls like 1/L³ (theory of images)."""
    free = exact(REPULSION).thresholds["squeeze_out_load"]
    shifts = [free - traced(REPULSION, cell, 64, "periodic").thresholds["squeeze_out_load"] for cell in (8.0, 11.0)]
    assert 0.0 < shifts[1] < shifts[0]
    assert np.log(shifts[0] / shifts[1]) / np.log(11.0 / 8.0) == pytest.approx(3.0, abs=0.5)


def test_a_coarse_grid_warns_and_names_the_grid_needed() -> None:
    contact = cb.Contact.reduced("gauss", tabor=4.0, sign=-1)
    model = cb.Periodic(cell=12.0, grid=128)
    with pytest.warns(cb.GridWarning, match=r"use a grid of at least (\d+)") as caught:
        cb.solve(contact, load=100.0, model=model)
    needed = int(str(caught[0].message).rstrip(".").split()[-1])
    # |v''| = 1/z0² = 16 at contact must not exceed π/(8Δ).
    assert needed == pytest.approx(8.0 * 12.0 * 16.0 / np.pi, rel=0.03)


@pytest.mark.parametrize(("cell", "load"), [(5.0, 1.0), (9.8, 18.0)])
def test_a_small_cell_warns_and_names_the_cell_needed(cell: float, load: float) -> None:
    with pytest.warns(cb.GridWarning, match=r"use a cell of about ([0-9.]+)") as caught:
        cb.solve(ATTRACTION, load=load, model=cb.FreeSpace(cell=cell, grid=64))
    needed = float(str(caught[0].message).split("of about ")[1].split()[0])
    assert needed > cell
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        cb.solve(ATTRACTION, load=load, model=cb.FreeSpace(cell=needed, grid=64))


def test_film_and_contact_are_both_found_on_request() -> None:
    load = 8.2
    model = cb.FreeSpace(cell=8.0, grid=64)
    found = cb.find_all(REPULSION, load=load, model=model)
    assert [state.unstable_load for state in found] == [0, 1, 0]
    reference = cb.find_all(REPULSION, load=load)
    for state, other in zip(found, reference, strict=True):
        assert state.displacement == pytest.approx(other.displacement, abs=4e-3)
    for state in (found[0], found[2]):
        again = cb.solve(REPULSION, load=load, model=model, near=state)
        assert abs(again.displacement - state.displacement) <= state.error["displacement"]
        assert again.residual < 1e-8
    # Of the two stable ones the lower in V - F d is returned without a wish.
    best = cb.solve(REPULSION, load=load, model=model)
    assert best.central_gap == cb.solve(REPULSION, load=load).central_gap == 0.0
    assert "The axisymmetric model has 3 equilibria" in best.message


def test_controls_agree_on_common_points() -> None:
    model = cb.Periodic(cell=10.0, grid=64)
    one = cb.solve(ATTRACTION, load=1.0, accuracy=1e-8, model=model)
    other = cb.solve(ATTRACTION, displacement=one.displacement, accuracy=1e-8, model=model)
    assert other.load == pytest.approx(1.0, abs=1e-7)
    assert other.energy == pytest.approx(one.energy, abs=1e-7)


def test_elliptic_paraboloid_through_pull_off() -> None:
    ellipse = cb.EllipticParaboloid(radius_x=np.sqrt(2.0), radius_y=np.sqrt(0.5))
    contact = cb.Contact(tip=ellipse, interaction=cb.Gauss(1.0, 1.0))
    diagram = cb.trace(contact, control="displacement", model=cb.FreeSpace(cell=13.0, grid=64))
    assert diagram.status == "complete"
    # With a long-range law the load is close to that of the parabola with the same Gaussian curvature (Derjaguin).
    parabola = exact(cb.Contact.reduced("gauss", tabor=1.0)).thresholds["pull_off_load"]
    assert diagram.thresholds["pull_off_load"] == pytest.approx(parabola, rel=0.02)
    assert diagram.thresholds["pull_off_load"] > parabola
    branch = diagram.branches[0]
    film = branch.contact_radius == 0.0
    slope = np.gradient(branch.energy[film], branch.displacement[film])
    assert np.median(np.abs(slope - branch.load[film])) < 0.05


def test_hertz_radius_below_the_spacing() -> None:
    """a³ = 3 F R/(4 E) at Δ = a/32, L = 8 a: within 0.1 %, in free space."""
    hertz = cb.Contact.reduced(None)
    for load in (4.0 / 3.0, 4.0 / 3.0 * 1.021**3):
        radius = (0.75 * load) ** (1.0 / 3.0)
        state = cb.solve(hertz, load=load, model=cb.FreeSpace(cell=8.0, grid=256))
        assert state.contact_radius == pytest.approx(radius, rel=1e-3)
        assert abs(state.contact_radius - radius) < state.error["contact_radius"]


def test_a_repulsion_with_a_jump_of_its_pressure() -> None:
    contact = cb.Contact.reduced("maugis-dugdale", tabor=1.0, sign=-1)
    reference = cb.solve(contact, load=10.0)
    state = cb.solve(contact, load=10.0, model=cb.FreeSpace(cell=12.0, grid=64))
    assert abs(state.displacement - reference.displacement) < 2.0 * state.error["displacement"] + 2e-2


def test_errors_name_the_field_and_the_remedy() -> None:
    with pytest.raises(cb.InputError, match=r"^load: -50 cannot be reached"):
        cb.solve(ATTRACTION, load=-50.0, model=cb.FreeSpace(cell=10.0, grid=32))
    with pytest.raises(cb.InputError, match=r"^contact_radius: .*give a load"):
        cb.solve(ATTRACTION, contact_radius=1.0, model=cb.FreeSpace(cell=10.0, grid=32))
    with pytest.raises(cb.InputError, match=r"^grid: 33"):
        cb.FreeSpace(cell=10.0, grid=33)
    with pytest.raises(cb.InputError, match=r"^cell: "):
        cb.Periodic(cell=-1.0, grid=32)
    with pytest.raises(cb.InputError, match=r"^threads: 0"):
        cb.Periodic(cell=1.0, grid=32, threads=0)


def test_auto_takes_a_grid_only_for_tips_without_axial_symmetry() -> None:
    assert cb.solve(ATTRACTION, load=1.0).model.kind == "axisymmetric"
    ellipse = cb.Contact(tip=cb.EllipticParaboloid(radius_x=2.0, radius_y=0.5), interaction=cb.Gauss(1.0, 1.0))
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        state = cb.solve(ellipse, load=1.0, accuracy=1e-2)
    assert state.model.kind == "free"
    assert "no axial symmetry" in state.model.why
    round_one = cb.Contact(tip=cb.EllipticParaboloid(radius_x=1.0, radius_y=1.0), interaction=cb.Gauss(1.0, 1.0))
    assert cb.solve(round_one, load=1.0).model.kind == "axisymmetric"


def test_physical_contacts_give_the_same_numbers_in_their_units() -> None:
    contact = cb.Contact.physical(
        radius="1 um", modulus="5 GPa", interaction="gauss", work_of_adhesion="-40 mN/m", range="2 nm"
    )
    scales = contact.scales
    reduced = cb.Contact.reduced("gauss", tabor=contact.tabor, sign=-1)
    one = cb.solve(contact, load=8.0 * scales.load, model=cb.FreeSpace(cell=30.0 * scales.in_plane, grid=64))
    other = cb.solve(reduced, load=8.0, model=cb.FreeSpace(cell=30.0, grid=64))
    assert one.displacement == pytest.approx(other.displacement * scales.normal, rel=1e-9)
    assert one.cell.gap == pytest.approx(other.cell.gap * scales.normal, rel=1e-7)
    assert one.mean_gap == pytest.approx(other.mean_gap * scales.normal, rel=1e-9)


def test_saved_diagrams_keep_what_grids_add(tmp_path) -> None:  # type: ignore[no-untyped-def]
    diagram = traced(REPULSION, 8.0, 64)
    diagram.save(tmp_path / "d.h5")
    again = cb.load(tmp_path / "d.h5")
    assert [e.verdict for e in again.events] == [e.verdict for e in diagram.events]
    assert again.branches[0].fft_pairs.tolist() == diagram.branches[0].fft_pairs.tolist()
    assert again.branches[0].state(5).gap == pytest.approx(diagram.branches[0].state(5).gap)
