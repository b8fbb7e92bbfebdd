"""Time limits, callbacks that raise, Ctrl-C: every computation ends with what it has, and says so."""

from __future__ import annotations

import json
import math
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from functools import cache, partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import contbranch as cb
from contbranch import watch
from contbranch.cli import main
from contbranch.models.axisymmetric.problem import ContactProblem
from contbranch.models.grid import equilibria

ATTRACTION = cb.Contact.reduced(cb.Exponential, tabor=4.0)
REPULSION = cb.Contact.reduced(cb.Gauss, tabor=1.0, sign=-1)
STIFF = cb.Contact.reduced(cb.VanDerWaals, tabor=64.0, sign=-1)
MODELS: dict[str, tuple[cb.Contact, Any]] = {
    "exact": (cb.Contact.reduced(cb.MaugisDugdale, tabor=1.0), "exact"),
    "axisymmetric": (REPULSION, "axisymmetric"),
    "rings": (cb.Contact.reduced(cb.MaugisDugdale, tabor=1.0, sign=-1), "auto"),
    "grid": (REPULSION, cb.Periodic(cell=9.8825, grid=32)),
}


class Ending:
    """A progress callback that raises when it is called for the n-th time."""

    def __init__(self, error: BaseException, call: int) -> None:
        self.error, self.left, self.said = error, call, []

    def __call__(self, fraction: float, text: str) -> None:
        self.said.append((fraction, text))
        self.left -= 1
        if not self.left:
            raise self.error


