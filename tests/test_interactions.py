"""Laws against their formulas: (12) and what is said of it for the energies, mpmath for derivatives and integrals."""

import dataclasses
import math

import mpmath as mp
import numpy as np
import pytest

from contbranch.contact.contact import Contact
from contbranch.contact.interactions import (
    INTERACTIONS,
    Exponential,
    Gauss,
    Interaction,
    InverseSquare,
    Layered,
    LennardJones,
    MaugisDugdale,
    Sum,
    Tabulated,
    VanDerWaals,
)
from contbranch.contact.tips import Parabola
from contbranch.errors import InputError

WORK, RANGE = -0.7, 0.4
GAPS = np.array([-0.05, 0.0, 1e-9, 0.03, 0.2, 0.39, 0.41, 1.0, 3.0, 40.0])

# law and f(x) of v = -Δγ f(g/z0) at any precision
LAWS = {
    "exponential": (Exponential(WORK, RANGE), lambda x: mp.exp(-x)),
    "gauss": (Gauss(WORK, RANGE), lambda x: mp.exp(-(x**2) / 2)),
    "van-der-waals": (VanDerWaals(WORK, RANGE), lambda x: 1 / (1 + x**2)),
    "inverse-square": (InverseSquare(WORK, RANGE), lambda x: 1 / (1 + x) ** 2),
    "layered": (
        Layered(WORK, RANGE, wavelength=0.3, phase=0.5),
        lambda x: mp.exp(-x) * mp.cos(2 * mp.pi * x * mp.mpf(RANGE) / mp.mpf(0.3) + 0.5) / mp.cos(0.5),
    ),
}
LAWS["lennard-jones"] = (LennardJones(WORK, RANGE), lambda x: (4 / (1 + x) ** 2 - 1 / (1 + x) ** 8) / 3)
smooth_laws = pytest.mark.parametrize(("law", "shape"), LAWS.values(), ids=LAWS)
all_laws = pytest.mark.parametrize(
    "law",
    [
        *(law for law, _ in LAWS.values()),
        MaugisDugdale(WORK, RANGE),
        Tabulated(np.linspace(0.0, 8.0, 60), -np.exp(-np.linspace(0.0, 8.0, 60))),
        VanDerWaals(0.3, 0.5) + Exponential(-1.0, 0.2),
    ],
    ids=lambda law: law.name or "sum",
)


@smooth_laws
def test_energy_pressure_and_stiffness(law, shape):
    energy, pressure, stiffness = law.evaluate(GAPS)
    with mp.workdps(30):

        def v(g):
            return -mp.mpf(WORK) * shape(g / mp.mpf(RANGE))

        for k, gap in enumerate(GAPS):
            g = mp.mpf(gap)
            # relative to the size of the envelope, because the layered law has zeros
            size = abs(WORK) * float(abs(shape(g / RANGE))) + 1e-2 * abs(WORK) * math.exp(-abs(gap) / RANGE)
            assert energy[k] == pytest.approx(float(v(g)), abs=1e-14 * size)
            assert pressure[k] == pytest.approx(float(-mp.diff(v, g)), rel=1e-13, abs=1e-12 * size)
            assert stiffness[k] == pytest.approx(float(mp.diff(v, g, 2)), rel=1e-12, abs=1e-11 * size)


@smooth_laws
def test_derivatives_by_complex_steps(law, shape):
    step = 1e-30
    for gap in (0.0, 0.03, 0.7, 2.0):
        energy, pressure, stiffness = law.evaluate(np.array([gap + 1j * step]))
        assert pressure[0].real == pytest.approx(-energy[0].imag / step, rel=1e-13, abs=1e-15)
        assert stiffness[0].real == pytest.approx(-pressure[0].imag / step, rel=1e-12, abs=1e-14)


