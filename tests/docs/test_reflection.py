"""Policies trained for one bench, on the other one by reflection."""

from dataclasses import replace
from itertools import product

import pytest

from docs.transfer import reflection
from docs.transfer.reflection import reflection_of
from docs.transfer.study import targets
from kinarm.evaluation.trials import trial_set
from kinarm.policies import load_policy
from kinarm.policies.mirror import missing_mirror
from kinarm.policies.policy import Layer
from kinarm.problem import PROBLEMS, ReachProblem
from kinarm.problem_files import problem_names


@pytest.fixture(scope="module")
def policies():
    """Learnt ones without a mirror, and one that turns at full speed."""
    linear, network = (
        replace(load_policy(f"{learner}-tuned-both-seed0"), mirror=None)
        for learner in ("ars", "ppo")
    )
    layers = tuple(Layer(9 * layer.weights, layer.bias + 0.1) for layer in network.layers)
    return linear, network, replace(network, layers=layers)


def test_mirrored_trials_give_mirrored_trajectories(policies):
    """In all shipped problems of the arm ``paper`` that have a mirror, and of another arm."""
    shipped = [ReachProblem.load(name) for name in problem_names() if "paper" in name]
    shown = [each for each in (*PROBLEMS.values(), *shipped) if each.observation.parts is None]
    known = [each for each in shown if not missing_mirror(each)]
    assert {each.name for each in known} >= {"left", "both", "post-paper", "table-paper"}
    for problem, policy in product((*known, targets()[-1]), policies):
        found = reflection_of(policy, trial_set(problem, 100, 3))
        assert (found["problem"], found["trials"]) == (problem.name, 100)
        assert found["deviation"] <= 1e-12
        assert found["differing"] == 0


def test_without_a_mirror_they_do_not(policies, monkeypatch):
    monkeypatch.setattr(reflection, "with_mirror", lambda policy, _: policy)
    for policy in policies:
        found = reflection_of(policy, trial_set(PROBLEMS["both"], 100, 3))
        assert found["differing"] > 10
        assert found["deviation"] > 0.1
