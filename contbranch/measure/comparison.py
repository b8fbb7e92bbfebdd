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

from contbranch.arrays import Array, Flags, Indices
from contbranch.measure.features import NEIGHBOURS, SIGNIFICANT, Features, MeasuredJump, step_weights
from contbranch.measure.force_curve import ForceCurve
from contbranch.measure.reduced import Curve

# Samples just before a jump that are left out: the slope is all but infinite there, and the jump has its place.
STEEP = 2
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


class Branch:
    """Force over growing piezo position, by parabolas through neighbours; behind a fold mirrored about that.

    Straight lines between the rows of a model make the errors of fits uneven. Where a jump of the model comes before
    that of the data, samples between them are on no branch of the model: mirrored, the force goes on as steeply as it
    comes to the fold, so that they are not described by a plateau.

    Parameters
    ----------
    piezo, force : array (M,)
        Positions that do not fall.
    fold : {-1, 0, 1}
        At which end there is one.
    """

    def __init__(self, piezo: Array, force: Array, fold: int = 0) -> None:
        self.piezo, self.force, self.fold = piezo, force, fold
        steps = np.diff(piezo)
        self.slopes = np.divide(np.diff(force), steps, out=np.zeros_like(steps), where=steps > 0)
        bends = np.zeros_like(piezo)
        distinct = np.minimum(steps[1:], steps[:-1]) > 0
        np.divide(np.diff(self.slopes), steps[1:] + steps[:-1], out=bends[1:-1], where=distinct)
        bends[:2] = 0.0  # the first point is far away
        self.steps, self.bends = steps, 0.5 * (bends[1:] + bends[:-1])

    def at(self, piezo: Array) -> tuple[Array, Array]:
        """Force and its slope."""
        if not self.fold:
            return self._inside(piezo)
        end = self.piezo[0 if self.fold < 0 else -1]
        behind = self.fold * (piezo - end) > 0
        force, slope = self._inside(np.where(behind, 2 * end - piezo, piezo))
        return np.where(behind, 2 * self.force[0 if self.fold < 0 else -1] - force, force), slope

    def _inside(self, piezo: Array) -> tuple[Array, Array]:
        k = np.clip(np.searchsorted(self.piezo, piezo, side="right") - 1, 0, self.steps.size - 1)
        steps, bends = self.steps[k], self.bends[k]
        before = np.clip(piezo - self.piezo[k], 0.0, steps)
        tilt = self.slopes[k] + (before - steps) * bends
        return self.force[k] + before * tilt, np.where(before < steps, tilt + before * bends, 0.0)


class Leg(NamedTuple):
    """Force over growing piezo position, vertical at jumps; its largest jump, and the branches on either side of it."""

    whole: Branch
    jump: ModelJump | None
    below: Branch
    above: Branch


