"""`fit`: a contact fitted to a measured force curve, jumps included, and what the curve can tell of it."""

from __future__ import annotations

import math
import warnings
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from itertools import combinations
from time import perf_counter

import numpy as np
import scipy

from contbranch.api import hysteresis
from contbranch.arrays import Array
from contbranch.contact.contact import Contact
from contbranch.contact.interaction_law import terms_of
from contbranch.contact.interactions import INTERACTIONS
from contbranch.contact.parameters import parameters_of
from contbranch.contact.tips import Parabola
from contbranch.contact.units import Quantity
from contbranch.control import Spring
from contbranch.errors import InputError, ModelError, look_up
from contbranch.measure.comparison import Comparison, Leg, legs
from contbranch.measure.features import Features, features
from contbranch.measure.force_curve import ForceCurve
from contbranch.measure.quantities import LINE, NARROW, Problem, State
from contbranch.measure.reduced import LIMITS, TABOR, curve_of, tabulated
from contbranch.results.diagram import Cost
from contbranch.results.fit import Correlations, Fit, FitJump, LawFit
from contbranch.threads import one_thread
from contbranch.watch import INTERRUPTIONS, Progress, caught, check, finishing, over, part, tell, told, watched

# Laws that are compared.
COMPARED = ("maugis-dugdale", "exponential", "van-der-waals", *LIMITS)
# Tabor coefficients from which fits start, where the range is free; and factors of the modulus otherwise.
STARTS, FACTORS = (0.2, 0.8, 3.0, 12.0), (0.2, 1.0, 5.0)
# Contact points that are tried.
PLACES = 24
# Samples of a leg while starts are tried, the evaluations they may take, and those of the last fit.
FEW, TRIED, MOST = 250, 40, 120
# Starts that are followed to their end: the best ones, as far as their sums of squares are within this factor.
BEST, WITHIN = 2, 3.0
# Residuals beyond so many standard deviations count less.
ROBUST = 3.0
# Where the residuals' standard deviation exceeds the noise by this, or their correlation length a sample, the model is
# not the curve's, and weights are those of residuals with that deviation and correlation.
MISFIT, LONG = 1.25, 2.0
# Largest relative error of a value that the data determine, and the part of the length of the contact by which its
# place is to be known.
KNOWN, PLACED = 0.2, 0.3
# Unknowns with larger errors (of their logarithm) are held at other values, a range at so many between its bounds.
SHARP, GRID, HELD = 0.04, 6, 1e-7
# Criterion above the best law's at which a law is as good as excluded.
EXCLUDED = 10.0
# Standard deviations by which a sum of squares may exceed its expectation before samples are put on other branches.
POOR = 3.0
# Change of the sum of squares by which two minima are told apart.
TOLD = 9.0
# Relative steps of derivatives.
STEP = 3e-4
# Parts of the approach in which its slope in contact is looked for, the first one with a relative error below this.
PARTS, SURE = (25, 12, 6, 3), 0.1
# A contact that takes a part of the spring's motion: slope in contact over the stiffness.
COMPLIANT = 0.8
# A slope in contact that no contact on the spring has, over the stiffness.
STIFFER = 1.25
# Residuals beside the noise that are larger than this share of the pull-off, or of a fifth of the largest force.
ELSEWHERE = 0.1
# Jumps agree within this share of the force.
AGREE = 0.05


