"""The contract of learners, held by one that is written here: one module, one registration."""

import sys
from dataclasses import dataclass
from types import ModuleType

import numpy as np
import pytest

from kinarm.errors import InvalidInputError, UnknownNameError
from kinarm.policies import (
    CurvePoint,
    Layer,
    Learner,
    Normalizer,
    Policy,
    Provenance,
    TrainingConfig,
    TrainingState,
    find_learner,
    learner_names,
    learners,
    load_checkpoint,
    recipe,
    register_learner,
    save_checkpoint,
    state_policy,
    train_policy,
)


@dataclass(frozen=True, kw_only=True)
class ToyConfig(TrainingConfig):
    """Settings of a random search that keeps the best matrix of all that it tried.

    Parameters
    ----------
    noise : float
        Standard deviation of the steps.
    """

    iterations: int = 5
    noise: float = 0.1


@dataclass(frozen=True, kw_only=True, eq=False)
class ToyState(TrainingState):
    """The best matrix so far."""

    theta: np.ndarray
    best: float


class ToyTraining:
    """Tries one matrix per iteration, on the same scenarios."""

    def __init__(self, config: ToyConfig) -> None:
        self.config, self.simulator = config, config.simulator(threads=1)
        self.scenarios = self.simulator.sample(np.random.default_rng(config.seed), 20)

    def initial_state(self) -> ToyState:
        shape = (self.simulator.n_actions, self.simulator.n_observations)
        return ToyState(theta=np.zeros(shape), best=-np.inf)

    def iterate(self, state: ToyState) -> ToyState:
        rng = np.random.default_rng([self.config.seed, state.iteration])
        theta = state.theta + self.config.noise * rng.normal(size=state.theta.shape)
        policy = policy_of(self.config, ToyState(theta=theta, best=0.0))
        rollouts = self.simulator.rollout(policy, *self.scenarios)
        score = float(rollouts.returns.mean())
        point = CurvePoint(
            mean_return=score,
            std_return=float(rollouts.returns.std()),
            success=float(rollouts.success.mean()),
            environment_steps=state.environment_steps + int(rollouts.steps.sum()),
            wall_time=state.wall_time,
        )
        kept = theta if score > state.best else state.theta
        return ToyState(theta=kept, best=max(score, state.best), curve=(*state.curve, point))


def policy_of(config: ToyConfig, state: ToyState) -> Policy:
    seen = Normalizer.empty(state.theta.shape[1])
    return Policy(
        mean=seen.mean,
        std=seen.std,
        layers=(Layer(state.theta, np.zeros(len(state.theta))),),
        provenance=Provenance.of("toy", config, state.environment_steps),
    )


LEARNER = Learner(
    name="toy",
    title="Random search",
    config=ToyConfig,
    state=ToyState,
    recipes={"paper": ToyConfig(recipe="paper")},
    begin=ToyTraining,
    policy=policy_of,
)


@pytest.fixture
def toy(monkeypatch):
    """The learner of this file, registered."""
    module = ModuleType("toy_learner")
    module.LEARNER = LEARNER
    monkeypatch.setitem(sys.modules, "toy_learner", module)
    monkeypatch.setattr(learners, "_MODULES", dict(learners._MODULES))
    register_learner("toy", "toy_learner")
    return LEARNER


def test_names():
    assert learner_names() == ("ars", "ppo")
    for name in learner_names():
        learner = find_learner(name)
        assert learner.name == name
        assert {"paper", "tuned"} <= set(learner.recipes)
        for key, config in learner.recipes.items():
            assert (type(config), config.recipe) == (learner.config, key)


def test_unknown_learner():
    with pytest.raises(UnknownNameError, match="unknown learner 'toy'; available: ars, ppo"):
        find_learner("toy")


def test_settings_of_nobody():
    with pytest.raises(InvalidInputError, match="expected settings of ars, ppo, got ToyConfig"):
        train_policy(ToyConfig())


def test_a_learner_of_ones_own_trains(toy):
    states = []
    result = train_policy(recipe("toy", problem="left", seed=4), on_iteration=states.append)
    assert [state.iteration for state in states] == [1, 2, 3, 4, 5]
    assert result.policy.provenance.algorithm == "toy"
    assert result.state is states[-1]
    assert (result.state.theta == result.policy.layers[0].weights).all()


@pytest.mark.parametrize("stopped_after", [0, 2, 5])
def test_its_checkpoints_resume_exactly(toy, tmp_path, stopped_after):
    config = recipe("toy", noise=0.2)
    states = [ToyTraining(config).initial_state()]
    whole = train_policy(config, on_iteration=states.append)
    save_checkpoint(tmp_path / "c.npz", config, states[stopped_after])
    loaded, state = load_checkpoint(tmp_path / "c.npz")
    assert (loaded, state.iteration, state.best) == (
        config,
        stopped_after,
        states[stopped_after].best,
    )
    resumed = train_policy(loaded, state=state)
    assert resumed.curve == whole.curve
    assert resumed.policy.layers[0].weights.tobytes() == whole.policy.layers[0].weights.tobytes()
    assert resumed.policy.provenance == whole.policy.provenance


def test_its_states_are_policies(toy):
    config = recipe("toy")
    state = ToyTraining(config).initial_state()
    assert state_policy(config, state).provenance.recipe == "paper"


def test_its_options_are_its_own(toy):
    with pytest.raises(InvalidInputError, match="toy has no option 'threads'"):
        train_policy(recipe("toy"), threads=2)
