"""Experiments come to the figures that were recorded of them, to the last bit.

Those of ARS are of version 1.0.0; intervals are of a later kind.
"""

import csv
import json
from pathlib import Path

import numpy as np

from kinarm.evaluation import Study
from kinarm.evaluation.experiments.experiment import Experiment
from kinarm.evaluation.experiments.page import results_document

FROZEN = Path(__file__).parent


def rows_of(name):
    with (FROZEN / name).open() as file:
        return list(csv.DictReader(file))


def test_the_runs_of_a_study(tmp_path):
    """With the keys of its files, by which folders go on."""
    study = Study(FROZEN / "study.toml", tmp_path).run(jobs=1)
    rows = study.rows()
    expected = rows_of("runs.csv")
    assert [{name: str(row[name]) for name in expected[0]} for row in rows] == expected


def test_learners_compared(tmp_path):
    """Of ARS: the bits of PyTorch's learners are those of a processor."""
    learners = ("ars-tuned",)
    experiment = Experiment.load(FROZEN / "learners.toml").only(entries=learners)
    study = Study(experiment, tmp_path).run(jobs=1)
    expected = json.loads((FROZEN / "learners.json").read_text())
    document = results_document(study, "")
    results = [row for row in expected["results"] if row["learner"] in learners]
    for group, now, before in zip(study.groups(), document["results"], results, strict=True):
        assert now["entry"] == before.pop("learner")
        assert now["reachable"] == expected["reachable"][now["problem"]]
        for name in ("success", "collision"):
            assert now[name] == before.pop(name)
        rounded = [round(run.last.median_distance, 5) for run in group.runs]
        assert np.mean(rounded) == before.pop("median_distance")
        del before["steps_to_success"]  # then the mean of the seeds' medians
        for now_until, before_until in zip(now["until"], before.pop("until"), strict=True):
            assert now_until.items() >= before_until.items()
        assert now.items() >= before.items()
    found = [
        {
            "learner": row["entry"],
            "seed": str(row["seed"]),
            "environment_steps": str(row["environment_steps"]),
            "successes": str(round(60 * row["success"])),
            "collisions": str(round(60 * row["collision"])),
            "median_distance": str(round(row["median_distance"], 5)),
        }
        for row in study.curve_rows()
    ]
    assert found == [row for row in rows_of("learners.csv") if row["learner"] in learners]
