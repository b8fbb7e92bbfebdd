"""Panels that resolve a solution, and finer ones that measure what they leave out."""

from __future__ import annotations

import math
from dataclasses import replace
from itertools import pairwise

import numpy as np

from contbranch.arrays import Array, magnitude
from contbranch.models.fronts import CORE, SMOOTH

from .equations import Fields, RingEquations
from .layout import Layout, Region
from .panels import Grid, Panels

__all__ = ["adapted", "finer", "order_for", "panel_errors", "pieces", "surrounded"]

# Breaks of a piece between an edge and the far end of its region, in shares of its length in √distance.
BOUNDED = (0.3,)
# The panel next to an edge is split at this share: the solution has higher-order logarithms there.
GRADING = 0.3
# ... but not below this share of the piece: a pressure that answers a given gap is determined the worse the narrower
# the panels.
FINEST = 0.05
# ... nor below this one next to a front.
AT_FRONT = 0.01
# Cuts leave at least a fifth of a panel.
WIDEST = 0.8
# Neighbouring panels differ by no more than this factor in their outer ends.
GROWTH = 3.0
# Tail of a pressure at rest as a share of the largest in its region, beyond which a panel is split whatever it bears; a
# region bears little below this share of the largest pressure.
RESOLVED, LITTLE = 3e-3, 1e-3
# ... unless that is rounding: of the gap, as a share of the lift, felt the more the shorter the panel.
ROUNDING = 3e-14
# The panel at the centre is cut so far from it: an apex is felt there, by the pressure to this share of itself.
APEX_GRADING, PEAK = 0.25, 1e-5
# ... but not below this share of the disc, where rounding tells no peak.
TINIEST = 1e-3
# Breaks taken over from other panels are farther from an anchor than this share of the way to their own neighbours.
APART = 0.3
# ... and stretched by no more than this factor.
STRETCHED = 1.5
# Higher order by this share makes the finer panels.
FINER_SHARE = 3


def order_for(tolerance: float) -> int:
    """Nodes a panel for a tolerance."""
    return int(min(16, max(8, round(6 - 0.7 * math.log10(tolerance)))))


def surrounded(
    regions: tuple[Region, ...], extent: float, edges: Array, radii: Array, order: int
) -> tuple[Layout, Panels, Array]:
    """Regions of which the last reaches to infinity, or to the edge of a tip, panels that end at radii, and the edges.

    Beyond the edge of a tip there is no gap: panels that move with other edges must not come to lie there.
    """
    ends = math.isfinite(extent)
    layout, edges = Layout(regions, ends, ends), np.append(edges, extent) if ends else edges
    free = Panels(order, (), tuple(np.append(radii[radii < extent], edges[-1:] if ends else []).tolist()), not ends)
    return layout, pieces(edges, free, Grid(free, np.zeros(0), False), ends), edges


def _ends(anchors: Array) -> list[tuple[float, float]]:
    """Anchor and far end of every piece."""
    middles = [0.0, *((anchors[1:] + anchors[:-1]) / 2).tolist()]
    pairs = zip(anchors.tolist(), pairwise([*middles, math.inf]), strict=False)
    return [(edge, far) for edge, pair in pairs for far in pair][:-1]


def pieces(anchors: Array, panels: Panels, grid: Grid, bounded: bool, front: float = 0.0) -> Panels:
    """Panels for other edges, and for a front: next to new ones they have their breaks where there were some before.

    Piece 2j lies inside of anchor j and piece 2j + 1 outside of it; what lies outside of the last one is no piece.
    Those next to anchors that were there before are kept, stretched to their new length unless that is much longer.
    """
    radii = np.append(grid.inner, grid.outer[-1:])  # the other ends are the same, but for rounding
    radii = radii[np.isfinite(radii)]
    room = APART * np.minimum(np.diff(radii, prepend=-math.inf), np.diff(radii, append=math.inf))

    def shares(anchor: float, far: float) -> tuple[float, ...]:
        """Breaks between an anchor and a far end, in shares of the root of the distance."""
        inside = radii[(min(anchor, far) + room < radii) & (radii < max(anchor, far) - room)]
        return tuple(np.sort(np.sqrt(abs(inside - anchor) / (abs(far - anchor) if far < math.inf else 1.0))).tolist())

    old = {
        (anchor, far > anchor): (abs(far - anchor), piece)
        for (anchor, far), piece in zip(_ends(grid.anchors), panels.halves, strict=False)
    }

    def piece(anchor: float, far: float) -> tuple[float, ...]:
        length, kept = old.get((anchor, far > anchor), (0.0, ()))
        if abs(far - anchor) < STRETCHED * length:
            return kept
        found = shares(anchor, far)
        return found if found and found[0] <= BOUNDED[0] else BOUNDED + found

    outer, last = () if bounded else panels.outer, float(anchors[-1]) if len(anchors) else 0.0
    if not bounded and not (len(anchors) and len(grid.anchors) and last == grid.anchors[-1]):
        outer = shares(last, math.inf) if len(anchors) else tuple(radii[radii > 0].tolist())
    halves = tuple(piece(*ends) for ends in _ends(anchors))
    return replace(panels, halves=halves, outer=outer, front=front)


