"""Progress, the clock, and what ends a computation early: with what it has, not with nothing.

A computation runs inside `watched`. What takes long says how far it is (`tell`), or only that it is alive (`check`);
either raises an `Interruption` once the time is over or the progress callback has wanted an end, and from then on at
once, so that whatever is still under way ends soon. What has something to keep calls `kept`, or `caught`, and goes on
to its result, which `Watch.passed` hands over: returned, or as the attribute `partial` of what was raised.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager, nullcontext, suppress
from contextvars import ContextVar
from time import perf_counter
from typing import TypeVar

from contbranch.errors import ModelError, Stop

Progress = Callable[[float, str], None]
Kind = TypeVar("Kind")

# Seconds without news after which what was said last is said again, so that the callback is asked.
SILENCE = 0.2
LATE = "The time limit of"
# Whose frames tell nothing of whose fault an error is.
_OURS = ("contbranch", "numpy", "scipy", "pyfftw")


class Interruption(BaseException):
    """A computation ends with what it has. No `Exception`: those are taken for failures of what is evaluated."""


INTERRUPTIONS = (Interruption, KeyboardInterrupt)


class Watch:
    """Progress and clock of one computation.

    Attributes
    ----------
    reason : str
        Why the computation ends early, a sentence; empty while it does not.
    cause : BaseException or None
        What is raised with the result: KeyboardInterrupt, what the callback raised apart from `Stop`, or what a law or
        model of the user's own did.
    """

    def __init__(self, progress: Progress | None = None, limit: float | None = None) -> None:
        self.reason = ""
        self.cause: BaseException | None = None
        self._progress, self._limit = progress, limit
        self._deadline = float("inf") if limit is None else perf_counter() + limit
        self._span, self._said, self._next, self._finishing = (0.0, 1.0), (0.0, ""), 0.0, False

    def end(self, error: BaseException) -> None:
        """Note what ends the computation."""
        if not isinstance(error, Interruption) and not self.reason:
            own = isinstance(error, KeyboardInterrupt)
            self.reason = f"The computation was {'interrupted' if own else 'stopped by its progress callback'}."
            self.cause = None if isinstance(error, Stop) else error

    def passed(self, result: Kind) -> Kind:
        """The result of a computation that is no longer watched; if something was raised, that, with the result."""
        if self.cause is None or _present.get() is self:
            return result
        with suppress(AttributeError):  # of an exception that takes no attributes
            self.cause.partial = result  # type: ignore[attr-defined]
        raise self.cause

    def _look(self) -> None:
        """Raise Interruption where the computation is to end; otherwise call back, now and then."""
        now = perf_counter()
        if self._finishing or (not self.reason and now < self._next):
            return
        if now >= self._deadline:
            self.reason = self.reason or f"{LATE} {self._limit:g} s was reached."
        if self.reason:
            raise Interruption(self.reason)
        self._next = min(now + SILENCE, self._deadline)
        if self._progress is not None and self._said[1]:
            own = _present.set(_NOBODY)  # a callback may compute something of its own
            try:
                self._progress(*self._said)
            except BaseException as error:
                self.end(error)
                raise Interruption(self.reason) from error
            finally:
                _present.reset(own)

    def _tell(self, fraction: float, text: str) -> None:
        low, high = self._span
        self._said, self._next = (low + (high - low) * min(max(fraction, 0.0), 1.0), text), 0.0
        self._look()


# Of computations that nobody watches: it never ends one.
_NOBODY = Watch()
_present: ContextVar[Watch] = ContextVar("present", default=_NOBODY)


@contextmanager
def watched(progress: Progress | None = None, limit: float | None = None) -> Iterator[Watch]:
    """Watch a computation; what is part of another one has that one's watch. In notebooks a bar is the default."""
    outer = _present.get()
    if outer is not _NOBODY:
        yield outer
        return
    with _bar() if progress is None and _in_notebook() else nullcontext(progress) as report:
        watch = Watch(report, limit)
        own = _present.set(watch)
        try:
            yield watch
        except ModelError:
            if watch.cause is None:
                raise
            raise watch.cause from None
        finally:
            _present.reset(own)


def _in_notebook() -> bool:
    shell = getattr(sys.modules.get("IPython"), "get_ipython", lambda: None)()
    return hasattr(shell, "kernel")


def _bar() -> AbstractContextManager[Progress]:
    """The bar that notebooks show."""
    from contbranch.output.notebook import progress_bar

    return progress_bar()


def check() -> None:
    """Raise Interruption if the present computation is to end; asked wherever the next answer may take long."""
    _present.get()._look()


def tell(fraction: float, text: str) -> None:
    """Say how far the present computation is (a guess), and what is being done; raises as `check` does."""
    _present.get()._tell(fraction, text)


def over() -> bool:
    """Whether the present computation has been interrupted."""
    return bool(_present.get().reason)


def told(message: str) -> str:
    """The message of a result, behind why its computation was interrupted."""
    return " ".join(dict.fromkeys(filter(None, (_present.get().reason, message))))


def caught(error: BaseException) -> None:
    """Go on to the result of an interrupted computation; where none is watched, the error is raised again."""
    watch = _present.get()
    if watch is _NOBODY:
        raise error
    watch.end(error)


def blame(error: BaseException | None) -> None:
    """Pass on with the result what a user's own code has raised, which has ended a computation."""
    watch = _present.get()
    if watch is not _NOBODY and watch.cause is None and error is not None and of_users(error):
        watch.cause = error


def of_users(error: BaseException) -> bool:
    """Whether an error comes from code of the user's, below what has called it."""
    place = None if error.__traceback__ is None else error.__traceback__.tb_next
    while place is not None:
        module = place.tb_frame.f_globals.get("__name__", "").partition(".")[0]
        if module not in _OURS and module not in sys.stdlib_module_names:
            return True
        place = place.tb_next
    return False


def kept(compute: Callable[[], Kind], otherwise: Kind) -> Kind:
    """What is computed, or something else if that is interrupted."""
    try:
        return compute()
    except INTERRUPTIONS as error:
        caught(error)
        return otherwise


@contextmanager
def finishing() -> Iterator[None]:
    """The little that an interrupted computation still has to do for its result is not interrupted."""
    watch = _present.get()
    before, watch._finishing = watch._finishing, True
    try:
        yield
    finally:
        watch._finishing = before


@contextmanager
def part(begin: float, end: float) -> Iterator[None]:
    """Fractions told are of this part of the whole."""
    watch = _present.get()
    before, watch._span = watch._span, (begin, end)
    try:
        yield
    finally:
        watch._span = before


@contextmanager
def patient(seconds: float) -> Iterator[None]:
    """What is part of a computation ends with what it has after so many seconds, and the whole goes on."""
    outer, watch = _present.get(), Watch(limit=seconds)
    if outer is not None:
        watch._progress, watch._said, watch._deadline = (
            outer._progress,
            outer._said,
            min(watch._deadline, outer._deadline),
        )
    own = _present.set(watch)
    try:
        yield
    finally:
        _present.reset(own)
    if watch.cause is not None:
        if outer is _NOBODY:  # whom nobody else would tell
            raise watch.cause
        outer.end(watch.cause)
    check()
