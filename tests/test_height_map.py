"""Height maps: their numbers, scales and grids against formulas of waves and paraboloids; files; what is refused."""

import copy
import dataclasses
import json
import math
import pickle
from types import SimpleNamespace

import h5py
import numpy as np
import pytest

import contbranch as cb

CELL, N = 2.0, 16
NODES = np.arange(N) * CELL / N
Q = 2.0 * math.pi / CELL


def egg_box(x, y, amplitude=0.1):
    return amplitude * (1.0 - np.cos(Q * x) * np.cos(Q * y))


def waves(x, y):
    """A trigonometric polynomial of waves that 16 nodes resolve, the shortest along x and y among them."""
    return (
        0.3 * np.cos(Q * x)
        + 0.2 * np.sin(3 * Q * x - 2 * Q * y)
        + 0.1 * np.cos(7 * Q * y + 1.0)
        + 0.05 * np.cos(8 * Q * x)
        + 0.04 * np.cos(8 * Q * x) * np.cos(8 * Q * y)
    )


def sampled(surface, n=N):
    nodes = np.arange(n) * CELL / n
    return surface(nodes[:, None], nodes)


RANDOM = np.random.default_rng(0).normal(size=(N, N))


def test_heights_are_those_above_the_point_that_touches_first():
    tip = cb.HeightMap(RANDOM, CELL)
    np.testing.assert_allclose(tip.heights, RANDOM - RANDOM.min(), rtol=1e-15)
    peaks = cb.HeightMap(RANDOM, CELL, peaks=True)
    np.testing.assert_allclose(peaks.heights, RANDOM.max() - RANDOM, rtol=1e-15)
    assert tip.heights.min() == peaks.heights.min() == 0.0
    assert cb.HeightMap(RANDOM, CELL, unit=2.5).heights.max() == pytest.approx(2.5 * np.ptp(RANDOM))
    assert not tip.is_axisymmetric
    whole = cb.HeightMap(np.arange(64).reshape(8, 8), CELL)
    assert whole.heights.dtype == np.float64
    assert tip.points == (N, N)


def test_the_array_is_copied_and_cannot_be_changed():
    heights = RANDOM - RANDOM.min()
    tip = cb.HeightMap(heights, CELL)
    heights[0, 0] = 77.0
    assert tip.heights.max() < 10.0
    for one in (tip, copy.deepcopy(tip), pickle.loads(pickle.dumps(tip)), tip.scaled(2.0, 3.0)):
        with pytest.raises(ValueError, match="read-only"):
            one.heights[0, 0] = 1.0
        with pytest.raises(dataclasses.FrozenInstanceError):
            one.cell = 1.0


def test_maps_are_values():
    tip = cb.HeightMap(RANDOM, CELL)
    for other in (
        copy.deepcopy(tip),
        pickle.loads(pickle.dumps(tip)),
        dataclasses.replace(tip),
        cb.HeightMap(**tip.parameters()),
        cb.HeightMap(RANDOM + 0.0, CELL),
    ):
        assert other == tip
        assert hash(other) == hash(tip)
    changed = RANDOM.copy()
    changed[3, 4] += 1e-12
    different = [cb.HeightMap(changed, CELL), cb.HeightMap(RANDOM, 3.0), cb.HeightMap(RANDOM, CELL, 1.0), cb.Cone(1.0)]
    assert len({tip, *different}) == 5
    assert len(repr(tip)) < 200


