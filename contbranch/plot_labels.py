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
    obstacles = _Obstacles(
        lines=_line_pixels(axes, 2.0 * unit),
        markers=[_square(pixels[i], _MARKER * unit) for i in seen],
        frame=frame + np.array([2, 2, -2, -2]) * unit,
    )
    places: dict[int, _Place] = {}
    for _ in range(_PASSES):  # a label placed early moves if later ones took better places beside it
        for i in seen:
            size = _text_size(axes, texts[i]) + 2.0 * _ROOM * unit
            others = [place for j, place in places.items() if j != i]
            candidates = [
                _Place(box, distance, _leader(pixels[i], box, 2.0 * unit, distance))
                for distance in _DISTANCES
                for box in _boxes(pixels[i], size, distance * unit)
            ]
            costs = [obstacles.cost(candidate, others) for candidate in candidates]
            places[i] = candidates[int(np.argmin(costs))]
    for i, place in places.items():
        _write(axes, points[i], pixels[i], place, texts[i], colors[i])


class _Place(NamedTuple):
    """A place of a label: its box (x0, y0, x1, y1) in pixels, distance in points, and points (M, 2) on its leader."""

    box: Array
    distance: float
    leader: Array


class _Obstacles(NamedTuple):
    """What labels must not hide: points on lines (M, 2), boxes of markers, and the frame they must not leave."""

    lines: Array
    markers: Sequence[Array]
    frame: Array

    def cost(self, place: _Place, others: Sequence[_Place]) -> float:
        """Return how bad a place is: 1 for a covered line point, much more for labels, markers and the frame."""
        box = place.box
        area = (box[2] - box[0]) * (box[3] - box[1])
        cost: float = 0.1 * place.distance + _count_inside(self.lines, box)
        cost += sum(400.0 * _overlap(box, marker) / area for marker in self.markers)
        cost += 2000.0 * (1.0 - _overlap(box, self.frame) / area)
        cost += 5.0 * sum(_count_inside(place.leader, marker) for marker in self.markers)
        for other in others:
            cost += 400.0 * _overlap(box, other.box) / area
            cost += 5.0 * (_count_inside(other.leader, box) + _count_inside(place.leader, other.box))
        return cost


def _count_inside(points: Array, box: Array) -> float:
    """Return how many points (M, 2) lie in a box."""
    return float(np.count_nonzero(np.all((points >= box[:2]) & (points <= box[2:]), axis=1)))


def _leader(pixel: Array, box: Array, spacing: float, distance: float) -> Array:
    """Return points on the line from a label to its point; none where the label is beside it."""
    if distance <= _NEAR:
        return np.zeros((0, 2))
    return _resampled(np.array([pixel, 0.5 * (box[:2] + box[2:])]), spacing)


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


def _overlap(a: Array, b: Array) -> float:
    """Return the area that two boxes have in common, in square pixels."""
    width = min(a[2], b[2]) - max(a[0], b[0])
    height = min(a[3], b[3]) - max(a[1], b[1])
    return float(max(width, 0.0) * max(height, 0.0))


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
