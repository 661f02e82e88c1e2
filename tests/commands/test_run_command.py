"""``kinarm-run``: runs and checks, and one line that says why not."""

from dataclasses import replace

import numpy as np
import pytest
from refusals import check_refused

from kinarm.policies import export_policy, load_policy
from kinarm.policies.running.fake import FakeArm
from kinarm.recording import load_recordings

POLICY = "ppo-best-both"
GOALS = (0.4, -0.5, 0.3, "--goal", 0.3, 0.5, 0.4)
POSE = ("0.5", "0.9", "1.3", "-0.6", "-1.1", "0")


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    out = tmp_path_factory.mktemp("exported") / "best"
    wiring = {"sign": [1, -1, 1, 1, 1, 1], "offset": [0, 0.3, 0, 0, 0, 0]}
    export_policy(load_policy(POLICY), out, onnx=False, **wiring)
    return out


def test_fake_arm_and_recording(run, folder, tmp_path):
    made = tmp_path / "run.npz"
    answer = run("kinarm-run", folder, "--backend", "fake", "--goal", *GOALS, "--record", made)
    assert (answer.status, answer.err) == (0, "")
    first, _, cycles, written = answer.out.splitlines()
    assert first.startswith("goal 1 (")
    assert ": reached, 0.0" in first
    assert "at 50 Hz, 5 a step" in cycles
    assert written == f"written: {made}; kinarm-replay {made} shows it"
    assert [each.policy for each in load_recordings(made)] == ["best", "best"]
    again = run("kinarm-run", folder, "--backend", "fake", "--record", made)
    check_refused(again, "exists")
    page = tmp_path / "page.html"
    assert run("kinarm-replay", made, "--out", page).status == 0


@pytest.mark.parametrize("shield", [True, False])
def test_shield_of_a_policy_that_learnt_behind_one(run, tmp_path, shield):
    """The option decides."""
    policy = load_policy(POLICY)
    made = replace(policy.provenance, problem=policy.problem.replace(shield=True))
    replace(policy, provenance=made).save(tmp_path / "mine.npz")
    words = ("--backend", "fake", "--trials", 1, "--record", tmp_path / "run.npz")
    words += () if shield else ("--no-shield",)
    assert run("kinarm-run", tmp_path / "mine.npz", *words).status == 0
    (kept,) = load_recordings(tmp_path / "run.npz")
    assert kept.problem.stepping.shield == shield


def test_check(run, folder):
    answer = run("kinarm-run", "check", folder, "--backend", "fake", "--at", *POSE)
    assert (answer.status, answer.err) == (0, "")
    assert answer.out == (
        "passed: joints read what they have at the pose, and move as they are told\n"
    )
    answer = run("kinarm-run", "check", folder, "--backend", "fake")
    assert "not seen at this pose: sign or scale" in answer.out


def test_check_finds_an_error(run, folder, monkeypatch):
    read = FakeArm.read
    monkeypatch.setattr(FakeArm, "read", lambda arm: read(arm) + 0.5 * (np.arange(6) == 2))
    answer = run("kinarm-run", "check", folder, "--backend", "fake", "--at", *POSE)
    assert answer.status == 1
    assert answer.out.startswith("axis_3 reads 1.800, and is at 1.300: its offset")
    assert len(answer.err.splitlines()) == 1


class TestStops:
    def stop(self, monkeypatch, error, *errors, after=30):
        command, ahead = FakeArm.command, [*[None] * (after - 1), error, *errors]

        def fail(arm, positions):
            if ahead and (raised := ahead.pop(0)):
                raise raised
            command(arm, positions)

        monkeypatch.setattr(FakeArm, "command", fail)

    def test_lost_connection(self, run, monkeypatch, tmp_path):
        self.stop(monkeypatch, ConnectionError("cable"))
        made = tmp_path / "run.npz"
        answer = run("kinarm-run", POLICY, "--backend", "fake", "--record", made)
        assert (answer.status, answer.err) == (1, "kinarm-run: lost the arm: cable\n")
        assert "goal 1" in answer.out
        assert len(load_recordings(made)) == 1

    def test_ctrl_c(self, run, monkeypatch, tmp_path):
        self.stop(monkeypatch, KeyboardInterrupt())
        made = tmp_path / "run.npz"
        answer = run("kinarm-run", POLICY, "--backend", "fake", "--record", made)
        assert (answer.status, answer.err) == (130, "kinarm-run: interrupted; the arm rests\n")
        assert load_recordings(made)[0].steps > 4

    def test_connection_that_is_lost_after_ctrl_c(self, run, monkeypatch):
        """Nobody knows whether the arm rests."""
        self.stop(monkeypatch, KeyboardInterrupt(), ConnectionError("cable"))
        answer = run("kinarm-run", POLICY, "--backend", "fake")
        said = "kinarm-run: interrupted; lost the arm: cable\n"
        assert (answer.status, answer.err) == (130, said)


@pytest.mark.parametrize(
    ("words", "said"),
    [
        ((POLICY, "--backend", "fake", "--goal", 3, 3), "a goal is 3 numbers, got 2"),
        ((POLICY, "--backend", "fake", "--speed", 2), "speed must lie in (0, 1]"),
        ((POLICY, "--backend", "ur"), "needs --address"),
        ((POLICY, "--backend", "ur", "--address", "a", "--plant", "ur"), "has no --plant"),
        ((POLICY, "--backend", "fakes"), "invalid choice"),
        ((POLICY,), "--backend"),
        (("random", "--backend", "fake"), "'random' is no trained policy"),
        (("check", POLICY, "--backend", "fake", "--at", "here"), "--at must be numbers"),
        (("check", POLICY, "--backend", "fake", "--at", "9", *POSE[1:]), "axis_1 at 9"),
    ],
)
def test_refusals(run, words, said):
    check_refused(run("kinarm-run", *words), said)
