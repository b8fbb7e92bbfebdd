"""Units: reduced and physical (nN and nm), and the reading of quantities. Nothing else converts units.

A contact is described either in reduced units (bare numbers: R = E = |Δγ| = 1, or any other consistent choice) or in
physical units, where everything is kept in nN and nm: loads in nN, lengths in nm, stiffnesses and energies per area in
nN/nm (= N/m), pressures and moduli in nN/nm² (= GPa), energies in nN·nm.
"""

from __future__ import annotations

import math
import re
import reprlib
from dataclasses import dataclass
from functools import cache
from typing import Any

from contbranch.errors import InputError

# A number in the contact's units, a text with a unit, or nothing.
Quantity = float | str | None

# dimension -> (unit of the document, the same for pint, an example of a right value)
_DIMENSIONS: dict[str, tuple[str, str, str]] = {
    "length": ("nm", "nm", "'1 um'"),
    "force": ("nN", "nN", "'5 nN'"),
    "pressure": ("nN/nm²", "nN/nm**2", "'5 GPa'"),
    "energy per area": ("nN/nm", "nN/nm", "'-40 mN/m'"),
    "stiffness": ("nN/nm", "nN/nm", "'0.1 N/m'"),
    "energy": ("nN·nm", "nN*nm", "'2 aJ'"),
    "area": ("nm²", "nm**2", "'3 um^2'"),
    "potential": ("mV", "mV", "'-50 mV'"),
    "charge per area": ("mC/m²", "mC/m**2", "'5 mC/m^2'"),
    "concentration": ("mol/L", "mol/L", "'1 mM'"),
    "force rate": ("nN/s", "nN/s", "'100 nN/s'"),
    "speed": ("nm/s", "nm/s", "'1 um/s'"),
    "frequency": ("1/s", "1/s", "'1 MHz'"),
    "temperature": ("K", "kelvin", "'298 K'"),
    "dimensionless": ("", "dimensionless", "0.5"),
}

# Accuracies that may be asked for.
FINEST, COARSEST = 1e-13, 1e-2

_ANGLE = re.compile(r"°|deg|rad|grad|gon|turn|arc", re.IGNORECASE)
_QUANTITY = re.compile(r"\s*([+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?)\s*([^\s\d.+-].*?)?\s*")


# Powers of ten, newton and metre of the units of lengths, forces, pressures and energies, with their prefixes.
_SYMBOLS = {"m": (0, 0, 1), "N": (0, 1, 0), "Pa": (0, 1, -2), "J": (0, 1, 1)}
_PREFIXES = {"a": -18, "f": -15, "p": -12, "n": -9, "u": -6, "µ": -6, "μ": -6, "m": -3, "c": -2, "": 0, "k": 3}
_POWERS = {
    **{
        prefix + symbol: (ten + power, *dimension)
        for prefix, power in {**_PREFIXES, "M": 6, "G": 9, "T": 12}.items()
        for symbol, (ten, *dimension) in _SYMBOLS.items()
    },
    **dict.fromkeys(("angstrom", "Angstrom", "ångström", "Ångström"), (-10, 0, 1)),
    "Å": (-10, 0, 1),
}
_WRITTEN = {"**": "^", "⁻¹": "^-1", "⁻²": "^-2", "²": "^2", "³": "^3", "·": "*"}


@cache
def _powers(unit: str) -> tuple[int, ...] | None:
    """Powers of ten, newton and metre of a product or quotient of the units above; None for any other unit."""
    for old, new in _WRITTEN.items():
        unit = unit.replace(old, new)
    product, *divisors = unit.split("/")
    factors = [(factor, 1) for factor in re.split(r" *\* *| +", product.strip())]
    factors += [(divisor.strip(), -1) for divisor in divisors]
    total: tuple[int, ...] = (0, 0, 0)
    for factor, sign in factors:
        match = re.fullmatch(r"([^\W\d]+)\^?(-?\d)?", factor)
        if match is None or match[1] not in _POWERS:
            return None
        power = sign * int(match[2] or 1)
        total = tuple(have + power * one for have, one in zip(total, _POWERS[match[1]], strict=True))
    return total


# Units that are printed, the smallest first, with their number in one of the document's: by quantity, or by that unit.
_PRINTED = {
    "spring": {"N/m": 1.0}, "tilt": {"pN/nm": 1e3}, "nN/nm": {"mN/m": 1e3, "N/m": 1.0}, "nm": {"nm": 1.0, "µm": 1e-3},
    "nN": {"pN": 1e3, "nN": 1.0, "µN": 1e-3}, "nN/nm²": {"Pa": 1e9, "kPa": 1e6, "MPa": 1e3, "GPa": 1.0},
}  # fmt: skip


