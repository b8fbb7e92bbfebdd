"""Pages: what they hold is what was computed, and, where there is a browser, what they show is."""

from __future__ import annotations

import base64
import gzip
import html
import json
import re
import shutil
import subprocess
from concurrent.futures import ThreadPoolExecutor
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import contbranch as cb
from contbranch.cli import main
from contbranch.output.page import page

BROWSER = next(filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), None)
# A person's visit, in which `seen` is what is told of it.
VISIT = """
<script>
addEventListener("error", (event) => { document.title = "error: " + event.message; });
const wait = setInterval(() => {
  if (document.documentElement.dataset.ready !== "yes") return;
  clearInterval(wait);
  const seen = {}, choose = (id, value, kind) => { byId(id).value = value; byId(id).dispatchEvent(new Event(kind)); };
  const boxes = (chosen) => [...document.querySelectorAll(chosen)].map((one) => one.getBoundingClientRect());
  const point = (x, y) => {
    const frame = scene.svg.getBoundingClientRect(), k = scene.svg.viewBox.baseVal.width / frame.width;
    const at = { clientX: frame.left + x / k, clientY: frame.top + y / k };
    scene.svg.dispatchEvent(new PointerEvent("pointermove", at));
    return { row: view.row, ...Object.fromEntries(Object.entries(profile()).map(([n, v]) => [n, Array.from(v)])) };
  };
@DONE@
  const [axis, ...numbers] = boxes("#diagram text:not(.name)").sort((one, other) => one.left - other.left);
  seen.apart = Math.min(...numbers.map((one) => one.left)) - axis.right;
  seen.beyond = document.documentElement.scrollWidth - innerWidth;
  const said = document.createElement("pre");
  said.id = "seen";
  said.textContent = JSON.stringify(seen);
  document.body.append(said);
}, 20);
</script>
"""
# Point at the curve, choose axes and control, move to another contact and back, play the loop, move again.
OF_CURVES = """
  const rows = item().branches[0].rows, middle = Math.floor(array(rows.load).length * 0.8);
  seen.first = point(scene.plot.px(array(rows.load)[middle]), scene.plot.py(array(rows.contact_radius)[middle]));
  seen.wanted = middle;
  choose("x", "displacement", "change");
  choose("y", "load", "change");
  choose("control", "displacement", "change");
  seen.second = point(scene.plot.px(array(rows.displacement)[middle]), scene.plot.py(array(rows.load)[middle]));
  if (byId("parameter0")) {
    const there = (value) => { choose("parameter0", value, "input"); return [view.item, view.values.displacement]; };
    seen.places = [0, 1, 0].map(there);
  }
  seen.unstable = document.querySelectorAll("#diagram path.unstable").length;
  choose("loop", Math.floor(byId("loop").max / 2), "input");
  seen.jumps = document.querySelectorAll("#diagram path.jump").length;
  seen.stops = Number(byId("loop").max);
  if (!looped()) seen.kept = travel().jumps.filter((jump) => jump[1]).map((jump) =>
    jump.map(([b, i]) => between(drive(item().branches[b]), i)));
  if (byId("parameter0")) {
    choose("parameter0", 1, "input");
    Object.assign(seen, { item: view.item, told: byId("status").textContent });
  }
  seen.events = document.querySelectorAll("#events tbody tr").length;
  seen.above = scene.svg.lastElementChild.contains(scene.here);
  const [first] = item().events, layer = (k) => ({ ...first, control: view.control, name: `layer-${k}` });
  const symmetry = { ...first, kind: "symmetry", control: null, name: null, mode: 3 };
  item().events.push(...[2, 3, 4, 5, 6, 7, 8, 9].map(layer), symmetry);
  redraw();
  seen.said = document.querySelector("#events tbody tr:last-child td").textContent;
  const names = boxes("#diagram text.name"), apart = (a, b) => a.left >= b.right || b.left >= a.right;
  const below = (a, b) => a.top + 3 >= b.bottom || b.top + 3 >= a.bottom;  // boxes are taller than letters
  seen.names = names.length;
  seen.covered = names.filter((a, i) => names.slice(i + 1).some((b) => !apart(a, b) && !below(a, b))).length;
"""
# Axes of springs, what is dissipated, and the last state by its key; a loop on its own, without a curve.
OF_LOOPS = """
  byId("table").parentElement.open = true;
  choose("x", "piezo", "change");
  choose("y", "deflection", "change");
  scene.svg.dispatchEvent(new KeyboardEvent("keydown", { key: "End" }));
  const cells = (row) => [...row.children].map((one) => one.textContent);
  const rows = (id) => [...document.querySelectorAll(`#${id} tbody tr`)].map(cells);
  for (const id of ["jumps", "table", "events"]) seen[id] = rows(id);
  Object.assign(seen, { state: view.values, panel: document.querySelectorAll("#state dd").length });
"""


