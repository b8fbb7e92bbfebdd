"""Finite-range interaction laws: energy per area, pressure and stiffness as functions of the gap.

A law is v(g) = -Δγ f(g/z0) with the work of adhesion Δγ (> 0 attracts, < 0 repels), the range z0 and a shape f,
f(0) = 1.
To add one, write a class with a `name` and `shape`; the command line and contact files find it by that name.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import ClassVar

import numpy as np
import scipy
from numpy.typing import ArrayLike

from contbranch.arrays import Array
from contbranch.contact.interaction_law import Evaluated, Interaction, Response, Sum
from contbranch.contact.tables import Table, columns, energy_of_table, with_fields
from contbranch.contact.units import finite_number, make_positive
from contbranch.errors import InputError

__all__ = [
    "INTERACTIONS",
    "DoubleLayer",
    "Exponential",
    "Gauss",
    "Interaction",
    "InverseSquare",
    "Layered",
    "LennardJones",
    "MaugisDugdale",
    "Response",
    "Sum",
    "Tabulated",
    "VanDerWaals",
]

# Share of the distance of the minimum by which a soft core is entered at most.
SOFT_CORE = 0.8


@dataclass(frozen=True)
class Exponential(Interaction):
    """v = -Δγ exp(-g/z0): one density correlation length."""

    name = "exponential"
    shape_convex = True

    def shape(self, x: Array) -> tuple[Array, Array, Array]:
        """Return e^-x and its derivatives."""
        f = np.exp(-x)
        return f, -f, f

    def _shape_reach(self, tolerance: float) -> float:
        """Return ln(1/tolerance)."""
        return -math.log(tolerance)


@dataclass(frozen=True)
class Gauss(Interaction):
    """v = -Δγ exp(-g²/2z0²), (12): no force when the surfaces touch."""

    name = "gauss"

    def shape(self, x: Array) -> tuple[Array, Array, Array]:
        """Return e^(-x²/2) and its derivatives."""
        square = x * x
        f = np.exp(-0.5 * square)
        return f, -x * f, (square - 1.0) * f

    def _shape_reach(self, tolerance: float) -> float:
        """Return sqrt(2 ln(1/tolerance))."""
        return math.sqrt(max(0.0, -2.0 * math.log(tolerance)))


@dataclass(frozen=True)
class VanDerWaals(Interaction):
    """v = -Δγ/(1 + (g/z0)²), (12): no force when the surfaces touch, an algebraic tail."""

    name = "van-der-waals"

    def shape(self, x: Array) -> tuple[Array, Array, Array]:
        """Return u = 1/(1+x²) and its derivatives -2xu², (6x²-2)u³."""
        square = x * x
        f = 1.0 / (1.0 + square)
        f2 = f * f
        return f, -2.0 * x * f2, (6.0 * square - 2.0) * (f2 * f)

    def _shape_reach(self, tolerance: float) -> float:
        """Return sqrt(1/tolerance - 1)."""
        return math.sqrt(max(0.0, 1.0 / tolerance - 1.0))


@dataclass(frozen=True)
class InverseSquare(Interaction):
    """v = -Δγ/(1 + g/z0)², in place of (12): the van der Waals tail with a force when the surfaces touch."""

    name = "inverse-square"
    shape_convex = True

    def shape(self, x: Array) -> tuple[Array, Array, Array]:
        """Return u² with u = 1/(1+x), and its derivatives -2u³, 6u⁴; defined for x > -1."""
        u = 1.0 / (1.0 + x)
        f = u * u
        return f, -2.0 * f * u, 6.0 * f * f

    def _shape_reach(self, tolerance: float) -> float:
        """Return 1/sqrt(tolerance) - 1."""
        return 1.0 / math.sqrt(tolerance) - 1.0


@dataclass(frozen=True)
class MaugisDugdale(Interaction):
    """v = -Δγ (1 - g/z0) for g < z0, otherwise 0, (12): a constant pressure that ends at g = z0.

    The stiffness is returned as 0 everywhere; its delta function at g = z0 has no value there.
    """

    name = "maugis-dugdale"
    shape_convex = True

    def shape(self, x: Array) -> tuple[Array, Array, Array]:
        """Return 1 - x, -1 and 0 for x < 1, and 0 beyond; NaN stays NaN."""
        inside = np.where(x < 1.0, 1.0, 0.0 * x)
        return (1.0 - x) * inside, -inside, 0.0 * inside

    def _shape_reach(self, tolerance: float) -> float:
        """Return 1 - tolerance."""
        return 1.0 - tolerance


@dataclass(frozen=True)
class Layered(Interaction):
    """v = -Δγ e^(-g/z0) cos(2πg/λ + φ)/cos φ: the decaying oscillation of a layered fluid.

    Attributes
    ----------
    wavelength
        λ > 0, the thickness of a layer, a length; if not given, z0.
    phase
        φ in radians, cos φ not zero, so that v(0) = -Δγ.
    """

    name = "layered"
    dimensions: ClassVar[Mapping[str, str]] = {**Interaction.dimensions, "wavelength": "length"}

    wavelength: float | None = None
    phase: float = 0.0

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.wavelength is None:
            object.__setattr__(self, "wavelength", self.range)
        make_positive(self, "wavelength")
        object.__setattr__(self, "phase", finite_number(self.phase, "phase"))
        if abs(math.cos(self.phase)) < 1e-6:
            raise InputError(
                f"phase: {self.phase:g}; must not be an odd multiple of π/2, where the law vanishes at contact"
            )

    def shape(self, x: Array) -> tuple[Array, Array, Array]:
        """Return e^-x cos(kx + φ)/cos φ and its derivatives, k = 2π z0/λ."""
        k = 2.0 * math.pi * self.range / self.wave
        angle = k * x + self.phase
        envelope = np.exp(-x) / math.cos(self.phase)
        cosine, sine = envelope * np.cos(angle), envelope * np.sin(angle)
        return cosine, -cosine - k * sine, (1.0 - k * k) * cosine + (2.0 * k) * sine

    @property
    def wave(self) -> float:
        """The wavelength."""
        return self.wavelength or self.range

    def _shape_reach(self, tolerance: float) -> float:
        """Return where the envelope, e^-x/|cos φ|, falls to `tolerance`."""
        return -math.log(tolerance * abs(math.cos(self.phase)))

    def scaled(self, normal: float, energy: float) -> Layered:
        """Return the law in other units; the wavelength is a length, too."""
        return Layered(self.work_of_adhesion / energy, self.range / normal, self.wave / normal, self.phase)


@dataclass(frozen=True)
class LennardJones(Interaction):
    """v = -Δγ [4 (1 + g/ε)⁻² - (1 + g/ε)⁻⁸]/3, the 9-3 law of two half spaces of atoms; gaps count from its minimum.

    Attributes
    ----------
    work_of_adhesion
        Δγ, the depth of the minimum.
    range
        ε, the distance of the surfaces in the minimum, where g = 0.
    core
        ``"wall"``: a hard wall at the minimum. ``"soft"``: the law goes on to g > -ε; no wall is ever met, and the
        contact radius is that at which the surfaces attract each other most, h = 3^(1/6) ε.
    """

    name = "lennard-jones"
    dimensions: ClassVar[Mapping[str, str]] = {**Interaction.dimensions, "core": "text"}

    core: str = "wall"

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.core not in ("wall", "soft"):
            raise InputError(f"core: {self.core!r}; must be 'wall' or 'soft'")
        if self.core == "soft" and self.work_of_adhesion < 0.0:
            raise InputError(f"work_of_adhesion: {self.work_of_adhesion:g}; a soft core repels, the rest must attract")

    def shape(self, x: Array) -> tuple[Array, Array, Array]:
        """Return (4u² - u⁸)/3 with u = 1/(1 + x), and its derivatives; defined for x > -1."""
        u = 1.0 / (1.0 + x)
        square = u * u
        eighth = square**4
        return (
            (4.0 * square - eighth) / 3.0,
            8.0 / 3.0 * u * (eighth - square),
            8.0 * square * (square - 3.0 * eighth),
        )

    @property
    def wall(self) -> float:
        """Of a soft core, where its pressure is 10⁶ times the largest tension."""
        return -SOFT_CORE * self.range if self.core == "soft" else 0.0

    @property
    def rim_gap(self) -> float:
        """Of a soft core, where the tension has its peak."""
        return (3.0 ** (1.0 / 6.0) - 1.0) * self.range if self.core == "soft" else 0.0

    def _shape_reach(self, tolerance: float) -> float:
        """Return where 4u²/3 falls to `tolerance`."""
        return math.sqrt(4.0 / (3.0 * tolerance)) - 1.0


@dataclass(frozen=True)
class DoubleLayer(Interaction):
    """Electric double layers of two surfaces in an electrolyte, linearised Poisson-Boltzmann theory.

    With x = (g + cutoff)/λ, Debye length λ and permittivity ϵ,

        v = 2A/(eˣ + 1) + 2B/(eˣ - 1),

    at constant potentials ψ₁, ψ₂: A = ϵ (ψ₁ + ψ₂)²/4λ, B = -ϵ (ψ₁ - ψ₂)²/4λ (Hogg, Healy & Fuerstenau, Trans. Faraday
    Soc. 62, 1638 (1966)); at constant charges σ₁, σ₂ per area: B = λ (σ₁ + σ₂)²/4ϵ, A = -λ (σ₁ - σ₂)²/4ϵ. Its numbers
    are in the units below, whatever those of the contact.

    Attributes
    ----------
    surface_potentials
        ψ₁ and ψ₂ in mV; linear for small ones, up to 25 mV or so.
    surface_charges
        σ₁ and σ₂ in mC/m², in place of potentials.
    debye_length
        λ in nm.
    concentration, valency, temperature
        In place of λ: of the salt in mol/L, of its ions, in K: λ² = ϵ k T/(2 N e² z² c).
    permittivity
        Relative to the vacuum's.
    cutoff
        Distance of the charged planes at g = 0, in nm. Needed where v is infinite otherwise, as at constant charges.
    work_of_adhesion, range
        Not given: -v(0) and λ.
    """

    name = "double-layer"
    dimensions: ClassVar[Mapping[str, str]] = {
        "surface_potentials": "potential", "surface_charges": "charge per area", "debye_length": "length",
        "concentration": "concentration", "temperature": "temperature", "cutoff": "length",
    }  # fmt: skip

    work_of_adhesion: float = field(init=False)
    range: float = field(init=False)
    surface_potentials: tuple[float, float] | None = None
    surface_charges: tuple[float, float] | None = None
    debye_length: float | None = None
    concentration: float | None = None
    valency: float = 1.0
    temperature: float = 298.15
    permittivity: float = 78.4
    cutoff: float = 0.0
    in_nm: bool = field(init=False, repr=False, default=True)  # until it is scaled
    _terms: tuple[float, float, float, float] = field(init=False, repr=False)

    def __post_init__(self) -> None:
        make_positive(self, "valency", "temperature", "permittivity")
        if (self.debye_length is None) == (self.concentration is None):
            raise InputError("debye_length, concentration: give one of them, not both and not none")
        if (self.surface_potentials is None) == (self.surface_charges is None):
            raise InputError("surface_potentials, surface_charges: give one of them, not both and not none")
        if finite_number(self.cutoff, "cutoff") < 0.0:
            raise InputError(f"cutoff: {self.cutoff:g}; must not be negative")
        epsilon = self.permittivity * scipy.constants.epsilon_0  # in C²/(N m²)
        if self.concentration is None:
            make_positive(self, "debye_length")
            length = float(self.debye_length or 0.0)
        else:
            make_positive(self, "concentration")
            ions = 2e3 * scipy.constants.N_A * self.concentration * (self.valency * scipy.constants.e) ** 2
            length = 1e9 * math.sqrt(epsilon * scipy.constants.k * self.temperature / ions)
        held = "surface_charges" if self.surface_potentials is None else "surface_potentials"
        pair = getattr(self, held)
        if not isinstance(pair, tuple | list) or len(pair) != 2:
            raise InputError(f"{held}: {pair!r}; must be two numbers, one for each surface")
        first, second = (finite_number(one, held) for one in pair)
        object.__setattr__(self, held, (first, second))
        # Energies per area in N/m, from mV and nm, or mC/m² and nm.
        unit = 1e3 * epsilon / (4.0 * length) if held == "surface_potentials" else 1e-15 * length / (4.0 * epsilon)
        same, opposite = unit * (first + second) ** 2, -unit * (first - second) ** 2
        a, b = (same, opposite) if held == "surface_potentials" else (opposite, same)
        if b and not self.cutoff:
            raise InputError(
                "cutoff: 0; the energy is infinite there unless the potentials are the same, or the charges opposite: "
                "give the distance of the charged planes in contact, for example '0.3 nm'"
            )
        object.__setattr__(self, "range", length)
        object.__setattr__(self, "_terms", (self.cutoff / length, a, b, 1.0))
        with np.errstate(all="ignore"):
            energies = self.shape(np.linspace(0.0, 20.0, 2001))[0]
        contact = float(energies[0])
        if contact == 0.0:
            raise InputError(f"{held}: {first:g}, {second:g}; the law has no energy at gap 0")
        object.__setattr__(self, "work_of_adhesion", -contact)
        largest = float(np.abs(energies).max()) / abs(contact)
        object.__setattr__(self, "_terms", (self.cutoff / length, a / contact, b / contact, largest))

    def _factors(self, x: Array) -> tuple[Array, Array, Array]:
        """2/(e^X ± 1) and their derivatives at X = x + cutoff/λ, (2, n) each."""
        q = np.exp(-(x + self._terms[0]))
        signs = np.array([1.0, -1.0]).reshape(2, *[1] * q.ndim)
        below = 1.0 + signs * q
        return 2.0 * q / below, -2.0 * q / below**2, 2.0 * q * (1.0 - signs * q) / below**3

    def shape(self, x: Array) -> tuple[Array, Array, Array]:
        """Return f with f(0) = 1, and its derivatives."""
        _, a, b, _ = self._terms
        # Without a pole its term is left out: at a gap of 0 it would be 0 · ∞.
        f, slope, curvature = (a * one[0] + (b * one[1] if b else 0.0) for one in self._factors(np.asarray(x)))
        return f, slope, curvature

    def scaled(self, normal: float, energy: float) -> Interaction:
        """Return the law in other units; the numbers it is described by stay."""
        law = super().scaled(normal, energy)
        object.__setattr__(law, "in_nm", False)
        return law

    @property
    def reference_work(self) -> float:
        """The largest |v|, which may be that of a barrier."""
        return abs(self.work_of_adhesion) * self._terms[3]


@dataclass(frozen=True)
class Tabulated(Evaluated):
    """A law given by a table, interpolated so that the energy per area is twice continuously differentiable.

    Attributes
    ----------
    gaps
        (n,) n ≥ 4, increasing from 0.
    energies
        (n,) energy per area v, zero at infinite gap; either this or `pressures`.
    pressures
        (n,) p = -v'.
    work_of_adhesion, range
        Not given but taken from the table: -v(0), and max|v|/max|p|. Where v is lowest at a gap above zero, as with the
        repulsive core of a Lennard-Jones law: the depth of that minimum, and the quotient outside of it.

    Notes
    -----
    Energies of one sign are the exponential of a spline; others are joined by a quintic spline, pressures by a cubic
    one. Tables that scatter are smoothed as far as their scatter goes. Beyond the table's end a short polynomial
    takes them to zero smoothly. Where |v| or |p| are not below 1 % of their largest values by then, curves begin with
    the surfaces as far apart as the table goes, and say so (`limitation`).
    """

    name = "tabulated"
    dimensions: ClassVar[Mapping[str, str]] = {"gaps": "length", "energies": "energy per area", "pressures": "pressure"}

    gaps: tuple[float, ...]
    energies: tuple[float, ...] | None = None
    pressures: tuple[float, ...] | None = None
    _largest: float = field(init=False, repr=False, compare=False)
    _table: Table = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        if (self.energies is None) == (self.pressures is None):
            raise InputError("energies, pressures: give one of them, not both and not none")
        gaps, values = columns(self, "gaps", self._kind)
        object.__setattr__(self, "_table", energy_of_table(gaps, values, self._kind))
        places = np.concatenate([np.nextafter(gaps, 0.0), 0.5 * (gaps[1:] + gaps[:-1])])
        object.__setattr__(self, "_largest", float(np.max(np.abs(self._table.energy(places)))))
        outside = np.append(self.lowest_gap, places[places > self.lowest_gap])
        largest, steepest = (float(np.max(np.abs(self._table.energy(outside, order)))) for order in (0, 1))
        work = self.net_adhesion
        if work == 0.0 or steepest == 0.0:
            raise InputError(
                "gaps: the law has no energy at gap 0; give a table whose energy does not vanish at contact"
            )
        for name, value in (("work_of_adhesion", work), ("range", largest / steepest), ("_largest", largest)):
            object.__setattr__(self, name, value)

    @property
    def _kind(self) -> str:
        return "energies" if self.pressures is None else "pressures"

    def evaluate(self, gap: ArrayLike) -> Response:
        """Return energy per area, pressure and stiffness at `gap`."""
        # Beyond the last piece but one the law is zero; a gap is never asked for 0 · ∞ there.
        gap = np.minimum(gap, 2.0 * float(self._table.energy.x[-2]))
        return Response(self._table.energy(gap), -self._table.energy(gap, 1), self._table.energy(gap, 2))

    @cached_property
    def lowest_gap(self) -> float:
        """The gap at which v is lowest; 0 also where no row attracts, whatever the curve between them does."""
        rows = self.pressures if self.energies is None else self.energies
        return super().lowest_gap if rows is not None and min(rows) < 0.0 else 0.0

    def _pressures_inside(self) -> Array:
        """Those of the rows, or their differences: a spline falls short of a steep core at its last row."""
        gaps = np.array(self.gaps)
        inside = gaps <= self.lowest_gap
        if self.energies is None:
            return np.array(self.pressures)[inside]
        return -np.diff(np.array(self.energies)[inside]) / np.diff(gaps[inside])

    @property
    def reference_work(self) -> float:
        """The largest |v| of the table, from the gap on at which v is lowest."""
        return self._largest

    @property
    def pieced(self) -> bool:
        """It is."""
        return True

    @property
    def ends(self) -> float:
        """The last gap of the table if it ends too early."""
        return math.inf if self._table.decayed else self.gaps[-1]

    @property
    def limitation(self) -> str:
        """Say where the table ends if it ends too early, and how much it scatters."""
        found = []
        if not self._table.decayed:
            found.append(f"the table of {self._kind} ends at a gap of {self.gaps[-1]:g} before the law has decayed")
        if self._table.scatter:
            found.append(f"the table of {self._kind} scatters by {self._table.scatter:.2g} and is smoothed")
        return "; ".join(found)

    def reach(self, tolerance: float) -> float:
        """Return the gap beyond which |v| ≤ tolerance · reference_work."""
        pieces = self._table.energy
        gaps = np.unique(np.linspace(pieces.x[:-2], pieces.x[1:-1], 9))
        least = tolerance * self.reference_work
        above = np.flatnonzero(np.abs(pieces(gaps)) > least)
        if not above.size or above[-1] == gaps.size - 1:
            return float(gaps[-1]) if above.size else 0.0
        # Not at the next of the gaps, which may be the end of the law, where all derivatives vanish.
        last, beyond = gaps[above[-1] :][:2]
        return float(scipy.optimize.brentq(lambda gap: abs(float(pieces(gap))) - least, last, beyond))

    def scaled(self, normal: float, energy: float) -> Tabulated:
        """Return the table in other units, with its pieces, which take long to make."""
        per = {"energies": energy, "pressures": energy / normal}[self._kind]
        return with_fields(
            self,
            gaps=tuple(gap / normal for gap in self.gaps),
            work_of_adhesion=self.work_of_adhesion / energy,
            range=self.range / normal,
            _largest=self._largest / energy,
            _table=self._table.scaled(normal, energy, per),
            **{self._kind: tuple(value / per for value in getattr(self, self._kind))},
        )


INTERACTIONS: Mapping[str, type[Interaction]] = {
    law.name: law
    for law in (
        Exponential, Gauss, VanDerWaals, InverseSquare, MaugisDugdale, Layered, LennardJones, DoubleLayer, Tabulated,
    )
}  # fmt: skip
