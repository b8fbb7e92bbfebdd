"""Contacts compared with a measured force curve: where the difference is least, and how well that tells values."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import Any

import numpy as np
import scipy

from contbranch.arrays import Array, Flags, Indices
from contbranch.contact.contact import Contact
from contbranch.errors import InputError
from contbranch.measure.comparison import Comparison, Leg, legs
from contbranch.measure.features import NEIGHBOURS, SEEN, features, straight_line
from contbranch.measure.force_curve import ForceCurve
from contbranch.measure.quantities import Problem, State
from contbranch.measure.reduced import curve_of
from contbranch.watch import INTERRUPTIONS, caught, check, finishing

# Residuals beyond so many standard deviations count less.
ROBUST = 3.0
# Where the residuals' standard deviation exceeds the noise by this, or their correlation length a sample, the model is
# not the curve's, and weights are those of residuals with that deviation and correlation.
MISFIT, LONG = 1.25, 2.0
# Blocks over which means are taken to see slow residuals are so many at least.
BLOCKS = 16
# Relative steps of derivatives.
STEP = 3e-4
# What MINPACK says where it has come to no minimum with the evaluations allowed.
OUT_OF_EVALUATIONS = 5
# Parts of the approach in which its slope in contact is looked for, the first one with a relative error below this.
PARTS, SURE = (25, 12, 6, 3), 0.1


@dataclass(frozen=True)
class Minimum:
    """Where a minimisation has ended: samples and their branches, vector, residuals, derivatives, and weights."""

    problem: Problem
    comparison: Comparison
    x: Array
    cost: float
    residuals: Array
    slopes: Array
    converged: bool
    spread: float
    noise: float
    others: tuple[Array, ...] = ()
    near: tuple[tuple[Array, float], ...] = ()

    @property
    def forces(self) -> Array:
        """What is left of the force at the samples (nN)."""
        return self.residuals[: self.comparison.samples.size] * self.spread

    @property
    def places(self) -> Array:
        """What is left of the places of jumps, in standard deviations."""
        return self.residuals[self.comparison.samples.size :]

    @property
    def rms(self) -> float:
        """Its root mean square."""
        return float(np.sqrt(np.mean(self.forces**2)))

    @property
    def values(self) -> Array:
        """The numbers where it has ended."""
        return self.problem.numbers(self.x)

    @cached_property
    def deviation(self) -> float:
        """Standard deviation that independent residuals would have, were there as many as they are worth."""
        own = self.forces
        size = 1.4826 * float(np.median(np.abs(own)))
        if size <= MISFIT * self.noise:  # the model's curve: all but outliers tell of the noise
            clipped = np.clip(own, -ROBUST * size, ROBUST * size)
            size = math.sqrt(float(clipped @ clipped) / max(own.size - self.x.size, 1))
        length = correlation_length(own[np.argsort(self.comparison.samples)])
        return max(size, self.noise * 0.5) * math.sqrt(length if length > LONG else 1.0)

    @property
    def worst(self) -> float:
        """The largest root mean square of few residuals in a row, in units of the noise; outliers are cut short."""
        own = np.clip(self.forces[np.argsort(self.comparison.samples)] / self.noise, -ROBUST, ROBUST) ** 2
        return math.sqrt(float(np.max(np.add.reduceat(own, np.arange(0, own.size, NEIGHBOURS)))) / NEIGHBOURS)

    @cached_property
    def inverse(self) -> tuple[Array, bool]:
        """Covariance of the unknowns by robust weights and the residuals' size, and whether it could not be had."""
        weights = 1.0 / (1.0 + (self.residuals / ROBUST) ** 2) ** 0.75
        slopes = self.slopes * np.sqrt(weights)[:, None]
        size = np.linalg.norm(slopes, axis=0)
        size = np.where(size > 0, size, 1e-12)
        _, singular, rows = np.linalg.svd(np.linalg.qr(slopes / size, mode="r"))
        floor = 1e-9 * singular[0]
        inverse = (rows.T / np.maximum(singular, floor) ** 2) @ rows / np.outer(size, size)
        return inverse * max(self.deviation / self.spread, 0.8) ** 2, bool(singular[-1] < floor)

    @property
    def errors(self) -> Array:
        """Standard deviations of the unknowns."""
        return errors_of(self.inverse[0])


