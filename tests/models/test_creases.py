"""Meshes that move with the creases of films."""

from dataclasses import replace

import numpy as np
import pytest

import contbranch as cb
from contbranch.curve.curves import FollowedCurves
from contbranch.curve.refine import moved, settled
from contbranch.curve.trace import Request
from contbranch.models.axisymmetric.creases import Crease, apart, moved_with, velocities
from contbranch.models.axisymmetric.equations import ContactCoordinate, Equations
from contbranch.models.axisymmetric.front import Front
from contbranch.models.axisymmetric.mesh import Mesh
from contbranch.models.axisymmetric.moving import Resolution
from contbranch.models.axisymmetric.problem import ContactProblem

EDGES = np.array([0.0, 0.2, 0.5, 0.8, 1.1, 1.4, 1.8, 2.3, 3.0])


@pytest.mark.parametrize("radius", [0.0, 0.7])
def test_rates_of_a_mesh_that_moves(radius):
    """All that follows from the same nodal values on a mesh that moves changes at the rates that are computed."""
    mesh, tip = Mesh(EDGES, 10), cb.Parabola(1.0)
    creases = [Crease(0.9, 0.1, 1, 0.0, 1.0, 1.0, 0), Crease(1.9, 0.2, 0, 0.5, 1.0, 1.0, 1)]
    edges, nodes = velocities(creases, (1.3, 1.4), mesh)
    assert edges[:, [0, 1, -1]] == pytest.approx(0.0)
    assert nodes.max(axis=1) == pytest.approx(1.0, abs=0.1)
    law, coordinate = cb.Gauss(-1.0, 0.7), ContactCoordinate(tip, 2.0)
    # Not a solution, and not continuous where panels meet: rates are those of what is computed.
    h = 1.0 / (1.0 + mesh.nodes**2) + 1e-3 * np.repeat(np.cos(np.arange(8.0)), 10)
    y = radius**2 if radius else -0.3

    def found(by):
        moved = mesh if by is None else moved_with(mesh, edges, by)
        equations = Equations(tip, law, moved, coordinate, radius > 0.0)
        fields = equations.fields(h, y)
        values = np.array([equations.load(fields), equations.displacement(fields)])
        return equations, fields, np.concatenate([fields.gap, fields.residual, values])

    equations, fields, _ = found(None)
    gaps, residuals = equations.drift(fields, edges, nodes)
    for k, by in enumerate(1e-5 * np.eye(2)):
        differences = (found(by)[2] - found(-by)[2]) / 2e-5
        rates = equations.drift_rates(fields, edges[k], nodes[k])
        assert gaps[k] == pytest.approx(differences[:80], abs=2e-7 * np.abs(differences[:80]).max())
        assert residuals[k] == pytest.approx(differences[80:160], abs=2e-7 * np.abs(differences[80:160]).max())
        assert rates == pytest.approx(differences[160:], abs=1e-9)


def test_every_crease_moves_its_own_place_alone():
    """At the place of one the velocity is 1 by its own motion and 0 by those of others; nowhere is the mesh torn."""
    mesh = Mesh(np.linspace(0.0, 3.0, 301), 4)
    chosen = [Crease(place, half, 0, 0.5, 1.0, 1.0, 0) for place, half in ((1.0, 0.3), (1.5, 0.15), (1.2, 0.07))]
    creases = apart(chosen)
    edges, _ = velocities(creases, None, mesh)
    rates = np.array([np.interp([crease.place for crease in creases], mesh.edges, own) for own in edges])
    assert rates == pytest.approx(np.eye(3), abs=1e-12)
    assert np.abs(np.diff(edges, axis=1)).max() < 0.2  # over panels of 0.01


