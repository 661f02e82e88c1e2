"""Verdicts on results that are made up so that the answers are known."""

import json
import math

import numpy as np
import pytest

from kinarm.evaluation.paper.claims import Claim, ClaimPart, assess, bench_shares
from kinarm.evaluation.paper.results import PaperRun, Reading
from kinarm.evaluation.statistics import Estimate
from kinarm.evaluation.trials import trial_set
from kinarm.problem import PROBLEMS

TRIALS = 200


def noise(run, scale=0.01):
    """Differences between the seeds of a training, and between its trials."""
    rng = np.random.default_rng([len(run.name), run.planned.config.seed])
    return scale * (rng.normal() + rng.normal(size=TRIALS))


def learnt_at(point):
    """Distances at four points of a policy that reaches everything from one of them on."""
    return np.where(np.arange(4)[:, None] >= point, 0.01, 1.0) * np.ones((4, 10))


@pytest.fixture(scope="module")
def as_the_paper_says(made_up_run):
    """A world in which everything is as in the paper."""

    def run_of(run):
        config = run.planned.config
        if run.purpose == "sweep":
            worse = 0.2 * (config.step_size == 0.005) + 0.2 * (config.directions == 32)
            distance = 0.3 + worse + noise(run)
            return made_up_run(distance, np.tile(distance[:10], (4, 1)))
        base = 0.1 if run.purpose == "ars" else 0.05
        distance = base + np.abs(noise(run))
        if run.purpose == "ars" and run.task == "both":
            poor = (trial_set(config.problem, TRIALS, 0).goals[:, 1] > 0) == bool(config.seed % 2)
            distance = distance + 0.5 * poor
        return made_up_run(distance, learnt_at(0 if run.purpose == "ars" else 2))

    return run_of


@pytest.fixture(scope="module")
def the_other_way_round(made_up_run):
    """A world in which nothing is."""

    def run_of(run):
        config = run.planned.config
        if run.purpose == "sweep":
            better = 0.1 * (config.step_size == 0.005) + 0.1 * (config.directions == 32)
            distance = 0.5 - better + noise(run)
            return made_up_run(distance, np.tile(distance[:10], (4, 1)))
        base = 0.5 if run.purpose == "ars" else 0.7
        distance = base - 0.1 * (run.task == "both") + noise(run)
        return made_up_run(distance, learnt_at(2 if run.purpose == "ars" else 0))

    return run_of


def verdicts(claims):
    return {claim.name: claim.verdict for claim in claims}


ALL = {
    *("ars-left", "ars-right", "ars-both", "ars-one-bench"),
    *("ppo-nearer", "ppo-both", "ars-samples"),
    *("sweep-rate", "sweep-perturbations", "sweep-perturbations-steps"),
}


