"""A measured force curve fitted: a silicon nitride probe (radius 20 nm) on a 1.184 N/m cantilever.

    python studies/sin_curve.py [RAW.ibw]    # under a minute

The curve is `sin_force_curve.csv` (CC0, from the source distribution of afmformats 0.18.7, where its raw file is
tests/data/fmt-igor-fd_SiN_FD_plot.ibw); a raw file is read in its place if it is given. Both legs are those of one
contact if the sensitivity is free; with the one recorded they are not, and each is fitted by itself. The figure is
`docs/figures/force-curve.png`.
"""

from __future__ import annotations

import sys
from pathlib import Path

import contbranch as cb

FOLDER = Path(__file__).parent
FIGURE = FOLDER.parent / "docs" / "figures" / "force-curve.png"
FREE = ("work_of_adhesion", "modulus", "range", "sensitivity")


def curve(raw: str | None = None) -> cb.ForceCurve:
    """The measured curve."""
    return cb.read_force_curve(raw or FOLDER / "sin_force_curve.csv", spring="1.1841 N/m")


def contact() -> cb.Contact:
    """Where the fit starts."""
    return cb.Contact.physical(
        radius="20 nm", modulus="1 GPa", interaction="exponential", work_of_adhesion="50 mN/m", range="1 nm"
    )


def main() -> None:
    """Fit, print, draw; then without the sensitivity, and with other laws."""
    data = curve(*sys.argv[1:2])
    fit = cb.fit(data, contact(), FREE)
    print(fit)
    fit.plot().savefig(FIGURE)
    print("\nWith the sensitivity as recorded:")
    print(cb.fit(data, contact(), FREE[:3]))
    print("\nLaws compared:")
    print(cb.fit(data, contact(), FREE, law="compare"))


if __name__ == "__main__":
    main()