@one_thread
def fit(
    curve: ForceCurve,
    contact: Contact,
    free: Sequence[str] = ("work_of_adhesion", "modulus"),
    *,
    fixed: Sequence[str] = (),
    spring: Quantity = None,
    law: str | None = None,
    progress: Progress | None = None,
    time_limit: float | None = None,
) -> Fit:
    """Fit a contact to a measured force curve.

    Model and data are compared over the piezo position, on each leg where the force has one value: up to a jump on one
    branch, behind it on the other, and the places of the jumps besides. Several starts are tried, made from the curve
    and from the contact given; bounds keep positive what is positive.

    Parameters
    ----------
    curve : ForceCurve
    contact : Contact
        Physical; its values are those that stay, and a start for those that are free.
    free : sequence of str
        Numbers of the contact (``work_of_adhesion``, ``modulus``, ``range``, ``radius``, …, in a sum of laws
        ``range[0]``, …), ``spring`` and ``sensitivity``, the factor between the true deflection and the recorded one.
    fixed : sequence of str
        Which of `contact_point`, `baseline` and `tilt` are held at 0; otherwise they are free.
    spring : float or str, optional
        Stiffness of the cantilever in place of the curve's.
    law : str, optional
        A law in place of the contact's, with the same work of adhesion and range; ``"jkr"`` or ``"dmt"``, its limits;
        or ``"compare"``: all of them in turn, and the best one by the Bayesian information criterion.
    progress : callable, optional
        Called as ``progress(fraction, text)`` now and then; where it raises `Stop`, the fit ends with what it has.
    time_limit : float, optional
        Seconds after which it does.

    Returns
    -------
    Fit
        With status ``incomplete`` where the minimisation did not converge.

    Raises
    ------
    InputError
        If an argument cannot be used, or the curve has nothing to fit: no contact, no adhesion, reversed signs.
    ModelError
        If the contact cannot be traced anywhere near the curve.
    """
    if not isinstance(curve, ForceCurve):
        raise InputError(f"curve: {type(curve).__name__}; must be a ForceCurve, such as cb.read_force_curve(path)")
    if not isinstance(contact, Contact) or not contact.units.physical:
        raise InputError("contact: must be a Contact with units, made by cb.Contact.physical(...) or from a file")
    if not terms_of(contact.interaction):
        raise InputError("contact: it has no interaction; give a law, with a start for its work of adhesion")
    began = perf_counter()
    with watched(progress, time_limit) as watch, warnings.catch_warnings():
        warnings.simplefilter("ignore")  # of values that are tried on the way
        fitting = _Fitting(curve.with_spring(spring), contact, named(free), named(fixed))
        found = fitting.compared() if law == "compare" else fitting.result(fitting.profiled(fitting.law(law)))
        found = replace(found, message=told(found.message), cost=Cost(perf_counter() - began, fitting.evaluations))
    return watch.passed(found)


def named(free: Sequence[str]) -> tuple[str, ...]:
    """Names, also those of one text with commas."""
    return tuple(filter(None, (name.strip() for name in (free.split(",") if isinstance(free, str) else free))))


@dataclass(frozen=True)
class _Minimum:
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


