"""Models of a contact, the choice between them, and what they are asked: `trace` and `solve`."""

from .choice import choose
from .find import find_all
from .follow import follow
from .hysteresis import hysteresis
from .phase import phase_diagram
from .run import solve, trace

__all__ = ["choose", "find_all", "follow", "hysteresis", "phase_diagram", "solve", "trace"]
