"""Bifurcation diagrams of curves."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from itertools import groupby, pairwise
from typing import Any, cast

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from contbranch.continuation.curve import Curve, Point
from contbranch.continuation.problem import Array
from contbranch.continuation.segment import segment_between

Quantity = str | int | Callable[[Array, float], float]

# Pieces in which the cubic between two points is drawn.
DRAWN_PIECES = 16
MARKERS = {"fold": "ko", "branch point": "ks", "hopf": "k^"}


def draw(curve: Curve, x: Quantity, y: Quantity, ax: Axes | None, line: dict[str, Any]) -> Figure:
    """Draw what `Curve.plot` documents."""
    if ax is None:
        ax = Figure(layout="constrained").add_subplot()
    (x_label, across), (y_label, up) = _read(x), _read(y)
    ax.set(xlabel=ax.get_xlabel() or x_label, ylabel=ax.get_ylabel() or y_label)
    (first,) = ax.plot([], [], **line)  # takes its colour from the axes' cycle
    line = {**line, "color": first.get_color(), "label": None}
    between = curve.unstable_between
    dashed = [False] * (len(curve.points) - 1) if between is None else list(between > 0)
    straight = any(isinstance(quantity, str) and quantity != "parameter" for quantity in (x, y))
    pairs = zip(pairwise(curve.points), dashed, strict=True)
    for unstable, part in groupby(pairs, key=lambda pair: pair[1]):
        points = [point for pair, _ in part for point in _between(*pair, straight)]
        style = {"linestyle": "--", "label": _new("unstable", ax)} if unstable else {}
        ax.plot(list(map(across, points)), list(map(up, points)), **{**line, **style})
    for kind in dict.fromkeys(event.kind for event in curve.events):
        points = [event.point for event in curve.events if event.kind == kind]
        marker, label = MARKERS.get(kind, "kx"), _new(kind, ax)
        ax.plot(list(map(across, points)), list(map(up, points)), marker, label=label, zorder=3, ms=5)
    if ax.get_legend_handles_labels()[1]:
        ax.legend()
    return cast(Figure, ax.figure)


def _read(quantity: Quantity) -> tuple[str, Callable[[Point], float]]:
    """Return the label of a quantity, and what reads it at a point."""
    if callable(quantity):
        return "", lambda point: float(quantity(point.x, point.parameter))
    if quantity == "parameter":
        return "p", lambda point: point.parameter
    if isinstance(quantity, str):
        return quantity, lambda point: point.observables[quantity]
    return f"x[{quantity}]", lambda point: float(point.x[quantity])


def _between(begin: Point, end: Point, straight: bool) -> list[Point]:
    """Return points from one to the next: the two, or on the cubic through both and their tangents."""
    if straight or begin.x.size != end.x.size:
        return [begin, end]
    at = segment_between(begin, end).at
    inside = [replace(begin, x=x, parameter=p) for x, p in map(at, np.arange(1, DRAWN_PIECES) / DRAWN_PIECES)]
    return [begin, *inside, end]


def _new(label: str, ax: Axes) -> str | None:
    """Return a label unless the axes have it already."""
    return None if label in ax.get_legend_handles_labels()[1] else label