class TestScales:
    def test_egg_box(self):
        # √⟨cos² cos²⟩ = 1/2, √⟨|∇|²⟩ = q/√2; the curvature of the summits is A q²
        tip = cb.HeightMap(sampled(egg_box), CELL)
        assert tip.rms_height == pytest.approx(0.05, rel=1e-13)
        assert tip.rms_slope == pytest.approx(0.1 * Q / math.sqrt(2.0), rel=1e-13)
        assert tip.natural_length == pytest.approx(1.0 / (0.1 * Q * Q), rel=1e-13)

    def test_they_do_not_depend_on_the_grid(self):
        tip = cb.HeightMap(sampled(waves), CELL)
        finer = cb.HeightMap(tip.on_grid((4 * N, 4 * N)), CELL)
        assert finer.rms_height == pytest.approx(tip.rms_height, rel=1e-12)
        assert finer.rms_slope == pytest.approx(tip.rms_slope, rel=1e-12)

    @pytest.mark.parametrize("n", [64, 256])
    def test_paraboloid_that_ends_in_a_kink(self, n):
        # on a square of edge L: ⟨z²⟩ - ⟨z⟩² = L⁴/(360 R²), ⟨|∇z|²⟩ = L²/(6 R²), so R is multiplied by 6/√360
        x = (np.arange(n) - n / 2) * CELL / n
        tip = cb.HeightMap((x[:, None] ** 2 + x**2) / (2 * 5.0), CELL)
        assert tip.natural_length == pytest.approx(5.0 * 6.0 / math.sqrt(360.0), rel=2.0 / n)

    def test_radius_given(self):
        # (23), (24) for R = 1000 nm, |Δγ| = 0.04 nN/nm, E = 5 nN/nm²: X = 20 nm, Z = 0.4 nm
        tip = cb.HeightMap(10.0 * RANDOM, 300.0, radius=1000.0)
        contact = cb.Contact.physical(tip=tip, modulus="5 GPa", interaction=cb.Gauss(0.04, 1.0))
        assert (contact.scales.in_plane, contact.scales.normal) == (pytest.approx(20.0), pytest.approx(0.4))
        assert contact.tabor == pytest.approx(0.4)

    @pytest.mark.parametrize("radius", [None, 30.0])
    @pytest.mark.parametrize("heights", [RANDOM, np.zeros((8, 8))], ids=["rough", "flat"])
    @pytest.mark.parametrize("law", [cb.Gauss(0.04, 1.0), None], ids=["gauss", "none"])
    def test_reduced(self, radius, heights, law):
        contact = cb.Contact(cb.HeightMap(heights, CELL, radius), law, 5.0)
        reduced, scales = contact.to_reduced(), contact.scales
        np.testing.assert_allclose(reduced.tip.heights * scales.normal, contact.tip.heights, rtol=1e-14)
        assert reduced.tip.cell * scales.in_plane == pytest.approx(CELL)
        assert reduced.tip.natural_length == pytest.approx(1.0, rel=1e-12)  # R = 1
        assert (reduced.scales.in_plane, reduced.scales.normal) == (pytest.approx(1.0), pytest.approx(1.0))
        assert reduced.tabor == (None if law is None else pytest.approx(contact.tabor, rel=1e-12))

    def test_flat(self):
        tip = cb.HeightMap(np.full((8, 8), 3.0), CELL)
        assert tip.heights.max() == 0.0
        assert tip.rms_slope == 0.0
        assert tip.natural_length == CELL


class TestGrids:
    tip = cb.HeightMap(sampled(waves), CELL)
    least = sampled(waves).min()

    @pytest.mark.parametrize("n", [32, 64])
    def test_finer(self, n):
        np.testing.assert_allclose(self.tip.on_grid(self.tip.nodes_of(n)), sampled(waves, n) - self.least, atol=1e-14)

    def test_odd_map(self):
        nodes = np.arange(9) * CELL / 9
        tip = cb.HeightMap(egg_box(nodes[:, None], nodes), CELL)
        np.testing.assert_allclose(tip.on_grid(tip.nodes_of(36)), sampled(egg_box, 36), atol=1e-15)

    def test_coarser_and_the_same(self):
        assert self.tip.on_grid(self.tip.nodes_of(N)) is self.tip.heights
        np.testing.assert_allclose(self.tip.on_grid((8, 8)), sampled(waves, 8) - self.least, atol=1e-15)

    @pytest.mark.parametrize("n", [0, 12, 24, 48, 17])
    def test_grids_that_do_not_fit(self, n):
        with pytest.raises(cb.InputError, match=f"^grid: {n} does not fit the 16 x 16 .*: 8, 16, 32, 64$"):
            self.tip.nodes_of(n)

    def test_rectangles(self):
        tip = cb.HeightMap(RANDOM[:, :12], (4.0, 3.0))
        assert [tip.nodes_of(n) for n in (8, 16, 32)] == [(8, 6), (16, 12), (32, 24)]
        np.testing.assert_allclose(tip.on_grid((32, 24))[::2, ::2], tip.heights, atol=1e-13)
        assert cb.HeightMap(RANDOM[:, :1], (4.0, 1.0)).nodes_of(32) == (32, 1)
        with pytest.raises(cb.InputError, match=r"^grid: 2 does not fit the 16 x 12 .*: 8, 16, 32, 64$"):
            tip.nodes_of(2)

    def test_another_cell(self):
        contact = cb.Contact(self.tip, cb.Exponential(1.0, 0.5))
        with pytest.raises(cb.InputError, match=r"^cell: 2.1; the height map has the cell 2 x 2: leave cell out"):
            cb.solve(contact, load=1.0, model=cb.Periodic(cell=2.1))

    def test_surface_at_any_place(self):
        np.testing.assert_allclose(self.tip.surface(NODES[:, None], NODES), self.tip.heights, atol=1e-13)
        np.testing.assert_allclose(self.tip.surface(NODES - CELL, 3 * CELL), self.tip.heights[:, 0], atol=1e-13)
        x, y = np.random.default_rng(1).uniform(-3.0, 3.0, (2, 50))

        def error(n):
            return np.abs(cb.HeightMap(sampled(egg_box, n), CELL).surface(x, y) - egg_box(x, y)).max()

        assert error(64) < error(16) / 4**3.5  # cubic splines: 4⁴ asymptotically

    def test_mirror_symmetry(self):
        assert cb.HeightMap(sampled(egg_box), CELL).mirror_symmetric
        middle = (np.arange(N) - N / 2) ** 2
        assert cb.HeightMap(middle[:, None] + 3 * middle, CELL).mirror_symmetric
        assert not cb.HeightMap(RANDOM, CELL).mirror_symmetric
        for shift in ((1, 0), (0, 1)):  # symmetric about another node, or about one axis alone
            assert not cb.HeightMap(np.roll(sampled(egg_box), shift, (0, 1)), CELL).mirror_symmetric


