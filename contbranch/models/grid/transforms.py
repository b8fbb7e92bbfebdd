"""Transforms of fields on a lattice: the whole lattice, or a quarter of it where fields are even.

A field that is even about the middle of a row of M nodes is known from M/2 of them, and its Fourier series is the
cosine transform of these: a quarter of the nodes suffices for a field with both mirror symmetries.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Literal

import numpy as np
import pyfftw

from contbranch.arrays import Array
from contbranch.curve.problem import Work
from contbranch.results.diagram import Cost
from contbranch.watch import check

__all__ = ["Counter", "Transform", "orders"]


@dataclass
class Counter(Work):
    """Pairs of transforms spent, one forward and one inverse whatever their size, and on what."""

    equilibrium: int = 0
    stability: int = 0
    target: Literal["equilibrium", "stability"] = "equilibrium"

    def add(self) -> None:
        """Count one pair."""
        check()
        setattr(self, self.target, getattr(self, self.target) + 1)

    def cost(self) -> Cost:
        """As results have it."""
        return Cost(0.0, self.newton, self.equilibrium, self.stability)


def orders(shape: tuple[int, int], even: bool) -> tuple[Array, Array]:
    """Numbers of the coefficients of a transform along both directions, (m, 1) and (1, n): half waves on a quarter,
    which has m × n nodes, waves on the whole array of M × N, (M, 1) and (1, N/2+1).

    Parameters
    ----------
    shape : (int, int)
        Of the array that is transformed.
    even : bool
        Whether that is a quarter of the lattice.
    """
    rows, columns = (np.arange(float(count)) for count in shape)
    if even:
        return rows[:, None], columns[None, :]
    return (rows - shape[0] * (2.0 * rows >= shape[0]))[:, None], columns[None, : shape[1] // 2 + 1]


@dataclass
class Transform:
    """Plans and aligned work arrays for one shape of fields, made once and used for every product.

    Attributes
    ----------
    shape : (int, int)
        Of the array.
    even : bool
        Whether it is a quarter of the lattice.
    threads : int
    counter : Counter
        Where pairs are counted; transforms of one problem share it.
    """

    shape: tuple[int, int]
    even: bool = True
    threads: int = 1
    counter: Counter = field(default_factory=Counter)

    def __post_init__(self) -> None:
        rows, columns = self.shape
        self._space = pyfftw.empty_aligned(self.shape, dtype="float64")
        if self.even:
            self._spectrum = pyfftw.empty_aligned(self.shape, dtype="float64")
            directions: tuple[object, object] = (("FFTW_REDFT10",) * 2, ("FFTW_REDFT01",) * 2)
            self.normalisation = 1.0 / (4 * rows * columns)
        else:
            self._spectrum = pyfftw.empty_aligned((rows, columns // 2 + 1), dtype="complex128")
            directions = ("FFTW_FORWARD", "FFTW_BACKWARD")
            self.normalisation = 1.0 / (rows * columns)
        options = {"axes": (0, 1), "flags": ("FFTW_MEASURE", "FFTW_DESTROY_INPUT"), "threads": self.threads}
        self._forward: Callable[[], object] = pyfftw.FFTW(
            self._space, self._spectrum, direction=directions[0], **options
        ).execute
        self._inverse: Callable[[], object] = pyfftw.FFTW(
            self._spectrum, self._space, direction=directions[1], **options
        ).execute

    def filter(self, symbol: Array, values: Array) -> Array:
        """The field whose spectrum is that of `values` times `symbol`, which holds the normalisation; one pair.

        Parameters
        ----------
        symbol : array of the shape of the spectrum
            Times `normalisation`.
        values : array (rows, columns)
        """
        self._space[...] = values
        self._forward()
        np.multiply(self._spectrum, symbol, out=self._spectrum)
        self._inverse()
        self.counter.add()
        return np.array(self._space)
