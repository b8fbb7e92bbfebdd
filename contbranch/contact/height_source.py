"""Where heights come from: arrays, files, images, topography objects; what is made of them, and what is refused."""

from __future__ import annotations

import os
import re
import warnings
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from contbranch.arrays import Array
from contbranch.contact.units import Quantity, finite_number, parse, positive_number
from contbranch.errors import InputError, look_up, number_of

LEAST_POINTS = 8
HIGHEST = 1e100  # beyond, squares and products of heights cannot be computed with
_AGREE = 1e-9  # relative; edges that differ by no more are the same
# Degree of the polynomial that is subtracted.
_TRENDS = {"plane": 1, "paraboloid": 2}
_IMAGES = (".png", ".tif", ".tiff", ".bmp", ".gif", ".jpg", ".jpeg")
_KINDS = "a .npy, HDF5 or text file with real numbers, or a grey image"
_SURFACES = "pip install 'contbranch[surfaces]' for instruments' files"
# Nodes around a gap in the heights from which it is filled in.
_MARGIN = 2


@dataclass(frozen=True)
class Source:
    """How heights are made from what is given, so that they can be made again.

    Attributes
    ----------
    file
        The absolute path of the file they are read from; None for an array or an object.
    dataset
        The data set of an HDF5 file.
    unit
        The number by which the numbers are multiplied; None: that of a topography or of a data set of HDF5, or 1.
    peaks
        Whether the peaks of what is given point to the wall.
    grey
        Heights of black and of white in an image, in `unit`.
    detrend
        ``"plane"`` or ``"paraboloid"``: what is subtracted from the heights, by least squares.
    window
        A window of `scipy.signal.get_window` along both axes, which makes the heights periodic.
    fill
        Whether heights that are missing are interpolated between their neighbours.
    """

    file: str | None = None
    dataset: str | None = None
    unit: Quantity = None
    peaks: bool | None = None
    grey: tuple[float, float] | None = None
    detrend: str | None = None
    window: str | None = None
    fill: bool = False

    def __post_init__(self) -> None:
        if self.detrend is not None:
            look_up(self.detrend, _TRENDS, "detrend")
        if self.grey is not None:
            given: Any = self.grey
            if not (isinstance(given, Sequence) and len(given) == 2) or isinstance(given, str):
                raise InputError(f"grey: {given!r}; must be the heights of black and of white, for example (0.0, 12.0)")
            low, high = (finite_number(value, "grey") for value in given)
            object.__setattr__(self, "grey", (low, high))

    def read(self, given: Any, cell: object) -> tuple[Source, Array, tuple[float, float], bool]:
        """What was done, heights z ≥ 0 above the point that touches first, (N, M), the edges of the cell, and whether a
        unit was named, so that lengths are in nm.

        Raises
        ------
        InputError
            If what is given has no heights on a rectangle; the message names the field.
        """
        for name in ("peaks", "fill", "dataset", "window"):
            value, kind = getattr(self, name), bool if name in ("peaks", "fill") else str
            if not (value is None or isinstance(value, kind)):
                raise InputError(f"{name}: {value!r}; must be {'True or False' if kind is bool else 'a text'}")
        lengths = list(cell) if isinstance(cell, list | tuple) else [] if cell is None else [cell]
        edges = tuple(positive_number(parse(length, "length", "cell"), "cell") for length in lengths)
        values, own, done = given, None, self
        if isinstance(given, str | Path):
            values, dataset, own = _read_file(Path(given), self)
            done = replace(done, file=os.path.abspath(given), dataset=dataset)
        elif self.dataset is not None:
            raise InputError(f"dataset: {self.dataset!r}; only a file has data sets: leave it out")
        elif self.grey is not None:
            raise InputError(f"grey: {self.grey}; only an image file has shades: leave it out")
        topography = is_topography(values)
        done = replace(done, peaks=topography if self.peaks is None else self.peaks)
        own = getattr(values, "unit", None) if topography else own
        whose = "; it is the one that the heights came with: give what it is worth as unit="
        unit = _unit(own, whose) if self.unit is None else _unit(self.unit)
        if topography:
            values, edges = read_topography(values, unit, edges)
        heights = checked(values, self.fill)
        edges = _edges_of(heights.shape, edges)
        if done.peaks:
            heights = -heights
        if self.detrend is not None:
            heights = _detrended(heights, _TRENDS[self.detrend])
        if self.window is not None:
            heights = _windowed(heights, self.window)
        heights -= heights.min()
        if unit != 1.0:
            heights *= unit
        if not (largest := float(heights.max())) < HIGHEST:
            raise InputError(f"heights: up to {largest:g}; must be below {HIGHEST:g}: give them in another unit")
        named = any(isinstance(value, str) for value in (*lengths, own if self.unit is None else self.unit))
        return replace(done, unit=unit), heights, edges, named


