"""Do the errors hold that folds and first touch on grids state? Random contacts, against the axisymmetric model.

    python studies/grid_thresholds.py                # 60 contacts, some minutes
    python studies/grid_thresholds.py --seed 7 --count 20

Law, sign, μ_T (1/2 to 4), control, cell and grid are drawn. A line for every contact: true error over stated error, of
what is controlled at folds, and of load and displacement at first touch; then how many are above 1, and the largest.
"""

from __future__ import annotations

import argparse
import warnings
from collections.abc import Iterator

import numpy as np

import contbranch as cb

LAWS = cb.Gauss, cb.Exponential, cb.VanDerWaals
GRIDS = 48, 64, 96, 128, 160


def drawn(number: int, seed: int = 1) -> tuple[str, cb.Contact, str, cb.FreeSpace]:
    """One of the contacts, with its control and its model; the same for the same numbers."""
    rng = np.random.default_rng([seed, number])
    law, sign = LAWS[rng.integers(3)], [1, -1][rng.integers(2)]
    tabor = float(np.exp(rng.uniform(np.log(0.5), np.log(4.0))))
    control = ["load", "displacement"][rng.integers(2)]
    grid, cell = int(rng.choice(GRIDS)), float(rng.uniform(9.0, 13.0))
    text = f"{law.__name__} {sign:+d}, μ_T = {tabor:.3f}, {control}, cell {cell:.2f}, {grid}²"
    return text, cb.Contact.reduced(law, tabor, sign), control, cb.FreeSpace(cell=cell, grid=grid)


def ratios(found: cb.Diagram, exact: cb.Diagram) -> Iterator[tuple[str, float]]:
    """True error over stated error of the thresholds that both have."""
    for one in exact.events:
        if not (one.kind == "touch" or (one.kind == "fold" and one.name)):
            continue
        own = [e for e in found.events if (e.kind, e.control, e.name) == (one.kind, one.control, one.name)]
        if not own:
            yield f"{one.name or one.kind} ({one.control})", np.nan
            continue
        near = min(own, key=lambda event, one=one: abs(event.load - one.load))
        for field in ("load", "displacement"):
            if one.kind == "touch" or field == one.control:
                error = abs(getattr(near, field) - getattr(one, field))
                yield f"{one.name or one.kind} ({field})", error / near.error[field]


def main() -> None:
    """Trace, compare and print."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--count", type=int, default=60, help="contacts")
    parser.add_argument("--seed", type=int, default=1, help="of the draw")
    given = parser.parse_args()
    warnings.simplefilter("ignore", cb.GridWarning)
    every: list[float] = []
    for number in range(given.count):
        text, contact, control, model = drawn(number, given.seed)
        found = cb.trace(contact, control, model=model, modes=0)
        own = dict(ratios(found, cb.trace(contact, control, accuracy=1e-9, modes=0)))
        every += own.values()
        told = ", ".join(f"{name} {'missing' if np.isnan(ratio) else f'{ratio:.2f}'}" for name, ratio in own.items())
        print(f"{number:3d} {text}, {found.status}: {told}", flush=True)
    known = np.array([ratio for ratio in every if not np.isnan(ratio)])
    print(
        f"{(known <= 1.0).sum()} of {len(known)} thresholds within their errors, the largest ratio {known.max():.2f}; "
        f"{len(every) - len(known)} not found"
    )


if __name__ == "__main__":
    main()
