"""Force against displacement of a contact, as arrays along the whole curve: what a fit evaluates thousands of times.

For a parabola and one law the curve depends on the Tabor coefficient μ_T alone, in reduced units. It is traced at
values of μ_T evenly spaced on a logarithmic scale, when they are first needed, and interpolated between them at fixed
place τ along the curve,

    without contact  g0 = z0 sinh(u),   u = τ² asinh(g_far/z0),
    in contact       a² = R z0 sinh(u), u = τ² asinh(μ_T Y),

where load and displacement less those of the bare parabola are smooth. Maugis' law, JKR, DMT and contacts
without a law are closed forms; any other contact is traced each time.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping
from contextlib import suppress
from functools import cache, lru_cache
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import scipy

from contbranch.arrays import Array
from contbranch.contact.bodies import Body
from contbranch.contact.contact import Contact, make
from contbranch.contact.interaction_law import Interaction, terms_of
from contbranch.contact.interactions import (
    INTERACTIONS,
    Exponential,
    Gauss,
    InverseSquare,
    MaugisDugdale,
    VanDerWaals,
)
from contbranch.contact.tip_shape import Tip
from contbranch.contact.tips import Parabola
from contbranch.continuation import CorrectionError, Point
from contbranch.continuation.walk import point_on
from contbranch.curve.problem import equilibrium
from contbranch.curve.refine import OPTIONS
from contbranch.curve.trace import Request, trace
from contbranch.curve.track import Track, piece
from contbranch.errors import InputError, ModelError
from contbranch.models.choice import choose
from contbranch.theory import maugis
from contbranch.theory._dugdale import Zone
from contbranch.theory.layer import Disc
from contbranch.watch import check, over

# Tabor coefficients between which curves are tabulated, and their ratio from one to the next.
TABOR = (0.0302, 24.5)
RATIO = math.exp(0.2)
# Nodes of the interpolation between them.
NODES = 6
# Places of tables along a curve without contact and in contact, and of curves for each step from one to the next.
PLACES = (240, 360)
FINER = 5
# Rows between which curves are interpolated are at most so far apart.
APART = 0.08
# By how much closer rows are where curves may have corners.
CORNERED = 2.0
# Rows that are closer are one.
CLOSE = 1e-9
# Contact radii on a layer that are computed, between which the quotient by the half space is interpolated.
LAYER_PLACES = 120
# Decades by which adhesion may be larger than the largest load.
DECADES = 8
# Accuracy of tabulated curves, and of those that are traced each time.
ACCURACY, COARSE = 1e-6, 1e-5
# Curves end at loads of this many R Δγ, or a power of it.
TOP = 100.0
# Traced contacts that are kept.
KEPT = 64
# Laws whose tables are shipped.
SHIPPED = ("exponential", "van-der-waals")
# Laws that are limits: the Tabor coefficient has no meaning for them.
LIMITS = ("jkr", "dmt")


class Curve(NamedTuple):
    """Load and displacement along a curve of equilibria, from far away into contact, in the contact's units."""

    load: Array
    displacement: Array

    def scaled(self, load: float, displacement: float) -> Curve:
        """In other units."""
        return Curve(self.load * load, self.displacement * displacement)


def tabulated(contact: Contact) -> bool:
    """Whether a contact's curve is interpolated or a closed form: a parabola with one law of two parameters."""
    law = contact.interaction
    return isinstance(contact.tip, Parabola) and law is not None and type(law) in _SHAPES and contact.body is None


