"""Layered elastic bodies in place of the half space: how the surface answers a wave of pressure.

A pressure of wavenumber q displaces the surface by 2 S(qH)/(E q) times itself, with the thickness H of the layer; S = 1
for a half space, and for qH → ∞. Limits for q → 0: S = S(0) + S'(0) qH.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, fields, replace
from functools import cached_property
from typing import Any, ClassVar, Self

import numpy as np
import scipy
from numpy.typing import ArrayLike

from contbranch.arrays import Array
from contbranch.contact.units import finite_number, make_positive
from contbranch.errors import InputError

__all__ = ["Body", "Coating", "ElasticLayer", "body_of"]

# Wavenumber times thickness beyond which S is 1 to rounding, and Gauss nodes below, at least and for every thickness of
# distance; places between which what a layer adds to a point force's displacement is interpolated, to 1e-9 of itself.
END, WAVES, PLACES = 25.0, (64, 15.0), 1500
# Step of the difference that gives S'(0): S is known to rounding.
STEP = 1e-4


def _poisson(part: object, name: str) -> None:
    """Replace a field of a frozen dataclass by a float; InputError unless it may be Poisson's ratio."""
    value = finite_number(getattr(part, name), name)
    if not -1.0 < value <= 0.5:
        raise InputError(f"{name}: {value:g}; Poisson's ratio must be above -1 and at most 0.5")
    object.__setattr__(part, name, value)


@dataclass(frozen=True)
class Body:
    """A layer of a thickness; subclasses write `response`."""

    dimensions: ClassVar[dict[str, str]] = {
        "thickness": "length", "base": "text", "substrate_modulus": "pressure",
    }  # fmt: skip

    thickness: float
    poisson: float

    def __post_init__(self) -> None:
        make_positive(self, "thickness")
        _poisson(self, "poisson")

    def response(self, x: ArrayLike) -> Array:
        """Return S(x), x = qH, of any shape, where the layer's effective modulus is 1."""
        raise NotImplementedError(f"{type(self).__name__} must define response(x)")

    def waves(self, reach: float) -> tuple[Array, Array]:
        """Return wavenumbers q and weights (S - 1) dq of integrals over q that resolve cos(qt) up to a distance t."""
        x, w = np.polynomial.legendre.leggauss(WAVES[0] + math.ceil(WAVES[1] * reach / self.thickness))
        half = 0.5 * END / self.thickness
        return half * (x + 1.0), half * w * (self.response(0.5 * END * (x + 1.0)) - 1.0)

    def added(self, r: Array) -> Array:
        """Return what the layer adds to 1/(πr), the displacement at a distance from a unit point force, for E = 1.

        (1/π) ∫_0^∞ (S(qH) - 1) J0(qr) dq, which is smooth.
        """
        places = np.linspace(0.0, 1.0, PLACES) ** 2 * float(r.max())
        q, weights = self.waves(float(places[-1]))
        values = scipy.special.j0(np.multiply.outer(places, q)) @ weights
        return np.asarray(scipy.interpolate.CubicSpline(places, values)(r) / math.pi)

    @cached_property
    def far(self) -> float:
        """S(0), the compliance of a half space far below over that of the layer; 0 on a rigid base."""
        return float(self.response(np.array(0.0)))

    @cached_property
    def mean(self) -> float:
        """S'(0), half the displacement by a uniform pressure in units of pH/E, less that of the half space below."""
        ahead, behind = (float(one) for one in self.response(np.array([STEP, -STEP])))
        return 0.5 * (ahead - behind) / STEP

    def scaled(self, in_plane: float, modulus: float) -> Self:
        """Return the body in other units, worth `in_plane` (lengths) and `modulus` of the present ones."""
        return replace(self, thickness=self.thickness / in_plane)

    def parameters(self) -> dict[str, Any]:
        """Return the fields from which the body can be made again, by name."""
        return {item.name: getattr(self, item.name) for item in fields(self)}


