"""Meshes that move with breakpoints of the solution."""

from dataclasses import replace

import numpy as np
import pytest

import contbranch as cb
from contbranch.curve.curves import FollowedCurves
from contbranch.curve.refine import moved, settled
from contbranch.curve.trace import Request
from contbranch.models.axisymmetric.breakpoints import Breakpoint, Motion, moved_with
from contbranch.models.axisymmetric.equations import ContactCoordinate, Equations
from contbranch.models.axisymmetric.mesh import Mesh
from contbranch.models.axisymmetric.moving import Resolution
from contbranch.models.axisymmetric.problem import ContactProblem

EDGES = np.array([0.0, 0.2, 0.5, 0.8, 1.1, 1.4, 1.8, 2.3, 3.0])
LEAD, FIRST, SECOND = Breakpoint(1.4, 0.5, 5.0, -1, 1.0), Breakpoint(0.8, 0.5, 1.0, 0), Breakpoint(1.8, 0.5, 1.0, 1)


@pytest.mark.parametrize("radius", [0.0, 0.7])
def test_rates_of_a_mesh_that_moves(radius):
    """All that follows from the same nodal values on a mesh that moves changes at the rates that are computed."""
    mesh, tip = Mesh(EDGES, 10), cb.Parabola(1.0)
    edges, nodes = Motion(LEAD, (FIRST, SECOND)).velocities(mesh, radius > 0.0)
    assert edges[:, [0, 5, -1]] == pytest.approx(0.0)
    assert edges[:, [3, 6]] == pytest.approx(np.eye(2))
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


def test_a_breakpoint_moves_its_own_place_alone():
    """Those of the others, the leading one, the centre and the end stay; what lies between two moves linearly."""
    mesh = Mesh(np.linspace(0.0, 3.0, 31), 4)
    others = tuple(Breakpoint(place, 0.5, 1.0, key) for key, place in enumerate((1.0, 1.5, 1.2)))
    motion = Motion(Breakpoint(1.6, 0.5, 1.0, -1), others)
    edges, nodes = motion.velocities(mesh, False)
    rates = np.array([np.interp([0.0, 1.0, 1.5, 1.2, 1.6, 3.0], mesh.edges, own) for own in edges])
    assert rates == pytest.approx(np.eye(3, 6, 1), abs=1e-12)
    assert nodes[0] == pytest.approx(np.interp(mesh.nodes, [0.0, 1.0, 1.2], [0.0, 1.0, 0.0]), abs=1e-12)


def test_a_leading_breakpoint_is_found_next_to_where_it_was():
    """A gap with a dip passes the front's own value more than once."""
    mesh, tip = Mesh(np.linspace(0.0, 3.0, 31), 8), cb.Parabola(1.0)
    equations = Equations(tip, cb.Gauss(-1.0, 0.7), mesh, ContactCoordinate(tip, 2.0), False)
    fields = replace(equations.fields(np.zeros(mesh.size), -1.0), gap=1.0 + np.sin(2 * np.pi * mesh.nodes))
    motion = Motion(Breakpoint(1.0, 1.0, 10.0, -1, 1.0))
    for place in (0.5, 1.0, 1.5, 2.0, 2.5):
        found = motion.located((equations, fields), {}, np.log(place * 1.05))
        assert found == pytest.approx([np.log(place)], abs=1e-8)


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


def test_a_state_whose_breakpoints_have_left_the_mesh_is_lost():
    """Where it lies cannot be told then, which is no error of whoever asks."""
    mesh, tip = Mesh(EDGES, 10), cb.Parabola(1.0)
    equations = Equations(tip, cb.Gauss(-1.0, 0.7), mesh, ContactCoordinate(tip, 2.0), False)
    problem = ContactProblem(equations, 0.7, Resolution(1e-4, 8), 1.0, Motion(LEAD, (FIRST,)))
    h = 1.0 / (1.0 + mesh.nodes**2)
    assert not problem.lost(np.append(h, [0.0, 0.01]), -1.0)
    assert problem.lost(np.append(h, [0.0, -0.75]), -1.0)
    assert problem.lost(np.append(h, [-3000.0, 0.0]), -1.0)  # nor where the leading one is


def test_panels_are_not_crushed():
    mesh = Mesh(EDGES, 10)
    edges, _ = Motion(LEAD, (FIRST,)).velocities(mesh, False)
    with pytest.raises(cb.ModelError, match="breakpoint"):
        moved_with(mesh, edges, np.array([-0.75]))


def test_rings_cross_a_film_in_a_few_steps():
    """A film that bends upwards at its centre gives way on a ring, which wanders through it, and then on others.

    Every ring takes the curve from one end of the same range of loads to the other.
    """
    contact = cb.Contact(cb.PowerLaw(2.491, 1.0), cb.VanDerWaals(-1.0, 0.0966))
    rows = []

    def progress(share, text):
        if text not in rows[-1:]:  # what was said last is said again now and then, as the clock has it
            rows.append(text)
        if len(rows) > 180:  # behind the third turn
            raise cb.Stop

    diagram = cb.trace(contact, accuracy=1e-4, modes=0, progress=progress)
    first, second, third = list(diagram.folds("load"))[:3]
    assert second.position - first.position < 90
    assert third.position - second.position < 90
    assert first.load == pytest.approx(third.load, rel=1e-4) != second.load


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


def test_a_tangent_on_a_finer_mesh_moves_with_its_breakpoints():
    """Where a steep zone wanders the rate of h at a fixed place is a spike, which nothing but that zone makes."""
    contact = cb.Contact(cb.Parabola(1.0), cb.Layered(1.0, 1.0, 1.0))
    track = FollowedCurves(contact, cb.Axisymmetric()).track(Request(1e-4))
    moving = [point for point in track.points if point.problem.others]
    assert len(moving) > 20
    for point in moving[::10]:
        there = moved(point, point.problem.finer())
        here, metric = settled(there), there.problem.metric(there.x)
        tangents = [(one.tangent_x, one.tangent_parameter) for one in (there, here)]
        lengths = [metric.norm(there.problem, *one) for one in tangents]
        assert metric.dot(there.problem, *tangents[0], *tangents[1]) > 0.999 * lengths[0] * lengths[1]


def test_states_of_a_coarse_table_under_a_cap():
    """Steep zones of a coarse table travel far in a step."""
    gaps = np.linspace(0.0, 8.0, 9) * 0.241
    energies = np.array(cb.VanDerWaals(1.0, 0.241).evaluate(gaps).energy)
    contact = cb.Contact(cb.SphericalCap(3.471), cb.Tabulated(tuple(gaps), tuple(energies)))
    (state,) = (s for s in cb.solve(contact, load=-2.0).states if s.contact_radius > 1.5)
    assert state.displacement == pytest.approx(1.019, abs=1e-3)
    # A Maxwell relation that knows nothing of meshes: dV = F dd, between the two.
    work = cb.solve(contact, displacement=state.displacement + 1e-4).energy - state.energy
    assert work == pytest.approx(1e-4 * -2.0, abs=1e-6)
