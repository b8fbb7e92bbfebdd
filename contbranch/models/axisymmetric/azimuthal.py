"""Variations cos(mθ), m ≥ 1, of an axisymmetric equilibrium: eigenvalues, numbers of unstable modes, mode shapes.

With ``δg(r, θ) = η(r) cos mθ``, ``η = A_m h`` and k = −v'' (E = 1), the second variation of the energy is, up to a
factor,

    ∫_a^∞ h² dt − π ∫ k (A_m h)² r dr,      (A_m h)(r) = (2/π) ∫_a^r (t/r)^m h(t) / √(r² − t²) dt.

Its negative directions are the eigenvalues above 1 of ``T_m = B_m k A_m``, self-adjoint in ∫ dt, with
``(B_m f)(t) = 2 ∫_t^∞ (t/s)^m s f(s) / √(s² − t²) ds``. Call their number n_m. Modes m ≥ 1 carry no load and no mean
displacement, so the control does not matter to them; n_0 is the index under displacement control.

Three facts settle most states, whatever the sign of v''. In real space the form is that of ``L = |∇|/2 + v''(g)`` on
functions that vanish in the contact, and on the sector m the first term is ``½ √(−Δ_m)`` with
``−Δ_m = −r⁻¹ ∂_r r ∂_r + m²/r²``.

1. *Order in m.* −Δ_m grows with m, the square root is monotone on positive operators (Löwner), and restricting forms to
   the same functions η(r) keeps the order: every eigenvalue of L grows with m, and n_0 ≥ n_1 ≥ n_2 ≥ … So what is
   stable against m is stable against all larger ones, and **what is stable to axisymmetric variations at fixed
   displacement is stable to all**: only states with n_0 > 0 can have azimuthal unstable modes. By the same argument
   (numerator ∫ k η², denominator growing with m) every positive eigenvalue of T_m falls as m grows.
2. *A positive supersolution.* |∇| has a positive kernel off the diagonal, so the lowest eigenfunction u of L on the
   sector is positive (Perron–Frobenius). If some ψ > 0 has ``∫ u Lψ > 0``, its eigenvalue is positive and n_m = 0.
   For h and η = A_1 h ≥ 0 the integral ``H(t) = ∫_a^t s h ds = ∫_a^t r² η / √(t² − r²) dr`` is not negative, so that
   ``∫ t ξ h dt ≥ 0`` for every ξ(t) ≥ 0 that does not increase. Hence n_1 = 0 if ``(1 − T_1) h* = t ξ`` with
   A_1 h* > 0; and for ξ = 1 the converse holds too (L is an M-operator).
3. *Translation.* φ' = h' + ζ' satisfies (1 − T_1) φ' = ζ' and A_1 φ' = g'(r). So n_1 = 0, and with it all n_m, where
   the gap increases with r and ζ'(t)/t does not increase: parabolas, cones, and everything blunter.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from scipy.linalg import eigh, lapack

from contbranch.arrays import Array
from contbranch.curve.problem import Count
from contbranch.results.diagram import ModeShape

from .equations import Equations, Fields, lower_gram, negative_eigenvalues, upper_times_lower
from .modal import ModeSpace, inner_mode_pressure

__all__ = [
    "CriticalMode",
    "counted",
    "critical_eigenvalue",
    "eigenvalues",
    "mode_shape",
    "settled",
    "unstable_count",
]

# Largest mode number examined, where nothing settles the larger ones before.
LARGEST_MODE = 32
# The finer mesh has an error of its own.
SAFETY = 3.0
# Rounding of an eigenvalue, relative to the largest of the matrix, and of the gap, relative to the displacement.
ROUNDING = 1e-14
# Radii inside the contact at which the pressure of a mode is given, in units of a; it is singular at the rim.
INSIDE = np.sin(np.pi / 2 * np.arange(40) / 40)


@dataclass(frozen=True)
class CriticalMode:
    """The largest eigenvalue of T_m at one state, and its mode.

    Attributes
    ----------
    mode : int
        m.
    eigenvalue, error : float
        The equilibrium is stable against m if and only if the eigenvalue is below 1.
    t, h : array (N,)
        The mode in the Abel transform, at the nodes ``t = √(a² + tau²)``, in the scale of `shape`.
    shape : ModeShape
        Gap and pressure against the radius; the largest change of the gap is 1.
    """

    mode: int
    eigenvalue: float
    error: float
    t: Array
    h: Array
    shape: ModeShape


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
        rounding = ROUNDING * float(np.abs(fields.h).max())
        if bool((np.diff(fields.gap) > -rounding).all()) and bool((np.diff(blunt) <= 1e-12 * np.abs(blunt[1:])).all()):
            return True
    return _has_supersolution(equations, fields, t)


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


def unstable_count(equations: Equations, fields: Fields, m: int, finely: bool = True) -> int:
    """n_m: the number of eigenvalues of T_m above 1, by inertia.

    For v'' ≥ 0 the form is a sum of squares on the trial functions (panel polynomials), so that a stiff film cannot
    look unstable, however coarse the mesh.

    Parameters
    ----------
    m : int
        At least 1.
    finely : bool
        Whether the state is carried to the finer mesh.
    """
    if finely:
        equations, fields = _finer(equations, fields)
    matrix = -_form(ModeSpace.of(equations, fields), m)
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
            known[m] = unstable_count(equations, fields, m, finely=False)
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


def critical_eigenvalue(equations: Equations, fields: Fields, m: int, index: int = 1) -> CriticalMode:
    """The largest eigenvalue of T_m = B_m k A_m (or the one numbered `index`, from the largest), and its mode.

    The error estimate is the difference to the finer mesh, with the state corrected there by one Newton step.

    Raises
    ------
    ValueError
        If m < 1 or index < 1.
    """
    if m < 1 or index < 1:
        raise ValueError(f"m = {m}, index = {index}; must be at least 1")
    space = ModeSpace.of(equations, fields)
    values, vectors = _largest(space, m, index)
    finer = _corrected(*_finer(equations, fields))
    fine = eigenvalues(*finer, m, index)
    value = float(values[index - 1])
    error = SAFETY * abs(float(fine[index - 1]) - value) + ROUNDING * max(1.0, abs(value)) * math.sqrt(len(vectors))
    t, h, shape = _shape(space, m, vectors[:, index - 1])
    return CriticalMode(m, value, error, t, h, shape)


def mode_shape(equations: Equations, fields: Fields, m: int, index: int = 1) -> ModeShape:
    """Gap and pressure of the mode that belongs to the eigenvalue numbered `index`."""
    space = ModeSpace.of(equations, fields)
    return _shape(space, m, _largest(space, m, index)[1][:, index - 1])[2]


def _form(space: ModeSpace, m: int) -> Array:
    """π ∫ k (A_m h)² r dr on trial functions that are orthonormal in ∫ dt, (N, N); its lower triangle."""
    return lower_gram(space.plane(m), -np.pi * space.weights * space.rho * space.stiffness, *space.blocks)


def _largest(space: ModeSpace, m: int, count: int) -> tuple[Array, Array]:
    matrix = _form(space, m)
    size = len(matrix)
    count = min(count, size)
    values, vectors = eigh(matrix, subset_by_index=(size - count, size - 1), check_finite=False)
    return values[::-1], vectors[:, ::-1]


def _finer(equations: Equations, fields: Fields) -> tuple[Equations, Fields]:
    """The state carried to the finer mesh."""
    return equations.finer, equations.finer.fields(equations.mesh.to_finer @ fields.h, fields.y)


def _corrected(equations: Equations, fields: Fields) -> tuple[Equations, Fields]:
    """The state after one Newton step at fixed contact coordinate."""
    step = np.linalg.solve(equations.jacobian(fields), -fields.residual)
    return equations, equations.fields(fields.h + step, fields.y)


def _shape(space: ModeSpace, m: int, vector: Array) -> tuple[Array, Array, ModeShape]:
    """Nodes t, h there, and the shape, scaled so that the largest change of the gap is 1."""
    gap = space.plane(m) @ vector
    scale = 1 / gap[np.argmax(np.abs(gap))]
    vector, gap = scale * vector, scale * gap
    pressure = -space.stiffness * gap
    a, r = space.radius, np.hypot(space.radius, space.rho)
    t, h = space.nodal(m, vector)
    if a > 0:
        inside = a * INSIDE
        pressure = np.concatenate([inner_mode_pressure(space, m, vector, inside), pressure])
        gap, r = np.concatenate([np.zeros_like(inside), gap]), np.concatenate([inside, r])
    return t, h, ModeShape(m, r, gap, pressure)
