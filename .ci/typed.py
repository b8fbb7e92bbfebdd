"""An example whose types are checked against the installed package: `mypy --strict .ci/typed.py`."""

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

import contbranch as cb
from contbranch.continuation import Curve, Problem, trace_curve
from contbranch.theory import jkr

Vector = NDArray[np.float64]


class Screened(cb.Interaction):
    """f = exp(-x)/(1 + x)."""

    def shape(self, x: Vector) -> tuple[Vector, Vector, Vector]:
        """Return f and its derivatives."""
        f, u = np.exp(-x) / (1 + x), 1 / (1 + x)
        return f, -f * (1 + u), f * (1 + 2 * u + 2 * u * u)


class Circle(Problem):
    """x² + p² = 1."""

    def residual(self, x: Vector, p: float) -> Vector:
        """Return the residual."""
        return x**2 + p**2 - 1


def progress(fraction: float, text: str) -> None:
    """Stop half-way."""
    if fraction > 0.5:
        raise cb.Stop


contact: cb.Contact = cb.Contact.reduced(Screened, tabor=1.0)
diagram: cb.Diagram = cb.trace(contact, control=cb.Spring(2.0), accuracy=1e-4, progress=progress, time_limit=60.0)
pull_off: float = diagram.thresholds["pull_off_load"]
errors: list[float] = [fold.error["load"] for fold in diagram.folds("load")]
load: Vector = diagram.branches[0].load
state: cb.Solution = cb.solve(contact, load=1.0)
loop: cb.Hysteresis = cb.hysteresis(contact, control="spring:2")
lost: list[float | None] = [jump.dissipated for jump in loop.jumps]
found: cb.Sweep | None = None
curve: Curve = trace_curve(Circle(), np.array([1.0]), 0.0, parameter_range=(-2.0, 2.0))
folds: list[float] = [fold.parameter for fold in curve.folds]
by_jkr: float = float(jkr.load_fold().load)
diagram.save(Path("typed.h5"))
