"""Whole contacts drawn at random: complete, and their curves obey what every curve must obey."""

from __future__ import annotations

import sys
import warnings
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest

import contbranch as cb
from contbranch.curve import curves

ROOT = Path(__file__).parents[1]
if str(ROOT) not in sys.path:
    sys.path.append(str(ROOT))  # the scripts in studies/ are not installed

from studies import random_contacts  # noqa: E402

SEED = 3
# Every control and accuracy, and of tips and laws those that are not below; films that reach an edge.
NUMBERS = (10, 11, 36, 60, 94, 103, 117)


# A table that scatters, a law with a kink on a parabola, a stiff film that rounding changes more than a tiny contact
# does, a soft film of a pressure with a kink, a table through whose logarithms splines would swing.
OTHERS = ((6, 51), (22, 55), (101, 3), (104, 13), (516, 7), (6034, 37))
# Of curves and their folds alone: azimuthal modes are counted in the others.
WITHOUT_MODES = {(seed, number) for seed, number in OTHERS if seed > 500}


@pytest.fixture(autouse=True)
def _followed_once(monkeypatch):
    """Where work is integrated along a curve it is the one traced, not the same followed anew."""
    read, followed = curves.raw_curve, []

    def kept(track, request):
        followed.append(track)
        return read(track, request)

    monkeypatch.setattr(curves, "raw_curve", kept)
    monkeypatch.setattr(random_contacts, "_track", lambda contact, request: followed[-1])


@pytest.mark.parametrize(("seed", "number"), [*((SEED, number) for number in NUMBERS), *OTHERS])
def test_contact(seed, number):
    drawn = random_contacts.draw(seed, number)
    modes = {"modes": 0} if (seed, number) in WITHOUT_MODES else {}
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        diagram = cb.trace(drawn.contact, **drawn.asked, **modes)
    assert diagram.status == "complete", f"{drawn.words}: {diagram.message}"
    assert not list(random_contacts.violations(diagram)), drawn.words


def test_first_contacts_in_a_soft_film_under_a_flat_tip():
    """They are hardly told from noise: events against those asked for finer."""
    drawn = random_contacts.draw(9924, 42)
    diagram, finer = (cb.trace(drawn.contact, accuracy=accuracy) for accuracy in (1e-4, 1e-8))
    assert (diagram.status, finer.status) == ("complete", "complete")
    for one, other in zip(diagram.events, finer.events, strict=True):
        assert (one.kind, one.control) == (other.kind, other.control)
        assert abs(one.load - other.load) <= one.error["load"] + other.error["load"]
        assert abs(one.displacement - other.displacement) <= one.error["displacement"] + other.error["displacement"]


def test_events_of_a_law_with_a_kink_are_those_of_a_finer_trace():
    """A law with a kink, to which the first rows of a curve followed to 1e-4 are blind."""
    drawn = random_contacts.draw(9904, 15)
    diagram, finer = (cb.trace(drawn.contact, **{**drawn.asked, "accuracy": accuracy}) for accuracy in (1e-4, 1e-8))
    assert (diagram.status, finer.status) == ("complete", "complete")
    for one, other in zip(diagram.events, finer.events, strict=True):
        assert (one.kind, one.control) == (other.kind, other.control)
        assert abs(one.load - other.load) <= one.error["load"] + other.error["load"]
        assert abs(one.displacement - other.displacement) <= one.error["displacement"] + other.error["displacement"]


def test_rows_of_a_path_do_not_show_every_piece_of_a_table():
    drawn = random_contacts.draw(8103, 49)
    loop = cb.hysteresis(drawn.contact, **drawn.asked)
    assert (loop.status, loop.jumps) == ("complete", ())
    assert "reversible" in loop.message


def test_two_meshes_may_agree_by_chance_on_a_table():
    """A parabola in so soft a film touches where load is all but least: it cannot touch at less."""
    drawn = random_contacts.draw(3724, 3)
    diagram = cb.trace(drawn.contact, **drawn.asked)
    (fold,) = diagram.folds("load")
    touch = next(event for event in diagram.events if event.kind == "touch")
    assert touch.load >= fold.load - fold.error["load"] - touch.error["load"]
    assert touch.load - fold.load < 1e-7