class TestWorlds:
    def test_as_the_paper_says(self, results_of, as_the_paper_says):
        claims = assess(results_of(as_the_paper_says))
        assert verdicts(claims) == dict.fromkeys(ALL, "holds")
        for claim in claims:
            (first, *_) = json.loads(json.dumps(claim.to_json(), allow_nan=False))["parts"]
            low, high = first["ci95"]
            assert low <= first["statistic"] <= high

    def test_the_other_way_round(self, results_of, the_other_way_round):
        claims = assess(results_of(the_other_way_round))
        assert verdicts(claims) == dict.fromkeys(ALL, "does not hold")
        values = {claim.name: claim.parts[0].estimate.value for claim in claims}
        assert values["ars-left"] == values["ars-samples"] == 0
        assert values["ars-both"] == pytest.approx(-0.1, abs=0.02)
        assert values["ppo-nearer"] == pytest.approx(-0.2, abs=0.02)
        assert values["sweep-rate"] == pytest.approx(-0.1, abs=0.02)
        assert values["sweep-perturbations"] == pytest.approx(-0.1, abs=0.02)

    def test_by_chance(self, results_of, made_up_run):
        """A world in which seeds differ and nothing else does."""

        def run_of(run):
            rng = np.random.default_rng([*run.name.encode()])
            distance = np.full(TRIALS, rng.uniform(0.1, 0.3))
            return made_up_run(distance, np.full((4, 10), rng.uniform(0.1, 0.3)))

        found = verdicts(assess(results_of(run_of)))
        assert set(found) == ALL
        assert found["ppo-nearer"] == found["ppo-both"] == found["ars-samples"] == "undecided"
        assert found["sweep-rate"] == found["sweep-perturbations"] == "undecided"

    @pytest.mark.parametrize(("share", "verdict"), [(0.6, "holds"), (0.4, "does not hold")])
    def test_mostly_is_more_than_half(self, results_of, made_up_run, share, verdict):
        distance = np.where(np.arange(TRIALS) % 10 < 10 * share, 0.1, 0.3)
        found = verdicts(assess(results_of(lambda _: made_up_run(distance))))
        assert found["ars-left"] == found["ars-right"] == verdict

    @pytest.mark.parametrize(
        ("better", "worse", "verdict"),
        [(0.65, 0.35, "holds"), (0.35, 0.2, "does not hold"), (0.8, 0.65, "does not hold")],
    )
    def test_well_is_more_than_half_and_poorly_is_less(
        self, results_of, made_up_run, better, worse, verdict
    ):
        def run_of(run):
            left = trial_set(run.planned.config.problem, TRIALS, 0).goals[:, 1] > 0
            share = np.where(left, better, worse)
            return made_up_run(np.where(np.arange(TRIALS) % 20 < 20 * share, 0.1, 0.3))

        assert verdicts(assess(results_of(run_of)))["ars-one-bench"] == verdict

    def test_other_readings_are_judged_by_their_own_trainings(
        self, results_of, as_the_paper_says, the_other_way_round
    ):
        def run_of(run):
            literal = run.reading.start_spread == 1
            return (as_the_paper_says if literal else the_other_way_round)(run)

        results = results_of(run_of)
        assert set(verdicts(assess(results)).values()) == {"holds"}
        found = verdicts(assess(results, Reading(start_spread=0.1, sharing="pair")))
        assert set(found) == {name for name in ALL if not name.startswith("sweep")}
        assert set(found.values()) == {"does not hold"}


@pytest.mark.parametrize("start_spread", [1.0, 0.1])
def test_trials_of_all_tasks_are_crossed(start_spread):
    """What `contrast` is told of them: one start, and one place of the goal on its bench."""
    left, right, both = (
        trial_set(PROBLEMS[task].replace(start_spread=start_spread), 50, 0)
        for task in ("left", "right", "both")
    )
    bench_to_bench = np.array([0.0, 1.3, 0.0])
    np.testing.assert_allclose(left.goals, right.goals + bench_to_bench)
    on_left = both.goals[:, 1:2] > 0
    np.testing.assert_array_equal(both.goals, np.where(on_left, left.goals, right.goals))
    for trials in (right, both):
        np.testing.assert_array_equal(trials.starts, left.starts)


