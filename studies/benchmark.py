"""How long a trace takes, on one BLAS thread, and where its time goes.

    python studies/benchmark.py                # prints a report in Markdown; about a minute
    python studies/benchmark.py --json FILE    # also writes the numbers
    python studies/benchmark.py --update       # also writes the report into README.md and docs/accuracy-and-limits.md

Times are ratios to 100 calls of `numpy.linalg.solve` of order 500, measured in turn with them in the same process, so
that they can be compared between machines.
"""

from __future__ import annotations

import argparse
import json
import os
import platform
import signal
import statistics
import subprocess
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from types import CodeType, FrameType

import numpy as np
import scipy

import contbranch as cb
from contbranch.contact import interaction_law, interactions, tip_shape, tips
from contbranch.continuation import bordered
from contbranch.curve import refine
from contbranch.models.axisymmetric import adapt, equations, mesh, profile, rim

ROOT = Path(__file__).resolve().parents[1]
OMCTS = ROOT / "studies" / "omcts.toml"
PAGES = (ROOT / "README.md", ROOT / "docs" / "accuracy-and-limits.md")

ONE_THREAD = {f"{library}_NUM_THREADS": "1" for library in ("OPENBLAS", "OMP", "MKL", "BLIS", "VECLIB_MAXIMUM")}
SOLVES, ORDER = 100, 500
ACCURACIES = tuple(10.0**-digits for digits in range(4, 12))


@dataclass(frozen=True)
class Case:
    """A trace that is timed.

    Attributes
    ----------
    name : str
        What is traced, in words.
    contact : Contact
    accuracy : float
    max_load : float or None
        Where the curve ends; None: at its default.
    """

    name: str
    contact: cb.Contact
    accuracy: float = 1e-8
    max_load: float | None = None

    def trace(self, accuracy: float | None = None) -> cb.Diagram:
        """Trace it, with its own accuracy or another one."""
        return cb.trace(self.contact, accuracy=accuracy or self.accuracy, max_load=self.max_load)


GAUSS = Case("Gauss repulsion, μ_T = 4, to F = 120", cb.Contact.reduced(cb.Gauss, tabor=4.0, sign=-1), max_load=120.0)
EXPONENTIAL = Case("Exponential attraction, μ_T = 1", cb.Contact.reduced(cb.Exponential, tabor=1.0))


@dataclass(frozen=True)
class Timing:
    """Times of one case in seconds, and what they were spent on.

    Attributes
    ----------
    first, best, median : float
        First trace in the process (caches empty), best and median of all.
    reference : float
        Best time of the reference, measured in turn with the traces.
    points, unknowns, newton : int
        Points of the curve, unknowns of the largest problem, Newton iterations.
    status : str
    """

    name: str
    accuracy: float
    first: float
    best: float
    median: float
    reference: float
    points: int
    unknowns: int
    newton: int
    status: str

    @property
    def ratio(self) -> float:
        """Best time as a multiple of the best time of the reference."""
        return self.best / self.reference


def reference_time() -> float:
    """Seconds that 100 calls of `numpy.linalg.solve` of order 500 take."""
    generator = np.random.default_rng(1)
    matrix, right = generator.standard_normal((ORDER, ORDER)), generator.standard_normal(ORDER)
    began = time.perf_counter()
    for _ in range(SOLVES):
        np.linalg.solve(matrix, right)
    return time.perf_counter() - began


def measure(case: Case, repetitions: int = 7) -> Timing:
    """Time a case and the reference in turn, so that both see the same machine."""
    times, references = [], []
    for _ in range(repetitions):
        references.append(reference_time())
        began = time.perf_counter()
        diagram = case.trace()
        times.append(time.perf_counter() - began)
    points = sum(len(branch) for branch in diagram.branches)
    work = (points, diagram.model.unknowns, diagram.cost.newton, diagram.status)
    summary = (times[0], min(times), statistics.median(times), min(references))
    return Timing(case.name, case.accuracy, *summary, *work)


@dataclass(frozen=True)
class Growth:
    """Best times and unknowns of one case against the accuracy asked for."""

    name: str
    accuracies: tuple[float, ...]
    seconds: tuple[float, ...]
    unknowns: tuple[int, ...]

    @property
    def power(self) -> float:
        """q of the least-squares fit ``time ∝ digitsᑫ``, the digits being −log10(accuracy)."""
        digits = -np.log10(self.accuracies)
        return float(np.polyfit(np.log(digits), np.log(self.seconds), 1)[0])


