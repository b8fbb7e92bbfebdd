"""How long one equilibrium on a grid takes, cold, on one thread, here and with tamaas and Adhesion.

    pip install 'contbranch[benchmark]'              # or, in a checkout: pip install '.[benchmark]'
    python studies/benchmark_grid.py                 # 512², μ_T = 1, exponential attraction, F = 1.5625, L = 9.8825
    python studies/benchmark_grid.py --grid 256 --tabor 2 --repeats 3 --json FILE
    python studies/benchmark_grid.py --scaling       # pairs of transforms against the grid, this package alone

The others hold the mean gap or an offset, not the load. So the value of that control which gives the load is found
once, by secants on the load with warm starts ("load found" in the report), and given to them in all that follows
("told"). With it each is asked for ever tighter tolerances until the true residual (`grid_peers.examine`, computed from
the returned gap alone) is below `--accuracy`; the loosest that suffices is timed. Then all are timed in turn,
A B C A B C …, cold, set-up included, in one process. The ratio is that of the time of the fastest of the others, found
or told, to the time here, medians.
"""

from __future__ import annotations

import argparse
import json
import os
import platform
import statistics
import sys
import time
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path

import numpy as np

if (folder := str(Path(__file__).resolve().parents[1])) not in sys.path:
    sys.path.append(folder)  # run as a script, studies/ is not a package

from studies.grid_peers import (
    SOLVERS,
    Answer,
    Case,
    Examined,
    GridSolver,
    NotAble,
    NotInstalled,
    examine,
    load_packages,
    version,
)

ONE_THREAD = {f"{library}_NUM_THREADS": "1" for library in ("OPENBLAS", "OMP", "MKL", "BLIS", "VECLIB_MAXIMUM")}
LADDER = (1000.0, 100.0, 30.0, 10.0, 3.0, 1.0, 0.3, 0.1)
OWN = "contbranch"


@dataclass
class Row:
    """Times and worth of one solver.

    Attributes
    ----------
    name, version, control : str
    failure : str
        Why there is no result, or what is wrong with it; empty if all is well.
    tolerance : float or None
        Its own tolerance that was found to suffice.
    told : list of float
        Seconds of cold solves at the known value of its control.
    found : float or None
        Seconds of the iteration on the load, from a cold start; None for what takes the load.
    solves : int
        Solves of that iteration.
    found_load_error : float or None
        |F - F asked for| at its end.
    evaluations : int or None
        Of one cold solve (`grid_peers.Answer`).
    worth : Examined or None
        Of a cold solve.
    """

    name: str
    version: str
    control: str
    failure: str = ""
    tolerance: float | None = None
    told: list[float] = field(default_factory=list)
    found: float | None = None
    solves: int = 0
    found_load_error: float | None = None
    evaluations: int | None = None
    worth: Examined | None = None

    @property
    def median(self) -> float:
        """Median of the cold solves; infinite if there are none."""
        return statistics.median(self.told) if self.told else float("inf")

    @property
    def counts(self) -> float:
        """The shorter of both times, infinite after a failure."""
        if self.failure:
            return float("inf")
        return min(self.median, self.found if self.found is not None else float("inf"))


@dataclass
class Report:
    """Everything that is measured."""

    case: Case
    accuracy: float
    machine: Mapping[str, object]
    rows: list[Row]

    @property
    def own(self) -> Row | None:
        """The row of this package if it has a result."""
        rows = [row for row in self.rows if row.name == OWN and np.isfinite(row.counts)]
        return rows[0] if rows else None

    @property
    def best(self) -> Row | None:
        """The row of the fastest of the others that has a result."""
        rows = [row for row in self.rows if row.name != OWN and np.isfinite(row.counts)]
        return min(rows, key=lambda row: row.counts) if rows else None

    @property
    def ratio(self) -> float | None:
        """Time of the fastest of the others by the time here; None if either is missing."""
        if self.own is None or self.best is None:
            return None
        return self.best.counts / self.own.counts


