"""Policies: what they compute, and their files."""

import gc
import json
from dataclasses import replace

import numpy as np
import pytest

from kinarm.arm import Arm
from kinarm.errors import InvalidInputError, OutputError, PolicyFileError
from kinarm.networks import Mirror
from kinarm.observation_layout import observation_layout
from kinarm.policies.policy import Layer, Policy
from kinarm.problem import PROBLEMS

FUNCTIONS = {"linear": lambda x: x, "tanh": np.tanh, "relu": lambda x: np.maximum(x, 0)}
MIRROR = Mirror(np.tile([1.0, -1, 1], 16), np.array([-1.0, 1, 1, -1, 1]))


def contents(path):
    with np.load(path) as file:
        return dict(file)


def assert_bitwise_equal(first, second):
    assert first.mean.tobytes() == second.mean.tobytes()
    assert first.std.tobytes() == second.std.tobytes()
    assert len(first.layers) == len(second.layers)
    for a, b in zip(first.layers, second.layers, strict=True):
        assert a.weights.tobytes() == b.weights.tobytes()
        assert a.bias.tobytes() == b.bias.tobytes()
    assert first.activations == second.activations
    assert (first.mirror is None) == (second.mirror is None)
    if first.mirror is not None:
        for a, b in zip(first.mirror, second.mirror, strict=True):
            np.testing.assert_array_equal(a, b)
    assert first.provenance == second.provenance


@pytest.fixture
def saved(make_policy, tmp_path):
    """A policy file, to be spoilt."""
    path = tmp_path / "policy.npz"
    make_policy().save(path)
    return path


class TestCall:
    def test_linear_by_hand(self, provenance):
        policy = Policy(
            mean=np.array([1.0, 2.0]),
            std=np.array([2.0, 0.5]),
            layers=(Layer(np.array([[0.2, 0.1], [10.0, 0.0]]), np.array([0.05, 0.0])),),
            provenance=provenance,
        )
        np.testing.assert_allclose(policy([3, 2.5]), [0.2 + 0.1 + 0.05, 1.0])
        np.testing.assert_allclose(policy([-1, 2.0]), [-0.2 + 0.05, -1.0])

    def test_deep_by_hand(self, provenance):
        policy = Policy(
            mean=np.zeros(1),
            std=np.ones(1),
            layers=(
                Layer(np.array([[2.0], [-1.0]]), np.array([0.0, 0.5])),
                Layer(np.array([[0.3, 0.4]]), np.array([-0.1])),
            ),
            provenance=provenance,
        )
        expected = 0.3 * np.tanh(2 * 0.7) + 0.4 * np.tanh(0.5 - 0.7) - 0.1
        np.testing.assert_allclose(policy([0.7]), [expected])

    @pytest.mark.parametrize(
        ("between", "after"), [("tanh", "relu"), ("relu", "tanh"), ("linear",) * 2]
    )
    def test_functions_between_and_after_the_layers(self, make_policy, between, after):
        policy = make_policy(9, 7, activations=(between, between, after))
        seen = np.random.default_rng(0).normal(size=(20, 48))
        x = (seen - policy.mean) / policy.std
        for (weights, bias), name in zip(policy.layers, policy.activations, strict=True):
            x = FUNCTIONS[name](x @ weights.T + bias)
        np.testing.assert_allclose(policy(seen), np.clip(x, -1, 1), rtol=0, atol=1e-12)

    def test_batch_equals_single(self, make_policy):
        policy = make_policy(8, mirror=MIRROR)
        seen = np.random.default_rng(1).normal(size=(20, 48))
        batch = policy(seen)
        assert batch.shape == (20, 5)
        for row, action in zip(seen, batch, strict=True):
            np.testing.assert_allclose(policy(row), action, rtol=0, atol=1e-14)

    def test_constant_inputs_have_no_influence(self, make_policy):
        policy = make_policy(constant=10)
        seen = np.random.default_rng(2).normal(size=48)
        changed = seen.copy()
        changed[:10] += 5
        np.testing.assert_array_equal(policy(seen), policy(changed))

    @pytest.mark.parametrize("bad", [np.zeros(47), np.zeros((2, 49)), np.full(48, np.nan), 3.0])
    def test_bad_observations(self, make_policy, bad):
        with pytest.raises(InvalidInputError, match="observations"):
            make_policy()(bad)


class TestNetworks:
    @pytest.mark.parametrize(
        ("hidden", "settings"),
        [
            *(((), {}), ((), {"activations": ("tanh",)}), ((), {"mirror": MIRROR})),
            *(((16,), {}), ((16,), {"activations": ("relu", "tanh"), "mirror": MIRROR})),
            ((12, 9), {"activations": ("hardtanh", "silu", "linear")}),
        ],
    )
    def test_compiled_equals_python(self, make_policy, simulator, hidden, settings):
        policy = make_policy(*hidden, constant=3, **settings)
        starts, goals = simulator.sample(np.random.default_rng(3), 200)
        compiled = simulator.rollout(policy, starts, goals, record=True)
        called = simulator.rollout(lambda seen: policy(seen), starts, goals, record=True)
        np.testing.assert_array_equal(compiled.steps, called.steps)
        np.testing.assert_array_equal(compiled.collision, called.collision)
        np.testing.assert_allclose(compiled.paths, called.paths, rtol=0, atol=1e-12)


