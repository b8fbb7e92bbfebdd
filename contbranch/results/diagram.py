"""The result of a trace: branches, events and thresholds with their error estimates, as plain data."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from contbranch.arrays import AnyArray, Array, Integers
from contbranch.control import Control
from contbranch.errors import InputError, ModelError
from contbranch.results.profile import CellFields, ModeShape, Profile
from contbranch.results.record import (
    OBSERVABLES,
    Record,
    Result,
    Values,
    described,
    given,
    record,
)
from contbranch.results.table import Table, Tables, joined, of_columns, of_records
from contbranch.watch import patient

if TYPE_CHECKING:
    from matplotlib.figure import Figure

__all__ = [
    "Branch",
    "CellFields",
    "Cost",
    "Diagram",
    "Event",
    "Exponent",
    "LocalExponent",
    "ModeShape",
    "ModelChoice",
    "Profile",
    "Solution",
    "State",
    "Window",
]

# Seconds for a local exponent that nobody has asked for.
PATIENCE = 10.0
# Nodes a side that are kept of the fields of a state.
KEPT = 64

EventKind = Literal["fold", "touch", "topology", "symmetry", "inadmissible", "end"]


@record
class State(Record):
    """One equilibrium, in the contact's units.

    Attributes
    ----------
    unstable_load, unstable_displacement : int
        Morse indices: the number of axisymmetric unstable modes under load and under displacement control.
    residual : float
        Largest residual of the equilibrium equations relative to the largest value of the unknown.
    error : mapping
        Error estimates of load, displacement, contact_radius and central_gap.
    profile : Profile or None
        Gap and pressures.
    unstable_spring : int or None
        Morse index under the control of a spring, where one was asked for.
    unstable_azimuthal : int
        Number of unstable modes that break the axial symmetry, cos mθ and sin mθ of each m ≥ 1 together counted as one.
        They do not depend on the control. Modes up to m = 32 are counted (a trace: up to its `modes`).
    mean_gap : float or None
        Mean of the gap over the cell, of grid models.
    barrier : float or None
        The lowest barrier around a stable state, of `find_all`; None if it is unstable, or none is known.
    cell_energy : float or None
        Energy of a periodic cell by itself. `displacement` is that of the far field of a single contact, C F more than
        that of the cell's mean plane, and `energy` C F²/2 more than that of the cell (C: `docs/grid.md`).
    in_cell : CellFields, callable or None
        Fields on the nodes of the cell, or what computes them: ask for them as ``state.cell``.
    """

    load: float
    displacement: float
    contact_radius: float
    central_gap: float
    energy: float
    unstable_load: int
    unstable_displacement: int
    residual: float
    error: Mapping[str, float] = described(kind=dict, default_factory=dict)
    profile: Profile | None = described(written=False, default=None)
    unstable_spring: int | None = described(written="if known", default=None)
    unstable_azimuthal: int = 0
    mean_gap: float | None = described(written="if known", default=None)
    cell_energy: float | None = described(written="if known", default=None)
    barrier: float | None = described(unit="energy", written="if known", default=None)
    in_cell: CellFields | Callable[[], CellFields] | None = described(
        written=False, computed=lambda state: None if state.in_cell is None else state.cell, default=None
    )

    @cached_property
    def cell(self) -> CellFields:
        """Gap and pressures on the nodes of the cell, of grid models.

        Raises
        ------
        InputError
            For a state of another model, or one whose fields were not kept.
        """
        if self.in_cell is None:
            raise InputError(
                "state: it has no fields on a cell; solve with model=cb.Periodic(...) or cb.FreeSpace(...)"
            )
        cell: CellFields = given(self.in_cell)
        return cell

    @property
    def r(self) -> Array:
        """Radii of the profile, (M,)."""
        return self._profile().r

    @property
    def gap(self) -> Array:
        """Gap at `r`."""
        return self._profile().gap

    @property
    def pressure(self) -> Array:
        """Total pressure at `r`."""
        return self._profile().pressure

    @property
    def wall_pressure(self) -> Array:
        """The wall's share of the pressure at `r`."""
        return self._profile().wall_pressure

    def _profile(self) -> Profile:
        if self.profile is None:
            raise InputError("state: it was kept without its gap and pressure profiles")
        return self.profile

    def unstable(self, control: str | Control) -> int:
        """Morse index under ``"load"``, ``"displacement"`` or ``"spring"`` control.

        Raises
        ------
        InputError
            If the state was not found with a spring.
        """
        return int(_of_control(self, control))

    def stable(self, control: str | Control) -> bool:
        """Whether the state is stable to all modes under ``"load"``, ``"displacement"`` or ``"spring"`` control."""
        return self.unstable(control) == 0 and self.unstable_azimuthal == 0