class TestFiles:
    def test_npy(self, tmp_path):
        np.save(tmp_path / "a.npy", RANDOM)
        tip = cb.HeightMap.from_file(tmp_path / "a.npy", cell=CELL)
        assert tip == cb.HeightMap(RANDOM, CELL) == cb.HeightMap(str(tmp_path / "a.npy"), CELL)
        assert tip.source.file == str(tmp_path / "a.npy")
        options = {"cell": CELL, "unit": 3.0, "peaks": True, "radius": 2.0}
        assert cb.HeightMap.from_file(tmp_path / "a.npy", **options) == cb.HeightMap(
            RANDOM, CELL, 2.0, peaks=True, unit=3.0
        )

    def test_hdf5(self, tmp_path):
        path = tmp_path / "a.h5"
        with h5py.File(path, "w") as file:
            file["scan/heights"] = RANDOM
            file["x"] = np.arange(3)
        assert cb.HeightMap.from_file(path, cell=CELL).source.dataset == "scan/heights"
        assert cb.HeightMap.from_file(path, cell=CELL, dataset="/scan/heights") == cb.HeightMap(RANDOM, CELL)
        with h5py.File(path, "a") as file:
            file["other"] = RANDOM
        for dataset, message in (
            (None, "dataset: missing; .* has 2 arrays of two dimensions: name one of other, scan/heights, x"),
            ("heights", "dataset: 'heights' is not in .*; must be one of other, scan/heights, x"),
            ("scan", "dataset: 'scan' is not in"),
            ("x", r"heights: shape \(3,\); must be \(N, M\)"),
        ):
            with pytest.raises(cb.InputError, match=f"^{message}") as error:
                cb.HeightMap.from_file(path, cell=CELL, dataset=dataset)
            assert "\n" not in str(error.value)

    def test_what_netcdf_says_of_numbers(self, tmp_path):
        whole = np.round(1e3 * RANDOM)
        with h5py.File(tmp_path / "a.nc", "w") as file:
            file["z"] = whole.astype("i2")
            file["z"].attrs.update({"scale_factor": 1e-3, "add_offset": 7.0, "units": np.array([b"um"])})
        tip = cb.HeightMap.from_file(tmp_path / "a.nc", cell=CELL)
        np.testing.assert_allclose(tip.heights, whole - whole.min(), atol=1e-9)
        with h5py.File(tmp_path / "b.nc", "w") as file:
            file["z"] = np.where(RANDOM.max() == RANDOM, -9999.0, RANDOM)
            file["z"].attrs["_FillValue"] = [-9999.0]
        with pytest.raises(cb.InputError, match="heights: 1 of 256 are not finite"):
            cb.HeightMap.from_file(tmp_path / "b.nc", cell=CELL)

    def test_wrong_files(self, tmp_path):
        with pytest.raises(cb.InputError, match=r"^file: '.*no.npy': no such file; give the path"):
            cb.HeightMap.from_file(tmp_path / "no.npy", cell=CELL)
        (tmp_path / "text.npy").write_text("1 2 3")
        np.save(tmp_path / "objects.npy", np.array([{}, None]), allow_pickle=True)
        (tmp_path / "broken.h5").write_bytes(b"\x89HDF\r\n\x1a\n" + b"\x00" * 50)
        for name in ("text.npy", "objects.npy", "broken.h5"):
            with pytest.raises(cb.InputError, match=rf"^file: '.*{name}' cannot be read; must be") as error:
                cb.HeightMap.from_file(tmp_path / name, cell=CELL)
            assert "\n" not in str(error.value)
        np.save(tmp_path / "a.npy", RANDOM)
        with pytest.raises(cb.InputError, match=r"^dataset: 'x'; .* is not an HDF5 file"):
            cb.HeightMap.from_file(tmp_path / "a.npy", cell=CELL, dataset="x")

    def test_texts_with_decimal_commas_and_lines_of_names(self, tmp_path):
        lines = [";".join(f"{value:.6f}" for value in row).replace(".", ",") for row in RANDOM]
        (tmp_path / "a.txt").write_text("\n".join(lines))
        assert cb.HeightMap.from_file(tmp_path / "a.txt", cell=CELL).heights == pytest.approx(
            cb.HeightMap(RANDOM, CELL).heights, abs=1e-6
        )
        (tmp_path / "b.txt").write_text("x y z\n" + "1 2 3\n" * 3)
        with pytest.raises(cb.InputError, match=r"could not convert string 'x' .* row 0.*numbers alone"):
            cb.HeightMap.from_file(tmp_path / "b.txt", cell=CELL)

    def test_units_by_name_belong_to_contacts_in_nm(self, tmp_path):
        with h5py.File(tmp_path / "a.h5", "w") as file:
            file["z"] = RANDOM
            file["z"].attrs["units"] = "um"
        tip = cb.HeightMap.from_file(tmp_path / "a.h5", cell=CELL)
        assert tip.heights == pytest.approx(1e3 * cb.HeightMap(RANDOM, CELL).heights)
        with pytest.warns(UserWarning, match="nm, and the contact has reduced units"):
            cb.Contact(tip, cb.Gauss(1.0, 0.5))
        text = '[tip]\nshape = "height-map"\nfile = "a.h5"\ncell = {}\n[material]\nmodulus = {}\n'
        (tmp_path / "a.toml").write_text(text.format('"1 um"', '"1 GPa"'))
        assert cb.Contact.from_file(tmp_path / "a.toml").units.physical
        (tmp_path / "a.toml").write_text(text.format("1.0", "1.0"))
        with pytest.raises(cb.InputError, match=r"tip.file: has a unit, tip.cell has none; drop the unit"):
            cb.Contact.from_file(tmp_path / "a.toml")

    @pytest.mark.parametrize(
        ("how", "words"),
        [
            ({"peaks": "yes"}, "peaks: 'yes'; must be True or False"),
            ({"window": 3}, "window: 3; must be a text"),
            ({"dataset": 3}, "dataset: 3; must be a text"),
        ],
    )
    def test_options_of_another_type(self, how, words):
        with pytest.raises(cb.InputError, match=words):
            cb.HeightMap(RANDOM, CELL, **how)
        with pytest.raises(cb.InputError, match=r"heights: up to .*must be below 1e"):
            cb.HeightMap(RANDOM * 1e300, CELL)

    def test_description_names_the_file_or_only_the_digest(self, tmp_path):
        np.save(tmp_path / "a.npy", RANDOM)
        law = cb.Gauss(1.0, 0.5)
        from_file = cb.Contact(cb.HeightMap.from_file(tmp_path / "a.npy", cell=CELL, unit=2.0, peaks=True), law)
        description = json.loads(json.dumps(from_file.describe(), allow_nan=False))
        assert description["tip"]["file"] == str(tmp_path / "a.npy")
        assert len(json.dumps(description)) < 800
        again = cb.Contact.from_description(description)
        assert again == from_file
        assert again.describe() == from_file.describe()
        np.save(tmp_path / "a.npy", RANDOM + np.eye(N))
        with pytest.raises(cb.InputError, match=r"^tip: the heights are not those that were described"):
            cb.Contact.from_description(description)
        (tmp_path / "a.npy").unlink()
        with pytest.raises(cb.InputError, match=r"^tip: the heights cannot be read again: file: .* no such file"):
            cb.Contact.from_description(description)
        plain = cb.Contact(cb.HeightMap(RANDOM, CELL), law).describe()
        assert plain["tip"] == {
            "shape": "height-map",
            "points": [N, N],
            "cell": CELL,
            "rms_height": pytest.approx(np.std(RANDOM), rel=0.05),  # but for the shortest waves
            "rms_slope": cb.HeightMap(RANDOM, CELL).rms_slope,
            "sha256": cb.HeightMap(RANDOM, CELL).digest,
        }
        with pytest.raises(cb.InputError, match=r"^tip.heights: the description has only their SHA-256; make the"):
            cb.Contact.from_description(plain)


