"""Contact: what is in contact. A tip, an interaction law and a modulus; it knows nothing of grids or models."""

from __future__ import annotations

import inspect
import math
import sys
from collections.abc import Callable, Mapping
from dataclasses import dataclass, fields, replace
from functools import cached_property
from pathlib import Path
from typing import Any

from contbranch.arrays import plain
from contbranch.contact.bodies import Body, body_of
from contbranch.contact.interaction_law import terms_of
from contbranch.contact.interactions import INTERACTIONS, Interaction
from contbranch.contact.surface_forces import SURFACE_FORCES, SurfaceForce
from contbranch.contact.tips import TIPS, HeightMap, Parabola, Tip, TipShape
from contbranch.contact.units import PHYSICAL, REDUCED, Scales, Units, parse, positive_number
from contbranch.contact.validity import warn_of_units
from contbranch.errors import InputError, look_up, refuse_unknown

# Bounds of what a reduced unit may be worth, so that no power of it overflows, and of ranges in reduced units.
LARGEST, WIDEST = 1e60, 1e12


# What makes a tip or a law from its parameters.
Part = type[TipShape] | type[Interaction] | type[Body] | SurfaceForce
# Parameters that are pairs of numbers.
PAIRS = ("surface_potentials", "surface_charges")


def dimensions(kind: Part) -> dict[str, str]:
    """Return the dimension of every parameter of a tip or law, by name; dimensionless where the class says nothing."""
    if isinstance(kind, SurfaceForce):
        return dict(kind.dimensions)
    return {item.name: kind.dimensions.get(item.name, "dimensionless") for item in fields(kind) if item.init}


def make(kind: Part, values: Mapping[str, object], prefix: str = "") -> Any:
    """Return the tip or law of that kind with the parameters `values`.

    Raises
    ------
    InputError
        For a missing, unknown or wrong parameter, which is named with `prefix` in front.
    """
    known = dimensions(kind)
    call: Callable[..., Any] = kind.make if isinstance(kind, SurfaceForce) else kind
    refuse_unknown(values, known, prefix)
    for name, parameter in inspect.signature(call).parameters.items():
        if parameter.default is parameter.empty and name not in values:
            raise InputError(f"{prefix}{name}: missing; {call.__name__} needs it ({known[name]})")
    try:
        return call(**values)
    except InputError as error:
        raise InputError(f"{prefix}{error}") from None


def _description(part: TipShape | Interaction, known: Mapping[str, Any], key: str) -> dict[str, object]:
    """Return the parameters of a tip or law under its name; under its class and marked if the user has written it."""
    kind = type(part)
    values = part.described() if isinstance(part, TipShape) else part.parameters()
    parameters = {name: plain(value) for name, value in values.items() if value is not None}
    if known.get(part.name) is kind:
        return {key: part.name, **parameters}
    return {key: f"{kind.__module__}.{kind.__qualname__}", "user_defined": True, **parameters}


def _rebuilt(description: Mapping[str, object], known: Mapping[str, Any], key: str, field: str) -> Any:
    """Return the tip or law of a description; one of the user's if its class is there."""
    values = {name: value for name, value in description.items() if name not in (key, "user_defined")}
    if description.get("user_defined"):
        module, _, name = str(description.get(key)).rpartition(".")
        own = getattr(sys.modules.get(module), name, None)
        if isinstance(own, type) and issubclass(own, TipShape | Interaction):
            told = {k: tuple(v) if isinstance(v, list) else v for k, v in values.items() if not str(v).startswith("<")}
            made = make(own, told, f"{field}.")
            if _description(made, known, key) == description:
                return made
        raise InputError(
            f"{field}: {description.get(key)!r} is not part of contbranch; make the contact with that class, or import "
            f"{module} first"
        )
    kind = look_up(description.get(key), known, f"{field}.{key}")
    return HeightMap.restored(values, field) if kind is HeightMap else make(kind, values, f"{field}.")


