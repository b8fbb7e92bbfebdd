"""Passing from one layout to the next where an inequality fails: regions that are born, and regions that vanish."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from contbranch.arrays import Array, magnitude
from contbranch.continuation import CorrectionError, Event, Point, StopAt
from contbranch.continuation.edge import Range
from contbranch.continuation.follow import follow
from contbranch.continuation.newton import border, evaluating, linearise, solve
from contbranch.curve.events import Margin
from contbranch.curve.problem import Rates, Succession, alike, equilibrium, oriented, rates_of, values_of
from contbranch.errors import ModelError

from .constraints import ROUNDING, Breach, begun, least_margin
from .disc import ALONE, disc_of
from .equations import Fields, RingEquations, rings
from .layout import Layout
from .meshing import pieces
from .newton import resolved, solved
from .panels import Grid
from .topology import change

__all__ = ["born", "handed", "left", "vanished"]

# Half-widths with which a region is born, as shares of the room there is for it; the first that succeeds counts, unless
# an inequality fails there by more than this.
SEEDS, FAILS = (0.02, 0.05, 0.01, 0.1, 0.004, 0.2, 1e-3, 2e-4, 4e-5, 0.4), 1e-3
# ... or the displacement has changed by more than this multiple of its scale: that is another state.
ASTRAY = 1.0
# ... or rounding moves the edges by more than this share of the narrowest width: too narrow for so stiff a film.
UNTOLD = 3e-3
# Under a sharp tip like r^n the pressure has a cusp in the middle; even a tiny hole takes up to this multiple of the
# radius times the slope at the hole's edge, divided by n − 1, or by this at least.
CUSP, TINY = 2.0, 0.01
# Where the gap is this share of the shortest range there is no room for surfaces that come to rest.
DEEP = 0.1
# Radii of a disc that takes the place of a ring, in units of the ring's; the least radius of a ring over which a law is
# felt. In a hole no deeper than this share of the range nothing is told.
FILLED, TOLD, SHALLOW = (1.5, 3.0, 10.0), 3e-3, 1e-6
# First steps behind a change as a share of the narrowest region, or behind a jump of the outermost edge; no shorter.
FIRST, AFTER_JUMP, SHORTEST = 0.3, 1e-2, 1e-3
# A pressure is least in the middle of a disc where it is least within this share of its radius.
CENTRAL = 1e-2
# What vanishes there for the model of a disc.
MIDDLE = "middle"
# Where a region vanishes is sought no farther away than this multiple of range and displacement.
FAR = 10.0


class Begins(Margin):
    """Where a margin ceases to be negative, however long it has been."""

    happenings = Event.happenings


def born(point: Point) -> Succession:
    """The curve behind a point at which an inequality fails: a region is born.

    Raises
    ------
    ModelError
        If no state with it was found.
    """
    breach = failing(point)
    problem = rings(point)
    if breach.region == 0 and breach.radius == 0.0 and breach.new in problem.layout.regions[1:2]:
        fields = problem.fields(point.x, point.parameter)
        hole = fields.gap[fields.grid.of_node == 0] - problem.law.levels[breach.new.index]
        told = max(SHALLOW * problem.scale, ROUNDING * magnitude(fields.lift))
        if magnitude(hole) < told:  # it closes before a disc in it can be told
            return vanished([point], 0)
    kind, message = change(problem, breach, growing=True)
    start = begun(seeded(point, breach))
    return changed(kind, point, start, FIRST * narrowest(start), message)


def changed(kind: str, event: Point, start: Point, step: float, message: str, margin: str = "") -> Succession:
    """The curve behind an event; one disc of contact, or none, is left to the model of that where it is safe."""
    problem = rings(start)
    if problem.layout.single and problem.setting.regained is not None:
        if margin_of(start) <= ALONE:
            start = replace(start, problem=replace(problem, leaves=True))
        elif regained := handed(start):
            return Succession(kind, event, (regained,), same=False, message=message, margin=margin)
    return Succession(kind, event, (start,), same=False, step=step, message=message, margin=margin)


def left(point: Point) -> Succession:
    """The curve behind a point from which on one disc of contact, or none, is all there is."""
    return Succession("", point, (handed(point) or replace(point, problem=replace(rings(point), leaves=False)),))


def closed(point: Point) -> Point | None:
    """An event at which a ring closes to a disc, by the model of the disc."""
    resting, single = rings(point).layout.regions[0].rests, rings(point).layout.single
    return handed(point) if resting and single and failing(point).radius == 0.0 else None


def handed(point: Point) -> Point | None:
    """The state of one disc of contact, or none, as the model of that has it, where it finds it."""
    disc, regained = disc_of(point), rings(point).setting.regained
    if disc is None or regained is None:
        return None
    try:
        with evaluating(point.parameter):
            return regained(disc)
    except CorrectionError:
        return None


def vanished(points: Sequence[Point], region: int | None = None) -> Succession:
    """The curve behind the last of points, where a region, by default the one that is narrowest, has all but vanished.

    The event lies where the layout without it begins to be right.

    Raises
    ------
    ModelError
        If the neighbours cannot be joined, or the event was not found.
    """
    point = points[-1]
    joined, jump = passed(point, region)
    if jump:  # no change of the contact set, only of how it is represented
        return Succession("", point, (begun(joined),), step=AFTER_JUMP * float(joined.x[-1]))
    width = narrowest(point)
    if not becomes_right(joined, FIRST * width):  # at a fold, where what was held turns at once
        joined = joined.turned()
    right = margin_of(joined) > 0  # for a while already: look back
    event = along(joined.turned() if right else joined, width, [Begins("breach")])
    if event.label != "breach":
        raise ModelError("a region vanished, but not where its inequality says")
    event = event.turned() if right else event
    kind, message = change(rings(event), failing(event), growing=False)
    if filled := closed(event):
        return Succession(kind, filled, (filled,), dropped=beyond(points, filled), message=message, margin=MIDDLE)
    if right:
        start = joined
    else:
        start = along(event, width, [], lambda found: margin_of(found) > 0)
    return changed(kind, event, begun(start), max(width, SHORTEST), message, "breach")


def beyond(points: Sequence[Point], event: Point) -> int:
    """How many of the last rows do not lie before an event, as another model tells it; at least one."""
    values, rates, count = values_of(event), rates_of(event), 1
    for row in reversed(points[1:-1]):
        ahead = (row.observables[name] - getattr(values, name) for name in Rates._fields)
        if not alike(values, Rates(*ahead), rates):
            break
        count += 1
    return count


def along(start: Point, width: float, events: Sequence[Event], arrived: Callable[[Point], bool] | None = None) -> Point:
    """The last point of the curve from a start on, in steps of a width at first, as far as events or `arrived` say."""
    problem = equilibrium(start)
    balance, p = problem.balance(start, FIRST * width), start.parameter
    far = FAR * (problem.scale + abs(p))
    start = problem.leaving(start, FIRST * width)
    branch = follow(start, balance, Range(p - far, p + far), problem.steps(start), events, StopAt(predicate=arrived))
    if not branch.points:
        raise ModelError(f"where a region vanished the curve could not be followed: {branch.end.message}")
    return branch.points[-1]


def margin_of(point: Point) -> float:
    """How far the inequalities of contact are from failing."""
    return equilibrium(point).margins(point.x, point.parameter)["breach"]


def becomes_right(point: Point, step: float) -> bool:
    """Whether the inequalities of contact come to hold along the curve, or hold by more, within a step."""
    problem = equilibrium(point)
    behind, ahead = (
        problem.margins(point.x + s * point.tangent_x, point.parameter + s * point.tangent_parameter)["breach"]
        for s in (-step, step)
    )
    return ahead >= behind


def failing(point: Point) -> Breach:
    """The inequality that fails at a point."""
    problem = rings(point)
    breach = least_margin(problem, problem.fields(point.x, point.parameter))
    if breach is None:
        raise ModelError("where the contact set changes its inequality could not be told")
    middle = breach.region == 0 and problem.layout.regions[0].rests
    if middle and breach.radius < CENTRAL * problem.widths(point.x[point.x.size - problem.edges :])[0]:
        return replace(breach, radius=0.0)
    return breach


def narrowest(point: Point) -> float:
    """The smallest width of a region that ends somewhere."""
    problem = rings(point)
    return float(problem.widths(point.x[point.x.size - problem.edges :][: problem.layout.edges]).min())


def uncertain(point: Point) -> float:
    """How far rounding moves the edges, as a share of the narrowest width: one more correction by Newton's method."""
    problem, at = rings(point), linearise(rings(point), point.x, point.parameter)
    row = problem.metric(point.x).row(problem, point.tangent_x, point.tangent_parameter)
    dx, _ = solve(border(problem, point.x, point.parameter, at, row), -at[0], 0.0, point.parameter)
    return magnitude(dx[dx.size - problem.edges :]) / narrowest(point)


