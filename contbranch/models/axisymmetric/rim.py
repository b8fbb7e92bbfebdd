"""How the Abel integrals of ``h`` depend on the rim radius of the contact."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.polynomial import chebyshev

from contbranch.arrays import Array
from contbranch.models.quadrature import chebyshev_values, gauss_between

from .mesh import Mesh

__all__ = ["Rim", "make_rim"]

# The factor tau/√(a² + tau²) is a polynomial to machine precision on an innermost panel shorter than a/SMOOTH; closer
# in, the panel is integrated in theta, where the factor disappears.
SMOOTH = 2.0


@dataclass(frozen=True)
class Rim:
    """Operators on nodal values of an even function f(tau), and their derivatives with respect to a².

    Attributes
    ----------
    radius : float
        Rim radius a; 0 without contact.
    plane : array (N, N)
        ``(plane @ f)(rho) = (2/π) ∫_a^r f dt / √(r² − t²)`` with ``r² = a² + rho²``, ``t² = a² + tau²``.
    weights : array (N,)
        ``weights @ f = ∫_a^∞ f dt``.
    factor : array (N,)
        ``dt/dtau = tau/t`` at the nodes.
    """

    mesh: Mesh
    radius: float
    plane: Array
    weights: Array
    factor: Array

    def plane_slope(self, f: Array) -> Array:
        """d(plane @ f)/d(a²) for an f that vanishes at the rim, at fixed rho and nodal values; shape (N,)."""
        mesh, a, n = self.mesh, self.radius, self.mesh.order
        weighted = self._factor_slope * f
        if not self.smooth:
            weighted[:n] = self._factor_slope[:n] * (mesh.rule.project_even @ f[:n])
            return mesh.plane @ weighted
        weighted[:n] = 0.0
        result = mesh.plane @ weighted
        # First panel in theta, t = r sin(theta): s = r² sin² − a² moves by −cos² with a² at fixed rho; the upper end
        # moves where rho lies beyond the panel. f(0) = 0 kills the lower end.
        rho = mesh.nodes
        theta, scale = mesh.angles(a, rho, _count(mesh))
        slopes, total = self._fit(f[:n], _squares(mesh, a, theta))
        inside = (slopes * -(np.cos(theta) ** 2) * scale).sum(axis=1)
        end = mesh.innermost
        with np.errstate(divide="ignore", invalid="ignore"):
            # sin(theta1) = t1/r:  d theta1/d(a²) = (rho² − L²) / (2 t1 r² √(r² − t1²)) = √(rho² − L²)/(2 t1 r²)
            moved = np.sqrt(np.maximum(rho**2 - end**2, 0.0)) / (2 * np.hypot(a, end) * (a * a + rho * rho))
        return np.asarray(result + (2 / np.pi) * (inside + moved * total))

    def weights_slope(self, f: Array) -> float:
        """d(weights @ f)/d(a²) without the boundary term −f(0)/(2a), which the disc's own integral cancels."""
        mesh, a, n = self.mesh, self.radius, self.mesh.order
        weighted = mesh.weights * self._factor_slope * f
        if not self.smooth:
            weighted[:n] = mesh.weights[:n] * self._factor_slope[:n] * (mesh.rule.project_even @ f[:n])
            return float(weighted.sum() + mesh.rule.rim @ f[:n] / (2 * a))
        t, w = _line_rule(mesh, a)
        slopes, total = self._fit(f[:n], _local(mesh, t**2 - a * a))
        return float(weighted[n:].sum() - slopes @ w + total / (2 * np.hypot(a, mesh.innermost)))

    @property
    def smooth(self) -> bool:
        """Whether the innermost panel is integrated in theta."""
        return self.radius < SMOOTH * self.mesh.innermost

    @cached_property
    def _factor_slope(self) -> Array:
        """d(factor)/d(a²)."""
        tau = self.mesh.nodes
        return np.asarray(-0.5 * tau / np.hypot(self.radius, tau) ** 3)

    def _fit(self, values: Array, local: Array) -> tuple[Array, float]:
        """d/d(tau²) of the even fit to the innermost panel's nodal values at local places, and the fit at its end."""
        coefficients = self.mesh.rule.to_even @ values
        slopes = chebyshev.chebval(local, chebyshev.chebder(coefficients))
        return np.asarray(slopes, dtype=np.float64) * (2 / self.mesh.innermost**2), float(coefficients.sum())


def make_rim(mesh: Mesh, radius: float) -> Rim:
    """The operators for a contact disc of the given radius (0: no contact)."""
    tau = mesh.nodes
    n = mesh.order
    factor = tau / np.sqrt(radius**2 + tau**2) if radius > 0 else np.ones_like(tau)
    plane = mesh.plane * factor
    weights = mesh.weights * factor
    project, to_even = mesh.rule.project_even, mesh.rule.to_even
    rim = Rim(mesh, radius, plane, weights, factor)
    if rim.smooth:
        theta, scale = mesh.angles(radius, tau, _count(mesh))
        values = chebyshev_values(mesh.rule.even_order, _squares(mesh, radius, theta))
        plane[:, :n] = ((2 / np.pi) * np.einsum("kim,im->ik", values, scale)) @ to_even
        t, w = _line_rule(mesh, radius)
        weights[:n] = (chebyshev_values(mesh.rule.even_order, _local(mesh, t**2 - radius**2)) @ w) @ to_even
    else:
        plane[:, :n] = plane[:, :n] @ project
        weights[:n] = weights[:n] @ project
    return rim


def _count(mesh: Mesh) -> int:
    return mesh.order + 8


def _local(mesh: Mesh, squares: Array) -> Array:
    """tau² mapped to [−1, 1] over the innermost panel."""
    return 2 * squares / mesh.innermost**2 - 1


def _squares(mesh: Mesh, a: float, theta: Array) -> Array:
    return _local(mesh, (a * a + mesh.nodes**2)[:, None] * np.sin(theta) ** 2 - a * a)


def _line_rule(mesh: Mesh, a: float) -> tuple[Array, Array]:
    """Nodes t and weights for ∫_a^{t1} dt over the innermost panel."""
    return gauss_between(np.asarray(a), np.hypot(a, mesh.innermost), _count(mesh))
