"""Models of a contact, the choice between them, and what they are asked: `trace` and `solve`."""

from .choice import choose
from .hysteresis import hysteresis
from .run import solve, trace

__all__ = ["choose", "hysteresis", "solve", "trace"]
