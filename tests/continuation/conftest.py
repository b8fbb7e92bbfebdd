"""Make the problems shared by these tests, and the scripts in `studies/`, importable however pytest is started."""

from __future__ import annotations

import sys
from pathlib import Path

for folder in (Path(__file__).parent, Path(__file__).parents[2]):
    if str(folder) not in sys.path:
        sys.path.append(str(folder))
