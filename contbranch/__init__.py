"""Continuation and bifurcation analysis of elastic contact with coexisting solutions.

Describe a contact (`Contact`: a tip, an interaction law, a modulus), then `trace` its whole curve of equilibria or
`solve` for one of them. Closed-form theories are in `contbranch.theory`, continuation of any problem in
`contbranch.continuation`.
"""

from contbranch._lazy import lazily

TYPE_CHECKING = False  # of `typing`, which takes as long to import as everything else here
if TYPE_CHECKING:
    from contbranch.advice import advise
    from contbranch.api import find_all, hysteresis, phase_diagram, solve, trace
    from contbranch.contact.contact import Contact
    from contbranch.contact.interactions import (
        Exponential,
        Gauss,
        Interaction,
        InverseSquare,
        Layered,
        MaugisDugdale,
        Response,
        Sum,
        Tabulated,
        VanDerWaals,
    )
    from contbranch.contact.tips import (
        Cone,
        EllipticParaboloid,
        HeightMap,
        Parabola,
        PowerLaw,
        Profile,
        SphericalCap,
        Tip,
        TipShape,
    )
    from contbranch.control import Spring
    from contbranch.curve.follow import follow
    from contbranch.errors import InputError, ModelError, Stop
    from contbranch.measure.fit import fit
    from contbranch.measure.force_curve import ForceCurve
    from contbranch.measure.maps import fit_map
    from contbranch.measure.reading import read_force_curve, read_force_curves
    from contbranch.models.axisymmetric.model import Axisymmetric
    from contbranch.models.exact.model import Exact
    from contbranch.models.grid.model import FreeSpace, Periodic
    from contbranch.models.grid.resolution import GridWarning
    from contbranch.output.hdf5 import load
    from contbranch.results.advice import Advice, Candidate
    from contbranch.results.diagram import Branch, Diagram, Event, Exponent, LocalExponent, Solution, State, Window
    from contbranch.results.equilibria import Barrier, Equilibria
    from contbranch.results.fit import Fit
    from contbranch.results.fit_map import FitMap
    from contbranch.results.followed import Followed, FollowedPoint, Special
    from contbranch.results.loop import Hysteresis
    from contbranch.results.phase import PhaseDiagram
    from contbranch.results.profile import CellFields
    from contbranch.results.sweep import Sweep, SweepTask
    from contbranch.sweeps.design import Design, varied
    from contbranch.sweeps.sweep import sweep

__version__ = "0.2.0"

__all__ = [
    "Advice",
    "Axisymmetric",
    "Barrier",
    "Branch",
    "Candidate",
    "CellFields",
    "Cone",
    "Contact",
    "Design",
    "Diagram",
    "EllipticParaboloid",
    "Equilibria",
    "Event",
    "Exact",
    "Exponent",
    "Exponential",
    "Fit",
    "FitMap",
    "Followed",
    "FollowedPoint",
    "ForceCurve",
    "FreeSpace",
    "Gauss",
    "GridWarning",
    "HeightMap",
    "Hysteresis",
    "InputError",
    "Interaction",
    "InverseSquare",
    "Layered",
    "LocalExponent",
    "MaugisDugdale",
    "ModelError",
    "Parabola",
    "Periodic",
    "PhaseDiagram",
    "PowerLaw",
    "Profile",
    "Response",
    "Solution",
    "Special",
    "SphericalCap",
    "Spring",
    "State",
    "Stop",
    "Sum",
    "Sweep",
    "SweepTask",
    "Tabulated",
    "Tip",
    "TipShape",
    "VanDerWaals",
    "Window",
    "advise",
    "find_all",
    "fit",
    "fit_map",
    "follow",
    "hysteresis",
    "load",
    "phase_diagram",
    "read_force_curve",
    "read_force_curves",
    "solve",
    "sweep",
    "trace",
    "varied",
]

__getattr__, __dir__ = lazily(
    __name__,
    {
        ".contact.contact": "Contact",
        ".contact.interactions": "Exponential Gauss Interaction InverseSquare Layered MaugisDugdale Response "
        "Sum Tabulated VanDerWaals",
        ".contact.tips": "Cone EllipticParaboloid HeightMap Parabola PowerLaw Profile SphericalCap Tip TipShape",
        ".control": "Spring",
        ".errors": "InputError ModelError Stop",
        ".advice": "advise",
        ".results.advice": "Advice Candidate",
        ".api": "find_all hysteresis phase_diagram solve trace",
        ".curve.follow": "follow",
        ".measure.fit": "fit",
        ".measure.maps": "fit_map",
        ".measure.force_curve": "ForceCurve",
        ".measure.reading": "read_force_curve read_force_curves",
        ".models.axisymmetric.model": "Axisymmetric",
        ".models.exact.model": "Exact",
        ".models.grid.model": "FreeSpace Periodic",
        ".models.grid.resolution": "GridWarning",
        ".output.hdf5": "load",
        ".results.diagram": "Branch Diagram Event Exponent LocalExponent Solution State Window",
        ".results.equilibria": "Barrier Equilibria",
        ".results.fit": "Fit",
        ".results.fit_map": "FitMap",
        ".results.followed": "Followed FollowedPoint Special",
        ".results.loop": "Hysteresis",
        ".results.phase": "PhaseDiagram",
        ".results.profile": "CellFields",
        ".results.sweep": "Sweep SweepTask",
        ".sweeps.design": "Design varied",
        ".sweeps.sweep": "sweep",
        ".contact": "",
        ".continuation": "",
        ".measure": "",
        ".models": "",
        ".output": "",
        ".results": "",
        ".theory": "",
    },
)