@all_laws
def test_derivatives_by_differences(law):
    step = 1e-4
    gap = np.array([0.011, 0.13, 0.33, 1.234, 5.0])
    middle = law.evaluate(gap)
    energies = [law.evaluate(gap + k * step).energy for k in (-2, -1, 1, 2)]
    pressures = [law.evaluate(gap + k * step).pressure for k in (-2, -1, 1, 2)]
    weights = np.array([1.0, -8.0, 8.0, -1.0]) / (12.0 * step)  # fourth order
    np.testing.assert_allclose(-weights @ energies, middle.pressure, atol=1e-8)
    np.testing.assert_allclose(-weights @ pressures, middle.stiffness, atol=1e-7)


@all_laws
def test_work_of_adhesion_is_the_energy_at_contact(law):
    energy = law.evaluate(0.0).energy
    assert float(energy) == pytest.approx(-law.work_of_adhesion, rel=1e-14)
    f, slope, curvature = law.shape(np.array([0.0, 0.3]))
    assert f[0] == pytest.approx(1.0, rel=1e-14)
    response = law.evaluate(law.range * np.array([0.0, 0.3]))
    np.testing.assert_allclose(response.energy, -law.work_of_adhesion * f, rtol=1e-13)
    np.testing.assert_allclose(response.pressure, law.work_of_adhesion / law.range * slope, rtol=1e-12, atol=1e-14)
    np.testing.assert_allclose(response.stiffness, -law.work_of_adhesion / law.range**2 * curvature, rtol=1e-12)


@all_laws
def test_far_away_there_is_nothing(law):
    for values in law.evaluate(np.array([1e30, 1e200, math.inf])):  # outside a tip of finite extent gaps are infinite
        np.testing.assert_array_equal(np.abs(values) < 1e-50, True)
    assert all(np.isnan(values[0]) for values in law.evaluate(np.array([math.nan])))


@all_laws
def test_deep_inside_the_wall_there_is_no_warning(law):
    # a solver may try such gaps on its way; warnings are errors in these tests
    law.evaluate(np.array([-1e4, -law.range, -0.3, 0.0]))


@all_laws
def test_arrays_keep_their_shape(law):
    for shape in ((), (3,), (2, 3)):
        assert all(np.shape(values) == shape for values in law.evaluate(np.full(shape, 0.2)))


@all_laws
@pytest.mark.parametrize("tolerance", [1e-1, 1e-4, 1e-8, 1e-12])
def test_reach(law, tolerance):
    reach = law.reach(tolerance)
    beyond = reach * np.concatenate([[1.0], 1.0 + np.geomspace(1e-6, 1e3, 400)]) + 1e-9 * law.range
    assert np.all(np.abs(law.evaluate(beyond).energy) <= tolerance * law.reference_work * (1 + 1e-6))
    # and it is not far beyond what is needed: a tenth of it is not enough for any of these laws
    inside = np.linspace(0.1 * reach, reach, 2000)
    assert np.max(np.abs(law.evaluate(inside).energy)) > tolerance * law.reference_work


def test_maugis_dugdale_ends_at_its_range():
    # (12): pressure -Δγ/z0 up to g = z0
    law = MaugisDugdale(2.0, 0.5)
    np.testing.assert_allclose(law.evaluate([-0.1, 0.0, 0.2, 0.5, 0.7]).energy, [-2.4, -2.0, -1.2, 0.0, 0.0])
    np.testing.assert_allclose(law.evaluate([-0.1, 0.0, 0.2, 0.5, 0.7]).pressure, [-4.0, -4.0, -4.0, 0.0, 0.0])


def test_layered_law_oscillates_under_its_envelope():
    # zeros of cos(2πg/λ) at odd quarters of the wavelength; e^(-g/z0) at whole ones
    law = Layered(1.0, 0.5, wavelength=0.4)
    np.testing.assert_allclose(law.evaluate([0.1, 0.3]).energy, 0.0, atol=1e-15)
    np.testing.assert_allclose(law.evaluate([0.4, 0.8]).energy, -np.exp([-0.8, -1.6]), rtol=1e-14)


