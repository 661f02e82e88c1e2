"""Demonstrations held against the reference and the environment, and their files."""

import subprocess
import sys

import numpy as np
import pytest
from reference_episodes import scripted
from simulators import changed

from kinarm.envs import ReachEnv
from kinarm.errors import InvalidInputError, OutputError
from kinarm.policies import Demonstrations, Oracle
from kinarm.problem import PROBLEMS
from kinarm.reference import ReferenceSimulator

TRIALS = 40
PROBLEM = PROBLEMS["both"].replace(horizon=10, reward={"success": 2.0, "step": -0.1})
ARRAYS = (
    *("observations", "actions", "rewards", "terminations", "truncations"),
    *("final_observations", "starts", "goals"),
)


@pytest.fixture(scope="module")
def oracle():
    return Oracle(PROBLEM, threads=1)


@pytest.fixture(scope="module")
def shown(oracle):
    return oracle.demonstrations(TRIALS, seed=3)


def motions(shown):
    """Rows, start and goal of each motion."""
    ends = np.cumsum(shown.steps)
    rows = [slice(end - steps, end) for end, steps in zip(ends, shown.steps, strict=True)]
    return zip(rows, shown.starts, shown.goals, strict=True)


def assert_same(first, second):
    assert first.problem.digest == second.problem.digest
    assert first.trials == second.trials
    for name in ARRAYS:
        a, b = getattr(first, name), getattr(second, name)
        assert a.dtype == b.dtype
        np.testing.assert_array_equal(a, b)


def test_motions_reach_their_goals_in_the_reference(oracle, shown):
    reference = ReferenceSimulator(changed(oracle.simulator, tested_configurations=4))
    for number, (rows, start, goal) in enumerate(motions(shown)):
        episode = reference.rollout(scripted(shown.actions[rows]), start, goal)
        assert episode.success
        seen = np.concatenate([shown.observations[rows], shown.final_observations[number, None]])
        np.testing.assert_allclose(seen, episode.observations, rtol=0, atol=1e-12)
        np.testing.assert_allclose(shown.rewards[rows], episode.rewards, rtol=0, atol=1e-12)


def test_they_are_what_the_environment_returns(shown):
    env = ReachEnv(PROBLEM)
    for number, (rows, start, goal) in enumerate(motions(shown)):
        seen, _ = env.reset(options={"start": start, "goal": goal})
        for row in range(rows.start, rows.stop):
            np.testing.assert_array_equal(seen, shown.observations[row])
            seen, *end, _ = env.step(shown.actions[row])
            wanted = (shown.rewards[row], shown.terminations[row], shown.truncations[row])
            assert end == list(wanted)
        assert shown.terminations[rows].sum() == 1
        np.testing.assert_array_equal(seen, shown.final_observations[number])


def test_only_those_that_reach_the_goal_are_shown(oracle, shown):
    found = oracle.solve_batch(*oracle.simulator.sample(np.random.default_rng(0), TRIALS))
    starts, goals = oracle.simulator.sample(np.random.default_rng(0), TRIALS)
    reached = found.reachable
    assert 0 < reached.sum() < TRIALS
    again = oracle.demonstrate(starts, goals)
    assert (len(again), again.trials) == (reached.sum(), TRIALS)
    np.testing.assert_array_equal(again.goals, goals[reached])
    np.testing.assert_array_equal(again.steps, found.steps[reached])
    assert len(shown) < TRIALS
    assert f"{len(shown)} motions of {len(shown.rewards)} steps" in repr(shown)
    assert f"{TRIALS} trials" in repr(shown)


def test_a_seed_decides(oracle, shown):
    assert_same(Oracle(PROBLEM, threads=2).demonstrations(TRIALS, seed=3), shown)
    assert not np.array_equal(oracle.demonstrations(TRIALS, seed=4).goals, shown.goals)


def test_without_a_motion_there_is_nothing_to_imitate():
    with pytest.raises(InvalidInputError, match="no motion that could be imitated"):
        Oracle(PROBLEM.replace(horizon=1), threads=1).demonstrations(3)


@pytest.mark.parametrize(("n", "seed", "name"), [(0, 0, "n"), (2.5, 0, "n"), (1, -1, "seed")])
def test_bad_numbers(oracle, n, seed, name):
    with pytest.raises(InvalidInputError, match=f"{name} must be a whole number"):
        oracle.demonstrations(n, seed=seed)


class TestFile:
    def test_is_read_back(self, shown, tmp_path):
        shown.save(tmp_path / "shown.npz")
        assert_same(Demonstrations.load(tmp_path / "shown.npz"), shown)
        with np.load(tmp_path / "shown.npz") as plain:
            np.testing.assert_array_equal(plain["actions"], shown.actions)

    def test_arrays_are_read_only(self, shown):
        with pytest.raises(ValueError, match="read-only"):
            shown.actions[0] = 0.0

    @pytest.mark.parametrize("name", ARRAYS)
    def test_shapes_must_match(self, shown, name):
        given = {**vars(shown), name: getattr(shown, name)[:-1]}
        with pytest.raises(InvalidInputError, match=r"must (have shape|be true)"):
            Demonstrations(**given)


class TestMinari:
    @pytest.fixture(autouse=True)
    def minari(self, tmp_path, monkeypatch):
        monkeypatch.setenv("MINARI_DATASETS_PATH", str(tmp_path / "sets"))
        return pytest.importorskip("minari")

    def test_is_read_back_with_its_environment(self, minari, shown):
        shown.to_minari("kinarm/both-oracle-v0", author="Jane")
        found = minari.load_dataset("kinarm/both-oracle-v0")
        env = found.recover_environment()
        assert env.unwrapped.simulator.problem.digest == PROBLEM.digest
        assert found.total_episodes == len(shown)
        options = [each["options"] for each in found.storage.get_episode_metadata(range(3))]
        for episode, (rows, start, goal) in zip(found, motions(shown), strict=True):
            np.testing.assert_array_equal(episode.observations[:-1], shown.observations[rows])
            np.testing.assert_array_equal(episode.actions, shown.actions[rows])
            np.testing.assert_array_equal(episode.rewards, shown.rewards[rows])
            if episode.id < len(options):
                np.testing.assert_array_equal(options[episode.id]["start"], start)
                np.testing.assert_array_equal(options[episode.id]["goal"], goal)
                seen, _ = env.reset(options=options[episode.id])
                np.testing.assert_array_equal(seen, episode.observations[0])
                for action, then in zip(episode.actions, episode.observations[1:], strict=True):
                    np.testing.assert_array_equal(env.step(action)[0], then)

    def test_its_environment_needs_no_import_of_kinarm(self, shown, tmp_path):
        shown.to_minari("right-v0")
        program = "import minari; print(minari.load_dataset('right-v0').recover_environment())"
        done = subprocess.run(
            [sys.executable, "-c", program], capture_output=True, text=True, check=False
        )
        assert "kinarm/Reach-v0" in done.stdout, done.stderr

    def test_refusals(self, shown, tmp_path):
        for name in ("right", "right oracle-v0", "/-v0"):
            with pytest.raises(InvalidInputError, match="dataset_id must be like"):
                shown.to_minari(name)
        assert not (tmp_path / "sets" / "right").exists()
        shown.to_minari("right-v0")
        with pytest.raises(OutputError, match="exists: minari.delete_dataset"):
            shown.to_minari("right-v0")
        (tmp_path / "sets" / "file").write_text("")
        with pytest.raises(OutputError, match="cannot write"):
            shown.to_minari("file/right-v0")
