"""Layered bodies: an integral equation of its own, limits, and the same contact on grids."""

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.interpolate import CubicSpline

import contbranch as cb
from contbranch.contact.file import read_contact
from contbranch.theory import hertz, jkr
from contbranch.theory.layer import Disc, curve

PARABOLA = cb.Parabola(1.0)
# Load over Hertz' at the same depth on a bonded incompressible layer, by a/H: from an independent code with 40 nodes.
BONDED = {0.015: 1.017143, 0.05: 1.059028, 0.2: 1.269771, 0.5: 1.857117, 1.0: 3.371098}


@pytest.mark.parametrize("radius", BONDED)
def test_hertz_on_a_bonded_layer(radius):
    (load,), (depth,) = curve(PARABOLA, [radius], cb.ElasticLayer(1.0, 0.5))
    assert load / (4 / 3 * depth**1.5) == pytest.approx(BONDED[radius], abs=6e-7)


def test_a_thick_layer_is_a_half_space():
    body = cb.ElasticLayer(1e6, 0.3)
    (load,), (depth,) = curve(PARABOLA, [0.7], body, modulus=2.0)
    assert load == pytest.approx(float(hertz.load(0.7, modulus=2.0)), rel=1e-9)
    assert depth == pytest.approx(0.49, abs=1e-5)
    (load,), (depth,) = curve(PARABOLA, [0.7], body, work_of_adhesion=0.3)
    assert load == pytest.approx(float(jkr.load(0.7, work_of_adhesion=0.3)), rel=1e-9)


@pytest.mark.parametrize("poisson", [0.0, 0.3, 0.45])
def test_a_thin_layer_is_a_foundation(poisson):
    """w = pH/E frictionless, p = M w/H with the oedometric modulus M if bonded; E is the effective modulus."""
    oedometric = (1 - poisson) ** 2 / (1 - 2 * poisson)
    for base, stiffness in (("frictionless", 1.0), ("bonded", oedometric)):
        found = [curve(PARABOLA, [a], cb.ElasticLayer(1.0, poisson, base)) for a in (10.0, 40.0)]
        errors = [abs(load[0] / (math.pi * depth[0] ** 2) / stiffness - 1) for load, depth in found]
        assert errors[1] < 0.3 * errors[0] + 1e-5 < 0.2


def test_coatings_between_their_limits():
    x = np.array([0.05, 0.4, 1.5, 6.0])
    rigid, layer = cb.Coating(1.0, 0.3, 1e12, 0.4), cb.ElasticLayer(1.0, 0.3)
    assert np.allclose(rigid.response(x), layer.response(x), rtol=1e-8)
    assert np.allclose(cb.Coating(1.0, 0.3, 1.0, 0.3).response(x), 1.0)
    assert cb.Coating(1.0, 0.3, 0.2, 0.45).far == pytest.approx(5.0)
    assert cb.Coating(1.0, 0.3, 0.2, 0.45).response(30.0) == pytest.approx(1.0)
    # From a contact much smaller than the coating to one much larger the modulus goes over to the substrate's.
    for radius, modulus in ((1e-3, 1.0), (40.0, 0.2)):
        (load,), (depth,) = curve(cb.Parabola(1e4), [radius], cb.Coating(1.0, 0.3, 0.2, 0.45))
        assert load / (4 / 3 * 1e2 * depth**1.5) == pytest.approx(modulus, rel=0.08)


def test_response_of_a_frictionless_layer():
    x = np.array([1e-4, 0.3, 2.0, 20.0])
    expected = (np.cosh(2 * x) - 1) / (np.sinh(2 * x) + 2 * x)
    assert np.allclose(cb.ElasticLayer(1.0, 0.2, "frictionless").response(x), expected, rtol=1e-9)
    kappa = 3 - 4 * 0.2
    expected = (2 * kappa * np.sinh(2 * x) - 4 * x) / (2 * kappa * np.cosh(2 * x) + 4 * x**2 + 1 + kappa**2)
    assert np.allclose(cb.ElasticLayer(1.0, 0.2).response(x), expected, rtol=1e-9)


