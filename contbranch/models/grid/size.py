"""Cell and grid for a contact, where they are not given: as small as what interacts and the accuracy allow."""

from __future__ import annotations

import math
from contextlib import suppress
from dataclasses import replace

import numpy as np

from contbranch.arrays import Array
from contbranch.contact.contact import Contact
from contbranch.contact.tip_shape import inverse
from contbranch.contact.tips import Parabola
from contbranch.curve.curves import FollowedCurves
from contbranch.curve.trace import Request
from contbranch.errors import InputError, ModelError
from contbranch.grid_size import nearest_fast
from contbranch.models.axisymmetric import Axisymmetric
from contbranch.watch import kept, over, patient

from .lattice import Kind
from .resolution import DECAYED, LOUD, border_energy, needed_grid, rounded_up, smallest_on_border, warn
from .setup import Setup
from .sketch import relatives

__all__ = ["announce", "border_message", "chosen_size", "expected_seconds"]

# Seconds of a trace in a free cell of 10 on so many nodes a side, one core: means over the exponential attraction with
# μ_T = 1 and the Gauss attraction with 2 (finer ones by the last growth); minutes from which on a trace is announced.
SECONDS = {64: 1.4, 128: 3.2, 256: 18.0}
LONG = 2.0

# Edge of the cell over the radius at which the interaction has decayed; images of a periodic cell act from far away.
ROOM = {"free": 2.3, "periodic": 4.0}
# Nodes a side at least and at most, where they are chosen.
LEAST, MOST = 64, 512
# Relative error of loads and radii with a spacing as long as the shortest length of the contact, and its order in the
# spacing: measured on folds of the repulsive and the attractive Gauss and exponential laws in free space.
COARSE_ERROR, ORDER = 0.02, 1.5
# Accuracy of the curve that tells how much room a trace takes, and the seconds after which what there is must do.
COARSE_CURVE, PATIENCE = 1e-4, 20.0
# A tip is flat whose height is not reached at this distance.
FLAT = 1e8
# By how much a cell that is too small is to grow at least.
LARGER = 1.05
# Heights of a tip far away that a cell has room for, as a share of the law's reach.
FAR = 0.5


def chosen_size(
    contact: Contact,
    kind: Kind,
    given: tuple[float | None, int | None],
    asked: tuple[str | None, float | None],
    accuracy: float,
    depth: float | None = None,
) -> tuple[float, int]:
    """Edge and nodes for a reduced contact.

    Parameters
    ----------
    given : (float or None, int or None)
        Edge and nodes; what is given stays.
    asked : (str or None, float or None)
        ``("load", F)`` or ``("displacement", d)`` that must fit; ``(None, F)`` for a trace to its largest load, None
        for its default.
    depth : float, optional
        The largest displacement, if it is known.
    """
    (cell, grid), (field, value) = given, asked
    depth, radius = _extent(contact, field, value) if depth is None else (depth, 0.0)
    if cell is None:
        reach = _reach(contact)  # however far away the tip is, so much of it counts as is felt out there
        cell = ROOM[kind] * _radius_at(contact, max(depth + reach, FAR * reach))
    if grid is None:
        law = contact.interaction
        lengths = [*([] if law is None else [law.range]), *([radius] if radius > 0.0 else [])]
        shortest = min(lengths, default=0.1 * cell)
        spacing = shortest * min(1.0, (accuracy / COARSE_ERROR) ** (1.0 / ORDER))
        wanted = max(LEAST, min(MOST, cell / spacing), needed_grid(cell, law))
        grid = max(LEAST, 4 * math.ceil(nearest_fast(wanted) / 4))
    return cell, grid


def _reach(contact: Contact) -> float:
    return 0.0 if contact.interaction is None else contact.interaction.reach(DECAYED)


def _radius_at(contact: Contact, height: float) -> float:
    """The largest distance from the apex at which the tip is no higher than that, along the axes."""
    surface = contact.tip.surface

    def height_at(distance: float) -> float:
        return min(float(surface(distance, 0.0)), float(surface(0.0, distance)))

    radius = inverse(height_at, height, contact.tip.natural_length, FLAT)
    if radius >= FLAT:
        raise InputError("cell: the tip is flat; give the edge of the cell")
    return radius


def _extent(contact: Contact, field: str | None, value: float | None) -> tuple[float, float]:
    """Largest displacement, and smallest radius of contact at a fold, of the axisymmetric model or its likeness."""
    likeness = replace(contact, body=None, tip=contact.tip if contact.tip.is_axisymmetric else Parabola(1.0))
    if field is not None and value is not None:
        states, _ = relatives(contact, field, value)
        if states:
            radii = [state.contact_radius for state in states if state.contact_radius > 0.0]
            return max(state.displacement for state in states), min(radii, default=0.0)
        return max(value, 1.0), 0.0
    request = Request(COARSE_CURVE, target=value, events=False, modes=0)
    try:
        with patient(PATIENCE):
            curve = FollowedCurves(likeness, Axisymmetric()).trace(request)
        return float(curve.branch.displacement.max(initial=1.0)), 0.0
    except ModelError:
        return 10.0, 0.0


def border_message(setup: Setup, gap: Array, load: float, asked: tuple[str | None, float | None]) -> str:
    """A sentence if the interaction reaches the border of the cell, empty if it has decayed; `asked` as for a size."""
    problem, law = setup.problem, setup.law
    share = border_energy(problem, gap)
    if law is None or share <= DECAYED:
        return ""
    missing, edge = law.reach(DECAYED) - smallest_on_border(problem.lattice, gap), LARGER * setup.edge
    with suppress(InputError):  # of a tip that is flat out there
        edge = max(
            edge, 2.0 * _radius_at(setup.contact, smallest_on_border(problem.lattice, problem.heights) + missing)
        )
    if share > LOUD:  # what lies outside has never been felt: it bears load that goes elsewhere here
        edge = max(edge, 1.5 * setup.edge)
        with suppress(InputError):
            chosen = (setup.contact, setup.kind, (None, setup.grid), asked, 1e-3)
            edge = max(edge, edge if over() else kept(lambda: chosen_size(*chosen), (edge, 0))[0])
    return (
        f"The cell is too small: the interaction reaches its border with {share:.2g} of its strength at load "
        f"{load * setup.units.load:.6g}; use a cell of about {rounded_up(edge * setup.units.in_plane)} or more."
    )


def expected_seconds(grid: int) -> float:
    """Seconds that a trace of a single asperity on a grid of so many nodes a side takes on one core, about."""
    known, measured = np.log(list(SECONDS)), np.log(list(SECONDS.values()))
    slope = float((measured[-1] - measured[-2]) / (known[-1] - known[-2]))
    beyond = slope * max(0.0, math.log(grid) - float(known[-1]))
    return math.exp(float(np.interp(math.log(grid), known, measured)) + beyond)


def announce(grid: int) -> None:
    """Warn of a trace that will take minutes."""
    minutes = expected_seconds(grid) / 60.0
    if minutes >= LONG:
        warn(f"a trace on {grid} nodes a side takes {minutes:.0f} minutes, about; take fewer, or give a time limit")
