"""Regions that begin and end: the curve behind a failing inequality, and behind a region that has all but vanished."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from contbranch.arrays import Array, magnitude
from contbranch.continuation import CorrectionError, Event, Options, Outcome, Point, StopAt
from contbranch.continuation.edge import Range
from contbranch.continuation.follow import follow
from contbranch.continuation.newton import border, correct, linearise, residual, solve
from contbranch.continuation.walk import unit_tangent
from contbranch.curve.events import Margin
from contbranch.curve.problem import Succession, equilibrium, oriented
from contbranch.errors import ModelError

from .breakpoints import EXTENT, Breakpoint
from .laying import Functions, laid_edges, led_by
from .layout import Layout, Region
from .mesh import mesh_on
from .regions import Breach, layout_of, least_margin, radii_of

if TYPE_CHECKING:
    from .problem import ContactProblem

__all__ = ["begun", "born", "laid", "narrowness", "positions", "vanished"]

Row = tuple[Array, float]

# Newton's method from a guess at other regions: iterations, the relative correction from which it is left to itself,
# the growth of the residual that is accepted, how often a step is halved to avoid more, and the growth of a correction
# beyond which it is astray (those that lead to a state grow by a fifth at most).
APPROACHES, NEARLY, GROWS, HALVINGS, LEAPS = 30, 1e-3, 1.5, 6, 2.5
# No width changes by more than this share of itself in one of its steps.
ROOM = 0.3
PRECISE = Options(tolerance=1e-12, noise=1e8)
# Rounds of meshing and solving for one state.
ROUNDS = 6
# Half-widths with which a region is born, as shares of the room there is for it; the first that succeeds counts, unless
# an inequality fails there by more than this.
SEEDS, FAILS = (0.02, 0.05, 0.01, 0.1, 0.004, 0.2, 1e-3, 2e-4, 4e-5, 0.4), 1e-3
# ... or the displacement has changed by more than this multiple of its scale: that is another state.
ASTRAY = 1.0
# ... or rounding moves the edges by more than this share of the narrowest width: too narrow for so stiff a film.
UNCERTAIN = 3e-3
# Under a sharp tip like r^n the pressure has a cusp in the middle; even a tiny hole takes up to this multiple of the
# radius times the slope at the hole's edge, divided by n − 1, or by this at least.
CUSP, TINY = 2.0, 0.01
# Where the gap is this share of the shortest range there is no room for surfaces that come to rest.
DEEP = 0.1
# Radii of a disc that takes the place of a ring, in units of the ring's; the least radius of a ring over which a law is
# felt.
FILLED, FELT = (1.5, 3.0, 10.0), 3e-3
# Under a cone the pressure at the apex exceeds every bound σ. The hole in what comes to rest tends to exp(1 − 2σ/z′) of
# its radius, as measured to four digits from σ = 2z′ on; shares of that which are tried, and the smallest hole.
HOLES, LEAST_HOLE = (1.0, 0.8, 1.2), 1e-5
# Where it is exceeded almost everywhere, the width of the ring in units of its radius is CLOSING exp(−π z′/(2σ)): the
# slope of what a uniform pressure lifts is as steep as the tip that far inside of its edge.
CLOSING = 4.3
# First steps behind a change as a share of the narrowest region.
FIRST, SHORTEST = 0.3, 1e-3
# A pressure is least in the middle of a disc where it is least within this share of its radius.
CENTRAL = 1e-2
# Where a region vanishes is sought no farther away than this multiple of range and displacement.
FAR = 10.0
# A region vanishes at this share of its width where the piece of the curve begins, or of the outermost edge if that is
# less.
SHRUNK, NARROWEST = 0.5, 1e-3
CONE = "The Morse indices there are those of both sides: admissible variations form a cone."


class Begins(Margin):
    """Where a margin ceases to be negative, however long it has been."""

    happenings = Event.happenings


def problem_of(point: Point) -> ContactProblem:
    """The problem of a point of such a curve."""
    from .problem import ContactProblem

    if not isinstance(point.problem, ContactProblem):
        raise TypeError(f"{type(point.problem).__name__} is not a ContactProblem")
    return point.problem


def seen_layout(point: Point) -> tuple[Layout, Array]:
    """Regions and their radii."""
    equations, fields = problem_of(point).seen(point.x, point.parameter)
    return layout_of(equations), radii_of(equations, fields)


# -- states with other regions ----------------------------------------------------------------------------------------
def laid(
    problem: ContactProblem, before: Functions, layout: Layout, radii: Array
) -> tuple[ContactProblem, Array, float]:
    """The problem with other regions whose edges have given radii, and a guess at its state and parameter.

    Parameters
    ----------
    problem : ContactProblem
        Of the state from which one is guessed.
    before : Functions
        That state.
    """
    old, order = problem.equations, problem.resolution.order
    disc, a = layout.regions[0].rests, float(radii[0]) if layout.regions[0].rests else 0.0
    outside = radii[1:] if disc else radii
    regions = layout.regions[1:] if disc else layout.regions
    ends, edge = before.ends, None
    if problem.motion is not None and problem.motion.ends:
        edge = Breakpoint(math.sqrt((old.tip.extent - a) * (old.tip.extent + a)), 0.0, 1.0, EXTENT)
    ends, roots = (np.sqrt(np.maximum((r - a) * (r + a), 0.0)) for r in (ends[ends >= a], outside))
    if not regions:  # a disc in an outermost band without pressure
        regions, layout = (Region(False, old.law.outermost),), replace(layout, bounded=False)
    if len(roots):
        edges = laid_edges(roots, ends, layout.bounded, edge.place if edge else None)
    else:
        edges = np.unique(np.append(0.0, ends)) if len(ends) > 1 else np.array([0.0, 0.5, 1.0]) * max(a, 1e-300)
    places = tuple(np.flatnonzero(np.isin(edges, roots)).tolist())
    mesh = mesh_on(edges, order, (layout.bounded and bool(len(roots))) or edge is not None, places)
    level = layout.regions[0].index if disc else 0
    equations = replace(old, mesh=mesh, contact=disc, regions=regions, level=level)
    t = np.hypot(mesh.nodes, a)
    state = np.append(before.transformed(t), before.pressure(t[equations.resting]))
    gap = before.central_gap
    y = equations.coordinate.of(a, gap) if disc else equations.wall - gap
    fields = equations.fields(state, y)
    motion = led_by(equations, fields, edge)
    found = replace(problem, equations=equations, motion=motion, vanishing=())
    return found, np.append(state, np.zeros(len(motion.all) if motion else 0)), problem.parameter(y)


def positions(problem: ContactProblem, x: Array) -> tuple[Array, Array]:
    """Places of the root edges from inside outwards, (R,), and their rates with σ and b, (R, 1 + m)."""
    motion = problem.motion_at(x)
    if motion is None or not problem.mesh.roots:
        return np.zeros(0), np.zeros((0, 0))
    stretch = math.exp(float(x[problem.size]))
    own = sorted((one.place, k) for k, one in enumerate(motion.all) if one.root)
    places, moves = stretch * np.array([place for place, _ in own]), np.zeros((len(own), len(motion.all)))
    moves[:, 0] = places
    for j, (_, k) in enumerate(own):
        moves[j, k] = stretch if k else places[j]
    return places, moves


def solved(problem: ContactProblem, x: Array, p: float, row: Row) -> tuple[Array, float]:
    """The solution near (x, p) in the plane that `row` is normal to.

    Newton's method, with steps shortened so that no width changes by more than a share of itself and the residual does
    not grow much: a guess at other regions may be far from the solution.

    Raises
    ------
    CorrectionError
        If Newton's method fails.
    """
    metric, n, size = problem.metric(x), problem.size, math.inf
    for _ in range(APPROACHES):
        at = linearise(problem, x, p)
        dx, dp = border(problem, x, p, at, row).solve(-at[0], 0.0)
        last, size = size, metric.norm(problem, dx, dp)
        if not (math.isfinite(size) and size < LEAPS * last):
            break
        if size < NEARLY:
            done = correct(problem, (x, p), row, metric, PRECISE)
            return done.x, done.parameter
        places, moves = positions(problem, x)
        change = moves @ dx[n:] if len(places) else np.zeros(0)
        room = np.diff(places, prepend=0.0)
        share = min(1.0, ROOM / max(magnitude(np.diff(change, prepend=0.0) / room), 1e-300))
        before = magnitude(at[0])
        for _ in range(HALVINGS):
            trial = x + share * dx, p + share * dp
            try:
                after = magnitude(residual(problem, *trial))
            except CorrectionError:
                after = math.inf
            if after < GROWS * before:
                break
            share /= 2
        x, p = trial
    raise CorrectionError(Outcome.START_FAILED, f"(Newton's last correction was {size:.2g} of the state.)")


def resolved(point: Point, row: Callable[[ContactProblem, Array], Row] | None = None) -> Point:
    """The point on a mesh that resolves it; `row`: what is held of it, by default the solution is sought across.

    Raises
    ------
    CorrectionError
        If Newton's method fails.
    """
    for _ in range(ROUNDS):
        problem, p = problem_of(point), point.parameter
        if problem.relative_error(point.x, p) <= problem.resolution.tolerance:
            break
        other, x = problem.remeshed(point.x, p, solve=False)
        if other.mesh is problem.mesh:
            break
        tangent = problem.carried(point.tangent_x, point.x, p, other)
        held = row(other, x) if row else other.metric(x).row(other, tangent, point.tangent_parameter)
        point = oriented(other, *solved(other, x, p, held), (tangent, point.tangent_parameter))
    return point


# -- births -----------------------------------------------------------------------------------------------------------
def born(points: Sequence[Point]) -> Succession:
    """The curve behind the last of points, where an inequality fails: a region begins.

    Raises
    ------
    ModelError
        If no state with it was found.
    """
    point, dropped = failed(points)
    breach = failing(point)
    kind, message = change(point, breach, growing=True)
    start = begun(seeded(point, breach))
    step = FIRST * narrowest(start)
    if not kind:  # the range of the interaction begins, and all is nothing
        return Succession("", point, (start,), step=step)
    return Succession(kind, point, (start,), same=False, dropped=dropped, step=step, message=message, margin="breach")


def failed(points: Sequence[Point]) -> tuple[Point, int]:
    """Where the inequalities fail exactly, and how many of the points lie beyond: discs are followed with tolerance."""
    if not problem_of(points[-1]).tolerant:
        return points[-1], 1
    right = next((k for k in reversed(range(len(points))) if margin_of(points[k]) > 0.0), None)
    if right is None:
        raise ModelError("no admissible state was left")
    event = along(points[right], narrowest(points[right]), [Margin("breach")])
    if event.label != "breach":
        raise ModelError("where the contact set changes its inequality could not be told")
    return event, len(points) - 1 - right


def begun(point: Point) -> Point:
    """The point as the start of a piece of curve, with the widths at which its regions vanish."""
    problem = problem_of(point)
    widths = vanishing_widths(*seen_layout(point), problem.narrow_ring)
    return replace(point, problem=replace(problem, vanishing=widths))


def vanishing_widths(layout: Layout, radii: Array, narrow_ring: float) -> tuple[float, ...]:
    """Widths in shares of the outermost edge at which regions vanish on a piece of the curve; 0: never."""
    if len(radii) == 0 or (len(radii) == 1 and layout.regions[0].rests):
        return ()
    found = []
    for k, share in enumerate(np.diff(radii, prepend=0.0) / radii[-1]):
        joins, collapses = layout.without(k) is not None, layout.collapsed(k) is not None
        least = NARROWEST if joins else narrow_ring if collapses else 0.0
        found.append(float(min(least, SHRUNK * share)))
    return tuple(found)


def narrowness(vanishing: Sequence[float], radii: Array) -> float:
    """The smallest width over that at which its region vanishes, less 1; at most 1."""
    least, shares = np.array(vanishing), np.diff(radii, prepend=0.0) / radii[-1:]
    counts = least > 0.0
    return min(1.0, float((shares[counts] / least[counts]).min()) - 1.0) if counts.any() else 1.0


def seeds(point: Point, breach: Breach) -> Iterator[tuple[Layout, Array, tuple[int, ...]]]:
    """Layouts in which the new region has begun, from the likeliest size on, their radii, and the number of the radius
    that is held, or those of two whose distance is."""
    problem = problem_of(point)
    equations, fields = problem.seen(point.x, point.parameter)
    tip, law, (layout, radii) = equations.tip, equations.law, seen_layout(point)
    k, centre, new = breach.region, breach.radius == 0.0, breach.new
    before, after = radii[k - 1] if k else 0.0, radii[k] if k < len(radii) else math.inf
    outermost = radii[-1] if len(radii) else 0.0
    room = min(after - breach.radius, max(outermost, math.sqrt(problem.scale)))
    room = room if centre else min(room, breach.radius - before)
    if new.rests:  # no wider than the dip in which surfaces meet
        r = np.hypot(equations.mesh.nodes, fields.rim.radius)
        own = (r > before) & (r < after)
        apart = own & (np.abs(fields.gap - law.levels[new.index]) > DEEP * problem.scale)
        room = min(room, float(np.abs(r[apart] - breach.radius).min(initial=room)))
    sizes = [(centre, share * room) for share in SEEDS]
    if k == 0 and not centre and new.rests:  # the disc that fills a ring soon
        filled = [(True, share * breach.radius) for share in FILLED]
        sizes = [*filled, *sizes] if breach.radius < FELT * math.sqrt(problem.scale) else [*sizes, *filled]
    sharp, around = new.rests and new.index > 0 and tip.apex_exponent < 2.0, layout.regions
    for inside, half in sizes:
        if not inside:
            ring = np.insert(radii, k, breach.radius + half * np.array([-1.0, 1.0]))
            yield layout.born(k, new, False), ring, (k + 1, k)
            continue
        if not half < min(after, tip.extent):
            continue
        if not sharp or tip.apex_exponent > 1.0:
            yield layout.born(k, new, True), np.append(half, radii), (0,)
        if sharp:  # under a cone the pressure in the middle exceeds every bound
            hole, jump = Region(False, new.index - 1), law.pressure(new.index - 1, new.index) - law.bounds(new.index)[0]
            steep = float(tip.height_derivative(np.float64(half)))
            width = CLOSING * math.exp(-math.pi * steep / (2 * jump))
            if width < problem.narrow_ring:
                yield replace(layout, regions=(hole, *around)), np.append(half, radii), (0,)
                continue
            small = math.exp(1.0 - 2.0 * jump / steep)
            for share in [*([1.0 - width] if width < 1.0 else []), *(small * factor for factor in HOLES)]:
                if LEAST_HOLE < share < 1.0:
                    yield replace(layout, regions=(hole, new, *around)), np.append([share * half, half], radii), (1,)


def holding(edges: tuple[int, ...]) -> Callable[[ContactProblem, Array], Row]:
    """What holds an edge, or the distance of two."""

    def row(problem: ContactProblem, x: Array) -> Row:
        held, n, disc = np.zeros(x.size), problem.size, int(problem.equations.contact)
        if len(edges) == 1 and edges[0] < disc:
            return held, 1.0
        _, moves = positions(problem, x)
        for edge, sign in zip(edges, (1.0, -1.0), strict=False):
            if edge >= disc:
                held[n:] += sign * moves[edge - disc]
        return held, 0.0

    return row


def seeded(point: Point, breach: Breach) -> Point:
    """The state in which a narrow new region has begun, oriented towards its growth.

    Raises
    ------
    ModelError
        If none was found.
    """
    problem = problem_of(point)
    before, tip, least = Functions(*problem.seen(point.x, point.parameter)), problem.equations.tip, 0.0
    doubtful: list[tuple[float, Point]] = []
    cusp = CUSP / max(tip.apex_exponent - 1.0, TINY)
    for layout, radii, edges in seeds(point, breach):
        half = float(radii[edges[0]] if len(edges) == 1 else (radii[edges[0]] - radii[edges[1]]) / 2)
        if half <= least:
            continue
        hold = holding(edges)
        try:
            trial, x, p = laid(problem, before, layout, radii)
            row = hold(trial, x)
            found = resolved(oriented(trial, *solved(trial, x, p, row), row), hold)
        except (CorrectionError, ModelError, ValueError):
            continue
        row = hold(problem_of(found), found.x)
        beyond = abs(found.observables["displacement"] - point.observables["displacement"]) - ASTRAY * problem.scale
        if beyond > cusp * float(radii[-1] * tip.height_derivative(np.float64(half))):
            continue
        if row[0] @ found.tangent_x + row[1] * found.tangent_parameter < 0.0:
            found = found.turned()
        uncertain = uncertainty(found) - UNCERTAIN
        least = half if uncertain > 0.0 else least
        if margin_of(found) > 0 >= max(beyond, uncertain):
            return found
        if margin_of(found) >= -FAILS:
            doubtful.append((max(beyond, uncertain, 0.0), found))
    if not doubtful:
        sharp = tip.apex_exponent <= 1.0 and breach.radius == 0.0 and breach.new.rests and breach.new.index > 0
        raise ModelError(
            "the tip is too sharp for so stiff a film: describe its apex as rounded"
            if sharp
            else "no state was found beyond the change of the contact set"
        )
    return min(doubtful, key=lambda one: one[0])[1]


# -- ends -------------------------------------------------------------------------------------------------------------
def vanished(points: Sequence[Point]) -> Succession:
    """The curve behind the last of points, where the narrowest region has all but vanished.

    The event lies where the layout without it begins to be right.

    Raises
    ------
    ModelError
        If the neighbours cannot be joined, or the event was not found.
    """
    point = points[-1]
    joined, jump = passed(point)
    if jump:  # no change of the contact set, only of how it is represented
        return Succession("", point, (begun(joined),))
    width = narrowest(point)
    if not becomes_right(joined, FIRST * width):  # at a fold, where what was held turns at once
        joined = joined.turned()
    right = (margin := margin_of(joined)) > 0  # for a while already: look back
    if 0 < margin < FAILS:  # only just: look back from farther on
        joined = along(joined, width, [], lambda found: margin_of(found) > 2 * margin)
    event = along(joined.turned() if right else joined, width, [Begins("breach")])
    if event.label != "breach":
        raise ModelError("a region vanished, but not where its inequality says")
    event = event.turned() if right else event
    kind, message = change(event, failing(event), growing=False)
    if problem_of(event).tolerant:
        return Succession(kind, event, (event,), message=message, margin="breach")
    start = joined if right else along(event, width, [], lambda found: margin_of(found) > 0)
    step = max(width, SHORTEST)
    return Succession(kind, event, (begun(start),), same=False, step=step, message=message, margin="breach")


def passed(point: Point) -> tuple[Point, bool]:
    """The state without the region that has all but vanished, and whether a jump takes its place.

    Raises
    ------
    ModelError
        If the neighbours cannot be joined, or Newton's method fails.
    """
    problem = problem_of(point)
    layout, radii = seen_layout(point)
    limits, widths = problem.vanishing, np.diff(radii, prepend=0.0)
    region = min((k for k, limit in enumerate(limits) if limit > 0), key=lambda k: widths[k] / limits[k])
    joined = layout.without(region)
    other = joined or layout.collapsed(region)
    if other is None:
        raise ModelError("the neighbours of a region that vanished cannot be joined")
    gone = [region] if region == 0 or joined is None else [region - 1, region]
    kept = np.delete(radii, gone)
    if joined is None:
        kept[region - 1] = (radii[region - 1] + radii[region]) / 2
    trial, x, p = laid(problem, Functions(*problem.seen(point.x, point.parameter)), other, kept)
    # Of the direction only what is seen is told: that of displacement and load.
    along_d = point.tangent_x, point.tangent_parameter
    rates = problem.rates(point.x, point.parameter, *along_d)
    try:
        row = trial.displaced(x, p)
        x, p = solved(trial, x, p, row)
        found = resolved(oriented(trial, x, p, row))
    except (CorrectionError, ValueError) as error:
        raise ModelError("no state was found without the region that vanished") from error
    own = problem_of(found).rates(found.x, found.parameter, found.tangent_x, found.tangent_parameter)
    backwards = own.displacement * rates.displacement + own.load * rates.load < 0.0
    return found.turned() if backwards else found, joined is None


def along(start: Point, width: float, events: Sequence[Event], arrived: Callable[[Point], bool] | None = None) -> Point:
    """The last point of the curve from a start on, in steps of a width at first, as far as events or `arrived` say."""
    problem = equilibrium(start)
    balance, p = problem.balance(start, FIRST * width), start.parameter
    if not problem_of(start).mesh.roots and start.observables["contact_radius"] > width:  # whose own steps are its size
        share = FIRST * width / start.observables["contact_radius"]
        balance = replace(balance, state=share * balance.state, parameter=share * balance.parameter)
    far, options = FAR * (1.0 + abs(p)), problem.steps(start)
    start = unit_tangent(start, balance.metric(options.weight, options.state_floor))
    branch = follow(start, balance, Range(p - far, p + far), options, events, StopAt(predicate=arrived))
    if not branch.points:
        raise ModelError(f"where a region vanished the curve could not be followed: {branch.end.message}")
    return branch.points[-1]


# -- what is seen of a point ------------------------------------------------------------------------------------------
def margin_of(point: Point) -> float:
    """How far the inequalities of contact are from failing."""
    return equilibrium(point).margin(point.x, point.parameter, "breach")


def becomes_right(point: Point, step: float) -> bool:
    """Whether the inequalities of contact come to hold along the curve, or hold by more, within a step."""
    x, p = point.x + step * point.tangent_x, point.parameter + step * point.tangent_parameter
    return equilibrium(point).margin(x, p, "breach") >= margin_of(point)


def failing(point: Point) -> Breach:
    """The inequality that fails at a point."""
    problem = problem_of(point)
    equations, fields = problem.seen(point.x, point.parameter)
    breach = least_margin(equations, fields, problem.scale, problem.narrow_ring)
    if breach is None:
        raise ModelError("where the contact set changes its inequality could not be told")
    if breach.region == 0 and equations.contact and breach.radius < CENTRAL * fields.rim.radius:
        return replace(breach, radius=0.0)
    return breach


def narrowest(point: Point) -> float:
    """The smallest width of a region that ends somewhere."""
    return float(np.diff(seen_layout(point)[1], prepend=0.0).min(initial=math.inf))


def uncertainty(point: Point) -> float:
    """How far rounding moves the edges, as a share of the narrowest width: one more correction by Newton's method."""
    problem, at = problem_of(point), linearise(equilibrium(point), point.x, point.parameter)
    row = problem.metric(point.x).row(problem, point.tangent_x, point.tangent_parameter)
    dx, _ = solve(border(problem, point.x, point.parameter, at, row), -at[0], 0.0, point.parameter)
    places, moves = positions(problem, point.x)
    return magnitude(moves @ dx[problem.size :]) / narrowest(point) if len(places) else 0.0