@pytest.mark.parametrize("kind", MODELS)
def test_what_was_traced_of_any_model_lies_on_the_curve(kind: str) -> None:
    """dF/dd and the order of rows are those of the whole trace: the rows of the part are among its rows."""
    contact, model = MODELS[kind]
    counted = Ending(cb.Stop(), -1)
    whole = cb.trace(contact, model=model, modes=0, progress=counted)
    part = cb.trace(contact, model=model, modes=0, progress=Ending(cb.Stop(), len(counted.said) // 2))
    assert part.status == "incomplete"
    assert part.message.startswith("The computation was stopped by its progress callback.")
    rows = part.branches[0]
    assert 2 < len(rows) <= len(whole.branches[0])
    known = np.column_stack([whole.branches[0].load, whole.branches[0].displacement])
    for row in np.column_stack([rows.load, rows.displacement]):
        assert np.abs(known - row).max(axis=1).min() <= 1e-9
    part.document()
    assert all(0.0 <= fraction <= 1.0 and text for fraction, text in counted.said)


def test_rows_survive_what_is_checked_of_them_in_the_end(monkeypatch: pytest.MonkeyPatch) -> None:
    """Stopped while events are located, with an inertia at the last row that takes long enough to look at the watch."""
    whole = cb.trace(REPULSION)
    counts = ContactProblem.unstable

    def looking(self: ContactProblem, *state: Any) -> int | None:
        watch.check()
        return counts(self, *state)

    def stops(fraction: float, text: str) -> None:
        if text.startswith("locating"):
            raise cb.Stop

    monkeypatch.setattr(ContactProblem, "unstable", looking)
    part = cb.trace(REPULSION, progress=stops)
    assert part.status == "incomplete"
    assert len(part.branches[0]) == len(whole.branches[0])
    assert [event.kind for event in part.events] == [event.kind for event in whole.events if event.kind != "symmetry"]


def test_rows_survive_where_folds_of_a_grid_are_compared(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """Stopped while the first of two folds of one control is located, whose states are not at hand any more."""
    contact, model = MODELS["grid"]

    def stops(fraction: float, text: str) -> None:
        if text.startswith("locating"):
            raise cb.Stop

    monkeypatch.setattr(equilibria, "RECENT", 1)
    part = cb.trace(contact, model=model, progress=stops)
    assert (part.status, len(list(part.folds("load")))) == ("incomplete", 2)
    assert len(part.branches[0]) > 20
    part.save(tmp_path / "x.h5")
    assert len(cb.load(tmp_path / "x.h5").branches[0]) == len(part.branches[0])


@cache
def complete() -> cb.Diagram:
    return cb.trace(REPULSION, accuracy=1e-9)


@pytest.mark.parametrize("call", [1, 30, 37, 60])
def test_events_found_so_far_are_located_and_the_file_opens(call: int, tmp_path: Path) -> None:
    """At any stage (following, locating, counting modes) an event is within its error estimate of the true one."""
    whole = complete()
    part = cb.trace(REPULSION, progress=Ending(cb.Stop(), call))
    assert part.status == "incomplete"
    for event in part.events:
        near = [e for e in whole.events if (e.kind, e.control) == (event.kind, event.control) != ("end", None)]
        apart = min((abs(e.load - event.load) for e in near), default=0.0)
        assert apart <= 3.0 * event.error["load"] + 1e-8
    part.save(tmp_path / "x.h5")
    found = cb.load(tmp_path / "x.h5")
    assert (found.status, found.message, found.events) == (part.status, part.message, part.events)


COMPUTATIONS: dict[str, Callable[..., Any]] = {
    "trace": lambda **how: cb.trace(ATTRACTION, **how),
    "solve": lambda **how: cb.solve(ATTRACTION, displacement=-1.0, **how),
    "find_all": lambda **how: cb.find_all(ATTRACTION, displacement=-1.0, **how),
    "hysteresis": lambda **how: cb.hysteresis(ATTRACTION, control="displacement", **how),
    "phase_diagram": lambda **how: cb.phase_diagram(REPULSION, between=(1.0, 1.2), samples=3, **how),
}


@pytest.mark.parametrize("name", COMPUTATIONS)
def test_every_computation_keeps_a_limit_and_passes_on_what_was_raised(name: str) -> None:
    compute = COMPUTATIONS[name]
    began = time.perf_counter()
    found = compute(time_limit=0.01)
    assert time.perf_counter() - began < 10.0
    assert (found.status, "The time limit of 0.01 s was reached." in found.message) == ("incomplete", True)
    found.document()
    found._repr_html_()
    for error in (KeyboardInterrupt(), ZeroDivisionError("of the callback")):
        with pytest.raises(type(error)) as caught:
            compute(progress=Ending(error, 8))
        assert caught.value is error
        assert (type(error.partial), error.partial.status) == (type(found), "incomplete")
    assert compute(progress=Ending(cb.Stop(), 8)).status == "incomplete"
    with pytest.raises(cb.InputError, match="time_limit: 0; must be greater than zero"):
        compute(time_limit=0)


def test_a_phase_diagram_is_drawn_however_little_of_it_there_is() -> None:
    contact = cb.Contact.reduced("maugis-dugdale", tabor=1.0)
    counted = Ending(cb.Stop(), -1)
    cb.phase_diagram(contact, between=(1.0, 1.3), samples=3, progress=counted)
    drawn = set()
    for call in range(1, len(counted.said), max(1, len(counted.said) // 4)):
        part = cb.phase_diagram(contact, between=(1.0, 1.3), samples=3, progress=Ending(cb.Stop(), call))
        part.plot()
        drawn.add((len(part.values), len(part.boundaries)))
    assert {0, 1, 2} <= {values for values, _ in drawn}
    assert any(boundaries for _, boundaries in drawn)


def test_an_event_is_followed_as_far_as_there_is_time() -> None:
    event = next(e for e in cb.trace(REPULSION).events if e.name == "squeeze-out")
    counted = Ending(cb.Stop(), -1)
    whole = cb.follow(event, "tabor", 2.0, progress=counted)
    for call in (1, len(counted.said) // 2, len(counted.said)):
        part = cb.follow(event, "tabor", 2.0, progress=Ending(cb.Stop(), call))
        assert part.status == "incomplete" or call == len(counted.said)  # silence is broken by the clock
        assert len(part.curve["load"]) <= len(whole.curve["load"])
        for value, load, error in zip(part.curve["tabor"], part.curve["load"], part.error["load"], strict=True):
            assert abs(whole.at(value)[0].load - load) <= 3.0 * error + 3e-6
    assert cb.follow(event, "tabor", 2.0, time_limit=1e-3).status == "incomplete"


def test_a_search_that_found_nothing_has_no_number() -> None:
    found = cb.solve(ATTRACTION, displacement=-1.0, time_limit=1e-3)
    assert math.isnan(found.load)
    assert (found.status, found.states, found.document()["states"]) == ("incomplete", (), [])


@pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning")
def test_an_interrupt_between_two_calls_is_kept_too() -> None:
    """A signal comes at any place of the code, not only where the computation asks; not while modules are imported."""
    cb.trace(STIFF, accuracy=1e-3, modes=0, time_limit=0.1)
    for delay in (0.02, 0.05, 0.1):
        signal.setitimer(signal.ITIMER_REAL, delay, 1.0)  # again, if Python has dropped the first one in a destructor
        before = signal.signal(signal.SIGALRM, signal.default_int_handler)
        try:
            with pytest.raises(KeyboardInterrupt) as caught:
                cb.trace(STIFF, accuracy=1e-8)  # no machine is done with it as soon
        finally:
            signal.setitimer(signal.ITIMER_REAL, 0.0)
            signal.signal(signal.SIGALRM, before)
        assert caught.value.partial.status == "incomplete"
        assert caught.value.partial.message == "The computation was interrupted."


def test_a_callback_may_compute_something_of_its_own() -> None:
    inner: list[float] = []

    def progress(fraction: float, text: str) -> None:
        if not inner:
            inner.append(cb.solve(cb.Contact.reduced(cb.MaugisDugdale), load=1.0, time_limit=5.0).load)

    assert cb.trace(REPULSION, modes=0, progress=progress).status == "complete"
    assert inner == [1.0]


def test_nothing_is_watched_outside_of_a_computation() -> None:
    watch.check()
    watch.tell(0.5, "nothing")
    assert not watch.over()
    with pytest.raises(KeyboardInterrupt):
        watch.caught(KeyboardInterrupt())


CODE = "import sys; from contbranch.cli import main; sys.exit(main())"
SHORT = ["--interaction", "maugis-dugdale", "--tabor", "1"]
LAYERS = """[tip]\nshape = "parabola"\nradius = 1.0\n[material]\nmodulus = 1.0
[[interaction]]\nlaw = "layered"\nwork_of_adhesion = -1.0\nrange = 0.1\nwavelength = 0.1\n"""


def test_a_limit_saves_and_prints_what_there_is(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "c.toml").write_text(LAYERS)
    outputs = ["--json", str(tmp_path / "x.json"), "-o", str(tmp_path / "x.h5")]
    given = [str(tmp_path / "c.toml"), "--accuracy", "1e-9", "--time-limit", "0.4", *outputs]
    assert main(["trace", *given]) == 1
    out, err = capsys.readouterr()
    assert err == "contbranch: incomplete: The time limit of 0.4 s was reached.\n"
    assert "incomplete" in out
    document = json.loads((tmp_path / "x.json").read_text())
    assert document["status"] == "incomplete"
    assert document["branches"][0]["load"] == cb.load(tmp_path / "x.h5").branches[0].load.tolist()
    given = ["--interaction", "exponential", "--tabor", "4", "--time-limit", "0.05", "--json", "-"]
    for command in (["loop"], ["solve", "--load", "1"], ["solve", "--load", "1", "--all"]):
        assert main([*command, *given]) == 1
        assert json.loads(capsys.readouterr().out)["status"] == "incomplete"
    empty = ["solve", "--interaction", "exponential", "--tabor", "4", "--load", "1", "-o", str(tmp_path / "empty.h5")]
    assert main([*empty, "--time-limit", "1e-6"]) == 1
    assert len(cb.load(tmp_path / "empty.h5").branches) == 0
    capsys.readouterr()
    assert main(["follow", "--event", "pull-off", "--vary", "tabor=3:5", *given]) == 1
    assert json.loads(capsys.readouterr().out)["format"] == "contbranch-diagram"  # the event was not found in time


def test_uncertainties_of_a_curve_that_is_there_are_there(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """The time is over when the curve has been followed."""
    propagate = cb.Diagram.propagate

    def late(diagram: cb.Diagram, given: dict[str, Any]) -> dict[str, float]:
        watch._present.get().reason = "The time is over."
        return propagate(diagram, given)

    monkeypatch.setattr(cb.Diagram, "propagate", late)
    asked = ["trace", "--interaction", "exponential", "--tabor", "1", "--accuracy", "1e-3", "--json", "-"]
    assert main([*asked, "--uncertainty", "range=0.1"]) == 0
    assert json.loads(capsys.readouterr().out)["uncertainties"]["pull_off_load"] > 0.0


@pytest.mark.parametrize(
    ("name", "least"), [(signal.SIGINT, 0.7), (signal.SIGINT, 0.05), (signal.SIGTERM, 0.7), (signal.SIGKILL, 0.7)]
)
def test_a_signal_leaves_the_old_file_or_a_readable_one(name: signal.Signals, least: float, tmp_path: Path) -> None:
    (tmp_path / "c.toml").write_text(LAYERS)
    path = tmp_path / "x.h5"
    path.write_text("old")
    command = [sys.executable, "-c", CODE, "trace", str(tmp_path / "c.toml"), "--accuracy", "1e-10", "-o", str(path)]
    pipes = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "text": True}
    heard = partial(signal.signal, signal.SIGINT, signal.SIG_DFL)  # what a job in the background inherits ignores it
    with subprocess.Popen(command, preexec_fn=heard, **pipes) as program:
        # after the lock, which comes before the libraries
        while not list(tmp_path.glob("*.part")):
            time.sleep(0.01)
        time.sleep(least)
        program.send_signal(name)
        _, err = program.communicate(timeout=60)
    assert "Traceback" not in err
    if name != signal.SIGKILL:
        assert program.returncode == 128 + name
        assert err.startswith("contbranch: interrupted")
        assert [p.name for p in sorted(tmp_path.iterdir())] == ["c.toml", "x.h5"]
    if path.read_bytes() != b"old":
        assert cb.load(path).status == "incomplete"
        assert name != signal.SIGKILL


def test_full_outputs_are_one_line(tmp_path: Path) -> None:
    limited = f'ulimit -f 20; exec {sys.executable} -c "{CODE}" trace {" ".join(SHORT)} -o {tmp_path}/x.h5'
    done = subprocess.run(["bash", "-c", limited], capture_output=True, text=True, check=False)
    assert done.returncode == 2
    assert done.stderr.count("\n") == 1
    assert "x.h5' cannot be written (File too large)" in done.stderr
    assert "pull off load" in done.stdout  # what was computed is not lost
    assert os.listdir(tmp_path) == []
    full = f'exec {sys.executable} -c "{CODE}" trace {" ".join(SHORT)} --json - > /dev/full'
    done = subprocess.run(["bash", "-c", full], capture_output=True, text=True, check=False)
    assert (done.returncode, done.stderr.count("\n")) == (2, 1)
    assert "standard output cannot be written (No space left on device)" in done.stderr


def test_a_part_that_is_given_up_does_not_end_the_whole() -> None:
    """A trace that tells how much room a contact takes ends with what it has; Ctrl-C in it is passed on."""
    with watch.watched(limit=3600.0):
        with watch.patient(1e-9):
            part = cb.trace(ATTRACTION)
        assert part.status == "incomplete"
        assert not watch.over()
        assert cb.trace(ATTRACTION).status == "complete"
    with pytest.raises(watch.Interruption), watch.watched(limit=3600.0) as whole, watch.patient(3600.0):
        watch.kept(interrupt, None)
    assert isinstance(whole.cause, KeyboardInterrupt)


def interrupt() -> None:
    raise KeyboardInterrupt


def test_patience_within_a_computation_ends_with_its_time() -> None:
    began = time.perf_counter()

    def waiting() -> None:
        while time.perf_counter() - began < 5.0:
            watch.check()

    def patient() -> None:
        with watch.patient(30.0):
            watch.kept(waiting, None)

    with watch.watched(limit=0.2) as outer:
        watch.kept(patient, None)
    assert outer.reason == "The time limit of 0.2 s was reached."
    assert time.perf_counter() - began < 2.0


def test_what_was_not_found_is_drawn_and_told_as_such() -> None:
    def stop(fraction: float, text: str) -> None:
        raise cb.Stop

    assert cb.solve(REPULSION, load=1.0, progress=stop).plot().texts[0].get_text() == "no state was found"
    told = cb.find_all(REPULSION, load=1.0, progress=stop).message
    assert told.startswith("0 equilibria found so far in the window")
    assert "; ." not in told
    assert len(cb.trace(REPULSION, cb.Spring(1.0), time_limit=1e-9).branches[0].unstable("spring")) == 0
