"""Figure of a fitted force curve: measured and fitted forces over the piezo position, and residuals."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib import rcParams
from matplotlib.figure import Figure

from contbranch.output.plot_view import BLUE, GREY, ORANGE, cell_edges, handle, heat_map, new_figure, said
from contbranch.results.fit import Fit
from contbranch.results.fit_map import FitMap
from contbranch.results.table import with_unit

# Units as one says them.
PEOPLE = {"nN/nm²": ("MPa", 1e3), "nN/nm": ("mN/m", 1e3)}


def fit_figure(fit: Fit) -> Figure:
    """Draw force and residuals over the piezo position; samples are dots, the fit is a line, jumps are crosses."""
    with new_figure(4.2) as figure:
        above, below = figure.subplots(2, 1, sharex=True, height_ratios=(3, 1))
        for back, colour in ((False, BLUE), (True, ORANGE)):
            own = np.flatnonzero(fit.retract == back)
            order = own[np.argsort(fit.piezo[own], kind="stable")]
            place, kept = fit.piezo[order], np.isfinite(fit.fitted[order])
            above.plot(place, fit.force[order], ".", color=colour, markersize=3.0, markeredgewidth=0)
            above.plot(place[kept], fit.fitted[order][kept], color="black", linewidth=0.5)
            below.plot(place, fit.residuals[order], ".", color=colour, markersize=1.6, markeredgewidth=0)
        line = {name: fit.values.get(name, 0.0) for name in ("baseline", "tilt")}
        for jump in fit.jumps:
            for seen, mark in ((jump.measured, "x"), (jump.fitted, "+")):
                if seen is not None:
                    force = seen["force"] + line["baseline"] + line["tilt"] * seen["piezo"]
                    above.plot(seen["piezo"], force, mark, color="black", markersize=5.0, markeredgewidth=0.8)
        below.axhline(0.0, color=GREY, linewidth=0.6)
        above.margins(0.04, 0.07)
        below.margins(0.04, 0.1)
        above.set_ylabel("Force (nN)")
        below.set_ylabel("Residual (nN)")
        below.set_xlabel("Piezo position (nm)")
        handles = [handle("approach", color=BLUE), handle("retraction", color=ORANGE)]
        if fit.jumps:
            handles += [handle("jump measured", color="black", marker="x", linestyle="none")]
            handles += [handle("fitted", color="black", marker="+", linestyle="none")]
        look = {"ncols": 4, "columnspacing": 1.0, "handlelength": 1.4, "title_fontsize": rcParams["legend.fontsize"]}
        title = "" if fit.status == "complete" else "did not converge"
        figure.legend(handles=handles, loc="outside upper center", title=title, **look)
    return figure


def map_figure(fits: FitMap, names: Sequence[str]) -> Figure:
    """Draw values over the places of a map, side by side; a cross where there is none."""
    if not names:
        return said(fits.message or "No curve determines a value.")
    with new_figure(2.6, len(names)) as figure:
        for axes, name in zip(figure.subplots(1, len(names), squeeze=False)[0], names, strict=True):
            x, y, values = fits.picture(name)
            widths = [float(np.diff(places).min()) for places in (x, y) if places.size > 1] or [1.0]
            unit = fits.unit_names.get(name, "")
            unit, factor = PEOPLE.get(unit, (unit, 1.0))
            axes.set_aspect("equal")
            title = with_unit(name.replace("_", " "), unit)
            across, up = (cell_edges(places, min(widths)) for places in (x, y))
            heat_map(axes, across, up, factor * values, title, cmap="viridis")
            rows, columns = np.nonzero(~np.isfinite(values))
            axes.plot(x[columns], y[rows], "x", color=GREY, markersize=3.0, markeredgewidth=0.6)
            names_of = ("x", "y") if "x" in fits.parameters else ("column", "row")
            labels = [with_unit(one, fits.unit_names.get(one, "")) for one in names_of]
            axes.set(xlabel=labels[0], ylabel=labels[1])
    return figure
