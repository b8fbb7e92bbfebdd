"""What the exact model returns, as plain data in reduced units."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from contbranch.theory._inputs import FloatArray

__all__ = ["ExactEvent", "ExactProfile", "ExactState", "ExactStates"]


class ExactState(NamedTuple):
    """One equilibrium, in reduced units; the fields are those of `ExactStates`."""

    parameter: float
    load: float
    displacement: float
    contact_radius: float
    interaction_radius: float
    rim_angle: float
    central_gap: float
    energy: float
    unstable_load: int
    unstable_displacement: int


class ExactStates(NamedTuple):
    """Equilibria as arrays of one length, in reduced units.

    Attributes
    ----------
    parameter : array
        The parameter s of `contbranch.models.exact.curve`.
    load, displacement, contact_radius, interaction_radius, rim_angle, central_gap, energy : array
        As in `contbranch.theory.maugis.Curve`.
    unstable_load, unstable_displacement : array of int
        Morse indices for azimuthal mode 0 under load and under displacement control. A fold itself counts as stable
        under its control; beyond the range the load does not depend on the displacement, and neutral counts as
        stable.
    """

    parameter: FloatArray
    load: FloatArray
    displacement: FloatArray
    contact_radius: FloatArray
    interaction_radius: FloatArray
    rim_angle: FloatArray
    central_gap: FloatArray
    energy: FloatArray
    unstable_load: NDArray[np.int64]
    unstable_displacement: NDArray[np.int64]

    def state(self, index: int) -> ExactState:
        """Return one of them as plain numbers."""
        return ExactState(*(column[index].item() for column in self))


class ExactEvent(NamedTuple):
    """A fold or first touch.

    Attributes
    ----------
    kind : {"fold", "touch"}
        The edge of the interaction, d = -z0, is the fold named jump-in.
    control : {"load", "displacement", "spring"} or None
        Control whose fold it is; None for a touch.
    name : {"pull-off", "jump-in"} or None
        Name of the fold; None for a touch.
    state : ExactState
        The equilibrium itself.
    error : mapping of str to float
        Bounds of the round-off errors of load, displacement, contact_radius and central_gap.
    """

    kind: Literal["fold", "touch"]
    control: Literal["load", "displacement", "spring"] | None
    name: Literal["pull-off", "jump-in"] | None
    state: ExactState
    error: Mapping[str, float]


class ExactProfile(NamedTuple):
    """Gap, total pressure and the wall's share of it over the distance r from the axis, in reduced units."""

    r: FloatArray
    gap: FloatArray
    pressure: FloatArray
    wall_pressure: FloatArray
