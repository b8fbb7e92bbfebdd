"""Options of the commands: those that describe a contact and its computation, shared by all, and the outputs."""

from __future__ import annotations

import inspect
from collections.abc import Callable
from typing import TYPE_CHECKING, Annotated, Any, get_type_hints

import typer

if TYPE_CHECKING:
    from contbranch.cli.request import Request

__all__ = ["Json", "MaxLoad", "Output", "Plot", "with_request"]

ContactFile = Annotated[
    str | None, typer.Argument(metavar="[CONTACT]", help="TOML file that describes the contact.", show_default=False)
]
Law = Annotated[
    str | None,
    typer.Option("--interaction", metavar="NAME", help="Instead of CONTACT: the law of a contact in reduced units."),
]
Tabor = Annotated[str | None, typer.Option(metavar="X", help="Its Tabor coefficient.")]
Repulsive = Annotated[bool, typer.Option("--repulsive", help="The law repels.")]
Control = Annotated[
    str | None, typer.Option(metavar="load|displacement|spring:K", help="What is controlled.  [default: load]")
]
Accuracy = Annotated[
    str | None, typer.Option(metavar="X", help="Error allowed to events and thresholds.  [default: 1e-6]")
]
Model = Annotated[
    str | None,
    typer.Option(metavar="auto|exact|axisymmetric|periodic|free", help="Model of the contact.  [default: auto]"),
]
MaxLoad = Annotated[str | None, typer.Option(metavar="F", help="Largest load.  [default: beyond all events]")]
Cell = Annotated[
    str | None, typer.Option(metavar="L", help="Edge of a periodic or free cell.  [default: by the accuracy]")
]
Grid = Annotated[str | None, typer.Option(metavar="N", help="Nodes along it, even.  [default: by the accuracy]")]
Json = Annotated[str | None, typer.Option("--json", metavar="FILE", help="Write JSON; - for standard output.")]
Output = Annotated[str | None, typer.Option("-o", "--output", metavar="FILE.h5", help="Save arrays and profiles.")]
Plot = Annotated[str | None, typer.Option(metavar="FILE", help="Draw to a .png, .pdf or .svg file.")]


def _shared(
    contact: ContactFile = None,
    interaction: Law = None,
    tabor: Tabor = None,
    repulsive: Repulsive = False,
    control: Control = None,
    accuracy: Accuracy = None,
    model: Model = None,
    cell: Cell = None,
    grid: Grid = None,
) -> Request:
    """The request that the shared options make."""
    from contbranch.cli.request import make_request

    return make_request(contact, interaction, tabor, repulsive, control, accuracy, model, cell, grid)


def with_request(command: Callable[..., int]) -> Callable[..., int]:
    """Give a command the shared options: it receives what they ask for as `request`, and `source`, the contact's file.

    The parameters that a command declares itself follow the shared ones.
    """
    shared = list(inspect.signature(_shared).parameters.values())
    own = [p for p in inspect.signature(command).parameters.values() if p.name not in ("request", "source")]
    # The request's own class is imported when a command runs: the start of the program is a good part of its time.
    hints: dict[str, Any] = {}
    for function in (command, _shared):
        hints |= get_type_hints(function, localns={"Request": Any}, include_extras=True)

    def run(**given: Any) -> int:
        asked = {p.name: given.pop(p.name) for p in shared}
        return command(request=_shared(**asked), source=asked["contact"], **given)

    parameters = [p.replace(kind=p.KEYWORD_ONLY, annotation=hints[p.name]) for p in (*shared, *own)]
    run.__name__, run.__doc__ = command.__name__, command.__doc__
    run.__signature__ = inspect.Signature(parameters, return_annotation=int)  # type: ignore[attr-defined]
    run.__annotations__ = {p.name: p.annotation for p in parameters} | {"return": int}
    return run
