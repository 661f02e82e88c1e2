"""Experiment files: what they can say, which trainings they plan, and what is refused."""

from dataclasses import replace

import pytest

from kinarm.errors import InvalidInputError, KinarmError
from kinarm.evaluation.experiments.experiment import Experiment
from kinarm.evaluation.experiments.plan import _changed_problem, plan
from kinarm.policies.recipes import recipe
from kinarm.problem import PROBLEMS, ReachProblem

FILE = """
learner = "ars"
problems = ["right", "own.toml"]
seeds = 3

[trials]
count = 50

[fixed]
iterations = 7
reward.success = 2.0

[grid]
step_size = [0.01, 0.05]
"problem.task.start_spread" = [0.2, 1.0]
"""


def made(**entries):
    return Experiment.from_json({"name": "mine", **entries}, "study")


@pytest.fixture
def experiment(tmp_path):
    path = tmp_path / "steps.toml"
    path.write_text(FILE)
    (tmp_path / "own.toml").touch()
    return Experiment.load(path)


class TestFile:
    def test_written_and_read_again(self, experiment):
        assert Experiment.from_json(experiment.to_json(), "it") == experiment

    def test_it_is_found_from_elsewhere(self, tmp_path):
        (tmp_path / "study.toml").write_text('recipe = "mine.toml"\nproblem = "gone.toml"')
        (tmp_path / "mine.toml").touch()
        read = Experiment.load(tmp_path / "study.toml")
        assert read.recipes == (str(tmp_path / "mine.toml"),)
        assert read.problems == ("gone.toml",)


class TestChoices:
    def test_every_value_with_every_other(self, experiment):
        choices = [run.choices for run in plan(replace(experiment, problems=("right",), seeds=1))]
        grid = [(each["step_size"], each["problem.task.start_spread"]) for each in choices]
        assert grid == [(0.01, 0.2), (0.01, 1.0), (0.05, 0.2), (0.05, 1.0)]


TOY = {"learner": "ars", "recipe": "tuned"}


@pytest.mark.parametrize(
    ("entries", "words"),
    [
        ({"entries": [TOY, TOY]}, "entries names the same twice: ars-tuned, ars-tuned"),
        ({"grid": {"noise": []}}, "grid.noise must be a list of at least one value, got []"),
        ({"grid": {"noise": [1]}, "fixed": {"noise": 1}}, "'noise' stands in fixed and in grid"),
        ({"search": {"count": 1, "noise": {"low": 0, "high": 2, "log": True}}}, "low is above 0"),
        (
            {"trials": {"cuont": 5}},
            "unknown key 'trials.cuont' (did you mean 'count'?); available: count",
        ),
    ],
)
def test_refused(entries, words):
    with pytest.raises(InvalidInputError, match="^study: ") as caught:
        made(**entries)
    assert words in str(caught.value)


def planned(**entries):
    return plan(Experiment.from_json({"name": "mine", **entries}, "study"))


class TestRuns:
    def test_every_setting_with_every_seed(self):
        runs = planned(
            problems=["left", "right"],
            recipes=["paper", "brs"],
            seeds=3,
            grid={"noise": [0.1, 0.2]},
        )
        assert len(runs) == len({run.key for run in runs}) == 2 * 2 * 3 * 2
        assert [run.config.seed for run in runs] == sorted(run.config.seed for run in runs)
        assert {run.config.noise for run in runs} == {0.1, 0.2}

    def test_settings_are_those_of_the_recipe(self):
        (run,) = planned(recipes="tuned", problems="both", first_seed=4, fixed={"iterations": 9})
        expected = recipe("ars", "tuned", problem=PROBLEMS["both"].pinned, seed=4, iterations=9)
        assert run.config == expected

    def test_recipes_adapt_to_the_changed_problem(self):
        (run,) = planned(recipes="tuned", fixed={"problem.arm": "lrmate200ic_5l"})
        problem = PROBLEMS["right"].replace(arm="lrmate200ic_5l")
        assert run.config.reward == recipe("ars", "tuned", problem=problem).reward
        assert run.config.problem.arm_digest == problem.arm_digest

    def test_fields_concern_the_learners_that_have_them(self):
        runs = planned(
            learners=["ars", "ppo"],
            fixed={"iterations": 5, "clip_range": 0.1},
            grid={"n_epochs": [1, 2], "noise": [0.01, 0.02]},
        )
        assert len(runs) == 2 + 2
        ars = [run.config for run in runs if run.learner == "ars"]
        ppo = [run.config for run in runs if run.learner == "ppo"]
        assert {config.iterations for config in (*ars, *ppo)} == {5}
        assert {config.noise for config in ars} == {0.01, 0.02}
        assert {config.n_epochs for config in ppo} == {1, 2}
        assert {config.clip_range for config in ppo} == {0.1}

    def test_weights_of_the_reward(self):
        (run,) = planned(fixed={"reward.success": 3.0, "reward": {"progress": 2.0}})
        assert (run.config.reward.success, run.config.reward.progress) == (3.0, 2.0)

    def test_entries_have_settings_problems_and_seeds_of_their_own(self):
        entries = [
            {"name": "a", "learner": "ars", "fixed": {"noise": 0.5}, "grid": {"episodes": [1, 2]}},
            {"name": "b", "learner": "ppo", "problem": "left", "seeds": 1, "first_seed": 7},
        ]
        runs = planned(
            entries=entries, seeds=2, problem="both", fixed={"noise": 0.1, "n_epochs": 2}
        )
        found = [(r.entry.name, r.learner, r.config.problem.name, r.config.seed) for r in runs]
        first = [("a", "ars", "both", 0)] * 2
        assert found == [*first, ("b", "ppo", "left", 7), *[("a", "ars", "both", 1)] * 2]
        assert [run.choices for run in runs[:3]] == [{"episodes": 1}, {"episodes": 2}, {}]
        assert (runs[0].config.noise, runs[2].config.n_epochs) == (0.5, 2)

    def test_an_entrys_own_value_replaces_the_values_of_all(self):
        entries = [
            {"name": "a", "learner": "ars", "fixed": {"noise": 0.5}},
            {"name": "b", "learner": "ars"},
        ]
        runs = planned(entries=entries, grid={"noise": [0.1, 0.2]})
        found = [(run.entry.name, run.config.noise, run.choices) for run in runs]
        others = [("b", noise, {"noise": noise}) for noise in (0.1, 0.2)]
        assert found == [("a", 0.5, {}), *others]

    def test_a_table_and_a_path_into_it_are_one(self):
        weights = [{"success": 1.0}, {"success": 2.0}]
        for table in (
            {"fixed": {"reward.collision": -7.0}},
            {"grid": {"reward.collision": [-7.0]}},
        ):
            grid = {"reward": weights, **table.pop("grid", {})}
            runs = planned(grid=grid, **table)
            rewards = [run.config.training_problem.task.reward for run in runs]
            assert [(each.collision, each.success) for each in rewards] == [(-7.0, 1), (-7.0, 2)]
            assert [run.choices["reward"] for run in runs] == weights

    def test_other_seeds_are_those_of_every_entry(self, experiment):
        entries = [{"name": "a", "learner": "ars", "seeds": 5}, {"name": "b", "learner": "ars"}]
        made = Experiment.from_json({"name": "x", "entries": entries, "seeds": 2}, "x")
        assert [run.config.seed for run in plan(made.only(seeds=1))] == [0, 0]

    def test_entries_that_come_to_the_same_are_both_told_of(self):
        runs = planned(entries=[{"name": "a"}, {"name": "b"}])
        assert [run.entry.name for run in runs] == ["a", "b"]
        assert runs[0].key == runs[1].key


