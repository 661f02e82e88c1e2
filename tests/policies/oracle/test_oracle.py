"""The oracle: bounds that hold, motions that arrive, and what is refused."""

import numpy as np
import pytest
from proofs import assert_identical, assert_reference_agrees, drawn, replayed

from kinarm.errors import InvalidInputError, StartInContactError
from kinarm.policies import Oracle, OracleSolutions
from kinarm.policies.oracle.inverse import steps_between
from kinarm.problem import PROBLEMS
from kinarm.scene import RandomBodies, Scene

TRIALS = {"lrmate200ic_5l": 100, "paper": 150, "paper_flange": 220}

HORIZON = 64
TOLERANCE = 0.05


@pytest.fixture(scope="module", params=sorted(TRIALS))
def solved(request):
    """An arm's oracle, random trials of both benches, and what it knows about them."""
    oracle = Oracle(PROBLEMS["both"].replace(arm=request.param), threads=2)
    starts, goals = drawn(oracle.simulator, 1, TRIALS[request.param])
    return oracle, starts, goals, oracle.solve_batch(starts, goals)


@pytest.fixture(scope="module")
def oracle():
    return Oracle("both", threads=1)


class TestBounds:
    def test_motions_are_no_better_than_the_bounds(self, solved):
        _, _, _, known = solved
        reached = known.reachable
        assert (known.steps_lower_bound >= 1).all()
        assert (known.steps >= known.steps_lower_bound)[reached].all()
        assert (known.steps <= HORIZON).all()
        assert (known.steps[~reached] == HORIZON).all()
        assert (known.steps_lower_bound <= HORIZON + 1).all()
        assert (known.final_distance <= TOLERANCE)[reached].all()

    def test_straight_motion_to_the_end_takes_no_less_than_the_floor(self, solved):
        oracle, starts, _, known = solved
        ends = known.paths[np.arange(len(known)), known.steps]
        straight = steps_between(oracle.simulator, starts, ends)[known.reachable]
        assert (np.ceil(straight - 1e-9) >= known.steps_lower_bound[known.reachable]).all()
        assert (straight <= known.steps[known.reachable] + 1e-9).all()

    def test_gap_is_small_and_floors_are_tight(self, solved):
        _, _, _, known = solved
        gap = (known.steps - known.steps_lower_bound)[known.reachable]
        assert np.median(gap) <= 2
        assert np.percentile(gap, 95) <= 6
        # 0.9 is the aim; a share of 200 trials is known to about 0.02.
        assert known.proof_complete.mean() > 0.85
        assert (known.proof_complete | (known.steps > known.steps_lower_bound)).all()

    def test_trials_that_are_not_reached_say_why(self, solved):
        _, _, _, known = solved
        for row, reason in enumerate(known.reasons):
            if known.reachable[row]:
                assert reason == ""
                continue
            assert known.final_distance[row] > TOLERANCE
            if known.steps_lower_bound[row] > HORIZON:
                assert known.proof_complete[row]
                assert reason == "out of reach: proven for all motions of 64 steps"
                assert known.final_distance[row] < 3 * TOLERANCE
            else:
                assert "found" in reason

    def test_goals_of_either_bench_are_reached_as_far_as_the_arm_is_long(self, solved):
        oracle, _, goals, known = solved
        left = goals[:, 1] > 0
        for share in (known.reachable[left].mean(), known.reachable[~left].mean()):
            is_long = oracle.simulator.arm.name != "paper_flange"
            assert share == 1 if is_long else 0.85 < share < 0.98

    @pytest.mark.rare
    def test_a_thousand_trials_of_the_default_arm(self):
        oracle = Oracle("both")
        known = oracle.solve_batch(*drawn(oracle.simulator, 4, 1000))
        rest = known.reasons[~known.reachable]
        assert len(rest) <= 1, rest
        gap = (known.steps - known.steps_lower_bound)[known.reachable]
        assert (gap >= 0).all()
        assert np.median(gap) <= 2
        assert np.percentile(gap, 95) <= 6
        assert known.proof_complete.mean() > 0.9


class TestMotions:
    def test_reference_agrees(self, solved):
        oracle, starts, goals, known = solved
        assert_reference_agrees(oracle, starts[:40], goals[:40], known)

    def test_paths_and_actions(self, solved):
        """Within the rated speeds; they begin at the start and end closer to the goal."""
        oracle, starts, goals, known = solved
        assert (np.abs(known.actions) <= 1 + 1e-9).all()
        np.testing.assert_array_equal(known.paths[:, 0], starts)
        for row, steps in enumerate(known.steps):
            assert np.isnan(known.paths[row, steps + 1 :]).all()
        tools, _ = oracle.simulator.world.screen(starts)
        before = np.linalg.norm(tools - goals, axis=1)
        assert (known.final_distance < before)[~known.reachable].all()