def carried(problem: RingEquations, fields: Fields, layout: Layout, edges: Array) -> tuple[RingEquations, Array]:
    """Another layout with its edges, and the state on it with the present pressures."""
    trial = problem.laid_out(layout, pieces(edges, problem.panels, fields.grid, layout.bounded))
    nodes = Grid(trial.panels, edges, layout.bounded).r
    return trial, np.concatenate([fields.grid.interpolate(fields.pressure, nodes), edges])


def seeded(point: Point, breach: Breach) -> Point:
    """The state in which a narrow new region has been born, oriented towards its growth.

    Raises
    ------
    ModelError
        If none was found.
    """
    problem = rings(point)
    fields = problem.fields(point.x, point.parameter)
    grid = fields.grid
    edges = grid.edges
    centre = breach.radius == 0.0
    before = edges[breach.region - 1] if breach.region else 0.0
    after = edges[breach.region] if breach.region < len(edges) else math.inf
    room = min(
        *([] if centre else [breach.radius - before]),
        after - breach.radius,
        max(edges[-1] if len(edges) else 0.0, math.sqrt(problem.scale)),
    )
    if breach.new.rests:  # no wider than the dip in which surfaces meet
        apart = abs(fields.gap - problem.law.levels[breach.new.index]) > DEEP * problem.scale
        room = min(room, float(abs(grid.r[apart & (grid.of_node == breach.region)] - breach.radius).min(initial=room)))
    seeds = [(centre, share * room) for share in SEEDS]
    if breach.region == 0 and not centre:  # the disc that fills a ring soon, at once where that is too small to be told
        place = 0 if breach.radius < TOLD * math.sqrt(problem.scale) else len(seeds)
        seeds[place:place] = [(True, share * breach.radius) for share in FILLED]
    tip, doubtful, least = problem.tip, list[tuple[float, Point]](), 0.0
    cusp = CUSP / max(tip.apex_exponent - 1.0, TINY)
    for inside, half in seeds:
        if least and (half <= least or inside != centre):
            continue
        if inside:
            new, held = np.concatenate([[half], edges]), np.eye(len(edges) + 1)[0]
        else:
            new = np.insert(edges, breach.region, breach.radius + half * np.array([-1.0, 1.0]))
            held = np.zeros(len(new))
            held[breach.region : breach.region + 2] = -1.0, 1.0
        trial, x = carried(problem, fields, problem.layout.born(breach.region, breach.new, inside), new)
        row = np.concatenate([np.zeros(x.size - len(new)), held]), 0.0
        try:
            found = resolved(oriented(trial, *solved(trial, x, point.parameter, row), row), (held, 0.0))
        except CorrectionError:
            continue
        beyond = abs(found.parameter - point.parameter) - ASTRAY * trial.metric(found.x).parameter_scale
        if beyond > cusp * float(new[-1] * tip.height_derivative(np.float64(half))):
            continue
        if found.tangent_x[found.x.size - rings(found).edges :][: len(held)] @ held < 0.0:  # told where it is resolved
            found = found.turned()
        untold = uncertain(found) - UNTOLD
        least = half if untold > 0.0 else least
        if margin_of(found) > 0 >= max(beyond, untold):
            return found
        if margin_of(found) >= -FAILS:
            doubtful.append((max(beyond, untold, 0.0), found))
    if not doubtful:
        raise ModelError("no state was found beyond the change of the contact set")
    return min(doubtful, key=lambda one: one[0])[1]


