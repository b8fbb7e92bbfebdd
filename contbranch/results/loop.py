"""The result of a hysteresis loop: the quasi-static path, its jumps and the energy they dissipate. Plain data."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from contbranch.arrays import AnyArray, Array, Integers
from contbranch.results.diagram import Cost, ModelChoice, State
from contbranch.results.record import Record, Result, described, record
from contbranch.results.table import Tables, of_columns

if TYPE_CHECKING:
    from matplotlib.figure import Figure


@record
class Path(Record):
    """Stable states in the order in which they are passed, in the contact's units.

    Attributes
    ----------
    load, displacement, contact_radius, central_gap, energy : array (M,)
    position : array (M,)
        What is controlled: the load, the displacement, or the far end of the spring d + F/K.
    direction : integer array (M,)
        1 while it is raised, −1 while it is lowered.
    leg : integer array (M,)
        Number of the leg, from 0; between two legs there is a jump or the turn.
    """

    load: Array
    displacement: Array
    contact_radius: Array
    central_gap: Array
    energy: Array
    position: Array
    direction: Integers
    leg: Integers

    def __len__(self) -> int:
        return len(self.load)

    def __getitem__(self, name: str) -> AnyArray:
        found: AnyArray = getattr(self, name)
        return found


@record
class Jump(Record):
    """A jump at a fold; what it starts from is called ``from`` in documents and `start` here (``from`` is a keyword).

    Attributes
    ----------
    name : str or None
        Name of the fold: ``pull-off``, ``jump-in``, ``squeeze-out``, ``wetting``.
    position : float
        What is controlled, which does not change during the jump.
    start : State
        The fold.
    to : State or None
        Where overdamped relaxation from the fold ends; None: at infinite separation, or not reached if the loop is
        incomplete.
    dissipated : float or None
        Energy of contact and drive at the fold minus that after the jump; None where it has no bound.
    error : float or None
        Its error estimate.
    others : tuple of State
        Stable states of lower energy than the fold that the relaxation does not reach.
    area : float or None
        Area between the branches: ∫ (F_drive − F) dd along the curve, by quadrature, computed when asked for: a check
        of `dissipated`. Both agree to about the accuracy asked, relative to the energies of the contact: on the meshes
        along the way dV = F dd holds to their discretisation errors only, while `dissipated` needs the ends alone. None
        where there is no state after the jump, or no curve that joins it with the fold.
    """

    name: str | None
    position: float
    start: State = described(key="from")
    to: State | None
    dissipated: float | None
    error: float | None = described(unit="dissipated")
    others: tuple[State, ...] = described(written=False, default=(), repr=False)
    area: float | None = described(unit="dissipated", written=False, late=True, default=None)


# The document's key is a keyword of the language, which only getattr can spell.
setattr(Jump, "from", property(lambda jump: jump.start))


@record
class Hysteresis(Result):
    """A quasi-static loop under one control: what `contbranch.hysteresis` returns.

    Attributes
    ----------
    path : Path
    jumps : tuple of Jump
        In the order in which they happen.
    dissipated : float or None
        Energy dissipated in the whole loop; None where it does not close.
    error : float or None
        Its error estimate.
    closed : bool
        Whether the path comes back to where it started.
    model, cost, status, message
        As of a Diagram; the message says so where the loop does not close.
    control, stiffness : str, float or None
    area : float or None
        Work done by the drive over the closed loop, by quadrature along the stable legs, computed when asked for;
        equals `dissipated`. Where a leg is not found again between its rows, the change of energy takes its place.
    contact : Contact or None
    """

    format = "contbranch-loop"
    path: Path
    jumps: tuple[Jump, ...]
    dissipated: float | None
    error: float | None = described(unit="dissipated")
    closed: bool
    model: ModelChoice
    cost: Cost
    control: str
    stiffness: float | None = described(written="if known", default=None)
    area: float | None = described(unit="dissipated", written=False, late=True, default=None)

    def told(self) -> str:
        """Its jumps and what they dissipate."""
        jumps = ", ".join(f"{jump.name or 'jump'} at {jump.position:.7g}" for jump in self.jumps)
        return (jumps or "no jump") + ("" if self.dissipated is None else f"; dissipated {self.dissipated:.7g}")

    def tables(self) -> Tables:
        """The points of the path."""
        position = "load" if self.control == "load" else "displacement"
        return {"point": of_columns(self.path.items(), self.units, position=position)}

    def plot(self, x: str | None = None, y: str | None = None, **options: Any) -> Figure:
        """Draw the force curve and the contact radius along the loop, with arrows and jumps, or `y` against `x`.

        The options are those of `contbranch.output.plot_loop.loop_figure`: ``ax``.
        """
        from contbranch.output.plot_loop import loop_figure

        return loop_figure(self, x, y, **options)
