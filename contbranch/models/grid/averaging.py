"""The curve of a contact from that of a lattice: averaged over the arcs between changes of the contact.

On a lattice load and displacement ripple as single nodes join the contact, and where the law is stiff the ripples are
folds. They are the lattice's own. As functions of the contact radius a, which is measured with sub-grid resolution, the
ripples average out: by least squares,

    min ∫ |F(a) - P(a)|² da

over some rows of nodes, P a polynomial. The integral runs along the arcs, each with its length in a: most of the bias
of single states is that they gather where a hardly changes. A spline through the middles of such windows is a piece of
the contact's curve, and its folds are the contact's.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
from scipy.interpolate import CubicSpline

from contbranch.arrays import Array, Flags
from contbranch.continuation import Options, Point
from contbranch.continuation.problem import Linearisation
from contbranch.control import Control
from contbranch.curve.problem import STEPS, Count, Defect, EquilibriumProblem, Four, Rates, Succession, Values
from contbranch.results.profile import Profile

from .arcs import Arc, arcs, onward
from .judged import OnNodes
from .newton import Equilibrium
from .readings import Reading, read
from .resolution import tail_energy
from .setup import Setup

if TYPE_CHECKING:
    from .equilibria import LatticeProblem

__all__ = ["AveragedProblem", "Fit", "Samples", "averaged", "half_width", "turned"]

# Half of a window in rows of nodes, the share of the contact radius that it may take up, and its least; where a row
# has many nodes, fewer rows are enough.
ROWS, SHARE, LEAST, MANY = 3.5, 0.6, 1.6, 110.0
# Degree of the polynomials, and the powers of the radius next to first touch.
DEGREE, FROM_TOUCH_ON = 3, np.array([0, 2, 3])
# Windows, relative: that of the average, the one with which it is compared, and by how much, and how often, wider ones
# where ripples are left.
WINDOW, OTHER, WIDER, WIDENINGS = 1.0, 0.8, 1.15, 4
# Centres of windows a row of nodes, and rows of the curve.
CENTRES, ROWS_A_ROW = 4, 1
# States a row of nodes of which the fields are kept.
STATES = 3
# Weight of first touch, up to where windows begin that hold it, and radius of the first row, in rows of nodes.
TOUCH, FROM_TOUCH, FIRST = 5.0, 0.5, 0.1
# Rows of nodes at most by which an average begins later than the row before it, and by which radii are the same.
JOINT, SAME = 1.5, 1e-6
# Arcs at most of one average, and rows of nodes for which they are followed where steps lead nowhere.
MOST_ARCS, STUCK = 3000, 2.0
# Gauss-Legendre rule for the product of two parabolas.
_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(3)
_NODES, _WEIGHTS = 0.5 * (_NODES + 1.0), 0.5 * _WEIGHTS
_LAGRANGE = np.stack([(1 - _NODES) * (1 - 2 * _NODES), 4 * _NODES * (1 - _NODES), _NODES * (2 * _NODES - 1)])
_SLOPES = np.stack([4 * _NODES - 3, 4 - 8 * _NODES, 4 * _NODES - 1])
# What a contact of few nodes may be off, in units of what changes from its beginning.
BEGINNING = 1.1
# Rows of nodes beside a fold over which its curvature is told.
GRAIN = 1.5
# Error of the contact radius itself, in rows of nodes, and arcs that what is fitted takes off the scatter.
MEASURED, FITTED = 0.03, 3.0


def half_width(radius: float, spacing: float) -> float:
    """Half of the window around a contact radius."""
    rows = radius / spacing
    return spacing * max(LEAST, min(ROWS, SHARE * rows, MANY / max(rows, 1.0)))


def turned(
    seen: Array, controls: Sequence[Control], spacing: float, beyond: float, ended: bool
) -> tuple[float, float | None]:
    """Where a control has turned round, at a radius with rows on both sides over more than what single nodes do.

    Parameters
    ----------
    seen : array (M, 3)
        Load, displacement and contact radius of rows along the curve.
    controls : sequence of Control
    spacing : float
    beyond : float
        Contact radius up to which this is known; negative: from the last row without contact on.
    ended : bool
        Whether no rows will follow, so that those there are must do.

    Returns
    -------
    beyond : float
        Up to where it is known now.
    centre : float or None
        The radius.
    """
    radii = seen[:, 2]
    inner = np.flatnonzero(radii > beyond)
    if beyond < 0.0 and inner.size:
        inner = inner[max(int(np.argmax(radii > 0.0)) - 1, 0) :]
    for k in inner[:-1].tolist():
        half = half_width(radii[k], spacing)
        if k == 0 or (radii[-1] < radii[k] + half and not ended):
            continue
        beyond = max(beyond, float(radii[k]))
        # one row without contact, or beyond the window
        first = max(min(int(np.argmax(radii > max(radii[k] - half, 0.0))), k) - 1, 0)
        for control in controls:
            values = np.array([control.value(*row[:2]) for row in seen[first:]])
            others = np.delete(values, k - first)
            if k > first and not others.min() < values[k - first] < others.max():
                return beyond, float(radii[k])
    return beyond, None


@dataclass
class Samples:
    """What was read off the arcs, in order.

    Attributes
    ----------
    radius, values, perimeters, weight : list
        Of three states an arc: contact radius; load, displacement and energy; length of the rim; share of the integral
        over the radius.
    ends : list
        Contact radius at the end of every arc.
    states : list of (float, Equilibrium)
        States with fields, some in every row of nodes, and their contact radii.
    last : Arc or None
    """

    radius: list[float] = field(default_factory=list)
    values: list[tuple[float, float, float]] = field(default_factory=list)
    perimeters: list[float] = field(default_factory=list)
    weight: list[float] = field(default_factory=list)
    ends: list[float] = field(default_factory=list)
    states: list[tuple[float, Equilibrium]] = field(default_factory=list)
    last: Arc | None = None
    _seen: Reading | None = None

    def add(self, setup: Setup, arc: Arc) -> float:
        """Read off an arc; the contact radius at its end."""
        begin = self._seen if self.last is not None and arc.begin is self.last.end else None
        seen = begin or read(setup, arc.begin, cell=False), *(read(setup, s, cell=False) for s in (arc.middle, arc.end))
        self.last, self._seen = arc, seen[2]
        self.ends.append(seen[2].contact_radius)
        if seen[0].contact_radius > 0.0 and np.isfinite([one[:4] for one in seen]).all():
            radii = np.array([one.contact_radius for one in seen])
            own = np.maximum(_LAGRANGE @ (_WEIGHTS * (radii @ _SLOPES)), 0.0)
            length = max(radii[2] - radii[0], 0.0)
            self.weight += (own * (length / own.sum() if own.sum() > 0.0 else 0.0)).tolist()
            self.radius += radii.tolist()
            self.perimeters += [one.perimeter for one in seen]
            self.values += [(one.load, one.displacement, one.energy) for one in seen]
            if not self.states or radii[1] > self.states[-1][0] + setup.lattice.spacing / STATES:
                self.states.append((float(radii[1]), arc.middle.slim()))
        return seen[2].contact_radius

    def begin(self, touch: Reading, spacing: float) -> None:
        """First touch, known by itself: with it the average reaches to a contact of no size."""
        self.radius.append(0.0)
        self.perimeters.append(0.0)
        self.values.append((touch.load, touch.displacement, touch.energy))
        self.weight.append(TOUCH * spacing)


class Fit:
    """Load, displacement and energy over the contact radius: local polynomials, and a spline through their middles.

    Parameters
    ----------
    samples : Samples
    spacing : float
    width : float
        Of the windows, relative.
    """

    def __init__(self, samples: Samples, spacing: float, width: float = WINDOW) -> None:
        self.samples, self.spacing, self.width = samples, spacing, width
        self.radius, self.weight = np.array(samples.radius), np.array(samples.weight)
        self.values = np.array(samples.values).reshape(-1, 3)
        self.first, self.last = (float(f(self.radius)) for f in (np.min, np.max))
        count = max(4, int(CENTRES * (self.last - self.first) / spacing))
        self.centres = np.linspace(self.first, self.last, count)
        middles, self.scatter = (np.array(own) for own in zip(*map(self._window, self.centres), strict=True))
        self.curve = CubicSpline(self.centres, middles)

    def _window(self, radius: float) -> tuple[Array, Array]:
        """The average at a radius, and the error that the scatter of the arcs leaves to it."""
        half = self.width * half_width(radius, self.spacing)
        room = 0.5 * half
        centre = min(max(radius, self.first + room), max(self.last - room, self.first + room))
        distance = np.abs(self.radius - centre)
        enough = np.sort(distance[self.weight > 0.0])[: 3 * (DEGREE + 1)]
        half = max(half, 1.001 * float(enough[-1]))
        near = (distance < half) & (self.weight > 0.0)
        share = (1.0 - (distance / half) ** 3) ** 3
        origin, unit, powers = centre, half, np.arange(DEGREE + 1)
        if self.first == 0.0 and centre - half <= FROM_TOUCH * self.spacing:
            # Behind first touch the film goes on as before but for the square of the radius, the contact its cube.
            origin, unit, powers = 0.0, centre + half, FROM_TOUCH_ON
            near[0], share[0] = True, 1.0
        basis, values = ((self.radius[near, None] - origin) / unit) ** powers, self.values[near]
        weight = np.sqrt(self.weight[near] * share[near])[:, None]
        found = np.linalg.lstsq(basis * weight, values * weight, rcond=None)[0]
        left = np.sqrt(((weight * (values - basis @ found)) ** 2).sum(axis=0) / (weight**2).sum())
        arcs = max(len(values) / 3.0, 1.0)  # few of them are fitted better than they should be
        return ((radius - origin) / unit) ** powers @ found, left * (1.0 + FITTED / arcs) / np.sqrt(arcs)

    @cached_property
    def other(self) -> Fit:
        """Over other windows, which tells its errors."""
        return Fit(self.samples, self.spacing, OTHER * self.width)

    def turns(self, control: Control) -> tuple[Array, Array]:
        """Contact radii where what is controlled turns round, and its values there."""
        own = CubicSpline(self.centres, self.curve(self.centres)[:, :2] @ control.weights)
        found = own.derivative().roots(extrapolate=False)
        return found, own(found)

    def rippled(self, controls: Sequence[Control]) -> bool:
        """Whether neighbouring folds of a control differ by less than their errors."""
        errors = self.scatter + np.abs(self.curve(self.centres) - self.other.curve(self.centres))
        for control in controls:
            places, heights = self.turns(control)
            left = np.interp(places, self.centres, errors[:, :2] @ np.abs(control.weights))
            if (np.abs(np.diff(heights)) < np.maximum(left[1:], left[:-1])).any():
                return True
        return False


class AveragedProblem(OnNodes):
    """The average over a stretch of arcs: x = (F, d), and the parameter is the contact radius.

    Parameters
    ----------
    lattice : LatticeProblem
    samples : Samples
    fit : Fit
    first : float
        Contact radius at which its rows begin.
    """

    ordered = True
    rounding = 1e-12

    def __init__(self, lattice: LatticeProblem, samples: Samples, fit: Fit, first: float) -> None:
        self.lattice, self.samples, self.fit, self.first = lattice, samples, fit, first
        self.setup, self.scale, self.work = lattice.setup, lattice.setup.lattice.spacing, lattice.work
        self.states, self.behind = list(samples.states), samples.last

    @property
    def parameter_range(self) -> tuple[float, float]:
        """The stretch."""
        return self.first, self.fit.last

    def residual(self, x: Array, p: float) -> Array:
        """How far load and displacement are from the average."""
        return x - self.fit.curve(p)[:2]

    def linearise(self, x: Array, p: float) -> Linearisation:
        """The identity, and the slopes of the average."""
        return Linearisation(self.residual(x, p), np.eye(2), -self.fit.curve(p, 1)[:2])

    def row(self, p: float) -> Point:
        """The point at a contact radius."""
        x, slope = self.fit.curve(p)[:2], self.fit.curve(p, 1)[:2]
        return Point(self, x, p, slope, 1.0, observables=self.observables(x, p))

    def start(self, control: Control) -> Point:
        """Where its rows begin."""
        return self.row(self.first)

    def steps(self, start: Point) -> Options:
        """Some in every row of nodes."""
        share = self.setup.lattice.spacing / (ROWS_A_ROW * (self.fit.last - self.first))
        share = min(share, 0.5)
        return replace(
            STEPS, largest_parameter_step=share, first_step=share, angle=1.0, angle_limit=1.5, tolerance=1e-6
        )

    def successor(self, name: str, points: Sequence[Point]) -> Succession | None:
        """It takes the place of rows that it spans; behind its last arc the lattice's own curve goes on."""
        if name == "average":
            radii = [row.observables["contact_radius"] for row in points[:-1]]
            least, slack = (1, 0.0) if self.lattice.past is None else (0, SAME * self.scale)  # one average, or two
            kept = next((k for k, radius in enumerate(radii) if radius > self.first - slack), len(radii))
            return Succession("", points[-1], (points[-1],), dropped=len(points) - max(kept, least))
        start = self.lattice.behind(self.samples)
        ahead = np.array([start.observables[name] for name in ("load", "displacement")])
        # The lattice's own rows ripple about the average: rows of it from which they would turn back are dropped.
        near = [row for row in points if start.observables["contact_radius"] - row.parameter < JOINT * self.scale]
        on = (np.sign(ahead - row.x) == np.sign(self.fit.curve(row.parameter, 1)[:2]) for row in reversed(near))
        dropped = next((k for k, found in enumerate(on, start=1) if found.all()), 1)
        return Succession("", points[-dropped], (start,), same=False, dropped=dropped)

    def values(self, x: Array, p: float) -> Values:
        """Of the average."""
        load, displacement, energy = self.fit.curve(p).tolist()
        return Values(load, displacement, p, 0.0, energy)

    def observables(self, x: Array, p: float) -> Mapping[str, float]:
        """The values, and the length of the rim."""
        perimeter = float(np.interp(p, self.samples.radius, self.samples.perimeters))
        return self.values(x, p)._asdict() | {"perimeter": perimeter, "fft_pairs": float(self.state(p).pairs)}

    def rates(self, x: Array, p: float, x_rate: Array, p_rate: float) -> Rates:
        """Of the average."""
        load, displacement, _ = (p_rate * self.fit.curve(p, 1)).tolist()
        return Rates(load, displacement, p_rate, 0.0)

    def finer(self) -> AveragedProblem:
        """Over other windows, which tells its errors."""
        return self._other

    @cached_property
    def _other(self) -> AveragedProblem:
        return AveragedProblem(self.lattice, self.samples, self.fit.other, self.first)

    def meeting(self, begin: Point, end: Point, control: Control, value: float) -> Point | None:
        """The state on the lattice next to the place where the average has the value; None if it leaves that place."""
        known = [control.value(row.observables["load"], row.observables["displacement"]) for row in (begin, end)]
        share = (value - known[0]) / (known[1] - known[0]) if known[1] != known[0] else 0.0
        last = end.observables["contact_radius"]  # the end may be a row of the lattice behind
        place = begin.parameter + share * (last - begin.parameter)
        found = self.lattice.beside(self.nearest(place), control, value)
        if found is None:
            return None
        radius = self.lattice.reading(found.x, found.parameter).contact_radius
        return replace(found, problem=self.lattice.next_to(self)) if abs(radius - place) < self.scale else None

    def around(self, point: Point, control: Control | None) -> Array:
        """Errors of load, displacement, radius and gap of a state on the lattice: how far it is from the average, and
        that from the contact's curve; at a value of a control, what these change there."""
        load, displacement, radius, _ = self.lattice.reading(point.x, point.parameter)[:4]
        p = min(max(radius, self.first), self.fit.last)
        values, slopes = self.fit.curve(p)[:2], self.fit.curve(p, 1)[:2]
        off = np.abs(np.array([load, displacement]) - values) + np.abs(self.left_out(values, p)[:2])
        off += np.abs(self.defect(self.row(p))[:2])
        along = MEASURED * self.scale
        if control is not None:
            rate = abs(control.weighted(*slopes))
            along += abs(radius - p) + (control.weighted(*off) / rate if rate else math.inf)
        return np.array([*(off + np.abs(slopes) * along), along, 0.0])

    def left_out(self, x: Array, p: float) -> Four:
        """What the scatter of the arcs, the radius, and the beginning of the contact leave open, and the cell does."""
        fit, spacing = self.fit, self.fit.spacing
        error = np.array([np.interp(p, fit.centres, own) for own in fit.scatter[:, :2].T])
        error += MEASURED * spacing * np.abs(fit.curve(p, 1)[:2])
        error *= max(1.0, self.lattice.resolution.ratio)
        if fit.first == 0.0:  # what is wrong with the film at first touch is felt over some rows
            error += np.nan_to_num(self.lattice.touch_error / (1.0 + (p / spacing) ** 2), posinf=0.0)
        elif p < LEAST * spacing:  # where the contact begins is not in the window
            error += BEGINNING * np.abs(fit.curve(p) - fit.values[np.argmin(fit.radius)])[:2]
        load, displacement, radius, _ = read(self.setup, self.nearest(p)).errors
        return float(error[0]) + load, float(error[1]) + displacement, MEASURED * spacing + radius, 0.0

    def energy_left_out(self, x: Array, p: float) -> float:
        """That of the interaction outside the cell."""
        return tail_energy(self.setup, self.nearest(p))

    def shared(self, point: Point) -> tuple[float, float]:
        """What the cell leaves out."""
        load, displacement, *_ = read(self.setup, self.nearest(point.parameter)).errors
        return load, displacement

    def defect(self, point: Point) -> Defect:
        """By the other windows."""
        p = point.parameter
        load, displacement, _ = (self.fit.curve(p) - self.fit.other.curve(p)).tolist()
        return Defect(load, displacement, 0.0)

    def verdict(self, point: Point, control: Control, error: Sequence[float]) -> tuple[str | None, str]:
        """It was not looked for on another lattice."""
        count = int(self._near(point.parameter).sum()) // 3
        return "averaged", f"The average over {count} changes of the contact on the lattice."

    def _near(self, p: float) -> Flags:
        """Which of what was read off the arcs is in the window around a contact radius."""
        return np.abs(self.fit.radius - p) < self.fit.width * half_width(p, self.fit.spacing)

    # -- the states beside it -----------------------------------------------------------------------------------------
    def state(self, p: float) -> Equilibrium:
        """The state with fields next to a contact radius; of these u, load and contact only."""
        return min(self.states, key=lambda one: abs(one[0] - p))[1]

    def nearest(self, p: float) -> Equilibrium:
        """The same with all fields; one pair of transforms."""
        return self.lattice.state(*self.beside(p))

    def at(self, point: Point) -> Equilibrium:
        """The state on the lattice next to a row."""
        return self.nearest(point.parameter)

    def beside(self, p: float) -> tuple[Array, float]:
        """Its u and load."""
        state = self.state(p)
        return state.u.ravel(), state.load

    @property
    def grain(self) -> float:
        """Rows of nodes over which the average of the second derivative forgets the ripples."""
        return GRAIN * self.fit.spacing

    @property
    def countable(self) -> bool:
        """Not of the states beside it, with their ripples."""
        return False

    def unstable(self, x: Array, p: float) -> int:
        """Of the state beside it."""
        return self.lattice.modes.symmetric(self.nearest(p))

    def azimuthal(self, x: Array, p: float, unstable: int, limit: int = 32, near: Sequence[int] = ()) -> Count | None:
        """Of the state beside it."""
        return self.lattice.azimuthal(*self.beside(p), unstable, limit, near)

    def profile(self, x: Array, p: float) -> Profile:
        """Of the state beside it."""
        return self.lattice.profile(*self.beside(p))

    def described(self, x: Array, p: float) -> Mapping[str, Any]:
        """Of the state beside it."""
        return self.lattice.described(*self.beside(p))

    def relaxes_to(self, other: EquilibriumProblem) -> bool:
        """Whatever lies on the lattice."""
        return self.lattice.relaxes_to(other)

    def relaxed(self, fold: Point, control: Control, direction: int, others: Sequence[Point]) -> int | None:
        """From the state beside the fold, over the barriers of the arcs of which it is an average."""
        near = self._near(fold.parameter)
        value = control.value(*self.values(fold.x, fold.parameter)[:2])
        held = [direction * (control.value(load, way) - value) for load, way, _ in self.fit.values[near].tolist()]
        begin = self.nearest(fold.parameter)
        return self.lattice.landed(begin, fold, control, direction, others, max(0.0, *held))

    def away(self, point: Point, state: Equilibrium) -> float:
        """Whether a state with about the contact radius of a point is far from it."""
        radius = read(self.setup, state, cell=False).contact_radius
        return 0.0 if abs(radius - point.parameter) <= self.setup.lattice.spacing else np.inf


