"""*Train with Stable-Baselines3* and *HER*: what the pages show runs, with smaller budgets."""

import re
import runpy
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("stable_baselines3")

from kinarm.policies import load_policy

ROOT = Path(__file__).resolve().parents[2]
BUDGETS = (
    (r"learn\([\d_]+", "learn(2_400"),
    (r"n_envs=64", "n_envs=8"),
    (r"eval_freq=\d+", "eval_freq=150"),
    (r"gradient_steps=8", "gradient_steps=1"),
    (r"trials=\d+", "trials=20"),
)
"""What a page says, and what is run instead."""


def code_of(page: str) -> str:
    """All blocks of a page, one after the other."""
    text = (ROOT / "docs" / page).read_text(encoding="utf-8")
    code = "".join(re.findall(r"```\{code-block\} python\n:name: \S+\n\n(.*?)```", text, re.DOTALL))
    for shown, run in BUDGETS:
        code = re.sub(shown, run, code)
    return code


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """An empty folder to work in."""
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.mark.slow
def test_train_with_stable_baselines3(folder: Path) -> None:
    (folder / "page.py").write_text(code_of("stable_baselines3.md"))
    found = runpy.run_path("page.py")
    assert found["slow"].num_envs == 8
    assert np.load("logs/evaluations.npz")["successes"].shape == (2, 100)
    assert np.isfinite(found["mean_return"])
    assert len(found["evaluation"].rollouts) == 20
    assert load_policy("mine.npz").provenance.environment_steps >= 2400


@pytest.mark.slow
def test_hindsight_replay(folder: Path) -> None:
    (folder / "page.py").write_text(code_of("her.md"))
    found = runpy.run_path("page.py")
    assert found["model"].num_timesteps >= 2400
    np.testing.assert_allclose(found["rewards"], [-0.02, -np.hypot(0.02, 0.18)], atol=1e-9)
