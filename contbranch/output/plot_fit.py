"""Figure of a fitted force curve: measured and fitted forces over the piezo position, and residuals."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib import rcParams
from matplotlib.figure import Figure

from contbranch.contact.units import printed
from contbranch.output.plot_view import BLUE, GREY, ORANGE, cell_edges, handle, heat_map, new_figure, said
from contbranch.results.fit import Fit
from contbranch.results.fit_map import FitMap
from contbranch.results.table import with_unit

_LEFT_OUT = "#BBBBBB"


def fit_figure(fit: Fit) -> Figure:
    """Draw force and residuals over the piezo position; samples are dots, the fit is a line, jumps are crosses."""
    used, dots = np.isfinite(fit.residuals), {"marker": ".", "linestyle": "none", "markeredgewidth": 0}
    spans = ((fit.piezo, "nm"), (fit.force, "nN"), (fit.residuals[used], "nN"))
    units = [printed(float(np.ptp(values)) if values.size else 0.0, unit) for values, unit in spans]
    (length, across), (force, up), (rest, by) = units
    with new_figure(4.2) as figure:
        above, below = figure.subplots(2, 1, sharex=True, height_ratios=(3, 1))
        above.plot(across * fit.piezo[~used], up * fit.force[~used], color=_LEFT_OUT, markersize=3.0, **dots)
        for back, colour in ((False, BLUE), (True, ORANGE)):
            own = np.flatnonzero(fit.retract == back)
            order = own[np.argsort(fit.piezo[own], kind="stable")]
            place, kept = across * fit.piezo[order], np.where(used, up * fit.force, np.nan)[order]
            above.plot(place, kept, color=colour, markersize=3.0, **dots)
            above.plot(place, up * fit.fitted[order], color="black", linewidth=0.7)
            below.plot(place, by * fit.residuals[order], color=colour, markersize=1.6, **dots)
        for jump in fit.jumps:
            back = jump.name in ("pull-off", "wetting")
            values = fit.legs["retract"].values if back and fit.legs else fit.values
            line = {name: values.get(name, 0.0) for name in ("baseline", "tilt")}
            line |= {name: values.get(f"{name}_retract", value) for name, value in line.items() if back}
            for seen, mark in ((jump.measured, "x"), (jump.fitted, "+")):
                if seen is not None:
                    at = across * seen["piezo"], up * (seen["force"] + line["baseline"] + line["tilt"] * seen["piezo"])
                    above.plot(*at, mark, color="black", markersize=5.0, markeredgewidth=0.8)
        below.axhline(0.0, color=GREY, linewidth=0.6)
        above.margins(0.04, 0.07)
        below.margins(0.04, 0.1)
        above.set_ylabel(f"Force ({force})")
        below.set_ylabel(f"Residual ({rest})")
        below.set_xlabel(f"Piezo position ({length})")
        figure.align_ylabels()
        shown = {"approach": BLUE, "retraction": ORANGE, **({} if used.all() else {"left out": _LEFT_OUT})}
        handles = [handle(label, color=colour, markersize=7.0, **dots) for label, colour in shown.items()]
        handles += [handle("fit", color="black", linewidth=0.7)]
        if fit.jumps:
            handles += [handle("jump measured", color="black", marker="x", linestyle="none")]
            handles += [handle("jump fitted", color="black", marker="+", linestyle="none")]
        look = {"ncols": 3, "columnspacing": 1.0, "handlelength": 1.4, "title_fontsize": rcParams["legend.fontsize"]}
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
            usual = float(np.nanmedian(np.abs(values))) if np.isfinite(values).any() else 0.0
            unit, factor = printed(usual, fits.unit_names.get(name, ""), name)
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
