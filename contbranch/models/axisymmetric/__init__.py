"""The axisymmetric model: elasticity made diagonal by the Abel transform, on panels that follow the solution.

From the discretisation to the equilibria: `mesh` (panels and the two Abel integrals), `rim` (how they depend on the
contact radius), `equations` (equilibrium, observables, stability), `adapt` (errors and meshes), `problem` (what the
curve layer follows), `slope` (next to first touch), `modal` and `azimuthal` (modes without axial symmetry), `profile`,
`search` (what no curve reaches), `relaxation` (where a jump ends), `model`.
"""

from typing import TYPE_CHECKING

from contbranch._lazy import lazily

if TYPE_CHECKING:
    from contbranch.models.axisymmetric.model import Axisymmetric as Axisymmetric

__getattr__, __dir__, __all__ = lazily(__name__, {".model": "Axisymmetric"})