class TestUsersOwn:
    class Plain(Interaction):
        def shape(self, x):
            u = 1.0 / (1.0 + x * x)
            return u, -2.0 * x * u**2, (6.0 * x**2 - 2.0) * u**3

    @dataclasses.dataclass(frozen=True)
    class Stretched(Interaction):
        power: float = 1.0

        def shape(self, x):
            f = np.exp(-self.power * x)
            return f, -self.power * f, self.power**2 * f

    def test_one_without_a_name_is_called_by_its_class(self):
        contact = Contact(Parabola(1.0), self.Plain(-0.9, 0.3) + Exponential(0.1, 1.0))
        assert "parabola with repulsive Plain + exponential" in contact.brief

    def test_one_method_is_enough(self):
        for mine, known in (
            (self.Plain(0.9, 0.3), VanDerWaals(0.9, 0.3)),
            (self.Stretched(-0.9, 0.3, 1.5), Exponential(-0.9, 0.2)),
        ):
            gap = np.linspace(0.0, 3.0, 7)
            for value, wanted in zip(mine.evaluate(gap), known.evaluate(gap), strict=True):
                np.testing.assert_allclose(value, wanted, rtol=1e-13)
            for tolerance in (1e-2, 1e-6, 1e-12):
                assert mine.reach(tolerance) == pytest.approx(known.reach(tolerance), rel=1e-8)
            total = mine + known
            np.testing.assert_allclose(total.evaluate(gap).energy, 2.0 * known.evaluate(gap).energy, rtol=1e-13)

    def test_one_with_its_own_way_of_being_made(self):
        class Power(Interaction):
            def __init__(self, exponent):
                super().__init__(1.0, 0.5)
                self.exponent = exponent

            def shape(self, x):
                n = self.exponent
                return (1 + x) ** -n, -n * (1 + x) ** (-n - 1), n * (n + 1) * (1 + x) ** (-n - 2)

        gap = np.array([0.0, 0.7])
        other, wanted = Power(2.0).scaled(2.0, 4.0), InverseSquare(0.25, 0.25)
        np.testing.assert_allclose(other.evaluate(gap).pressure, wanted.evaluate(gap).pressure, rtol=1e-14)

    def test_without_shape(self):
        class Empty(Interaction):
            pass

        with pytest.raises(NotImplementedError, match=r"Empty must define shape\(x\)"):
            Empty(1.0, 1.0).evaluate(0.0)

    def test_one_that_does_not_decay(self):
        class Constant(Interaction):
            def shape(self, x):
                return np.ones_like(x), 0.0 * x, 0.0 * x

        with pytest.raises(InputError, match="Constant has not decayed"):
            Constant(1.0, 1.0).reach(1e-3)

    def test_one_that_fails_far_away_reaches_to_its_end(self):
        class Short(Interaction):
            def shape(self, x):
                f = np.where(x < 2.0, np.exp(-x), math.nan)
                return f, -f, f

        assert Short(1.0, 0.5).reach(1e-9) == pytest.approx(1.0, rel=1e-2)


class TestSum:
    first, second, third = VanDerWaals(2.0, 0.5), Exponential(-3.0, 0.1), Gauss(0.5, 1.0)

    def test_adds_up(self):
        total = self.first + self.second + self.third
        assert total.terms == (self.first, self.second, self.third)
        assert total == sum([self.first, self.second, self.third]) == self.first + (self.second + self.third)
        for k in range(3):
            np.testing.assert_allclose(
                total.evaluate(GAPS)[k], sum(law.evaluate(GAPS)[k] for law in total.terms), rtol=1e-12, atol=1e-15
            )

    def test_works(self):
        total = self.first + self.second + self.third
        assert total.work_of_adhesion == pytest.approx(-0.5)  # 2 - 3 + 0.5
        assert total.reference_work == pytest.approx(5.5)  # 2 + 3 + 0.5
        assert total.range == 0.1  # of the strongest
        assert (Exponential(1.0, 1.0) + Exponential(-1.0, 0.5)).reference_work == 2.0

    def test_other_things_do_not_add(self):
        with pytest.raises(TypeError):
            self.first + 1
        with pytest.raises(InputError, match="laws: none"):
            Sum(())


