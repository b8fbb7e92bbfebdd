"""Events of the exact model along a parameter: closed forms at every value, the passage through first touch by a root.

Without contact what is controlled, d + F/K, is least where the interaction's radius is
``c = 4 μ_T / (π (1 − 2π μ_T/K))`` (reduced units), which is possible only up to the radius c_touch at first touch. The
fold therefore passes first touch where ``4 μ_T/π = (1 − 2π μ_T/K) c_touch(μ_T)``; for displacement control, K = ∞, at
μ_T = [π/(8 (1 − 1/π))]^(1/3).
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from contbranch.contact.family import Family
from contbranch.continuation import find_root
from contbranch.control import Control
from contbranch.errors import InputError
from contbranch.models.event_curve import Four, RawEventCurve, RawPoint, RawSpecial
from contbranch.models.exact.model import Exact, ExactCurve
from contbranch.models.exact.results import ExactEvent

__all__ = ["follow_exact"]

POINTS = 61
# A coordinate of the family is found to this width.
RESOLUTION = 1e-15


class _Following:
    """One event of the exact model along a family."""

    def __init__(self, family: Family, event: ExactEvent, control: Control | None) -> None:
        self.family, self.event, self.control = family, event, control

    def _curve(self, q: float) -> tuple[ExactCurve, Four, float]:
        """The curve of a member, its units, and its unit of stiffness."""
        family = self.family
        contact = family.contact if family.spacing == "angle" else family.member(family.value(q))
        obstacle = Exact().obstacle(contact)
        if obstacle is not None:
            raise InputError(f"vary: at {family.name} = {family.value(q):.6g} {obstacle}")
        s = contact.scales
        return Exact().curve(contact), (s.load, s.normal, s.in_plane, s.normal), s.stiffness

    def _driven(self, q: float) -> Control | None:
        """The control at a coordinate, in the units of the contact."""
        if self.control is None or self.family.spacing != "angle":
            return self.control
        value = self.family.value(q)
        if value == 0.0:
            return Control("load", 0.0)
        return Control("displacement", value) if math.isinf(value) else Control("spring", value)

    def event_at(self, q: float) -> tuple[ExactEvent, Four]:
        """The event of a member (reduced units), and its units."""
        curve, units, stiffness = self._curve(q)
        driven = self._driven(q)
        events = curve.events
        if driven is not None and driven.kind == "spring":
            events = curve.spring_events(driven.stiffness / stiffness)
        kind = None if driven is None else driven.kind
        name = self.event.name
        if name == "jump-in" and kind == "load":  # a spring's jump-in leaves to infinity; its edge stays
            kind = "displacement"
        return next(e for e in events if (e.kind, e.control, e.name) == (self.event.kind, kind, name)), units

    def point(self, q: float, value: float) -> RawPoint:
        """The event at a coordinate, in the contact's units."""
        event, units = self.event_at(q)
        state = event.state
        keys = ("load", "displacement", "contact_radius", "central_gap")
        numbers = [getattr(state, key) * unit for key, unit in zip(keys, units, strict=True)]
        error = [event.error[key] * unit for key, unit in zip(keys, units, strict=True)]
        return RawPoint(
            value, (numbers[0], numbers[1], numbers[2], numbers[3]), (error[0], error[1], error[2], error[3])
        )

    def touch(self, q: float) -> RawPoint:
        """First touch at a coordinate, in the contact's units."""
        curve, units, _ = self._curve(q)
        event = next(e for e in curve.events if e.kind == "touch")
        load, displacement = event.state.load * units[0], event.state.displacement * units[1]
        error = (event.error["load"] * units[0], event.error["displacement"] * units[1], 0.0, 0.0)
        return RawPoint(self.family.value(q), (load, displacement, 0.0, 0.0), error)

    def excess(self, q: float) -> float:
        """Negative where the fold is without contact, zero where it is at first touch."""
        curve, _, stiffness = self._curve(q)
        driven = self._driven(q)
        if driven is not None and driven.kind == "load":
            return 1.0
        compliance = 0.0
        if driven is not None and driven.kind == "spring":
            compliance = stiffness / driven.stiffness
        rest = 1.0 - 2.0 * math.pi * curve.tabor * compliance
        return 4.0 * curve.tabor / math.pi - rest * curve.touch_radius

    def passage(self, left: float, right: float, index: int) -> RawSpecial:
        """The special point between two coordinates at which `excess` has different signs."""
        levels = (self.excess(left), self.excess(right))
        q = find_root(self.excess, (left, levels[0]), (right, levels[1]), RESOLUTION)
        slope = abs(levels[1] - levels[0]) / abs(right - left)
        rounding = 16.0 * np.finfo(float).eps
        q_error = rounding * (1.0 + max(map(abs, levels)) / slope) + RESOLUTION
        touch = self.touch(q)
        error = [e + q_error * abs(r) for e, r in zip(touch.error, self._rates(touch, q), strict=True)]
        row = replace(touch, error=(error[0], error[1], 0.0, 0.0))
        return RawSpecial(
            "fold-through-touch",
            index,
            row,
            q_error * abs(self.family.rate(q)),
            "displacement" if self.control is None else None,
            "A fold of this control lies exactly at first touch."
            if self.control is None
            else "The fold passes first touch: on one side it has contact, on the other none.",
        )

    def _rates(self, touch: RawPoint, q: float) -> list[float]:
        """Rates of change of first touch with the coordinate."""
        step = 1e-6
        beside = self.touch(q + step)
        return [(a - b) / step for a, b in zip(beside.numbers, touch.numbers, strict=True)]


