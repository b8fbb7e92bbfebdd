"""Derivatives of an event with respect to the parameters of its contact, from the linearisation at the event.

At fixed c·(x, p), with c the border of the matrix, the state changes with a parameter q by

    [ R_x  R_p ] [ x_q ]   [ −R_q ]
    [   c^T    ] [ p_q ] = [   0  ],

and any observable O by O_q = ∂O/∂q + O_x x_q + O_p p_q. The event is where a rate G along the curve, or a margin,
vanishes; to stay there it slides along the curve by s = −G_q/G_t, t the tangent with c·t = 1:

    dO*/dq = O_q + s O_t.

What is extremal at a fold has O_t = 0. For a fold G is the rate of what is controlled, C_t, so that G_q is C_qt: the
rate of C_q along the curve, which differences between states on both sides of the fold give for all parameters at once.

Three parameters follow from the others, since the units of lengths in the plane, of heights and of the modulus are
free: if q_k grows like λ^v_k and O like λ^m with one of the units, Σ v_k q_k dO/dq_k = m O.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass

import numpy as np
import scipy

from contbranch.arrays import Array
from contbranch.contact.contact import Contact
from contbranch.contact.parameters import Parameter, parameters_of
from contbranch.contact.units import Scales
from contbranch.continuation import Point
from contbranch.continuation.newton import border, linearise, solve
from contbranch.control import Control
from contbranch.curve.problem import EquilibriumProblem, equilibrium
from contbranch.curve.refine import at_parameter, moved, settled
from contbranch.errors import InputError
from contbranch.results.record import OBSERVABLES

__all__ = ["sensitivities"]

# Steps: of parameters relative to themselves (or of those that are zero), and along the curve relative to its metric.
STEP, ALONG = 3e-5, 3e-4
# Powers with which load, displacement, contact radius and central gap grow with the units of lengths in the plane, of
# heights and of the modulus; energies per area grow like E Z²/X.
POWERS = np.array([[1.0, 0.0, 1.0, 0.0], [1.0, 1.0, 0.0, 1.0], [1.0, 0.0, 0.0, 0.0]])
UNITS = ((2.0, 1.0, 1.0), (1.0, 2.0, 1.0), (1.0, 1.0, 2.0))
# A parameter that follows from the others has at least this share in what it follows from.
SHARE = 0.1

Members = tuple[EquilibriumProblem, EquilibriumProblem]


@dataclass(frozen=True)
class _Change:
    """A parameter that is changed: the contacts a step above and below, in the event's reduced units, and the step."""

    above: Contact
    below: Contact
    step: float


def sensitivities(
    contact: Contact, point: Point, control: Control | None, margin: str = "", wanted: Collection[str] = OBSERVABLES
) -> dict[str, dict[str, float]]:
    """Derivatives of the four observables of an event by parameter, in the contact's units.

    Parameters
    ----------
    contact : Contact
        In its own units.
    point : Point
        The event, in reduced units.
    control : Control or None
        Of a fold, in the contact's units; None for any other event.
    margin : str
        The margin that vanishes at the event; without it and at an edge of the parameter, the parameter is held.
    wanted : collection of str
        Observables: where a fold moves is not asked for what is extremal there.
    """
    scales, known = contact.scales, parameters_of(contact)
    units = np.array([scales.of_fields[name] for name in OBSERVABLES])
    values = {name: one.value for name, one in known.items()}
    powers = _powers(contact, values)
    implied = _implied(powers)
    event = _Event(point, None if control is None else control.scaled(scales.stiffness), margin)
    if control is not None and set(wanted) == {control.kind}:
        event.control = None
    direct = [name for name in known if name not in implied]
    found, stiffer = event.rates({name: _change(known[name], scales) for name in direct})
    rates = {name: (values[name] or 1.0) * units * rate for name, rate in found.items()}
    rows = np.array([[powers[name][k] for name in implied] for k in range(3)])
    here = event.values * units
    given = POWERS * here - sum(np.outer(powers[name], rates[name]) for name in direct)
    if control is not None and control.kind == "spring":  # its stiffness grows like E X
        given -= np.outer([1.0, 0.0, 1.0], units * stiffer)
    rates |= zip(implied, np.linalg.lstsq(rows, given, rcond=None)[0], strict=True)
    return {
        name: {key: float(rates[key][k] / (values[key] or 1.0)) for key in known}
        for k, name in enumerate(OBSERVABLES)
        if name in wanted
    }


