"""The COS equation, its modified form and that with a free exponent, fitted to exact branches over μ_T.

    python studies/paper/cos_fits.py [--fast] [--output DIR]    # DIR/tables/cos_fits.csv, force_displacement.csv

One row of `cos_fits.csv` is one fit; `force_displacement.csv` has F(d) of the exact contacts on approach and retraction
under displacement control, jumps included (two rows at one displacement), beside that of the fit with a free exponent.
"""

from __future__ import annotations

import argparse
import csv
import sys
import time
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import numpy as np

if __name__ == "__main__":
    sys.path.append(str(Path(__file__).resolve().parents[2]))
import contbranch as cb
from contbranch.theory import cos
from contbranch.threads import one_thread
from studies.paper.common import DOCS, LAWS, Array, branch, contact, table, traced

__all__ = ["FORMS", "TABORS", "Row", "fits", "force_curve", "in_words", "table_of_fits", "window"]

TABORS = tuple(2.0**k for k in range(-6, 7))
# Rows kept of each leg of F(d).
ROWS = 40
FORMS = dict(zip(cos.FORMS, ("(47)", "(48)", "free exponent"), strict=True))

COLUMNS = (
    "law",
    "tabor",
    "form",
    "pull_off_load",
    "pull_off_radius",
    "zero_load_radius",
    "alpha",
    "exponent",
    "lift_0",
)
COLUMNS += ("lift_1", "radius_error", "radius_rms_error", "displacement_error", "force_error")


@dataclass(frozen=True)
class Row:
    """A fit, with its error in F(d).

    Attributes
    ----------
    law, tabor : str, float
    fit : Fitted
    mean : float
        Root mean square of the relative error of the contact radius.
    force, late : float
        Largest error of F(d), in F_p, where the load control would keep the contact, and from the loss of contact under
        displacement control on.
    """

    law: str
    tabor: float
    fit: cos.Fitted
    mean: float
    force: float
    late: float


def window(law: str, tabor: float, count: int = 201) -> tuple[Array, Array, Array]:
    """Load, radius and displacement of stable contacts at loads evenly spaced from -F_p to 2 F_p."""
    found = branch(law, tabor, 1, 14.0)
    least = found.load[found.stable][0]
    load = np.linspace(least, -2.0 * least, count)
    return (load, *found.at_load(load))


@cache
def fits(law: str, tabor: float) -> tuple[Row, ...]:
    """All forms fitted to a law at a Tabor coefficient."""
    load, radius, displacement = window(law, tabor)
    exact, rows = branch(law, tabor, 1, 14.0), []
    least = traced(law, tabor, 1, 14.0).thresholds.get("pull_off_displacement_radius", 0.0)
    kept = (exact.radius >= least) & (exact.load <= load[-1])
    for form in FORMS:
        fit = cos.fit(load, radius, displacement, form=form)
        off = np.abs(fit.force(exact.displacement) - exact.load) / fit.pull_off_load
        known = kept & (exact.displacement >= float(fit.displacement(fit.detachment_radius)))
        mean = float(np.sqrt(np.mean((fit.contact_radius(load) / radius - 1.0) ** 2)))
        rows.append(Row(law, tabor, fit, mean, float(off[known & exact.stable].max()), float(off[known].max())))
    return tuple(rows)


def force_curve(law: str, tabor: float) -> list[list[float]]:
    """Displacement, exact load, contact radius, direction (1 approach, -1 retraction) and fitted load."""
    loop = cb.hysteresis(contact(law, tabor), control="displacement", max_load=10.0)
    fit = fits(law, tabor)[-1].fit
    path = loop.path
    fitted = np.where(path.contact_radius > 0.0, fit.force(path.displacement), 0.0)
    number = np.arange(len(path))
    ends = np.flatnonzero(np.diff(path.leg)) + 1
    leg = np.split(number, ends)
    kept = np.unique(
        np.concatenate([one[np.linspace(0, len(one) - 1, min(len(one), ROWS)).round().astype(int)] for one in leg])
    )
    columns = (column[kept] for column in (path.displacement, path.load, path.contact_radius, path.direction, fitted))
    return [[float(value) for value in row] for row in zip(*columns, strict=True)]


def in_words(tabor: float) -> str:
    """A power of two."""
    return f"{tabor:g}" if tabor >= 1.0 else f"1/{1.0 / tabor:g}"


def table_of_fits(law: str, tabors: tuple[float, ...]) -> str:
    """Parameters and errors in Markdown."""
    head = ("μ_T", "F_p", "a_p", "α (47)", "α (48)", "α, exponent", "p, q")
    head += tuple(
        f"{what} {name}"
        for what in ("a_c: largest (rms) error, %,", "F(d): largest error, % of F_p,")
        for name in FORMS.values()
    )
    rows = []
    for tabor in tabors:
        found = fits(law, tabor)
        first = found[0].fit
        rows.append(
            [
                in_words(tabor),
                f"{first.pull_off_load:.4f}",
                f"{first.pull_off_radius:.4f}",
                f"{first.alpha:.4f}",
                f"{found[1].fit.alpha:.4f}",
                f"{found[2].fit.alpha:.4f}, {found[2].fit.exponent:.4f}",
                f"{first.lift[0]:.4f}, {first.lift[1]:.4f}",
                *(f"{100 * row.fit.error:.3f} ({100 * row.mean:.3f})" for row in found),
                *(f"{100 * row.force:.2f}" for row in found),
            ]
        )
    return table(head, rows)


def write(folder: Path, laws: tuple[str, ...], tabors: tuple[float, ...]) -> list[Path]:
    """Write both tables."""
    folder.mkdir(parents=True, exist_ok=True)
    first, second = folder / "cos_fits.csv", folder / "force_displacement.csv"
    with first.open("w", newline="", encoding="utf-8") as file:
        out = csv.writer(file, lineterminator="\n")
        out.writerow(COLUMNS)
        for law in laws:
            for tabor in tabors:
                for row in fits(law, tabor):
                    one = row.fit
                    numbers = (one.pull_off_load, one.pull_off_radius, one.zero_load_radius, one.alpha, one.exponent)
                    numbers += (*one.lift, one.error, row.mean, one.displacement_error, row.force)
                    out.writerow([law, tabor, one.form, *(f"{value:.8g}" for value in numbers)])
    with second.open("w", newline="", encoding="utf-8") as file:
        out = csv.writer(file, lineterminator="\n")
        out.writerow(["law", "tabor", "displacement", "load", "contact_radius", "direction", "load_fitted"])
        for law in laws:
            for tabor in tabors:
                for values in force_curve(law, tabor):
                    out.writerow([law, tabor, *(f"{value:.8g}" for value in values)])
    return [first, second]


@one_thread
def write_all(folder: Path, fast: bool) -> float:
    """Write both tables, or short ones, and return the processor time in seconds."""
    began = time.process_time()
    write(folder, ("Maugis-Dugdale",) if fast else tuple(LAWS), (0.25, 1.0, 4.0) if fast else TABORS)
    return time.process_time() - began


def main() -> None:
    """Write the tables."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--fast", action="store_true", help="Maugis-Dugdale alone, at three Tabor coefficients")
    parser.add_argument("--output", type=Path, default=DOCS, metavar="DIR", help="folder of tables (%(default)s)")
    given = parser.parse_args()
    print(f"{given.output / 'tables'}: {write_all(given.output / 'tables', given.fast):.0f} s")


if __name__ == "__main__":
    main()
