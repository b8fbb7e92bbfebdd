"""Contacts: reduced and physical descriptions of the same thing, scales, and what is refused."""

import copy
import dataclasses
import json
import pickle

import numpy as np
import pytest

from contbranch.contact.contact import Contact
from contbranch.contact.interactions import (
    Exponential,
    Gauss,
    Interaction,
    Layered,
    MaugisDugdale,
    Tabulated,
    VanDerWaals,
)
from contbranch.contact.tips import Cone, Parabola, PowerLaw, Profile, SphericalCap
from contbranch.contact.units import PHYSICAL, REDUCED
from contbranch.errors import InputError

OMCTS = {
    "radius": "1 um",
    "modulus": "5 GPa",
    "interaction": "gauss",
    "work_of_adhesion": "-40 mN/m",
    "range": "1 nm",
}


def test_reduced():
    contact = Contact.reduced(Gauss, tabor=4.0, sign=-1)
    assert contact == Contact(Parabola(1.0), Gauss(-1.0, 0.25), 1.0)
    assert contact == Contact.reduced("gauss", 4.0, -1)
    assert contact.tabor == 4.0
    assert contact.units == REDUCED
    assert contact.to_reduced() is contact
    scales = contact.scales
    assert (scales.in_plane, scales.normal, scales.load, scales.pressure, scales.energy) == (1.0, 1.0, 1.0, 1.0, 1.0)
    assert Contact.reduced(Layered, 2.0, wavelength=0.3, phase=0.1).interaction == Layered(1.0, 0.5, 0.3, 0.1)
    assert Contact.reduced(None).tabor is None


def test_physical_units_of_the_papers_estimate():
    # the estimate for experiments, R = 1 µm, E = 5 GPa, Δγ = -40 mN/m, z0 = 1 nm; μ_T = 0.40, and (23)-(26)
    contact = Contact.physical(**OMCTS)
    assert contact == Contact(Parabola(1000.0), Gauss(-0.04, 1.0), 5.0, PHYSICAL)
    assert contact.tabor == pytest.approx(0.4, rel=1e-14)
    assert contact.scales.in_plane == pytest.approx(20.0, rel=1e-14)
    assert contact.scales.normal == pytest.approx(0.4, rel=1e-14)
    assert contact.scales.load == pytest.approx(40.0, rel=1e-14)
    reduced = contact.to_reduced()
    assert reduced.units == REDUCED
    assert reduced.modulus == 1.0
    assert reduced.tip.radius == pytest.approx(1.0, rel=1e-14)
    assert reduced.interaction.work_of_adhesion == pytest.approx(-1.0, rel=1e-14)
    assert reduced.interaction.range == pytest.approx(2.5, rel=1e-14)  # 1/μ_T


def test_physical_takes_numbers_in_nanometres_too():
    numbers = {"radius": 1000.0, "modulus": 5, "work_of_adhesion": -0.04, "range": 1.0}
    assert Contact.physical(interaction=Gauss, **numbers) == Contact.physical(**OMCTS)
    assert Contact.physical(tip=Parabola(1000.0), modulus=5, interaction=Gauss(-0.04, 1.0)) == Contact.physical(**OMCTS)
    cone = Contact.physical(tip="cone", slope=0.3, modulus="1 MPa")
    assert cone == Contact(Cone(0.3), None, 0.001, PHYSICAL)


CONTACTS = [
    Contact.physical(**OMCTS),
    Contact(Parabola(2.0), VanDerWaals(0.3, 0.1) + Exponential(-0.5, 0.4), 3.0),
    Contact(Cone(0.2), MaugisDugdale(0.3, 0.1), 3.0),
    Contact(PowerLaw(3.5, 2.0), Layered(0.3, 0.1, 0.07, 0.2), 3.0),
    Contact(SphericalCap(7.0), Tabulated(np.linspace(0, 4, 9), np.exp(-2 * np.linspace(0, 4, 9))), 2.0, PHYSICAL),
    Contact(Profile([0, 1, 2, 3], [0, 1, 4, 9.5]), Tabulated([0, 1, 2, 3], pressures=[1, 0.3, 0.1, 0]), 2.0, PHYSICAL),
    Contact(Parabola(5.0), None, 2.0),
]
each = pytest.mark.parametrize("contact", CONTACTS, ids=lambda contact: contact.tip.name)


