"""Contact files: the format of the interface, the tables of numbers, and one line for everything that is wrong."""

import math

import h5py
import numpy as np
import pytest

from contbranch.contact.contact import Contact
from contbranch.contact.file import read_contact
from contbranch.contact.interactions import Exponential, Gauss, Layered, Tabulated, VanDerWaals
from contbranch.contact.tips import Cone, EllipticParaboloid, HeightMap, Parabola, PowerLaw, Profile, SphericalCap
from contbranch.contact.units import PHYSICAL, REDUCED
from contbranch.control import DISPLACEMENT, LOAD, Control, as_control
from contbranch.errors import InputError

PHYSICAL_FILE = """
[tip]
shape = "parabola"              # parabola, cone, power-law, spherical-cap, profile
radius = "1 um"
[material]
modulus = "5 GPa"               # effective modulus
[[interaction]]                 # one table for each law of the sum; none: no interaction
law = "gauss"
work_of_adhesion = "-40 mN/m"   # < 0 repels
range = "1 nm"
"""
REDUCED_FILE = """
[tip]
shape = "parabola"
radius = 1
[material]
modulus = 1.0
[[interaction]]
law = "exponential"
work_of_adhesion = 1.0
range = 0.25
"""


@pytest.fixture
def write(tmp_path):
    def written(text, name="contact.toml"):
        path = tmp_path / name
        path.write_text(text, encoding="utf-8")
        return path

    return written


def test_physical(write):
    path = write(PHYSICAL_FILE)
    contact, options = read_contact(path)
    assert contact == Contact(Parabola(1000.0), Gauss(-0.04, 1.0), 5.0, PHYSICAL)
    assert options == {}
    assert Contact.from_file(path) == Contact.from_file(str(path)) == contact


def test_reduced(write):
    contact, _ = read_contact(write(REDUCED_FILE))
    assert contact == Contact(Parabola(1.0), Exponential(1.0, 0.25), 1.0)
    assert contact == Contact.reduced("exponential", tabor=4.0)


@pytest.mark.parametrize(
    ("lines", "tip"),
    [
        ('shape = "cone"\nslope = 0.3', Cone(0.3)),
        ('shape = "power-law"\nexponent = 4\nlength = "20 nm"', PowerLaw(4.0, 20.0)),
        ('shape = "spherical-cap"\nradius = "0.1 um"', SphericalCap(100.0)),
        (
            'shape = "profile"\nradii = [0, 1, 2, 3]\nheights = [0.0, 1.0, 4.0, 9.5]\nlength_unit = "angstrom"',
            Profile([0, 0.1, 0.2, 0.3], [0, 0.1, 0.4, 0.95]),
        ),
        (
            'shape = "profile"\nradii = [0, 1, 2, 3]\nheights = [0, 1, 2, 3.5]\nlength_unit = "nm"\napex = "sharp"',
            Profile([0, 1, 2, 3], [0, 1, 2, 3.5], apex="sharp"),
        ),
    ],
)
def test_every_shape(write, lines, tip):
    contact, _ = read_contact(write(f'[tip]\n{lines}\n[material]\nmodulus = "1 GPa"'))
    assert type(contact.tip) is type(tip)
    assert contact.interaction is None
    assert contact.units == PHYSICAL
    r = np.array([0.05, 0.2])
    np.testing.assert_allclose(contact.tip.height(r), tip.height(r), rtol=1e-12)


def test_elliptic_paraboloid(write):
    tip = 'shape = "elliptic-paraboloid"\nradius_x = "1 um"\nradius_y = "20 nm"'
    contact, _ = read_contact(write(f'[tip]\n{tip}\n[material]\nmodulus = "1 GPa"'))
    assert contact.tip == EllipticParaboloid(1000.0, 20.0)


