"""The equilibrium of an axisymmetric contact as N equations for N values of h and one contact coordinate.

For a given contact coordinate y (see `ContactCoordinate`) everything follows from ``h(tau)``:

    h(0) = rim value of h,     d = h(0) + zeta(a)  (contact),     d = h(0) − g(0)  (no contact)
    gap(rho) = plane(a) [h − h(0)] + gap of the undeformed tip + max(−y, 0) + gap of the wall, 0 without a soft core
    R(h, y)  = h − abel p_fr(gap) = 0

so the rim condition phi(a) = 0 is built in, and the displacement is a result and not an unknown.

Outside of the central disc the mesh may consist of regions that meet at its root edges. In one that floats the pressure
is that of a band of the law. In one that rests the pressure is unknown, and the gap is a level of the law:

    R = (h − abel p, gap − level on what rests),     state = (h, p on what rests)
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import pairwise
from typing import Any

import numpy as np
from scipy.linalg import lapack

from contbranch.arrays import Array, Flags, magnitude
from contbranch.contact.interactions import Interaction
from contbranch.contact.tips import Tip
from contbranch.contact.validity import energy_pole
from contbranch.models.quadrature import chebyshev_values, gauss

from .law import BandedLaw
from .layout import Region
from .mesh import Mesh
from .rim import Rim

__all__ = ["RECENT", "ContactCoordinate", "Equations", "Fields", "felt"]

# Gauss nodes in a power of end/r for what lies beyond the mesh, at most this one: energies around sharp tips decay
# slowly.
TAIL_NODES, SLOWEST = 20, 6.0
# Panels that a product of triangular matrices takes at a time.
STRIP = 4
# A mesh that ends this close to a tip's edge ends there: one that stretches may be off by many roundings.
WITHIN = 1.0 - 1e-9
# Radii so much smaller than the distance from the rim do not matter for the slope of a tip's gap.
APART = 1e-6
NONE, NO_LAW = np.zeros(0, dtype=np.intp), BandedLaw(None)
# v'' where the gap rests, in units of the largest elsewhere: larger ones say no more, and cost digits.
RIGID = 1e6
# Solutions whose fields are kept: the ends of a step and what was tried between them.
RECENT = 6

# Places on the innermost panel at which a dish under a flat tip is looked for; the first one as a share of its length.
DISH_PLACES, FIRST_DISH_PLACE = 60, 1e-4


@dataclass(frozen=True)
class ContactCoordinate:
    """One signed number that orders states: y = a^m in contact, y = −g(0) without (reduced units).

    ``m = min(n, 2)`` for a tip that starts like r^n, so that load and displacement have a finite slope in y at first
    touch.
    """

    tip: Tip
    power: float

    def radius(self, y: float) -> float:
        """Contact radius a(y); 0 for y <= 0."""
        return float(y) ** (1 / self.power) if y > 0 else 0.0

    def of(self, contact_radius: float, central_gap: float) -> float:
        """The coordinate of a state with this contact radius or this central gap."""
        return contact_radius**self.power if contact_radius > 0 else -central_gap

    def slopes(self, y: float) -> tuple[float, float, float]:
        """(da/dy, d(a²)/dy, dzeta(a)/dy), right-hand derivatives at y = 0+."""
        a = max(self.radius(y), 1e-12)
        da = a ** (1 - self.power) / self.power
        return da, 2 * a * da, float(self.tip.transform_derivative(np.float64(a))) * da


@dataclass(frozen=True)
class Fields:
    """All that follows from one state and y: fields at the mesh's nodes, reduced units."""

    state: Array
    h: Array
    y: float
    rim: Rim
    raised: Array  # what the surface follows, h on a half space
    rim_value: float  # of that, at tau = 0
    gaps: Array  # at the nodes and at the root edges
    gap: Array
    energy_density: Array
    pressure: Array
    stiffness: Array  # v'' = −dp/dg
    residual: Array
    rests: Flags  # whether the gap does
    derived: dict[str, Any] = field(default_factory=dict, compare=False, repr=False)  # what was computed from them

    @property
    def rigid(self) -> Array:
        """v'', and next to infinite where the gap rests, for variations that leave it there."""
        return np.where(self.rests, RIGID * max(1.0, magnitude(self.stiffness)), self.stiffness)

    @property
    def finite(self) -> bool:
        """Whether the residual is finite, so that the law could be evaluated everywhere."""
        return bool(np.isfinite(self.residual).all())


@dataclass(frozen=True)
class _Beyond:
    """Load, energy and displacement from beyond the mesh, and what changes of displacement and of the last gap add."""

    load: float = 0.0
    energy: float = 0.0
    shift: float = 0.0
    load_per_displacement: float = 0.0
    load_per_gap: float = 0.0
    shift_per_displacement: float = 0.0
    shift_per_gap: float = 0.0


NOTHING = _Beyond()


