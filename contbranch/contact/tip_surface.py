"""Tips without axial symmetry whose surface is a formula."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

import numpy as np
from numpy.typing import ArrayLike

from contbranch.arrays import Array
from contbranch.contact.tip_shape import TipShape
from contbranch.contact.units import make_positive

if TYPE_CHECKING:
    from contbranch.contact.tips import Parabola


@dataclass(frozen=True)
class EllipticParaboloid(TipShape):
    """z = x²/(2 R_x) + y²/(2 R_y): two crossed cylinders, a barrel, any smooth summit.

    In reduced units the mean radius R = √(R_x R_y) is 1, (23)-(26).

    Attributes
    ----------
    radius_x, radius_y
        R_x, R_y > 0, the principal radii of curvature along x and y, lengths.
    """

    name = "elliptic-paraboloid"
    dimensions: ClassVar[Mapping[str, str]] = {"radius_x": "length", "radius_y": "length"}

    radius_x: float
    radius_y: float

    def __post_init__(self) -> None:
        make_positive(self, *self.parameters())

    @property
    def axisymmetric(self) -> Parabola | None:
        """The parabola of the same radius if the two radii are equal; otherwise None."""
        if self.radius_x != self.radius_y:
            return None
        from contbranch.contact.tips import Parabola  # which lists this shape among all others

        return Parabola(self.radius_x)

    @property
    def mirror_symmetric(self) -> bool:
        """True."""
        return True

    @property
    def natural_length(self) -> float:
        """R = √(R_x R_y)."""
        return math.sqrt(self.radius_x) * math.sqrt(self.radius_y)

    def surface(self, x: ArrayLike, y: ArrayLike) -> Array:
        """Return x²/(2 R_x) + y²/(2 R_y)."""
        return np.square(x) / (2.0 * self.radius_x) + np.square(y) / (2.0 * self.radius_y)

    def scaled(self, in_plane: float, normal: float) -> EllipticParaboloid:
        """Return the paraboloid in other units."""
        factor = normal / in_plane**2
        return EllipticParaboloid(self.radius_x * factor, self.radius_y * factor)