class TestHeightMap:
    heights = np.random.default_rng(0).normal(size=(8, 8))
    head = '[tip]\nshape = "height-map"\n'
    material = '\n[material]\nmodulus = "1 GPa"'

    def test_npy_beside_the_contact_file(self, write, tmp_path):
        np.save(tmp_path / "h.npy", self.heights)
        keys = 'file = "h.npy"\ncell = "1 um"\nunit = "angstrom"\npeaks = true\nradius = "50 nm"'
        contact, _ = read_contact(write(self.head + keys + self.material))
        assert contact.tip == HeightMap(self.heights, 1000.0, 50.0, peaks=True, unit=0.1)
        assert contact.units == PHYSICAL
        assert Contact.from_description(contact.describe()) == contact

    def test_text_and_treatment(self, write, tmp_path):
        np.savetxt(tmp_path / "h.txt", self.heights)
        keys = 'file = "h.txt"\ncell = "1 um"\nunit = "um"\ndetrend = "plane"\nwindow = "hann"'
        contact, _ = read_contact(write(self.head + keys + self.material))
        assert contact.tip == HeightMap(self.heights, "1 um", unit="um", detrend="plane", window="hann")

    def test_hdf5_in_reduced_units(self, write, tmp_path):
        with h5py.File(tmp_path / "h.h5", "w") as file:
            file["a"] = self.heights[::-1]
            file["b"] = self.heights
        keys = 'file = "h.h5"\ndataset = "b"\ncell = 4.0'
        contact, _ = read_contact(write(self.head + keys + "\n[material]\nmodulus = 1"))
        assert contact.tip == HeightMap(self.heights, 4.0)
        assert contact.units == REDUCED

    @pytest.mark.parametrize(
        ("keys", "message"),
        [
            ('cell = "1 um"', "tip.file: missing; a height map needs a file"),
            ('file = "h.npy"', "tip.cell: missing; give the edge of the cell"),
            ('file = "h.npy"\ncell = "1 um"', "tip.file: has no unit, tip.cell has one; state unit"),
            ('file = "h.npy"\ncell = "1 um"\nunit = "GPa"', "tip.unit: '1 GPa': 'GPa' is not a unit of length"),
            ('file = "h.npy"\ncell = "1 um"\nunit = 3', "tip.unit: 3; must be a unit, for example 'nm'"),
            ('file = "no.npy"\ncell = "1 um"\nunit = "nm"', "tip.file: '.*no.npy': no such file"),
            ('file = "h.npy"\ncell = "-1 um"\nunit = "nm"', "tip.cell: -1000; must be greater than zero"),
            ('file = 3\ncell = "1 um"\nunit = "nm"', 'tip.file: 3; write for example file = "heights.npy"'),
            ('file = "h.npy"\ncell = "1 um"\nunit = "nm"\npeaks = 1', "tip.peaks: 1; write for example peaks = true"),
            ('file = "h.npy"\ncell = "1 um"\nheights = [1]', "tip.heights: not known; must be one of file, dataset"),
            ('file = "nan.npy"\ncell = "1 um"\nunit = "nm"', "tip.heights: 1 of 64 are not finite"),
        ],
    )
    def test_wrong(self, write, tmp_path, keys, message):
        np.save(tmp_path / "h.npy", self.heights)
        np.save(tmp_path / "nan.npy", np.where(self.heights.max() == self.heights, np.nan, self.heights))
        with pytest.raises(InputError, match=f"^{message}") as error:
            read_contact(write(self.head + keys + self.material))
        assert "\n" not in str(error.value)


def test_sums_and_layers(write):
    text = REDUCED_FILE.replace("exponential", "van-der-waals")
    text += '[[interaction]]\nlaw = "layered"\nwork_of_adhesion = -0.5\nrange = 0.5\nwavelength = 0.2\nphase = 0.3\n'
    contact, _ = read_contact(write(text))
    assert contact.interaction == VanDerWaals(1.0, 0.25) + Layered(-0.5, 0.5, 0.2, 0.3)


def test_phase_may_be_an_angle(write):
    law = 'law = "layered"\nwork_of_adhesion = "-1 mN/m"\nrange = "1 nm"\nwavelength = "0.8 nm"\nphase = {}'
    for phase in ('"45 deg"', str(math.pi / 4)):
        text = PHYSICAL_FILE.split("[[")[0] + "[[interaction]]\n" + law.format(phase)
        contact, _ = read_contact(write(text))
        assert contact.interaction.phase == pytest.approx(math.pi / 4)
        assert contact.interaction.wavelength == pytest.approx(0.8)


