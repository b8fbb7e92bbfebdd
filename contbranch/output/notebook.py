"""What notebooks show of a result: its figure, and its tables."""

from __future__ import annotations

import base64
import time
from collections.abc import Iterator
from contextlib import contextmanager
from html import escape
from importlib import import_module
from typing import TYPE_CHECKING, Any

from contbranch.errors import InputError
from contbranch.output.plot import draw, figure_content
from contbranch.output.summary import Cells, parts

if TYPE_CHECKING:
    from contbranch.results.record import Result
    from contbranch.watch import Progress


# Seconds before a progress bar is worth its room.
PATIENCE = 1.0


def as_png(result: Result) -> bytes | None:
    """The figure of a result, as `contbranch.output.plot.draw` draws it; None for one that is a table alone."""
    try:
        return figure_content(draw(result), ".png", dpi=200)
    except InputError:  # nothing to draw, or too many parameters for a picture
        return None


def as_html(result: Result) -> str:
    """The figure, what is printed for people, and for a diagram the page on which it is explored."""
    shown = [f"<p>{escape(part)}</p>" if isinstance(part, str) else _table(part) for part in parts(result)]
    return "\n".join(["<div>", *_image(result), *shown, *_explored(result), "</div>"])


def _image(result: Result) -> Iterator[str]:
    """The figure in the page."""
    if (content := as_png(result)) is not None:
        words, picture = escape(repr(result).splitlines()[0]), base64.b64encode(content).decode()
        yield f'<img alt="{words}" width="440" src="data:image/png;base64,{picture}">'


def _explored(result: Result) -> Iterator[str]:
    """The page of a diagram, folded up."""
    from contbranch.output.page import page
    from contbranch.results.diagram import Diagram

    if isinstance(result, Diagram) and result.branches:
        look = 'title="diagram" width="100%" height="900" loading="lazy"'
        frame = f'<iframe {look} srcdoc="{escape(page(result))}"></iframe>'
        yield f"<details><summary>Explore it</summary>{frame}</details>"


@contextmanager
def progress_bar() -> Iterator[Progress]:
    """Show a progress bar below the cell of what takes longer than a second; it leaves nothing behind."""
    page: Any = import_module("IPython.display")  # only where there is a notebook

    shown: list[Any] = []
    began = time.monotonic()

    def report(fraction: float, text: str) -> None:
        if time.monotonic() > began + PATIENCE:
            bar = page.HTML(f'<progress value="{fraction:.3f}" style="width:20em"></progress> {escape(text)}')
            if shown:
                shown[0].update(bar)
            else:
                shown.append(page.display(bar, display_id=True))

    try:
        yield report
    finally:
        for handle in shown:
            handle.update(page.HTML(""))


def _table(cells: Cells) -> str:
    sides = ["left" if side == "<" else "right" for side in cells.sides]
    rows = [("th", cells.headings), *(("td", row) for row in cells.rows)]
    lines = []
    for tag, row in rows:
        texts = zip(row, sides, strict=False)
        lines.append("".join(f'<{tag} style="text-align:{side}">{escape(text)}</{tag}>' for text, side in texts))
    return "<table>" + "".join(f"<tr>{line}</tr>" for line in lines) + "</table>"
