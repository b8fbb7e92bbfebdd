"""Contacts of the literature: Lennard-Jones, a wavy sphere, a thin layer, DLVO, and pull-off at a rate.

python studies/field_contacts.py    # writes docs/figures/field_contacts.png; half a minute
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np
from matplotlib import rc_context
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from numpy.typing import NDArray

import contbranch as cb
from contbranch.output.plot_curve import smooth_line
from contbranch.output.plot_view import BLUE, GREY, ORANGE, STYLE
from contbranch.theory import jkr, layer

FIGURE = Path(__file__).resolve().parents[1] / "docs" / "figures" / "field_contacts.png"
Array = NDArray[np.float64]

TABORS = np.geomspace(0.01, 8.0, 13)
# Guduru's wavy sphere, in reduced units, and the Tabor coefficient of its attraction.
WAVY, STEEP = cb.WavySphere(radius=1.0, amplitude=0.02, wavelength=0.5), 10.0
SALTS = (1e-4, 1e-3, 1e-2)
RATES = np.geomspace(1.0, 1e6, 7)


def pull_off(core: str) -> Array:
    """Pull-off loads of a Lennard-Jones contact over 2πRΔγ."""
    traced = (cb.trace(cb.Contact.reduced("lennard-jones", tabor, core=core)) for tabor in TABORS.tolist())
    return np.array([-diagram.thresholds["pull_off_load"] / (2 * np.pi) for diagram in traced])


def wavy() -> cb.Diagram:
    """The curve of a wavy sphere."""
    return cb.trace(cb.Contact(WAVY, cb.Exponential(1.0, 1 / STEEP)), max_load=8.0)


def thin_layer(radii: Array) -> tuple[Array, Array]:
    """Load on a bonded incompressible layer of thickness 1 over Hertz' at the same depth, and by a known series."""
    load, depth = layer.curve(cb.Parabola(1.0), radii, cb.ElasticLayer(1.0, 0.5))
    x = np.sqrt(depth)
    series = 1 + 1.133 * x + 1.283 * x**2 + 0.769 * x**3 + 0.0975 * x**4  # Dimitriadis et al. 2002
    return load / (4 / 3 * depth**1.5), series


def dlvo(concentration: float) -> cb.Diagram:
    """A silica sphere and a silica plane in salt water."""
    law = cb.hamaker("0.85e-20 J", "0.3 nm") + cb.DoubleLayer(
        surface_potentials=(-30.0, -30.0), concentration=concentration, cutoff=0.3
    )
    return cb.trace(cb.Contact.physical(modulus="38 GPa", radius="3.5 um", interaction=law))


def probe() -> cb.Diagram:
    """A probe of 20 nm on a hard sample."""
    return cb.trace(
        cb.Contact.physical(
            modulus="10 GPa", radius="20 nm", interaction="exponential", work_of_adhesion="20 mN/m", range="0.3 nm"
        )
    )


def main() -> None:
    """Draw and save."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--output", default=str(FIGURE), help="where to draw (default: %(default)s)")
    with rc_context(STYLE):
        figure = Figure(figsize=(10.2, 9.6), layout="constrained")
        FigureCanvasAgg(figure)
        panels = figure.subplots(3, 2).ravel()
        for letter, axes, draw in zip(
            "abcdef", panels, (_lennard_jones, _wavy, _layer, _law, _force, _rate), strict=True
        ):
            draw(axes)
            axes.set_title(f"({letter})", loc="left")
        figure.savefig(parser.parse_args().output, dpi=150)


def _lennard_jones(axes: Axes) -> None:
    for core, colour in (("soft", BLUE), ("wall", ORANGE)):
        axes.semilogx(TABORS, pull_off(core), "o-", color=colour, label=f'core="{core}"')
    for limit, name in ((1.0, "Bradley"), (0.75, "JKR")):
        axes.axhline(limit, color=GREY, linestyle=":")
        axes.annotate(name, (0.012, limit), xytext=(0, -4 if limit == 1.0 else 4), textcoords="offset points",
                      va="top" if limit == 1.0 else "bottom")  # fmt: skip
    axes.set(xlabel=r"Tabor coefficient $\mu_T$", ylabel=r"Pull-off load $-F/2\pi R\Delta\gamma$", ylim=(0.72, 1.03))
    axes.legend()


def _wavy(axes: Axes) -> None:
    diagram, radii = wavy(), np.linspace(0.02, 3.0, 1500)
    load, displacement = jkr.curve(WAVY, radii)
    seen = smooth_line(diagram, 0).columns
    axes.plot(seen["displacement"], seen["load"], color=BLUE, label=rf"$\mu_T = {STEEP:g}$")
    axes.plot(displacement, load, "--", color=ORANGE, label="JKR")
    folds = [event for event in diagram.folds("displacement") if event.name]
    axes.plot([fold.displacement for fold in folds], [fold.load for fold in folds], "ks", markerfacecolor="white",
              label="folds, displacement control")  # fmt: skip
    axes.set(xlabel=r"Displacement $d$", ylabel=r"Load $F_N$", xlim=(-1.9, 1.0), ylim=(-5.6, 1.4))
    axes.legend()


def _layer(axes: Axes) -> None:
    radii = np.geomspace(0.02, 2.0, 60)
    exact, series = thin_layer(radii)
    axes.loglog(radii, exact, color=BLUE, label="integral equation")
    axes.loglog(radii, series, "--", color=ORANGE, label="series, Dimitriadis et al.")
    axes.set(xlabel=r"Contact radius $a/H$", ylabel=r"Load over Hertz' at equal depth")
    axes.legend()


def _law(axes: Axes) -> None:
    gap = np.linspace(0.0, 12.0, 600)
    for concentration, colour in zip(SALTS, (BLUE, GREY, ORANGE), strict=True):
        law = dlvo(concentration).contact.interaction  # type: ignore[union-attr]
        axes.plot(gap, 1e3 * law.evaluate(gap).energy, color=colour, label=f"{1e3 * concentration:g} mM")
    axes.set(xlabel="Gap (nm)", ylabel="Energy per area (mJ/m²)", ylim=(-0.1, 0.12))
    axes.legend()


def _force(axes: Axes) -> None:
    for concentration, colour in zip(SALTS, (BLUE, GREY, ORANGE), strict=True):
        seen = smooth_line(dlvo(concentration), 0).columns
        axes.plot(seen["displacement"], seen["load"], color=colour, label=f"{1e3 * concentration:g} mM")
    axes.set(xlabel="Displacement (nm)", ylabel="Load (nN)", xlim=(-12.0, 0.6), ylim=(-5.0, 5.0))
    axes.legend()


def _rate(axes: Axes) -> None:
    diagram = probe()
    for temperature, colour in ((77, BLUE), (298, ORANGE)):
        jumps = [cb.activated(diagram, temperature, rate, "1 MHz")[0] for rate in RATES.tolist()]
        mean, std = (np.array([getattr(jump, name) for jump in jumps]) for name in ("mean", "std"))
        axes.semilogx(RATES, -mean, "o-", color=colour, label=f"{temperature} K")
        axes.fill_between(RATES, -mean - std, -mean + std, color=colour, alpha=0.2, linewidth=0)
    axes.axhline(-diagram.thresholds["pull_off_load"], color=GREY, linestyle=":")
    axes.annotate("fold", (RATES[0], -diagram.thresholds["pull_off_load"]), xytext=(0, -4), textcoords="offset points",
                  va="top")  # fmt: skip
    axes.set(xlabel="Rate of the load (nN/s)", ylabel="Pull-off load (nN)")
    axes.legend()


if __name__ == "__main__":
    main()