class TestTables:
    head = PHYSICAL_FILE.split("law =")[0] + 'law = "tabulated"\n'
    bare = REDUCED_FILE.split("law =")[0] + 'law = "tabulated"\n'
    gaps = np.linspace(0.0, 8.0, 41)

    def law(self, path):
        return read_contact(path)[0].interaction

    def test_lists(self, write):
        lists = "gaps = [0, 1, 2, 3]\nenergies = [-1, -0.3, -0.1, 0]"
        assert self.law(write(self.bare + lists)) == Tabulated([0, 1, 2, 3], [-1, -0.3, -0.1, 0])
        units = '\nlength_unit = "angstrom"\nenergy_unit = "mJ/m^2"'
        law = self.law(write(self.head + lists + units))
        np.testing.assert_allclose(law.gaps, [0, 0.1, 0.2, 0.3], rtol=1e-15)
        np.testing.assert_allclose(law.energies, [-1e-3, -3e-4, -1e-4, 0], rtol=1e-15)
        lists = "gaps = [0, 1, 2, 3]\npressures = [1, 0.3, 0.1, 0]"
        assert self.law(write(self.bare + lists)) == Tabulated([0, 1, 2, 3], pressures=[1, 0.3, 0.1, 0])

    @pytest.mark.parametrize("separator", [",", ", ", ";", " ", "\t", "   "])
    def test_file_beside_the_contact_file(self, write, separator):
        rows = [f"{gap}{separator}{10 * math.exp(-gap)}" for gap in self.gaps]
        write("# measured\ngap" + separator + "pressure\n\n" + "\n".join(rows) + " # the end\n", "law.csv")
        keys = 'file = "law.csv"\nquantity = "pressure"\nlength_unit = "nm"\npressure_unit = "MPa"'
        law = self.law(write(self.head + keys))
        assert law.pressures[0] == pytest.approx(0.01)
        assert law.gaps == pytest.approx(self.gaps)

    def test_energies_are_the_default(self, write):
        write("\n".join(f"{gap},{-math.exp(-gap)}" for gap in self.gaps), "law.csv")
        assert self.law(write(self.bare + 'file = "law.csv"')).energies[0] == -1.0

    def test_profile_from_a_file(self, write):
        write("radius height\n" + "\n".join(f"{r} {r * r / 2}" for r in range(6)), "tip.txt")
        text = '[tip]\nshape = "profile"\nfile = "tip.txt"\n[material]\nmodulus = 1'
        contact, _ = read_contact(write(text))
        assert contact.tip == Profile(range(6), [r * r / 2 for r in range(6)])
        assert contact.units == REDUCED

    @pytest.mark.parametrize(
        ("rows", "message"),
        [
            ("0 1\n1 x\n2 3", "interaction.file: .*law.csv, line 2: '1 x'; must be two numbers"),
            ("a b\nc d\n0 1", "line 2: 'c d'; must be two numbers"),
            ("0 1\n1 2 3\n", "line 2: 3 numbers; must be two columns"),
            ("0\n1\n", "line 1: 1 numbers; must be two columns"),
            ("", "interaction.gaps: shape"),
            ("0 1\n1 nan\n2 0\n3 0", "interaction.energies: nan; must be a finite number"),
            ("0 1\n1 0.5\n1 0.2\n3 0", "interaction.gaps: entry 3 is not above entry 2"),
        ],
    )
    def test_wrong_files(self, write, rows, message):
        write(rows, "law.csv")
        with pytest.raises(InputError, match=message) as error:
            read_contact(write(self.bare + 'file = "law.csv"'))
        assert "\n" not in str(error.value)

    @pytest.mark.parametrize(
        ("keys", "message"),
        [
            ('file = "none.csv"', "interaction.file: .*none.csv: no such file"),
            ("file = 3", "interaction.file: 3; must be the name of a text file"),
            ('file = "law.csv"\ngaps = [1]', "interaction.file: given with gaps or energies"),
            ("gaps = [0, 1, 2, 3]", "interaction.energies: missing; give the lists gaps and energies, or a file"),
            ("energies = [0, 1, 2, 3]", "interaction.gaps: missing"),
            ("gaps = 3\nenergies = [3, 2, 1, 0]", "interaction.gaps: 3; must be a list of numbers"),
            ('gaps = [0, "1 nm", 2, 3]\nenergies = [3, 2, 1, 0]', "interaction.gaps: '1 nm'; must be a number"),
            (
                "gaps = [0, 1, 2, 3]\nenergies = [3, 2, 1, 0]\npressures = [3, 2, 1, 0]",
                "interaction.energies: not known",
            ),
            ("gaps = [0, 1]\nenergies = [3, 2]\npressure_unit = 'GPa'", "interaction.energies: not known"),
            ('quantity = "force"', "interaction.quantity: 'force'; must be one of energy, pressure"),
            ("length_unit = 3\ngaps = [0, 1]\nenergies = [3, 2]", "interaction.length_unit: 3; must be a unit"),
            (
                'gaps = [0, 1]\nenergies = [3, 2]\nlength_unit = "nm"',
                "interaction.gaps: has a unit, tip.radius has none",
            ),
            ("gap = [0, 1]", r"interaction.gap: not known; .*; did you mean 'gaps'\?"),
        ],
    )
    def test_wrong_keys(self, write, keys, message):
        with pytest.raises(InputError, match=message) as error:
            read_contact(write(self.bare + keys))
        assert "\n" not in str(error.value)

    def test_units_of_tables_in_a_physical_file(self, write):
        lists = "gaps = [0, 1, 2, 3]\nenergies = [3, 2, 1, 0]\n"
        message = (
            "interaction.gaps: has no unit, tip.radius has one; state length_unit: units for all numbers or for none"
        )
        with pytest.raises(InputError, match=message):
            read_contact(write(self.head + lists))
        with pytest.raises(
            InputError, match=r"interaction.energies: has no unit, tip.radius has one; state energy_unit"
        ):
            read_contact(write(self.head + lists + 'length_unit = "nm"'))
        with pytest.raises(
            InputError, match=r"interaction.energy_unit: '1 GPa': 'GPa' is not a unit of energy per area"
        ):
            read_contact(write(self.head + lists + 'length_unit = "nm"\nenergy_unit = "GPa"'))


