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
PIECES = 16
MARKERS = {"fold": "ko", "branch point": "ks", "hopf": "k^"}


def draw(curve: Curve, x: Quantity, y: Quantity, ax: Axes | None, line: dict[str, Any]) -> Figure:
    """Draw what `Curve.plot` documents."""
    if ax is None:
        ax = Figure(layout="constrained").add_subplot()
    for label, quantity in (("xlabel", x), ("ylabel", y)):
        if not getattr(ax, f"get_{label}")():
            ax.set(**{label: _name(quantity)})
    (first,) = ax.plot([], [], **line)  # takes its colour from the axes' cycle
    line = {**line, "color": first.get_color(), "label": None}
    between = curve.unstable_between
    dashed = [False] * (len(curve.points) - 1) if between is None else list(between > 0)
    pairs = zip(pairwise(curve.points), dashed, strict=True)
    for unstable, part in groupby(pairs, key=lambda pair: pair[1]):
        points = [point for pair, _ in part for point in _between(*pair, straight=_recorded(x) or _recorded(y))]
        style = {"linestyle": "--", "label": _new("unstable", ax)} if unstable else {}
        ax.plot(_values(x, points), _values(y, points), **{**line, **style})
    for kind in dict.fromkeys(event.kind for event in curve.events):
        points = [event.point for event in curve.events if event.kind == kind]
        ax.plot(_values(x, points), _values(y, points), MARKERS.get(kind, "kx"), label=_new(kind, ax), zorder=3, ms=5)
    if ax.get_legend_handles_labels()[1]:
        ax.legend()
    return cast(Figure, ax.figure)


def _between(begin: Point, end: Point, straight: bool) -> list[Point]:
    """Return points from one to the next, on the cubic through both and their tangents where that is known."""
    if straight or begin.x.size != end.x.size:
        return [begin, end]
    at = segment_between(begin, end).at
    inside = [replace(begin, x=x, parameter=p) for x, p in map(at, np.arange(1, PIECES) / PIECES)]
    return [begin, *inside, end]


def _recorded(quantity: Quantity) -> bool:
    """Whether a quantity is known at the points alone."""
    return isinstance(quantity, str) and quantity != "parameter"


def _values(quantity: Quantity, points: list[Point]) -> list[float]:
    if quantity == "parameter":
        return [point.parameter for point in points]
    if isinstance(quantity, str):
        return [point.observables[quantity] for point in points]
    if isinstance(quantity, int):
        return [float(point.x[quantity]) for point in points]
    return [float(quantity(point.x, point.parameter)) for point in points]


def _name(quantity: Quantity) -> str:
    if isinstance(quantity, int):
        return f"x[{quantity}]"
    return {"parameter": "p"}.get(quantity, quantity) if isinstance(quantity, str) else ""


def _new(label: str, ax: Axes) -> str | None:
    """Return a label unless the axes have it already."""
    return None if label in ax.get_legend_handles_labels()[1] else label