class TestDeterminism:
    def test_order_split_and_threads_do_not_matter(self, solved):
        oracle, starts, goals, known = solved
        missed = np.flatnonzero(~known.reachable)[:6]
        slow = np.argsort(known.steps - known.steps_lower_bound, kind="stable")[-6:]
        rows = np.unique(np.concatenate([missed, slow, np.arange(16)]))
        np.random.default_rng(5).shuffle(rows)
        alone = Oracle(oracle.simulator.problem, threads=1)
        parts = [
            alone.solve_batch(starts[part], goals[part]) for part in np.split(rows, [1, 4, 15])
        ]
        assert_identical(known, OracleSolutions.concatenated(parts), rows)

    def test_lots_do_not_matter(self, solved, monkeypatch):
        oracle, starts, goals, known = solved
        monkeypatch.setattr("kinarm.policies.oracle.oracle.LOT", 3)
        assert_identical(known, oracle.solve_batch(starts[:8], goals[:8]), slice(8))

    def test_single_trials_equal_a_batch(self, oracle, few):
        for row, trial in enumerate(zip(*drawn(oracle.simulator, 17, 4), strict=True)):
            one = oracle.solve_batch(*(each.tolist() for each in trial))
            assert_identical(few, one, slice(row, row + 1))

    def test_mirror_images_have_the_same_floor(self, solved):
        oracle, starts, goals, known = solved
        rows = slice(24)
        image = oracle.solve_batch(starts[rows] * [-1, 1, 1, -1, 1, -1], goals[rows] * [1, -1, 1])
        both = known.proof_complete[rows] & image.proof_complete
        assert both.mean() > 0.8
        np.testing.assert_array_equal(
            known.steps_lower_bound[rows][both], image.steps_lower_bound[both]
        )


def with_task(**settings):
    return Oracle(PROBLEMS["both"].replace(**settings), threads=1)


def numbers(known):
    """Of one trial: steps of the motion, steps proven necessary, whether the proof is complete."""
    return known.steps[0], known.steps_lower_bound[0], known.proof_complete[0]


class TestSingleTrials:
    def test_goal_far_away(self, oracle):
        # The second axis lies at (0.075, 0, 0.33) when the base points at the goal; beyond it
        # the arm stretches to 0.3 m + 0.329 m + 0.23 m.
        goal = np.array([2.0, 0.0, 0.5])
        known = oracle.solve_batch(np.zeros(6), goal)
        reach = 0.3 + np.hypot(0.32, 0.075) + 0.23
        exact = np.hypot(2.0 - 0.075, 0.5 - 0.33) - reach
        assert known.reasons[0].startswith("out of reach")
        assert numbers(known) == (HORIZON, HORIZON + 1, True)
        assert exact - 0.1 < known.final_distance < exact + 0.1
        before = np.linalg.norm(oracle.simulator.arm.tool_position(np.zeros(6)) - goal)
        assert known.final_distance < before - 0.1
        assert replayed(oracle.simulator, np.zeros(6), goal, known.actions[0]).contact is None

    def test_goal_within_the_bench(self, oracle):
        # Within reach, were it not for the wood: 0.15 m below the top.
        known = oracle.solve_batch(np.zeros(6), [0.0, 0.65, 0.15])
        assert not known.reachable
        assert known.steps_lower_bound <= HORIZON
        assert known.reasons == "no contact-free configuration at the goal found"
        assert 0.09 < known.final_distance < 0.3

    def test_start_at_the_goal_takes_one_step(self, oracle):
        start, _ = drawn(oracle.simulator, 10, 1)
        for offset in (0.0, 0.9 * TOLERANCE):
            goal = oracle.simulator.arm.tool_position(start[0]) + np.array([0, 0, offset])
            known = oracle.solve_batch(start[0], goal)
            assert known.reachable
            assert numbers(known) == (1, 1, True)
            assert np.isfinite(known.paths[0]).all(axis=1).sum() == 2
            np.testing.assert_array_equal(known.actions[0, 1:], 0)

    def test_horizon_below_the_floor(self, oracle):
        starts, goals = drawn(oracle.simulator, 11, 8)
        known = oracle.solve_batch(starts, goals)
        row = int(known.steps_lower_bound.argmax())
        horizon = int(known.steps_lower_bound[row]) - 1
        short = with_task(horizon=horizon).solve_batch(starts[row], goals[row])
        assert not short.reachable
        assert numbers(short) == (horizon, horizon + 1, True)
        assert short.reasons[0].endswith(f"of {horizon} steps")
        assert TOLERANCE < short.final_distance < 2 * TOLERANCE
        enough = with_task(horizon=int(known.steps[row]))
        assert enough.solve_batch(starts[row], goals[row]).steps == known.steps[row]

    def test_wider_tolerance_lowers_the_floor(self, oracle):
        starts, goals = drawn(oracle.simulator, 12, 12)
        strict, wide = (
            with_task(tolerance=tolerance).solve_batch(starts, goals) for tolerance in (0.02, 0.1)
        )
        assert (wide.steps_lower_bound <= strict.steps_lower_bound).all()
        assert (wide.steps_lower_bound < strict.steps_lower_bound).any()
        assert (strict.final_distance[strict.reachable] <= 0.02).all()


