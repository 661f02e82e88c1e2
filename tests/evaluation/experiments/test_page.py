"""Tables, figures and the page of a study."""

import csv
import re

import numpy as np
import pytest
from small_studies import SMALL

from kinarm.evaluation.experiments.page import learning_curves, results_document, write_all
from kinarm.evaluation.experiments.study import Study
from kinarm.evaluation.experiments.table import COLUMNS, group_entries
from kinarm.evaluation.statistics import Estimate, share_difference


class TestTable:
    def test_a_row_for_each_training(self, finished):
        rows = finished.rows()
        assert len(rows) == 4
        assert sorted((row["seed"], row["step_size"]) for row in rows) == [
            *((0, 0.02), (0, 0.2), (1, 0.02), (1, 0.2))
        ]
        for row, trained in zip(rows, finished, strict=True):
            assert row["success"] == trained.outcomes.success.mean()
            assert row["collision"] == trained.outcomes.collision.mean()
            assert row["median_distance"] == np.median(trained.outcomes.distance)
            assert row["environment_steps"] == trained.last.environment_steps
            assert row["processor_seconds"] > 0

    def test_texts_and_missing_values(self, tmp_path):
        study = Study(
            {
                **SMALL,
                "learners": ["ars", "ppo"],
                "seeds": 1,
                "fixed": {"iterations": 1, "n_envs": 2, "n_steps": 32, "batch_size": 32},
                "grid": {"sharing": ["none", "pair"], "n_epochs": [1]},
            },
            tmp_path,
        )
        study.run(jobs=1)
        rows = study.rows()
        assert [row["sharing"] for row in rows] == ["none", "pair", None]
        assert [row["n_epochs"] for row in rows] == [None, None, 1]


class TestGroups:
    def test_seeds_belong_together(self, finished):
        groups = finished.groups()
        assert [group.label for group in groups] == ["step_size=0.02", "step_size=0.2"]
        assert [group.hits.shape for group in groups] == [(2, 12)] * 2
        for group in groups:
            assert group.success.value == group.hits.mean()
            assert group.estimates["success"].value == group.hits.mean()

    def test_each_is_compared_with_the_first(self, finished):
        first, second = finished.groups()
        assert first.difference == Estimate(None)
        assert second.difference == share_difference(second.hits, first.hits)
        alone, compared = map(group_entries, (first, second))
        assert alone["difference"] is None
        assert compared["difference"]["first"] == first.label
        assert compared["difference"]["success"] == second.difference.to_json()

    def test_what_a_policy_sees_makes_no_other_trials(self, small):
        """Nor does resolved-rate control, which residual policies also see."""
        learning = {"iterations": 1, "n_envs": 2, "n_steps": 4, "batch_size": 8}
        entries = [
            {"learner": "ars"},
            {"learner": "ppo", "recipe": "best", "fixed": learning},
            {"name": "short", "learner": "ars", "fixed": {"problem.task.horizon": 2}},
        ]
        study = small(grid={}, seeds=1, entries=entries).run(jobs=1)
        first, second, other = study.groups()
        assert second.first is first
        assert other.first is None
        assert len(study.bounds) == 2
        found = [entry["reachable"] for entry in results_document(study, "")["results"]]
        assert found[0] == found[1] > found[2]

    def test_the_best_comes_first(self, finished):
        first, second = finished.best(2)
        assert first.success.value >= second.success.value


@pytest.fixture(scope="module")
def folder(finished):
    """Where everything is written."""
    write_all(finished, "kinarm-study <mine>.toml")
    return finished.store.folder


class TestFiles:
    def test_csv(self, folder, finished):
        with (folder / "runs.csv").open() as file:
            rows = list(csv.DictReader(file))
        assert [row["key"] for row in rows] == [row["key"] for row in finished.rows()]
        assert [float(row["success"]) for row in rows] == [
            row["success"] for row in finished.rows()
        ]

    def test_the_page_fetches_nothing_and_tells_everything(self, folder, finished):
        page = (folder / "index.html").read_text()
        assert not re.search(r"(src|href)=\"(?!#|data:)", re.sub(r"xlink:href", "", page))
        assert "kinarm-study &lt;mine&gt;.toml" in page
        for group in finished.groups():
            for column in COLUMNS:
                assert str(column.cell(group)) in page
        assert '<section id="learning_curves">' in page
        assert (folder / "learning_curves.png").stat().st_size > 5000
        assert (folder / "learning_curves.svg").stat().st_size > 5000

    def test_without_points_there_is_no_figure(self, small):
        study = small(grid={}, seeds=1, trials={"count": 5, "per_decade": 0}).run(jobs=1)
        assert learning_curves(study) is None
        assert "learning_curves" not in write_all(study).read_text()
        assert not (study.store.folder / "learning_curves.png").exists()
