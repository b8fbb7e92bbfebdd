"""Contacts compared with a measured force curve: where the difference is least, and how well that tells values."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
import scipy

from contbranch.arrays import Array
from contbranch.contact.contact import Contact
from contbranch.errors import InputError
from contbranch.measure.comparison import Comparison, Leg, legs
from contbranch.measure.features import features
from contbranch.measure.force_curve import ForceCurve
from contbranch.measure.quantities import Problem, State
from contbranch.measure.reduced import curve_of
from contbranch.watch import INTERRUPTIONS, caught, check, finishing

# Residuals beyond so many standard deviations count less.
ROBUST = 3.0
# Where the residuals' standard deviation exceeds the noise by this, or their correlation length a sample, the model is
# not the curve's, and weights are those of residuals with that deviation and correlation.
MISFIT, LONG = 1.25, 2.0
# Numbers of parts over which means are taken to see slow residuals.
PARTED = (64, 32, 16)
# Room that an unknown has which is held.
HELD = 1e-7
# Relative steps of derivatives.
STEP = 3e-4
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
    others: tuple[Array, ...] = ()
    near: tuple[tuple[Array, float], ...] = ()

    @property
    def forces(self) -> Array:
        """What is left of the force at the samples (nN)."""
        return self.residuals[: self.comparison.samples.size] * self.spread

    @property
    def rms(self) -> float:
        """Its root mean square."""
        return float(np.sqrt(np.mean(self.forces**2)))

    @property
    def values(self) -> Array:
        """The numbers where it has ended."""
        return self.problem.numbers(self.x)


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

    def __init__(self, curve: ForceCurve, adhesive: bool) -> None:
        self.curve, self.evaluations = curve, 0
        self.seen = features(curve, adhesive=adhesive)
        self.samples = Comparison.of(curve, self.seen)
        if not curve.rigid and curve.spring is None:
            raise InputError("spring: missing; give the stiffness of the cantilever, such as '0.5 N/m'")
        self.stiffness = math.inf if curve.spring is None else curve.spring

    def slope(self) -> tuple[float, float]:
        """Slope of the force where the tip is pressed most, on approach, and its error by the noise.

        The part looked at is as small as the noise allows.
        """
        leg = self.curve.leg(False)
        order = leg[np.argsort(self.curve.piezo[leg])]
        for share in PARTS:
            top = order[-max(5, leg.size // share) :]
            piezo = self.curve.piezo[top]
            error = self.seen.noise / max(float(np.std(piezo)) * math.sqrt(top.size), 1e-300)
            slope = abs(float(np.polyfit(piezo, self.curve.force[top], 1)[0]))
            if error < SURE * slope:
                break
        return slope, error

    def legs(self, problem: Problem, state: State) -> tuple[Leg, Leg]:
        """Approach and retraction of the model."""
        largest = (self.seen.largest + 3 * self.seen.noise) * max(state.sensitivity, 1.0) * 1.1
        if self.curve.deflected:
            largest *= max(1.0, state.spring / self.stiffness)
        return _legs_of(state.contact, largest, problem.limit, state.spring)

    def gain(self, state: State) -> float:
        """The recorded force over the contact's."""
        bent = self.stiffness / state.spring if self.curve.deflected and math.isfinite(state.spring) else 1.0
        return bent / state.sensitivity

    def model(self, problem: Problem, x: Array, comparison: Comparison) -> tuple[Array, Array]:
        """The recorded force at the samples, and how far the jumps are from their places."""
        state = problem.state(x)
        place, baseline, tilt = state.line
        pair = self.legs(problem, state)
        force = comparison.forces(*pair, place) * self.gain(state) + baseline
        return force + tilt * self.curve.piezo[comparison.samples], comparison.places(*pair, place)

    def residuals(self, problem: Problem, comparison: Comparison, spread: float) -> Callable[[Array], Array]:
        """Differences of force and of places of jumps in standard deviations."""
        measured = self.curve.force[comparison.samples]
        wide = max(1.0, spread / self.seen.noise / math.sqrt(len(measured)))

        def residuals(x: Array) -> Array:
            check()
            self.evaluations += 1
            force, places = self.model(problem, x, comparison)
            return np.append((force - measured) / spread, places / wide)

        return residuals

    def minimised(
        self,
        problem: Problem,
        x: Array,
        comparison: Comparison,
        limits: tuple[float, int],
        held: int | None = None,
    ) -> Minimum:
        """A minimum from a start, with a standard deviation and a number of evaluations; one unknown may be held.

        Raises
        ------
        ModelError
            If the model has no curve at the start.
        """
        spread, evaluations = limits
        low, high = problem.bounds()
        if held is not None:
            low[held], high[held] = x[held] - HELD, x[held] + HELD
        residuals = self.residuals(problem, comparison, spread)

        def slopes(at: Array) -> Array:
            length = problem.state(at).contact.scales.normal
            steps = STEP * np.array([length if name == "contact_point" else 1.0 for name in problem.names])
            steps = np.where(at + steps < high, steps, -steps)
            base = residuals(at)
            found = np.array([(residuals(at + step) - base) / step.sum() for step in np.diag(steps)]).T
            known[:] = [(at.copy(), base, found)]
            return found

        known: list[tuple[Array, Array, Array]] = []  # where it has come to
        reached = np.clip(x, low, high)
        try:
            found = scipy.optimize.least_squares(
                residuals,
                reached.copy(),
                jac=slopes,
                bounds=(low, high),
                x_scale=self._scale(problem, reached),
                loss="soft_l1",
                f_scale=ROBUST,
                ftol=1e-9,
                xtol=1e-9,
                gtol=1e-9,
                max_nfev=evaluations,
            )
        except INTERRUPTIONS as error:
            caught(error)
            with finishing():
                if not known:
                    slopes(reached)
            at, last, derivatives = known[0]
            return Minimum(problem, comparison, at, loss(last), last, derivatives, False, spread)
        last = np.asarray(found.fun)
        return Minimum(problem, comparison, found.x, loss(last), last, slopes(found.x), found.status > 0, spread)

    def _scale(self, problem: Problem, x: Array) -> Array:
        """Sizes of steps that matter alike."""
        length, noise = problem.state(x).contact.scales.normal, self.seen.noise
        own = {"contact_point": 0.1 * length, "baseline": noise, "tilt": noise / float(np.ptp(self.curve.piezo))}
        return np.array([own.get(name, 0.1) for name in problem.names])

    def labelled(self, found: Minimum) -> Comparison:
        """The samples on the branches on which a fit puts them."""
        state = found.problem.state(found.x)
        place, baseline, tilt = state.line
        own = (self.curve.force - baseline - tilt * self.curve.piezo) / self.gain(state)
        return self.samples.labelled(*self.legs(found.problem, state), place, own)

    def spread(self, found: Minimum) -> float:
        """Standard deviation that independent residuals would have, were there as many as they are worth."""
        own = found.forces
        size = 1.4826 * float(np.median(np.abs(own)))
        if size <= MISFIT * self.seen.noise:  # the model's curve: all but outliers tell of the noise
            clipped = np.clip(own, -ROBUST * size, ROBUST * size)
            size = math.sqrt(float(clipped @ clipped) / max(own.size - found.x.size, 1))
        length = correlation_length(own[np.argsort(found.comparison.samples)])
        return max(size, self.seen.noise * 0.5) * math.sqrt(length if length > LONG else 1.0)

    def inverse(self, found: Minimum) -> tuple[Array, bool]:
        """Covariance of the unknowns by robust weights and the residuals' size, and whether it could not be had."""
        weights = 1.0 / (1.0 + (found.residuals / ROBUST) ** 2) ** 0.75
        slopes = found.slopes * np.sqrt(weights)[:, None]
        size = np.linalg.norm(slopes, axis=0)
        size = np.where(size > 0, size, 1e-12)
        _, singular, rows = np.linalg.svd(slopes / size, full_matrices=False)
        floor = 1e-9 * singular[0]
        inverse = (rows.T / np.maximum(singular, floor) ** 2) @ rows / np.outer(size, size)
        return inverse * max(self.spread(found) / found.spread, 0.8) ** 2, bool(singular[-1] < floor)


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