class _Tail:
    """Where what lies beyond the mesh is integrated, in end/r, for one rim.

    Attributes
    ----------
    ends, last : float
        Radius of the mesh's end, and the tip's height at its last node.
    height, fading : array (K,)
        Of the tip, and of the elastic displacement, which is 1 at the last node.
    rings : array (2, K)
        Weights of load and shift.
    poles : array (K,)
        What is taken off the energy per area, times its pole, where the integral would be infinite.
    answers : array (4, K)
        Weights with which the stiffness gives the last four numbers of `_Beyond`.
    """

    def __init__(self, tip: Tip, mesh: Mesh, radius: float) -> None:
        self.radius, self.ends = radius, math.hypot(float(mesh.end), radius)
        node = math.hypot(float(mesh.nodes[-1]), radius)
        nodes, weights = gauss(TAIL_NODES)
        x = (nodes + 1) / 2
        exponent = 2.0
        if self.ends < WITHIN * tip.extent:
            exponent = float(self.ends * tip.height_derivative(self.ends) / tip.height(self.ends))
        power = min(1 / max(2 * exponent - 2, 1 / SLOWEST), SLOWEST) if 1.0 < exponent < 1.5 else 1.0
        r = self.ends / x**power
        self.last, self.height, self.fading = float(tip.height(node)), tip.height(r), node / r
        ring = np.pi * weights * r * (power * r / x)
        self.poles = 1 / (r * r)
        self.rings = np.array([ring, ring / (np.pi * np.sqrt(r * r - radius * radius))])
        sharing = np.array([1 - self.fading, self.fading])
        self.answers: Array = (self.rings[:, None] * sharing).reshape(4, -1)
        self._tip, self._rho = tip, mesh.nodes

    @cached_property
    def pressed(self) -> Array:
        """2π r/z' at the mesh's nodes, (N,)."""
        r = np.hypot(self._rho, self.radius)
        with np.errstate(invalid="ignore", divide="ignore"):
            pressed = 2 * np.pi * r / self._tip.height_derivative(r)
        return np.where(np.isfinite(pressed), pressed, 0.0)