def averaged(
    lattice: LatticeProblem, points: Sequence[Point], centre: float, controls: Sequence[Control], stuck: bool
) -> Point | None:
    """The average around a contact radius that has been passed, or where steps lead nowhere: its first point.

    Parameters
    ----------
    points : sequence of Point
        The rows of the piece of curve, in order.
    controls : sequence of Control
        Every fold of which is to lie well inside.
    stuck : bool
    """
    setup = lattice.setup
    spacing, wide = setup.lattice.spacing, half_width(centre, setup.lattice.spacing)
    radii = np.array([point.observables["contact_radius"] for point in points])
    samples, row = lattice.past, 0
    if samples is not None and samples.last is not None and samples.ends[-1] >= centre - 1.5 * wide:
        way = onward(samples.last.middle, samples.last.end)
    else:
        below = np.flatnonzero(radii[:-1] <= max(centre - 1.3 * wide, 0.0))
        if not below.size or not (points[row := int(below[-1])].x.size and points[row + 1].x.size):
            return None
        way = lattice.at(points[row]), lattice.at(points[row + 1])
        samples = Samples()
        if row == 0 and lattice.film:
            samples.begin(Reading(*lattice.values(lattice.film[-1].x, lattice.film[-1].parameter)), spacing)
    wanted, known = centre + (STUCK * spacing if stuck else 0.0), len(samples.ends)
    reach, fit = wanted, None
    for arc in arcs(setup.problem, setup.length, way, lattice.settings):
        end_radius = samples.add(setup, arc)
        if end_radius >= reach + 1.3 * half_width(reach, spacing):
            fit = _ironed(samples, spacing, controls)
            reach = max([reach, *(float(radius) for one in controls for radius in fit.turns(one)[0])])
            if reach + 1.1 * half_width(reach, spacing) < end_radius:
                break
        if end_radius < max(samples.ends) - STUCK * spacing or end_radius > 0.49 * setup.edge:
            break
        if len(samples.ends) - known > MOST_ARCS:
            break
    if not (len(samples.ends) > known + 2 and samples.radius and samples.radius[-1] > wanted):
        return None
    fit = fit or _ironed(samples, spacing, controls)
    kept, least = points[row], fit.first + FIRST * spacing * (fit.first == 0.0)
    x_rate, load = kept.tangent_x, kept.tangent_parameter
    if row:
        x_rate, load = kept.x - points[row - 1].x, kept.parameter - points[row - 1].parameter
    load, displacement, *_ = lattice.rates(kept.x, kept.parameter, x_rate, load)
    first = _joint(fit, max(kept.observables["contact_radius"], least), (load, displacement), controls)
    return None if first >= fit.last else AveragedProblem(lattice, samples, fit, first).row(first)


def _joint(fit: Fit, first: float, ahead: tuple[float, float], controls: Sequence[Control]) -> float:
    """The first contact radius, from one on, at which the average goes the way of the lattice's curve before it."""
    way = np.sign([one.weighted(*ahead) for one in controls])
    for radius in first + fit.spacing * np.linspace(0.0, JOINT, 13):
        slopes = [one.weighted(*fit.curve(radius, 1)[:2]) for one in controls]
        if (np.sign(slopes) == way).all():
            return float(radius)
    return first


def _ironed(samples: Samples, spacing: float, controls: Sequence[Control]) -> Fit:
    """The average over windows so wide that its folds differ by more than the ripples leave."""
    fit = Fit(samples, spacing)
    for _ in range(WIDENINGS):
        if not fit.rippled(controls):
            break
        fit = Fit(samples, spacing, WIDER * fit.width)
    return fit
