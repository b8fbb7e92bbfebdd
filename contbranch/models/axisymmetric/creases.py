"""Creases that wander through a film: places inside of a front, or an edge, with which the mesh moves, too.

A film that is about to give way in one place, or layers, make the gap dip, or rise, over a length far below the film's
own. Where the film is flat there is next to nothing to hold such a crease, and the curve passes through all places that
it can be at. On a mesh that moves along with it, ``xi -> xi + Σ b_k v_k(xi)`` with one unknown b_k and one equation
``g'(xi_k) = 0`` for each crease, it stands still.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from contbranch.arrays import Array
from contbranch.errors import ModelError

from .equations import Fields
from .mesh import Mesh

__all__ = ["SHARE", "SHORTER", "Crease", "creases_of", "located", "moved_with", "shortened", "velocities"]

# A crease is narrower than its distance from the rim by this factor, and changes the pressure by this multiple of its
# largest value over that distance; one that is followed, by a smaller one.
BEGINS, ENDS = 4.0, 2.0
# What is moved undeformed on either side of it, in its widths, and at most as a share of the way to what is next to it.
AROUND, SHARE = 3.0, 0.35
# Panels are shortened down to this share before the mesh is taken for the one to be moved, and no further than this.
SHORTER, SHORTEST = 0.4, 0.2
# Creases that are followed; steps of Newton's method by which they are located.
MOST, NEWTON = 6, 3

_keys = itertools.count()


@dataclass(frozen=True)
class Crease:
    """A crease of the gap, on the mesh before that was moved.

    Attributes
    ----------
    place : float
        ξ_k.
    half : float
        What moves with it undeformed, on either side.
    bend : float
        d²g/dξ² there when it was found.
    weight : float
        Of its motion in the inner product of states: like that of h when it moves by its own distance.
    key : int
        By which it is known again on other meshes.
    """

    place: float
    half: float
    bend: float
    weight: float
    key: int

    def stretched(self, factor: float, weight: float) -> Crease:
        """The same where lengths are stretched, with a weight for its motion by its own place."""
        place = factor * self.place
        return replace(self, place=place, half=factor * self.half, bend=self.bend / factor**2, weight=weight / place**2)

    def row(self, mesh: Mesh) -> tuple[slice, Array]:
        """The nodes of the panel on which it lies, and what their gaps are multiplied by to say how far it is off."""
        panel = int(np.searchsorted(mesh.edges[1:-1], self.place))
        local = (self.place - mesh.edges[panel]) / mesh.half[panel] - 1.0
        slopes = mesh.rule.lagrange(np.array([local]))[0] @ mesh.rule.derivative
        return slice(panel * mesh.order, (panel + 1) * mesh.order), slopes / (mesh.half[panel] * self.bend)


def velocities(creases: Sequence[Crease], resting: tuple[float, float] | None, mesh: Mesh) -> tuple[Array, Array]:
    """Rates of the mesh's edges and nodes with the motions of all creases, (m, P + 1) and (m, N).

    Parameters
    ----------
    resting : (float, float) or None
        What stays between them where it is: a front.
    """
    held = [(crease.place - crease.half, crease.place + crease.half) for crease in creases]
    spans = sorted([*held, resting] if resting else held)
    knots = np.array([mesh.innermost, *itertools.chain(*spans), mesh.edges[-1]])
    rates = [
        np.interp(mesh.edges, knots, [0.0, *itertools.chain(*((float(span == own),) * 2 for span in spans)), 0.0])
        for own in held
    ]
    edges = np.array(rates).reshape(len(creases), mesh.panels + 1)
    along = (mesh.rule.nodes + 1) / 2
    nodes = edges[:, :-1, None] + (edges[:, 1:] - edges[:, :-1])[:, :, None] * along
    return edges, nodes.reshape(len(creases), mesh.size)


def moved_with(mesh: Mesh, rates: Array, by: Array) -> Mesh:
    """The mesh with its edges moved.

    Raises
    ------
    ModelError
        If panels would become far too short, which the continuation answers by a shorter step.
    """
    edges = mesh.edges + by @ rates
    if not shortened(mesh, edges) > SHORTEST:
        raise ModelError("a crease of the film has left its part of the mesh")
    return Mesh(edges, mesh.order, mesh.bounded)


def shortened(mesh: Mesh, edges: Array) -> float:
    """By which share the most shortened panel is so."""
    return float((np.diff(edges) / np.diff(mesh.edges)).min())


def creases_of(
    mesh: Mesh, fields: Fields, range_: float, front: float, followed: Sequence[Crease]
) -> tuple[Crease, ...]:
    """The creases of a film with which a mesh is to move, the narrowest first, without their weights.

    Parameters
    ----------
    mesh, fields : Mesh, Fields
        The state.
    range_ : float
        Of the interaction.
    front : float
        Where the front is, or the edge at which the mesh ends.
    followed : sequence of Crease
        Those that are followed already, where they are now; they end later.
    """
    nodes, chosen = mesh.nodes, list[Crease]()
    steep = np.abs(nodes * mesh.derivative(fields.pressure)) / max(float(np.abs(fields.pressure).max()), 1e-300)
    turns = [(place, bend, math.sqrt(range_ / abs(bend))) for place, bend in _turns(mesh, fields.gap)]
    for place, bend, width in sorted(turns, key=lambda turn: turn[2] / turn[0]):
        near = [crease for crease in followed if abs(crease.place - place) < width]
        needed = ENDS if near else BEGINS
        around = steep[np.abs(nodes - place) < AROUND * width]
        if not (needed * width < place and float(around.max(initial=0.0)) > needed):
            continue
        others = [front, mesh.edges[-1], *(crease.place for crease in chosen)]
        room = SHARE * min(place - mesh.innermost, *(abs(place - other) for other in others))
        if room > width:
            taken = [crease.key for crease in chosen]
            known = [crease for crease in near if crease.key not in taken]
            key = min(known, key=lambda crease: abs(crease.place - place)).key if known else next(_keys)
            chosen.append(Crease(place, min(AROUND * width, room), bend, 0.0, key))
    return tuple(chosen[:MOST])


def located(mesh: Mesh, gap: Array, place: float, around: float) -> float:
    """Where a crease is that will be at a place, or that place."""
    near = [one for one, _ in _turns(mesh, gap) if abs(one - place) < around]
    return min(near or [place], key=lambda one: abs(one - place))


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
