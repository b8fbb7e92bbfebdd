"""What is said of numbers outside of the theory, or in other units than they are taken to be in."""

from __future__ import annotations

import math
import warnings
from collections.abc import Callable

import numpy as np
import pytest

import contbranch as cb
from contbranch.advice import regime


def physical(**quantities: object) -> cb.Contact:
    given = {"radius": "1 um", "modulus": "50 MPa", "work_of_adhesion": "40 mN/m", "range": "5 nm"}
    return cb.Contact.physical(**{"interaction": "maugis-dugdale", **given, **quantities})


def test_a_contact_wider_than_the_tip_is_blunt_is_noted_once() -> None:
    """Hertz: a³ = 3FR/4E, so that a/R = 0.3 at F = 0.036 E R² = 1800 nN; a slope of a/R for a parabola."""
    contact = cb.Contact(cb.Parabola(1000.0), modulus=0.05, units=physical().units)
    edge = 4.0 / 3.0 * 0.05 * 1000.0**2 * 0.3**3
    assert "slope" not in cb.solve(contact, load=0.99 * edge).message
    beyond = cb.solve(contact, load=2.0 * edge).message
    assert beyond.count("slope") == 2  # of the sentence
    assert f"(largest {0.3 * math.cbrt(2.0):.2g})" in beyond
    diagram = cb.trace(contact, max_load=2.0 * edge)
    assert (diagram.status, diagram.message.count("beyond linear elasticity")) == ("complete", 1)
    assert "beyond" not in cb.trace(cb.Contact.reduced(cb.MaugisDugdale)).message  # has no size of its own
    cone = cb.Contact(cb.Cone(0.4), modulus=0.05, units=contact.units)
    assert "(largest 0.4)" in cb.solve(cone, load=10.0).message


def test_a_table_of_heights_that_ends_inside_of_what_bears_load_is_noted() -> None:
    """The table of a parabola: Hertz's contact reaches its end at F = 4 a³/3, a film at the displacement a²."""
    radii = np.linspace(0.0, 1.5, 12)
    tip = cb.Profile(tuple(radii), tuple(radii**2 / 2.0))
    bare, covered = cb.Contact(tip), cb.Contact(tip, cb.Exponential(-1.0, 1.0))
    assert "table ends" not in cb.solve(bare, load=0.99 * 4.5).message
    assert (
        "tip: its table ends at a radius of 1.5; from a load of 4.545 on, what continues it bears load, too."
        in cb.solve(bare, load=1.01 * 4.5).message
    )
    states = [cb.solve(covered, displacement=share * 1.5**2, accuracy=1e-2) for share in (0.99, 1.01)]
    assert [state.contact_radius for state in states] == [0.0, 0.0]
    assert ["table ends" in state.message for state in states] == [False, True]


def test_a_range_below_an_atoms_size_is_noted() -> None:
    assert "interaction.range: 0.05 nm is less than an atom's size (0.1 nm)." in cb.trace(physical(range=0.05)).message
    assert cb.trace(physical(range=0.11)).message == ""


def test_a_range_not_small_against_a_parabolas_radius_is_noted() -> None:
    """A rigid sphere is pulled with less by about the ratio of both."""
    message = cb.trace(physical(radius=10.0, range=2.0)).message
    assert "interaction.range: is 0.2 of the tip's radius" in message
    sphere = cb.Contact.physical(
        tip="spherical-cap", radius=10.0, modulus=5.0, interaction="gauss", work_of_adhesion=0.04, range=2.0
    )
    assert "of the tip's radius" not in cb.trace(sphere).message


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ({"radius": 1e-6}, "tip.radius: 1e-06 is taken in nm; write '1e-06 m' if that is meant"),
        ({"range": 1e-9}, "interaction.range: 1e-09 is taken in nm; write '1e-09 m'"),
        ({"modulus": 5e9}, r"modulus: 5e\+09 is taken in nN/nm² = GPa, and diamond has 1100; write '5e\+09 Pa'"),
        ({"modulus": "5 mPa"}, "modulus: 0.005 Pa is softer than any solid; mPa is a millipascal"),
        ({"work_of_adhesion": "40 N/m"}, "interaction.work_of_adhesion: 40 N/m is more than any surface has"),
    ],
)
def test_numbers_in_metres_and_pascals_draw_a_warning(given: dict[str, float], words: str) -> None:
    with pytest.warns(UserWarning, match=words):
        physical(**given)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        physical()
        cb.Contact(cb.Parabola(1e-6), cb.Gauss(0.04, 1e-9), 5e9)  # a set of units of the user's own