def curve_of(contact: Contact, largest: float, limit: str = "") -> Curve:
    """The curve of a contact up to a load.

    Parameters
    ----------
    contact : Contact
        In physical units.
    largest : float
        Load that the curve must reach.
    limit : {"", "jkr", "dmt"}
        The limit of short or of long ranges in place of the law's own.

    Raises
    ------
    ModelError
        If the contact's curve could not be traced so far.
    """
    scales, law = contact.scales, contact.interaction
    top = TOP ** max(1, math.ceil(math.log(max(largest / scales.load, 1.0)) / math.log(TOP)))
    if limit == "jkr" and law is not None and not (contact.body is None and isinstance(contact.tip, Parabola)):
        return _bare(contact, largest, law.work_of_adhesion / contact.modulus)
    if limit:
        return _LIMITING[limit](top).scaled(scales.load, scales.normal)
    if law is None:
        return _bare(contact, largest)
    if contact.tabor is None or not tabulated(contact):
        return _traced(contact, 1.01 * max(largest, 10 * scales.load))
    sign = 1.0 if law.work_of_adhesion > 0 else -1.0
    tabor = min(max(contact.tabor, TABOR[0]), TABOR[1])
    found = (
        _maugis(tabor, top) if isinstance(law, MaugisDugdale) and sign > 0 else _between(type(law), sign, tabor, top)
    )
    return found.scaled(scales.load, scales.normal)


# -- closed forms -----------------------------------------------------------------------------------------------------
def _jkr(top: float) -> Curve:
    a = np.linspace(0.0, 1.0, FINER * PLACES[1]) * (1.5 * top + 10.0) ** (1 / 3)
    load = 4 / 3 * a**3 - np.sqrt(8 * math.pi * a**3)
    return Curve(np.append(0.0, load), np.append(-_FAR, a * a - np.sqrt(2 * math.pi * a)))


def _dmt(top: float) -> Curve:
    a = np.linspace(0.0, 1.0, FINER * PLACES[1]) * (1.5 * top + 10.0) ** (1 / 3)
    fall = np.linspace(0.0, -2 * math.pi, 100)
    load = np.concatenate([[0.0], fall, 4 / 3 * a[1:] ** 3 - 2 * math.pi])
    return Curve(load, np.concatenate([[-_FAR], 0.0 * fall, a[1:] ** 2]))


_FAR = 1e9
_LIMITING: dict[str, Callable[[float], Curve]] = {"jkr": lru_cache(_jkr), "dmt": lru_cache(_dmt)}


def _bare(contact: Contact, largest: float, work: float = 0.0) -> Curve:
    """A tip that nothing attracts, or with JKR's adhesion, up to a load; `work`: of adhesion over E."""
    needed = max(largest / contact.modulus, 1e-300)
    tip, first = contact.axisymmetric_tip, math.ceil(math.log10(needed))
    body = None if contact.body is None else contact.body.scaled(1.0, contact.modulus)
    for power in range(first, first + (DECADES if work else 1)):  # adhesion takes some of the load
        if body is not None:
            found = _adhering(layer_curve(tip, body, 10.0**power), work)
        elif work:
            most = float(tip.contact_radius(bare_curve(tip, 10.0**power).displacement[-1]))
            found = _adhering(_half_space(tip, most * np.linspace(0.0, 1.0, FINER * PLACES[1])), work)
        else:
            found = bare_curve(tip, 10.0**power)
        if found.load[-1] >= needed:
            return found.scaled(contact.modulus, 1.0)
    raise ModelError("the curve of the contact ends before the largest load, at the edge of the tip")


@lru_cache(maxsize=KEPT)
def bare_curve(tip: Tip, largest: float) -> Curve:
    """Load over the modulus, and displacement, of a tip that nothing attracts, as far as it goes up to such a load.

    d = ζ(a) and F = 2E [a d − ∫ζ], with the tip's Abel transform ζ (I. N. Sneddon 1965).
    """

    def load(a: Array) -> Array:
        return 2.0 * (a * tip.transform(a) - tip.transform_integral(a))

    most = min(1.0, tip.extent)
    while load(np.array([0.5 * most]))[0] > largest:
        most *= 0.5
    while load(np.array([most]))[0] < largest and most < tip.extent:
        most = min(2.0 * most, tip.extent)
    a = most * np.linspace(0.0, 1.0, PLACES[1])
    with np.errstate(all="ignore"):  # at the edge of a sphere they are infinite
        force, displacement = load(a), tip.transform(a)
    known = np.isfinite(force) & np.isfinite(displacement)
    return Curve(np.append(0.0, force[known]), np.append(-_FAR, displacement[known]))


