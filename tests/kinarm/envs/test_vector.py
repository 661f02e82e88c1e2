"""The native batch environment held against a loop of single ones."""

import copy
import pickle

import gymnasium
import numpy as np
import pinocchio as pin
import pytest
from gymnasium.vector import AutoresetMode, SyncVectorEnv

from kinarm.bodies import RandomBodies
from kinarm.envs.reach import ReachEnv
from kinarm.envs.vector import ReachVectorEnv
from kinarm.errors import InvalidInputError, StartInContactError
from kinarm.scene import Scene

NAME = "kinarm/ReachBoth-v0"
NUMBER = 7


def native(mode, number=NUMBER, **settings):
    return gymnasium.make_vec(NAME, num_envs=number, autoreset_mode=mode, **settings)


def looped(mode, number=NUMBER, **settings):
    return SyncVectorEnv(
        [lambda: ReachEnv("both", **settings)] * number, autoreset_mode=AutoresetMode(mode)
    )


def assert_same_infos(batch, loop):
    """Equal entries; what only the batch holds is masked out everywhere."""
    assert set(loop) <= set(batch)
    for key in set(batch) - set(loop):
        assert not batch[key if key.startswith("_") else f"_{key}"].any()
    for key in loop:
        compare_entry(key, batch[key], loop[key])


def compare_entry(key, first, second):
    if isinstance(first, dict):
        assert_same_infos(first, second)
        return
    assert first.dtype == second.dtype, key
    if key == "final_obs":
        for a, b in zip(first, second, strict=True):
            assert (a is None) == (b is None)
            np.testing.assert_array_equal(a, b)
    else:
        np.testing.assert_array_equal(first, second, err_msg=key)


def assert_same_results(first, second):
    for a, b in zip(first[:-1], second[:-1], strict=True):
        assert a.dtype == b.dtype
        np.testing.assert_array_equal(a, b)
    assert_same_infos(first[-1], second[-1])


@pytest.mark.parametrize("mode", ["SameStep", "NextStep"])
class TestAutoreset:
    @pytest.mark.parametrize("horizon", [64, 3])
    def test_equals_a_loop_of_single_environments(self, mode, horizon):
        batch, loop = native(mode, horizon=horizon), looped(mode, horizon=horizon)
        rng = np.random.default_rng(0)
        assert_same_results(batch.reset(seed=3), loop.reset(seed=3))
        ends = np.zeros(2, dtype=int)
        for _ in range(250):
            actions = rng.uniform(-1.2, 1.2, (NUMBER, 5))
            first, second = batch.step(actions), loop.step(actions)
            assert_same_results(first, second)
            ends += [first[2].sum(), first[3].sum()]
        assert (ends > 5).all()
        assert_same_results(batch.reset(), loop.reset())

    def test_successes_are_reported_alike(self, mode):
        settings = {"tolerance": 0.4, "reward": {"success": 2.0, "step": -0.1}}
        batch, loop = native(mode, **settings), looped(mode, **settings)
        rng = np.random.default_rng(1)
        assert_same_results(batch.reset(seed=5), loop.reset(seed=5))
        successes = 0
        for _ in range(40):
            actions = rng.uniform(-1, 1, (NUMBER, 5))
            for _ in range(8):
                first, second = batch.step(actions), loop.step(actions)
                assert_same_results(first, second)
                successes += first[-1].get("final_info", first[-1])["success"].sum()
        assert successes > 2


def test_contacts_are_those_that_coal_finds():
    """At the end of the refused move, or else the first on its way."""
    batch = native("NextStep", 64)
    batch.reset(seed=0)
    rng, world, refused = np.random.default_rng(0), batch.simulator.world, 0
    arm, geometry = world.arm.model, world.contact_model.geometry
    data, placed = arm.createData(), geometry.createData()
    for _ in range(100):
        infos = batch.step(np.sign(rng.uniform(-1, 1, (64, 5))))[-1]
        q, target = batch.episodes.q, batch.episodes.target
        pairs = [batch.contact_names[number] for number in infos["contact"]]
        for row in np.flatnonzero(infos["collision"]):
            pin.computeCollisions(arm, data, geometry, placed, target[row], False)
            touching = [found.isCollision() for found in placed.collisionResults]
            if any(touching):
                assert touching[infos["contact"][row] - 1]
            else:
                assert pairs[row] == world.contact_pair(q[row], target[row]) is not None
            refused += 1
        assert all(pairs[row] is None for row in np.flatnonzero(~infos["collision"]))
    assert refused > 30


