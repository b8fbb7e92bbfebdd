"""Where numbers leave what the theory holds for, or are likely to be in other units than they are taken to be in."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

import numpy as np

from contbranch.arrays import Array
from contbranch.contact.interaction_law import places_of, terms_of
from contbranch.contact.tips import Parabola
from contbranch.errors import warned

if TYPE_CHECKING:
    from contbranch.contact.contact import Contact
    from contbranch.contact.interaction_law import Interaction
    from contbranch.contact.tip_shape import Tip


# Slope of the tip at the rim of the contact, a/R of a parabola, beyond which strains are not small. A sphere bears
# 3.8 % more than a parabola there: of what the theory neglects this is the part that is easily known.
STEEPEST = 0.3
# Radii, in units of the tip's own, at which v r² is compared with itself farther out.
FAR = 1e12
# Range of a law in radii of a parabola from which on a round tip is told from it.
FAR_ROUND = 0.1
# Diameter of the smallest atom, nm.
ATOM = 0.1
# Lengths in nm and moduli in nN/nm² (GPa) that nothing has: diamond has 1100 GPa.
SHORTEST = 1e-3
STIFFEST = 5e3
# And below which none is: 1 Pa. A work of adhesion, nN/nm = N/m, that no surface has: diamond has about 10.
SOFTEST, STRONGEST = 1e-9, 20.0


def in_pieces(tip: Tip, law: Interaction | None) -> bool:
    """Whether tip or law are put together from pieces, as tables are."""
    return law is not None and (law.pieced or math.isfinite(tip.table_end))


def perhaps_in_pieces(tip: Tip, law: Interaction | None) -> bool:
    """Whether they are, or of a class of the user's own, which may be."""
    return in_pieces(tip, law) or not all(
        type(one).__module__.startswith("contbranch.") for one in (tip, *terms_of(law))
    )


def _named(contact: Contact) -> Iterator[tuple[str, Any]]:
    """Tip and laws with their names."""
    terms = terms_of(contact.interaction)
    return zip(["tip", *places_of(terms)], [contact.tip, *terms], strict=True)


def warn_of_units(contact: Contact) -> None:
    """Warn of numbers in nm and nN that look like metres and pascals, and of lengths in nm among reduced ones."""
    if not contact.units.physical:
        if getattr(contact.tip, "in_nm", False):
            warned(
                "tip: a unit of length makes the numbers of its map nm, and the contact has reduced units; make it "
                "with cb.Contact.physical, or give the map cell= and unit= as numbers"
            )
        for place, law in _named(contact):
            if law is not contact.tip and getattr(law, "in_nm", False):
                warned(f"{place}: its numbers are in mV and nm, the contact is in reduced units; use Contact.physical")
        return
    for name, part in _named(contact):
        for field, dimension in part.dimensions.items():
            value = getattr(part, field)
            if dimension == "length" and isinstance(value, float) and 0.0 < value < SHORTEST:
                warned(f"{name}.{field}: {value:g} is taken in nm; write '{value:g} m' if that is meant")
    if contact.modulus < SOFTEST:
        warned(
            f"modulus: {1e9 * contact.modulus:.3g} Pa is softer than any solid; mPa is a millipascal, a million is MPa"
        )
    works = [(name, getattr(part, "work_of_adhesion", 0.0)) for name, part in _named(contact)]
    for name, work in works:
        if isinstance(work, float) and abs(work) > STRONGEST:
            warned(f"{name}.work_of_adhesion: {work:g} N/m is more than any surface has; write mN/m if that is meant")
    if contact.modulus > STIFFEST:
        value = f"{contact.modulus:g}"
        warned(f"modulus: {value} is taken in nN/nm² = GPa, and diamond has 1100; write '{value} Pa' if that is meant")


@np.errstate(all="ignore")  # so far out numbers may overflow, and then decay fast enough
def energy_pole(tip: Tip, law: Interaction | None) -> float:
    """lim r² v for r → ∞: where it is not zero, as for a cone in a law that decays like 1/g², energies are infinite."""
    if law is None or math.isfinite(tip.extent):
        return 0.0
    r = FAR * tip.natural_length * np.array([1.0, 8.0])
    first, second = (r * r * law.evaluate(tip.height(r)).energy).tolist()
    return second if abs(second - first) < 0.01 * abs(first) else 0.0


def _slopes(contact: Contact, contact_radius: Array) -> Array:
    """Slopes of the tip at radii of contact; the steeper one of both axes where it is not round, the mean of a map."""
    tip, round_tip = contact.tip, contact.tip.axisymmetric
    if (rms := getattr(tip, "rms_slope", None)) is not None:
        return np.full(contact_radius.shape, float(rms))
    places = np.maximum(contact_radius, 1e-12 * contact.scales.in_plane)
    if round_tip is not None:
        return np.asarray(round_tip.height_derivative(np.minimum(places, (1.0 - 1e-9) * round_tip.extent)))
    step = 1e-4 * places
    along_x = tip.surface(places + step, 0.0) - tip.surface(places - step, 0.0)
    along_y = tip.surface(0.0, places + step) - tip.surface(0.0, places - step)
    return np.maximum(along_x, along_y) / (2 * step)


def notes(contact: Contact, load: Array, displacement: Array, contact_radius: Array) -> str:
    """Sentences on limits of tip and laws, and on states outside of what is described or holds; mostly none."""
    found = [f"{name}: {part.limitation}." for name, part in _named(contact) if part.limitation]
    tip = contact.tip.axisymmetric
    if tip is not None:
        if energy_pole(tip, contact.interaction):
            found.append(
                "The law decays so slowly that the energy around this tip is infinite: energies are differences."
            )
        if math.isfinite(end := tip.table_end):
            film = (contact_radius == 0.0) & (displacement > tip.transform(end))  # ζ(r): to bear load out to r
            beyond = load[film | (contact_radius > end)]
            if beyond.size:
                found.append(
                    f"tip: its table ends at a radius of {end:.4g}; from a load of {beyond.min():.4g} on, what "
                    "continues it bears load, too."
                )
    if not contact.units.physical:
        return " ".join(found)
    slope = np.where(contact_radius > 0.0, _slopes(contact, contact_radius), 0.0)
    steep = slope > STEEPEST
    if steep.any():
        found.append(
            f"The tip's slope {'(rms)' if hasattr(contact.tip, 'rms_slope') else 'at the rim of the contact'} exceeds "
            f"{STEEPEST:g} from a load of {load[steep].min():.4g} nN on (largest {slope.max():.2g}): beyond linear "
            "elasticity, which holds for small slopes."
        )
    for name, part in _named(contact):
        if isinstance(contact.tip, Parabola) and getattr(part, "range", 0.0) > FAR_ROUND * contact.tip.radius:
            found.append(
                f"{name}.range: is {part.range / contact.tip.radius:.2g} of the tip's radius. Out to where it acts a "
                "round tip is no parabola: loads differ by as much, relatively; spherical-cap is a sphere."
            )
        if getattr(part, "range", ATOM) < ATOM:
            found.append(f"{name}.range: {part.range:.3g} nm is less than an atom's size ({ATOM:g} nm).")
    return " ".join(found)
