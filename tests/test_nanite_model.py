"""The models for nanite, in nanite's own pipeline."""

import numpy as np
import pytest

import contbranch as cb
from contbranch import nanite_model

pytest.importorskip("lmfit")
nanite = pytest.importorskip("nanite")

TRUE = {"E": 20e6, "R": 1e-6, "nu": 0.5, "w": 0.03, "z0": 5e-9, "contact_point": 20e-9, "baseline": 0.0}


def test_the_force_is_that_of_the_traced_contact():
    contact = cb.Contact.physical(
        radius=1000.0, modulus=0.02 / 0.75, interaction="exponential", work_of_adhesion=0.03, range=5.0
    )
    loop = cb.hysteresis(contact, control="displacement", accuracy=1e-7, max_load=500.0)
    for retract in (False, True):
        own = loop.path.direction == (-1 if retract else 1)
        place, load = loop.path.displacement[own], loop.path.load[own]
        away = np.all([np.abs(place - jump.position) > 1e-3 for jump in loop.jumps], axis=0)
        force = nanite_model.adhesive_force("exponential", TRUE["contact_point"] - place * 1e-9, retract, **TRUE)
        assert np.abs(force * 1e9 - load)[away].max() < 1e-3 * -load.min()


@pytest.mark.filterwarnings("ignore")  # nanite's own
def test_a_curve_is_fitted_in_nanites_pipeline():
    """A synthetic retraction: the modulus and the work of adhesion that made it come back."""
    model = nanite.model.register_model(nanite_model.model_of("maugis-dugdale", retract=True))
    assert nanite.model.models_available["contbranch_md_retract"] is model
    nanite.model.register_model(nanite_model)
    assert "contbranch_md" in nanite.model.models_available
    down = np.linspace(-150e-9, 120e-9, 400)
    tip = np.append(down[::-1], down)
    force = np.append(
        *(
            nanite_model.adhesive_force("maugis-dugdale", way, back, **TRUE)
            for back, way in enumerate((down[::-1], down))
        )
    )
    rng = np.random.default_rng(3)
    force = force + 1e-10 * rng.standard_normal(force.size)
    segment = np.append(np.zeros(400, dtype=np.uint8), np.ones(400, dtype=np.uint8))
    data = {"force": force, "tip position": tip, "height (measured)": tip + force, "segment": segment}
    metadata = {
        "spring constant": 1.0,
        "imaging mode": "force-distance",
        "point count": tip.size,
        "path": "made.csv",
        "enum": 0,
    }
    curve = nanite.Indentation(data=data, metadata=metadata)
    start = model.get_parameter_defaults()
    for name, factor in (("E", 1.5), ("R", 1.0), ("nu", 1.0), ("w", 0.7), ("z0", 1.0), ("contact_point", 0.9)):
        start[name].set(value=factor * TRUE[name])
    start["z0"].set(vary=False)
    curve.fit_model(
        model_key="contbranch_md_retract",
        params_initial=start,
        segment=1,
        x_axis="tip position",
        y_axis="force",
        weight_cp=0,
        preprocessing=[],
        gcf_k=1.0,
    )
    assert curve.fit_properties["success"]
    found = curve.fit_properties["params_fitted"]
    assert found["E"].value == pytest.approx(TRUE["E"], rel=0.02)
    assert found["w"].value == pytest.approx(TRUE["w"], rel=0.01)