@all_laws
def test_scaled_law_is_the_same_law(law):
    normal, energy = 3.7, 0.45
    other = law.scaled(normal, energy)
    gap = np.array([0.0, 0.02, 0.3, 1.7])
    v, p, s = law.evaluate(gap)
    scaled_v, scaled_p, scaled_s = other.evaluate(gap / normal)
    np.testing.assert_allclose(scaled_v, v / energy, rtol=1e-11, atol=1e-14)
    np.testing.assert_allclose(scaled_p, p / energy * normal, rtol=1e-10, atol=1e-13)
    np.testing.assert_allclose(scaled_s, s / energy * normal**2, rtol=1e-8, atol=1e-10)
    assert other.reference_work == pytest.approx(law.reference_work / energy, rel=1e-12)
    assert type(other) is type(law)


class TestTabulated:
    gaps = np.linspace(0.0, 10.0, 201)

    def test_energies(self):
        # the table of an exponential: interpolation error of order h⁴ = 6e-6 over 24, h³ and h² for the derivatives
        law, known = Tabulated(self.gaps, -0.7 * np.exp(-self.gaps)), Exponential(0.7, 1.0)
        gap = np.linspace(0.0, 9.0, 333)
        for order, (value, wanted) in enumerate(zip(law.evaluate(gap), known.evaluate(gap), strict=True)):
            np.testing.assert_allclose(value, wanted, rtol=0.0, atol=[2e-7, 2e-5, 3e-3][order])
        assert law.work_of_adhesion == pytest.approx(0.7)
        assert law.range == pytest.approx(1.0, rel=1e-4)

    def test_pressures(self):
        law, known = Tabulated(self.gaps, pressures=np.exp(-self.gaps)), Exponential(-1.0, 1.0)
        gap = np.linspace(0.0, 9.0, 333)
        for order, (value, wanted) in enumerate(zip(law.evaluate(gap), known.evaluate(gap), strict=True)):
            np.testing.assert_allclose(value, wanted, rtol=0.0, atol=[4e-5, 3e-7, 4e-5][order])
        assert law.work_of_adhesion == pytest.approx(-1.0, abs=4e-5)  # what lies beyond the table, e^-10, is a guess

    @pytest.mark.parametrize("kind", ["energies", "pressures"])
    def test_smooth_to_the_second_derivative_everywhere(self, kind):
        law = Tabulated(self.gaps[:121], **{kind: np.exp(-self.gaps[:121])})  # ends at 6: e^-6 is below 1 %
        joints = np.concatenate([self.gaps[1:121], law._table.energy.x[-2:-1]])
        assert law._table.energy.x[-2] > 6.0
        for before, after in zip(law.evaluate(joints - 1e-12), law.evaluate(joints + 1e-12), strict=True):
            np.testing.assert_allclose(before, after, atol=1e-9)
        assert law.limitation == ""
        assert all(values[0] == 0.0 for values in law.evaluate(np.array([law._table.energy.x[-2] + 1e-9])))

    def test_the_way_to_zero_does_not_overshoot(self):
        law = Tabulated(self.gaps[:101], np.exp(-self.gaps[:101]))  # ends at 5
        tail = np.linspace(5.0, law._table.energy.x[-2], 200)
        energy, pressure, _ = law.evaluate(tail)
        assert np.all(energy >= -1e-12)
        assert np.all(pressure >= -1e-12)

    def test_a_table_that_ends_too_early(self):
        law = Tabulated(self.gaps[:41], np.exp(-self.gaps[:41]))  # ends at 2: 14 %
        for before, after in zip(law.evaluate(2.0 - 1e-9), law.evaluate(2.0 + 1e-9), strict=True):
            assert before == pytest.approx(after, abs=1e-8)
        assert law.limitation == "the table of energies ends at a gap of 2 before the law has decayed"
        assert law.ends == 2.0
        assert (law + Exponential(1.0, 1.0)).ends == 2.0
        assert "gap of 2 before" in (law + Exponential(1.0, 1.0)).limitation

    def test_scatter_is_smoothed_away_and_told(self):
        rng = np.random.default_rng(1)
        gaps = np.linspace(0.0, 10.0, 80)
        law = Tabulated(gaps, np.exp(-gaps) + 1e-3 * rng.normal(size=gaps.size))
        assert "scatters by 0.0009" in law.limitation or "scatters by 0.00088" in law.limitation
        at = np.linspace(0.0, 12.0, 500)
        energy, pressure, stiffness = law.evaluate(at)
        assert np.abs(energy - np.exp(-at)).max() < 3e-3
        assert np.abs(pressure - np.exp(-at)).max() < 0.02
        assert np.abs(stiffness[40:] - np.exp(-at[40:])).max() < 0.1
        assert Tabulated(gaps, np.exp(-gaps)).limitation == ""

    @pytest.mark.parametrize("kind", [Exponential, Gauss])
    def test_coarse_tables_of_what_decays(self, kind):
        # logarithms of these are polynomials: nine rows tell all, far down the tail, too
        known, gaps = kind(-1.0, 1.0), np.linspace(0.0, 8.0, 9)
        law, at = Tabulated(gaps, known.evaluate(gaps).energy), np.linspace(0.0, 8.0, 500)
        for value, wanted in zip(law.evaluate(at), known.evaluate(at), strict=True):
            np.testing.assert_allclose(value, wanted, rtol=1e-6, atol=1e-8)

    @pytest.mark.parametrize("kind", [Exponential, Gauss, VanDerWaals, InverseSquare])
    @pytest.mark.parametrize(("rows", "end", "scatter"), [(9, 8.0, 0.0), (40, 10.0, 1e-3), (30, 2.0, 0.0)])
    def test_tables_have_no_turns_of_their_own(self, kind, rows, end, scatter):
        gaps = np.linspace(0.0, end, rows)
        energies = kind(1.0, 1.0).evaluate(gaps).energy + scatter * np.random.default_rng(7).normal(size=rows)
        law = Tabulated(gaps, energies)
        _, pressure, stiffness = law.evaluate(np.linspace(0.05, 30.0, 3000))
        assert np.all(pressure <= 0.02 * law.evaluate(0.1).pressure.clip(0.0) + 1e-12)
        assert np.count_nonzero(np.diff(np.sign(stiffness[np.abs(stiffness) > 1e-9]))) <= 1

    def test_a_constant_is_not_taken_for_energy(self):
        # energies measured from a wrong zero: no force, but not decayed either
        assert Tabulated(self.gaps, 1.0 + np.exp(-self.gaps)).limitation != ""

    @pytest.mark.parametrize(
        ("values", "message"),
        [
            ({"gaps": [0, 1, 2, 3]}, "energies, pressures: give one of them"),
            (
                {"gaps": [0, 1, 2, 3], "energies": [4, 3, 2, 1], "pressures": [1, 1, 1, 1]},
                "energies, pressures: give one",
            ),
            ({"gaps": [0, 1, 2, 3], "energies": [4, 3, 2]}, "energies: shape"),
            ({"gaps": [0, 1, 2, 3, 4], "energies": [4, 3, 2, 1]}, "energies: 4 numbers for 5 gaps"),
            ({"gaps": [0.1, 1, 2, 3], "energies": [4, 3, 2, 1]}, "gaps: the first is 0.1; must start at 0"),
            ({"gaps": [0, 2, 1, 3], "energies": [4, 3, 2, 1]}, "gaps: entry 3 is not above entry 2"),
            ({"gaps": [0, 1, 2, 3], "energies": [4, math.nan, 2, 1]}, "energies: entry 2 is nan"),
            ({"gaps": [0, 1, 2, 3], "pressures": [4, "high", 2, 1]}, "pressures: not all are numbers"),
            ({"gaps": [0, 1, 2, 3], "energies": [0, 0, 0, 0]}, "gaps: the law has no energy at gap 0"),
            ({"gaps": 3.0, "energies": [4, 3, 2, 1]}, "gaps: shape"),
        ],
    )
    def test_wrong_tables(self, values, message):
        with pytest.raises(InputError, match=message) as error:
            Tabulated(**values)
        assert "\n" not in str(error.value)


