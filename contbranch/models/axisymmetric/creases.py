"""Creases that wander through a film, and steps between layers: places with which the mesh moves besides its front.

A film that is about to give way in one place, or layers, make the gap dip, or rise, over a length far below the film's
own. Where the film is flat there is next to nothing to hold such a crease, and the curve passes through all places that
it can be at. On a mesh that moves along with it, ``xi -> xi + Σ b_k v_k(xi)`` with one unknown b_k and one equation
for each, ``g'(xi_k) = 0`` for a crease and ``g(xi_k) = g_k`` for a step, it stands still. Where the law's stiffness
jumps is such a step, too, unless it leads the mesh itself: there the panels' polynomials end.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from contbranch.arrays import Array, magnitude
from contbranch.continuation.problem import UnresolvedError
from contbranch.errors import ModelError

from .equations import Equations, Fields
from .mesh import Mesh

__all__ = [
    "KINK", "MOST", "SHARE", "SHORTER", "STAYS", "Crease", "apart", "creases_of", "crossings", "joined", "kinks_of",
    "located", "moved_with", "shortened", "velocities",
]  # fmt: skip

# A crease is narrower than its distance from the rim by the first factor, and changes the pressure by the second
# multiple of its largest value over that distance, or, a step, answers the gap within that distance over the third; one
# that is followed, by half as much.
NARROW, STEEP, FIRM = 4.0, 1.0, 3.0
# What is moved undeformed on either side of it, in its widths, and at most as a share of the way to what is next to it.
AROUND, SHARE = 3.0, 0.35
# Panels are shortened down to this share before the mesh is taken for the one to be moved, and no further than this.
SHORTER, SHORTEST = 0.4, 0.2
# Creases that are followed; steps of Newton's method by which they are located.
MOST, NEWTON = 6, 3
# The key of the outermost place of a law's first kink, below which are those of others, and of places farther in; other
# edges of panels are at least this share of its distance away from one, and one edge is at no more than the second. A
# kink that has counted does so down to this share of the distance from which on others do: its mesh, which may end
# there, must not end within it.
KINK, NEXT, INNERMOST, STAYS = -1, 1e-3, 0.5, 0.3
# ... where panels between edges of regions are shortened alike.
LEAST_ROOM = 1e-2
# It moves undeformed with what is at least this share of its distance around it, up to the mesh's end.
LAST = 1e-4


class AstrayError(ModelError, UnresolvedError):
    """A crease, or the front, has left its part of the mesh, which the continuation answers by a shorter step."""


@dataclass(frozen=True)
class Row:
    """A linear equation for gaps at nodes and root edges, or for pressures where the gap rests at nodes:
    ``weights @ what − value = 0``."""

    nodes: slice
    weights: Array
    value: float
    rests: bool = False

    def off(self, fields: Fields) -> float:
        """What is left of it."""
        return float(self.weights @ (fields.pressure if self.rests else fields.gaps)[self.nodes]) - self.value

    def by_state(self, equations: Equations, fields: Fields) -> Array:
        """Derivatives with respect to the state."""
        found = np.zeros(equations.size)
        if self.rests:
            first = int(np.searchsorted(equations.resting, self.nodes.start)) + equations.mesh.size
            found[first : first + len(self.weights)] = self.weights
        else:
            plane = self.weights @ fields.rim.plane_to_targets[self.nodes]
            found[: equations.mesh.size] = plane - plane.sum() * equations.rim_row
        return found

    def by_gap(self, gap: Array) -> Array:
        """Its changes where the gaps change by so much, (..., N + R) -> (...)."""
        return np.zeros(gap.shape[:-1]) if self.rests else gap[..., self.nodes] @ self.weights


def gap_row(mesh: Mesh, place: float, value: float) -> Row:
    """What says how far the gap at a place is from a value."""
    ends = np.flatnonzero(mesh.edges[list(mesh.roots)] == place) + mesh.size
    return Row(slice(ends[0], ends[0] + 1), np.ones(1), value) if ends.size else Row(*mesh.row(place), value)


@dataclass(frozen=True)
class Crease:
    """A crease of the gap, a step, or an edge of what rests, on the mesh before that was moved.

    Attributes
    ----------
    place : float
        ξ_k.
    half : float
        What moves with it undeformed, on either side.
    order : int
        Of the derivative of the gap that stays what it is: 1 of a crease, 0 of a step. At an edge of what rests, −1 if
        that lies inside of it and −2 if outside, it is the pressure.
    value : float
        What that is.
    slope : float
        Its own derivative when it was found.
    weight : float
        Of its motion in the inner product of states: like that of h when it moves by its own distance.
    key : int
        By which it is known again on other meshes.
    root : bool
        Whether functions are smooth in the root of the distance from there.
    """

    place: float
    half: float
    order: int
    value: float
    slope: float
    weight: float
    key: int
    root: bool = False

    @property
    def kink(self) -> bool:
        """Whether the law has one there."""
        return self.key <= KINK

    def stretched(self, factor: float, weight: float) -> Crease:
        """The same where lengths are stretched, with a weight for its motion by its own place."""
        place = factor * self.place
        slope = self.slope / factor ** (1 + self.order) if self.order >= 0 else self.slope
        weight = weight / place**2
        return replace(self, place=place, half=factor * self.half, slope=slope, weight=weight)

    def row(self, mesh: Mesh, equations: Equations) -> Row:
        """What says how far it is from its place, on the mesh before that is stretched."""
        value = self.wanted(mesh, equations)
        if self.order < 0:
            row = Row(*mesh.row(self.place, self.order == -2), value, True)
        else:
            row = gap_row(mesh, self.place, value)
        if self.order == 1:
            slopes = row.weights @ mesh.rule.derivative / mesh.half[row.nodes.start // mesh.order]
            row = replace(row, weights=slopes)
        return replace(row, weights=row.weights / self.slope, value=value / self.slope)

    def wanted(self, mesh: Mesh, equations: Equations) -> float:
        """What the gap, its slope or the pressure there is to be; a neighbouring law's may be another."""
        if self.order < 0:
            k = int(np.abs(mesh.edges[list(mesh.roots)] - self.place).argmin())
            rests, floats = equations.beside(k, inside=self.order == -1)
            return equations.law.pressure(floats.index, rests.index)
        if not self.kink:
            return self.value
        kinks = equations.kinks
        return kinks[(KINK - self.key) % len(kinks)]


