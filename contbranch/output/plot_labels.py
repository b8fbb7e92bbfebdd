"""Labels beside points of a plot, placed where they cover neither lines nor markers nor each other."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np
from matplotlib import rcParams
from matplotlib.axes import Axes
from matplotlib.path import Path
from matplotlib.text import Text
from matplotlib.transforms import Bbox

from contbranch.arrays import Array

_DISTANCES = (6.0, 10.0, 16.0, 24.0, 34.0, 46.0, 60.0)  # points, from the marker to the label's edge
_DIRECTIONS = 24
_NEAR = 10.0  # up to this distance a label needs no line to its point
_HALF = 4.5  # half the side of the square that a marker occupies, points
_ROOM = 1.5  # around a label, points
_BLOCKED, _OUTSIDE = 10.0, 10.0  # what it costs to cover a label, in lines covered; and to leave the frame, in labels


# A place of a label, in pixels: its box, the line from its point, and how far it is away.
_Place = tuple[Bbox, Path | None, float]


def place_labels(axes: Axes, points: Array, texts: Sequence[str], colors: Sequence[str]) -> None:
    """Write a text beside each point (N, 2) in data coordinates, with a line to it where it had to go far.

    Each label takes, in turn, the nearest place around its point where nothing is in the way; where there is none, the
    one with the least. The layout of the figure must be final.
    """
    figure: Any = axes.get_figure(root=True)
    unit, frame, size = figure.dpi / 72.0, axes.get_window_extent(), rcParams["legend.fontsize"]
    at = axes.transData.transform(points.reshape(-1, 2))
    seen = [i for i, place in enumerate(at) if frame.contains(*place)]
    shown = (line for line in axes.get_lines() if line.get_linestyle() != "None")
    lines = [line.get_transform().transform_path(line.get_path()) for line in shown]
    taken = [Bbox([at[i], at[i]]).padded(_HALF * unit) for i in seen]

    def obstacles(place: _Place, others: Array) -> float:
        """What is in the way of a place, the frame and nearer points included, whose name it would seem to be."""
        box, leader, distance = place
        apart = np.maximum(np.maximum(box.min - others, others - box.max), 0.0)
        mistaken = leader is None and bool(np.any(np.hypot(*apart.T) < (distance + 1.0) * unit))
        inside = frame.contains(*box.min) and frame.contains(*box.max)
        blocked = mistaken + box.count_overlaps(taken) + _OUTSIDE * (not inside)
        crossed = sum(path.intersects_bbox(box, filled=False) for path in lines)
        if leader is not None:
            blocked += sum(leader.intersects_bbox(one, filled=False) for one in taken)
        return _BLOCKED * blocked + crossed

    for i in seen:
        text = Text(0.0, 0.0, texts[i], fontsize=size, figure=figure)
        extent = np.array(text.get_window_extent(figure.canvas.get_renderer()).padded(_ROOM * unit).size)
        others = np.array([at[j] for j in seen if np.hypot(*(at[j] - at[i])) > unit]).reshape(-1, 2)
        costs: list[tuple[float, _Place]] = []
        for place in _places(at[i], extent, unit):
            costs.append((obstacles(place, others), place))
            if not costs[-1][0]:
                break
        box, leader, _ = min(costs, key=lambda one: one[0])[1]
        taken.append(box)
        lines += [] if leader is None else [leader]
        style = {"arrowstyle": "-", "linewidth": 0.5, "color": colors[i], "shrinkA": 0.0, "shrinkB": 3.0}
        offset = (box.get_points().mean(axis=0) - at[i]) / unit
        axes.annotate(
            texts[i], tuple(points[i]), tuple(offset), textcoords="offset points", ha="center", va="center",
            fontsize=size, color=colors[i], arrowprops=None if leader is None else style, zorder=6,
        )  # fmt: skip


def _places(at: Array, extent: Array, unit: float) -> Iterator[_Place]:
    """Places all around a point for a label of a size, the nearest first."""
    for distance in _DISTANCES:
        for angle in np.linspace(0.0, 2.0 * np.pi, _DIRECTIONS, endpoint=False):
            ray = np.array([np.cos(angle), np.sin(angle)])
            centre = at + ray * (distance * unit + 0.5 * extent)
            ends = at + np.outer([1.5 * _HALF, distance], ray) * unit
            leader = Path(ends) if distance > _NEAR else None
            yield Bbox([centre - 0.5 * extent, centre + 0.5 * extent]), leader, distance
