"""The order of the shipped policies, and which of them is best; see docs/ranking.py."""

import json
import re
from importlib import resources
from pathlib import Path
from runpy import run_path
from types import SimpleNamespace

import numpy as np
import pytest

from kinarm.policies import policy_names
from kinarm.policies.library import RANKING, best_policy
from kinarm.problem import PROBLEMS

SCRIPT = run_path(str(Path(__file__).parents[2] / "docs" / "ranking.py"))
ranking, best_of = SCRIPT["ranking"], SCRIPT["best_of"]


@pytest.fixture(scope="module")
def recorded():
    text = (resources.files("kinarm.data") / "policies" / RANKING).read_text(encoding="utf-8")
    return json.loads(text)


def test_every_shipped_policy_is_ranked(recorded):
    """After shipping others: ``python docs/ranking.py``."""
    serving = {name: [] for name in policy_names()}
    for problem, successes in recorded["success"].items():
        for name in successes:
            serving[name].append(problem)
    for name, problems in serving.items():
        everywhere = "paper" not in name  # what ships for all problems is symmetric
        assert problems == (list(PROBLEMS) if everywhere else [name.split("-")[2]])
    assert (recorded["trials"], recorded["seed"]) == (SCRIPT["TRIALS"], SCRIPT["SEED"])


@pytest.mark.slow
def test_the_best_are_measured_again(recorded):
    best = {problem: best_policy(problem) for problem in recorded["success"]}
    assert recorded["best"] == best
    measured = ranking(sorted(set(best.values())))
    for problem, name in best.items():
        assert re.match(r"ppo-(best|precise)-both-seed\d", name)
        for figure in ("success", "step_ratio"):
            assert measured[figure][problem][name] == recorded[figure][problem][name]


N_TRIALS = 1000
BOUNDS = SimpleNamespace(steps_lower_bound=np.full(N_TRIALS // 5, 10))


def made_up(share, steps, shift=0):
    """A policy that succeeds in a share of the trials, after so many steps."""
    success = np.arange(N_TRIALS) < round(share * N_TRIALS)
    return SimpleNamespace(success=np.roll(success, shift), steps=np.full(N_TRIALS, steps))


def test_seeds_that_are_lucky_do_not_make_a_recipe():
    found = {
        **{f"even-seed{k}": made_up(0.90 + 0.002 * k, 20) for k in range(4)},
        **{f"odd-seed{k}": made_up(share, 12) for k, share in enumerate((0.95, 0.3, 0.2, 0.4))},
        "one-seed0": made_up(0.7, 10),
    }
    assert best_of(found, BOUNDS).startswith("even")


def test_among_equally_good_ones_the_fastest_is_best():
    slow = {f"slow-seed{k}": made_up(0.90 + 0.01 * k, 20) for k in range(4)}
    fast = {f"fast-seed{k}": made_up(0.89 + 0.01 * k, 15 - (k == 2)) for k in range(4)}
    assert best_of(slow | fast, BOUNDS) == "fast-seed2"
    worse = {name: made_up(0.8, 10) for name in fast}
    assert best_of(slow | worse, BOUNDS).startswith("slow")


def test_with_equal_steps_more_goals_decide():
    found = {f"mine-seed{k}": made_up(share, 20) for k, share in enumerate((0.9, 0.901, 0.899))}
    assert best_of(found, BOUNDS) == "mine-seed1"
