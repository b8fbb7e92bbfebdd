"""The curve of a contact with one round rim from states on a lattice: averaged over the changes of the contact.

On a lattice load and displacement ripple as single nodes join the contact, and where the law is stiff the ripples are
folds. They are the lattice's own. As functions of the contact radius a, which is measured with sub-grid resolution, the
ripples average out: by least squares,

    min ∫ |F(a) - P(a)|² da

over some rows of nodes, P a polynomial. The integral runs along pieces with one contact each (`corners`), each with its
length in a: most of the bias of single states is that they gather where a hardly changes. A spline through the middles
of such windows is the contact's curve, and its folds are the contact's.

The pieces are found by their contacts, without a step along the curve: the nodes with the smallest gaps are next to
join, and with a contact given, the state in which one more node just closes solves smooth equations.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from operator import itemgetter
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from scipy.interpolate import CubicSpline

from contbranch.arrays import Array, Flags
from contbranch.continuation import Options, Point
from contbranch.continuation.problem import Linearisation
from contbranch.control import DISPLACEMENT, LOAD, Control
from contbranch.curve.problem import STEPS, Defect, EquilibriumProblem, Four, Rates, Values
from contbranch.curve.trace import END_FACTOR, LEAST_END
from contbranch.results.profile import Profile

from .contact_area import FEW, rim_noise
from .corners import ZERO_MARGIN, Corners, Way
from .judged import OnNodes
from .measure import Direction, Measure
from .newton import Equilibrium
from .readings import Reading, read
from .resolution import fills, tail_energy
from .setup import Setup

if TYPE_CHECKING:
    from .equilibria import LatticeProblem

__all__ = ["AveragedProblem", "Fit", "Piece", "Samples", "averaged", "half_width", "pieces"]

# Half of a window in rows of nodes, the share of the contact radius that it may take up, and its least; where a row
# has many nodes, fewer rows are enough.
ROWS, SHARE, LEAST, MANY = 3.5, 0.6, 1.6, 110.0
# Degree of the polynomials, and the powers of the radius next to first touch.
DEGREE, FROM_TOUCH_ON = 3, np.array([0, 2, 3])
# Windows, relative: that of the average, the one with which it is compared, and by how much, and how often, wider ones
# where ripples are left.
WINDOW, OTHER, WIDER, WIDENINGS = 1.0, 0.8, 1.15, 4
# Centres of windows in a row of nodes; rows between pieces where nothing turns round.
CENTRES, APART = 4, 0.5
# Weight of first touch, up to where windows begin that hold it, and radius of the first row, in rows of nodes.
TOUCH, FROM_TOUCH, FIRST = 5.0, 0.5, 0.1
# Half widths of a window by which pieces go on beyond what is asked of the curve, and around a fold.
BEYOND = 1.1
# Contacts that are tried for one corner, pieces at most, and part of the largest contact below which it has come back.
TARGETS, MOST_PIECES, SHRUNK = 4, 3000, 0.7
# Gauss-Legendre rule for the product of two parabolas.
_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(3)
_NODES, _WEIGHTS = 0.5 * (_NODES + 1.0), 0.5 * _WEIGHTS
_LAGRANGE = np.stack([(1 - _NODES) * (1 - 2 * _NODES), 4 * _NODES * (1 - _NODES), _NODES * (2 * _NODES - 1)])
_SLOPES = np.stack([4 * _NODES - 3, 4 - 8 * _NODES, 4 * _NODES - 1])
# Rows of nodes beside a fold over which its curvature is told.
GRAIN = 1.5
# Pieces that what is fitted takes off the scatter.
FITTED = 3.0
# Scatters that an energy may be off.
SCATTERS = 3.0


class Piece(NamedTuple):
    """Three equilibria of one contact: where its last node has just closed, in the middle, where the next one does."""

    begin: Equilibrium
    middle: Equilibrium
    end: Equilibrium


Place = tuple[Equilibrium, Way]


def half_width(radius: float, spacing: float) -> float:
    """Half of the window around a contact radius."""
    rows = radius / spacing
    return spacing * max(LEAST, min(ROWS, SHARE * rows, MANY / max(rows, 1.0)))


def pieces(lattice: LatticeProblem, begin: Place, rows: float = 0.0) -> Iterator[Piece]:
    """Pieces of the curve from a place on, as long as they are found.

    Parameters
    ----------
    begin : (Equilibrium, Way)
        A state, with the direction of the curve there.
    rows : float
        Rows of nodes between neighbouring pieces; 0: they join.
    """
    corners, multiplicity = lattice.corners, lattice.setup.lattice.multiplicity
    place: Place | None = begin
    before, largest = begin[0], 0
    for _ in range(MOST_PIECES):
        if place is None or fills(lattice.setup, place[0]):
            return
        count = int(place[0].contact.sum())
        largest = max(largest, count)
        if count < SHRUNK * largest - 1:  # the way leads back
            return
        state, way = place
        found = corners.next(state, way)
        if found is None:
            return
        end, node = found
        yield Piece(state, _middle(corners, state, end), end)
        joining = int(rows * 2.0 * np.sqrt(np.pi * end.contact.sum() / multiplicity))
        place = _leap(corners, before, end, way, joining) if joining > 1 else None
        place, before = place or corners.behind(end, node, way), end


def _leap(corners: Corners, before: Equilibrium, last: Equilibrium, way: Way, joining: int) -> Place | None:
    """The corner at which so many nodes have joined the contact behind the last of two others."""
    known, earlier = (int(state.contact.sum()) for state in (last, before))
    gap = np.where(last.contact, np.inf, last.fields.gap)
    contact = last.contact | (gap <= np.partition(gap, joining - 1, None)[joining - 1])
    if corners.problem.swapped:
        contact |= contact.T
    ahead = (int(contact.sum()) - known) / max(known - earlier, 1)
    u, load = last.u + ahead * (last.u - before.u), last.load + ahead * (last.load - before.load)
    row, column = np.unravel_index(int(np.where(contact & ~last.contact, gap, -np.inf).argmax()), gap.shape)
    node = int(row), int(column)
    for _ in range(TARGETS):
        corner = corners.at(replace(last, contact=contact), u, load, node)
        if corner is None:
            return None
        margins = corners.margins(corner)
        wrong = margins < -ZERO_MARGIN  # others have joined before, or would leave
        if not wrong.any():
            closing = contact & (np.abs(margins) <= ZERO_MARGIN)
            closing[node] = True
            return corners.behind(replace(corner, contact=contact & ~closing), node, way)
        contact, u, load = contact ^ wrong, corner.u, corner.load
        contact[node] = True
    return None


def _middle(corners: Corners, begin: Equilibrium, end: Equilibrium) -> Equilibrium:
    """The state half the way from one to another of the same contact."""
    way = Direction.along(Measure.at(begin, corners.length), *end.beyond(begin))
    return corners.beside(begin, 0.5 * (begin.u + end.u), 0.5 * (begin.load + end.load), way) or begin


@dataclass
class Samples:
    """What was read off the pieces.

    Attributes
    ----------
    setup : Setup
    radius, values, perimeters, weight : list
        Of three states a piece: contact radius; load, displacement and energy; length of the rim; share of the integral
        over the radius. First of all, first touch is known by itself.
    states : list of (float, Equilibrium)
        Those in the middle, with fields, and their contact radii.
    """

    setup: Setup
    radius: list[float] = field(default_factory=list)
    values: list[tuple[float, float, float]] = field(default_factory=list)
    perimeters: list[float] = field(default_factory=list)
    weight: list[float] = field(default_factory=list)
    states: list[tuple[float, Equilibrium]] = field(default_factory=list)

    @staticmethod
    def behind(touch: Values, setup: Setup) -> Samples:
        """None but first touch: with it the average reaches to a contact of no size."""
        spacing = setup.lattice.spacing
        return Samples(setup, [0.0], [(touch.load, touch.displacement, touch.energy)], [0.0], [TOUCH * spacing])

    def add(self, piece: Piece) -> Reading:
        """Read off a piece; what is seen at its end."""
        seen = [read(self.setup, state, cell=False) for state in piece]
        if seen[0].contact_radius > 0.0 and np.isfinite([one[:4] for one in seen]).all():
            radii = np.array([one.contact_radius for one in seen])
            own = np.maximum(_LAGRANGE @ (_WEIGHTS * (radii @ _SLOPES)), 0.0)
            length = max(radii[2] - radii[0], 0.0)
            self.weight += (own * (length / own.sum() if own.sum() > 0.0 else 0.0)).tolist()
            self.radius += radii.tolist()
            self.perimeters += [one.perimeter for one in seen]
            self.values += [(one.load, one.displacement, one.energy) for one in seen]
            self.states.append((float(radii[1]), piece.middle.slim()))
        return seen[2]

    def replaced(self, others: Samples) -> Samples:
        """These outside of the range of others, and the others."""
        low, high = min(others.radius[1:]), max(others.radius[1:])
        kept = [not low <= radius <= high for radius, _ in self.states]
        of_three = np.array([True, *np.repeat(kept, 3)])
        lists = [
            [*(one for one, keep in zip(own, of_three, strict=True) if keep), *more[1:]]
            for own, more in zip(self.read, others.read, strict=True)
        ]
        states = [one for one, keep in zip(self.states, kept, strict=True) if keep]
        return Samples(self.setup, lists[0], lists[1], lists[2], lists[3], [*states, *others.states])

    @property
    def read(self) -> tuple[list[Any], ...]:
        """Radii, values, perimeters and weights."""
        return self.radius, self.values, self.perimeters, self.weight


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
        """The average at a radius, and the error that the scatter of the pieces leaves to it."""
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
        middle = ((radius - origin) / unit) ** powers @ found
        left = values - basis @ found
        left = np.column_stack([left, left[:, 2] - middle[0] * left[:, 1]])  # V − F d, which ripples least
        scatter = np.sqrt(((weight * left) ** 2).sum(axis=0) / (weight**2).sum())
        count = max(len(values) / 3.0, 1.0)  # few pieces are fitted better than they should be
        return middle, scatter * (1.0 + FITTED / count) / np.sqrt(count)

    @cached_property
    def other(self) -> Fit:
        """Over other windows, which tells its errors."""
        return Fit(self.samples, self.spacing, OTHER * self.width)

    def turns(self, control: Control) -> tuple[Array, Array]:
        """Contact radii where what is controlled turns round, and its values there."""
        own = CubicSpline(self.centres, self.curve(self.centres)[:, :2] @ control.weights)
        found = own.derivative().roots(extrapolate=False)
        return found, own(found)

    def rippled(self) -> bool:
        """Whether neighbouring folds of a control differ by less than their errors."""
        errors = self.scatter[:, :3] + np.abs(self.curve(self.centres) - self.other.curve(self.centres))
        for control in (LOAD, DISPLACEMENT):
            places, heights = self.turns(control)
            left = np.interp(places, self.centres, errors[:, :2] @ np.abs(control.weights))
            if (np.abs(np.diff(heights)) < np.maximum(left[1:], left[:-1])).any():
                return True
        return False

    @staticmethod
    def ironed(samples: Samples, spacing: float) -> Fit:
        """The average over windows so wide that its folds differ by more than the ripples leave."""
        fit = Fit(samples, spacing)
        for _ in range(WIDENINGS):
            if not fit.rippled():
                break
            fit = Fit(samples, spacing, WIDER * fit.width)
        return fit


class AveragedProblem(OnNodes):
    """The average: x = (F, d), and the parameter is the contact radius.

    Parameters
    ----------
    lattice : LatticeProblem
        Of the states with a contact.
    samples : Samples
    fit : Fit
    """

    ordered = True
    rounding = 1e-12

    def __init__(self, lattice: LatticeProblem, samples: Samples, fit: Fit) -> None:
        self.lattice, self.samples, self.fit = lattice, samples, fit
        self.setup, self.scale, self.work = lattice.setup, lattice.setup.lattice.spacing, lattice.work

    @property
    def parameter_range(self) -> tuple[float, float]:
        """From next to first touch on."""
        return FIRST * self.scale, self.fit.last

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
        """Next to first touch."""
        return self.row(FIRST * self.scale)

    def steps(self, start: Point) -> Options:
        """One in every row of nodes."""
        share = min(self.scale / (self.fit.last - FIRST * self.scale), 0.5)
        return replace(
            STEPS, largest_parameter_step=share, first_step=share, angle=1.0, angle_limit=1.5, tolerance=1e-6
        )

    def ending(self, name: str, point: Point) -> str:
        """Where no further states were found."""
        return self.lattice.ending(name, point)

    def values(self, x: Array, p: float) -> Values:
        """Of the average."""
        load, displacement, energy = self.fit.curve(p).tolist()
        return Values(load, displacement, p, 0.0, energy)

    def observables(self, x: Array, p: float) -> Mapping[str, float]:
        """The values, and the length of the rim."""
        order = np.argsort(self.samples.radius)
        perimeter = float(np.interp(p, self.fit.radius[order], np.array(self.samples.perimeters)[order]))
        seen = self.values(x, p)
        own = self.setup.of_cell(seen.load, seen.displacement, seen.energy)
        return seen._asdict() | own | {"perimeter": perimeter, "fft_pairs": float(self.state(p).pairs)}

    def rates(self, x: Array, p: float, x_rate: Array, p_rate: float) -> Rates:
        """Of the average."""
        load, displacement, _ = (p_rate * self.fit.curve(p, 1)).tolist()
        return Rates(load, displacement, p_rate, 0.0)

    def finer(self) -> AveragedProblem:
        """Over other windows, which tells its errors."""
        return self._other

    @cached_property
    def _other(self) -> AveragedProblem:
        return AveragedProblem(self.lattice, self.samples, self.fit.other)

    def left_out(self, x: Array, p: float) -> Four:
        """What the scatter of the pieces, the radius, and first touch leave open, and the cell does."""
        fit, spacing = self.fit, self.fit.spacing
        error = np.array([np.interp(p, fit.centres, own) for own in fit.scatter[:, :2].T])
        error += self._by_radii(p)[:2]
        error *= max(1.0, self.lattice.resolution.ratio)
        # What is wrong with the film at first touch, and with contacts of a node, is felt over some rows.
        first = 1.0 / (1.0 + (p / spacing) ** 2)
        error += np.nan_to_num(self.lattice.touch_error * first, posinf=0.0)
        load, displacement, radius, _ = read(self.setup, self.nearest(p)).errors
        radius += (rim_noise(p / spacing) + FEW * first) * spacing
        return float(error[0]) + load, float(error[1]) + displacement, radius, 0.0

    def energy_left_out(self, x: Array, p: float) -> float:
        """That of the interaction outside the cell."""
        return tail_energy(self.setup, self.nearest(p))

    def energy_scatter(self, x: Array, p: float) -> float:
        """What the scatter of the pieces, and the radius, leave of V − F d."""
        return SCATTERS * float(np.interp(p, self.fit.centres, self.fit.scatter[:, 3])) + float(self._by_radii(p)[2])

    def _by_radii(self, p: float) -> Array:
        """What the errors of the radii make of load, displacement and V − F d.

        They differ from piece to piece, so that what counts is how steep the curve is over the window.
        """
        fit = self.fit
        half = fit.width * half_width(p, fit.spacing)
        places = np.clip(p + half * np.array([-0.25, 0.0, 0.25]), fit.first, fit.last)
        slopes = fit.curve(places, 1)
        slopes[:, 2] -= fit.curve(p)[0] * slopes[:, 1]  # of V at the load that there is
        return np.asarray(rim_noise(p / fit.spacing) * fit.spacing * np.abs(slopes).max(axis=0))

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
        """Which of what was read off the pieces is in the window around a contact radius."""
        return np.abs(self.fit.radius - p) < self.fit.width * half_width(p, self.fit.spacing)

    # -- the states beside it -----------------------------------------------------------------------------------------
    def state(self, p: float) -> Equilibrium:
        """The state with fields next to a contact radius; of these u, load and contact only."""
        return min(self.samples.states, key=lambda one: abs(one[0] - p))[1]

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
        return self.lattice.stability.index(self.nearest(p))

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
        """From the state beside the fold, over the barriers of the pieces of which it is an average."""
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
    lattice: LatticeProblem, begin: Place, held: Control | None, target: float | None
) -> AveragedProblem | None:
    """The curve behind first touch; None if hardly any states with a contact are found.

    Parameters
    ----------
    begin : (Equilibrium, Way)
        First touch, with the direction of the curve behind it.
    held, target : Control or None, float or None
        Where the curve ends, see `Request`.
    """
    film, setup, spacing = lattice.film, lattice.setup, lattice.setup.lattice.spacing
    touch = lattice.values(film[-1].x, film[-1].parameter)
    samples, fit = Samples.behind(touch, setup), None
    end = LEAST_END if target is None else target if held is None else held.target(target)
    if target is None:
        end = max(end, END_FACTOR * max(point.observables["load"] for point in film))
    reach, known = math.inf, [(0.0, math.inf)]  # until the value has risen over a window
    for piece in pieces(lattice, begin, APART):
        seen = samples.add(piece)
        value = seen.contact_radius if held is None else held.weighted(seen.load, seen.displacement)
        known.append((seen.contact_radius, value))
        radii, values = np.array(sorted(known)).T
        before = np.interp(seen.contact_radius - half_width(seen.contact_radius, spacing), radii, values)
        if value >= end and value > before and reach == math.inf:
            reach = seen.contact_radius
        if seen.contact_radius > reach + BEYOND * half_width(reach, spacing):
            fit = Fit(samples, spacing)
            highest = END_FACTOR * max(fit.turns(LOAD)[1], default=-math.inf)
            if target is not None or highest <= end:
                break
            end, reach = highest, math.inf
    if len(samples.states) < DEGREE + 1:
        return None
    fit = fit or Fit(samples, spacing)
    turns = np.sort(np.concatenate([fit.turns(control)[0] for control in (LOAD, DISPLACEMENT)]))
    wide = np.array([BEYOND * half_width(radius, spacing) for radius in turns])
    apart = np.flatnonzero(turns[1:] - wide[1:] > turns[:-1] + wide[:-1]) + 1
    for near in np.split(np.arange(len(turns)), apart) if len(turns) else ():
        samples = _denser(lattice, samples, float((turns - wide)[near[0]]), float((turns + wide)[near[-1]]))
    return AveragedProblem(lattice, samples, Fit.ironed(samples, spacing))


def _denser(lattice: LatticeProblem, known: Samples, low: float, high: float) -> Samples:
    """The same with all pieces between two contact radii, from the states that are known."""
    first_touch = [own[:1] for own in known.read]
    found = Samples(known.setup, first_touch[0], first_touch[1], first_touch[2], first_touch[3])
    states = sorted(known.states, key=itemgetter(0))
    below = [state for place, state in states if place < low]
    around = [*below[-1:], *(state for place, state in states if place >= low)]
    if len(around) < 2:
        return known
    first, ahead = around[:2]
    state = lattice.with_fields(first)
    way = lattice.corners.way(state, Direction.along(Measure.at(state, lattice.scale), *ahead.beyond(first)))
    for piece in pieces(lattice, (state, way)) if way else ():
        if found.add(piece).contact_radius > high:
            break
    return known.replaced(found) if found.states else known
