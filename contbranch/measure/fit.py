"""`fit`: a contact fitted to a measured force curve, jumps included, by any of several laws."""

from __future__ import annotations

import math
import warnings
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from time import perf_counter

import numpy as np

from contbranch.contact.contact import Contact
from contbranch.contact.interaction_law import terms_of
from contbranch.contact.interactions import INTERACTIONS
from contbranch.contact.tips import Parabola
from contbranch.contact.units import Quantity
from contbranch.errors import InputError, ModelError, look_up
from contbranch.measure.conclusions import concluded
from contbranch.measure.force_curve import ForceCurve
from contbranch.measure.minimum import MISFIT, Minimiser, Minimum, correlation_length, errors_of, loss, moved
from contbranch.measure.quantities import LINE, NARROW, Problem, State
from contbranch.measure.reduced import LIMITS, tabulated
from contbranch.measure.starts import guessed, starts
from contbranch.results.diagram import Cost
from contbranch.results.fit import Fit, LawFit
from contbranch.threads import one_thread
from contbranch.watch import INTERRUPTIONS, Progress, caught, finishing, over, part, tell, told, watched

# Laws that are compared.
COMPARED = ("maugis-dugdale", "exponential", "van-der-waals", *LIMITS)
# Evaluations that starts which are tried may take, and those of the last fit.
TRIED, MOST = 40, 120
# Starts that are followed to their end: the best ones, as far as their sums of squares are within this factor.
BEST, WITHIN = 2, 3.0
# Unknowns with larger errors (of their logarithm) are held at other values, a range at so many between its bounds.
SHARP, GRID = 0.04, 6
# Criterion above the best law's at which a law is as good as excluded.
EXCLUDED = 10.0
# Standard deviations by which a sum of squares may exceed its expectation before samples are put on other branches.
POOR = 3.0
# Change of the sum of squares by which two minima are told apart.
TOLD = 9.0
# A slope in contact that no contact on the spring has, over the stiffness.
STIFFER = 1.25


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
        Physical; its values are those that stay, and a start for those that are free. Without an interaction it is that
        of Hertz, or of Sneddon for other tips.
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
        If the contact cannot be traced anywhere near the curve, or not in time.
    """
    if not isinstance(curve, ForceCurve):
        raise InputError(f"curve: {type(curve).__name__}; must be a ForceCurve, such as cb.read_force_curve(path)")
    if not isinstance(contact, Contact) or not contact.units.physical:
        raise InputError("contact: must be a Contact with units, made by cb.Contact.physical(...) or from a file")
    if not contact.tip.is_axisymmetric:
        raise InputError("contact: a tip without axial symmetry; force curves are fitted by axisymmetric models")
    began = perf_counter()
    with watched(progress, time_limit) as watch, warnings.catch_warnings():
        warnings.simplefilter("ignore")  # of values that are tried on the way
        work = sum(term.work_of_adhesion for term in terms_of(contact.interaction))
        minimiser = Minimiser(curve.with_spring(spring), adhesive=work > 0)
        fitting = _Fitting(minimiser, contact, named(free), named(fixed))
        if law in LIMITS and "range" in fitting.free:
            raise InputError(f"free: range; the limit {law} has none, leave it out")
        if law in (*LIMITS, "compare") and contact.interaction and work <= 0:
            raise InputError(f"law: {law}; is for attraction, and the work of adhesion is {work:g}")
        try:
            found = fitting.compared() if law == "compare" else concluded(minimiser, fitting.profiled(fitting.law(law)))
        except INTERRUPTIONS as error:
            caught(error)
            raise ModelError(told("fit: no contact was compared with the curve by then.")) from None
        found = replace(found, message=told(found.message), cost=Cost(perf_counter() - began, minimiser.evaluations))
    return watch.passed(found)


def named(free: Sequence[str]) -> tuple[str, ...]:
    """Names, also those of one text with commas."""
    return tuple(filter(None, (name.strip() for name in (free.split(",") if isinstance(free, str) else free))))


class _Fitting:
    """A contact that is fitted."""

    def __init__(self, minimiser: Minimiser, contact: Contact, free: tuple[str, ...], fixed: tuple[str, ...]) -> None:
        self.minimiser, self.contact, self.free, self.fixed = minimiser, contact, free, fixed
        slope, error = minimiser.slope()
        calibrated = not {"spring", "sensitivity"} & set(free)
        if slope - 4 * error > STIFFER * minimiser.stiffness * (1.0 if calibrated else NARROW):
            raise InputError(
                f"curve: pressed most, the force rises by {slope:.3g} nN/nm, and no contact is stiffer than its spring "
                f"of {minimiser.stiffness:.3g} nN/nm; is a unit wrong, the stiffness or (then free it) the sensitivity?"
            )

    def law(self, name: str | None) -> Minimum:
        """The fit with a law, by name; None for the contact's own."""
        contact, limit = self.contact, name if name in LIMITS else ""
        if name is not None:
            known = (law for law in INTERACTIONS if law != "tabulated")
            look_up(name, dict.fromkeys((*known, *LIMITS, "compare")), "law")
            contact = _with_law(contact, "maugis-dugdale" if limit else name)
        if limit and not isinstance(contact.tip, Parabola):
            raise InputError(f"law: {limit}; is for a parabola")
        curve = self.minimiser.curve
        middle = float(np.mean(curve.piezo[curve.leg(False)][: max(3, len(curve) // 10)]))
        start = State(contact, self.minimiser.stiffness)
        problem = Problem.of(start, self.free, self.fixed, limit, middle)
        return self._followed(replace(problem, guess=guessed(self.minimiser, problem)))

    def compared(self) -> Fit:
        """The best of several laws."""
        if not tabulated(_with_law(self.contact, "exponential")):
            raise InputError("law: compare; is for a parabola")
        found: dict[str, Minimum] = {}
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
        result = concluded(self.minimiser, found[order[0]])
        near = [one.law for one in fits[1:] if one.criterion < EXCLUDED]
        words = f"Of the laws compared {fits[0].law} fits best"
        words += f"; the curve does not exclude {' and '.join(near)}." if near else "; the others are excluded by it."
        return replace(result, laws=tuple(fits), message=f"{words} {result.message}")

    def _scores(self, found: Mapping[str, Minimum]) -> dict[str, float]:
        """Bayesian information criteria, by law; residuals that are correlated are worth fewer."""
        count, noise = len(self.minimiser.curve), self.minimiser.seen.noise
        losses = {}
        for name, one in found.items():
            with finishing():
                losses[name] = loss(self.minimiser.residuals(one.problem, one.comparison, noise)(one.x))
        close = found[min(losses, key=losses.__getitem__)]
        misfit, length = max(1.0, min(losses.values()) / count), 1.0
        if misfit > MISFIT**2:
            length = max(1.0, correlation_length(close.forces))
        penalty = math.log(max(count / length, 8.0))
        return {name: losses[name] / (misfit * length) + one.x.size * penalty for name, one in found.items()}

    def _followed(self, problem: Problem) -> Minimum:
        """The best minimum: starts tried roughly, the best of them followed to the end."""
        noise = self.minimiser.seen.noise
        tried: list[Minimum] = []
        failure: Exception | None = None
        rough = max(noise, 0.02 * max(abs(self.minimiser.seen.lowest), self.minimiser.seen.largest * 0.1))
        pilot = problem
        if problem.by_tabor and not problem.limit:  # Maugis' closed form leads close enough
            pilot = problem.with_law(_with_law(problem.start.contact, "maugis-dugdale"))
        for k, x in enumerate(starts(self.minimiser, pilot)):
            if over() and tried:
                break
            try:
                tell(0.1 * k, f"start {k + 1}")
                tried.append(self.minimiser.minimised(pilot, x, self.minimiser.samples, (rough, TRIED)))
            except (ModelError, InputError, FloatingPointError) as error:
                failure = error
            except INTERRUPTIONS as error:
                caught(error)
                with finishing(), suppress(ModelError):  # the start itself is there then
                    tried.append(self.minimiser.minimised(pilot, x, self.minimiser.samples, (rough, 1)))
        if not tried:
            raise ModelError(told(f"fit: the contact cannot be traced near the curve. {failure or ''}".strip()))
        tried.sort(key=lambda one: one.cost)
        chosen = _distinct([one for one in tried if one.cost <= WITHIN * tried[0].cost + TOLD])[:BEST]
        found: list[Minimum] = []
        for one in chosen:
            worse = (one.cost - tried[0].cost) * (rough / noise) ** 2 > 4 * TOLD
            fits = found and found[0].cost < MISFIT**2 * found[0].comparison.samples.size
            if found and (over() or (fits and worse)):  # one start has led to a fit, this one was clearly worse
                break
            try:
                one = self.minimiser.minimised(problem, one.x, self.minimiser.samples, (max(noise, 0.2 * rough), TRIED))
                for evaluations in (TRIED, MOST):  # each time with jumps where the last one puts them
                    one = self.minimiser.minimised(problem, one.x, self.minimiser.labelled(one), (noise, evaluations))
            except ModelError:
                if not over():
                    raise
                one = replace(one, converged=False)  # the curve that leads close enough is all there is
            found.append(one)
        best = min(found, key=lambda one: one.cost)
        spread = self.minimiser.spread(best)
        if spread > MISFIT * best.spread:  # weights that residuals which are no white noise deserve
            return self.minimiser.minimised(best.problem, best.x, best.comparison, (spread, MOST))
        others = [one.x for one in _distinct([best, *found])[1:] if one.cost < best.cost + TOLD]
        return replace(best, others=tuple(others))

    def profiled(self, found: Minimum) -> Minimum:
        """The minimum with what else fits as well: minima with an unknown held elsewhere that the data hardly tell."""
        low, high = found.problem.bounds()
        errors, near, count = errors_of(self.minimiser.inverse(found)[0]), [], found.comparison.samples.size
        poor = found.cost > count + POOR * math.sqrt(2.0 * count)
        for k, name in enumerate(found.problem.names):
            if name in LINE or errors[k] < SHARP:
                continue
            tried = [found.x[k] + s * errors[k] for s in (-2.0, 2.0)]
            tried += list(np.linspace(low[k], high[k], GRID)) if name == "range" and found.problem.by_tabor else []
            for value in tried:
                if over() or not low[k] <= value <= high[k]:
                    continue
                x = moved(found.x, k, value)
                one = self.minimiser.minimised(found.problem, x, found.comparison, (found.spread, TRIED), held=k)
                if (poor or one.cost < found.cost - 0.5) and not over():  # a better one may have been found by the way
                    own = self.minimiser.labelled(one) if poor else found.comparison  # its jumps may be elsewhere
                    better = self.minimiser.minimised(found.problem, one.x, own, (found.spread, MOST))
                    if better.cost < found.cost - 0.5:
                        return self.profiled(replace(better, others=found.others))
                if one.cost < found.cost + 4.0:
                    near.append((one.x, max(one.cost - found.cost, 1.0)))
        return replace(found, near=tuple(near))


def _with_law(contact: Contact, name: str) -> Contact:
    """The contact with another law of the same work of adhesion and range."""
    law = contact.interaction
    if law is None:
        raise InputError("law: the contact has no interaction; give it one, with a start for its work of adhesion")
    if law.name == name:
        return contact
    return replace(contact, interaction=INTERACTIONS[name](law.work_of_adhesion, law.range))


def _distinct(found: list[Minimum]) -> list[Minimum]:
    """Minima that differ."""
    kept: list[Minimum] = []
    for one in found:
        positive = [k for k, name in enumerate(one.problem.names) if name not in LINE]
        if all(np.abs(one.x[positive] - other.x[positive]).max(initial=0.0) > 0.05 for other in kept):
            kept.append(one)
    return kept
