"""The command ``contbranch``: Ctrl-C and SIGTERM are heeded before anything else is imported."""

from __future__ import annotations

import _signal as signal  # type: ignore[import-not-found]  # `signal` takes ten times as long, unheeded
import os
import sys

TYPE_CHECKING = False
if TYPE_CHECKING:
    from collections.abc import Sequence

    from contbranch.output.files import Place


class Interrupts:
    """Ctrl-C, or SIGTERM: it ends the program at once, but where there is something to keep that is kept first.

    Attributes
    ----------
    keeping : bool
        Whether there is something to keep; then the computation asks for `pending`.
    pending : bool
        Whether there was a signal; a second one interrupts whatever is being done.
    status : int
        What the program exits with then: 130 for Ctrl-C, 143 for SIGTERM, with which job schedulers end a job.
    unfinished : list of Place
        Where files are being written, to be removed when the program ends at once.
    """

    keeping = pending = False
    status = 130

    def __init__(self) -> None:
        self.unfinished: list[Place] = []

    def heed(self) -> None:
        """Heed signals from now on, unless the program was started so that they are ignored."""
        for number, default in ((signal.SIGINT, signal.default_int_handler), (signal.SIGTERM, signal.SIG_DFL)):
            if signal.getsignal(number) == default:
                signal.signal(number, self)

    def __call__(self, number: int, _: object) -> None:
        """Take note, or end."""
        self.status = 128 + number
        if not self.keeping:
            for place in self.unfinished:
                place.abandon()
            os.write(2, b"contbranch: interrupted\n")
            os._exit(self.status)
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
        for number in (signal.SIGINT, signal.SIGTERM):
            signal.signal(number, signal.SIG_IGN)
    interrupts.keeping = interrupts.pending = False
    return status
