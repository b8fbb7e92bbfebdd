"""Critical behaviour at a fold or first touch: normal form, local exponent, crossover and a fit over a window."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from contbranch.continuation import CorrectionError, Point
from contbranch.control import Control
from contbranch.curve.problem import equilibrium, rates_of, values_of
from contbranch.curve.refine import Found, further, moved, numbers, settled
from contbranch.errors import ModelError
from contbranch.results.diagram import Exponent, LocalExponent, Window
from contbranch.watch import kept

__all__ = ["critical_exponent", "crossover_excess", "fitted_window", "sampled_exponent"]

# The window of the excess (reduced units) over which a power law is fitted.
WINDOW = (1e-2, 1e1)
# The local exponent is sampled at so many distances along the curve, up to this excess.
HIGHEST, SAMPLES, NEAREST, FARTHEST = 1e2, 57, 1e-5, 6.0
# Samples end where the discretisation is no longer good enough, or Newton's method has failed.
LOST = 1e-4
# Close to the event all samples share its discretisation, so that its errors cancel. At a greater distance that is to
# serve this share of the excess, or the event's own error; it is made finer where it is so much worse.
SHARE, POORER = 1e-7, 100.0
# The error estimate at the event holds within this distance.
NEARBY = 1e-3
# Beyond, errors change along the curve: those of rates are larger than those of values by this factor.
OF_RATES = 10.0
# Samples end where the tangent disagrees so much with the secant to the last one, if that is at most so much closer.
INCONSISTENT, NEIGHBOUR = 2e-2, 4.0
# Offset of the parameter for derivatives at a fold, and the share of the way to the edge of the representation, where
# there may be a kink: in general, and where nothing but distance tells a curvature.
OFFSET, OF_ROOM, OF_GRAIN = 2e-2, 0.2, 0.45
# Derivatives on a discretisation that was given, and over other windows, differ by this share at most.
AGREED = 0.3


class _Side:
    """The curve beside an event as functions of the parameter."""

    def __init__(self, found: Found, control: Control, point: Point | None = None) -> None:
        self.control, self.origin = control, point or found.point
        self.contact = found.numbers[2] > 0 or point is not None
        self.order_name = "contact_radius" if self.contact else "central_gap"
        problem = equilibrium(self.origin)
        edges = [abs(edge - self.origin.parameter) for edge in problem.parameter_range if edge != self.origin.parameter]
        self.room = min(edges)

    def sample(self, point: Point) -> tuple[float, float, float, float]:
        """Control, order parameter and their rates at a point of the curve."""
        load, displacement, radius, gap = numbers(point)
        rates = rates_of(point)
        control = self.control.value(load, displacement), self.control.value(rates.load, rates.displacement)
        order = (radius, rates.contact_radius) if self.contact else (gap, rates.central_gap)
        return control[0], order[0], control[1], order[1]

    def left(self, point: Point) -> float:
        """The error of a point, relative to its values."""
        return equilibrium(point).defect(point).relative(values_of(point))

    def served(self, point: Point, tolerance: float) -> tuple[Point, float]:
        """The point on a finer discretisation where the present one is far worse than a tolerance; the error left."""
        left, problem = self.left(point), equilibrium(point)
        if left <= POORER * tolerance:
            return point, left
        try:
            there = settled(moved(point, problem.finer()))
        except (CorrectionError, ModelError):
            return point, left
        return min((point, left), (there, self.left(there)), key=lambda one: one[1])


def critical_exponent(found: Found, control: Control) -> Exponent | None:
    """Normal form, crossover and windowed fit at a fold; the order parameter is the central gap without contact.

    With the order parameter q as coordinate, control = c0 + c2 (q − q0)²/2 + c3 (q − q0)³/6 + …, so
    |q − q0| = √(2Δ/|c2|) to leading order: kappa = 1/2 at every quadratic fold.
    """
    side = _Side(found, control)
    try:
        second, third = _derivatives(side, found.point)
        if equilibrium(found.point).grain:  # other windows say whether these are ripples
            other = _derivatives(side, moved(found.point, equilibrium(found.point).finer()))
            if not abs(other[0] - second) < AGREED * abs(second):
                return None
            third = third if abs(other[1] - third) < AGREED * abs(third) else 0.0
    except CorrectionError:
        return None
    if second == 0.0 or not math.isfinite(second):
        return None
    local = sampled_exponent(found, control)
    window = fitted_window(local, *WINDOW)
    return Exponent(0.5, crossover_excess(second, third), window, math.sqrt(2 / abs(second)), side.order_name)


def _derivatives(side: _Side, fold: Point) -> tuple[float, float]:
    """Second and third derivative of the control with respect to the order parameter."""
    grain = equilibrium(fold).grain
    offset = min(grain, OF_GRAIN * side.room) if grain else min(OFFSET, OF_ROOM * side.room)
    rows = np.array([side.sample(further(fold, offset * step)) for step in (-2, -1, 0, 1, 2)])
    slopes = np.delete(rows[:, 2] / rows[:, 3] - rows[2, 2] / rows[2, 3], 2)
    # slope = c2 q + c3 q²/2 + c4 q³/6 + c5 q⁴/24: four samples, four coefficients.
    distances = np.delete(rows[:, 1] - rows[2, 1], 2)
    scale = float(np.abs(distances).max())
    q = distances / scale
    powers = np.stack([q, q**2 / 2, q**3 / 6, q**4 / 24], axis=1)
    coefficients = np.linalg.solve(powers, slopes)
    return float(coefficients[0] / scale), float(coefficients[1] / scale**2)


def sampled_exponent(found: Found, control: Control, ahead: Point | None = None) -> LocalExponent:
    """κ_local = dln|Δq|/dlnΔ on the contact side, from true tangents at logarithmically spaced distances.

    Δ is the excess of the control beyond its value at the event, towards growing contact; q is the contact radius, or
    the central gap on the branch of a fold without contact.

    Parameters
    ----------
    ahead : Point, optional
        First touch as the problem in contact has it.
    """
    rows: list[tuple[float, float, float, float]] = []
    kept(lambda: rows.extend(_samples(found, control, ahead)), None)
    table = np.array(rows).reshape(-1, 4)
    table = table[table[:, 3] < 0.5] if len(table) else table
    return LocalExponent(table[:, 0], table[:, 1], table[:, 2], table[:, 3])


def _samples(found: Found, control: Control, ahead: Point | None) -> Iterator[tuple[float, float, float, float]]:
    """Excess, distance of the order parameter, local exponent and its error, farther and farther away."""
    side = _Side(found, control, ahead)
    control0, order0 = control.value(*found.numbers[:2]), found.numbers[2 if side.contact else 3]
    errors = control.value(*found.error[:2]), found.error[2 if side.contact else 3]
    near, direction, travelled = side.origin, 0, 0.0
    left = relative = side.left(near)
    # Towards growing contact, or (without contact) a shrinking gap.
    rates = rates_of(near)
    if (rates.contact_radius if side.contact else -rates.central_gap) < 0:
        near = near.turned()
    last = (0.0,) * 4
    grain = equilibrium(near).grain
    limit = math.inf if side.contact and not grain else side.room
    small = 1.0 if ahead is not None else min(1.0, side.room)
    nearest = 0.5 * grain or NEAREST
    for distance in np.geomspace(nearest, FARTHEST, SAMPLES):
        step = distance * max(1e-3, small) if distance < 1e-3 else distance
        if step >= limit:
            break
        try:
            near, travelled = further(near, step - travelled), step
        except CorrectionError:
            break
        if min(equilibrium(near).margins(near.x, near.parameter).values(), default=1.0) < 0.0:
            break
        if step > NEARBY:
            value = side.sample(near)[0]
            size = max(1.0, abs(value))
            near, left = side.served(near, max(SHARE * abs(value - control0), errors[0]) / size)
            relative = OF_RATES * left
        if not left < LOST:
            break
        value, order, control_rate, order_rate = side.sample(near)
        excess, change = value - control0, order - order0
        direction = direction or (1 if excess > 0 else -1)
        if excess * direction <= 0 or abs(excess) <= last[0] or not math.isfinite(excess):
            break  # the control has turned round: another fold
        kappa = excess * order_rate / (change * control_rate)
        error = abs(kappa) * ((errors[0] + relative * max(1.0, abs(value))) / abs(excess) + errors[1] / abs(change))
        if abs(excess) < NEIGHBOUR * last[0]:
            # The samples themselves say what their tangents should be.
            secant = math.log(abs(change) / last[1]) / math.log(abs(excess) / last[0])
            if not abs(secant - (kappa + last[2]) / 2) < INCONSISTENT + error + last[3]:
                break
        last = abs(excess), abs(change), kappa, error
        yield last
        if abs(excess) > HIGHEST:
            break


def crossover_excess(second: float, third: float) -> float | None:
    """Excess Δ× at which the correction to the square root has become as large as the square root itself.

    With control = c0 + c2 q²/2 + c3 q³/6 the order parameter is q = √(2Δ/c2) − c3 Δ/(3 c2²) + …; both terms are equal
    at Δ× = 18 |c2|³/c3².

    Parameters
    ----------
    second, third : float
        c2 and c3.
    """
    if third == 0.0:
        return None
    return float(18 * np.abs(second) ** 3 / np.square(third))


def fitted_window(local: LocalExponent, start: float, stop: float) -> Window | None:
    """Least-squares power law ``Δq = prefactor Δ^kappa`` over a window of the excess, in logarithms.

    A power law holds nowhere exactly: the uncertainty is half the range of the local exponent over the window, plus the
    standard error of the fit.
    """
    inside = (local.excess >= start) & (local.excess <= stop)
    if np.count_nonzero(inside) < 4:
        return None
    x, y = np.log(local.excess[inside]), np.log(local.order_parameter[inside])
    # Samples crowd where the curve was cheap; every decade is to count the same.
    weights = np.gradient(x)
    kappa, intercept = (float(value) for value in np.polyfit(x, y, 1, w=np.sqrt(weights)))
    spread = float(np.cov(x, aweights=weights, ddof=0))
    misfit = np.average((y - intercept - kappa * x) ** 2, weights=weights)
    error = float(np.ptp(local.kappa[inside]) / 2 + np.sqrt(misfit / spread / len(x)))
    return Window(
        float(local.excess[inside][0]), float(local.excess[inside][-1]), kappa, error, float(np.exp(intercept))
    )
