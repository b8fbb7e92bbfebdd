"""States with rings: azimuthal modes, relaxations, sensitivities and followed events, as for discs."""

from __future__ import annotations

import numpy as np
import pytest
from ring_kernel import Rings

import contbranch as cb
from contbranch.contact.parameters import parameters_of
from contbranch.control import DISPLACEMENT, LOAD
from contbranch.curve.curves import FollowedCurves
from contbranch.curve.trace import Request, trace
from contbranch.curve.track import Track
from contbranch.models.axisymmetric import Axisymmetric
from contbranch.models.axisymmetric.azimuthal import eigenvalues, mode_shape
from contbranch.models.axisymmetric.modal import _radii, inner_plane, outer_plane
from contbranch.models.axisymmetric.regions import radii_of

BLUNT = cb.Contact(cb.PowerLaw(6.0, 1.0), cb.Exponential(-1.0, 1.0) + cb.Gauss(-0.3, 0.3))
"""Squeezed out on a ring at first; both folds of the film in the middle have a ring around them."""

FILM = cb.Contact(cb.PowerLaw(4.0, 1.0), cb.Exponential(-1.0, 1.0))
STEP = cb.Contact.reduced(cb.MaugisDugdale, tabor=1.0, sign=-1)


@pytest.fixture(scope="module")
def blunt() -> Track:
    """Rows, the film in the middle lost and found among them."""
    return trace(Axisymmetric().problem(BLUNT.to_reduced(), 1e-7), Request(1e-7, modes=0))


@pytest.fixture(scope="module")
def diagram() -> cb.Diagram:
    return cb.trace(BLUNT)


def annular(track: Track) -> list[int]:
    """Rows with a ring of contact around a film."""
    return [
        k for k, point in enumerate(track.points) if track.problem(k).mesh.roots and point.observables["central_gap"]
    ]


# -- an independent discretisation: rings of pressure, see `ring_kernel` -----------------------------------------------
def rings_between(inner: float, outer: float, resting: bool) -> Rings:
    """Rings in the angle, r² = mean − half cos; nodal values of what rests are the pressure times its sine."""
    ends = 0.5 * 0.3 ** np.arange(3, 0, -1)
    edges = np.pi * np.concatenate([[0.0], ends, [0.5], 1 - ends[::-1], [1.0]])
    mean, half = (outer**2 + inner**2) / 2, (outer**2 - inner**2) / 2
    return Rings(
        edges,
        lambda s: np.sqrt(mean - half * np.cos(s)),
        lambda s: np.full_like(s, half) if resting else half * np.sin(s),
    )


def rings_within(radius: float) -> Rings:
    """Rings of a disc that floats."""
    edges = np.array([0.0, 0.1, 0.3, 0.6, 0.85, 0.95, 1.0])
    return Rings(edges, lambda s: radius * np.sqrt(np.maximum(1 - s * s, 0.0)), lambda s: radius**2 * s)


def rings_beyond(radius: float, end: float) -> Rings:
    """Rings up to a radius."""
    last = np.sqrt(end**2 - radius**2)
    edges = radius * 0.05 * 3.0 ** np.arange(12)
    edges = np.concatenate([[0.0], edges[edges < 0.9 * last], [last]])
    return Rings(edges, lambda s: np.hypot(radius, s), lambda s: s)


def lifted(m: int, source: Rings, target: Rings) -> np.ndarray:
    """Displacement by the pressure of some rings at others."""
    if source is target:
        return source.compliance(m, source.r, source.s, 0.0)
    ends = sorted(source.edges[[0, -1]], key=lambda s: float(source.radius(np.array(s))))
    return source.compliance(m, target.r, None, float(ends[int(target.r.min() > source.r.max())]))


@pytest.mark.parametrize("share", [0.0, 0.5, 0.8])
def test_eigenvalues_around_an_annulus_agree_with_rings_of_pressure(blunt, share):
    """Variations vanish on the annulus: their h has logarithms there, which polynomials resolve to 1e-5."""
    rows = annular(blunt)
    row = rows[int(share * len(rows))]
    point = blunt.points[row]
    equations, fields = blunt.problem(row).seen(point.x, point.parameter)
    inner, outer = radii_of(equations, fields)
    annulus, end = rings_between(inner, outer, True), float(equations.mesh.end)
    free = [rings_within(inner), rings_beyond(outer, end)]
    k = np.concatenate([equations.law.evaluate(0, equations.mesh.interpolate(fields.gap, f.r)).stiffness for f in free])
    for m in (1, 2, 4):
        contact, back = lifted(m, annulus, annulus), np.hstack([lifted(m, f, annulus) for f in free])
        matrix = np.block([[lifted(m, f, g) for f in free] for g in free])
        matrix -= np.vstack([lifted(m, annulus, f) for f in free]) @ np.linalg.solve(contact, back)
        expected = np.sort(np.linalg.eigvals(-matrix * k).real)[::-1][:2]
        found = eigenvalues(equations, fields, m, 2)
        assert found == pytest.approx(expected, abs=3e-5)
        assert blunt.problem(row).azimuthal(point.x, point.parameter, 1).of(m) == (expected > 1.0).sum()


