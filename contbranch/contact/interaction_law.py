"""What an interaction law is, and sums of laws; the laws themselves are in `interactions`."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from contextlib import suppress
from copy import copy
from dataclasses import dataclass, field, fields
from functools import cached_property
from typing import Any, ClassVar, NamedTuple

import numpy as np
import scipy
from numpy.typing import ArrayLike

from contbranch.arrays import Array
from contbranch.contact.units import finite_number, positive_number
from contbranch.errors import InputError

# Gaps beyond this many ranges (infinite ones too, outside a tip of finite extent) are taken as this many: every power
# that the shapes form of it is still a finite number.
_FAR = 1e50
# Where kinks are looked for, in ranges: from, to, how many places; jumps of f'' that count, as a share of its largest
# value, and how closely they are told.
_KINKS, _JUMP, _KINKED = (1e-3, 20.0, 4001), 1e-2, 1e-13
# Energies that count, as a share of the largest, and the gaps at which they are looked at, relative to where a law has
# decayed to that.
WEAK, _ENERGY_GAPS = 1e-2, np.concatenate([[0.0], np.geomspace(1e-4, 1.0, 400)])
# Gaps at which pressures are looked at inside a minimum, relative to the minimum's.
_CORE_GAPS = np.linspace(0.0, 1.0, 101)


class Response(NamedTuple):
    """What a law answers to a gap g; arrays of the shape of the gap.

    Attributes
    ----------
    energy
        v, energy per area.
    pressure
        p = -v', positive where the surfaces are pushed apart.
    stiffness
        v''.
    """

    energy: Array
    pressure: Array
    stiffness: Array


@dataclass(frozen=True)
class Interaction:
    """A law v(g) = -Δγ f(g/z0); subclasses write `shape` and inherit the rest.

    Attributes
    ----------
    work_of_adhesion
        Δγ, energy per area, not zero: > 0 attracts, < 0 repels.
    range
        z0 > 0, a length.

    Notes
    -----
    A subclass may have further fields. They are taken as dimensionless unless `dimensions` says otherwise; a subclass
    with another length overrides `scaled`, too.
    """

    name: ClassVar[str] = ""
    dimensions: ClassVar[Mapping[str, str]] = {"work_of_adhesion": "energy per area", "range": "length"}
    shape_convex: ClassVar[bool] = False  # whether f' never falls where the gap is not negative

    work_of_adhesion: float
    range: float

    def __post_init__(self) -> None:
        work = finite_number(self.work_of_adhesion, "work_of_adhesion")
        if work == 0.0:
            raise InputError("work_of_adhesion: 0; must not be zero (without interaction, leave the law out)")
        object.__setattr__(self, "work_of_adhesion", work)
        object.__setattr__(self, "range", positive_number(self.range, "range"))

    def shape(self, x: Array) -> tuple[Array, Array, Array]:
        """Return f, f' and f'' at x = g/z0, arrays of the shape of `x`; x may be slightly negative."""
        raise NotImplementedError(f"{type(self).__name__} must define shape(x), which returns f, f' and f''")

    def evaluate(self, gap: ArrayLike) -> Response:
        """Return energy per area, pressure and stiffness at `gap` (any shape), (12).

        Where a law is not defined, far inside the wall or as its author has it, they are infinite or NaN without
        further warning: it is for the caller to stop there.
        """
        force = self.work_of_adhesion / self.range
        with np.errstate(all="ignore"):
            x = np.minimum(np.asarray(gap) / self.range, _FAR)
            f, slope, curvature = self.shape(x)
            return Response(-self.work_of_adhesion * f, force * slope, (-force / self.range) * curvature)

    @property
    def terms(self) -> tuple[Interaction, ...]:
        """The single laws of which this one is the sum."""
        return (self,)

    @property
    def reference_work(self) -> float:
        """The energy per area, > 0, by which the law is measured: |Δγ|, and for a sum the sum of its terms' ones."""
        return abs(self.work_of_adhesion)

    @property
    def limitation(self) -> str:
        """What is to be said of whatever is computed with the law, in words; mostly nothing."""
        return ""

    @property
    def ends(self) -> float:
        """The gap at which the law's description ends before it has decayed; infinite otherwise."""
        return math.inf

    @property
    def wall(self) -> float:
        """The gap of the wall, 0; that of a soft core is negative, and out of reach."""
        return 0.0

    @property
    def rim_gap(self) -> float:
        """The gap at the edge of what counts as contact where no wall is reached."""
        return 0.0

    @property
    def convex(self) -> bool:
        """Whether the energy per area certainly is: repulsion that falls ever more slowly as the gap opens."""
        # A law made of such a one may have another shape.
        return all(term.work_of_adhesion < 0.0 and vars(type(term)).get("shape_convex") for term in self.terms)

    @property
    def pieced(self) -> bool:
        """Whether the law is put together from pieces, as between the rows of a table."""
        return False

    @property
    def wave(self) -> float:
        """Wavelength in which the law oscillates over any number of ranges; infinite if it does not."""
        return math.inf

    @cached_property
    def sampled_energies(self) -> tuple[Array, Array]:
        """Gaps out to where the law has decayed, and the energies per area there; NaN where they have no value."""
        gaps = self.reach(WEAK) * _ENERGY_GAPS
        try:
            energies = np.array(self.evaluate(gaps).energy, dtype=float)
        except Exception:  # a law may fail where the contact never comes
            energies = np.full(gaps.shape, np.nan)
            for k, gap in enumerate(gaps):
                with suppress(Exception):
                    energies[k] = self.evaluate(np.array([gap])).energy[0]
        return gaps, np.where(np.isfinite(energies), energies, np.nan)

    @cached_property
    def lowest_gap(self) -> float:
        """The gap at which v is lowest; 0 if that is at the wall, or v is nowhere negative by much."""
        gaps, energies = self.sampled_energies
        least = int(np.argmin(np.where(np.isnan(energies), np.inf, energies)))
        counts = WEAK * self.reference_work
        if not energies[least] < -counts or energies[0] - energies[least] < counts:
            return 0.0
        inner, outer = gaps[max(least - 1, 0)], gaps[min(least + 1, gaps.size - 1)]
        if not self._pressure(inner) > 0.0 > self._pressure(outer):  # the law has no value further in, or jumps
            return 0.0
        return float(scipy.optimize.brentq(self._pressure, inner, outer, xtol=1e-14 * outer))

    def _pressure(self, gap: float) -> float:
        return float(self.evaluate(np.array([gap])).pressure[0])

    @property
    def net_adhesion(self) -> float:
        """The energy per area that is gained from infinite separation: the depth of v's minimum, −v(0) without one."""
        return -float(self.evaluate(np.array([self.lowest_gap])).energy[0])

    @cached_property
    def contact_gap(self) -> float:
        """The gap of the minimum of a law that repels from there to the wall, most of all at the wall; otherwise 0.

        A film within it counts as contact. One under a law whose pressure has its largest value before the wall may
        still be squeezed out.
        """
        if not self.lowest_gap:
            return 0.0
        pressures = self._pressures_inside()
        return self.lowest_gap if pressures.size and not pressures[0] < np.nanmax(pressures) else 0.0

    def _pressures_inside(self) -> Array:
        """Pressures from the wall to the minimum."""
        return self.evaluate(self.lowest_gap * _CORE_GAPS).pressure

    @property
    def kinks(self) -> tuple[float, ...]:
        """The gaps at which v'' jumps, from far away inwards."""
        return tuple(self.range * x for x in reversed(self._shape_kinks))

    @property
    def kink(self) -> float:
        """The largest of them, where films begin if nothing lies beyond; infinite without."""
        return max(self.kinks, default=math.inf)

    @cached_property
    def _shape_kinks(self) -> list[float]:
        return self.jumps(2)

    def jumps(self, order: int) -> list[float]:
        """x where a derivative of f jumps: where halving the interval of a sharp bend over and over leaves as large a
        change."""

        def derivative(x: Array) -> Array:
            with np.errstate(all="ignore"):
                return np.asarray(self.shape(x)[order], dtype=float)

        x = np.linspace(*_KINKS)
        try:
            values = np.nan_to_num(derivative(x))
        except Exception:  # a law may fail where the contact never comes
            return []
        least, bends = _JUMP * np.abs(values).max(), np.pad(np.abs(np.diff(values, 2)), 1)
        sharp = np.flatnonzero((bends[1:-1] > least / 2) & (bends[1:-1] >= np.maximum(bends[:-2], bends[2:])))
        low, high = x[sharp], x[sharp + 2]
        while sharp.size and high[0] - low[0] > _KINKED:
            middle = 0.5 * (low + high)
            first, inner, last = (derivative(at) for at in (low, middle, high))
            before = np.abs(inner - first) > np.abs(last - inner)
            low, high = np.where(before, low, middle), np.where(before, middle, high)
        places = high[np.abs(derivative(high) - derivative(low)) > least]
        return [float(x) for x in places[np.diff(places, prepend=0.0) > 2 * _KINKED]]

    def reach(self, tolerance: float) -> float:
        """Return the gap beyond which |v| ≤ `tolerance` · `reference_work`; the end of the law if it ends before."""
        return self.range * max(0.0, self._shape_reach(tolerance))

    def _shape_reach(self, tolerance: float) -> float:
        """Return x beyond which |f| ≤ `tolerance`; where a law does not have it in closed form, by search."""
        places = np.concatenate([[0.0], np.geomspace(1e-3, 1e12, 1501)])

        def exceeds(x: float) -> bool:
            energy = self.evaluate(x * self.range).energy
            return bool(np.abs(energy) > tolerance * self.reference_work)  # NaN, beyond the law's end, does not

        # From far away inwards, so that a law which fails close to the wall is not asked there.
        last = next((k for k in range(places.size - 1, -1, -1) if exceeds(places[k])), -1)
        if last == places.size - 1:
            far = f"{places[-1]:g}"
            raise InputError(f"interaction: {type(self).__name__} has not decayed at {far} ranges; it must vanish")
        if last < 0:
            return 0.0
        low, high = places[last : last + 2].tolist()
        while high - low > 1e-9 * high:
            middle = 0.5 * (low + high)
            low, high = (middle, high) if exceeds(middle) else (low, middle)
        return float(high)

    def scaled(self, normal: float, energy: float) -> Interaction:
        """Return the law in other units, worth `normal` (gaps) and `energy` (per area) of the present ones."""
        law = copy(self)  # whatever else a law of the user's own consists of
        object.__setattr__(law, "work_of_adhesion", self.work_of_adhesion / energy)
        object.__setattr__(law, "range", self.range / normal)
        for name in ("sampled_energies", "lowest_gap", "contact_gap"):
            law.__dict__.pop(name, None)
        return law

    def __add__(self, other: object) -> Interaction:
        if not isinstance(other, Interaction):
            return NotImplemented
        return Sum((*self.terms, *other.terms))

    def __radd__(self, other: object) -> Interaction:
        if other == 0:  # so that sum([law1, law2]) works
            return self
        return NotImplemented

    def parameters(self) -> dict[str, Any]:
        """Return the fields from which the law can be made again, by name."""
        return {item.name: getattr(self, item.name) for item in fields(self) if item.init}