def _powers(contact: Contact, values: Mapping[str, float]) -> dict[str, Array]:
    """Powers (3,) with which parameters grow with the units."""
    law = contact.interaction
    scaled = []
    for in_plane, normal, modulus in UNITS:
        energy = modulus * normal**2 / in_plane
        changed = None if law is None else law.scaled(1.0 / normal, 1.0 / energy)
        other = Contact(
            contact.axisymmetric_tip.scaled(1.0 / in_plane, 1.0 / normal), changed, contact.modulus * modulus
        )
        scaled.append({name: one.value for name, one in parameters_of(other).items()})
    return {
        name: np.array([math.log2(own[name] / value) if value else 0.0 for own in scaled])
        for name, value in values.items()
    }


def _implied(powers: Mapping[str, Array]) -> list[str]:
    """Up to three parameters that follow from the others; those of tables and profiles are not among the parameters."""
    names = list(powers)
    _, triangle, order = scipy.linalg.qr(np.array([powers[name] for name in names]).T, mode="economic", pivoting=True)
    return [names[k] for k, size in zip(order, np.abs(np.diag(triangle)), strict=False) if size > SHARE]


def _change(parameter: Parameter, scales: Scales) -> _Change:
    """Members on both sides; on one where a parameter ends, such as the exponent 1 of a cone."""

    def member(step: float) -> Contact:
        other = parameter.contact(parameter.value + step)
        law = other.interaction
        scaled = None if law is None else law.scaled(scales.normal, scales.energy_per_area)
        return Contact(other.axisymmetric_tip.scaled(scales.in_plane, scales.normal), scaled)

    step = STEP * (abs(parameter.value) or 1.0)
    try:
        return _Change(member(step), member(-step), 2 * step)
    except InputError:
        return _Change(member(step), member(0.0), step)


