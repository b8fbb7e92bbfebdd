"""Publication plots: bifurcation diagrams, profiles of gap and pressure.

Figures are one column wide and drawn without pyplot, so that they need no display and keep no global state. Colours are
those of Okabe and Ito, which stay apart for colour-blind readers; line style and marker shape repeat what colour says.
"""

from __future__ import annotations

import io
from collections.abc import Sequence
from itertools import cycle
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from contbranch.arrays import Array
from contbranch.errors import InputError
from contbranch.output.plot_curve import Line, Piece, coordinate, pieces, smooth_line
from contbranch.output.plot_labels import place_labels
from contbranch.output.plot_maps import cell_maps
from contbranch.output.plot_view import (
    DASHES,
    END,
    GREY,
    SERIES,
    Style,
    axis_label,
    check_observables,
    figure_of,
    handle,
    loud_radius,
    mark_rim,
    new_figure,
    said,
    stacked,
    styled,
    unfinished,
    view,
)
from contbranch.output.smooth import smooth_path
from contbranch.results.diagram import Diagram, Event, Solution, State
from contbranch.results.profile import FAINT
from contbranch.results.record import UnitNames

_STABLE, _UNSTABLE, _TOUCH, _SYMMETRY = SERIES[:4]
_MOST = 8  # labels of a panel
_CLOSE = 6.0  # pixels between points that are not told apart


def draw(result: Any) -> Figure:
    """Draw a result as the command line does: a diagram as its `overview`, states as their `profiles` or maps."""
    if isinstance(result, Diagram):
        points = [branch.state(0) for branch in result.branches if len(branch) == 1]
        alone = 0 < len(points) == len(result.branches)  # saved by solve
        return coexisting(points, result.control, result.units) if alone else overview(result)
    if isinstance(result, Solution) and result.profile is None and result.in_cell is None:
        return said("no state was found")
    if isinstance(result, Solution):
        flat = result.in_cell is not None and not (result.contact is not None and result.contact.tip.is_axisymmetric)
        return cell_maps(result, result.units) if flat else profiles(result, result.units)
    if not hasattr(result, "plot"):
        raise InputError(f"plot: {type(result).__name__} is a table, and has no figure: print it")
    figure: Figure = result.plot()
    return figure


def bifurcation_diagram(
    diagram: Diagram,
    x: str = "load",
    y: str = "contact_radius",
    *,
    ax: Axes | None = None,
    labels: bool = True,
    **line: Any,
) -> Figure:
    """Draw `y` against `x`: solid where stable under the diagram's control, dashed where not, folds and touch marked.

    Parameters
    ----------
    diagram : Diagram
    x, y : str
        Two of ``load``, ``displacement``, ``contact_radius``, ``contact_area``, ``central_gap`` and ``energy``; for a
        diagram of a spring also ``piezo`` (its far end, d + F/K) and ``deflection`` (F/K).
    ax : matplotlib.axes.Axes, optional
        Where to draw, beside what is there already, in the style of those axes; default: a figure of its own.
    labels : bool
        Whether names are written beside the marks.
    **line
        What `matplotlib.axes.Axes.plot` takes, for the stable parts: ``color`` is that of the unstable ones, too.

    Raises
    ------
    InputError
        For another observable.
    """
    check_observables(x, y, diagram.stiffness)
    if ax is not None:
        _draw_curve(ax, diagram, _lines(diagram), (x, y), {"color": f"C{_curves(ax)}", **line})
        found: Figure = figure_of(ax)
        if labels:
            found.draw_without_rendering()  # what is placed last must know where everything else is
            _place_labels(ax, diagram, x, y)
        return found
    return _figure(diagram, [(x, y)], labels, line)


def _curves(axes: Axes) -> int:
    """The number of curves that axes have."""
    return len({line.get_gid() for line in axes.get_lines()} - {None})


def overview(diagram: Diagram) -> Figure:
    """Draw contact radius against load above load against displacement, as `bifurcation_diagram` draws one of them."""
    return _figure(diagram, [("load", "contact_radius"), ("displacement", "load")], True, {})


def _figure(diagram: Diagram, panels: Sequence[tuple[str, str]], labels: bool, line: Style) -> Figure:
    """Draw panels one above the other; where a branch has no line, of two points at least, say why there is none."""
    if not diagram.branches or any(len(branch) < 2 for branch in diagram.branches):
        return said(f"No curve could be traced. {diagram.message}")
    with styled():
        lines, handles = _lines(diagram), _legend(diagram)
        figure = stacked(len(panels), lambda axes, k: _draw_curve(axes, diagram, lines, panels[k], line), handles, 2)
        for axes, (x, y) in zip(figure.axes, panels if labels else [], strict=False):
            _place_labels(axes, diagram, x, y)
    return figure


