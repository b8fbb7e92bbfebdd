"""What a bifurcation diagram shows: pieces of the curve by stability, limits that frame its events, axis labels."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from contbranch.errors import InputError

if TYPE_CHECKING:
    from contbranch.diagram import Branch, Diagram, Event

__all__ = ["Limits", "Piece", "axis_label", "check_observables", "pieces", "view"]

Array = NDArray[np.float64]

# observable: (words, symbol, its unit where R = E = |Δγ| = 1, (23)-(26))
_AXES: Final = {
    "load": ("Load", "F_N", r"R\,|\Delta\gamma|"),
    "displacement": ("Displacement", "d", r"(R\,|\Delta\gamma|^2/E^2)^{1/3}"),
    "contact_radius": ("Contact radius", "a_c", r"(R^2|\Delta\gamma|/E)^{1/3}"),
    "central_gap": ("Central gap", "g(0)", r"(R\,|\Delta\gamma|^2/E^2)^{1/3}"),
    "energy": ("Energy", "V", r"(R^4|\Delta\gamma|^5/E^2)^{1/3}"),
    "gap": ("Gap", "g", ""),
    "pressure": ("Pressure", "p", ""),
    "r": ("Radius", "r", ""),
}
_COORDINATES: Final = ("load", "displacement", "contact_radius", "central_gap", "energy")

_PAD: Final = 1.0  # of the extent of the events, shown on either side of them
_LEAST_PAD: Final = 0.15  # of the events' distance from zero: context for a narrow window
_MARGIN: Final = 0.07  # of the axis, so that no line lies on the frame


class Piece(NamedTuple):
    """A part of a branch with one stability: coordinates (M,) and whether it is stable."""

    x: Array
    y: Array
    stable: bool


class Limits(NamedTuple):
    """Limits of the two axes."""

    x: tuple[float, float]
    y: tuple[float, float]


def axis_label(name: str, unit_names: Mapping[str, str], natural: bool) -> str:
    """Return words, symbol and unit of an observable; `natural`: the unit is made of R, E and |Δγ|."""
    words, symbol, reduced_unit = _AXES[name]
    unit = unit_names.get({"r": "radius"}.get(name, name), "")
    if unit:
        return f"{words} ${symbol}$ ({unit})"
    if natural and reduced_unit:
        return f"${symbol}\\,/\\,{_bracketed(reduced_unit)}$"
    return f"{words} ${symbol}$"


def _bracketed(unit: str) -> str:
    return unit if unit.startswith("(") else f"({unit})"


def pieces(diagram: Diagram, number: int, x: str, y: str) -> list[Piece]:
    """Return the pieces of branch `number`, cut where the stability under the diagram's control changes.

    Located folds and touches are inserted between the points, so that lines pass through them and change there.
    """
    check_observables(x, y)
    branch = diagram.branches[number]
    position, coordinates, unstable = _vertices(diagram, branch, number, x, y)
    if len(position) < 2:
        return []
    stable = _segment_stability(unstable)
    cuts = np.flatnonzero(stable[1:] != stable[:-1]) + 1
    starts, stops = [0, *cuts], [*cuts, len(stable)]
    return [
        Piece(coordinates[i : j + 1, 0], coordinates[i : j + 1, 1], bool(stable[i]))
        for i, j in zip(starts, stops, strict=True)
    ]


def check_observables(x: str, y: str) -> None:
    """Raise InputError unless both can be drawn."""
    for field, name in (("x", x), ("y", y)):
        if name not in _COORDINATES:
            raise InputError(f"{field}: {name!r}; must be one of {', '.join(_COORDINATES)}")


def _is_cut(diagram: Diagram, event: Event) -> bool:
    """Whether stability under the diagram's control may change at an event."""
    return event.kind == "fold" and event.control == diagram.control


