"""What moves with the mesh, always at the same place of it: a front, where the gap rises steeply, or a tip's edge.

Laws that do not pull at contact, the edge of a squeezed film and the rings of a layered liquid have a steep zone far
outside of the contact, which travels while everything else stays smooth. On the mesh ``tau = e^σ ξ`` with fixed ξ,
where σ is one more unknown and ``g(ξ_f) = g_f`` one more equation, it stands still, and steps are as long as the curve
in these coordinates allows. Where the interaction is felt out to the edge of a tip of finite extent, the pressure jumps
to zero there: that is where the mesh ends.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np

from contbranch.arrays import Array, magnitude
from contbranch.models.fronts import BEGINS, ENDS, FLATTER, STIFF

from .adapt import needed_reach
from .creases import KINK, MOST, SHARE, STAYS, Crease, Row, apart, crossings, gap_row, kinks_of
from .equations import Equations, Fields
from .mesh import Mesh

__all__ = ["Edge", "Front", "Kink", "Rest", "kinks", "steepest"]

# A front is moved where the gap rises by less than this share of what it did, too.
RESTS = 0.25
# A mesh that must reach beyond the first share of the distance to the edge of the tip ends there, if what ends there
# exceeds the tolerance, and goes on to do so down to the second share of both.
CLOSE_TO_EDGE, LEAVES = 0.8, 0.6
# Shares are of this part of the tolerance: on a mesh that does not end there, what does gives loads a slope of the
# mesh's own, alike at every resolution, and folds another place.
MISSED = 0.03
# Other edges of panels are at least this share of its distance away from a kink.
NEXT = 0.1
# A kink counts from this share of the radius at which the tip itself has that gap; its motion counts in the inner
# product of states at least like an h of this share of its gap.
SEEN, LIFTED = 4e-3, 0.3
# Radius over which the interaction is felt in units of the length on which elasticity answers it, from which on steps
# are limited by fronts that are flatter by this factor, like the edges of large films.
LARGE, OF_FILMS = 1000.0, 0.2
# A film is pressed where its gap is below this share of the displacement of the surface.
PRESSED = 0.1
# How much stiffer it has to be where only a film as large as its contact is: below that fixed meshes cost less.
FAR_OUT = 4.0
# A front this steep leads whatever the stiffness.
STEEP = 20.0


@dataclass(frozen=True)
class Front:
    """Where the front is in the mesh, which gap it has there, and the creases besides.

    Attributes
    ----------
    place : float
        ξ_f.
    gap : float
        g_f.
    width : float
        Over which the gap there changes by as much as it is.
    weight : float
        Of σ in the inner product of states: that of h where the front began.
    power : float
        n of a tip like rⁿ where a film is pressed: films that differ in size have the same h/bⁿ. Gaps, far smaller than
        h, change little with σ at fixed h e^(−nσ), and by far more than they are at fixed h. 0 elsewhere.
    """

    place: float
    gap: float
    width: float
    weight: float
    power: float
    creases: tuple[Crease, ...] = ()
    root: bool = False

    @property
    def resting(self) -> tuple[float, float]:
        """What creases do not move."""
        room = SHARE * min([self.place, *(abs(crease.place - self.place) for crease in self.creases)])
        return self.place - room, self.place + room

    @property
    def film(self) -> bool:
        """Whether a film is pressed."""
        return self.power > 0.0

    def weights(self, mesh: Mesh) -> Array:
        """Weights of the inner product of states, (N + 1 + m,): all lengths around the front count alike, down to its
        own.

        Otherwise nothing would tell how it looks, on which Newton's method depends.
        """
        own = [self.weight, *(crease.weight for crease in self.creases)]
        return np.append(mesh.weights * _near(mesh, self.place, self.width), own)

    def slopes(self, mesh: Mesh) -> Array:
        """Weights of dh/dξ in the inner product of states, (N,): so are all lengths around the centre, or the rim.

        A film is squeezed out, and a contact grows in it, over lengths that h itself, which bears the whole load, does
        not show.
        """
        found = np.zeros(mesh.size)
        for away, least in ((np.abs(mesh.nodes - self.place), self.width), (mesh.nodes, mesh.innermost)):
            found += self.place / (away + least) / math.log(2.0 + self.place / least)
        return mesh.weights * found * self.place**2

    def row(self, unit: Mesh, equations: Equations) -> Row:
        """What says how far the gap at the front is from its own."""
        return gap_row(unit, self.place, self.gap)

    def off(self, unit: Mesh, equations: Equations, fields: Fields, sigma: float) -> float:
        """What is left of the front's equation."""
        return self.row(unit, equations).off(fields)

    def derivatives(self, unit: Mesh, equations: Equations, fields: Fields) -> tuple[Array, float, float]:
        """Those of `off` with respect to the state, to σ and to y."""
        row = self.row(unit, equations)
        spread, slope = (
            row.by_gap(rates[0]) for rates in (equations.spread(fields, self.power), equations.slopes(fields))
        )
        return row.by_state(equations, fields), float(spread), float(slope)

    def passing(self, unit: Mesh, equations: Equations, gap: Array) -> Array:
        """Those of `off` where the gaps at the nodes change by so much, (m, N) -> (m,)."""
        return self.row(unit, equations).by_gap(gap)

    def anchored(self, equations: Equations, fields: Fields, about: float = 0.0) -> float:
        """ln s for which the front lies where a state has its gap; nearest to `about`."""
        mesh, above = equations.mesh, fields.gap > self.gap
        crossed = np.flatnonzero(above[1:] != above[:-1])
        if len(crossed) == 0:
            return about
        places = mesh.nodes[crossed]
        k = int(crossed[np.argmin(np.abs(np.log(places / self.place) - about))])
        low, high = float(mesh.nodes[k]), float(mesh.nodes[k + 1])
        rising = bool(above[k + 1])
        for _ in range(60):
            middle = (low + high) / 2
            if (float(mesh.interpolate(fields.gap, np.array([middle]))[0]) > self.gap) == rising:
                high = middle
            else:
                low = middle
        return math.log(low / self.place)


