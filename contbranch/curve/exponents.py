"""Critical exponents: crossover of a normal form, and the power law fitted over a window."""

from __future__ import annotations

import numpy as np

from contbranch.results.diagram import LocalExponent, Window

__all__ = ["crossover_excess", "fitted_window"]


def crossover_excess(second: float, third: float) -> float | None:
    """Excess Δ× at which the correction to the square root has become as large as the square root itself.

    With control = c0 + c2 q²/2 + c3 q³/6 the order parameter is q = √(2Δ/c2) − c3 Δ/(3 c2²) + …; both terms are equal
    at Δ× = 18 |c2|³/c3².

    Parameters
    ----------
    second, third : float
        c2 and c3.
    """
    if third == 0.0:
        return None
    return float(18 * abs(second) ** 3 / third**2)


def fitted_window(local: LocalExponent, start: float, stop: float) -> Window | None:
    """Least-squares power law ``Δq = prefactor Δ^kappa`` over a window of the excess, in logarithms.

    A power law holds nowhere exactly: the uncertainty is half the range of the local exponent over the window, plus the
    standard error of the fit.
    """
    inside = (local.excess >= start) & (local.excess <= stop)
    if np.count_nonzero(inside) < 4:
        return None
    x, y = np.log(local.excess[inside]), np.log(local.order_parameter[inside])
    # Samples crowd where the curve was cheap; every decade is to count the same.
    weights = np.gradient(x)
    mean = np.average(x, weights=weights)
    spread = np.average((x - mean) ** 2, weights=weights)
    kappa = float(np.average((x - mean) * y, weights=weights) / spread)
    intercept = float(np.average(y, weights=weights) - kappa * mean)
    misfit = np.average((y - intercept - kappa * x) ** 2, weights=weights)
    error = float(np.ptp(local.kappa[inside]) / 2 + np.sqrt(misfit / spread / len(x)))
    return Window(
        float(local.excess[inside][0]), float(local.excess[inside][-1]), kappa, error, float(np.exp(intercept))
    )
