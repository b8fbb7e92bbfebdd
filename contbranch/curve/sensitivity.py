"""Derivatives of an event with respect to the parameters of its contact, from the linearisation at the event.

They are those along the curve that the event is followed on as the parameter changes (`contbranch.curve.augmented`):
the tangent of the augmented system gives the change of the state, and differences along it that of the observables.

Three parameters follow from the others, since the units of lengths in the plane, of heights and of the modulus are
free: if q_k grows like λ^v_k and O like λ^m with one of the units, Σ v_k q_k dO/dq_k = m O. Where a table of the law or
of the tip has such units, of which no parameter tells, only units under which tables stay as they are do: one or none.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping
from contextlib import suppress
from dataclasses import replace
from typing import Any

import numpy as np
import scipy

from contbranch.arrays import Array
from contbranch.contact.contact import Contact
from contbranch.contact.family import Family
from contbranch.contact.interaction_law import terms_of
from contbranch.contact.parameters import Parameter, parameters_of
from contbranch.continuation import Point
from contbranch.continuation.edge import Range
from contbranch.continuation.metric import ROUNDING
from contbranch.control import Control
from contbranch.curve.augmented import Condition, EventProblem
from contbranch.curve.events import Margin
from contbranch.curve.problem import equilibrium
from contbranch.curve.refine import at_parameter, moved, numbers, settled
from contbranch.errors import InputError
from contbranch.results.record import OBSERVABLES

__all__ = ["Sensitivities"]

# Steps of parameters, relative to themselves.
STEP = ROUNDING ** (1 / 3)
# Heights change like the displacement with the numbers of a tip, and may by such a share of the law's shortest length.
HEIGHT = 1e-3
# Events of such accuracy are taken on the discretisation that located them, others on the next finer one.
FINE = 1e-8
# Powers with which load, displacement, contact radius and central gap grow with the units of lengths in the plane, of
# heights and of the modulus; energies per area grow like E Z²/X.
POWERS = np.array([[1.0, 0.0, 1.0, 0.0], [1.0, 1.0, 0.0, 1.0], [1.0, 0.0, 0.0, 0.0]])
UNITS = (1.0 + np.eye(3)).tolist()


class Sensitivities:
    """Derivatives of observables at events of a contact, by its parameters; the events have the accuracy given."""

    def __init__(self, contact: Contact, accuracy: float) -> None:
        self.contact, self.accuracy, self.scales = contact, accuracy, contact.scales
        self.known = parameters_of(contact)
        self.values = {name: one.value for name, one in self.known.items()}
        self.powers, self.freedoms = _powers(contact, self.values)
        lengths = (min(law.range, law.wave) for law in terms_of(contact.interaction))
        self.shortest = min(lengths, default=math.inf) / self.scales.normal
        self.tips = contact.axisymmetric_tip.parameters()
        ends = math.isfinite(contact.axisymmetric_tip.extent)
        edges = [name for name in self.tips if ends and _moves_edge(self.known[name])]
        self.implied = _implied({name: self.powers[name] for name in (*edges, *self.powers)})

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
        event = _Event(self.contact, point, control, margin, finer=self.accuracy > FINE)
        here = np.array(numbers(event.point))
        lower = min(1.0, HEIGHT * self.shortest / max(abs(here[1] * STEP), 1e-300))
        rates = {
            name: units * event.rates_by(one, lower if name in self.tips else 1.0)
            for name, one in self.known.items()
            if name not in implied
        }
        if "modulus" in rates:  # in whose own unit it has been changed: what grows with that does so
            rates["modulus"] += POWERS[2] * (here * units)
        given = self.freedoms @ POWERS * (here * units) - sum(np.outer(powers[name], rates[name]) for name in rates)
        if control is not None and control.kind == "spring":  # its stiffness grows like E X
            given -= np.outer(self.freedoms @ [1.0, 0.0, 1.0], units * event.rates_by_stiffness(control.stiffness))
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
    scaled, grown = [], []
    for in_plane, normal, modulus in UNITS:
        energy = modulus * normal**2 / in_plane
        changed = None if law is None else law.scaled(1.0 / normal, 1.0 / energy)
        tip = contact.axisymmetric_tip.scaled(1.0 / in_plane, 1.0 / normal)
        body = None if contact.body is None else contact.body.scaled(1.0 / in_plane, 1.0 / modulus)
        other = replace(contact, tip=tip, interaction=changed, modulus=contact.modulus * modulus, body=body)
        scaled.append({name: one.value for name, one in parameters_of(other).items()})
        grown.append(np.log2(np.divide(_tables(other), tables)).round(9))
    freedoms = scipy.linalg.null_space(np.transpose(grown)).T if tables else np.eye(3)
    powers = {
        name: freedoms @ [math.log2(own[name] / value) if value else 0.0 for own in scaled]
        for name, value in values.items()
    }
    return powers, freedoms


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
    found: list[str] = []
    for name in powers:
        if np.linalg.matrix_rank([powers[one].round(9) for one in (*found, name)]) > len(found):
            found.append(name)
    return found


def _moves_edge(parameter: Parameter) -> bool:
    """Whether the tip ends elsewhere with another value."""
    here, there = (parameter.contact(parameter.value * factor).axisymmetric_tip.extent for factor in (1.0, 1.0 + STEP))
    return here != there


class _Event:
    """An event of a contact, in reduced units, and how it moves in families that start at that contact."""

    def __init__(self, contact: Contact, point: Point, control: Control | None, margin: str, finer: bool) -> None:
        held = (control is None and not margin) or point.parameter in equilibrium(point).parameter_range
        if finer:
            point = (at_parameter if held else settled)(moved(point, equilibrium(point).finer()))
        self.contact, self.point = contact, point
        self.event, self.edge = Margin(margin) if margin and not held else None, point.parameter if held else None
        self.control = None if control is None else control.scaled(contact.scales.stiffness)

    def _rates(self, family: Family, low: float = -math.inf, high: float = math.inf) -> Array:
        """Derivatives of the observables by the family's coordinate, which is known between two values, (4,).

        Raises
        ------
        CorrectionError
            If the event cannot be followed.
        """
        what = Condition(family, self.control, self.event, self.edge)
        system, q = EventProblem.around(what, self.point, Range(low, high)), family.coordinate(family.start)
        z = system.joined(self.point.x, self.point.parameter)
        return np.array(system.rates(z, q, system.moved(z, q), 1.0))

    def rates_by(self, parameter: Parameter, share: float) -> Array:
        """Derivatives by a parameter relative to itself (by one that is zero), with a share of the usual step."""
        value, unit = parameter.value, share * (parameter.value or 1.0)
        family = Family(parameter.name, 0.0, self.contact, lambda q: parameter.contact(value + unit * q), "linear")
        edges = [0.0, 0.0]  # of a parameter that ends there, such as the exponent 1 of a cone
        for k, side in enumerate((-1.0, 1.0)):
            with suppress(InputError):
                family.reduced(side * STEP)
                edges[k] = side * math.inf
        return self._rates(family, *edges) / share

    def rates_by_stiffness(self, stiffness: float) -> Array:
        """Derivatives by the logarithm of a spring's stiffness, in the contact's units."""
        family = Family("stiffness", stiffness, self.contact, lambda _: self.contact, "angle")
        return 0.5 * math.sin(2 * family.coordinate(stiffness)) * self._rates(family)
