"""Studies: what is trained, once, and what it comes to."""

import json
import math
from dataclasses import replace

import numpy as np
import pytest
from small_studies import SMALL, contents

from kinarm.errors import InvalidInputError, OutputError
from kinarm.evaluation import evaluate, oracle_bounds
from kinarm.evaluation.studies import training
from kinarm.evaluation.studies.study import Study
from kinarm.evaluation.trials import TrialSet
from kinarm.policies import Policy, recipe, train_policy
from kinarm.workers import Finished


class Counting:
    """An executor that carries out at most so many tasks in this process."""

    def __init__(self, limit=1000):
        self.tasks, self._limit = [], limit

    def carry_out(self, work, tasks):
        for number, task in enumerate(tasks):
            if len(self.tasks) == self._limit:
                raise KeyboardInterrupt
            self.tasks.append(task)
            yield Finished(number, work(task))


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

    def test_a_policy_can_be_taken_out(self, finished, tmp_path):
        run = finished.runs[0]
        policy = finished.policy(run)
        assert policy.provenance.versions["kinarm"]
        policy.save(tmp_path / "it.npz")
        assert Policy.load(tmp_path / "it.npz").provenance.seed == run.config.seed

    def test_a_specification_is_taken_as_it_is(self, finished):
        again = Study(finished.specification, finished.store.folder)
        assert [run.key for run in again.runs] == [run.key for run in finished.runs]

    def test_reprs_and_lengths(self, finished):
        trained = next(iter(finished))
        assert len(trained.outcomes) == len(trained.outcomes.distance) == 12
        assert len(finished) == len(list(finished)) == 4
        assert repr(finished) == "Study('small', 4 of 4 trainings finished)"
        assert finished.missing == ()

    def test_a_study_is_read_from_its_folder(self, finished):
        again = Study.load(finished.store.folder)
        assert [run.key for run in again.finished] == [run.key for run in finished.finished]

    def test_no_study(self, tmp_path):
        with pytest.raises(InvalidInputError, match="there is no study in"):
            Study.load(tmp_path)


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
        for path in (study.store.run_path(study.runs[1]), *study.store.folder.glob("bounds/*")):
            path.write_bytes(path.read_bytes()[:200])
        executor = Counting()
        study.run(executor=executor)
        assert len(executor.tasks) == 2
        assert contents(study.store.folder) == before

    def test_a_file_under_the_name_of_another_is_made_anew(self, small):
        study = small().run(jobs=1)
        first, second = (study.store.run_path(run) for run in study.runs[:2])
        before = first.read_bytes()
        first.write_bytes(second.read_bytes())
        study.run(jobs=1)
        assert first.read_bytes() == before

    def test_more_seeds_and_values(self, small):
        small().run(jobs=1)
        executor = Counting()
        study = small(seeds=3, grid={"step_size": [0.02, 0.2, 0.5]})
        study.run(executor=executor)
        assert len(executor.tasks) == 3 * 3 - 4
        assert len(study) == 9

    def test_more_iterations_go_on_where_the_shorter_training_ended(self, small):
        small().run(jobs=1)
        fixed = {**SMALL["fixed"], "iterations": 8}
        executor = Counting()
        study = small(fixed=fixed).run(executor=executor)
        assert [task.start.state.iteration for task in executor.tasks] == [3] * 4
        straight = small("straight", fixed=fixed).run(jobs=1)
        for run in study.runs:
            went_on, at_once = (each.store.run_path(run).read_bytes() for each in (study, straight))
            assert went_on == at_once
            times = study.store.made(run)
            assert len(times["points"]) == len(study.finished[run].curve)

    def test_but_not_if_the_schedule_depends_on_them(self, small):
        changes = {"step_size_schedule": "linear"}
        small(fixed={**SMALL["fixed"], **changes}).run(jobs=1)
        executor = Counting()
        small(fixed={**SMALL["fixed"], **changes, "iterations": 5}).run(executor=executor)
        assert [task.start for task in executor.tasks] == [None] * 4

    def test_a_longer_training_of_ppo(self, small):
        pytest.importorskip("torch")
        fixed = {"n_envs": 2, "n_steps": 32, "batch_size": 32, "n_epochs": 2}
        changes = {"learners": "ppo", "seeds": 1, "grid": {}}
        small(fixed={**fixed, "iterations": 2}, **changes).run(jobs=1)
        executor = Counting()
        long = {"fixed": {**fixed, "iterations": 5}, **changes}
        study = small(**long).run(executor=executor)
        assert [task.start.state.iteration for task in executor.tasks] == [2]
        straight = small("straight", **long).run(jobs=1)
        assert contents(straight.store.folder).items() <= contents(study.store.folder).items()

    def test_nor_if_the_state_was_not_kept(self, small, monkeypatch):
        """Without it, a longer training begins anew, and comes to the same."""
        study = small().run(jobs=1)
        found = study.store.shorter_runs(
            {run.lineage for run in small(fixed={**SMALL["fixed"], "iterations": 8}).runs}
        )
        for each in (each for kept in found.values() for each in kept):
            path = study.store.run_path(each[0])
            with np.load(path) as archive:
                arrays = {
                    name: archive[name] for name in archive.files if not name.startswith("state.")
                }
            assert len(arrays) < len(archive.files)
            np.savez(path, **arrays)
        executor = Counting()
        longer = small(fixed={**SMALL["fixed"], "iterations": 8}).run(executor=executor)
        assert [task.start for task in executor.tasks] == [None] * 4
        straight = small("straight", fixed=longer.specification.fixed).run(jobs=1)
        for run in longer.runs:
            assert longer.store.run_path(run).read_bytes() == (
                straight.store.run_path(run).read_bytes()
            )

    def test_a_run_with_fewer_trials_is_made_anew(self, small):
        study = small().run(jobs=1)
        path = study.store.run_path(study.runs[0])
        before = path.read_bytes()
        with np.load(path) as archive:
            arrays = {
                name: archive[name][:-1] if name.startswith("outcomes.") else archive[name]
                for name in archive.files
            }
        np.savez(path, **arrays)
        assert study.runs[0] not in Study.load(study.store.folder).finished
        small().run(jobs=1)
        assert path.read_bytes() == before

    @pytest.mark.parametrize("number", [1e308, -math.inf, math.nan])
    @pytest.mark.parametrize("name", ["distance", "returns"])
    def test_a_run_with_numbers_that_no_trial_comes_to_is_made_anew(self, small, name, number):
        study = small().run(jobs=1)
        path = study.store.run_path(study.runs[0])
        with np.load(path) as archive:
            arrays = {each: archive[each] for each in archive.files}
        arrays[f"outcomes.{name}"][:2] = number
        np.savez(path, **arrays)
        assert study.runs[0] not in Study.load(study.store.folder).finished

    def test_where_no_record_tells_how_long_it_took(self, small):
        study = small().run(jobs=1)
        study.store.made_path(study.runs[0]).unlink()
        assert study.store.made(study.runs[0]) == {}
        assert np.isnan(study.table()["seconds"]).sum() == 1

    def test_a_folder_of_another_study(self, small):
        small().run(jobs=1)
        with pytest.raises(InvalidInputError, match="holds the study 'small', not 'other'"):
            small(name="other").run()

    def test_one_process_at_a_time(self, small):
        study = small()
        with study.store.writing(study.specification), pytest.raises(OutputError, match="another"):
            small().run()


