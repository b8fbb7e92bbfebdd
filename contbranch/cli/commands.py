"""The command ``contbranch``: trace, solve, loop, follow, sweep, show and view.

Exit status: 0 complete; 1 incomplete (whatever was traced is written all the same); 2 wrong input, in one line; 130
interrupted (as 1). Heavy libraries are imported where they are needed: the start of the command is a good part of its
time.
"""

from __future__ import annotations

import errno
import os
import re
import sys
import warnings
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from optparse import HelpFormatter, OptionParser, Values
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple, NoReturn

from contbranch.cli import interrupts
from contbranch.errors import InputError, ModelError
from contbranch.output.files import Place, reserved

if TYPE_CHECKING:
    from contbranch.cli.request import Request
    from contbranch.results.record import Result
    from contbranch.watch import Progress


COMPLETE = 0
INCOMPLETE = 1
WRONG_INPUT = 2

# The value's name (none: a switch) and what it means.
_OPTIONS = {
    "--interaction": ("NAME", "Instead of CONTACT: the law of a contact in reduced units."),
    "--tabor": ("X", "Its Tabor coefficient."),
    "--repulsive": ("", "The law repels."),
    "--control": ("load|displacement|spring:K", "What is controlled.  [default: load]"),
    "--accuracy": ("X", "Error allowed to events and thresholds.  [default: 1e-6]"),
    "--model": ("auto|exact|axisymmetric|periodic|free", "Model of the contact.  [default: auto]"),
    "--cell": ("L", "Edge of a periodic or free cell.  [default: by the accuracy]"),
    "--grid": ("N", "Nodes along it, even.  [default: by the accuracy]"),
    "--load": ("F", "Load of the equilibrium."),
    "--displacement": ("D", "Or its displacement."),
    "--all": ("", "Report all equilibria found, not only one."),
    "--event": ("NAME", "Name of a fold under --control, or touch."),
    "--vary": ("NAME=FROM:TO", "Parameter to vary, for example tabor=0.25:4."),
    "--temperature": ("T", "Such as '298 K'."),
    "--rate": ("R", "Of what is controlled, such as '100 nN/s' or '1 um/s'."),
    "--attempt-frequency": ("NU", "Such as '1 MHz'."),
    "--uncertainty": ("NAME=X", "Of a parameter: adds those of the thresholds; may be given several times."),
    "--free": (
        "NAMES",
        "What is fitted, such as work_of_adhesion,modulus,range (default: the first two; modulus without law).",
    ),
    "--fixed": ("NAMES", "Which of contact_point, baseline and tilt are held at 0."),
    "--spring": ("K", "Stiffness of the cantilever, such as '0.5 N/m', in place of the file's."),
    "--sensitivity": ("S", "Deflection by voltage, such as '50 nm/V', where the file has none, or in place of it."),
    "--columns": ("ROLE=NAME,…", "Columns of a text, such as 'piezo=-Height (nm),deflection=Defl (V)'; - reverses."),
    "--leg": ("auto|approach|retract|both", "What is fitted; auto: both, or each by itself.  [default: auto]"),
    "--baseline": ("auto|one|each", "One baseline and tilt, or one for each leg.  [default: auto]"),
    "--max-indentation": ("D", "Leave out what is pressed deeper, such as '500 nm'."),
    "--max-force": ("F", "Leave out larger forces above the baseline, such as '2 nN'."),
    "--min-force": ("F", "Leave out smaller forces in contact; negative: in attraction."),
    "--law": ("NAME", "Another law than the contact's; jkr, dmt, or compare."),
    "--shape": ("ROWSxCOLUMNS", "Of a map whose curves lie row by row.  [default: as files or names say]"),
    "--method": ("NAME", "curve or relaxation (of grids, by steps).  [default: curve]"),
    "--steps": ("N", "Steps of relaxation up to the largest load.  [default: 60]"),
    "--file": ("FILE.h5", "Where relaxation keeps its states, and goes on from."),
    "--max-load": ("F", "Largest load.  [default: beyond all events]"),
    "--time-limit": ("S", "Seconds after which what has been found is given.  [default: none]"),
    "--workers": ("N", "Traces at a time.  [default: one for each core]"),
    "--scheduler": ("ADDRESS", "Of a Dask cluster, instead of the cores of this machine."),
    "--resume": ("", "Go on with an earlier sweep of that file, if there is one."),
    "--retry": ("", "Compute again what failed, or had less time than now."),
    "--json": ("FILE", "Write JSON; - for standard output."),
    "--csv": ("FILE", "Write the points as a table, with units in its first line; - as above."),
    "--events-csv": ("FILE", "Write the events as a table; - as above."),
    "--plot": ("FILE", "Draw to a .png, .pdf or .svg file."),
    "-o --output": ("FILE.h5", "Save arrays and profiles."),
    "-o --page": ("FILE.html", "Write the page."),
}
_SHARED = tuple(_OPTIONS)[:8]
_READING = ("--spring", "--sensitivity", "--columns")
_PARTS = ("--leg", "--baseline", "--max-indentation", "--max-force", "--min-force")
_SUFFIXES = {
    "--json": ".json",
    "--csv": ".csv",
    "--events-csv": ".csv",
    "--plot": ".pdf, .png or .svg",
    "-o": ".h5 or .hdf5",
}
_SWEEPING = ("--workers", "--scheduler", "--resume", "--retry")
_OUTPUTS = ("--time-limit", "--json", "--csv", "--plot", "-o --output")