def topography(values, sizes, points=None):
    return SimpleNamespace(heights=lambda: values, physical_sizes=sizes, nb_grid_pts=points or np.shape(values))


class TestTopography:
    def test_brings_its_cell_and_points_its_peaks_to_the_wall(self):
        tip = cb.HeightMap(topography(RANDOM, (CELL, CELL)))
        assert tip == cb.HeightMap(RANDOM, CELL, peaks=True)
        assert cb.HeightMap(topography(RANDOM, (CELL, CELL)), peaks=False) == cb.HeightMap(RANDOM, CELL)
        assert cb.HeightMap(topography(RANDOM, (CELL, CELL)), unit=2.0) == cb.HeightMap(
            RANDOM, 2.0 * CELL, peaks=True, unit=2.0
        )

    @pytest.mark.parametrize(
        ("given", "cell", "message"),
        [
            (
                topography(RANDOM, None),
                None,
                r"heights: shape \(16, 16\) of a topography with .* and the edges \(\)",
            ),
            (topography(RANDOM, (1.0, 1.0)), 2.0, "cell: 2, but the topography has the edges 1 x 1; leave cell out"),
            (topography(RANDOM, (1.0, 1.0), (8, 8)), None, r"heights: shape \(16, 16\) of a topography with the grid"),
            (topography(np.ma.masked_greater(RANDOM, 2.0), (1.0, 1.0)), None, r"heights: \d+ of 256 are not finite"),
        ],
    )
    def test_wrong(self, given, cell, message):
        with pytest.raises(cb.InputError, match=f"^{message}"):
            cb.HeightMap(given, cell)


