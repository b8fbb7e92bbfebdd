"""Lennard-Jones contacts against published pull-off loads, and surface forces against their formulas."""

import math

import numpy as np
import pytest
from scipy.constants import N_A, e, epsilon_0, k

import contbranch as cb
from contbranch.contact.file import read_contact
from contbranch.contact.interaction_law import Interaction

# Pull-off loads over 2πRΔγ of the law without a wall by Tabor coefficient, from an independent code with 600 rings of
# pressure; 1 (Bradley) and 3/4 (JKR) are the limits.
PULL_OFF = {0.1: 0.98448, 0.5: 0.89374, 1.0: 0.83533, 3.0: 0.77552, 8.0: 0.75651}


def lennard_jones(tabor, core):
    return cb.Contact.reduced("lennard-jones", tabor, core=core)


@pytest.mark.parametrize("tabor", PULL_OFF)
def test_pull_off_of_a_soft_core(tabor):
    diagram = cb.trace(lennard_jones(tabor, "soft"))
    assert diagram.status == "complete"
    assert -diagram.thresholds["pull_off_load"] / (2 * math.pi) == pytest.approx(PULL_OFF[tabor], abs=1e-5)
    assert "touch_load" not in diagram.thresholds
    assert all(branch.load.max() <= 10.0 + 1e-6 for branch in diagram.branches)


def test_folds_of_soft_cores():
    """Displacements count from the minimum of the law; of the load folds at 3 the inner pair has no name."""
    found = cb.trace(lennard_jones(1.0, "soft")).thresholds
    assert found["jump_in_displacement"] == pytest.approx(-1.62921, abs=2e-5)
    assert found["pull_off_displacement"] == pytest.approx(-1.74342, abs=2e-5)
    folds = sorted(event.load / (2 * math.pi) for event in cb.trace(lennard_jones(3.0, "soft")).folds("load"))
    assert np.allclose(folds[1:], (-0.15440, -0.14645), atol=1e-5)


@pytest.mark.parametrize(("tabor", "load"), [(1.0, 0.83408), (3.0, 0.77532)])
def test_pull_off_of_a_wall_in_the_minimum(tabor, load):
    found = cb.trace(lennard_jones(tabor, "wall")).thresholds
    assert -found["pull_off_load"] / (2 * math.pi) == pytest.approx(load, abs=1e-5)


def test_a_rigid_tip_in_a_soft_core():
    """F(h) = 2πR v(h), so that the load is largest in the minimum of the law."""
    contact = lennard_jones(0.002, "soft")
    assert cb.trace(contact).thresholds["pull_off_load"] == pytest.approx(-2 * math.pi, rel=1e-4)


class TwelveSix(Interaction):
    """The same law as a user may write it, with the wall inside of the core, at half the distance of the minimum."""

    def shape(self, x):
        u = 1.0 / (0.5 + x)
        square, eighth = u * u, u**8
        return (4 * square - eighth) / 3, 8 / 3 * u * (eighth - square), 8 * square * (square - 3 * eighth)


def test_name_class_and_table_agree():
    tabor = 2.0
    named = cb.trace(lennard_jones(tabor, "soft"))
    own = cb.trace(cb.Contact(cb.Parabola(1.0), TwelveSix(1.0, 1 / tabor)))
    gaps = np.geomspace(0.5, 60.0, 400) / tabor
    u = 1 / (tabor * gaps)
    table = cb.Tabulated(gaps - gaps[0], energies=-(4 * u**2 - u**8) / 3)
    tabulated = cb.trace(cb.Contact(cb.Parabola(1.0), table))
    for other, tolerance in ((own, 1e-6), (tabulated, 1e-3)):
        assert other.thresholds["pull_off_load"] == pytest.approx(named.thresholds["pull_off_load"], rel=tolerance)
        shift = other.thresholds["jump_in_displacement"] - named.thresholds["jump_in_displacement"]
        assert shift == pytest.approx(-0.5 / tabor, abs=3 * tolerance)


