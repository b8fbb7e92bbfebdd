"""HDF5 files: an exact round trip, a layout others can read, and one-line errors."""

from __future__ import annotations

import os
import resource
from contextlib import contextmanager, nullcontext
from dataclasses import replace
from pathlib import Path

import h5py
import numpy as np
import pytest

import contbranch as cb
from contbranch.cli import main as cb_main
from contbranch.contact.contact import Contact
from contbranch.contact.interactions import Gauss
from contbranch.contact.tips import HeightMap
from contbranch.contact.units import PHYSICAL
from contbranch.errors import InputError, ModelError
from contbranch.output import files
from contbranch.output.hdf5 import load, save
from contbranch.output.plot import figure_content
from contbranch.results.diagram import Cost, Diagram, LocalExponent, ModelChoice, Solution, State
from contbranch.results.loop import Hysteresis, Jump, Path as LoopPath

COLUMNS = ("load", "displacement", "contact_radius", "central_gap", "energy", "load_error", "displacement_error")
INDICES = ("unstable_load", "unstable_displacement")


def assert_same(found: Diagram, wanted: Diagram) -> None:
    """Every number and text of two diagrams agrees exactly."""
    plain = ("contact", "thresholds", "model", "cost", "control", "accuracy", "status", "message", "unit_names")
    for name in ("events", *plain):
        assert getattr(found, name) == getattr(wanted, name), name
    for mine, other in zip(found.branches, wanted.branches, strict=True):
        for name in (*COLUMNS, *INDICES):
            np.testing.assert_array_equal(getattr(mine, name), getattr(other, name), err_msg=name, strict=True)
        assert len(mine.profiles) == len(other.profiles)


def test_round_trip_is_exact(attraction: Diagram, tmp_path: Path) -> None:
    path = tmp_path / "attraction.h5"
    attraction.save(path)
    found = load(path)
    assert_same(found, attraction)
    for i in (0, 45, 158):
        mine, other = found.branches[0].state(i).profile, attraction.branches[0].state(i).profile
        assert mine is not None
        assert other is not None
        for name in ("r", "gap", "pressure", "wall_pressure"):
            np.testing.assert_array_equal(getattr(mine, name), getattr(other, name), strict=True)
    assert [p.name for p in tmp_path.iterdir()] == ["attraction.h5"]


def test_round_trip_without_profiles_and_exponents(repulsion: Diagram, tmp_path: Path) -> None:
    save(repulsion, tmp_path / "x.h5")
    found = load(tmp_path / "x.h5")
    assert_same(found, repulsion)
    assert found.branches[0].state(3).profile is None
    with pytest.raises(InputError, match="no local exponent"):
        found.local_exponent(found.events[1])


def test_local_exponents_of_folds_and_touches_survive(attraction: Diagram, tmp_path: Path) -> None:
    def source(event):
        if event.name == "jump-in":
            raise ModelError("the curve ends too close to the event")
        excess = np.array([1.0, 2.0, 4.0]) * (1.0 + event.position)
        return LocalExponent(excess, excess**0.5, 0.5 + 0.0 * excess, 0.01 * excess)

    traced = replace(attraction, local_exponents=source)
    save(traced, tmp_path / "x.h5")
    found = load(tmp_path / "x.h5")
    for event in found.events:
        if event.name == "jump-in":
            continue
        for name in ("excess", "order_parameter", "kappa", "error"):
            mine, other = getattr(found.local_exponent(event), name), getattr(source(event), name)
            np.testing.assert_array_equal(mine, other)
    jump_in = next(event for event in found.events if event.name == "jump-in")
    with pytest.raises(InputError, match="no local exponent"):
        found.local_exponent(jump_in)


def test_profiles_that_are_computed_on_demand_are_stored(attraction: Diagram, tmp_path: Path) -> None:
    branch = attraction.branches[0]
    lazy = replace(branch, profiles=[lambda p=profile: p for profile in branch.profiles])
    save(replace(attraction, branches=(lazy,)), tmp_path / "x.h5")
    stored = load(tmp_path / "x.h5").branches[0].state(7).profile
    assert stored is not None
    np.testing.assert_array_equal(stored.gap, branch.profiles[7].gap)


