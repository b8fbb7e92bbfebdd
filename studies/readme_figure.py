"""The figure of README.md: squeeze-out of a wetting film, and an adhesive force curve.

    python studies/readme_figure.py    # writes docs/figures/readme.png; seconds

Left: contact radius against load for the Gauss repulsion, μ_T = 4. Right: load against displacement for the exponential
attraction, μ_T = 4. Both are drawn as `Diagram.plot` draws them.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import matplotlib.image
import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

import contbranch as cb

FIGURE = Path(__file__).resolve().parents[1] / "docs" / "figures" / "readme.png"
DPI = 220
GAP = 0.15  # inches between the panels


def diagrams() -> tuple[cb.Diagram, cb.Diagram]:
    """The two diagrams: the repulsion under load control, the attraction under displacement control."""
    squeeze_out = cb.trace(cb.Contact.reduced(cb.Gauss, tabor=4.0, sign=-1), accuracy=1e-8)
    adhesion = cb.trace(cb.Contact.reduced(cb.Exponential, tabor=4.0), control="displacement", accuracy=1e-8)
    return squeeze_out, adhesion


def picture() -> NDArray[np.uint8]:
    """Both panels side by side, an RGBA image."""
    squeeze_out, adhesion = diagrams()
    panels = [
        _pixels(squeeze_out.plot(x="load", y="contact_radius"), "(a) Gauss repulsion"),
        _pixels(adhesion.plot(x="displacement", y="load"), "(b) exponential attraction"),
    ]
    height = max(panel.shape[0] for panel in panels)
    width = sum(panel.shape[1] for panel in panels) + round(GAP * DPI)
    whole = np.full((height, width, 4), 255, dtype=np.uint8)
    for panel, left in zip(panels, (0, width - panels[1].shape[1]), strict=True):
        rows, columns = panel.shape[:2]
        whole[height - rows :, left : left + columns] = panel  # bottoms aligned
    return whole


def _pixels(figure: Figure, title: str) -> NDArray[np.uint8]:
    """The figure as RGBA, with a title in the upper left corner of its axes, where the curves are not."""
    axes = figure.axes[0]
    behind = {"facecolor": "white", "edgecolor": "none", "pad": 1.0}
    axes.text(0.03, 0.96, f"{title}, $\\mu_T = 4$", transform=axes.transAxes, va="top", fontsize=8.0, bbox=behind)
    figure.set_dpi(DPI)
    figure.canvas.draw()
    return np.asarray(figure.canvas.buffer_rgba())  # type: ignore[attr-defined]


def main() -> None:
    """Draw and save."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--figure", default=str(FIGURE), metavar="FILE", help="where to draw (default: %(default)s)")
    matplotlib.image.imsave(parser.parse_args().figure, picture(), dpi=DPI)


if __name__ == "__main__":
    main()
