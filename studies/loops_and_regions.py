"""Hysteresis loops under a spring and of a layered film, and a phase diagram: figures of the pages in docs/howto.

python studies/loops_and_regions.py    # writes docs/figures/loops.png and docs/figures/phases.png; seconds
"""

from __future__ import annotations

import argparse
from pathlib import Path

import matplotlib.image
import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

import contbranch as cb

FIGURES = Path(__file__).resolve().parents[1] / "docs" / "figures"
DPI = 200
GAP = 0.25  # inches between the panels


def loops() -> tuple[cb.Hysteresis, cb.Hysteresis]:
    """An adhesive tip on a spring, and a wetting film squeezed out and drawn in again under a load."""
    adhesion = cb.hysteresis(cb.Contact.reduced(cb.Exponential, tabor=2.0), control=cb.Spring(2.0))
    film = cb.hysteresis(cb.Contact.reduced(cb.Gauss, tabor=4.0, sign=-1), control="load")
    return adhesion, film


def regions() -> cb.PhaseDiagram:
    """Where film and contact coexist, for (1 − β) exponential + β Gauss repulsion of equal range, μ_T = 1."""
    both = cb.Exponential(work_of_adhesion=-0.5, range=1.0) + cb.Gauss(work_of_adhesion=-0.5, range=1.0)
    return cb.phase_diagram(cb.Contact(cb.Parabola(radius=1.0), both), vary="share", between=(0.5, 1.0))


def side_by_side(figures: list[Figure]) -> NDArray[np.uint8]:
    """Figures next to one another, as an RGBA image."""
    panels = []
    for figure in figures:
        figure.set_dpi(DPI)
        figure.canvas.draw()
        panels.append(np.asarray(figure.canvas.buffer_rgba()))  # type: ignore[attr-defined]
    height = max(panel.shape[0] for panel in panels)
    gap = np.full((height, round(GAP * DPI), 4), 255, dtype=np.uint8)
    columns = []
    for panel in panels:
        below = np.full((height - panel.shape[0], panel.shape[1], 4), 255, dtype=np.uint8)
        columns += [np.concatenate([panel, below]), gap]
    return np.concatenate(columns[:-1], axis=1)


def main() -> None:
    """Draw and save both."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--folder", default=str(FIGURES), help="where to draw (default: %(default)s)")
    folder = Path(parser.parse_args().folder)
    matplotlib.image.imsave(folder / "loops.png", side_by_side([loop.plot() for loop in loops()]), dpi=DPI)
    regions().plot().savefig(folder / "phases.png", dpi=DPI)


if __name__ == "__main__":
    main()
