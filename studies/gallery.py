"""Figures of every kind, one file each: what the package draws of curves, loops, followed events, regions and states.

    python studies/gallery.py FOLDER    # a minute

Each is drawn from a contact that once made the figure hard to read; `tests/test_gallery.py` asserts of the same figures
that no two labels overlap, that markers lie within the frame, and that axes name their units.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable
from pathlib import Path

from matplotlib.figure import Figure

import contbranch as cb

OMCTS = {"radius": "1 um", "modulus": "5 GPa", "interaction": "gauss", "range": "1 nm"}


def layers(work: float = -1.0) -> cb.Contact:
    """A contact with many layers: a cascade of folds."""
    law = cb.Layered(work_of_adhesion=work, range=0.8, wavelength=1.6)
    return cb.Contact(tip=cb.Parabola(radius=1.0), interaction=law)


def cascade() -> Figure:
    """A cascade of layers: the first and the last fold of a name are named."""
    return cb.trace(layers(), accuracy=1e-4).plot()


def cascade_loop() -> Figure:
    """The loop of a cascade that never touches shows its central gap."""
    return cb.hysteresis(layers(), accuracy=1e-4).plot()


def wetting() -> Figure:
    """First touch beside a wetting fold."""
    return cb.trace(cb.Contact.reduced("gauss", tabor=1.6, sign=-1), accuracy=1e-6).plot(
        "displacement", "contact_radius"
    )


def energies() -> Figure:
    """Energy, with its folds."""
    return cb.trace(cb.Contact.reduced("exponential", tabor=4.0), accuracy=1e-6).plot("displacement", "energy")


def loop_zero() -> Figure:
    """A loop of approach and retraction with the line of zero load."""
    return cb.hysteresis(cb.Contact.reduced("exponential", tabor=1.5), control="displacement", accuracy=1e-6).plot()


def spring_loop() -> Figure:
    """A physical contact on a spring."""
    contact = cb.Contact.physical(**{**OMCTS, "work_of_adhesion": "40 mN/m"})
    return cb.hysteresis(contact, control=cb.Spring(50.0), accuracy=1e-6).plot()


def regions() -> Figure:
    """Regions of stable states, with units."""
    contact = cb.Contact.physical(**OMCTS, work_of_adhesion="-40 mN/m")
    return cb.phase_diagram(contact, vary="interaction.range", between=(0.3, 3.0), accuracy=1e-4).plot()


FIGURES: dict[str, Callable[[], Figure]] = {
    f.__name__: f for f in (cascade, cascade_loop, wetting, energies, loop_zero, spring_loop, regions)
}


def main() -> None:
    """Draw them all."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("folder", type=Path)
    parser.add_argument("names", nargs="*", metavar="NAME", help=f"of {', '.join(FIGURES)}; default: all")
    asked = parser.parse_args()
    asked.folder.mkdir(parents=True, exist_ok=True)
    for name in asked.names or FIGURES:
        FIGURES[name]().savefig(asked.folder / f"{name}.png", dpi=300)


if __name__ == "__main__":
    main()
