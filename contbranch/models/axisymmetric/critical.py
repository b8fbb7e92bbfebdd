"""Critical behaviour at a fold or first touch: normal form, local exponent, crossover and a fit over a window."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import lu_factor, lu_solve

from contbranch.control import Control
from contbranch.curve.exponents import crossover_excess, fitted_window
from contbranch.results.diagram import Exponent, LocalExponent

from .locate import Place, Values
from .problem import ContactProblem

__all__ = ["critical_exponent", "sampled_exponent"]

Array = NDArray[np.float64]

# The window of the excess (reduced units) over which a power law is fitted, and the points in it.
WINDOW = (1e-2, 1e1)
# The local exponent is sampled at so many points, up to this excess.
HIGHEST, SAMPLES = 1e2, 57
# Samples end where the mesh is no longer good enough, or Newton's method has failed.
LOST = 1e-4
# Close to the event all samples share its mesh, so that discretisation errors cancel. At a greater distance the mesh
# need only serve this share of the excess; it is changed when that is so much coarser than the present one serves.
SHARE, COARSER, FINEST = 1e-7, 30.0, 1e-14
# It is made in so many rounds, and must have fewer unknowns by this factor.
REMESHES, FEWER = 4, 0.8
# Newton's method at a sample ends with a step this small, relative to the state; the next would be its square.
ITERATIONS, CONVERGED = 12, 1e-9
# The error estimate of the mesh at the event holds within this distance in the parameter.
NEARBY = 1e-3
# Or where the tangent disagrees so much with the secant to the last sample, if that is at most so much closer.
INCONSISTENT, NEIGHBOUR = 2e-2, 4.0
# Offset of the parameter for derivatives at a fold.
OFFSET = 2e-2


@dataclass(frozen=True)
class _Sample:
    """Control, order parameter and the rates of both along the curve, at one parameter."""

    control: float
    order: float
    control_rate: float
    order_rate: float


@dataclass(frozen=True)
class _State:
    """A solution at a parameter, with the tangent per parameter there."""

    u: float
    x: Array
    rate: Array


class _Side:
    """The curve around an event as functions of the parameter u, on the event's mesh or, farther away, coarser ones."""

    def __init__(self, place: Place, control: Control, contact: bool) -> None:
        self.control, self.contact = control, contact
        self.problem: ContactProblem = place.problem
        self.order_name = "contact_radius" if contact else "central_gap"
        fields = self.problem.fields(place.x, place.u)
        self.tolerance = max(self.problem.relative_error(fields), FINEST)
        self.start = _State(place.u, place.x, self.problem.direction(place.x, place.u)[0])

    def at(self, u: float, near: _State | None = None) -> tuple[_Sample, _State]:
        """The curve at a parameter, predicted from a state nearby."""
        state = self._state(u, near or self.start)
        rates = self.problem.rates(state.x, u, state.rate, 1.0)
        equations, fields = self.problem.equations, self.problem.fields(state.x, u)
        control = self.control.value(equations.load(fields), equations.displacement(fields))
        order = fields.rim.radius if self.contact else max(0.0, -fields.y)
        y_rate = self.problem.scale * math.cosh(u)
        order_rate = equations.coordinate.slopes(fields.y)[0] * y_rate if self.contact else -y_rate
        return _Sample(control, order, self.control.value(*rates), order_rate), state

    def _state(self, u: float, near: _State) -> _State:
        """Newton's method at a parameter; its last factors also give the tangent. Whatever was reached."""
        problem, equations = self.problem, self.problem.equations
        x = near.x + (u - near.u) * near.rate
        factors, size = None, math.inf
        for _ in range(ITERATIONS):
            fields = problem.fields(x, u)
            if not fields.finite:
                break
            factors = lu_factor(equations.jacobian(fields), overwrite_a=True, check_finite=False)
            step = lu_solve(factors, -fields.residual, check_finite=False)
            last, size = size, float(np.abs(step).max())
            x = x + step
            if not math.isfinite(size) or size <= CONVERGED * float(np.abs(x).max()) or size > 1e3 * max(1.0, last):
                break
        fields = problem.fields(x, u)
        if factors is None or not fields.finite:
            return _State(u, np.full_like(x, math.nan), np.full_like(x, math.nan))
        # The factors belong to the last state but one; one round of refinement makes the tangent that of the last.
        slope = problem.parameter_derivative(x, u)
        rate = lu_solve(factors, -slope, check_finite=False)
        raised = rate - float(equations.rim_row @ rate)
        left = rate + equations.mesh.abel @ (fields.stiffness * (fields.rim.plane @ raised)) + slope
        return _State(u, x, rate - lu_solve(factors, left, check_finite=False))

    def coarsened(self, state: _State, tolerance: float) -> _State:
        """The state on a coarser mesh that serves a tolerance; from then on the curve is followed there."""
        if tolerance < COARSER * self.tolerance:
            return state
        self.tolerance = tolerance
        problem, x = self.problem, state.x
        for _ in range(REMESHES):
            problem, x = problem.remeshed(x, state.u, tolerance)
            if problem.equations.mesh.size > FEWER * self.problem.equations.mesh.size:
                break
            if problem.relative_error(problem.fields(x, state.u)) <= tolerance:
                self.problem = problem
                return _State(state.u, x, problem.direction(x, state.u)[0])
        return state


