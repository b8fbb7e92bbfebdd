"""States with regions: functions of a state whatever its mesh, and meshes with edges of regions among their own."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from contbranch.arrays import Array, magnitude
from contbranch.contact.interaction_law import terms_of

from .breakpoints import CROSSING, LIFTED, RESTING, Breakpoint, Motion
from .equations import Equations, Fields
from .layout import Region

__all__ = ["Functions", "laid_edges", "led_by"]

# Panels next to an edge of regions are this share of the way to the next one, and each farther away is longer by no
# more than this factor; ends of panels of another mesh are kept where they are this share of the way from the others.
BESIDE_EDGE, GROWTH, APART = 0.4, 4.0, 0.3


@dataclass(frozen=True)
class Functions:
    """A state as functions of the radius."""

    equations: Equations
    fields: Fields

    @property
    def ends(self) -> Array:
        """Radii at which panels end."""
        return np.asarray(np.hypot(self.equations.mesh.edges, self.fields.rim.radius))

    @property
    def central_gap(self) -> float:
        """Gap in the middle."""
        return self.equations.central_gap(self.fields)

    def transformed(self, t: Array) -> Array:
        """h(t): outside of the central disc as the mesh has it, inside d + level − ζ(t)."""
        a, equations = self.fields.rim.radius, self.equations
        found = equations.mesh.interpolate(self.fields.h, np.sqrt(np.maximum(t * t - a * a, 0.0)))
        if a > 0.0:
            inside = equations.displacement(self.fields) + equations.rest - equations.tip.transform(np.minimum(t, a))
            found = np.where(t < a, inside, found)
        return found

    def pressure(self, r: Array) -> Array:
        """Total pressure."""
        a = self.fields.rim.radius
        found = self.equations.mesh.interpolate(self.fields.pressure, np.sqrt(np.maximum(r * r - a * a, 0.0)))
        inside = r < a
        if inside.any():
            found[inside] = self.equations.inner_pressure(self.fields, r[inside])
        return found


def laid_edges(roots: Array, ends: Array, bounded: bool, end: float | None = None) -> Array:
    """Edges of panels with roots among them, and the ends of panels of another mesh where these are not close.

    Parameters
    ----------
    bounded : bool
        Whether the last root is where the mesh ends.
    end : float, optional
        Where it ends otherwise.
    """
    knots = np.append(0.0, roots)
    room = np.diff(knots)
    near = BESIDE_EDGE * np.minimum(room, np.append(room[1:], np.inf))
    last = float(roots[-1]) if bounded else end or max(float(ends[-1]), 2.0 * float(roots[-1]))
    ranges = [*zip(knots[:-1], roots, strict=True), *([] if bounded else [(float(roots[-1]), last)])]
    edges = [*knots, last]
    for k, (low, high) in enumerate(ranges):
        middle = (low + high) / 2 if k < len(roots) else high
        steps = [low + near[k - 1] * GROWTH ** np.arange(60)] if k else []
        steps += [high - near[k] * GROWTH ** np.arange(60)] if k < len(roots) else []
        graded = np.concatenate(steps)
        beyond = np.abs(graded - (low if k else high)) if len(steps) == 1 else np.minimum(graded - low, high - graded)
        limit = middle - low if k < len(roots) else high - low
        own = graded[(graded > low) & (graded < high) & (beyond <= limit)]
        first, final = (low + near[k - 1] if k else low), (high - near[k] if k < len(roots) else high)
        for end in ends[(ends > first) & (ends < final)]:
            others = np.concatenate([[low, high], own])
            beside = min(end - low if k else np.inf, high - end if k < len(roots) else np.inf)
            if np.abs(others - end).min() > APART * beside:
                own = np.append(own, end)
        edges += own.tolist() if own.size else [middle]
    return np.unique(edges)


def led_by(equations: Equations, fields: Fields, edge: Breakpoint | None = None) -> Motion | None:
    """With what a mesh with regions moves: the edge of the tip, or the outermost of theirs, leads it."""
    mesh, law = equations.mesh, equations.law
    if not mesh.roots:
        return Motion(edge) if edge else None
    scale = min((term.range for term in terms_of(equations.interaction)), default=1.0)
    # Where only a tiny disc is felt its radius counts all the same, or nothing would tell whether it is found.
    weight = max(float(mesh.weights @ fields.h**2), (LIFTED * scale) ** 2 * equations.tip.radius_at(scale))
    pressure = max(magnitude(fields.pressure), 1.0 / scale)
    regions: Sequence[Region] = [*equations.regions, Region(False, law.outermost)]
    found: list[Breakpoint] = []
    for k, place in reversed(list(enumerate(mesh.edges[list(mesh.roots)].tolist()))):
        inner, outer = regions[k : k + 2]
        if inner.rests or outer.rests:
            side = -1 if inner.rests else 1
            one = Breakpoint(place, pressure, pressure, RESTING - k, weight / place**2, side, True)
        else:
            gap = law.levels[max(inner.index, outer.index)]
            key = equations.kinks.index(gap)
            while key in [other.key for other in found]:  # farther in, at another place
                key += CROSSING
            one = Breakpoint(place, gap, scale / place, key, weight / place**2, 0, True)
        found.append(one)
    if edge:
        return Motion(edge, tuple(found))
    return Motion(replace(found[0], weight=weight), tuple(found[1:]))
