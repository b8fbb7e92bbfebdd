"""`fit`: a contact fitted to a measured force curve, jumps included, by any of several laws."""

from __future__ import annotations

import math
import warnings
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from time import perf_counter

import numpy as np

from contbranch.contact.contact import Contact
from contbranch.contact.interaction_law import terms_of
from contbranch.contact.interactions import INTERACTIONS
from contbranch.contact.parameters import parameters_of
from contbranch.contact.tips import Parabola
from contbranch.contact.units import Quantity, parse, positive_number
from contbranch.errors import InputError, ModelError, look_up
from contbranch.measure.comparison import Comparison
from contbranch.measure.conclusions import apart, concluded
from contbranch.measure.features import SEEN, SIGNIFICANT, NoAdhesionError
from contbranch.measure.force_curve import LEAST, ForceCurve
from contbranch.measure.minimum import LONG, MISFIT, Minimiser, Minimum, correlation_length, loss, moved
from contbranch.measure.quantities import INSTRUMENT, LINEAR, NARROW, Problem, State
from contbranch.measure.reduced import LIMITS, tabulated
from contbranch.measure.starts import WITHIN, guessed, scanned, starts
from contbranch.results.fit import Fit, LawFit
from contbranch.threads import one_thread
from contbranch.watch import INTERRUPTIONS, Progress, caught, finishing, over, part, tell, told, watched

# Laws that are compared.
COMPARED = ("maugis-dugdale", "exponential", "van-der-waals", *LIMITS)
# Evaluations that starts which are tried may take, and those of the last fit.
TRIED, MOST = 15, 120
# Starts that are followed to their end: the best ones.
BEST = 2
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
# Times that samples in a range of force or indentation are chosen anew.
CHOSEN = 4
LEGS, BASELINES = ("auto", "approach", "retract", "both"), ("auto", "one", "each")


