"""Models for nanite: a parabola with an adhesion of finite range, over the tip position, fitted by lmfit.

    import contbranch.nanite_model, nanite.model
    nanite.model.register_model(contbranch.nanite_model)                        # Maugis–Dugdale, approach
    nanite.model.register_model(contbranch.nanite_model.model_of("exponential", retract=True))

nanite fits one leg of the force over the tip position: that of a rigid drive. With a cantilever that jumps,
`contbranch.fit` compares whole loops instead. nanite's weights, which put aside what is close to the contact point, are
not used: that is where adhesion is.
"""

from __future__ import annotations

from inspect import Parameter, Signature
from types import SimpleNamespace
from typing import Any

import numpy as np

from contbranch.arrays import Array
from contbranch.contact.contact import Contact
from contbranch.measure.comparison import legs
from contbranch.measure.reduced import curve_of
from contbranch.threads import one_thread

__all__ = ["adhesive_force", "get_parameter_defaults", "model_func", "model_of", "residual"]

# Laws, and what nanite calls their models.
LAWS = {"maugis-dugdale": "contbranch_md", "exponential": "contbranch_exp", "van-der-waals": "contbranch_vdw"}
_WORDS = "Parabola with {} adhesion of finite range, {}"
# Parameters: name, unit, start and least value; what is not varied by default.
_PARAMETERS = {
    "E": ("Young's Modulus", "Pa", 3e3, 1.0),
    "R": ("Tip Radius", "m", 10e-6, 1e-12),
    "nu": ("Poisson's Ratio", "", 0.5, 0.0),
    "contact_point": ("Contact Point", "m", 0.0, -np.inf),
    "baseline": ("Force Baseline", "N", 0.0, -np.inf),
    "w": ("Work of Adhesion", "J/m²", 1e-4, 1e-12),
    "z0": ("Range of Adhesion", "m", 10e-9, 1e-12),
}
_HELD = ("R", "nu")


@one_thread
def adhesive_force(law: str, delta: Array, retract: bool, **parameters: float) -> Array:
    """The force of an adhesive contact over the tip position, all in SI units.

    Parameters
    ----------
    law : str
        ``"maugis-dugdale"``, ``"exponential"`` or ``"van-der-waals"``.
    delta : array (M,)
        Tip position, which falls towards the surface.
    retract : bool
        Whether to take the branch of the retraction where there are two.
    **parameters
        ``E`` (of the material), ``R``, ``nu``, ``contact_point``, ``baseline``, ``w`` and ``z0``.
    """
    own = parameters
    contact = Contact.physical(
        radius=own["R"] * 1e9,
        modulus=own["E"] / (1.0 - own["nu"] ** 2) * 1e-9,
        interaction=law,
        work_of_adhesion=own["w"],
        range=own["z0"] * 1e9,
    )
    displacement = (own["contact_point"] - np.asarray(delta, dtype=float)) * 1e9
    deepest = max(float(displacement.max(initial=0.0)), 0.0) + 3 * contact.scales.normal
    largest = 4 / 3 * contact.modulus * (own["R"] * 1e9 * deepest**3) ** 0.5
    leg = legs(curve_of(contact, largest), np.inf)[int(retract)]
    return leg.whole.at(displacement)[0] * 1e-9 + own["baseline"]


def get_parameter_defaults() -> Any:
    """The parameters as lmfit has them."""
    import lmfit

    found = lmfit.Parameters()
    for key, (_, _, start, least) in _PARAMETERS.items():
        found.add(key, value=start, min=least, max=0.5 if key == "nu" else np.inf, vary=key not in _HELD)
    return found


def model_of(law: str = "maugis-dugdale", retract: bool = False) -> Any:
    """What `nanite.model.register_model` takes: the model of a law on one leg."""

    def model_func(delta: Array, **numbers: float) -> Array:
        return adhesive_force(law, delta, retract, **numbers)

    # nanite compares the names with those of the parameters
    kind = Parameter.POSITIONAL_OR_KEYWORD
    names = [Parameter(name, kind) for name in ("delta", *_PARAMETERS)]
    setattr(model_func, "__signature__", Signature(names))  # noqa: B010

    def residual(params: Any, delta: Array, force: Array, weight_cp: float = 0.0) -> Array:
        return force - model_func(delta, **params.valuesdict())

    return SimpleNamespace(
        __name__=LAWS[law],
        get_parameter_defaults=get_parameter_defaults,
        model_func=model_func,
        model_doc=adhesive_force.__doc__,
        model_key=LAWS[law] + ("_retract" if retract else ""),
        model_name=_WORDS.format(law, "retraction" if retract else "approach"),
        residual=residual,
        parameter_keys=list(_PARAMETERS),
        parameter_names=[words for words, *_ in _PARAMETERS.values()],
        parameter_units=[one[1] for one in _PARAMETERS.values()],
        valid_axes_x=["tip position"],
        valid_axes_y=["force"],
    )


# The module is itself what `register_model` takes.
_default = model_of()
model_doc, model_key, model_name = _default.model_doc, _default.model_key, _default.model_name
model_func, residual = _default.model_func, _default.residual
parameter_keys, parameter_names = _default.parameter_keys, _default.parameter_names
parameter_units, valid_axes_x, valid_axes_y = _default.parameter_units, ["tip position"], ["force"]
