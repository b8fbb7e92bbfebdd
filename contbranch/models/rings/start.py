"""Where a curve begins: far away, or where surfaces come to rest at the end of the interaction's range."""

from __future__ import annotations

import math

import numpy as np

from contbranch.arrays import Array
from contbranch.contact.interaction_law import terms_of
from contbranch.continuation import CorrectionError, Outcome, Point
from contbranch.control import LOAD, Control
from contbranch.curve.problem import oriented
from contbranch.errors import ModelError
from contbranch.models.quadrature import start_edges

from .constraints import begun, least_margin
from .equations import NARROW_RING, RingEquations, Setting, rings
from .layout import Layout, Region
from .meshing import BOUNDED, order_for, surrounded
from .newton import resolved, solved
from .panels import Grid, Panels

__all__ = ["beginning", "distance", "farther", "floating"]

# Share of the accuracy that the load at the start of the curve may have.
START_SHARE = 0.3
# A curve with a spring starts where the stiffness of the interaction is about this share of the spring's.
SOFTER = 0.05
# Radius of the first disc at rest, at most, as a share of that over which the interaction reaches.
SMALL = 1e-2
# Radii of the hole, in shares of the disc's, from which Newton's method is tried where the pressure at the apex would
# exceed its bound: with a cone however small the disc. Shares of the disc that are tried before that.
HOLES = (0.3, 0.1, 0.6, 0.03, 0.85, 0.01, 0.003, 0.001, 1e-4, 1e-5)
DISCS = (1.0, 0.5, 0.2, 0.1, 0.03, 0.01, 1e-3)
# Where it is exceeded almost everywhere, the width of the ring in units of its radius is CLOSING exp(−π z′/(2σ)): the
# slope of what a uniform pressure lifts is as steep as the tip that far inside of its edge.
CLOSING = 4.3
# Where it would be larger than this, σ is so many slopes that no nodes resolve what the film's hole is under a cone.
SHARPEST = CLOSING * math.exp(-math.pi / 9)


def distance(setting: Setting, control: Control = LOAD) -> float:
    """The gap beyond which the interaction is negligible at the accuracy asked, and softer than a spring."""
    law, range_ = setting.law, setting.law.levels[-1]
    if law.smooth is None:
        return range_
    negligible = min(0.1, START_SHARE * setting.accuracy / (2 * math.pi))
    if control.spring_stiffness is not None:
        negligible = min(negligible, SOFTER * control.spring_stiffness * setting.scale / (2 * math.pi))
    return max(law.smooth.reach(max(negligible, np.finfo(float).tiny)), 1.2 * range_)


def floating(setting: Setting, gap: float) -> tuple[Layout, Panels]:
    """Nothing at rest, and panels for a tip at a distance."""
    tip, law = setting.tip, setting.law
    width = tip.radius_at(min(gap, 4 * max((term.range for term in terms_of(law.interaction)), default=gap)))
    reach = max(tip.radius_at(gap), 2 * width)
    regions, radii = (Region(False, law.outermost),), start_edges(width, reach)[1:]
    return surrounded(regions, tip.extent, np.zeros(0), radii, order_for(setting.tolerance))[:2]


def beginning(problem: RingEquations, control: Control) -> Point:
    """The first point of the curve.

    Raises
    ------
    ModelError
        If no state was found.
    """
    setting = problem.setting
    law = setting.law
    if not law.vanishes(law.outermost):
        far = distance(setting, control)
        return apart(problem.laid_out(*floating(setting, far)), -far)
    if law.outermost == 0:
        raise ModelError("there is no interaction")
    # The load grows with radius^(n + 1) over a tip that begins like r^n.
    small = (START_SHARE * setting.accuracy) ** (1 / (1 + setting.tip.apex_exponent))
    return at_rest(problem, setting.tip.radius_at(law.levels[-1]) * min(SMALL, small))


def farther(problem: RingEquations, control: Control, value: float) -> Point | None:
    """A state farther away than the beginning, close to the one with a value of a control; None if there is none.

    Raises
    ------
    CorrectionError
        If Newton's method fails.
    """
    setting = problem.setting
    law = setting.law
    if control.kind != "load":  # out there the tip feels next to nothing: a spring's end is where the tip is
        return apart(problem.laid_out(*floating(setting, distance(setting))), value)
    if not law.vanishes(law.outermost) or value < 0.0:
        return None
    if value == 0.0:
        return apart(problem.laid_out(*floating(setting, law.levels[-1])), -law.levels[-1])
    first = beginning(problem, control)
    share = value / first.observables["load"]
    return at_rest(problem, float(first.x[-1]) * share ** (1 / (1 + setting.tip.apex_exponent)))


def apart(problem: RingEquations, d: float) -> Point:
    """The state at a displacement at which nothing rests, on its way towards the wall."""
    law = problem.law
    edges = np.full(problem.edges, problem.tip.extent)
    r = Grid(problem.panels, edges, problem.layout.bounded).r
    pressure = law.evaluate(law.outermost, problem.tip.height(r) - d).pressure
    ahead = np.zeros(r.size + len(edges)), 1.0
    x, d = solved(problem, np.concatenate([pressure, edges]), d, ahead)
    return resolved(oriented(problem, x, d, ahead), (0 * edges, 1.0))


def at_rest(problem: RingEquations, radius: float) -> Point:
    """A tiny disc, or ring, of a radius, on which the gap rests at the end of the law's range, on its way to grow."""
    setting, law = problem.setting, problem.law
    inside, rests = Region(False, law.outermost - 1), Region(True, law.outermost)
    steep = float(setting.tip.height_derivative(np.float64(radius)))
    width = CLOSING * math.exp(-math.pi * steep / (2 * law.pressure(law.outermost - 1, law.outermost)))
    discs = [(Layout((rests,), True), [share * radius]) for share in DISCS]
    holes = [(Layout((inside, rests), True), [share * radius, radius]) for share in HOLES]
    if width < NARROW_RING:  # a jump, from the beginning
        holes = [(Layout((inside,), True), [radius])]
    if setting.tip.apex_exponent > 1:
        holes = discs + holes
    elif width > SHARPEST:
        holes = []
    for trial, edges in holes:
        try:
            point = _with_edges(problem, trial, np.array(edges))
        except CorrectionError:
            continue
        breach = least_margin(rings(point), rings(point).fields(point.x, point.parameter))
        if breach is None or breach.margin > 0:
            return point
    sharp = "The tip is too sharp for so stiff a film: describe its apex as rounded."
    raise CorrectionError(Outcome.START_FAILED, f"({sharp})")


def _with_edges(problem: RingEquations, layout: Layout, edges: Array) -> Point:
    """The state with a given outermost edge."""
    law = problem.law
    order = order_for(problem.setting.tolerance)
    panels = Panels(order, (BOUNDED,) * (2 * layout.edges - 1))
    trial = problem.laid_out(layout, panels, origin=-law.levels[-1])
    size = Grid(trial.panels, edges, True).size
    pressure = np.full(size, law.pressure(law.outermost - 1, law.outermost))
    row = np.append(np.zeros(size + len(edges) - 1), 1.0), 0.0
    return begun(oriented(trial, *solved(trial, np.concatenate([pressure, edges]), 0.0, row), row))
