"""Exported folders: their runtime beside kinarm, alone with NumPy, and what they notice."""

import ast
import json
import shutil
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from known_arms import INSTALLED
from random_policies import policy_for, sliding

from kinarm import ReachProblem, Scene, Simulator
from kinarm.contact_pairs import random_configurations
from kinarm.errors import ArmError, InvalidInputError, OutputError
from kinarm.observation import OBSERVATION
from kinarm.observation_choice import Observation
from kinarm.policies import Policy, export_policy, load_policy
from kinarm.policies.arm_policy import ArmPolicy
from kinarm.policies.mirror import problem_mirror
from kinarm.policies.self_test import self_test

N, STEPS = 14_000, 24
"""Configurations that are drawn, of which 10,000 of the paper's arm touch nothing; and steps."""

EMPTY = Scene(obstacles=(), ground=False)


def states(simulator, n=N):
    """Configurations that touch nothing, and goals that others reach."""
    world = simulator.world
    q, others = (random_configurations(world.arm, n, seed) for seed in (0, 1))
    free = ~world.in_contact(q)
    return q[free], world.reached(others[free])


def check_one_step(folder, policy, n=N):
    """Commands from rest are where a step of the simulator ends, unless it is refused."""
    simulator = Simulator(policy.problem, threads=1)
    q, goals = states(simulator, n)
    assert len(q) > n / 5
    episodes = simulator.reset(q, goals)
    result = simulator.step(episodes, policy(episodes.observation))
    command = ArmPolicy(folder).command(q, goals)
    moved = ~result.collision
    assert moved.mean() > 0.5
    np.testing.assert_allclose(command[moved], episodes.q[moved], rtol=0, atol=1e-9)


def check_episodes(folder, policy, n=60):
    """Commands go on as the plant's do, from what is measured."""
    simulator, runtime = Simulator(policy.problem, threads=1), ArmPolicy(folder)
    q, goals = states(simulator, n)
    episodes = simulator.reset(q, goals)
    has_plant, actuated = bool(simulator.world.plants.width), slice(simulator.n_actions)
    compared = 0
    for _ in range(STEPS):
        seen = (episodes.sensed if has_plant else episodes.q).copy()
        command = runtime.command(seen, episodes.goal)
        simulator.step(episodes, policy(episodes.observation))
        going = episodes.status == 0
        expected = episodes.drive[:, 0] if has_plant else episodes.q[:, actuated]
        difference = np.abs(command[:, actuated] - expected)[going]
        assert difference.max(initial=0.0) < 1e-9
        compared += going.sum()
    assert compared > n


@pytest.mark.parametrize("name", ["ars-linear-both", "ars-tuned-both", "ppo-best-both"])
def test_shipped_policies(name, tmp_path):
    policy = load_policy(name)
    assert policy.mirror is not None
    export_policy(policy, tmp_path / "out", onnx=False)
    assert self_test(ArmPolicy(tmp_path / "out")) == []
    check_one_step(tmp_path / "out", policy)
    check_episodes(tmp_path / "out", policy)


@pytest.mark.parametrize("arm", ["ur5", "panda", "sliding"])
def test_other_arms(arm, tmp_path, make_joint, write_robot):
    if arm == "sliding":
        arm = sliding(make_joint, write_robot)
    elif any(INSTALLED.args):
        pytest.skip("needs the extra robots")
    problem = ReachProblem.load("both").replace(arm=arm, scene=EMPTY)
    policy = policy_for(problem)
    export_policy(policy, tmp_path / "out", onnx=False)
    assert self_test(ArmPolicy(tmp_path / "out")) == []
    check_one_step(tmp_path / "out", policy)


OBSERVATIONS = {
    "joints": ["goal", "joint_angles", "joint_positions", "joint_velocities", "last_action"],
    "late": {"parts": ["goal_minus_tool", "time_left", "commanded", "last_action"], "history": 3},
    "frames": ["position", "joint_velocities", "goal", "orientation"],
}
PLANTS = {
    "ideal": {},
    "ideal, commanded": {"feedback": "commanded"},
    "servo": {"bandwidth": 3.0, "delay": 1, "acceleration": 20.0, "resolution": 0.002},
    "servo, commanded": {"bandwidth": 3.0, "delay": 2, "feedback": "commanded"},
}


