"""How the Abel integrals of ``h`` depend on the rim radius of the contact."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from contbranch.models.quadrature import chebyshev_slopes, chebyshev_values, gauss

from .mesh import Mesh

__all__ = ["Rim", "make_rim"]

Array = NDArray[np.float64]

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
        """d(plane @ f)/d(a²) for an f that vanishes at the rim; shape (N,)."""
        return _Slope(self).plane(f)

    def weights_slope(self, f: Array) -> float:
        """d(weights @ f)/d(a²) without the boundary term −f(0)/(2a), which the disc's own integral cancels."""
        return _Slope(self).weights(f)


def make_rim(mesh: Mesh, radius: float) -> Rim:
    """The operators for a contact disc of the given radius (0: no contact)."""
    tau = mesh.nodes
    n = mesh.order
    factor = tau / np.sqrt(radius**2 + tau**2) if radius > 0 else np.ones_like(tau)
    plane = mesh.plane * factor
    weights = mesh.weights * factor
    project, to_even = mesh.rule.project_even, mesh.rule.to_even
    if radius < SMOOTH * mesh.innermost:
        theta, scale, reach = _theta_rule(mesh, radius)
        values = chebyshev_values(mesh.rule.even_order, _squares(mesh, radius, reach, theta))
        plane[:, :n] = ((2 / np.pi) * scale * np.einsum("kim,m->ik", values, gauss(_count(mesh))[1])) @ to_even
        t, w = _line_rule(mesh, radius)
        weights[:n] = (chebyshev_values(mesh.rule.even_order, _local(mesh, t**2 - radius**2)) @ w) @ to_even
    else:
        plane[:, :n] = plane[:, :n] @ project
        weights[:n] = weights[:n] @ project
    return Rim(mesh, radius, plane, weights, factor)


class _Slope:
    """Derivatives with respect to c = a² at fixed rho and fixed nodal values."""

    def __init__(self, rim: Rim) -> None:
        self.rim = rim
        tau, a = rim.mesh.nodes, rim.radius
        t2 = a * a + tau * tau
        self.factor = -0.5 * tau / (t2 * np.sqrt(t2))
        self.inner = a < SMOOTH * rim.mesh.innermost

    def plane(self, f: Array) -> Array:
        mesh, a, n = self.rim.mesh, self.rim.radius, self.rim.mesh.order
        weighted = self.factor * f
        if not self.inner:
            weighted[:n] = self.factor[:n] * (mesh.rule.project_even @ f[:n])
            return mesh.plane @ weighted
        weighted[:n] = 0.0
        result = mesh.plane @ weighted
        # First panel in theta, t = r sin(theta): s = r² sin² − a² moves by −cos² with a² at fixed rho; the upper end
        # moves where rho lies beyond the panel. f(0) = 0 kills the lower end.
        theta, scale, reach = _theta_rule(mesh, a)
        local = _squares(mesh, a, reach, theta)
        values = chebyshev_values(mesh.rule.even_order, local)
        coefficients = mesh.rule.to_even @ f[:n]
        slopes = np.tensordot(coefficients, chebyshev_slopes(values, local), 1) * (2 / mesh.innermost**2)
        inside = scale[:, 0] * ((slopes * -(np.cos(theta) ** 2)) @ gauss(_count(mesh))[1])
        end = mesh.innermost
        rho = mesh.nodes
        r2 = a * a + rho * rho
        with np.errstate(divide="ignore", invalid="ignore"):
            # sin(theta1) = t1/r:  d theta1/d(a²) = (rho² − L²) / (2 t1 r² √(r² − t1²)) = √(rho² − L²)/(2 t1 r²)
            moved = np.sqrt(np.maximum(rho**2 - end**2, 0.0)) / (2 * np.sqrt(a * a + end**2) * r2)
        return np.asarray(result + (2 / np.pi) * (inside + moved * coefficients.sum()))

    def weights(self, f: Array) -> float:
        mesh, a, n = self.rim.mesh, self.rim.radius, self.rim.mesh.order
        weighted = mesh.weights * self.factor * f
        if not self.inner:
            weighted[:n] = mesh.weights[:n] * self.factor[:n] * (mesh.rule.project_even @ f[:n])
            return float(weighted.sum() + mesh.rule.rim @ f[:n] / (2 * a))
        t, w = _line_rule(mesh, a)
        local = _local(mesh, t**2 - a * a)
        values = chebyshev_values(mesh.rule.even_order, local)
        coefficients = mesh.rule.to_even @ f[:n]
        slopes = (coefficients @ chebyshev_slopes(values, local)) * (2 / mesh.innermost**2)
        end = coefficients.sum() / (2 * np.sqrt(a * a + mesh.innermost**2))
        return float(weighted[n:].sum() - slopes @ w + end)


def _count(mesh: Mesh) -> int:
    return mesh.order + 8


def _local(mesh: Mesh, squares: Array) -> Array:
    """tau² mapped to [−1, 1] over the innermost panel."""
    return 2 * squares / mesh.innermost**2 - 1


def _theta_rule(mesh: Mesh, a: float) -> tuple[Array, Array, Array]:
    """Nodes theta (N, m), half-lengths (N, 1) and r² (N, 1) for the innermost panel, t = r sin(theta)."""
    rho = mesh.nodes
    r2 = a * a + rho * rho
    start = np.arctan2(a, rho)
    upper = np.minimum(rho, mesh.innermost)
    end = np.arctan2(np.sqrt(a * a + upper**2), np.sqrt(np.maximum(rho**2 - upper**2, 0.0)))
    z, _ = gauss(_count(mesh))
    scale = ((end - start) / 2)[:, None]
    return ((start + end) / 2)[:, None] + scale * z, scale, r2[:, None]


def _squares(mesh: Mesh, a: float, r2: Array, theta: Array) -> Array:
    return _local(mesh, r2 * np.sin(theta) ** 2 - a * a)


def _line_rule(mesh: Mesh, a: float) -> tuple[Array, Array]:
    """Nodes t and weights for ∫_a^{t1} dt over the innermost panel."""
    end = np.sqrt(a * a + mesh.innermost**2)
    z, w = gauss(_count(mesh))
    return (a + end) / 2 + (end - a) / 2 * z, (end - a) / 2 * w
