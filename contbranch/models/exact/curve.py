"""The whole equilibrium curve of a parabola with Maugis-Dugdale attraction, in closed form.

Reduced units throughout (R = E = w = 1), so the Tabor coefficient is the only parameter: range z0 = 1/mu_T and stress
sigma = mu_T. One parameter s runs along the curve of equilibria:

    s < -1        beyond the range: displacement d = s z0, no load
    -1 <= s <= 0  no contact: the interaction has the radius c = (1 + s) c_touch
    s = 0         first touch
    s > 0         contact of the radius a = s

Stability. The curve gains stability at one displacement fold and at one load fold. Before the former the second
variation at fixed displacement has one negative direction (the stiffness of the law is a delta function at c, of rank
one, and the sign of the reduced energy's curvature d^2V/dc^2 is that of dd/dc along the curve); the load adds one
where dF/dd < 0.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from contbranch.errors import InputError
from contbranch.models.exact.errors import error_apart, error_in_contact
from contbranch.models.exact.grids import graded, profile_grid
from contbranch.models.exact.results import ExactEvent, ExactProfile, ExactState, ExactStates
from contbranch.models.exact.series import LocalExpansion, in_central_gap, in_contact_radius
from contbranch.theory import maugis
from contbranch.theory._dugdale import Angle, Zone
from contbranch.theory._inputs import FloatArray, finite, positive

__all__ = ["ExactCurve"]


@dataclass(frozen=True)
class ExactCurve:
    """All axisymmetric equilibria of a parabola with Maugis-Dugdale attraction at one Tabor coefficient.

    Parameters
    ----------
    tabor : float
        Tabor coefficient mu_T > 0.

    Raises
    ------
    InputError
        If it is not a positive number.
    """

    tabor: float

    def __post_init__(self) -> None:
        object.__setattr__(self, "tabor", float(positive("tabor", self.tabor)))

    @cached_property
    def _zone(self) -> Zone:
        one = np.asarray(1.0)
        return Zone(one, one, one, np.asarray(1.0 / self.tabor))

    @property
    def _constants(self) -> dict[str, float]:
        return {"interaction_range": self.interaction_range}

    @property
    def interaction_range(self) -> float:
        """The range z0 = 1/mu_T; the interaction starts at the displacement -z0."""
        return 1.0 / self.tabor

    @cached_property
    def touch_radius(self) -> float:
        """Radius of the interaction at first touch."""
        return float(self._zone.touch_radius())

    @cached_property
    def _load_fold_tangent(self) -> float:
        return float(maugis.load_fold_tangent(self._zone))

    @cached_property
    def _displacement_fold_tangent(self) -> float:
        """Tangent of the rim angle at the displacement fold; infinite where that has no contact."""
        if self._separated_fold_radius(0.0) <= self.touch_radius:
            return math.inf
        return float(maugis.displacement_fold_tangent(self._zone))

    @cached_property
    def _load_fold_parameter(self) -> float:
        return self._radius_at(self._load_fold_tangent)

    @cached_property
    def _displacement_fold_parameter(self) -> float:
        if math.isinf(self._displacement_fold_tangent):
            return self._separated_fold_radius(0.0) / self.touch_radius - 1.0
        return self._radius_at(self._displacement_fold_tangent)

    def _radius_at(self, tangent: float) -> float:
        angle = Angle.from_tangent(np.asarray(tangent))
        return float(self._zone.interaction_radius(angle) * angle.cos)

    def _separated_fold_radius(self, compliance: float) -> float:
        """Return c where d + compliance * F is least without contact, or infinity: dd/dc = c - 4 sigma/pi and dF/dc =
        -2 pi sigma c.
        """
        rest = 1.0 - 2.0 * math.pi * self.tabor * compliance
        return 4.0 * self.tabor / (math.pi * rest) if rest > 0.0 else math.inf

    # ---- the curve

    def states(self, parameter: ArrayLike) -> ExactStates:
        """Return the equilibria at the values of the parameter s of the module, a one-dimensional array or a number."""
        s = np.atleast_1d(finite("parameter", parameter)).astype(np.float64)
        contact = maugis.contact(np.maximum(s, 0.0), **self._constants)
        apart = maugis.without_contact(self._zone, np.asarray(self.touch_radius * np.clip(1.0 + s, 0.0, 1.0)))
        curve = maugis.Curve(*(np.where(s > 0.0, x, y) for x, y in zip(contact, apart, strict=True)))
        far = np.where(s <= -1.0, s * self.interaction_range, curve.displacement)
        curve = curve._replace(displacement=far, central_gap=np.where(s <= -1.0, -far, curve.central_gap))
        return self._judged(s, curve)

    def _judged(self, s: FloatArray, curve: maugis.Curve) -> ExactStates:
        interacting = s > -1.0
        load = (interacting & (s < self._load_fold_parameter)).astype(np.int64)
        displacement = (interacting & (s < self._displacement_fold_parameter)).astype(np.int64)
        return ExactStates(s, *curve, load, displacement)

    def _state(self, parameter: float) -> ExactState:
        return self.states(parameter).state(0)

    def _separated_state(self, c: float) -> ExactState:
        """Return the state by the radius of its interaction, which the parameter has only to a fraction of c_touch."""
        curve = maugis.without_contact(self._zone, np.asarray([c]))
        return self._judged(np.array([c / self.touch_radius - 1.0]), curve).state(0)

    def _contact_state(self, tangent: float) -> ExactState:
        curve = maugis.in_contact(self._zone, np.asarray([tangent]))
        return self._judged(curve.contact_radius, curve).state(0)

    def sample(
        self, points: int = 400, *, max_load: float | None = None, far: float = 1.5, stiffness: float | None = None
    ) -> ExactStates:
        """Return the curve from beyond the range to a load, with the events among its points.

        Parameters
        ----------
        points : int
            About how many points; at least 20.
        max_load : float, optional
            Load at which the curve ends, in contact; 10 by default.
        far : float
            Displacement at which the curve starts, in -z0; at least 1.
        stiffness : float, optional
            Stiffness of a spring whose folds are to be among the points, too.

        Raises
        ------
        InputError
            If one of them is out of range.
        """
        if points < 20:
            raise InputError(f"points must be at least 20, not {points}")
        if not far >= 1.0:
            raise InputError(f"far must be at least 1, where the interaction starts, not {far}")
        last = self.solve(load=10.0 if max_load is None else max_load)[-1].parameter
        # features without contact sit at the scale of the fold, those in contact at the scales of touch and of pull-off
        inner = 0.2 * min(1.0, 4.0 * self.tabor / math.pi / self.touch_radius)
        outer = 0.1 * min(self.touch_radius, self._load_fold_parameter)
        share = points // 4
        events = [*self.events, *(() if stiffness is None else self.spring_events(stiffness))]
        own = np.array([event.state.parameter for event in events])
        ahead = np.linspace(-far, -1.0, 5) if far > 1.0 else np.empty(0)
        apart = np.concatenate([graded(1.0, inner, share), np.linspace(0.0, 1.0, share // 2)]) - 1.0
        contact = np.concatenate([graded(last, outer, 2 * share), np.linspace(0.0, last, share)])
        grid = np.unique(np.concatenate([ahead, apart, contact, own]))
        states = self.states(grid[grid <= last])
        for event in events:
            for column, value in zip(states, event.state, strict=True):
                column[states.parameter == event.state.parameter] = value
        return states

    # ---- events

    @cached_property
    def events(self) -> tuple[ExactEvent, ...]:
        """Jump-in, first touch and both pull-offs, in the order of the curve."""
        edge = ExactEvent("fold", "displacement", "jump-in", self._state(-1.0), error_apart(self._zone, 0.0))
        touch = ExactEvent("touch", None, None, self._state(0.0), error_apart(self._zone, self.touch_radius))
        found = [edge, touch, self._fold("load", 0.0, 1.0), self._fold("displacement", 1.0, 0.0)]
        return tuple(sorted(found, key=lambda event: event.state.parameter))

    def spring_events(self, stiffness: float) -> tuple[ExactEvent, ...]:
        """Return jump-in and pull-off of a spring of the given stiffness > 0, the folds of d + F / stiffness."""
        compliance = 1.0 / float(positive("stiffness", stiffness))
        edge = ExactEvent("fold", "spring", "jump-in", self._state(-1.0), error_apart(self._zone, 0.0))
        return edge, self._fold("spring", 1.0, compliance)

    def unstable_spring(self, states: ExactStates, stiffness: float) -> NDArray[np.int64]:
        """Return the Morse indices of states under a spring of the given stiffness > 0."""
        s = states.parameter
        return ((s > -1.0) & (s < self.spring_events(stiffness)[1].state.parameter)).astype(np.int64)

    def unstable_spring_at(self, parameter: float, stiffness: float) -> bool:
        """Return whether the state with the parameter s is unstable under a spring of the given stiffness > 0."""
        return -1.0 < parameter < self.spring_events(stiffness)[1].state.parameter

    def zero_load_contact(self) -> ExactState:
        """Return the contact without load."""
        return self.solve(load=0.0)[-1]

    def _fold(self, control: Literal["load", "displacement", "spring"], rigid: float, compliance: float) -> ExactEvent:
        """Return the fold of rigid * d + compliance * F."""
        if rigid:
            c = self._separated_fold_radius(compliance)
            if c <= self.touch_radius:
                return ExactEvent("fold", control, "pull-off", self._separated_state(c), error_apart(self._zone, c))
        if control == "spring":

            def slope(angle: Angle) -> FloatArray:
                slopes = self._zone.slopes(angle)
                return np.asarray(slopes.displacement + compliance * slopes.load)

            tangent = float(self._zone.root(slope, *self._zone.tangent_range()))
        else:
            tangent = self._load_fold_tangent if control == "load" else self._displacement_fold_tangent
        return ExactEvent(
            "fold",
            control,
            "pull-off",
            self._contact_state(tangent),
            error_in_contact(self._zone, tangent, rigid, compliance),
        )

    # ---- single equilibria

    def solve(
        self, *, load: float | None = None, displacement: float | None = None, contact_radius: float | None = None
    ) -> list[ExactState]:
        """Return every equilibrium with the given load, displacement or contact radius, in the order of the curve.

        Exactly one of the three is given, in reduced units. For the load 0 only the contact is returned, not the
        continuum of separations beyond the range.

        Raises
        ------
        InputError
            If not exactly one is given, if the load is below pull-off, or the contact radius not positive.
        """
        given = {"load": load, "displacement": displacement, "contact_radius": contact_radius}
        chosen = {key: value for key, value in given.items() if value is not None}
        if len(chosen) != 1:
            raise InputError(f"solve takes exactly one of load, displacement and contact_radius, not {len(chosen)}")
        ((field, value),) = chosen.items()
        number = float(finite(field, value))
        if field == "load":
            return self._at_load(number)
        if field == "displacement":
            return self._at_displacement(number)
        if number <= 0.0:
            raise InputError(
                f"contact_radius must be greater than 0, not {number}: without contact it does not select a state"
            )
        return [self._state(number)]

    def _event(self, control: str | None) -> ExactEvent:
        return next(event for event in self.events if event.control == control and event.name != "jump-in")

    def _at_load(self, load: float) -> list[ExactState]:
        fold, touch = self._event("load"), self._event(None)
        if load < fold.state.load - fold.error["load"]:
            raise InputError(
                f"load must be at least {fold.state.load:.12g} (pull-off), not {load}: no equilibrium has a lower load"
            )
        found, peak, above_touch = [], self._load_fold_tangent, load - touch.state.load
        if abs(above_touch) <= touch.error["load"]:
            found.append(touch.state)
        elif above_touch < 0.0 and load > fold.state.load + fold.error["load"]:
            found.append(self._root("load", load, peak, self._highest_tangent))
        elif above_touch > 0.0 and load < 0.0:
            found.append(self._separated_state(self.touch_radius * math.sqrt(load / touch.state.load)))
        if load <= fold.state.load + fold.error["load"]:
            return [*found, fold.state]
        return [*found, self._root("load", load, self._tangent_at(float(np.cbrt(3.0 * max(load, 0.0))) + 4.0), peak)]

    def _at_displacement(self, displacement: float) -> list[ExactState]:
        fold, touch = self._event("displacement"), self._event(None)
        in_contact = math.isfinite(self._displacement_fold_tangent)
        at_touch = abs(displacement - touch.state.displacement) <= touch.error["displacement"]
        at_fold = abs(displacement - fold.state.displacement) <= fold.error["displacement"]
        found = self._separated_at(displacement, in_contact, at_touch, at_fold)
        if at_touch:
            found.append(touch.state)
        # adhesion lowers the displacement by at most sqrt(2 pi a) from a^2, so this radius has a larger one
        low = self._tangent_at(math.sqrt(max(displacement, 0.0)) + 4.0)
        peak = self._displacement_fold_tangent if in_contact else self._highest_tangent
        if in_contact and at_fold:
            return [*found, fold.state]
        if in_contact and not at_touch and fold.state.displacement < displacement < touch.state.displacement:
            found.append(self._root("displacement", displacement, peak, self._highest_tangent))
        if (
            displacement > fold.state.displacement
            if in_contact
            else displacement > touch.state.displacement and not at_touch
        ):
            found.append(self._root("displacement", displacement, low, peak))
        return found

    def _separated_at(
        self, displacement: float, fold_in_contact: bool, at_touch: bool, at_fold: bool
    ) -> list[ExactState]:
        """Return the states without contact at a displacement: beyond the range, or c^2/2 - (4/pi) sigma c = d + z0."""
        z0, b = self.interaction_range, 4.0 / math.pi * self.tabor
        height = displacement + z0
        if abs(height) <= 4.0 * np.finfo(float).eps * z0:
            height = 0.0
        far = [self._state(displacement / z0 if height < 0.0 else -1.0)] if height <= 0.0 else []
        square = b * b + 2.0 * height
        larger = b + math.sqrt(max(square, 0.0))
        if at_fold and not fold_in_contact:
            radii = [b]
        elif square < 0.0:
            radii = []
        elif at_touch:  # one of the two radii is that of touch itself
            radii = [] if fold_in_contact else [-2.0 * height / larger]
        else:
            radii = [-2.0 * height / larger, larger]
        return far + [self._separated_state(c) for c in radii if 0.0 < c < self.touch_radius]

    @property
    def _highest_tangent(self) -> float:
        return float(self._zone.tangent_range()[1])

    def _tangent_at(self, contact_radius: float) -> float:
        return float(self._zone.tangent_at(np.asarray(contact_radius)))

    def _root(self, field: Literal["load", "displacement"], target: float, low: float, high: float) -> ExactState:
        """Return the contact state where a field, monotone between two tangents, has a value."""

        def excess(angle: Angle) -> FloatArray:
            c = self._zone.interaction_radius(angle)
            value = self._zone.load(angle, c) if field == "load" else self._zone.displacement(angle, c)
            return value - target

        rising = bool(excess(Angle.from_tangent(np.asarray(high))) > 0.0)
        sign = 1.0 if rising else -1.0
        tangent = self._zone.root(lambda angle: np.asarray(sign * excess(angle)), np.asarray(low), np.asarray(high))
        state = self._contact_state(float(tangent))
        # what was asked for is known exactly; the closed form returns it to a few units in the last place
        return state._replace(load=target) if field == "load" else state._replace(displacement=target)

    # ---- what one equilibrium looks like

    def profile(self, state: ExactState, r: ArrayLike | None = None) -> ExactProfile:
        """Return gap and pressures over the distance r from the axis, by default a grid graded towards the rims a and
        c.

        Raises
        ------
        InputError
            If a distance is negative.
        """
        grid = profile_grid(state) if r is None else np.atleast_1d(finite("r", r))
        curve = maugis.Curve(*(np.asarray(x, dtype=np.float64) for x in state[1:8]))
        gap = maugis.gap(grid, curve, **self._constants)
        total, wall = maugis.pressure(grid, curve, **self._constants)
        return ExactProfile(grid, gap, total, wall)

    def expansion(self, state: ExactState, order: int = 3) -> LocalExpansion:
        """Return derivatives of load and displacement with respect to the contact radius, or to the central gap
        without contact.

        At a load fold F' = 0 and the normal form is a - a_p = sqrt(2 (F - F_p) / F''); its ratio to the next order,
        with F''', sets the crossover load. First touch counts as contact; there F' = d' = 0 in the contact radius,
        without being a fold.

        Raises
        ------
        InputError
            If the order is below 1 or the state lies beyond the range, where nothing depends on the gap but the
            displacement.
        """
        if order < 1:
            raise InputError(f"order must be at least 1, not {order}")
        if state.parameter < -1.0:
            raise InputError(
                f"state must lie within the range of the interaction, not at the displacement {state.displacement}"
            )
        if state.parameter < 0.0:
            return in_central_gap(self._zone, state.interaction_radius, order)
        tangent = np.asarray(self._tangent_at(state.contact_radius))
        return in_contact_radius(self._zone, Angle.from_tangent(tangent), order)
