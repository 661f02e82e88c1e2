"""*Your own policy*: what the page shows is run as it stands."""

import re
import runpy
import shlex
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

from kinarm.evaluation.commands import evaluate, replay
from kinarm.policies import load_policy, train

ROOT = Path(__file__).resolve().parents[2]
PAGE = (ROOT / "docs" / "policies.md").read_text(encoding="utf-8")
BLOCKS = dict(re.findall(r"```\{code-block\} \w+\n:name: (\S+)\n\n(.*?)```", PAGE, re.DOTALL))
MAINS = {"kinarm-train": train.main, "kinarm-eval": evaluate.main, "kinarm-replay": replay.main}


def run_commands(name: str) -> None:
    """Run the command lines of a block in this process."""
    for line in BLOCKS[name].strip().splitlines():
        prog, *arguments = shlex.split(line, comments=True)
        with pytest.raises(SystemExit) as end:
            MAINS[prog](arguments)
        assert end.value.code == 0, line


@pytest.fixture
def run_code(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Callable[..., dict[str, object]]:
    """Run blocks of Python one after the other, in an empty folder."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "path", list(sys.path))

    def run(*names: str) -> dict[str, object]:
        (tmp_path / "page.py").write_text("".join(BLOCKS[name] for name in names))
        return runpy.run_path("page.py")

    return run


def test_every_block_is_run() -> None:
    source = Path(__file__).read_text(encoding="utf-8")
    assert all(f'"{name}"' in source for name in BLOCKS)
    assert len(BLOCKS) == 6


def test_a_model_of_stable_baselines3(run_code: Callable[..., dict[str, object]]) -> None:
    pytest.importorskip("stable_baselines3")
    found = run_code("own-sb3", "own-sb3-file")
    assert load_policy("mine.npz").provenance.environment_steps == 512
    assert found["action"].shape == (1, 5)
    run_commands("own-sb3-commands")


def test_a_network_of_pytorch(run_code: Callable[..., dict[str, object]]) -> None:
    pytest.importorskip("torch")
    run_code("own-torch")
    assert load_policy("torch.npz").provenance.algorithm == "mine"


def test_a_function(run_code: Callable[..., dict[str, object]]) -> None:
    run_code("own-function")
    Path("steering.py").write_text(BLOCKS["own-function"])
    run_commands("own-function-commands")
    sys.modules.pop("steering")