def cost_against_digits(case: Case, accuracies: tuple[float, ...] = ACCURACIES, repetitions: int = 3) -> Growth:
    """Time a case at several accuracies; of the repetitions the best counts."""
    seconds, unknowns = [], []
    for accuracy in accuracies:
        times = []
        for _ in range(repetitions):
            began = time.perf_counter()
            diagram = case.trace(accuracy)
            times.append(time.perf_counter() - began)
        seconds.append(min(times))
        unknowns.append(diagram.model.unknowns)
    return Growth(case.name, accuracies, tuple(seconds), tuple(unknowns))


def command_times(repetitions: int = 5) -> tuple[float, ...]:
    """Seconds of the whole command that traces and draws `omcts.toml`, as a process, after one run to fill caches."""
    program = "from contbranch.cli import main; raise SystemExit(main())"
    times = []
    with tempfile.TemporaryDirectory() as folder:
        command = [sys.executable, "-c", program, "trace", str(OMCTS), "--plot", str(Path(folder) / "omcts.png")]
        for _ in range(repetitions + 1):
            began = time.perf_counter()
            subprocess.run(command, env=os.environ | ONE_THREAD, check=True, capture_output=True)
            times.append(time.perf_counter() - began)
    return tuple(times[1:])


# Where the time goes. The kinds of work, in the order in which they are asked: the first one that any function on the
# stack belongs to has the sample.
FACTORISATION, MESHES, ESTIMATES = "factorisation", "meshes (Abel matrices)", "error estimates"
LINEARISATION, REST = "residuals and linearisation", "steps and bookkeeping"
EVENTS = "of all this: events located anew"


def _code(function: Callable[..., object]) -> CodeType:
    code: CodeType = getattr(function, "__wrapped__", function).__code__  # type: ignore[attr-defined]
    return code


LINEAR_ALGEBRA = tuple(str(Path(module.__file__ or "").parent) for module in (np.linalg, scipy.linalg))
LAPACK_CALLERS = {_code(function) for function in vars(bordered.DenseBordered).values() if callable(function)}
MESH_MAKERS = {_code(mesh.Mesh.__init__), _code(mesh.Mesh._matrices), _code(mesh.panel_rule)}
EVENT_FINDERS = {_code(refine.refine)}
WORKERS = {str(module.__file__) for module in (equations, rim, profile, interactions, interaction_law, tips, tip_shape)}


def kind_of_work(stack: list[CodeType]) -> str:
    """The kind of work that functions on a stack stand for."""
    files = {code.co_filename for code in stack}
    if any(file.startswith(LINEAR_ALGEBRA) for file in files) or stack[0] in LAPACK_CALLERS:
        return FACTORISATION
    if not MESH_MAKERS.isdisjoint(stack):
        return MESHES
    if adapt.__file__ in files:
        return ESTIMATES
    if not WORKERS.isdisjoint(files):
        return LINEARISATION
    return REST


def where_time_goes(case: Case, seconds: float = 5.0, interval: float = 1e-3) -> dict[str, float]:
    """Shares of the time of a case by kind of work, and the share spent on events located anew; by sampling the stack.

    Sampling does not slow Python down beside the linear algebra, as a profiler does. Unix, main thread.
    """
    samples: Counter[str] = Counter()

    def take(_: int, frame: FrameType | None) -> None:
        stack = [current.f_code for current in _frames(frame)]
        samples[kind_of_work(stack)] += 1
        samples[EVENTS] += not EVENT_FINDERS.isdisjoint(stack)
        samples["all"] += 1

    before = signal.signal(signal.SIGPROF, take)
    signal.setitimer(signal.ITIMER_PROF, interval, interval)
    try:
        began = time.perf_counter()
        while time.perf_counter() - began < seconds:
            mesh.forget()  # every trace makes its own meshes, as the first one of a process does
            case.trace()
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0.0)
        signal.signal(signal.SIGPROF, before)
    kinds = (LINEARISATION, FACTORISATION, MESHES, ESTIMATES, REST, EVENTS)
    return {kind: samples[kind] / max(samples["all"], 1) for kind in kinds}


def _frames(frame: FrameType | None) -> Iterator[FrameType]:
    while frame is not None:
        yield frame
        frame = frame.f_back


@dataclass(frozen=True)
class Report:
    """Everything that is measured."""

    machine: str
    timings: tuple[Timing, ...]
    growth: tuple[Growth, ...]
    command: tuple[float, ...]
    shares: dict[str, dict[str, float]]


def run() -> Report:
    """Measure everything; first the timings, so that their first trace is the first of the process."""
    cases = (GAUSS, EXPONENTIAL)
    timings = tuple(measure(case) for case in cases)
    growth = tuple(cost_against_digits(case) for case in cases)
    shares = {case.name: where_time_goes(case) for case in cases}
    return Report(machine(), timings, growth, command_times(), shares)


