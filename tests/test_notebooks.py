"""The notebook of the documentation runs, and shows figures and tables."""

from pathlib import Path

import nbformat
import pytest
from nbconvert import HTMLExporter
from nbconvert.preprocessors import ExecutePreprocessor

import contbranch as cb

NOTEBOOK = Path(__file__).resolve().parents[1] / "docs" / "howto" / "notebook.ipynb"


@pytest.fixture(scope="module")
def executed(tmp_path_factory):
    notebook = nbformat.read(NOTEBOOK, as_version=4)
    folder = tmp_path_factory.mktemp("notebook")
    ExecutePreprocessor(timeout=120, kernel_name="python3").preprocess(notebook, {"metadata": {"path": str(folder)}})
    return notebook


def shown(notebook, kind):
    outputs = (out for cell in notebook.cells for out in cell.get("outputs", ()))
    return [out["data"][kind] for out in outputs if kind in out.get("data", {})]


def test_the_notebook_shows_figures_and_tables(executed):
    pages = shown(executed, "text/html")
    assert sum("data:image/png;base64" in page for page in pages) >= 3
    assert sum("<table" in page for page in pages) >= 4
    assert len(shown(executed, "image/png")) >= 4
    html, _ = HTMLExporter().from_notebook_node(executed)
    assert html.count("data:image/png;base64") >= 4


def test_nothing_prints_arrays_or_leaves_bars(executed):
    assert all(text.count("\n") <= 60 for text in shown(executed, "text/plain"))
    streams = [out for cell in executed.cells for out in cell.get("outputs", ()) if out["output_type"] == "stream"]
    assert all(out["name"] == "stdout" for out in streams)
    assert not any("<progress" in page for page in shown(executed, "text/html"))


def test_results_say_what_they_are_in_three_lines():
    contact = cb.Contact.reduced("maugis-dugdale", tabor=1.0)
    diagram = cb.trace(contact)
    state = cb.solve(contact, load=1.0)
    loop = cb.hysteresis(contact, "displacement")
    everything = [diagram, state, loop, cb.find_all(contact, load=1.0), cb.advise(contact)]
    for one in [*everything, diagram.branches[0], diagram.events[0], diagram.branches[0].state(2), loop.path]:
        assert len(repr(one).splitlines()) <= 3
        assert all(len(line) <= 120 for line in repr(one).splitlines())
    for one in everything:
        page, picture = one._repr_html_(), one._repr_png_()
        assert ("<img" in page) == (picture is not None) == hasattr(one, "plot")
        assert "<td" in page
        assert "complete" in repr(one)
        assert "maugis-dugdale" in repr(one)
    assert "pull_off_load" in repr(diagram)
    assert "pull off load" in str(diagram)
