"""Make the independent computations shared by these tests importable however pytest is started."""

from __future__ import annotations

import sys
from pathlib import Path

folder = str(Path(__file__).parent)
if folder not in sys.path:
    sys.path.append(folder)
