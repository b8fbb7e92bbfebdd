"""Pseudo-arclength continuation of any problem F(x, p) = 0; it knows nothing of contact.

`trace_curve` follows the solution curve of a `Problem` in both directions and returns a `Curve` with its points,
folds, branch points and the user's events. The pieces (bordered solves, Newton's corrector, step control, location of
zeros along a curve) can be used by themselves.
"""

from contbranch.continuation.bordered import Bordered, SingularBorderedError, factorise
from contbranch.continuation.curve import (
    BranchPoint,
    Curve,
    End,
    EventPoint,
    Fold,
    HopfPoint,
    IndexChange,
    Located,
    Outcome,
    Point,
)
from contbranch.continuation.events import Crossing, Event, Extremum, Happening, TangentCrossing
from contbranch.continuation.folds import locate_fold
from contbranch.continuation.functions import other_solutions
from contbranch.continuation.locate import find_root
from contbranch.continuation.metric import Balance, Metric
from contbranch.continuation.newton import CorrectionError, correct
from contbranch.continuation.options import Options, StopAt
from contbranch.continuation.problem import Adaptation, Linearisation, Problem
from contbranch.continuation.segment import Segment
from contbranch.continuation.storage import load_curve
from contbranch.continuation.switching import switch_branch
from contbranch.continuation.trace import trace_curve
from contbranch.continuation.two_parameters import Cusp, FoldCurve, trace_folds

__all__ = [
    "Adaptation",
    "Balance",
    "Bordered",
    "BranchPoint",
    "CorrectionError",
    "Crossing",
    "Curve",
    "Cusp",
    "End",
    "Event",
    "EventPoint",
    "Extremum",
    "Fold",
    "FoldCurve",
    "Happening",
    "HopfPoint",
    "IndexChange",
    "Linearisation",
    "Located",
    "Metric",
    "Options",
    "Outcome",
    "Point",
    "Problem",
    "Segment",
    "SingularBorderedError",
    "StopAt",
    "TangentCrossing",
    "correct",
    "factorise",
    "find_root",
    "load_curve",
    "locate_fold",
    "other_solutions",
    "switch_branch",
    "trace_curve",
    "trace_folds",
]
