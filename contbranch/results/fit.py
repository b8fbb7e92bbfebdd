"""The result of a fit of a force curve: values with their errors, jumps, and what the data can tell. Plain data."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar, Literal

from contbranch.arrays import Array
from contbranch.contact.contact import Contact
from contbranch.errors import InputError
from contbranch.results.loop import Hysteresis
from contbranch.results.record import Record, Result, described, record

if TYPE_CHECKING:
    from matplotlib.figure import Figure

__all__ = ["Correlations", "Fit", "FitJump", "LawFit"]


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
        With ``piezo`` (nm), ``force`` and ``step`` (nN), less the baseline; None where there is none.
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


@record
class Fit(Result):
    """A fitted force curve, in nm, nN, nN/nm (work of adhesion, spring, tilt) and nN/nm² (modulus).

    Attributes
    ----------
    values, errors : mapping
        By name: what was free, `contact_point`, `baseline` and `tilt`; errors are one standard deviation.
    correlations : Correlations
    identifiable : tuple of str
        Names of the values that the data determine.
    jumps : tuple of FitJump
    rms, noise : float
        Of the residuals, and of neighbouring samples (nN).
    contact : Contact
        With the values found.
    law : str
    laws : tuple of LawFit
        Where laws were compared, the best one first.
    status, message : str
        ``"complete"`` if the fit converged; what the data tell and what not.
    piezo, force, fitted, residuals : array (M,)
        The curve with what was fitted to it (nN).
    retract : array (M,)
    spring : float
        The stiffness (nN/nm); infinite for a rigid drive.
    """

    format: ClassVar[str] = "contbranch-fit"
    values: Mapping[str, float]
    errors: Mapping[str, float]
    correlations: Correlations
    identifiable: tuple[str, ...]
    jumps: tuple[FitJump, ...]
    rms: float
    noise: float
    contact: Contact
    law: str
    status: Literal["complete", "incomplete"]
    message: str
    laws: tuple[LawFit, ...] = described(written="if known", default=())
    spring: float = described(written=False, default=float("inf"))
    piezo: Array | None = described(written=False, default=None, repr=False)
    force: Array | None = described(written=False, default=None, repr=False)
    fitted: Array | None = described(written=False, default=None, repr=False)
    residuals: Array | None = described(written=False, default=None, repr=False)
    retract: Array | None = described(written=False, default=None, repr=False)
    traced: Hysteresis | Callable[[], Hysteresis] | None = described(
        written=False, computed=lambda fit: None, default=None
    )

    @cached_property
    def loop(self) -> Hysteresis:
        """The quasi-static loop of the fitted contact on its spring, traced when it is asked for.

        Raises
        ------
        InputError
            For the limits jkr and dmt, which have no curve to trace.
        """
        if self.traced is None:
            raise InputError("loop: the limits jkr and dmt have none; fit a law with a range")
        return self.traced() if callable(self.traced) else self.traced

    def table(self) -> dict[str, Any]:
        """Columns of the curve with what was fitted, by names with units."""
        columns = {"piezo [nm]": self.piezo, "force [nN]": self.force, "fitted [nN]": self.fitted}
        words = [] if self.retract is None else ["retract" if back else "approach" for back in self.retract]
        return {**columns, "residual [nN]": self.residuals, "segment": words}

    def to_csv(self, path: str | Path) -> None:
        """Write the curve, what was fitted to it and the residuals as CSV.

        Raises
        ------
        InputError
            If the file cannot be written.
        """
        from contbranch.output.table import write_csv

        write_csv(path, self.table())

    def plot(self) -> Figure:
        """Draw force and residuals over the piezo position, measured and fitted, with the jumps."""
        from contbranch.output.plot_fit import fit_figure

        return fit_figure(self)