@dataclass
class _Fitting:
    """A curve that is fitted."""

    curve: ForceCurve
    contact: Contact
    free: tuple[str, ...]
    fixed: tuple[str, ...]
    evaluations: int = 0

    def __post_init__(self) -> None:
        work = sum(term.work_of_adhesion for term in terms_of(self.contact.interaction))
        self.seen = features(self.curve, adhesive=work > 0)
        self.all = Comparison.of(self.curve, self.seen)
        self.few = Comparison.of(self.curve, self.seen, FEW)
        if not self.curve.rigid and self.curve.spring is None:
            raise InputError("spring: missing; give the stiffness of the cantilever, such as '0.5 N/m'")
        self.stiffness = math.inf if self.curve.spring is None else self.curve.spring
        slope, error = self._slope()
        calibrated = not {"spring", "sensitivity"} & set(self.free)
        if slope - 4 * error > STIFFER * self.stiffness * (1.0 if calibrated else NARROW):
            raise InputError(
                f"curve: pressed most, the force rises by {slope:.3g} nN/nm, and no contact is stiffer than its spring "
                f"of {self.stiffness:.3g} nN/nm; is a unit wrong, the stiffness or (then free it) the sensitivity?"
            )

    # -- laws ---------------------------------------------------------------------------------------------------------
    def law(self, name: str | None) -> _Minimum:
        """The fit with a law, by name; None for the contact's own."""
        contact, limit = self.contact, name if name in LIMITS else ""
        if name is not None:
            look_up(name, dict.fromkeys((*INTERACTIONS, *LIMITS, "compare")), "law")
            contact = _with_law(contact, "maugis-dugdale" if limit else name)
        if limit and not isinstance(contact.tip, Parabola):
            raise InputError(f"law: {limit}; is for a parabola")
        middle = float(np.mean(self.curve.piezo[self.curve.leg(False)][: max(3, len(self.curve) // 10)]))
        start = State(contact, self.stiffness)
        problem = Problem.of(start, self.free, self.fixed, limit, middle)
        return self._followed(replace(problem, guess=self._guess(problem)))

    def compared(self) -> Fit:
        """The best of several laws."""
        if not tabulated(_with_law(self.contact, "exponential")):
            raise InputError("law: compare; is for a parabola")
        found: dict[str, _Minimum] = {}
        for k, name in enumerate(COMPARED):
            with part(k / len(COMPARED), (k + 1) / len(COMPARED)):
                found[name] = self.law(name)
            if over():
                break
        # what else fits as well is asked of those that may be the best
        first = self._scores(found)
        found |= {
            name: self.profiled(one) for name, one in found.items() if first[name] < min(first.values()) + EXCLUDED
        }
        scores = self._scores(found)
        order = sorted(scores, key=scores.__getitem__)
        best = scores[order[0]]
        listed = ((name, found[name]) for name in order)
        fits = [LawFit(name, one.rms, scores[name] - best, one.problem.values(one.x)) for name, one in listed]
        result = self.result(found[order[0]])
        near = [one.law for one in fits[1:] if one.criterion < EXCLUDED]
        words = f"Of the laws compared {fits[0].law} fits best"
        words += f"; the curve does not exclude {' and '.join(near)}." if near else "; the others are excluded by it."
        return replace(result, laws=tuple(fits), message=f"{words} {result.message}")

    def _scores(self, found: Mapping[str, _Minimum]) -> dict[str, float]:
        """Bayesian information criteria, by law; residuals that are correlated are worth fewer."""
        count, noise = len(self.curve), self.seen.noise
        losses = {}
        for name, one in found.items():
            with finishing():
                losses[name] = _loss(self._residuals(one.problem, one.comparison, noise)(one.x))
        close = found[min(losses, key=losses.__getitem__)]
        misfit, length = max(1.0, min(losses.values()) / count), 1.0
        if misfit > MISFIT**2:
            length = max(1.0, _correlation_length(close.forces))
        penalty = math.log(max(count / length, 8.0))
        return {name: losses[name] / (misfit * length) + one.x.size * penalty for name, one in found.items()}

    # -- starts -------------------------------------------------------------------------------------------------------
    def _guess(self, problem: Problem) -> State:
        """A contact made from the curve: adhesion by the pull-off, modulus by the slope where it is pressed most."""
        seen, state = self.seen, problem.start
        contact, known = state.contact, parameters_of(state.contact)
        pull = max(abs(seen.lowest), 6 * seen.noise)
        if isinstance(contact.tip, Parabola):
            radius = contact.tip.radius
            if "work_of_adhesion" in problem.free:
                work = math.copysign(pull / (1.75 * math.pi * radius), known["work_of_adhesion"].value)
                contact = known["work_of_adhesion"].contact(work)
            if "modulus" in problem.free:
                contact = replace(contact, modulus=self._modulus(radius, pull))
        return replace(state, contact=contact, line=(0.0, seen.baseline, seen.tilt))

    def _modulus(self, radius: float, pull: float) -> float:
        """E² = k³/(6 F R) of a contact of stiffness k under F, by Hertz."""
        slope = min(self._slope()[0], 0.95 * self.stiffness) or 1e-9
        stiffness = slope / (1.0 - slope / self.stiffness)
        force = max(self.seen.largest, 0.0) + pull
        return math.sqrt(stiffness**3 / (6.0 * force * radius))

    def _slope(self) -> tuple[float, float]:
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

    def _starts(self, problem: Problem) -> Iterator[Array]:
        """Vectors from which to start: around the guess, and the contact given."""
        guess, given = problem.guess or problem.start, problem.start.contact
        contact, normal = guess.contact, guess.contact.scales.normal
        contacts = [given]
        if problem.by_tabor:
            contacts += [parameters_of(contact)["range"].contact(normal / tabor) for tabor in STARTS]
        else:
            quick = "modulus" in problem.free and (tabulated(given) or problem.limit)
            contacts += [replace(contact, modulus=contact.modulus * f) for f in (FACTORS if quick else (1.0,))]
        low, high = problem.bounds()
        inside = 1e-6 * np.minimum(high - low, 1.0)
        begun: list[Array] = []
        for one in contacts:
            vector = np.clip(problem.vector(replace(guess, contact=one)), low + inside, high - inside)
            if not any(np.allclose(vector, other) for other in begun):
                begun.append(vector)
                yield self._placed(problem, vector)

    def _placed(self, problem: Problem, x: Array) -> Array:
        """A vector with the contact point where the curve is closest, tried where jumps and extreme forces agree."""
        if "contact_point" not in problem.names:
            return x
        try:
            state = problem.state(x)
            approach, retract = self._legs(problem, state)
        except (ModelError, InputError):
            return x
        piezo, force = self.curve.piezo, self.curve.force
        measured = [(retract, self.seen.pull_off), (approach, self.seen.jump_in)]
        places = [jump.piezo - leg.jump.piezo for leg, jump in measured if jump and leg.jump]
        lowest = int(np.argmin(retract.force))
        deep = float(np.interp(self.seen.largest, retract.force[lowest:], retract.piezo[lowest:]))
        places += [float(piezo[np.argmax(force)]) - deep, float(piezo[np.argmin(force)] - retract.piezo[lowest])]
        if not places[:-2]:  # no jump to go by
            around = state.contact.scales.normal
            places += list(np.linspace(min(places) - around, max(places) + around, PLACES))
        k, losses = problem.names.index("contact_point"), []
        comparison, (_, baseline, tilt) = self.few, state.line
        recorded = force[comparison.samples] - baseline - tilt * piezo[comparison.samples]
        for place in places:
            own = comparison.forces(approach, retract, place) / state.sensitivity
            losses.append(float(np.abs(own - recorded).sum()))
        return _moved(x, k, places[int(np.argmin(losses))])

    # -- minimisation -------------------------------------------------------------------------------------------------
    def _legs(self, problem: Problem, state: State) -> tuple[Leg, Leg]:
        """Approach and retraction of the model."""
        largest = (self.seen.largest + 3 * self.seen.noise) * max(state.sensitivity, 1.0) * 1.1
        if self.curve.deflected:
            largest *= max(1.0, state.spring / self.stiffness)
        return _legs_of(state.contact, largest, problem.limit, state.spring)

    def _gain(self, state: State) -> float:
        """The recorded force over the contact's."""
        bent = self.stiffness / state.spring if self.curve.deflected and math.isfinite(state.spring) else 1.0
        return bent / state.sensitivity

    def _model(self, problem: Problem, x: Array, comparison: Comparison) -> tuple[Array, Array]:
        """The recorded force at the samples, and how far the jumps are from their places."""
        state = problem.state(x)
        place, baseline, tilt = state.line
        pair = self._legs(problem, state)
        force = comparison.forces(*pair, place) * self._gain(state) + baseline
        return force + tilt * self.curve.piezo[comparison.samples], comparison.places(*pair, place)

    def _residuals(self, problem: Problem, comparison: Comparison, spread: float) -> Callable[[Array], Array]:
        """Differences of force and of places of jumps in standard deviations."""
        measured = self.curve.force[comparison.samples]
        wide = max(1.0, spread / self.seen.noise / math.sqrt(len(measured)))

        def residuals(x: Array) -> Array:
            check()
            self.evaluations += 1
            force, places = self._model(problem, x, comparison)
            return np.append((force - measured) / spread, places / wide)

        return residuals

    def _minimised(
        self,
        problem: Problem,
        x: Array,
        comparison: Comparison,
        limits: tuple[float, int],
        held: int | None = None,
    ) -> _Minimum:
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
        residuals = self._residuals(problem, comparison, spread)

        def slopes(at: Array) -> Array:
            reached[:] = at
            length = problem.state(at).contact.scales.normal
            steps = STEP * np.array([length if name == "contact_point" else 1.0 for name in problem.names])
            steps = np.where(at + steps < high, steps, -steps)
            base = residuals(at)
            return np.array([(residuals(at + step) - base) / step.sum() for step in np.diag(steps)]).T

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
                last = residuals(reached)
                return _Minimum(problem, comparison, reached, _loss(last), last, slopes(reached), False, spread)
        last = np.asarray(found.fun)
        return _Minimum(problem, comparison, found.x, _loss(last), last, slopes(found.x), found.status > 0, spread)

    def _scale(self, problem: Problem, x: Array) -> Array:
        """Sizes of steps that matter alike."""
        length, noise = problem.state(x).contact.scales.normal, self.seen.noise
        own = {"contact_point": 0.1 * length, "baseline": noise, "tilt": noise / float(np.ptp(self.curve.piezo))}
        return np.array([own.get(name, 0.1) for name in problem.names])

    def _followed(self, problem: Problem) -> _Minimum:
        """The best minimum: starts tried on few samples, the best of them followed on all."""
        noise = self.seen.noise
        tried: list[_Minimum] = []
        failure: Exception | None = None
        rough = max(noise, 0.02 * max(abs(self.seen.lowest), self.seen.largest * 0.1))
        pilot = problem
        if problem.by_tabor and not problem.limit:  # Maugis' closed form leads close enough
            pilot = problem.with_law(_with_law(problem.start.contact, "maugis-dugdale"))
        for k, x in enumerate(self._starts(pilot)):
            if over() and tried:
                break
            try:
                tell(0.1 * k, f"start {k + 1}")
                tried.append(self._minimised(pilot, x, self.few, (rough, TRIED)))
            except (ModelError, InputError, FloatingPointError) as error:
                failure = error
            except INTERRUPTIONS as error:
                caught(error)
        if not tried:
            raise ModelError(f"fit: the contact cannot be traced near the curve. {failure}")
        tried.sort(key=lambda one: one.cost)
        chosen = _distinct([one for one in tried if one.cost <= WITHIN * tried[0].cost + TOLD])[:BEST]
        found: list[_Minimum] = []
        for one in chosen:
            worse = (one.cost - tried[0].cost) * (rough / noise) ** 2 > 4 * TOLD
            fits = found and found[0].cost < MISFIT**2 * found[0].comparison.samples.size
            if found and (over() or (fits and worse)):  # one start has led to a fit, this one was clearly worse
                break
            coarse = self._minimised(problem, one.x, self.few, (max(noise, 0.2 * rough), TRIED))
            coarse = self._minimised(problem, coarse.x, self._labelled(coarse, FEW), (noise, TRIED))
            found.append(self._minimised(problem, coarse.x, self._labelled(coarse), (noise, MOST)))
        best = min(found, key=lambda one: one.cost)
        spread = self._spread(best)
        if spread > MISFIT * best.spread:  # weights that residuals which are no white noise deserve
            return self._minimised(best.problem, best.x, best.comparison, (spread, MOST))
        others = [one.x for one in _distinct([best, *found])[1:] if one.cost < best.cost + TOLD]
        return replace(best, others=tuple(others))

    def _labelled(self, found: _Minimum, most: int | None = None) -> Comparison:
        """The samples on the branches on which a fit puts them."""
        state = found.problem.state(found.x)
        place, baseline, tilt = state.line
        own = (self.curve.force - baseline - tilt * self.curve.piezo) / self._gain(state)
        known = self.all if most is None else self.few
        return known.labelled(*self._legs(found.problem, state), place, own, most)

    def profiled(self, found: _Minimum) -> _Minimum:
        """The minimum with what else fits as well: minima with an unknown held elsewhere that the data hardly tell."""
        low, high = found.problem.bounds()
        errors, near, count = _errors(self._inverse(found)[0]), [], found.comparison.samples.size
        poor = found.cost > count + POOR * math.sqrt(2.0 * count)
        for k, name in enumerate(found.problem.names):
            if name in LINE or errors[k] < SHARP:
                continue
            tried = [found.x[k] + s * errors[k] for s in (-2.0, 2.0)]
            tried += list(np.linspace(low[k], high[k], GRID)) if name == "range" and found.problem.by_tabor else []
            for value in tried:
                if over() or not low[k] <= value <= high[k]:
                    continue
                x = _moved(found.x, k, value)
                one = self._minimised(found.problem, x, found.comparison, (found.spread, TRIED), held=k)
                if (poor or one.cost < found.cost - 0.5) and not over():  # a better one may have been found by the way
                    own = self._labelled(one) if poor else found.comparison  # its jumps may be elsewhere
                    better = self._minimised(found.problem, one.x, own, (found.spread, MOST))
                    if better.cost < found.cost - 0.5:
                        return self.profiled(replace(better, others=found.others))
                if one.cost < found.cost + 4.0:
                    near.append((one.x, max(one.cost - found.cost, 1.0)))
        return replace(found, near=tuple(near))

    def _spread(self, found: _Minimum) -> float:
        """Standard deviation that independent residuals would have, were there as many as they are worth."""
        own = found.forces
        size, length = 1.4826 * float(np.median(np.abs(own))), 1.0
        if size <= MISFIT * self.seen.noise:  # the model's curve: all but outliers tell of the noise
            clipped = np.clip(own, -ROBUST * size, ROBUST * size)
            size = math.sqrt(float(clipped @ clipped) / max(own.size - found.x.size, 1))
        if size > MISFIT * self.seen.noise or found.spread > self.seen.noise:
            order = np.argsort(found.comparison.samples)
            length = _correlation_length(own[order])
        return max(size, self.seen.noise * 0.5) * math.sqrt(length if length > LONG else 1.0)

    # -- results ------------------------------------------------------------------------------------------------------
    def _elsewhere(self, found: _Minimum) -> float:
        """What the model leaves of the curve, if that is too much for its values to mean anything; otherwise 0."""
        rest = math.sqrt(max(found.rms**2 - self.seen.noise**2, 0.0))
        return rest if rest > ELSEWHERE * max(-self.seen.lowest, 0.2 * self.seen.largest) else 0.0

    def result(self, found: _Minimum) -> Fit:
        """The minimum as a result."""
        problem = found.problem
        state, values = problem.state(found.x), problem.values(found.x)
        covariance, tied = self._covariance(found)
        errors = _errors(covariance)
        safe = np.where(errors > 0, errors, 1.0)
        spreads = dict(zip(values, errors.tolist(), strict=True))
        fitted = np.full(len(self.curve), math.nan)
        fitted[found.comparison.samples], _ = self._model(problem, found.x, found.comparison)
        contact = state.contact
        control = "displacement" if math.isinf(state.spring) else Spring(state.spring)
        most = max(self.seen.largest * state.sensitivity, 1e-3 * contact.scales.load)
        result = Fit(
            values=values,
            errors=spreads,
            correlations=Correlations(tuple(values), covariance / np.outer(safe, safe)),
            identifiable=() if tied or self._elsewhere(found) else self._known(found, values, spreads),
            jumps=self._jumps(found.comparison.seen, state, *self._legs(problem, state)),
            rms=found.rms,
            noise=self.seen.noise,
            contact=contact,
            law=problem.limit or terms_of(contact.interaction)[0].name or "law",
            status="complete" if found.converged else "incomplete",
            message="",
            spring=state.spring,
            piezo=self.curve.piezo,
            force=self.curve.force,
            fitted=fitted,
            residuals=self.curve.force - fitted,
            retract=self.curve.retract,
            cost=Cost(0.0, 0),
            traced=None if problem.limit else lambda: hysteresis(contact, control, 1e-5, max_load=most),
        )
        return replace(result, message=self._message(found, result))

    def _inverse(self, found: _Minimum) -> tuple[Array, bool]:
        """Covariance of the unknowns by robust weights and the residuals' size, and whether it could not be had."""
        weights = 1.0 / (1.0 + (found.residuals / ROBUST) ** 2) ** 0.75
        slopes = found.slopes * np.sqrt(weights)[:, None]
        size = np.linalg.norm(slopes, axis=0)
        size = np.where(size > 0, size, 1e-12)
        _, singular, rows = np.linalg.svd(slopes / size, full_matrices=False)
        floor = 1e-9 * singular[0]
        inverse = (rows.T / np.maximum(singular, floor) ** 2) @ rows / np.outer(size, size)
        return inverse * max(self._spread(found) / found.spread, 0.8) ** 2, bool(singular[-1] < floor)

    def _covariance(self, found: _Minimum) -> tuple[Array, bool]:
        """Covariance of the values, no smaller than what fits as well is apart, and whether it could not be had."""
        inverse, tied = self._inverse(found)
        to_values = found.problem.derivatives(found.x)
        covariance = to_values @ inverse @ to_values.T
        apart = [np.abs(found.problem.numbers(x) - found.values) / math.sqrt(more) for x, more in found.near]
        errors = _errors(covariance, 1e-300)
        factor = np.max([errors, *apart], axis=0) / errors
        return covariance * np.outer(factor, factor), tied

    def _known(self, found: _Minimum, values: dict[str, float], errors: dict[str, float]) -> tuple[str, ...]:
        """What the data determine."""
        low, high = found.problem.bounds()
        inside = np.minimum(found.x - low, high - found.x) >= 0.05
        length = found.problem.state(found.x).contact.scales.normal
        sure = {name: KNOWN * abs(value) for name, value in values.items()}
        sure |= {"contact_point": PLACED * length, "baseline": math.inf, "tilt": math.inf}
        apart = [
            np.abs(found.problem.numbers(x) - found.values) > 3 * np.array([*errors.values()]) for x in found.others
        ]
        elsewhere = np.any([np.zeros(len(values), bool), *apart], axis=0)
        return tuple(
            name
            for k, name in enumerate(values)
            if errors[name] <= sure[name] and (inside[k] or name in LINE) and not elsewhere[k]
        )

    def _jumps(self, seen: Features, state: State, approach: Leg, retract: Leg) -> tuple[FitJump, ...]:
        """The jumps measured and fitted, in recorded forces less the baseline."""
        place, baseline, tilt = state.line
        attracts = self.seen.lowest < -6 * self.seen.noise
        names = ("jump-in", "pull-off") if attracts else ("squeeze-out", "wetting")
        found = []
        for name, leg, jump in ((names[0], approach, seen.jump_in), (names[1], retract, seen.pull_off)):
            measured = fitted = None
            if jump is not None:
                measured = {"piezo": jump.piezo, "force": jump.force - baseline - tilt * jump.piezo, "step": jump.step}
                measured["uncertainty"] = 4 * seen.noise + (_change(leg, jump.width) if leg is retract else 0.0)
            own = leg.jump  # which is one if it was seen, or should have been
            if own is not None and (jump is not None or abs(own.step) > 8 * self.seen.noise):
                gain = self._gain(state)
                fitted = {"piezo": own.piezo + place, "force": gain * own.before, "step": gain * own.step}
            if measured or fitted:
                found.append(FitJump(name, measured, fitted))
        return tuple(found)

    def _message(self, found: _Minimum, fit: Fit) -> str:
        """What the data tell, and what not."""
        values, errors, matrix, known = fit.values, fit.errors, fit.correlations.matrix, fit.identifiable
        names, problem, words = list(values), found.problem, []
        if not found.converged:
            words.append("The minimisation did not converge.")
        rest = self._elsewhere(found)
        if rest:
            words.append(
                f"This is not a curve of such a contact: it is {rest:.3g} nN away from the closest one (pull-off "
                f"{-self.seen.lowest:.3g} nN), and the values mean nothing."
            )
        words.append(f"The data determine {_listed(known)}." if known else "The data determine none of the values.")
        for name in (name for name in names if name not in known):
            error = abs(errors[name] / values[name]) if values[name] else math.inf
            words.append(f"They do not determine {name}{f' (± {100 * error:.0f} %)' if KNOWN < error < 10 else ''}.")
        tied = [
            f"{a} and {b} are {correlation:.2f} correlated"
            for (i, a), (j, b) in combinations(enumerate(names), 2)
            if abs(correlation := matrix[i, j]) > 0.9 and not {a, b} & {"baseline", "tilt"}
        ]
        if tied:
            listed = "; ".join(tied)
            words.append(f"{listed[0].upper()}{listed[1:]}.")
        slope, _ = self._slope()
        if "sensitivity" in names and slope < COMPLIANT * self.stiffness:
            words.append(
                f"Pressed most, the force rises by {slope:.3g} nN/nm, {slope / self.stiffness:.2f} of "
                "the spring's stiffness: a compliant contact, or a recorded deflection that is too small. The slope "
                "alone does not tell which; here the curve's bend and its jumps have decided."
            )
        if {"work_of_adhesion", "radius"} <= set(names) and not {"work_of_adhesion", "radius"} <= set(known):
            words.append("The pull-off fixes the product of work_of_adhesion and radius.")
        if problem.by_tabor:
            tabor = problem.state(found.x).contact.tabor or 0.0
            if tabor < 1.1 * TABOR[0] or tabor > TABOR[1] / 1.1:
                words.append(
                    f"The range is at the end of what is tabulated: the {'DMT' if tabor < 1 else 'JKR'} limit fits."
                )
        if found.others:
            words.append("Another minimum fits as well, with other values.")
        if fit.rms > 2 * self.seen.noise:
            words.append(
                f"The residuals (rms {fit.rms:.3g} nN) exceed the noise ({self.seen.noise:.3g} nN): the model is not "
                "all there is in the curve; errors allow for that."
            )
        return " ".join([*words, *_disagreements(fit.jumps)])


@lru_cache(maxsize=2)
def _legs_of(contact: Contact, largest: float, limit: str, spring: float) -> tuple[Leg, Leg]:
    """Kept while other numbers than the contact's change."""
    return legs(curve_of(contact, largest, limit), spring)


def _disagreements(jumps: tuple[FitJump, ...]) -> Iterator[str]:
    """Sentences on jumps that are not fitted."""
    for jump in jumps:
        one, other = jump.measured, jump.fitted
        if one is None or other is None:
            yield f"The {jump.name} was {'fitted but not seen' if one is None else 'seen but not fitted'}."
            continue
        # just before a jump into contact the force is small, and steep
        behind = jump.name in ("jump-in", "squeeze-out")
        seen, had = (side["force"] + (side["step"] if behind else 0.0) for side in (one, other))
        if abs(had - seen) > max(AGREE * abs(seen), one["uncertainty"]):
            where, share = "behind" if behind else "before", 100 * (had / seen - 1.0)
            yield (
                f"No such contact has the {jump.name} measured beside all else: the force {where} it is {seen:.3g} nN, "
                f"the fitted one {had:.3g} nN ({share:+.0f} %)."
            )


def _change(leg: Leg, width: float) -> float:
    """Change of the force in contact within a distance from the jump out of it."""
    ends = np.interp([0.0, width], leg.part(True)[0] - leg.part(True)[0][0], leg.part(True)[1])
    return float(abs(ends[1] - ends[0]))


def _moved(x: Array, k: int, value: float) -> Array:
    """A vector with another value of one unknown."""
    moved = x.copy()
    moved[k] = value
    return moved


def _errors(covariance: Array, least: float = 0.0) -> Array:
    """Standard deviations."""
    return np.sqrt(np.maximum(np.diag(covariance), least))


def _with_law(contact: Contact, name: str) -> Contact:
    """The contact with another law of the same work of adhesion and range."""
    law = contact.interaction
    if law is None:
        raise InputError("contact: it has no interaction")
    if law.name == name:
        return contact
    return replace(contact, interaction=INTERACTIONS[name](law.work_of_adhesion, law.range))


def _loss(residuals: Array) -> float:
    """Sum of squares, those of large residuals cut short."""
    return float(2 * ROBUST**2 * (np.sqrt(1 + (residuals / ROBUST) ** 2) - 1).sum())


def _distinct(found: list[_Minimum]) -> list[_Minimum]:
    """Minima that differ."""
    kept: list[_Minimum] = []
    for one in found:
        positive = [k for k, name in enumerate(one.problem.names) if name not in LINE]
        if all(np.abs(one.x[positive] - other.x[positive]).max(initial=0.0) > 0.05 for other in kept):
            kept.append(one)
    return kept


def _correlation_length(values: Array) -> float:
    """1 + 2 Σ ρ_k up to the first ρ_k below 0.05."""
    centred = np.clip(values - np.median(values), *np.quantile(values - np.median(values), (0.01, 0.99)))
    size = 1 << (2 * centred.size - 1).bit_length()
    spectrum = np.abs(np.fft.rfft(centred, size)) ** 2
    rho = np.fft.irfft(spectrum)[: centred.size // 2]
    rho /= rho[0] or 1.0
    low = np.flatnonzero(rho < 0.05)
    return float(1.0 + 2.0 * rho[1 : int(low[0]) if low.size else rho.size].sum())


def _listed(names: Sequence[str]) -> str:
    return f"{', '.join(names[:-1])} and {names[-1]}" if len(names) > 1 else "".join(names)
