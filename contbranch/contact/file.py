"""Contact files: TOML that describes a contact and, if it likes, how to trace it.

::

    [tip]
    shape = "parabola"              # parabola, cone, power-law, spherical-cap, profile, elliptic-paraboloid, height-map
    radius = "1 um"
    [material]
    modulus = "5 GPa"               # effective modulus
    thickness = "3 um"              # of a layer; none: a half space
    poisson = 0.5
    base = "bonded"                 # or frictionless; of a coating substrate_modulus and substrate_poisson
    [[interaction]]                 # one table for each law of the sum; none: no interaction
    law = "gauss"
    work_of_adhesion = "-40 mN/m"   # < 0 repels
    range = "1 nm"
    [trace]                         # optional
    control = "load"                # load, displacement, "spring:0.1 N/m"
    accuracy = 1e-6
    max_load = "500 nN"
    model = "periodic"              # auto, exact, axisymmetric, periodic, free
    cell = "2 um"                   # edge of the cell of a periodic or free one
    grid = 256                      # nodes along it

Numbers with units are physical, bare numbers are reduced: all or none. Exponents, slopes and phases are bare in both.
The parameters of a shape or law are the fields of its class in `tips` and `interactions`. Tables of numbers:

- ``shape = "profile"``: ``file = "tip.csv"`` with the columns radius and height, or the lists ``radii`` and
  ``heights``; ``length_unit = "nm"`` makes them physical; ``apex = "sharp"`` if the tip ends in a point.
- ``shape = "height-map"``: ``file = "heights.npy"`` (or an HDF5 file, with ``dataset = "name"`` if it holds more than
  one array) with (N, N) heights, and ``cell = "1 um"``, the edge of the square that they cover; ``unit = "nm"`` is that
  of the heights and makes them physical. ``peaks = true`` if the peaks of the map point to the wall; ``radius`` sets
  the scales.
- ``law = "hamaker"``, ``"hydration"`` and ``"structural"``: the parameters of the functions of `surface_forces`, of
  ``law = "double-layer"`` with pairs of potentials or charges, ``surface_potentials = ["-50 mV", "-50 mV"]``.
- ``law = "tabulated"``: ``file = "law.csv"`` with the columns gap and energy per area (``quantity = "energy"``, the
  default) or gap and pressure (``quantity = "pressure"``), or the lists ``gaps`` and ``energies`` or ``pressures``;
  ``length_unit = "nm"`` and ``energy_unit = "mJ/m^2"`` or ``pressure_unit = "MPa"`` make them physical.

A file is searched beside the contact file. One of numbers has two columns, separated by commas, semicolons or blanks;
text after # and a first line of names are skipped. A table ``[sweep]`` says what varies in a sweep
(`contbranch.sweeps.design.read_sweep`) and nothing to a single contact.
"""

from __future__ import annotations

import re
import tomllib
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from typing import Any

from contbranch.contact.bodies import Coating, ElasticLayer, body_of
from contbranch.contact.contact import PAIRS, Contact, Part, dimensions, make
from contbranch.contact.height_map import HeightMap
from contbranch.contact.interaction_law import places_of
from contbranch.contact.interactions import INTERACTIONS, Interaction, Tabulated
from contbranch.contact.surface_forces import SURFACE_FORCES
from contbranch.contact.text import as_path, read_text
from contbranch.contact.tip_profile import Profile
from contbranch.contact.tips import TIPS, TipShape
from contbranch.contact.units import PHYSICAL, REDUCED, Units, finite_number, parse, positive_number
from contbranch.control import as_control
from contbranch.errors import InputError, look_up, refuse_unknown
from contbranch.grid_size import MODELS, grid_points

# A table of a TOML file.
_Table = dict[str, Any]
_TABLES = ("tip", "material", "interaction", "trace", "sweep")
# The dimension of a table's unit, by its key.
_UNITS = {
    "length_unit": "length",
    "pressure_unit": "pressure",
    "energy_unit": "energy per area",
    "unit": "length",
}
_HEIGHT_MAP = ("file", "dataset", "cell", "unit", "peaks", "radius", "grey", "detrend", "window", "fill")
_HEIGHT_MAP_KINDS = (
    ("file", str, '"heights.npy"'),
    ("dataset", str, '"heights"'),
    ("peaks", bool, "true"),
    ("grey", list, "[0.0, 12.0]"),
    ("detrend", str, '"plane"'),
    ("window", str, '"hann"'),
    ("fill", bool, "true"),
)


