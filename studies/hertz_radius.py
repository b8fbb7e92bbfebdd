"""The contact radius of Hertz' contact on a grid, below the spacing of the nodes.

Run as `python studies/hertz_radius.py`; ten seconds.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

import contbranch as cb
from contbranch.models.grid.contact_area import contact_area
from contbranch.models.grid.newton import Equilibrium, Hold, Settings
from contbranch.models.grid.observables import CUBES
from contbranch.models.grid.problem import GridProblem
from contbranch.models.grid.setup import Setup
from contbranch.models.grid.sketch import drawn, relatives
from contbranch.models.grid.solve import reached

Model = cb.Periodic | cb.FreeSpace


def image_curvature(problem: GridProblem, equilibrium: Equilibrium) -> float:
    """How much the images in a periodic cell add to the curvature of a tip, κ of r²/2 → (1 + κ) r²/2, to leading order.

    κ = 9.0336 F/(2π E L³): without interaction the contact radius is smaller by κ/3 than that of a single contact at
    the same load, 0.125 % at a = L/8. Zero in free space.
    """
    lattice = problem.lattice
    return CUBES * equilibrium.load / (2.0 * np.pi * lattice.edges[0] ** 3) if lattice.kind == "periodic" else 0.0


@dataclass(frozen=True)
class Solved:
    """An equilibrium on a lattice with the setup it belongs to."""

    setup: Setup
    equilibrium: Equilibrium


def solved(contact: cb.Contact, model: Model, load: float, accuracy: float = 1e-6) -> Solved:
    """The equilibrium with a load next to the first one of the axisymmetric model; reduced units.

    Raises
    ------
    RuntimeError
        If none was found.
    """
    setup = model.setup(contact, "load", load, accuracy)
    related, _ = relatives(contact, "load", load)
    found = reached(setup, drawn(setup, related[0]), Hold(load), Settings(tolerance=1e-9))
    if found is None:
        raise RuntimeError(f"no equilibrium at load {load:g} with {model}")
    return Solved(setup, found)


SHARE = 1.0 / 8.0
# Radii, in spacings about the nominal one, over which the largest error is taken: where the nodes lie is chance.
SHIFTS = (-0.4, -0.2, 0.0, 0.2, 0.4)


@dataclass(frozen=True)
class HertzRow:
    """Relative errors of the contact radius of Hertz' contact with a radius of an eighth of the cell.

    Attributes
    ----------
    nodes : int
        Spacings in the radius, a/Δa.
    counted, fitted : float
        Largest relative error of √(nodes in contact · Δa²/π), and of the radius with sub-grid resolution.
    corrected : float
        That of the latter when the images' curvature is taken off; the same as `fitted` in free space.
    estimate : float
        Largest error estimate of the radius, relative, which leaves the images out.
    """

    nodes: int
    counted: float
    fitted: float
    corrected: float
    estimate: float


def hertz(nodes: int, kind: type[Model]) -> HertzRow:
    """Solve Hertz' contact, 4 a³/3 = F, at radii of about so many spacings."""
    contact = cb.Contact(tip=cb.Parabola(radius=1.0))
    rows = []
    for shift in SHIFTS:
        radius = 1.0 + shift / nodes
        found = solved(contact, kind(cell=1.0 / SHARE, grid=round(nodes / SHARE)), 4.0 * radius**3 / 3.0)
        area = contact_area(found.setup.problem, found.equilibrium)
        counted = np.sqrt(area.nodes * found.setup.lattice.spacing**2 / np.pi)
        images = 1.0 + image_curvature(found.setup.problem, found.equilibrium) / 3.0
        values = np.array([counted, area.radius, area.radius * images]) / radius
        rows.append([*np.abs(values - 1.0), area.radius_error / radius])
    worst = np.array(rows).max(axis=0)
    return HertzRow(nodes, *(float(value) for value in worst))


def report_hertz(counts: Sequence[int]) -> str:
    """Errors of the contact radius against the spacing, for both kinds of cell."""
    rows = []
    for nodes in counts:
        periodic, free = hertz(nodes, cb.Periodic), hertz(nodes, cb.FreeSpace)
        errors = (
            periodic.counted,
            periodic.fitted,
            periodic.corrected,
            periodic.estimate,
            free.counted,
            free.fitted,
            free.estimate,
        )
        rows.append([f"1/{nodes}", *(f"{100 * error:.3f} %" for error in errors)])
    head = (
        "Δa/a_c",
        "periodic: counted",
        "sub-grid",
        "without images",
        "estimate",
        "free: counted",
        "sub-grid",
        "estimate",
    )
    return "\n".join(f"| {' | '.join(row)} |" for row in (head, ["---"] * len(head), *rows))


def main() -> None:
    """Print the table."""
    argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0]).parse_args()
    print(report_hertz((8, 16, 32, 64)))


if __name__ == "__main__":
    main()