@dataclass(frozen=True)
class Evaluated(Interaction):
    """A law that writes `evaluate` instead of `shape` and finds its work of adhesion and range itself."""

    work_of_adhesion: float = field(init=False)
    range: float = field(init=False)

    @property
    def kinks(self) -> tuple[float, ...]:
        """It has none."""
        return ()

    def shape(self, x: Array) -> tuple[Array, Array, Array]:
        """Return f, f' and f'' with respect to the work of adhesion, which must not vanish."""
        energy, pressure, stiffness = self.evaluate(x * self.range)
        scale = -1.0 / self.work_of_adhesion
        return scale * energy, -scale * self.range * pressure, scale * self.range**2 * stiffness


@dataclass(frozen=True)
class Sum(Evaluated):
    """The sum of several laws, each with its own sign and range (DLVO); made by ``law1 + law2``.

    Attributes
    ----------
    laws
        The single laws, at least one.
    work_of_adhesion
        The net one, the sum of the laws' (may vanish).
    range
        That of the law with the largest reference work.
    """

    laws: tuple[Interaction, ...]

    def __post_init__(self) -> None:
        laws = tuple(term for law in self.laws for term in law.terms)
        if not laws:
            raise InputError("laws: none; a sum needs at least one law")
        object.__setattr__(self, "laws", laws)
        object.__setattr__(self, "work_of_adhesion", math.fsum(law.work_of_adhesion for law in laws))
        object.__setattr__(self, "range", max(laws, key=lambda law: law.reference_work).range)

    @property
    def terms(self) -> tuple[Interaction, ...]:
        """The single laws."""
        return self.laws

    @property
    def reference_work(self) -> float:
        """The sum of the laws' reference works: unlike the net work of adhesion it cannot cancel."""
        return math.fsum(law.reference_work for law in self.laws)

    @property
    def limitation(self) -> str:
        """That of each law."""
        return "; ".join(law.limitation for law in self.laws if law.limitation)

    @property
    def kinks(self) -> tuple[float, ...]:
        """Those of all laws."""
        return tuple(sorted({kink for law in self.laws for kink in law.kinks}, reverse=True))

    @property
    def wall(self) -> float:
        """That of the softest core."""
        return min(law.wall for law in self.laws)

    @property
    def rim_gap(self) -> float:
        """That of the law with the softest core."""
        return min(self.laws, key=lambda law: law.wall).rim_gap

    @property
    def pieced(self) -> bool:
        """Whether any law is."""
        return any(law.pieced for law in self.laws)

    @property
    def ends(self) -> float:
        """Where the first one ends."""
        return min(law.ends for law in self.laws)

    def evaluate(self, gap: ArrayLike) -> Response:
        """Return the sums of the laws' energies per area, pressures and stiffnesses at `gap`."""
        responses = (law.evaluate(gap) for law in self.laws)
        return Response(*map(sum, zip(*responses, strict=True)))  # type: ignore[arg-type]

    @property
    def wave(self) -> float:
        """The shortest one of the laws."""
        return min(law.wave for law in self.laws)

    def reach(self, tolerance: float) -> float:
        """Return a gap beyond which |v| ≤ tolerance · reference_work: no law exceeds its share of that."""
        allowed = tolerance * self.reference_work / len(self.laws)
        return max(law.reach(min(1.0, allowed / law.reference_work)) for law in self.laws)

    def scaled(self, normal: float, energy: float) -> Sum:
        """Return the sum of the laws in other units."""
        return Sum(tuple(law.scaled(normal, energy) for law in self.laws))


def places_of(laws: Sequence[object]) -> list[str]:
    """Return what messages call the laws of a contact: by their number in a sum."""
    return ["interaction"] if len(laws) == 1 else [f"interaction[{k}]" for k in range(len(laws))]


def terms_of(law: Interaction | None) -> tuple[Interaction, ...]:
    """Return the single laws of a contact's interaction; none without one."""
    return () if law is None else law.terms
