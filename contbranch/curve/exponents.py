"""Critical behaviour at a fold or first touch: normal form, local exponent, crossover and a fit over a window."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

import numpy as np

from contbranch.continuation import CorrectionError, Point
from contbranch.control import Control
from contbranch.curve.problem import equilibrium, rates_of, values_of
from contbranch.curve.refine import Found, further, moved, numbers, settled
from contbranch.errors import ModelError
from contbranch.results.diagram import Exponent, LocalExponent, Window
from contbranch.results.record import OBSERVABLES
from contbranch.watch import kept

__all__ = ["critical_exponent", "crossover_excess", "fitted_window", "sampled_exponent"]

# The window of the excess (reduced units) over which a power law is fitted.
WINDOW = (1e-2, 1e1)
# The local exponent is sampled at so many distances along the curve, in reduced units, up to this excess. They begin
# closer where an edge of the representation is close, but not where rounding hides the excess.
NEAREST, CLOSEST, FARTHEST, SAMPLES, HIGHEST = 1e-5, 1e-8, 6.0, 57, 1e2
# Samples share the discretisation of the event, so that their errors cancel, until errors there are so much larger.
POORER = 100.0
# Samples end where tangents and the secant between two of them differ by this much, though the excess of the farther
# one is at most so many times larger: closer ones would be needed.
INCONSISTENT, NEIGHBOUR = 2e-2, 4.0
# Errors of rates are larger than those of values by about this factor.
OF_RATES = 10.0
# Offset of the parameter for derivatives at a fold, and the largest share of the distance to the edge of the
# representation, where there may be a kink: in general, and where nothing but distance tells a curvature.
OFFSET, OF_ROOM, OF_GRAIN = 2e-2, 0.2, 0.45
# Derivatives on two discretisations that were given differ by this share at most.
AGREED = 0.3


class _Side:
    """The curve beside an event.

    Attributes
    ----------
    contact : bool
        Whether the order parameter is the contact radius; otherwise it is the central gap.
    order : int
        Its number among the observables.
    start : Point
        The event as the problem on this side has it, with its tangent towards growing contact.
    room : float
        Distance to the edge of the representation, in units of the problem's parameter.
    """

    def __init__(self, found: Found, control: Control, ahead: Point | None = None) -> None:
        self.control, start = control, ahead or found.point
        self.contact = found.numbers[2] > 0 or ahead is not None
        self.order = 2 if self.contact else 3
        rate = rates_of(start)[self.order]
        self.start = start.turned() if (rate < 0) == self.contact else start
        edges = equilibrium(start).parameter_range
        self.room = min(abs(edge - start.parameter) for edge in edges if edge != start.parameter)

    def seen(self, four: Sequence[float]) -> tuple[float, float]:
        """Control and order parameter of four observables, of their rates or of their errors."""
        return self.control.value(*four[:2]), four[self.order]


def _error(point: Point) -> float:
    """The discretisation error of a point, relative to its values."""
    return equilibrium(point).defect(point).relative(values_of(point))


def critical_exponent(found: Found, control: Control) -> Exponent | None:
    """Normal form, crossover and windowed fit at a fold; the order parameter is the central gap without contact.

    With the order parameter q as coordinate, control = c0 + c2 (q − q0)²/2 + c3 (q − q0)³/6 + …, so
    |q − q0| = √(2Δ/|c2|) to leading order: kappa = 1/2 at every quadratic fold.
    """
    side, problem = _Side(found, control), equilibrium(found.point)
    try:
        second, third = _derivatives(side, found.point)
        if problem.grain:  # ripples have other derivatives on another discretisation
            other = _derivatives(side, moved(found.point, problem.finer()))
            if not abs(other[0] - second) < AGREED * abs(second):
                return None
            third = third if abs(other[1] - third) < AGREED * abs(third) else 0.0
    except CorrectionError:
        return None
    if second == 0.0 or not math.isfinite(second):
        return None
    window, order = fitted_window(sampled_exponent(found, control), *WINDOW), OBSERVABLES[side.order]
    return Exponent(0.5, crossover_excess(second, third), window, math.sqrt(2 / abs(second)), order)


def _derivatives(side: _Side, fold: Point) -> tuple[float, float]:
    """Second and third derivative of the control with respect to the order parameter."""
    grain = equilibrium(fold).grain
    offset = min(grain, OF_GRAIN * side.room) if grain else min(OFFSET, OF_ROOM * side.room)
    points = [further(fold, offset * step) for step in (-2, -1, 0, 1, 2)]
    distances = np.array([side.seen(numbers(point))[1] for point in points])
    slopes = np.array([np.divide(*side.seen(rates_of(point))) for point in points])
    # The slope is c2 q + c3 q²/2 + c4 q³/6 + c5 q⁴/24.
    _, _, half_third, second, _ = np.polyfit(distances - distances[2], slopes - slopes[2], 4).tolist()
    return second, 2.0 * half_third


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
    kept(lambda: rows.extend(_samples(_Side(found, control, ahead), found)), None)
    table = np.array(rows).reshape(-1, 4)
    return LocalExponent(*table[table[:, 3] < 0.5].T)


def _samples(side: _Side, found: Found) -> Iterator[tuple[float, float, float, float]]:
    """Excess, distance of the order parameter, local exponent and its error, farther and farther away."""
    origin, errors = np.array(side.seen(found.numbers)), side.seen(found.error)
    near, travelled = side.start, 0.0
    grain = equilibrium(near).grain
    limit = math.inf if side.contact and not grain else side.room
    last, kappa, error = np.zeros(2), 0.0, 0.0
    nearest = 0.5 * grain or max(CLOSEST, NEAREST * min(1.0, side.room))
    for step in np.geomspace(nearest, FARTHEST, SAMPLES):
        if step >= limit or abs(last[0]) > HIGHEST:
            return
        try:
            near, travelled = further(near, step - travelled), step
            left = _error(near)
            if left > POORER * found.relative_error():
                near = settled(moved(near, equilibrium(near).finer()))
                left = _error(near)
        except (CorrectionError, ModelError):
            return
        if min(equilibrium(near).margins(near.x, near.parameter).values(), default=1.0) < 0.0:
            return
        here, rates = np.array(side.seen(numbers(near))), side.seen(rates_of(near))
        change, before = here - origin, (kappa, error)
        if not (change * last >= 0.0).all() or not abs(change[0]) > abs(last[0]):
            return  # the control has turned round: another fold
        kappa = change[0] * rates[1] / (change[1] * rates[0])
        off = errors[0] + OF_RATES * left * max(1.0, abs(here[0])), errors[1]
        error = abs(kappa) * float(np.sum(off / np.abs(change)))
        if abs(change[0]) < NEIGHBOUR * abs(last[0]):
            control, order = np.log(change / last)
            if not abs(order / control - (kappa + before[0]) / 2) < INCONSISTENT + error + before[1]:
                return
        last = change
        yield abs(change[0]), abs(change[1]), kappa, error


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