@pytest.mark.parametrize(("tabor", "near"), [(0.02, "near DMT"), (0.5, "between DMT and JKR"), (8.0, "near JKR")])
def test_the_tabor_coefficient_is_explained_by_numbers(tabor: float, near: str) -> None:
    """JKR −3π/2 and DMT −2π, against the pull-off load traced."""
    contact = cb.Contact.reduced(cb.MaugisDugdale, tabor=tabor)
    diagram = cb.trace(contact)
    said = str(diagram)
    assert f"Tabor coefficient {tabor:g}, {near}." in said
    load = diagram.thresholds["pull_off_load"]
    assert f"JKR {abs(1.5 * math.pi / load + 1.0):.2g}" in said
    assert f"DMT {abs(2.0 * math.pi / load + 1.0):.2g}" in said
    assert near in regime(contact)
    assert ("would do, in milliseconds" in said) == (tabor != 0.5)


def test_repulsion_has_a_tabor_coefficient_too() -> None:
    found = cb.solve(cb.Contact.reduced(cb.Gauss, tabor=2.0, sign=-1), load=1.0)
    assert "Tabor coefficient 2: " in str(found)
    assert np.isfinite(found.load)


def absurd(law: type[cb.Interaction] = cb.Gauss, **given: float) -> cb.Contact:
    values = {"radius": 1.0, "modulus": 1.0, "work_of_adhesion": -1.0, "range": 0.25, **given}
    tip = cb.PowerLaw(values["exponent"], 1.0) if "exponent" in values else cb.Parabola(values["radius"])
    return cb.Contact(tip, law(values["work_of_adhesion"], values["range"]), values["modulus"])


@pytest.mark.parametrize(
    "given",
    [
        *({"radius": value} for value in (1e-320, 1e-160, 1e300)),
        *({"modulus": value} for value in (1e-320, 1e-300, 1e300)),
        *({"work_of_adhesion": value} for value in (1e-320, -1e-200, 1e300)),
        *({"range": value} for value in (1e-320, 1e-200, 1e-8, 1e8, 1e300)),
        *({"exponent": value} for value in (1.0000001, 1e3, 1e6)),
    ],
)
def test_numbers_of_absurd_size_end_in_a_result_or_in_one_line(given: dict[str, float]) -> None:
    contact = absurd(**given)
    for compute in (cb.trace, cb.hysteresis, lambda contact, **how: cb.solve(contact, load=1.0, **how)):
        try:
            told = compute(contact, time_limit=0.1).status
        except (cb.InputError, cb.ModelError) as error:
            told = str(error)
        assert told
        assert "\n" not in told


GAPS, ENERGIES = (0.0, 1.0, 2.0, 3.0), (-1.0, -0.5, -0.1, -0.0)


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: cb.Tabulated(tuple(1e300 * gap for gap in GAPS), ENERGIES), "gaps: up to 3e.300; must be between"),
        (lambda: cb.Tabulated(GAPS, tuple(1e-200 * energy for energy in ENERGIES)), "energies: up to 1e-200"),
        (lambda: cb.Profile((0.0, 1e-20, 1.0, 2.0), (0.0, 1e-40, 0.5, 2.0)), "radii: entries closer than"),
        (lambda: cb.Contact(cb.Parabola(1.0), cb.Layered(1.0, 0.5, 1e-300)).scales, "a range or wavelength of 1e-300"),
        (lambda: cb.trace(absurd(), model=cb.Periodic(cell=1e300, grid=64)), "cell: 1e.300 of the contact's own"),
        (lambda: cb.trace(SMALL, model=cb.Periodic(cell=5.0, grid=16)), "grid: no node of it lies under the tip"),
        (lambda: cb.trace(cb.Contact(cb.EllipticParaboloid(0.1, 0.2)), max_load=1.7e308), "max_load, in reduced units"),
        (
            lambda: cb.trace(cb.Contact(cb.Cone(1.0), cb.MaugisDugdale(1.0, 1.0) + cb.MaugisDugdale(-1.0, 2.0))),
            "that repel cannot be added",
        ),
    ],
)
def test_tables_cells_and_loads_of_absurd_size_are_refused(make: Callable[[], object], words: str) -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        with pytest.raises(cb.InputError, match=words):
            make()


SMALL = cb.Contact(cb.SphericalCap(0.03), cb.MaugisDugdale(-1.0, 1.0))