def profiles(state: State, unit_names: UnitNames | None = None) -> Figure:
    """Draw gap and pressure of a state against the radius; `unit_names` as in ``contact.units.names``.

    Raises
    ------
    InputError
        If the state has no profile.
    """
    if state.profile is None:
        raise InputError("state: it has no profile; take a state of a traced diagram or of solve")
    return _profiles([state], [{"color": _STABLE, "label": "total"}], unit_names or {})


def coexisting(states: Sequence[State], control: str, unit_names: UnitNames) -> Figure:
    """Draw gap and pressure of states at one value of a control against the radius: dashed where they are not stable.

    They are told apart by what is not controlled: the load under displacement control, otherwise the displacement.
    """
    shown = [state for state in states if state.profile is not None]
    if not shown:
        return said("there is no state with a profile")
    name, symbol = ("load", "F_N") if control == "displacement" else ("displacement", "d")
    looks: list[Style] = []
    for state, colour in zip(shown, cycle(SERIES)):
        kind, style = ("stable", "-") if state.stable(control) else ("unstable", DASHES)
        value = f"{kind}, ${symbol} = {getattr(state, name):.4g}$ {unit_names.get(name, '')}"
        looks.append({"color": colour, "linestyle": style, "label": value})
    return _profiles(shown, looks, unit_names)


def _profiles(states: Sequence[State], looks: Sequence[Style], names: UnitNames) -> Figure:
    """Draw gap and pressure of states that have a profile, of a single one also the wall's share and the rim."""
    fields: list[Any] = [state.profile for state in states]
    radii = [1.5 * state.contact_radius for state in states]
    reach = max(*radii, *(1.25 * loud_radius(one.r, one.pressure, FAINT) for one in fields))
    with new_figure(3.8) as figure:
        above, below = figure.subplots(2, 1, sharex=True)

        def draw(axes: Axes, one: Any, name: str, look: Style) -> None:
            shown = (one.r <= reach) & np.isfinite(one.gap)
            values = getattr(one, name)[shown]  # at the axis they are as at the first node
            axes.plot(*smooth_path(np.append(0.0, one.r[shown]), np.append(values[:1], values)), **look)

        for one, look in zip(fields, looks, strict=True):
            draw(above, one, "gap", look)
            draw(below, one, "pressure", look)
        if len(states) > 1:
            figure.legend(handles=above.get_lines(), loc="outside upper center", ncols=2)
        elif radii[0] > 0.0:
            draw(below, fields[0], "wall_pressure", {"color": _UNSTABLE, "linestyle": "--", "label": "wall"})
            below.legend()
            mark_rim((above, below), states[0].contact_radius, True, -1)
        below.axhline(0.0, color=GREY, linewidth=0.5, zorder=0)
        above.margins(x=0.0)
        above.set_ylim(bottom=-0.04 * max(above.dataLim.ymax, 1e-300))
        above.set_ylabel(axis_label("gap", names))
        below.set_ylabel(axis_label("pressure", names))
        below.set_xlabel(axis_label("r", names))
        figure.align_ylabels()
    return figure


def figure_content(figure: Figure, suffix: str, **options: Any) -> bytes:
    """A figure as PNG, PDF or SVG, by the suffix; the same figure gives the same bytes."""
    drawn = io.BytesIO()
    kind = suffix.lower()[1:]
    dates = {"pdf": {"CreationDate": None}, "svg": {"Date": None}}.get(kind)
    figure.savefig(drawn, metadata=dates, format=kind, **options)
    return drawn.getvalue()


# One curve


def _draw_curve(axes: Axes, diagram: Diagram, lines: Sequence[Line], shown: tuple[str, str], style: Style) -> None:
    """Draw the branches with their stability, mark the events and set limits and axis labels."""
    x, y = shown
    axes.set_xlabel(axis_label(x, diagram.unit_names, diagram.contact))
    axes.set_ylabel(axis_label(y, diagram.unit_names, diagram.contact))
    known = (axes.get_xlim(), axes.get_ylim()) if axes.get_lines() else None
    style = {"gid": f"curve {_curves(axes)}", **style}
    for line in lines:
        for piece in pieces(line, x, y):
            _draw_piece(axes, piece, style)
            if piece.stable:  # one name in a legend is enough
                style = {**style, "label": None}
    for event in _marked(diagram):
        _draw_marker(axes, diagram, event, x, y)
    if diagram.status != "complete":
        axes.plot(lines[0].columns[x][-1:], lines[0].columns[y][-1:], **END, zorder=4)
    limits = view(diagram, lines, x, y)
    if limits is not None:
        wide = [(min(a, b[0]), max(c, b[1])) for (a, c), b in zip(limits, known or limits, strict=True)]
        axes.set_xlim(*wide[0])
        axes.set_ylim(*wide[1])
    for name, draw in ((x, axes.axvline), (y, axes.axhline)):
        if name in ("load", "displacement", "deflection") and known is None:
            draw(0.0, color=GREY, linewidth=0.4, alpha=0.6, zorder=0)


def _lines(diagram: Diagram) -> list[Line]:
    return [smooth_line(diagram, number) for number in range(len(diagram.branches))]


