"""How the Abel integrals of ``h`` depend on the rim radius of the contact."""

from __future__ import annotations

from functools import cached_property

import numpy as np

from contbranch.arrays import Array, Flags
from contbranch.models.quadrature import chebyshev_values, gauss_between

from .mesh import NEAR, Mesh

__all__ = ["Rim"]

# The factor tau/√(a² + tau²) is a polynomial to machine precision on an innermost panel shorter than a/SMOOTH; closer
# in, the panel is integrated in t or theta, where the factor disappears.
SMOOTH = 2.0
# Gauss nodes there, besides as many as the mesh has.
EXTRA = 8


class Rim:
    """Operators on nodal values of an even function f(tau), and their derivatives with respect to a².

    Parameters
    ----------
    mesh : Mesh
    radius : float
        Rim radius a; 0 without contact.

    Attributes
    ----------
    factor : array (N,)
        ``dt/dtau = tau/t`` at the nodes.
    weights : array (N,)
        ``weights @ f = ∫_a^∞ f dt``.
    """

    def __init__(self, mesh: Mesh, radius: float) -> None:
        self.mesh, self.radius = mesh, radius
        tau, n, rule = mesh.nodes, mesh.order, mesh.rule
        self.factor = tau / np.sqrt(radius**2 + tau**2) if radius > 0 else np.ones_like(tau)
        self.weights: Array = mesh.weights * self.factor
        self.smooth = radius < SMOOTH * mesh.innermost
        if self.smooth:
            _, scale, values = self._arcs
            w, line, roots = self._line
            near, far = np.einsum("kim,im->ik", values, scale), (w / roots) @ line.T
            self._innermost = self._joined(near, far) @ ((2 / np.pi) * rule.to_even)
            self.weights[:n] = (line @ w) @ rule.to_even
        else:
            self._innermost = (mesh.plane_to_targets[:, :n] * self.factor[:n]) @ rule.project_even
            self.weights[:n] = self.weights[:n] @ rule.project_even

    @property
    def plane(self) -> Array:
        """The rows of the nodes of `plane_to_targets`, (N, N)."""
        return self.plane_to_targets[: self.mesh.size]

    @cached_property
    def plane_to_targets(self) -> Array:
        """``(plane @ f)(rho) = (2/π) ∫_a^r f dt / √(r² − t²)`` with ``r² = a² + rho²``, ``t² = a² + tau²``; (N, N).

        Further rows are those of the root edges, (N + R, N).
        """
        plane = self.mesh.plane_to_targets * self.factor
        plane[:, : self.mesh.order] = self._innermost
        return plane

    def bent(self, f: Array) -> Array:
        """``plane @ f``, without that matrix."""
        n = self.mesh.order
        return self._innermost @ f[:n] + self.mesh.plane_to_targets[:, n:] @ (self.factor[n:] * f[n:])

    def drift(self, f: Array, edges: Array, nodes: Array) -> Array:
        """Rates of ``plane @ f`` where edges and targets move at rates linear on every panel; (m, P + 1) and (m, N + R)
        -> (m, N + R). The innermost panel is to stay around a disc no larger than that."""
        mesh, a, n = self.mesh, self.radius, self.mesh.order
        f = np.concatenate([mesh.rule.project_even @ f[:n], f[n:]])
        weighted, relative, turned = self.factor * f, nodes / mesh.targets, a * a / np.hypot(a, mesh.nodes) ** 3 * f
        plane, nodes = mesh.slopes_to_targets, nodes[:, : mesh.size]
        slope = mesh.slope(weighted)
        slope[:n] = turned[:n] + self.factor[:n] * mesh.derivative(f)[:n]
        rate = relative * (plane @ (mesh.nodes * slope)) + (nodes * (turned - slope)) @ plane.T
        return rate + mesh.passing((2 / np.pi) * mesh.jumps(weighted), edges, relative, False)

    def plane_slope(self, f: Array) -> Array:
        """d(plane @ f)/d(a²) for an f that vanishes at the rim, at fixed rho and nodal values; shape (N,)."""
        mesh, a, n = self.mesh, self.radius, self.mesh.order
        weighted = self._factor_slope * f
        if not self.smooth:
            weighted[:n] = self._factor_slope[:n] * (mesh.rule.project_even @ f[:n])
            return mesh.plane_to_targets @ weighted
        result = mesh.plane_to_targets[:, n:] @ weighted[n:]
        # First panel in theta, t = r sin(theta): s = r² sin² − a² moves by −cos² with a² at fixed rho; the upper end
        # moves where rho lies beyond the panel. f(0) = 0 kills the lower end.
        theta, scale, values = self._arcs
        w, line, roots = self._line
        slopes, total = self._fit(f[:n])
        targets = mesh.targets
        squares = a * a + targets**2
        near = np.add.reduce(np.tensordot(slopes, values, 1) * np.cos(theta) ** 2 * scale, axis=1)
        far = roots @ ((slopes @ line) * w) / squares[~self._close]
        # sin(theta1) = t1/r:  d theta1/d(a²) = (rho² − L²) / (2 t1 r² √(r² − t1²)) = √(rho² − L²)/(2 t1 r²)
        end = mesh.innermost
        moved = np.sqrt(np.maximum(targets**2 - end**2, 0.0)) / (2 * np.hypot(a, end) * squares)
        return np.asarray(result + (2 / np.pi) * (moved * total - self._joined(near, far)))

    def weights_slope(self, f: Array) -> float:
        """d(weights @ f)/d(a²) without the boundary term −f(0)/(2a), which the disc's own integral cancels."""
        mesh, a, n = self.mesh, self.radius, self.mesh.order
        weighted = mesh.weights * self._factor_slope * f
        if not self.smooth:
            weighted[:n] = mesh.weights[:n] * self._factor_slope[:n] * (mesh.rule.project_even @ f[:n])
            return float(weighted.sum() + mesh.rule.rim @ f[:n] / (2 * a))
        w, line, _ = self._line
        slopes, total = self._fit(f[:n])
        return float(weighted[n:].sum() - (slopes @ line) @ w + total / (2 * np.hypot(a, mesh.innermost)))

    @cached_property
    def _factor_slope(self) -> Array:
        """d(factor)/d(a²)."""
        tau = self.mesh.nodes
        return np.asarray(-0.5 * tau / np.hypot(self.radius, tau) ** 3)

    def _fit(self, values: Array) -> tuple[Array, float]:
        """d/d(tau²) of the even fit to the innermost panel's nodal values, in Chebyshev's polynomials, and the fit at
        the panel's end."""
        rule = self.mesh.rule
        coefficients = rule.to_even @ values
        return (rule.even_slopes @ coefficients) * (2 / self.mesh.innermost**2), float(coefficients.sum())

    @cached_property
    def _close(self) -> Flags:
        """Which targets are close to the innermost panel, (N + R,)."""
        return np.asarray(self.mesh.targets < (1 + NEAR) * self.mesh.innermost)

    def _joined(self, close: Array, others: Array) -> Array:
        """Values of the targets close to the innermost panel and of the others in their order."""
        values = np.empty((len(self._close), *close.shape[1:]))
        values[self._close], values[~self._close] = close, others
        return values

    # -- the innermost panel, closer in -------------------------------------------------------------------------------
    @cached_property
    def _arcs(self) -> tuple[Array, Array, Array]:
        """For targets close to the panel: nodes theta, weights, even polynomials there; (M, K), (M, K), (E, M, K)."""
        mesh, a = self.mesh, self.radius
        rho = mesh.targets[self._close]
        theta, scale = mesh.angles(a, rho, mesh.order + EXTRA)
        squares = (a * a + rho**2)[:, None] * np.sin(theta) ** 2 - a * a
        return theta, scale, self._polynomials(squares)

    @cached_property
    def _line(self) -> tuple[Array, Array, Array]:
        """Weights of ∫ dt over the panel, even polynomials at its nodes, and √(r² − t²) for targets farther away."""
        mesh, a = self.mesh, self.radius
        t, w = gauss_between(np.asarray(a), np.hypot(a, mesh.innermost), mesh.order + EXTRA)
        squares = (t - a) * (t + a)
        rho = mesh.targets[~self._close]
        return w, self._polynomials(squares), np.sqrt(rho[:, None] ** 2 - squares)

    def _polynomials(self, squares: Array) -> Array:
        """Even polynomials of the innermost panel, where tau² is given."""
        return chebyshev_values(self.mesh.rule.even_order, 2 * squares / self.mesh.innermost**2 - 1)
