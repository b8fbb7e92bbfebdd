"""Derivatives of thresholds against central differences of traces, closed forms and scaling laws."""

import json
import math

import numpy as np
import pytest

import contbranch as cb
from contbranch.cli import main
from contbranch.contact.parameters import parameters_of

GAPS = np.linspace(0.0, 12.0, 120)
RADII = np.linspace(0.0, 6.0, 60)
TABLE = cb.Tabulated(tuple(GAPS), energies=tuple(-0.8 * np.exp(-GAPS)))
PROFILE = cb.Profile(tuple(RADII), tuple(0.5 * RADII**2))

# Contact, control, accuracy of the traces, parameters varied: all of those of "exact", which is cheap, for most follow
# from the others by scaling, whatever the contact is.
CASES = {
    "repulsion": (cb.Contact.reduced(cb.Gauss, tabor=1.0, sign=-1), "load", 1e-11, "range"),
    "exact": (cb.Contact.reduced(cb.MaugisDugdale, tabor=1.5), cb.Spring(1.0), 1e-11, ""),
    "sum": (cb.Contact(cb.Parabola(1.0), cb.Gauss(1.0, 0.8) + cb.Exponential(-0.4, 1.0)), "load", 1e-10, "range[1]"),
    "cone": (cb.Contact(cb.Cone(0.5), cb.Exponential(1.0, 0.7)), "load", 1e-10, "slope"),
    # its film reaches the edge of the cap, which nodes must not pass
    "edge": (cb.Contact(cb.SphericalCap(5.0), cb.VanDerWaals(-1.7, 2.0)), "load", 1e-8, "radius"),
    # no parameter tells in which units a table is: less follows from the others
    "table": (cb.Contact(cb.Parabola(1.3), TABLE, 2.0), cb.Spring(2.0), 1e-8, ""),
    "tables": (cb.Contact(PROFILE, TABLE, 1.5), "load", 1e-8, ""),
    # a fold at a hundredth of a radius², next to the edge of its parameter
    "weak": (cb.Contact.reduced(cb.InverseSquare, tabor=0.0752), "load", 1e-11, "range"),
    "ring": (cb.Contact.reduced(cb.MaugisDugdale, tabor=0.5, sign=-1), "load", 1e-8, "range"),
}


@pytest.mark.parametrize("name", CASES)
def test_derivatives_agree_with_differences_of_traces(name):
    contact, control, accuracy, varied = CASES[name]
    diagram = cb.trace(contact, control=control, modes=0)
    assert diagram.sensitivities.keys() == diagram.thresholds.keys()
    step = 2e-3 if accuracy > 1e-9 else 2e-4
    farthest = max(0.1, 1.02 * max(event.load for event in diagram.events if event.kind != "end"))
    for key, parameter in parameters_of(contact).items():
        if not key.startswith(varied):
            continue
        above, below = (
            cb.trace(
                parameter.contact(parameter.value * (1 + h)), control, accuracy, modes=0, max_load=farthest
            ).thresholds
            for h in (step, -step)
        )
        for threshold, value in diagram.thresholds.items():
            expected = (above[threshold] - below[threshold]) / (2 * step * parameter.value)
            found = diagram.sensitivities[threshold][key]
            # the difference itself is wrong by the square of its step
            allowed = step * step * 10
            assert found == pytest.approx(expected, rel=3e-6 + allowed, abs=2e-7 * abs(value / parameter.value)), (
                threshold
            )


@pytest.mark.parametrize(("law", "tabor", "sign"), [("van-der-waals", 0.07, -1), ("gauss", 0.05, -1)])
def test_the_radius_of_a_tiny_contact_moves_as_traces_say(law, tabor, sign):
    """Next to first touch, where little is left between the fold and the edge of its parameter."""
    contact = cb.Contact.reduced(law, tabor, sign)
    rates = cb.trace(contact, modes=0).sensitivities["wetting_radius"]
    reach = parameters_of(contact)["range"]
    h = 0.01 * reach.value
    above, below = (
        cb.trace(reach.contact(reach.value + s), accuracy=1e-9, modes=0).thresholds["wetting_radius"] for s in (h, -h)
    )
    assert rates["range"] == pytest.approx((above - below) / (2 * h), rel=5e-3)


def test_a_slope_that_lifts_a_tip_by_more_than_a_thin_film_is_thick():
    """Heights of 2,000 ranges: what changes them by a small share moves the film by more than what it feels."""
    contact, h = cb.Contact(cb.Cone(0.5), cb.Exponential(-1.0, 0.4)), 1e-4
    rates = cb.trace(contact, modes=0, max_load=9.8e5).sensitivities  # just beyond first touch
    above, below = (
        cb.trace(cb.Contact(cb.Cone(0.5 + s), contact.interaction), accuracy=1e-10, modes=0, max_load=9.8e5).thresholds
        for s in (h, -h)
    )
    for threshold in ("squeeze_out_load", "touch_displacement"):
        assert rates[threshold]["slope"] == pytest.approx((above[threshold] - below[threshold]) / (2 * h), rel=5e-6)