class TestSpeed:
    def test_where_no_level_is_reached_it_cannot_be_compared(self, results_of, made_up_run):
        results = results_of(lambda _: made_up_run(np.ones(TRIALS)))
        claim = {claim.name: claim for claim in assess(results)}["ars-samples"]
        assert claim.verdict == "undecided"
        assert claim.parts[0].estimate.value is None
        json.dumps(claim.to_json(), allow_nan=False)

    def test_equal_steps_are_those_of_the_shortest_training(self, results_of, made_up_run):
        def run_of(run):
            if run.purpose != "sweep":
                return made_up_run(np.ones(TRIALS))
            many = run.planned.config.directions == 32
            curve = np.array([[0.4], [0.3], [0.2], [0.1]]) * np.ones((4, 10))
            return made_up_run(np.full(TRIALS, 0.1), curve, 2000 if many else 1000)

        claims = {claim.name: claim for claim in assess(results_of(run_of))}
        part = claims["sweep-perturbations-steps"].parts[0]
        assert "after 4 thousand environment steps" in part.measure
        assert part.estimate.value == pytest.approx(0.2)
        assert claims["sweep-perturbations"].parts[0].estimate.value == pytest.approx(0)

    @pytest.mark.parametrize(
        ("distance", "share", "steps"),
        [(0.5, 1.0, 1000), (0.2, 0.5, 2000), (0.2, 0.75, 3000), (0.05, 0.25, math.inf)],
    )
    def test_steps_to_level(self, made_up_run, distance, share, steps):
        curve = np.array([[0.5, 0.5], [0.2, 0.5], [0.1, 0.1], [0.3, 0.3]])
        run = PaperRun(planned=None, trained=made_up_run(np.ones(3), curve))
        assert run.steps_to_level(distance, share) == steps

    @pytest.mark.parametrize(("steps", "distance"), [(4000, 0.3), (3999, 0.1), (10, 0.5)])
    def test_distance_after(self, made_up_run, steps, distance):
        curve = np.array([[0.5, 0.5], [0.2, 0.5], [0.1, 0.1], [0.3, 0.3]])
        run = PaperRun(planned=None, trained=made_up_run(np.ones(3), curve))
        assert run.distance_after(steps)[1] == pytest.approx(distance)


class TestBenchShares:
    def test_by_hand(self):
        left = np.tile([True, True, False, False], 25)
        all_left_and_even_right = np.tile([True, True, True, False], 25)
        all_right = ~left
        better, worse = bench_shares(np.stack([all_left_and_even_right, all_right]), left)
        assert better.value == pytest.approx(np.mean([1.0, 1.0]))
        assert worse.value == pytest.approx(np.mean([0.5, 0.0]))

    def test_the_better_bench_is_told_by_other_trials(self):
        left = np.tile([True, True, False, False], 25)
        even_left_and_odd_right = np.tile([True, False, False, True], 25)
        better, worse = bench_shares(even_left_and_odd_right[None], left)
        assert (better.value, worse.value) == (0.0, 1.0)

    @pytest.mark.parametrize("left", [[True] * 4, [False] * 4, [True, False] * 2, [True]])
    def test_a_bench_without_trials_tells_nothing(self, left):
        near = np.ones((3, len(left)), dtype=bool)
        shares = bench_shares(near, np.array(left))
        assert shares == (Estimate(None), Estimate(None))
        assert json.loads(json.dumps([share.to_json() for share in shares], allow_nan=False))

    def test_no_bench_is_better_where_both_are_alike(self):
        rng = np.random.default_rng(0)
        gaps = []
        for _ in range(300):
            left, within = rng.random(200) < 0.5, rng.random((4, 200)) < 0.5
            better, worse = bench_shares(within, left)
            gaps.append(better.value - worse.value)
        assert abs(np.mean(gaps)) < 3 * np.std(gaps) / math.sqrt(300)


class TestVerdict:
    @pytest.mark.parametrize(
        ("ci95", "above", "below"),
        [
            ((0.6, 0.9), "holds", "does not hold"),
            ((0.1, 0.4), "does not hold", "holds"),
            ((0.4, 0.6), "undecided", "undecided"),
            ((0.5, 0.6), "undecided", "undecided"),
            (None, "undecided", "undecided"),
        ],
    )
    def test_of_a_part(self, ci95, above, below):
        estimate = Estimate(0.5, ci95)
        assert ClaimPart("", estimate, "above", 0.5).verdict == above
        assert ClaimPart("", estimate, "below", 0.5).verdict == below

    def test_of_a_claim_with_several_parts(self):
        yes, no, perhaps = (
            ClaimPart("", Estimate(0, interval), "above", 0.0)
            for interval in ((1.0, 2.0), (-2.0, -1.0), (-1.0, 1.0))
        )
        assert Claim("", "", (yes, yes)).verdict == "holds"
        assert Claim("", "", (yes, perhaps)).verdict == "undecided"
        assert Claim("", "", (perhaps, no)).verdict == "does not hold"