class _Parser(OptionParser):
    """Options whose values may begin with a minus, as loads of attraction do: not so with argparse."""

    def __init__(self, name: str, arguments: str, description: str, epilog: str) -> None:
        super().__init__(f"%prog {arguments}", prog=name, description=description, epilog=epilog, add_help_option=False)
        self.formatter.max_help_position = 34

    def format_epilog(self, formatter: HelpFormatter) -> str:
        """Return the epilog with its lines as they are."""
        return self.epilog or ""

    def error(self, msg: str) -> NoReturn:
        """Raise InputError with a complaint about the usage and a remedy."""
        message = re.sub(r"^(\S+) option requires 1 argument", r"Option '\1' requires an argument", msg)
        raise InputError(f"{message[0].upper()}{message[1:]}; see {self.prog} --help")


class Command(NamedTuple):
    """A command: what computes its result, its options, its argument with what that is, and what sweeps write."""

    compute: Callable[[Values], Any]
    options: tuple[str, ...]
    argument: tuple[str, str] = ("[CONTACT]", "TOML file that describes the contact.")
    own: tuple[str, ...] = ()
    second: tuple[str, str] | None = None

    @property
    def summary(self) -> str:
        """What it does, in a sentence."""
        return self.compute.__doc__ or ""

    def parser(self, name: str) -> _Parser:
        """The parser of its options."""
        told = [one for one in (self.argument, self.second) if one is not None]
        listed = "".join("  {:11s} {}\n".format(*one) for one in told)
        usage = " ".join(["[OPTIONS]", *(one[0] for one in told)])
        parser = _Parser(f"contbranch {name}", usage, self.summary, f"\nArguments:\n{listed}")
        for flags in self.options:
            value, words = _OPTIONS[flags]
            kind: dict[str, Any] = {"metavar": value} if value else {"action": "store_true", "default": False}
            kind |= {"action": "append"} if flags in ("--uncertainty", "--plot") else {}
            parser.add_option(*flags.split(), help=words, **kind)
        absent = ("json", "output", "plot", "csv", "events_csv", "model", "cell", "grid", "time_limit")
        parser.set_defaults(**dict.fromkeys(absent))
        return parser