@pytest.mark.parametrize("plant", PLANTS)
@pytest.mark.parametrize("observation", OBSERVATIONS)
def test_memory(observation, plant, tmp_path):
    chosen = OBSERVATIONS[observation]
    problem = ReachProblem.load("both").replace(observation=chosen, **PLANTS[plant])
    mirror = problem_mirror(problem) if observation == "joints" else None
    policy = policy_for(problem, mirror=mirror)
    export_policy(policy, tmp_path / "out", onnx=False)
    assert self_test(ArmPolicy(tmp_path / "out")) == []
    check_episodes(tmp_path / "out", policy)


SLOW = [
    pytest.param(name, marks=pytest.mark.slow) for name in ("direction", "pose", "configuration")
]


@pytest.mark.parametrize("kind", ["position", *SLOW])
def test_kinds_of_goals(kind, tmp_path):
    """Policies add to resolved rates of each."""
    shown = (*Observation().names(kind), "resolved_rate")
    problem = ReachProblem.load("both").replace(goal={"kind": kind}, observation=shown)
    policy = replace(policy_for(problem), residual=True)
    export_policy(policy, tmp_path / "out", onnx=False)
    check_one_step(tmp_path / "out", policy, 2000)


@pytest.mark.slow
@pytest.mark.parametrize("plant", PLANTS)
def test_rates_start_from_commands(plant, tmp_path):
    shown = (*Observation().names("position"), "resolved_rate")
    problem = ReachProblem.load("both").replace(observation=shown, **PLANTS[plant])
    policy = replace(policy_for(problem, mirror=problem_mirror(problem)), residual=True)
    export_policy(policy, tmp_path / "out", onnx=False)
    check_episodes(tmp_path / "out", policy)


@pytest.mark.parametrize("activation", ["relu", "hardtanh", "elu", "leaky_relu", "silu"])
def test_functions_of_layers(activation, tmp_path):
    policy = policy_for(ReachProblem.load("right"), activation=activation)
    export_policy(policy, tmp_path / "out", onnx=False)
    assert self_test(ArmPolicy(tmp_path / "out")) == []


def test_every_part_without_bodies_is_known():
    tree = ast.parse(Path(sys.modules[ArmPolicy.__module__].__file__).read_text())
    texts = {node.value for node in ast.walk(tree) if isinstance(node, ast.Constant)}
    assert {part.name for part in OBSERVATION} - texts == {"proximity", "obstacles"}


@pytest.fixture(scope="module")
def exported(tmp_path_factory):
    folder = tmp_path_factory.mktemp("exported") / "out"
    export_policy(load_policy("ars-tuned-both"), folder, onnx=False)
    return folder


class TestAlone:
    def run(self, folder):
        command = [sys.executable, "-s", str(folder / "self_test.py")]
        return subprocess.run(command, capture_output=True, text=True, check=False, cwd="/")

    def test_numpy_is_all_it_needs(self, exported):
        """Site packages are left out, and NumPy is the one package that is found."""
        code = f"""
import importlib.util, sys, types
numpy = types.SimpleNamespace(find_spec=lambda name, path=None, target=None: (
    importlib.util.spec_from_file_location(
        "numpy", {np.__file__!r}, submodule_search_locations=[{str(Path(np.__file__).parent)!r}]
    ) if name == "numpy" else None))
sys.meta_path.append(numpy)
sys.path.insert(0, {str(exported)!r})
import arm_policy, self_test
assert self_test.self_test(arm_policy.ArmPolicy()) == []
outside = {{name.partition(".")[0] for name in sys.modules}} - set(sys.stdlib_module_names)
assert outside <= {{"numpy", "arm_policy", "self_test", "__main__", "_distutils_hack"}}, outside
assert importlib.util.find_spec("kinarm") is None
"""
        done = subprocess.run(
            [sys.executable, "-I", "-S", "-c", code], capture_output=True, text=True, check=False
        )
        assert done.returncode == 0, done.stderr

    def test_source_is_of_python_3_9(self, exported):
        text = (exported / "arm_policy.py").read_text()
        ast.parse(text, feature_version=(3, 9))
        assert len(text.splitlines()) < 300

    def test_self_test(self, exported):
        done = self.run(exported)
        assert (done.returncode, done.stdout, done.stderr) == (0, "passed\n", "")

    @pytest.mark.parametrize("changed", ["limit", "axis", "command", "name"])
    def test_self_test_notices_a_change(self, exported, tmp_path, changed):
        shutil.copytree(exported, tmp_path / "out")
        path = tmp_path / "out" / "contract.json"
        contract = json.loads(path.read_text())
        if changed == "limit":
            contract["joints"][2]["velocity_limit"] += 0.01
        elif changed == "axis":
            contract["joints"][1]["axis"] = [0.0, -1.0, 0.0]
        elif changed == "command":
            contract["self_test"][3]["command"][0] += 1e-8
        else:
            contract["problem"]["name"] = "other"
        path.write_text(json.dumps(contract))
        done = self.run(tmp_path / "out")
        assert done.returncode == 1
        *lines, last = done.stdout.splitlines()
        assert last == "failed"
        assert lines[0] == "contract.json was changed after the export"
        assert (len(lines) > 1) == (changed != "name")


