"""Continuation and bifurcation analysis of elastic contact with coexisting solutions.

Describe a contact (`Contact`: a tip, an interaction law, a modulus), then `trace` its whole curve of equilibria or
`solve` for one of them. Closed-form theories are in `contbranch.theory`, continuation of any problem in
`contbranch.continuation`.
"""

from contbranch._lazy import lazily

TYPE_CHECKING = False  # of `typing`, which takes as long to import as everything else here
if TYPE_CHECKING:
    from contbranch.activation import activated as activated
    from contbranch.advice import advise as advise
    from contbranch.api import (
        find_all as find_all,
        hysteresis as hysteresis,
        phase_diagram as phase_diagram,
        solve as solve,
        trace as trace,
    )
    from contbranch.contact.bodies import Coating as Coating, ElasticLayer as ElasticLayer
    from contbranch.contact.contact import Contact as Contact
    from contbranch.contact.interactions import (
        DoubleLayer as DoubleLayer,
        Exponential as Exponential,
        Gauss as Gauss,
        Interaction as Interaction,
        InverseSquare as InverseSquare,
        Layered as Layered,
        LennardJones as LennardJones,
        MaugisDugdale as MaugisDugdale,
        Response as Response,
        Sum as Sum,
        Tabulated as Tabulated,
        VanDerWaals as VanDerWaals,
    )
    from contbranch.contact.surface_forces import hamaker as hamaker, hydration as hydration, structural as structural
    from contbranch.contact.tips import (
        Cone as Cone,
        EllipticParaboloid as EllipticParaboloid,
        HeightMap as HeightMap,
        Hyperboloid as Hyperboloid,
        Parabola as Parabola,
        PowerLaw as PowerLaw,
        Profile as Profile,
        SphericalCap as SphericalCap,
        Tip as Tip,
        TipShape as TipShape,
        WavySphere as WavySphere,
    )
    from contbranch.control import Spring as Spring
    from contbranch.curve.follow import follow as follow
    from contbranch.errors import InputError as InputError, ModelError as ModelError, Stop as Stop
    from contbranch.measure.fit import fit as fit
    from contbranch.measure.force_curve import ForceCurve as ForceCurve
    from contbranch.measure.maps import fit_map as fit_map
    from contbranch.measure.reading import read_force_curve as read_force_curve, read_force_curves as read_force_curves
    from contbranch.models.axisymmetric.model import Axisymmetric as Axisymmetric
    from contbranch.models.exact.model import Exact as Exact
    from contbranch.models.grid.model import FreeSpace as FreeSpace, Periodic as Periodic
    from contbranch.models.grid.resolution import GridWarning as GridWarning
    from contbranch.output.hdf5 import load as load
    from contbranch.results.activated import Activated as Activated, ActivatedJump as ActivatedJump
    from contbranch.results.advice import Advice as Advice, Candidate as Candidate
    from contbranch.results.diagram import (
        Branch as Branch,
        Diagram as Diagram,
        Event as Event,
        Exponent as Exponent,
        LocalExponent as LocalExponent,
        Solution as Solution,
        State as State,
        Window as Window,
    )
    from contbranch.results.equilibria import Barrier as Barrier, Equilibria as Equilibria
    from contbranch.results.fit import Fit as Fit
    from contbranch.results.fit_map import FitMap as FitMap
    from contbranch.results.followed import Followed as Followed, FollowedPoint as FollowedPoint, Special as Special
    from contbranch.results.loop import Hysteresis as Hysteresis
    from contbranch.results.phase import PhaseDiagram as PhaseDiagram
    from contbranch.results.profile import CellFields as CellFields
    from contbranch.results.sweep import Sweep as Sweep, SweepTask as SweepTask
    from contbranch.sweeps.design import Design as Design, varied as varied
    from contbranch.sweeps.sweep import sweep as sweep

__version__ = "0.2.0"

__getattr__, __dir__, __all__ = lazily(
    __name__,
    {
        ".contact.bodies": "Coating ElasticLayer",
        ".contact.contact": "Contact",
        ".contact.interactions": "DoubleLayer Exponential Gauss Interaction InverseSquare Layered "
        "LennardJones MaugisDugdale Response Sum Tabulated VanDerWaals",
        ".contact.surface_forces": "hamaker hydration structural",
        ".contact.tips": "Cone EllipticParaboloid HeightMap Hyperboloid Parabola PowerLaw Profile SphericalCap Tip "
        "TipShape WavySphere",
        ".control": "Spring",
        ".errors": "InputError ModelError Stop",
        ".advice": "advise",
        ".results.activated": "Activated ActivatedJump",
        ".results.advice": "Advice Candidate",
        ".api": "find_all hysteresis phase_diagram solve trace",
        ".activation": "activated",
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