@record
class Window(Record):
    """A power law fitted over a window of the excess control, ``Δa = prefactor · Δ^kappa`` (the paper's Table 1).

    Attributes
    ----------
    start, stop : float
        Ends of the window in the excess over the fold's control value.
    kappa, kappa_error, prefactor : float
        Fitted exponent, its uncertainty (the change of the local exponent across the window) and prefactor.
    """

    start: float = described(key="from")
    stop: float = described(key="to")
    kappa: float
    kappa_error: float
    prefactor: float


@record
class Exponent(Record):
    """Critical behaviour at a fold.

    Attributes
    ----------
    kappa : float
        Exponent at the fold itself: 1/2 at every quadratic fold.
    crossover_load : float or None
        Excess of the fold's control, in its unit (a spring's is the position of its end), at which the next term of the
        expansion has changed the order parameter as much as the leading one.
    window : Window or None
        The fit over a window, which measures the crossover.
    prefactor : float
        c of the normal form ``order parameter = c · excess^(1/2)``.
    order_parameter : str
        ``"contact_radius"``, or ``"central_gap"`` at a fold without contact.
    """

    kappa: float
    crossover_load: float | None
    window: Window | None = described(kind=Window)
    prefactor: float | None = None
    order_parameter: str = "contact_radius"


@record
class LocalExponent(Record):
    """Local exponent ``dln|Δorder parameter| / dlnΔ`` on the contact side of a fold or touch.

    Attributes
    ----------
    excess : array (M,)
        Excess ΔF of the load (or displacement) over the event's, increasing.
    order_parameter : array (M,)
        Distance of the contact radius (or central gap) from its value at the event.
    kappa, error : array (M,)
        Local exponent and its error estimate.
    """

    excess: Array
    order_parameter: Array
    kappa: Array
    error: Array


@record
class Event(Record):
    """Something that happens on the curve; every number is in the contact's units.

    Attributes
    ----------
    kind : str
        ``fold``, ``touch``, ``topology`` (a part of the contact set is born or vanishes), ``symmetry``,
        ``inadmissible`` or ``end``.
    control : str or None
        Control whose fold this is: ``load``, ``displacement`` or ``spring``.
    name : str or None
        ``pull-off``, ``jump-in``, ``squeeze-out``, ``wetting``; None for a fold that bounds no stable part.
    load, displacement, contact_radius, central_gap : float
    error : mapping
        Error estimate of each of the four.
    critical : Exponent, callable or None
        Critical exponent (folds), or what computes it: ask for it as ``event.exponent``.
    stiffness : float or None
        Stiffness of the spring (spring folds).
    message : str
        What happened, where the kind does not say it all.
    branch, position : int, float
        Branch, and position on it in units of points (between points i and i + 1: i + 0.5).
    mode : int or None
        Number m of the azimuthal mode that changes stability (symmetry).
    mode_shape : ModeShape or None
        Gap and pressure of that mode.
    verdict : str or None
        Of a fold on a grid: ``"stays"``, ``"moves"`` or ``"vanishes"`` on the grid with twice the nodes a side, where
        that was examined, or ``"unresolved"`` if it differs from the next fold by less than the lattice's error;
        ``"averaged"`` if it is a fold of the average over the nodes that join the contact. One that vanishes or is
        unresolved is the lattice's own and bears no name.
    origin : object or None
        What `contbranch.follow` needs to follow the event; None for events read from a file.
    """

    kind: EventKind = described(kind=str)
    load: float
    displacement: float
    contact_radius: float
    central_gap: float
    error: Mapping[str, float] = described(kind=dict)
    control: str | None = None
    name: str | None = None
    critical: Exponent | Callable[[], Exponent | None] | None = described(
        kind=Exponent, key="exponent", computed=lambda event: event.exponent, default=None
    )
    stiffness: float | None = None
    message: str = ""
    branch: int = 0
    position: float = 0.0
    origin: Any = described(written=False, computed=lambda event: None, default=None)
    mode: int | None = None
    mode_shape: ModeShape | None = described(written=False, default=None, repr=False, compare=False)
    verdict: str | None = None

    def brief(self) -> Values:
        """What documents hold, but for the exponent, which takes long."""
        return {key: value for key, value in replace(self, critical=None).items().items() if key != "exponent"}

    @cached_property
    def exponent(self) -> Exponent | None:
        """Critical exponent of a fold; computed when it is asked for, since it costs some tens of solutions."""
        exponent: Exponent | None = given(self.critical)
        return exponent


