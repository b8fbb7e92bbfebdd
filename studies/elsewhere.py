"""Methods that a user might choose elsewhere, in their plain form, for `speed_accuracy.py` and `failure_map.py`.

On a lattice: minimisers of the energy under a load or a displacement that is raised and lowered step by step (a ramp),
by SciPy's L-BFGS-B, by FIRE and by damped dynamics (GFMD). They reach stable states only, and jump where those end.
On a fixed radial mesh: Newton's method in steps of the control (natural-parameter stepping), and pseudo-arclength steps
along secants, which nothing guards against turning round.
"""

from __future__ import annotations

import itertools
import math
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize

import contbranch as cb
from contbranch.control import as_control
from contbranch.models.axisymmetric.equations import ContactCoordinate, Equations, Fields
from contbranch.models.axisymmetric.mesh import mesh_on
from contbranch.models.grid.newton import Equilibrium, Hold, control_held
from contbranch.models.grid.problem import GridProblem
from contbranch.models.grid.setup import Setup
from contbranch.models.grid.size import chosen_size
from studies.dynamics import DEFAULT, Ending, LatticeMotion, Motion, MotionSettings, Place, System, equilibrium

__all__ = [
    "MINIMISERS",
    "Failure",
    "Fire",
    "Lost",
    "Passed",
    "Radial",
    "Seen",
    "jump",
    "lattice",
    "lbfgs",
    "pressed",
    "ramp",
    "relax",
]

Array = NDArray[np.float64]
Held = Literal["load", "displacement"]

# A minimiser has converged where the forces left over are this part of the pressures.
TOLERANCE, ITERATIONS = 1e-6, 3000
# Of FIRE: steps with the force before the steps grow, factors of the steps, α at first, and its factor.
DELAY, GROWTH, SHRINKING, STEERING, FADING = 5, 1.1, 0.5, 0.1, 0.99
# A tip is lost where the smallest gap exceeds so many ranges.
AWAY = 8.0


class Failure(Exception):
    """A method has failed, and knows it.

    Parameters
    ----------
    kind : str
        ``"diverged"``, ``"retraced"``, ``"out of iterations"`` or ``"out of time"``.
    words : str
    """

    def __init__(self, kind: str, words: str) -> None:
        super().__init__(words)
        self.kind = kind


class Lost(Exception):
    """The load has pulled the surfaces apart."""


class Seen(NamedTuple):
    """What is seen of a state."""

    load: float
    displacement: float
    contact_radius: float
    central_gap: float

    @property
    def closeness(self) -> float:
        """One number that tells contact from its absence: the contact radius less the central gap."""
        return self.contact_radius - self.central_gap


# -- minimisers on a lattice ------------------------------------------------------------------------------------------


def lattice(contact: cb.Contact, kind: Literal["free", "periodic"], grid: int, cell: float | None = None) -> Setup:
    """A lattice for a reduced contact; without a cell, of the one that the package would choose."""
    edge = chosen_size(contact, kind, (cell, grid), (None, None), 1e-6)[0]
    return Setup(contact, kind, (edge, edge), (grid, grid))


def lbfgs(problem: GridProblem, u: Array, load: float, hold: Hold) -> Equilibrium:
    """Minimise the energy by SciPy's L-BFGS-B with the wall as bounds: displacements of the nodes as they are."""
    motion = LatticeMotion(problem, hold)
    scale = problem.lattice.node_area
    tension = hold.row is None and hold.value < 0.0

    def energy(x: Array) -> tuple[float, Array]:
        place = motion.place(x.reshape(problem.shape))
        if tension and float(place.fields.gap.min()) > AWAY * motion_length(problem):
            raise Lost
        return motion.energy(place) / scale, place.fields.excess.ravel()

    bounds = np.stack([-problem.heights.ravel(), np.full(u.size, np.inf)], axis=1)
    strongest = float(np.abs(problem.respond(np.linspace(0.0, 4.0, 200) * motion_length(problem))[1]).max())
    options = {"gtol": TOLERANCE * strongest, "ftol": 0.0, "maxiter": ITERATIONS, "maxfun": 2 * ITERATIONS}
    start = np.maximum(u, -problem.heights).ravel()
    found = minimize(energy, start, jac=True, method="L-BFGS-B", bounds=bounds, options=options | {"maxcor": 20})
    place = motion.place(found.x.reshape(problem.shape))
    free = np.abs(place.force).max() / strongest  # line searches stall at rounding: judge by the forces left over
    ending = Ending.CONVERGED if free < 100.0 * TOLERANCE else Ending.STEPS
    fields = place.fields
    displacement = problem.displacement(fields.u, fields.load)
    reason = "" if ending is Ending.CONVERGED else ending.value
    return Equilibrium(
        fields, fields.gap <= 0.0, place.residual, displacement, not reason, int(found.nit), int(found.nfev), reason
    )


