"""Which models would do for a contact: the result of `contbranch.advise`. Plain data."""

from __future__ import annotations

from collections.abc import Mapping

from contbranch.contact.contact import Contact
from contbranch.results.diagram import Cost, ModelChoice
from contbranch.results.record import Record, Result, described, record
from contbranch.results.table import Tables, of_records


@record
class Candidate(Record):
    """A model or theory, and what it would be good for.

    Attributes
    ----------
    model : str
        ``hertz``, ``dmt``, ``jkr``, ``maugis-dugdale`` (in place of the contact's law), ``exact``, ``axisymmetric``,
        ``rings`` (the axisymmetric model with free boundaries), ``free``, ``periodic``.
    errors : mapping
        Its error of every threshold judged, relative to max(1, |value|) in reduced units; None where it has no such
        value. Of what was traced that trace's estimates, of theories what they are off, of grids what was measured.
    seconds : float
        The time that it takes, about.
    why : str
        Where its errors come from, a sentence.
    """

    model: str
    errors: Mapping[str, float | None]
    seconds: float
    why: str

    @property
    def worst(self) -> float | None:
        """Its largest error; None where it lacks a value."""
        known = [error for error in self.errors.values() if error is not None]
        return max(known, default=0.0) if len(known) == len(self.errors) else None


@record
class Advice(Result):
    """The cheapest model that finds the folds of a contact to an accuracy, among the candidates.

    Attributes
    ----------
    tabor : float or None
        Tabor coefficient: below about 0.1 the contact is near DMT, above about 5 near JKR.
    chosen : str
        The candidate to take.
    why : str
        The reason, a sentence.
    thresholds : tuple of str
        Names of those judged: loads (displacements) of folds under the control asked for.
    candidates : tuple of Candidate
        From the cheapest to the dearest.
    accuracy : float
        What was asked.
    """

    format = "contbranch-advice"
    contact: Contact = described(kw_only=True)
    tabor: float | None
    chosen: str
    why: str
    thresholds: tuple[str, ...]
    candidates: tuple[Candidate, ...]
    model: ModelChoice
    cost: Cost
    accuracy: float
    control: str = "load"

    def told(self) -> str:
        """The choice."""
        return f"{self.chosen}: {self.why}"

    def tables(self) -> Tables:
        """The candidates."""
        return {"candidate": of_records(Candidate, self.candidates, {})}