@lru_cache(maxsize=KEPT)
def layer_curve(tip: Tip, body: Body, largest: float) -> Array:
    """Contact radius, load, displacement of a tip on a layer, and what a unit of JKR's neck takes off either, (5, M).

    Relative to the half space they are smooth.
    """
    ends = bare_curve(tip, largest)
    most = float(tip.contact_radius(ends.displacement[-1]))  # a layer bears more load
    places, a = (most * np.linspace(0.0, 1.0, count) for count in (LAYER_PLACES, FINER * PLACES[1]))
    discs = [Disc(tip, body, one) for one in places[1:].tolist()]
    found = np.array([[disc.load, disc.displacement, disc.stiffness, 1.0] for disc in discs]).T
    found[2:] /= [disc.unit_at_rim for disc in discs]
    ratios = np.column_stack([np.ones(5), np.vstack([places[1:], found]) / _half_space(tip, places[1:])])
    return scipy.interpolate.CubicSpline(places, ratios, axis=1)(a) * _half_space(tip, a)


def _half_space(tip: Tip, a: Array) -> Array:
    """The same of a half space in closed form."""
    depth = tip.transform(a)
    return np.array([a, 2.0 * (a * depth - tip.transform_integral(a)), depth, 2.0 * a, np.ones_like(a)])


def _adhering(table: Array, work: float) -> Curve:
    """The curve of a layer with a work of adhesion over E."""
    a, load, displacement, less_load, less = table
    neck = np.sqrt(2.0 * math.pi * a * work)
    return Curve(np.append(0.0, load - neck * less_load), np.append(-_FAR, displacement - neck * less))


def _maugis(tabor: float, top: float) -> Curve:
    """Maugis' solution: the radius of the interaction grows without contact, then the rim's angle falls."""
    zone = Zone(*(np.asarray(x) for x in (1.0, 1.0, 1.0, 1.0 / tabor)))
    bend, end = 4 / math.pi * float(zone.strain), float(zone.touch_radius())
    apart = maugis.without_contact(
        zone, bend * np.sinh(np.linspace(0.0, 1.0, FINER * PLACES[0]) * math.asinh(end / bend))
    )
    unit = float(1.0 / (1.0 + 0.5 / tabor**3))
    # in contact cot² θ = v sinh u up to a² = Y, where the zone is narrow or as wide as without elasticity
    deep = _depth(top)
    most = math.asinh(deep * max(1.0, tabor) / unit * max(1.0, deep))
    tau = 1 / np.sqrt(unit * np.sinh(most * np.linspace(0.0, 1.0, FINER * PLACES[1])[1:] ** 2))
    touching = maugis.in_contact(zone, tau)
    load = np.concatenate([[0.0], apart.load, touching.load])
    displacement = np.concatenate([[-_FAR], apart.displacement, touching.displacement])
    enough = max(int(np.searchsorted(touching.load, top)) + apart.load.size + 3, apart.load.size + 3)
    return Curve(load[:enough], displacement[:enough])


# -- tables -----------------------------------------------------------------------------------------------------------
def _depth(top: float) -> float:
    """Square of a contact radius at which every attraction of the table has at least the load."""
    return float((0.75 * (top + 8.0)) ** (2 / 3) + 4.0)


