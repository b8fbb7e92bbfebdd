"""Derivatives of an event with respect to the parameters of its contact, from the linearisation at the event.

At fixed c·(x, p), with c the border of the matrix, the state changes with a parameter q by

    [ R_x  R_p ] [ x_q ]   [ −R_q ]
    [   c^T    ] [ p_q ] = [   0  ],

and any observable O by O_q = ∂O/∂q + O_x x_q + O_p p_q. The event is where a rate G along the curve, or a margin,
vanishes; to stay there it slides along the curve by s = −G_q/G_t, t the tangent with c·t = 1:

    dO*/dq = O_q + s O_t.

What is extremal at a fold has O_t = 0. Where else a fold moves G_q would be the rate along the curve of a derivative,
of which rounding leaves little in tiny contacts and stiff films: then the fold is located anew on both sides of q.

Three parameters follow from the others, since the units of lengths in the plane, of heights and of the modulus are
free: if q_k grows like λ^v_k and O like λ^m with one of the units, Σ v_k q_k dO/dq_k = m O. Where a table of the law or
of the tip has such units, of which no parameter tells, only units under which tables stay as they are do: one or none.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Iterable, Mapping
from dataclasses import dataclass, replace
from functools import cache, partial
from typing import Any, NamedTuple

import numpy as np
import scipy

from contbranch.arrays import Array
from contbranch.contact.contact import Contact
from contbranch.contact.interaction_law import terms_of
from contbranch.contact.parameters import Parameter, parameters_of
from contbranch.contact.units import Scales
from contbranch.continuation import CorrectionError, Point
from contbranch.continuation.bordered import Bordered
from contbranch.continuation.newton import border, linearise, residual, solve
from contbranch.continuation.walk import corrected_point
from contbranch.control import Control
from contbranch.curve.events import FoldEvent
from contbranch.curve.problem import EquilibriumProblem, equilibrium
from contbranch.curve.refine import OPTIONS, Beside, moved
from contbranch.errors import InputError
from contbranch.results.record import OBSERVABLES

__all__ = ["Sensitivities"]

# Steps: of parameters relative to themselves (or of those that are zero), along the curve relative to its metric, at
# most a share of the distance from an edge of its parameter; closer to that than another share all is at fixed
# parameter.
STEP, ALONG, NEARER, ASIDE = 3e-5, 3e-4, 0.004, 0.1
# Those of parameters there, and in contacts smaller than this, of which little but rounding would change.
WIDE, TINY = 1e-3, 0.03
# Heights change like the displacement with the numbers of a tip, and may by such a share of the law's shortest length.
HEIGHT = 1e-3
# Shares of a parameter's step that are tried where the tip ends, until derivatives agree to such a share.
SHARES, ALIKE = (0.1, 0.01, 0.001), 1e-4
# Events of such accuracy are taken on the discretisation that located them, others on the next finer one.
FINE = 1e-8
# Corrections on the finer discretisation by one matrix, and the largest for which it serves.
CORRECTIONS, CLOSE = 2, 1e-7
# Powers with which load, displacement, contact radius and central gap grow with the units of lengths in the plane, of
# heights and of the modulus; energies per area grow like E Z²/X.
POWERS = np.array([[1.0, 0.0, 1.0, 0.0], [1.0, 1.0, 0.0, 1.0], [1.0, 0.0, 0.0, 0.0]])
UNITS = ((2.0, 1.0, 1.0), (1.0, 2.0, 1.0), (1.0, 1.0, 2.0))
# A parameter that follows from the others has at least this share in what it follows from.
SHARE = 0.1


# Derivatives of the observables by parameter, and by the logarithm of a spring's stiffness.
_Rates = tuple[dict[str, Array], Array]


@dataclass(frozen=True)
class _Change:
    """A parameter that is changed: the contacts a step above and below, in the event's reduced units, and the step."""

    above: Contact
    below: Contact
    step: float