def velocities(creases: Sequence[Crease], resting: tuple[float, float] | None, mesh: Mesh) -> tuple[Array, Array]:
    """Rates of the mesh's edges and targets with the motions of all creases, (m, P + 1) and (m, N + R).

    Parameters
    ----------
    resting : (float, float) or None
        What stays between them where it is: a front.
    """
    if mesh.roots:  # linear between edges of regions and whatever else moves
        own = [crease.place for crease in creases]
        fixed = [0.0, *([] if resting is None else [sum(resting) / 2]), float(mesh.end)]
        knots = np.unique([*own, *fixed])
        rates = [np.interp(mesh.edges, knots, (knots == place).astype(float)) for place in own]
        return _along(mesh, np.array(rates))
    # Next to the mesh's end, which stays, less is held than a crease is wide, and panels beyond a kink shrink alike.
    last = [c.place if c.kink and not c.root else (c.place + float(mesh.end)) / 2 for c in creases]
    held = [(c.place - c.half, min(c.place + c.half, most)) for c, most in zip(creases, last, strict=True)]
    spans = sorted([*held, resting] if resting else held)
    knots = np.minimum([mesh.innermost, *itertools.chain(*spans), mesh.end], mesh.end)
    rates = [
        np.interp(mesh.edges, knots, [0.0, *itertools.chain(*((float(span == own),) * 2 for span in spans)), 0.0])
        for own in held
    ]
    return _along(mesh, np.array(rates).reshape(len(creases), mesh.panels + 1))


def _along(mesh: Mesh, edges: Array) -> tuple[Array, Array]:
    """Rates of edges, and of the targets that go with them."""
    nodes = edges[:, :-1, None] + (edges[:, 1:] - edges[:, :-1])[:, :, None] * mesh.shares
    return edges, np.hstack([nodes.reshape(len(edges), mesh.size), edges[:, list(mesh.roots)]])


