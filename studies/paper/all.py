"""Every figure of the paper and its Table 1, and one page that shows them all beside what the paper prints.

    python studies/paper/all.py [--fast] [--output DIR] [--processes N]    # DIR/paper.md, figures/paper, tables

The page has the figures, every number that the paper prints with its reading accuracy, ours with its error, a verdict,
and the reason of a difference. The exit status is 1 if a difference has no explanation.
"""

from __future__ import annotations

import argparse
import importlib
import sys
import time
from collections import Counter
from concurrent.futures import ProcessPoolExecutor
from functools import partial
from multiprocessing import get_context
from pathlib import Path

if __name__ == "__main__":
    sys.path.append(str(Path(__file__).resolve().parents[2]))
from contbranch.threads import one_thread
from studies.paper import cos_fits
from studies.paper.common import DOCS, Result, save, table

# Those that take longest first.
NAMES = ("table1", "fig13", "fig04", "fig09", "fig15", "fig10", "fig03", "fig17", "fig08", "fig12", "fig16", "fig18")
NAMES += ("fig19", "fig11", "fig05", "fig06", "fig07", "fig14", "fig02")
HEAD = """# The paper, figure by figure

Figures 2 to 19 and Table 1 of [Müser's paper](model.md#references), computed anew by `python studies/paper/all.py`,
which writes this page. [Reduced units](model.md#conventions); equation numbers are the paper's. A number agrees if it
lies within half a unit of the last digit printed, or within what "about" leaves open. Where it does not, the verdict is
the kind of reason:

- *misprint*: the paper contradicts itself or its own model;
- *lattice*: its values come from a lattice in a periodic cell;
- *window*: an exponent, or what a power law extrapolates to, depends on the loads that are fitted;
- *last digit*: the caption of Table 1 says that its last digits may not be significant;
- *metastability*: a state was left at another load than where it ceases to be stable;
- *fit*: a constant chosen for the smallest error instead of an exact limit.

A reason counts only as far as it goes: every one has a largest difference that it explains, and one beyond that is
marked DIFFERS. Figures 1 and 20 are drawings.
"""


def made(name: str, fast: bool, folder: Path) -> tuple[Result, float]:
    """Make one figure, save it, and return what was found without the picture; processor time in seconds."""
    began = time.process_time()
    result = one_thread(importlib.import_module(f"studies.paper.{name}").make)(fast)
    save(result, folder)
    return result.told(), time.process_time() - began


def page(results: list[Result]) -> str:
    """The page: a summary, then all figures with their tables."""
    verdicts = Counter(one.verdict for result in results for one in result.findings)
    said = Counter(one.verdict.split(":")[0] for result in results for one in result.statements)
    rows = [["numbers", *_counted(verdicts, "agrees")], ["statements", *_counted(said, "holds")]]
    parts = [HEAD, table(("", "compared", "agree", "differ, explained", "differ, unexplained"), rows)]
    for result in results:
        label = "Table 1" if result.name == "table1" else f"Figure {int(result.name[3:])}"
        title = label if result.title == label else f"{label}: {result.title}"
        parts += [f"## {title}", f"![{title}](figures/paper/{result.name}.png)", result.text()]
    return "\n\n".join(part.strip("\n") for part in parts) + "\n"


def _counted(verdicts: Counter[str], good: str) -> list[str]:
    total, open_ = sum(verdicts.values()), verdicts["DIFFERS"]
    kinds = ", ".join(f"{count} {name}" for name, count in verdicts.most_common() if name not in (good, "DIFFERS"))
    explained = total - verdicts[good] - open_
    return [str(total), str(verdicts[good]), f"{explained} ({kinds})" if kinds else "0", str(open_)]


def main() -> int:
    """Make all figures in processes side by side, and write the page."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--fast", action="store_true", help="fewer curves and coarser grids")
    parser.add_argument("--output", type=Path, default=DOCS, metavar="DIR", help="where to write (%(default)s)")
    parser.add_argument("--processes", type=int, default=2, metavar="N", help="figures at a time (%(default)s)")
    given = parser.parse_args()
    began = time.perf_counter()
    with ProcessPoolExecutor(given.processes, mp_context=get_context("spawn")) as pool:
        tables = pool.submit(cos_fits.write_all, given.output / "tables", given.fast)
        found = list(pool.map(partial(made, fast=given.fast, folder=given.output), NAMES))
        seconds = sum(time for _, time in found) + tables.result()
    results = sorted((result for result, _ in found), key=lambda result: (result.name == "table1", result.name))
    (given.output / "paper.md").write_text(page(results), encoding="utf-8")
    for name, (result, time_) in zip(NAMES, found, strict=True):
        verdicts = [one.verdict for one in (*result.findings, *result.statements)]
        print(f"{name}: {len(verdicts)} compared, {verdicts.count('DIFFERS')} unexplained, {time_:.1f} s")
    print(f"{given.output / 'paper.md'}: {seconds:.0f} s of processor time, {time.perf_counter() - began:.0f} s")
    return int(any(one.verdict == "DIFFERS" for result in results for one in (*result.findings, *result.statements)))


if __name__ == "__main__":
    sys.exit(main())