def machine() -> str:
    """Processor, Python and numpy in words."""
    processor = platform.processor() or platform.machine()
    if Path("/proc/cpuinfo").exists():
        lines = Path("/proc/cpuinfo").read_text().splitlines()
        names = [line.partition(":")[2].strip() for line in lines if line.startswith("model name")]
        processor = names[0] if names else processor
    versions = f"Python {platform.python_version()}, numpy {np.__version__}, contbranch {cb.__version__}"
    return f"{processor}, one BLAS thread, {versions}"


def summary(report: Report) -> str:
    """The numbers of most interest, as Markdown."""
    rows = ["| what | time | in units of 100 solves of order 500 |", "|---|---|---|"]
    for t in report.timings:
        size = f"{t.points} points, {t.unknowns} unknowns"
        rows.append(f"| {t.name}, accuracy {t.accuracy:.0e} | {t.best:.2f} s ({size}) | {t.ratio:.2f} |")
    best, reference = min(report.command), min(t.reference for t in report.timings)
    command = f"`contbranch trace {OMCTS.relative_to(ROOT)} --plot omcts.png`, the whole process"
    rows.append(f"| {command} | {best:.2f} s | {best / reference:.1f} |")
    power = max(growth.power for growth in report.growth)
    closing = f"Between 4 and 11 digits the time grows like the number of digits to the power {power:.1f}."
    return "\n".join([*rows, "", f"{closing} Machine: {report.machine}."])


def details(report: Report) -> str:
    """All numbers, as Markdown tables."""
    names = [t.name for t in report.timings]
    speed = [
        (f"{t.name}, accuracy {t.accuracy:.0e}", *(f"{s:.3f} s" for s in (t.first, t.best, t.median, t.reference)))
        for t in report.timings
    ]
    ratios = [f"{t.ratio:.2f}" for t in report.timings]
    digits = [
        (f"{accuracy:.0e}", *(f"{g.seconds[k]:.3f} s, {g.unknowns[k]}" for g in report.growth))
        for k, accuracy in enumerate(report.growth[0].accuracies)
    ]
    kinds = next(iter(report.shares.values()))
    shares = [(kind, *(f"{100 * report.shares[name][kind]:.0f} %" for name in names)) for kind in kinds]
    command = f"{min(report.command):.2f} s and {statistics.median(report.command):.2f} s"
    sections = [
        f"Machine: {report.machine}.",
        table(
            ("trace", "first", "best", "median", f"{SOLVES} solves of order {ORDER}", "ratio of the best"),
            [(*row, ratio) for row, ratio in zip(speed, ratios, strict=True)],
        ),
        f"The whole command with a plot, best and median of {len(report.command)}: {command}.",
        table(("accuracy", *(f"{name}: time, unknowns" for name in names)), digits),
        f"Least-squares powers of the number of digits: {' and '.join(f'{g.power:.2f}' for g in report.growth)}.",
        table(("share of the time", *names), shares),
    ]
    return "\n\n".join(sections)


def table(head: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """A Markdown table."""
    return "\n".join(f"| {' | '.join(row)} |" for row in (head, ["---"] * len(head), *rows))


def update(path: Path, text: str) -> None:
    """Replace what stands between the benchmark's marks in a page."""
    begin, end = "<!-- benchmark -->", "<!-- end of benchmark -->"
    before, _, rest = path.read_text(encoding="utf-8").partition(begin)
    _, found, after = rest.partition(end)
    if not found:
        raise SystemExit(f"{path}: the marks {begin} and {end} are missing")
    path.write_text(f"{before}{begin}\n{text}\n{end}{after}", encoding="utf-8")


def start_with_one_thread() -> None:
    """Start this script anew with one BLAS thread, unless it has one: the number is read when numpy is loaded."""
    if any(os.environ.get(name) != value for name, value in ONE_THREAD.items()):
        print("starting anew with one BLAS thread", file=sys.stderr)
        os.execve(sys.executable, [sys.executable, *sys.orig_argv[1:]], os.environ | ONE_THREAD)


def main() -> None:
    """Measure, print, and write what was asked for."""
    start_with_one_thread()
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--json", metavar="FILE", help="write the numbers to a file")
    parser.add_argument("--update", action="store_true", help="write the report into README.md and docs/")
    arguments = parser.parse_args()
    report = run()
    print(summary(report), details(report), sep="\n\n")
    if arguments.json:
        numbers = json.dumps(asdict(report), indent=1, ensure_ascii=False)
        Path(arguments.json).write_text(numbers + "\n", encoding="utf-8")
    if arguments.update:
        for path, text in zip(PAGES, (summary(report), details(report)), strict=True):
            update(path, text)


if __name__ == "__main__":
    main()