def test_contact_of_an_unknown_law_is_none_but_described(broken: Diagram, tmp_path: Path) -> None:
    save(broken, tmp_path / "x.h5")
    with pytest.warns(UserWarning, match="tip or law that is not at hand"):
        found = load(tmp_path / "x.h5")
    assert found.contact is None
    assert found.description == broken.description
    assert (found.status, found.message) == ("incomplete", broken.message)
    np.testing.assert_array_equal(found.branches[0].load, broken.branches[0].load)
    save(found, tmp_path / "y.h5")
    with pytest.warns(UserWarning, match="tip or law that is not at hand"):
        assert load(tmp_path / "y.h5").unit_names == broken.unit_names


def test_heights_of_a_map_are_kept(repulsion: Diagram, tmp_path: Path) -> None:
    heights = np.random.default_rng(0).normal(size=(16, 16))
    tip = HeightMap(heights, 3.0, unit=1.7)  # from an array: a description alone could not bring it back
    contact = Contact(tip, Gauss(1.0, 0.5))
    save(replace(repulsion, contact=contact, description=contact.describe()), tmp_path / "x.h5")
    found = load(tmp_path / "x.h5")
    assert found.contact == contact
    np.testing.assert_array_equal(found.contact.tip.heights, tip.heights)
    save(found, tmp_path / "y.h5")
    assert load(tmp_path / "y.h5").contact == contact
    np.save(tmp_path / "h.npy", heights)
    from_file = Contact(HeightMap.from_file(tmp_path / "h.npy", cell=3.0, unit=1.7), Gauss(1.0, 0.5), 1.0, PHYSICAL)
    (tmp_path / "h.npy").unlink()
    traced = replace(repulsion, contact=from_file, description=from_file.describe(), unit_names=PHYSICAL.names)
    save(traced, tmp_path / "z.h5")
    assert load(tmp_path / "z.h5").contact.describe() == from_file.describe()
    with h5py.File(tmp_path / "z.h5", "a") as file:
        assert file["tip/heights"].attrs["unit"] == "nm"
        file["tip/heights"][0, 0] += 1.0
    without_checksum(tmp_path / "z.h5")
    with pytest.warns(UserWarning, match=r"has no checksum|not at hand"):
        assert load(tmp_path / "z.h5").contact is None  # no longer what was described


def test_layout_is_the_documented_one(attraction: Diagram, tmp_path: Path) -> None:
    save(attraction, tmp_path / "x.h5")
    with h5py.File(tmp_path / "x.h5") as file:
        head = [file.attrs[name] for name in ("format", "version", "units")]
        assert head == ["contbranch-diagram", 1, "physical"]
        assert file["branches/0/load"].attrs["unit"] == "nN"
        assert file["branches/0/profiles/pressure"].attrs["unit"] == "nN/nm²"
        start, stop = file["branches/0/profiles/offsets"][90:92]
        gap = file["branches/0/profiles/gap"][start:stop]
        np.testing.assert_array_equal(gap, attraction.branches[0].profiles[90].gap)
        assert list(file["events/kind"].asstr()) == [event.kind for event in attraction.events]
        written = {name.rsplit("/", 1)[-1] for name in [*file["events"], *file["branches/0"], *file]}
    sprung = cb.trace(cb.Contact.reduced("maugis-dugdale", tabor=2.0), control=cb.Spring(2.0), accuracy=1e-4)
    save(sprung, tmp_path / "x.h5")
    with h5py.File(tmp_path / "x.h5") as file:
        written |= {*file, *file.attrs, *file["branches/0"], *file["cost"].attrs, *file["model"].attrs}
    documented = (Path(__file__).parent.parent / "docs" / "file-layout.md").read_text(encoding="utf-8")
    assert [name for name in written if f"`{name}" not in documented] == []


