"""Laws whose stiffness jumps: panels have an edge where that is, wherever the film ends, and however many there are."""

import numpy as np
import pytest

import contbranch as cb


class Parabolic(cb.Interaction):
    """f = (1 - x/3)² up to x = 3, where f'' jumps."""

    def shape(self, x):
        u = np.maximum(1.0 - x / 3.0, 0.0)
        return u * u, -2.0 / 3.0 * u, 2.0 / 9.0 * (u > 0.0)


class Hat(cb.Interaction):
    """A pressure that grows linearly up to x = 1 and falls to zero at x = 2."""

    def shape(self, x):
        near, rest = x < 1, np.maximum(2 - x, 0.0)
        bends = np.where(near, -1.0, np.where(x < 2, 1.0, 0.0))
        return np.where(near, 1 - x * x / 2, rest**2 / 2), np.where(near, -x, -rest), bends


CONTACTS = {
    # The film comes to the edge of the tip: there were three pull-offs where there is one.
    "at the edge of a cap": cb.Contact(cb.SphericalCap(2.12), Parabolic(1.0, 0.34) + cb.Gauss(-0.144, 0.51)),
    # The first fold is where the kink begins to be felt.
    "at a fold": cb.Contact(cb.SphericalCap(1.63), Parabolic(-1.0, 1.72) + cb.Gauss(0.954, 1.16)),
    "at a fold under a flat tip": cb.Contact(cb.PowerLaw(3.2, 1.0), Parabolic(1.0, 0.18) + cb.Gauss(-0.688, 0.155)),
    "twice": cb.Contact(cb.Parabola(1.0), Parabolic(1.0, 0.33) + Parabolic(0.5, 0.2)),
    "twice, of both signs": cb.Contact(cb.Parabola(1.0), Parabolic(1.0, 0.25) + Parabolic(-0.6, 0.3)),
}


@pytest.mark.parametrize("name", CONTACTS)
def test_events_are_the_same_at_every_accuracy(name):
    coarse, fine = (cb.trace(CONTACTS[name], accuracy=accuracy, max_load=5.0) for accuracy in (1e-5, 1e-7))
    assert coarse.status == fine.status == "complete"
    assert [event.kind for event in coarse.events] == [event.kind for event in fine.events]
    for here, there in zip(coarse.events, fine.events, strict=True):
        for number in ("load", "displacement", "contact_radius", "central_gap"):
            off = abs(getattr(here, number) - getattr(there, number))
            assert off <= 1.5 * (here.error[number] + there.error[number]) or here.kind == "end"


def test_a_sum_whose_other_law_reaches_beyond_the_kink_begins():
    law = Parabolic(1.0, 0.3886397842128926) + cb.Gauss(-0.4628016878024164, 0.21147689626390084)
    diagram = cb.trace(cb.Contact(cb.SphericalCap(1.3525604066483932), law), accuracy=1e-5, max_load=1.0)
    assert diagram.status == "complete"
    assert diagram.events[0].name == "squeeze-out"


def test_a_loop_whose_film_reaches_the_edge_from_its_first_row():
    """States farther away than the first row were sought with that row's front, of which none was given."""
    contact, spring = CONTACTS["at the edge of a cap"], cb.Spring(2.0)
    loop = cb.hysteresis(contact, control=spring, accuracy=1e-4, max_load=4.0)
    assert loop.status == "complete"
    folds = cb.trace(contact, control=spring, accuracy=1e-6, max_load=4.0).folds("spring")
    assert [jump.name for jump in loop.jumps] == ["squeeze-out", "pull-off"]
    for jump, fold in zip(loop.jumps, folds, strict=True):
        assert abs(jump.start.load - fold.load) < 1e-4


def test_a_film_that_is_thinnest_on_a_ring_passes_a_kink_twice():
    """Nodes that the inner place passed gave the load folds of the mesh's own."""
    diagram = cb.trace(cb.Contact(cb.SphericalCap(1.8), Hat(-1.0, 0.9)), accuracy=1e-4, modes=0)
    assert diagram.status == "complete"
    for control in ("load", "displacement"):
        folds = list(diagram.folds(control))
        assert [fold.name for fold in folds] == ["squeeze-out", "wetting"]
        assert max(fold.error[control] for fold in folds) < 1e-4
