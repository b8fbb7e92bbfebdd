"""The exact model: a parabola with Maugis-Dugdale attraction, whose equilibria are known in closed form."""

from typing import TYPE_CHECKING

from contbranch._lazy import lazily

if TYPE_CHECKING:
    from contbranch.models.exact.model import Exact as Exact

__getattr__, __dir__, __all__ = lazily(__name__, {".model": "Exact"})