def test_contact_radius_of_a_soft_core_is_where_the_tension_peaks():
    contact = lennard_jones(2.0, "soft")
    state = cb.solve(contact, load=1.0)
    r, pressure = state.profile.r, state.profile.pressure
    at = int(np.argmin(pressure))
    assert r[at - 1] < state.contact_radius < r[at + 1]
    assert state.central_gap < 0.0
    again = cb.solve(contact, contact_radius=state.contact_radius)
    assert again.load == pytest.approx(1.0, abs=1e-5)


def test_the_energy_of_a_soft_core_changes_by_the_work():
    contact, step = lennard_jones(0.5, "soft"), 1e-3
    below, state, above = (cb.solve(contact, displacement=1.0 + k * step, accuracy=1e-9) for k in (-1, 0, 1))
    assert (above.energy - below.energy) / (2 * step) == pytest.approx(state.load, rel=1e-6)


def test_sensitivities_of_a_soft_core():
    def thresholds(width):
        return cb.trace(cb.Contact(cb.Parabola(1.0), cb.LennardJones(1.0, width, "soft")), accuracy=1e-8).thresholds

    found = cb.trace(lennard_jones(2.0, "soft"), accuracy=1e-8).sensitivities
    step = 1e-3
    more, less = thresholds(0.5 + step), thresholds(0.5 - step)
    for name in ("pull_off_load", "pull_off_radius", "pull_off_displacement_radius"):
        assert found[name]["range"] == pytest.approx((more[name] - less[name]) / (2 * step), rel=1e-3)


def test_soft_cores_are_saved_and_refused_on_grids(tmp_path):
    contact = lennard_jones(1.0, "soft")
    assert cb.Contact.from_description(contact.describe()) == contact
    with pytest.raises(cb.InputError, match="core='wall'"):
        cb.trace(contact, model=cb.FreeSpace(cell=8.0, grid=32))
    for arguments in ({"core": "hard"}, {"work_of_adhesion": -1.0, "core": "soft"}):
        with pytest.raises(cb.InputError):
            cb.LennardJones(**{"work_of_adhesion": 1.0, "range": 1.0, **arguments})


# -- double layers ----------------------------------------------------------------------------------------------------
GAPS = np.array([0.0, 0.5, 3.0, 20.0])


def hyperbolic(first, second, x):
    """(a² + b²) (1 - coth x) + 2ab csch x."""
    return (first**2 + second**2) * (1 - 1 / np.tanh(x)) + 2 * first * second / np.sinh(x)


def test_constant_potential():
    law = cb.DoubleLayer(surface_potentials=(-40.0, -15.0), debye_length=5.0, cutoff=0.3, permittivity=80.0)
    x = (GAPS + 0.3) / 5.0
    expected = 80 * epsilon_0 / (2 * 5e-9) * hyperbolic(-0.040, -0.015, x)
    assert np.allclose(law.evaluate(GAPS).energy, expected, rtol=1e-12)
    assert law.reference_work == pytest.approx(abs(expected).max())


def test_constant_charge():
    law = cb.DoubleLayer(surface_charges=(4.0, 1.0), concentration=0.01, valency=2, cutoff=0.2, temperature=300.0)
    epsilon = 78.4 * epsilon_0
    length = math.sqrt(epsilon * k * 300.0 / (2e3 * N_A * 0.01 * (2 * e) ** 2))
    assert law.range == pytest.approx(1e9 * length)
    x = (GAPS + 0.2) * 1e-9 / length
    expected = -length / (2 * epsilon) * hyperbolic(4e-3, -1e-3, x)
    assert np.allclose(law.evaluate(GAPS).energy, expected, rtol=1e-12)


def test_equal_potentials_need_no_cutoff():
    law = cb.DoubleLayer(surface_potentials=(25.0, 25.0), debye_length=10.0)
    expected = 78.4 * epsilon_0 / 1e-8 * 0.025**2 * (1 - np.tanh(GAPS / 20.0))
    assert np.allclose(law.evaluate(GAPS).energy, expected, rtol=1e-12)
    scaled = law.scaled(2.0, 1e-4)
    assert np.allclose(scaled.evaluate(GAPS / 2.0).energy, expected / 1e-4, rtol=1e-12)


