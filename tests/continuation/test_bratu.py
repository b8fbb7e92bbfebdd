"""The fold of Bratu's problem against an independent high-precision computation."""

from __future__ import annotations

import mpmath
import numpy as np
import pytest
import scipy.sparse.linalg
from continuation_problems import Bratu

from contbranch.continuation import Options, trace_curve


def shooting_fold(n, digits=40):
    """Return the fold of the discrete problem by shooting from the symmetry plane in high precision.

    For even n the discrete solution is symmetric about the middle of the interval, where u_m = u_{m+1} = s. The
    recursion u_{k-1} = 2 u_k - u_{k+1} - h² λ exp(u_k) runs down to the wall; u_0(s, λ) = 0 defines λ(s), whose
    derivative vanishes at the fold. This uses neither Jacobians nor continuation.
    """
    with mpmath.workdps(digits):
        h2 = mpmath.mpf(1) / (n + 1) ** 2

        def march(s, lam):
            """u_0 with its derivatives with respect to s and λ (by the differentiated recursion)."""
            upper, here = (s, mpmath.mpf(1), mpmath.mpf(0)), (s, mpmath.mpf(1), mpmath.mpf(0))
            for _ in range(n // 2):
                e = mpmath.exp(here[0])
                lower = (
                    2 * here[0] - upper[0] - h2 * lam * e,
                    2 * here[1] - upper[1] - h2 * lam * e * here[1],
                    2 * here[2] - upper[2] - h2 * e * (1 + lam * here[2]),
                )
                upper, here = here, lower
            return here

        def of_s(s):
            """λ(s) on the branch near the fold, and dλ/ds = -u_s/u_λ."""
            lam = mpmath.mpf("3.51")
            for _ in range(60):
                u, _, u_lam = march(s, lam)
                change = u / u_lam
                lam -= change
                if abs(change) < mpmath.mpf(10) ** (8 - digits):
                    break
            _, u_s, u_lam = march(s, lam)
            return lam, -u_s / u_lam

        s = mpmath.findroot(lambda s: of_s(s)[1], (mpmath.mpf("1.18"), mpmath.mpf("1.19")), tol=mpmath.mpf(10) ** -44)
        return float(of_s(s)[0]), float(s)


@pytest.fixture(scope="module")
def exact():
    return shooting_fold(100)


def test_fold_of_100_points_to_1e_12(exact):
    curve = trace_curve(Bratu(100), np.zeros(100), 0.0, (0.0, 4.0))
    assert curve.status == "complete"
    assert len(curve.folds) == 1
    fold = curve.folds[0]
    assert abs(fold.parameter - exact[0]) < 1e-12
    assert abs(fold.parameter - exact[0]) <= fold.error < 1e-11
    assert fold.x.max() == pytest.approx(exact[1], abs=1e-10)
    assert fold.curvature < 0


@pytest.mark.parametrize("kind", ["dense", "matrix-free"])
def test_other_linearisations_find_the_same_fold(kind, exact):
    curve = trace_curve(Bratu(100, kind), np.zeros(100), 0.0, (0.0, 4.0), Options(edge_tolerance=0.1))
    assert curve.folds[0].parameter == pytest.approx(exact[0], abs=1e-11)
    reference = trace_curve(Bratu(100, "sparse"), np.zeros(100), 0.0, (0.0, 4.0), Options(edge_tolerance=0.1))
    assert len(curve.points) == len(reference.points)
    np.testing.assert_allclose(curve.parameter, reference.parameter, rtol=1e-7)


def test_truly_sparse_factorisation_finds_the_fold():
    """300 points are beyond the size up to which sparse matrices are factorised as dense ones."""
    lam, s = shooting_fold(300)
    fold = trace_curve(Bratu(300), np.zeros(300), 0.0, (0.0, 4.0), Options(edge_tolerance=0.1)).folds[0]
    assert abs(fold.parameter - lam) <= fold.error < 1e-10
    assert fold.x.max() == pytest.approx(s, abs=1e-9)


def test_steps_do_not_depend_on_the_mesh():
    options = Options(edge_tolerance=0.1)
    coarse = trace_curve(Bratu(50), np.zeros(50), 0.0, (0.0, 4.0), options)
    fine = trace_curve(Bratu(400), np.zeros(400), 0.0, (0.0, 4.0), options)
    assert abs(len(coarse.points) - len(fine.points)) <= 1
    np.testing.assert_allclose(coarse.parameter[:10], fine.parameter[:10], rtol=0.01)


def test_null_vector_annihilates_and_curvature_is_that_of_the_curve():
    problem = Bratu(100)
    fold = trace_curve(problem, np.zeros(100), 0.0, (0.0, 4.0)).folds[0]
    assert np.linalg.norm(problem.jacobian(fold.x, fold.parameter) @ fold.null_vector) < 1e-6
    assert problem.inner(fold.null_vector, fold.null_vector) == pytest.approx(1.0)
    # d²p/dα² = -ψ·F_xx φφ / ψ·F_p with the left null vector ψ = φ (the Jacobian is symmetric) and F_xx = λ eᵘ.
    phi, e = fold.null_vector, np.exp(fold.x)
    assert fold.curvature == pytest.approx(-(phi**3 @ e) * fold.parameter / (phi @ e), rel=1e-5)


def test_a_sparse_matrix_serves_the_corrections_next_to_its_own(monkeypatch):
    """Residuals and products cost little beside it; points and tangents are what their own matrices say.

    Every point has its own, for the determinant's sign.
    """
    made, factorise = [], scipy.sparse.linalg.splu
    monkeypatch.setattr(scipy.sparse.linalg, "splu", lambda *what, **how: made.append(1) or factorise(*what, **how))
    problem = Bratu(300)
    curve = trace_curve(problem, np.zeros(300), 0.0, (0.0, 4.0))
    assert len(made) < 5 * len(curve.points)
    for point in curve.points:
        x, p, tangent = point.x, point.parameter, np.append(point.tangent_x, point.tangent_parameter)
        rows = np.column_stack([problem.jacobian(x, p).toarray(), np.exp(x)])
        right = np.column_stack([np.append(problem.residual(x, p), 0.0), np.eye(301)[-1]])
        error, own = np.linalg.solve(np.vstack([rows, tangent / (tangent @ tangent)]), right).T
        assert np.linalg.norm(error) < 1e-7 * np.linalg.norm(np.append(x, 1.0))
        assert np.linalg.norm(own - tangent) < 2e-4 * np.linalg.norm(tangent)  # to 1e-4 in the norm that steps have
