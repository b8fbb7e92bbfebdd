"""Regions of a parameter and a control, from followed folds and from curves traced between."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from itertools import pairwise

import numpy as np

from contbranch.contact.contact import Contact
from contbranch.contact.family import Family
from contbranch.curve.follow import followed
from contbranch.errors import ModelError
from contbranch.results.diagram import Cost, Diagram, Event
from contbranch.results.followed import Followed, FollowedPoint
from contbranch.results.phase import Part, PhaseDiagram
from contbranch.watch import check, kept, over, part, tell, told

__all__ = ["Regions"]

# An event lies on a followed curve if that passes it as closely as this, relative to max(1, |value|) in reduced units.
SAME_EVENT = 1e-4
LEVELS = 161
# Distance from a special point at which curves are traced, in that of those traced anyway.
SPECIAL_DISTANCE = 0.02
# Room beyond the boundaries, as a share of their extent.
FRAME_SHARE = 0.12


@dataclass
class Regions:
    """The regions of a family and a control, while they are found.

    Attributes
    ----------
    family : Family
    kind : {"load", "displacement"}
    between : (float, float)
        Values of the parameter, the lower one first.
    accuracy : float
        Of the boundaries.
    trace : callable
        The diagram of a contact.
    """

    family: Family
    kind: str
    between: tuple[float, float]
    accuracy: float
    trace: Callable[[Contact], Diagram]
    boundaries: list[Followed] = field(default_factory=list)
    values: list[float] = field(default_factory=list)
    parts: list[tuple[Part, ...]] = field(default_factory=list)
    messages: list[str] = field(default_factory=list)
    newton: int = 0

    def find(self, samples: int) -> PhaseDiagram:
        """Trace curves at so many values, and follow what bounds their parts."""
        began, family = time.perf_counter(), self.family
        low, high = (family.coordinate(value) for value in self.between)
        values = [family.value(float(q)) for q in np.linspace(low, high, samples)]
        values[0], values[-1] = self.between
        kept(lambda: self._sample(values), None)
        kept(lambda: self._sample(self._beside_special()), None)
        order = np.argsort(self.values, kind="stable").tolist()
        return PhaseDiagram(
            parameter=family.name,
            control=self.kind,  # type: ignore[arg-type]
            values=np.array([self.values[k] for k in order]),
            parts=tuple(self.parts[k] for k in order),
            levels=self._levels(),
            boundaries=tuple(self.boundaries),
            contact=family.contact,
            cost=Cost(time.perf_counter() - began, self.newton),
            logarithmic=family.spacing == "logarithmic" and self.between[0] > 0,
            status="incomplete" if self.messages or over() else "complete",
            message=told(" ".join(dict.fromkeys(self.messages))),
            unit_names=family.contact.units.names,
        )

    def _sample(self, values: Sequence[float]) -> None:
        """Trace the curves at values, as far as that is not interrupted."""
        for k, value in enumerate(values):
            with part(k / len(values), (k + 1) / len(values)):
                tell(0.0, f"{self.family.name} {value:.4g}")
                self._add(value)

    def _beside_special(self) -> list[float]:
        """Values on both sides of every special point, close to it: the parts change there."""
        known = [self.family.coordinate(value) for value in self.values]
        if len(known) < 2:
            return []
        low, high = min(known), max(known)
        distance = SPECIAL_DISTANCE * (high - low) / (len(known) - 1)
        special = [one.value for found in self.boundaries for one in found.special if one.control is None]
        places = [place for place in map(self.family.coordinate, special) if low < place < high]
        count = len(known)
        for place in sorted(place + side * distance for place in places for side in (-1.0, 1.0)):
            if min(abs(place - other) for other in known) > 0.5 * distance:
                known.append(place)
        return [self.family.value(place) for place in known[count:]]

    def _add(self, value: float) -> None:
        """Trace the curve at a value, and follow the events on it that lie on no known boundary."""
        member = self.family.member(value)
        diagram = self.trace(member)
        self.newton += diagram.cost.newton
        check()
        if diagram.status != "complete":
            self.messages.append(f"At {self.family.name} = {value:.4g}: {diagram.message}")
        edges = [e for e in diagram.events if e.kind == "touch" or (e.kind == "fold" and e.control == self.kind)]
        ends = sorted([*edges, *_begun_on_rings(diagram)], key=lambda e: e.position)
        self.values.append(value)
        self.parts.append(_parts(diagram, ends, self.kind))
        known = [k for boundary in self.boundaries for k in _met(boundary, edges, value, member)]
        for k, event in enumerate(edges):
            if k in known:
                continue
            goals = tuple(v for v in self.between if v != value)
            found = followed(event, replace(self.family, start=value, contact=member), goals, self.accuracy)
            self.boundaries.append(found)
            known += _met(found, edges, value, member)
            self.newton += found.cost.newton
            if found.status != "complete":
                self.messages.append(found.message)

    def _levels(self) -> np.ndarray:
        """Values of the control that frame the boundaries."""
        found = [value for boundary in self.boundaries for value in boundary.curve[self.kind]]
        found = found or [end for row in self.parts for part in row for end in (part.start, part.stop)]
        finite = [value for value in found if math.isfinite(value)] or [0.0]
        room = FRAME_SHARE * (np.ptp(finite) or max(1.0, abs(finite[0])))
        return np.linspace(min(finite) - room, max(finite) + room, LEVELS)


def _begun_on_rings(diagram: Diagram) -> list[Event]:
    """Events at which contact begins or ends away from the centre, which are not followed."""

    def begins(event: Event) -> bool:
        row = round(event.position)
        beside = diagram.branches[0].contact_radius[max(row - 1, 0) : row + 2]
        return bool((beside[0] > 0.0) != (beside[-1] > 0.0))

    return [event for event in diagram.events if event.kind == "topology" and begins(event)]


def _parts(diagram: Diagram, events: Sequence[Event], kind: str) -> tuple[Part, ...]:
    """The parts of a traced curve between events in order, the ends taken as far as they go."""
    branch = diagram.branches[0]
    control, unstable = getattr(branch, kind), branch.unstable(kind)
    rows = [0, *(round(e.position) for e in events), len(branch) - 1]
    limits = [
        0.0 if kind == "load" else -math.inf,
        *(getattr(e, kind) for e in events),
        math.inf if diagram.status == "complete" else float(control[-1]),
    ]
    stable = [bool(unstable[(a + b) // 2] == 0) if b - a >= 2 else None for a, b in pairwise(rows)]
    for k, known in enumerate(stable):
        if known is None:  # no row between two events: a fold's other side
            other, beside = (stable[k - 1], events[k - 1]) if k else (stable[1], events[0])
            stable[k] = bool(other) == (beside.kind != "fold")
    touching = [b > a and bool(branch.contact_radius[b] > 0) for a, b in pairwise(rows)]
    ends = pairwise(limits)
    return tuple(Part(*end, disc, bool(held)) for end, disc, held in zip(ends, touching, stable, strict=True))


def _met(boundary: Followed, events: Sequence[Event], value: float, member: Contact) -> list[int]:
    """The events that lie on a followed curve, one for each of its points: another one may be nearly as close."""
    scales = member.scales
    try:
        points = boundary.at(value)
    except ModelError:  # a curve that cannot be solved there is followed anew
        return []

    def apart(event: Event, point: FollowedPoint) -> float:
        load = abs(point.load - event.load) / max(scales.load, abs(event.load))
        shift = abs(point.displacement - event.displacement) / max(scales.normal, abs(event.displacement))
        return max(load, shift, abs(point.contact_radius - event.contact_radius) / (30 * scales.in_plane))

    found: dict[int, int] = {}  # of a point, its event
    alike = [k for k, event in enumerate(events) if event.kind == boundary.event.kind]
    for distance, i, k in sorted((apart(events[k], point), i, k) for i, point in enumerate(points) for k in alike):
        if distance <= SAME_EVENT and i not in found and k not in found.values():
            found[i] = k
    return list(found.values())