def change(point: Point, breach: Breach, growing: bool) -> tuple[str, str]:
    """The kind of an event at which a region begins (or, not growing, ends), and a sentence."""
    layout, _ = seen_layout(point)
    new, around, law = breach.new, layout.regions[breach.region], problem_of(point).equations.law
    if not around.rests and (not new.rests or law.vanishes(around.index)):  # the interaction's range begins
        return "", ""
    centre = breach.radius == 0.0
    place = "at the centre" if centre else f"on a ring of radius {breach.radius:.6g} (reduced)"
    level = (new if new.rests else around).index
    gap = law.levels[level]
    where = "the wall" if level == 0 else f"a gap of {gap:.6g} (reduced)"
    if new.rests:
        verb, shape = "comes to rest at" if growing else "leaves", ""
        alone = not any(region.rests and region.index == 0 for region in layout.regions)
        kind = "touch" if level == 0 and centre and alone else "topology"
    else:
        verb, kind = "lifts from" if growing else "comes to rest at", "topology"
        opens = ("a disc opens into a ring", "an annulus opens")
        closes = ("a ring closes to a disc", "an annulus closes")
        shape = f": {(opens if growing else closes)[0 if centre else 1]}"
    sentence = f"The surface {verb} {where} {place}{shape}."
    return kind, sentence if kind == "touch" else f"{sentence} {CONE}"
