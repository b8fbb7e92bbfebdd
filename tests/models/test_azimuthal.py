"""Azimuthal modes: against rings in real space, against translation, and against what is proved about them."""

from __future__ import annotations

import functools
import json

import numpy as np
import pytest
from followed import Followed
from ring_kernel import Rings, disc_rings, ring_eigenvalues

import contbranch as cb
from contbranch.errors import InputError
from contbranch.models.axisymmetric.azimuthal import _largest, counted, eigenvalues, mode_shape, settled, unstable_count
from contbranch.models.axisymmetric.modal import ModeSpace, inner_mode_pressure
from contbranch.output.plot_modes import mode_figure

TABOR = 2.0


def flat(law=cb.Gauss, exponent=3.0, work=-1.0, reach=0.4, length=1.0, modulus=1.0) -> cb.Contact:
    """A tip flatter than a parabola, whose unstable films break their symmetry."""
    tip = cb.PowerLaw(exponent=exponent, length=length)
    return cb.Contact(tip=tip, interaction=law(work_of_adhesion=work, range=reach), modulus=modulus)


def state_of(contact: cb.Contact, *, touching: bool):
    """A resolved equilibrium amid those on which the interaction softens somewhere: problem, h, u."""
    traced = Followed(contact.to_reduced(), 1e-9, events=False)
    rows = [
        row
        for row, point in enumerate(traced.points)
        if (traced.curve.branch.contact_radius[row] > 0) == touching
        and (traced.problem(row).fields(point.x, point.parameter).stiffness < 0).any()
        and abs(traced.curve.branch.load[row]) > 0.1
    ]
    point = traced.points[rows[len(rows) // 2]]
    problem, x = traced.problem(rows[len(rows) // 2]).remeshed(point.x, point.parameter, 1e-11)
    return problem, x, point.parameter


def eigenvalue_at(problem, x, u, m, index):
    """An eigenvalue of a state on a mesh, and how far it is from that on the finer one."""
    fine, y = problem.on(problem.equations.mesh.finer, x, u)
    found, better = (eigenvalues(one.equations, one.fields(z, u), m, index)[-1] for one, z in ((problem, x), (fine, y)))
    return found, abs(better - found)


def components(space, m, values):
    """Of a function with nodal values, in the trial functions of a space."""
    n, mesh = space.mesh.order, space.mesh
    t = np.hypot(space.radius, mesh.nodes)
    inner = mesh.rule.to_even @ (values[:n] / (t[:n] / mesh.innermost) ** (m % 2))
    outer = values[n:] * np.sqrt(mesh.weights[n:] * mesh.nodes[n:] / t[n:])
    return np.concatenate([space._factor(m).T @ inner, outer])


def mode_of(space, m, index):
    """An eigenvalue, and its mode with a gap of 1 at most."""
    values, vectors = _largest(space, m, index)
    gap = space.plane(m) @ vectors[:, index - 1]
    return values[index - 1], vectors[:, index - 1] / gap[np.argmax(np.abs(gap))]


STATES = {
    "repulsion, contact": (cb.Contact.reduced(cb.Gauss, TABOR, -1), True),
    "attraction, apart": (cb.Contact.reduced(cb.Gauss, TABOR), False),
    "attraction, contact": (cb.Contact.reduced(cb.Exponential, TABOR), True),
    "flat tip, film": (flat(), False),
}


@functools.cache
def state_named(name):
    contact, touching = STATES[name]
    return state_of(contact, touching=touching)


@pytest.fixture(params=STATES.keys())
def state(request):
    return state_named(request.param)


def stiffness_of(equations, fields):
    """v'' as a function of rho: what the ring computation is told about the state."""
    mesh = equations.mesh
    return lambda rho: equations.interaction.evaluate(mesh.interpolate(fields.gap, rho))[2]


def graded(mesh, a: float):
    """Panels for the rings, finer at a rim, where the pressure outside has a root."""
    return mesh.edges if a == 0 else np.concatenate([[0.0], mesh.edges[1] * 0.3 ** np.arange(3, 0, -1), mesh.edges[1:]])


@pytest.mark.parametrize(
    ("name", "m"),
    [("repulsion, contact", 4), ("attraction, apart", 4), ("flat tip, film", 1)],
)
def test_eigenvalues_agree_with_rings_of_pressure_in_real_space(name, m):
    """Rings of half the width change by 2e-10; the gap, interpolated for them at a steep rim, by up to 7e-9."""
    problem, x, u = state_named(name)
    fields = problem.fields(x, u)
    a = fields.rim.radius
    expected = ring_eigenvalues(m, a, graded(problem.equations.mesh, a), stiffness_of(problem.equations, fields))
    for index in (1, 2):
        found, change = eigenvalue_at(*problem.on(problem.equations.mesh.finer, x, u), u, m, index)
        assert change < 1e-8
        assert abs(found - expected[index - 1]) < change + 1e-8


def test_finer_meshes_show_the_error_of_coarse_ones(state):
    """On meshes of a tenth of the digits what the finer one changes is the error, but for a factor of 3."""
    problem, x, u = state
    exact, _ = eigenvalue_at(*problem.on(problem.equations.mesh.finer, x, u), u, 2, 1)
    found, change = eigenvalue_at(*problem.remeshed(x, u, 1e-4), u, 2, 1)
    assert change / 3 <= abs(found - exact) + 1e-10
    assert abs(found - exact) <= 3 * change + 1e-10


def test_translation(state):
    """h' = T_1 (h' + ζ'), since a shifted tip has the shifted solution; on the modes (1 − λ) <mode, h'> = λ <mode, ζ'>.

    The derivative of the panels' polynomials loses digits at the rim, so this is on the finer mesh.
    """
    problem, x, u = state
    problem, x = problem.on(problem.equations.mesh.finer, x, u)
    equations, fields = problem.equations, problem.fields(x, u)
    mesh, a = equations.mesh, fields.rim.radius
    t = np.hypot(a, mesh.nodes)
    own = mesh.derivative(fields.h) * t / mesh.nodes
    space = ModeSpace.of(equations, fields)
    tip = equations.tip.transform_derivative(t)
    for index in (1, 2, 3):
        value, mode = mode_of(space, 1, index)
        mode /= np.linalg.norm(mode)
        left = (1 - value) * (mode @ components(space, 1, own))
        right = value * (mode @ components(space, 1, tip))
        assert abs(right) > 1e-3
        assert left == pytest.approx(right, rel=1e-6)


def test_the_shape_keeps_the_contact_closed():
    """Rings with the mode's pressure, the singular one at the rim included, displace nothing inside, η outside."""
    problem, x, u = state_named("repulsion, contact")
    equations, fields = problem.equations, problem.fields(x, u)
    m, a = 2, fields.rim.radius
    shape, space = mode_shape(equations, fields, m), ModeSpace.of(equations, fields)
    value, vector = mode_of(space, m, 1)
    free = Rings(graded(equations.mesh, a), lambda s: np.hypot(a, s), lambda s: s)
    disc = disc_rings(a)
    outside = np.interp(free.s, space.rho, shape.gap[shape.r > a]) / value
    outside = -stiffness_of(equations, fields)(free.s) * outside
    inside = inner_mode_pressure(space, m, vector, disc.r) * disc.s
    closed = disc.compliance(m, disc.r, disc.s, 0.0) @ inside + free.compliance(m, disc.r, None, 0.0) @ outside
    assert np.abs(inside).max() > 0.1
    assert np.abs(closed).max() < 2e-3  # what linear interpolation of the shape leaves


def test_eigenvalues_fall_with_the_mode_number(state):
    """−Δ_m grows with m, and so does its square root (Löwner), whatever the sign of v''."""
    problem, x, u = state
    fields = problem.fields(x, u)
    largest = np.array([eigenvalues(problem.equations, fields, m, 3) for m in (1, 2, 3, 5, 8, 13, 30)])
    positive = largest[:-1] > 0
    assert (np.diff(largest, axis=0)[positive] < 0).all()


@pytest.mark.parametrize("tip", [cb.Parabola(1.0), cb.PowerLaw(exponent=4.0, length=1.0)])
def test_a_convex_energy_has_no_unstable_mode(tip):
    """The exponential repulsion: v'' > 0, so that the form is positive."""
    diagram = cb.trace(cb.Contact(tip, cb.Exponential(-1.0, 0.25)))
    assert not [event for event in diagram.events if event.kind == "symmetry"]
    assert (diagram.branches[0].unstable_azimuthal == 0).all()


@pytest.mark.parametrize(
    "contact",
    [cb.Contact.reduced(cb.Gauss, 4.0, -1), cb.Contact.reduced(cb.VanDerWaals, 4.0), flat(exponent=1.5)],
    ids=["repulsion", "attraction", "cone-like"],
)
def test_a_blunt_tip_never_breaks_its_symmetry(contact):
    """A growing gap is a positive supersolution; counted here without that proof, on every other unstable state."""
    traced = Followed(contact.to_reduced(), 1e-5)
    assert traced.curve.complete
    assert traced.curve.branch.unstable_displacement.max() == 1
    assert (traced.curve.branch.unstable_azimuthal == 0).all()
    for row in np.flatnonzero(traced.curve.branch.unstable_displacement)[::2]:
        point = traced.points[row]
        equations, fields = traced.problem(row).seen(point.x, point.parameter)  # on a mesh that moves with its front
        assert unstable_count(equations, fields, 1) == 0


@pytest.fixture(scope="module")
def cascade():
    """A flat tip's trace at the default accuracy, and one with other steps and meshes."""
    return Followed(flat(exponent=4.0, reach=0.5).to_reduced(), 1e-6)


def broken(events):
    return [event for event in events if event.kind == "symmetry"]


def test_what_settles_a_state_agrees_with_counting(cascade):
    """The supersolution exists if and only if m = 1 is stable (M-operators); n_m never grows with m, n_0 included."""
    seen = set()
    for row, point in enumerate(cascade.points):
        equations, fields = cascade.problem(row).equations, cascade.problem(row).fields(point.x, point.parameter)
        numbers = [unstable_count(equations, fields, m) for m in (1, 2, 3)]
        assert settled(equations, fields) == (numbers[0] == 0)
        assert counted(equations, fields).total == sum(numbers)
        assert (
            max(cascade.curve.branch.unstable_displacement[row], numbers[0]) >= numbers[0] >= numbers[1] >= numbers[2]
        )
        assert numbers[0] <= equations.unstable_modes(fields)
        seen.add(sum(numbers))
    assert seen == {0, 1, 2, 3}


def test_counting_between_equal_numbers_and_up_to_a_limit(cascade):
    row = int(np.argmax(cascade.curve.branch.unstable_azimuthal))
    point = cascade.points[row]
    equations, fields = cascade.problem(row).equations, cascade.problem(row).fields(point.x, point.parameter)
    for near in (1, 2, 3, 9):
        assert counted(equations, fields, near=(1,) * near).modes == (1, 1, 1)
    limited = counted(equations, fields, limit=2)
    assert limited.modes == (1, 1)
    assert not limited.complete


def test_the_index_changes_by_one_at_every_event(cascade):
    numbers = cascade.curve.branch.unstable_azimuthal
    positions = np.array([event.position for event in broken(cascade.curve.events)])
    assert len(positions) == 6
    for row in range(len(numbers) - 1):
        inside = (positions > row) & (positions <= row + 1)
        assert abs(int(numbers[row + 1]) - int(numbers[row])) == inside.sum()
    rows = [e.row if e.position is None else e.position for e in cascade.curve.events]
    assert rows == sorted(rows)


def test_events_do_not_depend_on_the_trace(cascade):
    """Another accuracy has other steps, other meshes and another order of the panels' polynomials."""
    sharp = Followed(flat(exponent=4.0, reach=0.5).to_reduced(), 1e-9, 1e-8)
    ours, theirs = broken(cascade.curve.events), broken(sharp.curve.events)
    assert [event.mode for event in ours] == [event.mode for event in theirs] == [1, 2, 3, 3, 2, 1]
    for one, other in zip(ours, theirs, strict=True):
        assert np.max(np.array(other.error) / np.maximum(1.0, np.abs(other.numbers))) <= 1e-9
        for a, b, error, rest in zip(one.numbers, other.numbers, one.error, other.error, strict=True):
            assert abs(a - b) <= error + rest
        largest = one.mode_shape.gap[np.argmax(np.abs(one.mode_shape.gap))]
        assert largest == pytest.approx(1.0)


@pytest.mark.parametrize("number", [1, 5])
def test_at_an_event_rings_in_real_space_have_the_eigenvalue_1(cascade, number):
    """m = 2 without, m = 1 with contact; the slope of the eigenvalue along the load is below 1."""
    event = broken(cascade.curve.events)[number]
    problem, x, u = event.point.problem, event.point.x, event.point.parameter
    fields = problem.fields(x, u)
    a = fields.rim.radius
    found = ring_eigenvalues(event.mode, a, graded(problem.equations.mesh, a), stiffness_of(problem.equations, fields))
    assert (a > 0) == (number == 5)
    assert found[0] == pytest.approx(1.0, abs=2e-7)
    assert found[1] < 0.9


def test_results_carry_modes(cascade, tmp_path):
    """Units, documents, files and figures; the contact is twice as large and three times as stiff as a reduced one."""
    contact = flat(exponent=4.0, work=-6.0, reach=1.0, length=2.0, modulus=3.0)
    diagram = cb.trace(contact)
    event = broken(diagram.events)[0]
    shape = event.mode_shape
    scales = contact.scales
    reduced = broken(cascade.curve.events)[0]
    assert event.load == pytest.approx(reduced.numbers[0] * scales.load, rel=1e-9)
    np.testing.assert_allclose(shape.r, reduced.mode_shape.r * scales.in_plane)
    np.testing.assert_allclose(shape.pressure, reduced.mode_shape.pressure * scales.pressure / scales.normal)

    document = diagram.document()
    json.dumps(document, allow_nan=False)
    assert {item["mode"] for item in document["events"] if item["kind"] != "symmetry"} == {None}
    assert document["events"][diagram.events.index(event)]["mode"] == event.mode
    assert document["branches"][0]["unstable_azimuthal"] == diagram.branches[0].unstable_azimuthal.tolist()

    diagram.save(tmp_path / "modes.h5")
    loaded = cb.load(tmp_path / "modes.h5")
    again = broken(loaded.events)[0]
    assert again.mode == event.mode
    for name in ("r", "gap", "pressure"):
        np.testing.assert_array_equal(getattr(again.mode_shape, name), getattr(shape, name))
    np.testing.assert_array_equal(loaded.branches[0].unstable_azimuthal, diagram.branches[0].unstable_azimuthal)
    assert loaded.branches[0].state(0).unstable_azimuthal == 0
    critical = loaded.branches[0].critical_eigenvalue
    np.testing.assert_array_equal(critical, diagram.branches[0].critical_eigenvalue)
    np.testing.assert_array_equal(critical > 1, diagram.branches[0].unstable_azimuthal > 0)

    physical = mode_figure(again.mode_shape, 0.3, {"pressure": "GPa", "displacement": "nm", "radius": "nm"})
    labels = " ".join(axes.get_ylabel() + axes.get_xlabel() for axes in physical.axes)
    assert "GPa per nm" in labels
    assert "Radius $r$ (nm)" in labels
    figure = loaded.plot_mode(again)
    assert [axes.get_xlabel() for axes in figure.axes if axes.get_xlabel()] == ["Radius $r$"]
    texts = {text.get_text() for text in loaded.plot("displacement", "load").axes[0].texts}
    assert "$m = 1$" in texts
    with pytest.raises(InputError, match="no azimuthal mode"):
        loaded.plot_mode(loaded.events[0])


def test_a_solution_that_breaks_symmetry_is_not_stable():
    """Between wetting and the last event the state amid the two stable ones is unstable to m = 1, too."""
    solution = cb.solve(flat(exponent=4.0, reach=0.5), load=8.0)
    assert [state.unstable_azimuthal for state in solution.states] == [0, 0, 1]
    assert [state.stable("displacement") for state in solution.states] == [True, True, False]


def test_modes_can_be_left_out():
    diagram = cb.trace(flat(exponent=4.0, reach=0.5), accuracy=1e-4, modes=0)
    assert not broken(diagram.events)
    assert diagram.branches[0].unstable_azimuthal is None
    limited = cb.trace(flat(exponent=4.0, reach=0.5), accuracy=1e-4, modes=2)
    assert {event.mode for event in broken(limited.events)} == {1, 2}
    assert "above m = 2" in limited.message
    assert limited.status == "complete"
    with pytest.raises(InputError, match="modes"):
        cb.trace(flat(), modes=-1)


def test_losses_of_symmetry_deep_in_a_snake_are_counted_and_not_located():
    """A flat tip on a stiff film, rings within rings: counts at every row, events where few modes are unstable."""
    tip = cb.PowerLaw(3.1, 1.0)
    law = cb.VanDerWaals(-1.0, tip.reduced_scales(1.0)[1] / 2.5)
    diagram = cb.trace(cb.Contact(tip, law), accuracy=1e-4, modes=3)
    branch = diagram.branches[0]
    deep = branch.unstable_displacement > 2
    assert diagram.status == "complete", diagram.message
    assert deep.any()
    assert (branch.unstable_azimuthal[deep] > 0).any()
    assert "losses of symmetry were not located" in diagram.message
    events = [event for event in diagram.events if event.kind == "symmetry"]
    assert events
    for event in events:
        row = int(event.position)
        assert branch.unstable_displacement[row : row + 2].max() <= 2


def test_losses_of_symmetry_next_to_a_turn_of_the_parameter_are_those_of_this_side_of_it():
    """Modes give way one after the other where the central gap all but turns back: the same gap has two states."""
    law = cb.InverseSquare(0.218, 0.05410998457823476) + cb.Exponential(-0.782, 0.05567917413100356)
    contact = cb.Contact(cb.SphericalCap(17.562), law, 3.0)
    diagram = cb.trace(contact, "displacement", accuracy=1e-5)
    events = broken(diagram.events)
    assert diagram.status == "complete", diagram.message
    assert [event.mode for event in events] == [*range(1, 33)]
    loads, error = [event.load for event in events], max(event.error["load"] for event in events)
    assert max(np.diff(loads)) < 2 * error < 1e-2