def read_contact(path: str | Path) -> tuple[Contact, _Table]:
    """Return the contact that a TOML file describes, and its options for the trace.

    Parameters
    ----------
    path
        The contact file.

    Returns
    -------
    contact, options
        `options` holds what the file gives of ``control`` (a `Control`), ``accuracy``, ``max_load``, ``model``,
        ``cell`` and ``grid``, in the contact's units.

    Raises
    ------
    InputError
        For a missing file, wrong TOML, an unknown table, key, shape or law, a missing or wrong value, a wrong unit, and
        for bare numbers beside numbers with units; the message is one line and names the field.
    """
    document = parsed(as_path(path))
    refuse_unknown(document, _TABLES)
    for name in ("tip", "material"):
        if name not in document:
            raise InputError(f"{name}: missing; the contact file needs a table [{name}]")
        _table(document[name], name)
    reader = _Reader(Path(path).parent)
    tip, material = reader.tip(document["tip"]), document["material"]
    known = {name: dimension for kind in (ElasticLayer, Coating) for name, dimension in dimensions(kind).items()}
    refuse_unknown(material, ("modulus", *known), "material.")
    if "modulus" not in material:
        raise InputError("material.modulus: missing; give the effective modulus, for example '5 GPa'")
    modulus = positive_number(reader.number(material["modulus"], "pressure", "material.modulus"), "material.modulus")
    laws = document.get("interaction", [])
    if not isinstance(laws, list):
        raise InputError("interaction: is a single table; write [[interaction]], one for each law of the sum")
    terms = [reader.law(_table(law, name), name) for law, name in zip(laws, places_of(laws), strict=True)]
    options = reader.options(_table(document.get("trace", {}), "trace"))
    layer = reader.quantities({k: value for k, value in material.items() if k != "modulus"}, known, "material.")
    try:
        body = body_of(layer)
    except InputError as error:
        raise InputError(f"material.{error}") from None
    return Contact(tip, sum(terms) or None, modulus, reader.units, body), options


def parsed(path: Path) -> _Table:
    """Return the tables of a TOML file; InputError if it is none."""
    try:
        return tomllib.loads(read_text(path))
    except tomllib.TOMLDecodeError as error:
        raise InputError(f"{path}: {' '.join(str(error).split())}; must be TOML, as in the documentation") from None


def _table(value: object, name: str) -> _Table:
    if not isinstance(value, dict):
        raise InputError(f"{name}: {value!r}; must be a table [{name}]")
    return value