def _between(law: type[Interaction], sign: float, tabor: float, top: float) -> Curve:
    """The reduced curve of a law, by interpolation over the logarithm of the Tabor coefficient."""
    place = math.log(tabor) / math.log(RATIO)
    known = nodes()
    first = min(max(math.floor(place) - NODES // 2 + 1, known[0]), known[-1] - NODES + 1)
    used = range(first, first + NODES)
    if abs(place - round(place)) < 1e-12:
        rest = _node(law.name, sign, round(place), top)
    else:
        weights = [math.prod((place - other) / (node - other) for other in used if other != node) for node in used]
        rest = np.sum([w * _node(law.name, sign, node, top) for w, node in zip(weights, used, strict=True)], axis=0)
    y = _places(law, tabor, top, FINER)
    hertz = 4 / 3 * np.maximum(y, 0.0) ** 1.5
    return Curve(np.append(0.0, rest[0] + hertz), np.append(-_FAR, rest[1] + y))


def _places(law: type[Interaction], tabor: float, top: float, finer: int = 1) -> Array:
    """Places along the curve: −g0 without contact, a² in contact."""
    far = np.linspace(1.0, 0.0, finer * (PLACES[0] - 1) + 1) ** 2 * math.asinh(_reach(law))
    near = np.linspace(0.0, 1.0, finer * (PLACES[1] - 1) + 1)[1:] ** 2 * math.asinh(tabor * _depth(top))
    return np.concatenate([-np.sinh(far), np.sinh(near)]) / tabor


def _reach(law: type[Interaction]) -> float:
    """Gap in ranges from which the table begins."""
    return 0.9 * float(law(1.0, 1.0).reach(0.5 * ACCURACY / (2 * math.pi)))


@cache
def _node(law: str, sign: float, node: int, top: float) -> Array:
    """A table's curve at `FINER` places for each of its own."""
    made, touch = _made(INTERACTIONS[law], sign, node, top), PLACES[0] - 1
    return np.concatenate([_finer(made[:, : touch + 1]), _finer(made[:, touch:])[:, 1:]], axis=1)


def _finer(rows: Array, at: Array | None = None) -> Array:
    """Rows (2, M) with `FINER` steps in place of each; of those at given places by splines that follow corners."""
    from scipy.interpolate import Akima1DInterpolator, CubicSpline

    count = np.arange(rows.shape[1])
    finer = np.linspace(0, count[-1], FINER * count[-1] + 1)
    if at is None:
        return CubicSpline(count, rows, axis=1)(finer)
    return Akima1DInterpolator(at, rows, axis=1)(np.interp(finer, count, at))


def _made(law: type[Interaction], sign: float, node: int, top: float) -> Array:
    """A curve that is shipped with the package, made by ``studies/reduced_curves.py``, or a new one."""
    if sign > 0 and top == TOP and node in nodes() and law.name in _shipped():
        return np.asarray(_shipped()[law.name][nodes().index(node)], dtype=float)
    return traced_node(law, sign, node, top)


@lru_cache(maxsize=1)
def _shipped() -> dict[str, Array]:
    path = Path(__file__).with_name("reduced.npz")
    if not path.exists():
        return {}
    with np.load(path) as file:
        return {name: file[name] for name in SHIPPED}


def nodes() -> range:
    """Nodes of a table that serves all Tabor coefficients."""
    low, high = (math.log(tabor) / math.log(RATIO) for tabor in TABOR)
    return range(math.floor(low), math.ceil(high) + 1)


def traced_node(law: type[Interaction], sign: float, node: int, top: float) -> Array:
    """Load and displacement less those of the bare parabola at the places of a table's curve, (2, M)."""
    tabor = RATIO**node
    contact = Contact(Parabola(1.0), law(sign, 1.0 / tabor))
    y = _places(law, tabor, top)
    end = 4 / 3 * _depth(top) ** 1.5 * 1.02 + (8.0 if sign < 0 else 0.0)
    rows = _rows(_track(contact, ACCURACY, end), lambda y: _power(y, tabor))
    return _joined(_power(rows[0], tabor), rows, _power(y, tabor))


def _power(y: Array, tabor: float) -> Array:
    """The place τ of a place y, up to a factor; it falls to 0 at first touch and is negative without contact."""
    return np.sign(y) * np.sqrt(np.abs(np.arcsinh(y * tabor)))


def _rows(track: Track, place: Callable[[Array], Array] | None = None) -> Array:
    """Place y, load and displacement at the rows, and at so many points between that places are close, (3, M)."""
    found = []
    for k, point in enumerate(track.points):
        found.append(point.observables)
        if place is not None and k + 1 < len(track.points):
            with suppress(CorrectionError):  # rows that no piece of curve joins are neighbours
                found += _along(track.link(k), place)
    return np.array([[_place(one), one["load"], one["displacement"]] for one in found]).T


def _along(ends: tuple[Point, Point] | None, place: Callable[[Array], Array]) -> Iterator[Mapping[str, float]]:
    """What is seen at so many points between two that places are close; of a curve not followed there nothing."""
    if ends is None:
        return
    low, high = (
        float(place(np.array(_place(one.observables or one.problem.observables(one.x, one.parameter))))) for one in ends
    )
    count = math.ceil(abs(high - low) / APART)
    segment = piece(*ends)
    for share in np.arange(1, count) / count:
        point, _ = point_on(segment, share, OPTIONS)
        yield equilibrium(point).values(point.x, point.parameter)._asdict()


def _place(seen: Mapping[str, float]) -> float:
    return seen["contact_radius"] ** 2 - seen["central_gap"]


def _joined(power: Array, rows: Array, place: Array) -> Array:
    """Load and displacement less those of the bare parabola, interpolated on either side of first touch."""
    from scipy.interpolate import CubicSpline

    rest = np.array([rows[1] - 4 / 3 * np.maximum(rows[0], 0.0) ** 1.5, rows[2] - rows[0]])
    found = np.empty((2, place.size))
    for side, own in ((power <= 0.0, place <= 0.0), (power >= 0.0, place > 0.0)):
        _, distinct = np.unique(power[side], return_index=True)
        found[:, own] = CubicSpline(power[side][distinct], rest[:, side][:, distinct], axis=1)(place[own])
    return found


# -- anything else ----------------------------------------------------------------------------------------------------
def _traced(contact: Contact, largest: float) -> Curve:
    """The curve of a contact, traced; in reduced units, which keeps it when only the units change."""
    scales, reduced = contact.scales, contact.to_reduced()
    top = 10.0 ** math.ceil(math.log10(max(largest / scales.load, 10.0)))
    laws = sum(map(_rounded, terms_of(reduced.interaction))) or None
    body = reduced.body and _rounded(reduced.body)
    return _reduced(Contact(_rounded(reduced.tip), laws, body=body), top).scaled(scales.load, scales.normal)


@lru_cache(maxsize=KEPT)
def _reduced(contact: Contact, top: float) -> Curve:
    track = _track(contact, COARSE, top)

    def power(y: Array) -> Array:
        return CORNERED * _power(y, 1.0 / track.problem(0).scale)

    rows = _rows(track, power)
    steps = np.append(1.0, np.abs(np.diff(power(rows[0]))))
    rows, steps = rows[:, steps > CLOSE], steps[steps > CLOSE]
    load, displacement = _finer(rows[1:], np.cumsum(steps))
    return Curve(np.append(0.0, load), np.append(-_FAR, displacement))


def _rounded(part: Any) -> Any:
    """A tip or law whose numbers are rounded, so that another unit does not change them."""
    values = part.parameters().items()
    return make(type(part), {name: float(f"{v:.11g}") if isinstance(v, float) else v for name, v in values})


def _track(contact: Contact, accuracy: float, top: float) -> Track:
    """The curve of a reduced contact with rows close enough to draw it."""
    if over():
        raise ModelError("the curve of the contact was not traced in time")
    try:
        model, _ = choose(contact, "auto")
        problem = getattr(model, "problem", None)
        if problem is None:
            raise InputError("contact: needs a grid; force curves are fitted by axisymmetric models, on layers by jkr")
        track = trace(problem(contact, accuracy), Request(accuracy, target=top, modes=0))
    except ModelError as error:
        raise ModelError(f"the curve of the contact could not be traced: {error}") from error
    if not track.complete:
        check()
        raise ModelError(f"the curve of the contact ends before the largest load: {track.message}")
    return track


_SHAPES = frozenset((Exponential, Gauss, VanDerWaals, InverseSquare, MaugisDugdale))