@each
def test_reduced_contact_is_the_same_contact(contact):
    reduced, scales = contact.to_reduced(), contact.scales
    assert reduced.modulus == 1.0
    assert reduced.scales.in_plane == pytest.approx(1.0, rel=1e-13)
    assert reduced.scales.normal == pytest.approx(1.0, rel=1e-13)
    r = np.array([0.1, 1.3, 2.9])
    np.testing.assert_allclose(
        reduced.tip.height(r / scales.in_plane) * scales.normal, contact.tip.height(r), rtol=1e-11
    )
    if contact.interaction is None:
        assert reduced.interaction is None
        return
    assert reduced.interaction.reference_work == pytest.approx(1.0, rel=1e-13)
    assert reduced.tabor == pytest.approx(contact.tabor, rel=1e-12)
    strongest = max(reduced.interaction.terms, key=lambda law: law.reference_work)
    assert 1.0 / strongest.range == pytest.approx(contact.tabor, rel=1e-12)  # z0 = 1/μ_T
    gap = np.array([0.0, 0.05, 0.4])
    mine, its = contact.interaction.evaluate(gap), reduced.interaction.evaluate(gap / scales.normal)
    np.testing.assert_allclose(its.pressure * scales.pressure, mine.pressure, rtol=1e-10, atol=1e-13)
    np.testing.assert_allclose(its.energy * scales.energy_per_area, mine.energy, rtol=1e-11, atol=1e-13)


def test_scales_without_interaction_are_those_of_the_tip():
    # R = 5, E = 2: lengths in R, loads in E R²
    scales = Contact(Parabola(5.0), None, 2.0).scales
    assert scales.in_plane == pytest.approx(5.0)
    assert scales.normal == pytest.approx(5.0)
    assert scales.load == pytest.approx(50.0)


def test_strongest_law_sets_the_tabor_coefficient():
    contact = Contact(Parabola(1.0), VanDerWaals(0.25, 0.1) + Exponential(-0.75, 0.5))
    assert contact.tabor == pytest.approx(2.0)  # |0.25| + |-0.75| = 1, so Z = 1; z0 = 0.5


@each
def test_description_makes_the_contact_again(contact):
    description = json.loads(json.dumps(contact.describe(), allow_nan=False))
    again = Contact.from_description(description)
    assert again == contact
    assert hash(again) == hash(contact)
    assert again.units == contact.units


def test_description_follows_the_contact_file():
    assert Contact.physical(**OMCTS).describe() == {
        "units": "physical",
        "tip": {"shape": "parabola", "radius": 1000.0},
        "material": {"modulus": 5.0},
        "interaction": [{"law": "gauss", "work_of_adhesion": -0.04, "range": 1.0}],
        "tabor": pytest.approx(0.4),
    }


@dataclasses.dataclass(frozen=True)
class Mine(Gauss):  # inherits the name of a law but is another
    table: tuple = (1.0, 2.0)
    helper: object = len


def test_law_of_the_users_own_is_made_again_where_its_class_is_there():
    contact = Contact(Parabola(1.0), Mine(1.0, 0.5))
    description = json.loads(json.dumps(contact.describe()))
    (law,) = description["interaction"]
    assert law["law"].endswith("Mine")
    assert law["user_defined"] is True
    assert law["table"] == [1.0, 2.0]
    assert law["range"] == 0.5
    assert Contact.from_description(description) == contact
    law["law"] = "elsewhere.Mine"
    with pytest.raises(InputError, match=r"^interaction\[0\]: '.*Mine' is not part of contbranch; make the contact"):
        Contact.from_description(description)
    assert Contact.reduced(Mine, 2.0, table=(3.0,)).interaction == Mine(1.0, 0.5, (3.0,))


def test_broken_descriptions():
    good = Contact.physical(**OMCTS).describe()
    for change, message in (
        ({"tip": {"shape": "sphere"}}, "tip.shape: 'sphere'; must be one of"),
        ({"tip": {"shape": "parabola"}}, "tip.radius: missing"),
        ({"material": {}}, "modulus: None; must be"),
        ({"units": "SI"}, "units: 'SI'"),
        ({"interaction": [{"law": "gauss", "range": 1.0}]}, r"interaction\[0\].work_of_adhesion: missing"),
    ):
        with pytest.raises(InputError, match=message):
            Contact.from_description({**good, **change})


