"""The script of transfer comes to the figures of ARS that version 1.0.0 recorded, to the bit.

Intervals are of a later kind.
"""

import json
from pathlib import Path

import pytest

from docs.transfer.__main__ import write_all
from docs.transfer.document import transfer_document
from docs.transfer.study import Protocol, TransferStudy


@pytest.mark.rare
def test_a_small_study(tmp_path):
    study = TransferStudy(
        learners=("ars",),
        seeds=2,
        lengths=(1.0, 0.5),
        settings={"ars": {"iterations": 12}},
        protocol=Protocol(trials=60, looks=6, look_trials=40),
    )
    document = json.loads(json.dumps(transfer_document(study, study.run(tmp_path), "frozen")))
    expected = json.loads((Path(__file__).parent / "transfer.json").read_text())
    assert {name: document[name] for name in expected} == expected
    page = write_all(document, tmp_path / "transfer.json")
    assert "![Success against environment steps](transfer.png)" in page.read_text()
