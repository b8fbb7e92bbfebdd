"""What a model offers: its equilibria as a problem F(x, p) = 0, with what can be seen of them in the plane (d, F)."""

from __future__ import annotations

import math
from abc import abstractmethod
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, ClassVar, NamedTuple, Self

import numpy as np

from contbranch.continuation import Balance, Metric, Options, Point, Problem
from contbranch.continuation.newton import tangent_at
from contbranch.continuation.problem import Array
from contbranch.continuation.walk import annotated
from contbranch.control import Control
from contbranch.curve.tolerances import DEFECT_SAFETY
from contbranch.results.diagram import Cost, State
from contbranch.results.profile import ModeShape, Profile

if TYPE_CHECKING:
    from contbranch.contact.contact import Contact
    from contbranch.continuation import Event
    from contbranch.curve.outcome import RawEvent

__all__ = [
    "STEPS",
    "AstrayError",
    "Defect",
    "EquilibriumProblem",
    "Four",
    "Rates",
    "Search",
    "Succession",
    "Values",
    "Work",
    "alike",
    "equilibrium",
    "oriented",
    "rates_of",
    "values_of",
]

# Of load, displacement, contact radius and central gap.
Four = tuple[float, ...]

STEPS = Options(
    angle=0.3,
    angle_limit=0.8,
    tolerance=1e-9,
    noise=1e5,
    first_step=0.05,
    detect_folds=False,
    detect_branch_points=False,
    maximum_points=40_000,
)


# Error of a row, relative to max(1, |value|), below which its estimate by one Newton step does not tell.
ROW_FLOOR = 2e-8


class Values(NamedTuple):
    """What is seen of an equilibrium, reduced units."""

    load: float
    displacement: float
    contact_radius: float
    central_gap: float
    energy: float


class Rates(NamedTuple):
    """Derivatives of the observables along a direction of the curve."""

    load: float
    displacement: float
    contact_radius: float
    central_gap: float


class Defect(NamedTuple):
    """Signed discretisation errors of load and displacement, and the size of that of the state."""

    load: float
    displacement: float
    state: float

    def relative(self, values: Values) -> float:
        """The larger error of load and displacement, each relative to max(1, |value|)."""
        return max(
            abs(self.load) / max(1.0, abs(values.load)),
            abs(self.displacement) / max(1.0, abs(values.displacement)),
        )


@dataclass(frozen=True)
class Count:
    """Numbers of unstable azimuthal modes of one state.

    Attributes
    ----------
    modes : tuple of int
        n_1, n_2, … up to the last one that is not zero; cos mθ and sin mθ count as one.
    complete : bool
        Whether all larger m are known to be stable; otherwise the limit was reached.
    """

    modes: tuple[int, ...] = ()
    complete: bool = True

    @property
    def total(self) -> int:
        """Number of unstable modes of all m ≥ 1."""
        return sum(self.modes)

    def of(self, m: int) -> int:
        """n_m."""
        return self.modes[m - 1] if m <= len(self.modes) else 0


@dataclass
class Work:
    """What has been spent on one curve, counted by all its problems together."""

    newton: int = 0
    unknowns: int = 0

    def cost(self) -> Cost:
        """As results have it."""
        return Cost(0.0, self.newton)


@dataclass(frozen=True)
class Succession:
    """How a curve goes on behind the end of one problem.

    Attributes
    ----------
    kind : str
        Of the event there: ``"touch"``, ``"topology"``; empty where only the representation changes.
    event : Point
        Where: the last row of the problem that ends.
    starts : tuple of Point
        First point of the next problem, with its tangent along the curve; empty where it could not be found.
    same : bool
        Whether event and start are one equilibrium, which then is one row; otherwise both are rows.
    dropped : int
        Rows of the problem that ends to be forgotten before the event's row is appended.
    step : float or None
        Length of the first step as `EquilibriumProblem.balance` understands it.
    message : str
    margin : str
        What vanishes at the event, as a margin of the event's problem; empty: what ended the piece.
    others : callable
        Makes further starts, to be tried where the curve does not leave from the first.
    """

    kind: str
    event: Point
    starts: tuple[Point, ...]
    same: bool = True
    dropped: int = 1
    step: float | None = None
    message: str = ""
    margin: str = ""
    others: Callable[[], Iterable[Point]] = tuple

    def tried(self) -> Iterator[Point]:
        """The starts, and the others as long as they are asked for."""
        yield from self.starts
        yield from self.others()


