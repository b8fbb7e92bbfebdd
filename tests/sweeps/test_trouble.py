"""What goes wrong in a sweep costs no more than itself: kills, torn files, full disks, workers that die or hang."""

from __future__ import annotations

import errno
import signal
import subprocess
import sys
import time
from collections import Counter
from concurrent.futures import Executor, Future, ProcessPoolExecutor, ThreadPoolExecutor
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest
from sweep_tasks import Number, Squares

import contbranch as cb
from contbranch.sweeps.cluster import Connected
from contbranch.sweeps.journal import Journal, Records, decoded, encoded

SCRIPT = """
import sys
sys.path.insert(0, {folder!r})
from pathlib import Path
import contbranch as cb
from sweep_tasks import Number, Squares
if __name__ == "__main__":
    here = Path({here!r})
    task = Squares(here / "notes", 0.01)
    cb.sweep([Number(k) for k in range(90)], here / "s.h5", task=task, workers=1, resume=True)
"""


def content(path: Path) -> dict[str, Any]:
    """All that a file holds, but for times."""
    found: dict[str, Any] = {}
    with h5py.File(path) as file:
        found.update(file.attrs)

        def put(name: str, data: Any) -> None:
            if isinstance(data, h5py.Dataset) and name != "wall_s":
                found[name] = np.asarray(data[()]).tolist()

        file.visititems(put)
    return found


def test_killed_and_resumed_a_sweep_is_what_it_would_have_been(tmp_path: Path) -> None:
    """Killed without warning twice; no task that had ended is computed again, and at most those under way are."""
    script = tmp_path / "sweep.py"
    script.write_text(SCRIPT.format(folder=str(Path(__file__).parent), here=str(tmp_path)))
    kills = 0
    for _ in range(8):
        child = subprocess.Popen([sys.executable, str(script)], stderr=subprocess.DEVNULL)
        begun = len(_notes(tmp_path))
        deadline = time.monotonic() + 30.0
        while child.poll() is None and (len(_notes(tmp_path)) < begun + 30 or kills == 2):
            assert time.monotonic() < deadline
            time.sleep(0.01)
        if child.poll() is None:
            child.send_signal(signal.SIGKILL)
            kills += 1
        elif child.returncode == 0:
            break
        child.wait()
    assert kills == 2
    whole = cb.load(tmp_path / "s.h5")
    assert Counter(task.computed for task in whole.tasks) == {1: 90}
    assert len(_notes(tmp_path)) <= 90 + 2 * kills
    with ThreadPoolExecutor(1) as executor:
        task = Squares(tmp_path / "others")
        cb.sweep([Number(k) for k in range(90)], tmp_path / "t.h5", executor, task=task)
    assert content(tmp_path / "s.h5") == content(tmp_path / "t.h5")
    assert not (tmp_path / "s.h5.journal").exists()


def _notes(folder: Path) -> list[str]:
    path = folder / "notes"
    return path.read_text().split() if path.exists() else []


def test_tasks_that_raise_hang_or_kill_their_worker_say_so_and_the_others_are_there(tmp_path: Path) -> None:
    task = Squares(tmp_path / "notes", 0.0, 0.5, raises=10, hangs=20, kills=30)
    found = cb.sweep([Number(k) for k in range(60)], tmp_path / "s.h5", task=task, workers=2)
    assert found.status == "complete"
    told = {failed.index: failed.message for failed in found.failed}
    assert sorted(told) == [10, 20, 30]
    assert told[10] == "ArithmeticError: no square today"
    assert "time limit of 0.5 s" in told[20]
    assert "worker died" in told[30]
    assert all(one.thresholds["touch_load"] == one.index**2 for one in found.tasks if one.index not in told)
    with pytest.raises(cb.InputError, match="this task failed"):
        found.diagram(10)
    with ThreadPoolExecutor(1) as executor:
        numbers, task = [Number(k) for k in range(60)], Squares(tmp_path / "notes")
        again = cb.sweep(numbers, tmp_path / "s.h5", executor, resume=True, retry=True, task=task)
    assert (again.computed, again.reused, again.failed) == (3, 57, ())


def test_where_an_executor_breaks_processes_of_this_machine_go_on(tmp_path: Path) -> None:
    with ProcessPoolExecutor(1) as executor:
        task = Squares(tmp_path / "notes", kills=5)
        with pytest.warns(UserWarning, match="it has broken; the sweep goes on with"):
            found = cb.sweep([Number(k) for k in range(9)], tmp_path / "s.h5", executor, task=task)
    assert [task.index for task in found.failed] == [5]
    assert found.status == "complete"


