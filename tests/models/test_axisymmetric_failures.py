"""Laws that fail in the middle, values out of reach, units, and sums of laws."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
import pytest

import contbranch as cb
from contbranch.contact.law_check import check_laws


@dataclass(frozen=True)
class Broken(cb.Interaction):
    """exp(−x), spoiled below x = 0.5."""

    name: ClassVar[str] = ""
    way: str = "nan"

    def shape(self, x):
        f = np.exp(-x)
        if (x < 0.5).any():
            if self.way == "raise":
                raise ZeroDivisionError("the user's law divides by zero")
            f = np.where(x < 0.5, np.inf if self.way == "inf" else np.nan, f)
        return f, -f, f


@pytest.mark.parametrize(("way", "sign"), [("nan", 1.0), ("nan", -1.0), ("inf", 1.0), ("raise", -1.0)])
def test_a_law_that_fails_leaves_the_part_traced(way, sign):
    contact = cb.Contact(cb.Parabola(1.0), Broken(sign, 1.0, way), 1.0)
    if way == "raise":  # what it raises is passed on, with what was traced
        with pytest.raises(ZeroDivisionError, match="the user's law") as caught:
            cb.trace(contact)
        diagram = caught.value.partial
        assert "shape" in [entry.name for entry in caught.traceback]
    else:
        with pytest.warns(UserWarning, match="Broken: is not finite at gaps of 0, 0.1, 0.2, 0.4 ranges"):
            diagram = cb.trace(contact)
    assert diagram.status == "incomplete"
    assert diagram.message
    assert "\n" not in diagram.message
    if way == "raise":
        assert "divides by zero" in diagram.message
    branch = diagram.branches[0]
    assert len(branch) > 3
    assert np.isfinite(branch.load).all()
    assert branch.contact_radius.max() == 0.0
    assert branch.central_gap[-1] == pytest.approx(0.5, abs=0.05)
    # what was traced is what the law without the defect gives
    healthy = cb.Contact(cb.Parabola(1.0), cb.Exponential(sign, 1.0), 1.0)
    row = len(branch) // 2
    true = cb.solve(healthy, displacement=float(branch.displacement[row]), near=branch.state(row), accuracy=1e-8)
    assert branch.load[row] == pytest.approx(true.load, abs=2e-6)
    assert len(branch.state(row).r) == len(branch.state(row).gap)


def test_a_law_that_fails_at_once_is_told():
    @dataclass(frozen=True)
    class Never(cb.Interaction):
        name: ClassVar[str] = ""

        def shape(self, x):
            return np.nan * x, np.nan * x, np.nan * x

    with pytest.raises(cb.InputError, match="interaction: Never: is finite at none of the gaps"):
        cb.trace(cb.Contact(cb.Parabola(1.0), Never(1.0, 1.0), 1.0))


def of_shape(function):
    class Mine(cb.Interaction):
        def shape(self, x):
            return function(x)

    return cb.Contact(cb.Parabola(1.0), cb.Exponential(1.0, 0.5) + Mine(1.0, 2.0), 1.0)


WRONG = {
    "f' is not the derivative of f: at x = 0 it is 1, and differences give -1": lambda f: (f, f, f),
    "f'' is not the derivative of f': at x = 0 it is 1.01, and differences give 1": lambda f: (f, -f, 1.01 * f),
    r"returns arrays of shapes \(5,\), \(\), \(\) for x of shape \(5,\); must be the same": lambda f: (f, -1.0, 1.0),
}


@pytest.mark.parametrize("words", WRONG)
def test_a_law_with_a_slip_is_refused_with_the_numbers(words):
    contact = of_shape(lambda x: WRONG[words](np.exp(-x)))
    for compute in (cb.trace, cb.hysteresis, lambda contact: cb.solve(contact, load=1.0)):
        with pytest.raises(cb.InputError, match=r"interaction\[1\]: Mine: " + words):
            compute(contact)


def test_a_law_with_another_work_of_adhesion_draws_a_warning():
    with pytest.warns(UserWarning, match=r"f\(0\) is 0.5, documented as 1"):
        assert (
            cb.trace(of_shape(lambda x: (0.5 * np.exp(-x), -0.5 * np.exp(-x), 0.5 * np.exp(-x)))).status == "complete"
        )


def test_laws_with_kinks_and_steep_ones_are_taken():
    """Differences disagree with the derivatives at the kink at x = 1 alone, and hardly with 50 waves a range."""

    def kinked(x):
        inside = x < 1.0
        return np.where(inside, 1.0 - x, 0.0), np.where(inside, -1.0, 0.0), 0.0 * x

    def waves(x):
        f = np.exp(-x - 50j * x)
        return tuple((part * f).real for part in (1.0, -1.0 - 50j, (1.0 + 50j) ** 2))

    for shape in (kinked, waves):
        check_laws(of_shape(shape).interaction)


def test_where_the_pressure_of_a_law_jumps_the_message_says_so():
    step = of_shape(lambda x: (np.maximum(1.0 - x, 0.0), np.where(x < 1.0, -1.0, 0.0), 0.0 * x))
    diagram = cb.trace(step)
    assert diagram.status == "incomplete"
    assert "interaction[1]: the pressure of Mine jumps at x = 1: let it fall" in diagram.message
    assert "ask for less" not in diagram.message


def test_a_slip_of_the_programmer_is_passed_on():
    with pytest.raises(NameError, match="undefined"):
        cb.trace(of_shape(lambda x: undefined))  # noqa: F821


def test_a_table_that_ends_too_early():
    gaps = np.linspace(0.0, 2.0, 60)
    law = cb.Tabulated(gaps=tuple(gaps), energies=tuple(-np.exp(-gaps)))
    diagram = cb.trace(cb.Contact(cb.Parabola(1.0), law, 1.0))
    assert diagram.status == "complete"
    assert "ends at a gap of 2 before the law has decayed" in diagram.message
    begin = diagram.events[0]
    assert (begin.kind, begin.name) == ("end", "table-end")
    assert begin.central_gap == pytest.approx(2.0, abs=1e-9)
    assert diagram.branches[0].central_gap.max() == pytest.approx(2.0, abs=1e-9)


@pytest.mark.parametrize("range_", [30.0, 1.0])
def test_a_contact_that_grows_to_the_edge_of_its_tip(range_):
    """The film is felt out to the edge; dV = F dd between events, by splines through the rows."""
    contact = cb.Contact(cb.SphericalCap(1.0), cb.Exponential(1.0, range_), 1.0)
    diagram = cb.trace(contact, modes=0)
    assert diagram.status == "complete", diagram.message
    end = diagram.events[-1]
    assert (end.kind, end.name) == ("end", "tip-edge")
    assert end.contact_radius == pytest.approx(0.999)
    assert max(max(event.error.values()) for event in diagram.events) < 3e-6
    assert cb.trace(contact, accuracy=1e-4, max_load=100.0, modes=0).status == "incomplete"
    finer = cb.trace(contact, accuracy=1e-7, modes=0)
    for event, other in zip(diagram.events, finer.events, strict=True):
        for key, error in event.error.items():
            assert abs(getattr(event, key) - getattr(other, key)) <= error + other.error[key]


@pytest.mark.parametrize(("law", "folds"), [(cb.InverseSquare(-1.0, 0.5), 0), (cb.VanDerWaals(-1.0, 0.1), 2)])
def test_a_film_that_gives_way_at_the_edge_of_its_tip(law, folds):
    """The gap closes next to the edge; what softens at contact is squeezed out there, at a fold, before."""
    contact = cb.Contact(cb.SphericalCap(2.0), law, 1.0)
    diagram, finer = (cb.trace(contact, accuracy=accuracy, modes=0) for accuracy in (1e-4, 1e-6))
    assert diagram.status == finer.status == "complete", (diagram.message, finer.message)
    assert [event.name for event in diagram.events] == ["squeeze-out"] * folds + ["tip-edge"]
    for event, other in zip(diagram.events, finer.events, strict=True):
        for key, error in event.error.items():
            assert abs(getattr(event, key) - getattr(other, key)) <= error + other.error[key]


def test_a_table_of_a_law_gives_the_laws_diagram():
    gaps = np.linspace(0.0, 12.0, 1200)
    law = cb.Tabulated(gaps=tuple(gaps), energies=tuple(-np.exp(-(gaps**2) / 2)))
    table = cb.trace(cb.Contact(cb.Parabola(1.0), law, 1.0), max_load=1.0, modes=0)
    exact = cb.trace(cb.Contact.reduced(cb.Gauss, 1.0), accuracy=1e-8, max_load=1.0, modes=0)
    assert table.status == "complete", table.message
    assert table.thresholds["pull_off_load"] == pytest.approx(exact.thresholds["pull_off_load"], abs=2e-5)


def test_values_out_of_reach():
    contact = cb.Contact.reduced(cb.Exponential, 1.0)
    with pytest.raises(cb.InputError, match=r"load.*-100.*cannot be reached") as caught:
        cb.solve(contact, load=-100.0)
    assert "-5.227" in str(caught.value)
    assert "\n" not in str(caught.value)
    for wrong in (-1.0, 0.0, float("nan"), float("inf")):
        with pytest.raises(cb.InputError, match="contact_radius"):
            cb.solve(contact, contact_radius=wrong)
    with pytest.raises(cb.InputError, match="exactly one"):
        cb.solve(contact, load=1.0, displacement=1.0)
    with pytest.raises(cb.InputError, match="accuracy"):
        cb.trace(contact, accuracy=0.0)
    with pytest.raises(cb.InputError, match="max_load"):
        cb.trace(contact, max_load=-1.0)


@pytest.mark.parametrize("max_load", [0.5, 60.0])
def test_a_trace_ends_at_the_load_asked_for(max_load):
    diagram = cb.trace(cb.Contact.reduced(cb.Exponential, 1.0), max_load=max_load, accuracy=1e-8, modes=0)
    assert diagram.status == "complete"
    assert diagram.branches[0].load[-1] == pytest.approx(max_load, rel=1e-8)
    end = diagram.events[-1]
    assert end.kind == "end"
    assert end.load == pytest.approx(max_load, rel=1e-8)
    assert diagram.thresholds["pull_off_load"] == pytest.approx(-5.22785161, abs=1e-7)


def test_every_unit_system_gives_the_same_diagram():
    """The reduced contact with mu_T = 1.3, with R = 2, E = 3, |Δγ| = 5, and in nN and nm."""
    law, sign, tabor = cb.Gauss, -1, 1.3
    reduced = cb.trace(cb.Contact.reduced(law, tabor, sign), accuracy=1e-9)
    radius, modulus, work = 2.0, 3.0, 5.0
    length = work / modulus
    x, z = radius ** (2 / 3) * length ** (1 / 3), radius ** (1 / 3) * length ** (2 / 3)
    bare = cb.Contact(cb.Parabola(radius), law(sign * work, z / tabor), modulus)
    # 2 µm, 3 GPa and 5 N/m are 2000 nm, 3 nN/nm² and 5 nN/nm.
    other = (5.0 / 3.0) ** (1 / 3) * 2000.0 ** (2 / 3), (5.0 / 3.0) ** (2 / 3) * 2000.0 ** (1 / 3)
    physical = cb.Contact.physical(
        radius="2 um",
        modulus="3 GPa",
        interaction=law.name,
        work_of_adhesion=f"{sign * 5} N/m",
        range=f"{other[1] / tabor} nm",
    )
    for contact, scales in ((bare, (x, z)), (physical, other)):
        unit_x, unit_z = scales
        assert contact.tabor == pytest.approx(tabor, rel=1e-12)
        diagram = cb.trace(contact, accuracy=1e-9)
        load = 3.0 * unit_x * unit_z
        assert contact.scales.load == pytest.approx(load, rel=1e-12)
        assert set(diagram.thresholds) == set(reduced.thresholds)
        for name, value in diagram.thresholds.items():
            unit = load if name.endswith("_load") else unit_x if name.endswith("_radius") else unit_z
            assert value / unit == pytest.approx(reduced.thresholds[name], rel=3e-9, abs=3e-9), name
        for event, known in zip(diagram.events, reduced.events, strict=True):
            assert event.load / load == pytest.approx(known.load, rel=3e-9, abs=3e-9)
            assert event.error["load"] <= 1e-9 * max(load, abs(event.load)) * (1 + 1e-9)
        branch = diagram.branches[0]
        row = int(np.flatnonzero(branch.contact_radius > 0)[3])
        state = cb.solve(contact, contact_radius=float(branch.contact_radius[row]), accuracy=1e-9)
        assert state.load == pytest.approx(branch.load[row], rel=2e-6, abs=2e-6 * load)
        assert state.energy == pytest.approx(branch.energy[row], rel=2e-5, abs=2e-5 * load * unit_z)
        twin = cb.solve(
            cb.Contact.reduced(law, tabor, sign), contact_radius=state.contact_radius / unit_x, accuracy=1e-9
        )
        assert state.displacement / unit_z == pytest.approx(twin.displacement, abs=3e-9)
        assert state.energy / (load * unit_z) == pytest.approx(twin.energy, rel=1e-6, abs=1e-6)
        assert np.interp(0.5 * unit_x, state.r, state.pressure) / (load / unit_x**2) == pytest.approx(
            np.interp(0.5, twin.r, twin.pressure), abs=1e-6
        )


def test_a_sum_of_halves_is_the_whole():
    whole = cb.trace(cb.Contact.reduced(cb.Exponential, 1.0), accuracy=1e-9, max_load=1.0, modes=0)
    half = cb.Exponential(0.5, 1.0)
    parts = cb.trace(cb.Contact(cb.Parabola(1.0), half + half, 1.0), accuracy=1e-9, max_load=1.0, modes=0)
    assert parts.thresholds == pytest.approx(whole.thresholds, abs=3e-9)


@pytest.mark.parametrize(
    "law",
    [
        cb.VanDerWaals(1.0, 1.0) + cb.Exponential(-0.5, 0.2),
        cb.VanDerWaals(0.5, 1.0) + cb.Exponential(-1.0, 0.5),
        cb.InverseSquare(1.0, 0.5) + cb.Gauss(-1.5, 0.5),
    ],
    ids=["weak-barrier", "strong-barrier", "net-repulsion"],
)
def test_sums_of_attraction_and_repulsion_are_complete(law):
    contact = cb.Contact(cb.Parabola(1.0), law, 1.0)
    diagram = cb.trace(contact, accuracy=1e-5, modes=0)
    assert diagram.status == "complete", diagram.message
    again = cb.trace(contact, accuracy=1e-8, modes=0)
    assert [(e.kind, e.control, e.name) for e in diagram.events] == [(e.kind, e.control, e.name) for e in again.events]
    for event, known in zip(diagram.events[:-1], again.events[:-1], strict=True):
        assert abs(event.load - known.load) <= event.error["load"] + known.error["load"]


def test_solve_with_several_equilibria_returns_the_lowest_stable_one():
    contact = cb.Contact.reduced(cb.Gauss, 1.0, -1)
    load = 8.2  # between wetting (8.0065) and squeeze-out (8.3771)
    found = cb.solve(contact, load=load, accuracy=1e-9)
    assert len(found.states) == 3
    assert "3" in found.message
    stable = [state for state in found.states if state.unstable_load == 0]
    assert len(stable) == 2
    assert all(state.load == load for state in found.states)
    assert found.energy - load * found.displacement == min(s.energy - load * s.displacement for s in stable)
    other = max(stable, key=lambda s: s.energy - load * s.displacement)
    assert cb.solve(contact, load=load, near=other, accuracy=1e-9).contact_radius == pytest.approx(other.contact_radius)
    # the unstable state is a barrier between the two
    saddle = next(state for state in found.states if state.unstable_load == 1)
    assert saddle.energy - load * saddle.displacement > other.energy - load * other.displacement


def test_a_ring_under_a_cap_is_found_at_every_accuracy():
    """A film under a cap is squeezed out on a ring next to the edge, and the hole in the contact closes further on.

    Pressure in the middle of a disc is told by the film out to the edge of the tip, where h ends like a root. A step
    may lead so far that the gap seems to close at the edge first, which would be the end of the curve.
    """
    contact = cb.Contact(cb.SphericalCap(7.486), cb.InverseSquare(-1.0, 1.5605))
    coarse, fine = (cb.trace(contact, accuracy=accuracy, modes=0) for accuracy in (1e-4, 1e-5))
    for diagram in (coarse, fine):
        assert diagram.status == "complete", diagram.message
        assert [event.kind for event in diagram.events] == ["topology", "topology", "end"]
    for one, other in zip(coarse.events, fine.events, strict=True):
        for name, error in one.error.items():
            assert abs(getattr(one, name) - getattr(other, name)) <= error + other.error[name]


def test_a_tip_that_is_all_but_a_flat_punch_is_left_without_rows():
    diagram = cb.trace(cb.Contact(cb.PowerLaw(1e6, 1.0), cb.Gauss(1.0, 1.0)))
    assert (diagram.status, len(diagram.branches[0])) == ("incomplete", 0)
    assert "the mesh does not resolve the solution" in diagram.message
