"""One equilibrium on a periodic grid, by this package and by others, and what their answers are worth.

Every solver is wrapped in a class with the same few methods (`GridSolver`) and returns a gap; `examine` computes all
that is said of the answer from this gap alone, the same for all. Reduced units, R = E = |Δγ| = 1.

The nodes lie at (i + 1/2) L/N from the border of the cell and the apex of the tip z = r²/2 in its middle. With
K̂(q) = |q|/2 (K̂(0) = 0) the surface bears the pressure K(g - z) + F/L², and

    e = K(g - z) + F/L² - p_fr(g),    p_fr = -v',    v = -Δγ f(g/z0)

vanishes in equilibrium where g > 0, and is ≥ 0 where g = 0.
"""

from __future__ import annotations

import importlib
import importlib.metadata
import sys
from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from types import ModuleType
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

__all__ = ["SOLVERS", "AdhesionCG", "AdhesionLBFGS", "AdhesionNewton", "Answer", "Case", "Examined", "GridSolver"]
__all__ += ["NotAble", "NotInstalled", "Own", "Tamaas", "examine"]

Array = NDArray[np.float64]

# -f'(x) for the shapes f of `Case.law`.
SLOPES: dict[str, Callable[[Array], Array]] = {
    "exponential": lambda x: np.exp(-x),
    "gauss": lambda x: x * np.exp(-0.5 * x**2),
}
IMAGES = 3.900264920001955  # E L π times the shift of the mean displacement by the images of a contact, per load


class NotInstalled(Exception):
    """A solver's package is missing."""


class NotAble(Exception):
    """A solver cannot do this case, or has failed."""


@dataclass(frozen=True)
class Case:
    """An equilibrium that is asked for.

    Attributes
    ----------
    grid : int
        N.
    cell : float
        Edge L of the periodic cell.
    load : float
    tabor : float
        μ_T = 1/z0.
    law : {"exponential", "gauss"}
    sign : {1, -1}
        Of Δγ; 1: attraction.
    """

    grid: int = 512
    cell: float = 9.8825
    load: float = 1.5625
    tabor: float = 1.0
    law: str = "exponential"
    sign: int = 1

    @cached_property
    def heights(self) -> Array:
        """z on the nodes, (N, N)."""
        x = (np.arange(self.grid) + 0.5 - 0.5 * self.grid) * self.cell / self.grid
        return 0.5 * (x[:, None] ** 2 + x[None, :] ** 2)

    @cached_property
    def stiffness(self) -> Array:
        """K̂ at the coefficients of `numpy.fft.rfft2`, (N, N/2 + 1)."""
        step = self.cell / self.grid
        qx, qy = np.fft.fftfreq(self.grid, step)[:, None], np.fft.rfftfreq(self.grid, step)[None, :]
        return np.asarray(np.pi * np.hypot(qx, qy))

    @property
    def spring(self) -> float:
        """K̂ at the longest wave of the cell, π/L; what some give to the mean displacement as its stiffness."""
        return np.pi / self.cell

    def pressure(self, gap: Array) -> Array:
        """p_fr(g)."""
        return -self.sign * self.tabor * SLOPES[self.law](gap * self.tabor)

    @property
    def contact_guess(self) -> float:
        """Contact radius of DMT (attraction) or Hertz, at least 0.1; only where to begin."""
        adhesion = 2.0 * np.pi if self.sign > 0 else 0.0
        return float(np.cbrt(max(0.75 * (self.load + adhesion), 1e-3)))

    @property
    def mean_gap_guess(self) -> float:
        """The mean gap that goes with `contact_guess`, the images' share included."""
        return float(self.heights.mean()) - self.contact_guess**2 + IMAGES * self.load / (np.pi * self.cell)