def holed(*places):
    heights = RANDOM.copy()
    for place in places:
        heights[place] = math.nan
    return heights


@pytest.mark.parametrize(
    ("heights", "message"),
    [
        (holed((3, 4), (5, 0)), r"2 of 256 are not finite, the first is nan at \[3, 4\]; fill=True inter"),
        (np.where(RANDOM.max() == RANDOM, np.inf, RANDOM), r"1 of 256 are not finite, the first is inf at"),
        (RANDOM[0], r"shape \(16,\); must be \(N, M\), at least 8"),
        (RANDOM[:7, :7], r"shape \(7, 7\); must be \(N, M\), at least 8"),
        (RANDOM[None], r"shape \(1, 16, 16\); must be"),
        (RANDOM + 0j, "dtype complex128; must be an array of real numbers"),
        (RANDOM > 0, "dtype bool; must be an array of real numbers"),
        (RANDOM.astype(str), "dtype <U32; must be"),
        (None, "dtype object; must be"),
        (3.0, r"shape \(\); must be"),
    ],
)
def test_wrong_heights(heights, message):
    with pytest.raises(cb.InputError, match=f"^heights: {message}") as error:
        cb.HeightMap(heights, CELL)
    assert "\n" not in str(error.value)


@pytest.mark.parametrize(
    ("keywords", "message"),
    [
        ({"cell": 0.0}, "cell: 0; must be greater than zero"),
        ({"cell": math.nan}, "cell: nan; must be a finite number"),
        ({}, "cell: missing; give the edge of the cell"),
        ({"cell": (1.0, 2.0, 3.0)}, "cell: 3 lengths for 16 x 16 heights; give the edge of the cell"),
        ({"cell": 1.0, "fill": 1}, "fill: 1; must be True or False"),
        ({"cell": 1.0, "radius": -1.0}, "radius: -1; must be greater than zero"),
        ({"cell": 1.0, "unit": 0.0}, "unit: 0; must be greater than zero"),
        ({"cell": 1.0, "dataset": "x"}, "dataset: 'x'; only a file has data sets"),
    ],
)
def test_wrong_settings(keywords, message):
    with pytest.raises(cb.InputError, match=f"^{message}"):
        cb.HeightMap(RANDOM, **keywords)