@pytest.mark.parametrize("kind", [Exponential, Gauss, VanDerWaals, InverseSquare, MaugisDugdale])
def test_wrong_numbers_are_refused(kind):
    for value in (0.0, -1.0, math.nan, math.inf, "1 nm", None, True):
        with pytest.raises(InputError, match=r"^range: .*; must be") as error:
            kind(1.0, value)
        assert "\n" not in str(error.value)
    for value in (0.0, math.nan, -math.inf, "1 mN/m", None):
        with pytest.raises(InputError, match=r"^work_of_adhesion: .*; must"):
            kind(value, 1.0)


def test_a_layer_is_as_thick_as_the_range_unless_said_otherwise():
    assert Layered(1.0, 0.4) == Layered(1.0, 0.4, wavelength=0.4)
    assert Layered(1.0, 0.4).scaled(2.0, 1.0) == Layered(1.0, 0.2, wavelength=0.2)


def test_wrong_numbers_of_layers_are_refused():
    with pytest.raises(InputError, match=r"^wavelength: 0; must be"):
        Layered(1.0, 1.0, wavelength=0)
    with pytest.raises(InputError, match=r"^phase: 1.5708; must not be an odd multiple"):
        Layered(1.0, 1.0, wavelength=1.0, phase=math.pi / 2)
    with pytest.raises(InputError, match=r"^phase: nan; must be"):
        Layered(1.0, 1.0, wavelength=1.0, phase=math.nan)