def test_options_of_the_trace(write):
    trace = '[trace]\ncontrol = "displacement"\naccuracy = 1e-8\nmax_load = "1 uN"\n'
    assert read_contact(write(PHYSICAL_FILE + trace))[1] == {
        "control": DISPLACEMENT,
        "accuracy": 1e-8,
        "max_load": 1000.0,
    }
    assert read_contact(write(PHYSICAL_FILE + '[trace]\ncontrol = "spring:0.1 N/m"'))[1] == {
        "control": Control("spring", 0.1)
    }
    assert read_contact(write(REDUCED_FILE + '[trace]\ncontrol = "spring:2"\nmax_load = 50'))[1] == {
        "control": Control("spring", 2.0),
        "max_load": 50.0,
    }
    cell = '[trace]\nmodel = "free"\ncell = "2 um"\ngrid = 128'
    assert read_contact(write(PHYSICAL_FILE + cell))[1] == {"model": "free", "cell": 2000.0, "grid": 128}


@pytest.mark.parametrize(
    ("control", "units", "wanted"),
    [
        ("load", REDUCED, LOAD),
        ("displacement", PHYSICAL, DISPLACEMENT),
        ("spring:2", REDUCED, Control("spring", 2.0)),
        ("spring:100 mN/m", PHYSICAL, Control("spring", 0.1)),
        ("spring: 3", PHYSICAL, Control("spring", 3.0)),
    ],
)
def test_control(control, units, wanted):
    assert as_control(control, units) == wanted


@pytest.mark.parametrize(
    ("control", "units", "message"),
    [
        ("force", REDUCED, "control: 'force'; must be load, displacement or spring:2"),
        ("displacment", PHYSICAL, r"must be load, displacement or spring:0.1 N/m; did you mean 'displacement'\?"),
        ("spring", REDUCED, "control: 'spring'; must be"),
        ("spring:", REDUCED, "control: 'spring:'; must be"),
        ("spring:0", REDUCED, "control: 0; must be greater than zero"),
        ("spring:-1 N/m", PHYSICAL, "control: -1; must be greater than zero"),
        ("spring:1 N/m", REDUCED, "control: '1 N/m'; the contact is in reduced units"),
        ("spring:1 nN", PHYSICAL, "control: '1 nN': 'nN' is not a unit of stiffness"),
        (3, REDUCED, "control: 3; must be"),
    ],
)
def test_wrong_control(control, units, message):
    with pytest.raises(InputError, match=message):
        as_control(control, units)


