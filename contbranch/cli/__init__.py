"""The command ``contbranch``: Ctrl-C is heeded before anything else is imported."""

from __future__ import annotations

import _signal as signal  # type: ignore[import-not-found]  # `signal` takes ten times as long, unheeded
import os
import sys

TYPE_CHECKING = False
if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

INTERRUPTED = 130


class Interrupts:
    """Ctrl-C: it ends the program at once, but where there is something to keep that is kept first.

    Attributes
    ----------
    keeping : bool
        Whether there is something to keep; then the computation asks for `pending`.
    pending : bool
        Whether Ctrl-C was pressed; a second time interrupts whatever is being done.
    unfinished : list of Path
        Files to be removed when the program ends at once.
    """

    keeping = pending = False

    def __init__(self) -> None:
        self.unfinished: list[Path] = []

    def heed(self) -> None:
        """Heed Ctrl-C from now on, unless the program was started so that it is ignored."""
        if signal.getsignal(signal.SIGINT) is signal.default_int_handler:
            signal.signal(signal.SIGINT, self)

    def __call__(self, *_: object) -> None:
        """Take note, or end."""
        if not self.keeping:
            for path in self.unfinished:
                path.unlink(missing_ok=True)
            os.write(2, b"contbranch: interrupted\n")
            os._exit(INTERRUPTED)
        if self.pending:
            self.keeping = False
            raise KeyboardInterrupt
        self.pending = True


interrupts = Interrupts()


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command with `arguments` (default: those of the process) and return its exit status."""
    if arguments is None:
        interrupts.heed()
    from contbranch.cli.commands import run

    status = run(sys.argv[1:] if arguments is None else arguments)
    if arguments is None:  # what is left to do ends by itself
        signal.signal(signal.SIGINT, signal.SIG_IGN)
    interrupts.keeping = interrupts.pending = False
    return status
