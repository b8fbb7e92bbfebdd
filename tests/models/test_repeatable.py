"""A trace does not depend on what was traced before it."""

from __future__ import annotations

import numpy as np

import contbranch as cb
from contbranch.models.axisymmetric import mesh

CONTACTS = [
    cb.Contact.reduced(law, tabor, sign)
    for law, tabors in ((cb.Gauss, (0.7, 4.0)), (cb.VanDerWaals, (4.0, 2.0)))
    for tabor, sign in zip(tabors, (1, -1), strict=True)
]


def numbers(contact):
    diagram = cb.trace(contact, accuracy=1e-4, max_load=1.0, modes=0)
    branch = diagram.branches[0]
    return np.concatenate([branch.load, branch.displacement, branch.contact_radius, [e.load for e in diagram.events]])


def test_every_digit_is_the_same_whatever_came_before():
    """Parts of meshes that earlier traces have left behind are those that a trace would make itself."""
    alone = []
    for contact in CONTACTS:
        mesh.forget()
        alone.append(numbers(contact))
    for contact, known in reversed(list(zip(CONTACTS, alone, strict=True))):
        np.testing.assert_array_equal(numbers(contact), known)
