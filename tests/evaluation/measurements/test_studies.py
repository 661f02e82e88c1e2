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


def test_figures_are_those_of_the_studies(monkeypatch, tmp_path):
    """Of times that are given, and of one small study in the place of all."""
    fixed = {"iterations": 2, "directions": 2, "top_directions": 1}
    small = {"name": "small", "seeds": 2, "trials": {"count": 12, "per_decade": 0}, "fixed": fixed}
    seconds, study = studies._timed(small, tmp_path / "small", jobs=1)
    spent = sum(study.store.made(run)["processor_seconds"] for run in study.runs)
    assert 0 < spent <= 2 * seconds
    times = {"one": 6.0, "two": 4.0, "table": 3.0, "ppo1": 9.0, "ppo2": 5.0}
    asked = []

    def timed(specification, folder, jobs):
        asked.append((folder.name, jobs))
        return times.get(folder.name, 1.0), study

    monkeypatch.setattr(studies, "_timed", timed)
    monkeypatch.setattr(studies, "find_spec", lambda name: name)
    monkeypatch.setattr(studies, "PLANNED", 10)
    monkeypatch.setattr(studies, "KEPT", 3)
    measured = studies.measure_studies()
    assert measured["speed_up"] == {"ars": 6 / 4, "ppo": 9 / 5}
    assert (measured["table_1_seconds"], measured["loaded"]) == (3.0, 2)
    sizes = [study.store.run_path(run).stat().st_size for run in study.runs]
    assert measured["bytes_each"] == sum(sizes) / 2
    assert {("one", 1), ("two", 2), ("ppo1", 1), ("ppo2", 2)} < set(asked)