class TestFailures:
    @pytest.fixture
    def failing(self, monkeypatch):
        """Trainings with the step size 0.2 fail."""
        train = training.train

        def sometimes(task, threads):
            if task.run.config.step_size == 0.2:
                raise ZeroDivisionError("much too fast\nindeed")
            return train(task, threads)

        monkeypatch.setattr(training, "train", sometimes)

    def test_others_go_on(self, small, failing, monkeypatch, finished):
        study = small().run(executor=Counting())
        assert len(study) == 2
        assert set(study.failures.values()) == {"much too fast"}
        assert {run.config.step_size for run in study.failures} == {0.2}
        record = json.loads(study.store.failure_path(study.missing[0]).read_text())
        assert "ZeroDivisionError" in record["trace"]
        monkeypatch.undo()
        study.run(jobs=1)
        assert study.failures == {}
        assert contents(study.store.folder) == contents(finished.store.folder)

    def test_bounds_that_cannot_be_found(self, small, monkeypatch):
        def fail(*_):
            raise MemoryError

        monkeypatch.setattr(training, "find_bounds", fail)
        study = small(seeds=1).run(executor=Counting())
        assert len(study) == 2
        assert study.bounds == {}
        assert study.store.failure(study.bound_tasks[0]) == "MemoryError"
        assert np.isnan(study.table()["relative_success"]).all()