def finer(panels: Panels) -> Panels:
    """Panels on which the present ones' errors have all but vanished."""
    halves = tuple(
        (*((GRADING * piece[0],) if GRADING * piece[0] > FINEST else ()), *piece) if piece else (GRADING,)
        for piece in panels.halves
    )
    if halves:  # towards the centre, where a tip may have an apex
        first = halves[0]
        halves = ((*first, 1 - APEX_GRADING * (1 - first[-1])), *halves[1:])
    outer = panels.outer
    if outer:
        far = (2 * outer[-1],) if panels.infinite else ()
        outer = (GRADING * outer[0], *outer, *far)
    return replace(panels, order=panels.order + max(4, panels.order // FINER_SHARE), halves=halves, outer=outer)


def panel_errors(problem: RingEquations, fields: Fields) -> Array:
    """Load that each panel may miss: the tail of the Legendre series of the pressure times the panel's area, (P,)."""
    grid = fields.grid
    coefficients = np.abs(grid.coefficients(fields.pressure))
    tail = coefficients[:, -2:].max(axis=1)
    area = 2 * math.pi * (grid.weights * grid.r).reshape(grid.count, -1).sum(axis=1)
    density = np.abs(fields.pressure).reshape(grid.count, -1).max(axis=1)
    # On the panel to infinity the area has no end; the pressure there has.
    ring = 2 * math.pi * (grid.weights * grid.r * np.abs(fields.pressure)).reshape(grid.count, -1).sum(axis=1)
    infinite = grid.sign == 2
    # ... whose series may look complete where that of the integrand, which the load adds up, is not.
    own = grid.rule.weights / 2
    integrand = grid.weights * grid.r * fields.pressure / np.tile(own, grid.count)
    missed = 2 * math.pi * np.abs(grid.coefficients(integrand))[:, -2:].max(axis=1)
    if infinite[-1] and grid.count > 1:  # a pressure that falls before its first node is seen where the panels meet
        ends = (grid.at_end(grid.count - 2, outer=True), grid.at_end(grid.count - 1, outer=False))
        first = grid.r[-grid.order]
        missed[-1] += 2 * math.pi * first * (first - grid.inner[-1]) * abs(float((ends[0] - ends[1]) @ fields.pressure))
    share = np.divide(tail, density, out=np.zeros_like(tail), where=density > 0)
    return np.asarray(np.where(infinite, np.maximum(missed, ring * np.minimum(1.0, share)), tail * area))


def unresolved(problem: RingEquations, fields: Fields) -> Array:
    """The tail of the pressure on panels that rest as a share of what the level itself bears in their region, (P,).

    A narrow ring bears next to nothing of the load, but its inequality is judged by the sign of that; 0 where more is.
    """
    grid, found = fields.grid, np.zeros(fields.grid.count)
    largest = magnitude(fields.pressure)
    for k, region in enumerate(problem.layout.regions[: grid.region[-1] + 1]):
        if region.rests:
            own = grid.region == k
            least = problem.law.bounds(region.index)[0]
            borne = fields.pressure.reshape(grid.count, -1)[own] - least
            tail = np.abs(grid.coefficients(fields.pressure)[own, -2:]).max(axis=1)
            tail -= ROUNDING * magnitude(fields.lift) / np.diff(grid.breaks[own])[:, 0]
            most = magnitude(borne)
            found[own] = np.maximum(tail, 0.0) / max(most, 1e-300) if most < LITTLE * largest else 0.0
    return found


def roughness(fields: Fields) -> Array:
    """Tails of v'' where a film bears much as shares of its largest value, in units of what is smooth, (P,).

    As on a disc: where the film gives way next says no load.
    """
    grid, largest = fields.grid, float(fields.pressure.max(initial=0.0))
    tails = np.abs(grid.coefficients(fields.stiffness)[:, -2:]).max(axis=1)
    bears = (fields.pressure > CORE * largest).reshape(grid.count, -1).any(axis=1) & (largest > 0.0)
    return np.where(bears, tails, 0.0) / (SMOOTH * max(magnitude(fields.stiffness), 1e-300))


def adapted(problem: RingEquations, fields: Fields, tolerance: float) -> Panels | None:
    """Panels with those split that miss too much load and those joined that need not be apart; None: no change.

    The tolerance is that of the load, relative to max(1, |value|).
    """
    errors = panel_errors(problem, fields)
    share = tolerance * max(1.0, abs(problem.load(fields))) / max(4.0, len(errors) ** 0.5)
    errors = np.maximum(errors, share * np.maximum(unresolved(problem, fields) / RESOLVED, roughness(fields)))
    grid, tip = fields.grid, problem.tip
    if problem.layout.regions[0].rests and tip.apex_exponent >= 2 and grid.breaks[0, 1] > TINIEST * grid.edges[0]:
        # a disc may open there
        peak = np.abs(grid.coefficients(fields.pressure)[0])
        errors[0] = max(errors[0], share * float(peak[-2:].max() / (PEAK * max(peak[0], 1e-300))))
    panels = problem.panels
    halves: list[tuple[float, ...]] = []
    at, floating = 0, [not region.rests for region in problem.layout.regions]
    roots = [math.sqrt(abs(far - anchor)) for anchor, far in _ends(grid.anchors)]
    roots.append(math.inf)

    def widest(k: int) -> float:
        """The longest first panel of a piece: what happens at its edge is as narrow as what lies beyond it."""
        if problem.law.smooth is None:  # pressures around are constant
            return math.inf
        return GROWTH * roots[k ^ 1] / (roots[k] if k < len(panels.halves) else 1.0)

    for k, piece in enumerate(panels.halves):
        own = errors[at : at + len(piece) + 1]
        at += len(piece) + 1
        # Pieces anchored at their outer end list their panels from the centre, their breaks from the anchor.
        reverse = k == 0 or k % 2 == 0
        finest = AT_FRONT if floating[min((k + 1) // 2, problem.layout.edges)] else FINEST
        own = own[::-1] if reverse else own
        halves.append(_cut((0.0, *piece, 1.0), own, share, finest, k == 0, widest(k))[1:-1])
    outer = panels.outer
    if outer:
        own = errors[at:]
        infinite = panels.infinite
        inside = own[: len(outer)]
        outer = _cut((0.0, *outer), inside, share, 0.0, False, widest(len(halves)) if halves else math.inf)[1:]
        if infinite and own[-1] > share:
            outer = (*outer, 1.5 * outer[-1])
        elif infinite and own[-1] < 1e-3 * share and len(outer) > 2 and inside[-1] < 1e-3 * share:
            outer = outer[:-1]
    found = replace(panels, halves=tuple(halves), outer=outer)
    return None if found == panels else found


def _cut(
    breaks: tuple[float, ...], errors: Array, share: float, finest: float, apex: bool, widest: float
) -> tuple[float, ...]:
    """Breaks with too inaccurate panels cut and needless ones removed.

    The cuts are graded next to the anchor, down to `finest` and up to `widest`, and next to an apex.
    """
    kept: list[float] = [breaks[0]]
    merged = False
    pairs = list(pairwise(breaks))
    for k, (a, b) in enumerate(pairs):
        grown = b > (GROWTH * a if k > 0 else widest)
        cut = a + (b - a) / 2 if k else max(GRADING * b, finest)
        if apex and k == len(pairs) - 1 and k > 0:
            cut = b - APEX_GRADING * (b - a)
        if (errors[k] > share or grown) and cut - a < WIDEST * (b - a):
            kept.append(cut)
        joins = (
            k + 1 < len(pairs)
            and not merged
            and max(errors[k], errors[k + 1]) < 1e-5 * share
            and pairs[k + 1][1] <= (GROWTH * a if k > 0 else widest)
            and (k > 0 or len(pairs) > 2)
        )
        if joins:
            merged = True
            continue
        merged = False
        kept.append(b)
    return tuple(kept)