def motion_length(problem: GridProblem) -> float:
    """The range of the law."""
    return 1.0 if problem.law is None else min(term.range for term in problem.law.terms)


class Fire(Motion[Place]):
    """FIRE, the fast inertial relaxation engine, with the mobility as metric.

    Momentum is steered towards the force at constant length as long as it works with the force, in steps that grow;
    when it works against it, half of the last change is taken back, momentum is dropped, and steps are halved:

        π' = (1 - α)(π + τ f) + α |π + τ f| f/|f|,      u' = u + τ W π'.

    References: Bitzek, Koskinen, Gähler, Moseler & Gumbsch, Phys. Rev. Lett. 97, 170201 (2006); Guénolé et al., Comput.
    Mater. Sci. 175, 109584 (2020) (semi-implicit steps, half a step back). The constants are theirs, but that steps are
    bounded by the limit of stability.
    """

    steering, along = STEERING, 0

    def __init__(self, system: System[Place], place: Place, settings: MotionSettings = DEFAULT) -> None:
        super().__init__(system, place, settings)
        self.time *= 0.5

    def steer(self, against: bool) -> None:
        """Steer, or take back half of what worked against the force."""
        self.along += 1
        if against:
            # What is held stays: taken back, it would be held again at once, and nothing would have moved.
            self.place = self.system.move(self.place, None, self.system.confine(self.place, self.change), -0.5)
            self.force = self.system.force(self.place)
            self.momentum = np.zeros_like(self.force)
            self.time, self.steering, self.along = max(SHRINKING * self.time, 0.02 * self.longest), STEERING, 0
        elif self.along > DELAY:
            self.time, self.steering = min(GROWTH * self.time, self.longest), FADING * self.steering
        momentum = self.momentum + self.time * self.force
        towards = np.linalg.norm(momentum) / (np.linalg.norm(self.force) or 1.0)
        self.momentum = (1.0 - self.steering) * momentum + (self.steering * towards) * self.force


def relax(
    problem: GridProblem,
    u: Array,
    load: float,
    hold: Hold,
    method: type[Motion[Any]] = Motion,
    settings: MotionSettings = DEFAULT,
) -> Equilibrium:
    """Relax a trial field from rest by damped dynamics; what overlaps with the wall is moved out of it."""
    before, motion = problem.counter.equilibrium, LatticeMotion(problem, hold)
    place, steps, ending = method(motion, motion.place(u), settings).run()
    return equilibrium(motion, place, steps, problem.counter.equilibrium - before, ending)


def dynamics(method: type[Motion[Any]]) -> Callable[[GridProblem, Array, float, Hold], Equilibrium]:
    """Damped dynamics as a minimiser."""

    def relaxed(problem: GridProblem, u: Array, load: float, hold: Hold) -> Equilibrium:
        found = relax(problem, u, load, hold, method, MotionSettings(TOLERANCE, ITERATIONS))
        if found.reason == Ending.ESCAPED.value:
            raise Lost
        return found

    return relaxed


MINIMISERS = {"L-BFGS-B": lbfgs, "FIRE": dynamics(Fire), "GFMD": dynamics(Motion)}
Minimiser = Callable[[GridProblem, Array, float, Hold], Equilibrium]