def follow_exact(family: Family, event: ExactEvent, control: Control | None, to: tuple[float, ...]) -> RawEventCurve:
    """Follow an event of the exact model to the values `to` of the family's parameter.

    Parameters
    ----------
    event : ExactEvent
        At the start of the family.
    control : Control or None
        In the contact's units; None for first touch.
    to : tuple of float
        One value, or one on each side of the start.

    Raises
    ------
    InputError
        If a member of the family is not one of the exact model.
    """
    following = _Following(family, event, control)
    goals = {family.coordinate(value): value for value in to}
    start = family.coordinate(family.start)
    known = {**goals, start: family.start}
    ends = sorted(goals, key=lambda q: (q > start, abs(q - start)))
    low, high = (start, ends[0]) if len(ends) == 1 else (min(ends), max(ends))
    if low == high:
        raise InputError(f"to: {to[0]:g}; is the present value of {family.name}, give another one")
    grid = np.linspace(low, high, POINTS)
    grid = np.unique(np.append(grid, [q for q in known if min(low, high) <= q <= max(low, high)]))
    grid = grid if low < high else grid[::-1]
    passes = event.name != "jump-in"
    rows: list[RawPoint] = []
    special: list[RawSpecial] = []
    level = 0.0
    for k, q in enumerate(map(float, grid)):
        now = following.excess(q) if passes else 1.0
        if k and passes and now * level < 0:
            special.append(following.passage(float(grid[k - 1]), q, len(rows)))
            rows.append(special[-1].point)
        level = now
        rows.append(following.point(q, known.get(q, family.value(q))))
    if family.spacing == "angle":
        for index, q in ((0, float(grid[0])), (len(rows) - 1, float(grid[-1]))):
            value = known.get(q, math.nan)
            if value == 0.0 or math.isinf(value):
                kind = "load-fold" if value == 0.0 else "displacement-fold"
                message = f"The fold of the spring has become a {kind.replace('-', ' ')}."
                special.append(RawSpecial(kind, index, rows[index], 0.0, message=message))

    def at(value: float) -> list[RawPoint]:
        q = family.coordinate(value)
        return [following.point(q, value)] if min(low, high) <= q <= max(low, high) else []

    special.sort(key=lambda one: one.index)
    return RawEventCurve(tuple(rows), tuple(special), at, True, "", 0, 1)
