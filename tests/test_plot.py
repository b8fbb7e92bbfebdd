"""Plots: what is drawn where, and that nothing hides anything else."""

from __future__ import annotations

import subprocess
import sys
from dataclasses import replace
from itertools import combinations

import numpy as np
import pytest
from matplotlib.axes import Axes
from matplotlib.text import Annotation, Text

import contbranch as cb
from contbranch.errors import InputError
from contbranch.output import plot, plot_maps, plot_view
from contbranch.output.plot_curve import pieces, smooth_line
from contbranch.output.plot_view import Limits
from contbranch.results.diagram import Branch, Diagram
from contbranch.results.followed import Followed
from contbranch.theory import maugis


def annotations(axes: Axes) -> list[Annotation]:
    return [child for child in axes.get_children() if isinstance(child, Annotation)]


def view(diagram: Diagram, x: str, y: str) -> Limits | None:
    lines = [smooth_line(diagram, number) for number in range(len(diagram.branches))]
    return plot_view.view(diagram, lines, x, y)


def test_pieces_meet_at_the_folds_of_the_control(repulsion: Diagram) -> None:
    load_folds = [(e.load, e.contact_radius) for e in repulsion.folds("load")]
    parts = pieces(smooth_line(repulsion, 0), "load", "contact_radius")
    assert [part.stable for part in parts] == [True, False, True]
    for left, right, fold in zip(parts[:-1], parts[1:], load_folds, strict=True):
        assert (left.x[-1], left.y[-1]) == (right.x[0], right.y[0]) == fold
    other = pieces(smooth_line(replace(repulsion, control="displacement"), 0), "displacement", "load")
    folds = [(e.displacement, e.load) for e in repulsion.folds("displacement")]
    assert [part.stable for part in other] == [True, False, True]
    assert [(part.x[-1], part.y[-1]) for part in other[:-1]] == folds


def test_two_folds_between_two_points_show_the_unstable_part(repulsion: Diagram) -> None:
    branch = repulsion.branches[0]
    far = [0, 60, 180, 240]  # both load folds, the touch and both displacement folds lie between 60 and 180
    columns = {n: values[far] for n, values in branch.columns.items()}
    events = tuple(replace(e, position=1.0 + (e.position - 60.0) / 120.0) for e in repulsion.events)
    coarse = replace(repulsion, branches=(replace(branch, **columns),), events=events)
    parts = pieces(smooth_line(coarse, 0), "load", "contact_radius")
    assert [part.stable for part in parts] == [True, False, True]
    assert parts[1].x[[0, -1]].tolist() == [e.load for e in repulsion.folds("load")]


def test_long_steps_are_filled_in_as_the_closed_form_says(attraction: Diagram) -> None:
    """Every tenth point of the Maugis-Dugdale curve and its events give back the curve to 0.5 % of its extent."""
    branch = attraction.branches[0]
    kept = np.arange(0, len(branch), 10)
    columns = {n: values[kept] for n, values in branch.columns.items()}
    events = tuple(replace(e, position=e.position / 10.0) for e in attraction.events)
    line = smooth_line(replace(attraction, branches=(Branch(**columns),), events=events), 0)
    radius = line.columns["contact_radius"]
    joined = radius > 0.0
    assert np.count_nonzero(joined) > 200
    constants = {"radius": 1000.0, "modulus": 5.0, "work_of_adhesion": 0.04, "interaction_range": 1.0}
    exact = maugis.contact(radius[joined], **constants)
    near = exact.load < 200.0
    np.testing.assert_allclose(line.columns["load"][joined][near], exact.load[near], atol=0.005 * 400.0)
    assert line.columns["load"].min() == min(event.load for event in events)  # it turns round at the fold, not beyond


def test_a_contact_that_has_just_begun_is_drawn_where_it_is() -> None:
    """Of a stiff film the first step in contact takes most of what is seen."""
    contact = cb.Contact.reduced("gauss", tabor=0.4, sign=-1)
    line = smooth_line(cb.trace(contact, accuracy=1e-4), 0)
    radius, load = line.columns["contact_radius"], line.columns["load"]
    first = int(np.argmax(radius > 0.0))
    for k in range(first + 1, first + 14, 6):
        near = [state.contact_radius for state in cb.find_all(contact, load=float(load[k])) if state.contact_radius > 0]
        assert min(abs(a - radius[k]) for a in near) < 0.1


