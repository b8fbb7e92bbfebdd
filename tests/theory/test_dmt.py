"""DMT, eq. (27) of the paper."""

import numpy as np
import pytest

from contbranch.errors import InputError
from contbranch.theory import dmt, maugis


def test_contact_radius_in_reduced_units():
    # (27): a^3 = (3/4) (F + 2 pi)
    force = np.array([-6.0, 0.0, 5.0])
    np.testing.assert_allclose(dmt.contact_radius(force) ** 3, 0.75 * (force + 2.0 * np.pi), rtol=1e-14)
    assert float(dmt.contact_radius(-2.0 * np.pi)) == 0.0


def test_general_constants_and_inverse():
    options = {"radius": 2.0, "modulus": 3.0, "work_of_adhesion": 0.5}
    a = np.array([0.1, 1.0, 4.0])
    np.testing.assert_allclose(dmt.load(a, **options), 2.0 * a**3 - 2.0 * np.pi, rtol=1e-14)
    np.testing.assert_allclose(dmt.contact_radius(dmt.load(a, **options), **options), a, rtol=1e-12)
    np.testing.assert_allclose(dmt.displacement(a, radius=2.0), a**2 / 2.0, rtol=1e-15)


def test_maugis_dugdale_approaches_it_for_long_range():
    # the exact load at a given contact radius differs by O(mu_T) (50)
    a = np.array([0.5, 2.0])
    errors = [np.max(np.abs(maugis.contact(a, interaction_range=1.0 / mu).load - dmt.load(a))) for mu in (1e-3, 1e-5)]
    assert errors[0] < 0.03
    assert errors[0] / errors[1] == pytest.approx(100.0, rel=0.05)


def test_lower_loads_are_refused():
    with pytest.raises(InputError, match=r"^load must be at least -6\.28"):
        dmt.contact_radius(-6.4)