@dataclass(frozen=True)
class Examined:
    """What a gap is worth as an answer to a case.

    Attributes
    ----------
    residual : float
        Root of the mean over all nodes of e² where g > 0 and of min(e, 0)² where g = 0, relative to that of p_fr²;
        with the load that was asked for.
    largest : float
        Largest |e| or |min(e, 0)|, relative to the same.
    penetration : float
        Largest overlap with the wall in the gap that was returned. It is cut off before all else, so that a solver
        that leaves tiny overlaps is judged by the nearest gap that is admissible.
    load : float
        The load at which e vanishes on average where g > 0: the load that the gap bears.
    contact_radius : float
        Root of the area of the nodes with g = 0 by π.
    mean_gap : float
    """

    residual: float
    largest: float
    penetration: float
    load: float
    contact_radius: float
    mean_gap: float


def examine(case: Case, gap: Array) -> Examined:
    """Judge a gap, (N, N).

    Raises
    ------
    NotAble
        If it has the wrong shape or is not finite.
    """
    gap = np.asarray(gap, dtype=np.float64)
    if gap.shape != case.heights.shape or not np.isfinite(gap).all():
        raise NotAble("no finite gap was returned")
    penetration = max(0.0, -float(gap.min()))
    gap = np.maximum(gap, 0.0)
    touching = gap <= 1e-12 * float(gap.max())
    attraction = case.pressure(gap)
    elastic = np.fft.irfft2(case.stiffness * np.fft.rfft2(gap - case.heights), s=gap.shape)
    area = case.cell**2
    excess = elastic + case.load / area - attraction
    violation = np.where(touching, np.minimum(excess, 0.0), excess)
    scale = float(np.sqrt(np.mean(attraction**2)))
    free = ~touching
    return Examined(
        residual=float(np.sqrt(np.mean(violation**2))) / scale,
        largest=float(np.abs(violation).max()) / scale,
        penetration=penetration,
        load=case.load - area * float(excess[free].mean()) if free.any() else float("nan"),
        contact_radius=float(np.sqrt(touching.mean() * area / np.pi)),
        mean_gap=float(gap.mean()),
    )


@dataclass(frozen=True)
class Answer:
    """What a solver returns.

    Attributes
    ----------
    gap : array (N, N)
    evaluations : int or None
        Evaluations of the energy and products with its curvature, if they can be counted.
    complaint : str
        What the solver says of itself if it has not converged by its own measure. The gap is judged all the same.
    """

    gap: Array
    evaluations: int | None = None
    complaint: str = ""


class GridSolver(ABC):
    """How a solver is asked.

    Attributes
    ----------
    name : str
        On the command line.
    packages : tuple of str
        Distributions it comes from.
    modules : tuple of str
        What has to be imported, before times are taken.
    control : str
        What it is told: ``load``, ``mean gap`` or ``offset``.
    """

    name: ClassVar[str]
    packages: ClassVar[tuple[str, ...]]
    modules: ClassVar[tuple[str, ...]]
    control: ClassVar[str]

    @abstractmethod
    def value(self, case: Case, mean_gap: float) -> float:
        """The value of the control that holds the equilibrium with this mean gap."""

    @abstractmethod
    def solve(self, case: Case, value: float, tolerance: float, start: Array | None = None) -> Answer:
        """Solve, cold or from a gap; NotInstalled, NotAble."""


def load_packages(*modules: str) -> tuple[ModuleType, ...]:
    """Import modules of other packages.

    Raises
    ------
    NotInstalled
        With what to install.
    """
    try:
        return tuple(importlib.import_module(module) for module in modules)
    except ImportError as error:
        raise NotInstalled(f"{error}; install it by: pip install 'contbranch[benchmark]'") from error


def version(solver: GridSolver) -> str:
    """Names and versions of its distributions; of one that is not installed the name."""
    found = []
    for package in solver.packages:
        try:
            found.append(f"{package} {importlib.metadata.version(package)}")
        except importlib.metadata.PackageNotFoundError:
            module = sys.modules.get(package)  # imported from a checkout
            found.append(f"{package} {getattr(module, '__version__', '')}".rstrip())
    return ", ".join(found)