@record
class Branch(Record):
    """One connected curve of equilibria, as arrays over its points, in the contact's units.

    Attributes
    ----------
    load, displacement, contact_radius, central_gap, energy : array (M,)
    unstable_load, unstable_displacement : integer array (M,)
        Morse indices under load and displacement control.
    load_error, displacement_error : array (M,)
        Error estimates of load and displacement at every point.
    unstable_spring : integer array (M,) or None
        Morse index under the control of the spring of the diagram, if it has one.
    unstable_azimuthal : integer array (M,) or None
        Number of unstable modes of all m ≥ 1 (see `State`), which can differ from zero only where
        `unstable_displacement` does; None where it has not been examined.
    cells : sequence of CellFields or callable
        Fields on the nodes of the cell, of grid models, or what computes them: ask for them as ``state(i).cell``. Files
        hold the part with pressure, at 64 nodes a side or fewer.
    critical_eigenvalue : array (M,) or None
        Largest eigenvalue of the azimuthal modes at every point; computed when asked for, None where unknown. It is
        that of m = 1, which is the largest of all m ≥ 1; a state is stable to all of them if and only if it is below 1.
    fft_pairs : integer array (M,) or None
        Pairs of transforms spent on each point by a grid model.
    contact_area, contact_perimeter : array (M,) or None
        Area of the contact and length of its rim, of grid models; `contact_radius` is there √(area/π).
    mean_gap, cell_energy : array (M,) or None
        Of periodic cells, as of a `State`.
    """

    load: Array
    displacement: Array
    contact_radius: Array
    central_gap: Array
    energy: Array
    unstable_load: Integers
    unstable_displacement: Integers
    load_error: Array = described(late=True, compare=True)
    displacement_error: Array = described(late=True, compare=True)
    profiles: Sequence[Profile | Callable[[], Profile]] = described(
        written=False,
        computed=lambda branch: tuple(map(given, branch.profiles)),
        default=(),
    )
    cells: Sequence[CellFields | Callable[[], CellFields]] = described(
        written=False,
        computed=lambda branch: tuple(branch.state(row).cell.shown(KEPT) for row in range(len(branch.cells))),
        default=(),
    )
    unstable_spring: Integers | None = described(written="if known", default=None)
    unstable_azimuthal: Integers | None = described(written="if known", default=None)
    critical_eigenvalue: Array | None = described(written=False, late=True, default=None)
    fft_pairs: Integers | None = described(written="if known", default=None)
    contact_area: Array | None = described(written="if known", default=None)
    contact_perimeter: Array | None = described(written="if known", default=None)
    mean_gap: Array | None = described(written="if known", default=None)
    cell_energy: Array | None = described(written="if known", default=None)

    def __len__(self) -> int:
        return len(self.load)

    @property
    def columns(self) -> dict[str, AnyArray]:
        """The arrays by name, those that the branch has."""
        return self.items()

    def state(self, i: int) -> State:
        """Point `i` with its profile: r, gap, pressure and wall_pressure."""
        names = (*OBSERVABLES, "energy", "unstable_load", "unstable_displacement")
        known: Values = {name: getattr(self, name)[i].item() for name in names}
        for name in ("unstable_spring", "unstable_azimuthal", "mean_gap", "cell_energy"):
            if getattr(self, name) is not None:
                known[name] = getattr(self, name)[i].item()
        return State(
            **known,
            residual=0.0,
            error={name: float(getattr(self, f"{name}_error")[i]) for name in OBSERVABLES[:2]},
            profile=given(self.profiles[i]) if len(self.profiles) else None,
            in_cell=self.cells[i] if len(self.cells) else None,
        )

    def unstable(self, control: str | Control) -> Integers:
        """Morse index under ``"load"``, ``"displacement"`` or ``"spring"`` control, (M,).

        Raises
        ------
        InputError
            If the branch was not traced with a spring.
        """
        return np.asarray(_of_control(self, control))


