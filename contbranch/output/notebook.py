"""What notebooks show of a result: its figure, and its tables."""

from __future__ import annotations

import base64
from html import escape
from io import BytesIO
from typing import TYPE_CHECKING

from contbranch.output.plot import draw
from contbranch.output.summary import Cells, parts

if TYPE_CHECKING:
    from contbranch.results.record import Result

__all__ = ["as_html", "as_png"]


def as_png(result: Result) -> bytes:
    """The figure of a result, as `contbranch.output.plot.draw` draws it."""
    held = BytesIO()
    draw(result).savefig(held, format="png", dpi=200)
    return held.getvalue()


def as_html(result: Result) -> str:
    """The figure, and what is printed for people."""
    picture = base64.b64encode(as_png(result)).decode()
    shown = [f"<p>{escape(part)}</p>" if isinstance(part, str) else _table(part) for part in parts(result)]
    image = f'<img alt="{escape(repr(result).splitlines()[0])}" width="440" src="data:image/png;base64,{picture}">'
    return "\n".join(["<div>", image, *shown, "</div>"])


def _table(cells: Cells) -> str:
    sides = ["left" if side == "<" else "right" for side in cells.sides]
    rows = [("th", cells.headings), *(("td", row) for row in cells.rows)]
    lines = []
    for tag, row in rows:
        texts = zip(row, sides, strict=False)
        lines.append("".join(f'<{tag} style="text-align:{side}">{escape(text)}</{tag}>' for text, side in texts))
    return "<table>" + "".join(f"<tr>{line}</tr>" for line in lines) + "</table>"
