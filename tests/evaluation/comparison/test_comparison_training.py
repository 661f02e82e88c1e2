"""Trainings of a comparison: judged as any policy is, and told apart by their settings."""

import json
from dataclasses import asdict, replace

import numpy as np
import pytest

from kinarm.errors import InvalidInputError
from kinarm.evaluation import evaluate
from kinarm.evaluation.comparison import training
from kinarm.evaluation.comparison.learners import ComparedLearner, read_learners
from kinarm.evaluation.comparison.runs import CurvePoint, PlannedRun, Protocol, load_run, save_run
from kinarm.evaluation.comparison.training import Judge, carry_out, sb3_model, train_sb3
from kinarm.policies import Policy, find_learner, recipe, train_policy
from kinarm.problem import PROBLEMS

FALLING = {"policy": "MlpPolicy", "learning_rate": 0.01}
PROTOCOL = Protocol(trials=40)
POINT = CurvePoint(1000, 1.0, 1.0, 20, 3, 0.1, 17.0)
EASY = PROBLEMS["right"].replace(name="easy", tolerance=0.4)


def planned(learner, steps=None, seed=0, problem=EASY):
    return PlannedRun(learner, problem, seed, steps, PROTOCOL)


def sb3_learner(algorithm="SAC", hindsight=True, **changes):
    buffer = {"learning_starts": 1000, "buffer_size": 2000}
    if hindsight:
        buffer["replay_buffer_kwargs"] = {"n_sampled_goal": 4}
    policy = "MultiInputPolicy" if hindsight else "MlpPolicy"
    given = {
        "name": "mine",
        "title": "Mine",
        "source": "here",
        "algorithm": algorithm,
        "environment_steps": 1300,
        "n_envs": 4,
        "hindsight": hindsight,
        "settings": {"policy": policy, "batch_size": 16, **buffer},
    }
    return ComparedLearner(**(given | changes))


class TestRecipes:
    def test_a_training_can_be_broken_off(self):
        run = planned(read_learners()["ars-paper"], steps=20_000)
        steps = [point.environment_steps for point in carry_out(run)]
        assert steps == sorted(set(steps))
        assert 20_000 <= steps[-1] < 25_000
        assert len(steps) >= 7

    def test_whole_training(self, monkeypatch):
        monkeypatch.setattr(
            "kinarm.evaluation.comparison.runs.recipe",
            lambda *given, **changes: recipe(*given, **changes, iterations=5),
        )
        run = planned(read_learners()["ars-tuned"])
        last = carry_out(run)[-1]
        policy = train_policy(recipe("ars", "tuned", problem=EASY, seed=0, iterations=5)).policy
        outcome = evaluate(policy, trials=40)
        assert last.successes == outcome.rollouts.success.sum()
        for name in ("median_distance", "steps_to_success"):  # as documents call them
            assert getattr(last, name) == pytest.approx(outcome.metrics[name].value, abs=1e-5)
        assert last.collisions == outcome.rollouts.collision.sum()
        assert last.median_distance == pytest.approx(np.median(outcome.rollouts.distance), abs=1e-5)
        assert last.environment_steps == policy.provenance.environment_steps

    def test_settings_replace_those_of_the_recipe(self):
        learner = replace(
            read_learners()["ars-tuned"],
            settings={"iterations": 5, "net_arch": [4], "reward": {"success": 1.0}},
        )
        config = planned(learner, seed=3).config
        changes = {"iterations": 5, "net_arch": (4,), "reward": {"success": 1.0}}
        assert config == recipe("ars", "tuned", problem=EASY, seed=3, **changes)
        assert config.net_arch == (4,)
        assert (config.reward.success, config.reward.collision) == (1.0, -4.0)

    def test_the_clock_runs_while_the_oracle_teaches(self, monkeypatch):
        pytest.importorskip("stable_baselines3")
        from kinarm.policies.ppo import learner as ppo

        now, demonstrate = np.zeros(2), ppo.demonstrate

        def slow(*given):
            now[:] += 100.0
            return demonstrate(*given)

        monkeypatch.setattr(ppo, "demonstrate", slow)
        monkeypatch.setattr(training, "clocks", now.copy)
        taught = ComparedLearner(
            name="taught",
            title="Taught",
            source="here",
            algorithm="ppo",
            recipe="taught",
            settings={"iterations": 1, "demonstrations": 20, "net_arch": [4]},
        )
        assert carry_out(planned(taught))[-1].processor_seconds == 100.0