def _trace(asked: Values) -> Any:
    """Trace the whole curve of equilibria, stable and unstable, with its folds and first touch."""
    request = _request(asked)
    limit = request.limit(asked.max_load)
    if not asked.uncertainty:
        return _computed("trace", request, max_load=limit)
    from dataclasses import replace

    from contbranch.cli.request import parse_uncertainties
    from contbranch.watch import finishing

    given = parse_uncertainties(asked.uncertainty, request)
    diagram = _computed("trace", request, max_load=limit)
    with finishing():
        return replace(diagram, uncertainties=diagram.propagate(given))


def _solve(asked: Values) -> Any:
    """Find the equilibrium at a load or a displacement; of several, the stable one of lowest energy."""
    request = _request(asked)
    if (asked.load is None) == (asked.displacement is None):
        raise InputError("--load, --displacement: give one of them")
    name, dimension = ("displacement", "length") if asked.load is None else ("load", "force")
    where: dict[str, float | None] = {name: request.quantity(getattr(asked, name), dimension, f"--{name}")}
    if not request.controlled:
        where["control"] = None  # that of the quantity given
    if asked.all:
        from contbranch.api import best_of

        return best_of(_computed("find_all", request, **where), name)
    from dataclasses import replace

    return replace(_computed("solve", request, **where), states=())


def _loop(asked: Values) -> Any:
    """Follow the hysteresis loop: approach and retraction with all jumps and the energy they dissipate."""
    request = _request(asked)
    own = {name: value for name in ("method", "steps", "file") if (value := getattr(asked, name)) is not None}
    if "steps" in own:
        from contbranch.cli.request import whole_number

        own["steps"] = whole_number(own["steps"], "--steps")
    return _computed("hysteresis", request, max_load=request.limit(asked.max_load), **own)


def _follow(asked: Values) -> Any:
    """Follow a fold or first touch in a second parameter, with the points where folds meet or end."""
    request = _request(asked)
    for option in ("event", "vary"):
        if getattr(asked, option) is None:
            raise InputError(f"--{option}: missing; write for example --event pull-off --vary tabor=0.25:4")
    from contbranch.cli.request import find_event, parse_vary
    from contbranch.contact.family import family_of
    from contbranch.curve.follow import follow
    from contbranch.models.choice import choose, on_grid
    from contbranch.watch import over

    name, values = parse_vary(asked.vary, request)
    limit = request.limit(asked.max_load)
    if on_grid(choose(request.contact, request.model)[0]):
        raise InputError("--model: events found on a grid cannot be followed; use the axisymmetric model")
    diagram = _computed("trace", request, max_load=limit)
    if over():
        return diagram
    event = find_event(diagram, asked.event, request.control.kind)
    try:
        present = event.stiffness if name == "stiffness" else None
        now = family_of(request.contact, name, values[-1], present, event.control).start
        if len(values) == 2 and not min(values) < now < max(values):  # to the farther one of the two
            values = (max(values, key=lambda value: abs(value - now)),)
        return follow(event, name, values, start=present, accuracy=request.accuracy)
    except InputError as error:
        raise InputError(f"--vary: {str(error).removeprefix('vary: ')}") from None


def _sweep(asked: Values) -> Result:
    """Trace all contacts of a sweep file, on all cores or on a cluster; what has ended is never computed again."""
    if asked.output is None:
        raise InputError("-o: missing; a sweep needs a file, for example -o results.h5")
    from contbranch.sweeps.design import read_sweep
    from contbranch.sweeps.sweep import sweep

    design, settings = read_sweep(asked.source)
    with _sweeping(asked) as running:
        return sweep(design, asked.output, **settings, **running)


@contextmanager
def _sweeping(asked: Values) -> Iterator[dict[str, Any]]:
    """How a sweep runs, by its options; what is wrong with it is said in their names."""
    settings: dict[str, Any] = {"resume": asked.resume or asked.retry, "retry": asked.retry}
    with ExitStack() as stack:
        if asked.scheduler is not None:
            from contbranch.sweeps.cluster import dask_executor

            settings["executor"], settings["workers"] = stack.enter_context(dask_executor(asked.scheduler))
        if asked.workers is not None:
            from contbranch.cli.request import whole_number

            settings["workers"] = whole_number(asked.workers, "--workers")
        try:
            yield settings
        except InputError as error:
            words = str(error).replace("path: ", "-o: ", 1).replace("resume that sweep", "add --resume")
            words = f"--{words}" if words.startswith("shape: ") else words
            raise InputError(words) from None