def test_double_layers_are_for_physical_contacts():
    law = cb.DoubleLayer(surface_potentials=(25.0, 25.0), debye_length=10.0)
    with pytest.warns(UserWarning, match="mV and nm"):
        cb.Contact(cb.Parabola(1.0), law)
    contact = cb.Contact.physical(modulus="1 GPa", radius="1 um", interaction=law)
    assert contact.to_reduced().interaction.in_nm is False


@pytest.mark.parametrize(
    ("arguments", "field"),
    [
        ({"surface_potentials": (10.0, 10.0)}, "debye_length"),
        ({"surface_potentials": (10.0, 10.0), "debye_length": 1.0, "concentration": 0.1}, "debye_length"),
        ({"debye_length": 1.0}, "surface_potentials"),
        ({"surface_potentials": 10.0, "debye_length": 1.0}, "surface_potentials"),
        ({"surface_potentials": (10.0, 20.0), "debye_length": 1.0}, "cutoff"),
        ({"surface_charges": (1.0, 1.0), "debye_length": 1.0}, "cutoff"),
        ({"surface_charges": (1.0, 1.0), "debye_length": -1.0, "cutoff": 1.0}, "debye_length"),
        ({"surface_potentials": (0.0, 0.0), "debye_length": 1.0}, "surface_potentials"),
    ],
)
def test_impossible_double_layers(arguments, field):
    with pytest.raises(cb.InputError, match=field):
        cb.DoubleLayer(**arguments)


# -- other names of laws ----------------------------------------------------------------------------------------------
def test_laws_by_the_names_of_surface_forces():
    assert cb.hamaker("1e-20 J") == cb.InverseSquare(1e-2 / (12 * math.pi * 0.165**2), 0.165)
    assert cb.hydration("10 mJ/m^2", "0.3 nm") == cb.Exponential(-0.01, 0.3)
    law = cb.structural("5 mN/m", period="0.8 nm", decay="1 nm")
    expected = 5e-3 * np.exp(-GAPS) * np.cos(2 * np.pi * GAPS / 0.8)
    assert np.allclose(law.evaluate(GAPS).energy, expected, atol=1e-16)
    with pytest.raises(cb.InputError, match="hamaker_constant"):
        cb.hamaker("1e-20 N")


def test_contact_file_of_surface_forces(tmp_path):
    path = tmp_path / "dlvo.toml"
    path.write_text(
        '[tip]\nshape = "parabola"\nradius = "5 um"\n[material]\nmodulus = "50 GPa"\n'
        '[[interaction]]\nlaw = "hamaker"\nhamaker_constant = "1e-20 J"\ncutoff = "0.2 nm"\n'
        '[[interaction]]\nlaw = "double-layer"\nsurface_potentials = ["-30 mV", "-30 mV"]\nconcentration = "1 mM"\n'
        '[[interaction]]\nlaw = "lennard-jones"\nwork_of_adhesion = "1 mN/m"\nrange = "0.3 nm"\ncore = "wall"\n'
    )
    contact, _ = read_contact(path)
    first, second, third = contact.interaction.terms
    assert first == cb.hamaker("1e-20 J", "0.2 nm")
    assert second == cb.DoubleLayer(surface_potentials=(-30.0, -30.0), concentration=1e-3)
    assert third == cb.LennardJones(1e-3, 0.3)
    assert cb.Contact.from_description(contact.describe()) == contact
    path.write_text(path.read_text().replace('"-30 mV"]', '"-30 m"]'))
    with pytest.raises(cb.InputError, match=r"interaction\[1\]\.surface_potentials"):
        read_contact(path)


def test_jump_in_of_a_rigid_sphere_on_a_spring():
    """By van der Waals forces at the distance (A R/3k)^(1/3), here 2.55436 nm."""
    contact = cb.Contact.physical(
        modulus="1000 GPa", radius="50 nm", interaction="hamaker", hamaker_constant="1e-19 J", cutoff="0.165 nm"
    )
    diagram = cb.trace(contact, control=cb.Spring("0.1 N/m"))
    (event,) = (one for one in diagram.events if one.name == "jump-in" and one.control == "spring")
    assert event.central_gap + 0.165 == pytest.approx((0.1 * 50 / (3 * 0.1)) ** (1 / 3), abs=1e-5)