class TestDisabled:
    def test_reset_mask_equals_a_loop_of_single_environments(self):
        batch, loop = native("Disabled", horizon=12), looped("Disabled", horizon=12)
        rng = np.random.default_rng(2)
        assert_same_results(batch.reset(seed=9), loop.reset(seed=9))
        resets = 0
        for _ in range(120):
            actions = rng.uniform(-1, 1, (NUMBER, 5))
            first, second = batch.step(actions), loop.step(actions)
            assert_same_results(first, second)
            ended = first[2] | first[3]
            if ended.any():
                resets += 1
                options = {"reset_mask": ended}
                renewed = batch.reset(options=dict(options)), loop.reset(options=dict(options))
                assert_same_results(*renewed)
        assert resets > 5

    def test_step_of_an_ended_episode_is_refused(self):
        """As Gymnasium's own vector environments refuse it, but with a message."""
        batch = native("Disabled", horizon=1)
        batch.reset(seed=0)
        batch.step(np.zeros((NUMBER, 5)))
        with pytest.raises(InvalidInputError, match=r"\[0, 1, 2, 3, 4, 5, 6\] are over"):
            batch.step(np.zeros((NUMBER, 5)))

    @pytest.mark.parametrize(
        "mask", [np.zeros(NUMBER, dtype=bool), np.ones(3, dtype=bool), np.ones(NUMBER), True]
    )
    def test_bad_mask(self, mask):
        batch = native("Disabled")
        batch.reset(seed=0)
        with pytest.raises(InvalidInputError, match="reset_mask must hold 7 booleans"):
            batch.reset(options={"reset_mask": mask})


class TestSeeding:
    def test_sub_environment_i_is_a_single_one_with_seed_plus_i(self):
        observations, _ = native("SameStep").reset(seed=11)
        for i in range(NUMBER):
            np.testing.assert_array_equal(observations[i], ReachEnv("both").reset(seed=11 + i)[0])

    def test_batch_size_does_not_matter(self):
        small, large = native("SameStep", 3), native("SameStep", 200)
        observations = small.reset(seed=0)[0], large.reset(seed=0)[0][:3]
        np.testing.assert_array_equal(*observations)
        actions = np.random.default_rng(3).uniform(-1, 1, (40, 200, 5))
        for action in actions:
            first, second = small.step(action[:3]), large.step(action)
            np.testing.assert_array_equal(first[0], second[0][:3])
            np.testing.assert_array_equal(first[1], second[1][:3])

    def test_threads_do_not_matter(self):
        results = []
        for threads in (1, 2):
            batch = ReachVectorEnv(1100, "both", threads=threads)
            seen = [batch.reset(seed=1)[0]]
            rng = np.random.default_rng(4)
            seen += [batch.step(rng.uniform(-1, 1, (1100, 5)))[0] for _ in range(5)]
            results.append(np.array(seen))
        np.testing.assert_array_equal(*results)