def timed(solver: GridSolver, case: Case, value: float, tolerance: float) -> tuple[float, Answer]:
    """Seconds of one cold solve, and its answer."""
    began = time.perf_counter()
    answer = solver.solve(case, value, tolerance)
    return time.perf_counter() - began, answer


@dataclass(frozen=True)
class Reached:
    """End of an iteration on the load: the control's value, the error of the load, solves, and seconds."""

    value: float
    load_error: float
    solves: int
    seconds: float


def reach_load(
    solver: GridSolver, case: Case, tolerance: float, load_tolerance: float = 1e-9, most: int = 15
) -> Reached:
    """Find the value of a solver's control that gives the load, by secants, each solve started from the last gap.

    Starts at the mean gap of `Case.mean_gap_guess`; the first step uses the slope 2a of a circular contact. Ends where
    the load is met or, the solver's own noise being reached, no longer improves.

    Raises
    ------
    NotAble
        If the load differs by more than 1e-4 of max(1, |F|) in the end.
    """
    began = time.perf_counter()
    gap: np.ndarray | None = None
    value = solver.value(case, case.mean_gap_guess)
    tried: list[tuple[float, float]] = []
    best = (float("inf"), value)
    for _ in range(most):
        gap = solver.solve(case, value, tolerance, gap).gap
        excess = examine(case, gap).load - case.load
        if not np.isfinite(excess):
            raise NotAble(f"the load at the {solver.control} {value:.6g} is not finite")
        stalled = len(tried) > 2 and abs(excess) > 0.5 * best[0]
        best = min(best, (abs(excess), value))
        tried.append((value, excess))
        if best[0] <= load_tolerance or (stalled and best[0] <= 1e-6):
            break
        if len(tried) == 1:
            change = solver.value(case, case.mean_gap_guess + excess / (2.0 * case.contact_guess)) - value
        else:
            (v0, e0), (v1, e1) = tried[-2:]
            change = -e1 * (v1 - v0) / (e1 - e0) if e1 != e0 else 0.0
        value += float(np.clip(change, -0.5, 0.5))
    if best[0] > 1e-4 * max(1.0, abs(case.load)):
        raise NotAble(f"the load is not met by iterating on the {solver.control}: off by {best[0]:.1e}")
    return Reached(best[1], best[0], len(tried), time.perf_counter() - began)


def prepare(solver: GridSolver, case: Case, accuracy: float) -> tuple[Row, float]:
    """Find a solver's control and tolerance; a failure goes into its row."""
    row = Row(solver.name, "", solver.control)
    value = case.load
    try:
        load_packages(*solver.modules)
        row.version = version(solver)
        if solver.control != "load":
            reached = reach_load(solver, case, 0.1 * accuracy)
            value, row.found = reached.value, reached.seconds
            row.solves, row.found_load_error = reached.solves, reached.load_error
        for factor in LADDER:
            row.tolerance = factor * accuracy
            answer = solver.solve(case, value, row.tolerance)
            row.worth = examine(case, answer.gap)
            if row.worth.residual <= accuracy or solver.control == "load":
                break
        if row.worth is None or row.worth.residual > accuracy:
            complaint = f"; it says: {answer.complaint}" if answer.complaint else ""
            row.failure = f"true residual above {accuracy:.0e}{complaint}"
    except NotInstalled as missing:
        row.failure = f"not installed: {missing}"
    except Exception as error:  # whatever a foreign solver raises is a result, not the end of the others
        row.failure = f"{type(error).__name__}: {error}"
    return row, value