def _of_control(source: State | Branch, control: str | Control) -> Any:
    """The Morse index (or indices) of a state or branch under a control."""
    kind = control.kind if isinstance(control, Control) else control
    found = {
        "load": source.unstable_load,
        "displacement": source.unstable_displacement,
        "spring": source.unstable_spring,
    }.get(kind)
    if found is None:
        raise InputError(f"control: {kind!r}; must be load, displacement, or spring where one was asked for")
    return found


@record
class ModelChoice(Record):
    """Which model was used, why, and how many unknowns it had at most."""

    kind: str
    why: str
    unknowns: int


@record
class Cost(Record):
    """Wall time in seconds, Newton iterations and pairs of transforms (those spent on stability apart)."""

    wall_s: float
    newton: int
    fft_pairs: int = 0
    stability_pairs: int = 0


@record
class Diagram(Result):
    """A bifurcation diagram.

    Attributes
    ----------
    contact : Contact or None
        What was traced (None when a file's contact cannot be rebuilt, for laws defined outside the package).
    branches : tuple of Branch
    events : tuple of Event
        In the order in which they lie on the curve.
    thresholds : dict
        Named loads, displacements and radii; no key for what does not exist.
    model : ModelChoice
    control : str
        The control whose stability plots speak of: ``load``, ``displacement`` or ``spring``.
    stiffness : float or None
        Stiffness of that spring.
    accuracy : float
        Error allowed to every event, relative to max(1, |value|) in reduced units.
    status, message : str
        ``"complete"`` or ``"incomplete"``, and the reason.
    sensitivities : mapping or None
        Derivatives ``sensitivities[threshold][parameter]`` of the thresholds in the contact's units, computed when they
        are asked for: `modulus`, the tip's numbers, and every law's, with its place in a sum (``range[1]``). None of
        grid models.
    uncertainties : mapping or None
        Standard uncertainties of the thresholds, from `propagate`, where the command line was asked for them.
    """

    format = "contbranch-diagram"
    branches: tuple[Branch, ...]
    events: tuple[Event, ...]
    thresholds: Mapping[str, float]
    model: ModelChoice
    cost: Cost
    control: str = "load"
    accuracy: float = 1e-6
    local_exponents: Callable[[Event], LocalExponent] | Mapping[int, LocalExponent] | None = described(
        written=False, computed=lambda diagram: diagram.known_exponents(), default=None
    )
    stiffness: float | None = described(written="if known", default=None)
    sensitivities: Mapping[str, Mapping[str, float]] | None = described(written="if known", late=True, default=None)
    uncertainties: Mapping[str, float] | None = described(written="if known", default=None)

    def propagate(self, uncertainties: Mapping[str, object]) -> dict[str, float]:
        """Standard uncertainties of the thresholds, to first order, from those of parameters that are independent.

        Parameters
        ----------
        uncertainties : mapping
            By the parameters' names in `sensitivities`: numbers in the contact's units, or texts with a unit.

        Raises
        ------
        InputError
            For a name that is not known or a value that cannot be used, and where there are no sensitivities.
        """
        from contbranch.contact.parameters import read_quantities

        if self.contact is None or self.sensitivities is None:
            raise InputError(
                "uncertainties: this diagram has no sensitivities; trace by the exact or axisymmetric model"
            )
        given = read_quantities(self.contact, uncertainties, "uncertainty")
        return {
            threshold: math.hypot(*(rates[name] * value for name, value in given.items()))
            for threshold, rates in self.sensitivities.items()
        }

    def told(self) -> str:
        """Its thresholds."""
        return ", ".join(f"{name} {value:.7g}" for name, value in self.thresholds.items())

    def folds(self, control: str | None = None) -> Iterator[Event]:
        """The folds of one control, ``"load"``, ``"displacement"`` or ``"spring"``, or all of them.

        Raises
        ------
        InputError
            For any other control.
        """
        if control not in (None, "load", "displacement", "spring"):
            raise InputError(f"control: {control!r}; must be load, displacement or spring")
        return (e for e in self.events if e.kind == "fold" and control in (None, e.control))

    def local_exponent(self, event: Event) -> LocalExponent:
        """Local exponent κ_local(ΔF) on the contact side of a fold or touch, with its error estimate.

        Raises
        ------
        InputError
            If the event is not a fold or touch of this diagram, or the diagram keeps no curve to take it from.
        """
        kind = event.kind if isinstance(event, Event) else type(event).__name__
        if kind not in ("fold", "touch") or event not in self.events:
            raise InputError(f"event: {kind} is not a fold or touch of this diagram; take one from diagram.events")
        source = self.local_exponents
        if callable(source):
            return source(event)
        found = (source or {}).get(self.events.index(event))
        if found is None:
            raise InputError("event: this diagram keeps no local exponent for it; trace the contact again")
        return found

    def known_exponents(self) -> dict[int, LocalExponent]:
        """Local exponents by the number of the event, of all that have one, each as far as some seconds go."""
        found = {}
        for number, event in enumerate(self.events):
            # A curve that ends too close to an event leaves it without.
            with suppress(InputError, ModelError), patient(PATIENCE):
                found[number] = self.local_exponent(event)
        return found

    def tables(self) -> Tables:
        """The points of all branches, and the events with their exponents."""
        return {"point": self.table(), "event": of_records(Event, self.events, self.unit_names)}

    def table(self) -> Table:
        """The points of all branches."""
        return of_columns(joined("branch", [branch.columns for branch in self.branches]), self.unit_names)

    def events_to_csv(self, path: str | Path) -> None:
        """Write the events as `to_csv` writes the points.

        Raises
        ------
        InputError
            If the file cannot be written.
        """
        self.tables()["event"].to_csv(path)

    def plot_mode(self, event: Event) -> Figure:
        """Draw the mode that changes stability at a symmetry event: gap and pressure over r, and the gap from above.

        Raises
        ------
        InputError
            If the event has no mode.
        """
        from contbranch.output.plot_modes import mode_figure

        if event.mode_shape is None:
            raise InputError(f"event: {event.kind} has no azimuthal mode; take a symmetry event")
        return mode_figure(event.mode_shape, event.contact_radius, self.unit_names)

    def plot(self, x: str = "load", y: str = "contact_radius", **options: Any) -> Figure:
        """Draw observable `y` against `x` with dashed unstable parts and marked events.

        The options are those of `contbranch.output.plot.bifurcation_diagram`: ``ax``, ``labels``, ``color``, ….
        """
        from contbranch.output.plot import bifurcation_diagram

        return bifurcation_diagram(self, x, y, **options)


