"""What is computed for each contact of a sweep; anything that is described, called and pickled alike can stand in."""

from __future__ import annotations

import hashlib
import json
from dataclasses import dataclass
from typing import Any, Literal, NamedTuple, Protocol

import numpy as np

from contbranch import __version__
from contbranch.arrays import AnyArray, Columns, plain
from contbranch.contact.contact import Contact
from contbranch.contact.units import accuracy_of, positive_number
from contbranch.control import Spring, as_control
from contbranch.errors import look_up
from contbranch.results.diagram import Branch, Diagram
from contbranch.results.profile import Profile
from contbranch.results.record import Values, given
from contbranch.results.table import joined

KEEP = ("thresholds", "curves", "profiles")
_POINT = ("load", "displacement", "contact_radius", "central_gap", "energy", "unstable_load",
                 "unstable_displacement", "unstable_spring", "unstable_azimuthal", "contact_area",
                 "contact_perimeter", "mean_gap", "cell_energy")  # fmt: skip


class Outcome(NamedTuple):
    """What a task gives.

    Attributes
    ----------
    about : dict
        What JSON holds: ``status``, ``message``, ``thresholds``, and whatever else the task has to say.
    arrays : dict of array (M,)
        Columns named ``dimension.name``; those of one dimension have one length.
    """

    about: Values
    arrays: Columns


class Task(Protocol):
    """What is done with every input of a sweep; pickled and sent to workers.

    It may have a `contact` that all inputs share, `unit_names` of parameters and thresholds, and a `kind` of `Sweep`.
    """

    @property
    def time_limit(self) -> float | None:
        """Seconds after which its worker is given up."""

    def describe(self) -> Values:
        """What makes results of two tasks comparable, as JSON holds it."""

    def __call__(self, given: Any) -> Outcome:
        """The outcome for one input."""


@dataclass(frozen=True)
class Tracing:
    """Every contact is traced.

    Attributes
    ----------
    control, accuracy, max_load, model
        As of `contbranch.trace`.
    keep : {"thresholds", "curves", "profiles"}
        What is stored: events and thresholds; the points of the curves besides; their gaps and pressures as well.
    time_limit : float or None
        Seconds after which a trace ends incomplete.
    """

    control: str | Spring = "load"
    accuracy: float = 1e-6
    max_load: float | None = None
    model: Any = "auto"
    keep: Literal["thresholds", "curves", "profiles"] = "curves"
    time_limit: float | None = None

    def __post_init__(self) -> None:
        as_control(self.control)
        look_up(self.keep, dict.fromkeys(KEEP), "keep")
        accuracy_of(self.accuracy)
        if self.max_load is not None and not isinstance(self.max_load, str):
            positive_number(self.max_load, "max_load")

    def describe(self) -> Values:
        """Every setting but the time allowed."""
        settings = {"accuracy": self.accuracy, "max_load": self.max_load, "model": repr(self.model), "keep": self.keep}
        return {"task": "trace", "control": repr(as_control(self.control)), **settings}

    def __call__(self, given: Contact) -> Outcome:
        """Thresholds, events and curves of a contact."""
        from contbranch.api import trace

        return self.outcome(
            trace(given, self.control, self.accuracy, self.max_load, self.model, time_limit=self.time_limit)
        )

    def outcome(self, diagram: Diagram) -> Outcome:
        """What is kept of a diagram."""
        events = [event.brief() for event in diagram.events]
        kept = ("status", "message", "thresholds", "control", "stiffness", "accuracy")
        about = {name: getattr(diagram, name) for name in kept} | {"model": diagram.model, "events": events}
        about["contact"] = diagram.head()["contact"]
        arrays: dict[str, AnyArray] = {}
        if self.keep != "thresholds":
            parts = [_points(branch, self.keep == "profiles") for branch in diagram.branches]
            arrays = joined("point.branch", parts) if parts else {}
        return Outcome(plain(about), arrays)


def _points(branch: Branch, profiles: bool) -> dict[str, AnyArray]:
    """The columns of a branch, and those of its profiles with their lengths."""
    found = {f"point.{name}": getattr(branch, name) for name in _POINT if getattr(branch, name) is not None}
    known: list[Profile] = list(map(given, branch.profiles)) if profiles else []
    if known:
        found["point.nodes"] = np.array([len(one.r) for one in known])
        for name in ("r", "gap", "pressure", "wall_pressure"):
            found[f"node.{name}"] = np.concatenate([getattr(one, name) for one in known])
    return found


def key_of(given: Any, task: Task) -> str:
    """What tells whether a result is that of a contact: a hash of the contact, the task and the version."""
    what = {"contact": plain(given.describe()), "task": task.describe(), "version": __version__}
    return hashlib.sha256(json.dumps(what, sort_keys=True).encode()).hexdigest()