def test_curve_is_solid_where_stable_and_dashed_where_not(repulsion: Diagram) -> None:
    axes = repulsion.plot().axes[0]
    curves = [line for line in axes.get_lines() if len(line.get_xdata()) > 2]
    assert [line.get_linestyle() for line in curves] == ["-", "--", "-"]
    assert len({line.get_color() for line in curves}) == 2


def test_events_are_marked_and_labelled(attraction: Diagram) -> None:
    axes = attraction.plot("displacement", "load").axes[0]
    marked = {tuple(line.get_xydata()[0]) for line in axes.get_lines() if line.get_marker() != "None"}
    assert marked == {(e.displacement, e.load) for e in attraction.events}
    assert sorted(a.get_text() for a in annotations(axes)) == ["jump-in", "pull-off", "pull-off", "touch"]


@pytest.mark.parametrize("name", ["attraction", "repulsion"])
@pytest.mark.parametrize("control", ["load", "displacement"])
def test_labels_overlap_neither_each_other_nor_markers_nor_the_frame(
    name: str, control: str, request: pytest.FixtureRequest
) -> None:
    figure = plot.overview(replace(request.getfixturevalue(name), control=control))
    renderer = figure.canvas.get_renderer()
    for axes in figure.axes:
        frame = axes.get_window_extent(renderer)
        for annotation in annotations(axes):
            annotation.update_positions(renderer)
        texts = [Text.get_window_extent(a, renderer) for a in annotations(axes)]  # without the lines to the points
        marked = {event.name or "touch" for event in request.getfixturevalue(name).events}
        assert {a.get_text() for a in annotations(axes)} == marked
        for one, other in combinations(texts, 2):
            assert not one.overlaps(other)
        markers = [line for line in axes.get_lines() if line.get_marker() != "None"]
        points = axes.transData.transform([line.get_xydata()[0] for line in markers])
        for text in texts:
            assert frame.x0 <= text.x0 < text.x1 <= frame.x1
            assert frame.y0 <= text.y0 < text.y1 <= frame.y1
            assert not any(text.contains(*point) for point in points)


def test_powers_of_ten_lie_beside_letters_and_below_the_legend(attraction: Diagram) -> None:
    branch, scaled = attraction.branches[0], {"load": 1e6, "contact_radius": 1e-5}
    rows = replace(branch, **{name: factor * getattr(branch, name) for name, factor in scaled.items()})
    events = tuple(replace(e, **{name: f * getattr(e, name) for name, f in scaled.items()}) for e in attraction.events)
    figure = plot.overview(replace(attraction, branches=(rows,), events=events))
    figure.draw_without_rendering()
    renderer = figure.canvas.get_renderer()
    names = [text.get_window_extent(renderer) for text in figure.legends[0].get_texts()]
    for axes in figure.axes:
        power, letter = axes.yaxis.get_offset_text(), axes._left_title
        assert power.get_text()
        one, other = (text.get_window_extent(renderer).padded(2.0) for text in (power, letter))
        assert not one.overlaps(other)
        assert not any(box.overlaps(name) for box in (one, other) for name in names)


def test_limits_frame_the_events_of_a_trace_that_starts_far_and_ends_far(attraction: Diagram) -> None:
    branch = attraction.branches[0]
    columns = dict(branch.columns)
    ends = {"load": (0.0, 1e6), "displacement": (-1e5, 1e4), "contact_radius": (0.0, 1e4), "central_gap": (1e5, 0.0)}
    for column, values in columns.items():
        first, last = ends.get(column, (values[0], values[-1]))
        columns[column] = np.concatenate([[first], values, [last]]).astype(values.dtype)
    events = tuple(replace(event, position=event.position + 1.0) for event in attraction.events)
    limits = view(replace(attraction, branches=(Branch(**columns),), events=events), "displacement", "load")
    assert limits is not None
    width = max(e.displacement for e in events) - min(e.displacement for e in events)
    assert limits.x[1] - limits.x[0] < 10.0 * width
    for event in attraction.events:
        assert limits.x[0] < event.displacement < limits.x[1]
        assert limits.y[0] < event.load < limits.y[1]
    fold = maugis.load_fold(radius=1000.0, modulus=5.0, work_of_adhesion=0.04, interaction_range=1.0)
    assert limits.y[1] > 0.5 * abs(float(fold.load))  # contact under compression is seen as well


