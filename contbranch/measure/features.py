"""What is seen in a force curve before any model: noise, baselines, jumps, samples that tell nothing of the contact."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cache
from itertools import pairwise

import numpy as np

from contbranch.arrays import Array, Flags, Indices
from contbranch.contact.units import readable
from contbranch.errors import InputError
from contbranch.measure.force_curve import ForceCurve

# A jump takes so many samples at most, is so many times larger than noise, and than steps beside it.
JUMP_SAMPLES, JUMP_OVER_NOISE, JUMP_OVER_STEPS = 3, 8.0, 5.0
# Of legs, in sentences.
NAMES = ("approach", "retraction")
# Samples on either side whose steps those of a jump are compared with; a spike has fewer samples.
NEIGHBOURS = 12
# Of several jumps off, the first one is the pull-off that has this share of the largest.
FIRST_JUMP = 0.25
# What holds the tip behind the pull-off, and lets go in a step, holds it with at least this share of the pull-off.
HOLDING = 0.05
# A baseline rises by less than this share of the slope where the tip is pressed most.
BASELINE_SLOPE = 0.5
# A tilt or a step is seen where it is so many times its error.
SIGNIFICANT = 3.0
# A detector is at its end where the slope of so many samples, or of twice as many, and so on, is below this share of
# that before them; what is within this share of the force there bends towards it.
PLATEAU, FLAT, BENDING = 5, 0.3, 0.3
# Adhesion and contact are seen where the force leaves the baseline by so many times the noise.
SEEN = 6.0
# The retraction is back at the baseline where it ends within this share of the pull-off from it.
UNBROKEN = 0.3
# Noise is taken to be at least this share of the range of forces: numbers in files are rounded.
QUIET = 2e-5
# ... and differences of forces below this share of it are rounding.
ROUNDED = 1e-9


class NoAdhesionError(InputError):
    """A curve to which a contact with adhesion is fitted shows none."""


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
    cut : bool
        Whether the detector was at its end before it, so that its force is not known.
    """

    before: int
    after: int
    piezo: float
    force: float
    step: float
    width: float
    cut: bool = False


@dataclass(frozen=True)
class Features:
    """What is seen in a curve.

    Attributes
    ----------
    noise : float
        Standard deviation of the force between neighbouring samples.
    lines : ((float, float), (float, float))
        Baseline and tilt of approach and retraction: force = baseline + tilt · piezo; the least force where there is
        no baseline.
    jump_in, pull_off : MeasuredJump or None
        On approach and on retraction.
    lowest, largest : float
        Least and largest force above the baseline.
    begun, returned : bool
        Whether the approach begins at a baseline, and the retraction comes back to it.
    used : array (M,)
        Samples that tell of the contact.
    resolution : float
        Distance of positions of the piezo that are repeated; 0 where they are not.
    adhesion : float
        The largest attraction of a retraction that is left out, where the contact to be fitted has none (nN).
    suspected : bool
        Whether the force seems to come to the end of the detector where nothing is left out.
    notes : tuple of str
        Sentences on what is left out.
    """

    noise: float
    lines: tuple[tuple[float, float], tuple[float, float]]
    jump_in: MeasuredJump | None
    pull_off: MeasuredJump | None
    lowest: float
    largest: float
    begun: bool
    returned: bool
    used: Flags
    resolution: float = 0.0
    adhesion: float = 0.0
    suspected: bool = False
    notes: tuple[str, ...] = ()