class TestContract:
    def test_says_what_there_is(self, exported):
        policy = load_policy("ars-tuned-both")
        arm, contract = (
            policy.problem.load_arm(),
            json.loads((exported / "contract.json").read_text()),
        )
        assert [joint["name"] for joint in contract["joints"]] == list(arm.joint_names)
        assert [joint["upper"] for joint in contract["joints"]] == arm.upper.tolist()
        assert [joint["actuated"] for joint in contract["joints"]] == [True] * 5 + [False]
        assert (contract["time_step"], contract["rate"]) == (0.02, 50.0)
        assert contract["problem"] == {"name": "both", "digest": policy.problem.digest}
        assert contract["plant"] == {"feedback": "measured"}
        assert len(contract["self_test"]) == 10
        names = [part["name"] for part in contract["observation"]["parts"]]
        assert names == ["goal", "goal_minus_tool", "orientation", "position"]
        assert not contract["observation"]["memory"]

    def test_policy_is_a_file_of_kinarm(self, exported):
        assert Policy.load(exported / "policy.npz").problem == load_policy("ars-tuned-both").problem

    def test_readme_names_joints(self, exported):
        text = (exported / "README.md").read_text()
        assert "| axis_6 | rad | -6.283 to 6.283 | 12.57 | no |" in text
        assert "{" not in text


class TestCommand:
    def test_starts_at_rest_and_goes_on_from_the_last_command(self, exported):
        policy = ArmPolicy(exported)
        q, goal = np.zeros(6), [0.4, -0.5, 0.3]
        first = policy.command(q, goal)
        second = policy.command(q, goal)
        assert np.abs(first[:5]).max() > 0.01
        assert first[5] == second[5] == 0
        np.testing.assert_allclose(second, 2 * first, rtol=0, atol=1e-12)
        policy.reset()
        np.testing.assert_array_equal(policy.command(q, goal), first)

    def test_feedback_of_the_command(self, exported):
        """The arm is taken to be where it was told to be."""
        told, ideal = ArmPolicy(exported, feedback="commanded"), ArmPolicy(exported)
        q, goal = np.zeros(6), [0.4, -0.5, 0.3]
        for _ in range(5):
            q = ideal.command(q, goal)
            np.testing.assert_allclose(told.command(np.zeros(6), goal), q, rtol=0, atol=1e-12)

    @pytest.mark.parametrize(
        ("joints", "goal", "words"),
        [
            (np.zeros(5), np.zeros(3), "joint_positions must be 6 finite numbers"),
            (np.full(6, np.nan), np.zeros(3), "joint_positions must be 6 finite numbers"),
            (np.zeros(6), np.zeros(4), "goal must be 3 finite numbers"),
            (np.full(6, 3.5), np.zeros(3), "beyond the limits"),
        ],
    )
    def test_bad_input(self, exported, joints, goal, words):
        with pytest.raises(ValueError, match=words):
            ArmPolicy(exported).command(joints, goal)

    def test_policy_of_another_folder(self, exported, tmp_path):
        export_policy(load_policy("ars-linear-both"), tmp_path / "out", onnx=False)
        shutil.copy(tmp_path / "out" / "policy.npz", shutil.copytree(exported, tmp_path / "mixed"))
        with pytest.raises(ValueError, match=r"policy\.npz is not the one that"):
            ArmPolicy(tmp_path / "mixed")


