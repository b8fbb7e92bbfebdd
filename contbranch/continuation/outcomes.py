"""How a trace ended, in whole sentences."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum

__all__ = ["End", "Outcome"]


class Outcome(Enum):
    """Why a curve ends where it ends; the value is the sentence to show."""

    REACHED_EDGE = "The curve reached the edge of the parameter range."
    APPROACHES_EDGE = "The curve approaches the edge of the parameter range without reaching it."
    STARTED_ON_EDGE = "The curve starts on the edge of the parameter range."
    CLOSED = "The curve is closed: it came back to its start."
    STOPPED_AT_FOLD = "The number of folds asked for was reached."
    STOPPED_AT_EVENT = "The event asked for was reached."
    STOPPED_BY_PREDICATE = "The stop condition given by the user was met."
    MAXIMUM_POINTS = "The largest number of points allowed was reached before the end of the curve."
    START_FAILED = "No solution was found near the start."
    STEP_TOO_SMALL = "Newton's method failed at the smallest step."
    NOT_FINITE = "The problem returned values that are not finite, even at the smallest step."
    EVALUATION_FAILED = "The problem raised an error, even at the smallest step."

    @property
    def complete(self) -> bool:
        """Whether nothing of the curve asked for is missing."""
        return self in _COMPLETE


_COMPLETE = frozenset(
    {
        Outcome.REACHED_EDGE,
        Outcome.APPROACHES_EDGE,
        Outcome.STARTED_ON_EDGE,
        Outcome.CLOSED,
        Outcome.STOPPED_AT_FOLD,
        Outcome.STOPPED_AT_EVENT,
        Outcome.STOPPED_BY_PREDICATE,
    }
)


@dataclass(frozen=True, slots=True)
class End:
    """One end of a curve: why it is there, and details (an error's text, a residual) where there are any."""

    outcome: Outcome
    detail: str = ""

    @property
    def message(self) -> str:
        """The outcome's sentence, followed by the details."""
        return f"{self.outcome.value} {self.detail}".strip()