@pytest.mark.parametrize("tip", [PARABOLA, cb.Cone(0.5), cb.WavySphere(1.0, 0.002, 0.3)], ids=str)
def test_energy_and_pressure_without_interaction(tip):
    body, step = cb.ElasticLayer(0.4, 0.45), 1e-4
    less, disc, more = (Disc(tip, body, 0.5 + k * step) for k in (-1, 0, 1))
    work = (more.energy - less.energy) / (more.displacement - less.displacement)
    assert work == pytest.approx(disc.load, rel=1e-6)
    state = cb.solve(cb.Contact(tip, body=body), contact_radius=0.5)
    assert state.energy == pytest.approx(disc.energy, rel=1e-9)
    inside = state.r < 0.5
    assert np.allclose(state.gap[inside], 0.0)
    assert (np.diff(state.gap[~inside]) > 0.0).all()
    angle = np.arcsin(np.minimum(state.r[inside] / 0.5, 1.0))
    share = CubicSpline(angle, state.pressure[inside] * 0.25 * np.sin(2 * angle))
    assert math.pi * float(share.integrate(0.0, math.pi / 2)) == pytest.approx(disc.load, rel=5e-3)


def test_what_a_layer_adds_to_a_point_force():
    body = cb.ElasticLayer(0.7, 0.4)
    from scipy.special import j0

    for r in (0.0, 0.3, 2.0):
        q = quad(lambda q, r=r: float(body.response(q * 0.7) - 1.0) * j0(q * r), 0, 60, limit=500)[0]
        assert float(body.added(np.array([r, 5.0]))[0]) == pytest.approx(q / math.pi, abs=1e-8)


# -- contacts on layers -----------------------------------------------------------------------------------------------
def test_trace_and_solve_without_interaction():
    contact = cb.Contact(PARABOLA, body=cb.ElasticLayer(0.5, 0.5))
    diagram = cb.trace(contact, max_load=2.0)
    assert diagram.status == "complete"
    branch = diagram.branches[0]
    touching = branch.contact_radius > 0
    load, depth = curve(PARABOLA, branch.contact_radius[touching], contact.body)
    assert np.allclose(branch.load[touching], load, rtol=1e-9)
    assert np.allclose(branch.displacement[touching], depth, rtol=1e-9)
    state = cb.solve(contact, displacement=0.1)
    assert np.interp(0.1, depth, load) == pytest.approx(state.load, rel=0.02)
    assert cb.trace(cb.Contact(cb.Cone(0.4), body=cb.ElasticLayer(0.5, 0.3))).status == "complete"


def test_units_do_not_matter():
    contact = cb.Contact.physical(modulus="1 kPa", radius="2.5 um", body=cb.ElasticLayer(3000.0, 0.5))
    state = cb.solve(contact, displacement="500 nm")
    (load,), _ = curve(cb.Parabola(2500.0), [state.contact_radius], contact.body, modulus=1e-6)
    assert state.load == pytest.approx(load, rel=1e-9)
    assert cb.Contact.from_description(contact.describe()) == contact


def test_contact_files_of_layers(tmp_path):
    path = tmp_path / "cell.toml"
    text = '[tip]\nshape = "parabola"\nradius = "2.5 um"\n[material]\nmodulus = "1 kPa"\n'
    path.write_text(text + 'thickness = "3 um"\npoisson = 0.5\nbase = "frictionless"\n')
    assert read_contact(path)[0].body == cb.ElasticLayer(3000.0, 0.5, "frictionless")
    path.write_text(text + 'thickness = "3 um"\npoisson = 0.5\nsubstrate_modulus = "1 MPa"\nsubstrate_poisson = 0.4\n')
    assert read_contact(path)[0].body == cb.Coating(3000.0, 0.5, 1e-3, 0.4)
    for wrong, field in (
        ('thickness = "3 um"\n', "material.poisson"),
        ('thickness = "3 um"\npoisson = 0.6\n', "material.poisson"),
        ('thickness = "3 um"\npoisson = 0.5\nbase = "glued"\n', "material.base"),
        ("poisson = 0.5\n", "material.thickness"),
    ):
        path.write_text(text + wrong)
        with pytest.raises(cb.InputError, match=field):
            read_contact(path)


def test_a_grid_and_the_integral_equation_agree():
    """By a trace of attraction, with the displacement of the far field, in free space and in a periodic cell."""
    body = cb.ElasticLayer(0.5, 0.5)
    sticky = cb.Contact(PARABOLA, cb.Exponential(1e-4, 0.05), body=body)
    exact = cb.solve(cb.Contact(PARABOLA, body=body), load=0.5)
    for model in (cb.FreeSpace(cell=4.0, grid=128), cb.Periodic(cell=4.0, grid=128)):
        state = cb.solve(sticky, load=0.5, model=model)
        assert state.displacement == pytest.approx(exact.displacement, rel=2e-3)
        assert state.contact_radius == pytest.approx(exact.contact_radius, rel=3e-3)


