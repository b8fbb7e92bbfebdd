"""Quantities with units, wherever a number of a physical contact is asked for."""

import numpy as np
import pytest

import contbranch as cb
from contbranch.cli import main
from contbranch.continuation import Problem, trace_curve

PHYSICAL = cb.Contact.physical(
    radius="1 um", modulus="5 GPa", interaction="gauss", work_of_adhesion="-40 mN/m", range="1 nm"
)
FILE = """[tip]
shape = "parabola"
radius = "1 um"
[material]
modulus = "5 GPa"
[[interaction]]
law = "gauss"
work_of_adhesion = "-40 mN/m"
range = "1 nm"
"""


def test_loads_and_springs_have_units():
    one = cb.solve(PHYSICAL, load="0.2 uN", accuracy=1e-4)
    assert one.load == 200.0
    assert one.displacement == cb.solve(PHYSICAL, load=200.0, accuracy=1e-4).displacement
    assert cb.Spring("0.5 N/m") == cb.Spring(0.5)
    for control in (cb.Spring("500 N/m"), "spring:500 N/m"):
        found = cb.trace(PHYSICAL, control, accuracy=1e-4, max_load="0.4 uN")
        assert found.stiffness == 500.0
        assert found.branches[0].load[-1] == pytest.approx(400.0, rel=1e-6)


def test_a_reduced_contact_has_bare_numbers():
    contact = cb.Contact.reduced("gauss", tabor=1.0, sign=-1)
    for ask in (
        lambda: cb.solve(contact, load="1 nN"),
        lambda: cb.trace(contact, cb.Spring("1 N/m")),
        lambda: cb.trace(contact, "spring:1 N/m"),
    ):
        with pytest.raises(cb.InputError, match="reduced units: give a bare number"):
            ask()


def test_the_command_line_asks_for_units(tmp_path, capsys):
    path = tmp_path / "contact.toml"
    path.write_text(FILE)
    assert main(["solve", str(path), "--load", "200", "--accuracy", "1e-4"]) == 0
    assert "taken as nN; write '200 nN'" in capsys.readouterr().err
    assert main(["solve", str(path), "--load", "200 nN", "--accuracy", "1e-4"]) == 0
    assert "taken as" not in capsys.readouterr().err
    assert main(["solve", str(path), "--load", "200", "nN"]) == 2
    assert "quote a quantity" in capsys.readouterr().err


def test_a_derivative_of_the_wrong_shape_is_named():
    class Scalar(Problem):
        def residual(self, x, p):
            return np.array([x[0] ** 2 + p - 1.0, x[1] - x[0]])

        def parameter_derivative(self, x, p):
            return 1.0

    with pytest.raises(cb.InputError, match=r"Scalar\.parameter_derivative has the shape \(\): return \(2,\)"):
        trace_curve(Scalar(), np.ones(2), 0.0, (-1.0, 2.0))