def passed(point: Point, region: int | None) -> tuple[Point, bool]:
    """The state without a region, by default the one that has all but vanished, and whether a jump takes its place.

    Raises
    ------
    ModelError
        If the neighbours cannot be joined, or Newton's method fails.
    """
    problem = rings(point)
    fields = problem.fields(point.x, point.parameter)
    edges, limits = fields.grid.edges, problem.vanishing
    widths = problem.widths(edges)
    if region is None:
        region = min((k for k, limit in enumerate(limits) if limit > 0), key=lambda k: widths[k] / limits[k])
    joined = problem.layout.without(region)
    layout = joined or problem.layout.collapsed(region)
    if layout is None:
        raise ModelError("the neighbours of a region that vanished cannot be joined")
    if region == len(edges):
        edges = problem.ends(edges)
    last = layout.whole and region == len(edges) - 1
    gone = [region - 1] if last else [region] if region == 0 or joined is None else [region - 1, region]
    kept = np.delete(edges, gone)
    if joined is None:
        kept[region - 1] = (edges[region - 1] + edges[region]) / 2
    trial, x = carried(problem, fields, layout, kept)
    # Close to the vanishing region rates of pressure are large and mean nothing for the joined state.
    rates = np.delete(np.append(point.tangent_x[fields.grid.size :], 0.0)[: len(edges)], gone)
    tangent = np.concatenate([np.zeros(x.size - len(kept)), rates]), point.tangent_parameter
    if not np.abs(rates).max(initial=0.0) + abs(point.tangent_parameter) > 0:
        raise ModelError("the direction of the curve was lost where a region vanished")
    try:
        x, d = solved(trial, x, point.parameter, trial.metric(x).row(trial, *tangent))
        return resolved(oriented(trial, x, d, tangent)), joined is None
    except CorrectionError as error:
        raise ModelError(f"no state was found without the region that vanished {error.detail}") from error