@dataclass(eq=False, repr=False)
class Equations:
    """Residual, linearisation and observables of one contact (reduced units) on one mesh.

    Parameters
    ----------
    tip, interaction : Tip, Interaction or None
        In reduced units.
    mesh : Mesh
    coordinate : ContactCoordinate
    contact : bool
        Whether there is a contact disc. First touch, y = 0, is a kink of the state's dependence on y, so either side
        has its
        own equations; those without contact go on smoothly into y > 0, where the gap would be negative at the centre.
    regions : tuple of Region
        What lies between the root edges of the mesh, from inside outwards.
    level : int
        The level of the law at which the central disc rests.
    law : BandedLaw
        That of the interaction; made where it is another's.

    Attributes
    ----------
    resting : integer array (K,)
        Nodes of the regions that rest.
    size : int
        Number of unknowns, N + K.
    """

    tip: Tip
    interaction: Interaction | None
    mesh: Mesh
    coordinate: ContactCoordinate
    contact: bool
    regions: tuple[Region, ...] = (Region(False, 0),)
    level: int = 0
    law: BandedLaw = NO_LAW

    def __post_init__(self) -> None:
        if self.law.interaction is not self.interaction:  # otherwise what it knows is kept
            self.law = BandedLaw(self.interaction)
        self.resting, self._levels = NONE, np.zeros(0)
        if len(self.regions) > 1:
            rest = [(nodes, region.index) for nodes, region in self.divided() if region.rests]
            self.resting = np.concatenate([NONE, *(np.arange(nodes.start, nodes.stop) for nodes, _ in rest)])
            self._levels = np.concatenate([np.full(n.stop - n.start, self.law.levels[k]) for n, k in rest] or [NONE])
        self.size = self.mesh.size + len(self.resting)
        self._rests = np.zeros(self.mesh.size, dtype=bool)
        self._rests[self.resting] = True
        self.rim_row = np.zeros(self.mesh.size)
        self.rim_row[: self.mesh.order] = self.mesh.rule.rim
        self._rim: Rim | None = None
        self._shape: tuple[Rim, tuple[Array, Array]] | None = None
        self._tail: _Tail | None = None
        self._recent: list[Fields] = []

    def on(self, mesh: Mesh) -> Equations:
        """The same contact on another mesh."""
        return replace(self, mesh=mesh)

    def stretched(self, factor: float) -> Equations:
        """The same contact on the mesh stretched by a factor."""
        return self.on(self.mesh.stretched(factor))

    @cached_property
    def finer(self) -> Equations:
        """The same contact on the finer mesh."""
        return self.on(self.mesh.finer)

    def touching(self, contact: bool) -> Equations:
        """The same contact on the same mesh, with or without a disc."""
        return self if contact == self.contact else replace(self, contact=contact)

    def forget(self) -> None:
        """Drop what has been kept to save work, matrices mostly; it is made again when it is asked for."""
        self._recent = []
        self._rim = self._shape = None
        self.__dict__.pop("finer", None)
        self.mesh.forget()

    @property
    def rest(self) -> float:
        """The gap of the central disc."""
        return self.law.levels[self.level] if self.contact else 0.0

    @property
    def wall(self) -> float:
        """The gap at the wall."""
        return self.law.levels[0]

    def central_gap(self, fields: Fields) -> float:
        """The gap in the middle."""
        return self.rest if self.contact else self.wall - fields.y

    # -- regions ------------------------------------------------------------------------------------------------------
    def divided(self) -> Iterator[tuple[slice, Region]]:
        """The nodes of every region."""
        ends = [0, *(root for root in self.mesh.roots if root < self.mesh.panels), self.mesh.panels]
        for (first, last), region in zip(pairwise(ends), self.regions, strict=True):
            yield slice(first * self.mesh.order, last * self.mesh.order), region

    def _answer(self, gap: Array, state: Array) -> tuple[Array, Array, Array]:
        """Energy density, pressure and v'' at the nodes."""
        if self.interaction is None:
            return np.zeros_like(gap), np.zeros_like(gap), np.zeros_like(gap)
        if len(self.law.levels) == 1 and not len(self.resting):
            return self.interaction.evaluate(gap)
        answer = np.zeros((3, len(gap)))
        for nodes, region in self.divided():
            if region.rests:
                answer[0, nodes] = self.law.energy(region.index)
            else:
                answer[:, nodes] = self.law.evaluate(region.index, gap[nodes])
        answer[1, self.resting] = state[self.mesh.size :]
        return answer[0], answer[1], answer[2]

    def beside(self, k: int, inside: bool) -> tuple[Region, Region]:
        """The region that rests inside of a root edge, or beyond, and the one on its other side."""
        pair = [*self.regions, Region(False, self.law.outermost)][k : k + 2]
        return (pair[0], pair[1]) if inside else (pair[1], pair[0])

    def carried(self, state: Array, other: Equations, factor: float = 1.0) -> Array:
        """A state, or a direction of states, at the nodes of other equations with these regions, whose lengths are
        taken times a factor."""
        mesh, n, places = self.mesh, self.mesh.size, factor * other.mesh.nodes
        found = mesh.interpolate(state[:n], places)
        if not len(self.resting):
            return found
        pressure = np.zeros(n)
        pressure[self.resting] = state[n:]
        return np.append(found, mesh.interpolate(pressure, places)[other.resting])

    def sloped(self, state: Array) -> Array:
        """Derivative of a state with respect to tau, at the nodes."""
        n = self.mesh.size
        if not len(self.resting):
            return self.mesh.derivative(state)
        pressure = np.zeros(n)
        pressure[self.resting] = state[n:]
        return np.append(self.mesh.derivative(state[:n]), self.mesh.derivative(pressure)[self.resting])

    def with_resting(self, values: Array) -> Array:
        """Values at the nodes as a vector of the equations: those where the gap rests once more."""
        return np.append(values, values[self.resting]) if len(self.resting) else values

    # -- fields -------------------------------------------------------------------------------------------------------
    def rim(self, y: float) -> Rim:
        """Operators for the rim of y (the last one is kept)."""
        a = self.coordinate.radius(y) if self.contact else 0.0
        if self._rim is None or self._rim.radius != a:
            self._rim = Rim(self.mesh, a)
        return self._rim

    def fields(self, state: Array, y: float) -> Fields:
        """Gap, pressure and residual of a state."""
        for known in self._recent:
            if known.y == y and known.state is state:
                return known
        rim, h = self.rim(y), state[: self.mesh.size]
        raised, rim_value = self._raised(h, rim)
        shape, shape_slope = self._shape_gap(rim)
        rise = rim.bent(raised - rim_value) + shape
        centre = self.rest if self.contact else self.wall - y
        gaps = rise + centre if centre else rise
        gap = gaps[: self.mesh.size]
        energy, pressure, stiffness = self._answer(gap, state)
        residual = h - self.mesh.abel_of(pressure)
        if len(self.resting):  # without the gaps' own rounding, which is that of the gap at the centre
            residual = np.append(residual, rise[self.resting] - (self._levels - centre))
        fields = Fields(
            state, h, y, rim, raised, rim_value, gaps, gap, energy, pressure, stiffness, residual, self._rests
        )
        fields.derived["shape_slope"] = shape_slope
        self._recent = [fields, *self._recent[: RECENT - 1]]
        return fields

    def _raised(self, h: Array, rim: Rim) -> tuple[Array, float]:
        """What the surface follows outside, and at the rim."""
        return h, float(self.rim_row @ h)

    def rim_gradient(self, fields: Fields) -> Array:
        """Derivative of what the surface follows at the rim with respect to h, (N,)."""
        return self.rim_row

    def _shape_gap(self, rim: Rim) -> tuple[Array, Array]:
        """The gap around a rim without interaction, and its slope (the last ones are kept)."""
        if self._shape is None or self._shape[0] is not rim:
            self._shape = rim, self.tip.shape_gap(self.mesh.targets, rim.radius)
        return self._shape[1]

    # -- linearisation ------------------------------------------------------------------------------------------------
    def response(self, fields: Fields) -> Array:
        """``abel v'' plane``: change of −abel p with h at fixed displacement and rim; (N, N)."""
        return upper_times_lower(self.mesh.abel_with(fields.stiffness), fields.rim.plane, self.mesh.order)

    def answered(self, fields: Fields, h: Array) -> Array:
        """``response @ h``, without that matrix; (N,)."""
        return self.mesh.abel_of(fields.stiffness * fields.rim.bent(h)[: self.mesh.size])

    def load_per_displacement(self, fields: Fields) -> float:
        """dF/dd = 2 (a + ∫_a^∞ δh dt) with (1 − B k A) δh = −B k s, in units of E: rim and its motion do not enter.

        The gap answers a rigid motion by −s (s = 1 without contact), and phi(a) = 0 keeps the motion of the rim out:
        the slope loses no digits where the rate of the load along the curve does.
        """
        response = self.response(fields)
        response.flat[:: len(response) + 1] += 1.0
        answer = np.linalg.solve(response, self.answered(fields, np.ones_like(fields.h)))
        beyond, last = self.beyond(fields), float(fields.rim.plane[-1] @ (answer - 1.0))
        load = 2.0 * (fields.rim.radius + float(fields.rim.weights @ answer))
        load += beyond.load_per_displacement - beyond.load_per_gap * last
        return load / (1.0 + beyond.shift_per_displacement - beyond.shift_per_gap * last)

    def multiplied(self, fields: Fields, h: Array) -> Array:
        """``jacobian @ h``, without that matrix: the gap hardly moves where a stiff film bears large changes of h."""
        if not len(self.resting):
            return h + self.answered(fields, h - self.rim_row @ h)
        n = self.mesh.size
        gap = fields.rim.bent(h[:n] - self.rim_row @ h[:n])[:n]
        answer = fields.stiffness * gap
        answer[self.resting] -= h[n:]
        return np.append(h[:n] + self.mesh.abel_of(answer), gap[self.resting])

    def jacobian(self, fields: Fields) -> Array:
        """dR/dstate at fixed y: of h, I + response (I − 1 rimᵀ)."""
        matrix = self.response(fields)
        n = self.mesh.order
        matrix[:, :n] -= matrix.sum(axis=1)[:, None] * self.rim_row[:n]
        matrix.flat[:: self.mesh.size + 1] += 1.0
        if not len(self.resting):
            return matrix
        n, whole = self.mesh.size, np.zeros((self.size, self.size))
        gap = fields.rim.plane[self.resting]
        whole[:n, :n], whole[n:, :n] = matrix, gap - gap.sum(axis=1)[:, None] * self.rim_row
        whole[:n, n:] = -self.mesh.abel[:, self.resting]
        return whole

    def slopes(self, fields: Fields) -> tuple[Array, Array]:
        """Rates of the gaps, (N + R,), and of the residual with y at fixed h."""
        if "slopes" not in fields.derived:
            gap_slope = self._gap_slope(fields)
            # Beyond the end of a tip the gap is infinite and nothing answers its change.
            own = gap_slope[: self.mesh.size]
            answer = np.zeros_like(own)
            np.multiply(fields.stiffness, own, out=answer, where=np.isfinite(own))
            residual_slope = self.mesh.abel_of(answer)
            if len(self.resting):
                residual_slope = np.append(residual_slope, gap_slope[self.resting])
            fields.derived["slopes"] = gap_slope, residual_slope
        gap_slope, residual_slope = fields.derived["slopes"]
        return gap_slope, residual_slope

    def _gap_slope(self, fields: Fields) -> Array:
        if not self.contact:
            return np.full(len(fields.gaps), -1.0)
        da, dc, _ = self.coordinate.slopes(fields.y)
        shape_slope: Array = fields.derived["shape_slope"]
        if fields.rim.radius < 1e-12:  # right-hand derivatives
            _, shape_slope = self.tip.shape_gap(self.mesh.targets, 1e-12)
        return fields.rim.plane_slope(fields.raised - fields.rim_value) * dc + shape_slope * da

    def spread(self, fields: Fields, power: float) -> tuple[Array, Array]:
        """Rates of the gaps, (N + R,), and the residual with ln of the stretch of the mesh, h growing with its power.

        The kernels are homogeneous: `abel` grows with the mesh, and `plane` depends on the rim's radius in its units.
        """
        if (kept := f"spread {power}") not in fields.derived:
            a, gap = fields.rim.radius, self._rising(fields)
            if a > 0:
                gap -= 2 * a * a * fields.rim.plane_slope(fields.h - fields.rim_value)
            gap += power * fields.rim.bent(fields.h - fields.rim_value)
            answer = np.zeros_like(fields.gap)
            np.multiply(fields.stiffness, gap[: self.mesh.size], out=answer, where=fields.stiffness != 0.0)
            answer[self.resting] = -power * fields.pressure[self.resting]
            residual = power * fields.h + self.mesh.abel_of(answer - fields.pressure)
            if len(self.resting):
                residual = np.append(residual, gap[self.resting])
            fields.derived[kept] = gap, residual
        gap_rate, residual_rate = fields.derived[kept]
        return gap_rate, residual_rate

    def _rising(self, fields: Fields) -> Array:
        """rho times the slope of the undeformed tip's gap, (N + R,)."""
        rho, a = self.mesh.targets, fields.rim.radius
        gap = rho * self.tip.height_derivative(rho)
        if a > 0:  # rho dg/drho = (2/π) (rho/r)² ∫_a^r ζ' t/√(r² − t²) dt, from its part in dg/da
            steep = (2 / np.pi) * float(self.tip.transform_derivative(np.float64(a)))
            around = rho * rho * ((fields.derived["shape_slope"] + steep * np.arctan2(rho, a)) / a)
            gap = np.where(rho > a / APART, gap, around)
        gap[~np.isfinite(gap)] = 0.0  # beyond the end of a tip nothing moves
        return gap

    def drift(self, fields: Fields, edges: Array, nodes: Array) -> tuple[Array, Array]:
        """Rates of gaps and residual where edges and targets of the mesh move at rates linear on every panel, with
        their h; (m, P + 1) and (m, N + R) -> (m, N + R) and (m, N + K)."""
        mesh = self.mesh
        gap = fields.rim.drift(fields.h - fields.rim_value, edges, nodes)
        gap += nodes / mesh.targets * self._rising(fields)
        n = mesh.size
        answer = mesh.abel_of((fields.stiffness * gap[:, :n]).T).T  # what moves is felt, and its gap is finite
        answer -= mesh.abel_drift(fields.pressure, edges, nodes[:, :n])
        return gap, np.hstack([answer, gap[:, self.resting]]) if len(self.resting) else answer

    # -- observables --------------------------------------------------------------------------------------------------
    def displacement(self, fields: Fields) -> float:
        """Far-field displacement d."""
        return self._own_displacement(fields) + self.beyond(fields).shift

    def _own_displacement(self, fields: Fields) -> float:
        """Displacement without the interaction beyond the mesh."""
        if not self.contact:
            return fields.rim_value + fields.y - self.wall
        return fields.rim_value + float(self.tip.transform(np.float64(fields.rim.radius))) - self.rest

    def load(self, fields: Fields) -> float:
        """Load F = 2 ∫_0^∞ h dt (E = 1), with h = d − zeta inside the contact, and the interaction's beyond the
        mesh."""
        return self._own_load(fields) + self.beyond(fields).load

    def _own_load(self, fields: Fields) -> float:
        """Load without the interaction beyond the mesh."""
        a = fields.rim.radius
        inside = 0.0
        if a > 0:
            inside = (self._own_displacement(fields) + self.rest) * a - float(
                self.tip.transform_integral(np.float64(a))
            )
        return 2 * (inside + float(fields.rim.weights @ fields.h))

    def energy(self, fields: Fields) -> float:
        """V_ela + V_fr, with the contact's own −work pi a² and the law's tail beyond the mesh."""
        a = fields.rim.radius
        d = self._own_displacement(fields)
        beyond = self.beyond(fields)
        elastic = float(fields.rim.weights @ fields.h**2) + beyond.shift * self._own_load(fields)
        if a > 0:
            tip, d = self.tip, d + self.rest
            elastic += d * d * a - 2 * d * float(tip.transform_integral(np.float64(a)))
            elastic += float(tip.transform_square_integral(np.float64(a)))
        return elastic + self._surface(fields) + beyond.energy

    def _surface(self, fields: Fields) -> float:
        """Energy of the interaction within the mesh."""
        if self.interaction is None:
            return 0.0
        surface = 2 * np.pi * float(self.mesh.weights @ (self.mesh.nodes * fields.energy_density))
        if fields.rim.radius > 0:  # a law may have no energy where the surfaces do not come to touch
            surface += np.pi * fields.rim.radius**2 * self._touching
        return surface

    def load_change(self, fields: Fields, step: Array) -> float:
        """Change of the load within the mesh with h."""
        return 2 * (float(fields.rim.weights @ step) + fields.rim.radius * float(self.rim_row @ step))

    def load_beyond(self, fields: Fields) -> Array:
        """Load of the interaction beyond each node, (N,), where the gap is the tip's own: ∫ p r dr = ∫ p (r/z') dg."""
        return self._tail_of(fields).pressed * fields.energy_density

    def beyond(self, fields: Fields) -> _Beyond:
        """What the interaction beyond the mesh adds to load, energy and displacement.

        The gap there is the tip's own plus an elastic displacement that falls like 1/r, as a point force's, from its
        value at
        the last node. The load is 2π ∫ p r dr and the energy 2π ∫ v r dr; the pressure out there lifts h, and with it
        the
        displacement, by 2 ∫ p r dr / rho everywhere inside. In x = end/r the integrands of algebraic tails are all but
        polynomials.
        """
        known = fields.derived.get("beyond")
        if isinstance(known, _Beyond):
            return known
        tail, found = self._tail_of(fields), NOTHING
        if not (self.interaction is None or self.mesh.bounded) and tail.ends < WITHIN * self.tip.extent:
            displacement = self._own_displacement(fields)
            lift = float(fields.gap[-1]) + displacement - tail.last
            gap = tail.height - displacement + lift * tail.fading
            energy, pressure, stiffness = self.law.evaluate(self.law.outermost, gap)
            load, shift = (tail.rings @ pressure).tolist()
            beyond = float(tail.rings[0] @ (energy - self._pole * tail.poles)) - 2 * np.pi * self._pole * math.log(
                tail.ends
            )
            found = _Beyond(load, beyond, shift, *(tail.answers @ stiffness).tolist())
        fields.derived["beyond"] = found
        return found

    @cached_property
    def _pole(self) -> float:
        return energy_pole(self.tip, self.interaction)

    def _tail_of(self, fields: Fields) -> _Tail:
        if self._tail is None or self._tail.radius != fields.rim.radius:
            self._tail = _Tail(self.tip, self.mesh, fields.rim.radius)
        return self._tail

    def gradients(self, fields: Fields) -> tuple[Array, Array]:
        """Derivatives of load and displacement with respect to the nodal values of h at fixed y, (N,) each."""
        displacement = self.rim_row
        load = 2 * (fields.rim.weights + (fields.rim.radius * self.rim_row if self.contact else 0.0))
        beyond = self.beyond(fields)
        if beyond is NOTHING:
            return load, displacement
        last = fields.rim.plane[-1]
        gap = last - last.sum() * self.rim_row
        return (
            load + beyond.load_per_displacement * displacement - beyond.load_per_gap * gap,
            displacement + beyond.shift_per_displacement * displacement - beyond.shift_per_gap * gap,
        )

    def rates(
        self, fields: Fields, h_rate: Array, y_rate: float, stretching: float = 0.0, power: float = 0.0
    ) -> tuple[float, float]:
        """Directional derivatives of load and displacement along (h_rate, y_rate), the mesh stretching at a rate.

        Of what is computed, to rounding: `h_rate` is that at the nodes, which move, and h grows with the stretch to
        its `power` besides.
        """
        a = fields.rim.radius
        _, area, lift = self.coordinate.slopes(fields.y) if self.contact else (0.0, 0.0, 1.0)
        whole = h_rate + stretching * power * fields.h if stretching else h_rate
        displacement = float(self.rim_row @ whole) + lift * y_rate
        load = 2 * float(fields.rim.weights @ whole)
        if self.contact:
            load += 2 * a * displacement + 2 * fields.rim.weights_slope(fields.h) * area * y_rate
        if stretching:
            load += stretching * self._load_per_stretch(fields)
        beyond = self.beyond(fields)
        if beyond is NOTHING:
            return load, displacement
        n = self.mesh.size
        gap = float(fields.rim.plane[-1] @ (h_rate - self.rim_row @ h_rate)) + self.slopes(fields)[0][n - 1] * y_rate
        shift = 0.0
        if stretching:
            rise, lost, shift = self._at_end(fields)
            gap += stretching * (float(self.spread(fields, power)[0][n - 1]) - rise)
            load -= stretching * lost
        return (
            load + beyond.load_per_displacement * displacement - beyond.load_per_gap * gap,
            displacement
            + beyond.shift_per_displacement * displacement
            - beyond.shift_per_gap * gap
            - stretching * shift,
        )

    def drift_rates(self, fields: Fields, edges: Array, nodes: Array) -> tuple[float, float]:
        """Rates of load and displacement where the mesh moves as in `drift`, in one way, with its h."""
        mesh, a, n = self.mesh, fields.rim.radius, self.mesh.size
        longer = np.repeat(np.diff(edges) / (2 * mesh.half), mesh.order)
        turned = a * a / np.hypot(a, mesh.nodes) ** 3
        load = 2 * float((mesh.weights * (longer * fields.rim.factor + nodes[:n] * turned)) @ fields.h)
        beyond = self.beyond(fields)
        if beyond is NOTHING:
            return load, 0.0
        gap = float(self.drift(fields, edges[None], nodes[None])[0][0, n - 1])
        gap -= float(nodes[n - 1] / mesh.nodes[-1]) * self._at_end(fields)[0]
        return load - beyond.load_per_gap * gap, -beyond.shift_per_gap * gap

    def _at_end(self, fields: Fields) -> tuple[float, float, float]:
        """Rates with ln of the stretch: of the last gap, by where it is; of load and shift that the mesh takes over."""
        tail, tip, a = self._tail_of(fields), self.tip, fields.rim.radius
        rho, edge = float(self.mesh.nodes[-1]), float(self.mesh.end)
        node, own = math.hypot(rho, a), self._own_displacement(fields)
        lift = float(fields.gap[-1]) + own - tail.last
        rise = (float(tip.height_derivative(node)) - lift / node) * rho * rho / node
        last = float(tip.height(tail.ends)) - own + lift * node / tail.ends
        pressure = float(self.law.evaluate(self.law.outermost, np.array([last]))[1][0])
        return rise, 2 * np.pi * pressure * edge * edge, 2 * pressure * edge

    def _load_per_stretch(self, fields: Fields) -> float:
        """Rate of the load within the mesh with ln of its stretch at fixed nodal h: ∫ h dt is of order 1 in lengths."""
        rim, a = fields.rim, fields.rim.radius
        slope = 2 * a * a * rim.weights_slope(fields.h) - a * fields.rim_value if a > 0 else 0.0
        return 2 * (float(rim.weights @ fields.h) - slope)

    # -- pressures inside the contact, admissibility ------------------------------------------------------------------
    def inner_pressure(self, fields: Fields, r: Array) -> Array:
        """Total pressure at radii 0 ≤ r < a, (M,): that of the tip alone less ∫_a^∞ h'(t)/√(t² − r²) dt/π."""
        a = fields.rim.radius
        return self.tip.contact_pressure(r, a) - self._pulled(fields, np.maximum((a - r) * (a + r), 0.0)) / np.pi

    def middle_pressure(self, fields: Fields) -> float:
        """The same at r = 0; infinite under a cone."""
        return float(self.inner_pressure(fields, np.zeros(1))[0])

    def _pulled(self, fields: Fields, distance: Array) -> Array:
        """∫_a^∞ h'(t)/√(t² − r²) dt, (M,), with ``distance = a² − r²``."""
        mesh, n, h = self.mesh, self.mesh.order, fields.h
        places, slope = mesh.rises(h)
        root = np.sqrt(places**2 + distance[:, None])
        if mesh.bounded and not mesh.root[-1]:  # h ends like a root: by parts
            slope[-n:] = mesh.weights[-n:] * h[-n:] * mesh.nodes[-n:]
            root[:, -n:] **= 3
        outside = (1 / root) @ slope
        if mesh.bounded and not mesh.root[-1]:
            begin = float(mesh.rule.lagrange(np.ones(1))[0] @ h[-2 * n : -n])
            outside -= begin / np.sqrt(mesh.edges[-2] ** 2 + distance)
        return outside + self._innermost_slope(h, distance)

    def _innermost_slope(self, h: Array, distance: Array) -> Array:
        """∫ h'(t) dt/√(t² − r²) over the innermost panel, (M,), with ``distance = a² − r²``.

        With h even in tau and w² = tau² + distance it is 2 ∫ (dh/dtau²) dw, a polynomial's, however close the rim.
        """
        mesh = self.mesh
        nodes, weights = gauss(mesh.order + 8)
        end = np.sqrt(mesh.innermost**2 + distance)[:, None]
        start = np.sqrt(distance)[:, None]
        w = (end + start) / 2 + (end - start) / 2 * nodes
        return (end - start)[:, 0] * (self._bend(h, w * w - distance[:, None]) @ weights)

    def _bend(self, h: Array, square: Array) -> Array:
        """dh/dtau² on the innermost panel, where h is even in tau, at places tau²."""
        mesh = self.mesh
        local = 2 * square / mesh.innermost**2 - 1
        coefficients = mesh.rule.even_slopes @ (mesh.rule.to_even @ h[: mesh.order])
        values = np.tensordot(coefficients, chebyshev_values(mesh.rule.even_order, local), 1)
        return values * (2 / mesh.innermost**2)

    @cached_property
    def kinks(self) -> tuple[float, ...]:
        """The gaps at which the stiffness jumps, or the pressure within the mesh, from far away inwards."""
        smooth = () if self.interaction is None else self.interaction.kinks
        return tuple(sorted({*smooth, *self.steps}, reverse=True))

    @cached_property
    def steps(self) -> tuple[float, ...]:
        """The gaps at which the pressure jumps between two regions that float."""
        pairs = pairwise([*self.regions, *([Region(False, self.law.outermost)] if self.mesh.bounded else [])])
        floats = [(a.index, b.index) for a, b in pairs if not (a.rests or b.rests) and a.index != b.index]
        return tuple(self.law.levels[max(pair)] for pair in floats)

    @cached_property
    def marks(self) -> dict[int, float]:
        """Gaps of the law at which breakpoints lie, by numbers: kinks, then layers from the wall on."""
        return dict(enumerate((*self.kinks, *self.law.layers)))

    @cached_property
    def softens(self) -> bool:
        """Whether the interaction softens at contact, so that a film that is pressed is squeezed out at once."""
        return self.interaction is not None and float(self.interaction.evaluate(np.zeros(1))[2][0]) < 0.0

    @cached_property
    def _touching(self) -> float:
        """Energy per area of the interaction where the surfaces touch."""
        return 0.0 if self.interaction is None else self.law.energy(self.level)

    def opening(self, fields: Fields, tau: Array) -> Array:
        """phi'(t)/t on the innermost panel, with ``phi = h + zeta − d``.

        Where it is negative at the rim, tau = 0, the gap would close beside it, and the wall would have to pull within.
        """
        t = np.hypot(tau, fields.rim.radius)
        return 2 * self._bend(fields.raised, tau * tau) + self.tip.transform_derivative(t) / t

    @property
    def dish_places(self) -> Array:
        """Distances from the rim, on the innermost panel, at which a dish is looked for."""
        return self.mesh.innermost * np.geomspace(FIRST_DISH_PLACE, 1.0, DISH_PLACES)

    def dish(self, fields: Fields) -> float:
        """Radius of the dish that a film presses into the surface under the apex, at first touch; 0 without.

        The surfaces meet on a ring within before they do at the centre, and no smaller disc is admissible. At most as
        large as the innermost panel.
        """
        tau = self.dish_places
        right = np.flatnonzero(self.opening(fields, tau) >= 0.0)
        return 0.0 if right.size and right[0] == 0 else float(tau[right[0] if right.size else -1])

    # -- stability ----------------------------------------------------------------------------------------------------
    def unstable_modes(self, fields: Fields, finely: bool = True) -> int:
        """Morse index under displacement control (m = 0): negative eigenvalues of the second variation, by inertia.

        The second variation of the energy divided by 2E, ``W + π planeᵀ (rho v'' w) plane`` with ``W = w dt/dtau``: a
        sum of congruences, so that a stiff film (v'' > 0) can never look unstable, however coarse the mesh. The trial
        functions
        are this mesh's polynomials; their gap has half-order edges at the panels' ends, so it is integrated on the
        finer one.
        """
        mesh = self.mesh
        plane, fine_mesh, fine_fields = fields.rim.plane, mesh, fields
        if finely:
            fine_mesh = mesh.finer
            fine_fields = self.finer.fields(self.carried(fields.state, self.finer), fields.y)
            plane = mesh.before_finer(fine_fields.rim.plane)
        # The congruence with W^(-1/2) leaves the inertia alone and makes the unit matrix the bulk of the spectrum.
        scaled = plane / np.sqrt(mesh.weights * fields.rim.factor)
        matrix = scaled.T @ ((np.pi * fine_mesh.weights * fine_mesh.nodes * fine_fields.rigid)[:, None] * scaled)
        matrix.flat[:: mesh.size + 1] += 1.0
        return negative_eigenvalues(matrix)