def run(case: Case, solvers: Sequence[GridSolver], accuracy: float = 1e-8, repeats: int = 5) -> Report:
    """Prepare all solvers, then time them in turn."""
    where = machine()
    prepared = [(solver, *prepare(solver, case, accuracy)) for solver in solvers]
    able = [item for item in prepared if item[1].worth is not None]
    for _ in range(repeats):
        for solver, row, value in able:
            try:
                seconds, answer = timed(solver, case, value, row.tolerance or accuracy)
                worth = examine(case, answer.gap)
            except Exception as error:
                row.failure = row.failure or f"{type(error).__name__}: {error}"
                continue
            row.told.append(seconds)
            row.evaluations = answer.evaluations
            if row.worth is None or worth.residual >= row.worth.residual:
                row.worth = worth  # the worst of all that were timed
    return Report(case, accuracy, where, [row for _, row, _ in prepared])


def machine() -> dict[str, object]:
    """Processor, number of processors, how busy they are (before anything is measured) and versions."""
    name = platform.processor() or platform.machine()
    if Path("/proc/cpuinfo").exists():
        lines = Path("/proc/cpuinfo").read_text().splitlines()
        names = [line.partition(":")[2].strip() for line in lines if line.startswith("model name")]
        name = names[0] if names else name
    busy = round(os.getloadavg()[0], 2) if hasattr(os, "getloadavg") else None
    versions = {"python": platform.python_version(), "numpy": np.__version__}
    return {"processor": name, "nproc": os.cpu_count(), "load_average": busy, "threads": 1, **versions}


@dataclass(frozen=True)
class OwnCost:
    """Pairs of transforms and seconds of a cold solve, and of one continuation point started from a neighbour's."""

    grid: int
    cold_pairs: int
    cold_seconds: float
    warm_pairs: int
    warm_seconds: float


def own_cost(grid: int, case: Case) -> OwnCost:
    """What this package takes at a grid: the case cold, and then the load 1 % higher, started from that state."""
    import contbranch as cb

    contact = cb.Contact.reduced(case.law, tabor=case.tabor, sign=case.sign)
    model = cb.Periodic(cell=case.cell, grid=grid)
    cold = cb.solve(contact, load=case.load, model=model)
    warm = cb.solve(contact, load=1.01 * case.load, model=model, near=cold)
    return OwnCost(grid, cold.cost.fft_pairs, cold.cost.wall_s, warm.cost.fft_pairs, warm.cost.wall_s)


def scaling(case: Case, grids: Sequence[int] = (128, 256, 512, 1024, 2048)) -> list[OwnCost]:
    """`own_cost` at every grid."""
    return [own_cost(grid, replace(case, grid=grid)) for grid in grids]


def scaling_table(costs: Sequence[OwnCost]) -> str:
    """Pairs of transforms against the grid with their growth for each doubling, as Markdown."""
    rows = []
    for k, cost in enumerate(costs):
        growth = f"{cost.warm_pairs / max(costs[k - 1].warm_pairs, 1):.2f}" if k else ""
        cells = (f"{cost.grid}²", cost.cold_pairs, f"{cost.cold_seconds:.2f} s", cost.warm_pairs)
        rows.append([str(cell) for cell in (*cells, growth, f"{cost.warm_seconds:.2f} s")])
    return table(("grid", "cold: pairs", "time", "continuation point: pairs", "growth", "time"), rows)


def summary(report: Report) -> str:
    """The table of all solvers and the ratio, as Markdown."""
    times, worth = (
        ("told: median", "load found", "evaluations"),
        ("residual", "largest", "load error", "a_c", "mean gap"),
    )
    rows = [_cells(report.case, row) for row in report.rows]
    c, m = report.case, report.machine
    sign = "attraction" if c.sign > 0 else "repulsion"
    lines = [
        f"{c.law} {sign}, μ_T = {c.tabor:g}, F = {c.load:g}, {c.grid}², L = {c.cell:g}; "
        f"true residual at most {report.accuracy:g}",
        f"{m['processor']}, {m['nproc']} processors (load {m['load_average']}), one thread used; "
        f"Python {m['python']}, numpy {m['numpy']}",
        table(("solver", *times, *worth), rows),
    ]
    own, best, ratio = report.own, report.best, report.ratio
    if ratio is None or own is None or best is None or own.worth is None or best.worth is None:
        lines.append("No ratio: it needs this package and at least one other with a result.")
    else:
        residuals = f"true residuals {best.worth.residual:.1e} and, here, {own.worth.residual:.1e}"
        lines.append(f"The fastest of the others, {best.name}, takes {ratio:.1f} times as long as {OWN}; {residuals}.")
    return "\n\n".join(lines)