class _Event:
    """An event with what moves it, on a discretisation finer than the one that located it."""

    def __init__(self, point: Point, control: Control | None, margin: str) -> None:
        held = (control is None and not margin) or point.parameter in equilibrium(point).parameter_range
        finer = equilibrium(point).finer()
        if finer is not point.problem:
            point = (at_parameter if held else settled)(moved(point, finer))
        self.point, self.problem = point, equilibrium(point)
        self.control, self.margin = (None, "") if held else (control, margin)
        x, p, problem = point.x, point.parameter, self.problem
        self.values = np.array(problem.values(x, p)[:4])
        metric = problem.metric(x)
        self.row: tuple[Array, float] = np.zeros_like(x), 1.0
        self.length = ALONG / metric.norm(problem, point.tangent_x, point.tangent_parameter)
        if not held:
            self.row = metric.row(problem, point.tangent_x, point.tangent_parameter)
            rate = max(abs(point.tangent_parameter), 1e-300)  # not beyond an edge of the parameter
            self.length = min(self.length, *(ALONG * abs(edge - p) / rate for edge in problem.parameter_range))

    def _sheet(self, s: float) -> _Sheet:
        """The state at a distance s along the tangent, its own tangent t with c·t = 1, and what solves for changes."""
        x, p = self.point.x + s * self.point.tangent_x, self.point.parameter + s * self.point.tangent_parameter
        bordered = border(self.problem, x, p, linearise(self.problem, x, p), self.row)
        tangent = solve(bordered, np.zeros_like(x), 1.0, p)
        return _Sheet(x, p, tangent, lambda f: solve(bordered, f, 0.0, p))

    def rates(self, changes: Mapping[str, _Change]) -> tuple[dict[str, Array], Array]:
        """Derivatives of the four observables by parameter, and by the logarithm of a spring's stiffness."""
        members = {
            name: (self.problem.varied(one.above), self.problem.varied(one.below)) for name, one in changes.items()
        }
        steps = {name: one.step for name, one in changes.items()}
        sheet = self._sheet(0.0)
        moved = {name: self._moved(sheet, members[name], steps[name]) for name in changes}
        found = {name: rate for name, (rate, _) in moved.items()}
        if self.control is None and not self.margin:
            return found, np.zeros(4)
        along = np.array(self.problem.rates(sheet.x, sheet.p, *sheet.tangent))
        if self.control is None:
            turn, shift = self._at_margin(sheet, members, {name: (steps[name], moved[name][1]) for name in moved})
            return {name: found[name] - shift[name] / turn * along for name in found}, np.zeros(4)
        return self._at_fold(self.control, along, found, members, steps)

    def _moved(self, sheet: _Sheet, members: Members, step: float) -> tuple[Array, tuple[Array, float]]:
        """O_q at a state, and the change of the state."""
        above, below = (member.residual(sheet.x, sheet.p) for member in members)
        change = sheet.solve((below - above) / step)
        half = 0.5 * step
        high, low = (
            np.array(member.values(sheet.x + h * change[0], sheet.p + h * change[1])[:4])
            for member, h in zip(members, (half, -half), strict=True)
        )
        return (high - low) / step, change

    def _at_fold(
        self,
        control: Control,
        along: Array,
        found: Mapping[str, Array],
        members: Mapping[str, Members],
        steps: Mapping[str, float],
    ) -> tuple[dict[str, Array], Array]:
        """Derivatives at a fold; that of the discretisation lies a little aside of the point."""
        weights, length = np.array([*control.weights, 0.0, 0.0]), self.length
        sides = [self._sheet(s) for s in (-length, length)]
        before, behind = (np.array(self.problem.rates(side.x, side.p, *side.tangent)) for side in sides)
        apart = 2 * length * float(self.row[0] @ self.point.tangent_x + self.row[1] * self.point.tangent_parameter)
        bend = (behind - before) / apart
        aside = -float(weights @ along) / float(weights @ bend)
        turn = float(weights @ (bend + aside * 4 * (before - 2 * along + behind) / apart**2))
        along = along + aside * bend
        rates = {}
        for name, rate in found.items():
            low, high = (self._moved(side, members[name], steps[name])[0] for side in sides)
            slope = (high - low) / apart
            shift = float(weights @ (slope + aside * 4 * (low - 2 * rate + high) / apart**2))
            rates[name] = rate + aside * slope - shift / turn * along
        stiffer = -control.weights[1] * along[1] / turn * along if control.kind == "spring" else np.zeros(4)
        return rates, stiffer

    def _at_margin(
        self, sheet: _Sheet, members: Mapping[str, Members], moved: Mapping[str, tuple[float, tuple[Array, float]]]
    ) -> tuple[float, dict[str, float]]:
        """G_t and G_q of a margin."""

        def margin(problem: EquilibriumProblem, step: float, direction: tuple[Array, float]) -> float:
            return problem.margins(sheet.x + step * direction[0], sheet.p + step * direction[1])[self.margin]

        def rate(pair: Members, step: float, direction: tuple[Array, float]) -> float:
            return (margin(pair[0], step, direction) - margin(pair[1], -step, direction)) / (2 * step)

        turn = rate((self.problem, self.problem), self.length, sheet.tangent)
        return turn, {name: rate(members[name], 0.5 * step, change) for name, (step, change) in moved.items()}


@dataclass(frozen=True)
class _Sheet:
    """A state with its tangent, and what solves for its change at fixed c·(x, p)."""

    x: Array
    p: float
    tangent: tuple[Array, float]
    solve: Callable[[Array], tuple[Array, float]]