def test_creases_that_have_moved_leave_room_for_one_another():
    """Towards one another, or towards a front: at the place of each only its own motion counts, as before."""
    mesh = Mesh(np.linspace(0.0, 3.0, 301), 4)
    moved = [Crease(place, 0.3, 0, 0.5, 1.0, 1.0, 0) for place in (1.2, 1.3, 1.5)]
    creases = apart(moved, (mesh.innermost, 1.6))
    edges, _ = velocities(creases, (1.58, 1.62), mesh)
    rates = np.array([np.interp([1.2, 1.3, 1.5, 1.6], mesh.edges, own) for own in edges])
    assert rates == pytest.approx(np.eye(3, 4), abs=1e-12)


def test_a_front_is_found_next_to_where_it_was():
    """A gap with a dip passes the front's own value more than once."""
    mesh, tip = Mesh(np.linspace(0.0, 3.0, 31), 8), cb.Parabola(1.0)
    equations = Equations(tip, cb.Gauss(-1.0, 0.7), mesh, ContactCoordinate(tip, 2.0), False)
    fields = replace(equations.fields(np.zeros(mesh.size), -1.0), gap=1.0 + np.sin(2 * np.pi * mesh.nodes))
    front = Front(1.0, 1.0, 0.1, 1.0, 0.0)
    for place in (0.5, 1.0, 1.5, 2.0, 2.5):
        assert front.anchored(equations, fields, np.log(place * 1.05)) == pytest.approx(np.log(place), abs=1e-8)


def test_layers_travel_beside_the_front():
    """A layer gives way at the centre while the film's front is a hundred times farther out.

    On a mesh that moves with the front alone the wall of the hole wanders through it: the gap there then needs 230 rows
    to come down to 2.85 ranges.
    """
    contact, rows = cb.Contact(cb.Parabola(1.0), cb.Layered(1.0, 0.07, 0.1)), []

    def progress(share, text):
        if text not in rows[-1:]:  # what was said last is said again now and then, as the clock has it
            rows.append(text)
        if len(rows) > 190:
            raise cb.Stop

    diagram = cb.trace(contact, accuracy=1e-4, modes=0, progress=progress)
    assert diagram.branches[0].central_gap.min() < 2.8 * 0.07


def test_a_state_whose_creases_have_left_the_mesh_is_lost():
    """Where it lies cannot be told then, which is no error of whoever asks."""
    mesh, tip = Mesh(EDGES, 10), cb.Parabola(1.0)
    front = Front(1.35, 0.5, 0.1, 1.0, 0.0, (Crease(0.9, 0.1, 1, 0.0, 1.0, 1.0, 0),))
    equations = Equations(tip, cb.Gauss(-1.0, 0.7), mesh, ContactCoordinate(tip, 2.0), False)
    problem = ContactProblem(equations, 0.7, Resolution(1e-4, 8), 1.0, front)
    h = 1.0 / (1.0 + mesh.nodes**2)
    assert not problem.lost(np.append(h, [0.0, 0.01]), -1.0)
    assert problem.lost(np.append(h, [0.0, -0.55]), -1.0)
    assert problem.lost(np.append(h, [-3000.0, 0.0]), -1.0)  # nor where the front itself is


def test_panels_are_not_crushed():
    mesh = Mesh(EDGES, 10)
    edges, _ = velocities([Crease(0.9, 0.1, 1, 0.0, 1.0, 1.0, 0)], None, mesh)
    with pytest.raises(cb.ModelError, match="crease"):
        moved_with(mesh, edges, np.array([-0.55]))


def test_creases_cross_a_film_in_a_few_steps():
    """A film that bends upwards at its centre gives way on a ring, which wanders through it, and then on others.

    Every ring takes the curve from one end of the same range of loads to the other. On meshes at rest it takes the ring
    140 rows to wander through the film for the first time.
    """
    contact = cb.Contact(cb.PowerLaw(2.491, 1.0), cb.VanDerWaals(-1.0, 0.0966))
    rows = []

    def progress(share, text):
        if text not in rows[-1:]:  # what was said last is said again now and then, as the clock has it
            rows.append(text)
        if len(rows) > 84:  # behind the third turn
            raise cb.Stop

    diagram = cb.trace(contact, accuracy=1e-4, modes=0, progress=progress)
    turns = np.array([fold.load for fold in diagram.folds("load")])
    first, second, third = [fold.position for fold in diagram.folds("load")][:3]
    assert second - first < 80
    assert third - second < 90
    assert turns[0] == pytest.approx(turns[2], rel=1e-4) != turns[1]


