"""Symmetry events on lattices and the branches that leave them: the axisymmetric model, theory, refinement."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from grid_indices import morse
from grid_states import Row, traced

import contbranch as cb
from contbranch.curve.outcome import RawEvent
from contbranch.curve.refine import refine
from contbranch.curve.symmetry import SymmetryEvent
from contbranch.curve.track import between
from contbranch.models.grid.angular import angular_content, mode_shape
from contbranch.models.grid.branches import departure
from contbranch.models.grid.equilibria import LatticeProblem
from contbranch.models.grid.lattice import Lattice
from contbranch.models.grid.newton import Hold, newton
from contbranch.models.grid.setup import Setup
from contbranch.models.grid.stability import Stability
from contbranch.models.grid.switching import mirrored, switch
from contbranch.models.grid.transforms import EVEN

# A tip flatter than a parabola: its film is thinnest on a ring, which breaks up.
CONTACT = cb.Contact(cb.PowerLaw(3.5, 1.0), cb.Gauss(-1.0, 0.45))
EDGE = 8.0
ODD, DOUBLE = ("odd", "even"), ("odd", "odd")


class Events:
    """The first symmetry events of the contact's curve on a lattice, and those of the axisymmetric model."""

    def __init__(self, grid: int, count: int) -> None:
        self.curve = traced(CONTACT, 1e-8)
        self.expected = [event for event in self.curve.curve.events if event.kind == "symmetry"][:count]
        self.problem = LatticeProblem(Setup(CONTACT, "free", EDGE, grid), 1e-8)
        self.nodes = self.problem.nodes
        rows = sorted({row for event in self.expected for row in range(event.row, event.row + 2)})
        self.rows = [Row(CONTACT, self.curve, row) for row in rows]
        self.states = [row.on(self.nodes) for row in self.rows]
        points = [self.problem.point(state, (state.u, 0.0)) for state in self.states]
        self.events = []
        for event in self.expected:
            first = rows.index(event.row)
            ends = points[first], points[first + 1]
            way = ends[1].x - ends[0].x, ends[1].parameter - ends[0].parameter
            ends = tuple(replace(end, tangent_x=way[0], tangent_parameter=way[1]) for end in ends)
            passing = SymmetryEvent(event.mode)
            _, near = between(ends, passing)
            found = refine(near, passing, 1e-6)
            raw = RawEvent(**vars(found), kind="symmetry", row=0, mode=event.mode)
            self.events.append((departure(raw), found))


@pytest.fixture(scope="module")
def found() -> Events:
    return Events(64, 2)


def test_waves_are_told_from_each_other():
    """cos mθ and sin mθ in a ring, in the sector that contains them."""
    lattice = Lattice("periodic", 4.0, 64)
    x = lattice.axis
    r, theta = np.hypot(x[:, None], x), np.arctan2(x[None, :], x[:, None])
    ring = np.exp(-(((r - 1.0) / 0.3) ** 2))
    for sector, m, wave in ((EVEN, 4, np.cos), (ODD, 3, np.cos), (("even", "odd"), 5, np.sin), (DOUBLE, 6, np.sin)):
        content = angular_content(lattice, ring * wave(m * theta), ring, sector)
        assert content[m] > 0.99
        assert np.delete(content, m).max() < 0.05
    half = angular_content(lattice, ring * (1.0 + np.sqrt(2.0) * np.cos(2 * theta)), ring, EVEN)
    assert half[[0, 2]] == pytest.approx([0.5, 0.5], abs=1e-2)


@pytest.mark.parametrize("sector", [ODD, ("even", "odd"), DOUBLE])
@pytest.mark.parametrize("kind", ["periodic", "free"])
def test_the_mirror_changes_the_sign_of_what_breaks_it(kind, sector):
    lattice = Lattice(kind, 4.0, 8)
    values = lattice.unfold(np.random.default_rng(1).standard_normal((lattice.size, lattice.size)), sector)
    assert np.array_equal(mirrored(lattice.whole(), values, sector), -values)
    x = lattice.whole().axis
    assert lattice.unfold(np.broadcast_to(lattice.axis[:, None], (lattice.size,) * 2), ODD)[
        : lattice.grid, : lattice.grid
    ] == pytest.approx(np.broadcast_to(x[: lattice.grid, None], (lattice.grid,) * 2))


def test_events_lie_where_the_axisymmetric_model_has_them(found):
    """m = 1 and 2 of a film: load and displacement, the modes, and their shapes.

    On 128² nodes the loads are closer still, by the factor that is checked below.
    """
    for (event, place), expected in zip(found.events, found.expected, strict=True):
        assert place.numbers[:2] == pytest.approx(expected.numbers[:2], rel=2e-5)
        for value, true, error in zip(place.numbers[:2], expected.numbers, place.error, strict=False):
            assert abs(value - true) <= error < 0.01 * value
        shape = found.problem.mode_shape(place.point.x, place.point.parameter, event.mode)
        other = expected.mode_shape
        assert shape.mode == other.mode
        inner = (shape.r > 0.2) & (shape.r < 2.5)
        assert shape.gap[inner] == pytest.approx(np.interp(shape.r[inner], other.r, other.gap), abs=0.02)
        scale = np.abs(other.pressure).max()
        assert shape.pressure[inner] / scale == pytest.approx(
            np.interp(shape.r[inner], other.r, other.pressure) / scale, abs=0.03
        )


