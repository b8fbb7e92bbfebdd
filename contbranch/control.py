"""What is controlled: the load, the displacement, or the far end of a spring. One formulation for all stiffnesses.

The far end of a spring of stiffness K is at D = d + F/K. K = 0 is load control and K = ∞ displacement control: the
folds are where ``F' + K d'`` vanishes along the curve, and an equilibrium has one unstable direction more than with its
displacement held where ``dF/dd + K < 0``.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Any, Literal

from contbranch.contact.units import PHYSICAL, Units, parse, positive_number
from contbranch.errors import InputError, nearest

Kind = Literal["load", "displacement", "spring"]


@dataclass(frozen=True)
class Spring:
    """Control by the far end of a spring: an AFM's cantilever, the spring of an SFA, the frame of a testing machine.

    Attributes
    ----------
    stiffness : float
        K > 0, a load per displacement in the contact's units (nN/nm for a physical contact), or a text with a unit such
        as ``"0.5 N/m"`` for a physical contact.
    quantity : bool
        Whether it was given with a unit, which a contact in reduced units cannot have.
    """

    stiffness: float
    quantity: bool = field(default=False, init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "quantity", isinstance(self.stiffness, str))
        number = parse(self.stiffness, "stiffness", "stiffness")
        if number <= 0.0:
            raise InputError(f"stiffness: {number:g}; must be greater than zero (0 is load control)")
        object.__setattr__(self, "stiffness", number)


@dataclass(frozen=True)
class Control:
    """A control in the units of whoever uses it.

    Attributes
    ----------
    kind : {"load", "displacement", "spring"}
    stiffness : float
        K; 0 for load and infinite for displacement control.
    """

    kind: Kind
    stiffness: float

    @property
    def weights(self) -> tuple[float, float]:
        """Weights w with w·(F, d) the controlled quantity up to a positive factor: (1, K)/√(1 + K²)."""
        if self.kind == "displacement":
            return 0.0, 1.0
        norm = math.hypot(1.0, self.stiffness)
        return 1.0 / norm, self.stiffness / norm

    def weighted(self, load: float, displacement: float) -> float:
        """``w·(F, d)``: what is controlled up to a positive factor; of rates, the rate of what is controlled."""
        first, second = self.weights
        return first * load + second * displacement

    def value(self, load: float, displacement: float) -> float:
        """What is controlled: F, d, or the far end of the spring D = d + F/K."""
        if self.kind == "spring":
            return displacement + load / self.stiffness
        return load if self.kind == "load" else displacement

    def of(self, state: Any) -> float:
        """What is controlled at a state, anything with a load and a displacement."""
        return self.value(state.load, state.displacement)

    def height(self, value: float, state: Any) -> float:
        """Energy of a state and of what drives it at a value."""
        return float(state.energy + self.potential(value, state.load, state.displacement))

    def target(self, value: float) -> float:
        """``w·(F, d)`` of the states at a value of what is controlled."""
        return value * self.weights[1] if self.kind == "spring" else value

    def potential(self, value: float, load: float, displacement: float) -> float:
        """Potential energy of what drives the contact at a value: −F₀d, K (D − d)²/2, or −F (d − D) of a rigid drive.

        With it the energy is stationary: a state that is a little off the value has the energy of the one there.
        """
        if self.kind == "load":
            return -value * displacement
        off = value - displacement
        return 0.5 * self.stiffness * off * off if self.kind == "spring" else load * off

    def scaled(self, unit: float) -> Control:
        """The control with its stiffness in another unit, worth `unit` of the present one."""
        return Control(self.kind, self.stiffness / unit) if self.kind == "spring" else self

    @property
    def spring_stiffness(self) -> float | None:
        """K of a spring; None for load and displacement control."""
        return self.stiffness if self.kind == "spring" else None

    def __str__(self) -> str:
        return f"spring:{self.stiffness:g}" if self.kind == "spring" else self.kind


LOAD = Control("load", 0.0)
DISPLACEMENT = Control("displacement", math.inf)


def as_control(control: object, units: Units = PHYSICAL, field: str = "control") -> Control:
    """Return the control that a user names: ``"load"``, ``"displacement"``, ``"spring:2.5"`` or ``Spring(2.5)``.

    Stiffnesses of physical contacts may have a unit: ``"spring:0.5 N/m"``, ``Spring("0.5 N/m")``. `field` is what
    messages name.

    Raises
    ------
    InputError
        For anything else.
    """
    if isinstance(control, Control):
        return control
    if isinstance(control, Spring):
        if control.quantity and not units.physical:
            raise InputError("control: a spring in N/m; the contact is in reduced units: give a bare number")
        return Control("spring", control.stiffness)
    known = {"load": LOAD, "displacement": DISPLACEMENT}
    if isinstance(control, str) and control in known:
        return known[control]
    kind, _, stiffness = str(control).partition(":")
    if kind.strip() == "spring" and stiffness.strip():
        return Control("spring", positive_number(units.read(stiffness.strip(), "stiffness", field), field))
    names = ("load", "displacement", "spring:0.1 N/m" if units.physical else "spring:2")
    words = f"must be {', '.join(names[:2])} or {names[2]}{nearest(control, names)}"
    raise InputError(f"{field}: {control!r}; {words}")