def _with(old, new, text=PHYSICAL_FILE):
    assert old in text
    return text.replace(old, new)


WRONG = {
    "syntax": (_with("[material]", "[material"), r"contact.toml: .*line 5.*; must be TOML"),
    "unknown table": (PHYSICAL_FILE + "[tracing]\n", r"^tracing: not known; .*; did you mean 'trace'\?"),
    "unknown key": (
        _with("radius", "raduis"),
        r"^tip.raduis: not known; must be one of radius; did you mean 'radius'\?",
    ),
    "unknown key of a law": (
        _with("range", "z0"),
        r"^interaction.z0: not known; must be one of work_of_adhesion, range",
    ),
    "unknown key of the material": (_with("modulus", "module"), r"^material.module: not known; .*'modulus'"),
    "unknown shape": (_with('"parabola"', '"sphere"'), r"^tip.shape: 'sphere'; must be one of .*'wavy-sphere'\?"),
    "unknown law": (_with('"gauss"', '"gaussian"'), r"^interaction.law: 'gaussian'; must be .* did you mean 'gauss'\?"),
    "law with underscores": (_with('"gauss"', '"van_der_waals"'), r"did you mean 'van-der-waals'\?"),
    "no shape": (_with('shape = "parabola"', ""), r"^tip.shape: missing; must be one of parabola"),
    "no radius": (_with('radius = "1 um"', ""), r"^tip.radius: missing"),
    "no law": (_with('law = "gauss"', ""), r"^interaction.law: missing; must be one of exponential"),
    "no range": (_with('range = "1 nm"', ""), r"^interaction.range: missing"),
    "no modulus": (_with('modulus = "5 GPa"', ""), r"^material.modulus: missing"),
    "tip that is no table": ("tip = 5", r"^tip: 5; must be a table \[tip\]"),
    "no tip": ('[material]\nmodulus = "5 GPa"', r"^tip: missing; the contact file needs a table \[tip\]"),
    "no material": ('[tip]\nshape = "parabola"\nradius = 1', r"^material: missing"),
    "empty": ("", r"^tip: missing"),
    "wrong unit": (_with('"1 um"', '"1 GPa"'), r"^tip.radius: '1 GPa': 'GPa' is not a unit of length; write .*'1 um'"),
    "unknown unit": (_with('"5 GPa"', '"5 GPz"'), r"^material.modulus: '5 GPz': 'GPz' is not a unit"),
    "text for a number": (_with('"1 um"', '"large"'), r"^tip.radius: 'large' is not a number with a unit"),
    "negative radius": (_with('"1 um"', '"-1 um"'), r"^tip.radius: -1000; must be greater than zero"),
    "zero modulus": (_with('"5 GPa"', '"0 GPa"'), r"^material.modulus: 0; must be greater than zero"),
    "negative range": (_with('"1 nm"', '"-1 nm"'), r"^interaction.range: -1; must be greater than zero"),
    "no work of adhesion": (_with('"-40 mN/m"', '"0 mN/m"'), r"^interaction.work_of_adhesion: 0; must not be zero"),
    "nan": (_with("0.25", "nan", REDUCED_FILE), r"^interaction.range: nan; must be a finite number"),
    "inf": (_with("radius = 1", "radius = inf", REDUCED_FILE), r"^tip.radius: inf; must be a finite number"),
    "boolean": (_with("radius = 1", "radius = true", REDUCED_FILE), r"^tip.radius: True; must be a number"),
    "list": (_with("radius = 1", "radius = [1]", REDUCED_FILE), r"^tip.radius: is a list; must be one number"),
    "mixed, bare": (_with('"5 GPa"', "5.0"), r"^material.modulus: has no unit, tip.radius has one; add the unit"),
    "mixed, unit": (
        _with("0.25", '"1 nm"', REDUCED_FILE),
        r"^interaction.range: has a unit, tip.radius has none; drop",
    ),
    "mixed, load": (PHYSICAL_FILE + "[trace]\nmax_load = 5", r"^trace.max_load: has no unit, tip.radius has one"),
    "single interaction": (_with("[[interaction]]", "[interaction]"), r"^interaction: is a single table; write \[\["),
    "tip is no table": ("tip = 3\n[material]\nmodulus = 1", r"^tip: 3; must be a table \[tip\]"),
    "law is no table": ("interaction = [3]\n" + REDUCED_FILE.split("[[")[0], r"^interaction: 3; must be a table"),
    "second law": (PHYSICAL_FILE + '[[interaction]]\nlaw = "gaus"', r"^interaction\[1\].law: 'gaus'"),
    "unknown option": (
        REDUCED_FILE + "[trace]\nprecision = 1e-3",
        r"^trace.precision: not known; must be one of control",
    ),
    "wrong accuracy": (REDUCED_FILE + "[trace]\naccuracy = -1e-3", r"^trace.accuracy: -0.001; must be between 0 and 1"),
    "wrong model": (
        REDUCED_FILE + '[trace]\nmodel = "periodical"',
        r"^trace.model: 'periodical'; must be one of auto, .*; did you mean 'periodic'\?",
    ),
    "model is no text": (REDUCED_FILE + "[trace]\nmodel = 3", r"^trace.model: 3; must be one of auto"),
    "wrong cell": (REDUCED_FILE + "[trace]\ncell = 0", r"^trace.cell: 0; must be greater than zero"),
    "cell without unit": (PHYSICAL_FILE + "[trace]\ncell = 5", r"^trace.cell: has no unit, tip.radius has one"),
    "wrong grid": (REDUCED_FILE + "[trace]\ngrid = 127", r"^trace.grid: 127; must be a whole and even .* 128$"),
    "wrong control": (REDUCED_FILE + '[trace]\ncontrol = "force"', r"^trace.control: 'force'; must be load"),
    "phase": (
        _with("range = 0.25", "range = 0.25\nwavelength = 1\nphase = 1.5707963267948966", REDUCED_FILE).replace(
            "exponential", "layered"
        ),
        r"^interaction.phase: 1.5708; must not be an odd multiple",
    ),
}