class Sensitivities:
    """Derivatives of observables at events of a contact, by its parameters; the events have the accuracy given."""

    def __init__(self, contact: Contact, accuracy: float) -> None:
        known, self.accuracy = parameters_of(contact), accuracy
        self.scales, self.ends = contact.scales, math.isfinite(contact.axisymmetric_tip.extent)
        lengths = (min(law.range, law.wave) for law in terms_of(contact.interaction))
        self.shortest = min(lengths, default=math.inf) / self.scales.normal
        self.values = {name: one.value for name, one in known.items()}
        self.powers, self.freedoms = _powers(contact, self.values)
        tips = contact.axisymmetric_tip.parameters()
        edges = [name for name in tips if self.ends and _moves_edge(known[name])]
        self.implied = _implied({name: self.powers[name] for name in (*edges, *self.powers)})
        free = {name: one for name, one in known.items() if name not in self.implied}
        self.changes = cache(
            lambda step, share: {
                name: _change(one, self.scales, step * (share if name in tips else 1.0)) for name, one in free.items()
            }
        )

    def at(
        self, point: Point, control: Control | None, margin: str = "", wanted: Collection[str] = OBSERVABLES
    ) -> dict[str, dict[str, float]]:
        """Derivatives of the observables of an event by parameter, in the contact's units.

        Parameters
        ----------
        point : Point
            The event, in reduced units.
        control : Control or None
            Of a fold, in the contact's units; None for any other event.
        margin : str
            The margin that vanishes at the event; without it and at an edge of the parameter, the parameter is held.
        wanted : collection of str
            Observables: where a fold moves is not asked for what is extremal there.
        """
        values, powers, implied = self.values, self.powers, self.implied
        units = np.array([self.scales.of_fields[name] for name in OBSERVABLES])
        if self.accuracy > FINE:
            point = moved(point, equilibrium(point).finer())
        reduced = None if control is None else control.scaled(self.scales.stiffness)
        slides = control is not None and set(wanted) != {control.kind}
        event = _Event(point, reduced, margin, slides)
        lower = min(1.0, HEIGHT * self.shortest / max(abs(event.values[1] * event.step), 1e-300))
        # The edge of a tip may pass nodes where a parameter changes, too.
        shares = (1.0, *SHARES) if self.ends else (1.0,)
        found, stiffer = _settled(event.rates(self.changes(k * event.step, lower)) for k in shares)
        units = units / event.smooth  # of rates; a contact radius is a root of what is smooth
        rates = {name: (values[name] or 1.0) * units * rate for name, rate in found.items()}
        if "modulus" in rates:  # in whose own unit it has been changed: what grows with that does so, a spring softens
            rates["modulus"] += POWERS[2] * (event.values * units * event.smooth) - units * stiffer
        given = self.freedoms @ POWERS * (event.values * units * event.smooth) - sum(
            np.outer(powers[name], rates[name]) for name in found
        )
        if control is not None and control.kind == "spring":  # its stiffness grows like E X
            given -= np.outer(self.freedoms @ [1.0, 0.0, 1.0], units * stiffer)
        if implied:
            rows = np.column_stack([powers[name] for name in implied])
            rates |= zip(implied, np.linalg.lstsq(rows, given, rcond=None)[0], strict=True)
        return {
            name: {key: float(rates[key][k] / (values[key] or 1.0)) for key in values}
            for k, name in enumerate(OBSERVABLES)
            if name in wanted
        }


def _powers(contact: Contact, values: Mapping[str, float]) -> tuple[dict[str, Array], Array]:
    """Units (d, 3) that are free, as powers of those of lengths in the plane, of heights and of the modulus, d ≤ 3, and
    the powers (d,) with which parameters grow with them."""
    law, tables = contact.interaction, _tables(contact)
    scaled = []
    for in_plane, normal, modulus in UNITS:
        energy = modulus * normal**2 / in_plane
        changed = None if law is None else law.scaled(1.0 / normal, 1.0 / energy)
        other = Contact(
            contact.axisymmetric_tip.scaled(1.0 / in_plane, 1.0 / normal), changed, contact.modulus * modulus
        )
        numbers = {name: one.value for name, one in parameters_of(other).items()}
        scaled.append((numbers, np.log2(np.divide(_tables(other), tables))))
    grown = np.array([one for _, one in scaled]).T.round(9)
    freedoms = scipy.linalg.null_space(grown).T if tables else np.eye(3)
    powers = {
        name: np.array([math.log2(own[name] / value) if value else 0.0 for own, _ in scaled])
        for name, value in values.items()
    }
    return {name: freedoms @ own for name, own in powers.items()}, freedoms