def _fit(asked: Values) -> Any:
    """Fit a contact to a measured force curve, and say what the curve can tell."""
    from contbranch.contact.file import read_contact
    from contbranch.measure.reading import Unread, curves_in

    contact, _ = read_contact(asked.contact)
    how: dict[str, Any] = {"free": asked.free or ("work_of_adhesion,modulus" if contact.interaction else "modulus")}
    how |= {"fixed": asked.fixed or "", "law": asked.law}
    chosen = {name.strip("-").replace("-", "_") for name in _PARTS}
    how |= {name: getattr(asked, name) for name in chosen if getattr(asked, name) is not None}
    folder = Path(asked.source).is_dir()
    reading = {name: getattr(asked, name) for name in (option.strip("-") for option in _READING)}
    curves: list[Any] = [] if folder else list(curves_in(asked.source, **reading))
    if len(curves) == 1:
        from contbranch.measure.fit import fit

        if isinstance(curves[0], Unread):
            raise curves[0].error
        if asked.shape is not None:
            raise InputError(f"--shape: {asked.shape!r}; '{asked.source}' holds one curve, no map: leave it out")
        return fit(curves[0], contact, **how)
    if asked.output is None:
        what = "of a folder" if folder else f"{len(curves)} curves"
        raise InputError(f"-o: missing; the fits {what} are kept in a file as they end, for example -o map.h5")
    from contbranch.measure.maps import fit_map

    with _sweeping(asked) as running:
        if asked.shape is not None:
            running["shape"] = asked.shape
        return fit_map(curves or asked.source, contact, asked.output, **reading, **how, **running)


def _show(asked: Values) -> Result:
    """Print what a saved result holds, and draw it; exit status 0 even if the trace was incomplete."""
    from contbranch.output.hdf5 import load

    return load(asked.source)


def _activated(asked: Values) -> Any:
    """Say at which load or position jumps happen at a temperature, from a saved trace."""
    from contbranch.activation import activated
    from contbranch.output.hdf5 import load
    from contbranch.results.diagram import Diagram

    diagram = load(asked.source)
    if not isinstance(diagram, Diagram):
        raise InputError(f"FILE.h5: '{asked.source}' holds a {type(diagram).__name__}; save a trace with -o")
    names = ("temperature", "rate", "attempt_frequency")
    for name in names:
        if getattr(asked, name) is None:
            raise InputError(f"--{name.replace('_', '-')}: missing; write for example {_ACTIVATED[name]}")
    numbers = {name: _bare(getattr(asked, name)) for name in names}
    try:
        return activated(diagram, event=asked.event, **numbers)
    except InputError as error:
        raise InputError(f"--{str(error).replace('attempt_frequency', 'attempt-frequency', 1)}") from None


_ACTIVATED = {
    "temperature": "--temperature '298 K'",
    "rate": "--rate '100 nN/s'",
    "attempt_frequency": "--attempt-frequency '1 MHz'",
}


def _bare(text: str) -> float | str:
    """A number without a unit as one."""
    try:
        return float(text)
    except ValueError:
        return text


def _advise(asked: Values) -> Any:
    """Say which model or theory is enough for the folds of a contact, and what it would take."""
    request = _request(asked)
    from contbranch.advice import advise

    return advise(request.contact, 0.01 if asked.accuracy is None else request.accuracy, request.control)