def test_a_first_touch_alone_is_seen_with_its_surroundings(repulsion: Diagram) -> None:
    touch = tuple(event for event in repulsion.events if event.kind == "touch")
    limits = view(replace(repulsion, events=touch), "load", "displacement")
    assert limits is not None
    assert limits.x[0] <= repulsion.branches[0].load.min()
    assert limits.x[1] >= repulsion.branches[0].load.max()


def test_events_at_one_place_share_a_label(repulsion: Diagram) -> None:
    load_folds = {event.name: event for event in repulsion.folds("load")}
    same = tuple(replace(load_folds.get(e.name, e), control=e.control, position=e.position) for e in repulsion.events)
    texts = [a.get_text() for a in annotations(replace(repulsion, events=same).plot().axes[0])]
    assert sorted(texts) == ["squeeze-out", "touch", "wetting"]


def test_a_curve_without_events_is_seen_as_a_whole(repulsion: Diagram) -> None:
    plain = replace(repulsion, events=())
    assert view(plain, "load", "contact_radius") is None
    axes = plain.plot().axes[0]
    low, high = axes.get_xlim()
    assert low <= plain.branches[0].load.min()
    assert high >= plain.branches[0].load.max()


def test_a_broken_end_does_not_spoil_the_plot(broken: Diagram) -> None:
    axes = broken.plot().axes[0]
    assert np.all(np.isfinite([*axes.get_xlim(), *axes.get_ylim()]))
    assert all(np.all(np.isfinite(line.get_xydata())) for line in axes.get_lines())


def test_incomplete_curves_say_where_they_stopped(broken: Diagram, repulsion: Diagram) -> None:
    """The last point of the one that is broken is not a number; of a followed event there may be one point, or none."""
    axes = broken.plot("displacement", "load").axes[0]
    (end,) = (line for line in axes.get_lines() if line.get_marker() == "x")
    branch = broken.branches[0]
    assert end.get_xydata().tolist() == [[branch.displacement[-2], branch.load[-2]]]
    texts = [text.get_text() for text in axes.figure.legends[0].get_texts()]
    assert texts[-1] == f"stopped at load {branch.load[-2]:.3g} nN"
    curve = {name: np.array([2.0]) for name in ("tabor", "load", "displacement", "contact_radius", "central_gap")}
    known = {name: getattr(repulsion, name) for name in ("contact", "model", "cost", "accuracy")}
    one = Followed("tabor", curve, curve, (), repulsion.events[0], **known, status="incomplete", message="Stopped.")
    axes = one.plot().axes[0]
    assert [line.get_marker() for line in axes.get_lines()] == ["o", "x"]
    assert axes.get_legend().get_texts()[-1].get_text() == "stopped at tabor 2"
    none = replace(one, curve={name: values[:0] for name, values in curve.items()})
    assert none.plot().texts[0].get_text() == "Stopped."


def test_axis_labels_name_units(attraction: Diagram, repulsion: Diagram, broken: Diagram) -> None:
    axes = attraction.plot().axes[0]
    assert axes.get_xlabel() == "Load $F_N$ (nN)"
    assert axes.get_ylabel() == "Contact radius $a_c$ (nm)"
    assert repulsion.plot().axes[0].get_xlabel() == r"$F_N\,/\,(R\,|\Delta\gamma|)$"
    assert broken.plot().axes[0].get_xlabel() == "Load $F_N$ (nN)"
    assert repulsion.plot("load", "energy").axes[0].get_ylabel().startswith("$V")


def test_unknown_observable(repulsion: Diagram) -> None:
    with pytest.raises(InputError, match="y: 'force'; must be one of load, displacement"):
        repulsion.plot("load", "force")


def test_profiles_show_contact_and_interaction_zone(attraction: Diagram) -> None:
    state = attraction.branches[0].state(100)
    figure = plot.profiles(state, attraction.unit_names)
    gap, pressure = figure.axes
    assert gap.get_ylabel() == "Gap $g$ (nm)"
    assert pressure.get_ylabel() == "Pressure $p$ (nN/nm²)"
    total, wall = pressure.get_lines()[:2]
    assert total.get_ydata()[0] == pytest.approx(wall.get_ydata()[0] - 0.04)  # σ = Δγ/z0 pulls
    assert state.contact_radius < gap.get_xlim()[1] <= state.profile.r[-1]
    inner = replace(state.profile, **{name: getattr(state.profile, name)[3:] for name in state.profile.items()})
    cut = plot.profiles(replace(state, profile=inner), attraction.unit_names).axes[0]
    assert cut.get_xlim()[0] == 0.0 == cut.get_lines()[0].get_xdata()[0]  # the first node of a mesh is beside the axis
    with pytest.raises(InputError, match="no profile"):
        plot.profiles(replace(state, profile=None))


