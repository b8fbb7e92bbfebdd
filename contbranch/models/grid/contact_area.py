"""Area and radius of the contact on a lattice, with sub-grid resolution and error estimates.

Three estimates are combined, all from the crossings of the rim with the lines of the lattice (`crossings`): from the
pairs of nodes at the rim, from the profile of the wall pressure inside, and from that of the gap outside. A fit over
more nodes averages over more of the lattice's own error next to the rim, but follows the profile less closely; as many
nodes are used as agree, within the noise, with all fits over fewer.

The noise of each estimate is that found on lattices of many spacings for the contact without interaction, whose radius
is a³ = 3FR/(4E). Areas are turned into shifts of the rim by its length, so that errors are compared in spacings.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from contbranch.arrays import Array

from .crossings import Crossings, find_crossings
from .newton import Equilibrium
from .problem import GridProblem

__all__ = ["ContactArea", "contact_area"]


# Nodes, degree and noise (in spacings, at a radius of 32 spacings) of the fits to the pressure and to the gap, noisiest
# first.
_FITS = (
    (
        (3, 2, 0.016),
        (5, 3, 0.014),
        (4, 2, 0.014),
        (6, 3, 0.011),
        (5, 2, 0.009),
        (8, 3, 0.008),
        (8, 2, 0.0045),
        (12, 3, 0.004),
    ),
    (
        (4, 3, 0.011),
        (3, 2, 0.009),
        (4, 2, 0.007),
        (6, 3, 0.006),
        (5, 2, 0.005),
        (8, 3, 0.005),
        (6, 2, 0.004),
        (12, 3, 0.0035),
        (8, 2, 0.003),
    ),
)
# Rougher fits, and the part of their distance from the noisiest that this is in error where no other agrees.
_ROUGH = ((3, 1, 0.3), (3, 2, 1.0))
# All of them, as many for either.
_TRIED = np.array([(rough, *fits, fits[-1])[:10] for rough, fits in zip(_ROUGH, _FITS, strict=True)])[..., :2].astype(
    int
)
_NOISE_OF_PAIRS = 0.011
_RADIUS_OF_NOISE = 32.0
_GROWTH_OF_NOISE = 0.5
# Share of the rim along which a fit must exist.
_SHARE = 0.6
# A contact of few nodes carries its load on a disc that the lattice chooses: error in spacings at a radius of one, and
# the power with which it falls.
_FEW, _FEW_POWER = 0.5, 1.8
# Such that the true error, of contacts of all laws at random, is below the estimate in 95 % of the cases.
_SAFETY = 1.5


@dataclass(frozen=True)
class ContactArea:
    """Contact area and radius, in reduced units.

    Attributes
    ----------
    radius, radius_error : float
        √(A/π), for a contact of any shape, and its error estimate.
    area, area_error : float
        A and its error estimate.
    from_pairs, from_pressure, from_gap : float
        A by each of the three estimates; the latter two are `from_pairs` where the contact is too small for them.
    nodes : int
        Nodes of the whole lattice in contact.
    perimeter : float
        Length of the rim.
    """

    radius: float = 0.0
    radius_error: float = 0.0
    area: float = 0.0
    area_error: float = 0.0
    from_pairs: float = 0.0
    from_pressure: float = 0.0
    from_gap: float = 0.0
    nodes: int = 0
    perimeter: float = 0.0


def contact_area(problem: GridProblem, equilibrium: Equilibrium) -> ContactArea:
    """Measure the contact of an equilibrium; without a node in contact all is zero."""
    contact = equilibrium.contact
    if not contact.any():
        return ContactArea()
    wall = np.where(contact, np.maximum(equilibrium.fields.excess, 0.0), 0.0)
    crossings = find_crossings(problem.lattice, contact, wall, equilibrium.fields.gap)
    return _measured(crossings, problem.lattice.multiplicity)


def _measured(crossings: Crossings, multiplicity: int) -> ContactArea:
    nodes, pairs, spacing = crossings.nodes * multiplicity, crossings.area, crossings.spacing
    if crossings.cosine.size == 0:
        # The whole cell.
        return ContactArea(math.sqrt(pairs / math.pi), 0.0, pairs, 0.0, pairs, pairs, pairs, nodes)
    strip = crossings.perimeter * spacing
    noise = (_RADIUS_OF_NOISE * 2.0 * math.pi * spacing / crossings.perimeter) ** _GROWTH_OF_NOISE
    enlarged, shares = crossings.shifts(_TRIED)
    (pressure, pressure_error), (gap, gap_error) = map(_fitted, (0, 1), enlarged / strip, shares, (noise, noise))
    bent = sum(error for error in (pressure_error, gap_error) if math.isfinite(error))
    pairs_error = max(_NOISE_OF_PAIRS * noise, 0.5 * pressure_error if math.isfinite(pressure_error) else 0.0)

    shifts = np.array([0.0, pressure, gap])
    precision = np.array([pairs_error, pressure_error, gap_error]) ** -2.0
    total = float(precision.sum())
    shift = float(precision @ shifts) / total
    scatter = max(total**-0.5, float(precision @ np.abs(shifts - shift)) / total)
    area = pairs + shift * strip
    if area <= 0.0:
        area = crossings.node_area * crossings.nodes
    # The three share the error of the equilibrium itself: it grows with what bends the profiles near the rim, and where
    # the contact has few nodes.
    few = _FEW * (0.5 * crossings.perimeter * spacing / area) ** _FEW_POWER
    area_error = _SAFETY * strip * math.hypot(2.0 * scatter, 0.5 * bent, few)
    radius = math.sqrt(area / math.pi)
    return ContactArea(
        radius=radius,
        radius_error=area_error / (2.0 * math.pi * radius),
        area=area,
        area_error=area_error,
        from_pairs=pairs,
        from_pressure=pairs + pressure * strip,
        from_gap=pairs + gap * strip,
        nodes=nodes,
        # the rim of the nodes' squares, shrunk to the area
        perimeter=crossings.length * math.sqrt(area / (crossings.node_area * crossings.nodes)),
    )


def _fitted(side: int, shifts: Array, shares: Array, noise: float) -> tuple[float, float]:
    """Shift of the rim by the fits of one profile, in spacings, and its error; infinite where there is no fit."""
    found: list[tuple[float, float]] = []
    rough, *others = shifts.tolist()
    for (*_, level), shift, share in zip(_FITS[side], others, shares[1:], strict=False):
        if share < _SHARE:
            continue
        uncertain = level * noise
        if any(abs(shift - other) > 2.0 * math.hypot(uncertain, error) for other, error in found):
            break
        found.append((shift, uncertain))
    if not found:
        return 0.0, math.inf
    shift, uncertain = found[-1]
    if len(found) > 1:
        return shift, math.hypot(uncertain, 0.5 * (shift - found[-2][0]))
    return shift, math.hypot(uncertain, _ROUGH[side][2] * (rough - shift))
