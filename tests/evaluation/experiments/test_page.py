"""Tables, figures and the page of a study."""

import csv
import re
import sys

import numpy as np
import pytest
from matplotlib.figure import Figure
from small_studies import SMALL

from kinarm.errors import MissingExtraError
from kinarm.evaluation.experiments import page
from kinarm.evaluation.experiments.figures import _band, beside_bound, draw_all, effects
from kinarm.evaluation.experiments.page import write_all, write_parquet
from kinarm.evaluation.experiments.results import shown
from kinarm.evaluation.experiments.study import Study
from kinarm.evaluation.experiments.table import group_row
from kinarm.evaluation.statistics import share_over_seeds, wilson_interval


class TestTable:
    def test_a_row_for_each_training(self, finished):
        table = finished.table()
        assert len(table) == 4
        assert sorted(zip(table["seed"], table["step_size"], strict=True)) == [
            *((0, 0.02), (0, 0.2), (1, 0.02), (1, 0.2))
        ]
        for row, trained in zip(table, finished, strict=True):
            assert row["success"] == trained.outcomes.success.mean()
            assert row["collision"] == trained.outcomes.collision.mean()
            assert row["median_distance"] == np.median(trained.outcomes.distance)
            assert row["environment_steps"] == trained.last.environment_steps
        assert (table["processor_seconds"] > 0).all()

    def test_texts_and_missing_values(self, tmp_path):
        pytest.importorskip("torch")
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
        table = study.table()
        assert table["sharing"].tolist() == ["none", "pair", ""]
        assert table["n_epochs"].tolist() == ["", "", "1"]
        panels = {axes.get_title(): axes for axes in effects(study).axes}
        assert [text.get_text() for text in panels["sharing"].get_xticklabels()] == ["none", "pair"]
        assert set(panels) == {"learner", "sharing"}

    def test_lists_of_numbers_are_joined(self):
        assert shown((64, 32)) == "64-32"
        assert shown([0.5, "tanh"]) == "0.5-tanh"

    def test_nothing_finished(self, small):
        assert len(small().table()) == 0
        assert small().groups() == ()


class TestGroups:
    def test_seeds_belong_together(self, finished):
        groups = finished.groups()
        assert [group.label for group in groups] == ["step_size=0.02", "step_size=0.2"]
        assert [group.hits.shape for group in groups] == [(2, 12)] * 2
        for group in groups:
            assert group.success.value == group.hits.mean()
            assert group.figures["success"] == group.hits.mean()

    def test_the_best_comes_first(self, finished):
        best = finished.best(2)
        assert best[0].relative_success >= best[1].relative_success

    def test_an_interval_covers_that_over_trials(self):
        hits = np.zeros((3, 50))
        assert share_over_seeds(hits).ci95 == (0.0, wilson_interval(0, 50)[1])

    def test_and_that_over_seeds(self):
        hits = np.array([np.ones(50), np.zeros(50), np.ones(50)])
        low, high = share_over_seeds(hits).ci95
        assert (low, high) == (0.0, 1.0)
        assert share_over_seeds(hits).value == pytest.approx(2 / 3)


@pytest.fixture(scope="module")
def folder(finished):
    """Where everything is written."""
    write_all(finished, "kinarm-study <mine>.toml")
    return finished.store.folder


