"""The whole curve of a contact with any number of discs and annuli."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from contbranch.contact.contact import Contact
from contbranch.continuation import CorrectionError, Point
from contbranch.control import DISPLACEMENT, LOAD, Control
from contbranch.curve.outcome import RawCurve
from contbranch.curve.stability import Indices
from contbranch.errors import ModelError
from contbranch.results.diagram import Cost

from .journey import Journey, Target
from .law import BandedLaw
from .problem import Setting
from .results import assembled
from .start import beginning

__all__ = ["Traced", "trace"]

Progress = Callable[[float, str], None]

# Panels of the rows need not be as fine as those of the events, which are located anew.
TRACE_TOLERANCE = 1e-7


@dataclass(frozen=True)
class Traced:
    """A traced curve: its rows with the problems that solved them, and the raw result."""

    points: tuple[Point, ...]
    curve: RawCurve
    indices: Indices


def trace(
    contact: Contact,
    accuracy: float,
    target: Target,
    progress: Progress | None = None,
    events: bool = True,
    control: Control = LOAD,
) -> Traced:
    """Follow a reduced contact's curve from first interaction, and locate its events.

    Parameters
    ----------
    contact : Contact
        In reduced units.
    accuracy : float
        Error allowed to every event, relative to max(1, |value|).
    target : Target
    progress : callable, optional
        Called with the fraction done (a guess) and what is being done.
    events : bool
        Whether events are made precise; without, the result has none.
    control : Control
        A spring (reduced units), whose folds are located besides those of load and displacement.
    """
    began = time.perf_counter()
    setting = Setting(contact.axisymmetric_tip, BandedLaw(contact.interaction), min(TRACE_TOLERANCE, 10 * accuracy))
    controls = (LOAD, DISPLACEMENT, *((control,) if control.kind == "spring" else ()))
    journey = Journey(target, controls, progress=progress)
    with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
        try:
            rows, start, step = beginning(setting, accuracy)
            journey.points += rows
            journey.run(start, step)
        except (ModelError, CorrectionError) as error:
            journey.message = f"The curve could not be begun: {error}."
        curve, indices = assembled(journey, accuracy if events else None)
    counts = setting.counts
    cost = Cost(time.perf_counter() - began, counts["newton"])
    return Traced(tuple(journey.points), replace(curve, cost=cost, unknowns=counts["unknowns"]), indices)
