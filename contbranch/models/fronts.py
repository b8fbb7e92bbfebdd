"""What a steep front of the pressure is, and how smooth a film has to be, around discs and rings alike."""

from __future__ import annotations

__all__ = ["BEGINS", "CORE", "ENDS", "FLATTER", "SMOOTH", "STIFF"]

# A front begins where the pressure changes by more than this multiple of its largest value over its distance from the
# rim, ends where it changes by less than the second, and is moved where its own change is below this share.
BEGINS, ENDS, FLATTER = 1.5, 1.0, 0.2
# Radius over which the interaction is felt in units of the length on which elasticity answers it, from which on steps
# are limited by fronts.
STIFF = 16.0
# Share of its largest value up to which v'' may be unresolved inside a film, as far as that bears this share of its
# largest pressure.
SMOOTH, CORE = 1e-4, 0.7
