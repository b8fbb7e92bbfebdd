"""Tasks that do little, or misbehave; workers import them from here."""

from __future__ import annotations

import os
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from contbranch.sweeps.tasks import Outcome


@dataclass(frozen=True)
class Number:
    """What a task is given."""

    value: int

    def describe(self) -> dict[str, Any]:
        return {"value": self.value}


@dataclass(frozen=True)
class Squares:
    """Squares a number, after some time; some numbers raise, hang or kill the worker. Notes each one it has begun."""

    notes: Path
    seconds: float = 0.0
    time_limit: float | None = None
    raises: int = -1
    hangs: int = -1
    kills: int = -1

    def describe(self) -> dict[str, Any]:
        return {"task": "square"}

    def __call__(self, given: Number) -> Outcome:
        with open(self.notes, "a") as notes:
            notes.write(f"{given.value}\n")
        time.sleep(self.seconds)
        if given.value == self.raises:
            raise ArithmeticError("no square today")
        while given.value == self.hangs:
            pass
        if given.value == self.kills:
            os._exit(9)
        square = float(given.value) ** 2
        about = {"status": "complete", "message": "", "thresholds": {"touch_load": square}}
        return Outcome(about, {"point.load": np.arange(given.value % 7) * square})
