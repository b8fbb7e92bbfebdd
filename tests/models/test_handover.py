"""Discs of contact are handed to free boundaries and back: both models tell one curve, and neither is turned round."""

import numpy as np
import pytest
from scipy.integrate import quad

import contbranch as cb
from contbranch.errors import ModelError
from contbranch.models.axisymmetric import problem
from contbranch.models.axisymmetric.problem import ContactProblem
from contbranch.models.quadrature import peak_pressure
from contbranch.models.rings import changes
from contbranch.models.rings.meshing import pieces
from contbranch.models.rings.panels import Grid
from contbranch.models.rings.problem import RingProblem

# A film that is squeezed out on a ring, which closes to a disc.
CONTACT = cb.Contact(cb.PowerLaw(3.5, 1.0), cb.Exponential(-1.0, 8.0), 1.0)


def unheld(points):
    raise ModelError("rings are left to the model with free boundaries")


@pytest.fixture(scope="module", autouse=True)
def free_boundaries():
    """Rings by the model with free boundaries, which takes over where a disc cannot be followed otherwise."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(problem, "born", unheld)
        yield


@pytest.fixture(scope="module")
def diagram(free_boundaries):
    return cb.trace(CONTACT, accuracy=1e-5, max_load=8.0, modes=0)


def by(event):
    return type(event.origin.raw.point.problem)


def test_a_ring_closes_to_the_same_disc_in_both_models(diagram, monkeypatch):
    monkeypatch.setattr(changes, "handed", lambda point: None)
    free = cb.trace(CONTACT, accuracy=1e-5, max_load=8.0, modes=0)
    assert diagram.status == "complete", diagram.message
    first, closing = (event for event in diagram.events if event.kind == "topology")
    assert (by(first), by(closing), by(diagram.events[-1])) == (RingProblem, ContactProblem, ContactProblem)
    assert by(free.events[-1]) is RingProblem
    assert "closes to a disc" in closing.message
    for one, other in zip(diagram.events, free.events, strict=True):
        assert (one.kind, one.control) == (other.kind, other.control)
        for name in ("load", "displacement", "contact_radius", "central_gap"):
            allowed = one.error[name] + other.error[name]
            assert abs(getattr(one, name) - getattr(other, name)) <= allowed, (one.kind, name)
    end = diagram.branches[0].unstable_displacement[-1], free.branches[0].unstable_displacement[-1]
    assert end[0] == end[1]


def test_the_pressure_in_the_middle_of_a_disc_without_interaction():
    """π p(0) = ∫ ζ'/t dt, for z = rⁿ/n with ζ' ∝ tⁿ⁻¹, and for a sphere."""
    for tip, a in ((cb.PowerLaw(3.3, 1.0), 0.7), (cb.PowerLaw(1.4, 1.0), 0.7), (cb.SphericalCap(2.0), 1.1)):
        reduced = cb.Contact(tip, cb.Gauss(1.0, 1.0), 1.0).to_reduced().axisymmetric_tip
        whole, _ = quad(lambda t, tip=reduced: float(tip.transform_derivative(t)) / t, 0.0, a, epsabs=1e-13)
        assert peak_pressure(reduced, a) == pytest.approx(whole / np.pi, rel=1e-10)


def test_no_front_where_the_gap_falls(diagram):
    """A front that wandered over the thinnest place of a film would turn its curve round."""
    point = next(event for event in diagram.events if event.kind == "topology").origin.raw.point
    problem = point.problem
    fields = problem.fields(point.x, point.parameter)
    grid, thinnest = fields.grid, float(fields.grid.r[fields.gap.argmin()])

    def with_front_at(radius):
        level = float(np.interp(radius, grid.r, fields.gap))
        anchors = np.append(grid.edges, radius)
        panels = pieces(anchors, problem.panels, grid, problem.layout.bounded, level)
        r = Grid(panels, anchors, problem.layout.bounded).r
        x = np.concatenate([grid.interpolate(fields.pressure, r), anchors])
        return problem.on(panels).fields(x, point.parameter)

    assert with_front_at(1.5 * thinnest).gap.min() == pytest.approx(fields.gap.min(), abs=1e-4)
    with pytest.raises(ModelError, match="does not rise at the front"):
        with_front_at(0.7 * thinnest)


def test_a_load_that_turns_where_a_ring_opens_turns_there():
    """Load and displacement rest at the opening of a ring: the fold in that corner is the event of the opening."""
    law = cb.Exponential(-0.709, 4.070950854001363) + cb.InverseSquare(0.291, 4.51061354623351)
    contact = cb.Contact(cb.PowerLaw(4.774, 1.0), law)
    soft = cb.Spring(0.05)  # whose fold is there, too
    coarse, fine = (cb.trace(contact, soft, accuracy=accuracy, max_load=2.0, modes=0) for accuracy in (1e-4, 1e-6))
    for diagram in (coarse, fine):
        branch = diagram.branches[0]
        assert diagram.status == "complete"
        opening = next(event for event in diagram.events if event.kind == "topology")
        sprung, fold = (event for event in diagram.events if event.name == "wetting")
        assert (sprung.control, fold.control) == ("spring", "load")
        assert (fold.load, fold.displacement) == (opening.load, opening.displacement)
        assert (sprung.load, sprung.displacement) == (opening.load, opening.displacement)
        assert opening.load <= branch.load[branch.contact_radius > 0.0].min() + fold.error["load"]
    assert abs(coarse.thresholds["wetting_load"] - fine.thresholds["wetting_load"]) <= 3e-7 + 3e-9