def printed(size: float, unit: str, name: str = "") -> tuple[str, float]:
    """The unit in which a value of that size is printed, and the factor from the document's `unit` to it.

    The spring and the tilt, which share their unit with the work of adhesion, are known by their names.
    """
    known = _PRINTED.get(name.removesuffix("_error").removesuffix("_retract")) or _PRINTED.get(unit) or {unit: 1.0}
    large = (one for one in reversed(known.items()) if abs(size) * one[1] >= 1.0)
    return next(large, next(iter(known.items())))


def readable(value: float, unit: str, error: float | None = None, name: str = "") -> str:
    """Return a value for people, ``"1.234 ± 0.040 kPa"``, unit by its size, digits by two of its error; a dash for NaN.

    Parameters
    ----------
    value, error : float
        In `unit`, that of the document: nm, nN, nN/nm, nN/nm² or none. Without an error, or one that is zero or no
        number, four digits are given.
    unit, name : str
        As of `printed`.
    """
    if error is None or not 0.0 < error < math.inf or math.isnan(value):
        word, factor = printed(value, unit, name)
        text = f"{factor * value:.4g}{' ± ∞' if error == math.inf else ''} {word}".rstrip()
        return "–" if math.isnan(value) else text
    word, factor = printed(max(error, min(abs(value), 1e3 * error)), unit, name)  # 1388.55 ± 0.17 nm are no µm
    place = 1 - int(f"{factor * error:.1e}".partition("e")[2])
    value, error = (round(factor * one, place) + 0.0 for one in (value, error))
    return f"{value:.{max(place, 0)}f} ± {error:.{max(place, 0)}f} {word}".rstrip()


def is_unit(text: str) -> bool:
    """Whether a text is one of the usual units of lengths, forces, pressures, energies and stiffnesses."""
    return _powers(text) is not None


@cache
def _registry() -> Any:
    """Return pint's unit registry: for unusual units only, because it takes a fifth of a second."""
    import pint

    return pint.UnitRegistry()


@cache
def _factor(unit: str, dimension: str) -> float:
    """Return one `unit` in the document's unit of `dimension`; ValueError says in words what is wrong with the unit."""
    wanted = _DIMENSIONS[dimension][1]
    usual, own = _powers(unit), _powers(wanted)
    if usual and own and usual[1:] == own[1:]:
        return float(f"1e{usual[0] - own[0]}")
    import pint

    registry = _registry()
    try:
        parsed = registry.Unit(unit.replace("·", "*").replace("⁻¹", "**-1").replace("⁻²", "**-2"))
    except Exception as error:  # the parser behind pint raises whatever Python's tokenizer does
        raise ValueError(f"'{unit}' is not a unit") from error
    try:
        factor = float(registry.Quantity(1.0, parsed).to(wanted).magnitude)
    except (pint.DimensionalityError, pint.OffsetUnitCalculusError) as error:
        raise ValueError(f"'{unit}' is not a unit of {dimension}") from error
    return float(f"{factor:.15g}")  # units are defined in decimals: 1 um is 1000 nm, not 999.9999999999999


def finite_number(value: object, field: str) -> float:
    """Return `value` as a float; InputError, naming `field`, unless it is a finite real number."""
    if isinstance(value, bool | str | bytes):
        raise InputError(f"{field}: {value!r}; must be a number")
    try:
        number = float(value)  # type: ignore[arg-type]
    except (TypeError, ValueError, OverflowError):
        shown = " ".join(reprlib.repr(value).split())
        raise InputError(f"{field}: {shown}; must be a finite number") from None
    if not math.isfinite(number):
        raise InputError(f"{field}: {number}; must be a finite number")
    return number


def accuracy_of(value: object) -> float:
    """An accuracy that can be asked for, or InputError."""
    number = finite_number(value, "accuracy")
    if not FINEST <= number <= COARSEST:
        raise InputError(f"accuracy: {number:g}; must lie between {FINEST:g} and {COARSEST:g}")
    return number


def positive_number(value: object, field: str) -> float:
    """Return `value` as a float; InputError, naming `field`, unless it is positive and finite."""
    number = finite_number(value, field)
    if number <= 0.0:
        raise InputError(f"{field}: {number:g}; must be greater than zero")
    return number


def make_positive(part: object, *names: str) -> None:
    """Replace fields of a frozen dataclass by floats; InputError, naming the field, unless positive and finite."""
    for name in names:
        object.__setattr__(part, name, positive_number(getattr(part, name), name))