def _view(asked: Values) -> Result:
    """Write a page on which a saved diagram, loop or sweep is explored: one file, no network."""
    from contbranch.output.hdf5 import load
    from contbranch.output.page import page
    from contbranch.results.loop import Hysteresis

    if asked.page is None or not asked.page.endswith((".html", ".htm")):
        raise InputError(f"-o: {asked.page or 'missing'}; give a file for the page, for example -o page.html")
    result = load(asked.source)
    curve = None
    if isinstance(result, Hysteresis) and result.contact is not None and result.contact.tip.axisymmetric:
        from contbranch.api import trace
        from contbranch.control import Spring

        control = result.control if result.stiffness is None else Spring(result.stiffness)
        whole = result.status == "complete"  # of which no state is beyond the curve
        curve = trace(result.contact, control, max_load=float(result.path.load.max()) if whole else None)
    with reserved(asked.page, "-o") as place:
        place.write(page(result, curve).encode())
    return result


COMMANDS = {
    "trace": Command(_trace, (*_SHARED, "--max-load", "--uncertainty", *_OUTPUTS, "--events-csv")),
    "solve": Command(_solve, (*_SHARED, "--load", "--displacement", "--all", *_OUTPUTS)),
    "loop": Command(_loop, (*_SHARED, "--max-load", "--method", "--steps", "--file", *_OUTPUTS)),
    "follow": Command(_follow, (*_SHARED, "--event", "--vary", "--max-load", *_OUTPUTS)),
    "activated": Command(
        _activated,
        ("--temperature", "--rate", "--attempt-frequency", "--event", "--json", "--csv", "--plot", "-o --output"),
        ("FILE.h5", "What trace saved by -o."),
    ),
    "advise": Command(_advise, (*_SHARED[:5], "--json")),
    "sweep": Command(
        _sweep,
        (*_SWEEPING, "--time-limit", "--json", "--csv", "-o --output"),
        ("SWEEP", "TOML file: a contact file with a table [sweep.vary]."),
        own=("-o",),
    ),
    "show": Command(_show, ("--plot",), ("FILE.h5", "What another command saved by -o.")),
    "view": Command(_view, ("-o --page",), ("FILE.h5", "Saved by trace, loop or sweep -o.")),
    "fit": Command(
        _fit,
        ("--free", "--fixed", *_READING, "--law", *_PARTS, "--shape", *_SWEEPING, *_OUTPUTS),
        ("CURVE", "Force curve: text (piezo [nm],force [nN]), .ibw, .jpk-force, …; a map, or a folder of curves."),
        own=("-o",),
        second=("CONTACT", "TOML file with the contact: what stays, and where to start."),
    ),
}


def run(arguments: Sequence[str]) -> int:
    """Run the command and return its exit status."""
    try:
        with warnings.catch_warnings():
            warnings.showwarning = _show_warning
            status = _run(list(arguments))
        sys.stdout.flush()
    except InputError as error:
        return _fail(str(error), WRONG_INPUT)
    except ModelError as error:
        return _fail(str(error), INCOMPLETE)
    except KeyboardInterrupt:
        return _fail("interrupted", interrupts.status)
    except OSError as error:
        if error.errno not in (errno.EPIPE, errno.ENOSPC, errno.EFBIG):
            raise
        # standard output takes no more: let the interpreter's last flush go nowhere
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        if error.errno == errno.EPIPE:  # whoever read it has left
            return INCOMPLETE
        return _fail(f"standard output cannot be written ({error.strerror})", WRONG_INPUT)
    return status


