"""Figures that once were hard to read: labels stand apart, marks lie within the frame, axes name their units."""

import sys
from functools import cache
from itertools import combinations
from pathlib import Path

import matplotlib as mpl
import numpy as np
import pytest
from matplotlib.figure import Figure
from matplotlib.image import imread
from matplotlib.text import Annotation

import contbranch as cb

ROOT = Path(__file__).resolve().parents[1]
if str(ROOT) not in sys.path:
    sys.path.append(str(ROOT))  # the scripts in studies/ are not installed

from studies import gallery  # noqa: E402


@cache
def drawn(name):
    return gallery.FIGURES[name]()


@pytest.fixture(scope="module", params=gallery.FIGURES)
def figure(request):
    figure = drawn(request.param)
    figure.draw_without_rendering()
    return figure


def labels(axes):
    return [one for one in axes.texts if isinstance(one, Annotation) and one.get_text()]


def boxes(figure, items):
    renderer = figure.canvas.get_renderer()
    found = [item.get_window_extent(renderer) for item in items if item.get_text()]
    return [box for box in found if box.width > 0.0]


def test_no_two_labels_overlap(figure):
    for axes in figure.axes:
        texts = [mpl.text.Text.get_window_extent(one, figure.canvas.get_renderer()) for one in labels(axes)]
        ticks = [boxes(figure, axis.get_ticklabels()) for axis in (axes.xaxis, axes.yaxis)]
        for group in (texts, *ticks):
            assert not any(one.overlaps(other) for one, other in combinations(group, 2))


def test_labels_are_few_and_within_the_figure(figure):
    for axes in figure.axes:
        assert len(labels(axes)) <= 8
        low, high = axes.get_xlim()
        shown = [label for label in axes.get_xticklabels() if low <= label.get_position()[0] <= high]
        for box in [*boxes(figure, shown), *boxes(figure, [axes.xaxis.label, axes.yaxis.label])]:
            assert box.x0 >= 0.0
            assert box.x1 <= figure.bbox.x1
            assert box.y0 >= 0.0


def test_marks_lie_within_the_frame(figure):
    for axes in figure.axes:
        frame = axes.get_window_extent()
        for line in axes.get_lines():
            if line.get_marker() in (None, "None", ""):
                continue
            half = 0.5 * line.get_markersize() * figure.dpi / 72.0
            (x, y) = axes.transData.transform(line.get_xydata())[0]
            assert frame.x0 + half <= x <= frame.x1 - half
            assert frame.y0 + half <= y <= frame.y1 - half


def test_axes_have_units(figure):
    for axes in figure.axes:
        for text in (axes.get_xlabel(), axes.get_ylabel()):
            assert "(" in text or text.startswith(r"Tabor"), text


def test_the_first_and_the_last_layer_are_named():
    axes = drawn("cascade").axes[0]
    shown = {one.get_text() for one in labels(axes)}
    assert {"squeeze-out-1", "squeeze-out-6", "pull-off-2", "pull-off-7"} <= shown
    assert not {"squeeze-out-3", "pull-off-4"} & shown


def test_a_loop_shows_zero_load():
    axes = drawn("loop_zero").axes[0]
    assert axes.get_ylim()[0] < 0.0 < axes.get_ylim()[1]
    path = max(
        (line for line in axes.get_lines() if len(line.get_xdata()) > 9), key=lambda line: line.get_ydata().max()
    )
    assert path.get_ydata().max() > 0.0


def test_a_loop_without_contact_shows_the_gap():
    loop = cb.hysteresis(cb.Contact.reduced("gauss", tabor=1.0, sign=-1), max_load=5.0, accuracy=1e-4)
    apart = np.all(loop.path.contact_radius == 0.0)
    assert loop.plot().axes[1].get_ylabel().startswith("$g(0)" if apart else "$a_c")


def test_energies_of_events_lie_on_the_curve():
    """At a fold under displacement control the energy has a cusp: dV = F dd."""
    contact = cb.Contact.reduced("exponential", tabor=4.0)
    fine = cb.trace(contact, accuracy=1e-6)
    from contbranch.output.plot_curve import coordinate

    for event in fine.folds("displacement"):
        found = cb.solve(contact, load=event.load, near=None, accuracy=1e-8) if event.name is None else None
        if found is not None and abs(found.displacement - event.displacement) < 1e-6:
            assert coordinate(fine, event, "energy") == pytest.approx(found.energy, abs=1e-3)
    axes = fine.plot("displacement", "energy").axes[0]
    assert {"pull-off", "jump-in"} <= {one.get_text() for one in labels(axes)}


def test_a_spring_has_a_position_and_a_deflection():
    contact = cb.Contact.reduced("exponential", tabor=1.0)
    diagram = cb.trace(contact, control=cb.Spring(2.0), accuracy=1e-4)
    line = max(diagram.plot("piezo", "deflection").axes[0].get_lines(), key=lambda line: len(line.get_xdata()))
    assert line.get_xdata().max() > line.get_ydata().max()
    loop = cb.hysteresis(contact, control=cb.Spring(2.0), accuracy=1e-4)
    axes = loop.plot("piezo", "deflection").axes[0]
    at = [line.get_xydata()[0] for line in axes.get_lines() if line.get_marker() == "o"]
    for jump, (x, y) in zip(loop.jumps, at, strict=True):
        assert (x, y) == pytest.approx((jump.position, jump.start.load / 2.0), abs=1e-9)
    with pytest.raises(cb.InputError, match=r"no spring here"):
        cb.trace(cb.Contact.reduced("maugis-dugdale")).plot("piezo", "deflection")


def test_several_curves_share_axes_in_the_users_style():
    with mpl.rc_context({"font.size": 13.0, "xtick.direction": "out"}):
        figure = Figure()
        axes = figure.subplots()
        for number, tabor in enumerate((1.0, 2.0)):
            diagram = cb.trace(cb.Contact.reduced("gauss", tabor=tabor, sign=-1), accuracy=1e-4)
            assert diagram.plot("load", "contact_radius", ax=axes, labels=False, label=f"{tabor:g}") is figure
            stable = [line for line in axes.get_lines() if line.get_color() == f"C{number}"]
            assert stable
        axes.legend()
    assert [text.get_text() for text in axes.get_legend().get_texts()] == ["1", "2"]
    assert not labels(axes)
    for event in diagram.folds():
        assert axes.get_xlim()[0] < event.load < axes.get_xlim()[1]
    with mpl.rc_context({"figure.figsize": (5.0, 4.0), "axes.labelsize": 15.0}):
        own = diagram.plot()
    assert own.get_size_inches().tolist() == [5.0, 4.0]
    assert own.axes[0].xaxis.label.get_size() == 15.0


def test_a_figure_is_saved_as_finely_as_from_the_command_line_and_shows_itself(tmp_path):
    figure = cb.trace(cb.Contact.reduced("maugis-dugdale")).plot()
    figure.savefig(tmp_path / "x.png")
    assert imread(tmp_path / "x.png").shape[1] == round(3.4 * 300)
    assert figure._repr_png_()[0].startswith(b"\x89PNG")