def _tables(contact: Contact) -> list[float]:
    """The largest entries of all columns of tables."""
    parts: list[Any] = [contact.axisymmetric_tip, *terms_of(contact.interaction)]
    columns = [np.asarray(one) for part in parts for one in part.parameters().values() if isinstance(one, tuple | list)]
    return [float(np.abs(one).max()) for one in columns if one.dtype.kind in "iuf" and one.any()]


def _implied(powers: Mapping[str, Array]) -> list[str]:
    """As many parameters as there are free units, or fewer, that follow from the others: the first that can.

    They are the modulus and those of the tip, which change heights by far more than the range of a law where films are
    stiff, so that differences of states would not be small. Before the modulus come those that move the edge of a tip:
    heights rise without bound there, and differences depend on their step.
    """
    found: dict[str, Array] = {}
    for name, row in powers.items():
        left = row - sum(((row @ one) * one for one in found.values()), np.zeros_like(row))
        if (size := float(np.linalg.norm(left))) > SHARE:
            found[name] = left / size
    return list(found)


def _moves_edge(parameter: Parameter) -> bool:
    """Whether the tip ends elsewhere with another value."""
    here, there = (parameter.contact(parameter.value * factor).axisymmetric_tip.extent for factor in (1.0, 1.0 + WIDE))
    return here != there


def _change(parameter: Parameter, scales: Scales, step: float) -> _Change:
    """Members on both sides; on one where a parameter ends, such as the exponent 1 of a cone."""

    def member(step: float) -> Contact:
        other = parameter.contact(parameter.value + step)
        law = other.interaction
        energy = scales.energy_per_area * other.modulus / scales.modulus
        scaled = None if law is None else law.scaled(scales.normal, energy)
        return Contact(other.axisymmetric_tip.scaled(scales.in_plane, scales.normal), scaled)

    step *= abs(parameter.value) or 1.0
    try:
        return _Change(member(step), member(-step), 2 * step)
    except InputError:
        return _Change(member(step), member(0.0), step)


class _Event:
    """An event, or a point next to it, with what moves it; states with p at their end."""

    def __init__(self, point: Point, control: Control | None, margin: str, slides: bool) -> None:
        held = (control is None and not margin) or point.parameter in equilibrium(point).parameter_range
        self.problem, metric = (problem := equilibrium(point)), problem.metric(point.x)
        self.control, self.margin = control if slides and not held else None, "" if held else margin
        if self.control is not None:
            self.fold = Beside(point, FoldEvent(self.control))
            x, p, matrix = self.fold.point.x, self.fold.point.parameter, self.fold.matrix
        else:
            x, p, matrix = _solved(point, held)
        self.solve: Callable[[Array, float], Array] = lambda f, g: np.append(*solve(matrix, f, g, p))
        self.state, self.tangent = np.append(x, p), self.solve(np.zeros_like(x), 1.0)
        self.values = np.array(problem.values(x, p)[:4])
        self.smooth = np.array([1.0, 1.0, 2 * self.values[2] or 1.0, 1.0])
        self.step, self.length = STEP, ALONG / metric.norm(problem, self.tangent[:-1], self.tangent[-1])
        if not held:
            rate = max(abs(self.tangent[-1]), 1e-300)  # not beyond an edge of the parameter
            near = min(abs(edge - p) / rate for edge in problem.parameter_range)
            tiny = ASIDE * near <= self.length or 0.0 < self.values[2] < TINY
            self.length, self.step = min(self.length, NEARER * near), WIDE if tiny else STEP

    def rates(self, changes: Mapping[str, _Change]) -> _Rates:
        """Derivatives of the four observables by parameter, and by the logarithm of a spring's stiffness."""
        problem, state, tangent = self.problem, self.state, self.tangent
        pairs = {
            name: _Pair(problem.varied(one.above), problem.varied(one.below), one.step) for name, one in changes.items()
        }
        still = np.zeros_like(state)
        moved = {name: self.solve(-pair.rate(_residual, state, still), 0.0) for name, pair in pairs.items()}
        if self.control is not None:
            return self._at_fold(self.control, pairs, moved)
        found = {name: pair.rate(_values, state, moved[name]) for name, pair in pairs.items()}
        if not self.margin:
            return found, np.zeros(4)

        def margin(problem: EquilibriumProblem, at: Array) -> Array:
            return np.array(problem.margin(at[:-1], at[-1], self.margin))

        turn = _Pair(problem, problem, 2 * self.length).rate(margin, state, tangent)
        along = self.smooth * problem.rates(state[:-1], state[-1], tangent[:-1], tangent[-1])
        shifts = {name: pair.rate(margin, state, moved[name]) / turn for name, pair in pairs.items()}
        return {name: found[name] - shifts[name] * along for name in found}, np.zeros(4)

    def _at_fold(self, control: Control, pairs: Mapping[str, _Pair], moved: Mapping[str, Array]) -> _Rates:
        """Derivatives from the folds on both sides; unknown where they are not found."""

        def beside(control: Control, problem: EquilibriumProblem, state: Array) -> Array:
            point = replace(self.fold.point, problem=problem, x=state[:-1], parameter=float(state[-1]), observables={})
            try:
                found = self.fold.at(point, FoldEvent(control))
            except CorrectionError:
                return np.full(4, math.nan)
            return _values(problem, np.append(found.x, found.parameter))

        rates = {name: pair.rate(partial(beside, control), self.state, moved[name]) for name, pair in pairs.items()}
        if control.kind != "spring":
            return rates, np.zeros(4)
        springs = (replace(control, stiffness=control.stiffness * (1.0 + k * self.step)) for k in (1, -1))
        above, below = (beside(spring, self.problem, self.state) for spring in springs)
        return rates, (above - below) / (2 * self.step)


