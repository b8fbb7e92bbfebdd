"""The command ``contbranch``: trace, solve, loop, follow and show.

Exit status: 0 complete; 1 incomplete (whatever was traced is written all the same); 2 wrong input, in one line. Heavy
libraries are imported where they are needed: the start of the command is a good part of its time.
"""

from __future__ import annotations

import os
import re
import sys
import warnings
from collections.abc import Callable, Sequence
from optparse import HelpFormatter, OptionParser, Values
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final, NamedTuple, NoReturn

from contbranch.errors import InputError, ModelError

if TYPE_CHECKING:
    from contbranch.cli.request import Request
    from contbranch.results.record import Result

__all__ = ["main"]

COMPLETE: Final = 0
INCOMPLETE: Final = 1
WRONG_INPUT: Final = 2
INTERRUPTED: Final = 130

# The value's name (none: a switch) and what it means.
_OPTIONS: Final = {
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
    "--uncertainty": ("NAME=X", "Of a parameter: adds those of the thresholds; may be given several times."),
    "--max-load": ("F", "Largest load.  [default: beyond all events]"),
    "--json": ("FILE", "Write JSON; - for standard output."),
    "--plot": ("FILE", "Draw to a .png, .pdf or .svg file."),
    "-o --output": ("FILE.h5", "Save arrays and profiles."),
}
_SHARED: Final = tuple(_OPTIONS)[:8]
_OUTPUTS: Final = ("--json", "--plot", "-o --output")


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
    """A command: what computes its result, its options, and its argument with what that is."""

    compute: Callable[[Values], Any]
    options: tuple[str, ...]
    argument: tuple[str, str] = ("[CONTACT]", "TOML file that describes the contact.")

    @property
    def summary(self) -> str:
        """What it does, in a sentence."""
        return self.compute.__doc__ or ""

    def parser(self, name: str) -> _Parser:
        """The parser of its options."""
        argument = "\nArguments:\n  {:11s} {}\n".format(*self.argument)
        parser = _Parser(f"contbranch {name}", f"[OPTIONS] {self.argument[0]}", self.summary, argument)
        for flags in self.options:
            value, words = _OPTIONS[flags]
            kind: dict[str, Any] = {"metavar": value} if value else {"action": "store_true", "default": False}
            kind |= {"action": "append", "default": []} if flags == "--uncertainty" else {}
            parser.add_option(*flags.split(), help=words, **kind)
        parser.set_defaults(json=None, output=None)
        return parser


def _trace(asked: Values) -> Any:
    """Trace the whole curve of equilibria, stable and unstable, with its folds and first touch."""
    request = _request(asked)
    limit = request.limit(asked.max_load)
    if not asked.uncertainty:
        return _computed("trace", request, max_load=limit)
    from dataclasses import replace

    from contbranch.cli.request import parse_uncertainties

    given = parse_uncertainties(asked.uncertainty, request)
    diagram = _computed("trace", request, max_load=limit)
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

        return best_of(_computed("find_all", request, **where))
    from dataclasses import replace

    return replace(_computed("solve", request, **where), states=())


def _loop(asked: Values) -> Any:
    """Follow the hysteresis loop: approach and retraction with all jumps and the energy they dissipate."""
    request = _request(asked)
    return _computed("hysteresis", request, max_load=request.limit(asked.max_load))


def _follow(asked: Values) -> Result:
    """Follow a fold or first touch in a second parameter, with the points where folds meet or end."""
    request = _request(asked)
    for option in ("event", "vary"):
        if getattr(asked, option) is None:
            raise InputError(f"--{option}: missing; write for example --event pull-off --vary tabor=0.25:4")
    from contbranch.cli.request import find_event, parse_vary
    from contbranch.contact.family import family_of
    from contbranch.curve.follow import follow
    from contbranch.models.choice import choose, on_grid

    name, values = parse_vary(asked.vary, request)
    limit = request.limit(asked.max_load)
    if on_grid(choose(request.contact, request.chosen_model)[0]):
        raise InputError("--model: events found on a grid cannot be followed; use the axisymmetric model")
    event = find_event(_computed("trace", request, max_load=limit), asked.event, request.control)
    try:
        present = event.stiffness if name == "stiffness" else None
        now = family_of(request.contact, name, values[-1], present, event.control).start
        if len(values) == 2 and not min(values) < now < max(values):  # to the farther one of the two
            values = (max(values, key=lambda value: abs(value - now)),)
        return follow(event, name, values, start=present, accuracy=request.accuracy)
    except InputError as error:
        raise InputError(f"--vary: {str(error).removeprefix('vary: ')}") from None


def _show(asked: Values) -> Result:
    """Print what a saved diagram holds, and draw it; exit status 0 even if the trace was incomplete."""
    from contbranch.output.hdf5 import load

    return load(asked.source)


