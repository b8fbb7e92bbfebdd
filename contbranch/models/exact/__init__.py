"""The exact model: a parabola with Maugis-Dugdale attraction, whose equilibria are known in closed form."""

from contbranch.models.exact.model import Exact, ExactCurve

__all__ = ["Exact", "ExactCurve"]
