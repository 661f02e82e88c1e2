"""Studies: what is trained, once, wherever and whatever happens, and what it comes to."""

import errno
import json
import os
import pickle
from dataclasses import replace

import numpy as np
import pytest
from small_studies import Counting, contents

from kinarm.errors import InvalidInputError, OutputError, TrainingFailedError
from kinarm.evaluation import evaluate, oracle_bounds
from kinarm.evaluation.experiments import runs as training
from kinarm.evaluation.experiments import study as studies
from kinarm.evaluation.experiments.executors import RayExecutor, SlurmExecutor
from kinarm.evaluation.experiments.study import Study
from kinarm.evaluation.trials import TrialSet
from kinarm.policies import recipe, train_policy


class TestResults:
    def test_a_run_is_what_training_and_evaluation_give(self, finished):
        for run, trained in finished.finished.items():
            settings = {"iterations": 3, "directions": 4, "top_directions": 2}
            config = recipe(
                "ars", "paper", problem="right", seed=run.config.seed, **run.choices, **settings
            )
            policy = train_policy(config).policy
            outcome = evaluate(policy, trials=12)
            np.testing.assert_array_equal(trained.outcomes.distance, outcome.rollouts.distance)
            np.testing.assert_array_equal(trained.outcomes.steps, outcome.rollouts.steps)
            np.testing.assert_array_equal(trained.outcomes.success, outcome.rollouts.success)
            np.testing.assert_array_equal(trained.outcomes.collision, outcome.rollouts.collision)
            steps = policy.provenance.environment_steps
            assert trained.last.environment_steps == steps
            np.testing.assert_array_equal(
                finished.policy(run).layers[0].weights, policy.layers[0].weights
            )

    def test_bounds_are_those_of_the_oracle(self, finished):
        trials = TrialSet.draw("right", 12, 0)
        (bounds,) = finished.bounds.values()
        known = oracle_bounds(trials)
        np.testing.assert_array_equal(bounds.reachable, known.reachable)
        np.testing.assert_array_equal(bounds.steps_lower_bound, known.steps_lower_bound)

    def test_the_curve_is_the_policy_in_the_course_of_the_training(self, finished):
        run, trained = next(iter(finished.finished.items()))
        assert trained.curve
        for point in trained.curve:
            config = replace(run.config, iterations=point.iteration)
            outcome = evaluate(train_policy(config).policy, trials=12)
            assert point.success == outcome.rollouts.success.mean()
            assert point.median_distance == np.median(outcome.rollouts.distance)
            assert point.environment_steps >= 200

    def test_a_study_is_read_from_its_folder(self, finished):
        again = Study.load(finished.store.folder)
        assert [run.key for run in again.finished] == [run.key for run in finished.finished]
        assert repr(again) == "Study('small', 4 of 4 trainings finished)"


