"""A measured force curve: force against piezo position on approach and retraction, its conventions checked."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from copy import copy
from dataclasses import dataclass
from hashlib import sha256
from typing import Any, Self

import numpy as np
from numpy.typing import ArrayLike

from contbranch.arrays import AnyArray, Array, Flags, Indices
from contbranch.contact.units import Quantity, is_unit, parse, positive_number
from contbranch.errors import InputError, refuse_unknown

# What a curve can be made of, and its dimension.
COLUMNS = {"piezo": "length", "tip": "length", "force": "force", "deflection": "length"}
# What else can be said of a curve.
_OPTIONS = ("units", "sensitivity", "deflected", "source", "place")
# Legs with fewer samples than this say nothing.
LEAST = 8
# Columns that change by less than this (nm, nN) are in metres and newtons.
METRES = {"piezo": 0.1, "tip": 0.1, "force": 1e-5, "deflection": 1e-4}
# A drive that moves steadily: the median of its ways in parts of a leg as a share of their mean.
STEADY = 0.2
# Positions within this share of all are close to the turn. In a pause this share of them is within a quarter of that; a
# quarter is where a drive is steady, a half where it follows a sine.
CLOSE, RESTING = 0.01, 0.6
# What a sample can be said to belong to.
WORDS = {"approach": ("approach", "extend", "0", "false"), "retract": ("retract", "1", "true"), "pause": ("pause",)}


@dataclass(frozen=True, eq=False)
class ForceCurve:
    """Force against piezo position, in the order in which it was measured; lengths in nm, forces in nN.

    The piezo position grows towards the surface and the force is positive in repulsion. A tip position is turned into
    that of the piezo with the spring, ``piezo = tip + force/K``, and a deflection into a force, ``force = K δ``.
    Without a spring a tip position is taken for that of a rigid drive.

    Attributes
    ----------
    retract, pause : array (M,)
        Whether a sample belongs to the retraction, or to a pause between the legs, which is in neither.

    Parameters
    ----------
    piezo, tip : array (M,)
        One of the two.
    force, deflection : array (M,)
        One of the two; a deflection needs the spring.
    spring : float or str, optional
        Stiffness of the cantilever in nN/nm, or with a unit.
    segment : array (M,), optional
        ``"approach"``, ``"pause"`` and ``"retract"`` (or 0 for approach, 1 for retract). Without it the curve is split
        at its largest piezo position; where the piezo rests close to it that is a pause. A curve that
        begins and ends close to the surface is split at its smallest position: first the retraction, then the approach.
        One leg is enough. A leg that runs the other way than the other one does, as where both are listed by growing
        positions, is turned round.
    units : mapping, optional
        Units of `piezo`, `tip`, `force` and `deflection` where they are not nm and nN, such as ``{"piezo": "um"}``; a
        deflection may be in volts.
    sensitivity : float or str, optional
        Deflection by voltage, in nm/V or with a unit; for a deflection in volts.
    deflected : bool
        Whether the force was found from a deflection with this spring: then another spring changes it.
    source : str
        Where it is from.
    place : mapping, optional
        Where in a map: ``x`` and ``y`` (nm), or ``row`` and ``column``.

    Raises
    ------
    InputError
        For arrays of different lengths, values that are not finite, legs of fewer than 8 samples both, and piezo
        positions that do not grow on approach or fall on retraction.
    """

    piezo: Array
    force: Array
    spring: float | None
    retract: Flags
    pause: Flags
    source: str
    deflected: bool
    rigid: bool
    place: Mapping[str, float]

    def __init__(
        self,
        piezo: ArrayLike | None = None,
        force: ArrayLike | None = None,
        spring: Quantity = None,
        segment: Sequence[Any] | AnyArray | None = None,
        **others: Any,
    ) -> None:
        refuse_unknown((*others, *(others.get("units") or {})), (*COLUMNS, *_OPTIONS), "curve: ")
        units, sensitivity, deflected, source, place = (others.pop(name, None) for name in _OPTIONS)
        if sensitivity is not None and is_unit((units or {}).get("deflection") or "nm"):
            raise InputError(f"sensitivity: {sensitivity!r}; no deflection is in volts: leave it out, or add its unit")
        given = {name: one for name, one in {"piezo": piezo, "force": force, **others}.items() if one is not None}
        columns = {name: _column(one, name, (units or {}).get(name), sensitivity) for name, one in given.items()}
        for one, other in (("piezo", "tip"), ("force", "deflection")):
            if (one in columns) == (other in columns):
                raise InputError(f"curve: give either {one} or {other}")
        sizes = {name: values.size for name, values in columns.items()}
        sizes |= {} if segment is None else {"segment": np.size(segment)}
        if len(set(sizes.values())) > 1:
            much = " and ".join(f"{n} {name}" for name, n in sizes.items())
            raise InputError(f"curve: {much} values; must be as many")
        stiffness = None if spring is None else stiffness_of(spring)
        if "deflection" in columns and stiffness is None:
            raise InputError("spring: missing; a deflection becomes a force with the stiffness of the cantilever")
        found = columns["force"] if "force" in columns else (stiffness or 0.0) * columns["deflection"]
        drive = columns["piezo"] if "piezo" in columns else columns["tip"] + (found / stiffness if stiffness else 0.0)
        retract, pause = _split(drive, found) if segment is None else _named(segment)
        order = _order(drive, retract, pause)
        self.__dict__.update(piezo=drive[order], force=found[order], spring=stiffness, retract=retract, pause=pause)
        self.__dict__.update(rigid="tip" in columns and stiffness is None, source=source or "", place=dict(place or {}))
        self.__dict__["deflected"] = stiffness is not None and bool(deflected or "deflection" in columns)

    def __len__(self) -> int:
        return self.piezo.size

    def with_spring(self, spring: Quantity) -> Self:
        """The curve with another spring, if one is given; a force made of a deflection changes with it.

        Raises
        ------
        InputError
            If it is no stiffness.
        """
        if spring is None:
            return self
        stiffness, changed = stiffness_of(spring), copy(self)
        piezo = self.piezo + self.force / stiffness if self.rigid else self.piezo
        force = self.force * (stiffness / self.spring) if self.deflected and self.spring else self.force
        changed.__dict__.update(piezo=piezo, force=force, spring=stiffness, rigid=False)
        return changed

    def describe(self) -> dict[str, Any]:
        """What tells it from other curves: its place, and a hash of its samples."""
        told = np.array([self.spring or np.inf, self.rigid, self.deflected])
        parts = (self.piezo, self.force, self.retract, self.pause, told)
        return {**self.place, "samples": sha256(b"".join(part.tobytes() for part in parts)).hexdigest()}

    def leg(self, retract: bool) -> Indices:
        """Numbers of the samples of approach or retraction, as they were measured; none where they are fewer than 8."""
        found = np.flatnonzero((self.retract == retract) & ~self.pause)
        return found if found.size >= LEAST else found[:0]


def _order(drive: Array, retract: Flags, pause: Flags) -> Indices:
    """Numbers of the samples with a leg turned round that alone runs the other way than it should.

    Raises
    ------
    InputError
        If the legs are short, or do not move steadily; where nothing goes back, steps and dense parts are steady.
    """
    order, legs = np.arange(drive.size), [np.flatnonzero((retract == back) & ~pause) for back in (False, True)]
    if max(leg.size for leg in legs) < LEAST:
        much = f"{drive.size - int(pause.sum())} samples on approach and retraction, the others in pauses"
        raise InputError(f"curve: {much}; must be at least {LEAST} on one of them")
    long = []
    for leg, way, words in zip(legs, (1, -1), ("grow steadily on approach", "fall steadily on retract"), strict=True):
        if leg.size >= 2 * LEAST:
            long.append((leg, words, way * np.diff([part.mean() for part in np.array_split(drive[leg], LEAST)])))
    turned = len(long) == 2 and sum(steps.sum() < 0.0 for *_, steps in long) == 1
    for leg, words, steps in long:
        if turned and steps.sum() < 0.0:
            order[leg], steps = leg[::-1], -steps
        if steps.sum() <= 0.0 or (steps.min() < 0.0 and np.median(steps) <= STEADY * steps.mean()):
            remedy = "are columns swapped? If it grows away from the surface, give its negative"
            raise InputError(f"curve: the piezo position does not {words}; {remedy}")
    return order


def stiffness_of(spring: object) -> float:
    """A stiffness in nN/nm."""
    return positive_number(parse(spring, "stiffness", "spring"), "spring")


def scale(name: str, unit: str, sensitivity: Quantity = None) -> float:
    """One `unit` of a column in nm or nN; of a deflection in volts with the sensitivity."""
    if name != "deflection" or is_unit(unit):
        return parse(f"1 {unit}", COLUMNS[name], f"curve: unit of {name}")
    text = f"{sensitivity} nm/V" if isinstance(sensitivity, float | int) else sensitivity
    try:
        return positive_number(parse(f"{text}*{unit}", "length", ""), "")
    except InputError:
        said = "missing" if sensitivity is None else repr(sensitivity)
        remedy = f"must be a length above zero per {unit}, such as '50 nm/{unit}'"
        raise InputError(f"sensitivity: {said}; {remedy}") from None


def numbers(values: ArrayLike, name: str) -> Array:
    """Values of that name as numbers, or InputError."""
    try:
        return np.array(values, dtype=float).ravel()
    except (TypeError, ValueError) as error:
        raise InputError(f"curve: {name} must be numbers ({error})") from None


def _column(values: ArrayLike, name: str, unit: str | None, sensitivity: Quantity) -> Array:
    """Values in nm or nN."""
    found = numbers(values, name)
    if found.size < 2 * LEAST:
        raise InputError(f"curve: {found.size} values of {name}; must be at least {2 * LEAST}")
    if wrong := int((~np.isfinite(found)).sum()):
        raise InputError(f"curve: {wrong} of {found.size} values of {name} are not finite; leave those samples out")
    if unit is not None:
        found *= scale(name, unit, sensitivity)
    change, (unit, other) = float(np.ptp(found)), ("nN", "N") if name == "force" else ("nm", "m")
    if 0.0 < change < METRES[name]:
        given = f"'{name} [{other}]' in a file's first line, or units={{'{name}': '{other}'}}"
        raise InputError(f"curve: {name} changes by {change:.2g} {unit}; is its unit such as {other}? Give it: {given}")
    return found


def _named(segment: Sequence[Any] | AnyArray) -> tuple[Flags, Flags]:
    """Which samples belong to the retraction, and which to a pause, as they are named."""
    words = np.char.lower(np.char.strip(np.asarray(segment).ravel().astype(str)))
    approach, retract, pause = (np.isin(words, known) for known in WORDS.values())
    known = approach | retract | pause
    if not known.all():
        raise InputError(f"curve: segment {str(words[~known][0])!r}; must be {', '.join(WORDS)}, 0 or 1")
    return retract, pause


def _split(drive: Array, force: Array) -> tuple[Flags, Flags]:
    """Which samples belong to the retraction, and which to a pause, as the drive moves.

    What lies between the first and the last sample close to the turn is a pause, if these are more than a steady drive
    would have there, and most of them at one place.
    """
    back = drive[0] + drive[-1] > drive.max() + drive.min()  # it begins and ends close to the surface
    way, number = -drive if back else drive, np.arange(drive.size)
    turn = int(np.argmax(way))
    bends = np.abs(np.diff(way[max(turn - 4 * LEAST, 0) : turn + 4 * LEAST], 2))
    noise = float(np.median(bends)) / (0.6745 * math.sqrt(6.0)) if bends.size else 0.0
    close = max(CLOSE * float(np.ptp(way)), 8.0 * noise)  # most of what rests is within a quarter of that
    first, last = np.flatnonzero(way >= way.max() - close)[[0, -1]]
    near = np.sort(way[first : last + 1])
    densest = int(np.max(np.searchsorted(near, near + 0.25 * close, side="right") - np.arange(near.size)))
    steady = 2 * close * drive.size / max(float(2 * way.max() - way[0] - way[-1]), 1e-300)
    if near.size <= LEAST + 2 + steady or densest < RESTING * near.size:
        first, last = turn, turn + 1
    retract, pause = number <= first if back else number >= last, (number > first) & (number < last)
    low, high = (float(force[part].mean()) for part in np.split(np.argsort(drive), (LEAST, -LEAST))[::2])
    if low > high and (back or first + 1 < LEAST):  # nothing approaches the surface before it leaves
        said = "the force is larger where the piezo position is smaller, which must grow towards the surface"
        raise InputError(f"curve: {said}: give its negative (piezo=-NAME), or name the legs with segment")
    return retract, pause
