"""Jumps by thermal activation from the traced curve: the unstable states are the barriers.

With the energy H of contact and drive, the barrier ΔH(c) = H(unstable) - H(stable) at what is controlled, c, vanishes
at the fold c*. dH/dc is known, -d or F, and through the fold it is a smooth function of s = ±√|c - c*|, so that ΔH is
the integral over the difference of both sides, which loses no digits there. With the attempt frequency ν and a ramp of
rate r the probability of the state is S = exp(-∫ ν e^(-ΔH/kT) dc/r).

E. Evans and K. Ritchie, Biophys. J. 72, 1541 (1997); O. K. Dudko, G. Hummer and A. Szabo, Phys. Rev. Lett. 96, 108101
(2006).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import cached_property
from time import perf_counter
from typing import NamedTuple

import numpy as np
import scipy

from contbranch.arrays import Array, Integers
from contbranch.contact.units import parse, positive_number
from contbranch.control import DISPLACEMENT, Control, Kind
from contbranch.curve.problem import Four
from contbranch.curve.solve import crossing, pieces_at
from contbranch.curve.trace import Request as TraceRequest
from contbranch.errors import InputError, ModelError, look_up, nearest
from contbranch.models.choice import choose, curves
from contbranch.results.activated import Activated, ActivatedJump
from contbranch.results.diagram import Branch, Cost, Diagram, Event

__all__ = ["activated"]

# Places in s between the fold and where a barrier is that of the way back.
PLACES = 4000
# States that the parts of a row are apart, between which barriers are interpolated.
BETWEEN = 4
# Rows on either side of a fold at least, and parts of a row that are rounding.
FEWEST, EXACT = 3, 1e-9
_KINDS: dict[str, Kind] = {"load": "load", "displacement": "displacement", "spring": "spring"}


def activated(
    diagram: Diagram,
    temperature: float | str,
    rate: float | str,
    attempt_frequency: float | str,
    event: str | None = None,
) -> Activated:
    """Say when jumps happen at a temperature, while what is controlled changes at a rate.

    A jump is counted from where the two stable states have the same energy; under a load that pulls, from no load.
    There are no jumps back.

    Parameters
    ----------
    diagram : Diagram
        Of `contbranch.trace`, whose control is the one that changes.
    temperature : float or str
        Such as ``"298 K"``; a number is in K, for a contact in reduced units k T in units of the energy.
    rate : float or str
        Magnitude of the rate of what is controlled: ``"100 nN/s"`` of a load, ``"1 um/s"`` of a displacement or of the
        end of a spring; a number is in nN/s or nm/s, or reduced.
    attempt_frequency : float or str
        Such as ``"1 MHz"``; a number is in 1/s.
    event : str, optional
        Name of the one fold that is asked for; default: all that have names.

    Returns
    -------
    Activated

    Raises
    ------
    InputError
        If a number cannot be used, or there is no such fold.
    """
    began, contact = perf_counter(), diagram.contact
    kind = look_up(diagram.control, _KINDS, "control")
    physical = bool(diagram.units)
    speed = "force rate" if kind == "load" else "speed"
    read = {"temperature": (temperature, "temperature"), "rate": (rate, speed)}
    read["attempt_frequency"] = (attempt_frequency, "frequency")
    numbers = {
        name: positive_number(parse(value, dimension, name) if physical else value, name)
        for name, (value, dimension) in read.items()
    }
    heat = numbers["temperature"] * (scipy.constants.k * 1e18 if physical else 1.0)
    control = Control(kind, diagram.stiffness or (math.inf if kind == "displacement" else 0.0))
    folds = [one for one in diagram.events if one.kind == "fold" and one.control == kind and one.name]
    if event is not None:
        known = dict.fromkeys(str(one.name) for one in folds)
        if event not in known:
            raise InputError(f"event: {event!r}; the curve has {', '.join(known) or 'none'}{nearest(event, known)}")
        folds = [one for one in folds if one.name == event]
    frequency = numbers["attempt_frequency"] / numbers["rate"]
    found: list[ActivatedJump] = []
    for number, branch in enumerate(diagram.branches):
        own = [one for one in folds if one.branch == number]
        curve = _Curve.of(branch, control, own)
        dense = curve.denser(diagram) if own and contact is not None else curve
        jumps = [[_jump(rows, one, heat, frequency) for one in own] for rows in (dense, dense.thinned())]
        found += [
            replace(jump, error=math.inf if rough is None else abs(jump.mean - rough.mean))
            for jump, rough in zip(*jumps, strict=True)
            if jump is not None
        ]
    complete = diagram.status == "complete"
    return Activated(
        jumps=tuple(found),
        control=kind,
        thermal_energy=heat,
        rate=numbers["rate"],
        attempt_frequency=numbers["attempt_frequency"],
        cost=Cost(perf_counter() - began, 0),
        stiffness=diagram.stiffness,
        contact=contact,
        unit_names=diagram.unit_names,
        status="complete" if complete and len(found) == len(folds) else "incomplete",
        message=" ".join(filter(None, [_missing(folds, found), "" if complete else diagram.message])),
    )


def _missing(folds: Sequence[Event], found: Sequence[ActivatedJump]) -> str:
    """A sentence on the folds of which no barrier is known."""
    names = sorted({str(one.name) for one in folds} - {jump.name for jump in found})
    return f"The curve has too few states beside {', '.join(names)} for a barrier." if names else ""


class _Arcs(NamedTuple):
    """States on both sides of a fold, as far as what is controlled goes one way.

    Attributes
    ----------
    fold : float
        What is controlled there.
    ramp : float
        1 where it is a maximum, -1 where a minimum.
    slope : spline
        dH/dc at s, which is positive on the side asked for first, and smooth through the fold.
    ends : (float, float)
        The largest s of that side and of the other.
    last : int
        Row at the end of the other side.
    turns : bool
        Whether what is controlled turns round there.
    """

    fold: float
    ramp: float
    slope: scipy.interpolate.Akima1DInterpolator
    ends: tuple[float, float]
    last: int
    turns: bool

    def barriers(self, s: Array) -> Array:
        """H on the second side minus H on the first, at s from 0 on."""
        rates = s * (self.slope(-s) - self.slope(s))
        return np.asarray(-2.0 * self.ramp * scipy.integrate.cumulative_simpson(rates, x=s, initial=0.0))


@dataclass(frozen=True)
class _Curve:
    """Rows of a branch as the control sees them, in order.

    Attributes
    ----------
    control : Control
    positions : array (M,)
        On the branch, in units of its rows.
    load, displacement : array (M,)
    unstable : integer array (M,)
    arcs : (int, int)
        Rows between which the arcs of the folds lie.
    """

    control: Control
    positions: Array
    load: Array
    displacement: Array
    unstable: Integers
    arcs: tuple[int, int] = (0, 0)

    @staticmethod
    def of(branch: Branch, control: Control, folds: Sequence[Event]) -> _Curve:
        """All rows of a branch."""
        positions = np.arange(float(len(branch)))
        found = _Curve(control, positions, branch.load, branch.displacement, branch.unstable(control))
        ends = [round(fold.position) for fold in folds]
        for fold in folds:
            for step in (-1, 1):
                begin = min(max(round(fold.position) + step, 0), len(positions) - 1)
                last = found.rows(control.of(fold), begin, step)[0][-1]
                ends += [
                    last,
                    found.rows(float(found.values[last]), min(max(last + step, 0), len(positions) - 1), step)[0][-1],
                ]
        return replace(found, arcs=(min(ends, default=0), max(ends, default=0)))

    @cached_property
    def values(self) -> Array:
        """What is controlled."""
        pairs = zip(self.load.tolist(), self.displacement.tolist(), strict=True)
        return np.array([self.control.value(*pair) for pair in pairs])

    @cached_property
    def slopes(self) -> Array:
        """dH/dc."""
        return -self.displacement if self.control.kind == "load" else self.load

    def denser(self, diagram: Diagram) -> _Curve:
        """With exact states of the curve between the rows of the arcs, at equal distances of the displacement."""
        contact = diagram.contact
        if contact is None or diagram.model.kind in ("periodic", "free"):
            return self
        scales, request = contact.scales, TraceRequest(diagram.accuracy, events=False, modes=0)
        track = curves(contact, choose(contact, diagram.model.kind)[0]).recent(request)
        depth, load, reached = self.displacement / scales.normal, self.load / scales.load, track.column("displacement")
        rows: list[tuple[float, float, float]] = []
        for k in range(*self.arcs):
            for share in np.arange(1.0, BETWEEN) / BETWEEN:
                value, force = ((1.0 - share) * one[k] + share * one[k + 1] for one in (depth, load))
                found: list[Four] = []
                with suppress(ModelError):
                    pieces = pieces_at(reached, value)
                    found = [
                        crossing(track, piece, DISPLACEMENT, value, diagram.accuracy).found.numbers for piece in pieces
                    ]
                near = [one for one in found if (one[0] - load[k]) * (one[0] - load[k + 1]) <= 0.0]
                if near:
                    best = min(near, key=lambda one: abs(one[0] - force))
                    rows.append((k + share, best[0] * scales.load, best[1] * scales.normal))
        added = np.array(rows).reshape(-1, 3)
        order = np.argsort(positions := np.append(self.positions, added[:, 0]))
        turning = {round(one.position) for one in diagram.events if one.control == self.control.kind}
        beside = [int(k) + (int(k) in turning) for k in added[:, 0]]  # at a fold itself stability changes
        unstable = np.append(self.unstable, self.unstable[beside])
        return replace(
            self,
            positions=positions[order],
            load=np.append(self.load, added[:, 1])[order],
            displacement=np.append(self.displacement, added[:, 2])[order],
            unstable=unstable[order],
        )

    def thinned(self) -> _Curve:
        """Every second row."""
        parts = {name: getattr(self, name)[::2] for name in ("positions", "load", "displacement", "unstable")}
        return replace(self, **parts)

    def rows(self, value: float, begin: int, step: int) -> tuple[list[int], bool]:
        """Rows from one on in which the control moves away from a value, and whether there are others behind."""
        found, row = [begin], begin + step
        while 0 <= row < len(self.values) and abs(self.values[row] - value) > abs(self.values[found[-1]] - value):
            found.append(row)
            row += step
        return found, 0 <= row < len(self.values)

    def beside(self, position: float) -> tuple[int, int]:
        """The rows before a position and behind it; they may not exist."""
        before = int(np.searchsorted(self.positions, position - EXACT)) - 1
        return before, int(np.searchsorted(self.positions, position + EXACT))

    def around(self, value: float, slope: float, position: float, way: int) -> _Arcs | None:
        """The arcs of a fold; those with s > 0 lie in the direction `way` along the branch."""
        before, behind = self.beside(position)
        if before < 0 or behind >= len(self.values):
            return None
        first, _ = self.rows(value, behind if way > 0 else before, way)
        second, turns = self.rows(value, before if way > 0 else behind, -way)
        s = [np.sqrt(np.abs(self.values[rows] - value)) for rows in (first, second)]
        if min(map(len, s)) < FEWEST or min(s[0][0], s[1][0]) <= 0.0:
            return None
        places = np.concatenate([-s[1][::-1], [0.0], s[0]])
        slopes = np.concatenate([self.slopes[second][::-1], [slope], self.slopes[first]])
        ramp = 1.0 if self.values[first[-1]] < value else -1.0
        spline = scipy.interpolate.Akima1DInterpolator(places, slopes, method="makima")
        return _Arcs(value, ramp, spline, (float(s[0][-1]), float(s[1][-1])), second[-1], turns)


def _jump(curve: _Curve, fold: Event, heat: float, frequency: float) -> ActivatedJump | None:
    """How the stable state that ends at a fold is left; None where neither side is stable, or has hardly any rows."""
    ends, value = curve.beside(fold.position), curve.control.of(fold)
    if ends[0] < 0 or ends[1] >= len(curve.values) or min(curve.unstable[list(ends)]) != 0:
        return None
    way = -1 if curve.unstable[ends[0]] == 0 else 1
    arcs = curve.around(value, -fold.displacement if curve.control.kind == "load" else fold.load, fold.position, way)
    if arcs is None:
        return None
    s = np.linspace(0.0, min(arcs.ends), PLACES)
    end = _exchange(curve, arcs, s, way)
    s = np.linspace(0.0, end, PLACES) if end < s[-1] else s
    barriers = arcs.barriers(s)
    attempts = frequency * np.exp(-np.maximum(barriers, 0.0) / heat)
    passed = scipy.integrate.cumulative_simpson((2.0 * s * attempts)[::-1], x=-s[::-1], initial=0.0)[::-1]
    survival = np.exp(-passed)
    # Of the distance y = s² from the fold: E[y] = ∫ P(y' > y) dy, and E[y²] likewise.
    gone = (1.0 - survival) * 2.0 * s
    first = float(scipy.integrate.simpson(gone, x=s))
    second = float(scipy.integrate.simpson(2.0 * s * s * gone, x=s))
    return ActivatedJump(
        name=str(fold.name),
        fold=value,
        values=(value - arcs.ramp * s * s)[::-1],
        barriers=barriers[::-1],
        survival=survival[::-1],
        distribution=(survival * attempts)[::-1],
        mean=value - arcs.ramp * first,
        error=0.0,
        std=math.sqrt(max(second - first * first, 0.0)),
    )


def _exchange(curve: _Curve, arcs: _Arcs, s: Array, way: int) -> float:
    """The place s where the stable state behind the barrier has the same energy; without such a state the last one.

    The other side's barrier is counted from the fold at which the unstable states end.
    """
    if not arcs.turns:
        return float(s[-1])  # the barrier goes to infinite separation
    last = arcs.last
    other = curve.around(float(curve.values[last]), float(curve.slopes[last]), float(curve.positions[last]), -way)
    if other is None or curve.unstable[last - way] != 0:
        return float(s[-1])
    t = np.linspace(0.0, min(other.ends), PLACES)
    at = np.sqrt(np.maximum(np.abs(arcs.fold - arcs.ramp * s * s - other.fold), 0.0))
    back = np.interp(at, t, other.barriers(t), right=np.inf)
    ahead = np.flatnonzero(arcs.barriers(s)[1:] >= back[1:])
    return float(s[ahead[0] + 1]) if ahead.size else float(s[-1])