def legs(curve: Curve, stiffness: float) -> tuple[Leg, Leg]:
    """Approach and retraction of a curve on a spring; an infinite stiffness is a rigid drive."""
    force, piezo = curve.load, curve.displacement + curve.load / stiffness
    if (np.diff(piezo) > 0.0).all():
        whole = Branch(piezo, force)
        return (leg := Leg(whole, None, whole, whole)), leg
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
    places = np.maximum.accumulate(np.insert(piezo[kept], rows, np.repeat([jump.piezo for jump in jumps], 2)))
    values = np.insert(force[kept], rows, np.ravel(sides))
    whole = Branch(places, values)
    if not jumps:
        return Leg(whole, None, whole, whole)
    jump = max(jumps, key=lambda jump: abs(jump.step))
    low, high = (int(np.searchsorted(places, jump.piezo, side=side)) for side in ("left", "right"))
    below = Branch(places[: low + 1], values[: low + 1], fold=max(direction, 0))
    return Leg(whole, jump, below, Branch(places[high - 1 :], values[high - 1 :], fold=min(direction, 0)))


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
    def of(cls, curve: ForceCurve, seen: Features, kept: Flags | None = None) -> Comparison:
        """Sort the samples that are used and, if a choice is given, kept."""
        none = np.empty(0, dtype=np.intp)
        far, near, whole = [none], [none], [none, none]
        used = seen.used if kept is None else seen.used & kept
        for retract, jump in ((False, seen.jump_in), (True, seen.pull_off)):
            leg = curve.leg(retract)
            leg = leg[used[leg]]
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

        Where the data have no step beyond the noise there is none.

        Parameters
        ----------
        recorded : array (M,)
            The forces of all samples as the model has them: less the baseline.
        """
        piezo, noise = self.curve.piezo - contact_point, self.seen.noise
        found: dict[str, Any] = {}
        for back, name, leg, own in (
            (False, "jump_in", approach, self.approach),
            (True, "pull_off", retract, self.retract),
        ):
            if leg.jump is None or own.size < 2 * NEIGHBOURS:
                continue
            apart = [((recorded[own] - one.at(piezo[own])[0]) / noise) ** 2 for one in (approach.below, retract.above)]
            first, last = apart[::-1] if back else apart
            score = np.cumsum(first - last)[:-1]
            weights = np.exp(-0.5 * (score - score.min()))
            weights /= weights.sum()
            middle = 0.5 * (self.curve.piezo[own][1:] + self.curve.piezo[own][:-1])
            place = float(weights @ middle)
            spread = math.sqrt(max(float(weights @ (middle - place) ** 2), 0.0))
            k = int(np.argmin(score))
            beside = self.curve.force[own[max(k + 1 - NEIGHBOURS, 0) : k + 1 + NEIGHBOURS]]
            if beside.size < 2 * NEIGHBOURS:
                continue
            step = float(step_weights() @ beside)
            if step * math.copysign(1.0, leg.jump.step) < SIGNIFICANT * noise * np.linalg.norm(step_weights()):
                continue
            width = math.hypot(float(abs(np.diff(self.curve.piezo[own[k : k + 2]])[0])), math.sqrt(12.0) * spread)
            before, after = int(own[k]), int(own[k + 1])
            found[name] = MeasuredJump(before, after, place, float(self.curve.force[before]), step, max(width, 1e-9))
        if not found:
            return self
        kept = np.zeros(len(self.curve), dtype=bool)
        kept[self.samples] = True
        return Comparison.of(self.curve, replace(self.seen, **found), kept)

    @property
    def samples(self) -> Indices:
        """All samples, in the order of the residuals."""
        return np.concatenate([self.far, self.near, self.approach, self.retract])

    def forces(self, approach: Leg, retract: Leg, contact_point: float) -> tuple[Array, Array]:
        """The model's force at the samples, and its slope over the piezo position."""
        branches = (approach.below, retract.above, approach.whole, retract.whole)
        groups = (self.far, self.near, self.approach, self.retract)
        parts = zip(groups, branches, strict=True)
        found = [branch.at(self.curve.piezo[own] - contact_point) for own, branch in parts if own.size]
        force, slope = zip(*found, strict=True)
        return np.concatenate(force), np.concatenate(slope)

    def places(self, approach: Leg, retract: Leg, contact_point: float) -> Array:
        """How far jumps are from where they were seen, in standard deviations; a pull-off behind the last sample: 0."""
        found = []
        for leg, jump in ((approach, self.seen.jump_in), (retract, self.seen.pull_off)):
            if jump is not None:
                found.append((_jump_place(leg) + contact_point - jump.piezo) * math.sqrt(12.0) / jump.width)
        back = self.curve.leg(True)
        samples = self.curve.piezo[back[self.seen.used[back]]]
        if self.seen.pull_off is None and not self.seen.returned and samples.size:
            late = 0.0
            if retract.jump is not None:
                late = (retract.jump.piezo + contact_point - samples.min()) * samples.size / float(np.ptp(samples))
            found.append(max(0.0, late))
        return np.array(found)


def _jump_place(leg: Leg) -> float:
    """Where the leg jumps; where it is steepest if it does not."""
    if leg.jump is not None:
        return leg.jump.piezo
    return float(leg.whole.piezo[int(np.argmin(leg.whole.slopes))])
