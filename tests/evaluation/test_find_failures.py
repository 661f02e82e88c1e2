"""The failures of several policies on several problems, for one page."""

import re
from collections import Counter
from itertools import groupby

import pytest

from kinarm.errors import InvalidInputError
from kinarm.evaluation import ReplayRequest, evaluate, find_failures
from kinarm.evaluation.replay import choosing
from kinarm.viewer import replay_page

POLICIES, PROBLEMS = ("ars-tuned-both-seed9", "ppo-paper-both-seed1"), ("left", "both")


@pytest.fixture(scope="module")
def found():
    return find_failures(POLICIES, PROBLEMS, trials=60, seed=3)


def test_all_failures_are_there(found):
    played, _ = found.runs
    expected = Counter()
    for policy in POLICIES:
        for problem in PROBLEMS:
            success = evaluate(policy, problem, trials=60, seed=3).rollouts.success
            expected[policy, problem] = int((~success).sum())
    assert Counter((each.policy, each.problem.name) for each in played) == expected
    assert found.heading == f"{len(played)} of 240 trials of left, both failed"


def test_groups_are_recipes_and_causes_the_most_frequent_first(found):
    alone = ReplayRequest(policy=POLICIES[0], problem="both", failures=True, trials=60, seed=3)
    (run, _) = alone.recordings()
    assert {each.trial for each in run} == {
        each.trial
        for each in found.runs[0]
        if (each.policy, each.problem.name) == (POLICIES[0], "both")
    }
    names = [name for name, _ in groupby(found.groups)]
    assert len(names) == len(set(names))
    sizes = Counter(found.groups)
    for recipe in ("ars-tuned-both", "ppo-paper-both"):
        counts = [sizes[name] for name in names if name.startswith(f"{recipe}: ")]
        assert counts
        assert counts == sorted(counts, reverse=True)
    assert names == sorted(names, key=lambda name: name.startswith("ppo"))


def test_the_oracle_faces_the_same_trials_on_one_page(found):
    played, oracle = found.runs
    assert all(one.same_trial(ghost) for one, ghost in zip(played, oracle, strict=True))
    assert {each.policy for each in oracle} == {"oracle"}
    page = replay_page(played, ghosts=oracle, groups=found.groups, heading=found.heading)
    (title,) = re.findall("<title>(.*)</title>", page.html)
    assert title.startswith(f"{POLICIES[0]} and oracle and {POLICIES[1]} ")


def test_too_many_for_a_page(monkeypatch):
    monkeypatch.setattr(choosing, "MOST_FAILURES", 10)
    with pytest.raises(InvalidInputError, match="trials failed, a page holds 10 at most"):
        find_failures(("ppo-paper-both-seed1",), trials=20)