@dataclass(frozen=True)
class Kink(Front):
    """A front where the law's stiffness jumps, which is an edge of panels: nothing is a polynomial across it."""

    def row(self, unit: Mesh, equations: Equations) -> Row:
        """What says how far the gap at the front is from the law's kink."""
        return gap_row(unit, self.place, equations.kink)

    def joined(self, mesh: Mesh, fields: Fields) -> Array:
        """Edges of panels with the kink among them; the last one where there is nothing beyond."""
        edges = mesh.edges
        if not fields.pressure[mesh.nodes > self.place].any():
            edges = edges[edges < self.place]
        away = np.abs(edges - self.place) > NEXT * np.minimum(edges, self.place)
        return np.unique(np.append(edges[away | (edges == 0.0)], self.place))

    @staticmethod
    def needed(seen: tuple[Equations, Fields], present: Front | Edge | None) -> Kink | None:
        """The outermost kink of a state, if there is one; the present one as long as it is there."""
        equations, fields = seen
        mesh, kink = equations.mesh, equations.kink
        if math.isinf(kink):
            return None
        if kink in equations.steps and isinstance(present, Kink):
            return present
        width, (last, crossed) = equations.tip.radius_at(kink), _to_kink(seen)
        near = CLOSE_TO_EDGE * _to_edge(equations, fields)
        if not SEEN * width * (STAYS if isinstance(present, Kink) else 1.0) < last < near:
            return None
        if isinstance(present, Kink) or crossed is None:
            return present if isinstance(present, Kink) else None
        weight = max(float(mesh.weights @ fields.h**2), (LIFTED * kink) ** 2 * width)
        found = Kink(last, kink, 1.0, weight, 0.0)
        place = last * math.exp(found.anchored(equations, fields))
        power = equations.tip.apex_exponent * float(fields.pressure[0] > 0.0)
        return replace(found, place=place, width=abs(kink / crossed), power=power)