def seen(problem: GridProblem, state: Equilibrium) -> Seen:
    """What a user reads off: the contact by counting nodes, the gap at the node next to the apex."""
    touching = state.fields.gap <= 0.0
    radius = math.sqrt(float(touching.sum()) * problem.lattice.node_area / math.pi)
    return Seen(state.fields.load, state.displacement, radius, max(float(state.fields.gap.min()), 0.0))


def pressed(problem: GridProblem, control: Held, value: float) -> Array:
    """Where to begin: the tip rigidly at a displacement, or at that of Hertz' (DMT's) contact for a load."""
    depth = value if control == "displacement" else float(np.cbrt(0.75 * max(value, 0.0)) ** 2)
    return np.full(problem.shape, -depth)


@dataclass(frozen=True)
class Passed:
    """The states passed on a ramp, and the value at which the surfaces came apart, if they did.

    Attributes
    ----------
    values : tuple of float
    states : tuple of Seen
    lost : float or None
    """

    values: tuple[float, ...]
    states: tuple[Seen, ...]
    lost: float | None = None


def ramp(
    problem: GridProblem, minimise: Minimiser, control: Held, values: Sequence[float], until: float = math.inf
) -> Passed:
    """Minimise at one value of the control after the other, each from the state before.

    Parameters
    ----------
    until : float
        Processor time (`time.process_time`) at which to give up.

    Raises
    ------
    Failure
        If a state has not converged, or time is up.
    """
    u, load = pressed(problem, control, values[0]), 0.0
    states: list[Seen] = []
    for value in values:
        if time.process_time() > until:
            raise Failure("out of time", f"time was up at {control} {value:.4g}")
        hold = control_held(problem, as_control(control), float(value))
        try:
            state = minimise(problem, u, load, hold)
        except Lost:
            return Passed(tuple(values[: len(states)]), tuple(states), float(value))
        if not np.isfinite(state.residual):
            raise Failure("diverged", f"forces are not finite at {control} {value:.4g}")
        if not state.converged:
            raise Failure("out of iterations", f"{state.steps} iterations did not suffice at {control} {value:.4g}")
        states.append(seen(problem, state))
        u, load = state.u, state.fields.load
    return Passed(tuple(values), tuple(states))


def jump(passed: Passed, least: float = 0.0) -> float | None:
    """The value at which a ramp jumps, in the middle of a step; None if it does not.

    A jump is a change of the closeness above `least` and four times those of the steps before and after.
    """
    values = list(passed.values)
    if passed.lost is not None:
        return 0.5 * (values[-1] + passed.lost) if values else passed.lost
    change = np.abs(np.diff([state.closeness for state in passed.states]))
    if len(change) < 3:
        return None
    k = int(np.argmax(change))
    others = max(change[k - 1] if k else 0.0, change[k + 1] if k + 1 < len(change) else 0.0)
    if change[k] <= max(least, 4.0 * others):
        return None
    return 0.5 * (values[k] + values[k + 1])


def touches(passed: Passed) -> float | None:
    """The value at which the contact appears or vanishes; None if it does not."""
    contact = np.array([state.contact_radius > 0.0 for state in passed.states])
    changes = np.flatnonzero(contact[1:] != contact[:-1])
    return None if len(changes) == 0 else 0.5 * (passed.values[changes[0]] + passed.values[changes[0] + 1])


# -- continuation on a fixed radial mesh ------------------------------------------------------------------------------