def test_the_edge_of_a_cap_may_pass_nodes_of_fine_meshes():
    """As those for tables are, whose last panels are shorter than the way the edge goes when the radius is varied."""
    contact = cb.Contact(cb.SphericalCap(7.8), TABLE)
    rates = cb.trace(contact, modes=0).sensitivities
    radius = parameters_of(contact)["radius"]
    h = 2e-3 * radius.value
    above, below = (cb.trace(radius.contact(radius.value + s), accuracy=1e-8, modes=0) for s in (h, -h))
    for threshold, found in rates.items():
        expected = (above.thresholds[threshold] - below.thresholds[threshold]) / (2 * h)
        assert found["radius"] == pytest.approx(expected, rel=3e-4, abs=1e-6)


def test_the_radius_of_a_cap_follows_from_what_does_not_move_its_edge():
    """In a table as under the law that it is of; a difference by the radius was off by a tenth at the edge."""
    cap, law = cb.SphericalCap(2.868), cb.Gauss(-1.0, 0.9)
    gaps = 0.9 * np.linspace(0.0, 14.0, 60)
    table = cb.Tabulated(tuple(gaps.tolist()), tuple(law.evaluate(gaps).energy.tolist()))
    found, expected = (
        cb.trace(cb.Contact(cap, one), accuracy=1e-9, modes=0).sensitivities["touch_load"] for one in (table, law)
    )
    for name in ("radius", "modulus", "steepness"):
        assert found[name] == pytest.approx(expected[name], rel=1e-5)


@pytest.mark.parametrize(
    ("contact", "name", "varied"),
    [
        (cb.Contact.reduced(cb.Gauss, 0.0013, -1), "wetting_radius", ("range",)),  # 5e-8
        (
            cb.Contact(cb.PowerLaw(2.837, 1.0), cb.Exponential(1.0, 305.0), 3.0),
            "pull_off_radius",  # 6e-4
            ("range", "exponent"),
        ),
    ],
    ids=["film", "attraction"],
)
def test_radii_of_contacts_that_are_all_but_none(contact, name, varied):
    """By states next to the fold they would be but rounding, or off by 3 %; against differences of traces."""
    rates = cb.trace(contact, accuracy=1e-9, modes=0).sensitivities[name]
    for key in varied:
        parameter = parameters_of(contact)[key]
        step = 1e-3 * parameter.value
        high, low = (
            cb.trace(parameter.contact(parameter.value + k * step), accuracy=1e-10, modes=0).thresholds[name]
            for k in (1, -1)
        )
        assert rates[key] == pytest.approx((high - low) / (2 * step), rel=2e-4)


def test_jkr_limit_and_dimensions():
    """Far in the JKR limit F = −(3π/2) R Δγ (in these units −1.5π): linear in both, whatever E and the range."""
    contact = cb.Contact(cb.Parabola(2.0), cb.MaugisDugdale(3.0, 1e-3))
    rates = cb.trace(contact).sensitivities["pull_off_load"]
    assert rates["radius"] == pytest.approx(-1.5 * math.pi * 3.0, rel=1e-3)
    assert rates["work_of_adhesion"] == pytest.approx(-1.5 * math.pi * 2.0, rel=1e-3)
    assert abs(rates["modulus"]) < 1e-3
    assert abs(rates["range"]) * 1e-3 < 1e-2


def test_propagation_adds_squares_in_the_units_of_the_contact(tmp_path, capsys):
    contact = cb.Contact.physical(
        radius="1 um", modulus="5 GPa", interaction="maugis-dugdale", work_of_adhesion="40 mN/m", range="1 nm"
    )
    diagram = cb.trace(contact)
    rates = diagram.sensitivities["pull_off_load"]
    spread = diagram.propagate({"range": "0.1 nm", "radius": 50.0})["pull_off_load"]
    assert spread == pytest.approx(math.hypot(rates["range"] * 0.1, rates["radius"] * 50.0))
    for wrong in ({"rnage": 0.1}, {"range": "1 N"}, {"range": -1.0}):
        with pytest.raises(cb.InputError, match="uncertainty"):
            diagram.propagate(wrong)
    diagram.save(tmp_path / "d.h5")
    assert cb.load(tmp_path / "d.h5").sensitivities == diagram.sensitivities
    file = tmp_path / "c.toml"
    file.write_text(
        '[tip]\nshape = "parabola"\nradius = "1 um"\n[material]\nmodulus = "5 GPa"\n[[interaction]]\n'
        'law = "maugis-dugdale"\nwork_of_adhesion = "40 mN/m"\nrange = "1 nm"\n'
    )
    assert (
        main(["trace", str(file), "--uncertainty", "range=0.1nm", "--uncertainty", "radius=50 nm", "--json", "-"]) == 0
    )
    document = json.loads(capsys.readouterr().out)
    assert document["uncertainties"]["pull_off_load"] == pytest.approx(spread)
    assert document["sensitivities"]["pull_off_radius"].keys() == {"modulus", "radius", "work_of_adhesion", "range"}
    assert main(["trace", str(file), "--uncertainty", "range"]) == 2


def test_without_interaction_nothing_moves():
    """Without interaction first touch is at no load and no displacement, whatever the parameters are."""
    rates = cb.trace(cb.Contact.reduced(None)).sensitivities
    assert all(rate == pytest.approx(0.0, abs=1e-9) for one in rates.values() for rate in one.values())