def _solved(point: Point, held: bool) -> tuple[Array, float, Bordered]:
    """The state at a point to rounding, and its matrix; at fixed parameter where that is held, or next to an edge."""
    problem, x, p = equilibrium(point), point.x, point.parameter
    metric = problem.metric(x)
    # Next to an edge of the parameter, as in a tiny contact, all is compared at fixed parameter.
    far = abs(point.tangent_parameter) / metric.norm(problem, point.tangent_x, point.tangent_parameter) * ALONG
    held_there = held or ASIDE * min(abs(edge - p) for edge in problem.parameter_range) < far
    along = (np.zeros_like(x), 1.0) if held_there else (point.tangent_x, point.tangent_parameter)
    row = metric.row(problem, *metric.unit(problem, *along))
    at = linearise(problem, x, p)
    matrix, left = border(problem, x, p, at, row), at[0]
    for _ in range(CORRECTIONS):  # by the same matrix: they are tiny
        dx, dp = solve(matrix, -left, 0.0, p)
        if metric.norm(problem, dx, dp) > CLOSE:
            exact, _ = corrected_point(problem, (x, p), along, metric, OPTIONS)
            x, p = exact.x, exact.parameter
            return x, p, border(problem, x, p, linearise(problem, x, p), row)
        x, p = x + dx, p + dp
        left = residual(problem, x, p)
    return x, p, matrix


class _Pair(NamedTuple):
    """Problems a step of a parameter apart."""

    above: EquilibriumProblem
    below: EquilibriumProblem
    step: float

    def rate(self, of: Callable[[EquilibriumProblem, Array], Array], state: Array, change: Array) -> Array:
        """Derivative by the parameter of a function of problem and state, where the state changes with it."""
        half = 0.5 * self.step * change
        return (of(self.above, state + half) - of(self.below, state - half)) / self.step


def _settled(tries: Iterable[_Rates]) -> _Rates:
    """The first derivatives with which the next agree to a share of the largest, or those that do so best: of two that
    agree the longer step, which rounding spoils less."""
    last: _Rates = {}, np.zeros(4)
    best, least = last, math.inf
    for one in tries:
        pairs = [(rates, last[0][name]) for name, rates in one[0].items() if name in last[0]]
        apart = max((np.nanmax(np.abs(a - b)) / max(np.nanmax(np.abs(a)), 1e-300) for a, b in pairs), default=math.inf)
        if apart < least or not best[0]:
            best, least = last if pairs else one, apart
        if apart <= ALIKE:
            break
        last = one
    return best


def _residual(problem: EquilibriumProblem, state: Array) -> Array:
    return problem.residual(state[:-1], state[-1])


def _values(problem: EquilibriumProblem, state: Array) -> Array:
    """The observables, the square of the contact radius in its place: that is smooth where contact begins."""
    found = np.array(problem.values(state[:-1], state[-1])[:4])
    found[2] **= 2
    return found
