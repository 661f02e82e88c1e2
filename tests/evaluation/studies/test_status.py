"""How far a study is."""

import os

from small_studies import SMALL

from kinarm.evaluation.studies.status import StudyStatus
from kinarm.evaluation.studies.study import Study


def test_before_the_first_training(small):
    status = StudyStatus.of(small())
    assert (status.done, status.remaining, status.running, status.rate) == (0, 4, False, None)
    assert status.lines() == [
        "small: 0 of 4 trainings finished, stopped; the command that made it goes on"
    ]


def test_all_done(finished):
    assert StudyStatus.of(finished).lines() == ["small: 4 of 4 trainings finished"]


def test_under_way(small):
    small().run(jobs=1)
    study = small(seeds=3)
    finished = [study.store.run_path(run) for run in study.runs]
    for number, path in enumerate(path for path in finished if path.exists()):
        os.utime(path, (1000.0 + 30 * number, 1000.0 + 30 * number))
    with study.store.writing(study.specification):
        status = StudyStatus.of(study)
    assert (status.done, status.remaining, status.running) == (4, 2, True)
    assert status.rate == 2.0
    first, second = status.lines()
    assert first == "small: 4 of 6 trainings finished, running"
    assert second.startswith("2.0 a minute; 2 remain, until about ")


def test_a_rate_is_told_once_there_is_one():
    status = StudyStatus(name="x", done=1, remaining=2, failed=(), running=True, rate=None)
    assert status.lines() == ["x: 1 of 3 trainings finished, running"]


def test_failures_are_told(tmp_path, monkeypatch):
    def fail(*_):
        raise ValueError("of all things")

    monkeypatch.setattr("kinarm.evaluation.studies.training.train", fail)
    study = Study({**SMALL, "seeds": 1, "grid": {}}, tmp_path).run(jobs=1)
    assert StudyStatus.of(study).lines()[1:] == [
        "failed: ars paper* right seed 0: of all things",
    ]