class Own(GridSolver):
    """contbranch; it is told the load, and its tolerance is left alone."""

    name = "contbranch"
    packages = ("contbranch",)
    modules = ("contbranch",)
    control = "load"

    def value(self, case: Case, mean_gap: float) -> float:
        """The load, whatever the gap."""
        return case.load

    def solve(self, case: Case, value: float, tolerance: float, start: Array | None = None) -> Answer:
        """A cold start by `contbranch.solve`, evaluations counted in pairs of transforms."""
        (cb,) = load_packages(*self.modules)
        contact = cb.Contact.reduced(case.law, tabor=case.tabor, sign=case.sign)
        solution = cb.solve(contact, load=value, model=cb.Periodic(cell=case.cell, grid=case.grid))
        if solution.status != "complete":
            raise NotAble(solution.message)
        return Answer(self.gap(solution, case), solution.cost.fft_pairs)

    @staticmethod
    def gap(solution: Any, case: Case) -> Array:
        """The gap on all nodes."""
        return np.asarray(solution.cell.gap, dtype=np.float64)


class Tamaas(GridSolver):
    """tamaas: `PolonskyKeerRey` with the gap as unknown, held at its mean.

    Under load control (the constraint on the pressure) it does not converge with attraction, and neither with the
    pressure as unknown.
    """

    name = "tamaas"
    packages = ("tamaas",)
    modules = ("tamaas",)
    control = "mean gap"
    functionals: ClassVar[dict[str, str]] = {
        "exponential": "ExponentialAdhesionFunctional",
        "gauss": "SquaredExponentialAdhesionFunctional",
    }

    def value(self, case: Case, mean_gap: float) -> float:
        """The mean gap itself."""
        return mean_gap

    def solve(self, case: Case, value: float, tolerance: float, start: Array | None = None) -> Answer:
        """One thread; it does not tell how many iterations it took."""
        (tamaas,) = load_packages(*self.modules)
        tamaas.initialize(1)
        tamaas.set_log_level(tamaas.LogLevel.error)
        model = tamaas.Model(tamaas.model_type.basic_2d, [case.cell] * 2, [case.grid] * 2)
        model.E, model.nu = 1.0, 0.0
        surface = np.ascontiguousarray(-case.heights)
        kinds = tamaas.PolonskyKeerRey.type
        solver = tamaas.PolonskyKeerRey(model, surface, tolerance, kinds.gap, kinds.gap)
        law = getattr(tamaas, self.functionals[case.law])(surface)
        law.parameters = {"rho": 1.0 / case.tabor, "surface_energy": float(case.sign)}
        solver.addFunctionalTerm(law)
        solver.max_iter = 1000
        solver.dump_freq = 10**6
        if start is not None:
            model["gap"][:] = start.reshape(model["gap"].shape)
        error = solver.solve(value)
        gap = np.array(model["gap"], dtype=np.float64).reshape(case.grid, case.grid)
        return Answer(gap, complaint="" if error <= tolerance else f"no convergence: its error is {error:.1e}")