def felt(tip: Tip, law: Interaction | None) -> float:
    """Radius over which an interaction is felt; 0 without."""
    return 0.0 if law is None else tip.radius_at(min(term.range for term in law.terms))


def upper_times_lower(upper: Array, lower: Array, block: int) -> Array:
    """Product of a block upper and a block lower triangular matrix (blocks of a panel): half the work of a full one."""
    product, strip = np.empty_like(upper), STRIP * block
    for start in range(0, len(upper), strip):
        own, on = slice(start, start + strip), slice(start, None)
        np.matmul(upper[: start + strip, on], lower[on, own], out=product[: start + strip, own])
        np.matmul(upper[own, on], lower[on, :start], out=product[own, :start])
    return product


def negative_eigenvalues(matrix: Array) -> int:
    """Number of negative eigenvalues of a symmetric matrix, of which the lower triangle counts.

    Cholesky if there are none, otherwise LDLᵀ (Sylvester).
    """
    _, info = lapack.dpotrf(matrix, lower=1, clean=0)
    if info == 0:
        return 0
    factor, pivots, _ = lapack.dsytrf(matrix, lower=1, lwork=64 * len(matrix))  # in blocks
    count, k, size = 0, 0, len(pivots)
    diagonal = np.diagonal(factor)
    while k < size:
        if pivots[k] > 0:
            count += int(diagonal[k] < 0)
            k += 1
        else:  # a 2 × 2 block of the Bunch–Kaufman factorisation
            determinant = diagonal[k] * diagonal[k + 1] - factor[k + 1, k] ** 2
            count += 1 if determinant < 0 else 2 * int(diagonal[k] < 0)
            k += 2
    return count