@pytest.mark.filterwarnings("ignore:Could not import mpi4py:ImportWarning")
def test_files_that_surfacetopography_reads(tmp_path):
    """Its own format is netCDF of version 3, which is no HDF5."""
    from SurfaceTopography import Topography, UniformLineScan

    Topography(RANDOM[:12], (3.0, 4.0), unit="um").to_netcdf(tmp_path / "a.nc")
    tip = cb.HeightMap.from_file(tmp_path / "a.nc")
    assert tip == cb.HeightMap(RANDOM[:12], ("3 um", "4 um"), unit="um", peaks=True)
    assert tip.in_nm
    UniformLineScan(RANDOM[0], 4.0, unit="um").to_netcdf(tmp_path / "b.nc")
    assert cb.HeightMap.from_file(tmp_path / "b.nc").edges == (4000.0, 1.0)
    (tmp_path / "rough.toml").write_text(
        'tip = {shape = "height-map", file = "a.nc"}\nmaterial = {modulus = "1 GPa"}\n'
    )
    assert cb.Contact.from_file(tmp_path / "rough.toml").tip == tip


def test_coordinates_are_no_map(tmp_path):
    """Which SurfaceTopography may know, but here they are at no equal distances."""
    np.savetxt(tmp_path / "xyz.txt", np.random.default_rng(3).normal(size=(20, 3)))
    with pytest.raises(cb.InputError, match=r"^(file|heights): "):
        cb.HeightMap.from_file(tmp_path / "xyz.txt", cell=(1.0, 2.0))


class TestRectangles:
    def test_edges(self):
        tip = cb.HeightMap(RANDOM[:8], ("1 um", "2 um"))
        assert (tip.points, tip.edges, tip.cell) == ((8, 16), (1000.0, 2000.0), (1000.0, 2000.0))
        with pytest.raises(cb.InputError, match=r"^cell: 1 length for 8 x 16 heights; give both edges of the cell"):
            cb.HeightMap(RANDOM[:8], 1.0)

    def test_moments_of_a_wave(self):
        x, y = np.arange(32) / 32, np.arange(12) / 12
        tip = cb.HeightMap(np.cos(2 * np.pi * x)[:, None] + 0.0 * y, (3.0, 0.5))
        assert tip.rms_slope == pytest.approx(2 * np.pi / 3.0 / math.sqrt(2.0), rel=1e-12)
        tip = cb.HeightMap(0.0 * x[:, None] + np.cos(4 * np.pi * y), (3.0, 0.5))
        assert tip.rms_slope == pytest.approx(8 * np.pi / math.sqrt(2.0), rel=1e-12)
        np.testing.assert_allclose(tip.surface(0.1, 0.125), 0.0, atol=1e-13)

    def test_description(self):
        contact = cb.Contact(cb.HeightMap(RANDOM[:8], (1.0, 2.0)))
        plain = json.loads(json.dumps(contact.describe()))
        plain["tip"]["heights"] = contact.tip.heights.tolist()
        assert cb.Contact.from_description(plain) == contact


class TestHoles:
    smooth = 0.3 * NODES[:, None] + NODES

    def test_a_plane_is_filled_exactly(self):
        given = self.smooth.copy()
        given[4:7, 5:8] = given[10, 2] = math.nan
        np.testing.assert_allclose(cb.HeightMap(given, CELL, fill=True).heights, self.smooth, atol=1e-13)
        masked = np.ma.masked_invalid(given)
        np.testing.assert_allclose(cb.HeightMap(masked, CELL, fill=True).heights, self.smooth, atol=1e-13)

    def test_corners_and_lines_take_the_nearest(self):
        given = self.smooth.copy()
        given[0, 0] = math.nan
        filled = cb.HeightMap(given, CELL, fill=True).heights
        assert filled[0, 0] in (filled[0, 1], filled[1, 0])
        line = np.append(math.nan, NODES)[:, None]
        assert cb.HeightMap(line, (CELL, 1.0), fill=True).heights[:2, 0].tolist() == [0.0, 0.0]

    def test_without_any_height(self):
        with pytest.raises(cb.InputError, match=r"^heights: 256 of 256 are not finite"):
            cb.HeightMap(np.full((16, 16), math.nan), CELL, fill=True)


