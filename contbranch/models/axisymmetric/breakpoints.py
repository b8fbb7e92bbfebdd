"""Places in the mesh with an equation of their own, with which it moves.

Where the pressure falls steeply, has a kink or jumps, where what rests ends, and where a tip does, the solution is no
polynomial, or one over a short length only, and such a place travels as the contact changes. Each is a position ξ in
the mesh with one scalar equation (`docs/model.md`): the gap there is that of a kink, a step or a layer of the law, or
of the steepest pressure; the pressure is continuous at an edge of what rests; ξ is the edge of the tip. The first one
leads: the mesh ``tau = e^σ ξ`` is stretched with it. The others move by b_k besides, and what lies between two of them
moves linearly, ``ξ → ξ + Σ b_k v_k(ξ)``. σ and b are unknowns.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from contbranch.arrays import Array, magnitude
from contbranch.continuation.problem import UnresolvedError
from contbranch.errors import ModelError
from contbranch.models.fronts import BEGINS, ENDS, FLATTER, STIFF

from .adapt import needed_reach
from .equations import Equations, Fields
from .mesh import Mesh

__all__ = [
    "CROSSING", "EXTENT", "LIFTED", "RESTING", "STEEPEST", "AstrayError", "Breakpoint", "EdgeRow", "Motion", "Row",
    "Seen", "extent_leads", "law_leads", "moved_with", "of_law", "shortened", "steepest", "to_edge", "with_edges",
]  # fmt: skip

Seen = tuple[Equations, Fields]

# Keys of breakpoints that are not of the law, whose own count from 0: the steepest pressure, the edge of the tip, edges
# of what rests. Keys of two crossings of one gap differ by the last number.
STEEPEST, EXTENT, RESTING, CROSSING = -1, -2, -3, 1000
# A breakpoint of the law counts from this share of the radius at which the tip itself has that gap, down to the second
# share of that once it has counted; its motion counts in the inner product of states at least like an h of the third
# share of its gap.
LEAST_DISTANCE, STAYS, LIFTED = 4e-3, 0.3, 0.3
# A layer counts where the gap crosses it within this share of its distance from the rim, and where it is farther from
# the leading breakpoint than this factor; that many breakpoints move besides the leading one.
NARROW, BESIDE_LEAD, MOST = 0.25, 1.5, 6
# The gap crosses a layer over this share of their wavelength.
LAYER = 0.25
# Other edges of panels are at least this share of its distance away from a breakpoint; the innermost one is at no more
# than the second.
NEXT, INNERMOST = 1e-3, 0.5
# Panels are shortened no further than to this share, between edges of regions to the second.
SHORTEST, LEAST_ROOM = 0.2, 1e-2
# The steepest pressure is followed on where the gap rises by this share of what it did, too; it leads whatever the
# stiffness where it is as steep as the second number, and elsewhere only where the film is stiffer by the third than
# for fixed meshes to cost less. Where the interaction is felt over more than the fourth number of lengths on which
# elasticity answers it, fronts that are flatter by the fifth lead, too.
RESTS, STEEP, FAR_OUT, LARGE, OF_FILMS = 0.25, 20.0, 4.0, 1000.0, 0.2
# A film is pressed where its gap is below this share of the displacement of the surface.
PRESSED = 0.1
# A mesh that must reach beyond the first share of the distance to the edge of the tip ends there, if what ends there
# exceeds the tolerance, and goes on to do so down to the second share of both. The tolerance is this part of what is
# allowed: on a mesh that does not end there, loads have a slope of the mesh's own, alike at every resolution.
CLOSE_TO_EDGE, LEAVES, MISSED = 0.8, 0.6, 0.03


class AstrayError(ModelError, UnresolvedError):
    """A breakpoint has left its part of the mesh, which the continuation answers by a shorter step."""


@dataclass(frozen=True)
class Row:
    """A linear equation for gaps at nodes and root edges, or for pressures where the gap rests at nodes:
    ``weights @ what − value = 0``."""

    nodes: slice
    weights: Array
    value: float
    rests: bool = False

    def off(self, equations: Equations, fields: Fields, sigma: float) -> float:
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

    def by_stretch(self, equations: Equations, fields: Fields, power: float) -> float:
        """Derivative with respect to σ, h growing with the stretch to its power."""
        return float(self.by_gap(equations.spread(fields, power)[0]))

    def by_coordinate(self, equations: Equations, fields: Fields) -> float:
        """Derivative with respect to y."""
        return float(self.by_gap(equations.slopes(fields)[0]))


@dataclass(frozen=True)
class EdgeRow:
    """σ is ln of the distance of the tip's edge from the rim over what it was, `place`."""

    place: float

    def off(self, equations: Equations, fields: Fields, sigma: float) -> float:
        """What is left of it."""
        return sigma - math.log(to_edge(equations, fields) / self.place)

    def by_state(self, equations: Equations, fields: Fields) -> Array:
        """Nothing: the edge is the tip's own."""
        return np.zeros(equations.size)

    def by_gap(self, gap: Array) -> Array:
        """Nothing."""
        return np.zeros(gap.shape[:-1])

    def by_stretch(self, equations: Equations, fields: Fields, power: float) -> float:
        """Derivative with respect to σ."""
        return 1.0

    def by_coordinate(self, equations: Equations, fields: Fields) -> float:
        """Derivative with respect to y."""
        growth = equations.coordinate.slopes(fields.y)[1] if equations.contact else 0.0
        return 0.5 * growth / to_edge(equations, fields) ** 2