def _edges_of(shape: tuple[int, ...], edges: tuple[float, ...]) -> tuple[float, float]:
    """The two edges of a cell; one number is that of a square.

    Raises
    ------
    InputError
        Without edges, or with one for a map that is no square.
    """
    rows, columns = shape
    if len(edges) == 2:
        return edges[0], edges[1]
    if len(edges) == 1 and rows == columns:
        return edges[0], edges[0]
    wanted = "the edge of the cell, a length above zero" if rows == columns else "both edges of the cell, (Lx, Ly)"
    said = "missing" if not edges else f"{number_of(len(edges), 'length', 'lengths')} for {rows} x {columns} heights"
    raise InputError(f"cell: {said}; give {wanted}")


def _unit(unit: object, whose: str = "") -> float:
    """What a unit of the heights is worth: a number, or the name of a unit of length, in nm."""
    if unit is None:
        return 1.0
    if not isinstance(unit, str):
        return positive_number(unit, "unit")
    try:
        return parse(f"1 {unit}", "length", "unit")
    except InputError:
        raise InputError(f"unit: {unit!r}; must be a number or a unit of length such as 'um'{whose}") from None


def _detrended(heights: Array, degree: int) -> Array:
    """Heights less the polynomial of a degree in x and y that fits them best."""
    x, y = np.meshgrid(*(np.linspace(-1.0, 1.0, nodes) for nodes in heights.shape), indexing="ij")
    terms = [x**i * y**j for i in range(degree + 1) for j in range(degree + 1 - i)]
    matrix = np.array(terms).reshape(len(terms), -1).T
    return heights - (matrix @ np.linalg.lstsq(matrix, heights.ravel(), rcond=None)[0]).reshape(heights.shape)


def _windowed(heights: Array, window: str) -> Array:
    """Heights about their mean, times a periodic window along both axes."""
    from scipy.signal import get_window  # slow to import, and seldom needed

    try:
        rows, columns = (get_window(window, nodes) if nodes > 1 else np.ones(1) for nodes in heights.shape)
    except (ValueError, TypeError) as error:
        raise InputError(
            f"window: {window!r}; must be a window of scipy.signal, for example 'hann' ({error})"
        ) from None
    mean = heights.mean()
    windowed: Array = mean + np.outer(rows, columns) * (heights - mean)
    return windowed


def checked(values: object, fill: bool = False) -> Array:
    """Return heights as a (N, M) array of finite floats, the larger of N and M at least 8, a copy.

    Parameters
    ----------
    fill
        Whether to interpolate those that are not finite.

    Raises
    ------
    InputError
        If they are no real numbers, of another shape, or not finite: how many are not, and where the first one is.
    """
    holes = np.ma.getmaskarray(values) if isinstance(values, np.ma.MaskedArray) else None
    array = np.asarray(values)
    if array.dtype.kind not in "iuf":
        raise InputError(f"heights: dtype {array.dtype}; must be an array of real numbers")
    if array.ndim != 2 or max(array.shape) < LEAST_POINTS or not array.size:
        raise InputError(
            f"heights: shape {array.shape}; must be (N, M), at least {LEAST_POINTS} along the longer side; (N, 1) for "
            "a line contact"
        )
    copied = np.array(array, dtype=float, order="C")
    if holes is not None:
        copied[holes] = np.nan
    bad = np.argwhere(~np.isfinite(copied))
    if fill and 0 < len(bad) < copied.size:
        _fill(copied)
    elif bad.size:
        i, j = (int(k) for k in bad[0])
        raise InputError(
            f"heights: {len(bad)} of {copied.size} are not finite, the first is {copied[i, j]} at [{i}, {j}]; "
            "fill=True interpolates between their neighbours"
        )
    return copied