def test_solution_is_saved_with_its_profile(attraction: Diagram, tmp_path: Path) -> None:
    state = attraction.branches[0].state(100)
    fields = {name: getattr(state, name) for name in state.__dataclass_fields__}
    model, cost = ModelChoice("exact", "closed form", 1), Cost(0.01, 4)
    other = attraction.branches[0].state(50)
    solution = Solution(**fields, model=model, cost=cost, states=(state, other), contact=attraction.contact)
    save(solution, tmp_path / "x.h5")
    found = load(tmp_path / "x.h5")
    assert [branch.state(0).load for branch in found.branches] == [state.load, other.load]
    profile = found.branches[0].state(0).profile
    assert profile is not None
    np.testing.assert_array_equal(profile.gap, state.profile.gap)
    assert found.contact == attraction.contact


def without_checksum(path: Path) -> None:
    """Make a file one of version 0.1: what HDF5 reads, without the block before it."""
    path.write_bytes(path.read_bytes()[512:])


def changed(path: Path, change) -> None:
    without_checksum(path)
    with h5py.File(path, "a") as file:
        change(file)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda file: file.attrs.modify("format", "contbranch-solution"), "holds contbranch-solution"),
        (lambda file: file.attrs.modify("version", 2), "has version 2"),
        (lambda file: file.attrs.__delitem__("format"), "holds something else"),
        (lambda file: file.__delitem__("events"), "is damaged"),
        (lambda file: file["branches/0"].__delitem__("energy"), "is damaged"),
        (lambda file: file["contact"].write_direct(np.array("{", dtype=h5py.string_dtype())), "is damaged"),
    ],
)
def test_wrong_files_are_refused_in_one_line(repulsion: Diagram, tmp_path: Path, change, words: str) -> None:
    path = tmp_path / "x.h5"
    save(repulsion, path)
    changed(path, change)
    known = nullcontext() if words != "is damaged" else pytest.warns(UserWarning, match="has no checksum")
    with pytest.raises(InputError, match=words) as caught, known:
        load(path)
    assert "\n" not in str(caught.value)
    assert str(path) in str(caught.value)


def test_no_file_and_no_hdf5(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="is not a file"):
        load(tmp_path / "missing.h5")
    (tmp_path / "text.h5").write_text("load 1 2 3")
    with pytest.raises(InputError, match="not an HDF5 file"):
        load(tmp_path / "text.h5")


@contextmanager
def no_more_than(size: int):
    """Let files grow no larger, as `ulimit -f` does: a write beyond fails as on a full disk."""
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (size, hard))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))


def test_a_failed_write_keeps_the_old_file(attraction: Diagram, tmp_path: Path) -> None:
    path, picture = tmp_path / "x.h5", tmp_path / "x.png"
    for old in (path, picture):
        old.write_text("old")
    with no_more_than(20_000), pytest.raises(InputError, match=r"x.h5' cannot be written \(File too large\)"):
        save(attraction, path)
    with no_more_than(20_000), pytest.raises(InputError, match=r"x.png' cannot be written \(File too large\)"):
        files.write(picture, figure_content(attraction.plot(), ".png"))
    assert path.read_text() == picture.read_text() == "old"
    assert sorted(p.name for p in tmp_path.iterdir()) == ["x.h5", "x.png"]
    with pytest.raises(InputError, match="cannot be written"):
        save(attraction, tmp_path / "no folder" / "x.h5")


def test_the_second_of_two_writers_is_told(repulsion: Diagram, tmp_path: Path) -> None:
    path = tmp_path / "x.h5"
    (tmp_path / "x.h5.part").write_text("what a killed writer has left")
    with files.reserved(path, "-o") as place:
        with pytest.raises(InputError, match=r"x.h5' is being written by another process"):
            save(repulsion, path)
        place.write(b"first")
    assert path.read_bytes() == b"first"
    save(repulsion, path)
    assert load(path).events == repulsion.events
    assert [p.name for p in tmp_path.iterdir()] == ["x.h5"]


def test_a_link_keeps_its_target_and_a_device_its_name(repulsion: Diagram, tmp_path: Path) -> None:
    (tmp_path / "real.h5").write_text("old")
    (tmp_path / "link.h5").symlink_to("real.h5")
    save(repulsion, tmp_path / "link.h5")
    assert (tmp_path / "link.h5").is_symlink()
    assert load(tmp_path / "real.h5").events == repulsion.events
    os.mkfifo(tmp_path / "pipe")
    reader = os.open(tmp_path / "pipe", os.O_RDONLY | os.O_NONBLOCK)
    files.write(tmp_path / "pipe", b"text")
    assert os.read(reader, 10) == b"text"
    os.close(reader)


