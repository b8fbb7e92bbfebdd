"""Models of a contact, the choice between them, and what they are asked: `trace` and `solve`."""

from contbranch.models.choice import choose
from contbranch.models.find import find_all
from contbranch.models.follow import follow
from contbranch.models.hysteresis import hysteresis
from contbranch.models.phase import phase_diagram
from contbranch.models.run import solve, trace

__all__ = ["choose", "find_all", "follow", "hysteresis", "phase_diagram", "solve", "trace"]
