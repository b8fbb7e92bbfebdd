"""A measured force curve: force against piezo position on approach and retraction, its conventions checked."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from hashlib import sha256
from typing import Any, Self

import numpy as np
from numpy.typing import ArrayLike

from contbranch.arrays import AnyArray, Array, Flags, Indices
from contbranch.contact.units import Quantity, parse, positive_number
from contbranch.errors import InputError

# What a curve can be made of, and its dimension.
COLUMNS = {"piezo": "length", "tip": "length", "force": "force", "deflection": "length"}
# Legs with fewer samples than this say nothing.
LEAST = 8
# Columns that change by less than this (nm, nN) are in metres and newtons.
METRES = {"piezo": 0.1, "tip": 0.1, "force": 1e-5, "deflection": 1e-4}
# A drive that moves steadily: the median of its ways in parts of a leg as a share of their mean.
STEADY = 0.2
WORDS = ("approach", "retract")


@dataclass(frozen=True, eq=False)
class ForceCurve:
    """Force against piezo position, in the order in which it was measured; lengths in nm, forces in nN.

    The piezo position grows towards the surface and the force is positive in repulsion. A tip position is turned into
    that of the piezo with the spring, ``piezo = tip + force/K``, and a deflection into a force, ``force = K δ``.
    Without a spring a tip position is taken for that of a rigid drive.

    Parameters
    ----------
    piezo, tip : array (M,)
        One of the two.
    force, deflection : array (M,)
        One of the two; a deflection needs the spring.
    spring : float or str, optional
        Stiffness of the cantilever in nN/nm, or with a unit.
    segment : array (M,), optional
        ``"approach"`` and ``"retract"`` (or 0 and 1); without it the curve is split at its largest piezo position.
    units : mapping, optional
        Units of `piezo`, `tip`, `force` and `deflection` where they are not nm and nN, such as ``{"piezo": "um"}``.
    source : str
        Where it is from.
    place : mapping, optional
        Where in a map: ``x`` and ``y`` (nm), or ``row`` and ``column``.

    Raises
    ------
    InputError
        For arrays of different lengths, values that are not finite, and piezo positions that do not grow on approach.
    """

    piezo: Array
    force: Array
    spring: float | None
    retract: Flags
    source: str = ""
    deflected: bool = False
    rigid: bool = field(default=False)
    place: Mapping[str, float] = field(default_factory=dict)

    def __init__(
        self,
        piezo: ArrayLike | None = None,
        force: ArrayLike | None = None,
        spring: Quantity = None,
        segment: Sequence[Any] | AnyArray | None = None,
        **others: Any,
    ) -> None:
        units: Mapping[str, str] = others.pop("units", None) or {}
        source, place = str(others.pop("source", "")), others.pop("place", None) or {}
        given = {"piezo": piezo, "force": force, **others}
        unknown = [name for name in (*given, *units) if name not in COLUMNS]
        if unknown:
            raise InputError(
                f"curve: {unknown[0]!r} is not known; must be one of {', '.join(COLUMNS)}, units, source, place"
            )
        columns = {name: _column(values, name, units.get(name)) for name, values in given.items() if values is not None}
        for one, other in (("piezo", "tip"), ("force", "deflection")):
            if (one in columns) == (other in columns):
                raise InputError(f"curve: give either {one} or {other}")
        sizes = {name: values.size for name, values in columns.items()}
        if len(set(sizes.values())) > 1:
            raise InputError(
                f"curve: {' and '.join(f'{n} {name}' for name, n in sizes.items())} values; must be as many"
            )
        stiffness = None if spring is None else _stiffness(spring)
        if "deflection" in columns and stiffness is None:
            raise InputError("spring: missing; a deflection becomes a force with the stiffness of the cantilever")
        found = columns["force"] if "force" in columns else (stiffness or 0.0) * columns["deflection"]
        drive = columns["piezo"] if "piezo" in columns else columns["tip"] + (found / stiffness if stiffness else 0.0)
        self.__dict__.update(
            piezo=drive,
            force=found,
            spring=stiffness,
            retract=_retract(segment, drive),
            source=source,
            place=dict(place),
            deflected="deflection" in columns,
            rigid="tip" in columns and stiffness is None,
        )
        self._check()

    def __len__(self) -> int:
        return self.piezo.size

    def with_spring(self, spring: Quantity) -> Self:
        """The curve with another spring, if one is given; a force made of a deflection changes with it.

        Raises
        ------
        InputError
            If a tip position was taken for that of a rigid drive: give the spring when the curve is made.
        """
        if spring is None:
            return self
        stiffness = _stiffness(spring)
        changed = object.__new__(type(self))
        changed.__dict__.update(self.__dict__ | {"spring": stiffness, "rigid": False})
        if self.rigid:
            changed.__dict__["piezo"] = self.piezo + self.force / stiffness
        if self.deflected and self.spring:
            changed.__dict__["force"] = self.force * (stiffness / self.spring)
        return changed

    def describe(self) -> dict[str, Any]:
        """What tells it from other curves: its place, and a hash of its samples."""
        parts = (self.piezo, self.force, self.retract, np.array([self.spring or np.inf, self.rigid, self.deflected]))
        return {**self.place, "samples": sha256(b"".join(part.tobytes() for part in parts)).hexdigest()}

    def leg(self, retract: bool) -> Indices:
        """Numbers of the samples of approach or retraction, in the order in which they were measured."""
        return np.flatnonzero(self.retract == retract)

    def _check(self) -> None:
        approach = self.leg(False)
        if approach.size < LEAST:
            much = f"{approach.size} of {len(self)} samples"
            raise InputError(
                f"curve: {much} on approach, without which there is no fit; the piezo position must grow towards the "
                "surface (if it falls, give its negative), and what comes before its largest value is the approach "
                "unless segment names it"
            )
        for retract, word in enumerate(WORDS):
            leg = self.piezo[self.leg(bool(retract))]
            if leg.size < 2 * LEAST:
                continue
            ways = (1 - 2 * retract) * np.diff([float(part.mean()) for part in np.array_split(leg, LEAST)])
            if not np.median(ways) > STEADY * abs(float(ways.mean())):
                sense = "grow" if not retract else "fall"
                raise InputError(
                    f"curve: the piezo position does not {sense} steadily on {word}; are columns swapped, or does it "
                    "grow away from the surface (then give its negative)?"
                )


def _stiffness(spring: object) -> float:
    return positive_number(parse(spring, "stiffness", "spring"), "spring")


def _column(values: ArrayLike, name: str, unit: str | None) -> Array:
    """Values in nm or nN."""
    try:
        found = np.array(values, dtype=float).ravel()
    except (TypeError, ValueError) as error:
        raise InputError(f"curve: {name} must be numbers ({error})") from None
    if found.size < 2 * LEAST:
        raise InputError(f"curve: {found.size} values of {name}; must be at least {2 * LEAST}")
    wrong = int((~np.isfinite(found)).sum())
    if wrong:
        raise InputError(f"curve: {wrong} of {found.size} values of {name} are not finite; leave those samples out")
    if unit is not None:
        found *= parse(f"1 {unit}", COLUMNS[name], f"curve: unit of {name}")
    change, unit, other = float(np.ptp(found)), *(("nN", "N") if name == "force" else ("nm", "m"))
    if 0.0 < change < METRES[name]:
        raise InputError(
            f"curve: {name} changes by {change:.2g} {unit} in all; is its unit another one, such as {other}? "
            f"Give it: '{name} [{other}]' in a file's first line, or units={{'{name}': '{other}'}}"
        )
    return found


def _retract(segment: Sequence[Any] | AnyArray | None, drive: Array) -> Flags:
    """Which samples belong to the retraction."""
    if segment is None:
        return np.arange(drive.size) > int(np.argmax(drive))
    words = np.asarray(segment).ravel()
    if words.size != drive.size:
        raise InputError(f"curve: {words.size} values of segment and {drive.size} positions; must be as many")
    texts = np.char.lower(np.char.strip(words.astype(str)))
    known = np.isin(texts, ("approach", "retract", "0", "1", "false", "true"))
    if not known.all():
        raise InputError(f"curve: segment {str(texts[~known][0])!r}; must be approach or retract")
    return np.isin(texts, ("retract", "1", "true"))
