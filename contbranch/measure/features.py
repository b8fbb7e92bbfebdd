"""What is seen in a force curve before any model: noise, baseline, jumps, and whether there is anything to fit."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from contbranch.arrays import Array, Indices
from contbranch.errors import InputError
from contbranch.measure.force_curve import ForceCurve

# A jump takes so many samples at most, is so many times larger than noise, and than steps beside it.
SAMPLES, ABOVE_NOISE, ABOVE_STEPS = 3, 8.0, 5.0
# A baseline ends before a step of this share of the range of forces, where it has so many samples by then.
JUMP, FEWEST = 0.05, 3
# A tilt is seen where it is so many times its error.
TILTED = 3.0
# Steps beside a jump are those this near to it.
BESIDE = 12
# A detector at its end gives one number so often.
PLATEAU = 5
# A parabola that is within one step of recording over a plateau rises by 9 over as many samples beside it.
BEND = 16
# Adhesion and contact are seen where the force leaves the baseline by so many times the noise.
SEEN = 6.0
# The retraction is back at the baseline where it ends within this share of all forces, and of the pull-off, from it.
DRIFT, UNBROKEN = 0.05, 0.3
# Noise is taken to be at least this share of the range of forces: numbers in files are rounded.
QUIET = 2e-5
# ... and differences of forces below this share of it are rounding.
ROUNDED = 1e-9


@dataclass(frozen=True)
class MeasuredJump:
    """A jump within a leg.

    Attributes
    ----------
    before, after : int
        Last sample before and first after it, as numbers of the curve's samples.
    piezo, force : float
        In its middle, and just before it, the baseline left in.
    step : float
        Change of the force.
    width : float
        Piezo positions between which it lies.
    """

    before: int
    after: int
    piezo: float
    force: float
    step: float
    width: float


@dataclass(frozen=True)
class Features:
    """What is seen in a curve.

    Attributes
    ----------
    noise : float
        Standard deviation of the force between neighbouring samples.
    baseline, tilt : float
        Of the far part of the approach: force = baseline + tilt · piezo.
    jump_in, pull_off : MeasuredJump or None
        On approach and on retraction.
    lowest, largest : float
        Least and largest force above the baseline.
    begun, returned : bool
        Whether the approach begins at the baseline, and the retraction comes back to it.
    """

    noise: float
    baseline: float
    tilt: float
    jump_in: MeasuredJump | None
    pull_off: MeasuredJump | None
    lowest: float
    largest: float
    begun: bool
    returned: bool


def features(curve: ForceCurve, adhesive: bool) -> Features:
    """Look at a curve.

    Parameters
    ----------
    adhesive : bool
        Whether the contact to be fitted attracts.

    Raises
    ------
    InputError
        If there is no contact in it, no adhesion where the contact attracts, or its force is reversed.
    """
    approach, retract = curve.leg(False), curve.leg(True)
    if not np.ptp(curve.force):
        raise InputError("curve: the force is the same everywhere; there is no contact to fit")
    told = _step(curve.force) / math.sqrt(12.0)  # as well as a number of a few digits tells a force
    noise = max(_noise(curve, approach, retract), told, QUIET * float(np.ptp(curve.force)), 1e-300)
    far_leg = _far_leg(curve, approach, retract)
    baseline, tilt = _baseline(curve, far_leg, noise)
    force = curve.force - baseline - tilt * curve.piezo
    allowed = SEEN * noise
    if all(_ramp(curve.force[leg], noise) for leg in (approach, retract) if leg.size >= 2 * BESIDE):
        raise InputError(
            "curve: the force is a straight ramp; are columns swapped, is there no contact in it, or too little of the "
            "baseline before it?"
        )
    deep = approach[np.argsort(curve.piezo[approach])[-max(5, approach.size // 20) :]]
    lowest, largest = float(np.min(force)), float(np.max(force))
    _cut_off(curve, noise)
    if max(-lowest, largest) < allowed:
        raise InputError(
            f"curve: nothing but noise, of {noise:.3g} nN: the force leaves its baseline by "
            f"{max(-lowest, largest):.3g} nN at most; there is no contact to fit"
        )
    pressed, rise = float(np.median(force[deep])), float(np.polyfit(curve.piezo[deep], force[deep], 1)[0])
    if pressed < -allowed and rise * float(np.ptp(curve.piezo[deep])) < -0.5 * allowed:
        raise InputError(
            "curve: the force falls where the tip is pressed on; it must be positive in repulsion (give its negative)"
        )
    if adhesive and -lowest < allowed:
        raise InputError(
            f"curve: no adhesion: the force stays above {lowest:.3g} nN of its baseline, and the noise is "
            f"{noise:.3g} nN; work of adhesion and range cannot be found from it; fit a contact without interaction "
            "(Hertz' theory)"
        )
    if _gains(curve, force, allowed):
        raise InputError(
            "curve: where the surfaces attract, the force is lower on approach than on retraction, as if the loop gave "
            "energy; are the samples reversed in time, or is there a drift?"
        )
    far = np.argsort(curve.piezo[retract])[: max(3, retract.size // 50)]
    end = float(np.median(force[retract][far])) if retract.size else math.nan
    drift = min(DRIFT * (largest - lowest), -UNBROKEN * lowest if adhesive else math.inf)
    returned = bool(retract.size) and abs(end) < max(2 * allowed, drift)
    parts = np.array_split(force[approach][: max(9, approach.size // 8)], 3)
    first, second, third = map(float, map(np.median, parts))
    sure, flat = 6 * noise / math.sqrt(len(parts[0])), 0.03 * (largest - lowest)
    # in contact the force rises
    outside = max(map(abs, (first, second, third))) < max(sure, flat) and third - first < sure
    begun = far_leg is approach or outside
    sign = -1.0 if adhesive else 1.0
    jump_in = _jump(curve, force, approach, sign, noise)
    pull_off = _jump(curve, force, retract, -sign, noise) if retract.size else None
    return Features(noise, baseline, tilt, jump_in, pull_off, lowest, largest, begun, returned)


def _cut_off(curve: ForceCurve, noise: float) -> None:
    """Raise InputError where the extreme force is that of many samples in a row, and changes beside them.

    By many of the steps in which it is recorded, too: where these are coarse, a flat minimum is one number as well.
    """
    least = max(ABOVE_NOISE * noise, BEND * _step(curve.force))
    for word, extreme in (("largest", curve.force.max()), ("least", curve.force.min())):
        same = np.flatnonzero(curve.force == extreme)
        runs = np.split(same, np.flatnonzero(np.diff(same) > 1) + 1)
        run = max(runs, key=len)
        if run.size < PLATEAU or not np.ptp(curve.piezo[run]):
            continue
        last = run[-1] + run.size  # behind a plateau at the end there is the baseline with which the curve begins
        beside = [curve.force[max(run[0] - run.size, 0)], curve.force[last if last < len(curve) else 0]]
        if np.abs(np.array(beside) - extreme).min() > least:
            raise InputError(
                f"curve: the {word} force, {extreme:.4g} nN, is that of {run.size} samples in a row: the detector was "
                "at its end; leave them out"
            )


def _step(force: Array) -> float:
    """The step in which forces were recorded, if all of them are multiples of one apart; otherwise 0."""
    apart = np.diff(np.unique(force))
    apart = apart[apart > ROUNDED * float(np.ptp(force))]
    steps = apart / apart.min()
    return float(apart.min()) if np.abs(steps - np.round(steps)).max() < 0.01 else 0.0


def _gains(curve: ForceCurve, force: Array, allowed: float) -> bool:
    """Whether most of what lies between the legs, below the baseline, has the approach below the retraction."""
    legs = []
    for leg in (curve.leg(False), curve.leg(True)):
        order = leg[np.argsort(curve.piezo[leg], kind="stable")]
        legs.append((curve.piezo[order], force[order]))
    (there, down), back = legs
    if back[0].size < 2:
        return False
    apart = down - np.interp(there, *back, left=math.nan, right=math.nan)
    apart = apart[(np.abs(apart) > 2 * allowed) & (down - np.maximum(apart, 0.0) < -allowed)]
    return bool(
        apart.size >= SAMPLES
        and -apart.sum() > 2 * np.abs(apart[apart > 0]).sum()
        and -apart.sum() > apart.size * 0.1 * -float(force.min())
    )


def _ramp(force: Array, noise: float) -> bool:
    """Whether a force is a straight line in time, as the position of a piezo is."""
    time = np.arange(force.size)
    rest = force - np.polyval(np.polyfit(time, force, 1), time)
    return float(np.ptp(force)) > 50 * max(noise, float(np.std(rest)))


def _noise(curve: ForceCurve, approach: Indices, retract: Indices) -> float:
    """From second differences where the force is flattest."""
    found = []
    for leg in (approach, retract):
        if leg.size < 12:
            continue
        bends = np.diff(curve.force[leg], 2) / math.sqrt(6.0)
        parts = np.array_split(bends, max(1, min(5, bends.size // 10)))
        found += [1.4826 * float(np.median(np.abs(part - np.median(part)))) for part in parts]
    return float(np.median(found)) if found else 0.0


def _far_leg(curve: ForceCurve, approach: Indices, retract: Indices) -> Indices:
    """The approach, or the retraction backwards where that begins clearly farther away."""
    if not retract.size:
        return approach
    begin, end = (float(curve.piezo[leg].min()) for leg in (approach, retract))
    return retract[::-1] if end < begin - 0.1 * float(np.ptp(curve.piezo)) else approach


def _baseline(curve: ForceCurve, approach: Indices, noise: float) -> tuple[float, float]:
    """A line through the far part of a leg towards the surface, as far as it fits, and no farther than to a jump."""
    piezo, force = curve.piezo[approach], curve.force[approach]
    jumps = np.flatnonzero(np.abs(np.diff(force)) > max(ABOVE_NOISE * noise, JUMP * float(np.ptp(force))))
    if jumps.size and jumps[0] + 1 >= FEWEST:
        piezo, force = piezo[: jumps[0] + 1], force[: jumps[0] + 1]
    count = min(max(6, piezo.size // 8), piezo.size)
    line = np.polyfit(piezo[:count], force[:count], 1)
    far = piezo[0] + 0.15 * float(np.ptp(piezo))
    if piezo[count - 1] < far:
        count = max(count, int(np.searchsorted(np.maximum.accumulate(piezo), far)))
    spread = 4 * max(noise, float(np.std(force[:count] - np.polyval(line, piezo[:count]))))
    for _ in range(4):  # longer as long as the line holds
        longer = min(int(1.4 * count), int(0.6 * piezo.size))
        trial = np.polyfit(piezo[:longer], force[:longer], 1)
        if longer <= count or np.abs(force[:longer] - np.polyval(trial, piezo[:longer])).max() > spread:
            break
        count, line = longer, trial
    if abs(line[0]) * float(np.std(piezo[:count])) * math.sqrt(count) < TILTED * noise:  # noise explains it
        return float(np.mean(force[:count])), 0.0
    return float(line[1]), float(line[0])


def _jump(curve: ForceCurve, force: Array, leg: Indices, sign: float, noise: float) -> MeasuredJump | None:
    """The largest change of a sign within few samples that stands out from those beside it."""
    own = force[leg]
    if own.size < 2 * SAMPLES + 2:
        return None
    steps = sign * np.diff(own)
    k = int(np.argmax(steps))
    low = high = k
    while high - low + 1 < SAMPLES:  # neighbours that belong to it
        sides = [(steps[j], j) for j in (low - 1, high + 1) if 0 <= j < steps.size]
        size, j = max(sides)
        if size < max(0.08 * steps[k], 3 * noise):
            break
        low, high = min(low, j), max(high, j)
    step = float(own[high + 1] - own[low])
    beside = np.abs(np.concatenate([steps[max(0, low - BESIDE) : low], steps[high + 1 : high + 1 + BESIDE]]))
    usual = float(np.sort(beside)[-2:].mean()) if beside.size > 1 else 0.0
    if sign * step < ABOVE_NOISE * noise or steps[k] < 0.5 * ABOVE_STEPS * usual:
        return None
    before, after = int(leg[low]), int(leg[high + 1])
    piezo = float(curve.piezo[before]), float(curve.piezo[after])
    width = max(abs(piezo[1] - piezo[0]), 0.5 * float(np.median(np.abs(np.diff(curve.piezo[leg])))), 1e-9)
    return MeasuredJump(before, after, 0.5 * sum(piezo), float(curve.force[before]), step, width)
