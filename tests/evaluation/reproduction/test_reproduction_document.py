"""What a reproduction writes beside its page, against sums by hand."""

import csv
import io

import numpy as np
from made_up_runs import made_up

from kinarm.evaluation.reproduction.document import runs_csv, timing


def test_a_line_for_each_training(results_of):
    distance = np.array([0.01, 0.05, 0.08, 0.16, 0.30])
    results = results_of(lambda training: made_up(distance))
    rows = list(csv.DictReader(io.StringIO(runs_csv(results))))
    assert [row["training"] for row in rows] == [each.name for each in results.study.trainings]
    first = rows[0]
    assert [first[f"within_{limit}"] for limit in ("0.05", "0.1", "0.2")] == ["0.4", "0.6", "0.8"]
    assert (first["mean_distance"], first["median_distance"]) == ("0.1200", "0.0800")
    assert (first["environment_steps"], first["contact"]) == ("4000", "0.0")


def test_time_is_summed_by_purpose(results_of):
    results = results_of(lambda training: made_up(np.ones(3)))
    purposes = [training.purpose for training in results.study.trainings]
    expected = {purpose: float(purposes.count(purpose)) for purpose in purposes}
    assert timing(results) == {"training_seconds": expected}
