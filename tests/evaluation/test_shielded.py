"""Policies behind a shield: their names, figures, recordings and files."""

from dataclasses import replace

import gymnasium
import numpy as np
import pytest

from kinarm import PROBLEMS, ReachProblem, Simulator
from kinarm.errors import PolicyFileError
from kinarm.evaluation import EvaluationRequest, ReplayRequest, evaluate
from kinarm.evaluation.commands.replay import described
from kinarm.evaluation.finding import contestant_of, find_contestants
from kinarm.evaluation.selection import group_names, select_pairs
from kinarm.policies import Policy, PPOConfig, load_policy, train_policy
from kinarm.recording import load_recordings, record_rollouts, save_recordings

NAME = "ars-linear-both-seed0"


def half_speed(env):
    return gymnasium.wrappers.TransformAction(env, lambda action: action / 2, env.action_space)


@pytest.fixture(scope="module")
def policy():
    return load_policy(NAME)


def test_a_shielded_policy_acts_behind_a_shield_wherever_it_is_rolled_out(policy, tmp_path):
    simulator, safe = Simulator("both"), policy.shielded()
    safe.save(tmp_path / "safe.npz")
    scenarios = simulator.sample(np.random.default_rng(0), 400)
    expected = simulator.shielded().rollout(policy, *scenarios)
    assert expected.interventions.sum() > 0
    for each in (safe, Policy.load(tmp_path / "safe.npz")):
        found = simulator.rollout(each, *scenarios)
        for column in ("configurations", "steps", "interventions"):
            np.testing.assert_array_equal(getattr(found, column), getattr(expected, column))
    assert simulator.rollout(policy, *scenarios).interventions.shape == (0,)


def test_it_has_a_name_and_a_group_of_its_own(policy):
    assert evaluate(policy.shielded(), trials=1).name == "ars-linear-both+shield"
    shielded = find_contestants("ars-linear-both+shield")
    assert shielded[0].name == "ars-linear-both+shield-seed0"
    names = group_names((*shielded, *find_contestants("ars-linear-both")))
    assert set(names.values()) == {"ars-linear-both", "ars-linear-both+shield"}
    assert shielded[0].shielded() is shielded[0]


def test_what_is_named_with_its_shield_too_comes_once():
    request = EvaluationRequest(policies=(NAME, f"{NAME}+shield"), shield=True, oracle=False)
    names = [contestant.name for contestant, _ in select_pairs(request)]
    assert names == [NAME, "ars-linear-both+shield-seed0"]


@pytest.mark.parametrize("first", ["mine.npz+shield", "random+shield", "mine.npz"])
def test_what_is_first_is_the_reference_with_its_shield_too(policy, tmp_path, monkeypatch, first):
    monkeypatch.chdir(tmp_path)
    policy.save("mine.npz")
    names = dict.fromkeys((first, "mine.npz+shield", "zero"))
    request = EvaluationRequest(policies=(*names,), problems=("both",), trials=3, oracle=False)
    compared = {each.reference for each in request.run().differences}
    assert compared == {first.replace(".npz", "")}


def test_a_file_may_be_called_as_policies_behind_a_shield_are(policy, tmp_path):
    policy.shielded().save(tmp_path / "mine+shield.npz")
    names = (str(tmp_path / "mine+shield.npz"),)
    pairs = select_pairs(EvaluationRequest(policies=names, oracle=False))
    found = [(contestant.name, contestant.has_shield) for contestant, _ in pairs]
    assert sorted(set(found)) == [("mine", False), ("mine+shield", True)]


def test_baselines_are_behind_a_shield_if_they_are_named_so():
    safe, bare = (evaluate(each, "both", trials=200) for each in ("random+shield", "random"))
    assert (safe.name, safe.rollouts.collision.any()) == ("random+shield", False)
    assert bare.rollouts.collision.any()
    request = EvaluationRequest(policies=("random",), shield=True, oracle=False)
    assert {contestant.name for contestant, _ in select_pairs(request)} == {"random"}
    replayed = ReplayRequest(policy="random", problem="both", shield=True, trials=3, oracle=False)
    assert {each.policy for each in replayed.recordings()[0]} == {"random+shield"}


