"""Variations cos(mθ), m ≥ 1, of an axisymmetric equilibrium: eigenvalues, numbers of unstable modes, mode shapes.

With ``δg(r, θ) = η(r) cos mθ``, ``η = A_m h`` and k = −v'' (E = 1), the second variation of the energy is, up to a
factor,

    ∫_a^∞ h² dt − π ∫ k (A_m h)² r dr,      (A_m h)(r) = (2/π) ∫_a^r (t/r)^m h(t) / √(r² − t²) dt.

Its negative directions are the eigenvalues above 1 of ``T_m = B_m k A_m``, self-adjoint in ∫ dt, with
``(B_m f)(t) = 2 ∫_t^∞ (t/s)^m s f(s) / √(s² − t²) ds``. Call their number n_m. Modes m ≥ 1 carry no load and no mean
displacement, so the control does not matter to them; n_0 is the index under displacement control.

Variations vanish where the gap rests, on rings, too. Three facts settle most states, whatever the sign of v''. In real
space the form is that of ``L = |∇|/2 + v''(g)`` on functions that vanish where the gap rests, and on the sector m the
first term is ``½ √(−Δ_m)`` with ``−Δ_m = −r⁻¹ ∂_r r ∂_r + m²/r²``. Where the pressure jumps v'' has a term
−[p] δ(r − c)/g'(c), of which only the first fact is used.

1. *Order in m.* −Δ_m grows with m, the square root is monotone on positive operators (Löwner), and restricting forms to
   the same functions η(r) keeps the order: every eigenvalue of L grows with m, and n_0 ≥ n_1 ≥ n_2 ≥ … So what is
   stable against m is stable against all larger ones, and **what is stable to axisymmetric variations at fixed
   displacement is stable to all**: only states with n_0 > 0 can have azimuthal unstable modes. By the same argument
   (numerator ∫ k η², denominator growing with m) every positive eigenvalue of T_m falls as m grows.
2. *A positive supersolution.* |∇| has a positive kernel off the diagonal, so the lowest eigenfunction u of L on the
   sector is positive (Perron–Frobenius). If some ψ > 0 has ``∫ u Lψ > 0``, its eigenvalue is positive and n_m = 0.
   For h and η = A_1 h ≥ 0 the integral ``H(t) = ∫_a^t s h ds = ∫_a^t r² η / √(t² − r²) dr`` is not negative, so that
   ``∫ t ξ h dt ≥ 0`` for every ξ(t) ≥ 0 that does not increase. Hence n_1 = 0 if ``(1 − T_1) h* = t ξ`` with
   A_1 h* > 0; and for ξ = 1 the converse holds too (L is an M-operator). Asked without rings only.
3. *Translation.* φ' = h' + ζ' satisfies (1 − T_1) φ' = ζ' and A_1 φ' = g'(r), which vanishes where the gap rests. So
   n_1 = 0, and with it all n_m, where the gap increases with r (or rests) and ζ'(t)/t does not increase: parabolas,
   cones, and everything blunter.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import numpy as np
from scipy.linalg import eigh, lapack

from contbranch.arrays import Array, magnitude
from contbranch.curve.problem import Count
from contbranch.results.diagram import ModeShape

from .equations import Equations, Fields, negative_eigenvalues, upper_times_lower
from .modal import ModeSpace, inner_mode_pressure

__all__ = [
    "counted",
    "eigenvalues",
    "mode_shape",
    "settled",
    "unstable_count",
]

# Largest mode number examined, where nothing settles the larger ones before.
LARGEST_MODE = 32
# Rounding of the gap, relative to the displacement.
ROUNDING = 1e-14
# Radii inside the contact at which the pressure of a mode is given, in units of a; it is singular at the rim.
INSIDE = np.sin(np.pi / 2 * np.arange(40) / 40)


def settled(equations: Equations, fields: Fields, unstable: int | None = None) -> bool:
    """Whether all modes m ≥ 1 are proved stable without an eigenvalue; see the module's three facts.

    Parameters
    ----------
    unstable : int, optional
        n_0, the index under displacement control, if it is known.
    """
    if unstable == 0 or equations.interaction is None or not bool((fields.stiffness < 0).any()):
        return True
    t = np.hypot(fields.rim.radius, equations.mesh.nodes)
    with np.errstate(invalid="ignore", divide="ignore"):  # a tip of finite extent: then nothing compares
        blunt = equations.tip.transform_derivative(t) / t
        rounding = ROUNDING * magnitude(fields.h)
        opens = bool((np.diff(fields.gap[~fields.rests]) > -rounding).all())
        if opens and bool((np.diff(blunt) <= 1e-12 * np.abs(blunt[1:])).all()):
            return True
    return not len(equations.resting) and _has_supersolution(equations, fields, t)


def _has_supersolution(equations: Equations, fields: Fields, t: Array) -> bool:
    """Whether the solution of (1 − T_1) h = t has A_1 h > 0."""
    mesh = equations.mesh
    with np.errstate(divide="ignore", invalid="ignore"):
        ratio = t[None, :] / t[:, None]
    plane = fields.rim.plane * ratio
    matrix = upper_times_lower(mesh.abel_with(fields.stiffness) * ratio.T, plane, mesh.order)
    matrix.flat[:: mesh.size + 1] += 1.0
    _, _, h, info = lapack.dgesv(matrix, t, overwrite_a=1)
    return info == 0 and bool((plane @ h > 0).all())


def unstable_count(equations: Equations, fields: Fields, m: int) -> int:
    """n_m: the number of eigenvalues of T_m above 1, by inertia.

    For v'' ≥ 0 the form is a sum of squares on the trial functions (panel polynomials), so that a stiff film cannot
    look unstable, however coarse the mesh.

    Parameters
    ----------
    m : int
        At least 1.
    """
    space = ModeSpace.of(equations, fields)
    matrix = -_form(space, m, space.basis(m) if space.resting else None)
    matrix.flat[:: len(matrix) + 1] += 1.0
    return negative_eigenvalues(matrix)


def counted(
    equations: Equations,
    fields: Fields,
    unstable: int | None = None,
    limit: int = LARGEST_MODE,
    near: Sequence[int] = (),
) -> Count:
    """n_1, n_2, … until the order in m settles the rest, or until `limit`.

    Since n_m does not grow with m, equal numbers at two m hold between them, and few m are examined: where a guess is
    right, those at which its numbers change.

    Parameters
    ----------
    unstable : int, optional
        n_0, the index under displacement control, if it is known.
    near : sequence of int
        A guess: n_1, n_2, … of a neighbouring state.
    """
    known: dict[int, int] = {}

    def number(m: int) -> int:
        if m not in known:
            known[m] = unstable_count(equations, fields, m)
        return known[m]

    guess = min(len(near), limit)
    last = guess if guess and number(guess) else 0
    if last == 0 and (settled(equations, fields, unstable) or number(1) == 0):
        return Count()
    last, beyond = max(last, 1), last + 1 if last else max(guess, 2)
    while beyond <= limit and number(beyond):
        last, beyond = beyond, min(beyond + max(1, beyond // 4), limit + 1)
    pace = 1
    while beyond - last > 1:  # the last unstable m lies between the two
        middle, pace = max(beyond - pace, (last + beyond) // 2), 2 * pace
        last, beyond = (middle, beyond) if number(middle) else (last, middle)
    steps = [m for m, (here, there) in enumerate(pairwise(near), start=1) if there != here]

    def between(low: int, high: int) -> list[int]:
        """n of low + 1 … high."""
        if high - low < 2 or number(low) == number(high):
            return [number(high)] * (high - low)
        step = next((at for m in steps for at in (m, m + 1) if low < at < high), (low + high) // 2)
        return between(low, step) + between(step, high)

    return Count((number(1), *between(1, last)), complete=last < limit)


def eigenvalues(equations: Equations, fields: Fields, m: int, count: int = 1) -> Array:
    """The largest eigenvalues of T_m on the present mesh, in decreasing order, (count,)."""
    return _largest(ModeSpace.of(equations, fields), m, count)[0]


def mode_shape(equations: Equations, fields: Fields, m: int, index: int = 1) -> ModeShape:
    """Gap and pressure of the mode of the eigenvalue numbered `index`; the largest change of the gap is 1."""
    space = ModeSpace.of(equations, fields)
    vector = _largest(space, m, index)[1][:, index - 1]
    gap = space.plane(m) @ vector
    scale = 1 / gap[np.argmax(np.abs(gap))]
    vector, gap = scale * vector, scale * gap
    pressure = space.resting_pressure(m, vector) - space.stiffness * gap
    a, r = space.radius, np.hypot(space.radius, space.rho)
    if a > 0:
        inside = a * INSIDE
        pressure = np.concatenate([inner_mode_pressure(space, m, vector, inside), pressure])
        gap, r = np.concatenate([np.zeros_like(inside), gap]), np.concatenate([inside, r])
    return ModeShape(m, r, gap, pressure)


def _form(space: ModeSpace, m: int, basis: Array | None) -> Array:
    """π ∫ k (A_m h)² r dr on trial functions that are orthonormal in ∫ dt, (N, N)."""
    plane = space.plane(m) if basis is None else space.plane(m) @ basis
    return np.asarray(plane.T @ ((-np.pi * space.weights * space.rho * space.stiffness)[:, None] * plane))


def _largest(space: ModeSpace, m: int, count: int) -> tuple[Array, Array]:
    basis = space.basis(m) if space.resting else None
    matrix = _form(space, m, basis)
    size = len(matrix)
    count = min(count, size)
    values, vectors = eigh(matrix, subset_by_index=(size - count, size - 1), check_finite=False)
    vectors = vectors if basis is None else basis @ vectors
    return values[::-1], vectors[:, ::-1]
