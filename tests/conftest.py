"""Diagrams made of closed forms, for what is done with a diagram once it is traced."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from contbranch.contact.contact import Contact
from contbranch.contact.units import PHYSICAL
from contbranch.results.diagram import (
    Branch,
    Cost,
    Diagram,
    Event,
    Exponent,
    LocalExponent,
    ModelChoice,
    Profile,
    Window,
)
from contbranch.theory import maugis

R, E, WORK, RANGE = 1000.0, 5.0, 0.04, 1.0
"""1 µm, 5 GPa, 40 mN/m and 1 nm in nN and nm."""


def maugis_diagram() -> Diagram:
    """The closed-form Maugis-Dugdale curve of a physical contact: far away, through first touch, into contact."""
    constants = {"radius": R, "modulus": E, "work_of_adhesion": WORK, "interaction_range": RANGE}
    contact = Contact.physical(radius=R, modulus=E, interaction="maugis-dugdale", work_of_adhesion=WORK, range=RANGE)
    touch = maugis.first_touch(**constants)
    apart = maugis.separated(np.linspace(0.0, 1.0, 40)[:-1] * touch.interaction_radius, **constants)
    joined = maugis.contact(np.linspace(0.0, 60.0, 120), **constants)
    columns = [np.concatenate(pair) for pair in zip(apart, joined, strict=True)]
    curve = dict(zip(maugis.Curve._fields, columns, strict=True))
    slope_load, slope_d = np.gradient(curve["load"]), np.gradient(curve["displacement"])
    branch = Branch(
        load=curve["load"],
        displacement=curve["displacement"],
        contact_radius=curve["contact_radius"],
        central_gap=curve["central_gap"],
        energy=curve["energy"],
        unstable_load=(slope_load * slope_d < 0).astype(np.int64) + (slope_d < 0),
        unstable_displacement=(slope_d < 0).astype(np.int64),
        load_error=1e-9 + 0.0 * curve["load"],
        displacement_error=1e-9 + 0.0 * curve["load"],
        profiles=[_profile(maugis.Curve(*(c[i] for c in columns)), constants) for i in range(len(columns[0]))],
    )
    folds = {"load": maugis.load_fold(**constants), "displacement": maugis.displacement_fold(**constants)}
    events = [
        _event("fold", maugis.Curve(*(c[0] for c in columns)), branch, "displacement", "jump-in"),
        _event("touch", touch, branch),
        *(_event("fold", state, branch, control, "pull-off") for control, state in folds.items()),
    ]
    events.sort(key=lambda event: event.position)
    pull_off = next(e for e in events if (e.control, e.name) == ("load", "pull-off"))
    excess = np.geomspace(1e-3, 1e3, 40)
    kappa = 0.5 - excess / (6.0 * (excess + 50.0))
    return Diagram(
        contact=contact,
        branches=(branch,),
        events=tuple(events),
        thresholds={"pull_off_load": pull_off.load, "pull_off_radius": pull_off.contact_radius},
        model=ModelChoice("exact", "Maugis-Dugdale attraction has a closed form", 1),
        cost=Cost(0.125, 321),
        accuracy=1e-9,
        description=contact.describe(),
        unit_names=PHYSICAL.names,
        local_exponents=lambda event: LocalExponent(excess, excess**kappa, kappa, 0.01 * kappa),
    )


def _profile(state: maugis.Curve, constants: dict[str, float]) -> Profile:
    r = np.linspace(0.0, 120.0, 30 + int(state.contact_radius))  # of different lengths
    return Profile(r, maugis.gap(r, state, **constants), *maugis.pressure(r, state, **constants))


def _event(kind, state, branch: Branch, control: str | None = None, name: str | None = None) -> Event:
    """The event at a state, placed by the order in which the curve goes into contact."""
    along = branch.contact_radius - branch.central_gap
    values = {n: float(getattr(state, n)) for n in ("load", "displacement", "contact_radius", "central_gap")}
    exponent = None
    if kind == "fold" and name == "pull-off":
        exponent = Exponent(0.5, 42.0, Window(1.0, 10.0, 0.47, 0.02, 3.5), 4.25, "contact_radius")
    position = float(np.interp(values["contact_radius"] - values["central_gap"], along, np.arange(len(along))))
    error = dict.fromkeys(values, 2e-7)
    return Event(kind, **values, error=error, control=control, name=name, critical=exponent, position=position)


def repulsive_diagram() -> Diagram:
    """A made-up curve with two load folds and two displacement folds, as a repulsive film has them."""
    s = np.linspace(-3.0, 3.0, 241)
    a2 = np.maximum(s + 0.4, 0.0)
    gap = np.maximum(-0.4 - s, 0.0)
    load = 8.2 + 0.2 * s**3 - 0.54 * s
    d = 4.0 + 0.1 * s**3 - 0.135 * s
    slope_load, slope_d = 0.6 * (s**2 - 0.9), 0.3 * (s**2 - 0.45)
    branch = Branch(
        load=load,
        displacement=d,
        contact_radius=np.sqrt(a2),
        central_gap=gap,
        energy=load * d,
        unstable_load=(slope_load * slope_d < 0).astype(np.int64) + (slope_d < 0),
        unstable_displacement=(slope_d < 0).astype(np.int64),
        load_error=0.0 * s,
        displacement_error=0.0 * s,
    )

    def at(kind, u: float, control: str | None = None, name: str | None = None) -> Event:
        values = {
            "load": 8.2 + 0.2 * u**3 - 0.54 * u,
            "displacement": 4.0 + 0.1 * u**3 - 0.135 * u,
            "contact_radius": max(u + 0.4, 0.0) ** 0.5,
            "central_gap": max(-0.4 - u, 0.0),
        }
        error = dict.fromkeys(values, 1e-9)
        return Event(kind, **values, error=error, control=control, name=name, position=(u + 3.0) * 40.0)

    events = (
        at("fold", -(0.9**0.5), "load", "squeeze-out"),
        at("fold", -(0.45**0.5), "displacement", "squeeze-out"),
        at("touch", -0.4),
        at("fold", 0.45**0.5, "displacement", "wetting"),
        at("fold", 0.9**0.5, "load", "wetting"),
    )
    return Diagram(
        contact=Contact.reduced("gauss", tabor=1.0, sign=-1),
        branches=(branch,),
        events=events,
        thresholds={"squeeze_out_load": events[0].load, "wetting_load": events[4].load},
        model=ModelChoice("axisymmetric", "made up", 100),
        cost=Cost(0.5, 10),
    )


@pytest.fixture(scope="session")
def attraction() -> Diagram:
    """Maugis-Dugdale attraction in nN and nm, with profiles, exponents and local exponents."""
    return maugis_diagram()


@pytest.fixture(scope="session")
def repulsion() -> Diagram:
    """Two folds under either control, in reduced units, without profiles."""
    return repulsive_diagram()


@pytest.fixture
def broken(attraction: Diagram) -> Diagram:
    """An incomplete diagram whose last point is not a number and whose law belongs to nobody."""
    branch = attraction.branches[0]
    load = branch.load.copy()
    load[-1] = np.nan
    return replace(
        attraction,
        contact=None,
        branches=(replace(branch, load=load, profiles=()),),
        description={"tip": {"shape": "mine"}, "interaction": [{"law": "mine"}]},
        status="incomplete",
        message="the law returned NaN at a gap of 0.5",
    )
