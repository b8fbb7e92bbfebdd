"""Where a curve begins: far away, or where surfaces come to rest at the end of the interaction's range."""

from __future__ import annotations

import math

import numpy as np

from contbranch.contact.tips import Tip
from contbranch.continuation import CorrectionError, Point
from contbranch.errors import ModelError

from .constraints import least_margin
from .layout import Layout, Region
from .legs import AdaptingProblem, oriented, solved
from .meshing import order_for, start_panels
from .panels import Grid
from .problem import RingProblem, Setting

__all__ = ["beginning", "radius_at"]

# Share of the accuracy that the load at the start of the trace may have.
START_SHARE = 0.3
# Radii of the hole, in shares of the disc's, from which Newton's method is tried where the pressure at the apex would
# exceed its bound however small the disc (a cone's).
HOLES = (0.3, 0.1, 0.6, 0.03, 0.85, 0.01, 0.003, 0.001, 1e-4, 1e-5)


def radius_at(tip: Tip, height: float) -> float:
    """Radius at which the tip's profile has a height."""
    low, high = 0.0, 1.0
    while high < tip.extent and float(tip.height(np.float64(high))) < height:
        low, high = high, 2 * high
    high = min(high, tip.extent)
    for _ in range(60):
        middle = (low + high) / 2
        low, high = (middle, high) if float(tip.height(np.float64(middle))) < height else (low, middle)
    return high


def beginning(setting: Setting, accuracy: float) -> tuple[list[Point], Point, float]:
    """Rows before the first leg, its first point and the length of its first step.

    Raises
    ------
    ModelError
        If no state was found.
    """
    law = setting.law
    if law.vanishes(law.outermost):
        return _resting(setting, accuracy)
    return _far(setting, accuracy)


def _resting(setting: Setting, accuracy: float) -> tuple[list[Point], Point, float]:
    """A tiny disc, or ring, on which the gap rests at the end of the law's range."""
    law = setting.law
    # The load grows with radius^(n + 1) over a tip that begins like r^n.
    small = (START_SHARE * accuracy) ** (1 / (1 + setting.tip.apex_exponent))
    radius = radius_at(setting.tip, law.levels[-1]) * min(1e-2, small)
    order = order_for(setting.tolerance)
    rests = Region(True, law.outermost)
    if setting.tip.apex_exponent > 1:
        return [], _at_radius(setting, Layout((rests,), True), np.array([radius]), order), 0.3 * radius
    if law.outermost == 0:
        raise ModelError("there is no interaction")
    layout = Layout((Region(False, law.outermost - 1), rests), True)
    for share in HOLES:
        try:
            point = _at_radius(setting, layout, np.array([share * radius, radius]), order)
        except CorrectionError:
            continue
        found = least_margin(point.problem, point.problem.fields(point.x, point.parameter))  # type: ignore[attr-defined,arg-type]
        if found is None or found.margin > 0:
            return [], point, 0.3 * radius
    raise ModelError("no ring at rest was found where the interaction begins")


def _at_radius(setting: Setting, layout: Layout, edges: np.typing.NDArray[np.float64], order: int) -> Point:
    """The state with a given outermost edge."""
    law = setting.law
    problem = AdaptingProblem(setting, layout, start_panels(layout, order, 1.0, 1.0, False))
    grid = Grid(problem.panels, edges, True)
    pressure = np.full(grid.size, law.pressure(law.outermost - 1, law.outermost) if law.outermost else 1.0)
    x = np.concatenate([pressure, edges])
    row = np.zeros(x.size)
    row[-1] = 1.0
    x, d = solved(problem, x, -law.levels[-1], (row, 0.0))
    return oriented(problem, x, d, (row, 0.0))


def _far(setting: Setting, accuracy: float) -> tuple[list[Point], Point, float]:
    """No region at rest: floating in the outermost band."""
    tip, law = setting.tip, setting.law
    assert law.smooth is not None
    terms = law.smooth.terms
    far = max(law.smooth.reach(min(0.1, START_SHARE * accuracy / (2 * math.pi))), 1.2 * law.levels[-1])
    width = radius_at(tip, min(far, 4 * max(term.range for term in terms)))
    reach = radius_at(tip, far)
    layout = Layout((Region(False, law.outermost),), False)
    infinite = not math.isfinite(tip.extent)
    panels = start_panels(layout, order_for(setting.tolerance), width, max(reach, 2 * width), infinite)
    problem: RingProblem = AdaptingProblem(setting, layout, panels)
    d = -far
    grid = Grid(panels, np.zeros(0), False)
    pressure = law.evaluate(law.outermost, tip.height(grid.r) - d).pressure
    x, d = solved(problem, np.asarray(pressure, dtype=float), d)
    for _ in range(4):
        found = problem.adapt(x, d)
        if found is None or isinstance(found, np.ndarray):
            break
        assert isinstance(found.problem, RingProblem)
        problem = found.problem
        x, d = solved(problem, found.x, d)
    return [], oriented(problem, x, d, (np.zeros_like(x), 1.0)), setting.scale