@cache
def film() -> cb.Diagram:
    return cb.trace(cb.Contact.reduced(cb.Gauss, tabor=4.0, sign=-1), accuracy=1e-4)


@cache
def force_loop() -> cb.Hysteresis:
    contact = cb.Contact.physical(radius="1 um", modulus="1 GPa", interaction="maugis-dugdale",
                                  work_of_adhesion="40 mN/m", range="1 nm")  # fmt: skip
    return cb.hysteresis(contact, control=cb.Spring("1 N/m"))


def unpacked(text: str) -> tuple[dict[str, Any], Any]:
    """The data of a page, and what returns one of its arrays."""
    data = json.loads(re.search(r'id="data">(.*?)</script>', text, re.S)[1])
    packed = re.search(r'id="arrays">(.*?)</script>', text, re.S)[1]
    planes = np.frombuffer(gzip.decompress(base64.b64decode(packed)), np.uint8).reshape(4, -1)
    numbers = np.ascontiguousarray(planes.T).view("<f4").ravel()
    return data, lambda place: numbers[place[0] : place[0] + place[1]]


def test_a_page_holds_what_was_computed_and_nothing_from_outside() -> None:
    diagram = film()
    text = page(diagram)
    assert not re.search(r"""(src|href)\s*=|url\((?!#)|https?://(?!www\.w3\.org/2000/svg)""", text)
    data, array = unpacked(text)
    (item,) = data["items"]
    (branch,) = item["branches"]
    traced = diagram.branches[0]
    for name in ("load", "displacement", "contact_radius", "central_gap", "energy"):
        assert array(branch["rows"][name]) == pytest.approx(getattr(traced, name), rel=1e-7, abs=1e-30)
    for control in ("load", "displacement"):
        assert np.array_equal(array(branch["unstable"][control]), traced.unstable(control))
    assert [event["name"] for event in item["events"]] == [event.name for event in diagram.events]
    ends = np.cumsum([0, *array(branch["counts"]).astype(int)])
    for row in (0, 30, len(traced) - 1):
        kept, state = slice(ends[row], ends[row + 1]), traced.state(row)
        r, gap = array(branch["r"])[kept], array(branch["gap"])[kept]
        assert gap == pytest.approx(np.interp(r, state.r, state.gap), rel=1e-4, abs=1e-6)
        assert array(branch["pressure"])[kept] == pytest.approx(
            np.interp(r, state.r, state.pressure), rel=1e-3, abs=1e-4
        )


def test_no_more_digits_are_shown_than_a_page_of_many_curves_has(tmp_path: Path) -> None:
    contact = cb.Contact.reduced(cb.MaugisDugdale, tabor=1.0)
    design = cb.varied(contact, {"interaction.work_of_adhesion": np.linspace(0.5, 1.0, 9).tolist()})
    with ThreadPoolExecutor(1) as executor:
        found = cb.sweep(design, tmp_path / "s.h5", executor, accuracy=1e-4)
    data, array = unpacked(page(found))
    for index, item in enumerate(data["items"]):
        exact = found.diagram(index).branches[0].load
        unit = 10.0 ** (np.floor(np.log10(np.abs(exact) + 1e-300)) - data["digits"] + 1)
        assert (np.abs(array(item["branches"][0]["rows"]["load"]) - exact) <= unit).all()
    assert "=> digits(array(" not in page(found)


