"""The command ``contbranch``: trace, solve, loop, follow and show.

Exit status: 0 complete; 1 incomplete (whatever was traced is written all the same); 2 wrong input, in one line. Heavy
libraries are imported where they are needed: the start of the command is a good part of its time.
"""

from __future__ import annotations

import json
import os
import sys
import warnings
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Final, TextIO

import typer

from contbranch.cli.options import Json, MaxLoad, Output, Plot, with_request
from contbranch.errors import InputError, ModelError

if TYPE_CHECKING:
    from contbranch.cli.request import Request
    from contbranch.cli.request_follow import Variation
    from contbranch.results.diagram import Diagram, Solution
    from contbranch.results.followed import Followed

__all__ = ["main"]

COMPLETE: Final = 0
INCOMPLETE: Final = 1
WRONG_INPUT: Final = 2
INTERRUPTED: Final = 130

_USAGE_ERROR: Final = typer.BadParameter.__mro__[2]  # click's ClickException, wherever the installed typer keeps it

app = typer.Typer(
    add_completion=False,
    rich_markup_mode=None,
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"], "max_content_width": 100},
)


def _print_version(asked: bool) -> None:
    if asked:
        from importlib.metadata import PackageNotFoundError, version

        try:
            print(f"contbranch {version('contbranch')}")
        except PackageNotFoundError:  # run from a source tree that was never installed
            print("contbranch, not installed")
        raise typer.Exit


@app.callback()
def options(
    version: Annotated[
        bool, typer.Option("--version", is_eager=True, callback=_print_version, help="Print the version and stop.")
    ] = False,
) -> None:
    """Equilibrium curves of elastic contacts, with their stability and their folds."""


@app.command("trace")
@with_request
def trace_command(
    request: Request,
    source: str | None,
    max_load: MaxLoad = None,
    json_file: Json = None,
    plot: Plot = None,
    output: Output = None,
) -> int:
    """Trace the whole curve of equilibria, stable and unstable, with its folds and first touch."""
    limit = _limit(request, max_load)
    _check_outputs({"--json": json_file, "--plot": plot, "-o": output}, source)
    diagram = _with_progress("trace", request, max_load=limit)
    _write_outputs(diagram, json_file, plot, output)
    return _report(diagram.status, diagram.message)


@app.command("solve")
@with_request
def solve_command(
    request: Request,
    source: str | None,
    load: Annotated[str | None, typer.Option(metavar="F", help="Load of the equilibrium.")] = None,
    displacement: Annotated[str | None, typer.Option(metavar="D", help="Or its displacement.")] = None,
    every: Annotated[bool, typer.Option("--all", help="Report all equilibria found, not only one.")] = False,
    json_file: Json = None,
    plot: Plot = None,
    output: Output = None,
) -> int:
    """Find the equilibrium at a load or a displacement; of several, the stable one of lowest energy."""
    if (load is None) == (displacement is None):
        raise InputError("--load, --displacement: give one of them")
    if load is not None:
        where = {"load": request.quantity(load, "force", "--load")}
    else:
        where = {"displacement": request.quantity(displacement or "", "length", "--displacement")}
    _check_outputs({"--json": json_file, "--plot": plot, "-o": output}, source)
    solution = _solve(request, where, every)
    if output is not None:
        from contbranch.output.hdf5 import save_solution

        save_solution(solution, output, every=every)
    if json_file is not None:
        from contbranch.output.document import solution_document

        _write_json(solution_document(solution, every=every), json_file)
    if plot is not None:
        from contbranch.output.plot import profiles, save_figure

        save_figure(profiles(solution, request.contact.units.names), plot)
    if json_file != "-":
        from contbranch.output.summary import print_solution

        print_solution(solution, every=every)
    return _report(solution.status, solution.message)


