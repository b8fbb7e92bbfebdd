"""Models of a contact, the choice between them, and what they are asked: `trace` and `solve`."""

from .choice import choose
from .find import find_all
from .hysteresis import hysteresis
from .run import solve, trace

__all__ = ["choose", "find_all", "hysteresis", "solve", "trace"]