@cache
def visited(kind: str) -> dict[str, Any]:
    """What a narrow browser shows of a page on which someone has done what is written above."""
    import tempfile

    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        if kind == "sweep":
            film_contact = cb.Contact.reduced(cb.Gauss, tabor=4.0, sign=-1)
            design = cb.varied(film_contact, {"interaction.work_of_adhesion": [-1.0, -0.9]})
            with ThreadPoolExecutor(1) as executor:
                text = page(cb.sweep(design, folder / "s.h5", executor, accuracy=1e-4))
        else:
            text = page(force_loop() if kind == "loop" else film())
        visit = VISIT.replace("@DONE@", OF_LOOPS if kind == "loop" else OF_CURVES)
        (folder / "page.html").write_text(text.replace("</body>", visit + "</body>"), encoding="utf-8")
        options = [
            "--headless=new",
            "--window-size=500,900",
            "--no-sandbox",
            "--disable-gpu",
            "--virtual-time-budget=20000",
            "--dump-dom",
        ]
        command = [str(BROWSER), *options, f"--user-data-dir={folder / 'profile'}", (folder / "page.html").as_uri()]
        done = subprocess.run(command, capture_output=True, text=True, timeout=120)
    assert "<title>error" not in done.stdout
    found: dict[str, Any] = json.loads(re.search(r'<pre id="seen">(.*?)</pre>', done.stdout, re.S)[1])
    return found


@pytest.mark.skipif(BROWSER is None, reason="no Chromium here: pages are drawn by a browser alone")
@pytest.mark.parametrize("kind", ["diagram", "sweep"])
def test_pointing_at_the_curve_shows_the_profile_computed_there(kind: str) -> None:
    seen = visited(kind)
    for which in ("first", "second"):
        shown = seen[which]
        assert shown["row"] == seen["wanted"]
        state = film().branches[0].state(shown["row"])
        assert shown["gap"] == pytest.approx(np.interp(shown["r"], state.r, state.gap), rel=1e-4, abs=1e-6)
    assert seen["unstable"] >= 1
    assert seen["jumps"] == len(seen["kept"]) == 2  # out of the film, and back
    for before, after in seen["kept"]:  # at one value of the control
        assert after == pytest.approx(before, rel=1e-5, abs=1e-6)
    assert seen["stops"] > 100
    assert seen["events"] == 6
    assert kind == "diagram" or (seen["item"] == 1 and "-0.9" in seen["told"].replace("−", "-"))
    if kind == "sweep":  # on the curve of the other contact what is controlled has the value that it had
        (_, before), (other, there), (_, back) = seen["places"]
        assert other == 1
        assert (there, back) == pytest.approx((before, before), rel=1e-6)
    assert seen["above"]  # the present state, of all marks
    assert seen["said"] == "symmetry m = 3"
    assert seen["names"] > 3
    assert seen["covered"] == 0
    assert seen["apart"] > 0.0
    assert seen["beyond"] <= 0


@pytest.mark.skipif(BROWSER is None, reason="no Chromium here: pages are drawn by a browser alone")
def test_a_loop_without_a_curve_has_its_states_and_its_jumps() -> None:
    loop, seen = force_loop(), visited("loop")
    assert len(seen["table"]) == len(loop.path)
    last = {"load": loop.path.load[-1], "piezo": loop.path.position[-1], "deflection": loop.path.load[-1]}
    for name, value in last.items():
        assert seen["state"][name] == pytest.approx(value, rel=1e-6, abs=1e-6)
    assert seen["panel"] == 8  # seven columns, and that it is stable
    lost = [float(row[-1]) for row in seen["jumps"] if row[-1]]
    assert lost == pytest.approx([*(jump.dissipated for jump in loop.jumps), loop.dissipated], rel=1e-6)
    assert [row[0] for row in seen["jumps"]] == ["jump-in", "", "pull-off", "", "whole loop"]
    assert seen["events"] == []
    assert seen["apart"] > 0.0
    assert seen["beyond"] <= 0


