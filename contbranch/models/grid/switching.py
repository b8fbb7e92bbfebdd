"""Branches of less symmetry that leave a curve where an eigenvalue passes zero, and the symmetry that they keep.

At a symmetry event the variation φ neither carries a load nor can be told from -φ by the state, which one of its
symmetries maps to the other. So the new branch is a pitchfork: with the amplitude ε,

    u = u* + ε φ + O(ε²),      F = F* + F₂ ε² + O(ε⁴).

Its states are found on the whole lattice, at given ε: ``row · (u - u*) = ε`` with row = K φ/(φ·K φ), the pressure of φ.
The symmetric curve has ε = 0. Around an axis the branch is a whole family, turned against each other, and an eigenvalue
of its states is all but zero, that of the turn; the state with a mirror of the lattice is found, since nothing in the
iteration breaks that.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from contbranch.arrays import Array, Flags

from .lattice import Lattice
from .newton import Equilibrium, Hold, Settings, newton
from .problem import GridProblem
from .stability import ZERO, Sector, Spectrum
from .transforms import EVEN

__all__ = [
    "Departure",
    "Image",
    "Switched",
    "has_symmetry",
    "kept_symmetry",
    "lacking",
    "mirrored",
    "switch",
    "whole_problem",
]

# The image of a field of the whole lattice.
Image = Callable[[Array], Array]

# Eigenvalue of the turn around the axis at most: zero, but for the lattice.
TURN = 0.02


# Amplitude, relative to the length over which the interaction decays.
AMPLITUDE = 0.03
# Factor of it with a contact, where an eigenvalue jumps as that changes by a node: many have to change.
MANY = 4.0
# Amplitudes are halved so often until both states are found, and the load changes like that of a pitchfork.
HALVINGS = 4
# How far F₂ from the first state may be from the extrapolated one, relative.
SHARE = 0.2
SETTINGS = Settings(tolerance=1e-9, steps=20)


class Departure(NamedTuple):
    """Where a branch leaves: the state, its variation φ on a quarter of the lattice with its sector, and its mode."""

    equilibrium: Equilibrium
    sector: Sector
    mode: int
    vector: Array


@dataclass(frozen=True)
class Switched:
    """Two states of a branch of less symmetry, from which it can be followed.

    Attributes
    ----------
    problem : GridProblem
        On the whole lattice.
    origin : Equilibrium
        The event's state there.
    amplitudes : (float, float)
        ε and 2ε.
    states : (Equilibrium, Equilibrium)
        In that order, away from the event; those at -ε are their images under the symmetry that is broken.
    curvature : float
        F₂, extrapolated from both states to ε = 0.
    distance : float
        Of the first state from its image under the symmetry: the largest difference of gaps. It is 0 on the symmetric
        curve and, for small ε, 2 ε on the new one.
    sector : (str, str)
        Of φ.
    """

    problem: GridProblem
    origin: Equilibrium
    amplitudes: tuple[float, float]
    states: tuple[Equilibrium, Equilibrium]
    curvature: float
    distance: float
    sector: Sector


def whole_problem(problem: GridProblem) -> GridProblem:
    """The same problem without symmetry; work is counted with that of the given one."""
    lattice = problem.lattice
    return GridProblem(lattice.whole(), lattice.unfold(problem.heights), problem.law, problem.threads, problem.counter)


def mirrored(lattice: Lattice, values: Array, sector: Sector) -> Array:
    """The image of a field of the whole lattice under the symmetry that variations of a sector break.

    That is the mirror that changes the sign of x (or of y, if variations are odd in y alone); for variations that are
    even in both, the exchange of x and y.
    """
    if sector == EVEN:
        return np.ascontiguousarray(values.T)
    axis = 0 if sector[0] == "odd" else 1
    # The mirror maps node i of the cell to N - 1 - i, and the padding of the cyclic array to itself.
    return np.roll(np.flip(values, axis), lattice.inside - lattice.size, axis)


def switch(problem: GridProblem, event: Departure, amplitude: float | None = None) -> Switched | None:
    """Two states of the branch that leaves the curve at a symmetry event; None if they are not found.

    Parameters
    ----------
    problem : GridProblem
        In which the event was found, on a quarter of the lattice.
    event : Departure
    amplitude : float, optional
        ε, largest change of the gap at the first state, in units of length; default: from the interaction. It is halved
        where the states are not found, or are not those of a pitchfork.

    Raises
    ------
    ValueError
        If the event's variation cannot be told from its opposite by a symmetry of the lattice (cos 4θ, for instance).
    """
    sector = event.sector
    if sector == EVEN and event.mode % 4 == 0:
        raise ValueError(f"mode: {event.mode}; the lattice has no symmetry that it breaks")
    lattice = problem.lattice
    whole = whole_problem(problem)
    vector = event.vector / event.vector.flat[np.argmax(np.abs(event.vector))]
    if sector == EVEN:
        vector = 0.5 * (vector - vector.T)
    direction = lattice.unfold(vector, sector)
    state = event.equilibrium
    origin = newton(
        whole,
        lattice.unfold(state.u),
        state.load,
        Hold(state.load),
        lattice.unfold(state.contact.astype(np.float64)) > 0.5,
        Settings(tolerance=max(SETTINGS.tolerance, 2.0 * state.residual), steps=0),
    )
    touching = bool(origin.contact.any())
    epsilon = amplitude if amplitude is not None else _amplitude(origin) * (MANY if touching else 1.0)
    best: Switched | None = None
    for _ in range(HALVINGS + 1):
        found = _pair(whole, origin, direction, epsilon, event)
        best = found or best
        if found is not None and (touching or abs(_near(found) - found.curvature) <= SHARE * abs(found.curvature)):
            break
        epsilon *= 0.5
    return best


def _pair(
    problem: GridProblem, origin: Equilibrium, direction: Array, epsilon: float, event: Departure
) -> Switched | None:
    """States at ε and 2ε, if there are, and are not the symmetric ones."""
    sector = event.sector
    row = _row(origin, direction)
    start = origin.u + epsilon * direction
    first = newton(problem, start, origin.load, _hold(origin, row, epsilon), settings=SETTINGS)
    if not first.converged:
        return None
    # u - u* = ε φ + ε² ψ: what φ is not, at ε, counts four times at 2ε.
    image = mirrored(problem.lattice, first.u, sector)
    odd, even = 0.5 * (first.u - image), 0.5 * (first.u + image) - origin.u
    distance = 2.0 * np.abs(odd).max()
    rise = first.load - origin.load
    start = origin.u + 2.0 * odd + 4.0 * even
    second = newton(problem, start, origin.load + 4.0 * rise, _hold(origin, row, 2.0 * epsilon), settings=SETTINGS)
    if not second.converged or distance < epsilon:
        return None
    near, far = rise / epsilon**2, (second.load - origin.load) / (4.0 * epsilon**2)
    curvature = (4.0 * near - far) / 3.0
    amplitudes, states = (epsilon, 2.0 * epsilon), (first, second)
    return Switched(problem, origin, amplitudes, states, curvature, distance, sector)


def _near(found: Switched) -> float:
    """F₂ from the first state."""
    return (found.states[0].load - found.origin.load) / found.amplitudes[0] ** 2


def _row(origin: Equilibrium, direction: Array) -> Array:
    """K φ/(φ·K φ), where K φ = -v'' φ at the event, and φ is nothing in the contact."""
    pressure = -origin.fields.stiffness * direction
    return pressure / np.vdot(pressure, direction)


def _hold(origin: Equilibrium, row: Array, amplitude: float) -> Hold:
    return Hold(float(np.vdot(row, origin.u)) + amplitude, 0.0, row)


def _amplitude(origin: Equilibrium) -> float:
    """A change of the gap that is small against the range of the interaction."""
    fields = origin.fields
    return AMPLITUDE * float(np.abs(fields.energy).max() / np.abs(fields.pressure).max())


def kept_symmetry(lattice: Lattice, sector: Sector, swapped: bool) -> Image:
    """The symmetry of the whole lattice that a branch keeps which breaks those of a sector."""
    if sector == EVEN or (sector == ("odd", "odd") and not swapped):
        return lambda values: mirrored(lattice, mirrored(lattice, values, ("even", "odd")), ("odd", "even"))
    other = EVEN if sector[0] == sector[1] else (sector[1], sector[0])
    return lambda values: mirrored(lattice, values, other)


def has_symmetry(spectrum: Spectrum, kept: Image) -> Flags:
    """Which variations are rather even than odd under a symmetry of the whole lattice."""
    return np.array([np.vdot(vector, kept(vector)) > 0.0 for vector in spectrum.vectors], dtype=bool)


def lacking(spectrum: Spectrum, kept: Image, turning: bool) -> int:
    """Number of unstable modes without a symmetry.

    Parameters
    ----------
    spectrum : Spectrum
        Of the whole lattice.
    kept : callable
    turning : bool
        Whether a turn around the axis leads to another state of the branch; its mode is then left out.
    """
    values = spectrum.eigenvalues[~has_symmetry(spectrum, kept)]
    if turning and values.size and np.abs(values).min() < TURN:
        values = np.delete(values, np.abs(values).argmin())
    return int((values < -ZERO).sum())