class Minimiser:
    """A force curve with which contacts are compared.

    Attributes
    ----------
    curve : ForceCurve
    seen : Features
        Of the curve.
    samples : Comparison
        With the jumps that are seen in it.
    stiffness : float
        Of the spring; infinite where the curve was measured without one.
    evaluations : int

    Raises
    ------
    InputError
        If the curve has nothing to fit, or its spring's stiffness is missing.
    """

    def __init__(
        self, curve: ForceCurve, adhesive: bool, legs: Sequence[bool] = (False, True), suspect: bool = False
    ) -> None:
        self.curve, self.evaluations = curve, 0
        self.seen = features(curve, adhesive, legs, suspect)
        self.samples = Comparison.of(curve, self.seen)
        if not curve.rigid and curve.spring is None:
            raise InputError("spring: missing; give the stiffness of the cantilever, such as '0.5 N/m'")
        self.stiffness = math.inf if curve.spring is None else curve.spring

    @cached_property
    def slope(self) -> tuple[float, float]:
        """Slope of the force where the tip is pressed most, on approach if there is one, and its error by the noise.

        The part looked at is as small as the noise allows.
        """
        leg = next(leg for back in (False, True) if (leg := self.used(back)).size)
        order = leg[np.argsort(self.curve.piezo[leg])]
        for share in PARTS:
            top = order[-max(5, leg.size // share) :]
            piezo = self.curve.piezo[top]
            _, rise, error = straight_line(piezo, self.curve.force[top])
            slope, error = abs(rise), error * self.seen.noise
            if error < SURE * slope:
                break
        return slope, error

    def used(self, retract: bool) -> Indices:
        """Numbers of the samples of a leg that are fitted."""
        leg = self.curve.leg(retract)
        return leg[self.seen.used[leg]]

    def legs(self, problem: Problem, state: State) -> tuple[Leg, Leg]:
        """Approach and retraction of the model."""
        beyond = 1.1 if self.seen.begun or self.seen.returned else 2.0  # the load is known from the baseline
        largest = (self.seen.largest + 3 * self.seen.noise) * max(state.sensitivity, 1.0) * beyond
        if self.curve.deflected:
            largest *= max(1.0, state.spring / self.stiffness)
        return _legs_of(state.contact, largest, problem.limit, state.spring)

    def gain(self, state: State) -> float:
        """The recorded force over the contact's."""
        bent = self.stiffness / state.spring if self.curve.deflected and math.isfinite(state.spring) else 1.0
        return bent / state.sensitivity

    def model(self, problem: Problem, x: Array, comparison: Comparison) -> tuple[Array, Array, Array, Array]:
        """The recorded force at the samples, the part of the contact, its slope, and how far jumps are from theirs."""
        state, samples = problem.state(x), comparison.samples
        pair, place, gain = self.legs(problem, state), state.line[0], self.gain(state)
        force, slope = comparison.forces(*pair, place)
        lines = state.baseline(self.curve.piezo[samples], self.curve.retract[samples])
        return force * gain + lines, force * gain, slope * gain, comparison.places(*pair, place)

    def minimised(
        self,
        problem: Problem,
        x: Array,
        comparison: Comparison,
        limits: tuple[float, int],
        held: int | None = None,
    ) -> Minimum:
        """A minimum from a start, with a standard deviation and a number of evaluations; one unknown may be held.

        The sum of squares of robust residuals is least (J. J. Moré 1978, as in MINPACK).

        Raises
        ------
        ModelError
            If the model has no curve at the start.
        """
        spread, evaluations = limits
        low, high = problem.bounds()
        varied = np.arange(x.size) != (-1 if held is None else held)
        residuals = _Residuals(self, problem, comparison, spread)
        reached: tuple[Array, Array, Array] | None = None  # vector, residuals and slopes where it has come to

        def placed(part: Array) -> Array:
            at = x.copy()
            at[varied] = part
            return np.clip(at, low, high)

        def bent(part: Array) -> Array:
            return np.asarray(_robust(residuals.at(placed(part))[0])[0])

        def bent_slopes(part: Array) -> Array:
            nonlocal reached
            at = placed(part)
            base, found = residuals.slopes(at, varied)
            reached = at, base, found
            turned = (found * _robust(base)[1][:, None])[:, varied].T
            turned[(part < low[varied]) | (part > high[varied])] = 0.0
            return np.ascontiguousarray(turned)

        settings: Any = {"col_deriv": True, "full_output": True, "ftol": 1e-8, "xtol": 1e-8, "maxfev": evaluations}
        start = np.clip(x, low, high)[varied]
        try:
            found, _, _, _, flag = scipy.optimize.leastsq(bent, start, Dfun=bent_slopes, **settings)
            values, derivatives = residuals.slopes(placed(found), varied)
            at, converged = placed(found), flag != OUT_OF_EVALUATIONS
        except INTERRUPTIONS as error:
            caught(error)
            with finishing():
                at = np.clip(x, low, high) if reached is None else reached[0]
                values, derivatives = residuals.slopes(at, varied) if reached is None else reached[1:]
            converged = False
        return Minimum(problem, comparison, at, loss(values), values, derivatives, converged, spread, self.seen.noise)

    def columns(self, problem: Problem, samples: Indices) -> dict[str, Array]:
        """What baselines and tilts that are varied add to the force at samples, each being 1."""
        retract, far = self.curve.retract[samples], self.curve.piezo[samples] - problem.middle
        first, second = np.where(retract & problem.each, 0.0, 1.0), np.where(retract, 1.0, 0.0)
        own: dict[str, Array] = {"baseline": first, "tilt": first * far}
        own |= {"baseline_retract": second, "tilt_retract": second * far}
        return {name: own[name] for name in problem.names if name in own}

    def labelled(self, found: Minimum) -> Comparison:
        """The samples on the branches on which a fit puts them."""
        state = found.problem.state(found.x)
        own = (self.curve.force - state.baseline(self.curve.piezo, self.curve.retract)) / self.gain(state)
        return self.samples.labelled(*self.legs(found.problem, state), state.line[0], own)

    def misfit(self, found: Minimum, *legs: bool) -> tuple[float, float]:
        """Root mean squares of what the model leaves of the force in contact, outliers cut short, and of that force."""
        state, samples = found.problem.state(found.x), found.comparison.samples
        rest = found.forces
        bare = self.curve.force[samples] + rest - state.baseline(self.curve.piezo[samples], self.curve.retract[samples])
        pressed = (np.abs(bare) > SEEN * self.seen.noise) & np.isin(self.curve.retract[samples], legs or (False, True))
        if not pressed.any():
            return float(np.sqrt(np.mean(rest**2))), 0.0
        rest, bare = rest[pressed], bare[pressed]
        most = ROBUST * 1.4826 * float(np.median(np.abs(rest)))
        return float(np.sqrt(np.mean(np.clip(rest, -most, most) ** 2))), float(np.sqrt(np.mean(bare**2)))


class _Residuals:
    """Differences of force and of places of jumps in standard deviations, as functions of the unknowns."""

    def __init__(self, minimiser: Minimiser, problem: Problem, comparison: Comparison, spread: float) -> None:
        self.minimiser, self.problem, self.comparison, self.spread = minimiser, problem, comparison, spread
        self.measured = minimiser.curve.force[comparison.samples]
        # of places, which the distance of samples tells
        self.wide = max(1.0, spread / minimiser.seen.noise / math.sqrt(self.measured.size))
        self.last: dict[bytes, tuple[Array, Array, Array]] = {}  # MINPACK asks for derivatives where it has just been

    def at(self, x: Array) -> tuple[Array, Array, Array]:
        """The residuals, the contact's part of the force, and its slope."""
        if x.tobytes() not in self.last:
            check()
            self.minimiser.evaluations += 1
            force, own, slope, places = self.minimiser.model(self.problem, x, self.comparison)
            residuals = np.append((force - self.measured) / self.spread, places / self.wide)
            self.last = {x.tobytes(): (residuals, own, slope)}
        return self.last[x.tobytes()]

    def slopes(self, x: Array, varied: Flags) -> tuple[Array, Array]:
        """The residuals and their derivatives; those that need another curve only where the unknown is varied."""
        (base, own, slope), minimiser, count = self.at(x), self.minimiser, self.measured.size
        state, found = self.problem.state(x), np.zeros((base.size, x.size))
        known = minimiser.columns(self.problem, self.comparison.samples) | {"contact_point": -slope}
        if state.contact.interaction is None:  # at F = E f(d) and z = d + F/K
            known["modulus"] = own * (1.0 - slope / minimiser.gain(state) / state.spring)
        for k, name in enumerate(self.problem.names):
            if name in known:
                found[:count, k] = known[name] / self.spread
            elif varied[k]:
                step = STEP if x[k] + STEP < self.problem.bounds()[1][k] else -STEP
                found[:, k] = (self.at(moved(x, k, x[k] + step))[0] - base) / step
            if name == "contact_point" and base.size > count:
                step = STEP * state.contact.scales.normal
                pair = minimiser.legs(self.problem, state)
                places = self.comparison.places(*pair, state.line[0] + step) / self.wide
                found[count:, k] = (places - base[count:]) / step
        return base, found


@lru_cache(maxsize=2)
def _legs_of(contact: Contact, largest: float, limit: str, spring: float) -> tuple[Leg, Leg]:
    """Kept while other numbers than the contact's change."""
    return legs(curve_of(contact, largest, limit), spring)


def moved(x: Array, k: int, value: float) -> Array:
    """A vector with another value of one unknown."""
    moved = x.copy()
    moved[k] = value
    return moved


def errors_of(covariance: Array, least: float = 0.0) -> Array:
    """Standard deviations."""
    return np.sqrt(np.maximum(np.diag(covariance), least))


def _robust(residuals: Array) -> tuple[Array, Array]:
    """Residuals whose sum of squares is the loss, and their derivatives."""
    root = np.sqrt(1.0 + (residuals / ROBUST) ** 2)
    cut = residuals * np.sqrt(2.0 / (1.0 + root))
    return cut, np.sqrt(0.5 * (1.0 + root)) / root


def loss(residuals: Array) -> float:
    """Sum of squares, those of large residuals cut short."""
    return float((_robust(residuals)[0] ** 2).sum())


def correlation_length(values: Array) -> float:
    """Number of values in a row that are worth one independent one, 1 for white noise.

    The largest of what the means over blocks vary more than those of white noise would, for blocks of 2, 4, 8, … values
    (H. Flyvbjerg, H. G. Petersen 1989). A slow drift that is smaller than the noise shows in long blocks alone.
    """
    away = values - np.median(values)
    centred = np.clip(away, *np.quantile(away, (0.01, 0.99)))
    variance, size, length = float(np.mean(centred**2)) or 1.0, 2, 1.0
    while centred.size >= BLOCKS * size:
        means = centred[: centred.size // size * size].reshape(-1, size).mean(axis=1)
        length = max(length, size * float(np.mean(means**2)) / variance)
        size *= 2
    return length