@dataclass(frozen=True)
class Contact:
    """A rigid tip on an elastic half space or layer with a finite-range interaction; immutable and hashable.

    Attributes
    ----------
    tip
        The shape of the tip.
    interaction
        The law between the surfaces, besides their impenetrability; None for none.
    modulus
        The effective (contact) modulus E > 0.
    units
        `REDUCED` or `PHYSICAL` (nN and nm): what the numbers of tip, law and modulus mean.
    body
        What is in place of the half space: `ElasticLayer` or `Coating`, to the layer of which the modulus belongs.
    """

    tip: TipShape
    interaction: Interaction | None = None
    modulus: float = 1.0
    units: Units = REDUCED
    body: Body | None = None

    def __post_init__(self) -> None:
        if not isinstance(self.tip, TipShape):
            raise InputError(f"tip: {type(self.tip).__name__}; must be a tip such as Parabola(radius=1.0)")
        if self.interaction is not None and not isinstance(self.interaction, Interaction):
            kind = type(self.interaction).__name__
            raise InputError(
                f"interaction: {kind}; must be a law such as Gauss(work_of_adhesion=1.0, range=0.5) or None"
            )
        if self.body is not None and not isinstance(self.body, Body):
            raise InputError(f"body: {type(self.body).__name__}; must be ElasticLayer(...), Coating(...) or None")
        if not isinstance(self.units, Units):
            raise InputError(f"units: {self.units!r}; must be REDUCED or PHYSICAL")
        object.__setattr__(self, "modulus", positive_number(self.modulus, "modulus"))
        warn_of_units(self)

    @staticmethod
    def reduced(law: type[Interaction] | str | None, tabor: float = 1.0, sign: int = 1, **shape: object) -> Contact:
        """Return the contact of a parabola in reduced units, R = E = |Δγ| = 1 and z0 = 1/μ_T, (23)-(26).

        Parameters
        ----------
        law
            A law's class or name; None for contact without interaction.
        tabor
            Tabor coefficient μ_T > 0.
        sign
            1: attraction, -1: repulsion.
        **shape
            Further parameters of the law, in reduced units.
        """
        tip = Parabola(1.0)
        if law is None:
            return Contact(tip)
        kind = look_up(law, INTERACTIONS, "interaction") if isinstance(law, str) else law
        if sign not in (1, -1):
            raise InputError(f"sign: {sign!r}; must be 1 (attraction) or -1 (repulsion)")
        if "range" not in dimensions(kind):
            raise InputError(f"interaction: {kind.name} brings its own range; describe it in a contact file")
        values = {"work_of_adhesion": float(sign), "range": 1.0 / positive_number(tabor, "tabor"), **shape}
        return Contact(tip, make(kind, values))

    @staticmethod
    def physical(
        *,
        modulus: object = None,
        tip: str | TipShape = "parabola",
        interaction: str | type[Interaction] | Interaction | None = None,
        body: Body | None = None,
        **quantities: object,
    ) -> Contact:
        """Return a contact in physical units, kept in nN and nm.

        Parameters
        ----------
        modulus
            Effective modulus, a text with a unit or a number in nN/nm².
        tip
            The name of a shape, or a tip in nm.
        interaction
            The name or class of a law, or a law in nN and nm, or None.
        body
            A layered body in nm and nN/nm², or None.
        **quantities
            Parameters of the tip's shape and of the law, such as ``radius="1 um"``, ``work_of_adhesion="-40 mN/m"``,
            ``range="1 nm"``: texts with units, or numbers in nm, nN/nm and nN/nm².

        Raises
        ------
        InputError
            For a parameter that is missing, not known, or has a wrong unit.
        """
        shape_kind = look_up(tip, TIPS, "tip") if isinstance(tip, str) else None
        if isinstance(interaction, str):
            interaction = look_up(interaction, {**INTERACTIONS, **SURFACE_FORCES}, "interaction")
        law_kind = interaction if isinstance(interaction, type | SurfaceForce) else None
        known = {
            name: dimension for kind in (shape_kind, law_kind) if kind for name, dimension in dimensions(kind).items()
        }
        refuse_unknown(quantities, known)
        if modulus is None:
            raise InputError("modulus: missing; give the effective modulus, for example '5 GPa'")

        def read(value: Any, name: str) -> Any:
            if name in PAIRS and isinstance(value, tuple | list):
                return tuple(parse(one, known[name], name) for one in value)
            return parse(value, known[name], name) if isinstance(value, str) and known[name] != "text" else value

        values = {name: read(value, name) for name, value in quantities.items()}

        def built(kind: Any) -> Any:
            return make(kind, {name: values[name] for name in dimensions(kind) if name in values})

        shape = built(shape_kind) if shape_kind else tip
        law = built(law_kind) if law_kind else interaction
        return Contact(shape, law, parse(modulus, "pressure", "modulus"), PHYSICAL, body)  # type: ignore[arg-type]

    @staticmethod
    def from_file(path: str | Path) -> Contact:
        """Return the contact that a TOML file describes (format: `contact_file`)."""
        from contbranch.contact.file import read_contact

        return read_contact(path)[0]

    @staticmethod
    def from_description(description: Mapping[str, Any]) -> Contact:
        """Return the contact that `describe` has described.

        Raises
        ------
        InputError
            If the tip or a law is a class of the user's, of which a description has name and parameters, that has
            not been imported, or a height map that is not from a file or whose file has changed.
        """
        units = Units(description.get("units", "reduced"))
        tip = _rebuilt(description.get("tip", {}), TIPS, "shape", "tip")
        laws = description.get("interaction", [])
        terms = [_rebuilt(law, INTERACTIONS, "law", f"interaction[{k}]") for k, law in enumerate(laws)]
        material = dict(description.get("material", {}))
        modulus = material.pop("modulus", None)
        return Contact(tip, sum(terms) or None, modulus, units, body_of(material))

    def describe(self) -> dict[str, Any]:
        """Return the contact as JSON can hold it, in its own units; `from_description` makes it again."""
        return {
            "units": self.units.kind,
            "tip": _description(self.tip, TIPS, "shape"),
            "material": {"modulus": self.modulus, **({} if self.body is None else self.body.parameters())},
            "interaction": [_description(law, INTERACTIONS, "law") for law in terms_of(self.interaction)],
            "tabor": self.tabor,
        }

    @property
    def brief(self) -> str:
        """Tip, laws and Tabor coefficient in a few words."""
        laws = [
            f"{'repulsive ' if getattr(law, 'work_of_adhesion', 1.0) < 0 else ''}{law.name or type(law).__name__}"
            for law in terms_of(self.interaction)
        ]
        tabor = "" if self.tabor is None else f", μ_T = {self.tabor:.4g}"
        return f"{self.tip.name or type(self.tip).__name__} with {' + '.join(laws) or 'no interaction'}{tabor}"

    @property
    def axisymmetric_tip(self) -> Tip:
        """The tip as one with a profile and its transform.

        Raises
        ------
        InputError
            If it is not axisymmetric.
        """
        tip = self.tip.axisymmetric
        if tip is None:
            raise InputError(f"tip: {self.tip.name or type(self.tip).__name__}; must be axisymmetric")
        return tip

    @cached_property
    def scales(self) -> Scales:
        """What one reduced unit is worth: (23)-(26) with the interaction's reference work for |Δγ|.

        Without interaction the tip's own length stands for |Δγ|/E (for a parabola, all lengths in R).
        """
        try:
            if self.interaction is None:
                length = self.tip.natural_length
            else:
                length = self.interaction.reference_work / self.modulus
            scales = Scales(*self.tip.reduced_scales(length), self.modulus)
            sizes = [*scales.of_fields.values(), scales.stiffness, scales.energy_per_area]
            ranges = [law.range / scales.normal for law in terms_of(self.interaction)]
            ranges += [law.wave / scales.normal for law in terms_of(self.interaction) if law.wave < math.inf]
        except ArithmeticError:
            sizes, ranges = [math.inf], []
        wrong = [size for size in sizes if not 1.0 / LARGEST < size < LARGEST]
        if wrong:
            raise InputError(
                "tip, modulus, interaction: their numbers are of too different a size to be computed with (a reduced "
                f"unit would be {wrong[0]:.3g}); take other units or values"
            )
        if wrong := [size for size in ranges if not 1.0 / WIDEST < size < WIDEST]:
            raise InputError(
                f"interaction: a range or wavelength of {wrong[0]:.3g} deformations (1/μ_T); must be between "
                f"{1.0 / WIDEST:g} and {WIDEST:g}"
            )
        return scales

    @cached_property
    def tabor(self) -> float | None:
        """The Tabor coefficient μ_T = Z/z0, with z0 of the law with the largest reference work; None without a law."""
        if self.interaction is None:
            return None
        return self.scales.normal / self.interaction.range

    def to_reduced(self) -> Contact:
        """Return the same contact in reduced units: modulus, reference work and the tip's scale are 1."""
        scales = self.scales
        if (scales.in_plane, scales.normal, scales.modulus) == (1.0, 1.0, 1.0):
            return self if self.units == REDUCED else replace(self, units=REDUCED)
        law = self.interaction
        reduced = None if law is None else law.scaled(scales.normal, scales.energy_per_area)
        body = None if self.body is None else self.body.scaled(scales.in_plane, scales.modulus)
        return Contact(self.tip.scaled(scales.in_plane, scales.normal), reduced, 1.0, REDUCED, body)