def features(
    curve: ForceCurve, adhesive: bool, legs: Sequence[bool] = (False, True), suspect: bool = False
) -> Features:
    """Look at a curve.

    Parameters
    ----------
    adhesive : bool
        Whether the contact to be fitted attracts.
    legs : sequence of bool
        False for the approach, True for the retraction.
    suspect : bool
        Whether to leave out where the force seems to come to the end of the detector: a smooth minimum before a
        pull-off looks the same.

    Raises
    ------
    InputError
        If there is no contact in it, no adhesion where the contact attracts, or its force is reversed.
    """
    own = {back: leg for back in legs if (leg := curve.leg(back)).size}
    used, notes = np.zeros(len(curve), dtype=bool), []
    for leg in own.values():
        used[leg] = True
    if not np.ptp(curve.force[used]):
        raise InputError("curve: the force is the same everywhere; there is no contact to fit")
    step = _step(curve.force[used])
    digits = step / math.sqrt(12.0)  # as well as a number of a few digits tells a force
    noise = max(_noise(curve, own), digits, QUIET * float(np.ptp(curve.force[used])), 1e-300)
    for leg in own.values():
        used[leg[_spikes(curve.force[leg], noise)]] = False
    if alone := sum(leg.size for leg in own.values()) - int(used.sum()):
        notes.append(f"Left out as dropouts or spikes: {alone} of {used.size} samples.")
    own = {back: leg[used[leg]] for back, leg in own.items()}
    flat, (approach, retract) = _lines(curve, own, noise, adhesive)
    line = np.where(curve.retract, retract[0], approach[0])
    force = curve.force - line - np.where(curve.retract, retract[1], approach[1]) * curve.piezo
    sign = 1.0 if adhesive else -1.0
    jumps = {back: _jump(curve, force, leg, sign if back else -sign, noise) for back, leg in own.items()}
    suspected = False
    for back, leg in own.items():
        jump = jumps[back]
        pulled = leg if jump is None else leg[leg <= jump.before]
        for turned, ends in ((1.0, leg[::-1] if back else leg), (-1.0, pulled if back and adhesive else leg[:0])):
            level = _end_level(turned * force[ends], curve.piezo[ends], noise)
            if level is None or not suspect:
                suspected |= level is not None
                continue
            beyond = turned * force > (1.0 - BENDING) * level
            used &= ~beyond
            if jump is not None and beyond[jump.before]:
                jumps[back] = replace(jump, cut=True)
            notes.append(
                f"The detector is at its end on {NAMES[back]}, {readable(turned * level, 'nN')} from the baseline: "
                f"what is beyond {1.0 - BENDING:.0%} of that is left out."
            )
    least, largest = float(np.min(force[used])), float(np.max(force[used]))
    _refuse(curve, force, own, noise, (least, largest), adhesive and any(flat.values()))
    held = 0.0
    if flat.get(True) and adhesive:
        jump = jumps[True]
        behind = own[True][:0] if jump is None else own[True][own[True] >= jump.after]
        found = behind[: _last_step(sign * force[behind], noise, -HOLDING * least)]
        words = "The contact comes off in several steps, or a tether holds it: what lies between them is left out."
    elif flat.get(True):
        found = _below(own[True], force, noise)
        held = -least if found.size else 0.0
        words = f"The retraction shows adhesion ({readable(least, 'nN')}), of which this contact has none: the samples "
        words += "below the baseline are left out."
    if flat.get(True) and found.size:
        used[found] = False
        notes.append(words)
    resolution = max(_repeated(curve.piezo[leg]) for leg in own.values())
    return Features(
        noise=noise,
        lines=(approach, retract),
        jump_in=jumps.get(False),
        pull_off=jumps.get(True),
        lowest=least,
        largest=largest,
        begun=flat.get(False, False),
        returned=flat.get(True, False),
        used=used,
        resolution=resolution,
        adhesion=held,
        suspected=suspected,
        notes=tuple(notes),
    )


def _lines(
    curve: ForceCurve, own: dict[bool, Indices], noise: float, adhesive: bool
) -> tuple[dict[bool, bool], tuple[tuple[float, float], tuple[float, float]]]:
    """Which legs have a baseline; and the lines of both, one being that of the other where it has none."""
    lines = {back: _baseline(curve, leg[::-1] if back else leg, noise) for back, leg in own.items()}
    flat = {back: _is_flat(curve, leg, lines[back][1]) for back, leg in own.items()}
    used = np.concatenate([*own.values()])
    if adhesive and flat.get(False) and flat.get(True):  # pulled at one force it is not back
        (low, tilt), (high, other) = lines[False], lines[True]
        apart = abs(high - low + (other - tilt) * float(curve.piezo[own[True]].min()))
        deepest = float((curve.force[used] - low - tilt * curve.piezo[used]).min())
        flat[True] = apart < max(2 * SEEN * noise, -UNBROKEN * deepest)
    lowest = float(np.min(curve.force[used])), 0.0
    known = next((lines[back] for back in own if flat[back]), lowest)
    approach, retract = (lines[back] if flat.get(back) else known for back in (False, True))
    return flat, (approach, retract)


