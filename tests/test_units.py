"""Units: conversions known from their definitions, (43)-(46) from Maugis' choice of πΔγ and 4E/3, and refusals."""

import math
import subprocess
import sys
from functools import cache

import numpy as np
import pint
import pytest

from contbranch.contact.contact import Contact
from contbranch.contact.units import (
    PHYSICAL,
    REDUCED,
    Scales,
    Units,
    finite_number,
    parse,
    positive_number,
)
from contbranch.errors import InputError


@pytest.mark.parametrize(
    ("text", "dimension", "value"),
    [
        ("1 um", "length", 1000.0),
        ("1 µm", "length", 1000.0),
        ("1 μm", "length", 1000.0),
        ("10 angstrom", "length", 1.0),
        ("-3nm", "length", -3.0),
        ("2.5e-9 m", "length", 2.5),
        ("5 GPa", "pressure", 5.0),
        ("70 MPa", "pressure", 0.07),
        ("3 N/m^2", "pressure", 3e-9),
        ("-40 mN/m", "energy per area", -0.04),
        ("-40 mJ/m²", "energy per area", -0.04),
        ("-40 mJ m^-2", "energy per area", -0.04),
        ("0.1 N/m", "stiffness", 0.1),
        ("0.1 N·m⁻¹", "stiffness", 0.1),
        ("5 nN", "force", 5.0),
        ("1 uN", "force", 1000.0),
        ("1e-18 J", "energy", 1.0),
        ("180 deg", "dimensionless", math.pi),
        ("0.25", "dimensionless", 0.25),
        (3, "length", 3.0),
        (np.float64(0.5), "pressure", 0.5),
    ],
)
def test_quantities(text, dimension, value):
    assert parse(text, dimension, "field") == pytest.approx(value, rel=1e-15)


def test_decimal_units_are_exact():
    assert parse("1 um", "length", "field") == 1000.0
    assert parse("5 GPa", "pressure", "field") == 5.0


@pytest.mark.parametrize(
    ("text", "dimension", "message"),
    [
        ("5 GPa", "length", "radius: '5 GPa': 'GPa' is not a unit of length; write for example '1 um'"),
        ("5 nm", "pressure", "radius: '5 nm': 'nm' is not a unit of pressure; write for example '5 GPa'"),
        (
            "5 nN",
            "energy per area",
            "radius: '5 nN': 'nN' is not a unit of energy per area; write for example '-40 mN/m'",
        ),
        ("5 nN", "stiffness", "'nN' is not a unit of stiffness; write for example '0.1 N/m'"),
        ("5 J", "force", "'J' is not a unit of force; write for example '5 nN'"),
        ("5 N", "energy", "'N' is not a unit of energy; write for example '2 aJ'"),
        ("5 nm", "dimensionless", "'nm' is not a unit of dimensionless; write for example 0.5"),
        ("5 parsnips", "length", "'parsnips' is not a unit; write for example '1 um'"),
        ("5 degC", "length", "'degC' is not a unit of length"),
        ("5", "length", "'5' has no unit; write for example '1 um'"),
        ("nm", "length", "'nm' is not a number with a unit"),
        ("nan nm", "length", "'nan nm' is not a number with a unit"),
        ("", "length", "'' is not a number with a unit"),
        ("1e999 nm", "length", "inf; must be a finite number"),
        ("1 nm + 2 nm", "length", "is not a unit"),
        ("1 nm; import os", "length", "is not a unit"),
        ("2**9 nm", "length", "is not a number with a unit|is not a unit"),
        (math.nan, "length", "radius: nan; must be a finite number"),
        (None, "length", "radius: None; must be a finite number"),
        (True, "length", "radius: True; must be a number"),
        ([1.0, 2.0], "length", r"radius: \[1.0, 2.0\]; must be a finite number"),
    ],
)
def test_wrong_quantities(text, dimension, message):
    with pytest.raises(InputError, match=message) as error:
        parse(text, dimension, "radius")
    assert str(error.value).startswith("radius: ")
    assert "\n" not in str(error.value)


def test_numbers():
    assert positive_number(np.int64(3), "range") == 3.0
    assert finite_number(-1, "phase") == -1.0
    with pytest.raises(InputError, match=r"^range: -1; must be greater than zero"):
        positive_number(-1, "range")
    with pytest.raises(InputError, match=r"^range: 'xxx.*\.\.\.|^range: '") as error:
        positive_number("x" * 100, "range")
    assert "\n" not in str(error.value)


