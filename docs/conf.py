"""How the pages are made: `sphinx-build -W -n docs FOLDER`, without network.

Formulas are drawn by matplotlib, the pictures of the gallery by `studies/gallery.py`, and the page of the command
line is what `contbranch COMMAND --help` prints.
"""

from __future__ import annotations

import os
import re
import sys
from contextlib import redirect_stdout
from io import StringIO
from pathlib import Path
from typing import TYPE_CHECKING

from docutils import nodes

if TYPE_CHECKING:
    from sphinx.application import Sphinx
    from sphinx.writers.html5 import HTML5Translator

ROOT = Path(__file__).resolve().parents[1]
GENERATED = Path(__file__).parent / "generated"
sys.path[:0] = [str(ROOT)]
os.environ.setdefault("MPLBACKEND", "Agg")
os.environ["COLUMNS"] = "100"

import contbranch  # noqa: E402

project = "contbranch"
author = "The contbranch developers"
copyright = "2026, the contbranch developers"  # noqa: A001
release = version = contbranch.__version__

extensions = ["myst_nb", "sphinx.ext.autodoc", "numpydoc"]
exclude_patterns = ["_build", "**.ipynb_checkpoints"]
nitpicky = True
# What docstrings put in backquotes is linked where it is a name of the package, and is code otherwise.
default_role = "py:obj"
nitpick_ignore_regex = [("py:.*", ".*")]

html_theme = "furo"
html_title = f"contbranch {release}"
html_static_path = ["static"]
html_css_files = ["pages.css"]
html_show_sphinx = False

myst_enable_extensions = ["colon_fence", "deflist", "dollarmath"]
myst_heading_anchors = 3
nb_execution_mode = "force"
nb_execution_timeout = 300
nb_execution_raise_on_error = True
nb_merge_streams = True

autodoc_member_order = "bysource"
autodoc_typehints = "none"
numpydoc_show_class_members = False
numpydoc_class_members_toctree = False
numpydoc_xref_param_type = False

html_math_renderer = "drawn"


def drawn(formula: str) -> str:
    """Return a line of TeX as a picture in the colour of the text."""
    from matplotlib import rc_context
    from matplotlib.font_manager import FontProperties
    from matplotlib.mathtext import math_to_image

    def upright(found: re.Match[str]) -> str:
        return rf"\mathrm{{{found[1]}}}".replace(" ", r"\ ").replace("-", "\N{HYPHEN}")

    words = re.sub(r"\\text\{(.*?)\}", upright, formula)
    with rc_context({"mathtext.fontset": "stix", "svg.fonttype": "path", "svg.hashsalt": formula}):
        picture = StringIO()
        math_to_image(
            f"${' '.join(words.split())}$", picture, prop=FontProperties(size=14), dpi=72, format="svg", color="#123456"
        )
    svg = picture.getvalue().replace("#123456", "currentColor")
    return svg[svg.index("<svg") :]


def write_formula(self: HTML5Translator, node: nodes.Element) -> None:
    """Write the lines of a displayed formula, one below the other."""
    text = (
        re.sub(r"\\(begin|end)\{aligned\}", "", node.astext())
        .replace("&&", r"\quad ")
        .replace("&", "")
        .replace(r"\frac", r"\dfrac")
    )
    lines = text.split(r"\\")
    self.body.append(f'<div class="formula">{"".join(f"<div>{drawn(line)}</div>" for line in lines)}</div>')
    raise nodes.SkipNode


def draw_gallery(_: Sphinx) -> None:
    """Draw what `studies/gallery.py` draws, and write the page that shows it."""
    from studies.gallery import FIGURES

    GENERATED.mkdir(exist_ok=True)
    parts = ["# Gallery\n\nThe figures that results draw by themselves, `python studies/gallery.py FOLDER`.\n"]
    for name, draw in FIGURES.items():
        picture = GENERATED / f"{name}.png"
        if not picture.exists():
            draw().savefig(picture, dpi=150)
        title = name.replace("_", " ").capitalize()
        code = f"```{{literalinclude}} ../../studies/gallery.py\n:pyobject: {name}\n```"
        parts.append(f"## {title}\n\n{draw.__doc__}\n\n![{title}]({picture.name})\n\n{code}\n")
    write("gallery", "\n".join(parts))


def write_command_line(_: Sphinx) -> None:
    """Write what every command says of itself."""
    from contbranch.cli import main

    def told(*words: str) -> str:
        with redirect_stdout(StringIO()) as said:
            main([*words, "--help"])
        return said.getvalue()

    top = told()
    names = re.findall(r"^  ([a-z]+)  ", top, flags=re.MULTILINE)
    page = ["# Command line\n", f"```text\n{top}```\n"]
    page += [f"## contbranch {name}\n\n```text\n{told(name)}```\n" for name in names]
    write("command-line", "\n".join(page))


def keep_numbers(_: Sphinx, document: nodes.document) -> None:
    """Let numbers in tables stand on one line."""
    for entry in document.findall(nodes.entry):
        if re.fullmatch(r"[-−+\d.e±()…\s%]+", entry.astext()):
            entry["classes"].append("number")


def skip_field(_app: Sphinx, _what: str, _name: str, obj: object, _skip: bool, _options: object) -> bool | None:
    """Leave out the fields of named tuples, which stand among the attributes of their class."""
    return True if (getattr(obj, "__doc__", None) or "").startswith("Alias for field") else None


def escape_bars(_app: Sphinx, _what: str, _name: str, _obj: object, _options: object, lines: list[str]) -> None:
    """Let |x| in docstrings be an absolute value and not a substitution."""
    lines[:] = [
        "``".join(part.replace("|", r"\|") if i % 2 == 0 else part for i, part in enumerate(line.split("``")))
        for line in lines
    ]


def write(name: str, text: str) -> None:
    """Write a page, unless it is there as it is."""
    path = GENERATED / f"{name}.md"
    GENERATED.mkdir(exist_ok=True)
    if not path.exists() or path.read_text(encoding="utf-8") != text:
        path.write_text(text, encoding="utf-8")


def setup(app: Sphinx) -> None:
    """Register what is made here."""
    app.add_html_math_renderer("drawn", (write_formula, None), (write_formula, None))
    app.connect("doctree-read", keep_numbers)
    app.connect("autodoc-process-docstring", escape_bars)
    app.connect("autodoc-skip-member", skip_field)
    app.connect("builder-inited", draw_gallery)
    app.connect("builder-inited", write_command_line)
