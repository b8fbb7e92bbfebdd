"""Marks of one fold that noise has repeated."""

from __future__ import annotations

import pytest
from contbranch.models.axisymmetric.located import repetitions


@pytest.mark.parametrize(
    ("names", "positions", "dropped"),
    [
        (["load"], [0.3], set()),
        (["load", "load"], [0.3, 0.3], set()),  # perhaps a pair too narrow to be told apart
        (["load", "load", "load"], [0.3, 0.3 + 1e-13, 0.3], {1, 2}),  # one fold, whose rate is noise at its zero
        (["load", "load", "load"], [0.3, 0.3 + 1e-6, 0.3], set()),  # three folds
        (["load", "displacement", "load", "load"], [0.3, 0.3, 0.3, 0.3], {2, 3}),
        (["load"] * 5, [0.3] * 5, {1, 2, 3, 4}),
        (["load"] * 3, [1e-6, 1e-6 + 1e-10, 1e-6 + 2e-10], set()),  # tiny contacts: relative to the place
    ],
)
def test_a_fold_is_not_three(names, positions, dropped):
    assert repetitions(names, positions) == dropped