class TestInvariants:
    def test_arrays_are_copied_and_frozen(self, provenance):
        mean, weights = np.zeros(2), np.ones((1, 2))
        policy = Policy(mean, np.ones(2), (Layer(weights, np.zeros(1)),), provenance)
        mean[0], weights[0, 0] = 9, 9
        assert policy.mean[0] == 0
        assert policy.layers[0].weights[0, 0] == 1
        for array in (policy.mean, policy.std, *policy.layers[0]):
            with pytest.raises(ValueError, match="read-only"):
                array.flat[0] = 1

    @pytest.mark.parametrize(
        ("changes", "message"),
        [
            ({"layers": ()}, "at least one layer"),
            ({"std": [1.0, -1.0]}, "std must not be negative"),
            ({"layers": (Layer(np.ones((1, 3)), np.zeros(1)),)}, "mean must have shape"),
            ({"layers": (Layer(np.ones((1, 2)), np.zeros(2)),)}, "bias of layer 0"),
            ({"activations": ("sine",)}, "function 'sine' .*available: linear, tanh, relu"),
            ({"mirror": Mirror([1.0, 1.0], [1.0, 1.0])}, "mirror of actions must have shape"),
            (
                {"layers": (Layer(np.ones((4, 2)), np.zeros(4)), Layer(np.ones((1, 3)), [0.0]))},
                "weights of layer 1",
            ),
        ],
    )
    def test_parts_that_do_not_fit_are_refused(self, provenance, changes, message):
        parts = {
            "mean": [0.0, 0.0],
            "std": [1.0, 1.0],
            "layers": (Layer(np.ones((1, 2)), np.zeros(1)),),
            "provenance": provenance,
        }
        with pytest.raises(InvalidInputError, match=message):
            Policy(**{**parts, **changes})


def test_observations_that_no_arm_has_are_refused(provenance):
    problem = provenance.problem.replace(observation=["goal"])
    layers = (Layer(np.ones((5, 5)), np.zeros(5)),)
    policy = Policy(np.zeros(5), np.ones(5), layers, replace(provenance, problem=problem))
    with pytest.raises(InvalidInputError, match="mean has 5 values, its observation has fewer"):
        policy.layout  # noqa: B018


class TestCheckArm:
    def test_refuses_another_arm(self, make_policy, shipped_arms):
        with pytest.raises(
            PolicyFileError, match="trained for arm 'paper', not for 'paper_flange'"
        ):
            make_policy().check_arm(shipped_arms["paper_flange"])

    def test_refuses_another_version_of_the_arm(self, make_policy):
        with pytest.raises(PolicyFileError, match="another version of arm 'paper'"):
            make_policy().check_arm(Arm.load("paper", actuated=("axis_1", "axis_2")))


class TestFile:
    @pytest.mark.parametrize("hidden", [(), (6,), (6, 4)])
    @pytest.mark.parametrize("mirror", [None, MIRROR])
    def test_round_trip_is_bitwise(self, make_policy, tmp_path, hidden, mirror):
        activations = ("hardtanh", "relu", "tanh")[-len(hidden) - 1 :]
        policy = make_policy(*hidden, activations=activations, mirror=mirror)
        policy.save(tmp_path / "policy.npz")
        assert_bitwise_equal(policy, Policy.load(tmp_path / "policy.npz"))

    def test_failed_write_leaves_the_old_file(self, make_policy, saved, monkeypatch):
        before = saved.read_bytes()

        def fail(file, **_):
            file.write(b"half")
            raise OSError(28, "No space left on device")

        monkeypatch.setattr(np, "savez_compressed", fail)
        with pytest.raises(OutputError, match="cannot write.*No space left"):
            make_policy(seed=9).save(saved)
        assert saved.read_bytes() == before
        assert list(saved.parent.iterdir()) == [saved]


class TestBadFile:
    def refused(self, path, message):
        with pytest.raises(PolicyFileError, match=message) as caught:
            Policy.load(path)
        gc.collect(1)  # a file left open is reported here, not in a later test
        assert path.name in str(caught.value)
        assert "\n" not in str(caught.value)

    def test_observations_of_another_layout(self, saved):
        header = json.loads(str(contents(saved)["header"])) | {"observation": "0: goal 3"}
        np.savez(saved, **{**contents(saved), "header": json.dumps(header)})
        self.refused(saved, f"layout '0: goal 3', not '{observation_layout(PROBLEMS['right'])}'")

    def test_half_a_mirror(self, make_policy, saved):
        make_policy(mirror=MIRROR).save(saved)
        for name in ("mirror_observations", "mirror_actions"):
            kept = contents(saved)
            del kept[name]
            spoilt = saved.with_name(f"{name}.npz")
            np.savez(spoilt, **kept)
            self.refused(spoilt, "mirror")


def test_what_would_overflow_is_refused(provenance):
    layer = Layer(np.full((2, 3), 1e31), np.zeros(2))
    with pytest.raises(InvalidInputError, match=r"weights must be at most 1e\+30"):
        Policy(np.zeros(3), np.ones(3), (layer,), provenance)