class TestStableBaselines:
    @pytest.fixture(autouse=True)
    def _sb3(self):
        pytest.importorskip("sb3_contrib")

    @pytest.mark.parametrize(
        ("algorithm", "hindsight", "changes"),
        [
            ("TQC", True, {"train_on": {"tolerance": 0.3}}),
            (
                "SAC",
                False,
                {"decaying": True, "settings": {**FALLING, "learning_starts": 1000}},
            ),
            ("TD3", False, {"action_noise": 0.1, "train_on": {"reward": {"success": 5.0}}}),
        ],
    )
    def test_off_policy(self, algorithm, hindsight, changes):
        run = planned(sb3_learner(algorithm, hindsight, **changes))
        curve = carry_out(run)
        assert [point.environment_steps for point in curve] == [1000, 1260, 1300]
        assert all(point.processor_seconds > 0 for point in curve)

    def test_on_policy_with_normalised_observations(self, tmp_path):
        settings = {"policy": "MlpPolicy", "n_steps": 64, "batch_size": 64}
        learner = sb3_learner("PPO", hindsight=False, normalize=True, settings=settings)
        run = planned(learner, steps=1100)
        judge = Judge(EASY, PROTOCOL)
        train_sb3(run, judge)
        assert judge.curve[-1].environment_steps == 1280  # whole rollouts

    def test_the_settings_stay_as_they_are(self):
        settings = {"policy": "MlpPolicy", "policy_kwargs": {"net_arch": [8]}}
        learner = sb3_learner(hindsight=False, settings=settings)
        sb3_model(learner, EASY, seed=0)
        assert learner.settings == {"policy": "MlpPolicy", "policy_kwargs": {"net_arch": [8]}}

    def test_settings_that_the_algorithm_refuses(self):
        learner = sb3_learner(settings={"policy": "MultiInputPolicy", "colour": 1})
        with pytest.raises(InvalidInputError, match=r"settings of mine: .*'colour'"):
            sb3_model(learner, EASY, seed=0)

    def test_the_same_again(self, tmp_path):
        curves = []
        for _ in range(2):
            judge = Judge(EASY, PROTOCOL)
            train_sb3(planned(sb3_learner()), judge)
            curves.append([point._replace(seconds=0, processor_seconds=0) for point in judge.curve])
        assert curves[0] == curves[1]

    def test_what_is_judged_is_what_the_model_does(self):
        model = sb3_model(sb3_learner(train_on={"tolerance": 0.3}), EASY, seed=1)
        assert model.get_env().get_attr("simulator")[0].task.tolerance == 0.3
        judge = Judge(EASY, PROTOCOL)
        judge.look(1000, lambda: Policy.from_sb3(model, EASY))
        interface = model.get_env().get_attr("interface")[0]
        outcome = evaluate(
            lambda seen: model.predict(interface.observe(seen), deterministic=True)[0],
            EASY,
            trials=40,
        )
        assert judge.curve[0].successes == outcome.rollouts.success.sum()
        assert judge.curve[0].median_distance == pytest.approx(
            np.median(outcome.rollouts.distance), abs=1e-4
        )


class TestFiles:
    RUN = planned(read_learners()["ars-paper"])

    @pytest.mark.parametrize(
        "other",
        [
            replace(RUN, seed=1),
            replace(RUN, steps=9),
            replace(RUN, protocol=Protocol(trials=41)),
            replace(RUN, problem=EASY.replace(horizon=50)),
            replace(RUN, learner=replace(RUN.learner, recipe="tuned")),
        ],
    )
    def test_other_settings_are_another_file(self, other):
        assert other.name != self.RUN.name

    def test_a_changed_recipe_is_another_file(self, tmp_path, monkeypatch):
        save_run(tmp_path, self.RUN, [POINT])
        assert load_run(tmp_path, self.RUN) == (POINT,)
        monkeypatch.setitem(
            find_learner("ars").recipes, "paper", recipe("ars", "paper", reward={"success": 2.0})
        )
        assert load_run(tmp_path, replace(self.RUN)) is None

    def test_what_a_recipe_becomes_for_a_problem_is_in_the_file(self, tmp_path):
        scene = PROBLEMS["both"].scene
        one_bench = replace(scene, obstacles=scene.obstacles[:1])
        lopsided = PROBLEMS["both"].replace(scene=one_bench)
        run = planned(read_learners()["ars-tuned"], problem=lopsided)
        save_run(tmp_path, run, [POINT])
        settings = json.loads((tmp_path / f"{run.name}.json").read_text())["settings"]["recipe"]
        made = recipe("ars", "tuned", problem=lopsided)
        assert settings["net_arch"] == list(made.net_arch) == [16]
        assert settings["reward"] == asdict(made.reward)
        assert not {"problem", "seed"} & set(settings)

    def test_foreign_learners_have_no_recipe(self):
        assert planned(sb3_learner()).settings["recipe"] == {}

    @pytest.mark.parametrize("damage", [b"", b"[]", b'{"curve": []}', b'{"curve": [{"x": 1}]}'])
    def test_a_damaged_file_is_none(self, tmp_path, damage):
        save_run(tmp_path, self.RUN, [])
        (path,) = tmp_path.iterdir()
        path.write_bytes(damage)
        assert load_run(tmp_path, self.RUN) is None

    def test_none(self, tmp_path):
        assert load_run(tmp_path, self.RUN) is None