class TestSpikes:
    def test_dust_towards_the_wall(self):
        rough = cb.HeightMap.self_affine(64, CELL, 0.8, rms_height=0.01, seed=1)
        heights = rough.heights.copy()
        heights[5, 6] -= 0.03
        heights[40, 3] -= 0.05
        heights[20, 20] += 0.05  # a pit
        assert rough.spikes == []
        assert cb.HeightMap(heights, CELL).spikes == [(40, 3), (5, 6)]

    @pytest.mark.parametrize(
        "heights",
        [
            np.random.default_rng(5).standard_normal((128, 128)),
            np.kron(np.arange(16.0).reshape(4, 4) % 2, np.ones((8, 8))),
            np.zeros((16, 16)),
            sampled(egg_box),
        ],
        ids=["noise", "grating", "flat", "egg box"],
    )
    def test_surfaces_without(self, heights):
        assert cb.HeightMap(heights, CELL).spikes == []


def test_by_name():
    contact = cb.Contact.physical(tip="height-map", heights=RANDOM, cell="1 um", modulus="1 GPa")
    assert contact.tip == cb.HeightMap(RANDOM, 1000.0)
    with pytest.raises(cb.InputError, match=r"^heights: missing; HeightMap needs it"):
        cb.Contact.physical(tip="height-map", cell="1 um", modulus="1 GPa")


class TestFilesOfOtherKinds:
    @pytest.mark.parametrize("separator", [" ", ",", ";", "\t", ", "])
    def test_text(self, tmp_path, separator):
        path = tmp_path / "a.txt"
        lines = [separator.join(f"{value:.17g}" for value in row) for row in RANDOM]
        path.write_text("\n".join(["# heights in nm", *lines]))
        assert cb.HeightMap.from_file(path, cell=CELL) == cb.HeightMap(RANDOM, CELL)

    @pytest.mark.parametrize(("unit", "worth"), [("m", 1e9), ("um", 1e3)])
    def test_the_unit_in_the_header_of_a_text(self, tmp_path, unit, worth):
        header = f"Channel: ZSensor\nWidth: 10.00 µm\nHeight: 10.00 µm\nValue units: {unit}"
        np.savetxt(tmp_path / "a.txt", RANDOM, header=header, encoding="utf-8")
        found = cb.HeightMap.from_file(tmp_path / "a.txt", cell="10 um")
        assert (found.cell, found.in_nm) == (1e4, True)
        np.testing.assert_allclose(found.heights, worth * cb.HeightMap(RANDOM, CELL).heights, rtol=1e-12)
        assert cb.HeightMap.from_file(tmp_path / "a.txt", cell="10 um", unit="nm").rms_height < found.rms_height

    @pytest.mark.parametrize(("suffix", "white"), [("png", 255), ("tif", 65535)])
    def test_images_by_the_heights_of_black_and_white(self, tmp_path, suffix, white):
        from PIL import Image

        shades = np.random.default_rng(2).integers(0, white, (N, N), endpoint=True)
        path = tmp_path / f"a.{suffix}"
        Image.fromarray(shades.astype(np.uint8 if white == 255 else np.uint16)).save(path)
        tip = cb.HeightMap.from_file(path, cell=CELL, grey=(2.0, 14.0), unit="um")
        expected = 12e3 / white * (shades - shades.min())
        np.testing.assert_allclose(tip.heights, expected, rtol=1e-12, atol=1e-9)
        contact = cb.Contact.physical(tip=tip, interaction=cb.Gauss(1.0, 0.5), modulus=1.0)
        again = cb.Contact.from_description(json.loads(json.dumps(contact.describe())))
        assert again.tip == tip
        assert again.tip.source == tip.source
        with pytest.raises(cb.InputError, match=r"^grey: missing; give the heights of black"):
            cb.HeightMap.from_file(path, cell=CELL)

    def test_colours_are_no_heights(self, tmp_path):
        from PIL import Image

        colours = np.random.default_rng(2).integers(0, 255, (N, N, 3)).astype(np.uint8)
        Image.fromarray(colours).save(tmp_path / "a.png")
        with pytest.raises(cb.InputError, match=r"^file: '.*a.png' is a coloured image"):
            cb.HeightMap.from_file(tmp_path / "a.png", cell=CELL, grey=(0.0, 1.0))
        Image.fromarray(np.array([[0, 70000]] * 2, dtype="i4")).save(tmp_path / "d.tif")
        with pytest.raises(cb.InputError, match=r"^file: '.*d.tif' has shades beyond those of 16 bits"):
            cb.HeightMap.from_file(tmp_path / "d.tif", cell=CELL, grey=(0.0, 1.0))
        Image.fromarray(RANDOM.astype("f4")).save(tmp_path / "c.tif")
        with pytest.raises(cb.InputError, match=r"^grey: .* holds numbers, not shades: leave it out"):
            cb.HeightMap.from_file(tmp_path / "c.tif", cell=CELL, grey=(0.0, 1.0))
        grey = np.repeat(colours[..., :1], 3, axis=2)
        Image.fromarray(grey).save(tmp_path / "b.png")
        tip = cb.HeightMap.from_file(tmp_path / "b.png", cell=CELL, grey=(0.0, 255.0))
        np.testing.assert_allclose(tip.heights, grey[..., 0] - float(grey[..., 0].min()))

    @pytest.mark.parametrize(
        ("keywords", "message"),
        [
            ({"grey": (0.0, 1.0)}, "grey: .* is not an image: leave it out"),
            ({"grey": 3.0}, "grey: 3.0; must be the heights of black and of white"),
            ({"unit": "kg"}, "unit: 'kg'; must be a number or a unit of length"),
            ({"detrend": "cubic"}, "detrend: 'cubic'; must be one of plane, paraboloid"),
            ({"window": "no such"}, "window: 'no such'; must be a window of scipy.signal"),
        ],
    )
    def test_wrong_readings(self, tmp_path, keywords, message):
        np.save(tmp_path / "a.npy", RANDOM)
        with pytest.raises(cb.InputError, match=f"^{message}"):
            cb.HeightMap.from_file(tmp_path / "a.npy", cell=CELL, **keywords)


