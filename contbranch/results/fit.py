"""The result of a fit of a force curve: values with their errors, jumps, and what the data can tell. Plain data."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from contbranch.arrays import Array, Flags
from contbranch.contact.contact import Contact
from contbranch.contact.units import readable
from contbranch.errors import InputError
from contbranch.results.diagram import Cost
from contbranch.results.loop import Hysteresis
from contbranch.results.record import Record, Result, Values, described, given, record
from contbranch.results.table import Table, Tables

if TYPE_CHECKING:
    from matplotlib.figure import Figure


@record
class Correlations(Record):
    """Correlations of the values.

    Attributes
    ----------
    names : tuple of str
    matrix : array (N, N)
    """

    names: tuple[str, ...]
    matrix: Array


@record
class FitJump(Record):
    """A jump as it was measured and as it is fitted: piezo position, force just before it, and its step.

    Attributes
    ----------
    name : str
    measured, fitted : mapping or None
        With ``piezo`` (nm), ``force`` and ``step`` (nN), less the baseline; None where there is none. Of the one that
        was measured ``uncertainty`` (nN): within which forces cannot be told apart, for noise and distance of samples.
    """

    name: str
    measured: Mapping[str, float] | None
    fitted: Mapping[str, float] | None


@record
class LawFit(Record):
    """How well a law fits.

    Attributes
    ----------
    law : str
    rms : float
        Of the residuals (nN).
    criterion : float
        Bayesian information criterion less that of the best law: above 10 the law is as good as excluded.
    values : mapping
    """

    law: str
    rms: float
    criterion: float
    values: Mapping[str, float]


def _samples(kind: type = float) -> Any:
    return described(written=False, default_factory=lambda: np.empty(0, kind), repr=False)


@record
class Fit(Result):
    """A fitted force curve, in nm, nN, nN/nm (work of adhesion, spring, tilt) and nN/nm² (modulus).

    Attributes
    ----------
    values, errors : mapping
        By name: what was free, `contact_point`, `baseline` and `tilt`; errors are one standard deviation.
    correlations : Correlations
    determined : tuple of str
        Names of the values that the data determine.
    jumps : tuple of FitJump
    rms, noise : float
        Of the residuals, and of neighbouring samples (nN).
    contact : Contact
        With the values found.
    law : str
    leg : {"both", "approach", "retract", "each"}
        What was fitted: ``"each"`` leg by itself where one contact does not explain both. The values are then the
        approach's, but for the retraction's work of adhesion.
    legs : mapping or None
        By leg the `Fit` of each, ``"approach"`` and ``"retract"``, where they were fitted by themselves.
    laws : tuple of LawFit
        Where laws were compared, the best one first.
    status, message : str
        ``"complete"`` if the fit converged; what the data tell and what not.
    piezo, force, fitted, residuals : array (M,)
        The curve with what was fitted to it (nN); not a number where a sample was left out.
    retract, pause : array (M,)
    spring : float
        The stiffness (nN/nm); infinite for a rigid drive.
    """

    format = "contbranch-fit"
    values: Mapping[str, float]
    errors: Mapping[str, float]
    correlations: Correlations
    determined: tuple[str, ...]
    jumps: tuple[FitJump, ...]
    rms: float
    noise: float
    contact: Contact = described(kw_only=True)
    law: str
    leg: str
    legs: Mapping[str, Fit] | None
    cost: Cost
    laws: tuple[LawFit, ...] = described(written="if known", default=())
    spring: float = described(written=False, default=float("inf"))
    piezo: Array = _samples()
    force: Array = _samples()
    fitted: Array = _samples()
    residuals: Array = _samples()
    retract: Flags = _samples(bool)
    pause: Flags = _samples(bool)
    traced: Hysteresis | Callable[[], Hysteresis] | None = described(
        written=False, computed=lambda fit: None, default=None
    )

    @cached_property
    def loop(self) -> Hysteresis:
        """The quasi-static loop of the fitted contact on its spring, traced when it is asked for.

        Raises
        ------
        InputError
            For the limits jkr and dmt, which have no curve to trace, and for a fit that was read or pickled: take
            `contbranch.hysteresis` of its contact.
        """
        if self.traced is None:
            raise InputError(
                "loop: not there, as of the limits jkr and dmt, and of a fit that was read; see hysteresis"
            )
        loop: Hysteresis = given(self.traced)
        return loop

    def items(self) -> Values:
        """What documents hold: of the fits of single legs their values."""
        kept = ("values", "errors", "determined", "rms")
        legs = {name: {key: getattr(one, key) for key in kept} for name, one in (self.legs or {}).items()}
        return super().items() | {"legs": legs or None}

    def told(self) -> str:
        """The values that the data determine."""
        units = {name: unit_of_value(name) for name in self.determined}
        return ", ".join(
            f"{name} {readable(self.values[name], unit, self.errors[name], name)}" for name, unit in units.items()
        )

    def tables(self) -> Tables:
        """The samples with what was fitted to them; a CSV file of them is a force curve again."""
        measured = {"piezo": self.piezo, "force": self.force, "fitted": self.fitted, "residual": self.residuals}
        segment = np.where(self.retract, "retract", "approach")
        units = {name: "nm" if name == "piezo" else "nN" for name in measured}
        return {"sample": Table({**measured, "segment": segment}, units)}

    def plot(self) -> Figure:
        """Draw force and residuals over the piezo position, measured and fitted, with the jumps."""
        from contbranch.output.plot_fit import fit_figure

        return fit_figure(self)


def unit_of_value(name: str) -> str:
    """The unit of a value: lengths in nm, forces in nN."""
    known = {"contact_point": "nm", "baseline": "nN", "spring": "nN/nm", "sensitivity": ""}
    known |= {"tilt": "nN/nm", "baseline_retract": "nN", "tilt_retract": "nN/nm"}
    known |= {"modulus": "nN/nm²", "work_of_adhesion": "nN/nm"}
    return known.get(name.partition("[")[0], "nm" if name.partition("[")[0] in _LENGTHS else "")


_LENGTHS = ("range", "radius", "length", "wavelength")