def loss(residuals: Array) -> float:
    """Sum of squares, those of large residuals cut short."""
    return float(2 * ROBUST**2 * (np.sqrt(1 + (residuals / ROBUST) ** 2) - 1).sum())


def correlation_length(values: Array) -> float:
    """1 + 2 Σ ρ_k up to the first ρ_k below 0.05; more where means over parts vary more than that says.

    Of what varies slowly and less than the noise, such as a drift, single ρ_k say nothing.
    """
    centred = np.clip(values - np.median(values), *np.quantile(values - np.median(values), (0.01, 0.99)))
    size = 1 << (2 * centred.size - 1).bit_length()
    spectrum = np.abs(np.fft.rfft(centred, size)) ** 2
    rho = np.fft.irfft(spectrum)[: centred.size // 2]
    rho /= rho[0] or 1.0
    low = np.flatnonzero(rho < 0.05)
    length = float(1.0 + 2.0 * rho[1 : int(low[0]) if low.size else rho.size].sum())
    variance = float(np.mean(centred**2))
    for parts in PARTED if variance > 0.0 else ():
        each = centred.size // parts
        means = centred[: each * parts].reshape(parts, -1).mean(axis=1) if each else np.zeros(1)
        length = max(length, each * float(np.mean(means**2)) / variance)
    return length
