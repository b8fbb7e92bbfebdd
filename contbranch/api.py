"""`trace`, `solve`, `find_all` and `hysteresis`: from a contact to its results, whatever the model."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Sequence
from contextlib import AbstractContextManager
from dataclasses import dataclass, fields, replace
from functools import partial
from numbers import Integral
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np

from contbranch.contact.contact import Contact
from contbranch.contact.family import Vary, family_of, value_of
from contbranch.contact.law_check import check_laws
from contbranch.contact.units import Quantity, accuracy_of, positive_number
from contbranch.contact.validity import notes
from contbranch.control import DISPLACEMENT, LOAD, Control, Spring, as_control
from contbranch.curve.curves import Coexisting, FollowedCurves, Model, Route
from contbranch.curve.loop import loop
from contbranch.curve.outcome import RawCurve, assemble, no_curve, state_in_reduced, state_in_units
from contbranch.curve.trace import Request
from contbranch.errors import InputError, ModelError, look_up, number_of
from contbranch.models.choice import choose, curves
from contbranch.results.diagram import Branch, Cost, Diagram, ModelChoice, Solution, State
from contbranch.results.equilibria import Barrier, Equilibria
from contbranch.results.loop import Hysteresis
from contbranch.results.record import OBSERVABLES, Values
from contbranch.threads import one_thread
from contbranch.watch import Progress, Watch, kept, of_users, over, told, watched

if TYPE_CHECKING:
    from contbranch.results.phase import PhaseDiagram


Answer = TypeVar("Answer", RawCurve, Coexisting, Route)

BEYOND = "its parameters lead to numbers that cannot be computed with"
# What an interrupted search has found before it has found anything.
UNKNOWN = State(*(math.nan,) * 5, 0, 0, math.nan)


@one_thread
def trace(
    contact: Contact,
    control: str | Spring = "load",
    accuracy: float = 1e-6,
    max_load: Quantity = None,
    model: str | Model = "auto",
    progress: Progress | None = None,
    modes: int = 32,
    time_limit: float | None = None,
) -> Diagram:
    """Trace the whole curve of equilibria of a contact, stable and unstable, and locate its events.

    Parameters
    ----------
    contact : Contact
    control : {"load", "displacement"} or Spring
        The control whose stability plots speak of. Folds of load and displacement are reported always, those of a
        spring besides.
    accuracy : float
        Error allowed to every event and threshold, relative to max(1, |value|) in reduced units; 1e-13 to 1e-2.
    max_load : float, optional
        Load (in the contact's units, or a text such as ``"100 nN"``) at which the curve ends; default: in contact, at
        1.4 times the largest load of any event, and at least 10 in reduced units.
    model : str or model object
        ``"auto"``, ``"exact"``, ``"axisymmetric"``, ``"periodic"``, ``"free"``, or an object such as ``cb.Exact()`` or
        ``cb.Periodic(cell=10.0, grid=256)``. ``"auto"`` takes a grid only for tips without axial symmetry. Any object
        with a ``name`` and a method ``problem(contact, accuracy)`` that returns an `EquilibriumProblem` will do.
    progress : callable, optional
        Called as ``progress(fraction, text)`` now and then, several times a second. Where it raises `Stop`, the trace
        ends, and what was traced is returned; whatever else it raises is passed on, with what was traced as its
        attribute ``partial``, and so is KeyboardInterrupt.
    modes : int
        Azimuthal modes cos mθ are examined from m = 1 up to here at most, fewer where the rest is known to be stable;
        0: none, and no ``unstable_azimuthal``. On a grid all of them are, if any.
    time_limit : float, optional
        Seconds after which the trace ends with what it has.

    Returns
    -------
    Diagram
        With status ``incomplete`` and a message where the curve could not be followed to its end; what was traced is
        kept. Of an interrupted trace the rows are as good as ever; events that had not been made precise yet are where
        the rows have them, with an estimate of that error, and rows have none.

    Raises
    ------
    InputError
        If an argument cannot be used.
    """
    if not isinstance(modes, int) or modes < 0:
        raise InputError(f"modes: {modes!r}; must be a whole number, zero or greater")
    with _watched(progress, time_limit) as watch:
        asked = _ask(contact, control, accuracy, model)
        request = replace(asked.request, target=_limit(contact, max_load), modes=modes)
        raw = asked.answer(partial(asked.curves.trace, request), no_curve())
        asked.refuse_below(request, raw)
        message = asked.noted(raw.message, raw.branch)
        raw = replace(raw, cost=asked.timed(raw.cost), message=message)
        diagram = assemble(contact, raw, asked.choice(raw.unknowns), asked.control, accuracy)
    return watch.passed(diagram)


@one_thread
def solve(
    contact: Contact,
    *,
    load: Quantity = None,
    displacement: Quantity = None,
    contact_radius: Quantity = None,
    mean_gap: Quantity = None,
    near: State | None = None,
    control: str | Spring | None = None,
    accuracy: float = 1e-6,
    model: str | Model = "auto",
    progress: Progress | None = None,
    time_limit: float | None = None,
) -> Solution:
    """Find the equilibrium at a load, displacement, contact radius or mean gap (one of them, in the contact's units).

    Where several exist, the stable one that is lowest in energy − F d (load) or in energy (displacement) is returned,
    or the one closest to `near`; all of them are in ``solution.states``.

    Parameters
    ----------
    mean_gap : float, optional
        Mean gap of a periodic cell, which a grid can hold.
    near : State, optional
        A state whose nearest relative is wanted instead of the lowest. On a grid a state of the same grid is the start.
    control : {"load", "displacement"} or Spring, optional
        Whose stability counts; by default that of the quantity given (load for a contact radius).
    accuracy : float
        Error allowed to every number, relative to max(1, |value|) in reduced units; where more is left open, as of what
        is next to a fold or to first touch, the errors and the message say so.
    progress, time_limit
        As in `trace`. Where an interrupted search has found no equilibrium yet, the numbers are NaN.

    Raises
    ------
    InputError
        If the value cannot be reached; the message says which ones can.
    ModelError
        If the computation failed.
    """
    known = {"load": load, "displacement": displacement, "contact_radius": contact_radius, "mean_gap": mean_gap}
    field, value = _only(contact, **known)
    if near is not None and not isinstance(near, State):
        raise InputError(f"near: {type(near).__name__}; must be a State, such as a solution or a branch's state")
    held = control or ("displacement" if field in ("displacement", "mean_gap") else "load")
    with _watched(progress, time_limit) as watch:
        asked = _ask(contact, held, accuracy, model)
        unit = contact.scales.of_fields[field]
        start = None if near is None else state_in_reduced(contact, near)
        found = asked.answer(partial(asked.curves.solve, asked.request, field, value / unit, start), Coexisting())
        if not found.states and not over():
            raise InputError(f"{field}: {value:g} cannot be reached; {_reachable(found, field, unit, accuracy)}")
        states = tuple(state_in_units(contact, state) for state in found.states)
        solution = _solution(asked, found, states, field, near)
    return watch.passed(solution)


def _solution(asked: _Asked, found: Coexisting, states: tuple[State, ...], field: str, near: State | None) -> Solution:
    """The best of the states found, or the one closest to another."""
    count, stable = len(states), sum(state.stable(asked.control) for state in states)
    known = number_of(count, "equilibrium", "equilibria")
    message = found.message or f"{known} on the curve, {stable} stable under {asked.control.kind} control."
    if states and not stable:
        message += " None is stable" + ("; the lowest one is returned." if near is None else ".")
    best = UNKNOWN if not states else _lowest(states, asked.control, field)
    if near is not None:
        best = min(states, key=lambda one: _apart(one, near), default=UNKNOWN)
    listed = (best, *(state for state in states if state is not best))[: len(states)]
    return _as_solution(best, states=listed, **asked.about(found, message), **asked.held())


@one_thread
def find_all(
    contact: Contact,
    *,
    load: Quantity = None,
    displacement: Quantity = None,
    window: tuple[float, float] | None = None,
    control: str | Spring | None = None,
    accuracy: float = 1e-6,
    model: str | Model = "auto",
    progress: Progress | None = None,
    time_limit: float | None = None,
) -> Equilibria:
    """Find every equilibrium at a load or a displacement: on the traced curve, and by deflation what is not on it.

    Deflated Newton's method starts from states all along the curve and from undeformed ones. No finite search can prove
    that there is nothing else; the message says what was done.

    Parameters
    ----------
    contact : Contact
    load, displacement : float
        Exactly one of them, in the contact's units.
    window : (float, float), optional
        Displacements between which equilibria are looked for; default: the traced range and the displacement asked for.
    control : {"load", "displacement"} or Spring, optional
        Whose stability counts; by default that of the quantity given.
    accuracy, model, progress, time_limit
        As in `solve`.

    Returns
    -------
    Equilibria
        Without states if there are none in the window.

    Raises
    ------
    InputError
        If an argument cannot be used.
    """
    field, value = _only(contact, load=load, displacement=displacement)
    inside = None if window is None else _window(contact, window)
    with _watched(progress, time_limit) as watch:
        asked = _ask(contact, control or field, accuracy, model)
        search = partial(asked.curves.find_all, asked.request, field, value / contact.scales.of_fields[field], inside)
        found = asked.answer(search, Coexisting())
        equilibria = _found(asked, found, field, value)
    return watch.passed(equilibria)


def _lowest_barrier(number: int, barriers: Sequence[Barrier]) -> float | None:
    """The lowest barrier of a state; None without any, as of unstable ones."""
    own = [height for one in barriers for k, height in zip(one.stable, one.heights, strict=True) if k == number]
    return min((height for height in own if height is not None), default=None)


def _found(asked: _Asked, found: Coexisting, field: str, value: float) -> Equilibria:
    """The states found, in the contact's units."""
    normal = asked.contact.scales.normal
    states = tuple(state_in_units(asked.contact, state) for state in found.states)
    stable = sum(state.stable(asked.control) for state in states)
    known = number_of(len(states), "equilibrium", "equilibria") + " found so far" * over()
    words = f"{known} in the window, {stable} stable under {asked.control.kind} control"
    barriers: tuple[Barrier, ...] = ()
    if asked.control.kind == field:
        barriers = _barriers(states, found.connected, asked.control, value if field == "load" else math.inf)
        states = tuple(replace(state, barrier=_lowest_barrier(k, barriers)) for k, state in enumerate(states))
    return Equilibria(
        states=states,
        connected=found.connected,
        barriers=barriers,
        window=(found.window[0] * normal, found.window[1] * normal),
        **asked.held(),
        **asked.about(found, f"{words}; {found.searched}. {found.message}".strip()),
    )


def best_of(found: Equilibria, field: str) -> Solution:
    """The best of all equilibria at a load or displacement as `solve` chooses it, with all of them along the curve.

    Raises
    ------
    InputError
        If there is none.
    """
    if not found.states and found.status == "complete":
        low, high = found.window
        raise InputError(f"load, displacement: no equilibrium there with a displacement from {low:.6g} to {high:.6g}")
    held = as_control(found.control if found.stiffness is None else Spring(found.stiffness))
    best = _lowest(found.states, held, field) if found.states else UNKNOWN
    names = ("model", "cost", "status", "message", "states", "contact", "control", "stiffness", "accuracy")
    return _as_solution(best, **{name: getattr(found, name) for name in names})


def _as_solution(state: State, **told: Any) -> Solution:
    """A state as a solution."""
    return Solution(**{item.name: getattr(state, item.name) for item in fields(State)}, **told)


@one_thread
def hysteresis(
    contact: Contact,
    control: str | Spring = "load",
    accuracy: float = 1e-6,
    max_load: Quantity = None,
    model: str | Model = "auto",
    progress: Progress | None = None,
    time_limit: float | None = None,
    *,
    method: str = "curve",
    steps: int = 60,
    file: str | Path | None = None,
) -> Hysteresis:
    """Follow the quasi-static loop of a contact: the control is raised, then lowered, with a jump at every fold.

    After a jump the system is where overdamped relaxation from the fold ends. Where the contact set is no disc, the
    relaxation is not followed: the system is then in the next stable state along the curve that is lower than the fold,
    and the message says so unless the saddles along the curve are too high for any other. Energies are those of contact
    and drive: V − F d under load, V under displacement control, V + K (D − d)²/2 with a spring.

    Parameters
    ----------
    contact : Contact
    control : {"load", "displacement"} or Spring
    accuracy : float
        Error allowed to jumps and dissipated energies, relative to max(1, |value|) in reduced units.
    max_load : float, optional
        Load, in contact, at which the path turns round; default as in `trace`, and far enough for every jump.
    model, progress, time_limit
        As in `trace`.
    method : {"curve", "relaxation"}
        Whether the curve is traced, or the control goes up and down in `steps`, each relaxed to the next stable state:
        on grids only, for height maps with more jumps than a curve is worth being followed through. Jumps then lie
        within a step, as the errors of what they dissipate say. `max_load` has to be given.
    steps : int
        Of relaxation, up to `max_load` and as many down again.
    file : path, optional
        HDF5 file in which relaxation keeps its states: ``rows``, with the names of the columns as an attribute, and
        ``gap`` (states, nodes along x, nodes along y), in reduced units. A cycle that was interrupted goes on from it.

    Returns
    -------
    Hysteresis
        With `dissipated` None, and a message, where the loop does not close.

    Raises
    ------
    InputError
        If an argument cannot be used.
    ModelError
        If the relaxation after a jump cannot be followed.
    """
    with _watched(progress, time_limit) as watch:
        asked = _ask(contact, control, accuracy, model)
        request = replace(asked.request, target=_limit(contact, max_load))
        if look_up(method, {"curve": False, "relaxation": True}, "method"):
            found = _relaxed(asked, request, steps, file)
            return watch.passed(replace(found, cost=asked.timed(found.cost), model=asked.choice(found.model.unknowns)))
        if file is not None:
            raise InputError("file: only relaxation keeps its states in one; give method='relaxation', or leave it out")
        route = asked.answer(partial(asked.curves.path, request), Route())
        curve = route.curve
        asked.refuse_below(request, curve)
        route = replace(route, message=asked.noted(route.message, curve.branch))
        found = loop(contact, route, asked.control, asked.choice(curve.unknowns), asked.timed(curve.cost))
    return watch.passed(found)


def _relaxed(asked: _Asked, request: Request, steps: int, file: str | Path | None) -> Hysteresis:
    """A loop by relaxation on a grid."""
    if request.target is None:
        raise InputError("max_load: missing; relaxation needs the load at which the path turns round")
    if isinstance(steps, bool) or not isinstance(steps, Integral) or steps < 2:
        raise InputError(f"steps: {steps!r}; must be a whole number of at least 2")
    return asked.curves.cycle(request, asked.control, int(steps), None if file is None else Path(file))


@one_thread
def phase_diagram(
    contact: Contact,
    vary: Vary = "tabor",
    between: Sequence[Quantity] = (0.25, 4.0),
    control: str = "load",
    *,
    start: float | None = None,
    samples: int = 17,
    accuracy: float = 1e-6,
    progress: Progress | None = None,
    time_limit: float | None = None,
) -> PhaseDiagram:
    """Find the regions of a parameter and a control by the number and kind of stable states.

    The contact is traced at values of the parameter; every fold of the control and every first touch met there is
    followed to both ends, unless it lies on a curve that is known. Folds that appear and vanish between neighbouring
    values are missed: ask for more samples.

    Parameters
    ----------
    contact : Contact
    vary : str or callable
        As for `follow`, apart from a stiffness.
    between : pair of floats
        Values of the parameter, in the contact's units or texts with a unit.
    control : {"load", "displacement"}
    start : float, optional
        Present value of the parameter of a function.
    samples : int
        Values at which the contact is traced, at least 3; it is traced on both sides of special points, too.
    accuracy : float
        Of the boundaries, as for `follow`.
    progress, time_limit
        As in `trace`.

    Returns
    -------
    PhaseDiagram

    Raises
    ------
    InputError
        If an argument cannot be used.
    """
    kind = as_control(control).kind
    if kind == "spring" or vary == "stiffness":
        raise InputError("control: a spring; phase diagrams are for load and displacement control")
    contact = checked(contact)
    low, high = _pair(between, "between", partial(value_of, contact, vary, field="between"))
    if not isinstance(samples, Integral) or samples < 3:
        raise InputError(f"samples: {samples!r}; must be a whole number of at least 3")
    accuracy = accuracy_of(accuracy)
    if contact.tip.axisymmetric is None:
        raise InputError("contact: its tip needs a grid; phase diagrams are made of curves that grids cannot follow")
    family = family_of(contact, vary, low, start)
    if family.spacing == "logarithmic" and low * high <= 0:
        raise InputError(f"between: {low:g} and {high:g}; both must have the sign of the present {family.name}")

    def traced(member: Contact) -> Diagram:
        return trace(member, control=kind, accuracy=max(accuracy, 1e-5))

    from contbranch.curve.phase import Regions  # what other commands do not use is not imported for them

    with _watched(progress, time_limit) as watch:
        found = Regions(family, kind, (low, high), accuracy, traced).find(samples)
    return watch.passed(found)


# -- what is asked ----------------------------------------------------------------------------------------------------
@dataclass(frozen=True)
class _Asked:
    """A question made of arguments: whom to ask, under which control (in the contact's units), since when."""

    contact: Contact
    curves: FollowedCurves
    request: Request
    control: Control
    name: str
    why: str
    began: float

    def choice(self, unknowns: int) -> ModelChoice:
        """The model of a result."""
        return ModelChoice(self.name, self.why, unknowns)

    def answer(self, compute: Callable[[], Answer], nothing: Answer) -> Answer:
        """What is computed, incomplete if that is interrupted."""
        try:
            found = kept(compute, nothing)
        except (ArithmeticError, MemoryError) as error:
            if of_users(error):
                raise
            what = f"{type(error).__name__}: {error}".removesuffix(": ")
            raise ModelError(f"contact: {BEYOND} ({what}); take moderate ones") from error
        return replace(found, complete=False, message=told(found.message)) if over() else found

    def refuse_below(self, request: Request, curve: RawCurve) -> None:
        """Raise InputError for a largest load below that with which the curve begins."""
        if request.target is not None and len(curve.branch) and request.target <= curve.branch.load[0]:
            unit = self.contact.scales.load
            raise InputError(
                f"max_load: {request.target * unit:g}; must be greater than the load with which the curve begins, "
                f"{curve.branch.load[0] * unit:.4g}"
            )

    def noted(self, message: str, *reached: Branch | State) -> str:
        """A message, and what is to be said of states outside of the theory or of what describes the contact."""
        scales = self.contact.scales
        load, shift, radius = (
            np.concatenate([np.atleast_1d(getattr(one, name)) for one in reached] or [np.empty(0)]) * unit
            for name, unit in (
                ("load", scales.load),
                ("displacement", scales.normal),
                ("contact_radius", scales.in_plane),
            )
        )
        return f"{message} {notes(self.contact, load, shift, radius)}".strip()

    def about(self, found: Coexisting, message: str) -> Values:
        """What is said of states found, besides themselves."""
        status = "complete" if found.complete else "incomplete"
        if found.excess > 1.0:
            message += f" An error estimate is {found.excess:.3g} times the accuracy asked: next to a fold, or to first"
            message += " touch, states are told apart better by another quantity."
        about = {"model": self.choice(found.unknowns), "cost": self.timed(found.cost), "contact": self.contact}
        return {**about, "status": status, "message": self.noted(message, *found.states)}

    def held(self) -> Values:
        """What is controlled, and how accurately."""
        control = {"control": self.control.kind, "stiffness": self.control.spring_stiffness}
        return {**control, "accuracy": self.request.accuracy}

    def timed(self, cost: Cost) -> Cost:
        """A cost with the time since the question was asked."""
        return replace(cost, wall_s=time.perf_counter() - self.began)


def _watched(progress: Progress | None, time_limit: float | None) -> AbstractContextManager[Watch]:
    if not (progress is None or callable(progress)):
        raise InputError(f"progress: {progress!r}; must be called as progress(fraction, text), or None")
    return watched(progress, None if time_limit is None else positive_number(time_limit, "time_limit"))


def _ask(contact: Contact, control: object, accuracy: float, model: str | Model) -> _Asked:
    began = time.perf_counter()
    contact = checked(contact)
    driven = as_control(control, contact.units)
    number = accuracy_of(accuracy)
    check_laws(contact.interaction)
    chosen, why = choose(contact, model)
    request = Request(number, driven.scaled(contact.scales.stiffness))
    return _Asked(contact, curves(contact, chosen), request, driven, chosen.name, why, began)


def _only(contact: Contact, **given: Quantity) -> tuple[str, float]:
    """The one quantity that is given."""
    dimension = {"load": "force"}
    asked = [
        (name, checked(contact).units.read(value, dimension.get(name, "length"), name))
        for name, value in given.items()
        if value is not None
    ]
    if len(asked) != 1:
        raise InputError(f"give exactly one of {', '.join(given)}, not {len(asked)}")
    return asked[0]


def _limit(contact: Contact, max_load: Quantity) -> float | None:
    if max_load is None:
        return None
    load = positive_number(contact.units.read(max_load, "force", "max_load"), "max_load")
    return positive_number(load / contact.scales.load, "max_load, in reduced units,")


def checked(contact: object) -> Contact:
    """The contact, or InputError if it is none."""
    if not isinstance(contact, Contact):
        raise InputError(f"contact: {type(contact).__name__}; must be a Contact, made by cb.Contact(...)")
    return contact


def _window(contact: Contact, window: object) -> tuple[float, float]:
    def read(value: object) -> float:
        return contact.units.read(value, "length", "window") / contact.scales.normal

    return _pair(window, "window", read)


def _pair(pair: Any, field: str, read: Callable[[object], float]) -> tuple[float, float]:
    """Two numbers, the lower one first."""
    try:
        low, high = pair
    except (TypeError, ValueError) as error:
        raise InputError(f"{field}: {pair!r}; give two values, the lower one first") from error
    low, high = map(read, (low, high))
    if not low < high:
        raise InputError(f"{field}: {pair!r}; the first value must be the smaller one")
    return low, high


# -- what is answered -------------------------------------------------------------------------------------------------
def _reachable(found: Coexisting, field: str, unit: float, accuracy: float) -> str:
    if field == "contact_radius":
        return f"contact radii greater than {found.lowest * unit:.6g} are reachable"
    return f"{field}s from {found.lowest * unit:.10g} upwards are reachable at an accuracy of {accuracy:g}"


def _lowest(states: Sequence[State], control: Control, field: str) -> State:
    """The lowest, at what they have in common, of the states stable under a control; of all, if none is stable."""
    stable = [state for state in states if state.stable(control)]
    held = DISPLACEMENT if field == "displacement" else LOAD
    return min(stable or states, key=lambda state: held.height(held.of(state), state))


def _apart(state: State, near: State) -> float:
    return math.hypot(*(getattr(state, name) - getattr(near, name) for name in OBSERVABLES))


def _barriers(states: Sequence[State], connected: Sequence[bool], control: Control, load: float) -> tuple[Barrier, ...]:
    """Barriers between consecutive stable states of the curve, all at one value of the control, with one saddle between
    them, and that to infinite separation under a load that does not press.
    """
    on_curve = [k for k, joined in enumerate(connected) if joined]
    found = []
    if control.kind == "load" and load <= 0.0 and on_curve:  # far away the load is next to nothing
        outermost = [states[k].unstable(control) for k in on_curve[:2]]
        energies = [control.height(load, states[k]) for k in on_curve[:2]]
        if outermost == [1, 0]:
            height = energies[0] - energies[1]
            found.append(Barrier((on_curve[1], None), on_curve[0], (height, None), "detachment"))
        elif outermost[0] == 0 and load == 0.0 and energies[0] < 0.0:
            found.append(Barrier((on_curve[0], None), None, (-energies[0], None), "detachment"))
    for own in zip(on_curve, on_curve[1:], on_curve[2:], strict=False):
        if [states[k].unstable(control) for k in own] == [0, 1, 0]:
            first, top, last = (control.height(control.of(states[k]), states[k]) for k in own)
            found.append(Barrier((own[0], own[2]), own[1], (top - first, top - last)))
    return tuple(found)
