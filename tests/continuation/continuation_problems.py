"""Problems with known curves, shared by the tests."""

from __future__ import annotations

import numpy as np
from scipy import sparse
from scipy.sparse.linalg import LinearOperator, splu

from contbranch.continuation import Problem


class Scalar(Problem):
    """One equation f(x, p) = 0 given by functions."""

    def __init__(self, f, fx, fp=None):
        self.f, self.fx, self.fp = f, fx, fp

    def residual(self, x, p):
        return np.array([self.f(x[0], p)])

    def jacobian(self, x, p):
        return np.array([[self.fx(x[0], p)]])

    def parameter_derivative(self, x, p):
        if self.fp is None:
            return super().parameter_derivative(x, p)
        return np.array([self.fp(x[0], p)])


def circle(radius=1.0):
    return Scalar(lambda x, p: x * x + p * p - radius**2, lambda x, p: 2 * x, lambda x, p: 2 * p)


def cusp(lam):
    """x³ - λ x - μ, followed in μ."""
    return Scalar(lambda x, p: x**3 - lam * x - p, lambda x, p: 3 * x * x - lam, lambda x, p: -1.0)


def pitchfork(imperfection=0.0):
    return Scalar(lambda x, p: p * x - x**3 + imperfection, lambda x, p: p - 3 * x * x, lambda x, p: x)


def graph(g, dg):
    """The curve p = g(x)."""
    return Scalar(lambda x, p: g(x) - p, lambda x, p: dg(x), lambda x, p: -1.0)


class Bratu(Problem):
    """u'' + λ eᵘ = 0 by central differences, with a dense, a sparse or a matrix-free Jacobian."""

    def __init__(self, n=100, kind="sparse"):
        self.n, self.kind = n, kind
        self.laplace = sparse.csc_array(
            (sparse.eye_array(n, k=1) + sparse.eye_array(n, k=-1) - 2 * sparse.eye_array(n)) * (n + 1.0) ** 2
        )
        self.inverse = splu(self.laplace)

    def residual(self, x, p):
        return self.laplace @ x + p * np.exp(x)

    def jacobian(self, x, p):
        if self.kind == "matrix-free":
            return LinearOperator((self.n, self.n), matvec=lambda v: self.laplace @ v + p * np.exp(x) * v, dtype=float)
        matrix = self.laplace + sparse.diags_array(p * np.exp(x))
        return matrix.toarray() if self.kind == "dense" else matrix

    def parameter_derivative(self, x, p):
        return np.exp(x)

    def preconditioner(self, x, p):
        return self.inverse.solve
