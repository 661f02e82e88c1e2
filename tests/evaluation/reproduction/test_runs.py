"""Trained runs on disk: complete and of the same settings, or not there at all."""

from dataclasses import replace

import numpy as np
import pytest
from made_up_runs import made_up

from kinarm.evaluation.reproduction import runs
from kinarm.evaluation.reproduction.results import Results
from kinarm.evaluation.reproduction.runs import RunStore
from kinarm.evaluation.reproduction.study import PlannedTraining, Protocol, Study
from kinarm.evaluation.reproduction.training import carry_out
from kinarm.evaluation.trials import TrialSet
from kinarm.policies import Policy, recipe, train_policy
from kinarm.problem import PROBLEMS

PROTOCOL = Protocol(trials=12, snapshots=3, snapshot_trials=5)
TRAINING = PlannedTraining(
    purpose="ars", config=recipe("ars", "paper", problem="left", iterations=7, directions=12)
)


@pytest.fixture
def store(tmp_path):
    store = RunStore(tmp_path, PROTOCOL)
    store.save(TRAINING, *carry_out(TRAINING, PROTOCOL, threads=1))
    return store


class TestCarryOut:
    def test_the_run_is_that_of_the_training(self, store):
        run = store.load(TRAINING)
        result = train_policy(TRAINING.config)
        np.testing.assert_array_equal(run.returns, [p.mean_return for p in result.curve])
        steps = [point.environment_steps for point in result.curve]
        np.testing.assert_array_equal(run.environment_steps, steps)
        trials = TrialSet.draw(PROBLEMS["left"], 12, seed=0)
        rollouts = trials.simulator.rollout(result.policy, trials.starts, trials.goals)
        np.testing.assert_array_equal(run.distance, rollouts.distance)
        np.testing.assert_array_equal(run.collision, rollouts.collision)
        np.testing.assert_array_equal(run.steps, rollouts.steps)
        saved = Policy.load(store.policy_path(TRAINING))
        np.testing.assert_array_equal(saved.layers[0].weights, result.policy.layers[0].weights)

    def test_snapshots_are_policies_in_the_course_of_it(self, store):
        run = store.load(TRAINING)
        assert run.snapshots.tolist() == [1, 4, 6]
        trials = TrialSet.draw(PROBLEMS["left"], 5, seed=1)
        for row, iteration in enumerate(run.snapshots):
            policy = train_policy(replace(TRAINING.config, iterations=int(iteration) + 1)).policy
            rollouts = trials.simulator.rollout(policy, trials.starts, trials.goals)
            np.testing.assert_allclose(run.snapshot_distance[row], rollouts.distance, atol=1e-6)

    def test_the_last_snapshot_of_a_symmetric_training_is_its_policy(self, tmp_path):
        """Statistics of the mirror images are part of it."""
        config = recipe("ars", "tuned", problem="both", iterations=3)
        training = PlannedTraining(purpose="ars", config=config)
        store = RunStore(tmp_path, PROTOCOL)
        store.save(training, *carry_out(training, PROTOCOL, threads=1))
        policy = Policy.load(store.policy_path(training))
        trials = TrialSet.draw(PROBLEMS["both"], 5, seed=1)
        last = trials.simulator.rollout(policy, trials.starts, trials.goals).distance
        found = store.load(training).snapshot_distance[-1]
        np.testing.assert_array_equal(found, last.astype(np.float32))

    def test_wall_time_grows(self, store):
        times = store.load(TRAINING).wall_time
        assert times[0] > 0
        assert (np.diff(times) >= 0).all()


class TestStore:
    def test_nothing_is_there_at_first(self, tmp_path):
        assert RunStore(tmp_path, PROTOCOL).load(TRAINING) is None

    @pytest.mark.parametrize("kept", [0.0, 0.3, 0.9, 0.999])
    @pytest.mark.parametrize("folder", ["policies", "runs", "timing"])
    def test_a_part_of_a_file_is_not_trusted(self, store, folder, kept):
        (path,) = (store.folder / folder).iterdir()
        path.write_bytes(path.read_bytes()[: int(kept * path.stat().st_size)])
        assert store.load(TRAINING) is None

    @pytest.mark.parametrize("folder", ["policies", "runs", "timing"])
    def test_a_missing_file_is_noticed(self, store, folder):
        (path,) = (store.folder / folder).iterdir()
        path.unlink()
        assert store.load(TRAINING) is None

    def test_a_policy_of_another_training_is_noticed(self, store):
        train_policy(replace(TRAINING.config, seed=5)).policy.save(store.policy_path(TRAINING))
        assert store.load(TRAINING) is None

    def test_other_settings_are_another_training(self, store):
        assert store.load(TRAINING) is not None
        longer = replace(TRAINING, config=replace(TRAINING.config, iterations=8))
        assert longer.name == TRAINING.name
        assert store.load(longer) is None
        other = RunStore(store.folder, replace(PROTOCOL, trials=13))
        assert other.load(TRAINING) is None

    def test_other_semantics_are_another_training(self, store, monkeypatch):
        monkeypatch.setattr(runs, "SEMANTICS", "another")
        assert store.load(TRAINING) is None

    def test_they_concern_ppo(self, store, monkeypatch):
        training = replace(TRAINING, purpose="ppo")
        policy = Policy.load(store.policy_path(TRAINING))
        store.save(training, policy, made_up(np.zeros(PROTOCOL.trials)))
        assert store.load(training) is not None
        versions = runs.package_versions()
        monkeypatch.setattr(runs, "package_versions", lambda: {**versions, "torch": "0"})
        assert store.load(training) is None

    def test_commits_are_those_of_the_policies_that_can_be_read(self, store):
        made = Policy.load(store.policy_path(TRAINING)).provenance.commit
        assert store.commits([TRAINING]) == ((made,) if made else ())
        store.policy_path(TRAINING).write_bytes(b"damaged")
        assert store.commits([TRAINING]) == ()

    def test_ppos_packages_do_not_concern_ars(self, store, monkeypatch):
        versions = runs.package_versions()
        monkeypatch.setattr(runs, "package_versions", lambda: {**versions, "torch": "0"})
        assert store.load(TRAINING) is not None
        monkeypatch.setattr(runs, "package_versions", lambda: {**versions, "numpy": "0"})
        assert store.load(TRAINING) is None


def test_results_know_what_is_missing(store):
    other = replace(TRAINING, config=replace(TRAINING.config, seed=1))
    study = Study(name="test", trainings=(TRAINING, other), protocol=PROTOCOL)
    results = Results.load(study, store)
    assert results.missing == (other,)
    assert results.distances("ars", "left").shape == (1, 12)
    assert results.select("ars", "right") == []


class TestSnapshots:
    RUN = made_up(np.ones(3), np.array([[0.5, 0.5], [0.2, 0.5], [0.1, 0.1], [0.3, 0.3]]))

    @pytest.mark.parametrize(
        ("distance", "share", "steps"),
        [(0.5, 1.0, 1000), (0.2, 0.5, 2000), (0.2, 0.75, 3000), (0.05, 0.25, float("inf"))],
    )
    def test_steps_to_level(self, distance, share, steps):
        assert self.RUN.steps_to_level(distance, share) == steps

    @pytest.mark.parametrize(("steps", "distance"), [(4000, 0.3), (3999, 0.1), (10, 0.5)])
    def test_distance_after(self, steps, distance):
        assert self.RUN.distance_after(steps)[1] == pytest.approx(distance)
