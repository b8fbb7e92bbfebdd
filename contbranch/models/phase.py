"""`phase_diagram`: regions of a parameter and a control, from followed folds and from curves traced between."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Sequence
from itertools import pairwise

import numpy as np

from contbranch.contact.contact import Contact
from contbranch.contact.family import Family, Vary, family_of
from contbranch.control import as_control
from contbranch.errors import InputError, ModelError
from contbranch.models.choice import choose
from contbranch.models.follow import follow_in
from contbranch.models.grid import FreeSpace, Periodic
from contbranch.models.run import trace
from contbranch.results.diagram import Branch, Cost, Diagram, Event
from contbranch.results.followed import Followed
from contbranch.results.phase import Part, PhaseDiagram

__all__ = ["phase_diagram"]

Progress = Callable[[float, str], None]

# An event lies on a followed curve if that passes it as closely as this, relative to max(1, |value|) in reduced units.
SAME = 1e-4
LEVELS = 161
# Room beyond the boundaries, as a share of their extent.
MARGIN = 0.12


def phase_diagram(
    contact: Contact,
    vary: Vary = "tabor",
    between: Sequence[float] = (0.25, 4.0),
    control: str = "load",
    *,
    start: float | None = None,
    samples: int = 17,
    accuracy: float = 1e-6,
    progress: Progress | None = None,
) -> PhaseDiagram:
    """Find the regions of a parameter and a control by the number and kind of stable states.

    The contact is traced at values of the parameter; every fold of the control and every first touch met there is
    followed to both ends, unless it lies on a curve that is known. Folds that appear and vanish between neighbouring
    values are missed: ask for more samples.

    Parameters
    ----------
    contact : Contact
    vary : str or callable
        As for `follow`, apart from a stiffness.
    between : pair of floats
        Values of the parameter.
    control : {"load", "displacement"}
    start : float, optional
        Present value of the parameter of a function.
    samples : int
        Values at which the contact is traced, at least 3.
    accuracy : float
        Of the boundaries, as for `follow`.

    Returns
    -------
    PhaseDiagram

    Raises
    ------
    InputError
        If an argument cannot be used.
    """
    began = time.perf_counter()
    kind = as_control(control).kind
    if kind == "spring" or vary == "stiffness":
        raise InputError("control: a spring; phase diagrams are for load and displacement control")
    if len(between) != 2 or not between[0] < between[1]:
        raise InputError(f"between: {tuple(between)}; give two values, the lower one first")
    if samples < 3:
        raise InputError(f"samples: {samples}; must be at least 3")
    if isinstance(choose(contact)[0], Periodic | FreeSpace):
        raise InputError("contact: its tip needs a grid; phase diagrams are made of curves that grids cannot follow")
    family = family_of(contact, vary, between[0], start)
    if family.spacing == "logarithmic" and between[0] * between[1] <= 0:
        raise InputError(f"between: {tuple(between)}; both must have the sign of the present {family.name}")
    grid = np.linspace(family.coordinate(between[0]), family.coordinate(between[1]), samples)
    values = [family.value(float(q)) for q in grid]
    values[0], values[-1] = float(between[0]), float(between[1])
    boundaries: list[Followed] = []
    parts: list[tuple[Part, ...]] = []
    messages: list[str] = []
    newton = 0
    for k, value in enumerate(values):
        if progress is not None:
            progress(k / samples, f"{family.name} {value:.4g}")
        member = family.member(value)
        diagram = trace(member, control=kind, accuracy=max(accuracy, 1e-5))
        newton += diagram.cost.newton
        if diagram.status != "complete":
            messages.append(f"At {family.name} = {value:.4g}: {diagram.message}")
        parts.append(_parts(diagram, kind))
        for event in _edges(diagram, kind):
            if any(_on(followed, event, value, member) for followed in boundaries):
                continue
            own = Family(family.name, value, member, family.member, family.spacing)
            goals = tuple(v for v in between if v != value)
            boundaries.append(follow_in(event, own, goals, accuracy))
            newton += boundaries[-1].cost.newton
            if boundaries[-1].status != "complete":
                messages.append(boundaries[-1].message)
    return PhaseDiagram(
        parameter=family.name,
        control=kind,
        values=np.array(values),
        parts=tuple(parts),
        levels=_levels(boundaries, kind, parts),
        boundaries=tuple(boundaries),
        contact=contact,
        cost=Cost(time.perf_counter() - began, newton),
        logarithmic=family.spacing == "logarithmic" and between[0] > 0,
        status="incomplete" if messages else "complete",
        message=" ".join(dict.fromkeys(messages)),
        unit_names=contact.units.names,
    )


def _edges(diagram: Diagram, kind: str) -> list[Event]:
    """The events that bound parts of the curve under a control."""
    return [e for e in diagram.events if e.kind == "touch" or (e.kind == "fold" and e.control == kind)]


def _parts(diagram: Diagram, kind: str) -> tuple[Part, ...]:
    """The parts of a traced curve, the ends taken as far as they go."""
    branch = diagram.branches[0]
    control, unstable = getattr(branch, kind), branch.unstable(kind)
    events = sorted(_edges(diagram, kind), key=lambda e: e.position)
    rows = [0, *(round(e.position) for e in events), len(branch) - 1]
    limits = [
        0.0 if kind == "load" else -math.inf,
        *(getattr(e, kind) for e in events),
        math.inf if diagram.status == "complete" else float(control[-1]),
    ]
    stable = [_stable(unstable, a, b) for a, b in pairwise(rows)]
    for k in range(len(stable)):
        if stable[k] is None:  # no row between two events: a fold's other side
            other = stable[k - 1] if k else stable[k + 1]
            beside = events[k - 1] if k else events[0]
            stable[k] = bool(other) == (beside.kind == "touch")
    return tuple(
        Part(limits[k], limits[k + 1], _touching(branch, rows[k], rows[k + 1]), bool(stable[k]))
        for k in range(len(stable))
    )


def _stable(unstable: np.ndarray, first: int, last: int) -> bool | None:
    """Whether the part between two rows is stable; None if there is no row between."""
    if last - first < 2:
        return None
    return bool(unstable[(first + last) // 2] == 0)


def _touching(branch: Branch, first: int, last: int) -> bool:
    return bool(branch.contact_radius[max(first, last)] > 0) if last > first else False


def _on(followed: Followed, event: Event, value: float, member: Contact) -> bool:
    """Whether an event lies on a followed curve."""
    if followed.event.kind != event.kind:
        return False
    scales = member.scales
    try:
        points = followed.at(value)
    except ModelError:  # a curve that cannot be solved there is followed anew
        return False
    for point in points:
        near = (
            abs(point.load - event.load) <= SAME * max(scales.load, abs(event.load)),
            abs(point.displacement - event.displacement) <= SAME * max(scales.normal, abs(event.displacement)),
            abs(point.contact_radius - event.contact_radius) <= 30 * SAME * scales.in_plane,
        )
        if all(near):
            return True
    return False


def _levels(boundaries: list[Followed], kind: str, parts: list[tuple[Part, ...]]) -> np.ndarray:
    """Values of the control that frame the boundaries."""
    found = [value for followed in boundaries for value in followed.curve[kind]]
    if not found:
        found = [end for row in parts for part in row for end in (part.start, part.stop)]
    finite = [value for value in found if math.isfinite(value)] or [0.0]
    low, high = min(finite), max(finite)
    room = MARGIN * ((high - low) or max(1.0, abs(high)))
    return np.linspace(low - room, high + room, LEVELS)