@dataclass(frozen=True)
class Rest(Front):
    """An edge of what rests, which is inside of it or (`outside`) beyond; `gap` is what pressures are measured by."""

    outside: bool = False

    def row(self, unit: Mesh, equations: Equations) -> Row:
        """What says how far the pressure there is from that of the law."""
        order = -2 if self.outside else -1
        return Crease(self.place, 0.0, order, 0.0, self.gap, 0.0, 0, True).row(unit, equations)


@dataclass(frozen=True)
class Edge:
    """The mesh ends at the edge of the tip.

    Attributes
    ----------
    place : float
        Where it ended when that began.
    film : bool
        Whether a stiff film has been pressed there.
    """

    place: float
    film: bool = False
    creases: tuple[Crease, ...] = ()
    power: ClassVar[float] = 0.0
    root: ClassVar[bool] = False
    resting: ClassVar[None] = None

    def weights(self, mesh: Mesh) -> Array:
        """Weights of the inner product of states, (N + 1 + m,): σ follows from the rim."""
        return np.append(mesh.weights, [0.0, *(crease.weight for crease in self.creases)])

    def slopes(self, mesh: Mesh) -> Array:
        """Weights of dh/dξ in the inner product of states, (N,): all lengths next to the edge count alike.

        There a film is squeezed out first, over a length that h, which ends like a root, hardly shows.
        """
        away, last = self.place - mesh.nodes, self.place - mesh.edges[-2]
        return mesh.weights * away * self.place / math.log(2.0 + self.place / last)

    def off(self, unit: Mesh, equations: Equations, fields: Fields, sigma: float) -> float:
        """How far ln s is from what it should be."""
        return sigma - math.log(_to_edge(equations, fields) / self.place)

    def derivatives(self, unit: Mesh, equations: Equations, fields: Fields) -> tuple[Array, float, float]:
        """Those of `off` with respect to h, (N,), to σ and to y."""
        growth = equations.coordinate.slopes(fields.y)[1] if equations.contact else 0.0
        return np.zeros(equations.size), 1.0, 0.5 * growth / _to_edge(equations, fields) ** 2

    def passing(self, unit: Mesh, equations: Equations, gap: Array) -> Array:
        """Nothing: the edge is the tip's own."""
        return np.zeros(len(gap))

    def anchored(self, equations: Equations, fields: Fields, about: float = 0.0) -> float:
        """ln s for which the mesh ends at the edge."""
        return math.log(_to_edge(equations, fields) / self.place)

    @staticmethod
    def needed(seen: tuple[Equations, Fields], tolerance: float, front: Front | Edge | None = None) -> Edge | None:
        """The edge, if a mesh for a tolerance of the load comes close to it, and what ends there matters.

        It does where a film is pressed, whose own front gets there, and the law's kink must not cross that edge within
        a panel. A mesh that ends there goes on to do so for longer.
        """
        equations, fields = seen
        tolerance *= MISSED
        distance, present = _to_edge(equations, fields), front if isinstance(front, Edge) else None
        share, nodes = LEAVES if present else 1.0, equations.mesh.nodes
        close = share * CLOSE_TO_EDGE * distance
        kinked = math.isfinite(equations.kink) and _to_kink(seen)[0] > close
        if not (kinked or needed_reach(equations, fields, tolerance) > close):
            return None
        last = max(int(np.searchsorted(nodes, distance)) - 1, 0)
        ends = math.pi * distance**2 * max(abs(fields.pressure[last]), abs(fields.energy_density[last]))
        layered = equations.interaction is not None and math.isfinite(equations.interaction.wave)
        matters = kinked or layered or ends > share * tolerance  # between layers it vanishes
        if not (matters or fields.pressure[0] > 0.0):
            return None
        pressed = bool((fields.pressure[-1] > 0.0) & (np.abs(fields.stiffness).max() * distance > STIFF))
        if present and present.film >= pressed:
            return present
        return replace(present, film=True) if present else Edge(distance, pressed)