@dataclass(frozen=True)
class Breakpoint:
    """A place in the mesh, before it is moved, with an equation of its own.

    Attributes
    ----------
    place : float
        ξ.
    gap : float
        γ; of an edge of what rests, what pressures there are measured by.
    slope : float
        Of the gap when it was found: the equation is one of lengths.
    key : int
        By which it is known on other meshes. Of the law: the number of its gap in `Equations.marks`, plus `CROSSING`
        for each crossing of that gap farther out.
    weight : float
        Of its motion in the inner product of states.
    side : int
        Of an edge of what rests: −1 if that lies inside of it, 1 if beyond; else 0.
    root : bool
        Whether functions are smooth in the root of the distance from there.
    """

    place: float
    gap: float
    slope: float
    key: int
    weight: float = 0.0
    side: int = 0
    root: bool = False

    @property
    def width(self) -> float:
        """Over which the gap changes by as much as it is."""
        return self.place if self.root else abs(self.gap / self.slope)

    def stretched(self, place: float, factor: float) -> Breakpoint:
        """The same at another place, where lengths are stretched by a factor."""
        return replace(self, place=place, slope=self.slope / factor)

    def row(self, mesh: Mesh, equations: Equations) -> Row | EdgeRow:
        """Its equation, on the mesh before that is stretched; the law's own gaps may be those of a neighbouring law."""
        if self.key == EXTENT:
            return EdgeRow(self.place)
        if self.side:
            k = int(np.abs(mesh.edges[list(mesh.roots)] - self.place).argmin())
            rests, floats = equations.beside(k, inside=self.side < 0)
            row = Row(*mesh.row(self.place, self.side > 0), equations.law.pressure(floats.index, rests.index), True)
        else:
            value = equations.marks.get(self.key % CROSSING, self.gap) if self.key >= 0 else self.gap
            at = np.flatnonzero(mesh.edges[list(mesh.roots)] == self.place) + mesh.size
            row = Row(slice(at[0], at[0] + 1), np.ones(1), value) if at.size else Row(*mesh.row(self.place), value)
        return replace(row, weights=row.weights / self.slope, value=row.value / self.slope)