class TestRefusals:
    @pytest.mark.parametrize("part", ["proximity", "obstacles"])
    def test_bodies(self, part, tmp_path):
        problem = ReachProblem.load("both").replace(observation=["goal", part])
        with pytest.raises(InvalidInputError, match=f"the policy sees {part}"):
            export_policy(policy_for(problem), tmp_path / "out", onnx=False)
        assert not (tmp_path / "out").exists()

    def test_folder_that_exists(self, tmp_path):
        policy = load_policy("ars-linear-both")
        with pytest.raises(OutputError, match="exists"):
            export_policy(policy, tmp_path, onnx=False)
        export_policy(policy, tmp_path, onnx=False, overwrite=True)
        (tmp_path / "file").touch()
        with pytest.raises(OutputError, match="exists"):
            export_policy(policy, tmp_path / "file", onnx=False, overwrite=True)


def test_nothing_is_left_of_an_earlier_policy(tmp_path):
    """Its network would stand beside the runtime of another one."""
    out, policy = tmp_path / "out", load_policy("ars-linear-both")
    out.mkdir()
    for name in ("policy.onnx", "network.onnx", "notes.txt"):
        (out / name).touch()
    export_policy(policy, out, onnx=False, overwrite=True)
    assert (out / "notes.txt").exists()
    assert not [*out.glob("*.onnx")]


class TestTorch:
    @pytest.mark.parametrize("name", ["ars-linear-both", "ppo-best-both"])
    def test_module(self, name):
        torch = pytest.importorskip("torch")
        policy = load_policy(name)
        module, rng = policy.to_torch(), np.random.default_rng(0)
        seen = policy.mean + 2 * policy.std * rng.normal(size=(1000, policy.n_observations))
        action = module(torch.tensor(seen)).detach().numpy()
        np.testing.assert_allclose(action, policy(seen), rtol=0, atol=1e-12)
        assert sum(each.numel() for each in module.parameters()) == sum(
            weights.size + bias.size for weights, bias in policy.layers
        )


def model_of_stable_baselines3():
    sb3 = pytest.importorskip("stable_baselines3")
    from kinarm import ReachEnv

    return Policy.from_sb3(sb3.SAC("MlpPolicy", ReachEnv("right"), buffer_size=10, device="cpu"))


def test_model_of_stable_baselines3(tmp_path):
    policy = model_of_stable_baselines3()
    export_policy(policy, tmp_path / "out", onnx=False)
    check_one_step(tmp_path / "out", policy)


def run_onnx(path, **inputs):
    runtime = pytest.importorskip("onnxruntime")
    session = runtime.InferenceSession(path, providers=["CPUExecutionProvider"])
    assert [each.name for each in session.get_inputs()] == list(inputs)
    return session.run(None, {name: each.astype(np.float32) for name, each in inputs.items()})[0]