def kinks(
    seen: tuple[Equations, Fields], front: Front | Edge | None, followed: Sequence[Crease] = ()
) -> tuple[Crease, ...]:
    """What moves with the law's kinks on a mesh that ends at the edge of a tip, or on one that the first of them leads,
    without its weight."""
    equations, fields = seen
    leads = isinstance(front, Kink)
    if not (equations.kinks and (leads or isinstance(front, Edge))):
        return ()
    least = [SEEN * equations.tip.radius_at(kink) for kink in equations.kinks[:MOST]]
    found = [
        crease
        for k, distance in enumerate(least)
        for crease in kinks_of(equations.mesh, fields, equations.kinks, k, distance, followed)
        if not (leads and crease.key == KINK)
    ]
    return apart(found[:MOST], [_to_kink(seen)[0]] if leads else [])


def _to_kink(seen: tuple[Equations, Fields]) -> tuple[float, float | None]:
    """Distance of the outermost kink from the rim, and the slope of the gap there; None if a mesh ends within it."""
    equations, fields = seen
    found = crossings(equations.mesh, fields, equations.kink).get(0)
    return found or (float(equations.mesh.nodes[fields.gap < equations.kink].max(initial=0.0)), None)


def _to_edge(equations: Equations, fields: Fields) -> float:
    """Distance rho of the tip's edge from the rim."""
    extent, a = equations.tip.extent, fields.rim.radius
    return math.sqrt(max((extent - a) * (extent + a), 1e-300))


def steepest(seen: tuple[Equations, Fields], present: Front | None, unit: Mesh, radius: float) -> Front | None:
    """The front of a state: the present one as long as it serves, or one where the pressure is steepest; None without.

    Parameters
    ----------
    seen : Equations, Fields
    present : Front or None
    unit : Mesh
        The mesh before it was stretched.
    radius : float
        Over which the interaction is felt.
    """
    equations, fields = seen
    mesh = equations.mesh
    if present is not None and not present.film and _pressed(equations, fields):
        present, unit = None, mesh  # a film's is another
    slope = mesh.derivative(fields.gap) * (mesh.end / unit.end)
    serving = None
    if present is not None:
        nodes, row = unit.row(present.place)
        # Where the gap comes to rest at the front, its place would turn round, and with it the curve.
        serving = present if abs(row @ slope[nodes]) * present.width > RESTS * present.gap else None
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
    ends = mesh.nodes[place] > CLOSE_TO_EDGE * _to_edge(equations, fields)  # the tip does there
    steady = bool((np.diff(gap) > 0).all()) or bool((np.diff(gap) < 0).all())
    if ends or not steady or not fields.gap[place] > 0.0:  # below zero the wall has yet to be felt
        return serving
    at, own = float(unit.nodes[place]), float(fields.gap[place])
    width = own / abs(float(slope[place]))
    power = present.power if present else equations.tip.apex_exponent * float(fields.pressure[0] > 0.0)
    growth = float(mesh.end / unit.end) ** power
    weights = unit.weights * _near(unit, at, width)
    return Front(at, own, width, float(weights @ (fields.h / growth) ** 2), power)


def _pressed(equations: Equations, fields: Fields) -> bool:
    """Whether a film is far thinner than what it lets the surface bend."""
    return not equations.contact and 0.0 < -fields.y < PRESSED * fields.rim_value and bool(fields.pressure[0] > 0.0)


def _near(mesh: Mesh, place: float, width: float) -> Array:
    """Weights with which all lengths around a place count alike; what lies far outside only moves through the mesh."""
    return place / (np.abs(mesh.nodes - place) + width) / math.log(2.0 + place / width)