def test_workers_that_cannot_begin_end_the_sweep_with_the_reason(tmp_path: Path) -> None:
    """A script without a guard runs its sweep again in every worker, where the file is locked."""
    script = tmp_path / "unguarded.py"
    text = SCRIPT.format(folder=str(Path(__file__).parent), here=str(tmp_path)).replace(
        " cb.sweep", " found = cb.sweep"
    )
    text = text.replace('__name__ == "__main__"', "True").replace("workers=2", "workers=1")
    script.write_text(text + "    print(found.status, found.message, len(found.tasks))")
    done = subprocess.run([sys.executable, str(script)], capture_output=True, text=True, timeout=60)
    assert done.stdout.startswith("incomplete Workers die before they begin")
    assert done.stdout.endswith(" 0\n")


def test_what_was_torn_is_dropped_wherever_it_was_torn(tmp_path: Path) -> None:
    whole = [encoded({"key": f"k{n}", "run": f"r{n}", "status": "complete"}, {"a.b": np.arange(n)}) for n in range(3)]
    for cut in range(0, len(whole[2]), 7):
        path = tmp_path / f"{cut}"
        path.write_bytes(whole[0] + whole[1] + whole[2][:cut])
        records = Records(path)
        assert [entry.about["key"] for entry in records.entries] == ["k0", "k1"]
        records.append(whole[2])
        records.close()
        assert path.read_bytes() == b"".join(whole)
    about, arrays = decoded(whole[2])
    assert about["key"] == "k2"
    assert arrays["a.b"].tolist() == [0, 1]


def test_a_record_that_is_not_what_its_checksum_says_ends_the_journal(tmp_path: Path) -> None:
    whole = [encoded({"key": f"k{n}", "run": f"r{n}"}, {}) for n in range(3)]
    damaged = bytearray(whole[1])
    damaged[-3] ^= 1
    (tmp_path / "j").write_bytes(whole[0] + damaged + whole[2])
    records = Records(tmp_path / "j")
    assert [entry.about["key"] for entry in records.entries] == ["k0"]
    records.close()


def test_records_of_a_batch_that_are_in_the_journal_already_are_no_second_computation(tmp_path: Path) -> None:
    """The program ended between adding the batch and removing its file."""
    journal = Journal(tmp_path / "j")
    record = encoded({"key": "k", "run": "r", "status": "complete"}, {})
    journal.add(record)
    journal.close()
    (tmp_path / "j" / "batch-1").write_bytes(record)
    journal = Journal(tmp_path / "j")
    assert journal.computed == {"k": 1}
    journal.close()
    assert not (tmp_path / "j" / "batch-1").exists()


def test_a_second_writer_is_refused(tmp_path: Path) -> None:
    class Second(Executor):
        def submit(self, fn: Any, /, *args: Any, **kwargs: Any) -> Future[Any]:
            again = f"cb.sweep([cb.Contact.reduced('gauss')], {str(tmp_path / 's.h5')!r}, resume=True)"
            code = f"import contbranch as cb; {again}"
            child = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
            assert "is being written by another process" in child.stderr
            done: Future[Any] = Future()
            done.set_result(fn(*args, **kwargs))
            return done

    found = cb.sweep([Number(1)], tmp_path / "s.h5", Second(), task=Squares(tmp_path / "notes"))
    assert found.status == "complete"


def test_an_interrupted_sweep_returns_what_it_has_and_is_resumed(tmp_path: Path) -> None:
    def report(fraction: float, text: str) -> None:
        if fraction > 0.2:
            raise cb.Stop

    contacts, task = [Number(k) for k in range(30)], Squares(tmp_path / "notes", 0.02)
    with ThreadPoolExecutor(1) as executor:
        part = cb.sweep(contacts, tmp_path / "s.h5", executor, task=task, progress=report)
        assert part.status == "incomplete"
        assert "are missing" in part.message
        assert 0 < len(part.tasks) < 30
    with pytest.raises(cb.InputError, match="holds an unfinished sweep"):
        cb.sweep(contacts, tmp_path / "s.h5", task=task)
    with ThreadPoolExecutor(1) as executor:
        rest = cb.sweep(contacts, tmp_path / "s.h5", executor, resume=True, task=task)
    assert rest.status == "complete"
    assert rest.computed + rest.reused == 30
    assert rest.reused >= len(part.tasks)
    assert Counter(_notes(tmp_path)).most_common(1)[0][1] == 1


