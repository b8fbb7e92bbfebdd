"""The force that a cantilever feels over the position of its piezo, and how far a measured curve is from it.

The far end of the spring is at z = d + F/K. Approaching, the contact follows its curve as long as z grows and jumps at
a maximum of z to the next part on which z is larger; retracting, from a minimum to the next part with smaller z. Each
sample is compared with the branch on which it was measured, before or after the jump seen in its leg: so the residuals
change smoothly with the parameters, and where the jumps are is a residual of its own.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np

from contbranch.arrays import Array, Indices
from contbranch.measure.features import Features, MeasuredJump
from contbranch.measure.force_curve import ForceCurve
from contbranch.measure.reduced import Curve

# Samples just before a jump that are left out: the slope is all but infinite there, and the jump has its place.
STEEP = 2
# Jumps below this multiple of the noise have no place in a curve.
SMALL = 2.0
# An extremum of z is a corner where its steps on the flat side are below this share of that on the steep one; those of
# a parabola are at least as large together.
CORNER = 0.3


class ModelJump(NamedTuple):
    """A jump at a piezo position, from a force to a force."""

    piezo: float
    before: float
    after: float

    @property
    def step(self) -> float:
        """Change of the force."""
        return self.after - self.before


class Leg(NamedTuple):
    """Force over growing piezo position, vertical at jumps; and its largest jump, if there is one."""

    piezo: Array
    force: Array
    jump: ModelJump | None

    def at(self, piezo: Array) -> Array:
        """The force."""
        return _between(piezo, self.piezo, self.force)

    def part(self, above: bool) -> tuple[Array, Array]:
        """The part above or below the jump, which ends with the force at the jump."""
        if self.jump is None:
            return self.piezo, self.force
        k = int(np.searchsorted(self.piezo, self.jump.piezo, side="right" if above else "left"))
        chosen = slice(k - 1, None) if above else slice(0, k + 1)
        return self.piezo[chosen], self.force[chosen]


def _between(at: Array, places: Array, values: Array) -> Array:
    """Values between growing places, by parabolas through neighbours: straight lines make the errors of fits uneven."""
    steps = np.diff(places)
    slopes = np.divide(np.diff(values), steps, out=np.zeros_like(steps), where=steps > 0)
    wide = steps[1:] + steps[:-1]
    bends = np.zeros_like(places)
    np.divide(np.diff(slopes), wide, out=bends[1:-1], where=np.minimum(steps[1:], steps[:-1]) > 0)
    bends[:2] = 0.0  # the first point is far away
    k = np.clip(np.searchsorted(places, at, side="right") - 1, 0, steps.size - 1)
    before = np.clip(at - places[k], 0.0, steps[k])
    return values[k] + before * (slopes[k] + (before - steps[k]) * 0.5 * (bends[k] + bends[k + 1]))


def legs(curve: Curve, stiffness: float) -> tuple[Leg, Leg]:
    """Approach and retraction of a curve on a spring; an infinite stiffness is a rigid drive."""
    force, piezo = curve.load, curve.displacement + curve.load / stiffness
    rising = piezo > np.append(-math.inf, np.maximum.accumulate(piezo)[:-1])
    falling = piezo < np.append(np.minimum.accumulate(piezo[::-1])[::-1][1:], math.inf)
    return _leg(piezo, force, np.flatnonzero(rising), 1), _leg(piezo, force, np.flatnonzero(falling), -1)


def _leg(piezo: Array, force: Array, kept: Indices, direction: int) -> Leg:
    """The leg of the points kept; at a gap between them the fold, and where the jump lands."""
    gaps = np.flatnonzero(np.diff(kept) > 1)
    jumps = []
    for gap in gaps:
        fold, beyond = (kept[gap], kept[gap + 1]) if direction > 0 else (kept[gap + 1], kept[gap])
        at, before = _vertex(piezo, force, int(fold))
        beside = beyond - direction
        low, high = piezo[beside], piezo[beyond]
        share = (at - low) / (high - low) if high != low else 1.0
        after = float(force[beside] + min(max(share, 0.0), 1.0) * (force[beyond] - force[beside]))
        jumps.append(ModelJump(at, before, after))
    rows, sides = np.repeat(gaps + 1, 2), [(jump.before, jump.after)[::direction] for jump in jumps]
    places = np.insert(piezo[kept], rows, np.repeat([jump.piezo for jump in jumps], 2))
    values = np.insert(force[kept], rows, np.ravel(sides))
    largest = max(jumps, key=lambda jump: abs(jump.step), default=None)
    return Leg(np.maximum.accumulate(places), values, largest)


def _vertex(piezo: Array, force: Array, k: int) -> tuple[float, float]:
    """Piezo position and force at the extremum of the position next to a point; a corner is its own."""
    near = piezo[max(k - 2, 0) : k + 3] - piezo[k]
    if near.size < 5 or near[1] * near[3] <= 0.0:
        return float(piezo[k]), float(force[k])
    below, above = float(near[1]), float(near[3])
    flat, steep = (near[4], below) if abs(above) < abs(below) else (near[0], above)
    if abs(flat) < CORNER * abs(steep):
        return float(piezo[k]), float(force[k])
    s = 0.5 * (below - above) / (below + above)
    half = 0.5 * (force[k + 1] - force[k - 1]), 0.5 * (force[k + 1] - 2 * force[k] + force[k - 1])
    return float(piezo[k] - (above - below) ** 2 / (8 * (above + below))), float(force[k] + s * (half[0] + s * half[1]))


@dataclass(frozen=True)
class Comparison:
    """Samples of a curve with the branches on which they were measured.

    Attributes
    ----------
    curve : ForceCurve
    seen : Features
    far, near, approach, retract : integer arrays
        Samples compared with the branch without and with contact (behind or before a jump), and with whole legs.
    """

    curve: ForceCurve
    seen: Features
    far: Indices
    near: Indices
    approach: Indices
    retract: Indices

    @classmethod
    def of(cls, curve: ForceCurve, seen: Features) -> Comparison:
        """Sort the samples."""
        none = np.empty(0, dtype=np.intp)
        far, near, whole = [none], [none], [none, none]
        for retract, jump in ((False, seen.jump_in), (True, seen.pull_off)):
            leg = curve.leg(retract)
            if jump is not None:
                (near if retract else far).append(leg[leg <= jump.before - STEEP])
                (far if retract else near).append(leg[leg >= jump.after])
            elif not (seen.returned if retract else seen.begun):
                near.append(leg)
            else:
                whole[retract] = leg
        return cls(curve, seen, np.concatenate(far), np.concatenate(near), *whole)

    def labelled(self, approach: Leg, retract: Leg, contact_point: float, recorded: Array) -> Comparison:
        """With the place of a jump in legs where none stands out, where the branches of a model put it most likely.

        Parameters
        ----------
        recorded : array (M,)
            The forces of all samples as the model has them: less the baseline.
        """
        branches = approach.part(False), retract.part(True)
        piezo = self.curve.piezo - contact_point
        found: dict[str, Any] = {}
        for back, name, leg in ((False, "jump_in", approach), (True, "pull_off", retract)):
            step = 0.0 if leg.jump is None else leg.jump.step
            whole = self.seen.returned if back else self.seen.begun
            if getattr(self.seen, name) is not None or not whole or abs(step) < SMALL * self.seen.noise:
                continue
            own = self.curve.leg(back)
            apart = [((recorded[own] - _between(piezo[own], *branch)) / self.seen.noise) ** 2 for branch in branches]
            first, last = apart[::-1] if back else apart
            score = np.cumsum(first - last)[:-1]
            weights = np.exp(-0.5 * (score - score.min()))
            weights /= weights.sum()
            middle = 0.5 * (self.curve.piezo[own][1:] + self.curve.piezo[own][:-1])
            place = float(weights @ middle)
            spread = math.sqrt(max(float(weights @ (middle - place) ** 2), 0.0))
            k = int(np.argmin(score))
            width = math.hypot(float(abs(np.diff(self.curve.piezo[own[k : k + 2]])[0])), math.sqrt(12.0) * spread)
            before, after = int(own[k]), int(own[k + 1])
            forces = self.curve.force[[before, after]]
            found[name] = MeasuredJump(before, after, place, float(forces[0]), float(forces[1] - forces[0]), width)
        return Comparison.of(self.curve, replace(self.seen, **found)) if found else self

    @property
    def samples(self) -> Indices:
        """All samples, in the order of the residuals."""
        return np.concatenate([self.far, self.near, self.approach, self.retract])

    def forces(self, approach: Leg, retract: Leg, contact_point: float) -> Array:
        """The model's force at the samples."""
        piezo = self.curve.piezo - contact_point
        return np.concatenate(
            [
                _between(piezo[self.far], *approach.part(False)),
                _between(piezo[self.near], *retract.part(True)),
                approach.at(piezo[self.approach]),
                retract.at(piezo[self.retract]),
            ]
        )

    def places(self, approach: Leg, retract: Leg, contact_point: float) -> Array:
        """How far jumps are from where they were seen, in standard deviations; a pull-off behind the last sample: 0."""
        found = []
        for leg, jump in ((approach, self.seen.jump_in), (retract, self.seen.pull_off)):
            if jump is not None:
                found.append((_jump_place(leg) + contact_point - jump.piezo) * math.sqrt(12.0) / jump.width)
        if self.seen.pull_off is None and not self.seen.returned:
            samples, late = self.curve.piezo[self.curve.leg(True)], 0.0
            if retract.jump is not None and samples.size:
                late = (retract.jump.piezo + contact_point - samples.min()) * samples.size / float(np.ptp(samples))
            found.append(max(0.0, late))
        return np.array(found)


def _jump_place(leg: Leg) -> float:
    """Where the leg jumps; where it is steepest if it does not."""
    if leg.jump is not None:
        return leg.jump.piezo
    slopes = np.diff(leg.force) / np.maximum(np.diff(leg.piezo), 1e-300)
    return float(leg.piezo[int(np.argmin(slopes))])