@dataclass(frozen=True)
class Motion:
    """With what a mesh moves.

    Attributes
    ----------
    lead : Breakpoint
        With which it is stretched.
    others : tuple of Breakpoint
        Which move besides.
    power : float
        n of a tip like rⁿ where a film is pressed: films that differ in size have the same h/bⁿ. Gaps, far smaller than
        h, change little with σ at fixed h e^(−nσ), and by far more than they are at fixed h. 0 elsewhere.
    """

    lead: Breakpoint
    others: tuple[Breakpoint, ...] = ()
    power: float = 0.0

    @property
    def ends(self) -> bool:
        """Whether the mesh ends at the edge of the tip."""
        return self.lead.key == EXTENT

    @property
    def of_law(self) -> bool:
        """Whether the law has a kink or a step at the leading breakpoint."""
        return self.lead.key >= 0

    @property
    def edges(self) -> list[float]:
        """Places that are edges of panels: all but that of the steepest pressure where it leads."""
        return [one.place for one in (self.all if self.of_law else self.others)]

    @property
    def all(self) -> tuple[Breakpoint, ...]:
        """All of them."""
        return (self.lead, *self.others)

    def weights(self, mesh: Mesh) -> Array:
        """Weights of the inner product of states, (N + 1 + m,): all lengths around the lead count alike, down to its
        own.

        Otherwise nothing would tell how it looks, on which Newton's method depends. σ follows from the rim where the
        edge of the tip leads.
        """
        near = 1.0 if self.ends else _near(mesh, self.lead.place, self.lead.width)
        return np.append(mesh.weights * near, [one.weight for one in self.all])

    def velocities(self, mesh: Mesh, disc: bool) -> tuple[Array, Array]:
        """Rates of the mesh's edges and targets with the motions of the others, (m, P + 1) and (m, N + R).

        Around a disc the innermost panel stays, on which functions have their expansion at the rim.
        """
        places = [one.place for one in self.others]
        first = mesh.innermost if disc and min(places) > mesh.innermost else 0.0
        knots = np.unique([first, *places, self.lead.place, float(mesh.end)])
        edges = np.array([np.interp(mesh.edges, knots, (knots == place).astype(float)) for place in places])
        nodes = edges[:, :-1, None] + (edges[:, 1:] - edges[:, :-1])[:, :, None] * mesh.shares
        return edges, np.hstack([nodes.reshape(len(edges), mesh.size), edges[:, list(mesh.roots)]])

    def located(self, seen: Seen, known: dict[int, float], about: float) -> Array:
        """σ and b at a state on a mesh at rest, (1 + m,): `known` are places of its breakpoints by their keys; the lead
        is where the state has its gap, nearest to `about`."""
        equations, fields = seen
        sigma = self._shift(seen, about)
        moves = []
        for one in self.others:
            place = known.get(one.key)
            if place is None and not one.root:
                found = crossings(equations.mesh, fields, one.gap).get(max(0, one.key) // CROSSING)
                place = None if found is None else found[0]
            moves.append(0.0 if place is None else place * math.exp(-sigma) - one.place)
        return np.array([sigma, *moves])

    def _shift(self, seen: Seen, about: float) -> float:
        (equations, fields), lead = seen, self.lead
        if self.ends:
            return math.log(to_edge(equations, fields) / lead.place)
        mesh, above = equations.mesh, fields.gap > lead.gap
        crossed = np.flatnonzero(above[1:] != above[:-1])
        if len(crossed) == 0:
            return about
        k = int(crossed[np.argmin(np.abs(np.log(mesh.nodes[crossed] / lead.place) - about))])
        low, high, rising = float(mesh.nodes[k]), float(mesh.nodes[k + 1]), bool(above[k + 1])
        for _ in range(60):
            middle = (low + high) / 2
            if (float(mesh.interpolate(fields.gap, np.array([middle]))[0]) > lead.gap) == rising:
                high = middle
            else:
                low = middle
        return math.log(low / lead.place)


def moved_with(mesh: Mesh, rates: Array, by: Array) -> Mesh:
    """The mesh with its edges moved.

    Raises
    ------
    AstrayError
        If panels would become far too short.
    """
    edges = mesh.edges + by @ rates
    if not shortened(mesh, edges) > (LEAST_ROOM if mesh.roots else SHORTEST):
        raise AstrayError("a breakpoint has left its part of the mesh")
    return Mesh(edges, mesh.order, mesh.bounded, mesh.roots)


def shortened(mesh: Mesh, edges: Array) -> float:
    """By which share the most shortened panel is so."""
    return float((np.diff(edges) / np.diff(mesh.edges)).min())


def with_edges(edges: Array, places: Sequence[float]) -> Array:
    """Edges of panels with places among them, none close to these; the last one stays."""
    for place in places:
        away = np.abs(edges - place) > NEXT * np.minimum(edges, place)
        away[[0, -1]] = True
        away |= np.isin(edges, places)
        inner = [INNERMOST * place] if edges[1] > INNERMOST * place else []
        edges = np.unique(np.append(edges[away], [*inner, place]))
    return edges


# -- which there are ---------------------------------------------------------------------------------------------------
def extent_leads(seen: Seen, tolerance: float, present: Motion | None) -> Motion | None:
    """The edge of the tip, if a mesh for a tolerance of the load comes close to it, and what ends there matters.

    It does where a film is pressed, whose own front gets there, and the law's kink must not cross that edge within a
    panel. A mesh that ends there goes on to do so for longer.
    """
    equations, fields = seen
    tolerance, distance, ends = tolerance * MISSED, to_edge(*seen), present is not None and present.ends
    share = LEAVES if ends else 1.0
    close = share * CLOSE_TO_EDGE * distance
    kinked = bool(equations.kinks) and _outermost(seen)[0] > close
    if not (kinked or needed_reach(equations, fields, tolerance) > close):
        return None
    last = max(int(np.searchsorted(equations.mesh.nodes, distance)) - 1, 0)
    edge = math.pi * distance**2 * max(abs(fields.pressure[last]), abs(fields.energy_density[last]))
    if not (kinked or equations.law.layers or edge > share * tolerance or fields.pressure[0] > 0.0):
        return None
    return present if ends else Motion(Breakpoint(distance, 0.0, 1.0, EXTENT))


def law_leads(seen: Seen, present: Motion | None) -> Motion | None:
    """The outermost kink of the law in a state, if there is one; the present one as long as it is there."""
    equations, fields = seen
    if not equations.kinks:
        return None
    kink, mesh, leads = equations.kinks[0], equations.mesh, present is not None and present.of_law
    width, (place, slope) = equations.tip.radius_at(kink), _outermost(seen)
    least = LEAST_DISTANCE * width * (STAYS if leads else 1.0)
    if not least < place < CLOSE_TO_EDGE * to_edge(*seen):
        return None
    if leads or slope is None:
        return present if leads else None
    weight = max(float(mesh.weights @ fields.h**2), (LIFTED * kink) ** 2 * width)
    power = equations.tip.apex_exponent * float(fields.pressure[0] > 0.0)
    found = Motion(Breakpoint(place, kink, slope, 0, weight), (), power)
    place *= math.exp(found.located(seen, {}, 0.0)[0])
    return replace(found, lead=replace(found.lead, place=place))


def steepest(seen: Seen, present: Motion | None, unit: Mesh, radius: float) -> Motion | None:
    """What leads of a smooth law: the present breakpoint as long as it serves, or where the pressure is steepest.

    Parameters
    ----------
    seen : Equations, Fields
    present : Motion or None
    unit : Mesh
        The mesh before it was stretched.
    radius : float
        Over which the interaction is felt.
    """
    equations, fields = seen
    mesh = equations.mesh
    if present is not None and not present.power and _pressed(equations, fields):
        present = None  # a film's is another
    unit = mesh if present is None else unit
    slope = mesh.derivative(fields.gap) * (mesh.end / unit.end)
    serving = None
    if present is not None:
        nodes, row = unit.row(present.lead.place)
        # Where the gap comes to rest at the front, its place would turn round, and with it the curve.
        serving = present if abs(row @ slope[nodes]) > RESTS * abs(present.lead.slope) else None
    stiffness = np.abs(fields.stiffness)
    stiff = float((stiffness * np.maximum(mesh.nodes, radius)).max())
    steep = np.abs(mesh.nodes * mesh.derivative(fields.pressure)) / max(magnitude(fields.pressure), 1e-300)
    place = int(np.argmax(steep))
    if not (stiff > FAR_OUT * STIFF or float(stiffness.max()) * radius > STIFF or steep[place] > STEEP):
        return serving
    if not steep[place] > (BEGINS if serving is None else ENDS) * (OF_FILMS if stiff > LARGE else 1.0):
        return None
    if serving is not None and float(steep[nodes].max()) > FLATTER * steep[place]:
        return serving
    gap = fields.gap[max(place - 1, 0) : place + 2]
    ends = mesh.nodes[place] > CLOSE_TO_EDGE * to_edge(*seen)  # the tip does there
    steady = bool((np.diff(gap) > 0).all()) or bool((np.diff(gap) < 0).all())
    if ends or not steady or not fields.gap[place] > 0.0:  # below zero the wall has yet to be felt
        return serving
    at, power = float(unit.nodes[place]), equations.tip.apex_exponent * float(fields.pressure[0] > 0.0)
    found = Breakpoint(at, float(fields.gap[place]), float(slope[place]), STEEPEST)
    power = present.power if present else power
    growth = float(mesh.end / unit.end) ** power
    weights = unit.weights * _near(unit, at, found.width)
    return Motion(replace(found, weight=float(weights @ (fields.h / growth) ** 2)), (), power)


def of_law(seen: Seen, lead: Breakpoint, known: dict[int, float], stiff: bool) -> tuple[Breakpoint, ...]:
    """What moves besides a leading breakpoint: crossings of the law's kinks, and of its layers where these are stiff.

    Parameters
    ----------
    lead : Breakpoint
        On the mesh of the state.
    known : dict
        Places of those that move already, by their keys.
    """
    equations, fields = seen
    mesh, kinks = equations.mesh, len(equations.kinks)
    wave = math.inf if equations.interaction is None else equations.interaction.wave
    found = []
    for k, gap in equations.marks.items():
        if lead.key == STEEPEST if k < kinks else not stiff:
            continue
        crossed = crossings(mesh, fields, gap)
        for number, (place, slope) in crossed.items():
            key = k + number * CROSSING
            place = known.get(key, place)
            away = min([place, *(abs(place - other) for n, (other, _) in crossed.items() if n != number)])
            share = STAYS if key in known else 1.0
            apart = abs(place - lead.place) if key != lead.key else 0.0
            least = share * LEAST_DISTANCE * equations.tip.radius_at(gap)
            if k >= kinks:
                beside = max(place / lead.place, lead.place / place) < 1.0 + share * (BESIDE_LEAD - 1.0)
                beside &= lead.key != EXTENT
                wide = LAYER * wave / abs(slope) > NARROW * place / share
                least = math.inf if beside or wide else least
            if math.isfinite(slope) and min(away, apart, float(mesh.end) - place) > least:
                found.append(Breakpoint(place, gap, slope, key))
    found.sort(key=lambda one: one.width / one.place)
    return tuple(found[:MOST])


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


def to_edge(equations: Equations, fields: Fields) -> float:
    """Distance rho of the tip's edge from the rim."""
    extent, a = equations.tip.extent, fields.rim.radius
    return math.sqrt(max((extent - a) * (extent + a), 1e-300))


def _outermost(seen: Seen) -> tuple[float, float | None]:
    """Distance of the outermost kink from the rim, and the slope of the gap there; None if a mesh ends within it."""
    equations, fields = seen
    kink = equations.kinks[0]
    found = crossings(equations.mesh, fields, kink).get(0)
    return found or (float(equations.mesh.nodes[fields.gap < kink].max(initial=0.0)), None)


def _pressed(equations: Equations, fields: Fields) -> bool:
    """Whether a film is far thinner than what it lets the surface bend."""
    return not equations.contact and 0.0 < -fields.y < PRESSED * fields.rim_value and bool(fields.pressure[0] > 0.0)


def _near(mesh: Mesh, place: float, width: float) -> Array:
    """Weights with which all lengths around a place count alike; what lies far outside only moves through the mesh."""
    return place / (np.abs(mesh.nodes - place) + width) / math.log(2.0 + place / width)
