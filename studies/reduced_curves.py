"""The tables of reduced curves that are shipped with the package: `contbranch/measure/reduced.npz`.

    python studies/reduced_curves.py

For every law of `SHIPPED` the curve of a parabola is traced at Tabor coefficients a factor exp(0.2) apart. Any other
law's table is made in the same way when a fit needs it.
"""

from __future__ import annotations

import sys
import time
from pathlib import Path

import numpy as np

from contbranch.contact.interactions import INTERACTIONS
from contbranch.measure import reduced


def main() -> None:
    """Trace the curves of all laws and write them."""
    path = Path(reduced.__file__).with_name("reduced.npz")
    tables = {}
    for name in reduced.SHIPPED:
        found = []
        for node in reduced.nodes():
            began = time.perf_counter()
            found.append(reduced.traced_node(INTERACTIONS[name], 1.0, node, reduced.TOP))
            tabor = reduced.RATIO**node
            print(f"{name} μ_T = {tabor:.4f}: {time.perf_counter() - began:.1f} s", file=sys.stderr, flush=True)
        tables[name] = np.array(found, dtype=np.float32)
    np.savez_compressed(path, **tables)
    print(f"{path}: {path.stat().st_size / 1024:.0f} kB")


if __name__ == "__main__":
    main()