class TestTreatment:
    @pytest.mark.parametrize(("detrend", "left"), [("plane", 1), ("paraboloid", 0)])
    def test_trends(self, detrend, left):
        x, y = NODES[:, None], NODES
        bowl = 0.7 * x * x - 0.4 * x * y + 0.2 * y * y
        tip = cb.HeightMap(3.0 * x - 2.0 * y + 5.0 + left * bowl, CELL, detrend=detrend)
        if left:
            terms = np.column_stack([np.ones(N * N), np.tile(x, N).ravel(), np.tile(y, (N, 1)).ravel()])
            bowl = bowl - (terms @ np.linalg.lstsq(terms, bowl.ravel(), rcond=None)[0]).reshape(N, N)
        np.testing.assert_allclose(tip.heights, left * (bowl - bowl.min()), atol=1e-12)

    def test_a_window_makes_a_map_periodic(self):
        n = 64
        cut = cb.HeightMap.self_affine(2 * n, 2.0, 0.8, rms_slope=0.3, seed=3).heights[:n, :n]
        given, windowed = cb.HeightMap(cut, 1.0), cb.HeightMap(cut, 1.0, window="hann")
        assert given.edge_step > 5.0
        assert windowed.edge_step < 1.0
        assert cb.HeightMap.self_affine(n, 2.0, 0.8, rms_slope=0.3, seed=3).edge_step == pytest.approx(1.0, abs=0.5)
        middle = n // 2
        np.testing.assert_allclose(
            windowed.heights[middle, middle] - windowed.heights[0, 0], cut[middle, middle] - cut.mean(), rtol=1e-12
        )

    def test_line_scans_are_line_contacts(self):
        tip = cb.HeightMap(topography(RANDOM[0], (CELL,)))
        assert tip == cb.HeightMap(RANDOM[0][:, None], (CELL, 1.0), peaks=True)

    def test_units_of_topographies(self):
        given = topography(RANDOM, (CELL, CELL))
        given.unit = "um"
        tip = cb.HeightMap(given)
        assert tip.cell == pytest.approx(1e3 * CELL)
        assert tip.heights.max() == pytest.approx(1e3 * np.ptp(RANDOM))
        assert cb.HeightMap(given, unit=1.0) == cb.HeightMap(RANDOM, CELL, peaks=True)
        given.unit = "furlongs of old"
        with pytest.raises(cb.InputError, match=r"^unit: 'furlongs of old'; .* the heights came with"):
            cb.HeightMap(given)

    def test_units_of_data_sets(self, tmp_path):
        """Attributes of HDF5 say the unit, unless it is given."""
        path = tmp_path / "heights.h5"
        with h5py.File(path, "w") as file:
            file["z"] = RANDOM
            file["z"].attrs["units"] = "um"
        assert cb.HeightMap.from_file(path, cell=CELL).heights.max() == pytest.approx(1e3 * np.ptp(RANDOM))
        assert cb.HeightMap.from_file(path, cell=CELL, unit=1.0).heights.max() == pytest.approx(np.ptp(RANDOM))