@pytest.mark.parametrize(("text", "message"), WRONG.values(), ids=WRONG)
def test_wrong_files(write, text, message):
    with pytest.raises(InputError, match=message) as error:
        read_contact(write(text))
    assert "\n" not in str(error.value)


def test_missing_file(tmp_path):
    with pytest.raises(InputError, match=r"nowhere.toml: no such file; give the path"):
        read_contact(tmp_path / "nowhere.toml")
    with pytest.raises(InputError, match=r": Is a directory; must be a readable text file"):
        read_contact(tmp_path)
    (tmp_path / "binary.toml").write_bytes(b"\xff\xfe\x00")
    with pytest.raises(InputError, match=r"binary.toml: not UTF-8 text; must be"):
        read_contact(tmp_path / "binary.toml")


@pytest.mark.parametrize(
    ("text", "unit", "words"),
    [
        (
            "r [um],z [um]\n0,0\n0.5,0.1\n1,0.5\n2,2\n",
            "nm",
            r"tip.csv, line 1: .* has the unit um, and the contact file says nm",
        ),
        ("r [nm],z [nm]\n0,0\n0.5,0.1\n1,0.5\n2,2\n", "nm", None),
        ("0;0\n0,5;0,1\n1;0,5\n2;2\n", "nm", None),
    ],
)
def test_columns_of_files_say_their_units_and_may_have_decimal_commas(tmp_path, text, unit, words):
    (tmp_path / "tip.csv").write_text(text)
    file = tmp_path / "c.toml"
    tip = f'shape = "profile"\nfile = "tip.csv"\nlength_unit = "{unit}"'
    file.write_text(f'[tip]\n{tip}\n[material]\nmodulus = "1 GPa"\n')
    if words is not None:
        with pytest.raises(InputError, match=words):
            Contact.from_file(file)
        return
    assert list(Contact.from_file(file).tip.radii) == [0.0, 0.5, 1.0, 2.0]


def test_a_slope_is_no_angle_and_a_minus_may_be_typeset():
    with pytest.raises(InputError, match="slope: '45 deg' is an angle"):
        Contact.physical(tip="cone", slope="45 deg", modulus="1 GPa")
    made = Contact.physical(radius="1 um", modulus="1 GPa", interaction="gauss", work_of_adhesion="−40 mN/m", range=1.0)
    assert made.interaction.work_of_adhesion == -0.04