def _cells(case: Case, row: Row) -> list[str]:
    name = f"{row.name} ({row.version})" if row.version else row.name
    if row.worth is None:
        return [name, row.failure, *[""] * 7]
    spread = f"{row.median:.3f} s ({min(row.told):.3f}–{max(row.told):.3f})" if row.told else "–"
    found = "–" if row.found is None else f"{row.found:.1f} s, {row.solves} solves"
    w = row.worth
    return [
        name + (f": {row.failure}" if row.failure else ""),
        spread,
        found,
        "–" if row.evaluations is None else str(row.evaluations),
        f"{w.residual:.1e}",
        f"{w.largest:.1e}",
        f"{abs(w.load - case.load):.1e}",
        f"{w.contact_radius:.5f}",
        f"{w.mean_gap:.7f}",
    ]


def table(head: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """A Markdown table."""
    return "\n".join(f"| {' | '.join(row)} |" for row in (head, ["---"] * len(head), *rows))


def as_json(report: Report) -> str:
    """All numbers; no NaN and no infinity."""
    rows = [asdict(row) | {"median": statistics.median(row.told) if row.told else None} for row in report.rows]
    document = {"case": asdict(report.case), "accuracy": report.accuracy, "machine": dict(report.machine)}
    return json.dumps(document | {"rows": rows, "ratio": report.ratio}, indent=1, ensure_ascii=False, allow_nan=False)


def start_with_one_thread() -> None:
    """Start this script anew with one thread, unless it has one: the number is read when libraries are loaded."""
    if any(os.environ.get(name) != value for name, value in ONE_THREAD.items()):
        print("starting anew with one thread", file=sys.stderr)
        os.execve(sys.executable, [sys.executable, *sys.orig_argv[1:]], os.environ | ONE_THREAD)


def arguments(words: Sequence[str] | None = None) -> argparse.Namespace:
    """Read the command line."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    for item in ("grid", "cell", "load", "tabor"):
        default = getattr(Case, item)
        parser.add_argument(f"--{item}", type=type(default), default=default, help=f"default {default}")
    parser.add_argument("--law", choices=("exponential", "gauss"), default=Case.law)
    parser.add_argument("--repulsive", action="store_true")
    parser.add_argument("--accuracy", type=float, default=1e-8, help="true relative residual that all have to reach")
    parser.add_argument("--repeats", type=int, default=5)
    parser.add_argument(
        "--peers", nargs="+", choices=[n for n in SOLVERS if n != OWN], metavar="NAME", help="which ones"
    )
    parser.add_argument("--without-own", action="store_true", help="time the others alone")
    parser.add_argument("--scaling", action="store_true", help="pairs of transforms of this package against the grid")
    parser.add_argument("--grids", type=int, nargs="+", default=(128, 256, 512, 1024, 2048), help="for --scaling")
    parser.add_argument("--json", metavar="FILE", help="write the numbers to a file")
    return parser.parse_args(words)


def main() -> None:
    """Measure, print, and write what was asked for."""
    given = arguments()
    start_with_one_thread()
    case = Case(given.grid, given.cell, given.load, given.tabor, given.law, -1 if given.repulsive else 1)
    if given.scaling:
        costs = scaling(case, given.grids)
        print(scaling_table(costs))
        document = json.dumps([asdict(cost) for cost in costs], indent=1)
    else:
        names = given.peers or [name for name in SOLVERS if name != OWN]
        report = run(
            case, [SOLVERS[n] for n in ([] if given.without_own else [OWN]) + names], given.accuracy, given.repeats
        )
        print(summary(report))
        document = as_json(report)
    if given.json:
        Path(given.json).write_text(document + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