class TestFiles:
    def test_csv(self, folder, finished):
        with (folder / "runs.csv").open() as file:
            rows = list(csv.DictReader(file))
        table = finished.table()
        assert [row["key"] for row in rows] == table["key"].tolist()
        assert [float(row["success"]) for row in rows] == table["success"].tolist()

    def test_parquet(self, folder, finished):
        parquet = pytest.importorskip("pyarrow.parquet")
        read = parquet.read_table(folder / "runs.parquet")
        assert read.column("success").to_pylist() == finished.table()["success"].tolist()

    def test_parquet_needs_an_extra(self, finished, monkeypatch, tmp_path):
        monkeypatch.setitem(sys.modules, "pyarrow", None)
        with pytest.raises(MissingExtraError, match=r"kinarm\[study\]"):
            write_parquet(finished, tmp_path / "runs.parquet")

    def test_without_it_everything_else_is_written(self, small, monkeypatch):
        monkeypatch.setattr(page, "find_spec", lambda _: None)
        study = small(seeds=1, grid={}).run(jobs=1)
        write_all(study, "kinarm-study mine.toml")
        written = {path.name for path in study.store.folder.iterdir()}
        assert {"runs.csv", "index.html", "beside_bound.png"} <= written
        assert "runs.parquet" not in written

    def test_the_page_fetches_nothing_and_tells_everything(self, folder, finished):
        page = (folder / "index.html").read_text()
        assert not re.search(r"(src|href)=\"(?!#|data:)", re.sub(r"xlink:href", "", page))
        assert "kinarm-study &lt;mine&gt;.toml" in page
        for group in finished.groups():
            for cell in group_row(group):
                assert cell in page
        for name in ("learning_curves", "effects", "beside_bound"):
            assert f'<section id="{name}">' in page
            assert (folder / f"{name}.png").stat().st_size > 5000
            assert (folder / f"{name}.svg").stat().st_size > 5000

    def test_the_same_study_gives_the_same_page(self, folder, finished):
        before = (folder / "index.html").read_bytes()
        write_all(finished, "kinarm-study <mine>.toml")
        assert (folder / "index.html").read_bytes() == before


class TestFigures:
    def test_nothing_varies(self, small):
        study = small(grid={}, seeds=1, trials={"count": 5, "per_decade": 0}).run(jobs=1)
        assert list(draw_all(study)) == ["beside_bound"]

    def test_nothing_finished(self, small):
        assert draw_all(small()) == {}
        assert beside_bound(small()) is None

    def test_curves_that_nothing_is_known_of_are_left_out(self):
        axes = Figure().subplots()
        known = (np.array([1.0, 10.0]), np.array([0.0, 1.0]))
        unknown = [(np.array([]), np.array([])), (np.array([np.nan]), np.array([0.5]))]
        _band(axes, unknown, "unknown", 0)
        assert len(axes.lines) == 0
        _band(axes, [*unknown, known], "known", 0)
        (line,) = axes.lines
        assert (line.get_ydata()[0], line.get_ydata()[-1]) == (0.0, 1.0)

    def test_places_that_no_field_fills_are_empty(self, small):
        """Four fields in rows of three, of which one has more values than there is room for."""
        ranges = {name: {"low": 0.01, "high": 0.1} for name in ("step_size", "noise")}
        more = {"episodes": {"low": 1, "high": 9}, "reward.success": {"low": 0.0, "high": 1.0}}
        study = small(grid={}, random={"count": 3, **ranges, **more}, seeds=1).run(jobs=1)
        assert [axes.get_visible() for axes in effects(study).axes] == [True] * 4 + [False] * 2

    def test_of_many_numbers_not_each_has_a_tick(self, small):
        sizes = [0.01 * (k + 1) for k in range(7)]
        study = small(grid={"step_size": sizes}, seeds=1).run(jobs=1)
        (axes,) = effects(study).axes
        drawn = sorted(line.get_xdata()[0] for line in axes.lines if line.get_marker() == "o")
        assert drawn == pytest.approx(sizes)
        assert axes.get_xticks().tolist() != drawn

    def test_effects_are_means_over_the_rest(self, finished):
        (axes,) = effects(finished).axes
        drawn = {
            line.get_xdata()[0]: line.get_ydata()[0]
            for line in axes.lines
            if line.get_marker() == "o"
        }
        for group in finished.groups():
            assert drawn[group.choices["step_size"]] == pytest.approx(group.hits.mean())

    def test_what_is_drawn_at_random_is_shown_training_by_training(self, small):
        ranges = {"count": 3, "step_size": {"low": 0.01, "high": 0.1}}
        study = small(grid={}, random=ranges, seeds=1).run(jobs=1)
        (axes,) = effects(study).axes
        assert sorted(line.get_xdata()[0] for line in axes.lines) == sorted(
            study.table()["step_size"]
        )

    def test_texts_stand_side_by_side(self, small):
        study = small(grid={"sharing": ["none", "pair", "iteration"]}, seeds=1).run(jobs=1)
        (axes,) = effects(study).axes
        assert [text.get_text() for text in axes.get_xticklabels()] == ["none", "pair", "iteration"]