@all_laws
def test_laws_are_immutable_values(law):
    with pytest.raises(dataclasses.FrozenInstanceError):
        law.range = 2.0
    again = type(law)(**law.parameters())
    assert again == law
    assert hash(again) == hash(law)


def test_laws_differ():
    assert Gauss(1.0, 1.0) != Exponential(1.0, 1.0)
    assert Gauss(1.0, 1.0) == Gauss(1, 1) != Gauss(1.0, 2.0)


def test_every_law_is_found_by_its_name():
    names = ["exponential", "gauss", "van-der-waals", "inverse-square", "maugis-dugdale", "layered", "lennard-jones"]
    names += ["double-layer", "tabulated"]
    assert set(names) == set(INTERACTIONS)
    assert all(INTERACTIONS[name].name == name for name in names)


@pytest.mark.parametrize("kind", ["energies", "pressures"])
def test_what_takes_a_table_to_zero_does_not_swing(kind):
    """Beyond its last row a law is no stronger than there, or than its slope there takes it in one row."""
    rng = np.random.default_rng(5)
    gaps = np.linspace(0.0, 3.0, 61)
    for _ in range(60):
        depth, place, width = 10.0 ** rng.uniform(-4, -2), rng.uniform(2.3, 2.95), rng.uniform(10.0, 150.0)
        values = np.exp(-3.0 * gaps) - depth * np.exp(-width * (gaps - place) ** 2)
        law = Tabulated(tuple(gaps), **{kind: tuple(values)})
        beyond = np.linspace(3.0, 12.0, 3001)
        answer = law.evaluate(beyond)
        found = answer.energy if kind == "energies" else answer.pressure
        rise = abs(values[-1] - values[-2]) * 2.0
        assert np.abs(found).max() <= abs(values[-1]) + rise
        assert abs(found[-1]) <= 1e-6 * abs(values[-1])
        if abs(values[-1]) > 2.0 * rise:  # it does not come to zero within a row
            assert (found * np.sign(values[-1])).min() >= -0.06 * abs(values[-1])