@dataclass(frozen=True)
class Search:
    """Where equilibria off the curve are looked for.

    Attributes
    ----------
    problem : EquilibriumProblem
        On a coarse discretisation that can hold all that the curve's rows hold.
    starts : tuple of (state, parameter)
        From which to search, besides the rows.
    size : float
        What the norm of a state is measured in.
    """

    problem: EquilibriumProblem
    starts: tuple[tuple[Array, float], ...]
    size: float


class AstrayError(Exception):
    """A relaxation has come to rest at a state that is not on the curve.

    Parameters
    ----------
    state : State
        Reduced units.
    """

    def __init__(self, state: State) -> None:
        super().__init__()
        self.state = state


class EquilibriumProblem(Problem):
    """Equilibria of one contact in reduced units, as long as one representation serves: a piece of its curve.

    A model writes the equations (`residual`, `linearise`, `inner`, `dual`), what is seen of a state (`values`,
    `rates`, `unstable`, `profile`), where the representation ends and what goes on there (`margins`,
    `parameter_range`, `successor`), and how it is discretised (`finer`, `resolving`, `carried`, `defect`). The curve,
    its folds, indices, error estimates, paths and exponents are made of these in `contbranch.curve`.

    Attributes
    ----------
    scale : float
        Shortest length of the interaction: the unit in which lengths along the curve are measured.
    work : Work
    complete_by : str
        Why the curve holds every equilibrium there is, as the end of a sentence; empty where that is not known.
    refinable : bool
        Whether finer discretisations bring errors below the accuracy asked. Otherwise they are stated, rows lie as
        close as the discretisation lets them, and nothing is computed between them unless a value is asked there:
        lines between them need not show the curve. Stable states need not lie on the curve either, so that the
        relaxation from a fold is followed always.
    row_safety : float
        Factor of `defect` in the error estimates of rows.
    fold_resolution : float
        Share of a step within which folds are located; 0: rounding.
    """

    scale: float
    work: Work
    complete_by: ClassVar[str] = ""
    refinable: ClassVar[bool] = True
    row_safety: ClassVar[float] = DEFECT_SAFETY
    fold_resolution: ClassVar[float] = 0.0

    @property
    def convex(self) -> bool:
        """Whether the energy is: then there is one equilibrium for each value of a control, and no fold."""
        return False

    @property
    def pieced(self) -> bool:
        """Whether solutions have so many kinks that two discretisations may agree by chance."""
        return False

    @property
    def states_between(self) -> bool:
        """Whether states between rows are worth their cost where a path is drawn."""
        return True

    @property
    def has_family(self) -> bool:
        """Whether the discretisation serves other contacts, too: see `varied`."""
        own, base = type(self), EquilibriumProblem
        return own.member is not base.member or own.varied is not base.varied

    @property
    def described_to(self) -> float:
        """The central gap at which the contact's description ends, where its curve begins; infinite: nowhere."""
        return math.inf

    # -- the curve ----------------------------------------------------------------------------------------------------
    @abstractmethod
    def start(self, control: Control) -> Point:
        """The first equilibrium of the curve (without interaction, or next to it), along the way it is to be followed.

        Asked of the first problem of the chain only. A soft spring feels the interaction farther away.
        """

    @property
    def parameter_range(self) -> tuple[float, float]:
        """Parameters between which this representation holds; arriving at an edge is the event ``"edge"``."""
        return -np.inf, np.inf

    def steps(self, start: Point) -> Options:
        """Step control of the piece that begins at a point."""
        return STEPS

    def metric(self, x: Array) -> Metric:
        """Lengths along the curve at a state: of the state relative to itself, of the parameter in its own unit."""
        return Metric(math.sqrt(self.inner(x, x)) + self.scale, 1.0)

    def balance(self, start: Point, step: float | None = None) -> Balance:
        """Scales of state and parameter with which a piece begins: how far both will go, by the tangent.

        Parameters
        ----------
        step : float, optional
            `Succession.step`.
        """
        low, high = self.parameter_range
        slope, size = (math.sqrt(self.inner(v, v)) for v in (start.tangent_x, start.x))
        return Balance.ahead(slope, abs(start.tangent_parameter), size, start.parameter, high - low)

    def leaving(self, start: Point, step: float | None) -> Point:
        """The start with a tangent that the first step is a share of: `Options.first_step`."""
        return start

    def margins(self, x: Array, p: float) -> Mapping[str, float]:
        """Signed distances, positive as long as this representation holds; the curve is cut where one vanishes."""
        return {}

    @property
    def kinked(self) -> bool:
        """Whether the stiffness of the interaction jumps somewhere."""
        return False

    def margin(self, x: Array, p: float, name: str) -> float:
        """A margin, or another distance of the problem's that names an event."""
        return self.margins(x, p)[name]

    def successor(self, name: str, points: Sequence[Point]) -> Succession | None:
        """What goes on behind the margin (or ``"edge"``) of that name, reached by the last of the piece's points.

        None: nothing, the curve ends there. `ending` says why.

        Raises
        ------
        ModelError
            If it could not be found.
        """
        return None

    def cause(self, name: str, point: Point) -> str:
        """What a margin that fails at a point stands for there: by default itself."""
        return name

    def ending(self, name: str, point: Point) -> str:
        """Why a curve ends at a point; `name` is a margin, "end", or empty if it could not be followed."""
        return ""

    @property
    def contact_gap(self) -> float:
        """The central gap below which a film counts as contact: that of the law's repulsive core, if it has one."""
        return 0.0

    @property
    def wall_gap(self) -> float:
        """The least gap: 0 unless the law has a soft core."""
        return 0.0

    def endures(self, point: Point) -> bool:
        """Whether no load that can be computed leads from a state without contact to a fold, or to contact."""
        return False

    @property
    def cornered(self) -> bool:
        """Whether the curve has corners between rows, so that nothing is interpolated there."""
        return False

    def corners_between(self, begin: Point, end: Point) -> int:
        """How many corners lie between two points next to each other on the curve."""
        return 0

    def before(self, control: Control, value: float) -> Point | None:
        """An equilibrium close to the one with a value of a control farther away than the start; None without."""
        return None

    def joins(self, other: EquilibriumProblem) -> bool:
        """Whether the other problem's states are states of this representation, on a discretisation of their own."""
        return type(other) is type(self) and other.parameter_range == self.parameter_range

    # -- what is seen -------------------------------------------------------------------------------------------------
    @abstractmethod
    def values(self, x: Array, p: float) -> Values:
        """Load, displacement, contact radius, central gap, energy."""

    @abstractmethod
    def rates(self, x: Array, p: float, x_rate: Array, p_rate: float) -> Rates:
        """Derivatives of load, displacement, contact radius and central gap along a direction, exact."""

    @property
    def grain(self) -> float:
        """Length along the curve within which it tells no curvature."""
        return 0.0

    @property
    def countable(self) -> bool:
        """Whether the unstable modes of its states are those of the contact."""
        return True

    @abstractmethod
    def unstable(self, x: Array, p: float) -> int:
        """Morse index at fixed displacement for axisymmetric modes, by inertia or eigenvalues of the second variation.

        It is asked at a few points, as a check and where the way along the curve leaves two answers open.
        """

    def azimuthal(self, x: Array, p: float, unstable: int, limit: int = 32, near: Sequence[int] = ()) -> Count | None:
        """Numbers of unstable modes cos mθ, m = 1 … limit; None where the model does not examine them.

        Parameters
        ----------
        unstable : int
            Morse index at fixed displacement.
        near : sequence of int
            A guess: n_1, n_2, … of a neighbouring state.
        """
        return None

    @property
    def tells_modes(self) -> bool:
        """Whether eigenvalues of azimuthal modes are known, and not only how many are unstable."""
        return type(self).mode_eigenvalue is not EquilibriumProblem.mode_eigenvalue

    def mode_eigenvalue(self, x: Array, p: float, mode: int, index: int = 1) -> float:
        """An eigenvalue of an azimuthal mode, counted from the largest: the mode is unstable where it exceeds 1."""
        raise NotImplementedError

    def variations(self, x: Array, p: float, mode: int, index: int = 1) -> str:
        """What the mode of that eigenvalue is called."""
        return f"variations cos({mode}θ)"

    def mode_shape(self, x: Array, p: float, mode: int, index: int = 1) -> ModeShape:
        """Gap and pressure of the mode of that eigenvalue."""
        raise NotImplementedError

    @abstractmethod
    def profile(self, x: Array, p: float) -> Profile:
        """Gap and pressures over the radius."""

    def described(self, x: Array, p: float) -> Mapping[str, Any]:
        """Further fields of a `State`."""
        return {}

    def observables(self, x: Array, p: float) -> Mapping[str, float]:
        """The values, by name."""
        return self.values(x, p)._asdict()

    # -- discretisations ----------------------------------------------------------------------------------------------
    def finer(self) -> Self:
        """The same problem with errors smaller by orders; itself where there is nothing to refine."""
        return self

    def compared(self) -> Self:
        """The discretisation with which single states are compared for their errors."""
        return self.finer()

    def stated(self, point: Point, event: Event | None) -> Four | None:
        """Errors of load, displacement, radius and gap of an event that needs no refinement; None: see `finer`.

        Parameters
        ----------
        event : Event or None
            None: the point itself.
        """
        return None

    def left_out(self, x: Array, p: float) -> Four:
        """Errors of load, displacement, radius and gap that finer discretisations have, too."""
        return 0.0, 0.0, 0.0, 0.0

    def energy_left_out(self, x: Array, p: float) -> float:
        """Error of the energy that finer discretisations have, too; states near each other have it in common."""
        return 0.0

    def energy_scatter(self, x: Array, p: float) -> float:
        """Error of V − F d that finer discretisations do not tell, and that states near each other do not share."""
        return 0.0

    def row_error(self, point: Point) -> tuple[float, float]:
        """Error estimates of load and displacement at a row, from `defect`."""
        own, left_out = point.observables, self.left_out(point.x, point.parameter)
        values = np.array([own["load"], own["displacement"]])
        floor = ROW_FLOOR if self.finer() is not self else self.rounding
        error = self.row_safety * np.abs(self.defect(point)[:2]) + floor * np.maximum(1.0, np.abs(values))
        load, displacement = (error + left_out[:2]).tolist()
        return load, displacement

    def error_rows(self, count: int) -> Sequence[int]:
        """Which of so many rows are asked for their errors; between them the larger one of both sides counts."""
        return range(count)

    def counted_rows(self, folds: Sequence[int], last: int) -> list[list[int]]:
        """Groups of rows of which one is to have the Morse index that the folds say, counted by inertia.

        Parameters
        ----------
        folds : sequence of int
            Their rows.
        last : int
            The last row.
        """
        return [[last]] if last else []

    def judged(
        self, events: Sequence[RawEvent], points: Sequence[Point], controls: Sequence[Control]
    ) -> list[RawEvent]:
        """Events with what is known of them on other discretisations."""
        return list(events)

    def halved(self, point: Point, share: float) -> Self:
        """The same problem with panels halved where a state is not smooth, until its error is that share of itself.

        With a share of 0 all of them. By default `finer`.
        """
        return self.finer()

    def doubled(self) -> Self:
        """The same problem on twice as many panels with other edges; itself where that is too large, or unknown."""
        return self

    def carried(self, vector: Array, x: Array, p: float, other: Self) -> Array:
        """A state or direction at (x, p) on another discretisation of the same problem; a state is x itself."""
        return vector

    def resolving(self, point: Point, tolerance: float) -> Self:
        """A discretisation made for a state; itself where it serves.

        Parameters
        ----------
        point : Point
            Of this problem.
        tolerance : float
            Error wanted of load and displacement, relative to max(1, |value|).
        """
        return self

    def defect(self, point: Point) -> Defect:
        """Estimated discretisation errors of a point: of its load and displacement, and of its state."""
        return Defect(0.0, 0.0, 0.0)

    @property
    def size(self) -> int:
        """Number of unknowns, where it can be refined."""
        return 1

    @property
    def rounding(self) -> float:
        """Rounding errors of values, relative to max(1, |value|)."""
        return 4e-14

    # -- off the curve ------------------------------------------------------------------------------------------------
    def gradients(self, x: Array, p: float) -> tuple[Array, Array]:
        """Derivatives of load and displacement with respect to the state, (n,) each; a search asks for them."""
        rates = [self.rates(x, p, unit, 0.0) for unit in np.eye(len(x))]
        return np.array([rate.load for rate in rates]), np.array([rate.displacement for rate in rates])

    def search(self, points: Sequence[Point]) -> Search | None:
        """Where to look for equilibria off the curve, given its rows in this representation; None: nowhere."""
        return None

    def relaxes_to(self, other: EquilibriumProblem) -> bool:
        """Whether `relaxed` may come to rest at states of another problem."""
        return type(other) is type(self)

    def relaxed(self, fold: Point, control: Control, direction: int, others: Sequence[Point]) -> int | None:
        """Which of several stable states overdamped relaxation from a fold reaches; None where that cannot be told.

        Parameters
        ----------
        fold : Point
            Of this problem.
        control : Control
            Held at its value at the fold.
        direction : int
            1 if the fold was reached by raising the control, −1 by lowering it.
        others : sequence of Point
            Of problems of the same class.

        Raises
        ------
        AstrayError
            If it comes to rest at a state that is none of them.
        """
        return None

    def rows_within(self, tolerance: float) -> Self:
        """The first problem of the chain with rows as accurate as this, as far as round-off allows."""
        return self

    # -- families -----------------------------------------------------------------------------------------------------
    def member(self, contact: Contact, tolerance: float | None = None) -> Self:
        """The same discretisation for another contact, with the parameter meaning the same.

        Parameters
        ----------
        contact : Contact
            In one set of reduced units for the whole family, so that its own scales need not be 1.
        tolerance : float, optional
            Error of load and displacement that `adapt` allows from now on.
        """
        raise NotImplementedError

    def varied(self, contact: Contact) -> EquilibriumProblem:
        """The same equations, states and parameter for a contact that differs a little; by default the `member`."""
        return self.member(contact)

    @property
    def power(self) -> float:
        """m where load and displacement are smooth functions of p^(1/m) next to p = 0."""
        return 1.0

    @property
    def beyond_edge(self) -> bool:
        """Whether the equations go on smoothly beyond the edges of the parameter, so that states there are defined."""
        return False

    def across(self, x: Array, p: float) -> Sequence[Point]:
        """A state at an edge of the parameter as one of the problem behind it, with its tangent in either sense.

        Further ones are tried where the curve does not leave from the first; none where nothing is known.
        """
        return ()