def parse(value: object, dimension: str, field: str) -> float:
    """Return a quantity in the document's unit (nN and nm).

    Parameters
    ----------
    value
        A number, taken as given in the document's unit, or a text such as ``"-40 mN/m"``.
    dimension
        A key of `_DIMENSIONS`, such as ``"length"`` or ``"dimensionless"``.
    field
        The name of the field, for messages.

    Raises
    ------
    InputError
        If `value` is no number with a unit of that dimension; the message shows a right one.
    """
    if not isinstance(value, str):
        return finite_number(value, field)
    example = _DIMENSIONS[dimension][2]
    value = value.replace("\N{MINUS SIGN}", "-")
    match = _QUANTITY.fullmatch(value)
    if match is None or re.match(r",\d", match[2] or ""):
        dotted = value.replace(",", ".")
        example = repr(dotted) if _QUANTITY.fullmatch(dotted) else f"for example {example}"
        raise InputError(f"{field}: {value!r} is not a number with a unit; write {example}")
    number, unit = finite_number(float(match[1]), field), match[2]
    if unit is None:
        if dimension == "dimensionless":
            return number
        raise InputError(f"{field}: {value!r} has no unit; write for example {example}")
    if field.endswith("slope") and _ANGLE.match(unit):
        raise InputError(f"{field}: {value!r} is an angle; give a number, its tangent")
    try:
        return finite_number(number * _factor(unit, dimension), field)
    except ValueError as error:
        if isinstance(error, InputError):
            raise
        raise InputError(f"{field}: {value!r}: {error}; write for example {example}") from None


@dataclass(frozen=True)
class Units:
    """The units in which a contact and its results are expressed.

    Attributes
    ----------
    kind
        ``"reduced"`` (bare numbers) or ``"physical"`` (nN and nm).
    """

    kind: str = "reduced"

    def __post_init__(self) -> None:
        if self.kind not in ("reduced", "physical"):
            raise InputError(f"units: {self.kind!r}; must be 'reduced' or 'physical'")

    @property
    def physical(self) -> bool:
        """Whether numbers are in nN and nm."""
        return self.kind == "physical"

    @property
    def names(self) -> dict[str, str]:
        """The unit of every reported quantity, by its name in a document; empty for reduced units."""
        if not self.physical:
            return {}
        lengths = ("displacement", "contact_radius", "central_gap", "mean_gap", "gap", "radius")
        names = {"load": "force", **dict.fromkeys(lengths, "length"), "energy": "energy", "cell_energy": "energy"}
        names |= {"contact_area": "area", "contact_perimeter": "length"}
        names |= {"pressure": "pressure", "stiffness": "stiffness", "dissipated": "energy"}
        return {name: _DIMENSIONS[dimension][0] for name, dimension in names.items()}

    def name(self, dimension: str) -> str:
        """Return the unit of a `dimension` ("length", "force", ...), an empty text for reduced units."""
        return _DIMENSIONS[dimension][0] if self.physical else ""

    def read(self, value: object, dimension: str, field: str) -> float:
        """Return `value` in these units: a bare number (or text of one) as it is, a unit only for a physical contact.

        Raises
        ------
        InputError
            For a quantity with a unit given to a contact in reduced units, and whatever `parse` refuses.
        """
        if not isinstance(value, str):
            return finite_number(value, field)
        match = _QUANTITY.fullmatch(value)
        if match is not None and match[2] is None:
            return finite_number(float(match[1]), field)
        if self.physical:
            return parse(value, dimension, field)
        raise InputError(f"{field}: {value!r}; the contact is in reduced units: give a bare number")


REDUCED = Units("reduced")
PHYSICAL = Units("physical")


@dataclass(frozen=True)
class Scales:
    """What one reduced unit is worth in the contact's own units, (23)-(26) and their products.

    Attributes
    ----------
    in_plane, normal
        Unit of radii, X, and of gaps and displacements, Z.
    modulus
        Unit of the effective modulus, E.
    """

    in_plane: float
    normal: float
    modulus: float

    @property
    def load(self) -> float:
        """Unit of the load, E X Z (R |Δγ| for a parabola, (25))."""
        return self.modulus * self.in_plane * self.normal

    @property
    def pressure(self) -> float:
        """Unit of the pressure, E Z / X, (26)."""
        return self.modulus * self.normal / self.in_plane

    @property
    def energy(self) -> float:
        """Unit of the energy, E X Z²."""
        return self.modulus * self.in_plane * self.normal**2

    @property
    def energy_per_area(self) -> float:
        """Unit of the energy per area, E Z² / X (|Δγ| where the interaction sets the scales)."""
        return self.modulus * self.normal**2 / self.in_plane

    @property
    def stiffness(self) -> float:
        """Unit of the stiffness dF/dd, E X."""
        return self.modulus * self.in_plane

    @property
    def of_fields(self) -> dict[str, float]:
        """The unit of every quantity by the name that results give it."""
        return {
            "load": self.load,
            **dict.fromkeys(("energy", "cell_energy"), self.energy),
            **dict.fromkeys(("pressure", "wall_pressure"), self.pressure),
            "contact_area": self.in_plane**2,
            **dict.fromkeys(("contact_radius", "contact_perimeter", "r", "x", "y"), self.in_plane),
            **dict.fromkeys(("displacement", "central_gap", "mean_gap", "gap"), self.normal),
        }