class _Reader:
    """Reads quantities and remembers whether they had units, which must be the same for all."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._first: dict[bool, str] = {}  # the first field with a unit, and the first without

    @property
    def units(self) -> Units:
        """PHYSICAL if the quantities read had units."""
        return PHYSICAL if True in self._first else REDUCED

    def _note(self, has_unit: bool, field: str, remedy: str) -> None:
        """Remember whether `field` has a unit; InputError if an earlier one decided otherwise."""
        self._first.setdefault(has_unit, field)
        if len(self._first) == 2:
            one, other = ("a unit", "none") if has_unit else ("no unit", "one")
            first = self._first[not has_unit]
            raise InputError(f"{field}: has {one}, {first} has {other}; {remedy}: units for all numbers or for none")

    def number(self, value: object, dimension: str, field: str) -> float:
        """Return a quantity in the file's units."""
        if isinstance(value, dict | list):
            raise InputError(f"{field}: is a {'table' if isinstance(value, dict) else 'list'}; must be one number")
        number = parse(value, dimension, field)
        if dimension != "dimensionless":
            has_unit = isinstance(value, str)
            self._note(has_unit, field, "drop the unit" if has_unit else "add the unit")
        return number

    def tip(self, table: _Table) -> TipShape:
        """Return the tip of the table [tip]."""
        if "shape" not in table:
            raise InputError(f"tip.shape: missing; must be one of {', '.join(TIPS)}")
        kind = look_up(table.pop("shape"), TIPS, "tip.shape")
        if kind is HeightMap:
            return self._height_map(table)
        if kind is not Profile:
            tip: TipShape = make(kind, self._parameters(kind, table, "tip."), "tip.")
            return tip
        values = self._lists(table, "tip", {"radii": "length_unit", "heights": "length_unit"}, ("apex",))
        profile: TipShape = make(Profile, values | {name: table[name] for name in ("apex",) if name in table}, "tip.")
        return profile

    def _height_map(self, table: _Table) -> HeightMap:
        """Return the height map of the table [tip]."""
        refuse_unknown(table, _HEIGHT_MAP, "tip.")
        if "file" not in table:
            raise InputError("tip.file: missing; a height map needs a file with its heights")
        for name, kind, example in _HEIGHT_MAP_KINDS:
            if name in table and not isinstance(table[name], kind):
                raise InputError(f"tip.{name}: {table[name]!r}; write for example {name} = {example}")
        keywords: _Table = {**table}
        for name in keywords.keys() & {"cell", "radius"}:
            pair = name == "cell" and isinstance(table[name], list) and len(table[name]) == 2
            numbers = [self.number(one, "length", f"tip.{name}") for one in (table[name] if pair else [table[name]])]
            keywords[name] = tuple(numbers) if pair else numbers[0]
        file = keywords.pop("file")
        if "unit" in table:
            keywords["unit"] = self._unit(table, "tip", "file", "unit")
        try:
            found = HeightMap.from_file(self._folder / file, **keywords)
        except InputError as error:
            raise InputError(f"tip.{error}") from None
        if "unit" not in table:  # but the file may say it
            remedy = "drop the unit of its data set" if found.in_nm else "state unit"
            self._note(found.in_nm, "tip.file", remedy)
        return found

    def law(self, table: _Table, field: str) -> Interaction:
        """Return the law of a table [[interaction]]."""
        known = {**INTERACTIONS, **SURFACE_FORCES}
        if "law" not in table:
            raise InputError(f"{field}.law: missing; must be one of {', '.join(known)}")
        kind = look_up(table.pop("law"), known, f"{field}.law")
        prefix = f"{field}."
        if kind is not Tabulated:
            law: Interaction = make(kind, self._parameters(kind, table, prefix), prefix)
            return law
        quantity = table.pop("quantity", "pressure" if "pressures" in table or "pressure_unit" in table else "energy")
        name = look_up(quantity, {"energy": "energies", "pressure": "pressures"}, f"{prefix}quantity")
        columns = {"gaps": "length_unit", name: f"{quantity}_unit"}
        tabulated: Interaction = make(Tabulated, self._lists(table, field, columns), prefix)
        return tabulated

    def options(self, table: _Table) -> _Table:
        """Return the options of the table [trace]."""
        readers: dict[str, Callable[[Any, str], object]] = {
            "control": lambda value, field: as_control(value, self.units, field),
            "accuracy": _accuracy,
            "max_load": lambda value, field: self.number(value, "force", field),
            "model": lambda value, field: look_up(value, {name: name for name in MODELS}, field),
            "cell": lambda value, field: positive_number(self.number(value, "length", field), field),
            "grid": grid_points,
        }
        refuse_unknown(table, readers, "trace.")
        return {name: read(table[name], f"trace.{name}") for name, read in readers.items() if name in table}

    def _parameters(self, kind: Part, table: _Table, prefix: str) -> _Table:
        """Return the values of a table whose keys are parameters of `kind`; others are left to `make` to refuse."""
        known = dimensions(kind)
        refuse_unknown(table, known, prefix)
        return self.quantities(table, known, prefix)

    def quantities(self, table: _Table, known: Mapping[str, str], prefix: str) -> _Table:
        """Return the values of a table by the dimensions of its keys."""

        def read(value: object, name: str) -> object:
            if known[name] == "text":
                return value
            if isinstance(value, list) and name in PAIRS:
                return tuple(self.number(one, known[name], f"{prefix}{name}") for one in value)
            return self.number(value, known[name], f"{prefix}{name}")

        return {name: read(value, name) for name, value in table.items()}

    def _lists(self, table: _Table, field: str, units: Mapping[str, str], others: Iterable[str] = ()) -> _Table:
        """Return two lists of numbers in the file's units, from a file if `table` names one.

        `units` has the lists' names and the keys of their units; `others` may be in the table, too.
        """
        refuse_unknown(table, list(dict.fromkeys(("file", *units, *units.values(), *others))), f"{field}.")
        if "file" in table:
            if any(name in table for name in units):
                raise InputError(f"{field}.file: given with {' or '.join(units)}; give either the file or the lists")
            path = table.pop("file")
            if not isinstance(path, str):
                raise InputError(f"{field}.file: {path!r}; must be the name of a text file with two columns")
            said = [table.get(key, "") for key in units.values()]
            table.update(zip(units, _read_columns(self._folder / path, f"{field}.file", said), strict=True))
        for name in units:
            if name not in table:
                raise InputError(f"{field}.{name}: missing; give the lists {' and '.join(units)}, or a file")
        factors = {name: self._unit(table, field, name, key) for name, key in units.items()}
        return {name: _multiplied(table[name], factors[name], f"{field}.{name}") for name in units}

    def _unit(self, table: _Table, field: str, name: str, key: str) -> float:
        """Return what a number called `name` is worth: of the unit that the table has under `key`, or 1 without."""
        unit = table.get(key)
        if unit is None:
            self._note(False, f"{field}.{name}", f"state {key}")
            return 1.0
        if not isinstance(unit, str):
            raise InputError(f"{field}.{key}: {unit!r}; must be a unit, for example 'nm'")
        self._note(True, f"{field}.{name}", f"drop {key}")
        return parse(f"1 {unit}", _UNITS[key], f"{field}.{key}")