def moved_with(mesh: Mesh, rates: Array, by: Array) -> Mesh:
    """The mesh with its edges moved.

    Raises
    ------
    AstrayError
        If panels would become far too short.
    """
    edges = mesh.edges + by @ rates
    if not shortened(mesh, edges) > (LEAST_ROOM if mesh.roots else SHORTEST):
        raise AstrayError("a crease of the film has left its part of the mesh")
    return Mesh(edges, mesh.order, mesh.bounded, mesh.roots)


def shortened(mesh: Mesh, edges: Array) -> float:
    """By which share the most shortened panel is so."""
    return float((np.diff(edges) / np.diff(mesh.edges)).min())


def creases_of(
    mesh: Mesh, fields: Fields, range_: float, front: float, followed: Sequence[Crease], steps: float
) -> tuple[Crease, ...]:
    """The creases of a film with which a mesh is to move, the narrowest first, without their weights.

    Parameters
    ----------
    mesh, fields : Mesh, Fields
        The state.
    range_ : float
        Over which the gap changes where the pressure does.
    front : float
        Where the front is, or the edge at which the mesh ends.
    followed : sequence of Crease
        Those that are followed already, where they are now; they end later.
    steps : float
        Steps count, too, where their distance from the rim differs from the front's by this factor.
    """
    nodes, chosen = mesh.nodes, [crease for crease in followed if crease.kink]
    fresh = 1 + max((crease.key for crease in followed), default=-1)
    steep = np.abs(nodes * mesh.derivative(fields.pressure)) / max(magnitude(fields.pressure), 1e-300)
    firm = np.maximum(steep, np.abs(nodes * fields.stiffness) / (FIRM / STEEP))
    found = [(place, 1, 0.0, bend, math.sqrt(range_ / abs(bend))) for place, bend in _turns(mesh, fields.gap)]
    if math.isfinite(steps):
        found += [
            (place, 0, gap, slope, range_ / abs(slope))
            for place, gap, slope in _steps(mesh, fields.gap, steep)
            if max(place / front, front / place) > steps
        ]
    for place, order, value, slope, width in sorted(found, key=lambda one: one[4] / one[0]):
        taken = [crease.key for crease in chosen]
        near = [one for one in followed if one.order == order and one.key not in taken]
        near = [one for one in near if abs(one.place - place) < width]
        known = min(near, key=lambda one: abs(one.place - place)) if near else None
        around = (steep if order else firm)[np.abs(nodes - place) < AROUND * width]
        share = 0.5 if known else 1.0
        if not (share * NARROW * width < place and float(around.max(initial=0.0)) > share * STEEP):
            continue
        if known:  # what it is known by stays
            place, value, slope = known.place, known.value, known.slope
        others = [front, mesh.end, *(crease.place for crease in chosen)]
        room = SHARE * min(place - mesh.innermost, *(abs(place - other) for other in others))
        if room > width:
            key = known.key if known else fresh + len(chosen)
            chosen.append(Crease(place, min(AROUND * width, room), order, value, slope, 0.0, key))
    return apart(chosen[:MOST])


def crossings(mesh: Mesh, fields: Fields, value: float) -> dict[int, tuple[float, float]]:
    """Places at which the gap passes a value, as two nodes tell them, with its slopes there: infinite where a tip ends.

    By their numbers from outside: at even ones it rises outwards, at odd ones it falls. Where the mesh ends below the
    value there is no first one.
    """
    nodes, gap = np.append(0.0, mesh.nodes), np.append(max(0.0, -fields.y), fields.gap)
    above = gap >= value
    found = {}
    for number, k in enumerate(np.flatnonzero(above[1:] != above[:-1])[::-1], int(not above[-1])):
        ends = slice(k, k + 2) if above[k + 1] else slice(k + 1, k - 1 if k else None, -1)
        place = math.sqrt(float(np.interp(value, gap[ends], nodes[ends] ** 2)))
        found[number] = place, float(np.diff(gap[ends])[0] / np.diff(nodes[ends])[0])
    return found