class TestONNX:
    @pytest.fixture(autouse=True)
    def needs(self):
        for package in ("torch", "onnx", "onnxruntime"):
            pytest.importorskip(package)

    def check(self, policy, folder):
        assert export_policy(policy, folder)["onnx"] == ["network.onnx", "policy.onnx"]
        assert self_test(ArmPolicy(folder)) == []
        simulator = Simulator(policy.problem, threads=1)
        q, goals = states(simulator)
        command = ArmPolicy(folder).command(q, goals)
        answer = run_onnx(folder / "policy.onnx", joint_positions=q, goal=goals, commanded=q)
        np.testing.assert_allclose(answer, command, rtol=0, atol=1e-5)
        seen = simulator.world.observe(q, goals)
        policy.to_onnx(folder / "own.onnx")
        assert (folder / "own.onnx").read_bytes() == (folder / "network.onnx").read_bytes()
        action = run_onnx(folder / "network.onnx", observation=seen)
        np.testing.assert_allclose(action, policy(seen), rtol=0, atol=1e-5)

    @pytest.mark.parametrize("name", ["ars-linear-both", "ppo-best-both"])
    def test_shipped_policies(self, name, tmp_path):
        self.check(load_policy(name), tmp_path / "out")

    def test_a_slide_and_seen_commands(self, tmp_path, make_joint, write_robot):
        arm = sliding(make_joint, write_robot)
        problem = ReachProblem.load("both").replace(
            arm=arm,
            scene=EMPTY,
            feedback="commanded",
            observation=["goal", "commanded", "goal_minus_tool", "position"],
        )
        self.check(policy_for(problem, activation="elu"), tmp_path / "out")

    @pytest.mark.slow
    def test_poses(self, tmp_path):
        shown = (*Observation().names("pose"), "resolved_rate")
        problem = ReachProblem.load("both").replace(goal={"kind": "pose"}, observation=shown)
        policy = policy_for(problem, activation="silu")
        self.check(replace(policy, residual=True), tmp_path / "out")

    def test_model_of_stable_baselines3(self, tmp_path):
        self.check(model_of_stable_baselines3(), tmp_path / "out")

    def test_memory_is_left_to_the_runtime(self, tmp_path):
        problem = ReachProblem.load("both").replace(observation={"history": 2})
        contract = export_policy(policy_for(problem), tmp_path / "out")
        assert (contract["onnx"], contract["observation"]["memory"]) == (["network.onnx"], True)


WIRING = {"sign": [1, -1, -1, 1, -1, 1], "offset": [0.3, 0, -1.5, 0, 2, 0.1]}


@pytest.fixture(scope="module")
def wired(tmp_path_factory):
    folder = tmp_path_factory.mktemp("wired") / "out"
    export_policy(load_policy("ars-tuned-both"), folder, onnx=False, **WIRING)
    return folder


class TestSignsAndOffsets:
    """An arm that counts some joints backwards, and from elsewhere."""

    def test_commands_and_self_test(self, wired, exported):
        assert self_test(ArmPolicy(wired)) == []
        sign, offset = (np.array(WIRING[name], dtype=float) for name in ("sign", "offset"))
        plain, theirs, q = ArmPolicy(exported), ArmPolicy(wired), np.full(6, 0.1)
        for _ in range(5):
            command = theirs.command(sign * q + offset, [0.4, -0.5, 0.3])
            q = plain.command(q, [0.4, -0.5, 0.3])
            np.testing.assert_allclose(command, sign * q + offset, rtol=0, atol=1e-12)

    def test_self_test_notices_a_flipped_sign(self, wired, tmp_path):
        shutil.copytree(wired, tmp_path / "out")
        path = tmp_path / "out" / "contract.json"
        contract = json.loads(path.read_text())
        contract["joints"][4]["sign"] = 1.0
        path.write_text(json.dumps(contract))
        assert len(self_test(ArmPolicy(tmp_path / "out"))) > 1

    def test_onnx(self, wired, tmp_path):
        for package in ("torch", "onnx"):
            pytest.importorskip(package)
        export_policy(load_policy("ars-tuned-both"), tmp_path / "out", **WIRING)
        theirs = ArmPolicy(wired)
        vectors = theirs.contract["self_test"]
        q, goals = (
            np.array([each[name] for each in vectors]) for name in ("joint_positions", "goal")
        )
        inputs = {"joint_positions": q, "goal": goals, "commanded": q}
        answer = run_onnx(tmp_path / "out" / "policy.onnx", **inputs)
        np.testing.assert_allclose(answer, theirs.command(q, goals), rtol=0, atol=1e-5)

    @pytest.mark.parametrize(
        ("wiring", "words"),
        [({"sign": [1] * 5}, "sign must have shape"), ({"sign": [2] * 6}, "sign must be 1 or -1")],
    )
    def test_bad_ones(self, wiring, words, tmp_path):
        with pytest.raises(InvalidInputError, match=words):
            export_policy(load_policy("ars-tuned-both"), tmp_path / "out", onnx=False, **wiring)


def test_another_version_of_an_arm(tmp_path):
    policy = load_policy("ars-linear-both")
    arm = replace(policy.problem.arm, digest="0" * 16)
    made = replace(policy.provenance, problem=replace(policy.problem, arm=arm))
    with pytest.raises(ArmError, match="another version"):
        export_policy(replace(policy, provenance=made), tmp_path / "out", onnx=False)