def test_coexisting_states_are_drawn_together(attraction: Diagram) -> None:
    """Of `find_all`, and of what `solve` has saved: told apart by their loads, where the displacement is given."""
    branch, names = attraction.branches[0], attraction.unit_names
    states = [branch.state(number) for number in (10, 60)]
    axes = plot.coexisting(states, "displacement", names).axes
    lines = [line for line in axes[0].get_lines() if len(line.get_xdata()) > 2]
    for state, line in zip(states, lines, strict=True):
        stable = state.stable("displacement")
        assert line.get_linestyle() == ("-" if stable else "--")
        assert line.get_label().startswith(f"{'stable' if stable else 'unstable'}, $F_N = {state.load:.4g}$ nN")
    points = [replace(branch, **{name: values[k : k + 1] for name, values in branch.columns.items()}) for k in (10, 60)]
    points = [replace(point, profiles=[state.profile]) for point, state in zip(points, states, strict=True)]
    saved = plot.draw(replace(attraction, branches=tuple(points), events=()))
    assert len(saved.legends[0].get_texts()) == 2
    assert "with a profile" in plot.coexisting([replace(states[0], profile=None)], "load", names).texts[0].get_text()


FILES = [(".pdf", b"%PDF"), (".svg", b"<?xml"), (".PNG", b"\x89PNG")]


@pytest.mark.parametrize(("suffix", "magic"), FILES)
def test_figures_are_written_by_suffix(repulsion: Diagram, suffix: str, magic: bytes) -> None:
    content = plot.figure_content(repulsion.plot(), suffix)
    assert content.startswith(magic)
    assert plot.figure_content(repulsion.plot(), suffix) == content  # the same diagram gives the same file


def test_no_pyplot() -> None:
    code = "import sys, contbranch.output.plot; sys.exit('matplotlib.pyplot' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0


def test_a_diagram_without_points_says_so_in_a_figure() -> None:
    """A computation may be stopped before it has any."""
    import contbranch as cb

    diagram = cb.trace(cb.Contact.reduced(cb.Gauss, tabor=1.0), time_limit=1e-9)
    assert len(diagram.branches[0]) == 0
    for figure in (plot.overview(diagram), plot.bifurcation_diagram(diagram)):
        assert "The time limit of 1e-09 s was reached" in " ".join(figure.texts[0].get_text().split())


def test_states_of_tips_that_are_not_round_are_drawn_as_maps() -> None:
    """Gap, pressure and contact on the nodes, as far as there is pressure; a round tip has a profile."""
    law = cb.Exponential(1.0, 1.0)
    ellipse = cb.solve(
        cb.Contact(cb.EllipticParaboloid(2.0, 0.5), law), load=1.0, model=cb.FreeSpace(cell=16.0, grid=64)
    )
    maps = [axes for axes in plot.draw(ellipse).axes if axes.get_xlabel() == "$x$"]
    gap, pressure, contact = (np.asarray(axes.collections[0].get_array()) for axes in maps)
    assert gap.shape == pressure.shape == contact.shape
    inside = contact.ravel() > 0
    assert np.count_nonzero(inside) == np.count_nonzero(ellipse.cell.wall_pressure)
    assert np.ptp(gap.ravel()[inside]) == 0.0
    assert pressure.max() == ellipse.cell.pressure.max()
    assert gap.size < ellipse.cell.gap.size
    across, along = (np.count_nonzero(contact.reshape(gap.shape).any(axis=axis)) for axis in (1, 0))
    assert along > across
    (round_tip,) = {len(plot.draw(cb.solve(cb.Contact(cb.Parabola(1.0), law), load=1.0)).axes)}
    assert round_tip == 2
    with pytest.raises(InputError, match="state: it has no fields on a cell"):
        plot_maps.cell_maps(cb.solve(cb.Contact(cb.Parabola(1.0), law), load=1.0))