def critical_exponent(place: Place, values: Values, control: Control) -> Exponent | None:
    """Normal form, crossover and windowed fit at a fold; the order parameter is the central gap where there is no
    contact.

    With the order parameter q as coordinate, control = c0 + c2 (q − q0)²/2 + c3 (q − q0)³/6 + …, so
    |q − q0| = √(2Δ/|c2|) to leading order: kappa = 1/2 at every quadratic fold.
    """
    contact = place.problem.equations.contact
    side = _Side(place, control, contact)
    order = values.numbers[2] if contact else values.numbers[3]
    # Offsets small against the distance to first touch, where the parametrisation has its kink.
    offset = min(OFFSET, 0.2 * abs(place.u))
    steps = offset * np.array([-2, -1, 1, 2])
    samples = [side.at(place.u + step)[0] for step in steps]
    slopes = np.array([sample.control_rate / sample.order_rate for sample in samples])
    distances = np.array([sample.order for sample in samples]) - order
    second, third = _derivatives(distances, slopes)
    if second == 0.0 or not math.isfinite(second):
        return None
    local = sampled_exponent(place, values, control)
    return Exponent(
        0.5,
        crossover_excess(second, third),
        fitted_window(local, *WINDOW),
        math.sqrt(2 / abs(second)),
        side.order_name,
    )


def _derivatives(distances: Array, slopes: Array) -> tuple[float, float]:
    """Second and third derivative of the control from its slopes (which vanish at distance 0)."""
    # slope = c2 q + c3 q²/2 + c4 q³/6 + c5 q⁴/24: four samples, four coefficients.
    scale = float(np.abs(distances).max())
    q = distances / scale
    powers = np.stack([q, q**2 / 2, q**3 / 6, q**4 / 24], axis=1)
    coefficients = np.linalg.solve(powers, slopes)
    return float(coefficients[0] / scale), float(coefficients[1] / scale**2)


def sampled_exponent(place: Place, values: Values, control: Control) -> LocalExponent:
    """κ_local = dln|Δq|/dlnΔ on the contact side, from true tangents at logarithmically spaced distances.

    Δ is the excess of the control beyond its value at the event, towards growing contact; q is the contact radius, or
    the central gap on the branch of a fold without contact.
    """
    touch = place.u == 0.0
    if touch:
        place = Place(place.problem.in_contact(), place.x, 0.0, place.direction)
    contact = place.problem.equations.contact
    side = _Side(place, control, contact) if not touch else _touching(place, control)
    control0 = control.value(values.load, values.displacement)
    order0 = values.numbers[2] if contact else values.numbers[3]
    errors = (control.value(values.error[0], values.error[1]), values.error[2 if contact else 3])
    rows: list[tuple[float, float, float, float]] = []
    near: _State | None = None
    relative = side.problem.relative_error(side.problem.fields(side.start.x, side.start.u))
    limit = math.inf if contact else -place.u  # without contact the branch ends at first touch
    direction = 0
    for distance in np.geomspace(1e-5, 6.0, SAMPLES):
        step = distance * max(1e-3, min(1.0, abs(place.u) if not touch else 1.0)) if distance < 1e-3 else distance
        if step >= limit:
            break
        u = place.u + step
        sample, near = side.at(u, near)
        excess, moved = sample.control - control0, sample.order - order0
        direction = direction or (1 if excess > 0 else -1)
        if excess * direction <= 0 or (rows and abs(excess) <= rows[-1][0]) or not math.isfinite(excess):
            break  # the control has turned round: another fold
        kappa = excess * sample.order_rate / (moved * sample.control_rate)
        if step > NEARBY:
            relative = side.problem.relative_error(side.problem.fields(near.x, u))
        if not relative < LOST:
            break
        error = abs(kappa) * (
            (errors[0] + relative * max(1.0, abs(sample.control))) / abs(excess) + errors[1] / abs(moved)
        )
        if rows and abs(excess) < NEIGHBOUR * rows[-1][0]:
            # The samples themselves say what their tangents should be.
            secant = math.log(abs(moved) / rows[-1][1]) / math.log(abs(excess) / rows[-1][0])
            if not abs(secant - (kappa + rows[-1][2]) / 2) < INCONSISTENT + error + rows[-1][3]:
                break
        rows.append((abs(excess), abs(moved), kappa, error))
        if abs(excess) > HIGHEST:
            break
        near = side.coarsened(near, min(SHARE * abs(excess) / max(1.0, abs(sample.control)), LOST))
    table = np.array(rows).reshape(-1, 4)
    table = table[table[:, 3] < 0.5] if len(table) else table
    return LocalExponent(table[:, 0], table[:, 1], table[:, 2], table[:, 3])


def _touching(place: Place, control: Control) -> _Side:
    return _Side(place, control, True)
