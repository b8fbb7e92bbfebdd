"""A tip given by heights on the nodes of a rectangular cell: a rough surface, a pattern, a measured map."""

from __future__ import annotations

import hashlib
import math
from collections.abc import Mapping
from dataclasses import InitVar, asdict, dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
from numpy.typing import ArrayLike

from contbranch.arrays import Array
from contbranch.contact.height_source import LEAST_POINTS, Source
from contbranch.contact.self_affine import self_affine_heights
from contbranch.contact.tip_shape import TipShape
from contbranch.contact.units import Quantity, positive_number
from contbranch.errors import InputError

_ROUNDING = 8.0 * np.finfo(float).eps
_SAME_CELL = 1e-9  # relative
# A node is a spike if it lies so many times as far below the median of the nodes around it as 99 % of the nodes do:
# Gaussian noise on 4096 nodes reaches 1.8 times that.
_SPIKE = 6.0


@dataclass(frozen=True, eq=False)
class HeightMap(TipShape):
    """A tip by its heights z on the nodes of a rectangular cell; z = 0 where it touches first.

    z is the tip's profile as for the other tips: the gap of the undeformed tip that just touches the wall. The least of
    the heights given is subtracted from them; with `peaks` they are those of a surface whose peaks point to the wall,
    and z is the highest one minus them. Node [i, j] lies at x = i·Lx/N, y = j·Ly/M. A map of (N, 1) nodes is a line
    contact, periodic along x and the same everywhere along y; its load is that over the width Ly.

    Maps are equal, and have the same hash, if their numbers are: `heights`, `cell` and `radius`.

    Attributes
    ----------
    heights
        (N, M) the heights z ≥ 0, the larger of N and M at least 8, read-only. Given as an array, the path of a file
        (.npy, HDF5, text with a line for every row, a grey image, whatever SurfaceTopography reads if that is
        installed), or a topography object with `heights()`, `physical_sizes` and `nb_grid_pts` like those of
        SurfaceTopography.
    cell
        Edges (Lx, Ly) of the cell, lengths > 0, or texts such as ``"1 um"`` for those in nm; of N × N nodes in a square
        one number will do, which it then is. Only a topography brings its own.
    radius
        Radius of curvature R that sets the scales (23)-(26). By default it follows from the map: see `natural_length`.
    source
        The file that the heights were read from, and how, if they were.
    in_nm
        Whether a unit of length was named, so that the numbers are nm: no tip for a contact in reduced units.

    Parameters
    ----------
    peaks
        Whether the peaks of the heights given point to the wall; by default only those of a topography object do.
    dataset
        Name of the data set in an HDF5 file; not needed if it holds a single array of two dimensions.
    unit
        What a unit of the heights given (of a topography: also of its edge) is worth in the contact's unit of length;
        or its name, such as ``"um"``, for lengths in nm. By default 1, and for a topography that has a unit, a data
        set of HDF5 with an attribute ``unit`` or ``units``, or a text with a comment ``# Value units: m``, that one.
    grey
        Heights of black and of white in an image.
    detrend
        ``"plane"`` or ``"paraboloid"``: subtracted from the heights as it fits them best.
    window
        Name of a window of `scipy.signal.get_window` with which the heights, about their mean, are multiplied along x
        and along y: it makes a measured map periodic, and changes it next to the edges. See `edge_step`.
    fill
        Whether heights that are missing (NaN, masked) are interpolated between their neighbours; otherwise refused.

    Raises
    ------
    InputError
        For heights that are not (N, M) finite real numbers with N or M ≥ 8, a file or data set that does not exist, a
        unit, trend or window that is not known, and a cell or radius that is not positive.
    """

    name = "height-map"
    dimensions: ClassVar[Mapping[str, str]] = {"heights": "length", "cell": "length", "radius": "length"}

    heights: Array = field(repr=False)
    cell: float | tuple[float, float] = None  # type: ignore[assignment]  # only until a topography has given its own
    radius: float | None = None
    source: Source | None = field(init=False, default=None)
    in_nm: bool = field(init=False, default=False, repr=False)
    peaks: InitVar[bool | None] = None
    dataset: InitVar[str | None] = None
    unit: InitVar[Quantity] = None
    grey: InitVar[tuple[float, float] | None] = None
    detrend: InitVar[str | None] = None
    window: InitVar[str | None] = None
    fill: InitVar[bool] = False

    def __post_init__(self, peaks: Any, dataset: Any, unit: Any, *treatment: Any) -> None:
        source, heights, edges, named = Source(None, dataset, unit, peaks, *treatment).read(self.heights, self.cell)
        object.__setattr__(self, "in_nm", named or isinstance(self.radius, str))
        if source.file is not None:
            object.__setattr__(self, "source", source)
        heights.setflags(write=False)
        object.__setattr__(self, "heights", heights)
        object.__setattr__(self, "cell", edges[0] if edges[0] == edges[1] else edges)
        if self.radius is not None:
            object.__setattr__(self, "radius", positive_number(self.radius, "radius"))

    @staticmethod
    def from_file(path: str | Path, *, cell: Any = None, radius: float | None = None, **reading: Any) -> HeightMap:
        """Return the map of a file; its path is what a description keeps of it.

        Parameters
        ----------
        path, cell, radius
            As for any map.
        **reading
            ``dataset``, ``unit``, ``peaks``, ``grey``, ``detrend``, ``window``, ``fill``.
        """
        return HeightMap(path, cell, radius, **reading)  # type: ignore[arg-type]

    @staticmethod
    def self_affine(
        n: int,
        cell: float,
        hurst: float,
        *,
        radius: float | None = None,
        **waves: Any,
    ) -> HeightMap:
        """Return a random surface with the power spectrum C(q) ∝ q^(-2(1+H)) between two cutoffs.

        Parameters
        ----------
        n
            Nodes along each edge, at least 8. With the same cutoffs, maps of different `n` sample the same surface.
        cell
            Edge of the periodic cell.
        hurst
            H from 0 to 1.
        rms_slope, rms_height
            √⟨|∇h|²⟩ or √⟨(h - ⟨h⟩)²⟩; exactly one of them.
        seed
            Whole number; the same seed is the same surface.
        short_cutoff, long_cutoff
            Shortest and longest wavelength; by default four node spacings and the edge of the cell.
        radius
            As for any map.
        """
        return HeightMap(self_affine_heights(n, cell, hurst, **waves), cell, radius)

    @property
    def points(self) -> tuple[int, int]:
        """N and M, the numbers of nodes along x and along y."""
        rows, columns = self.heights.shape
        return rows, columns

    @property
    def edges(self) -> tuple[float, float]:
        """Lx and Ly."""
        return self.cell if isinstance(self.cell, tuple) else (self.cell, self.cell)

    @property
    def mirror_symmetric(self) -> bool:
        """Whether the map is, to rounding, the same under x → -x and under y → -y about node [0, 0] of the cell."""
        z, allowed = self.heights, _ROUNDING * float(self.heights.max())
        rows, columns = (-np.arange(nodes) for nodes in self.points)  # periodic: node -i is node N - i
        return bool(np.all(np.abs(z[rows] - z) <= allowed) and np.all(np.abs(z[:, columns] - z) <= allowed))

    @property
    def edge_step(self) -> float:
        """How much more heights change across the edge of the cell than between other neighbouring nodes (rms).

        About 1 for a periodic map. The periodic cell repeats a map that is not, and has a step there.
        """
        z = self.heights
        steps = [
            math.sqrt(float(np.mean((across[0] - across[-1]) ** 2) / (np.mean(np.diff(across, axis=0) ** 2) or 1.0)))
            for across in (z, z.T)
            if len(across) > 1
        ]
        return max(steps)

    @property
    def tilted(self) -> bool:
        """Whether most of the step across the edges goes with the plane that fits the heights best."""
        level = HeightMap(self.heights, self.edges, self.radius, detrend="plane")
        return level.edge_step < 0.5 * self.edge_step

    @property
    def spikes(self) -> list[tuple[int, int]]:
        """Nodes that stand out towards the wall from those around them as dust and outliers do, the longest first.

        They touch first, and bear the load alone until the others are reached.
        """
        from scipy.ndimage import median_filter  # slow to import

        out = median_filter(self.heights, 3, mode="wrap") - self.heights
        usual = float(np.quantile(np.abs(out), 0.99)) or self.rms_height
        found = np.argwhere(out > _SPIKE * usual)
        order = np.argsort(-out[tuple(found.T)], kind="stable")
        return [(int(i), int(j)) for i, j in found[order]] if usual > 0.0 else []

    @property
    def rms_height(self) -> float:
        """√⟨(z - ⟨z⟩)²⟩ of the map's trigonometric interpolant."""
        return self._moments[0]

    @property
    def rms_slope(self) -> float:
        """√⟨|∇z|²⟩ of the map's trigonometric interpolant."""
        return self._moments[1]

    @cached_property
    def _moments(self) -> tuple[float, float]:
        power = np.abs(np.fft.fft2(self.heights) / self.heights.size) ** 2
        power[0, 0] = 0.0
        orders = [np.fft.fftfreq(nodes, 1.0 / nodes) for nodes in self.points]
        for order, nodes, axis in zip(orders, self.points, (1, 0), strict=True):
            share = np.where(2 * np.abs(order) == nodes, 0.5, 1.0)  # cos² has a mean of 1/2, and of 1 on its nodes
            power *= np.expand_dims(share, axis)
        x, y = ((2.0 * math.pi / edge * order) ** 2 for edge, order in zip(self.edges, orders, strict=True))
        return math.sqrt(float(power.sum())), math.sqrt(float(((x[:, None] + y) * power).sum()))

    @property
    def natural_length(self) -> float:
        """`radius` if it was given; otherwise (rms height)/(rms slope)², and √(Lx Ly) for a flat map.

        It is the radius of the summits of an egg-box, cos(qx) cos(qy). Unlike the rms curvature it needs no second
        derivative, so it depends little on how finely a kink or the shortest wave is resolved.
        """
        if self.radius is not None:
            return self.radius
        height, slope = self._moments
        return height / slope**2 if slope > 0.0 else math.sqrt(math.prod(self.edges))

    def surface(self, x: ArrayLike, y: ArrayLike) -> Array:
        """Return the height at any place, by periodic bicubic splines through the nodes; `on_grid` is preferable."""
        from scipy.ndimage import map_coordinates  # slow to import, and seldom needed

        places = np.broadcast_arrays(np.asarray(x, dtype=float), np.asarray(y, dtype=float))
        spacings = [edge / nodes for edge, nodes in zip(self.edges, self.points, strict=True)]
        numbers = [place.ravel() / spacing for place, spacing in zip(places, spacings, strict=True)]
        found = map_coordinates(self.heights, numbers, order=3, mode="grid-wrap")
        return np.asarray(found, dtype=float).reshape(places[0].shape)

    def covers(self, cell: float) -> bool:
        """Whether a square cell of an edge is that of the map, to rounding."""
        return all(abs(cell - edge) <= _SAME_CELL * edge for edge in self.edges)

    def nodes_of(self, grid: int) -> tuple[int, int]:
        """The nodes of a grid with so many along the edge that has the most: all times, or divided by, one number.

        Raises
        ------
        InputError
            If that is no power of two; the message names grids that fit.
        """
        whole = max(self.points)
        up, down = grid // whole, whole // grid if grid else 0
        if (up and grid == up * whole and _power_of_two(up)) or (
            down and whole == down * grid and _power_of_two(down) and all(n == 1 or n % down == 0 for n in self.points)
        ):
            rows, columns = (n if n == 1 else n * grid // whole for n in self.points)
            return rows, columns
        halves = [whole // 2**k for k in (2, 1) if all(n == 1 or n % 2**k == 0 for n in self.points)]
        numbers = [*(n for n in halves if n >= LEAST_POINTS), whole, 2 * whole, 4 * whole]
        raise InputError(
            f"grid: {grid} does not fit the {self.points[0]} x {self.points[1]} heights of the map; must be {whole} "
            f"times or divided by a power of two: {', '.join(map(str, numbers))}"
        )

    def on_grid(self, nodes: tuple[int, int]) -> Array:
        """Return the heights on the nodes of a grid: as they are, every 2nd, 4th, ... node, or interpolated by Fourier.

        Nothing is subtracted from them: a finer grid may go slightly below 0, a coarser one may stay above, so that
        displacements on all grids mean the same.

        Parameters
        ----------
        nodes
            Those of `nodes_of`.

        Returns
        -------
        heights
            Of the shape `nodes`, read-only if they are the map's own.
        """
        if nodes == self.points:
            return self.heights
        if nodes < self.points:
            return self.heights[:: max(self.points[0] // nodes[0], 1), :: max(self.points[1] // nodes[1], 1)]
        from scipy.signal import resample  # slow to import, and seldom needed

        return np.asarray(resample(resample(self.heights, nodes[0]), nodes[1], axis=1))

    def scaled(self, in_plane: float, normal: float) -> HeightMap:
        """Return the map in other units, with its radius stated, for that of a flat one would not scale."""
        radius = self.natural_length * (normal / in_plane**2)
        return HeightMap(self.heights / normal, (self.edges[0] / in_plane, self.edges[1] / in_plane), radius)

    @cached_property
    def digest(self) -> str:
        """The SHA-256 of the heights z as little-endian numbers of 64 bits."""
        return hashlib.sha256(self.heights.astype("<f8", copy=False).tobytes()).hexdigest()

    def described(self) -> dict[str, Any]:
        """Return what a description says of the map: not its numbers but what they are, and their file if any."""
        return {
            "points": list(self.points),
            "cell": list(self.cell) if isinstance(self.cell, tuple) else self.cell,
            "radius": self.radius,
            "rms_height": self.rms_height,
            "rms_slope": self.rms_slope,
            "sha256": self.digest,
            **({} if self.source is None else {k: v for k, v in asdict(self.source).items() if v is not None}),
        }

    @staticmethod
    def restored(description: Mapping[str, Any], field: str) -> HeightMap:
        """Return the map that `described` has described, from its file, or from its ``heights`` if these were added.

        Raises
        ------
        InputError
            If there is neither, the file is gone, or it now holds something else; the message begins with `field`.
        """
        values: dict[str, Any] = {name: description.get(name) for name in ("cell", "radius")}
        file, how = description.get("file"), {name: description[name] for name in _READING if name in description}
        if "heights" in description:
            found = HeightMap(description["heights"], **values)
            if file is not None:
                object.__setattr__(found, "source", Source(file, **how))
        elif file is not None:
            try:
                found = HeightMap(file, **values, **how)
            except InputError as error:
                raise InputError(f"{field}: the heights cannot be read again: {error}") from None
        else:
            raise InputError(
                f"{field}.heights: the description has only their SHA-256; make the contact with the heights"
            )
        if found.digest != description.get("sha256"):
            raise InputError(f"{field}: the heights are not those that were described; make the contact with those")
        return found

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, HeightMap):
            return NotImplemented
        return (self.cell, self.radius, self.digest) == (other.cell, other.radius, other.digest)

    def __hash__(self) -> int:
        return hash((self.cell, self.radius, self.digest))

    def __setstate__(self, state: dict[str, Any]) -> None:
        self.__dict__.update(state)
        self.heights.setflags(write=False)  # which copies and pickles of an array forget


_READING = ("dataset", "unit", "peaks", "grey", "detrend", "window", "fill")


def _power_of_two(number: int) -> bool:
    return number & (number - 1) == 0