def equilibrium(point: Point) -> EquilibriumProblem:
    """The problem of a point of a contact's curve.

    Raises
    ------
    TypeError
        If it is not an `EquilibriumProblem`.
    """
    problem = point.problem
    if isinstance(problem, EquilibriumProblem):
        return problem
    raise TypeError(f"{type(problem).__name__} is not an EquilibriumProblem")


def values_of(point: Point) -> Values:
    """What is seen of a point's state."""
    return equilibrium(point).values(point.x, point.parameter)


def rates_of(point: Point) -> Rates:
    """The rates of that along the unit tangent."""
    return equilibrium(point).rates(point.x, point.parameter, point.tangent_x, point.tangent_parameter)


def alike(values: Values, one: Rates, other: Rates) -> bool:
    """Whether load, displacement and contact radius of a state change in one sense in two directions."""
    scale = np.array([max(1.0, abs(values.load)), max(1.0, abs(values.displacement)), 1.0])
    return float((np.array(one[:3]) / scale) @ (np.array(other[:3]) / scale)) >= 0


def oriented(problem: EquilibriumProblem, x: Array, p: float, direction: tuple[Array, float]) -> Point:
    """The point with its unit tangent, along the direction given rather than against it."""
    u, a, _ = tangent_at(problem, x, p)
    along = problem.inner(u, direction[0]) + a * direction[1]
    sign = 1.0 if along >= 0 else -1.0
    return annotated(Point(problem, x, p, sign * u, sign * a), label="start")