def test_the_command_writes_pages_of_traces_and_loops(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    contact = cb.Contact.reduced(cb.MaugisDugdale, tabor=1.0)
    cb.hysteresis(contact, control="displacement", max_load=70.0).save(tmp_path / "loop.h5")
    assert main(["view", str(tmp_path / "loop.h5"), "-o", str(tmp_path / "loop.html")]) == 0
    data, array = unpacked((tmp_path / "loop.html").read_text(encoding="utf-8"))
    loop = data["items"][0]["loop"]
    assert [jump["name"] for jump in loop["jumps"]] == ["jump-in", "pull-off"]
    assert array(loop["load"]).min() == pytest.approx(cb.trace(contact).thresholds["pull_off_load"], rel=1e-3)
    rows = data["items"][0]["branches"][0]["rows"]
    assert array(rows["load"]).max() == array(loop["load"]).max() == 70.0  # each state of the loop is on the curve
    assert main(["view", str(tmp_path / "loop.h5"), "-o", str(tmp_path / "loop.pdf")]) == 2
    assert "for example -o page.html" in capsys.readouterr().err
    assert main(["view", str(tmp_path / "loop.h5"), "-o", str(tmp_path / "nowhere" / "loop.html")]) == 2
    assert capsys.readouterr().err.startswith("contbranch: -o: ")


def test_notebooks_hold_the_page_of_a_diagram() -> None:
    """Folded up, in a frame whose text is that of the page."""
    shown = film()._repr_html_()
    framed = html.unescape(re.search(r'srcdoc="(.*?)"', shown, re.S)[1])
    assert framed == page(film())
    assert shown.count("<script") == 0


def test_states_on_a_grid_are_maps_also_of_a_file(tmp_path: Path) -> None:
    """The nodes with pressure, contact where the wall presses; a page made from a file shows them too."""
    contact = cb.Contact(cb.EllipticParaboloid(2.0, 0.5), cb.Exponential(0.5, 1.0))
    traced = cb.trace(contact, model=cb.FreeSpace(grid=32), max_load=1.0)
    traced.save(tmp_path / "cell.h5")
    data, array = unpacked(page(cb.load(tmp_path / "cell.h5")))
    (branch,) = data["items"][0]["branches"]
    edges = array(branch["maps"]["edges"]).reshape(-1, 6)
    assert len(edges) == len(traced.branches[0])
    row = len(edges) - 1
    start = int(sum(edges[:row, 2] * edges[:row, 5]))
    x0, x1, columns, y0, y1, rows = edges[row]
    gap, pressure = (array(branch["maps"][name])[start:].reshape(int(rows), -1).T for name in ("gap", "pressure"))
    cell = traced.branches[0].state(row).cell
    i, j = (np.searchsorted(side, low - 1e-6) for side, low in ((cell.x, x0), (cell.y, y0)))
    seen = np.s_[i : i + int(columns), j : j + int(rows)]
    assert (cell.x[seen[0]][-1], cell.y[seen[1]][-1]) == pytest.approx((x1, y1), rel=1e-6)
    np.testing.assert_allclose(pressure, cell.pressure[seen], rtol=1e-6, atol=1e-12)
    assert np.array_equal(gap == 0.0, cell.wall_pressure[seen] > 0.0)
    assert (gap == 0.0).any()
    assert np.ptp(cell.x[seen[0]]) > np.ptp(cell.y[seen[1]])  # as the contact is


def test_titles_are_text_whatever_is_in_them() -> None:
    """What closes an element in the name of a law of the user's closes nothing on the page."""

    class Odd(cb.Gauss):
        name = "</script><b>odd"

    diagram = cb.trace(cb.Contact.reduced(Odd, tabor=1.0), accuracy=1e-2)
    text = page(diagram)
    assert "<b>odd" not in text
    assert "odd" in unpacked(text)[0]["title"]