# -- damage -----------------------------------------------------------------------------------------------------------
def flipped(data: bytearray, random: np.random.Generator) -> None:
    data[random.integers(len(data))] ^= 1 << int(random.integers(8))


def truncated(data: bytearray, random: np.random.Generator) -> None:
    del data[random.integers(len(data)) :]


def zeroed(data: bytearray, random: np.random.Generator) -> None:
    start = int(random.integers(len(data)))
    size = min(int(random.choice([1, 16, 512, 4096])), len(data) - start)
    data[start : start + size] = bytes(size)


def scrambled(data: bytearray, random: np.random.Generator) -> None:
    start = int(random.integers(len(data) - 8))
    data[start : start + 8] = random.bytes(8)  # an offset to nowhere, if it is one


def removed(file: h5py.File, path: str) -> None:
    del file[path]


def shortened(file: h5py.File, path: str) -> None:
    values = file[path][()][:-1] if file[path].shape else file[path][()]
    del file[path]
    file[path] = values


def retyped(file: h5py.File, path: str) -> None:
    shape = file[path].shape
    del file[path]
    file[path] = np.full(shape, b"text")


def shifted(file: h5py.File, path: str) -> None:
    if file[path].dtype.kind == "f" and file[path].size:
        file[path][...] += 1.0
    else:
        file[path].attrs["unit"] = "m"


@pytest.mark.parametrize("damage", [flipped, truncated, zeroed, scrambled, removed, shortened, retyped, shifted])
def test_nothing_is_read_of_a_damaged_file(repulsion: Diagram, tmp_path: Path, damage) -> None:
    """40 files a kind: one line that says so, or (where nothing was changed) every number as it was."""
    path, random = tmp_path / "x.h5", np.random.default_rng(11)
    save(repulsion, path)
    whole = path.read_bytes()
    names: list[str] = []
    with h5py.File(path) as file:
        file.visititems(lambda name, item: names.append(name) if isinstance(item, h5py.Dataset) else None)
    for _ in range(40):
        if damage in (flipped, truncated, zeroed, scrambled):
            data = bytearray(whole)
            damage(data, random)
            path.write_bytes(data)
        else:
            path.write_bytes(whole)
            with h5py.File(path, "a") as file:
                damage(file, names[random.integers(len(names))])
        if path.read_bytes() == whole:
            assert_same(load(path), repulsion)
            continue
        with pytest.raises(InputError, match=r"is damaged|is not an HDF5 file") as caught:
            load(path)
        assert "\n" not in str(caught.value)


@pytest.mark.parametrize("damage", [shortened, retyped])
@pytest.mark.parametrize("name", ["branches/0/contact_radius", "branches/0/load_error", "branches/0/unstable_load"])
def test_a_file_without_checksum_of_which_nothing_can_be_made_is_refused(
    repulsion: Diagram, tmp_path: Path, damage, name: str
) -> None:
    path = tmp_path / "x.h5"
    save(repulsion, path)
    path.write_bytes(path.read_bytes()[512:])
    with h5py.File(path, "a") as file:
        damage(file, name)
    with pytest.warns(UserWarning, match="cannot be verified"), pytest.raises(InputError, match="is damaged"):
        load(path)


