"""The script that holds what *Contact* claims against Coal: it finds what is wrong, and goes on."""

import json

import numpy as np
import pytest
from simulators import changed

from docs.measurements import contact_claims
from kinarm.collision import ContactModel
from kinarm.problem import ReachProblem
from tests.helpers.reference import ReferenceSimulator

pytestmark = pytest.mark.rare


def test_it_goes_on_where_it_ended(tmp_path, monkeypatch):
    parts = {part: (check, 3, most) for part, (check, _, most) in contact_claims.PARTS.items()}
    monkeypatch.setattr(contact_claims, "PARTS", parts)
    monkeypatch.setattr(contact_claims, "SAMPLES", 300)
    for configurations, steps in ((3, 2), (9, 4)):
        counts = ["--configurations", str(configurations), "--steps", str(steps), "--episodes", "2"]
        contact_claims.main([*counts, "--arms", "paper", "--folder", str(tmp_path)])
    record = json.loads((tmp_path / "claims.json").read_text("utf-8"))
    assert record["found"] == []
    sizes = {part: [record[part]["paper"][name] for name in ("lots", "cases")] for part in parts}
    assert sizes == {"configurations": [3, 9], "episodes": [1, 2], "steps": [2, 4]}
    table = (tmp_path / "claims.md").read_text("utf-8")
    assert table.count("| `paper` | ") == table.count("| all | ") == 3


@pytest.mark.parametrize("part", ["configurations", "episodes", "steps"])
def test_it_finds_what_is_wrong(part, monkeypatch):
    """A Coal that sees nothing, or steps that are tested at four configurations alone."""
    monkeypatch.setattr(contact_claims, "SAMPLES", 300)
    few = changed(contact_claims.before_plate("paper"), tested_configurations=4)
    assert contact_claims.check((part, "paper", 0, 100))[2] == []
    monkeypatch.setattr(ContactModel, "in_contact", lambda _, q: np.zeros(len(q), bool))
    monkeypatch.setattr(ReferenceSimulator, "first_contact", lambda *_: None)
    monkeypatch.setattr(contact_claims, "before_plate", lambda _: few)
    checked, counts, found = contact_claims.check((part, "paper", 0, 100))
    record = {part: {}, "found": []}
    contact_claims.add(record, (part, "paper", 0, 100), (checked, counts, found))
    assert 0 < record[part]["paper"]["contradicted"] == len(record["found"])
    assert ReachProblem.from_json(found[0]["problem"]).arm.name == "paper"
