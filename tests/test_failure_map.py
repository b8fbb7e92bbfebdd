"""studies/failure_map.py: how answers are judged, how methods fail, and what the map says of the package."""

from __future__ import annotations

import sys
from dataclasses import replace
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
if str(ROOT) not in sys.path:
    sys.path.append(str(ROOT))  # the scripts in studies/ are not installed

from studies import failure_map  # noqa: E402
from studies.elsewhere import Failure  # noqa: E402
from studies.failure_map import (  # noqa: E402
    DIVERGED,
    METHODS,
    REFUSED,
    RIGHT,
    TRAPPED,
    WRONG,
    Cell,
    Claim,
    Method,
    Subject,
    judge,
    measured,
)

GAUSS = Subject("gauss", -1, 1.0)
OWN = METHODS[0]


def method(name: str, resolution: str = "") -> Method:
    return next(one for one in METHODS if one.name.startswith(name) and one.resolution.startswith(resolution))


# Judging. Folds of the Gauss repulsion, μ_T = 1: 8.377051 and 8.006511 (load), 1.899648 and 1.864842 (displacement).


@pytest.mark.parametrize(
    ("folds", "reason", "whole", "outcome"),
    [
        ((("squeeze-out", 8.37705, 1e-5), ("wetting", 8.00651, 1e-5)), "", True, RIGHT),
        ((("squeeze-out", 8.37705, 1e-7), ("wetting", 8.00651, 1e-5)), "", True, WRONG),  # off by 1.4e-6
        ((("squeeze-out", 8.37705, 1e-7), ("wetting", 8.00651, 1e-5)), "too coarse", True, REFUSED),
        ((("squeeze-out", 8.37705, 1e-5), ("wetting", 8.00651, 1e-5)), "too coarse", True, RIGHT),
        ((("squeeze-out", 8.37705, 1e-5), ("wetting", 8.00651, 1e-5)), "not traced to its end", False, REFUSED),
        ((("squeeze-out", 8.37705, 1e-5),), "", True, WRONG),
        ((), "", True, WRONG),
        ((("squeeze-out", 8.37705, 1e-5), ("wetting", 8.00651, 1e-5), ("wetting", 7.5, 1e-5)), "", True, WRONG),
    ],
)
def test_default_settings_are_right_within_their_own_errors(folds, reason, whole, outcome):
    assert judge(GAUSS, OWN, "load", Claim(folds, reason, whole=whole))[0] == outcome


def test_others_are_allowed_three_per_cent_and_a_step():
    steps = method("natural")
    off = (("squeeze-out", 8.7, None), ("wetting", 8.0, None))
    assert judge(GAUSS, steps, "load", Claim(off))[0] == WRONG
    assert judge(GAUSS, steps, "load", Claim(off, step=0.2))[0] == RIGHT
    assert judge(GAUSS, steps, "displacement", Claim(()))[0] == RIGHT  # a hysteresis narrower than 3 %
    assert judge(GAUSS, steps, "load", Failure(DIVERGED, "no convergence"))[0] == DIVERGED


def test_a_coarse_lattice_traps():
    stiff, soft = Subject("gauss", -1, 4.0), Subject("gauss", -1, 1.0)
    assert judge(stiff, method("L-BFGS-B", "32"), "load", Claim(()))[0] == TRAPPED
    assert judge(soft, method("L-BFGS-B", "32"), "load", Claim((("wetting", 5.0, None),)))[0] == WRONG


# Methods


@pytest.mark.parametrize(
    ("name", "subject", "load", "displacement"),
    [
        ("axisymmetric", GAUSS, RIGHT, RIGHT),
        ("axisymmetric", Subject("maugis-dugdale", 1, 1.0), RIGHT, RIGHT),
        ("free grid", GAUSS, RIGHT, RIGHT),
        ("free grid", Subject("gauss", 1, 0.0625), RIGHT, RIGHT),  # one pull-off, not two
        ("periodic grid", GAUSS, RIGHT, RIGHT),
        ("fixed mesh", GAUSS, RIGHT, RIGHT),
        ("natural", Subject("exponential", 1, 1.0), DIVERGED, DIVERGED),
        ("nearest-zero", Subject("exponential", 1, 1.0), WRONG, RIGHT),
    ],
)
def test_outcomes(name, subject, load, displacement):
    """Folds of both controls (attraction: −5.2279; −1.6965 and −1.7326), and how plain methods miss them."""
    cells = measured(subject, method(name))
    assert [cell.outcome for cell in cells] == [load, displacement], [cell.detail for cell in cells]
    assert cells[0].seconds > 0.0


def test_a_minimiser_finds_no_jump_where_there_is_none():
    """A convex energy, on few nodes, of which none makes a fold."""
    few = replace(method("L-BFGS-B"), resolution="16")
    assert [cell.outcome for cell in measured(Subject("exponential", -1, 1.0), few)] == [RIGHT, RIGHT]


def test_secants_turn_round_or_miss_a_fold():
    """Without a guard, at least one of the curves of the Gauss laws from μ_T = 4 on is not followed to its end."""
    tried = (cell for sign in (1, -1) for cell in measured(Subject("gauss", sign, 4.0), method("secant")))
    assert any(cell.outcome != RIGHT for cell in tried)


# The map


def test_truth_is_convexity_and_closed_form():
    """No fold where v'' ≥ 0; Maugis' pull-off load at μ_T = 1."""
    assert failure_map.truth(Subject("exponential", -1, 4.0)).lost == {"load": {}, "displacement": {}}
    exact = failure_map.truth(Subject("maugis-dugdale", 1, 1.0)).lost["load"]["pull-off"]
    assert exact == pytest.approx(-4.98063009659)


def test_cells_are_kept_and_not_done_twice(tmp_path, monkeypatch):
    path = tmp_path / "map.jsonl"
    chosen = Method("fixed mesh", "48", False, ("exponential",), method("fixed mesh").claims)
    monkeypatch.setattr(failure_map, "TABORS", (1.0,))
    cells = failure_map.run(1.0, path, [chosen])
    assert len(cells) == 4  # both signs, both controls
    monkeypatch.setattr(failure_map, "measured", None)
    assert failure_map.run(1.0, path, [chosen]) == cells == failure_map.load_cells(path)


def test_chart():
    cells = [
        Cell(one.name, one.resolution, law, sign, tabor, control, outcome, "", 0.1, one.own)
        for one, outcome in zip(METHODS, (*failure_map.OUTCOMES, *failure_map.OUTCOMES), strict=False)
        for law in one.laws
        for sign in (1, -1)
        for tabor in failure_map.TABORS[::4]
        for control in failure_map.CONTROLS
    ]
    figure = failure_map.draw(cells)
    assert len(figure.axes) == 2 * 4 + 2 * 6


def test_default_settings_fail_rarely():
    """The kept map: 800 cells and more; of the default settings' at most 2 % neither right nor refused."""
    cells = failure_map.load_cells()
    assert len(cells) >= 800
    own = [cell for cell in cells if cell.own]
    assert WRONG not in {cell.outcome for cell in own}
    assert sum(cell.outcome not in (RIGHT, REFUSED) for cell in own) <= 0.02 * len(own)
    assert all(cell.detail for cell in own if cell.outcome != RIGHT)  # reasons are given


def test_page_quotes_the_map():
    order = [(one.name, one.resolution) for one in METHODS]
    cells = sorted(failure_map.load_cells(), key=lambda cell: order.index((cell.method, cell.resolution)))
    page = failure_map.PAGE.read_text(encoding="utf-8")
    assert failure_map.summary(cells) in page
    assert failure_map.failures(cells) in page
