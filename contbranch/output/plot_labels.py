"""Labels beside points of a plot, placed where they cover neither lines nor markers nor each other."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, Final, NamedTuple

import numpy as np
from matplotlib.text import Text
from numpy.typing import NDArray

if TYPE_CHECKING:
    from matplotlib.axes import Axes

__all__ = ["place_labels"]

Array = NDArray[np.float64]

_DISTANCES: Final = (6.0, 10.0, 16.0, 24.0, 34.0, 46.0, 60.0)  # points, from the marker to the label's edge
_NEAR: Final = 10.0  # up to this distance a label needs no line to its point
_DIRECTIONS: Final = 16
_PASSES: Final = 3
_MARKER: Final = 4.0  # half the side of the square that a marker occupies, points
_ROOM: Final = 1.5  # around a label, points
_FONT: Final = 7.0


def place_labels(axes: Axes, points: Array, texts: Sequence[str], colors: Sequence[str]) -> None:
    """Write a text beside each point (N, 2) in data coordinates, with a line to it where it had to go far.

    Each label takes, in turn and three times over, the place of least cost among those around its point: covered
    lines, markers and other labels cost most, distance little. The layout of the figure must be final.
    """
    figure = axes.get_figure(root=True)
    assert figure is not None
    unit = figure.dpi / 72.0
    extent = axes.get_window_extent()
    frame = np.array([extent.x0, extent.y0, extent.x1, extent.y1])
    pixels = axes.transData.transform(points) if len(points) else np.zeros((0, 2))
    seen = [i for i, p in enumerate(pixels) if np.all((p >= frame[:2]) & (p <= frame[2:]))]
    lines = _line_pixels(axes, 2.0 * unit)
    obstacles = _Obstacles(
        lines=lines[np.all((lines >= frame[:2]) & (lines <= frame[2:]), axis=1)],
        markers=np.array([_square(pixels[i], _MARKER * unit) for i in seen]).reshape(-1, 4),
        frame=frame + np.array([2, 2, -2, -2]) * unit,
    )
    choices = {i: _places(pixels[i], _text_size(axes, texts[i]) + 2.0 * _ROOM * unit, unit) for i in seen}
    alone = {i: obstacles.costs(choices[i]) for i in seen}
    chosen: dict[int, _Place] = {}
    for _ in range(_PASSES):  # a label placed early moves if later ones took better places beside it
        for i in seen:
            others = [place for j, place in chosen.items() if j != i]
            chosen[i] = choices[i][int(np.argmin(alone[i] + _crowding(choices[i], others)))]
    for i, place in chosen.items():
        _write(axes, points[i], pixels[i], place, texts[i], colors[i])


class _Place(NamedTuple):
    """A place of a label: its box (x0, y0, x1, y1) in pixels, distance in points, and points (M, 2) on its leader."""

    box: Array
    distance: float
    leader: Array


class _Obstacles(NamedTuple):
    """What labels must not hide: points on lines (M, 2), boxes of markers (K, 4), and the frame they must not leave."""

    lines: Array
    markers: Array
    frame: Array

    def costs(self, places: Sequence[_Place]) -> Array:
        """Return how bad places are: 3 for a covered line point, much more for markers and the frame."""
        boxes = np.array([place.box for place in places])
        area = (boxes[0, 2] - boxes[0, 0]) * (boxes[0, 3] - boxes[0, 1])
        costs = np.array([0.1 * place.distance for place in places])
        costs += 3.0 * _counts_inside(self.lines, boxes)
        costs += 400.0 * np.sum(_overlaps(boxes, self.markers), axis=1) / area
        costs += 2000.0 * (1.0 - _overlaps(boxes, self.frame[None, :])[:, 0] / area)
        crossed = [np.sum(_counts_inside(place.leader, self.markers)) for place in places]
        return np.asarray(costs + 20.0 * np.array(crossed) + 4.0 * self._crossings(places))

    def _crossings(self, places: Sequence[_Place]) -> Array:
        """Return how many points of each leader (N,) lie on lines, on a grid as coarse as the points are apart."""
        cell = 0.01 * float(np.max(self.frame[2:] - self.frame[:2]))
        occupied = {(int(x), int(y)) for x, y in self.lines / cell}
        return np.array([sum((int(x), int(y)) in occupied for x, y in p.leader / cell) for p in places], dtype=float)


def _crowding(places: Sequence[_Place], others: Sequence[_Place]) -> Array:
    """Return how much places (N,) are in the way of labels that have theirs, leaders included."""
    if not others:
        return np.zeros(len(places))
    boxes, taken = (np.array([place.box for place in group]) for group in (places, others))
    area = (boxes[0, 2] - boxes[0, 0]) * (boxes[0, 3] - boxes[0, 1])
    costs = 400.0 * np.sum(_overlaps(boxes, taken), axis=1) / area
    costs += 20.0 * _counts_inside(np.concatenate([other.leader for other in others]), boxes)
    return np.asarray(costs + 20.0 * np.array([np.sum(_counts_inside(place.leader, taken)) for place in places]))


def _counts_inside(points: Array, boxes: Array) -> Array:
    """Return how many of the points (M, 2) lie in each of the boxes (N, 4)."""
    if not len(points):
        return np.zeros(len(boxes))
    x, y = points[:, :1].T, points[:, 1:].T
    inside = (x >= boxes[:, :1]) & (x <= boxes[:, 2:3]) & (y >= boxes[:, 1:2]) & (y <= boxes[:, 3:])
    return np.asarray(np.count_nonzero(inside, axis=1), dtype=np.float64)


def _overlaps(boxes: Array, others: Array) -> Array:
    """Return the areas (N, K) that boxes (N, 4) and others (K, 4) have in common, in square pixels."""
    low = np.maximum(boxes[:, None, :2], others[None, :, :2])
    high = np.minimum(boxes[:, None, 2:], others[None, :, 2:])
    return np.asarray(np.prod(np.maximum(high - low, 0.0), axis=2))


def _places(pixel: Array, size: Array, unit: float) -> list[_Place]:
    """Return the places tried for a label of a size around a point, in pixels; `unit` is a point in pixels."""
    return [
        _Place(box, distance, _leader(pixel, box, 2.0 * unit, distance))
        for distance in _DISTANCES
        for box in _boxes(pixel, size, distance * unit)
    ]


def _leader(pixel: Array, box: Array, spacing: float, distance: float) -> Array:
    """Return points on the line from a label to its point; none where the label is beside it."""
    if distance <= _NEAR:
        return np.zeros((0, 2))
    line = _resampled(np.array([pixel, 0.5 * (box[:2] + box[2:])]), spacing)
    return np.asarray(
        line[np.hypot(*(line - pixel).T) > _MARKER * spacing]
    )  # not what lies under the point's own marker


def _text_size(axes: Axes, text: str) -> Array:
    """Return width and height of a text, in pixels."""
    figure: Any = axes.get_figure(root=True)
    probe = Text(0.0, 0.0, text, fontsize=_FONT, figure=figure)
    extent = probe.get_window_extent(figure.canvas.get_renderer())
    return np.array([extent.width, extent.height])


def _square(pixel: Array, half: float) -> Array:
    return np.array([pixel[0] - half, pixel[1] - half, pixel[0] + half, pixel[1] + half])


def _boxes(pixel: Array, size: Array, distance: float) -> list[Array]:
    """Return boxes (x0, y0, x1, y1) of a size all around a point, their edges at about the distance from it."""
    angles = 2.0 * np.pi * np.arange(_DIRECTIONS) / _DIRECTIONS
    rays = np.column_stack([np.cos(angles), np.sin(angles)])
    centres = pixel + rays * (distance + 0.5 * size)
    return [np.concatenate([centre - 0.5 * size, centre + 0.5 * size]) for centre in centres]


def _line_pixels(axes: Axes, spacing: float) -> Array:
    """Return points (M, 2), in pixels and closely spaced, on all lines of the axes."""
    found = [np.zeros((0, 2))]
    for line in axes.get_lines():
        if line.get_linestyle() != "None":
            xy = np.asarray(line.get_xydata(), dtype=np.float64)
            found.append(_resampled(line.get_transform().transform(xy[np.isfinite(xy).all(axis=1)]), spacing))
    return np.concatenate(found)


def _resampled(points: Array, spacing: float) -> Array:
    """Return points at a spacing along a polygon; a hundred thousand of them at most."""
    if len(points) < 2:
        return points
    length = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(points, axis=0).T))])
    at = np.linspace(0.0, length[-1], int(np.clip(length[-1] / spacing, 2, 100_000)))
    return np.column_stack([np.interp(at, length, points[:, k]) for k in (0, 1)])


def _write(axes: Axes, point: Array, pixel: Array, place: _Place, text: str, color: str) -> None:
    """Write a text into its place, with a thin line to its point if that is not beside it."""
    figure = axes.get_figure(root=True)
    assert figure is not None
    offset = (0.5 * (place.box[:2] + place.box[2:]) - pixel) * 72.0 / figure.dpi
    style = {"arrowstyle": "-", "linewidth": 0.5, "color": color, "shrinkA": 0.0, "shrinkB": 3.0}
    arrow = style if len(place.leader) else None
    axes.annotate(
        text, tuple(point), tuple(offset), textcoords="offset points", ha="center", va="center", fontsize=_FONT,
        color=color, arrowprops=arrow, zorder=6,
    )  # fmt: skip
