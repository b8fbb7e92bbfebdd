"""What becomes of the accuracy asked for: errors of rows, of paths and of integrals, relative to max(1, |value|)."""

from __future__ import annotations

__all__ = [
    "DEFECT_SAFETY",
    "FINEST_ROWS",
    "LANDING_MARGIN",
    "ORDINARY_ROWS",
    "QUADRATURE_SHARE",
    "RETRY_FACTOR",
    "of_rows",
]

# A curve that is lost, or whose events are in doubt, is followed once more at the accuracy asked times this. With it
# the contacts of tests/test_random_contacts.py that fail at 1e-4 are complete.
RETRY_FACTOR = 0.01
# Largest error estimate of rows, times two, of exponential and Gauss laws at μ_T = 1/12, 1, 4 and 13 traced to 1e-6 or
# better: closer to a fold such rows do not tell on which side of it a value lies.
ORDINARY_ROWS = 3e-6
# Rows that count themselves, as in integrals along the curve, are as accurate as events, but no more than this: Newton
# steps along a curve end at a relative residual of 1e-9 (`problem.STEPS`).
FINEST_ROWS = 1e-9
# Error estimates are differences to a finer discretisation, which has an error of its own, times this.
DEFECT_SAFETY = 3.0
# A path needs the curve beyond the value of the fold that it jumps from by this, as far as rows at the coarsest
# accuracies may be off; tests/test_hysteresis.py has loops whose curves are continued.
LANDING_MARGIN = 1e-3
# Quadrature error allowed to a piece of path, as a share of the accuracy: areas of loops then equal the energies that
# the jumps dissipate to the accuracy (tests/test_hysteresis.py).
QUADRATURE_SHARE = 0.1


def of_rows(accuracy: float) -> float:
    """Error estimate allowed to rows that are to be as accurate as events."""
    return max(FINEST_ROWS, accuracy) / DEFECT_SAFETY