def _draw_piece(axes: Axes, piece: Piece, style: Style) -> None:
    if piece.stable:
        known = {"color": _STABLE, "solid_capstyle": "round", "solid_joinstyle": "round", "zorder": 3}
    else:
        known = {"color": _UNSTABLE, "linestyle": DASHES, "dash_joinstyle": "round", "zorder": 2}
        style = {key: value for key, value in style.items() if key in ("color", "gid", "linewidth", "alpha")}
    axes.plot(piece.x, piece.y, **{**known, **style})


def _marked(diagram: Diagram) -> list[Event]:
    """Return the events that get a marker: named folds, touches, and where symmetry is lost."""
    return [e for e in diagram.events if (e.kind == "fold" and e.name) or e.kind in ("touch", "symmetry")]


def _marker(diagram: Diagram, event: Event) -> Style:
    """Return the style of an event's marker: full for folds under the diagram's control, empty for the other's."""
    if event.kind == "touch":
        return {"marker": "D", "markersize": 4.0, "markerfacecolor": _TOUCH, "markeredgecolor": "white"}
    if event.kind == "symmetry":
        return {"marker": "p", "markersize": 5.2, "markerfacecolor": _SYMMETRY, "markeredgecolor": "white"}
    own = event.control == diagram.control
    marker = {"load": "o", "displacement": "s"}.get(event.control or "", "^")
    return {
        "marker": marker,
        "markersize": 4.8 if own else 4.2,
        "markerfacecolor": "black" if own else "white",
        "markeredgecolor": "white" if own else "black",
    }


def _draw_marker(axes: Axes, diagram: Diagram, event: Event, x: str, y: str) -> None:
    level = 5.0 if event.kind == "touch" else 6.0 if event.control == diagram.control else 4.0
    place = coordinate(diagram, event, x), coordinate(diagram, event, y)
    axes.plot(*place, linestyle="none", markeredgewidth=0.7, zorder=level, **_marker(diagram, event))


def _place_labels(axes: Axes, diagram: Diagram, x: str, y: str) -> None:
    """Write names beside the marks of axes whose layout is final."""
    shown = _labelled(axes, diagram, x, y)
    points = np.array([point for _, _, point in shown]).reshape(-1, 2)
    own = [event.kind != "fold" or event.control == diagram.control for event, _, _ in shown]
    place_labels(axes, points, [text for _, text, _ in shown], ["black" if one else GREY for one in own])


def _labelled(axes: Axes, diagram: Diagram, x: str, y: str) -> list[tuple[Event, str, Array]]:
    """Return the events that get a label, with it and their place: those of the control first, one of each at a place.

    Of the folds of a cascade, and of the modes that lose their symmetry, the first and the last are named.
    """
    marked = _marked(diagram)
    numbers: dict[str, set[int]] = {}
    for event in marked:
        kind, number = _numbered(event)
        numbers.setdefault(kind, set()).add(number)
    kept: list[tuple[Event, str, Array]] = []
    for event in sorted(marked, key=lambda event: event.control != diagram.control):
        kind, number = _numbered(event)
        text, point = _label(event), np.array([coordinate(diagram, event, name) for name in (x, y)])
        pixels = axes.transData.transform(np.array([point, *(place for _, _, place in kept)]))
        beside = np.hypot(*(pixels[1:] - pixels[0]).T) <= _CLOSE
        shared = any(near and one[1] == text for near, one in zip(beside, kept, strict=True))
        if not shared and len(kept) < _MOST and number in (min(numbers[kind]), max(numbers[kind])):
            kept.append((event, text, point))
    return kept


def _label(event: Event) -> str:
    return f"$m = {event.mode}$" if event.kind == "symmetry" else event.name or "touch"


def _numbered(event: Event) -> tuple[str, int]:
    """Of what an event is one of several, and its number among them."""
    kind, _, number = (event.name or "").rpartition("-")
    return (kind, int(number)) if number.isdigit() else (event.kind + kind, event.mode or 0)


def _legend(diagram: Diagram) -> list[Line2D]:
    """Return a handle for each line style and marker that occurs."""
    unstable = np.concatenate([branch.unstable(diagram.control) for branch in diagram.branches])
    handles = {}
    if np.any(unstable == 0):
        handles["stable"] = handle(f"stable ({diagram.control} control)", color=_STABLE)
    if np.any(unstable > 0):
        handles["unstable"] = handle("unstable", color=_UNSTABLE, linestyle=DASHES)
    words = {"touch": "first touch", "symmetry": "loss of symmetry"}
    for event in sorted(_marked(diagram), key=lambda e: (e.kind == "fold", e.kind, e.control != diagram.control)):
        label = words.get(event.kind, f"fold, {event.control} control")
        if label not in handles:
            handles[label] = handle(label, linestyle="none", markeredgewidth=0.7, **_marker(diagram, event))
    load = diagram.branches[0].load  # those after the first begin and end at it
    return [*handles.values(), *unfinished(diagram, "load", load[np.isfinite(load)][-1])]
