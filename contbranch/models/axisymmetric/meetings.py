"""What happens along a followed event: it turns round, passes first touch, or meets other events."""

from __future__ import annotations

from collections.abc import Callable

from contbranch.continuation import Event, Point

from .conditions import rates
from .problem import COARSE
from .special import event_problem

__all__ = ["MESSAGES", "SPECIAL", "Inadmissible", "Meeting", "Touch", "Turn"]

# While following, the gap may be this much below zero (in ranges), as while tracing.
INADMISSIBLE = 1e-3
# Labels of points that are special, and what they mean.
SPECIAL = ("cusp", "touch", "coincidence", "load", "displacement")
MESSAGES = {
    "cusp": "Two folds merge: a cusp. The curve goes on as the other fold.",
    "pair": "Two events of this kind merge: the parameter has an extremum along them.",
    "coincidence": "Load and displacement have their folds at the same state, and with them every spring.",
    "meeting": "A fold of this control lies exactly at first touch.",
    "met": "A fold of this control lies at the same state.",
    "fold-through-touch": "The fold passes first touch: on one side it has contact, on the other none.",
    "cusp-at-touch": "Two folds, one with contact and one without, meet at first touch and end there: a kinked cusp.",
}


class Turn(Event):
    """The parameter turns round: two events merge."""

    name = "cusp"
    relative_resolution = COARSE

    def value(self, point: Point) -> float:
        """Component of the tangent."""
        return point.tangent_parameter


class Touch(Event):
    """First touch: from without at u = 0, from within at a small radius."""

    name = "touch"
    terminal = True
    hidden_pairs = False

    def __init__(self, beside: float) -> None:
        self.beside = beside

    def value(self, point: Point) -> float:
        """The contact coordinate, minus half of that at which curves start within."""
        w = float(point.x[-1])
        return w - 0.5 * self.beside if event_problem(point).contact else w


class Meeting(Event):
    """The rate of another control vanishes, too."""

    relative_resolution = COARSE

    def __init__(self, name: str, weights: Callable[[float], tuple[float, float]]) -> None:
        self.name, self.weights = name, weights

    def value(self, point: Point) -> float:
        """Weighted rates of load and displacement along the equilibria at fixed parameter."""
        first, second = self.weights(point.parameter)
        load, displacement = rates(event_problem(point).on_sheet(point.x, point.parameter))
        return first * load + second * displacement


class Inadmissible(Event):
    """The contact set stops being a disc."""

    name = "inadmissible"
    terminal = True
    hidden_pairs = False
    relative_resolution = COARSE

    def value(self, point: Point) -> float:
        """As `InadmissibleEvent` has it."""
        problem = event_problem(point)
        h, u = problem.split(point.x)
        member = problem.member(point.parameter)
        fields = member.fields(h, u)
        if problem.contact:
            return member.equations.admissibility(fields, member.scale) + INADMISSIBLE
        # Beyond first touch the gap is negative at the centre before the curve is cut there.
        return (float(fields.gap.min()) + max(fields.y, 0.0)) / member.scale + INADMISSIBLE
