"""``kinarm-export``: a folder, or one line that says why not."""

import subprocess
import sys

import pytest
from refusals import check_refused

from kinarm import ReachEnv, ReachProblem
from kinarm.policies import Policy, load_policy
from kinarm.policies.arm_policy import ArmPolicy
from kinarm.policies.self_test import self_test


def test_folder(run, tmp_path):
    out = tmp_path / "out"
    answer = run("kinarm-export", "ars-linear-both", "--out", out, "--no-onnx")
    assert (answer.status, answer.err) == (0, "")
    assert answer.out == f"written: {out}; python {out}/self_test.py tests it\n"
    names = {"arm_policy.py", "self_test.py", "contract.json", "policy.npz", "README.md"}
    assert {each.name for each in out.iterdir()} == names
    assert Policy.load(out / "policy.npz").problem == load_policy("ars-linear-both").problem
    done = subprocess.run(
        [sys.executable, out / "self_test.py"], capture_output=True, text=True, check=False
    )
    assert (done.returncode, done.stdout) == (0, "passed\n")


def test_onnx(run, tmp_path):
    for package in ("torch", "onnx"):
        pytest.importorskip(package)
    out = tmp_path / "out"
    assert run("kinarm-export", "ars-linear-both", "--out", out).status == 0
    assert (out / "policy.onnx").is_file()
    assert (out / "network.onnx").is_file()


@pytest.mark.parametrize("missing", ["torch", "onnx"])
def test_without_the_extra(run, tmp_path, monkeypatch, missing):
    if missing == "onnx":
        pytest.importorskip("torch")
    monkeypatch.setitem(sys.modules, missing, None)
    out = tmp_path / "out"
    answer = run("kinarm-export", "ars-linear-both", "--out", out)
    check_refused(answer, missing, "pip install 'kinarm[export]'")
    assert not out.exists()


@pytest.fixture(scope="module")
def model(tmp_path_factory):
    sb3 = pytest.importorskip("stable_baselines3")
    folder = tmp_path_factory.mktemp("model")
    env = sb3.common.vec_env.DummyVecEnv([lambda: ReachEnv("right")])
    env = sb3.common.vec_env.VecNormalize(env)
    made = sb3.PPO("MlpPolicy", env, n_steps=64, device="cpu").learn(64)
    made.save(folder / "model.zip")
    env.save(folder / "statistics.pkl")
    return folder / "model.zip"


class TestModels:
    """Of Stable-Baselines3, whose files say neither their problem nor their statistics."""

    def test_with_its_problem_and_statistics(self, run, model, tmp_path):
        out = tmp_path / "out"
        words = ("--problem", "right", "--vec-normalize", model.parent / "statistics.pkl")
        answer = run("kinarm-export", model, *words, "--out", out, "--no-onnx")
        assert (answer.status, answer.err) == (0, "")
        assert self_test(ArmPolicy(out)) == []

    def test_without(self, run, model, tmp_path):
        words = ("--out", tmp_path / "out", "--no-onnx")
        check_refused(run("kinarm-export", model, *words), "--problem")
        check_refused(run("kinarm-export", model, "--problem", "right", *words), "--vec-normalize")

    def test_of_what_is_no_model(self, run, tmp_path):
        words = ("--out", tmp_path / "out", "--no-onnx", "--problem", "right")
        answer = run("kinarm-export", "ars-linear-both", *words)
        check_refused(answer, "--problem and --vec-normalize are for a model")


class TestRefusals:
    def test_names_and_folders(self, run, tmp_path):
        words = ("--out", tmp_path / "out", "--no-onnx")
        check_refused(run("kinarm-export", "ars-liner-both", *words), "ars-linear-both")
        check_refused(run("kinarm-export", *words), "POLICY")
        check_refused(run("kinarm-export", "ars-linear-both"), "--out")
        (tmp_path / "out").mkdir()
        answer = run("kinarm-export", "ars-linear-both", *words)
        check_refused(answer, "exists: --overwrite replaces")
        assert run("kinarm-export", "ars-linear-both", *words, "--overwrite").status == 0
        (tmp_path / "file").touch()
        inside = ("--out", tmp_path / "file" / "a", "--no-onnx")
        check_refused(run("kinarm-export", "ars-linear-both", *inside), "cannot write")

    def test_policy_that_sees_bodies(self, run, tmp_path):
        problem = ReachProblem.load("right").replace(observation=["goal", "proximity"])
        torch = pytest.importorskip("torch")
        linear = torch.nn.Linear(3 + 6 * 9, 5)
        Policy.from_torch(linear, problem).save(tmp_path / "mine.npz")
        answer = run("kinarm-export", tmp_path / "mine.npz", "--out", tmp_path / "out")
        check_refused(answer, "the policy sees proximity")
        assert not (tmp_path / "out").exists()