def _fill(heights: Array) -> None:
    """Replace heights that are not finite, linearly between the nodes around them, or by the nearest one."""
    from scipy.interpolate import griddata  # slow to import, and seldom needed
    from scipy.ndimage import binary_dilation

    missing = ~np.isfinite(heights)
    around = binary_dilation(missing, np.ones((3, 3), dtype=bool), _MARGIN) & ~missing
    places, known = np.argwhere(missing), (np.argwhere(around), heights[around])
    flat = min(heights.shape) == 1 or min(np.ptp(known[0], axis=0)) == 0
    found = np.full(len(places), np.nan) if flat else griddata(*known, places, "linear")
    outside = np.isnan(found)
    found[outside] = griddata(*known, places[outside], "nearest")
    heights[missing] = found


def _read_file(path: Path, source: Source) -> tuple[object, str | None, object]:
    """What a file holds, of an HDF5 file the data set, and the unit by its attribute `unit` or `units`, or a header.

    Other attributes by which netCDF says what the numbers stand for are heeded.

    Raises
    ------
    InputError
        For a missing file, one of another kind, or a data set that is not there; the message lists those that are.
    """
    import h5py  # takes a tenth of a second, and most contacts have no file

    if not path.is_file():
        raise InputError(f"file: '{path}': no such file; give the path of {_KINDS}")
    hdf5, image = h5py.is_hdf5(path), path.suffix.lower() in _IMAGES
    if source.dataset is not None and not hdf5:
        raise InputError(f"dataset: {source.dataset!r}; '{path}' is not an HDF5 file: leave it out")
    if source.grey is not None and not image:
        raise InputError(f"grey: {source.grey}; '{path}' is not an image: leave it out")
    try:
        if hdf5:
            return _read_dataset(path, source.dataset)
        if image:
            return _read_image(path, source.grey), None, None
        with path.open("rb") as file:
            if path.suffix.lower() == ".npy" or file.read(6) == b"\x93NUMPY":
                return np.load(path, allow_pickle=False), None, None
        try:
            values, unit = _read_text(path)
        except ValueError:
            found = _read_surface(path)
            if found is None:
                raise
            return found, None, None
        return values, None, unit
    except InputError:
        raise
    except (OSError, ValueError, EOFError):
        raise InputError(f"file: '{path}' cannot be read; must be {_KINDS}; {_SURFACES}") from None