def _vertices(diagram: Diagram, branch: Branch, number: int, x: str, y: str) -> tuple[Array, Array, NDArray[np.int64]]:
    """Return position (M,), coordinates (M, 2) and unstable modes (M,); -1: fold of the control, -2: other event."""
    position = np.arange(len(branch), dtype=np.float64)
    points = np.column_stack([getattr(branch, x), getattr(branch, y)]).astype(np.float64)
    unstable = np.asarray(branch.unstable(diagram.control), dtype=np.int64)
    keep = np.isfinite(points).all(axis=1)
    events = [e for e in diagram.events if e.branch == number and e.kind in ("fold", "touch")]
    if "energy" in (x, y):
        events = []  # events carry no energy
    for event in events:
        keep &= np.abs(position - event.position) > 1e-6
    position = np.concatenate([position[keep], [e.position for e in events]])
    points = np.concatenate([points[keep], np.array([[getattr(e, x), getattr(e, y)] for e in events]).reshape(-1, 2)])
    flags = [-1 if _is_cut(diagram, e) else -2 for e in events]
    unstable = np.concatenate([unstable[keep], np.array(flags, dtype=np.int64)])
    order = np.argsort(position, kind="stable")
    return position[order], points[order], unstable[order]


def _segment_stability(unstable: NDArray[np.int64]) -> NDArray[np.bool_]:
    """Return for each segment (M - 1,) whether it is stable, from the unstable modes of the M vertices."""
    stable = np.zeros(len(unstable) - 1, dtype=bool)
    for i in range(len(stable)):
        known = [n == 0 for n in unstable[i : i + 2] if n >= 0]
        if known:
            stable[i] = all(known)
        elif i > 0:  # between two events inside one step: a fold turns stability over, a touch keeps it
            stable[i] = not stable[i - 1] if unstable[i] == -1 else stable[i - 1]
    return stable


def view(diagram: Diagram, x: str, y: str) -> Limits | None:
    """Return limits that frame the events, or None if there is nothing to frame and all of the curve is to be seen.

    The part of the curve from the first to the last event (and, where the load changes sign in contact, to zero load)
    is widened on all sides. A trace that starts far away or ends under a large load then does not squeeze its events.
    """
    check_observables(x, y)
    framed = [b for i, b in enumerate(diagram.branches) if _core(diagram, b, i) is not None]
    if not framed:
        return None
    windows = {name: _window(diagram, name) for name in {x, y, "load"}}
    seen = [_inside(branch, windows) for branch in diagram.branches]
    limits = []
    for name in (x, y):
        values = np.concatenate([getattr(b, name)[s] for b, s in zip(diagram.branches, seen, strict=True)])
        values = np.append(values, _event_values(diagram, name))
        low = max(float(np.nanmin(values)), windows[name][0])
        high = min(float(np.nanmax(values)), windows[name][1])
        margin = _MARGIN * ((high - low) or abs(high) or 1.0)
        limits.append((low - margin, high + margin))
    return Limits(limits[0], limits[1])


def _core(diagram: Diagram, branch: Branch, number: int) -> slice | None:
    """Return the points of a branch from its first to its last event, and on to zero load in contact."""
    positions = [e.position for e in diagram.events if e.branch == number and e.kind in ("fold", "touch")]
    if not positions:
        return None
    first, last = int(np.floor(min(positions))), int(np.ceil(max(positions)))
    sign = np.sign(branch.load)
    crossing = np.flatnonzero((sign[1:] * sign[:-1] < 0) & (branch.contact_radius[1:] > 0.0))
    if crossing.size:
        first, last = min(first, int(crossing[0])), max(last, int(crossing[-1]) + 1)
    return slice(max(first, 0), last + 1)


def _event_values(diagram: Diagram, name: str) -> list[float]:
    if name == "energy":
        return []
    return [getattr(e, name) for e in diagram.events if e.kind in ("fold", "touch")]


def _window(diagram: Diagram, name: str) -> tuple[float, float]:
    """Return the range of an observable that is worth showing."""
    values = list(_event_values(diagram, name))
    for number, branch in enumerate(diagram.branches):
        core = _core(diagram, branch, number)
        if core is not None:
            values += [float(np.nanmin(getattr(branch, name)[core])), float(np.nanmax(getattr(branch, name)[core]))]
    low, high = min(values), max(values)
    pad = max(_PAD * (high - low), _LEAST_PAD * max(abs(low), abs(high)))
    return low - pad, high + pad


def _inside(branch: Branch, windows: Mapping[str, tuple[float, float]]) -> NDArray[np.bool_]:
    """Return which points lie in all windows, with a neighbour on either side so that lines reach the frame."""
    inside = np.ones(len(branch), dtype=bool)
    for name, (low, high) in windows.items():
        inside &= (getattr(branch, name) >= low) & (getattr(branch, name) <= high)
    grown = inside.copy()
    grown[1:] |= inside[:-1]
    grown[:-1] |= inside[1:]
    return grown
