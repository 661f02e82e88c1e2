"""Command lines on policies that are not kinarm's own, and cards."""

import json
import sys

import numpy as np
import pytest
from refusals import check_refused


@pytest.fixture
def here(tmp_path, monkeypatch):
    """An empty current directory."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "path", list(sys.path))
    return tmp_path


@pytest.fixture
def saved(here):
    """A model of Stable-Baselines3, with the statistics of its observations beside it."""
    sb3 = pytest.importorskip("stable_baselines3")
    from stable_baselines3.common.vec_env import DummyVecEnv, VecNormalize

    from kinarm.envs import ReachEnv

    env = VecNormalize(DummyVecEnv([lambda: ReachEnv("right")]))
    env.reset()
    for _ in range(20):
        env.step(np.ones((1, 5)))
    sb3.PPO("MlpPolicy", env, seed=1, device="cpu").save(here / "model_20_steps.zip")
    env.save(here / "statistics.pkl")
    return here / "model_20_steps.zip"


@pytest.fixture
def module(here):
    """A module in the current directory."""
    source = "import numpy as np\n\ndef still(seen):\n    return np.zeros((len(seen), 5))\n"
    (here / "still_for_tests.py").write_text(source)
    yield "still_for_tests:still"
    sys.modules.pop("still_for_tests", None)


class TestModel:
    def test_is_evaluated_beside_the_oracle(self, run, saved):
        statistics = saved.with_name("statistics.pkl")
        arguments = ("--policy", saved, "--vec-normalize", statistics)
        arguments += ("--problem", "right", "--trials", 5)
        answer = run("kinarm-eval", *arguments)
        assert answer.status == 0, answer.err
        assert "model" in answer.out
        assert "oracle" in answer.out
        note = f"model_20_steps: observations normalised by {statistics}"
        assert note in "".join(answer.out.splitlines())
        rows = json.loads(run("kinarm-eval", *arguments, "--json").out)["results"]
        assert [(row["policy"], row["trained_on"]) for row in rows] == [
            ("model_20_steps", "right"),
            ("oracle", None),
        ]
        assert rows[0]["note"] == note

    @pytest.mark.parametrize("command", ["kinarm-eval", "kinarm-replay"])
    def test_bad_files(self, run, here, command):
        pytest.importorskip("stable_baselines3")
        (here / "broken.zip").write_bytes(b"PK")
        for name, word in (("broken.zip", "not a complete"), ("gone.zip", "No such file")):
            check_refused(run(command, "--policy", name, "--problem", "right"), name, word)

    @pytest.mark.parametrize("command", ["kinarm-eval", "kinarm-replay"])
    @pytest.mark.parametrize("policy", ["ars-tuned-both-seed0", "random"])
    def test_statistics_without_a_model(self, run, here, command, policy):
        words = (command, "--policy", policy, "--problem", "both", "--vec-normalize", "none")
        check_refused(run(*words), "--vec-normalize", "models of Stable-Baselines3")


class TestModule:
    @pytest.mark.parametrize("command", ["kinarm-eval", "kinarm-replay"])
    def test_takes_part(self, run, module, command):
        answer = run(command, "--policy", module, "--problem", "left", "--trials", 3)
        assert answer.status == 0, answer.err
        assert module in answer.out


class TestCard:
    def test_of_a_file(self, run, here, policy):
        policy.save("mine.npz")
        arguments = ("--policy", "mine.npz", "--trials", 4, "--card", "mine.md")
        answer = run("kinarm-eval", *arguments)
        assert answer.status == 0, answer.err
        assert "written: mine.md, mine.npz and mine.html" in answer.out
        text = (here / "mine.md").read_text()
        assert "kinarm-eval --policy mine.npz --trials 4 --card mine.md" in text
        assert (here / "mine.html").is_file()
        check_refused(run("kinarm-eval", *arguments), "mine.md' exists", "--overwrite")
        assert run("kinarm-eval", *arguments, "--overwrite").status == 0
        assert (here / "mine.md").read_text() == text.replace(
            "--card mine.md", "--card mine.md --overwrite"
        )