def test_adhesion_on_a_thick_layer_is_that_on_a_half_space():
    law, model = cb.Exponential(1.0, 0.5), cb.FreeSpace(cell=8.0, grid=96)
    half = cb.trace(cb.Contact(PARABOLA, law), model=model).thresholds
    thick = cb.trace(cb.Contact(PARABOLA, law, body=cb.ElasticLayer(1e4, 0.3)), model=model).thresholds
    for name in ("pull_off_load", "pull_off_radius", "touch_load"):
        assert thick[name] == pytest.approx(half[name], rel=1e-5)
    shift = thick["pull_off_displacement"] - half["pull_off_displacement"]
    assert abs(shift) < 5.0 / 1e4


def test_free_space_and_periodic_cells_agree_on_thin_layers():
    """The images of a cell are screened by the base."""
    contact = cb.Contact(PARABOLA, cb.Exponential(1.0, 0.5), body=cb.ElasticLayer(1.0, 0.3))
    free, periodic = (cb.trace(contact, model=kind(cell=8.0, grid=96)) for kind in (cb.FreeSpace, cb.Periodic))
    assert free.status == periodic.status == "complete"
    for name in ("pull_off_load", "jump_in_displacement", "touch_displacement"):
        assert free.thresholds[name] == pytest.approx(periodic.thresholds[name], rel=1e-4)


def test_what_no_model_has():
    layer = cb.ElasticLayer(0.5, 0.3)
    with pytest.raises(cb.InputError, match="jumps"):
        cb.trace(cb.Contact(PARABOLA, cb.MaugisDugdale(1.0, 0.5), body=layer), model="axisymmetric")
    with pytest.raises(cb.InputError, match="periodic"):
        cb.trace(
            cb.Contact(PARABOLA, cb.Exponential(1.0, 0.5), body=cb.ElasticLayer(0.01, 0.3)),
            model=cb.FreeSpace(cell=8.0, grid=32),
        )
    for arguments in ((0.0, 0.3), (1.0, 0.6), (1.0, 0.3, "glued")):
        with pytest.raises(cb.InputError):
            cb.ElasticLayer(*arguments)


# -- with an interaction ----------------------------------------------------------------------------------------------
ADHESIVE = cb.Contact(PARABOLA, cb.Exponential(1.0, 0.5), body=cb.ElasticLayer(1.0, 0.3))


@pytest.fixture(scope="module")
def adhesive():
    return cb.trace(ADHESIVE, accuracy=1e-8)


def test_a_thick_layer_changes_the_displacement_by_its_own(adhesive):
    """By F g(0)/(π H) with what the layer adds to a point force; loads and radii are those of the half space."""
    half = cb.trace(cb.Contact(PARABOLA, cb.Exponential(1.0, 0.5))).thresholds
    body = cb.ElasticLayer(1e3, 0.3)
    thick = cb.trace(cb.Contact(PARABOLA, cb.Exponential(1.0, 0.5), body=body)).thresholds
    assert thick["pull_off_load"] == pytest.approx(half["pull_off_load"], abs=1e-5)
    assert thick["touch_load"] == pytest.approx(half["touch_load"], abs=1e-5)
    lift = float(body.added(np.array([0.0, 1.0]))[0]) * half["touch_load"]
    assert thick["touch_displacement"] - half["touch_displacement"] == pytest.approx(lift, rel=1e-2)


def test_a_grid_and_the_axisymmetric_model_agree(adhesive):
    assert (adhesive.status, adhesive.model.kind) == ("complete", "axisymmetric")
    grid = cb.trace(ADHESIVE, model=cb.FreeSpace(cell=8.0, grid=128)).thresholds
    for name in ("jump_in_displacement", "touch_load", "touch_displacement"):
        assert adhesive.thresholds[name] == pytest.approx(grid[name], abs=1e-6)
    for name in ("pull_off_load", "pull_off_displacement"):
        assert adhesive.thresholds[name] == pytest.approx(grid[name], abs=1e-3)


@pytest.mark.parametrize("displacement", [0.5, -0.98])
def test_energy_of_an_adhesive_layer_changes_by_the_work(displacement):
    step = 1e-4
    below, state, above = (cb.solve(ADHESIVE, displacement=displacement + k * step, accuracy=1e-9) for k in (-1, 0, 1))
    assert (above.energy - below.energy) / (2 * step) == pytest.approx(state.load, rel=1e-5)