def _run(given: list[str]) -> int:
    """Run what the arguments ask for."""
    listed = "".join(f"  {name:7s} {command.summary}\n" for name, command in COMMANDS.items())
    about = "Equilibrium curves of elastic contacts, with their stability and their folds."
    parser = _Parser("contbranch", "[OPTIONS] COMMAND [ARGS]...", about, f"\nCommands:\n{listed}")
    parser.disable_interspersed_args()
    parser.add_option("--version", action="store_true", help="Print the version and stop.")
    asked, rest = _parsed(parser, given)
    if asked.help or asked.version:
        return COMPLETE if asked.help else _print_version()
    if not rest:
        parser.error("Missing command")
    name = rest.pop(0)
    if name not in COMMANDS:
        parser.error(f"No such command {name!r}")
    command = COMMANDS[name]
    parser = command.parser(name)
    asked, rest = _parsed(parser, rest)
    if asked.help:
        return COMPLETE
    wanted = [one[0] for one in (command.argument, command.second) if one is not None]
    extra = rest[len(wanted) :]
    if extra:
        from contbranch.contact.units import is_unit

        quote = "; quote a quantity: '265 nN'" if any(map(is_unit, extra)) else ""
        parser.error(f"Got unexpected extra argument ({next(filter(is_unit, extra), extra[0])}){quote}")
    missing = [word for word in wanted[len(rest) :] if not word.startswith("[")]
    if missing:
        parser.error(f"Missing argument '{missing[0]}'")
    asked.source, asked.contact, asked.notes = rest[0] if rest else None, rest[1] if rest[1:] else None, []
    interrupted = False
    with ExitStack() as stack:
        outputs = _outputs(asked)
        places = [stack.enter_context(reserved(path, field)) for field, path in outputs if field not in command.own]
        interrupts.unfinished = places
        try:
            result = command.compute(asked) if name in ("show", "advise") else _watched(command, asked)
        except KeyboardInterrupt as error:
            if not hasattr(error, "partial"):
                raise
            result, interrupted = error.partial, True
        interrupts.keeping = True
        if not hasattr(result, "tasks"):  # a sweep has written its file, a fit of one curve has not
            places += [stack.enter_context(reserved(path, field)) for field, path in outputs if field in command.own]
        for note in asked.notes:
            print(f"contbranch: warning: {note}", file=sys.stderr)
        _deliver(result, asked, places)
    if interrupts.pending or interrupted:
        late = "what was asked for is complete all the same" if result.status == "complete" else result.message
        return _fail(f"interrupted: {late}", interrupts.status)
    if name in ("show", "view"):
        return COMPLETE
    if result.status != "complete":
        return _fail(f"incomplete: {result.message}", INCOMPLETE)
    if name == "fit":
        from contbranch.results.fit_map import NOTHING

        return _fail(NOTHING, INCOMPLETE) if result.outcome == NOTHING else COMPLETE
    return COMPLETE


def _watched(command: Command, asked: Values) -> Any:
    """Compute within the time allowed, telling how far it is; Ctrl-C ends it with what it has."""
    from contbranch.watch import watched

    limit = None
    if asked.time_limit is not None:
        from contbranch.cli.request import seconds

        limit = seconds(asked.time_limit)
    with _reporting() as report, watched(report, limit) as watch:
        result = command.compute(asked)
    return watch.passed(result)


@contextmanager
def _reporting() -> Iterator[Progress]:
    """Show progress on standard error, heeding Ctrl-C; what shows it is imported with the first news."""
    shown: list[Progress] = []
    with ExitStack() as stack:

        def report(fraction: float, text: str) -> None:
            interrupts.keeping = True
            if interrupts.pending:
                raise KeyboardInterrupt
            if not shown:
                from contbranch.output.summary import progress_bar, progress_lines

                shown.append(stack.enter_context(progress_bar()) if sys.stderr.isatty() else progress_lines())
            shown[0](fraction, text)

        yield report


def _parsed(parser: _Parser, given: list[str]) -> tuple[Values, list[str]]:
    """The options and what is left; help is printed where it is asked for."""
    parser.add_option("-h", "--help", action="store_true", help="Show this message and exit.")
    asked, rest = parser.parse_args(given)
    if asked.help:
        print(parser.format_help(), end="")
    return asked, rest


def _print_version() -> int:
    from contbranch import __version__

    print(f"contbranch {__version__}")
    return COMPLETE


def _show_warning(message: Warning | str, category: type[Warning], *_: object, **__: object) -> None:
    """Print a warning of ours as one line on standard error; others with their kind."""
    kind = "" if issubclass(category, UserWarning) else f"{category.__name__}: "
    print(f"contbranch: warning: {kind}{' '.join(str(message).split())}", file=sys.stderr)