def _below(leg: Indices, force: Array, noise: float) -> Indices:
    """The samples of a retraction from the first to the last one below the baseline, if it shows adhesion."""
    below = leg[force[leg] < -SEEN * noise]
    return leg[(leg >= below[0]) & (leg <= below[-1])] if below.size > NEIGHBOURS else leg[:0]


def _refuse(
    curve: ForceCurve,
    force: Array,
    own: dict[bool, Indices],
    noise: float,
    extremes: tuple[float, float],
    adhesive: bool,
) -> None:
    """Raise InputError where there is nothing to fit, or no adhesion; forces are those above the baseline."""
    allowed, (lowest, largest) = SEEN * noise, extremes
    if max(-lowest, largest) < allowed:
        raise InputError(
            f"curve: nothing but noise, of {noise:.3g} nN: the force leaves its baseline by "
            f"{max(-lowest, largest):.3g} nN at most; there is no contact to fit"
        )
    leg = next(iter(own.values()))
    deep = _deepest(curve, leg)
    pressed, rise = float(np.median(force[deep])), straight_line(curve.piezo[deep], force[deep])[1]
    if pressed < -allowed and rise * float(np.ptp(curve.piezo[deep])) < -0.5 * allowed:
        raise InputError(
            "curve: the force falls where the tip is pressed on; it must be positive in repulsion (give its negative)"
        )
    if adhesive and -lowest < allowed:
        raise NoAdhesionError(
            f"curve: no adhesion: the force stays above {lowest:.3g} nN of its baseline, and the noise is "
            f"{noise:.3g} nN; work of adhesion and range cannot be found from it; fit a contact without interaction "
            "(Hertz' theory)"
        )
    if len(own) > 1 and _gains(curve, force, own, allowed):
        raise InputError(
            "curve: where the surfaces attract, the force is lower on approach than on retraction, as if the loop gave "
            "energy; are the samples reversed in time, or is there a drift?"
        )


