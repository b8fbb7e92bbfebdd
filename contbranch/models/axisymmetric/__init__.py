"""The axisymmetric model: elasticity made diagonal by the Abel transform, on panels that follow the solution.

From the discretisation to the results: `mesh` (panels and the two Abel integrals), `rim` (how they depend on the
contact radius), `equations` (equilibrium, observables, stability), `adapt` (errors and meshes), `problem` (what the
continuation follows), `locate` (events to the accuracy asked), `near_touch` (tiny contacts), `marks` (folds along the
curve), `critical` (exponents), `modal`, `azimuthal` and `symmetry` (modes without axial symmetry), `profile`, `located`
(rows and events as one result), `trace`; on a traced curve `piece`, `crossing`, `solve`, `search` (what no curve
reaches), `arc`, `relaxation` and `paths` (hysteresis); with a second parameter `conditions`, `event_problem`,
`meetings`, `special` and `two_parameters`; `model`.
"""

from typing import TYPE_CHECKING

from contbranch._lazy import lazily

if TYPE_CHECKING:
    from contbranch.models.axisymmetric.model import Axisymmetric

__all__ = ["Axisymmetric"]

__getattr__, __dir__ = lazily(__name__, {".model": "Axisymmetric"})
