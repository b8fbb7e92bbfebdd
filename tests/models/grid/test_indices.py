"""Morse indices counted along a curve from its folds, against curves whose eigenvalues are known."""

from __future__ import annotations

import numpy as np
import pytest

from contbranch.control import DISPLACEMENT, LOAD
from contbranch.models.grid.rows import morse_indices


def test_without_folds_everything_is_stable():
    indices = morse_indices(4, [], (1, 1))
    assert indices.rows(LOAD).tolist() == indices.rows(DISPLACEMENT).tolist() == [0, 0, 0, 0]
    falling = morse_indices(3, [], (-1, 1))
    assert falling.rows(LOAD).tolist() == [1, 1, 1]
    assert falling.rows(DISPLACEMENT).tolist() == [0, 0, 0]


@pytest.mark.parametrize("amplitude", [0.5, 1.5, 3.0])
def test_a_chain_of_two_springs(amplitude):
    """Energy V(q) + (d − q)²/2, V' = c(q), one internal variable: λ = c'(q) + 1, dF/dd = c'/λ.

    The curve in q has d = q + c(q), F = c(q); displacement folds where λ = 0, load folds where c' = 0.
    """
    q = np.linspace(-1.2, 1.2, 4001)
    force, slope = amplitude * (q**3 - q), amplitude * (3 * q**2 - 1)
    eigenvalue = slope + 1
    folds = [(int(k), "load") for k in np.flatnonzero(slope[:-1] * slope[1:] < 0)]
    folds += [(int(k), "displacement") for k in np.flatnonzero(eigenvalue[:-1] * eigenvalue[1:] < 0)]
    loading = int(np.sign(force[1] - force[0]))
    approaching = int(np.sign((q + force)[1] - (q + force)[0]))
    indices = morse_indices(len(q), sorted(folds), (loading, approaching))
    middle = (q[1:] + q[:-1]) / 2
    safe = np.ones(len(middle), dtype=bool)
    for row, _ in folds:
        safe[max(0, row - 1) : row + 2] = False
    curvature = amplitude * (3 * middle**2 - 1)
    # under load control the Hessian of V + (d − q)²/2 − F d in (q, d) is [[c' + 1, −1], [−1, 1]]
    for piece in np.flatnonzero(safe)[::37]:
        hessian = np.array([[curvature[piece] + 1, -1.0], [-1.0, 1.0]])
        assert indices.pieces(LOAD)[0][piece] == (np.linalg.eigvalsh(hessian) < 0).sum()
        assert indices.pieces(DISPLACEMENT)[0][piece] == int(curvature[piece] + 1 < 0)
    assert (indices.pieces(LOAD)[1][safe] == np.sign(np.diff(force))[safe]).all()


def test_a_fold_row_counts_with_its_more_stable_side():
    indices = morse_indices(5, [(2, "load")], (1, 1))
    assert indices.pieces(LOAD)[0].tolist() == [0, 0, 1, 1]
    assert indices.rows(LOAD).tolist() == [0, 0, 0, 1, 1]
    assert indices.rows(DISPLACEMENT).tolist() == [0, 0, 0, 0, 0]