def _deepest(curve: ForceCurve, leg: Indices) -> Indices:
    """The samples of a leg where the tip is pressed most."""
    return leg[np.argsort(curve.piezo[leg])[-max(5, leg.size // 20) :]]


def _is_flat(curve: ForceCurve, leg: Indices, tilt: float) -> bool:
    """Whether the far part of a leg is a baseline: it rises far less than the part where the tip is pressed most."""
    deep = _deepest(curve, leg)
    return abs(tilt) < BASELINE_SLOPE * abs(straight_line(curve.piezo[deep], curve.force[deep])[1])


def _repeated(piezo: Array) -> float:
    """The distance of positions, where most of them are repeated; otherwise 0."""
    places = np.unique(piezo)
    return float(np.median(np.diff(places))) if 1 < places.size < 0.5 * piezo.size else 0.0


def _spikes(force: Array, noise: float) -> Flags:
    """Samples, few in a row between two steps, that are away from all that is on either side of them."""
    steps, found = np.diff(force), np.zeros(force.size, dtype=bool)
    for there, back in pairwise(np.flatnonzero(np.abs(steps) > JUMP_OVER_NOISE * noise)):
        sides = force[max(there + 1 - NEIGHBOURS, 0) : there + 1], force[back + 1 : back + 1 + NEIGHBOURS]
        if back - there > NEIGHBOURS or not sides[1].size:
            continue
        low, high = sorted(float(np.median(side)) for side in sides)
        level = float(np.median(force[there + 1 : back + 1]))
        away = max(low - level, level - high)
        if away > max(JUMP_OVER_NOISE * noise, high - low) and 2 * np.abs(steps[[there, back]]).min() > away:
            found[there + 1 : back + 1] = True
    for end, beside in ((0, steps[: NEIGHBOURS + 1]), (-1, steps[: -NEIGHBOURS - 2 : -1])):
        first, *others = np.abs(beside) if beside.size > 1 else (0.0, 0.0)
        found[end] |= first > max(JUMP_OVER_NOISE * noise, JUMP_OVER_STEPS * max(others))
    return found


def _end_level(force: Array, piezo: Array, noise: float) -> float | None:
    """The force at the end of a detector, where samples that end at a largest force end there; otherwise None.

    Into contact and towards a pull-off the force changes ever faster. So a detector is at its end where the force is
    flat at the end, and has risen before.
    """
    size = PLATEAU
    while 2 * size <= force.size:
        windows = [slice(force.size - (k + 1) * size, force.size - k * size) for k in range(min(4, force.size // size))]
        (_, slope, share), *before = (straight_line(piezo[one], force[one]) for one in windows)
        steepest, error = FLAT * max(abs(rise) for _, rise, _ in before), SIGNIFICANT * noise * share
        if abs(slope) - error > steepest:
            return None
        level = float(np.median(force[windows[0]]))
        if abs(slope) + error < steepest and level > JUMP_OVER_NOISE * noise:
            return level
        size *= 2
    return None


def straight_line(x: Array, y: Array) -> tuple[float, float, float]:
    """Height at 0 and slope of the line through values, and the standard deviation of its slope for values of 1."""
    middle, height = float(x.mean()), float(y.mean())
    if not np.ptp(x):
        return height, 0.0, math.inf
    away = x - middle
    size = float(away @ away)
    slope = float(away @ y) / size
    return height - slope * middle, slope, 1.0 / math.sqrt(size)


def _last_step(force: Array, noise: float, held: float) -> int:
    """Number of samples up to the last step that stands out of those on either side of it; 0 if there is none.

    Smaller ones are seen among twice as many samples, where they are at least what holds a tip.
    """
    found = 0
    for side, times, least in ((NEIGHBOURS, JUMP_OVER_NOISE, 0.0), (2 * NEIGHBOURS, JUMP_OVER_STEPS, held)):
        if force.size >= 2 * side:
            weights = step_weights(side)
            steps = np.convolve(force, weights[::-1], mode="valid")
            large = np.flatnonzero(steps > max(times * noise * float(np.linalg.norm(weights)), least))
            found = max(found, int(large[-1]) + side) if large.size else found
    return found


@cache
def step_weights(size: int = NEIGHBOURS) -> Array:
    """What times so many values on either side is the step between the straight lines through them."""
    side = np.linalg.pinv(np.vander(np.arange(size) + 0.5, 2))[1]
    return np.concatenate([-side[::-1], side])


def _step(force: Array) -> float:
    """The step in which forces were recorded, if all of them are multiples of one apart; otherwise 0."""
    apart = np.diff(np.unique(force))
    apart = apart[apart > ROUNDED * float(np.ptp(force))]
    steps = apart / apart.min()
    return float(apart.min()) if np.abs(steps - np.round(steps)).max() < 0.01 else 0.0


def _gains(curve: ForceCurve, force: Array, own: dict[bool, Indices], allowed: float) -> bool:
    """Whether most of what lies between the legs, below the baseline, has the approach below the retraction."""
    order = own[True][np.argsort(curve.piezo[own[True]], kind="stable")]
    there, down, here, up = curve.piezo[own[False]], force[own[False]], curve.piezo[order], force[order]
    apart = down - np.interp(there, here, up, left=math.nan, right=math.nan)
    apart = apart[(np.abs(apart) > 2 * allowed) & (down - np.maximum(apart, 0.0) < -allowed)]
    return apart.size >= JUMP_SAMPLES and bool(apart.mean() < -0.1 * -float(force.min()))


def _noise(curve: ForceCurve, own: dict[bool, Indices]) -> float:
    """From second differences where the force is flattest."""
    found = []
    for leg in own.values():
        if leg.size < 12:
            continue
        bends = np.diff(curve.force[leg], 2) / math.sqrt(6.0)
        parts = max(1, min(5, bends.size // 10))
        rows = bends[: bends.size // parts * parts].reshape(parts, -1)
        found += (1.4826 * np.median(np.abs(rows - np.median(rows, axis=1, keepdims=True)), axis=1)).tolist()
    return float(np.median(found)) if found else 0.0


def _baseline(curve: ForceCurve, approach: Indices, noise: float) -> tuple[float, float]:
    """A line through the far part of a leg towards the surface, as far as it fits, and no farther than to a jump."""
    piezo, force = curve.piezo[approach], curve.force[approach]
    steps = np.abs(np.diff(force))
    before = np.maximum(JUMP_OVER_NOISE * noise, 0.5 * JUMP_OVER_STEPS * np.maximum.accumulate(steps)[:-1])
    jumps = np.flatnonzero(steps[1:] > before) + 1
    if jumps.size and jumps[0] + 1 >= JUMP_SAMPLES:
        piezo, force = piezo[: jumps[0] + 1], force[: jumps[0] + 1]
    count = min(max(6, piezo.size // 8), piezo.size)
    height, slope, error = straight_line(piezo[:count], force[:count])
    far = piezo[0] + 0.15 * float(np.ptp(piezo))
    if piezo[count - 1] < far:
        count = max(count, int(np.searchsorted(np.maximum.accumulate(piezo), far)))
    spread = 4 * max(noise, float(np.std(force[:count] - slope * piezo[:count])))
    for _ in range(4):  # longer as long as the line holds
        longer = min(int(1.4 * count), int(0.6 * piezo.size))
        tried = straight_line(piezo[:longer], force[:longer])
        rest = force[:longer] - tried[0] - tried[1] * piezo[:longer]
        if longer <= count or np.abs(rest).max() > spread:
            break
        count, (height, slope, error) = longer, tried
    if abs(slope) < SIGNIFICANT * noise * error:  # noise explains it
        return float(np.mean(force[:count])), 0.0
    return height, slope


def _jump(curve: ForceCurve, force: Array, leg: Indices, sign: float, noise: float) -> MeasuredJump | None:
    """The first large change of a sign within few samples that stands out from those beside it."""
    steps = sign * np.diff(force[leg])
    if steps.size < 2 * JUMP_SAMPLES + 1:
        return None
    found: list[MeasuredJump] = []
    left = steps.copy()
    while True:
        low = high = k = int(np.argmax(left))
        while high - low + 1 < JUMP_SAMPLES:  # neighbours that belong to it
            size, j = max((steps[j], j) for j in (low - 1, high + 1) if 0 <= j < steps.size)
            if size < max(0.08 * steps[k], 3 * noise):
                break
            low, high = min(low, j), max(high, j)
        left[low : high + 1] = 0.0
        step = float(steps[low : high + 1].sum())
        beside = np.abs(np.concatenate([left[max(0, low - NEIGHBOURS) : low], left[high + 1 : high + 1 + NEIGHBOURS]]))
        usual = float(np.sort(beside)[-2:].mean()) if beside.size > 1 else 0.0
        least = max(JUMP_OVER_NOISE * noise, FIRST_JUMP * abs(found[0].step) if found else 0.0)
        if step < least or steps[k] < 0.5 * JUMP_OVER_STEPS * usual:
            return min(found, key=lambda jump: jump.before, default=None)
        before, after = int(leg[low]), int(leg[high + 1])
        piezo = curve.piezo[[before, after]]
        apart = np.abs(np.diff(curve.piezo[leg]))
        width = max(float(np.ptp(piezo)), 0.5 * float(np.median(apart[apart > 0])), _repeated(curve.piezo[leg]))
        found.append(MeasuredJump(before, after, float(piezo.mean()), float(curve.force[before]), sign * step, width))
