"""Lines drawn between rows show the curve."""

from __future__ import annotations

import numpy as np
import pytest

import contbranch as cb

# What a straight line between rows may be off, in units of the curve's extent.
STRAY = 0.003
# How many of the longest lines of each curve are checked.
LONGEST = 3


@pytest.mark.parametrize(
    "contact",
    [
        cb.Contact.reduced(cb.Exponential, 4.0),
        cb.Contact.reduced(cb.Gauss, 4.0, -1),
        cb.Contact.reduced(cb.MaugisDugdale, 1.0),
        cb.Contact.reduced(cb.MaugisDugdale, 0.5, -1),
    ],
    ids=["deep contact", "film and contact", "exact", "rings"],
)
def test_states_between_rows_lie_next_to_the_chord(contact):
    """A state that `solve` finds at a load halfway between two rows is next to the line that joins them."""
    branch = cb.trace(contact, modes=0).branches[0]
    rows = np.column_stack([branch.load, branch.displacement, branch.contact_radius])
    extent = np.ptp(rows, axis=0)
    chords = np.linalg.norm(np.diff(rows / extent, axis=0), axis=1)
    for k in np.argsort(chords)[-LONGEST:]:
        middle = 0.5 * (rows[k] + rows[k + 1])
        along = (rows[k + 1] - rows[k]) / extent
        held = {"load": middle[0]} if abs(along[0]) > abs(along[1]) else {"displacement": middle[1]}
        near = min(
            cb.solve(contact, **held, accuracy=1e-4).states,
            key=lambda s: np.linalg.norm((np.array([s.load, s.displacement, s.contact_radius]) - middle) / extent),
        )
        off = (np.array([near.load, near.displacement, near.contact_radius]) - middle) / extent
        across = off - along * (off @ along) / (along @ along)
        assert np.linalg.norm(across) < STRAY


def test_between_two_folds_a_row_shows_what_is_unstable_there():
    """However straight the curve is between them: from squeeze-out to the touch at which wetting begins."""
    contact = cb.Contact(cb.PowerLaw(2.194, 1.0), cb.Gauss(-1.0, 295.534), 3.0)
    diagram = cb.trace(contact, control=cb.Spring(0.30994))
    squeezed, wetted = (fold.position for fold in diagram.folds("load"))
    unstable = diagram.branches[0].unstable_load
    assert (unstable[int(squeezed) + 1 : int(wetted)] == 1).any()
    assert set(unstable) == {0, 1}