def _fail(message: str, status: int) -> int:
    """Print one line on standard error and return the exit status."""
    print(f"contbranch: {' '.join(message.split())}", file=sys.stderr)
    return status


def _request(asked: Values) -> Request:
    if asked.source is not None:
        from contbranch.contact.text import read_text

        read_text(Path(asked.source))  # that it is missing is said before any library is imported
    from contbranch.cli.request import make_request

    return make_request(asked)


def _computed(name: str, request: Request, **options: Any) -> Any:
    """Call a computation of the package with the settings of the request."""
    import contbranch

    compute = getattr(contbranch, name)
    settings: dict[str, Any] = {"control": request.control, "accuracy": request.accuracy, "model": request.model}
    return compute(request.contact, **settings | options)


# Output


def _outputs(asked: Values) -> list[tuple[str, Path]]:
    """The files to be written, by option; InputError for one that cannot be, before anything is computed."""
    given = [*_texts(asked), ("-o", asked.output), *(("--plot", name) for name in asked.plot or ())]
    to_screen = [field for field, name in given if name == "-"]
    if len(to_screen) > 1 or "-o" in to_screen:
        takes = "standard output takes one of --json, --csv, --events-csv"
        raise InputError(f"{to_screen[-1]}: '-'; {takes}: give a file")
    paths = [(field, Path(name)) for field, name in given if name not in (None, "-")]
    seen = {} if asked.source is None else {Path(asked.source).resolve(): "the input"}
    for field, path in paths:
        folder = path.resolve().parent
        try:
            there = path.is_dir()
        except OSError as error:
            raise InputError(f"{field}: '{path.name[:40]}…': {error.strerror}; choose another name") from error
        if there:
            raise InputError(f"{field}: '{path}' is a folder; give a file")
        if not folder.is_dir():
            raise InputError(f"{field}: the folder '{folder}' does not exist; make it or choose another")
        if not os.access(path if path.exists() else folder, os.W_OK):
            raise InputError(f"{field}: '{path}' cannot be written; choose a place with write permission")
        if path.resolve() in seen:
            raise InputError(f"{field}: '{path}' is also {seen[path.resolve()]}; choose another file")
        seen[path.resolve()] = f"the output of {field}"
        known = _SUFFIXES[field]
        if (path.suffix or field == "--plot") and path.suffix.lower() not in re.findall(r"\.\w+", known):
            what = "no known suffix" if field == "--plot" else f"the suffix {path.suffix}"
            raise InputError(f"{field}: '{path}' has {what}; must end in {known}")
    return paths


def _deliver(result: Result, asked: Values, places: Sequence[Place]) -> None:
    """Write and print a result as it was asked for; what cannot be written leaves the rest."""
    failures: list[InputError] = []
    for place in sorted(places, key=lambda one: one.field != "-o"):  # first the one that holds everything
        try:
            place.write(_content(result, place.field, place.path.suffix))
        except InputError as error:
            failures.append(error)
    to_screen = [field for field, name in _texts(asked) if name == "-"]
    if to_screen:
        sys.stdout.write(_content(result, to_screen[0]).decode())
    else:
        print(result)
    if failures:
        raise InputError("; ".join(map(str, failures)))


def _texts(asked: Values) -> list[tuple[str, str | None]]:
    """What can be printed as well as written, by option; - is standard output."""
    return [("--json", asked.json), ("--csv", asked.csv), ("--events-csv", asked.events_csv)]


def _content(result: Result, field: str, suffix: str = "") -> bytes:
    """What an option writes."""
    if field == "-o":
        from contbranch.output.hdf5 import content

        return content(result)
    if field == "--plot":
        from contbranch.output.plot import draw, figure_content

        return figure_content(draw(result), suffix)
    if field == "--json":
        import json

        return f"{json.dumps(result.document(), allow_nan=False, ensure_ascii=False)}\n".encode()
    return (result.table() if field == "--csv" else result.tables()["event"]).csv().encode()
