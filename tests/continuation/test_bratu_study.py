"""The script `studies/bratu.py`."""

from __future__ import annotations

import pytest

from studies.bratu import main, trace


def test_study_reports_the_fold(capsys):
    """Continuous limit: λ = 3.513830719125162 (u_max = 2 ln cosh θ, λ = 8 θ²/cosh² θ, θ tanh θ = 1)."""
    assert trace(400).folds[0].parameter == pytest.approx(3.513830719125162, abs=2e-5)
    # Second order: four times the points, sixteen times closer.
    errors = [trace(n).folds[0].parameter - 3.513830719125162 for n in (49, 199)]
    assert errors[0] / errors[1] == pytest.approx(16.0, rel=0.01)
    main()
    printed = capsys.readouterr().out
    assert "fold at λ = 3.5136515062589" in printed
    assert "ms a point" in printed