def test_modes_are_counted_as_those_of_the_axisymmetric_model(found):
    assert [event.sector for event, _ in found.events] == [ODD, EVEN]
    for row, state in zip(found.rows, found.states, strict=True):
        assert found.problem.modes.symmetric(state) == row.n_0
        assert found.problem.azimuthal(state.u.ravel(), state.load, row.n_0).modes == row.azimuthal


def test_the_eigenvalue_is_zero_at_the_event(found):
    for event, _ in found.events:
        spectrum = Stability(found.nodes).spectrum(event.equilibrium, event.sector, count=2)
        assert np.abs(spectrum.eigenvalues).min() < 1e-6
        shape = mode_shape(found.nodes, event.equilibrium, event.vector, event.sector, event.mode)
        assert np.abs(shape.gap).max() == pytest.approx(1.0)


@pytest.fixture(scope="module")
def switched(found):
    return switch(found.nodes, found.events[0][0])


def test_the_branch_breaks_the_symmetry(found, switched):
    """Asymmetric by 2 ε at ε and more at 2ε, an equilibrium to the solver's tolerance, and its image one too."""
    event, lattice = found.events[0][0], switched.problem.lattice
    assert event.mode == 1
    epsilon = switched.amplitudes[0]
    for factor, state in zip((1, 2), switched.states, strict=True):
        image = mirrored(lattice, state.u, ODD)
        assert state.residual < 1e-8
        assert np.abs(state.u - image).max() == pytest.approx(2 * factor * epsilon, rel=0.2)
        assert np.abs(state.u - mirrored(lattice, state.u, ("even", "odd"))).max() < 1e-9
        assert switched.problem.fields(image, state.load).excess == pytest.approx(0.0, abs=1e-6)
    assert switched.distance == pytest.approx(2 * epsilon, rel=0.2)


def test_the_branch_is_a_pitchfork(found, switched):
    """F - F* ∝ ε², with the same F₂ at a quarter of the amplitude, and the branch inherits what the curve loses.

    The curve is unstable to m = 1 at loads below that of the event, and the branch lies there. It is as stable as the
    curve is above, but for an eigenvalue 0 whose vector is a turn around the axis, since any other orientation will do.
    """
    event = found.events[0][0]
    near = switch(found.nodes, event, 0.25 * switched.amplitudes[0])
    assert near.curvature == pytest.approx(switched.curvature, rel=0.05)
    assert switched.curvature < 0.0
    assert found.states[1].load < event.equilibrium.load < found.states[0].load
    above, below = (morse(found.nodes, state) for state in found.states[:2])
    assert (above.breaking, below.breaking) == (0, 2)
    spectrum = Stability(switched.problem).spectrum(switched.states[1], None)
    turn = int(np.abs(spectrum.eigenvalues).argmin())
    assert abs(spectrum.eigenvalues[turn]) < 1e-4
    others = np.delete(spectrum.eigenvalues, turn)
    assert (others < 0).sum() == above.displacement
    n = switched.problem.lattice.grid
    gap, x = switched.states[1].fields.gap[:n, :n], switched.problem.lattice.axis[:n]
    # The event's state is axisymmetric, but its finite differences are not.
    slope = np.gradient((switched.states[1].u - switched.origin.u)[:n, :n], x, x)
    rotation = x[:, None] * slope[1] - x * slope[0]
    vector = spectrum.vectors[turn][:n, :n]
    close = gap < 1.5
    overlap = np.vdot(vector[close], rotation[close])
    overlap /= np.linalg.norm(vector[close]) * np.linalg.norm(rotation[close])
    assert abs(overlap) > 0.99


def test_the_branch_can_be_followed(switched):
    """Steps along the secant, held across it: the asymmetry grows, as the load falls.

    The mirror that the branch keeps is kept, and it is as unstable as it was, but for the turn around the axis.
    """
    problem, lattice = switched.problem, switched.problem.lattice
    weight = np.abs(switched.origin.fields.stiffness)
    first, last = switched.states
    asymmetry = [2 * switched.amplitudes[0], 2 * switched.amplitudes[1]]
    stability = Stability(problem)
    for _ in range(4):
        step, rise = last.u - first.u, last.load - first.load
        row = weight * step / np.vdot(weight * step, step)
        value = float(np.vdot(row, last.u)) + 1.0
        first, last = last, newton(problem, last.u + step, last.load + rise, Hold(value, 0.0, row))
        assert last.converged
        asymmetry.append(np.abs(last.u - mirrored(lattice, last.u, ODD)).max())
        assert np.abs(last.u - mirrored(lattice, last.u, ("even", "odd"))).max() < 1e-6
        assert last.load < first.load
        index = morse(stability, last)
        assert index.slope > 0.0
        assert (index.spectra[None].eigenvalues < -1e-4).sum() == 1
    assert (np.diff(asymmetry) > 0).all()


def test_refinement_keeps_event_and_branch(found, switched):
    """From 64² to 96² nodes event and F₂ move by what their lattice leaves, and the former closer to the exact ones."""
    fine = Events(96, 1)
    event, expected = fine.events[0][0], fine.expected[0].numbers[0]
    assert abs(event.equilibrium.load - expected) < 0.5 * abs(found.events[0][0].equilibrium.load - expected) + 1e-6
    again = switch(fine.nodes, event, switched.amplitudes[0])
    assert again.distance == pytest.approx(switched.distance, rel=0.01)
    assert again.curvature == pytest.approx(switched.curvature, rel=0.05)


def test_a_mode_with_the_lattices_own_symmetry_is_refused(found):
    with pytest.raises(ValueError, match="mode: 4"):
        switch(found.nodes, found.events[0][0]._replace(sector=EVEN, mode=4))