@dataclass(frozen=True)
class ElasticLayer(Body):
    """An elastic layer on a rigid base.

    S as by E. K. Dimitriadis et al., Biophys. J. 82, 2798 (2002), and K. L. Johnson, Contact Mechanics, section 5.8.

    Attributes
    ----------
    thickness
        H > 0, a length.
    poisson
        Poisson's ratio ν of the layer.
    base
        ``"bonded"``: the layer does not move where it meets the base; ``"frictionless"``: it slides there.
    """

    base: str = "bonded"

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.base not in ("bonded", "frictionless"):
            raise InputError(f"base: {self.base!r}; must be 'bonded' or 'frictionless'")

    def response(self, x: ArrayLike) -> Array:
        """Return S: (2κ sinh 2x - 4x)/(2κ cosh 2x + 4x² + 1 + κ²) with κ = 3 - 4ν of a bonded layer, (cosh 2x - 1)/
        (sinh 2x + 2x) of a frictionless one."""
        x = np.asarray(x, dtype=float)
        size = np.abs(x)
        decay = np.exp(-2.0 * size)
        if self.base == "frictionless":
            double = np.where(size > 0.0, size, 1.0)
            found = np.expm1(-2.0 * size) ** 2 / (-np.expm1(-4.0 * double) + 4.0 * double * decay)
        else:
            kappa = 3.0 - 4.0 * self.poisson
            found = (-kappa * np.expm1(-4.0 * size) - 4.0 * size * decay) / (
                kappa * (1.0 + decay**2) + (4.0 * size**2 + 1.0 + kappa**2) * decay
            )
        return np.asarray(np.copysign(found, x))


@dataclass(frozen=True)
class Coating(Body):
    """A layer bonded to an elastic half space.

    S by D. M. Burmister, Trans. Am. Soc. Civ. Eng. 110 (1945).

    Attributes
    ----------
    thickness, poisson
        Of the layer. The contact's modulus is the effective one of the layer.
    substrate_modulus
        Effective modulus > 0 of the half space.
    substrate_poisson
        Its Poisson's ratio.
    """

    substrate_modulus: float
    substrate_poisson: float

    def __post_init__(self) -> None:
        super().__post_init__()
        make_positive(self, "substrate_modulus")
        _poisson(self, "substrate_poisson")

    def response(self, x: ArrayLike) -> Array:
        """Return S = [1 + 4κx e⁻²ˣ - λκ e⁻⁴ˣ]/[1 - (λ + κ + 4κx²) e⁻²ˣ + λκ e⁻⁴ˣ] with the ratio of shear moduli μ,
        κ = (μ - 1)/(μ + 3 - 4ν₁) and λ = 1 - 4(1 - ν₁)/(1 + μ(3 - 4ν₂))."""
        x = np.asarray(x, dtype=float)
        ratio = (1.0 - self.poisson) / (self.substrate_modulus * (1.0 - self.substrate_poisson))
        kappa = (ratio - 1.0) / (ratio + 3.0 - 4.0 * self.poisson)
        lam = 1.0 - 4.0 * (1.0 - self.poisson) / (1.0 + ratio * (3.0 - 4.0 * self.substrate_poisson))
        decay = np.exp(-2.0 * x)
        upper = 1.0 + 4.0 * kappa * x * decay - lam * kappa * decay**2
        return np.asarray(upper / (1.0 - (lam + kappa + 4.0 * kappa * x**2) * decay + lam * kappa * decay**2))

    def scaled(self, in_plane: float, modulus: float) -> Coating:
        """Return the body in other units."""
        substrate = self.substrate_modulus / modulus
        return replace(self, thickness=self.thickness / in_plane, substrate_modulus=substrate)


def body_of(values: dict[str, Any]) -> ElasticLayer | Coating | None:
    """Return the body of parameters; None if there are none. It is a coating if there is a substrate."""
    if not values:
        return None
    kind = Coating if any(name.startswith("substrate") for name in values) else ElasticLayer
    known = [item.name for item in fields(kind)]
    for name in values:
        if name not in known:
            raise InputError(f"{name}: not of a {kind.__name__}; it has {', '.join(known)}")
    for name in ("thickness", "poisson", *(known[2:] if kind is Coating else ())):
        if name not in values:
            raise InputError(f"{name}: missing; {kind.__name__} needs it")
    return kind(**values)
