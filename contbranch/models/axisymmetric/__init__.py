"""The axisymmetric model: elasticity made diagonal by the Abel transform, on panels that follow the solution.

From the discretisation to the results: `mesh` (panels and the two Abel integrals), `rim` (how they depend on the
contact radius), `equations` (equilibrium, observables, stability), `adapt` (errors and meshes), `problem` (what the
continuation
follows), `locate` (events to the accuracy asked), `critical` (exponents), `profile`, `trace`, `solve`, `model`.
"""

from .model import Axisymmetric

__all__ = ["Axisymmetric"]
