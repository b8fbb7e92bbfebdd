"""Labels beside points of a plot, placed where they cover neither lines nor markers nor each other."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from matplotlib import rcParams
from matplotlib.axes import Axes
from matplotlib.text import Text

from contbranch.arrays import Array, Integers

_CELL = 1.5  # points, of the map of what is in the way
_PAD = 80  # cells around the frame
_LINE, _MARKER, _LABEL, _OUTSIDE = 3.0, 20.0, 20.0, 20.0  # what it costs to cover a cell
_HALF = 4.5  # half the side of the square that a marker occupies, points
_DISTANCES = (6.0, 10.0, 16.0, 24.0, 34.0, 46.0, 60.0)  # points, from the marker to the label's edge
_FAR = 0.1  # the cost of a point of distance
_DOUBT = 30.0  # that of a label that might belong to another point
_NEAR = 10.0  # up to this distance a label needs no line to its point
_DIRECTIONS = 24
_FINE = 3  # places on a line to a point, a dozen times
_PASSES = 3
_ROOM = 1.5  # around a label, points


class _Places(NamedTuple):
    """Places of a label, in cells: centres and corners (N, 2), distances (N,) in points, and leaders (N, S, 2).

    `doubt` (N,) is what it costs that a label without a line stands nearer to another point.
    """

    centre: Array
    low: Integers
    high: Integers
    distance: Array
    leader: Integers
    doubt: Array

    def cheapest(self, busy: Array) -> int:
        """The place that covers least of a map."""
        total = np.zeros((busy.shape[0] + 1, busy.shape[1] + 1))
        total[1:, 1:] = busy.cumsum(0).cumsum(1)
        (x0, y0), (x1, y1) = self.low.T, self.high.T
        covered = total[x1, y1] - total[x0, y1] - total[x1, y0] + total[x0, y0]
        crossed = np.where(
            self.distance > _NEAR, busy[self.leader[..., 0], self.leader[..., 1]].sum(axis=1) / _FINE, 0.0
        )
        return int(np.argmin(covered + crossed + _FAR * self.distance + self.doubt))

    def stamp(self, chosen: int, busy: Array) -> None:
        """Mark a place on a map."""
        (x0, y0), (x1, y1) = self.low[chosen], self.high[chosen]
        busy[x0:x1, y0:y1] += _LABEL
        if self.distance[chosen] > _NEAR:
            busy[tuple(self.leader[chosen].T)] += _LABEL


def place_labels(axes: Axes, points: Array, texts: Sequence[str], colors: Sequence[str]) -> None:
    """Write a text beside each point (N, 2) in data coordinates, with a line to it where it had to go far.

    Each label takes, in turn and three times over, the place of least cost among those around its point, on a map of
    lines, markers and other labels; distance costs little. The layout of the figure must be final.
    """
    figure: Any = axes.get_figure(root=True)
    cell = _CELL * figure.dpi / 72.0
    frame = axes.get_window_extent()
    corner, extent = np.array([frame.x0, frame.y0]), np.array([frame.width, frame.height]) / cell
    busy = np.full(np.ceil(extent).astype(int) + 2 * _PAD, _OUTSIDE)
    busy[_PAD:-_PAD, _PAD:-_PAD] = 0.0
    for line in axes.get_lines():
        if line.get_linestyle() != "None":
            xy = np.asarray(line.get_xydata(), dtype=float)
            pixels = line.get_transform().transform(xy[np.isfinite(xy).all(axis=1)])
            on = _resampled((pixels - corner) / cell)
            inside = np.floor(on[np.all((on >= 0.0) & (on < extent), axis=1)]).astype(int) + _PAD
            busy[tuple(inside.T)] = _LINE
    at = (axes.transData.transform(points) - corner) / cell if len(points) else np.zeros((0, 2))
    seen = [i for i, place in enumerate(at) if np.all((place >= 0.0) & (place <= extent))]
    places = {}
    for i in seen:
        others = np.array([at[j] + _PAD for j in seen if np.hypot(*(at[j] - at[i])) > 1.0]).reshape(-1, 2)
        places[i] = _places(at[i] + _PAD, _size(figure, texts[i]) / cell, busy.shape, others)
    for i in seen:
        low, high = (np.round(at[i] + _PAD + side * _HALF / _CELL).astype(int) for side in (-1, 1))
        busy[low[0] : high[0], low[1] : high[1]] = _MARKER
    chosen: dict[int, int] = {}
    for _ in range(_PASSES):  # a label placed early moves if later ones took better places beside it
        for i in seen:
            now = busy.copy()
            for other in chosen.keys() - {i}:
                places[other].stamp(chosen[other], now)
            chosen[i] = places[i].cheapest(now)
    size = rcParams["legend.fontsize"]
    for i, place in chosen.items():
        offset = (places[i].centre[place] - _PAD - at[i]) * _CELL
        style = {"arrowstyle": "-", "linewidth": 0.5, "color": colors[i], "shrinkA": 0.0, "shrinkB": 3.0}
        axes.annotate(
            texts[i], tuple(points[i]), tuple(offset), textcoords="offset points", ha="center", va="center",
            fontsize=size, color=colors[i], arrowprops=style if places[i].distance[place] > _NEAR else None, zorder=6,
        )  # fmt: skip


def _places(at: Array, size: Array, shape: tuple[int, ...], others: Array) -> _Places:
    """Return places all around a point for a label of a size, their edges at about each of the distances from it.

    `others` (P, 2) are the other points.
    """
    angles = 2.0 * np.pi * np.arange(_DIRECTIONS) / _DIRECTIONS
    rays = np.tile(np.column_stack([np.cos(angles), np.sin(angles)]), (len(_DISTANCES), 1))
    distance = np.repeat(_DISTANCES, _DIRECTIONS)
    centre = at + rays * (distance[:, None] / _CELL + 0.5 * size)
    limits = np.array(shape)
    low = np.clip(np.floor(centre - 0.5 * size), 0, limits).astype(int)
    high = np.clip(np.ceil(centre + 0.5 * size), 0, limits).astype(int)
    # From beside the marker to the edge of the label, where its own box is counted.
    along = at + rays[:, None, :] * np.linspace(1.5 * _HALF, distance, 12 * _FINE, axis=1)[:, :, None] / _CELL
    off = np.abs(others[:, None] - centre) - 0.5 * size
    nearer = (_CELL * np.hypot(*np.moveaxis(np.maximum(off, 0.0), -1, 0)) < distance + 1.0).any(axis=0)
    doubt = np.where(nearer & (distance <= _NEAR), _DOUBT, 0.0)
    return _Places(centre, low, high, distance, np.clip(along, 0, limits - 1).astype(int), doubt)


def _size(figure: Any, text: str) -> Array:
    """Return width and height of a text with some room around it, in pixels."""
    extent = Text(0.0, 0.0, text, fontsize=rcParams["legend.fontsize"], figure=figure).get_window_extent(
        figure.canvas.get_renderer()
    )
    return np.array([extent.width, extent.height], dtype=float) + 2.0 * _ROOM * float(figure.dpi) / 72.0


def _resampled(points: Array) -> Array:
    """Return points along a polygon, half a cell apart; a hundred thousand of them at most."""
    if len(points) < 2:
        return points
    length = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(points, axis=0).T))])
    at = np.linspace(0.0, length[-1], int(np.clip(2.0 * length[-1], 2, 100_000)))
    return np.column_stack([np.interp(at, length, points[:, k]) for k in (0, 1)])