def test_units_of_a_document():
    # interface: nN, nm, nN/nm (stiffness), nN·nm (energy), nN/nm² (pressure)
    names = PHYSICAL.names
    assert (names["load"], names["displacement"], names["contact_radius"]) == ("nN", "nm", "nm")
    assert (names["stiffness"], names["energy"], names["pressure"]) == ("nN/nm", "nN·nm", "nN/nm²")
    assert REDUCED.names == {}
    assert (PHYSICAL.physical, REDUCED.physical) == (True, False)
    assert (PHYSICAL.name("force"), REDUCED.name("force")) == ("nN", "")
    assert hash(Units("physical")) == hash(PHYSICAL)
    with pytest.raises(InputError, match="units: 'SI'; must be 'reduced' or 'physical'"):
        Units("SI")


def test_options_in_the_contacts_units():
    assert PHYSICAL.read("5 uN", "force", "load") == 5000.0
    assert PHYSICAL.read("5", "force", "load") == 5.0
    assert PHYSICAL.read(5, "force", "load") == 5.0
    assert REDUCED.read("-1.5e1", "force", "load") == -15.0
    with pytest.raises(InputError, match=r"^load: '5 nN'; the contact is in reduced units: give a bare number"):
        REDUCED.read("5 nN", "force", "load")
    with pytest.raises(InputError, match=r"^load: 'much'; the contact"):
        REDUCED.read("much", "force", "load")
    with pytest.raises(InputError, match=r"^load: '5 nm': 'nm' is not a unit of force"):
        PHYSICAL.read("5 nm", "force", "load")


def test_scales_belong_together():
    # (23)-(26) for R = 1000 nm, E = 5 GPa, |Δγ| = 0.04 N/m: X = 20 nm, Z = 0.4 nm, F = RΔγ = 40 nN,
    # p = (Δγ/R)^(1/3) E^(2/3) = (4e-5·25)^(1/3) = 0.1 GPa
    scales = Scales(20.0, 0.4, 5.0)
    assert scales.load == pytest.approx(40.0)
    assert scales.pressure == pytest.approx(0.1)
    assert scales.energy == pytest.approx(40.0 * 0.4)
    assert scales.energy_per_area == pytest.approx(0.04)
    assert scales.stiffness == pytest.approx(40.0 / 0.4)


PREFIXES = ("a", "f", "p", "n", "u", "µ", "μ", "m", "c", "", "k", "M", "G", "T")
FORMS = ("{}", "{}/nm", "{} / um", "{}/m^2", "{} m^-2", "{}·m⁻¹", "{}*m**-1", "{}/nm/nm", "{}/nm²", "{} nm", "{}·m⁻²")


@cache
def usual_units():
    return pint.UnitRegistry()


@pytest.mark.parametrize("symbol", ["m", "N", "Pa", "J", "angstrom", "Å"])
def test_usual_units_are_worth_what_pint_says(symbol):
    """Every usual unit of every dimension, against pint; and no unit is taken for one of another dimension."""
    registry = usual_units()
    documents = {"length": "nm", "force": "nN", "pressure": "nN/nm**2", "stiffness": "nN/nm", "energy": "nN*nm"}
    for prefix in PREFIXES if len(symbol) < 3 and symbol != "Å" else ("",):
        for form in FORMS:
            text = form.format(prefix + symbol)
            parsed = registry.Quantity(1.0, text.replace("·", "*").replace("⁻¹", "**-1").replace("⁻²", "**-2"))
            for dimension, unit in documents.items():
                if parsed.is_compatible_with(unit):
                    wanted = parsed.to(unit).magnitude
                    assert parse(f"3 {text}", dimension, "field") == pytest.approx(3.0 * wanted, rel=2e-15), text
                else:
                    with pytest.raises(InputError, match=f"is not a unit of {dimension}"):
                        parse(f"3 {text}", dimension, "field")


def test_pint_is_imported_for_unusual_units_only():
    code = (
        "import sys; from contbranch.contact.contact import Contact; "
        "Contact.physical(radius='1 um', modulus='5 GPa', interaction='gauss', work_of_adhesion='-40 mJ m^-2', "
        "range='1 nm'); assert 'pint' not in sys.modules; "
        "assert Contact.physical(radius='1 inch', modulus=5).tip.radius == 25.4e6; assert 'pint' in sys.modules"
    )
    subprocess.run([sys.executable, "-c", code], check=True, timeout=60)


@pytest.mark.parametrize(
    ("text", "number"), [("30 mJ/m2", 0.03), ("3 Angstrom", 0.3), ("40 mN/m", 0.04)], ids=lambda value: str(value)
)
def test_units_as_they_are_written(text, number):
    dimension = "length" if "strom" in text else "energy per area"
    assert parse(text, dimension, "range") == pytest.approx(number, rel=1e-15)


def test_a_decimal_comma_is_answered_with_a_point():
    with pytest.raises(InputError, match=r"'0\.3 nm'"):
        parse("0,3 nm", "length", "range")


def test_youngs_modulus_is_told_from_the_effective_one():
    with pytest.raises(InputError, match=r"effective modulus, E/\(1 − ν²\)"):
        Contact.physical(radius="1 um", youngs_modulus="3 GPa")
