"""Numbers of nodes: which are accepted, and what is suggested instead of the others."""

import numpy as np
import pytest

from contbranch import GridWarning
from contbranch.errors import InputError
from contbranch.grid_size import grid_points, nearest_fast


def test_nearest_fast_number_by_exhaustion():
    fast = {2**a * 3**b * 5**c * 7**d for a in range(1, 13) for b in range(8) for c in range(6) for d in range(5)}
    for n in (-4, 1, 8, 13.2, 22, 121, 127, 254, 509, 1022, 2047):
        found = nearest_fast(n)
        assert found in fast
        assert found >= 8
        nearer = {number for number in fast if number >= 8 and abs(number - n) < abs(found - n)}
        assert nearer == set()


def test_grid_that_a_stiff_law_needs_is_found_at_once():
    """Divisible by 4, so that errors are known, without prime factors above 7; hundreds of millions take no longer."""
    from contbranch import Gauss
    from contbranch.models.grid.resolution import needed_grid

    fast = sorted(
        2**a * 3**b * 5**c * 7**d for a in range(2, 31) for b in range(20) for c in range(13) for d in range(11)
    )
    for tabor in (1.0, 4.0, 16.0, 256.0):
        law = Gauss(-1.0, 1.0 / tabor)  # largest -v'' at no gap: |Δγ|/z0²
        needed = 8.0 * 9.7 * tabor**2 / np.pi
        assert needed_grid(9.7, law) == next(n for n in fast if n >= max(8, needed))


@pytest.mark.parametrize("value", [256, 256.0, "256", " 256 ", "2.56e2"])
def test_numbers_of_nodes(value):
    found = grid_points(value, "grid")
    assert found == 256
    assert isinstance(found, int)


def test_slow_ones_are_accepted():
    assert grid_points(254, "grid") == 254  # 2 · 127


@pytest.mark.parametrize(
    ("value", "message"),
    [
        (127, "127; must be a whole and even number of nodes, at least 8, .*: for example 128"),
        (4, "4; .*: for example 8"),
        (-256, "-256; .*: for example 8"),
        (100.5, "100.5; .*: for example 100"),
        ("nan", "nan; must be a whole number of nodes, for example 256"),
        ("many", "'many'; must be a whole number of nodes"),
        (True, "True; must be a whole number"),
        (None, "None; must be a whole number"),
        ([256], r"\[256\]; must be a whole number"),
    ],
)
def test_wrong_numbers(value, message):
    with pytest.raises(InputError, match=f"^grid: {message}"):
        grid_points(value, "grid")


def test_a_trace_of_minutes_is_announced() -> None:
    """N² log N a pair of transforms, and somewhat more of them: four to nine times as long on twice as many nodes."""
    from contbranch.models.grid.size import announce, expected_seconds

    assert 4.0 < expected_seconds(512) / expected_seconds(256) < 9.0
    assert 4.0 < expected_seconds(2048) / expected_seconds(1024) < 9.0
    announce(256)
    with pytest.warns(GridWarning, match="a trace on 768 nodes a side takes [0-9]+ minutes, about"):
        announce(768)
