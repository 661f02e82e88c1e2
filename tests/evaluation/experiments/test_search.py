"""Searches by Optuna: as many settings as asked for, and nothing stuck after an interruption."""

import sys
from dataclasses import replace

import pytest
from small_studies import SMALL

from kinarm.errors import InvalidInputError, MissingExtraError, TrainingFailedError
from kinarm.evaluation.experiments import study as studies
from kinarm.evaluation.experiments.executors import LocalExecutor
from kinarm.evaluation.experiments.experiment import Experiment
from kinarm.evaluation.experiments.runs import train
from kinarm.evaluation.experiments.search import _open_search
from kinarm.evaluation.experiments.study import Study
from kinarm.policies import recipe

optuna = pytest.importorskip("optuna")
pytestmark = pytest.mark.filterwarnings("ignore")  # Optuna's: what is experimental

SEARCH = {
    **{name: entry for name, entry in SMALL.items() if name not in ("grid", "seeds")},
    "name": "search",
    "seeds": 1,
    "search": {
        "count": 6,
        "step_size": {"low": 0.01, "high": 0.5, "log": True},
        "sharing": ["none", "pair"],
        "episodes": {"low": 1, "high": 2},
    },
}


def states(study):
    found = _open_search(study.experiment, study.store.folder).trials
    return [trial.state.name for trial in found]


@pytest.fixture
def searched(tmp_path):
    return Study(SEARCH, tmp_path).run(jobs=1)


class TestSearch:
    def test_it_tries_as_many_settings_as_asked_for(self, searched):
        assert states(searched) == ["COMPLETE"] * 6
        for run in searched.finished:
            assert 0.01 <= run.config.step_size <= 0.5
            assert run.config.sharing in ("none", "pair")
            assert run.config.episodes in (1, 2)
        assert len({run.config.step_size for run in searched.runs}) == len(searched) == 6

    def test_the_best_is_a_recipe(self, searched):
        best = max(searched.finished.values(), key=lambda run: run.outcomes.success.mean())
        made = recipe("ars", searched.store.folder / "best.toml", problem="right", seed=0)
        assert made.recipe == "best"
        success = best.outcomes.success.mean()
        named = {"recipe": made.recipe, "problem": made.problem}
        (same,) = [run for run in searched.runs if replace(run.config, **named) == made]
        assert searched.finished[same].outcomes.success.mean() == success

    def test_more_go_on(self, searched, tmp_path):
        more = {**SEARCH, "search": {**SEARCH["search"], "count": 8}}
        study = Study(more, tmp_path).run(jobs=2)
        assert states(study) == ["COMPLETE"] * 8
        assert len(study) == 8
        assert [run.key for run in study.runs[:6]] == [run.key for run in searched.runs]

    def test_what_was_under_way_is_tried_again(self, tmp_path):
        study = Study(SEARCH, tmp_path)
        with study.store.writing(study.experiment):
            stuck = _open_search(study.experiment, tmp_path).ask()
            stuck.suggest_float("step_size", 0.01, 0.5, log=True)
        (tmp_path / "search.journal.lock").symlink_to("nowhere")
        study.run(jobs=1)
        assert states(study) == ["FAIL"] + ["COMPLETE"] * 6
        assert study.runs[0].config.step_size == stuck.params["step_size"]

    @pytest.mark.parametrize(
        "searched",
        [
            {"sharing": ["pair", "none", "iteration"]},
            {"sharing": ["iteration"]},
            {"step_size": {"low": 0.1, "high": 0.3, "log": True}},
        ],
    )
    def test_another_search_begins_anew(self, tmp_path, searched):
        for count, fields in ((2, {"sharing": ["none", "pair"]}), (3, searched)):
            study = Study({**SEARCH, "search": {"count": count, **fields}}, tmp_path).run(jobs=1)
        assert states(study) == ["COMPLETE"] * 3
        assert all(run.choices.keys() == searched.keys() for run in study.runs)
        if values := searched.get("sharing"):
            assert {run.config.sharing for run in study.runs} <= set(values)

    def test_cmaes_needs_a_package_of_its_own(self, tmp_path, monkeypatch):
        monkeypatch.setitem(sys.modules, "cmaes", None)
        search = {**SEARCH["search"], "sampler": "cmaes"}
        with pytest.raises(MissingExtraError, match=r"cmaes is not installed: .*kinarm\[tune\]"):
            Study({**SEARCH, "search": search}, tmp_path).run(jobs=1)

    def test_impossible_settings_are_replaced_by_others(self, tmp_path):
        impossible = {"count": 3, "top_directions": {"low": 3, "high": 6}}
        fixed = {"iterations": 3, "directions": 4}
        study = Study({**SEARCH, "fixed": fixed, "search": impossible}, tmp_path).run(jobs=1)
        trials = _open_search(study.experiment, tmp_path).trials
        complete = [trial for trial in trials if trial.state.name == "COMPLETE"]
        assert len(complete) == 3
        assert {trial.params["top_directions"] for trial in complete} <= {3, 4}
        for trial in trials:
            if trial not in complete:
                assert "top_directions must be at most" in trial.user_attrs["error"]

    def test_too_many_impossible_settings_are_told(self, tmp_path):
        never = {"count": 2, "top_directions": {"low": 5, "high": 6}}
        fixed = {"iterations": 3, "directions": 4}
        with pytest.raises(TrainingFailedError, match="settings 0: top_directions must be at most"):
            Study({**SEARCH, "fixed": fixed, "search": never}, tmp_path).run(jobs=1)

    def test_trainings_that_fail_are_replaced_by_others(self, tmp_path, monkeypatch):
        failed = []

        def once(task, *arguments, **options):
            if not failed:
                failed.append(task.run)
                raise InvalidInputError("it does not work")
            return train(task, *arguments, **options)

        monkeypatch.setattr(studies, "train", once)
        study = Study(SEARCH, tmp_path).run(jobs=1)
        assert states(study) == ["FAIL"] + ["COMPLETE"] * 6
        trial = _open_search(study.experiment, tmp_path).trials[0]
        assert trial.user_attrs["error"] == "it does not work"
        assert study.failures == {}

    def test_as_many_at_a_time_as_there_are_jobs(self, tmp_path):
        counts = []

        class Counting(LocalExecutor):
            def map(self, work, tasks):
                counts.append(len(tasks))
                return super().map(work, tasks)

        entries = {**SEARCH, "seeds": 2, "search": {**SEARCH["search"], "count": 5}}
        study = Study(entries, tmp_path).run(jobs=2, executor=Counting(1))
        assert states(study) == ["COMPLETE"] * 5
        assert counts == [4, 4, 2, 0]


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"search": {"count": 2}}, "search names no field"),
        ({"learners": ["ars", "ppo"]}, "a search has one learner and one recipe, got 2"),
        (
            {"search": {"count": 2, "problem.task.horizon": [1]}},
            "a search is for settings of a learner, not for 'problem.task.horizon'",
        ),
    ],
)
def test_refused(changes, words):
    with pytest.raises(InvalidInputError, match="^study: ") as caught:
        Experiment.from_json({**SEARCH, **changes}, "study")
    assert words in str(caught.value)


def test_unknown_fields(tmp_path):
    with pytest.raises(InvalidInputError, match="unknown field of a recipe or problem 'stepsize'"):
        Study({**SEARCH, "search": {"count": 1, "stepsize": [1]}}, tmp_path)