@app.command("loop")
@with_request
def loop_command(
    request: Request,
    source: str | None,
    max_load: MaxLoad = None,
    json_file: Json = None,
    plot: Plot = None,
    output: Output = None,
) -> int:
    """Follow the hysteresis loop: approach and retraction with all jumps and the energy they dissipate."""
    from contbranch.output.document import loop_document

    limit = _limit(request, max_load)
    _check_outputs({"--json": json_file, "--plot": plot, "-o": output}, source)
    loop = _with_progress("hysteresis", request, max_load=limit)
    _write_document(loop_document(loop), json_file, output)
    if plot is not None:
        from contbranch.output.plot import save_figure

        save_figure(loop.plot(), plot)
    if json_file != "-":
        from contbranch.output.summary import print_loop

        print_loop(loop)
    return _report(loop.status, loop.message)


@app.command("follow")
@with_request
def follow_command(
    request: Request,
    source: str | None,
    event: Annotated[str | None, typer.Option(metavar="NAME", help="Name of a fold under --control, or touch.")] = None,
    vary: Annotated[
        str | None, typer.Option(metavar="NAME=FROM:TO", help="Parameter to vary, for example tabor=0.25:4.")
    ] = None,
    max_load: MaxLoad = None,
    json_file: Json = None,
    plot: Plot = None,
    output: Output = None,
) -> int:
    """Follow a fold or first touch in a second parameter, with the points where folds meet or end."""
    from contbranch.cli.request_follow import parse_vary

    for option, value in (("--event", event), ("--vary", vary)):
        if value is None:
            raise InputError(f"{option}: missing; write for example --event pull-off --vary tabor=0.25:4")
    variation = parse_vary(vary or "", request)
    _check_outputs({"--json": json_file, "--plot": plot, "-o": output}, source)
    followed = _follow(request, event or "", variation, _limit(request, max_load))
    _write_document(followed.document(), json_file, output)
    if plot is not None:
        from contbranch.output.plot import save_figure

        save_figure(followed.plot(), plot)
    if json_file != "-":
        from contbranch.output.summary_follow import print_followed

        print_followed(followed)
    return _report(followed.status, followed.message)


@app.command("show")
def show_command(
    file: Annotated[str, typer.Argument(metavar="FILE.h5", help="Diagram saved by trace -o.")],
    plot: Plot = None,
) -> int:
    """Print what a saved diagram holds, and draw it; exit status 0 even if the trace was incomplete."""
    _check_outputs({"--plot": plot}, file)
    from contbranch.output.hdf5 import load
    from contbranch.output.summary import print_diagram

    diagram = load(file)
    if plot is not None:
        _draw(diagram, plot)
    print_diagram(diagram)
    return COMPLETE


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command with `arguments` (default: those of the process) and return its exit status."""
    given = list(sys.argv[1:] if arguments is None else arguments)
    command = typer.main.get_command(app)
    try:
        with warnings.catch_warnings():
            warnings.showwarning = _show_warning
            status = command.main(args=given, prog_name="contbranch", standalone_mode=False)
        sys.stdout.flush()
        if status == INTERRUPTED:  # what typer makes of an interrupt
            raise KeyboardInterrupt
    except InputError as error:
        return _fail(str(error), WRONG_INPUT)
    except ModelError as error:
        return _fail(str(error), INCOMPLETE)
    except (KeyboardInterrupt, typer.Abort):
        return _fail("interrupted", INTERRUPTED)
    except BrokenPipeError:
        # whoever read standard output has left: let the interpreter's last flush go nowhere
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return INCOMPLETE
    except Exception as error:
        if not isinstance(error, _USAGE_ERROR):
            raise
        return _fail(_usage(error, given), WRONG_INPUT)
    return status if isinstance(status, int) else COMPLETE


def _show_warning(
    message: Warning | str,
    category: type[Warning],
    filename: str,
    lineno: int,
    file: TextIO | None = None,
    line: str | None = None,
) -> None:
    """Print a warning about a grid as one line on standard error; others with their kind."""
    kind = "" if category.__name__ == "GridWarning" else f"{category.__name__}: "
    print(f"contbranch: warning: {kind}{' '.join(str(message).split())}", file=sys.stderr)


def _fail(message: str, status: int) -> int:
    """Print one line on standard error and return the exit status."""
    print(f"contbranch: {' '.join(message.split())}", file=sys.stderr)
    return status


def _usage(error: Exception, given: Sequence[str]) -> str:
    """Return click's complaint about the usage with a remedy."""
    message = str(getattr(error, "format_message", lambda: error)()).strip().rstrip(".")
    command = next((word for word in given if word in ("trace", "solve", "loop", "follow", "show")), "")
    return f"{message}; see contbranch {command + ' ' if command else ''}--help"


