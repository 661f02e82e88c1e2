"""``kinarm-train ppo``: what it writes."""

import pytest

from kinarm.policies import (
    recipe,
    save_checkpoint,
    train_policy,
)

TINY = {"n_envs": 4, "n_steps": 16, "batch_size": 32, "n_epochs": 2, "net_arch": (8, 8)}
TINY_OPTIONS = (
    *("--n-envs", 4, "--n-steps", 16, "--batch-size", 32, "--n-epochs", 2),
    *("--net-arch", 8, 8),
)


def test_learners_do_not_resume_each_other(run, tmp_path):
    config, states = recipe("ppo", "paper", iterations=2, **TINY), []
    train_policy(config, on_iteration=states.append)
    save_checkpoint(tmp_path / "p.checkpoint.npz", config, states[0])
    answer = run("kinarm-train", "ars", "--out", tmp_path / "p.npz", "--resume")
    assert (answer.status, answer.out, len(answer.err.splitlines())) == (2, "", 1)
    assert "is of the learner ppo" in answer.err


@pytest.mark.parametrize(("rate", "words"), [("1e30", "at most 1e+06"), ("1e6", "diverged")])
def test_a_training_that_diverges_ends_in_one_line(run, tmp_path, rate, words):
    options = ("--learning-rate", rate, "--iterations", 20, "--out", tmp_path / "p.npz")
    answer = run("kinarm-train", "ppo", *TINY_OPTIONS, *options)
    assert answer.status == 2
    assert words in answer.err.splitlines()[-1]
    assert "Traceback" not in answer.err
    assert not (tmp_path / "p.npz").exists()