COMMANDS: Final = {
    "trace": Command(_trace, (*_SHARED, "--max-load", "--uncertainty", *_OUTPUTS)),
    "solve": Command(_solve, (*_SHARED, "--load", "--displacement", "--all", *_OUTPUTS)),
    "loop": Command(_loop, (*_SHARED, "--max-load", *_OUTPUTS)),
    "follow": Command(_follow, (*_SHARED, "--event", "--vary", "--max-load", *_OUTPUTS)),
    "show": Command(_show, ("--plot",), ("FILE.h5", "Diagram saved by trace -o.")),
}


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command with `arguments` (default: those of the process) and return its exit status."""
    try:
        with warnings.catch_warnings():
            warnings.showwarning = _show_warning
            status = _run(list(sys.argv[1:] if arguments is None else arguments))
        sys.stdout.flush()
    except InputError as error:
        return _fail(str(error), WRONG_INPUT)
    except ModelError as error:
        return _fail(str(error), INCOMPLETE)
    except KeyboardInterrupt:
        return _fail("interrupted", INTERRUPTED)
    except BrokenPipeError:
        # whoever read standard output has left: let the interpreter's last flush go nowhere
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return INCOMPLETE
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
    if rest[1:]:
        parser.error(f"Got unexpected extra argument ({rest[1]})")
    if not rest and not command.argument[0].startswith("["):
        parser.error(f"Missing argument '{command.argument[0]}'")
    asked.source = rest[0] if rest else None
    _check_outputs(asked)
    result = command.compute(asked)
    _deliver(result, asked)
    if name == "show" or result.status == "complete":
        return COMPLETE
    return _fail(f"incomplete: {result.message}", INCOMPLETE)


def _parsed(parser: _Parser, given: list[str]) -> tuple[Values, list[str]]:
    """The options and what is left; help is printed where it is asked for."""
    parser.add_option("-h", "--help", action="store_true", help="Show this message and exit.")
    asked, rest = parser.parse_args(given)
    if asked.help:
        print(parser.format_help(), end="")
    return asked, rest


def _print_version() -> int:
    from importlib.metadata import PackageNotFoundError, version

    try:
        print(f"contbranch {version('contbranch')}")
    except PackageNotFoundError:  # run from a source tree that was never installed
        print("contbranch, not installed")
    return COMPLETE


def _show_warning(message: Warning | str, category: type[Warning], *_: object, **__: object) -> None:
    """Print a warning about a grid as one line on standard error; others with their kind."""
    kind = "" if category.__name__ == "GridWarning" else f"{category.__name__}: "
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
    """Call a computation of the package with the settings of the request, showing its progress on a terminal."""
    import contbranch

    compute = getattr(contbranch, name)
    settings: dict[str, Any] = {"control": request.control, "accuracy": request.accuracy, "model": request.chosen_model}
    settings |= options
    if not sys.stderr.isatty():
        return compute(request.contact, **settings)
    from contbranch.output.summary import progress_bar

    with progress_bar() as progress:
        return compute(request.contact, progress=progress, **settings)


# Output


def _check_outputs(asked: Values) -> None:
    """Raise InputError for an output that cannot be written, before anything is computed."""
    seen = {} if asked.source is None else {Path(asked.source).resolve(): "the input"}
    for field, name in (("--json", asked.json), ("--plot", asked.plot), ("-o", asked.output)):
        if name is None or (name == "-" and field == "--json"):
            continue
        path = Path(name)
        if field == "--plot" and path.suffix.lower() not in (".pdf", ".png", ".svg"):
            raise InputError(f"--plot: '{name}' has no known suffix; must end in .pdf, .png or .svg")
        folder = path.resolve().parent
        if path.is_dir():
            raise InputError(f"{field}: '{name}' is a folder; give a file")
        if not folder.is_dir():
            raise InputError(f"{field}: the folder '{folder}' does not exist; make it or choose another")
        if not os.access(path if path.exists() else folder, os.W_OK):
            raise InputError(f"{field}: '{name}' cannot be written; choose a place with write permission")
        if path.resolve() in seen:
            raise InputError(f"{field}: '{name}' is also {seen[path.resolve()]}; choose another file")
        seen[path.resolve()] = f"the output of {field}"


def _deliver(result: Result, asked: Values) -> None:
    """Write and print a result as it was asked for."""
    if asked.output is not None:
        result.save(asked.output)  # first: it holds everything
    if asked.json is not None:
        _write_json(result.document(), asked.json)
    if asked.plot is not None:
        from contbranch.output.plot import draw, save_figure

        save_figure(draw(result), asked.plot)
    if asked.json != "-":
        from contbranch.output.summary import print_result

        print_result(result)


def _write_json(document: dict[str, Any], name: str) -> None:
    import json

    text = json.dumps(document, allow_nan=False, ensure_ascii=False)
    if name == "-":
        sys.stdout.write(text + "\n")
        return
    try:
        Path(name).write_text(text + "\n", encoding="utf-8")
    except OSError as error:
        raise InputError(f"--json: '{name}' cannot be written ({error.strerror}); give a writable file") from None