@pytest.mark.parametrize(
    ("rows", "heights", "law", "accuracy"),
    [
        (20, lambda r: 2 * (np.sqrt(1 + r * r / 4) - 1), cb.Exponential(-1.0, 0.3305528), 1e-8),
        (30, lambda r: np.sqrt(1 + r * r) - 1, cb.Exponential(1.0, 1.1123987), 1e-7),
        (30, lambda r: 2 * (np.sqrt(1 + r * r / 4) - 1), cb.Gauss(-1.0, 1.6869938), 1e-7),
    ],
)
def test_two_meshes_may_agree_by_chance_under_a_table_of_heights(rows, heights, law, accuracy):
    """Events against those asked for finer: 2 to 5 of their stated errors off, unless an agreement is confirmed."""
    radii = np.linspace(0.0, 8.0, rows)
    contact = cb.Contact(cb.Profile(tuple(radii.tolist()), tuple(heights(radii).tolist())), law)
    diagram, finer = (cb.trace(contact, accuracy=share, modes=0) for share in (accuracy, 1e-10))
    assert (diagram.status, finer.status) == ("complete", "complete")
    for one, other in zip(diagram.events[:-1], finer.events[:-1], strict=True):  # all but the end, which goes with them
        assert (one.kind, one.control) == (other.kind, other.control)
        for name in ("load", "displacement"):
            assert abs(getattr(one, name) - getattr(other, name)) <= one.error[name] + other.error[name]


class Cut(cb.Interaction):
    """(1 − x/3)³ as far as x = 3, where the third derivative jumps."""

    name = "cut"

    def shape(self, x):
        u = np.maximum(1.0 - x / 3.0, 0.0)
        return u**3, -(u**2), u * (2.0 / 3.0)


@dataclass(frozen=True)
class Blunt(cb.Tip):
    """A parabola as far as its curvature jumps to none, at `turn`, and the cone that touches it there."""

    radius: float
    turn: float
    steep: float = 1.0
    name = "blunt"

    @property
    def natural_length(self):
        return self.radius / self.steep

    def height(self, r):
        near, b = np.minimum(r, self.turn), self.turn
        return self.steep / self.radius * (near**2 / 2 + np.maximum(np.asarray(r) - b, 0.0) * b)

    def height_derivative(self, r):
        return self.steep / self.radius * np.minimum(r, self.turn)

    def transform(self, t):
        b, far = self.turn, np.maximum(t, self.turn)
        outside = far * (far - np.sqrt(far**2 - b**2)) + b * far * np.arccos(b / far)
        return self.steep / self.radius * np.where(np.asarray(t) < b, np.asarray(t) ** 2, outside)

    def transform_derivative(self, t):
        b, far = self.turn, np.maximum(t, self.turn)
        outside = 2 * far - 2 * np.sqrt(far**2 - b**2) + b * np.arccos(b / far)
        return self.steep / self.radius * np.where(np.asarray(t) < b, 2 * np.asarray(t), outside)

    def scaled(self, in_plane, normal):
        return Blunt(self.radius / in_plane, self.turn / in_plane, self.steep * in_plane / normal)


@pytest.mark.parametrize(
    ("contact", "accuracies", "fine"),
    [
        (
            cb.Contact(cb.PowerLaw(2.7407530850, 2.7558872897), Cut(1.6861154529, 1.9703581936), 0.44001989),
            (1e-7, 5e-9, 3e-9),
            3e-10,
        ),
        (cb.Contact(Blunt(1.0, 0.3), cb.VanDerWaals(1.0, 0.3)), (1e-6,), 1e-7),
    ],
)
def test_meshes_may_agree_by_chance_where_a_law_or_tip_of_the_users_is_not_smooth(contact, accuracies, fine):
    """A jump right beside an edge of panels is seen by no mesh with that edge: up to 200 stated errors off."""
    finer = cb.trace(contact, accuracy=fine, modes=0)
    for accuracy in accuracies:
        diagram = cb.trace(contact, accuracy=accuracy, modes=0)
        assert diagram.status == "complete" or (accuracy < 1e-8 and "times the accuracy asked" in diagram.message)
        for one, other in zip(diagram.events[:-1], finer.events[:-1], strict=True):
            assert (one.kind, one.control) == (other.kind, other.control)
            for name in ("load", "displacement"):
                assert abs(getattr(one, name) - getattr(other, name)) <= one.error[name] + other.error[name]


def test_draws_repeat_themselves():
    one, other = (random_contacts.draw(SEED, 7) for _ in range(2))
    assert one == other
    assert random_contacts.draw(SEED + 1, 7) != one


def test_a_broken_invariant_is_seen():
    """A curve whose energies, or whose loads, are not those of its states."""
    from dataclasses import replace

    diagram = cb.trace(cb.Contact.reduced(cb.Exponential, 1.0))
    branch, folds = diagram.branches[0], list(diagram.folds())
    middle = int(folds[-2].position + folds[-1].position) // 2  # next to events little is asked
    for name in ("energy", "load"):
        values = getattr(branch, name).copy()
        values[middle:] += 0.5
        broken = replace(diagram, branches=(replace(branch, **{name: values}),))
        assert any("dV" in text or "turns" in text for text in random_contacts.violations(broken))