def test_a_loop_is_written_as_its_document(tmp_path: Path) -> None:
    values, whole = np.array([1.0, np.nan, 3.0]), np.zeros(3, dtype=int)
    jump = Jump("pull-off", 1.0, State(-5.0, *4 * (0.0,), 0, 0, 0.0), None, None, None)
    loop = Hysteresis(
        LoopPath(*6 * (values,), whole, whole),
        (jump,),
        None,
        None,
        True,
        ModelChoice("exact", "", 1),
        Cost(0.0, 0),
        "load",
    )
    loop.save(tmp_path / "loop.h5")
    with h5py.File(tmp_path / "loop.h5") as file:
        assert file.attrs["format"] == "contbranch-loop"
        assert "dissipated" not in file.attrs
        np.testing.assert_array_equal(file["path/load"][()], values)
        assert file["jumps/0"].attrs["name"] == "pull-off"
        assert file["jumps/0/from"].attrs["load"] == -5.0
        assert "to" not in file["jumps/0"]
    with pytest.raises(InputError, match="cannot be written"):
        loop.save(tmp_path / "missing" / "loop.h5")
    followed = cb.Followed(
        "tabor",
        {},
        {},
        (),
        cb.Event("fold", *4 * (0.0,), {}),
        ModelChoice("", "", 0),
        Cost(0.0, 0),
        1e-6,
        contact=Contact(cb.Parabola(1.0)),
    )
    followed.save(tmp_path / "followed.h5")
    with h5py.File(tmp_path / "followed.h5") as file:
        assert file["special"].shape == (0,)
    changed(tmp_path / "loop.h5", lambda file: file.__delitem__("path/load"))
    with pytest.raises(InputError, match="damaged"), pytest.warns(UserWarning, match="no checksum"):
        load(tmp_path / "loop.h5")  # of a loop it holds too little


def test_loops_and_followed_events_are_read_again(tmp_path: Path) -> None:
    contact = Contact.physical(
        radius="1 um", modulus="5 GPa", interaction="gauss", work_of_adhesion="-40 mN/m", range="1 nm"
    )
    loop = cb.hysteresis(contact, cb.Spring(2.0), accuracy=1e-3)
    assert len(loop.jumps) == 2
    loop.save(tmp_path / "loop.h5")
    found = load(tmp_path / "loop.h5")
    assert str(found) == str(loop)
    assert found == loop
    assert (found.area, found.jumps[0].area) == (loop.area, loop.jumps[0].area) != (None, None)
    np.testing.assert_array_equal(found.jumps[0].start.gap, loop.jumps[0].start.gap)
    assert len(found.plot().axes) == 2
    bare = cb.hysteresis(cb.Contact.reduced("maugis-dugdale", tabor=1.0))  # leaves for infinity
    bare.save(tmp_path / "bare.h5")
    assert load(tmp_path / "bare.h5").jumps[-1].to is None
    fold = next(cb.trace(contact, accuracy=1e-3, modes=0).folds("load"))
    followed = cb.follow(fold, "interaction[0].range", to=1.05, accuracy=1e-3)
    followed.save(tmp_path / "followed.h5")
    again = load(tmp_path / "followed.h5")
    assert str(again) == str(followed)
    assert again == followed
    assert cb_main(["show", str(tmp_path / "loop.h5"), "--plot", str(tmp_path / "loop.png")]) == 0


def test_states_and_boundaries_are_read_as_they_were(tmp_path: Path) -> None:
    """With their profiles; boundaries belong to contacts of their own; a height map has its heights."""
    film = Contact.reduced("gauss", tabor=1.0, sign=-1)
    heights = cb.HeightMap.self_affine(16, 10.0, 0.5, rms_slope=0.3, seed=1)
    results = {
        "states": cb.find_all(film, load=8.2, accuracy=1e-4),
        "phase": cb.phase_diagram(Contact.reduced("maugis-dugdale", tabor=1.0), "tabor", (1.0, 1.1), samples=3),
        "rough": cb.find_all(Contact(heights, cb.Gauss(0.02, 0.8)), load=0.1, accuracy=1e-4),
    }
    for name, result in results.items():
        result.save(tmp_path / f"{name}.h5")
        assert load(tmp_path / f"{name}.h5") == result, name
    assert results["states"][0].profile is not None
    assert results["rough"].contact == load(tmp_path / "rough.h5").contact


def test_what_is_read_has_the_order_of_what_was_written(repulsion: Diagram, tmp_path: Path) -> None:
    backwards = dict(reversed(repulsion.thresholds.items()))
    save(replace(repulsion, thresholds=backwards), tmp_path / "x.h5")
    assert list(load(tmp_path / "x.h5").thresholds) == list(backwards) != sorted(backwards)