# Computing


def _solve(request: Request, where: dict[str, Any], every: bool) -> Solution:
    if not request.controlled:
        where = {**where, "control": None}  # that of the quantity given
    if not every:
        found: Solution = _with_progress("solve", request, **where)
        return found
    from contbranch.models.find import best_of

    return best_of(_with_progress("find_all", request, **where))


def _limit(request: Request, max_load: str | None) -> float | None:
    """The largest load, from the option or the contact file; None for the default."""
    return request.max_load if max_load is None else request.quantity(max_load, "force", "--max-load")


def _follow(request: Request, name: str, variation: Variation, limit: float | None) -> Followed:
    from contbranch.cli.request_follow import find_event
    from contbranch.contact.family import family_of
    from contbranch.curve.follow import follow
    from contbranch.models.choice import choose
    from contbranch.models.grid import FreeSpace, Periodic

    if isinstance(choose(request.contact, request.chosen_model)[0], Periodic | FreeSpace):
        raise InputError("--model: events found on a grid cannot be followed; use the axisymmetric model")
    diagram = _with_progress("trace", request, max_load=limit)
    event = find_event(diagram, name, request.control)
    try:
        present = event.stiffness if variation.name == "stiffness" else None
        family = family_of(request.contact, variation.name, variation.values[-1], present, event.control)
        goals = variation.to(family.start)
        return follow(event, variation.name, goals, start=present, accuracy=request.accuracy)
    except InputError as error:
        raise InputError(f"--vary: {str(error).removeprefix('vary: ')}") from None


def _with_progress(name: str, request: Request, **options: Any) -> Any:
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


def _check_outputs(outputs: dict[str, str | None], source: str | None) -> None:
    """Raise InputError for an output that cannot be written, before anything is computed."""
    seen: dict[Path, str] = {} if source is None else {Path(source).resolve(): "the input"}
    for field, name in outputs.items():
        if name is None or (name == "-" and field == "--json"):
            continue
        path = Path(name)
        if field == "--plot":
            _check_suffix(name)
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


def _check_suffix(name: str) -> None:
    """Raise InputError for a plot that cannot be drawn, without importing matplotlib for it."""
    if Path(name).suffix.lower() not in (".pdf", ".png", ".svg"):
        raise InputError(f"--plot: '{name}' has no known suffix; must end in .pdf, .png or .svg")


def _write_outputs(diagram: Diagram, json_file: str | None, plot: str | None, output: str | None) -> None:
    if output is not None:
        diagram.save(output)  # first: it holds everything
    if json_file is not None:
        from contbranch.output.document import diagram_document

        _write_json(diagram_document(diagram), json_file)
    if plot is not None:
        _draw(diagram, plot)
    if json_file != "-":
        from contbranch.output.summary import print_diagram

        print_diagram(diagram)


def _write_document(document: dict[str, Any], json_file: str | None, output: str | None) -> None:
    """Write a document as HDF5 and as JSON, where these are asked for."""
    if output is not None:
        from contbranch.output.hdf5 import save_document

        save_document(document, output)
    if json_file is not None:
        _write_json(document, json_file)


def _write_json(document: dict[str, Any], name: str) -> None:
    text = json.dumps(document, allow_nan=False, ensure_ascii=False)
    if name == "-":
        sys.stdout.write(text + "\n")
        return
    try:
        Path(name).write_text(text + "\n", encoding="utf-8")
    except OSError as error:
        raise InputError(f"--json: '{name}' cannot be written ({error.strerror}); give a writable file") from None


def _draw(diagram: Diagram, name: str) -> None:
    from contbranch.output.plot import overview, save_figure

    save_figure(overview(diagram), name)


def _report(status: str, message: str) -> int:
    """Print the reason of an incomplete result, and return the exit status."""
    if status == "complete":
        return COMPLETE
    return _fail(f"incomplete: {message}", INCOMPLETE)
