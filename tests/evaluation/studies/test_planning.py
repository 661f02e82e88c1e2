"""From a study to its trainings."""

from dataclasses import replace

import pytest

from kinarm.errors import InvalidInputError, KinarmError
from kinarm.evaluation.studies.planning import changed_problem, planned_runs
from kinarm.evaluation.studies.specification import StudySpecification
from kinarm.policies.recipes import recipe
from kinarm.problem import PROBLEMS, ReachProblem


def planned(**entries):
    return planned_runs(StudySpecification.from_json({"name": "mine", **entries}, "study"))


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

    def test_fields_of_one_learner_leave_the_others_alone(self):
        runs = planned(
            learners=["ars", "ppo"],
            fixed={"ars.iterations": 5, "clip_range": 0.1},
            grid={"ppo.n_epochs": [1, 2], "noise": [0.01, 0.02]},
        )
        assert len(runs) == 2 + 2
        ars = [run.config for run in runs if run.learner == "ars"]
        ppo = [run.config for run in runs if run.learner == "ppo"]
        assert {config.iterations for config in ars} == {5}
        assert {config.noise for config in ars} == {0.01, 0.02}
        assert {config.n_epochs for config in ppo} == {1, 2}
        assert {config.clip_range for config in ppo} == {0.1}
        assert ppo[0].iterations == recipe("ppo", "paper").iterations

    def test_weights_of_the_reward(self):
        (run,) = planned(fixed={"reward.success": 3.0, "reward": {"progress": 2.0}})
        assert (run.config.reward.success, run.config.reward.progress) == (3.0, 2.0)

    def test_choices_are_what_varies(self):
        runs = planned(grid={"problem.task.tolerance": [0.05, 0.1]}, fixed={"noise": 0.2})
        assert [run.choices for run in runs] == [
            {"problem.task.tolerance": 0.05},
            {"problem.task.tolerance": 0.1},
        ]


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
        monkeypatch.setattr("kinarm.evaluation.studies.planning.SEMANTICS", "0")
        (after,) = planned()
        assert before.key != after.key

    def test_a_lineage_is_without_iterations(self):
        short, long = (planned(fixed={"iterations": n})[0] for n in (5, 6))
        other = planned(fixed={"iterations": 6, "noise": 0.3})[0]
        assert short.lineage == long.lineage != other.lineage


class TestProblem:
    @pytest.mark.parametrize(
        ("path", "value", "found"),
        [
            ("task.start_spread", 0.3, lambda p: p.task.start_spread),
            ("task.reward.success", 2.0, lambda p: p.task.reward.success),
            ("stepping.time_step", 0.2, lambda p: p.stepping.time_step),
            ("horizon", 9, lambda p: p.task.horizon),
        ],
    )
    def test_a_field(self, path, value, found):
        assert found(changed_problem(PROBLEMS["right"], path, value)) == value

    def test_the_rest_stays(self):
        problem = changed_problem(PROBLEMS["both"], "task.start_spread", 0.5)
        assert problem == PROBLEMS["both"].replace(start_spread=0.5)

    def test_a_field_of_a_pinned_arm_makes_another_arm(self):
        """The hash of the arm that it was is not held against it."""
        pinned = PROBLEMS["right"].pinned
        problem = changed_problem(pinned, "arm.tool_offset", [0.0, 0.0, 0.2])
        expected = PROBLEMS["right"].replace(
            arm=replace(PROBLEMS["right"].arm, tool_offset=(0.0, 0.0, 0.2))
        )
        assert problem.arm_digest == expected.arm_digest != pinned.arm_digest

    def test_a_scene_by_name(self):
        problem = changed_problem(PROBLEMS["right"], "scene", "table")
        assert problem.scene == ReachProblem.load("right").replace(scene="table").scene

    @pytest.mark.parametrize(
        ("path", "words"),
        [
            ("task.spread", "unknown field of problem.task 'spread'"),
            ("tusk.spread", "unknown field of problem 'tusk'"),
            ("task.horizon.x", "unknown field of problem.task.horizon 'x'"),
        ],
    )
    def test_unknown(self, path, words):
        with pytest.raises(KinarmError) as caught:
            changed_problem(PROBLEMS["right"], path, 1)
        assert words in str(caught.value)


@pytest.mark.parametrize(
    ("entries", "words"),
    [
        ({"fixed": {"learning_rate": 1.0}}, "unknown field of a recipe or problem 'learning_rate'"),
        ({"grid": {"ppo.noise": [1]}}, "unknown field of a recipe or problem 'ppo.noise'"),
        ({"fixed": {"seed": 1}}, "unknown field of a recipe or problem 'seed'"),
        ({"fixed": {"noise": "much"}}, "noise must be a number, got 'much'"),
        ({"grid": {"noise": [0.1, -1.0]}}, "noise must be greater than 0, got -1.0"),
        (
            {"grid": {"problem.task.start_spread": [0.2, 3.0]}},
            "problem.task.start_spread: problem: task: start_spread must",
        ),
        (
            {"fixed": {"problem.task.sperad": 1}},
            "problem.task.sperad: unknown field of problem.task",
        ),
        ({"learners": "arse"}, "unknown learner 'arse'"),
        ({"recipes": "tunde"}, "unknown recipe 'tunde'"),
        ({"problems": "rihgt"}, "rihgt"),
    ],
)
def test_refused(entries, words):
    with pytest.raises(InvalidInputError) as caught:
        planned(**entries)
    assert words in str(caught.value)
    assert "\n" not in str(caught.value)
