"""Where heights come from: an array, a .npy or HDF5 file, a topography object; and what is refused of them."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np

from contbranch.arrays import Array
from contbranch.contact.units import positive_number
from contbranch.errors import InputError

__all__ = ["LEAST_POINTS", "Source", "checked", "is_topography", "read_heights", "read_topography"]

LEAST_POINTS: Final = 8
_AGREE: Final = 1e-9  # relative; edges that differ by no more are the same


@dataclass(frozen=True)
class Source:
    """The file that heights were read from, and how, so that they can be read again.

    Attributes
    ----------
    file
        Its absolute path.
    dataset
        The data set of an HDF5 file; None for a .npy file.
    unit
        The number by which its numbers are multiplied.
    peaks
        Whether its peaks point to the wall.
    """

    file: str
    dataset: str | None
    unit: float
    peaks: bool


def checked(values: object) -> Array:
    """Return heights as a (N, N) array of finite floats, N ≥ 8, a copy.

    Raises
    ------
    InputError
        If they are no real numbers, not a square array, or not finite: how many are not, and where the first one is.
    """
    holes = np.ma.getmaskarray(values) if isinstance(values, np.ma.MaskedArray) else None
    array = np.asarray(values)
    if array.dtype.kind not in "iuf":
        raise InputError(f"heights: dtype {array.dtype}; must be an array of real numbers")
    if array.ndim != 2 or array.shape[0] != array.shape[1] or array.shape[0] < LEAST_POINTS:
        raise InputError(
            f"heights: shape {array.shape}; must be (N, N) with N at least {LEAST_POINTS}: as many rows as columns"
        )
    copied = np.array(array, dtype=np.float64, order="C")
    if holes is not None:
        copied[holes] = np.nan
    bad = np.argwhere(~np.isfinite(copied))
    if bad.size:
        i, j = (int(k) for k in bad[0])
        raise InputError(
            f"heights: {len(bad)} of {copied.size} are not finite, the first is {copied[i, j]} at [{i}, {j}]; "
            "fill them in, for example from their neighbours"
        )
    return copied


def read_heights(path: str | Path, dataset: str | None = None) -> tuple[object, str | None]:
    """Return what a .npy file, or a data set of an HDF5 file, holds, and the data set's name (None for .npy).

    Without `dataset`, an HDF5 file must hold one array of two dimensions.

    Raises
    ------
    InputError
        For a missing file, one of another kind, or a data set that is not there; the message lists those that are.
    """
    import h5py  # takes a tenth of a second, and most contacts have no file

    path = Path(path)
    if not path.is_file():
        raise InputError(f"file: '{path}': no such file; give the path of a .npy or HDF5 file with heights")
    hdf5 = h5py.is_hdf5(path)
    if dataset is not None and not hdf5:
        raise InputError(f"dataset: {dataset!r}; '{path}' is not an HDF5 file: leave it out")
    try:
        if hdf5:
            return _read_dataset(path, dataset)
        return np.load(path, allow_pickle=False), None
    except InputError:
        raise
    except (OSError, ValueError, EOFError):
        raise InputError(f"file: '{path}' cannot be read; must be a .npy or HDF5 file with real numbers") from None


def _read_dataset(path: Path, dataset: str | None) -> tuple[object, str]:
    import h5py

    with h5py.File(path, "r") as file:
        found: dict[str, int] = {}

        def note(name: str, item: Any) -> None:
            if isinstance(item, h5py.Dataset):
                found[name] = item.ndim

        file.visititems(note)
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
        return file[wanted][()], wanted


def is_topography(value: object) -> bool:
    """Whether an object is a topography: it has `heights()` and `physical_sizes`, as those of SurfaceTopography."""
    return callable(getattr(value, "heights", None)) and hasattr(value, "physical_sizes")


def read_topography(topography: Any, unit: float, cell: float | None) -> tuple[object, float]:
    """Return heights and edge of a topography object, its heights in its own unit of length, the edge times `unit`.

    Raises
    ------
    InputError
        If it is not a square map, or its edge is not the `cell` given.
    """
    sizes = tuple(topography.physical_sizes or ())
    if len(sizes) != 2 or abs(sizes[0] - sizes[1]) > _AGREE * abs(sizes[0]):
        raise InputError(f"heights: a topography with the edges {sizes}; must be a square map")
    edge = positive_number(sizes[0], "cell") * unit
    if cell is not None and abs(positive_number(cell, "cell") - edge) > _AGREE * edge:
        raise InputError(f"cell: {cell:g}, but the topography has the edge {edge:g}; leave cell out")
    values = topography.heights()
    points = getattr(topography, "nb_grid_pts", None)
    if points is not None and tuple(points) != np.shape(values):
        raise InputError(f"heights: shape {np.shape(values)} of a topography with the grid {tuple(points)}; must agree")
    return values, edge
