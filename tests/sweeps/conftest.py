"""Make the tasks of these tests importable, by workers as well: they have the path of the process that starts them."""

from __future__ import annotations

import sys
from pathlib import Path

folder = str(Path(__file__).parent)
if folder not in sys.path:
    sys.path.append(folder)