@dataclass
class Radial:
    """The axisymmetric equations on a mesh that stays as it is: unknowns h at its nodes, and the contact coordinate y.

    y is the contact radius squared, or minus the central gap. Panels are of equal length.

    Attributes
    ----------
    contact : Contact
        In reduced units.
    nodes : int
    reach : float
        Radius at which the mesh ends.
    """

    contact: cb.Contact
    nodes: int
    reach: float
    order: int = 8
    _sides: dict[bool, Equations] = field(default_factory=dict, init=False)

    def __post_init__(self) -> None:
        tip, law = self.contact.axisymmetric_tip, self.contact.interaction
        edges = np.linspace(0.0, self.reach, self.nodes // self.order + 1)
        mesh, coordinate = mesh_on(edges, self.order), ContactCoordinate(tip, 2.0)
        self._sides = {side: Equations(tip, law, mesh, coordinate, side) for side in (False, True)}

    @property
    def size(self) -> int:
        """Values of h."""
        return self._sides[True].mesh.size

    def at(self, y: float) -> Equations:
        """The equations with or without contact."""
        return self._sides[y > 0.0]

    def fields(self, x: Array) -> tuple[Equations, Fields]:
        """Everything that follows from (h, y)."""
        y = float(x[-1])
        equations = self.at(y)
        return equations, equations.fields(np.array(x[:-1]), y)

    def seen(self, x: Array) -> Seen:
        """Load, displacement, radius and gap."""
        equations, fields = self.fields(x)
        y = float(x[-1])
        radius, gap = (math.sqrt(y), 0.0) if y > 0.0 else (0.0, -y)
        return Seen(equations.load(fields), equations.displacement(fields), radius, gap)

    def linearised(self, x: Array, control: Held) -> tuple[Array, float, Array, Array]:
        """Residual, controlled quantity, Jacobian (N, N + 1), and the gradient of the controlled quantity."""
        equations, fields = self.fields(x)
        if not fields.finite:
            raise FloatingPointError
        matrix = np.column_stack([equations.jacobian(fields), equations.slopes(fields)[1]])
        load, displacement = equations.gradients(fields)
        rates = equations.rates(fields, np.zeros(self.size), 1.0)
        if control == "load":
            return fields.residual, equations.load(fields), matrix, np.append(load, rates[0])
        return fields.residual, equations.displacement(fields), matrix, np.append(displacement, rates[1])

    def newton(
        self, x: Array, row: Callable[[Array, float, Array], tuple[float, Array]], control: Held
    ) -> tuple[Array, int]:
        """Newton's method for the equations and one more, whose value and gradient `row` makes; no line search.

        Raises
        ------
        Failure
            If it has not converged in 12 steps.
        """
        for iteration in range(1, 13):
            try:
                residual, value, matrix, gradient = self.linearised(x, control)
                excess, last = row(x, value, gradient)
                step = np.linalg.solve(np.vstack([matrix, last]), -np.append(residual, excess))
            except (FloatingPointError, OverflowError, np.linalg.LinAlgError):
                break
            x = x + step
            if not np.isfinite(x).all() or abs(x[-1]) > 1e9:
                break
            if float(np.abs(step).max()) < 1e-9 * (1.0 + float(np.abs(x).max())):
                return x, iteration
        raise Failure("diverged", "Newton's method does not converge")

    def held(self, x: Array, control: Held, value: float) -> Array:
        """The state at a value of the control."""
        return self.newton(x, lambda _, now, gradient: (now - value, gradient), control)[0]

    def along(self, coordinates: Sequence[float]) -> list[Array]:
        """States at values of y, which changes one way along the whole curve: what a careful method would follow.

        Raises
        ------
        Failure
            If Newton's method fails with a thousandth of a step.
        """
        states: list[Array] = []
        last = np.append(np.zeros(self.size), coordinates[0])
        for y in coordinates:
            part = 1.0
            while True:
                begin = float(last[-1])
                place = y if part == 1.0 else begin + part * (y - begin)
                try:
                    last = self._at(np.append(last[:-1], place))
                except Failure:
                    part *= 0.25
                    if part < 1e-3 or not states:
                        raise
                    continue
                if place == y:
                    break
                part = min(1.0, 2.0 * part)
            states.append(last)
        return states

    def _at(self, x: Array) -> Array:
        """The state with the contact coordinate of a trial state."""
        unit = np.append(np.zeros(self.size), 1.0)
        return self.newton(x, lambda _, __, ___: (0.0, unit), "load")[0]

    def stepped(self, start: Array, control: Held, values: Sequence[float], until: float) -> Passed:
        """Natural-parameter stepping: Newton's method at one value after the other, steps halved where it fails.

        Raises
        ------
        Failure
            If it fails with a thousandth of a step, or time is up.
        """
        x = self.held(start, control, float(values[0]))
        states, here = [self.seen(x)], float(values[0])
        for goal in values[1:]:
            part = 1.0
            while here != goal:
                if time.process_time() > until:
                    raise Failure("out of time", f"time was up at {control} {here:.4g}")
                target = goal if part == 1.0 else here + part * (goal - here)
                try:
                    x = self.held(x, control, target)
                except Failure as failure:
                    part *= 0.25
                    if part < 1e-3:
                        raise Failure("diverged", f"no convergence beyond {control} {here:.5g}") from failure
                    continue
                here, part = target, min(1.0, 2.0 * part)
            states.append(self.seen(x))
        return Passed(tuple(values), tuple(states))

    def followed(self, start: Array, end: float, control: Held, until: float, points: int = 400) -> list[Array]:
        """Pseudo-arclength steps along secants, without any guard on their direction, until y exceeds `end`.

        Lengths are Euclidean, in h (mean square), y and the control. Steps grow by half after four Newton steps or
        fewer, to a fiftieth of the range of y at most, and are halved where Newton's method fails.

        Raises
        ------
        Failure
            If steps become a millionth of the first one, points are too many, or time is up.
        """
        weight = np.append(np.full(self.size, 1.0 / self.size), 1.0)

        def value(x: Array) -> float:
            seen = self.seen(x)
            return seen.load if control == "load" else seen.displacement

        first = start.copy()
        first[-1] += 0.01 * max(1.0, abs(start[-1]))
        states = [start, self._at(first)]
        controls = [value(x) for x in states]
        length = smallest = 0.0
        largest = 0.02 * (end - float(start[-1]))
        while states[-1][-1] < end:
            if time.process_time() > until:
                raise Failure("out of time", "time was up")
            back = sum(after[-1] < before[-1] for before, after in itertools.pairwise(states))
            if len(states) >= points:
                raise Failure("retraced" if back > 2 else "out of iterations", f"{points} points did not suffice")
            dx, dc = states[-1] - states[-2], controls[-1] - controls[-2]
            norm = math.sqrt(float(weight @ dx**2) + dc * dc)
            dx, dc = dx / norm, dc / norm
            length = length or norm
            smallest = smallest or 1e-6 * norm
            base, anchor, held = states[-1], controls[-1], length

            def plane(
                x: Array,
                now: float,
                gradient: Array,
                base: Array = base,
                anchor: float = anchor,
                dx: Array = dx,
                dc: float = dc,
                held: float = held,
            ) -> tuple[float, Array]:
                return float((weight * dx) @ (x - base)) + dc * (now - anchor) - held, weight * dx + dc * gradient

            try:
                x, count = self.newton(base + length * dx, plane, control)
            except Failure as failure:
                length *= 0.5
                if length < smallest:
                    raise Failure(
                        "retraced" if back > 2 else "diverged", f"no convergence beyond {control} {anchor:.5g}"
                    ) from failure
                continue
            states.append(x)
            controls.append(value(x))
            length = min(largest, length * (1.5 if count <= 4 else 1.0))
        return states

    def indices(self, x: Array, control: Held, nearest: int | None = None) -> int:
        """Number of negative eigenvalues of the second variation, of all or of those nearest to zero.

        At fixed displacement it is 1 + B v'' A; under a load the displacement is one more unknown.
        """
        equations, fields = self.fields(x)
        matrix = equations.response(fields)
        matrix.flat[:: self.size + 1] += 1.0
        if control == "load":
            mesh, a = equations.mesh, fields.rim.radius
            r = np.hypot(a, mesh.nodes)
            share = 2.0 / math.pi * np.arccos(np.clip(a / r, 0.0, 1.0))
            bent = -mesh.abel @ (fields.stiffness * share)
            area = math.pi * mesh.weights * mesh.nodes * fields.stiffness * share
            below = -(area @ fields.rim.plane)
            matrix = np.block([[matrix, bent[:, None]], [below[None, :], np.array([[a + area @ share]])]])
        values = np.linalg.eigvals(matrix).real
        if nearest is not None:
            values = values[np.argsort(np.abs(values))[:nearest]]
        return int((values < 0.0).sum())