def _accuracy(value: object, field: str) -> float:
    accuracy = finite_number(value, field)
    if not 0.0 < accuracy < 1.0:
        raise InputError(f"{field}: {accuracy:g}; must be between 0 and 1, for example 1e-6")
    return accuracy


def _multiplied(values: object, factor: float, field: str) -> list[float]:
    """Return a list of numbers in the file's units."""
    if not isinstance(values, list):
        raise InputError(f"{field}: {values!r}; must be a list of numbers")
    return [finite_number(value, field) * factor for value in values]


def _read_columns(path: Path, field: str, units: Iterable[str]) -> tuple[list[float], list[float]]:
    """Return the first two columns of a text file; InputError names `field`, file and line that is not two numbers.

    Between semicolons a comma is a decimal one. Names may have their units in brackets, which must be those given.
    """
    try:
        lines = read_text(path).splitlines()
    except InputError as error:
        raise InputError(f"{field}: {error}") from None
    columns: tuple[list[float], list[float]] = ([], [])
    names_allowed = True
    for count, line in enumerate(lines, start=1):
        line = line.partition("#")[0].strip().strip(",;")
        decimal = line.replace(",", ".") if ";" in line and "." not in line else line
        cells = re.split(r"\s*[,;]\s*|\s+", decimal)
        if cells == [""]:
            continue
        try:
            numbers = [float(cell) for cell in cells]
        except ValueError:
            if names_allowed:
                names_allowed = False
                for found, unit in zip(re.findall(r"\[(.*?)\]", line), units, strict=False):
                    if found.strip() != unit:
                        raise InputError(
                            f"{field}: {path}, line {count}: {line!r} has the unit {found}, and the contact file says "
                            f"{unit or 'none'} for that column; let both be the same"
                        ) from None
                continue
            raise InputError(f"{field}: {path}, line {count}: {line.strip()!r}; must be two numbers") from None
        names_allowed = False
        if len(numbers) != 2:
            raise InputError(f"{field}: {path}, line {count}: {len(numbers)} numbers; must be two columns")
        for column, number in zip(columns, numbers, strict=True):
            column.append(number)
    return columns
