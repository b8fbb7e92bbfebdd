"""Models of a contact, the choice between them, and what they are asked: `trace`, `solve` and `follow`."""

from .choice import choose
from .follow import follow
from .phase import phase_diagram
from .run import solve, trace

__all__ = ["choose", "follow", "phase_diagram", "solve", "trace"]
