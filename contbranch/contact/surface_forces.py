"""Surface forces in the terms of their own field, as laws of `interactions` in other parameters.

Names, parameters and their dimensions are also those of contact files and of `Contact.physical`.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import NamedTuple

from contbranch.contact.interactions import Exponential, Interaction, InverseSquare, Layered
from contbranch.contact.units import finite_number, parse, positive_number
from contbranch.errors import InputError

__all__ = ["SURFACE_FORCES", "SurfaceForce", "hamaker", "hydration", "structural"]


def _read(value: object, dimension: str, name: str) -> float:
    """A number of the contact's units that is not zero."""
    number = parse(value, dimension, name)
    if number == 0.0:
        raise InputError(f"{name}: 0; must not be zero (without interaction, leave the law out)")
    return finite_number(number, name)


def _length(value: object, name: str) -> float:
    return positive_number(parse(value, "length", name), name)


def hamaker(hamaker_constant: float | str, cutoff: float | str = 0.165) -> InverseSquare:
    """Van der Waals forces of two half spaces, v = -A/(12π (D₀ + g)²): an inverse-square law.

    Parameters
    ----------
    hamaker_constant : float or str
        A, a number in nN·nm or a text such as ``"1e-20 J"``; negative where the medium between makes the bodies repel.
    cutoff : float or str
        D₀, the distance of the bodies in contact: 0.165 nm by default (J. Israelachvili, Intermolecular and Surface
        Forces).

    Returns
    -------
    InverseSquare
        With Δγ = A/(12π D₀²) and the range D₀.

    Raises
    ------
    InputError
        For a number or a unit that is not possible.
    """
    constant, distance = _read(hamaker_constant, "energy", "hamaker_constant"), _length(cutoff, "cutoff")
    return InverseSquare(constant / (12.0 * math.pi * distance**2), distance)


def hydration(amplitude: float | str, decay: float | str) -> Exponential:
    """Hydration force, v = W e^(-g/λ): an exponential law.

    Parameters
    ----------
    amplitude : float or str
        W, a number in nN/nm or a text such as ``"10 mJ/m^2"``; > 0 repels (hydration), < 0 attracts (hydrophobic).
    decay : float or str
        λ, a number in nm or a text.

    Raises
    ------
    InputError
        For a number or a unit that is not possible.
    """
    return Exponential(-_read(amplitude, "energy per area", "amplitude"), _length(decay, "decay"))


def structural(amplitude: float | str, period: float | str, decay: float | str) -> Layered:
    """Oscillatory structural force, v = W e^(-g/λ) cos(2π g/P): a layered law.

    Parameters
    ----------
    amplitude : float or str
        W, a number in nN/nm or a text; > 0 repels in contact.
    period, decay : float or str
        P, the size of a molecule, and λ, numbers in nm or texts.

    Raises
    ------
    InputError
        For a number or a unit that is not possible.
    """
    work, wavelength = -_read(amplitude, "energy per area", "amplitude"), _length(period, "period")
    return Layered(work, _length(decay, "decay"), wavelength)


class SurfaceForce(NamedTuple):
    """A function that makes a law, and the dimensions of its parameters."""

    make: Callable[..., Interaction]
    dimensions: Mapping[str, str]


SURFACE_FORCES: Mapping[str, SurfaceForce] = {
    "hamaker": SurfaceForce(hamaker, {"hamaker_constant": "energy", "cutoff": "length"}),
    "hydration": SurfaceForce(hydration, {"amplitude": "energy per area", "decay": "length"}),
    "structural": SurfaceForce(structural, {"amplitude": "energy per area", "period": "length", "decay": "length"}),
}
