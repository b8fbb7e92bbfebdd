"""The curve of a contact from that of a lattice: averaged over the arcs between changes of the contact.

On a lattice load and displacement ripple as single nodes join the contact, and where the law is stiff the ripples are
folds. They are the lattice's own. As functions of the contact radius a, which is measured with sub-grid resolution, the
ripples average out: by least squares,

    min ∫ |F(a) - P(a)|² da

over some rows of nodes, P a polynomial. The integral runs along the arcs, each with its length in a: most of the bias
of single states is that they gather where a hardly changes. Folds of the contact are those of P. How much they move if
the window or the degree is another one, and by how much the states scatter about P, is their error.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import NamedTuple

import numpy as np
import scipy

from contbranch.control import Control

from .arcs import Arc
from .arrays import Array
from .newton import Equilibrium
from .rows import Reading, Row, read
from .setup import Setup
from .walk import Measure

__all__ = ["LEAST", "MEASURED", "Average", "Fold", "Samples", "half_width", "turned"]

# Half of a window in rows of nodes, the share of the contact radius that it may take up, and its least; where a row
# has many nodes, fewer rows are enough.
ROWS, SHARE, LEAST, MANY = 3.5, 0.6, 1.6, 110.0
# Least radius of a fold, in rows of nodes.
FEWEST = 1.0
DEGREE = 3
# Other windows (relative) and degrees, of which a fold's error is made.
OTHERS = ((0.7, 3), (1.3, 3), (1.0, 4), (1.0, 2))
# Centres of windows a row of nodes where folds are looked for.
CENTRES = 4
# States a row of nodes of which the fields are kept.
STATES = 3
# Weight of first touch, in rows of nodes.
TOUCH = 0.5
# Gauss-Legendre rule for the product of two parabolas.
_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(3)
_NODES, _WEIGHTS = 0.5 * (_NODES + 1.0), 0.5 * _WEIGHTS
_LAGRANGE = np.stack([(1 - _NODES) * (1 - 2 * _NODES), 4 * _NODES * (1 - _NODES), _NODES * (2 * _NODES - 1)])
_SLOPES = np.stack([4 * _NODES - 3, 4 - 8 * _NODES, 4 * _NODES - 1])
# Scatter that counts in the error of an average of so many arcs, and the factor of what other windows give.
SCATTER, OTHER = 1.0, 1.0
# Error of the contact radius itself, in rows of nodes.
MEASURED = 0.03


def half_width(radius: float, spacing: float) -> float:
    """Half of the window around a contact radius."""
    rows = radius / spacing
    return spacing * max(LEAST, min(ROWS, SHARE * rows, MANY / max(rows, 1.0)))


def turned(
    rows: Sequence[Row], controls: Sequence[Control], spacing: float, beyond: float
) -> tuple[float, float | None]:
    """Where a control has turned round, at a radius with rows on both sides over more than what single nodes do.

    Parameters
    ----------
    rows : sequence of Row
    controls : sequence of Control
    spacing : float
    beyond : float
        Contact radius up to which this is known; negative: from the last row without contact on.

    Returns
    -------
    beyond : float
        Up to where it is known now.
    centre : float or None
        The radius.
    """
    rows = sorted(rows, key=lambda row: row.arc)
    radii = np.array([row.reading.contact_radius for row in rows])
    inner = np.flatnonzero(radii > beyond)
    if beyond < 0.0 and inner.size:
        inner = inner[max(int(np.argmax(radii > 0.0)) - 1, 0) :]
    for k in inner[:-1].tolist():
        half = half_width(radii[k], spacing)
        if k == 0 or radii[-1] < radii[k] + half:
            continue
        beyond = max(beyond, float(radii[k]))
        # one row without contact, or beyond the window
        first = max(min(int(np.argmax(radii > max(radii[k] - half, 0.0))), k) - 1, 0)
        for control in controls:
            values = np.array([control.value(*row.reading[:2]) for row in rows[first:]])
            others = np.delete(values, k - first)
            if k > first and not others.min() < values[k - first] < others.max():
                return beyond, float(radii[k])
    return beyond, None


class Fold(NamedTuple):
    """A fold of the average: contact radius, load, displacement and energy there, errors, and arcs in its window.

    The error of the potential V - F d, at the load of the fold, is smaller than those of its terms.
    """

    radius: float
    values: Array
    errors: Array
    maximum: bool
    arcs: int
    potential: float


@dataclass
class Samples:
    """What was read off the arcs, in order.

    Attributes
    ----------
    radius, values, perimeters, weight : list
        Of three states an arc: contact radius; load, displacement and energy; length of the rim; share of the integral
        over the radius.
    ends, lengths : list
        Contact radius at the end of every arc, and its length.
    states : list of (float, Equilibrium)
        States with fields, some in every row of nodes, and their contact radii.
    last : Arc or None
    """

    radius: list[float] = field(default_factory=list)
    values: list[tuple[float, float, float]] = field(default_factory=list)
    perimeters: list[float] = field(default_factory=list)
    weight: list[float] = field(default_factory=list)
    ends: list[float] = field(default_factory=list)
    lengths: list[float] = field(default_factory=list)
    states: list[tuple[float, Equilibrium]] = field(default_factory=list)
    last: Arc | None = None

    def add(self, setup: Setup, arc: Arc) -> float:
        """Read off an arc; the contact radius at its end."""
        seen = tuple(read(setup, state, cell=False) for state in (arc.begin, arc.middle, arc.end))
        self.last = arc
        self.ends.append(seen[2].contact_radius)
        self.lengths.append(Measure.at(arc.begin, setup.length).apart(arc.end, arc.begin))
        if seen[0].contact_radius > 0.0 and np.isfinite([one.four for one in seen]).all():
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

    def state(self, radius: float) -> Equilibrium:
        """A state with fields near a contact radius; of these u, load and contact only."""
        return min(self.states, key=lambda one: abs(one[0] - radius))[1]


class Average:
    """The averaged curve over a stretch of arcs.

    Parameters
    ----------
    samples : Samples
    spacing : float
    """

    def __init__(self, samples: Samples, spacing: float) -> None:
        self.spacing = spacing
        self.radius, self.weight = np.array(samples.radius), np.array(samples.weight)
        self.values = np.array(samples.values).reshape(-1, 3)
        self.first, self.last = (float(f(self.radius)) for f in (np.min, np.max))

    def _fit(self, radius: float, width: float, degree: int) -> tuple[Array, float, float, Array, int]:
        """Coefficients in (a - centre)/half, centre, half, root mean square of what is left, and states used."""
        half = width * half_width(radius, self.spacing)
        room = 0.5 * half
        centre = min(max(radius, self.first + room), max(self.last - room, self.first + room))
        x = (self.radius - centre) / half
        near = (np.abs(x) < 1.0) & (self.weight > 0.0)
        if near.sum() < 3 * (degree + 1):
            half = 1.001 * np.sort(np.abs(self.radius[self.weight > 0.0] - centre))[: 3 * (degree + 1)][-1]
            x = (self.radius - centre) / half
            near = (np.abs(x) < 1.0) & (self.weight > 0.0)
        x, values = x[near], self.values[near]
        weight = np.sqrt(self.weight[near] * (1.0 - np.abs(x) ** 3) ** 3)
        basis = np.vander(x, degree + 1, increasing=True)
        found = np.linalg.lstsq(basis * weight[:, None], values * weight[:, None], rcond=None)[0]
        left = (weight[:, None] * (values - basis @ found)) ** 2
        return found, centre, half, np.sqrt(left.sum(axis=0) / (weight**2).sum()), int(near.sum())

    def at(self, radius: float, width: float = 1.0, degree: int = DEGREE) -> tuple[Array, Array]:
        """Load, displacement and energy at a contact radius, and their slopes."""
        found, centre, half, _, _ = self._fit(radius, width, degree)
        x = (radius - centre) / half
        powers = np.arange(degree + 1)
        slopes = np.append(0.0, powers[1:] * x ** (powers[1:] - 1)) @ found / half
        return x**powers @ found, slopes

    def scatter(self, radius: float) -> tuple[Array, int]:
        """How far states are from their average, and how many arcs are in the window."""
        _, _, _, left, count = self._fit(radius, 1.0, DEGREE)
        return left, max(count // 3, 1)

    def _slope(self, control: Control, radius: float, width: float = 1.0, degree: int = DEGREE) -> float:
        load, displacement, _ = self.at(radius, width, degree)[1]
        return control.weighted(load, displacement)

    @cached_property
    def centres(self) -> Array:
        """Radii at which the average is a centred one, about."""
        edges = [half_width(radius, self.spacing) for radius in (self.first, self.last)]
        low, high = self.first + 0.3 * edges[0], self.last - 0.3 * edges[1]
        return np.linspace(low, high, max(2, int(CENTRES * (high - low) / self.spacing)))

    def folds(self, control: Control) -> list[Fold]:
        """The folds of a control in order of the contact radius, but for pairs that their errors swallow."""
        slopes = np.array([self._slope(control, radius) for radius in self.centres])
        found = []
        for k in np.flatnonzero(slopes[:-1] * slopes[1:] < 0.0):
            bracket = float(self.centres[k]), float(self.centres[k + 1])
            if bracket[1] < FEWEST * self.spacing:
                continue
            radius = float(scipy.optimize.brentq(lambda a: self._slope(control, a), *bracket))
            found.append(self._fold(control, radius, bool(slopes[k] > 0.0)))
        while len(found) > 1:
            heights = np.array([control.weighted(*fold.values[:2]) for fold in found])
            errors = np.array([control.weighted(*fold.errors[1:3]) for fold in found])
            rise = np.abs(np.diff(heights)) / np.maximum(errors[1:], errors[:-1])
            least = int(np.argmin(rise))
            if rise[least] >= 1.0:
                break
            del found[least : least + 2]  # no more than the ripples leave
        return found

    def _fold(self, control: Control, radius: float, maximum: bool) -> Fold:
        values = self.at(radius)[0]
        left, count = self.scatter(radius)
        half = half_width(radius, self.spacing)
        differences, potential = np.zeros(4), 0.0
        for width, degree in OTHERS:
            near = np.linspace(radius - 0.6 * half, radius + 0.6 * half, 26)
            near = near[(near > self.first) & (near < self.last)]
            heights = np.array([self.at(a, width, degree)[0] for a in near])
            driven = np.array([control.weighted(*row[:2]) for row in heights])
            best = int(np.argmax(driven) if maximum else np.argmin(driven))
            place = self._vertex(near, driven, best)
            change = self.at(place, width, degree)[0] - values
            differences = np.maximum(differences, np.abs(np.append(place - radius, change)))
            along = (values[0] + 0.5 * change[0]) * change[1]
            potential = max(potential, abs(float(change[2] - along)))
        errors = OTHER * differences + np.append(MEASURED * self.spacing, SCATTER * left / np.sqrt(count))
        return Fold(radius, values, errors, maximum, count, OTHER * potential)

    @staticmethod
    def _vertex(places: Array, heights: Array, best: int) -> float:
        """The extremum of the parabola through the best of equidistant places and its neighbours."""
        if not 0 < best < len(places) - 1:
            return float(places[best])
        before, here, after = heights[best - 1 : best + 2]
        bend = before - 2.0 * here + after
        return float(places[best] + 0.5 * (places[1] - places[0]) * (before - after) / bend if bend else places[best])
