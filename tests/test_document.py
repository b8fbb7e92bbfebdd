"""JSON documents: keys, nulls and units."""

from __future__ import annotations

import json
import time
from dataclasses import replace

import numpy as np
import pytest

from contbranch.contact.contact import Contact
from contbranch.results.diagram import Cost, Diagram, ModelChoice, Solution

EVENT_KEYS = {"kind", "control", "name", "load", "displacement", "contact_radius", "central_gap", "error", "exponent"}


def strict(document: dict) -> dict:
    """The document after a round through JSON that refuses NaN and infinity."""
    return json.loads(json.dumps(document, allow_nan=False))


def test_diagram_has_every_key(attraction: Diagram) -> None:
    document = strict(attraction.document())
    assert document["format"] == "contbranch-diagram"
    assert document["version"] == 1
    assert {"contact", "units", "model", "branches", "events", "thresholds"} <= set(document)
    assert {"cost", "status", "message"} <= set(document)
    assert document["model"] == {"kind": "exact", "why": "Maugis-Dugdale attraction has a closed form", "unknowns": 1}
    assert document["cost"] == {"wall_s": 0.125, "newton": 321, "fft_pairs": 0, "stability_pairs": 0}
    branch = document["branches"][0]
    assert {"load", "displacement", "contact_radius", "central_gap", "energy"} <= set(branch)
    assert {"unstable_load", "unstable_displacement"} <= set(branch)
    assert {len(values) for values in branch.values()} == {len(attraction.branches[0])}
    assert branch["load"] == attraction.branches[0].load.tolist()
    assert all(isinstance(n, int) for n in branch["unstable_load"])


def test_every_event_has_every_key_and_null_where_it_does_not_apply(attraction: Diagram) -> None:
    events = strict(attraction.document())["events"]
    assert all(set(event) >= EVENT_KEYS for event in events)
    assert all(set(event["error"]) == {"load", "displacement", "contact_radius", "central_gap"} for event in events)
    touch = next(event for event in events if event["kind"] == "touch")
    assert (touch["control"], touch["name"], touch["exponent"], touch["stiffness"]) == (None, None, None, None)
    pull_off = next(event for event in events if event["control"] == "load")
    window = {"from": 1.0, "to": 10.0, "kappa": 0.47, "kappa_error": 0.02, "prefactor": 3.5}
    assert pull_off["name"] == "pull-off"
    assert pull_off["exponent"]["kappa"] == 0.5
    assert pull_off["exponent"]["crossover_load"] == 42.0
    assert pull_off["exponent"]["window"] == window


def test_units(attraction: Diagram, repulsion: Diagram) -> None:
    physical, reduced = attraction.document(), repulsion.document()
    assert physical["units"] == "physical"
    assert physical["unit_names"]["load"] == "nN"
    assert physical["unit_names"]["contact_radius"] == "nm"
    assert reduced["units"] == "reduced"
    assert "unit_names" not in reduced
    assert reduced["contact"]["interaction"][0]["law"] == "gauss"


def test_not_a_number_becomes_null(broken: Diagram) -> None:
    event = replace(broken.events[0], load=np.inf, error={"load": np.nan}, stiffness=2.0)
    document = strict(replace(broken, events=(event,), thresholds={"touch_load": np.float64(np.nan)}).document())
    assert document["branches"][0]["load"][-1] is None
    assert document["branches"][0]["load"][-2] == broken.branches[0].load[-2]
    assert document["events"][0]["load"] is None
    assert document["events"][0]["error"] == dict.fromkeys(("load", "displacement", "contact_radius", "central_gap"))
    assert document["events"][0]["stiffness"] == 2.0
    assert document["thresholds"] == {"touch_load": None}
    assert (document["status"], document["units"]) == ("incomplete", "physical")
    assert document["contact"] == {"tip": {"shape": "mine"}, "interaction": [{"law": "mine"}]}


def test_document_of_a_solution(attraction: Diagram) -> None:
    first, second = (attraction.branches[0].state(i) for i in (100, 50))
    fields = {name: getattr(first, name) for name in first.__dataclass_fields__}
    solution = Solution(
        **fields,
        model=ModelChoice("exact", "closed form", 1),
        cost=Cost(0.01, 4),
        message="one of 2",
        states=(first, second),
        contact=attraction.contact,
    )
    document = strict(replace(solution, states=()).document())
    assert {"states", "model", "cost", "status", "message"} <= set(document)
    assert len(document["states"]) == 1
    keys = {"load", "displacement", "contact_radius", "central_gap", "energy", "residual"}
    assert keys | {"unstable_load", "unstable_displacement"} <= set(document["states"][0])
    assert document["states"][0]["load"] == first.load
    assert document["unit_names"]["energy"] == "nN·nm"
    both = solution.document()["states"]
    assert [state["load"] for state in both] == [first.load, second.load]


def test_contact_is_described_without_a_description_of_the_diagram(repulsion: Diagram) -> None:
    assert Contact.from_description(repulsion.document()["contact"]) == repulsion.contact


@pytest.mark.parametrize("points", [200, 400])
def test_a_branch_of_some_hundred_points_takes_milliseconds(repulsion: Diagram, points: int) -> None:
    branch = repulsion.branches[0]
    at = np.linspace(0, len(branch) - 1, points).astype(int)
    columns = {n: values[at] for n, values in branch.columns.items()}
    diagram = replace(repulsion, branches=(replace(branch, **columns),))
    start = time.process_time()
    json.dumps(diagram.document(), allow_nan=False)
    assert time.process_time() - start < 0.05