def test_wrappers_and_shields_go_together(policy):
    expected = evaluate(policy.shielded(), trials=100)
    assert expected.rollouts.interventions.sum() > 0
    found = evaluate(policy.shielded(), trials=100, wrapper=lambda env: env)
    ends = (each.rollouts.configurations for each in (found, expected))
    np.testing.assert_allclose(*ends, rtol=0, atol=1e-9)
    assert found.rollouts.interventions.sum() == expected.rollouts.interventions.sum()
    # A wrapper may show what the policy sees, and the problem does not.
    problem, arm = policy.problem.replace(goal={"kind": "direction"}), Simulator("both").arm
    contestant_of(policy, problem, wrapper=lambda env: env).shielded().check(problem, arm)
    with pytest.raises(PolicyFileError, match="sees other observations"):
        contestant_of(policy, problem).shielded().check(problem, arm)


def test_what_learnt_behind_a_shield_keeps_it_and_is_shown_without_it_too(tmp_path):
    problem = ReachProblem.load("both").replace(shield=True)
    config = PPOConfig(problem=problem, iterations=1, n_envs=4, n_steps=10, batch_size=20)
    policy = train_policy(config).policy
    assert policy.shield
    assert policy.problem.digest == PROBLEMS["both"].digest
    policy.save(tmp_path / "mine.npz")
    request = EvaluationRequest(policies=(str(tmp_path / "mine.npz"),), trials=100, oracle=False)
    bare, safe = request.evaluate()
    assert (bare.name, safe.name) == ("mine", "mine+shield")
    assert bare.rollouts.interventions.shape == (0,)
    assert not safe.rollouts.collision.any()
    # Both in the wrapper, if there is one.
    half = replace(request, wrapper=f"{__name__}:half_speed")
    bare, safe = half.evaluate()
    assert (bare.name, safe.name) == ("mine", "mine+shield")
    for each in (bare, safe):
        assert each.contestant.note.endswith(half.wrapper)
    assert bare.rollouts.interventions.shape == (0,)
    expected = evaluate(load_policy(tmp_path / "mine.npz"), trials=100, wrapper=half_speed)
    np.testing.assert_array_equal(safe.rollouts.distance, expected.rollouts.distance)
    moved = np.abs(bare.rollouts.configurations - bare.rollouts.starts).max(axis=1)
    assert (moved <= bare.rollouts.steps * bare.trials.simulator.step_limit.max() / 2).all()


def test_replaced_steps_stand_in_tables_where_there_is_a_shield():
    request = EvaluationRequest(policies=(NAME,), shield=True, trials=300, oracle=False)
    evaluations = {each.name: each for each in request.evaluate()}
    safe, bare = evaluations["ars-linear-both+shield-seed0"], evaluations[NAME]
    share = safe.rollouts.interventions.sum() / safe.rollouts.steps.sum()
    assert safe.metrics["replaced"].value == share > 0
    assert bare.metrics["replaced"].value is None


def test_recordings_say_which_steps_were_replaced_and_why(tmp_path):
    simulator = Simulator("both").with_plant("hard")
    scenarios = simulator.sample(np.random.default_rng(0), 100)
    rollouts = simulator.rollout(load_policy(NAME).shielded(), *scenarios, record=True)
    recordings = record_rollouts(simulator, rollouts, "some")
    for recording, count in zip(recordings, rollouts.interventions, strict=True):
        assert len(recording.replaced) == count
    pairs = {pair for each in recordings for _, pair in each.replaced}
    assert ("hand", "left bench") in pairs
    assert pairs <= {None, *simulator.world.contact_model.pair_names}
    save_recordings(tmp_path / "some.npz", recordings)
    read = load_recordings(tmp_path / "some.npz")
    assert [each.replaced for each in read] == [each.replaced for each in recordings]
    some = max(recordings, key=lambda each: len(each.replaced))
    assert f", {len(some.replaced)} replaced by the shield, " in described(some)


def test_replays_take_a_shield_or_a_shielded_name():
    given = {"trials": 250, "oracle": False}
    (by_option,) = ReplayRequest(policy=NAME, shield=True, **given).recordings()
    assert {each.policy for each in by_option} == {"ars-linear-both+shield-seed0"}
    assert not by_option[0].problem.stepping.shield
    assert any(each.replaced for each in by_option)
    (by_name,) = ReplayRequest(policy="ars-linear-both+shield", **given).recordings()
    assert [each.replaced for each in by_name] == [each.replaced for each in by_option]