@each
def test_contacts_are_immutable_values(contact):
    with pytest.raises(dataclasses.FrozenInstanceError):
        contact.modulus = 2.0
    _ = contact.scales, contact.tabor  # what is kept of them does not count
    for other in (copy.deepcopy(contact), pickle.loads(pickle.dumps(contact)), dataclasses.replace(contact)):
        assert other == contact
        assert hash(other) == hash(contact)
    assert dataclasses.replace(contact, modulus=77.0) != contact
    assert len({contact, dataclasses.replace(contact)}) == 1


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"radius": "-1 um"}, "radius: -1000; must be greater than zero"),
        ({"radius": "1 GPa"}, "radius: '1 GPa': 'GPa' is not a unit of length; write for example '1 um'"),
        ({"radius": "1"}, "radius: '1' has no unit"),
        ({"modulus": "0 GPa"}, "modulus: 0; must be greater than zero"),
        ({"modulus": "1 nm"}, "modulus: '1 nm': 'nm' is not a unit of pressure"),
        ({"modulus": float("nan")}, "modulus: nan; must be a finite number"),
        ({"range": "0 nm"}, "range: 0; must be greater than zero"),
        ({"work_of_adhesion": "0 mN/m"}, "work_of_adhesion: 0; must not be zero"),
        ({"work_of_adhesion": "40 mN"}, "work_of_adhesion: '40 mN': 'mN' is not a unit of energy per area"),
        ({"interaction": "gaus"}, r"interaction: 'gaus'; must be one of exponential, .*; did you mean 'gauss'\?"),
        ({"interaction": None}, "work_of_adhesion: not known; must be one of radius"),
        ({"tip": "parabel"}, r"tip: 'parabel'; must be one of parabola, .*; did you mean 'parabola'\?"),
        ({"tip": "cone"}, "radius: not known; must be one of slope"),
        ({"raduis": "1 um"}, r"raduis: not known; .*; did you mean 'radius'\?"),
    ],
)
def test_wrong_physical_contacts(change, message):
    with pytest.raises(InputError, match=message) as error:
        Contact.physical(**{**OMCTS, **change})
    assert "\n" not in str(error.value)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ((Gauss, 0.0), "tabor: 0; must be greater than zero"),
        ((Gauss, -1.0), "tabor: -1; must be greater than zero"),
        ((Gauss, float("nan")), "tabor: nan; must be a finite number"),
        ((Gauss, 1.0, 2), "sign: 2; must be 1"),
        (("nonsense", 1.0), "interaction: 'nonsense'; must be one of exponential"),
        ((Layered, 1.0, 1, {"wavelenght": 0.1}), r"wavelenght: not known; .*; did you mean 'wavelength'\?"),
        ((Tabulated, 1.0), "interaction: tabulated brings its own range"),
    ],
)
def test_wrong_reduced_contacts(arguments, message):
    *rest, last = arguments
    keywords = last if isinstance(last, dict) else {}
    with pytest.raises(InputError, match=message):
        Contact.reduced(*rest, *([] if keywords else [last]), **keywords)


def test_wrong_parts():
    law = Gauss(1.0, 1.0)
    for arguments, message in (
        (("parabola",), "tip: str; must be a tip such as"),
        ((Parabola(1.0), "gauss"), "interaction: str; must be a law such as"),
        ((Parabola(1.0), Gauss), "interaction: type; must be a law"),
        ((Parabola(1.0), law, "5 GPa"), "modulus: '5 GPa'; must be a number"),
        ((Parabola(1.0), law, -1.0), "modulus: -1; must be greater than zero"),
        ((Parabola(1.0), law, 1.0, "physical"), "units: 'physical'; must be REDUCED or PHYSICAL"),
    ):
        with pytest.raises(InputError, match=message):
            Contact(*arguments)
    with pytest.raises(InputError, match="radius: missing; Parabola needs it"):
        Contact.physical(modulus=1.0)


def test_any_law_with_the_interface_is_accepted():
    class Linear(Interaction):
        def shape(self, x):
            inside = x < 1.0
            return np.where(inside, (1 - x) ** 2, 0.0), np.where(inside, 2 * (x - 1), 0.0), np.where(inside, 2.0, 0.0)

    contact = Contact(Parabola(4.0), Linear(2.0, 0.5), 3.0)
    assert contact.to_reduced().interaction.range == pytest.approx(1.0 / contact.tabor)
    assert Contact.reduced(Linear, 2.0, -1).interaction.evaluate(0.0).energy == 1.0