def test_sensitivities_of_a_layer(adhesive):
    step = 1e-3
    for name, bodies in (
        ("thickness", [cb.ElasticLayer(1.0 + k * step, 0.3) for k in (1, -1)]),
        ("poisson", [cb.ElasticLayer(1.0, 0.3 + k * step) for k in (1, -1)]),
    ):
        more, less = (cb.trace(replace(ADHESIVE, body=body), accuracy=1e-8).thresholds for body in bodies)
        for key in ("pull_off_load", "touch_load", "jump_in_displacement"):
            expected = (more[key] - less[key]) / (2 * step)
            assert adhesive.sensitivities[key][name] == pytest.approx(expected, rel=1e-4)


def test_a_loop_on_a_layer_encloses_what_it_dissipates():
    loop = cb.hysteresis(ADHESIVE, "displacement")
    assert loop.status == "complete"
    for jump in loop.jumps:
        assert jump.area == pytest.approx(jump.dissipated, rel=1e-5)


def test_repulsion_on_a_layer_is_squeezed_out():
    contact = cb.Contact(PARABOLA, cb.Gauss(-1.0, 0.5), body=cb.ElasticLayer(1.0, 0.4))
    found = cb.trace(contact)
    grid = cb.trace(contact, model=cb.Periodic(cell=8.0, grid=96))
    assert found.status == "complete"
    assert [fold.name for fold in found.folds("load")] == ["squeeze-out", "wetting"]
    assert found.thresholds["squeeze_out_load"] == pytest.approx(grid.thresholds["squeeze_out_load"], rel=2e-3)


def test_the_thickness_may_vary(adhesive):
    (event,) = (one for one in adhesive.folds("load") if one.name == "pull-off")
    followed = cb.follow(event, vary="material.thickness", to=2.0)
    assert followed.status == "complete"
    there = cb.trace(replace(ADHESIVE, body=cb.ElasticLayer(2.0, 0.3))).thresholds["pull_off_load"]
    assert followed.curve["load"][-1] == pytest.approx(there, abs=1e-5)


def test_advice_for_layers():
    layer = cb.ElasticLayer(0.5, 0.3)
    assert cb.advise(cb.Contact(PARABOLA, body=layer)).chosen == "axisymmetric"
    advice = cb.advise(cb.Contact(PARABOLA, cb.Exponential(1.0, 0.5), body=layer), 0.05)
    assert advice.chosen in ("free", "periodic", "axisymmetric")
    assert "JKR" not in str(advice)


# -- force curves -----------------------------------------------------------------------------------------------------
def measured(body, work, stiffness=50.0, noise=2e-4, seed=1):
    """A force curve (nm, nN) of a bead of 2.5 µm on something of 1 kPa."""
    a = np.linspace(1.0, 1200.0, 300)
    load, depth = curve(cb.Parabola(2500.0), a, body, modulus=1e-6, work_of_adhesion=work)
    load, depth = load[depth > 0.0], depth[depth > 0.0]  # after the jump into contact
    tip = np.concatenate([np.linspace(-3000.0, 0.0, 200), depth])
    force = np.concatenate([np.zeros(200), load])
    force = force + noise * np.random.default_rng(seed).normal(size=force.size)
    return cb.ForceCurve(piezo=tip + force / (stiffness * 1e-3), force=force, spring=f"{stiffness} mN/m")


def test_the_modulus_of_a_thin_layer():
    body = cb.ElasticLayer(3000.0, 0.5)
    contact = cb.Contact.physical(modulus="3 kPa", radius="2.5 um", body=body)
    fit = cb.fit(measured(body, 0.0), contact, free=("modulus",))
    assert fit.values["modulus"] == pytest.approx(1e-6, rel=0.01)
    half = cb.fit(measured(body, 0.0), cb.Contact.physical(modulus="3 kPa", radius="2.5 um"), free=("modulus",))
    assert half.values["modulus"] > 1.6e-6


def test_jkr_on_a_thin_layer():
    body = cb.ElasticLayer(3000.0, 0.5)
    contact = cb.Contact.physical(
        modulus="3 kPa",
        radius="2.5 um",
        interaction="maugis-dugdale",
        work_of_adhesion="5 uN/m",
        range="5 nm",
        body=body,
    )
    fit = cb.fit(measured(body, 1e-5), contact, free=("modulus", "work_of_adhesion"), law="jkr", fixed=("tilt",))
    assert fit.values["modulus"] == pytest.approx(1e-6, rel=0.02)
    assert fit.values["work_of_adhesion"] == pytest.approx(1e-5, rel=0.05)
    with pytest.raises(cb.InputError, match="dmt"):
        cb.fit(measured(body, 1e-5), contact, free=("modulus",), law="dmt")
