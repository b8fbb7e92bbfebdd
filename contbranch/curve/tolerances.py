"""What becomes of the accuracy asked for: errors of rows, of paths and of integrals, relative to max(1, |value|)."""

from __future__ import annotations

__all__ = [
    "FINEST_ROWS",
    "LANDING_MARGIN",
    "ORDINARY_ROWS",
    "QUADRATURE_SHARE",
    "RETRY_FACTOR",
    "ROW_SAFETY",
    "of_rows",
]

# A curve that is lost, or whose events are in doubt, is followed once more at the accuracy asked times this. Fixed by
# studies/random_contacts.py: of the contacts that fail at 1e-4 nearly all are complete at 1e-6.
RETRY_FACTOR = 0.01
# Errors that rows have whatever is asked, at μ_T from 1/12 to 13: closer to a fold they do not tell on which side a
# value lies, and rows are made finer.
ORDINARY_ROWS = 3e-6
# Rows that count themselves, as in integrals, are made as accurate as events, but no more accurate than this: below it
# rounding in the residuals of stiff laws (μ_T = 100) adds more panels than accuracy.
FINEST_ROWS = 1e-9
# True errors of rows were found below this multiple of their estimates (one Newton step on a finer discretisation).
ROW_SAFETY = 3.0
# A curve is continued beyond the value of a fold by this, for the state that a path jumps to lies on it. Rows' errors
# at the coarsest accuracy, 1e-2, are smaller.
LANDING_MARGIN = 1e-3
# Quadrature error of a piece of path; paths of some ten pieces are then integrated as accurately as their events are.
QUADRATURE_SHARE = 0.1


def of_rows(accuracy: float) -> float:
    """Error estimate allowed to rows that are to be as accurate as events."""
    return max(FINEST_ROWS, accuracy) / ROW_SAFETY
