"""Settings of a trace."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

from contbranch.continuation.curve import Point
from contbranch.errors import InputError


@dataclass(frozen=True)
class Options:
    """Settings of a trace; lengths are relative to the path over about the last ten steps, see `Balance`.

    Attributes
    ----------
    angle : float
        Angle (radians) between the tangents at both ends of a step that the step control aims at.
    angle_limit : float
        Steps with a larger angle between tangents, or between a tangent and the chord, are repeated shorter.
    first_step : float
        Length of the first step: a share of the width of the parameter range (or of max(1, |p|) where it is infinite).
    smallest_step : float
        Steps below this length are given up.
    growth : float
        Largest ratio of a step to the one before.
    largest_parameter_step : float
        Largest change of the parameter in a step, as a share of the width of the range (if that is finite).
    weight : float
        Weight of the parameter against the state in lengths and angles; 1 treats their recent paths alike.
    state_floor : float
        Changes of the state (in the norm of `Problem.inner`) far below this do not shorten steps: for curves that start
        where the state is all but zero and grows exponentially.
    tolerance : float
        Error allowed in the corrected points, relative to the recent path.
    noise : float
        Where Newton's corrections no longer contract, those below this multiple of rounding, relative to the state, are
        taken for rounding: larger for ill-conditioned problems.
    patience : int
        First Newton corrections that need not contract: for points on which more depends than the length of a step.
    maximum_points : int
        Largest number of steps in each direction.
    edge_tolerance : float
        A curve that comes this close to an edge (as a share of the range's width) without crossing it ends there.
    detect_folds, detect_branch_points : bool
        What to look for besides the user's events. Branch points show in the sign of a determinant, which a Jacobian
        without matrix does not tell: with a LinearOperator none are found.
    """

    angle: float = 0.3
    angle_limit: float = 0.8
    first_step: float = 0.02
    smallest_step: float = 1e-9
    growth: float = 3.0
    largest_parameter_step: float = 0.2
    weight: float = 1.0
    state_floor: float = 0.0
    tolerance: float = 1e-10
    noise: float = 1e3
    patience: int = 0
    maximum_points: int = 10_000
    edge_tolerance: float = 1e-9
    detect_folds: bool = True
    detect_branch_points: bool = True

    def __post_init__(self) -> None:
        positive = ("angle", "angle_limit", "first_step", "smallest_step", "largest_parameter_step", "weight")
        for name in (*positive, "tolerance", "edge_tolerance", "noise"):
            value = getattr(self, name)
            if not (math.isfinite(value) and value > 0):
                raise InputError(f"Options.{name} is {value!r}: give a positive number.")
        if not (math.isfinite(self.state_floor) and self.state_floor >= 0):
            raise InputError(f"Options.state_floor is {self.state_floor!r}: give a number that is not negative.")
        if not self.angle < self.angle_limit <= math.pi / 2:
            raise InputError(f"Options.angle_limit is {self.angle_limit!r}: give a number in (angle, pi/2].")
        if not self.growth > 1:
            raise InputError(f"Options.growth is {self.growth!r}: give a number above 1.")
        if not self.maximum_points >= 1:
            raise InputError(f"Options.maximum_points is {self.maximum_points!r}: give a positive integer.")


@dataclass(frozen=True)
class StopAt:
    """Conditions that end a curve before the edge of the parameter range; each direction counts for itself.

    Attributes
    ----------
    folds : int, optional
        End at this fold, counted from the start: 1 is the first.
    predicate : callable, optional
        End at the first accepted point for which it is true; it is given the `Point`.
    """

    folds: int | None = None
    predicate: Callable[[Point], bool] | None = None

    def __post_init__(self) -> None:
        if self.folds is not None and self.folds < 1:
            raise InputError(f"StopAt.folds is {self.folds!r}: give a positive integer.")
