"""Networks of PyTorch as policies: the same actions, and what is refused."""

import numpy as np
import pytest

from kinarm.errors import InvalidInputError
from kinarm.policies import Policy

torch = pytest.importorskip("torch")
nn = torch.nn


@pytest.fixture(scope="module")
def observations(simulator):
    return simulator.world.observe(*simulator.sample(np.random.default_rng(2), 1000))


def of_torch(module, x):
    with torch.no_grad():
        return module.double()(torch.tensor(x)).numpy().clip(-1, 1)


MODULES = {
    "one layer": lambda: nn.Linear(48, 5),
    "without a bias": lambda: nn.Sequential(nn.Linear(48, 8, bias=False), nn.Linear(8, 5)),
    "nested": lambda: nn.Sequential(
        nn.Flatten(),
        nn.Sequential(nn.Linear(48, 20), nn.SiLU(), nn.Dropout(0.5)),
        nn.Identity(),
        nn.Linear(20, 5),
        nn.Tanh(),
    ).eval(),
    "all functions": lambda: nn.Sequential(
        *(nn.Linear(48, 16), nn.ReLU(), nn.Linear(16, 16), nn.ELU(), nn.Linear(16, 16)),
        *(nn.LeakyReLU(), nn.Linear(16, 16), nn.Hardtanh(), nn.Linear(16, 16), nn.ReLU6()),
        *(nn.Linear(16, 16), nn.Hardtanh(-0.3, 0.7), nn.SiLU(), nn.Linear(16, 5)),
    ),
    "float64": lambda: nn.Linear(48, 5, dtype=torch.float64),
}


@pytest.mark.parametrize("name", MODULES)
def test_acts_alike(name, observations, simulator):
    torch.manual_seed(0)
    module = MODULES[name]()
    policy = Policy.from_torch(module, "right")
    expected = of_torch(module, observations)
    assert expected.std() > 0.01
    np.testing.assert_allclose(policy(observations), expected, rtol=0, atol=1e-12)
    starts, goals = simulator.sample(np.random.default_rng(3), 50)
    compiled = simulator.rollout(policy, starts, goals)
    called = simulator.rollout(lambda seen: of_torch(module, seen), starts, goals)
    np.testing.assert_allclose(compiled.configurations, called.configurations, rtol=0, atol=1e-9)


def test_inputs_are_normalised_where_statistics_are_given(observations):
    module = nn.Linear(48, 5)
    mean, std = observations.mean(axis=0), observations.std(axis=0) + 0.1
    policy = Policy.from_torch(module, "right", mean=mean, std=std)
    expected = of_torch(module, (observations - mean) / std)
    np.testing.assert_allclose(policy(observations), expected, rtol=0, atol=1e-12)


def test_says_where_it_comes_from(tmp_path):
    policy = Policy.from_torch(nn.Linear(48, 5), "left", name="cem", environment_steps=7, seed=2)
    policy.save(tmp_path / "mine.npz")
    made = Policy.load(tmp_path / "mine.npz").provenance
    assert (made.algorithm, made.recipe, made.environment_steps, made.seed) == (
        "cem",
        "torch",
        7,
        2,
    )
    assert made.problem.name == "left"


@pytest.mark.parametrize(
    ("module", "message"),
    [
        (nn.Linear(47, 5), "takes 47 inputs where 48 arrive"),
        (nn.Sequential(nn.Linear(48, 5), nn.GELU()), r"cannot convert GELU\(.*; what can be"),
        (nn.Sequential(nn.Linear(48, 5), nn.ELU(0.5)), r"cannot convert ELU\(alpha=0.5\)"),
        (nn.Sequential(nn.Linear(48, 5), nn.Dropout(0.5)), "Dropout.*after eval"),
        (lambda x: x, "cannot convert <function"),
    ],
)
def test_what_cannot_be_converted(module, message):
    with pytest.raises(InvalidInputError, match=message):
        Policy.from_torch(module, "right")


def test_parameters_that_are_not_finite():
    module = nn.Linear(48, 5)
    module.weight.data[0, 0] = torch.nan
    with pytest.raises(InvalidInputError, match="weights of layer 0 must be finite"):
        Policy.from_torch(module, "right")
