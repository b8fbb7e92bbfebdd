"""Laws whose pressure jumps, as nodes can represent them.

The Maugis-Dugdale pressure ends at g = z0 at once, while a node stands for a square over which the gap varies. On a
lattice it ends over a ramp, σ (z0 (1 + δ) - g)/(2 δ z0) for |g - z0| < δ z0, with the work of adhesion unchanged. The
ramp is as steep as the lattice resolves (`resolution`): its stiffness |v''| = |Δγ|/(2 δ z0²) is that of a wave over
eight nodes, so that δ falls in proportion to the spacing.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from contbranch.arrays import Array
from contbranch.contact.interaction_law import terms_of
from contbranch.contact.interactions import Interaction, MaugisDugdale

__all__ = ["RampedDugdale", "has_ramps", "jump_message", "on_lattice", "ramp_errors", "ramp_message"]


# Nodes in the wave that is as stiff as the ramp, and the widest ramp.
WAVE, WIDEST = 8.0, 0.5


@dataclass(frozen=True)
class RampedDugdale(Interaction):
    """A constant pressure that falls to zero over a ramp around g = z0.

    Attributes
    ----------
    ramp
        δ, half the width of the ramp over z0.
    """

    name: ClassVar[str] = "ramped-dugdale"

    ramp: float = WIDEST

    def shape(self, x: Array) -> tuple[Array, Array, Array]:
        """Return f, f' and f''."""
        d = self.ramp
        left = np.clip((1.0 + d - x) / (2.0 * d), 0.0, 1.0)  # of the pressure
        inside = x < 1.0 - d
        energy = np.where(inside, 1.0 - x, d * left * left)
        curvature = np.where((x > 1.0 - d) & (x < 1.0 + d), 0.5 / d, 0.0)
        return energy, -left, curvature

    def reach(self, tolerance: float) -> float:
        """Return the end of the ramp."""
        return self.range * (1.0 + self.ramp)


def on_lattice(law: Interaction | None, spacing: float) -> Interaction | None:
    """The law with ramps in place of jumps of its pressure, for a lattice of a spacing (reduced units, E = 1)."""
    if law is None or not any(isinstance(term, MaugisDugdale) for term in law.terms):
        return law
    terms = [_ramped(term, spacing) if isinstance(term, MaugisDugdale) else term for term in law.terms]
    return sum(terms[1:], terms[0])


def _ramped(term: MaugisDugdale, spacing: float) -> RampedDugdale:
    # |Δγ|/(2 δ z0²) = π/(8 Δ), a little below so that the criterion holds.
    ramp = 1.01 * WAVE * abs(term.work_of_adhesion) * spacing / (2.0 * math.pi * term.range**2)
    return RampedDugdale(term.work_of_adhesion, term.range, min(ramp, WIDEST))


def has_ramps(law: Interaction | None) -> bool:
    """Whether the pressure of a law has kinks where ramps begin and end."""
    return bool(_ramps(law))


def jump_message(law: Interaction | None) -> str:
    """A sentence for laws with attraction that ends at once, empty for others."""
    if not any(term.work_of_adhesion > 0.0 for term in _ramps(law)):
        return ""
    return (
        "The maugis-dugdale attraction ends at once, for nodes over a ramp as steep as the grid resolves: the "
        "curve has many folds of the grid's own and may end early; for a parabola use the exact model, else a "
        "smooth law."
    )


def ramp_message(law: Interaction | None) -> str:
    """A sentence for laws with repulsion alone that ends at once, empty for others."""
    ramps = _ramps(law)
    if not ramps or jump_message(law):
        return ""
    width = 100.0 * max(term.ramp for term in ramps)
    return (
        f"The maugis-dugdale repulsion ends at once, for nodes over a ramp of ±{width:.2g} % of its range: a finer "
        "grid has a steeper one."
    )


def _ramps(law: Interaction | None) -> list[RampedDugdale]:
    return [term for term in terms_of(law) if isinstance(term, RampedDugdale)]


def ramp_errors(law: Interaction | None, gaps: Array, area: float, central_gap: float) -> tuple[float, float]:
    """What ramps add to the load of a state with these gaps at nodes of an area, and by how much they move a film.

    A film whose surfaces lie on the ramp in the middle is there by the ramp: the law itself has them at its end.
    """
    force = length = 0.0
    for term in _ramps(law):
        plain = MaugisDugdale(term.work_of_adhesion, term.range)
        change = term.evaluate(gaps).pressure - plain.evaluate(gaps).pressure
        force += area * float(change.sum())
        if central_gap > 0.0 and abs(central_gap - term.range) <= term.ramp * term.range:
            length = max(length, term.ramp * term.range)
    return abs(force), length