def _read_surface(path: Path) -> Any:
    """The first topography of a file by SurfaceTopography; None if that is not installed, or cannot read it."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        try:
            from SurfaceTopography import open_topography  # heavy, and only for instruments' files
        except ImportError:
            return None
        try:
            return open_topography(str(path)).topography()
        except Exception:  # what a reader raises depends on what is wrong with the file, of which the caller speaks
            return None


def _read_text(path: Path) -> tuple[Array, str | None]:
    """A table of numbers: a line for every row, separated by blanks, commas, semicolons or tabs; # begins a comment.

    Between semicolons a comma is a decimal one where there is no point. A comment as ``# Value units: m`` (Gwyddion)
    names the unit of the heights.
    """
    text = path.read_text(encoding="utf-8-sig")
    header = r"^\s*#.*\b(?:value|height|z)\s*units?\s*[:=]\s*(\S+)\s*$"
    named = re.search(header, text, re.IGNORECASE | re.MULTILINE)
    comma = "." if ";" in text and "." not in text else " "
    try:
        values = np.loadtxt(text.replace(";", " ").replace(",", comma).splitlines(), ndmin=2)
    except ValueError as error:
        why = str(error).partition(";")[0].rstrip(".")
        raise InputError(f"file: '{path}' cannot be read ({why}); a table of heights has numbers alone") from None
    if values.shape[1] in (2, 3):  # x, z or x, y, z
        raise InputError(
            f"file: '{path}' has {values.shape[1]} columns, as coordinates and heights have; must have a line for "
            "every row of nodes"
        )
    return values, named[1] if named else None


def _read_image(path: Path, grey: tuple[float, float] | None) -> Array:
    """An image by the heights of black and of white."""
    from PIL import Image  # comes with matplotlib; slow to import, and seldom needed

    with Image.open(path) as image:
        if image.mode == "F":
            if grey is not None:
                raise InputError(f"grey: {grey}; '{path}' holds numbers, not shades: leave it out")
            return np.asarray(image, dtype=float)
        deep = image.mode.startswith("I")  # of 16 bits
        values = np.asarray(image if deep else image.convert("RGB"), dtype=float)
    if not deep and np.ptp(values, axis=2).any():
        raise InputError(f"file: '{path}' is a coloured image; shades of grey can be heights: convert it")
    if deep and not 0.0 <= values.min() <= values.max() <= 65535.0:
        raise InputError(f"file: '{path}' has shades beyond those of 16 bits; save heights as numbers, in .npy")
    if grey is None:
        raise InputError(f"grey: missing; give the heights of black and of white in '{path}', for example (0.0, 12.0)")
    return grey[0] + (grey[1] - grey[0]) * (values / 65535.0 if deep else values[..., 0] / 255.0)


def _read_dataset(path: Path, dataset: str | None) -> tuple[object, str, object]:
    import h5py

    with h5py.File(path, "r") as file:
        names: list[str] = []
        file.visit(names.append)
        found = {name: file[name].ndim for name in names if isinstance(file[name], h5py.Dataset)}
        if dataset is None:
            flat = [name for name, ndim in found.items() if ndim == 2]
            if len(flat) != 1:
                raise InputError(
                    f"dataset: missing; '{path}' has {len(flat)} arrays of two dimensions: name one of "
                    f"{', '.join(found) or 'none'}"
                )
            (dataset,) = flat
        wanted = dataset.strip("/")
        if wanted not in found:
            raise InputError(f"dataset: {dataset!r} is not in '{path}'; must be one of {', '.join(found) or 'none'}")
        values, known = file[wanted][()], file[wanted].attrs
        for absent in [known[name] for name in ("_FillValue", "missing_value") if name in known]:
            values = np.where(np.isin(values, absent), np.nan, values)
        for name, apply in (("scale_factor", np.multiply), ("add_offset", np.add)):
            values = apply(values, known[name]) if name in known else values
        unit = np.ravel(known.get("unit", known.get("units", []))).tolist()
        return values, wanted, next((u.decode() if isinstance(u, bytes) else u for u in unit), None)


def is_topography(value: object) -> bool:
    """Whether an object is a topography: it has `heights()` and `physical_sizes`, as those of SurfaceTopography."""
    return callable(getattr(value, "heights", None)) and hasattr(value, "physical_sizes")


def read_topography(topography: Any, unit: float, cell: tuple[float, ...]) -> tuple[object, tuple[float, ...]]:
    """Return heights and edges of a topography object, its heights in its own unit of length, the edges times `unit`.

    A line scan is a line contact of unit width.

    Raises
    ------
    InputError
        If its edges are not those of the `cell` given, or its nodes not at equal distances.
    """
    sizes = tuple(topography.physical_sizes or ())
    values = np.ma.asanyarray(topography.heights())
    points = getattr(topography, "nb_grid_pts", None)
    if len(sizes) != values.ndim or (points is not None and tuple(points) != values.shape):
        raise InputError(
            f"heights: shape {values.shape} of a topography with the grid {points} and the edges {sizes}; must agree"
        )
    if getattr(topography, "is_uniform", True) is False:
        raise InputError("heights: a topography with nodes at unequal distances; make it uniform first")
    edges = tuple(positive_number(size, "cell") * unit for size in sizes)
    if values.ndim == 1:
        values, edges = values[:, None], (*edges, cell[1] if len(cell) == 2 else 1.0)
    given = cell * (2 if len(cell) == 1 else 1)
    if any(abs(one - edge) > _AGREE * edge for one, edge in zip(given, edges, strict=False)):
        own = " x ".join(f"{edge:g}" for edge in edges)
        raise InputError(f"cell: {given[0]:g}, but the topography has the edges {own}; leave cell out")
    return values, edges