def kinks_of(
    mesh: Mesh, fields: Fields, kinks: Sequence[float], k: int, least: float, followed: Sequence[Crease]
) -> Iterator[Crease]:
    """What moves with the places where the gap is that of one of a law's kinks, without their weights.

    They count from a distance, `least`, from the rim and from each other, and down to a share of that; those that are
    followed stay what they are.
    """
    found, known = crossings(mesh, fields, kinks[k]), {crease.key: crease for crease in followed}
    for number, (place, slope) in found.items():
        away = min([place, *(abs(place - other) for own, (other, _) in found.items() if own != number)])
        key = KINK - k - number * len(kinks)
        if key in known:
            place, slope = known[key].place, known[key].slope
        room = SHARE * min(place - min(mesh.innermost, INNERMOST * place), mesh.end - place)
        share = STAYS if key in known else 1.0
        if away > share * least and room > share * LAST * place and math.isfinite(slope):
            yield Crease(place, room, 0, kinks[k], slope, 0.0, key)


def joined(edges: Array, creases: Sequence[Crease]) -> Array:
    """Edges of panels with those creases among them across which nothing is a polynomial; the innermost one rests."""
    for place in (crease.place for crease in creases if crease.kink and not crease.root):
        away = np.abs(edges - place) > NEXT * place
        inner = [INNERMOST * place] if edges[1] > INNERMOST * place else []
        away[-1] = True
        edges = np.unique(np.append(edges[away], [*inner, place]))
    return edges


def apart(creases: Sequence[Crease], fixed: Sequence[float] = ()) -> tuple[Crease, ...]:
    """The creases with no more around each than a share of the way to the next one, or to what is fixed.

    Where what moves undeformed with two of them met, the mesh would be torn.
    """

    def nearest(crease: Crease) -> float:
        places = [*fixed, *(other.place for other in creases if other is not crease)]
        return min((abs(crease.place - place) for place in places), default=math.inf)

    return tuple(replace(crease, half=min(crease.half, SHARE * nearest(crease))) for crease in creases)


def located(mesh: Mesh, gap: Array, crease: Crease, stretch: float) -> float:
    """Where a state has what will be a crease on a mesh that is stretched, or where that is."""
    place, around = stretch * crease.place, stretch * crease.half
    if crease.order:
        places = [turn for turn, _ in _turns(mesh, gap)]
    else:
        above = gap > crease.value
        places = [
            float(mesh.nodes[k] + (crease.value - gap[k]) * (mesh.nodes[k + 1] - mesh.nodes[k]) / (gap[k + 1] - gap[k]))
            for k in np.flatnonzero(above[1:] != above[:-1])
        ]
    near = [one for one in places if abs(one - place) < around]
    return min(near or [place], key=lambda one: abs(one - place))


def _steps(mesh: Mesh, gap: Array, steep: Array) -> Iterator[tuple[float, float, float]]:
    """Nodes at which the pressure is steeper than around while the gap goes on rising, or falling; gaps and slopes."""
    with np.errstate(invalid="ignore"):  # beyond the edge of a tip
        slope = mesh.derivative(gap)
        peaks = (steep[1:-1] > steep[:-2]) & (steep[1:-1] >= steep[2:])
        peaks &= (slope[1:-1] * slope[:-2] > 0.0) & (slope[1:-1] * slope[2:] > 0.0)
    for k in np.flatnonzero(peaks) + 1:
        yield float(mesh.nodes[k]), float(gap[k]), float(slope[k])


def _turns(mesh: Mesh, gap: Array) -> Iterator[tuple[float, float]]:
    """Places at which a gap is stationary, and d²g/dtau² there, as the panels' polynomials have both."""
    nodes = mesh.nodes
    with np.errstate(invalid="ignore"):  # beyond the edge of a tip
        slope = mesh.derivative(gap)
        bend = mesh.derivative(slope)
        turns = (slope[2:-1] * slope[1:-2] < 0.0) & (bend[2:-1] * bend[1:-2] > 0.0)
        # Where panels meet, slopes are rough.
        turns &= (slope[1:-2] * slope[:-3] > 0.0) & (slope[3:] * slope[2:-1] > 0.0)
    for k in np.flatnonzero(turns) + 1:
        place = nodes[k] - slope[k] * (nodes[k + 1] - nodes[k]) / (slope[k + 1] - slope[k])
        for _ in range(NEWTON):
            rate, own = (float(mesh.interpolate(values, np.array([place]))[0]) for values in (slope, bend))
            if not own * bend[k] > 0.0:
                break
            place -= rate / own
        else:
            if nodes[k] <= place <= nodes[k + 1]:
                yield float(place), own
