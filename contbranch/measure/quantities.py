"""What is varied in a fit: numbers of the contact, the instrument's, and the straight line below the curve."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from contbranch.arrays import Array, Flags
from contbranch.contact.contact import Contact
from contbranch.contact.parameters import parameters_of
from contbranch.errors import InputError, look_up
from contbranch.measure.reduced import TABOR, tabulated

LINE = ("contact_point", "baseline", "tilt")
# ... and of the retraction, where that has its own.
RETRACTED = ("baseline_retract", "tilt_retract")
LINEAR = (*LINE, *RETRACTED)
INSTRUMENT = ("spring", "sensitivity")
# Factors from the first guess within which a positive number may lie.
WIDE, NARROW = 1e3, 5.0


@dataclass(frozen=True)
class State:
    """A contact with its instrument.

    Attributes
    ----------
    contact : Contact
    spring : float
        Infinite for a rigid drive.
    sensitivity : float
        True deflection over the recorded one.
    line : (float, float, float)
        Contact point, baseline and tilt: the recorded force is ``F/sensitivity + baseline + tilt · piezo``.
    retracted : (float, float)
        Baseline and tilt of the retraction.
    """

    contact: Contact
    spring: float
    sensitivity: float = 1.0
    line: tuple[float, float, float] = (0.0, 0.0, 0.0)
    retracted: tuple[float, float] = (0.0, 0.0)

    def baseline(self, piezo: Array, retract: Flags) -> Array:
        """The straight lines below the samples."""
        height, tilt = (np.where(retract, *pair) for pair in zip(self.retracted, self.line[1:], strict=True))
        return height + tilt * piezo


@dataclass(frozen=True)
class Problem:
    """The unknowns as a vector: logarithms of positive numbers, the Tabor coefficient for a range that is free.

    Attributes
    ----------
    start : State
    free : tuple of str
    fixed : tuple of str
        Of `LINE`, held at 0.
    middle : float
        Piezo position at which the baseline is taken, so that it does not depend on the tilt.
    limit : str
        ``"jkr"`` or ``"dmt"``: without a range.
    guess : State or None
        Made from the curve: the middle of the bounds; by default the start.
    each : bool
        Whether the retraction has a baseline and a tilt of its own.
    """

    start: State
    free: tuple[str, ...]
    fixed: tuple[str, ...] = ()
    middle: float = 0.0
    limit: str = ""
    guess: State | None = None
    each: bool = False

    @classmethod
    def of(
        cls, start: State, free: Sequence[str], fixed: Sequence[str], limit: str, middle: float, each: bool
    ) -> Problem:
        """The problem of names that a user gives.

        Raises
        ------
        InputError
            For a name that is not known, or cannot be varied.
        """
        known = parameters_of(start.contact)
        for field, names, possible in (("free", free, (*known, *INSTRUMENT)), ("fixed", fixed, LINE)):
            for name in names:
                look_up(name, dict.fromkeys(possible), field)
        zero = [name for name in free if name in known and known[name].value == 0.0]
        if zero:
            raise InputError(f"free: {zero[0]} is 0, and is varied by a factor; give another start")
        if "spring" in free and math.isinf(start.spring):
            raise InputError("free: spring; the curve has none, give its stiffness to start with")
        names = tuple(dict.fromkeys(name for name in free if not (limit and name == "range")))
        return cls(start, names, tuple(fixed), middle, limit, each=each)

    @property
    def names(self) -> tuple[str, ...]:
        """All that is varied."""
        straight = LINEAR if self.each else LINE
        return (*self.free, *(name for name in straight if name.removesuffix("_retract") not in self.fixed))

    @property
    def by_tabor(self) -> bool:
        """Whether the Tabor coefficient stands for the range."""
        return "range" in self.free and tabulated(self.start.contact)

    def state(self, x: Array) -> State:
        """What a vector means."""
        numbers = dict(zip(self.names, map(float, x), strict=True))
        contact, known = self.start.contact, parameters_of(self.start.contact)
        for name in self.free:
            if name in known and not (name == "range" and self.by_tabor):
                known = parameters_of(contact) if contact is not self.start.contact else known
                contact = known[name].contact(math.copysign(math.exp(numbers[name]), known[name].value))
        if self.by_tabor:
            wide = contact.scales.normal * math.exp(-numbers["range"])
            contact = parameters_of(contact)["range"].contact(wide)
        spring, sensitivity = (
            math.exp(numbers[name]) if name in numbers else getattr(self.start, name) for name in INSTRUMENT
        )
        place, baseline, tilt = (numbers.get(name, 0.0) for name in LINE)
        own = [numbers.get(name, other) for name, other in zip(RETRACTED, (baseline, tilt), strict=True)]
        lines = [(height - slope * self.middle, slope) for height, slope in ((baseline, tilt), own)]
        return State(contact, spring, sensitivity, (place, *lines[0]), lines[1])

    def vector(self, state: State) -> Array:
        """The vector of a state."""
        known, (place, baseline, tilt) = parameters_of(state.contact), state.line
        own: dict[str, float] = {"contact_point": place, "baseline": baseline + tilt * self.middle, "tilt": tilt}
        own |= {"baseline_retract": state.retracted[0] + state.retracted[1] * self.middle}
        own |= {"tilt_retract": state.retracted[1]}
        own |= {name: math.log(getattr(state, name)) for name in INSTRUMENT}
        own |= {name: math.log(abs(one.value)) for name, one in known.items() if one.value}
        if self.by_tabor:
            own["range"] = math.log(min(max(state.contact.tabor or 1.0, 1.02 * TABOR[0]), TABOR[1] / 1.02))
        return np.array([own[name] for name in self.names])

    def bounds(self) -> tuple[Array, Array]:
        """Bounds around the guess."""
        centre = self.vector(self.guess or self.start)
        width = {"spring": math.log(NARROW), "sensitivity": math.log(NARROW), "radius": math.log(30.0)}
        spread = np.array([math.inf if name in LINEAR else width.get(name, math.log(WIDE)) for name in self.names])
        low, high = centre - spread, centre + spread
        if self.by_tabor:
            k = self.names.index("range")
            low[k], high[k] = map(math.log, TABOR)
        return low, high

    def values(self, x: Array) -> dict[str, float]:
        """The numbers by name, in nm and nN."""
        state = self.state(x)
        own: dict[str, float] = {name: one.value for name, one in parameters_of(state.contact).items()}
        own |= {"spring": state.spring, "sensitivity": state.sensitivity, **dict(zip(LINE, state.line, strict=True))}
        own |= dict(zip(RETRACTED, state.retracted, strict=True))
        return {name: own[name] for name in self.names}

    def numbers(self, x: Array) -> Array:
        """The same as an array."""
        return np.array([*self.values(x).values()])

    def derivatives(self, x: Array) -> Array:
        """Of the numbers with respect to the vector."""
        steps = 1e-5 * np.eye(x.size)
        return np.array([(self.numbers(x + step) - self.numbers(x - step)) / 2e-5 for step in steps]).T

    def with_law(self, contact: Contact) -> Problem:
        """The same unknowns for another law."""
        return replace(self, start=replace(self.start, contact=contact))
