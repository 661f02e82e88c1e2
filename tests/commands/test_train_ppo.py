"""``kinarm-train ppo``: what it writes."""

import pytest

TINY_OPTIONS = (
    *("--n-envs", 4, "--n-steps", 16, "--batch-size", 32, "--n-epochs", 2),
    *("--net-arch", 8, 8),
)


@pytest.mark.parametrize(("rate", "words"), [("1e30", "at most 1e+06"), ("1e6", "diverged")])
def test_a_training_that_diverges_ends_in_one_line(run, tmp_path, rate, words):
    options = ("--learning-rate", rate, "--iterations", 20, "--out", tmp_path / "p.npz")
    answer = run("kinarm-train", "ppo", *TINY_OPTIONS, *options)
    assert answer.status == 2
    assert words in answer.err.splitlines()[-1]
    assert "Traceback" not in answer.err
    assert not (tmp_path / "p.npz").exists()