def test_abel_integrals_across_roots(blunt):
    """A_m of the moments t^m vanishes nowhere: (2/π) ∫ (t/r)^m t^m/√(r² − t²) dt = r^m (2/π) ∫ sin^2m."""
    row = annular(blunt)[4]
    mesh = blunt.problem(row).mesh
    t = mesh.nodes
    for m in (0, 1, 3):
        inner = np.zeros(mesh.rule.even_order)
        basis = mesh.rule.to_even @ (t[: mesh.order] / mesh.innermost) ** (m - m % 2)
        inner += basis * mesh.innermost**m
        rho, _ = _radii(mesh)
        gap = inner_plane(mesh, 0.0, rho, m) @ inner + outer_plane(mesh, 0.0, m) @ t[mesh.order :] ** m
        wallis = np.prod([(2 * k - 1) / (2 * k) for k in range(1, m + 1)]) if m else 1.0
        assert gap == pytest.approx(wallis * rho**m, rel=1e-10)


def test_symmetry_is_lost_and_the_ring_restores_it(diagram):
    """A ring, however narrow, keeps what tilts and bends the film on it from moving."""
    assert diagram.status == "complete"
    lost = [event for event in diagram.events if event.kind == "symmetry"]
    assert ["regained" in event.message for event in lost] == [False, False, True, True]
    (touched,) = [event for event in diagram.events if event.kind == "topology" and event.central_gap > 0.0]
    assert [event.load for event in lost[2:]] == pytest.approx([touched.load] * 2, abs=1e-6)


def test_modes_press_where_the_gap_rests(blunt):
    """Their gap vanishes on the annulus, and not their pressure."""
    row = annular(blunt)[10]
    point = blunt.points[row]
    equations, fields = blunt.problem(row).seen(point.x, point.parameter)
    inner, outer = radii_of(equations, fields)
    shape = mode_shape(equations, fields, 2)
    on = (shape.r > inner) & (shape.r < outer)
    assert np.abs(shape.gap[on]).max() < 1e-2  # the most at its edges
    assert np.abs(shape.gap).max() == pytest.approx(1.0)
    assert np.isfinite(shape.pressure).all()
    assert (shape.pressure[on] != 0.0).any()


@pytest.mark.parametrize("control", [LOAD, DISPLACEMENT])
def test_relaxation_passes_and_reaches_rings(control):
    """It tells the state that energies say must be reached, among others that are stable, too."""
    route = FollowedCurves(BLUNT, cb.Axisymmetric()).path(Request(1e-3, control))
    walk, jumps = route.walk, route.jumps
    assert len(jumps) == 4
    for jump in jumps:
        others = [other.end for other in jumps if other is not jump]
        assert walk.relaxed(jump.begin, [*others, jump.end], jump.direction) is jump.end
    assert walk.assumed == []


def test_sensitivities_with_rings_are_differences_of_traces():
    contact, name, threshold = STEP, "range", "touch_load"
    found = cb.trace(contact, modes=0).sensitivities[threshold][name]
    parameter, step = parameters_of(contact)[name], 2e-3
    above, below = (
        cb.trace(parameter.contact(parameter.value * (1 + h)), accuracy=1e-7, modes=0, max_load=18.0).thresholds
        for h in (step, -step)
    )
    expected = (above[threshold] - below[threshold]) / (2 * step * parameter.value)
    assert found == pytest.approx(expected, rel=5e-5)


@pytest.mark.parametrize(
    ("contact", "vary", "to", "member"),
    [
        (FILM, "interaction.range", 0.8, lambda q: cb.Contact(FILM.tip, cb.Exponential(-1.0, q))),
    ],
)
def test_changes_of_the_contact_set_are_followed(contact, vary, to, member):
    begin, end = (
        [event for event in cb.trace(c, accuracy=1e-7, modes=0).events if event.kind in ("topology", "touch")]
        for c in (contact, member(to))
    )
    assert len(begin) == len(end) == 2
    for event, expected in zip(begin, end, strict=True):
        found = cb.follow(event, vary, to=to)
        assert found.status == "complete"
        for key in ("load", "displacement", "contact_radius", "central_gap"):
            assert found.curve[key][-1] == pytest.approx(getattr(expected, key), abs=2e-6)


def test_folds_with_a_ring_merge_in_a_cusp(diagram):
    """Followed to where both folds of the film in the middle merge, one comes back as the other."""
    folds = [e for e in diagram.folds("load") if e.contact_radius > 0.0 and 0.0 < e.central_gap < 0.2]
    one, other = sorted(folds, key=lambda event: event.load)
    found = cb.follow(other, "interaction[1].range", to=0.32)
    assert [special.kind for special in found.special] == ["cusp"]
    assert found.curve["load"][-1] == pytest.approx(one.load, abs=1e-5)
    assert found.curve["displacement"][-1] == pytest.approx(one.displacement, abs=1e-5)