@record
class Solution(State, Result):
    """The equilibrium that `solve` returns: a State, and where it comes from.

    Attributes
    ----------
    model : ModelChoice
    cost : Cost
    status, message : str
        The message says how many equilibria there are, if that is known.
    states : tuple of State
        The equilibria found, this one first; of all of them on request (``solve --all``), in order along the curve.
    control, stiffness : str, float or None
        Whose stability counts.
    accuracy : float
        What was asked.
    """

    format = "contbranch-solution"
    model: ModelChoice = described(default_factory=lambda: ModelChoice("axisymmetric", "", 0))
    cost: Cost = described(default_factory=lambda: Cost(0.0, 0))
    states: tuple[State, ...] = described(written=False, default=())
    control: str = described(written=False, default="load")
    stiffness: float | None = described(written=False, default=None)
    accuracy: float = described(written=False, default=1e-6)

    def told(self) -> str:
        """Where the state is."""
        return ", ".join(f"{name} {getattr(self, name):.7g}" for name in (*OBSERVABLES, "energy"))

    @property
    def known(self) -> tuple[State, ...]:
        """All states found, or this one; none where an interrupted search has not found any."""
        return self.states or (() if np.isnan(self.load) else (self,))

    def plot(self) -> Figure:
        """Draw gap and pressure against the radius; where the tip is not round, maps of gap, pressure and contact."""
        from contbranch.output.plot import draw

        return draw(self)

    def tables(self) -> Tables:
        """The states found, in the order of `known`."""
        return {"state": of_records(State, self.known, self.units)}

    def body(self) -> Values:
        """All states found, or this one."""
        told = {name: getattr(self, name) for name in ("model", "cost", "status", "message")}
        listed = (state.items() for state in self.known)
        return {"states": [{key: value for key, value in one.items() if key not in told} for one in listed], **told}