class Adhesion(GridSolver):
    """Adhesion with ContactMechanics; the gap as unknown, g ≥ 0, at a given offset of the heights.

    The mean displacement is tied to the offset by a spring of the stiffness K̂ of the longest wave, the default there.
    """

    name = "adhesion"
    packages = ("Adhesion", "ContactMechanics", "NuMPI")
    modules = (
        "ContactMechanics",
        "Adhesion.System",
        "Adhesion.Interactions",
        "SurfaceTopography",
        "NuMPI.Optimization",
    )
    control = "offset"

    def value(self, case: Case, mean_gap: float) -> float:
        """Mean displacement F/(L² K̂) less the mean of g - z."""
        mean_displacement = case.load / (case.cell**2 * case.spring)
        return mean_displacement - mean_gap + float(case.heights.mean())

    def solve(self, case: Case, value: float, tolerance: float, start: Array | None = None) -> Answer:
        """Cold from the undeformed surface, overlaps cut off; the tolerance is for the largest pressure left over."""
        if case.law != "exponential":
            raise NotAble(f"offers no {case.law} law")
        mechanics, systems, laws, topography, _ = load_packages(*self.modules)
        shape = (case.grid, case.grid)
        system = systems.BoundedSmoothContactSystem(
            mechanics.PeriodicFFTElasticHalfSpace(shape, 1.0, (case.cell, case.cell)),
            laws.Exponential(float(case.sign), 1.0 / case.tabor),
            topography.Topography(-case.heights, physical_sizes=(case.cell, case.cell), periodic=True),
        )
        first = np.maximum(case.heights - value, 0.0) if start is None else start
        objective = _Counted(system.primal_objective(value, gradient=True))
        product = _Counted(lambda x, v: system.primal_hessian_product(x.reshape(shape), v.reshape(shape)).ravel())
        node_area = (case.cell / case.grid) ** 2
        result = self.minimise(objective, product, first.ravel(), tolerance * node_area)
        gap = np.asarray(result.x, dtype=np.float64).reshape(shape)
        return Answer(gap, objective.calls + product.calls, "" if result.success else str(result.message))

    @abstractmethod
    def minimise(self, objective: _Counted, product: _Counted, start: Array, tolerance: float) -> Any:
        """Minimise the energy; the largest component of its gradient is to fall below the tolerance."""


class _Counted:
    """A function, and how often it was called."""

    def __init__(self, function: Callable[..., Any]) -> None:
        self.function = function
        self.calls = 0

    def __call__(self, *arguments: Any) -> Any:
        self.calls += 1
        return self.function(*arguments)


class AdhesionNewton(Adhesion):
    """Its energy minimised by the trust-region Newton method of NuMPI.

    The first radius never hinders it, and inner solves to 0.1 take 5 % fewer products than the default at 512² (229
    against 241 evaluations in all).
    """

    name = "adhesion-newton"

    def minimise(self, objective: _Counted, product: _Counted, start: Array, tolerance: float) -> Any:
        """`tr_newton_bounded`."""
        (optimisation,) = load_packages("NuMPI.Optimization")
        options = {"delta0": 1.0, "delta_max": 10.0, "inner_tol": 0.1}
        return optimisation.tr_newton_bounded(
            objective, start, product, jac=True, bounds_lo=0.0, gtol=tolerance, maxiter=200, **options
        )


class AdhesionCG(Adhesion):
    """Its energy minimised by the constrained conjugate gradients of NuMPI (Bugnicourt et al.)."""

    name = "adhesion-cg"

    def minimise(self, objective: _Counted, product: _Counted, start: Array, tolerance: float) -> Any:
        """`constrained_conjugate_gradients`."""
        (optimisation,) = load_packages("NuMPI.Optimization")
        return optimisation.constrained_conjugate_gradients(
            objective,
            lambda x, v: product(x, v),  # it counts the parameters of what it is given
            start,
            gtol=tolerance,
            maxiter=1000,
            bounds=np.zeros_like(start),
        )


class AdhesionLBFGS(Adhesion):
    """Its energy minimised by SciPy's L-BFGS-B, the method that its own `minimize_proxy` takes by default."""

    name = "adhesion-lbfgs"

    def minimise(self, objective: _Counted, product: _Counted, start: Array, tolerance: float) -> Any:
        """`scipy.optimize.minimize`."""
        (optimisation,) = load_packages("scipy.optimize")
        return optimisation.minimize(
            objective,
            start,
            jac=True,
            method="L-BFGS-B",
            bounds=optimisation.Bounds(lb=np.zeros_like(start)),
            options={"ftol": 0.0, "gtol": tolerance, "maxiter": 1000, "maxfun": 1500, "maxcor": 20},
        )


SOLVERS: dict[str, GridSolver] = {
    solver.name: solver for solver in (Own(), Tamaas(), AdhesionNewton(), AdhesionCG(), AdhesionLBFGS())
}