class TestGoingOn:
    def test_nothing_is_done_twice(self, finished):
        before = contents(finished.store.folder)
        executor = Counting()
        finished.run(executor=executor)
        assert executor.tasks == []
        assert contents(finished.store.folder) == before

    def test_interrupted_anywhere(self, small, finished):
        study, expected = small(), contents(finished.store.folder)
        for limit in (0, 2, 1):
            with pytest.raises(KeyboardInterrupt):
                study.run(executor=Counting(limit))
        assert len(contents(study.store.folder)) == 3
        study.run(jobs=1)
        assert contents(study.store.folder) == expected

    def test_other_numbers_of_processes_and_threads(self, small, finished):
        study = small().run(jobs=2, threads=2)
        assert contents(study.store.folder) == contents(finished.store.folder)

    def test_a_damaged_file_is_made_anew(self, small):
        study = small().run(jobs=1)
        before = contents(study.store.folder)
        path = study.store.path("runs", study.runs[1])
        path.write_bytes(path.read_bytes()[:200])
        executor = Counting()
        study.run(executor=executor)
        assert len(executor.tasks) == 1
        assert contents(study.store.folder) == before

    def test_more_seeds_and_values(self, small):
        small().run(jobs=1)
        executor = Counting()
        study = small(seeds=3, grid={"step_size": [0.02, 0.2, 0.5]})
        study.run(executor=executor)
        assert len(executor.tasks) == 3 * 3 - 4
        assert len(study) == 9

    def test_an_interrupted_training_goes_on_where_it_was(self, small, monkeypatch):
        monkeypatch.setattr(training, "CHECKPOINT_SECONDS", 0.0)
        details = {"points": 3, "spacing": "geometric", "count": 5, "seed": 1}
        changes = {"seeds": 1, "grid": {}, "trials": {"count": 12, "curve": details}}
        straight = small("straight", **changes).run(jobs=1)
        study = small(**changes)
        save = training.save_checkpoint

        def interrupt(path, config, state, curve):
            save(path, config, state, curve)
            if state.iteration == 2:
                raise KeyboardInterrupt

        monkeypatch.setattr(training, "save_checkpoint", interrupt)
        with pytest.raises(KeyboardInterrupt):
            study.run(executor=Counting())
        monkeypatch.undo()
        assert "0 of 1 trainings finished, 1 under way 67 %, return -0.499" in study.status()[0]
        assert "success 0 %, stopped" in study.status()[0]
        executor = Counting()
        study.run(executor=executor)
        assert [task.state.iteration for task in executor.tasks] == [2]
        assert contents(study.store.folder) == contents(straight.store.folder)
        assert list(study.store.folder.glob("checkpoints/*")) == []

    @pytest.mark.parametrize("failing_at", [1, 3, 6])
    def test_a_write_that_fails(self, small, finished, monkeypatch, failing_at):
        study, sync, calls = small(), os.fsync, []

        def fail_once(file):
            calls.append(file)
            if len(calls) == failing_at:
                raise OSError(errno.ENOSPC, "no space")
            sync(file)

        monkeypatch.setattr(os, "fsync", fail_once)
        with pytest.raises(OutputError):
            study.run(jobs=1)
        study.run(jobs=1)
        assert contents(study.store.folder) == contents(finished.store.folder)
        assert list(study.store.folder.rglob("*.part")) == []

    def test_a_folder_of_another_study(self, small):
        small().run(jobs=1)
        with pytest.raises(InvalidInputError, match="is of the experiment 'small', not of"):
            small(name="other").run()

    def test_one_process_at_a_time(self, small):
        study = small()
        with study.store.writing(study.experiment), pytest.raises(OutputError, match="another"):
            small().run()


class TestFailures:
    @pytest.fixture
    def failing(self, monkeypatch):
        """Trainings with the step size 0.2 fail."""

        def sometimes(task, threads, **options):
            if task.run.config.step_size == 0.2:
                raise ZeroDivisionError("much too fast\nindeed")
            return training.train(task, threads, **options)

        monkeypatch.setattr(studies, "train", sometimes)

    def test_others_go_on(self, small, failing, monkeypatch, finished):
        study = small()
        name = "ars paper* right seed 0, step_size 0.2"
        with pytest.raises(TrainingFailedError, match="2 of 4 trainings failed: ars") as caught:
            study.run(executor=Counting())
        assert f"{name}: much too fast" in str(caught.value)
        assert str(pickle.loads(pickle.dumps(caught.value))) == str(caught.value)
        assert len(study) == 2
        assert set(study.failures.values()) == {"much too fast"}
        assert study.status()[1] == f"failed: {name}: much too fast"
        record = json.loads(study.store.path("failed", study.missing[0]).read_text())
        assert "ZeroDivisionError" in record["trace"]
        monkeypatch.undo()
        study.run(jobs=1)
        assert study.failures == {}
        assert contents(study.store.folder) == contents(finished.store.folder)


class TestStatus:
    def test_stopped_and_done(self, small, finished):
        stopped = "small: 0 of 4 trainings finished, stopped; the command that made it goes on"
        assert small().status() == [stopped]
        assert finished.status() == ["small: 4 of 4 trainings finished"]


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore")  # Ray's own
@pytest.mark.parametrize("package", ["ray", "submitit"])
def test_elsewhere_files_are_the_same(small, finished, tmp_path, monkeypatch, package):
    pytest.importorskip(package)
    monkeypatch.setenv("RAY_ACCEL_ENV_VAR_OVERRIDE_ON_ZERO", "0")
    elsewhere = {
        "ray": RayExecutor("local", jobs=2),
        "submitit": SlurmExecutor(tmp_path / "slurm", bundle=3, cluster="local"),
    }
    study = small().run(executor=elsewhere[package])
    assert contents(study.store.folder) == contents(finished.store.folder)