class TestKey:
    def test_everything_that_matters_is_in_it(self):
        base = {"seeds": 1, "fixed": {"iterations": 5}}
        others = (
            {},
            {"first_seed": 1},
            {"fixed": {"iterations": 6}},
            {"fixed": {"iterations": 5, "noise": 0.5}},
            {"trials": {"count": 7}},
            {"problems": "left"},
            {"fixed": {"iterations": 5, "problem.task.horizon": 5}},
        )
        keys = [planned(**{**base, **other})[0].key for other in others]
        assert len(set(keys)) == len(keys)

    def test_semantics_are_in_it(self, monkeypatch):
        (before,) = planned()
        monkeypatch.setattr("kinarm.evaluation.experiments.plan.SEMANTICS", "0")
        (after,) = planned()
        assert before.key != after.key


class TestProblem:
    @pytest.mark.parametrize(
        ("path", "value", "found"),
        [
            ("task.start_spread", 0.3, lambda p: p.task.start_spread),
            ("task.reward.success", 2.0, lambda p: p.task.reward.success),
            ("horizon", 9, lambda p: p.task.horizon),
        ],
    )
    def test_a_field(self, path, value, found):
        assert found(_changed_problem(PROBLEMS["right"], path, value)) == value

    def test_a_field_of_a_pinned_arm_makes_another_arm(self):
        """The hash of the arm that it was is not held against it."""
        pinned = PROBLEMS["right"].pinned
        problem = _changed_problem(pinned, "arm.tool_offset", [0.0, 0.0, 0.2])
        expected = PROBLEMS["right"].replace(
            arm=replace(PROBLEMS["right"].arm, tool_offset=(0.0, 0.0, 0.2))
        )
        assert problem.arm_digest == expected.arm_digest != pinned.arm_digest

    def test_a_scene_by_name(self):
        problem = _changed_problem(PROBLEMS["right"], "scene", "table")
        assert problem.scene == ReachProblem.load("right").replace(scene="table").scene

    @pytest.mark.parametrize(
        ("path", "words"),
        [
            (
                "task.spread",
                "unknown key 'task.spread' (did you mean 'start_spread'?); available: ",
            ),
            ("tusk.spread", "unknown key 'tusk' (did you mean 'task'?); available: "),
        ],
    )
    def test_unknown(self, path, words):
        with pytest.raises(KinarmError) as caught:
            _changed_problem(PROBLEMS["right"], path, 1)
        assert words in str(caught.value)


@pytest.mark.parametrize(
    ("entries", "words"),
    [
        ({"fixed": {"learning_rate": 1.0}}, "unknown field of a recipe or problem 'learning_rate'"),
        ({"grid": {"problem": ["left"]}}, "problem: unknown setting of a problem ''"),
        ({"grid": {"noise": [0.1, -1.0]}}, "noise must be greater than 0, got -1.0"),
        (
            {"grid": {"problem.task.start_spread": [0.2, 3.0]}},
            "problem.task.start_spread: problem: task: start_spread must",
        ),
        (
            {"seeds": 1000, "grid": {"noise": [1, 2], "step_size": [0.1, *range(1, 100)]}},
            "an experiment has at most 100,000 trainings, this one 200,000",
        ),
    ],
)
def test_plans_that_are_refused(entries, words):
    with pytest.raises(InvalidInputError) as caught:
        planned(**entries)
    assert words in str(caught.value)
    assert "\n" not in str(caught.value)
