"""Going on with a general contact set where a curve followed with a single disc of contact can go no further."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from dataclasses import fields as fields_of

import numpy as np

from contbranch.contact.tips import Tip
from contbranch.continuation import CorrectionError, Point
from contbranch.control import Control
from contbranch.curve.outcome import RawCurve
from contbranch.curve.stability import Indices
from contbranch.errors import ModelError
from contbranch.models.axisymmetric.equations import Equations
from contbranch.models.axisymmetric.equations import Fields as DiscFields
from contbranch.models.axisymmetric.problem import ContactProblem

from .journey import Journey, Target
from .law import BandedLaw
from .layout import Layout, Region
from .legs import AdaptingProblem, Violation, oriented, solved
from .meshing import BOUNDED, order_for
from .panels import Grid, Panels
from .problem import RingProblem, Setting
from .results import assembled
from .trace import TRACE_TOLERANCE

__all__ = ["Continued", "continue_from", "from_disc", "joined"]

# Rounds of meshing and solving for the first state.
ROUNDS = 6
# Rows, from the last admissible one backwards, from which the curve is taken over until one succeeds.
TRIES = 4


@dataclass(frozen=True)
class Continued:
    """What follows a state with a disc of contact.

    Attributes
    ----------
    curve : RawCurve
        Its rows begin with the state handed over; its events count rows from there.
    indices : Indices
    points : tuple of Point
    """

    curve: RawCurve
    indices: Indices
    points: tuple[Point, ...]


def from_disc(setting: Setting, equations: Equations, fields: DiscFields) -> tuple[RingProblem, np.ndarray, float]:
    """The equilibrium of a disc (or of none) on panels of this model: problem, unknowns, displacement.

    Raises
    ------
    CorrectionError
        If Newton's method fails.
    """
    mesh, a = equations.mesh, fields.rim.radius
    d = equations.displacement(fields)
    floating = Region(False, setting.law.outermost)
    tip: Tip = setting.tip
    # The same panels outside: tau = √(r² − a²) and y = √(r − a).
    radii = np.hypot(mesh.edges[1:], a)
    radii = radii[radii < tip.extent]
    order = order_for(setting.tolerance)
    infinite = not math.isfinite(tip.extent)
    if a > 0:
        layout = Layout((Region(True, 0), floating), False)
        panels = Panels(order, (BOUNDED,), tuple(float(y) for y in np.sqrt(radii - a)), infinite)
        edges = np.array([a])
    else:
        layout = Layout((floating,), False)
        panels = Panels(order, (), tuple(float(r) for r in radii), infinite)
        edges = np.zeros(0)
    problem: RingProblem = AdaptingProblem(setting, layout, panels)
    grid = Grid(panels, edges, False)
    rho = np.sqrt(np.maximum(grid.r**2 - a * a, 0.0))
    pressure = mesh.interpolate(fields.pressure, rho)
    inside = grid.r < a
    if inside.any():
        pressure[inside] = equations.inner_pressure(fields, grid.r[inside])
    x, d = solved(problem, np.concatenate([pressure, edges]), d)
    for _ in range(ROUNDS):
        offer = problem.adapt(x, d)
        if offer is None or isinstance(offer, np.ndarray):
            break
        assert isinstance(offer.problem, RingProblem)
        problem = offer.problem
        x, d = solved(problem, offer.x, d)
    return problem, x, d


def continue_from(
    before: Sequence[tuple[Equations, DiscFields]],
    law: BandedLaw,
    target: Target,
    controls: Sequence[Control],
    accuracy: float | None,
    largest: float = 0.0,
    unstable: int = 0,
) -> Continued:
    """The curve beyond a state with a disc of contact, through any number of changes of the contact set.

    Parameters
    ----------
    before : sequence of (Equations, Fields), two
        Two states of the axisymmetric model in order along the curve, both admissible. The second is the one handed
        over; the first tells the direction.
    law : BandedLaw
    target : Target
        Where the curve ends; without value, at the multiple of the largest load of any event.
    controls : sequence of Control
        Load and displacement, and a spring if there is one.
    accuracy : float or None
        Error allowed to every event; None: no events.
    largest : float
        The largest load of the events so far.
    unstable : int
        Morse index under displacement control at the state handed over.

    Raises
    ------
    ModelError
        If this model does not find the state handed over.
    """
    (first_equations, first), (equations, last) = before
    tolerance = TRACE_TOLERANCE if accuracy is None else min(TRACE_TOLERANCE, 10 * accuracy)
    setting = Setting(equations.tip, law, tolerance)
    try:
        problem, x, d = from_disc(setting, equations, last)
        load = problem.load(problem.fields(x, d))
        start = oriented(problem, x, d, (np.zeros_like(x), 1.0))
        # Along the curve load, displacement and contact radius change as they did before.
        old = np.array(
            [
                equations.load(last) - first_equations.load(first),
                equations.displacement(last) - first_equations.displacement(first),
                last.rim.radius - first.rim.radius,
            ]
        )
        edge = float(start.tangent_x[-1]) if problem.edges else 0.0
        new = np.array([problem.load_rate(problem.fields(x, d), start.tangent_x), start.tangent_parameter, edge])
        scale = np.array([max(1.0, abs(load)), max(1.0, abs(d)), 1.0])
        if float((old / scale) @ (new / scale)) < 0:
            start = start.turned()
    except CorrectionError as error:
        raise ModelError(f"the state was not found with free boundaries {error.detail}") from error
    journey = Journey(target, controls, largest)
    if Violation().value(start) <= 0:
        raise ModelError("the state handed over is not admissible")
    step = math.hypot(abs(old[2]), abs(old[1]))
    journey.run(start, 0.1 * max(step, 1e-4))
    curve, indices = assembled(journey, accuracy, unstable)
    return Continued(curve, indices, tuple(journey.points))


def joined(
    points: Sequence[Point],
    curve: RawCurve,
    indices: Indices,
    target: Target,
    controls: Sequence[Control],
    accuracy: float | None,
) -> tuple[tuple[Point, ...], RawCurve, Indices, int]:
    """A curve of the model with a disc, ended where its contact set stops being one, with what follows.

    Parameters
    ----------
    points, curve, indices
        Rows of that model (whose last ones may already be inadmissible), its result and its Morse indices.

    Returns
    -------
    points, curve, indices, row
        The last row of that model; the next one is the same state in the model with free boundaries.

    Raises
    ------
    ModelError
        If the curve could not be taken over.
    """
    failure = ModelError("no admissible state was left")
    admissible = [k for k, point in enumerate(points) if _margin(point) > 0]
    for row in reversed([k for k in admissible if k - 1 in admissible][-TRIES:]):
        before, last = _disc(points[row - 1]), _disc(points[row])
        loads = [p.observables["load"] for p in points[: row + 1] if p.label in ("load", "spring", "edge")]
        law = BandedLaw(last[0].interaction)
        unstable = int(indices.displacement_pieces[row - 1])
        try:
            more = continue_from(
                (before, last), law, target, controls, accuracy, max(loads, default=-math.inf), unstable
            )
        except ModelError as error:
            failure = error
            continue
        return (
            (*points[: row + 1], *more.points),
            _chained(curve, more.curve, row),
            _along(indices, more.indices, row),
            row,
        )
    raise failure


def _margin(point: Point) -> float:
    problem = point.problem
    assert isinstance(problem, ContactProblem)
    return problem.equations.admissibility(problem.fields(point.x, point.parameter), problem.scale)


def _disc(point: Point) -> tuple[Equations, DiscFields]:
    problem = point.problem
    assert isinstance(problem, ContactProblem)
    return problem.equations, problem.fields(point.x, point.parameter)


def _chained(first: RawCurve, second: RawCurve, row: int) -> RawCurve:
    """Rows 0 … row of one curve, and all of another; events beyond the row belong to the second."""

    def chain(name: str) -> np.ndarray:
        return np.concatenate([getattr(first, name)[: row + 1], getattr(second, name)])

    events = [event for event in first.events if event.row <= row and event.kind not in ("inadmissible", "end")]
    events += [replace(event, row=event.row + row + 1) for event in second.events]
    spring = None if first.unstable_spring is None else chain("unstable_spring")
    known = first.unstable_azimuthal is not None and second.unstable_azimuthal is not None
    return replace(
        second,
        load=chain("load"),
        displacement=chain("displacement"),
        contact_radius=chain("contact_radius"),
        central_gap=chain("central_gap"),
        energy=chain("energy"),
        unstable_load=chain("unstable_load"),
        unstable_displacement=chain("unstable_displacement"),
        load_error=chain("load_error"),
        displacement_error=chain("displacement_error"),
        unstable_spring=spring,
        unstable_azimuthal=chain("unstable_azimuthal") if known else None,
        profiles=[*first.profiles[: row + 1], *second.profiles],
        events=events,
    )


def _along(first: Indices, second: Indices, row: int) -> Indices:
    """Indices of both: pieces up to the row, the piece between the two representations of one state, the rest."""

    def rows(name: str) -> np.ndarray:
        return np.concatenate([getattr(first, name)[: row + 1], getattr(second, name)])

    def pieces(name: str) -> np.ndarray:
        own = getattr(first, name)[:row]
        return np.concatenate([own, own[-1:], getattr(second, name)])

    names = [item.name for item in fields_of(Indices)]
    between = ("pieces", "loading", "approaching", "pulling")
    return Indices(**{name: pieces(name) if name.endswith(between) else rows(name) for name in names})
