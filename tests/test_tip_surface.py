"""Elliptic paraboloids, surfaces of axisymmetric tips, and models that need axial symmetry."""

import dataclasses
import json
import math

import numpy as np
import pytest

import contbranch as cb
from contbranch.contact.tip_shape import TipShape
from contbranch.models.axisymmetric import Axisymmetric
from contbranch.models.choice import choose
from contbranch.models.exact.model import Exact

X, Y = np.array([0.0, 0.3, -0.3, 0.4, 1.1]), np.array([0.0, 0.4, 0.4, -0.3, 0.2])


@pytest.mark.parametrize(
    "tip",
    [
        cb.Parabola(1.3),
        cb.Cone(0.7),
        cb.PowerLaw(3.0, 1.4),
        cb.SphericalCap(2.0),
        cb.Profile([0, 1, 2, 3], [0, 1, 4, 9]),
    ],
    ids=lambda tip: tip.name,
)
def test_surface_of_an_axisymmetric_tip_is_its_profile_turned_round(tip):
    radii = np.array([0.0, 0.5, 0.5, 0.5, math.sqrt(1.25)])  # of the points (X, Y), by Pythagoras
    np.testing.assert_allclose(tip.surface(X, Y), tip.height(radii), rtol=1e-14, atol=1e-15)
    assert tip.surface(X[:, None], Y).shape == (5, 5)
    assert tip.is_axisymmetric
    assert tip.mirror_symmetric
    assert tip.axisymmetric is tip


def test_surface_ends_where_the_tip_ends():
    assert cb.SphericalCap(2.0).surface(1.5, 1.5) == math.inf  # r = 2.12
    assert np.isfinite(cb.SphericalCap(2.0).surface(1.4, 1.4))


def test_elliptic_paraboloid():
    tip = cb.EllipticParaboloid(2.0, 0.5)
    np.testing.assert_allclose(tip.surface(X, Y), X * X / 4.0 + Y * Y, rtol=1e-15)
    assert not tip.is_axisymmetric
    assert tip.mirror_symmetric
    assert tip.natural_length == pytest.approx(1.0)
    assert tip.surface(X[:, None], Y).shape == (5, 5)
    # principal curvatures are second derivatives: central differences of a quadratic are exact
    curvature_x = tip.surface(1.0, 0.0) - 2.0 * tip.surface(0.0, 0.0) + tip.surface(-1.0, 0.0)
    assert (curvature_x, tip.surface(0.0, 1.0) * 2.0) == (pytest.approx(1 / 2.0), pytest.approx(1 / 0.5))


def test_scales_of_the_paper_with_the_mean_radius():
    # (23), (24) for √(4000·250) = 1000 nm, |Δγ| = 0.04 nN/nm, E = 5 nN/nm²: 20 nm and 0.4 nm, as for that parabola
    contact = cb.Contact.physical(
        tip="elliptic-paraboloid",
        radius_x="4 um",
        radius_y="250 nm",
        modulus="5 GPa",
        interaction="gauss",
        work_of_adhesion="-40 mN/m",
        range="1 nm",
    )
    assert (contact.scales.in_plane, contact.scales.normal) == (pytest.approx(20.0), pytest.approx(0.4))
    assert contact.tabor == pytest.approx(0.4)
    reduced = contact.to_reduced()
    assert reduced.tip.radius_x == pytest.approx(4.0, rel=1e-14)  # R = 1, the ratio stays
    assert reduced.tip.radius_y == pytest.approx(0.25, rel=1e-14)
    heights = contact.tip.surface(20.0 * X, 20.0 * Y) / 0.4
    np.testing.assert_allclose(reduced.tip.surface(X, Y), heights, rtol=1e-13)
    again = cb.Contact.from_description(json.loads(json.dumps(contact.describe())))
    assert again == contact
    assert hash(again) == hash(contact)


@pytest.mark.parametrize("value", [0.0, -1.0, math.nan, "1 um", None])
@pytest.mark.parametrize("name", ["radius_x", "radius_y"])
def test_wrong_radii(name, value):
    with pytest.raises(cb.InputError, match=rf"^{name}: .*; must be"):
        cb.EllipticParaboloid(**{"radius_x": 1.0, "radius_y": 2.0, name: value})


def test_equal_radii_are_a_parabola_to_every_model():
    round_tip = cb.EllipticParaboloid(3.0, 3.0)
    assert round_tip.axisymmetric == cb.Parabola(3.0)
    for law, model in ((cb.MaugisDugdale(1.0, 0.5), Exact()), (cb.Exponential(1.0, 0.5), Axisymmetric())):
        contact = cb.Contact(round_tip, law)
        assert choose(contact)[0] == model
        mine, wanted = (cb.solve(cb.Contact(tip, law), load=2.0) for tip in (round_tip, cb.Parabola(3.0)))
        assert mine.contact_radius == pytest.approx(wanted.contact_radius, rel=1e-12)


@dataclasses.dataclass(frozen=True)
class Wedge(TipShape):
    """A ridge along y: z = |x|."""

    @property
    def natural_length(self):
        return 1.0

    def surface(self, x, y):
        return np.abs(x) + 0.0 * np.asarray(y)

    def reduced_scales(self, adhesion_length):
        return adhesion_length, adhesion_length

    def scaled(self, in_plane, normal):
        assert in_plane == normal
        return self


@pytest.mark.parametrize("tip", [cb.EllipticParaboloid(2.0, 1.0), Wedge()], ids=["elliptic", "own"])
def test_models_with_axial_symmetry_refuse_a_tip_without(tip):
    name = tip.name or "Wedge"
    contact = cb.Contact(tip, cb.Gauss(1.0, 0.5))
    assert Axisymmetric().obstacle(contact) == f"a tip of the shape {name} is not axisymmetric"
    assert Exact().obstacle(contact) == f"the closed form holds for a parabola, not for a tip of the shape {name}"
    with pytest.raises(cb.InputError, match=f"^tip: {name}; must be axisymmetric"):
        _ = contact.axisymmetric_tip
    for model in ("axisymmetric", "exact"):
        with pytest.raises(cb.InputError, match=f"^model: {model} does not represent this contact: .* shape {name}"):
            cb.solve(contact, load=1.0, model=model)


def test_a_parameter_that_breaks_the_symmetry_is_not_followed_without_it():
    contact = cb.Contact(cb.EllipticParaboloid(1.0, 1.0), cb.MaugisDugdale(-1.0, 0.5))
    from contbranch.contact.family import family_of

    family = family_of(contact, "tip.radius_x", 2.0)
    with pytest.raises(cb.InputError, match="must be axisymmetric"):
        family.reduced(family.coordinate(2.0))