def test_steps_travel_where_the_mesh_ends_at_an_edge():
    """Stiff attraction is felt out to the edge of a cap, while its steep zone travels from the centre to there.

    At contact the law does not pull, and pull-off tends to that of JKR: of any tip with the Abel transform ζ it is the
    least of F(a) = 2 E [d a − ∫ ζ] with d = ζ(a) − √(2π a w/E).
    """
    tip = cb.SphericalCap(6.0)
    diagram = cb.trace(cb.Contact(tip, cb.VanDerWaals(1.0, 0.05)), accuracy=1e-4, modes=0)
    assert diagram.status == "complete", diagram.message
    assert len(diagram.branches[0].load) < 140
    radii = np.linspace(3.0, 5.0, 2001)
    loads = 2.0 * ((tip.transform(radii) - np.sqrt(2 * np.pi * radii)) * radii - tip.transform_integral(radii))
    excess = diagram.thresholds["pull_off_load"] / loads.min() - 1.0
    assert 0.0 < excess < 2.0e-3


def test_a_tangent_on_a_finer_mesh_moves_with_its_creases():
    """Where a steep zone wanders the rate of h at a fixed place is a spike, which nothing but that zone makes."""
    contact = cb.Contact(cb.SphericalCap(1.41), cb.VanDerWaals(1.0, 0.05))
    track = FollowedCurves(contact, cb.Axisymmetric()).track(Request(1e-4))
    creased = [point for point in track.points if point.problem.creases]
    assert len(creased) > 20
    for point in creased[::10]:
        there = moved(point, point.problem.finer())
        here, metric = settled(there), there.problem.metric(there.x)
        tangents = [(one.tangent_x, one.tangent_parameter) for one in (there, here)]
        lengths = [metric.norm(there.problem, *one) for one in tangents]
        assert metric.dot(there.problem, *tangents[0], *tangents[1]) > 0.999 * lengths[0] * lengths[1]


def test_a_row_whose_creases_the_last_mesh_cannot_hold_is_joined_on_its_own():
    """Under a cap the creases of a coarse table move so far in a step that a mesh has room for one end only."""
    gaps = np.linspace(0.0, 8.0, 9) * 0.241
    energies = np.array(cb.VanDerWaals(1.0, 0.241).evaluate(gaps).energy)
    contact = cb.Contact(cb.SphericalCap(3.471), cb.Tabulated(tuple(gaps), tuple(energies)))
    (state,) = (s for s in cb.solve(contact, load=-2.0).states if s.contact_radius > 1.5)
    assert state.displacement == pytest.approx(1.019, abs=1e-3)
    # A Maxwell relation that knows nothing of meshes: dV = F dd, between the two.
    work = cb.solve(contact, displacement=state.displacement + 1e-4).energy - state.energy
    assert work == pytest.approx(1e-4 * -2.0, abs=1e-6)


def test_the_end_of_a_mesh_stays_where_it_is():
    """However wide a crease next to it is; at the edge of a tip the mesh would end beyond."""
    mesh = Mesh(EDGES, 10, bounded=True)
    crease = Crease(2.9, 0.2, 0, 0.3, 5.0, 60.0, 0)
    edges, _ = velocities([crease], None, mesh)
    assert edges[0, 0] == edges[0, -1] == 0.0
    assert np.interp(2.9, EDGES, edges[0]) > 0.1
    assert moved_with(mesh, edges, np.array([0.01])).edges[-1] == EDGES[-1]
