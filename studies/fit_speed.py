"""How long are fits beside nanite's (with lmfit) of the same 2,000 samples? `python studies/fit_speed.py [REPEATS]`.

Medians in one process and thread, after a first fit; nanite fits the approach, with and without its preprocessing.
"""

import os
import sys
import time
from collections.abc import Callable
from typing import Any

os.environ |= dict.fromkeys(("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS"), "1")

import numpy as np
from fit_faults import Contact
from nanite.indent import Indentation

import contbranch as cb

REPEATS, LEG = int(sys.argv[1]) if sys.argv[1:] else 7, np.repeat([0, 1], 1000)
HERTZ, JKR = Contact(1e-6, 0.0, 2500.0, 0.05, 3.0), Contact(1.0, 0.05, 20.0, 2.0, 8.0)


def recorded(contact: Contact, far: float, noise: float) -> cb.ForceCurve:
    """A curve of 2,000 samples."""
    place = np.interp(np.abs(np.arange(-999.5, 1000)), [0.5, 999.5], [contact.at(contact.top), -far])
    force = contact.force(place, LEG == 1) + noise * np.random.default_rng(3).standard_normal(place.size)
    return cb.ForceCurve(place, force + 0.1 + 1e-5 * place, contact.spring, LEG)


def prepared(curve: cb.ForceCurve) -> Any:
    """The curve as nanite takes it, in m and N, after its preprocessing."""
    columns = {"force": 1e-9 * curve.force, "height (measured)": -1e-9 * curve.piezo, "segment": LEG.astype(np.uint8)}
    told = {"path": "", "enum": 0, "imaging mode": "force-distance", "spring constant": curve.spring}
    data = Indentation(columns | {"time": 1e-3 * np.arange(2000)}, told | {"point count": 2000})
    data.apply_preprocessing(["compute_tip_position", "correct_force_offset", "correct_tip_offset"])
    return data


def fitted(data: Any) -> None:
    """Nanite's fit of Hertz' model of a parabola."""
    start = data.get_initial_fit_parameters(model_key="hertz_para")
    start["R"].value = 1e-9 * HERTZ.radius
    data.fit_model(model_key="hertz_para", params_initial=start, segment="approach")


def timed(what: str, call: Callable[..., object], *given: Any, **settings: Any) -> float:
    """Print and return the median time of a call."""
    times = []
    for _ in range(REPEATS + 1):
        began = time.perf_counter()
        call(*given, **settings)
        times.append(time.perf_counter() - began)
    print(f"{what:40s} {np.median(times[1:]):.4f} s", flush=True)
    return float(np.median(times[1:]))


if __name__ == "__main__":
    curve, adhesive = recorded(HERTZ, 3000.0, 0.01), recorded(JKR, 16.0, 0.05)
    tip, ready = cb.Contact.physical(radius=2500.0, modulus=2e-6), [prepared(curve) for _ in range(REPEATS + 1)]
    law: Any = {"interaction": "maugis-dugdale", "work_of_adhesion": 0.08, "range": 0.5}
    sticky, free = cb.Contact.physical(radius=20.0, modulus=2.0, **law), ["work_of_adhesion", "modulus"]
    whole = timed("nanite, with its preprocessing", lambda: fitted(prepared(curve)))
    alone = timed("nanite, the fit alone", lambda: fitted(ready.pop()))
    for leg in ("auto", "approach"):
        own = timed(f"cb.fit, Hertz, leg {leg}", cb.fit, curve, tip, "modulus", leg=leg)
        print(f"    {own / whole:.2f} of nanite's with its preprocessing, {own / alone:.2f} of that of its fit alone")
    timed("cb.fit, JKR", cb.fit, adhesive, sticky, free, law="jkr")
    timed("cb.fit, Maugis and Dugdale, with range", cb.fit, adhesive, sticky, [*free, "range"])