def test_a_full_disk_ends_the_sweep_with_what_it_has(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    contacts, task = [Number(k) for k in range(20)], Squares(tmp_path / "notes")
    append, count = Records.append, iter(range(10**6))

    def full(self: Records, record: bytes, sync: bool = True) -> None:
        if next(count) > 30:
            raise OSError(errno.ENOSPC, "No space left on device")
        append(self, record, sync)

    with monkeypatch.context() as patch, ThreadPoolExecutor(1) as executor:
        patch.setattr(Records, "append", full)
        with pytest.raises(cb.InputError, match="No space left on device"):
            cb.sweep(contacts, tmp_path / "s.h5", executor, task=task)
    with ThreadPoolExecutor(1) as executor:
        found = cb.sweep(contacts, tmp_path / "s.h5", executor, resume=True, task=task)
    assert found.reused > 0
    assert found.status == "complete"


def test_settings_are_looked_at_before_anything_is_computed(tmp_path):
    films = cb.varied(cb.Contact.reduced(cb.Exponential, tabor=1.0), {"tabor": [1.0, 3.0]})
    for settings, words in (
        ({"workers": -1}, "workers: -1; must be a whole number, 1 or greater"),
        ({"workers": 1.5}, "workers: 1.5; must be a whole"),
        ({"accuracy": 5.0}, "accuracy: 5; must lie between"),
        ({"max_load": -5.0}, "max_load: -5; must be greater than zero"),
    ):
        with pytest.raises(cb.InputError, match=words):
            cb.sweep(films, tmp_path / "s.h5", **settings)
    with pytest.raises(cb.InputError, match="contacts: Contact; must be a list"):
        cb.sweep(films[0], tmp_path / "s.h5")
    assert not list(tmp_path.iterdir())


def test_a_sweep_is_saved_as_a_copy_and_known_where_its_end_is_missing(tmp_path):
    films = cb.varied(cb.Contact.reduced(cb.MaugisDugdale, tabor=1.0), {"tabor": [1.0, 3.0]})
    with ThreadPoolExecutor(1) as executor:
        found = cb.sweep(films, tmp_path / "s.h5", executor, model="exact", keep="thresholds")
    found.save(tmp_path / "copy.h5")
    assert cb.load(tmp_path / "copy.h5").tasks == found.tasks
    (tmp_path / "short.h5").write_bytes((tmp_path / "s.h5").read_bytes()[:-1])
    with pytest.raises(cb.InputError, match=r"is damaged .its end is not what was written"):
        cb.load(tmp_path / "short.h5")
    for index in (2, "a"):
        with pytest.raises(cb.InputError, match=r"index: .*must be one of the numbers of 2 tasks"):
            found.diagram(index)


def test_what_cannot_be_sent_to_a_worker_has_failed(tmp_path: Path) -> None:
    class Local(Number):
        """Of a class that no worker can import."""

    found = cb.sweep([Local(1), Number(2)], tmp_path / "s.h5", task=Squares(tmp_path / "notes"), workers=1)
    assert [(task.index, "pickle" in task.message) for task in found.failed] == [(0, True)]
    assert found.tasks[1].status == "complete"


def test_a_journal_that_is_no_folder_is_said(tmp_path: Path) -> None:
    (tmp_path / "s.h5.journal").write_text("")
    with pytest.raises(cb.InputError, match=r"journal' cannot be written \(File exists\)"):
        cb.sweep([Number(1)], tmp_path / "s.h5", resume=True, task=Squares(tmp_path / "notes"))


class Lost:
    """A Dask client that loses its scheduler: what it was handed is cancelled, now and then with its worker dead."""

    status, left = "running", 5

    def get_executor(self, pure: bool) -> Lost:
        return self

    def submit(self, fn: Any, /, *args: Any, **kwargs: Any) -> Future[Any]:
        assert self.status == "running"
        future: Future[Any] = Future()
        future.cancel()
        future.set_running_or_notify_cancel()
        self.left -= 1
        self.status = "running" if self.left else "closed"
        return future


def test_what_a_lost_scheduler_cancels_has_not_failed(tmp_path: Path) -> None:
    task = Squares(tmp_path / "notes")
    with pytest.warns(UserWarning, match="it has broken"):
        found = cb.sweep([Number(1)], tmp_path / "s.h5", Connected(Lost()), task=task, workers=1)
    assert [one.status for one in found.tasks] == ["complete"]
