"""A tip given by heights on the nodes of a periodic square cell: a rough surface, a pattern, a measured map."""

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


@dataclass(frozen=True, eq=False)
class HeightMap(TipShape):
    """A tip by its heights z on the nodes of a periodic square cell; z = 0 where it touches first.

    z is the tip's profile as for the other tips: the gap of the undeformed tip that just touches the wall. The least of
    the heights given is subtracted from them; with `peaks` they are those of a surface whose peaks point to the wall,
    and z is the highest one minus them. Node [i, j] lies at x = i·cell/N, y = j·cell/N.

    Maps are equal, and have the same hash, if their numbers are: `heights`, `cell` and `radius`.

    Attributes
    ----------
    heights
        (N, N) the heights z ≥ 0, N ≥ 8, read-only. Given as an array, the path of a file (.npy, HDF5, text with a
        line for every row, a grey image), or a topography object with `heights()`, `physical_sizes` and `nb_grid_pts`
        like those of SurfaceTopography.
    cell
        Edge of the cell, a length > 0, or a text such as ``"1 um"`` for one in nm; only a topography brings its own.
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

    Raises
    ------
    InputError
        For heights that are not (N, N) finite real numbers with N ≥ 8, a file or data set that does not exist, a
        unit, trend or window that is not known, and a cell or radius that is not positive.
    """

    name = "height-map"
    dimensions: ClassVar[Mapping[str, str]] = {"heights": "length", "cell": "length", "radius": "length"}

    heights: Array = field(repr=False)
    cell: float = None  # type: ignore[assignment]  # only until a topography has given its own
    radius: float | None = None
    source: Source | None = field(init=False, default=None)
    in_nm: bool = field(init=False, default=False, repr=False)
    peaks: InitVar[bool | None] = None
    dataset: InitVar[str | None] = None
    unit: InitVar[Quantity] = None
    grey: InitVar[tuple[float, float] | None] = None
    detrend: InitVar[str | None] = None
    window: InitVar[str | None] = None

    def __post_init__(self, peaks: Any, dataset: Any, unit: Any, *treatment: Any) -> None:
        source, heights, cell, named = Source(None, dataset, unit, peaks, *treatment).read(self.heights, self.cell)
        object.__setattr__(self, "in_nm", named or isinstance(self.radius, str))
        if source.file is not None:
            object.__setattr__(self, "source", source)
        heights.setflags(write=False)
        if cell is None:
            raise InputError("cell: missing; give the edge of the cell on which the heights are, a length above zero")
        object.__setattr__(self, "heights", heights)
        object.__setattr__(self, "cell", cell)
        if self.radius is not None:
            object.__setattr__(self, "radius", positive_number(self.radius, "radius"))

    @staticmethod
    def from_file(path: str | Path, *, cell: float | str, radius: float | None = None, **reading: Any) -> HeightMap:
        """Return the map of a file; its path is what a description keeps of it.

        Parameters
        ----------
        path, cell, radius
            As for any map.
        **reading
            ``dataset``, ``unit``, ``peaks``, ``grey``, ``detrend``, ``window``.
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
    def points(self) -> int:
        """N, the number of nodes along each edge."""
        return len(self.heights)

    @property
    def mirror_symmetric(self) -> bool:
        """Whether the map is, to rounding, the same under x → -x and under y → -y about node [0, 0] of the cell."""
        z, allowed = self.heights, _ROUNDING * float(self.heights.max())
        mirrored = -np.arange(self.points)  # periodic: node -i is node N - i
        return bool(np.all(np.abs(z[mirrored] - z) <= allowed) and np.all(np.abs(z[:, mirrored] - z) <= allowed))

    @property
    def edge_step(self) -> float:
        """How much more heights change across the edge of the cell than between other neighbouring nodes (rms).

        About 1 for a periodic map. The periodic cell repeats a map that is not, and has a step there.
        """
        z = self.heights
        steps = [
            math.sqrt(float(np.mean((across[0] - across[-1]) ** 2) / (np.mean(np.diff(across, axis=0) ** 2) or 1.0)))
            for across in (z, z.T)
        ]
        return max(steps)

    @property
    def tilted(self) -> bool:
        """Whether most of the step across the edges goes with the plane that fits the heights best."""
        level = HeightMap(self.heights, self.cell, self.radius, detrend="plane")
        return level.edge_step < 0.5 * self.edge_step

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
        power = np.abs(np.fft.fft2(self.heights) / self.points**2) ** 2
        power[0, 0] = 0.0
        order = np.fft.fftfreq(self.points, 1.0 / self.points)
        share = np.where(2 * np.abs(order) == self.points, 0.5, 1.0)  # cos² has a mean of 1/2, and of 1 on its nodes
        power *= share[:, None] * share
        wave = (2.0 * math.pi / self.cell * order) ** 2
        return math.sqrt(float(power.sum())), math.sqrt(float(((wave[:, None] + wave) * power).sum()))

    @property
    def natural_length(self) -> float:
        """`radius` if it was given; otherwise (rms height)/(rms slope)², and the edge of the cell for a flat map.

        It is the radius of the summits of an egg-box, cos(qx) cos(qy). Unlike the rms curvature it needs no second
        derivative, so it depends little on how finely a kink or the shortest wave is resolved.
        """
        if self.radius is not None:
            return self.radius
        height, slope = self._moments
        return height / slope**2 if slope > 0.0 else self.cell

    def surface(self, x: ArrayLike, y: ArrayLike) -> Array:
        """Return the height at any place, by periodic bicubic splines through the nodes; `on_grid` is preferable."""
        from scipy.ndimage import map_coordinates  # slow to import, and seldom needed

        spacing = self.cell / self.points
        places = np.array(np.broadcast_arrays(np.asarray(x, dtype=float), np.asarray(y, dtype=float))) / spacing
        found = map_coordinates(self.heights, places.reshape(2, -1), order=3, mode="grid-wrap")
        return np.asarray(found, dtype=float).reshape(places.shape[1:])

    def covers(self, cell: float) -> bool:
        """Whether the edge of a cell is that of the map, to rounding."""
        return abs(cell - self.cell) <= _SAME_CELL * self.cell

    def on_grid(self, cell: float, n: int) -> Array:
        """Return the heights on the nodes of a grid: as they are, every 2nd, 4th, ... node, or interpolated by Fourier.

        Nothing is subtracted from them: a finer grid may go slightly below 0, a coarser one may stay above, so that
        displacements on all grids mean the same.

        Parameters
        ----------
        cell
            Edge of the grid's cell, that of the map.
        n
            Nodes along each edge: N, or N times or divided by a power of two.

        Returns
        -------
        heights
            (n, n), read-only if they are the map's own.

        Raises
        ------
        InputError
            If the grid does not fit the map; the message names those that do.
        """
        if not self.covers(cell):
            raise InputError(f"cell: {cell:g}; the height map has the cell {self.cell:g}: leave it out or give this")
        whole = self.points
        if n == whole:
            return self.heights
        if n > whole and n % whole == 0 and _power_of_two(n // whole):
            from scipy.signal import resample  # slow to import, and seldom needed

            return np.asarray(resample(resample(self.heights, n), n, axis=1))
        if 0 < n < whole and whole % n == 0 and _power_of_two(whole // n):
            step = whole // n
            return self.heights[::step, ::step]
        coarser = [whole // 2**k for k in (2, 1) if whole % 2**k == 0 and whole // 2**k >= LEAST_POINTS]
        fitting = ", ".join(str(number) for number in (*coarser, whole, 2 * whole, 4 * whole))
        raise InputError(
            f"grid: {n} does not fit the {whole} x {whole} heights of the map; must be {whole} times or divided by a "
            f"power of two: {fitting}"
        )

    def scaled(self, in_plane: float, normal: float) -> HeightMap:
        """Return the map in other units, with its radius stated, for that of a flat one would not scale."""
        radius = self.natural_length * (normal / in_plane**2)
        return HeightMap(self.heights / normal, self.cell / in_plane, radius)

    @cached_property
    def digest(self) -> str:
        """The SHA-256 of the heights z as little-endian numbers of 64 bits."""
        return hashlib.sha256(self.heights.astype("<f8", copy=False).tobytes()).hexdigest()

    def described(self) -> dict[str, Any]:
        """Return what a description says of the map: not its numbers but what they are, and their file if any."""
        return {
            "points": self.points,
            "cell": self.cell,
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


_READING = ("dataset", "unit", "peaks", "grey", "detrend", "window")


def _power_of_two(number: int) -> bool:
    return number & (number - 1) == 0
