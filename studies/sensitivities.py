"""Derivatives of thresholds against differences of traces at 1e-11, and what they cost.

    python studies/sensitivities.py [--accuracy 1e-11] [--only TEXT]

The differences are central, with two steps and their error of second order taken out: they have nine digits. Costs are
processor times, the lesser of two, of the derivatives of all thresholds over those of the trace.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Iterator, Mapping

import contbranch as cb
from contbranch.contact.parameters import Parameter, parameters_of

STEP = 2e-3
# Of what is less than this share of the threshold over the parameter, errors are relative to that.
SMALL = 0.01


def cases() -> Iterator[tuple[str, cb.Contact, str | cb.Spring]]:
    """Laws of both signs, sums, tips and springs."""
    for law in (cb.Exponential, cb.Gauss, cb.VanDerWaals, cb.InverseSquare, cb.MaugisDugdale):
        yield f"{law.__name__}, attraction", cb.Contact.reduced(law, tabor=1.0), "load"
        if law is not cb.MaugisDugdale:
            yield f"{law.__name__}, repulsion", cb.Contact.reduced(law, tabor=1.0, sign=-1), "load"
    yield "Gauss, small contacts", cb.Contact.reduced(cb.Gauss, tabor=0.5, sign=-1), "load"
    yield "spring", cb.Contact.reduced(cb.Exponential, tabor=1.0), cb.Spring(2.0)
    yield "sum", cb.Contact(cb.Parabola(1.0), cb.Gauss(1.0, 0.8) + cb.Exponential(-0.4, 1.0)), "load"
    yield "cone", cb.Contact(cb.Cone(0.5), cb.Exponential(1.0, 0.7)), "load"


def difference(one: Parameter, control: str | cb.Spring) -> Mapping[str, float]:
    """Derivatives of the thresholds by a parameter, from four traces."""
    found = []
    for step in (STEP, STEP / 2):
        above, below = (
            cb.trace(one.contact(one.value * (1 + s)), control, accuracy=1e-11, modes=0).thresholds
            for s in (step, -step)
        )
        found.append({name: (above[name] - below[name]) / (2 * step * one.value) for name in above if name in below})
    return {name: (4 * found[1][name] - value) / 3 for name, value in found[0].items()}


def main() -> None:
    """Print the largest errors and the costs."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--accuracy", type=float, default=1e-11)
    parser.add_argument("--only", default="")
    asked = parser.parse_args()
    errors: list[tuple[float, str]] = []
    thresholds = 0
    for name, contact, control in cases():
        if asked.only not in name:
            continue
        times = []
        for _ in range(2):
            began = time.process_time()
            diagram = cb.trace(contact, control, accuracy=asked.accuracy)
            traced = time.process_time()
            rates = diagram.sensitivities or {}
            times.append((traced - began, time.process_time() - traced))
        thresholds += len(rates)
        for key, one in parameters_of(contact).items():
            for threshold, true in difference(one, control).items():
                size = max(abs(true), SMALL * abs(diagram.thresholds[threshold] / one.value))
                errors.append((abs(rates[threshold][key] - true) / size, f"{name}: {threshold} by {key}"))
        trace, more = map(min, zip(*times, strict=True))
        print(f"{name:28s} trace {1e3 * trace:7.1f} ms, derivatives {100 * more / trace:5.1f} % of that", flush=True)
    errors.sort(reverse=True)
    wrong = sum(error > 1e-6 for error, _ in errors)
    print(f"{thresholds} thresholds, {len(errors)} derivatives, {wrong} off by more than 1e-6; the largest errors:")
    for error, words in errors[:6]:
        print(f"{error:.1e}  {words}")


if __name__ == "__main__":
    main()
