"""Which model does a contact need? The errors of simpler ones are computed, not guessed: a trace tells the truth."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace

import numpy as np

from contbranch.api import checked, trace
from contbranch.contact.contact import Contact
from contbranch.contact.interactions import MaugisDugdale
from contbranch.contact.tips import Parabola
from contbranch.contact.units import finite_number
from contbranch.control import LOAD, Control, Spring, as_control
from contbranch.errors import InputError
from contbranch.models.choice import choose, on_grid
from contbranch.models.exact.model import Exact
from contbranch.results.advice import Advice, Candidate
from contbranch.results.diagram import Cost, Diagram, ModelChoice
from contbranch.theory import dmt, jkr, maugis
from contbranch.threads import one_thread
from contbranch.watch import patient

FINEST, COARSEST = 1e-13, 0.5
# The trace that tells the truth: a tenth of what is asked, within limits that keep it short, and seconds at most.
SHARE, COARSE, FINE, PATIENCE = 0.1, 1e-4, 1e-7, 2.0
# What the axisymmetric model reaches, and how its time grows with digits asked beyond those of the trace.
REACHES, DIGIT = 1e-11, 1.12

# A contact is near a limit whose pull-off load is off by less; a theory that is better than this is recommended.
NEAR, ENOUGH = 0.05, 0.01

# Contact radii, in reduced units, between which JKR's theory has its folds.
RADII = np.geomspace(1e-4, 1e2, 600)

LOST = ("pull_off", "jump_in", "squeeze_out", "wetting")

Thresholds = Mapping[str, float]
Judged = Mapping[str, tuple[float, float]]
# A theory's thresholds for a reduced contact under a control; None where it does not speak of it.
Theory = Callable[[Contact, Control], Thresholds | None]


@one_thread
def advise(contact: Contact, accuracy: float = 0.01, control: str | Spring = "load") -> Advice:
    """Say which model is enough to find the folds of a contact to an accuracy, and what the others would cost.

    The contact is traced by the axisymmetric (or the exact) model; the closed-form theories are evaluated and compared
    with that. Errors on grids follow from the spacing of the nodes, as measured.

    Parameters
    ----------
    contact : Contact
    accuracy : float
        Error allowed to the loads (displacements) of the folds, relative to max(1, |value|) in reduced units; 1e-13 to
        0.5.
    control : {"load", "displacement"} or Spring
        Whose folds are judged; for a spring those of both, between which its own lie.

    Raises
    ------
    InputError
        If an argument cannot be used.
    """
    accuracy = finite_number(accuracy, "accuracy")
    if not FINEST <= accuracy <= COARSEST:
        raise InputError(f"accuracy: {accuracy:g}; must be from {FINEST:g} to {COARSEST:g}")
    began, held = time.perf_counter(), as_control(control)
    model, why = choose(checked(contact))
    reduced = contact.to_reduced()
    truth = None
    if not on_grid(model):
        coarse = min(max(SHARE * accuracy, FINE), COARSE)
        for tolerance in (coarse, SHARE**2 * coarse):  # what coarse meshes cannot settle, finer ones may
            truth = trace(reduced, _kinds(held)[0], tolerance, modes=0, time_limit=PATIENCE)
            if truth.status == "complete" or truth.cost.wall_s > PATIENCE:
                break
    wanted: Judged = {} if truth is None else _judged(truth, held)
    with patient(PATIENCE):
        candidates = list(_grids(reduced, wanted, accuracy, truth))
    if truth is not None:
        candidates += _theories(reduced, wanted, held)
        candidates.append(_own(reduced, wanted, accuracy, truth))
    candidates.sort(key=lambda one: one.seconds)
    chosen, reason = _choice(candidates, accuracy, truth)
    note, unknowns, cost = (
        "The contact needs a grid: there is no cheap truth to judge theories by.",
        0,
        Cost(0.0, 0),
    )
    complete = truth is None or truth.status == "complete"
    if truth is not None:
        note = "" if wanted else f"Under {held.kind} control there is no fold to judge by."
        note = note if complete else f"The trace that judges the others: {truth.message}"
        unknowns, cost = truth.model.unknowns, truth.cost
    return Advice(
        contact=contact,
        tabor=contact.tabor,
        chosen=chosen,
        why=reason,
        thresholds=tuple(wanted),
        candidates=tuple(candidates),
        model=ModelChoice(model.name, why, unknowns),
        cost=replace(cost, wall_s=time.perf_counter() - began),
        accuracy=accuracy,
        control=held.kind,
        status="complete" if complete else "incomplete",
        message=note,
        unit_names=contact.units.names,
    )


def regime(contact: Contact, pull_off: float | None = None) -> str:
    """A sentence on the Tabor coefficient: what it means for this contact, by what the closed forms would give.

    Parameters
    ----------
    pull_off : float, optional
        Its pull-off load; without, that of the Maugis-Dugdale law of the same work and range is taken.
    """
    tabor, reduced = f"Tabor coefficient {contact.tabor:.4g}", contact.to_reduced()
    limits = {"JKR": _jkr(reduced, LOAD), "DMT": _dmt(reduced, LOAD)}
    known = {name: found["pull_off_load"] for name, found in limits.items() if found is not None}
    law = reduced.interaction
    if law is None or len(known) < len(limits):
        return f"{tabor}: adhesion (or repulsion) of this work deforms the body by about as many ranges."
    substitute = float(maugis.load_fold(work_of_adhesion=_work(reduced), interaction_range=law.range).load)
    truth = substitute if pull_off is None else pull_off / contact.scales.load
    if pull_off is not None and not isinstance(law, MaugisDugdale):
        known["Maugis-Dugdale"] = substitute
    errors = {name: abs(value / truth - 1.0) for name, value in known.items()}
    near = min(limits, key=errors.__getitem__)
    place = f"near {near}" if errors[near] < NEAR else "between DMT and JKR"
    listed = ", ".join(f"{name} {value:.2g}" for name, value in sorted(errors.items(), key=lambda item: item[1]))
    against = "of the pull-off load" if pull_off is not None else "of Maugis-Dugdale's pull-off load"
    said = f"{tabor}, {place}. Relative errors {against} by closed forms: {listed}."
    best = min(errors, key=errors.__getitem__)
    if pull_off is not None and errors[best] < ENOUGH:
        said += f" To 1 % {best} would do, in milliseconds (see advise)."
    return said


def _judged(diagram: Diagram, control: Control) -> dict[str, tuple[float, float]]:
    """Thresholds at which stability is lost under a control, with their errors, reduced units."""
    found = {}
    for name, value in diagram.thresholds.items():
        what, _, kind = name.rpartition("_")
        if what in LOST and kind in _kinds(control):
            errors = (e.error[kind] for e in diagram.events if getattr(e, kind) == value)
            found[name] = (float(value), float(next(errors, diagram.accuracy)))
    return found


def _kinds(control: Control) -> tuple[str, ...]:
    """What is judged: for a spring the folds of both controls, between which its own lie."""
    return ("load", "displacement") if control.kind == "spring" else (control.kind,)


def _errors(found: Thresholds, wanted: Judged) -> dict[str, float | None]:
    """Errors of what a candidate finds; None for what it lacks, and for what it has and the contact has not."""
    errors: dict[str, float | None] = dict.fromkeys([*wanted, *found])
    for name in wanted.keys() & found.keys():
        value, error = wanted[name]
        errors[name] = (abs(found[name] - value) + error) / max(1.0, abs(value))
    return errors


def _work(contact: Contact) -> float:
    """The net work of adhesion on a half space; 0 on a layered body, of which the theories know nothing."""
    return 0.0 if contact.interaction is None or contact.body is not None else contact.interaction.net_adhesion


def _hertz(contact: Contact, _: Control) -> Thresholds | None:
    return {} if contact.interaction is None and contact.body is None else None


def _dmt(contact: Contact, _: Control) -> Thresholds | None:
    if not isinstance(contact.tip, Parabola) or _work(contact) <= 0.0:
        return None
    return {"pull_off_load": float(dmt.pull_off_load(radius=contact.tip.radius, work_of_adhesion=_work(contact)))}


def _jkr(contact: Contact, _: Control) -> Thresholds | None:
    tip, work = contact.tip.axisymmetric, _work(contact)
    if tip is None or work <= 0.0:
        return None
    radii = RADII[tip.extent > RADII]
    loads, displacements = (jkr.folds(tip, radii, kind, work_of_adhesion=work) for kind in ("load", "displacement"))
    if not (loads and displacements):
        return None
    # Without range nothing is felt before the surfaces meet.
    return {
        "pull_off_load": min(float(fold.load) for fold in loads),
        "pull_off_displacement": min(float(fold.displacement) for fold in displacements),
        "jump_in_displacement": 0.0,
    }


def _maugis(contact: Contact, control: Control) -> Thresholds | None:
    """The Maugis-Dugdale law of the same work and range."""
    work, law = _work(contact), contact.interaction
    if law is None or work <= 0.0 or not isinstance(contact.tip, Parabola) or isinstance(law, MaugisDugdale):
        return None
    other = replace(contact, interaction=MaugisDugdale(work, law.range))
    found = trace(other, _kinds(control)[0], 1e-9, model="exact", modes=0)
    return {name: value for name, (value, _) in _judged(found, control).items()}


_THEORIES: dict[str, tuple[Theory, str]] = {
    "hertz": (_hertz, "Without interaction there are no folds."),
    "dmt": (_dmt, "The limit of an interaction of long range on a stiff solid."),
    "jkr": (_jkr, "The limit of an interaction of short range on a soft solid."),
    "maugis-dugdale": (
        _maugis,
        "In place of the law: constant attraction of the same work and range, in closed form.",
    ),
}


def _theories(contact: Contact, wanted: Judged, control: Control) -> Iterator[Candidate]:
    for name, (theory, why) in _THEORIES.items():
        began = time.thread_time()
        values = theory(contact, control)
        seconds = time.thread_time() - began
        if values is not None:
            spoken = {name: value for name, value in values.items() if name.rpartition("_")[2] in _kinds(control)}
            yield Candidate(name, _errors(spoken, wanted), seconds, why)


def _own(contact: Contact, wanted: Judged, accuracy: float, truth: Diagram) -> Candidate:
    """The model that traced the contact, with the errors that its trace estimates, or those asked for if less."""
    errors: dict[str, float | None] = {name: error / max(1.0, abs(value)) for name, (value, error) in wanted.items()}
    if truth.model.kind == Exact.name:
        return Candidate("exact", errors, truth.cost.wall_s, "The law itself, in closed form.")
    rings = any(event.kind == "topology" for event in truth.events)
    digits = max(0.0, math.log10(truth.accuracy / max(accuracy, REACHES)))
    why = f"The law itself, as traced to {truth.accuracy:g}; accuracies down to {REACHES:g} are for the asking."
    errors = {name: min(error or 0.0, max(accuracy, REACHES)) for name, error in errors.items()}
    seconds = truth.cost.wall_s * DIGIT**digits
    return Candidate("rings" if rings else "axisymmetric", errors, seconds, why)


def _grids(contact: Contact, wanted: Judged, accuracy: float, truth: Diagram | None) -> Iterator[Candidate]:
    """Grids of the size that they would choose for themselves."""
    from contbranch.models.grid.size import COARSE_ERROR, ORDER, chosen_size, expected_seconds

    depth = (
        None
        if truth is None
        else max([1.0, *(float(branch.displacement.max(initial=1.0)) for branch in truth.branches)])
    )
    length = 1.0 if contact.interaction is None else contact.interaction.range
    for kind in ("free", "periodic"):
        try:
            cell, grid = chosen_size(contact, kind, (None, None), (None, None), accuracy, depth)
        except InputError:
            continue
        error = COARSE_ERROR * (cell / grid / length) ** ORDER
        seconds = expected_seconds(grid)
        why = f"{grid} nodes a side in a cell of {cell:.3g} (reduced): errors as measured for that spacing."
        yield Candidate(kind, dict.fromkeys(wanted, error), seconds, why)


def _choice(candidates: list[Candidate], accuracy: float, truth: Diagram | None) -> tuple[str, str]:
    """The cheapest that is accurate enough; of none, the most accurate one."""
    if truth is not None and truth.status != "complete":
        own = next(one.model for one in candidates if one.model in ("exact", "axisymmetric", "rings"))
        return own, f"What the others are worth is not known: the trace took more than {PATIENCE:g} s, or did not end."
    enough = [one for one in candidates if one.worst is not None and one.worst <= accuracy]
    if enough:
        best = enough[0]
        largest = f"largest {best.worst:.2g}" if best.errors else "none is judged"
        return best.model, f"The cheapest with errors up to {accuracy:g} ({largest})."
    best = min((one for one in candidates if one.worst is not None), key=lambda one: one.worst or 0.0)
    return best.model, f"None has errors below {accuracy:g}; this one has the smallest (largest {best.worst:.2g})."
