"""What a study costs beside its trainings."""

import pytest

from kinarm.evaluation.measurements import studies


@pytest.mark.slow
def test_all_of_it_is_measured(monkeypatch):
    small = {"fixed": {"iterations": 2, "directions": 2, "top_directions": 1}, "seeds": 3}
    monkeypatch.setattr(studies, "TABLE_1", {**studies.TABLE_1, **small})
    monkeypatch.setattr(studies, "SHORT", {**studies.SHORT, "seeds": 5})
    monkeypatch.setattr(studies, "FEW", 2)
    monkeypatch.setattr(studies, "PLANNED", 10)
    monkeypatch.setattr(studies, "KEPT", 3)
    monkeypatch.setattr(studies, "find_spec", lambda _: None)
    measured = studies.measure_studies()
    assert measured["trainings"] == 3
    assert measured["loaded"] == 5
    assert list(measured["speed_up"]) == ["ars"]
    assert measured["overhead"] < 1
    assert 1000 < measured["bytes_each"] < 50_000
    for name in ("load_seconds", "planned_per_second", "kept_per_second"):
        assert measured[name] > 0