@one_thread
def fit(
    curve: ForceCurve,
    contact: Contact,
    free: Sequence[str] = ("work_of_adhesion", "modulus"),
    *,
    fixed: Sequence[str] = (),
    spring: Quantity = None,
    law: str | None = None,
    leg: str = "auto",
    baseline: str = "auto",
    max_indentation: Quantity = None,
    max_force: Quantity = None,
    min_force: Quantity = None,
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
    leg : {"auto", "approach", "retract", "both"}
        What is fitted. ``"auto"``: both legs at once where one contact explains both; otherwise each by itself, and the
        modulus is the approach's, the work of adhesion the retraction's.
    baseline : {"auto", "one", "each"}
        Whether both legs have one baseline and tilt, or each its own, as drag and drift need; ``"auto"``: each its own
        where that explains more.
    max_indentation, max_force, min_force : float or str, optional
        Samples with a larger indentation (nm), or a force above the baseline (nN) outside this range, are left out;
        what is without contact stays.
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
        if law in LIMITS and "range" in named(free):
            raise InputError(f"free: range; the limit {law} has none, leave it out")
        if law in (*LIMITS, "compare") and contact.interaction and work <= 0:
            raise InputError(f"law: {law}; is for attraction, and the work of adhesion is {work:g}")
        limits = {"max_indentation": max_indentation, "max_force": max_force, "min_force": min_force}
        ranges: dict[str, float] = {}
        for name, value in limits.items():
            if value is not None:
                number = parse(value, "length" if name == "max_indentation" else "force", name)
                ranges[name] = number if name == "min_force" else positive_number(number, name)
        settings = Settings(curve.with_spring(spring), contact, named(free), named(fixed), law, baseline, ranges)
        look_up(leg, dict.fromkeys(LEGS), "leg")
        look_up(baseline, dict.fromkeys(BASELINES), "baseline")
        try:
            found = _of_legs(settings, leg)
        except INTERRUPTIONS as error:
            caught(error)
            raise ModelError(told("fit: no contact was compared with the curve by then.")) from None
        if (held := int(curve.pause.sum())) > LEAST:
            found = replace(found, message=f"The pause of {held} samples is left out. {found.message}")
        found = replace(found, message=told(found.message), cost=replace(found.cost, wall_s=perf_counter() - began))
    return watch.passed(found)


@dataclass(frozen=True)
class Settings:
    """What is asked of a fit: as the arguments of `fit`."""

    curve: ForceCurve
    contact: Contact
    free: tuple[str, ...]
    fixed: tuple[str, ...]
    law: str | None
    baseline: str
    ranges: dict[str, float]

    def bare(self) -> Settings:
        """The same without adhesion."""
        contact = replace(self.contact, interaction=None)
        possible = parameters_of(contact)
        kept = tuple(name for name in self.free if name in possible or name in INSTRUMENT)
        return replace(self, contact=contact, free=kept, law=None)


def _of_legs(settings: Settings, leg: str) -> Fit:
    """The legs fitted at once, or each by itself."""
    present = [back for back in (False, True) if settings.curve.leg(back).size >= LEAST]
    legs = {"approach": [False], "retract": [True]}.get(leg, present)
    if not set(legs) <= set(present) or (leg == "both" and len(legs) < 2):
        raise InputError(f"leg: {leg}; the curve has no {'approach' if True in present else 'retraction'}")
    if len(legs) == 1 or settings.law == "compare":
        return _fitted(settings, legs, settings.baseline == "each").concluded()
    joint = _fitted(settings, legs, settings.baseline == "each")
    if settings.baseline == "auto" and not joint.explains():
        other = _fitted(settings, legs, each=True)
        if other.explains() or MISFIT * other.found.rms < joint.found.rms:
            joint = other
    if joint.explains() or over():
        return joint.concluded()
    alone = [_alone(settings, back) for back in legs]
    single = [one.concluded() for one in alone]
    together = joint.concluded(single)
    if leg == "both" or all(joint.left(back) < MISFIT * one.left() for back, one in zip(legs, alone, strict=True)):
        return together
    separate = apart(*single)
    known = [{*found.determined} & {*settings.free} for found in (separate, together)]
    return together if known[0] < known[1] else separate


def _fitted(settings: Settings, legs: Sequence[bool], each: bool = False) -> _Fitting:
    """Legs at once; without what seems to be at the end of a detector, where that explains more."""
    found = _Fitting(settings, legs, each)
    if not found.minimiser.seen.suspected or settings.law == "compare" or found.explains():
        return found
    other = _Fitting(settings, legs, each, suspect=True)
    return other if other.explains() or MISFIT * other.left() < found.left() else found


def _alone(settings: Settings, back: bool) -> _Fitting:
    """A leg by itself; without adhesion where it shows none."""
    try:
        return _fitted(settings, [back])
    except NoAdhesionError:
        bare = _fitted(settings.bare(), [back])
        words = "This leg shows no adhesion, and is fitted by the theory of a contact without (Hertz', Sneddon's)."
        seen = bare.minimiser.seen
        bare.minimiser.seen = replace(seen, notes=(words, *seen.notes), adhesion=SEEN * seen.noise)  # what hides in it
        return bare


def named(free: Sequence[str]) -> tuple[str, ...]:
    """Names, also those of one text with commas."""
    return tuple(filter(None, (name.strip() for name in (free.split(",") if isinstance(free, str) else free))))


class _Fitting:
    """A contact that is fitted to legs of a curve.

    Attributes
    ----------
    found : Minimum
    """

    def __init__(self, settings: Settings, legs: Sequence[bool], each: bool, suspect: bool = False) -> None:
        self.contact, self.free, self.each, self.settings = settings.contact, settings.free, each, settings
        work = sum(term.work_of_adhesion for term in terms_of(settings.contact.interaction))
        self.minimiser = minimiser = Minimiser(settings.curve, work > 0, legs, suspect)
        self.fixed = settings.fixed
        slope, error = minimiser.slope
        calibrated = not {"spring", "sensitivity"} & set(self.free)
        if slope - 4 * error > STIFFER * minimiser.stiffness * (1.0 if calibrated else NARROW):
            raise InputError(
                f"curve: pressed most, the force rises by {slope:.3g} nN/nm, and no contact is stiffer than its spring "
                f"of {minimiser.stiffness:.3g} nN/nm; is a unit wrong, the stiffness or (then free it) the sensitivity?"
            )
        if settings.law != "compare":
            self.found = self._within(self.law(settings.law), settings.ranges)

    def explains(self) -> bool:
        """Whether no more is left than the noise, in all and anywhere, nothing varies slowly, and jumps are met."""
        found, noise = self.found, self.minimiser.seen.noise
        placed = np.abs(found.places).max(initial=0.0) <= SIGNIFICANT
        return bool(placed) and found.rms <= MISFIT * noise and found.worst <= LONG and found.deviation <= LONG * noise

    def left(self, *legs: bool) -> float:
        """Root mean square of what is left of the force in contact."""
        return self.minimiser.misfit(self.found, *legs)[0]

    def concluded(self, alone: Sequence[Fit] = ()) -> Fit:
        """The result; its errors allow for what legs fitted each by itself determine."""
        if self.settings.law == "compare":
            return self.compared()
        halved = {} if self.explains() or over() else self._halved()
        return concluded(self.minimiser, self.profiled(self.found), alone, halved)

    def law(self, name: str | None) -> Minimum:
        """The fit with a law, by name; None for the contact's own."""
        contact, limit = self.contact, name if name in LIMITS else ""
        if name is not None:
            known = (law for law in INTERACTIONS if law not in ("tabulated", "double-layer"))
            look_up(name, dict.fromkeys((*known, *LIMITS, "compare")), "law")
            contact = _with_law(contact, "maugis-dugdale" if limit else name)
        if limit == "dmt" and (contact.body is not None or not isinstance(contact.tip, Parabola)):
            raise InputError("law: dmt; is for a parabola on a half space, jkr for every axisymmetric tip and layers")
        samples = np.sort(self.minimiser.samples.samples)
        middle = float(np.mean(self.minimiser.curve.piezo[samples[: max(3, samples.size // 10)]]))
        start = State(contact, self.minimiser.stiffness)
        problem = Problem.of(start, self.free, self.fixed, limit, middle, self.each)
        if contact.interaction is None and not {"radius", *INSTRUMENT} & set(self.free):
            return self._from_scan(problem)
        return self._followed(replace(problem, guess=guessed(self.minimiser, problem)))

    def _from_scan(self, problem: Problem) -> Minimum:
        """The best minimum of a contact without an interaction: those that a scan of the contact point leads to."""
        noise, found = self.minimiser.seen.noise, []
        for state in scanned(self.minimiser, problem)[:BEST]:
            one = replace(problem, guess=state)
            found.append(self.minimiser.minimised(one, one.vector(state), self.minimiser.samples, (noise, MOST)))
        if not found:
            raise InputError(
                "curve: no modulus fits: the force rises nowhere, or as steeply as the spring; there is no contact "
                "in it, or one that is too stiff for this cantilever"
            )
        return self._weighted(found)

    def _within(self, found: Minimum, ranges: Mapping[str, float]) -> Minimum:
        """The minimum with the samples in ranges of force and indentation, which are chosen again as it moves."""
        curve, kept = self.minimiser.curve, self.minimiser.seen.used
        for _ in range(CHOSEN if ranges else 0):
            state = found.problem.state(found.x)
            force = curve.force - state.baseline(curve.piezo, curve.retract)
            depth = curve.piezo - force / self.minimiser.gain(state) / state.spring - state.line[0]
            inside = force <= ranges.get("max_force", math.inf)
            least = ranges.get("min_force", -math.inf)
            inside &= (force >= least) | ((depth < 0.0) & (least > 0.0))  # what is without contact stays
            inside &= depth <= ranges.get("max_indentation", math.inf)
            inside &= self.minimiser.seen.used
            if np.array_equal(inside, kept):
                break
            kept = inside
            if (pressed := int((kept & (depth > 0.0)).sum())) < LEAST:
                name, value = next(iter(ranges.items()))
                raise InputError(f"{name}: {value:g}; leaves {pressed} samples in contact; must be at least {LEAST}")
            self.minimiser.samples = Comparison.of(curve, self.minimiser.seen, kept)
            again = self.minimiser.minimised(found.problem, found.x, self.minimiser.samples, (found.noise, MOST))
            found = self._weighted([again])
        return found

    def _halved(self) -> dict[str, float]:
        """The values where only forces up to half of the largest are fitted; none where they cannot be had."""
        samples, half = self.minimiser.samples, 0.5 * self.minimiser.seen.largest
        try:
            found = self._within(self.found, self.settings.ranges | {"max_force": half})
        except InputError:
            return {}
        finally:
            self.minimiser.samples = samples
        return found.problem.values(found.x)

    def compared(self) -> Fit:
        """The best of several laws, by Bayesian information criteria; residuals that are correlated are worth fewer."""
        if not tabulated(_with_law(self.contact, "exponential")):
            raise InputError("law: compare; is for a parabola")
        found: dict[str, Minimum] = {}
        for k, name in enumerate(COMPARED):
            with part(k / len(COMPARED), (k + 1) / len(COMPARED)):
                one = self.law(name)  # the samples in the ranges are those of the first law
                found[name] = self.profiled(one if found else self._within(one, self.settings.ranges))
            if over():
                break
        noise, count = self.minimiser.seen.noise, self.minimiser.samples.samples.size
        losses = {name: loss(np.append(one.forces / noise, one.places)) for name, one in found.items()}
        close = found[min(losses, key=losses.__getitem__)]
        misfit = max(1.0, min(losses.values()) / count)
        length = correlation_length(close.forces) if misfit > MISFIT**2 else 1.0
        penalty = math.log(max(count / length, 8.0))
        scores = {name: losses[name] / (misfit * length) + one.x.size * penalty for name, one in found.items()}
        best, *others = sorted(scores, key=scores.__getitem__)
        fits = [LawFit(name, found[name].rms, scores[name] - scores[best], found[name].problem.values(found[name].x))
                for name in (best, *others)]  # fmt: skip
        near = " and ".join(one.law for one in fits[1:] if one.criterion < EXCLUDED)
        words = f"the curve does not exclude {near}" if near else "the others are excluded by it"
        result = concluded(self.minimiser, found[best])
        return replace(
            result, laws=tuple(fits), message=f"Of the laws compared {best} fits best; {words}. {result.message}"
        )

    def _followed(self, problem: Problem) -> Minimum:
        """The best minimum: starts tried roughly, the best of them followed to the end."""
        minimiser, noise, tried = self.minimiser, self.minimiser.seen.noise, list[Minimum]()
        failure: Exception | None = None
        rough = max(noise, 0.02 * max(abs(minimiser.seen.lowest), minimiser.seen.largest * 0.1))
        pilot = problem
        if problem.by_tabor and not problem.limit:  # Maugis' closed form leads close enough
            pilot = problem.with_law(_with_law(problem.start.contact, "maugis-dugdale"))
        for k, x in enumerate(starts(minimiser, pilot)):
            if over() and tried:
                break
            try:
                tell(0.1 * k, f"start {k + 1}")
                tried.append(minimiser.minimised(pilot, x, minimiser.samples, (rough, TRIED)))
            except (ModelError, InputError, FloatingPointError) as error:
                failure = error
            except INTERRUPTIONS as error:
                caught(error)
                with finishing(), suppress(ModelError):  # the start itself is there then
                    tried.append(minimiser.minimised(pilot, x, minimiser.samples, (rough, 1)))
        if not tried:
            raise ModelError(told(f"fit: the contact cannot be traced near the curve. {failure or ''}".strip()))
        tried.sort(key=lambda one: one.cost)
        found: list[Minimum] = []
        for one in _distinct([one for one in tried if one.cost <= WITHIN * tried[0].cost + TOLD])[:BEST]:
            worse = (one.cost - tried[0].cost) * (rough / noise) ** 2 > 4 * TOLD
            if found and (over() or (worse and found[0].rms < MISFIT * noise)):  # one start has led to a fit
                break
            try:
                one = minimiser.minimised(problem, one.x, minimiser.samples, (max(noise, 0.2 * rough), TRIED))
                for evaluations in (TRIED, MOST):  # each time with jumps where the last one puts them
                    one = minimiser.minimised(problem, one.x, minimiser.labelled(one), (noise, evaluations))
            except ModelError:
                if not over():
                    raise
                one = replace(one, converged=False)  # the curve that leads close enough is all there is
            found.append(one)
        return self._weighted(found)

    def _weighted(self, found: Sequence[Minimum]) -> Minimum:
        """The best of minima, with weights that residuals which are no white noise deserve."""
        best = min(found, key=lambda one: one.cost)
        others = tuple(one.x for one in _distinct([best, *found])[1:] if one.cost < best.cost + TOLD)
        spread = best.deviation
        if spread > MISFIT * best.spread:
            best = self.minimiser.minimised(best.problem, best.x, best.comparison, (spread, MOST))
        return replace(best, others=others) if others else best

    def profiled(self, found: Minimum) -> Minimum:
        """The minimum with what else fits as well: minima with an unknown held elsewhere that the data hardly tell."""
        low, high = found.problem.bounds()
        errors, near, count = found.errors, [], found.comparison.samples.size
        poor = found.cost > count + POOR * math.sqrt(2.0 * count)
        for k, name in enumerate(found.problem.names):
            if name in LINEAR or errors[k] < SHARP:
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
        return replace(found, near=tuple(near)) if near else found


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
        positive = [k for k, name in enumerate(one.problem.names) if name not in LINEAR]
        if all(np.abs(one.x[positive] - other.x[positive]).max(initial=0.0) > 0.05 for other in kept):
            kept.append(one)
    return kept
