"""A file of an instrument fitted twice: by a contact that explains it, and by one that does not.

    python studies/jpk_curve.py

The file, of a JPK CellHesion, is from the source distribution of afmformats 0.18.7 (tests/data, MIT licence). It does
not tell its tip: a bead of radius 2.5 µm is assumed. The figure is `docs/figures/jpk-curve.png`.
"""

from __future__ import annotations

from pathlib import Path

import matplotlib.image
import numpy as np

import contbranch as cb

ROOT = Path(__file__).resolve().parents[1]
FILE = ROOT / "tests" / "reference" / "force_curves" / "fmt-jpk-fd_spot3-0192.jpk-force"
FIGURE = ROOT / "docs" / "figures" / "jpk-curve.png"


def main() -> None:
    """Fit, print, draw what is close to the contact."""
    curve, panels = cb.read_force_curve(FILE), []
    bead = {"radius": "2.5 um", "modulus": "10 kPa"}
    adhesion = {"interaction": "maugis-dugdale", "work_of_adhesion": "0.1 mN/m", "range": "10 nm"}
    hertz = cb.fit(curve, cb.Contact.physical(**bead), ("modulus",))
    jkr = cb.fit(curve, cb.Contact.physical(**bead, **adhesion), law="jkr")
    for title, fit in (("(a) Hertz", hertz), ("(b) JKR", jkr)):
        print(title, fit, "", sep="\n")
        figure = fit.plot()
        figure.axes[0].set_xlim(-18.35, -17.78)
        figure.axes[0].set_title(title, fontsize=9.0)
        figure.axes[1].set_ylim(-450.0, 300.0)
        figure.set_dpi(220)
        figure.canvas.draw()
        panels.append(np.asarray(figure.canvas.buffer_rgba()))  # type: ignore[attr-defined]
    matplotlib.image.imsave(FIGURE, np.hstack(panels), dpi=220)


if __name__ == "__main__":
    main()