class TestOptions:
    def test_one_start_and_goal_for_all(self):
        goal = [0.1, 0.6, 0.325]
        observations, _ = native("SameStep").reset(
            seed=0, options={"start": np.zeros(6), "goal": goal}
        )
        np.testing.assert_array_equal(observations[:, :3], np.tile(goal, (NUMBER, 1)))
        np.testing.assert_array_equal(observations[0], observations[-1])

    def test_a_start_and_goal_of_each_equal_single_environments(self):
        batch = native("Disabled")
        starts, goals = batch.simulator.sample(np.random.default_rng(0), NUMBER)
        mask = np.arange(NUMBER) % 2 == 0
        batch.reset(seed=0)
        rest = batch.configuration
        for rows, options in ((mask, {"reset_mask": mask}), (np.ones(NUMBER, bool), {})):
            given = np.where(rows[:, None], starts, 0.0), np.where(rows[:, None], goals, 9.0)
            if rows.all():
                given = starts.tolist(), goals
            observations, infos = batch.reset(
                options={"start": given[0], "goal": given[1], **options}
            )
            np.testing.assert_array_equal(batch.configuration[~rows], rest[~rows])
            for row in np.flatnonzero(rows):
                options = {"start": starts[row], "goal": goals[row]}
                expected, info = ReachEnv("both").reset(options=options)
                np.testing.assert_array_equal(observations[row], expected)
                np.testing.assert_array_equal(infos["configuration"][row], info["configuration"])

    @pytest.mark.parametrize(
        ("options", "message"),
        [
            ({"start": np.zeros((3, 6))}, "start must have a row for each of 7 arms, got 3"),
            ({"goal": np.zeros((NUMBER, 2))}, r"goal must have shape \(n, 3\), got \(7, 2\)"),
            ({"start": np.eye(NUMBER, 6) * 9}, r"start\[0\] lies outside the limits: "),
        ],
    )
    def test_bad_options(self, options, message):
        with pytest.raises(InvalidInputError, match=message):
            native("SameStep").reset(options=options)

    def test_goals_are_checked_at_every_reset(self):
        batch = native("Disabled")
        batch.reset(seed=0)
        with pytest.raises(InvalidInputError, match="goals must lie within"):
            batch.reset(options={"goal": [1e12, 0.0, 0.0]})

    def test_arms_that_are_not_begun_are_not_asked(self):
        """Their bodies stay, wherever the arms are by now."""
        bodies = {"name": "ball", "shape": "sphere", "smallest": (0.1,), "largest": (0.3,)}
        places = {"lower": (-1.0, -1.0, 0.0), "upper": (1.0, 1.0, 1.2), "count": (3, 5)}
        scene = Scene(random_bodies=(RandomBodies(**bodies, **places),))
        batch = ReachVectorEnv(16, "both", scene=scene, shield=True, autoreset_mode="Disabled")
        batch.reset(seed=0)
        for _ in range(6):
            batch.step(np.random.default_rng(0).uniform(-1, 1, (16, 5)))
        starts, goals = batch.simulator.sample(np.random.default_rng(1), 16)
        mask, before = np.arange(16) == 0, batch.configuration
        batch.reset(options={"start": starts, "goal": goals, "reset_mask": mask})
        np.testing.assert_array_equal(batch.configuration[0], starts[0])
        np.testing.assert_array_equal(batch.configuration[1:], before[1:])

    def test_failed_reset_leaves_no_half_begun_episodes(self):
        batch, untouched = native("SameStep"), native("SameStep")
        batch.reset(seed=0)
        untouched.reset(seed=0)
        with pytest.raises(StartInContactError):
            batch.reset(options={"start": np.deg2rad([0, 110, -60, 0, 0, 0])})
        actions = np.full((NUMBER, 5), 0.1)
        try:
            observations = batch.step(actions)[0]
        except InvalidInputError:
            return  # asking for a new reset is as good as going on
        np.testing.assert_array_equal(observations, untouched.step(actions)[0])


@pytest.mark.parametrize("seed", [[1, 2], [], -1, [-1] * NUMBER, 3.0])
def test_bad_seeds_are_refused(seed):
    with pytest.raises(InvalidInputError, match="seed"):
        native("SameStep").reset(seed=seed)


@pytest.mark.parametrize(
    "actions", [np.zeros(5), np.zeros((NUMBER, 4)), np.full((NUMBER, 5), np.nan)]
)
def test_bad_actions_are_refused(actions):
    batch = native("SameStep")
    with pytest.raises(InvalidInputError, match="call reset"):
        batch.step(actions)
    batch.reset(seed=0)
    with pytest.raises(InvalidInputError, match="actions must"):
        batch.step(actions)


def test_returned_arrays_are_not_overwritten():
    batch = native("SameStep")
    first, _ = batch.reset(seed=0)
    second = batch.step(np.ones((NUMBER, 5)))
    kept = [first.copy(), second[0].copy(), second[1].copy()]
    batch.step(np.ones((NUMBER, 5)))
    np.testing.assert_array_equal(kept[0], first)
    np.testing.assert_array_equal(kept[1], second[0])
    np.testing.assert_array_equal(kept[2], second[1])


@pytest.mark.parametrize(
    "duplicate", [copy.deepcopy, lambda batch: pickle.loads(pickle.dumps(batch))]
)
def test_copies_continue_alike(duplicate):
    batch = native("NextStep")
    batch.reset(seed=8)
    other = duplicate(batch)
    rng = np.random.default_rng(6)
    for _ in range(70):
        actions = rng.uniform(-1, 1, (NUMBER, 5))
        assert_same_results(batch.step(actions), other.step(actions))


@pytest.mark.parametrize("kind", [gymnasium.vector.SyncVectorEnv, gymnasium.vector.AsyncVectorEnv])
def test_vector_environments_of_single_ones(kind):
    envs = kind([lambda: gymnasium.make(NAME)] * 2)
    batch = native("NextStep", 2)
    assert_same_results(envs.reset(seed=1), batch.reset(seed=1))
    for _ in range(66):
        actions = np.full((2, 5), 0.02)
        assert_same_results(envs.step(actions), batch.step(actions))
    envs.close()