HOME = [0.0] * 6
GOAL = [0.0, 0.65, 0.325]
FOLDED = np.deg2rad([0, 140, -72, 0, 0, 0])


class TestRefusals:
    @pytest.mark.parametrize(
        ("starts", "goals", "message"),
        [
            ([HOME[:5]], [GOAL], "starts must have shape"),
            ([["x"] * 6], [GOAL], "starts must be numbers"),
            ([HOME], [GOAL, GOAL], "goals must have shape"),
            ([HOME, [0.0, 0.0, 9.0, 0.0, 0.0, 0.0]], [GOAL, GOAL], r"starts\[1\] lies outside"),
            ([HOME], [[0.0, 0.0, -np.inf]], "goals must be finite"),
            (HOME, [0.0, np.nan, 0.3], "goals must be finite"),
        ],
    )
    def test_bad_trials(self, oracle, starts, goals, message):
        with pytest.raises(InvalidInputError, match=message):
            oracle.solve_batch(starts, goals)

    def test_start_in_contact_names_the_pair(self, oracle):
        pair = oracle.simulator.world.contact_model.contact_pair(FOLDED)
        touching = f"is in contact: {pair[0]} touches {pair[1]}$"
        with pytest.raises(StartInContactError, match=f"start 0 {touching}"):
            oracle.solve_batch(FOLDED, GOAL)
        with pytest.raises(StartInContactError, match=f"start 2 {touching}"):
            oracle.solve_batch([HOME, HOME, FOLDED], [GOAL] * 3)


def test_progress_counts_up_to_all(oracle, monkeypatch):
    monkeypatch.setattr("kinarm.policies.oracle.oracle.LOT", 2)
    for n, expected in ((5, [(2, 5), (4, 5), (5, 5)]), (0, [(0, 0)])):
        calls, trials = [], (np.tile(HOME, (n, 1)), np.tile(GOAL, (n, 1)))
        known = oracle.solve_batch(*trials, on_progress=lambda *done, to=calls: to.append(done))
        assert (calls, len(known)) == (expected, n)
        assert known.actions.shape == (n, HORIZON, 5)


@pytest.fixture(scope="module")
def few(oracle):
    return oracle.solve_batch(*drawn(oracle.simulator, 17, 4))


def test_solutions_are_joined(few, oracle):
    empty = oracle.solve_batch(np.zeros((0, 6)), np.zeros((0, 3)))
    joined = OracleSolutions.concatenated([few, empty, few])
    for rows in (slice(4), slice(4, 8)):
        assert_identical(joined, few, rows)


def test_no_trials_among_random_bodies_are_no_error():
    size, place = (0.1, 0.1, 0.1), {"lower": (0.2, -0.6, 0.2), "upper": (0.7, 0.6, 0.8)}
    bodies = RandomBodies(name="box", shape="box", smallest=size, largest=size, **place)
    oracle = Oracle(PROBLEMS["both"].replace(scene=Scene(random_bodies=(bodies,))), threads=1)
    assert len(oracle.solve_batch(np.zeros((0, 6)), np.zeros((0, 3)))) == 0


def test_one_start_for_many_goals_and_one_goal_for_many_starts(oracle):
    goals, starts = [GOAL, [0.2, 0.6, 0.325]], [[0.1] * 6, [0] * 6]
    for given, meant in (
        ((HOME, goals), ([HOME] * 2, goals)),
        ((starts, GOAL), (starts, [GOAL] * 2)),
    ):
        assert_identical(oracle.solve_batch(*given), oracle.solve_batch(*meant))
