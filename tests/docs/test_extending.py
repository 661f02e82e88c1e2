"""The drills of *Extending kinarm*: what the page shows is run as it stands."""

import json
import os
import shlex
import shutil
import subprocess
import sys
import tomllib
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pytest
from joblib.externals.loky import get_reusable_executor
from pages import ROOT, named_blocks

from kinarm.evaluation import Study
from kinarm.evaluation.commands import evaluate, replay, train
from kinarm.evaluation.experiments import runs, table
from kinarm.evaluation.experiments.page import write_all
from kinarm.policies import learners, load_policy
from kinarm.problem import ReachProblem

BLOCKS = named_blocks(ROOT / "docs" / "how-to" / "extending.md")
MAINS = {"kinarm-train": train.main, "kinarm-eval": evaluate.main, "kinarm-replay": replay.main}


def run(command: str) -> None:
    """Run a command line in this process."""
    prog, *arguments = shlex.split(command.replace("\\\n", " "))
    with pytest.raises(SystemExit) as end:
        MAINS[prog](arguments)
    assert end.value.code == 0, command


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """An empty folder to work in."""
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.fixture
def toy(folder: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """The learner of the page, in one file, in a package that names it by the entry point shown."""
    installed = folder / "toy_learner-1.0.dist-info"
    installed.mkdir()
    (installed / "METADATA").write_text("Metadata-Version: 2.1\nName: toy_learner\nVersion: 1.0\n")
    ((group, points),) = tomllib.loads(BLOCKS["entry-point"])["project"]["entry-points"].items()
    lines = [f"[{group}]", *(f"{name} = {place}" for name, place in points.items())]
    (installed / "entry_points.txt").write_text("\n".join(lines))
    shutil.copy(ROOT / "docs" / "how-to" / "toy_learner.py", folder)
    monkeypatch.syspath_prepend(str(folder))
    learners._installed.cache_clear()
    get_reusable_executor().shutdown()  # workers that are there already know no such package
    yield
    learners._installed.cache_clear()
    sys.modules.pop("toy_learner", None)


def test_a_learner_is_one_file(toy: None, folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    train_it, evaluate_it = BLOCKS["toy-commands"].strip().splitlines()
    run(train_it)
    policy = load_policy(folder / "toy.npz")
    assert policy.provenance.algorithm == "toy"
    assert policy.problem.name == "left"
    assert policy.provenance.config["noise"] == 0.03
    capsys.readouterr()
    run(evaluate_it)
    results = json.loads(capsys.readouterr().out)["results"]
    ends = {row["policy"]: row["metrics"]["mean_distance"]["value"] for row in results}
    assert ends["toy"] < ends["zero"]


def test_workers_train_the_learner_of_a_package(toy: None, folder: Path) -> None:
    run("kinarm-train toy --seeds 3 --jobs 2 --iterations 4 --out seeds")
    assert len(list((folder / "seeds").glob("toy-paper-right-seed?.npz"))) == 3


TOYS = {
    "name": "toys",
    "entries": [
        {"learner": "toy", "fixed": {"iterations": 4}},
        {"learner": "toy_learner:LEARNER", "name": "by module", "fixed": {"iterations": 5}},
    ],
    "seeds": 2,
    "trials": {"count": 10},
    "bounds": False,
}


@pytest.mark.slow
def test_experiments_train_it_in_other_processes_and_a_column_stands_in_one_place(
    toy: None, folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("PYTHONPATH", os.pathsep.join([str(folder), str(ROOT)]))
    monkeypatch.setattr(table, "COLUMNS", table.COLUMNS)
    exec(BLOCKS["column"], {})
    study = Study(TOYS, folder / "study").run(jobs=2)
    assert [group.entry.name for group in study.groups()] == ["toy", "by module"]
    assert len(study) == 4
    write_all(study)
    shown = str(table.COLUMNS[-1].cell(study.groups()[0]))
    for name in ("index.html", "RESULTS.md"):
        text = (folder / "study" / name).read_text()
        assert "best seed %" in text
        assert shown in text


@pytest.mark.slow
def test_a_registered_learner_resumes_exactly(
    toy: None, folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    command = "kinarm-train toy --iterations 12 --out {}.npz"
    run(command.format("whole"))
    states = runs.training_states

    def interrupted(*given: object, **options: object) -> Iterator[learners.TrainingState]:
        for state in states(*given, **options):
            if state.iteration == 6:
                raise KeyboardInterrupt
            yield state

    monkeypatch.setattr(runs, "CHECKPOINT_SECONDS", 0.0)
    monkeypatch.setattr(runs, "training_states", interrupted)
    with pytest.raises(SystemExit) as end:
        train.main(shlex.split(command.format("halves"))[1:])
    assert end.value.code == 130
    monkeypatch.setattr(runs, "training_states", states)
    run(command.format("halves"))
    whole, halves = (load_policy(folder / f"{name}.npz") for name in ("whole", "halves"))
    np.testing.assert_array_equal(whole.layers[0].weights, halves.layers[0].weights)


def test_a_metric_is_one_entry(
    folder: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    from kinarm.evaluation import metrics

    table = dict(metrics.METRICS)
    exec(BLOCKS["metric"])
    added = {**metrics.METRICS}
    metrics.METRICS.clear()
    metrics.METRICS.update(table)
    for name, metric in added.items():
        monkeypatch.setitem(metrics.METRICS, name, metric)
    command = "kinarm-eval --policy ars-tuned-both-seed0 --trials 40 --no-oracle"
    run(f"{command} --json")
    (result,) = json.loads(capsys.readouterr().out)["results"]
    outcomes = result["outcomes"]
    ends = zip(outcomes["outcome"], outcomes["steps"], strict=True)
    quick = np.mean([outcome == "success" and steps <= 16 for outcome, steps in ends])
    assert result["metrics"]["quick"]["value"] == pytest.approx(quick)
    run(f"{command} --markdown")
    assert "quick %" in capsys.readouterr().out


@pytest.fixture
def post(folder: Path, write_robot: Callable[..., Path]) -> ReachProblem:
    """The problem of the page, with an arm beside its file."""
    shutil.copy(ROOT / "data" / "arms" / "paper.urdf", folder / "my_arm.urdf")
    (folder / "post.toml").write_text(BLOCKS["post.toml"])
    return ReachProblem.load("post.toml")


def test_a_problem_is_one_file(post: ReachProblem, folder: Path) -> None:
    assert post.name == "post"
    assert [obstacle.name for obstacle in post.scene.obstacles] == ["right bench", "post"]
    for command in BLOCKS["post-commands"].strip().splitlines():
        run(command)
    assert load_policy(folder / "post.npz").problem.digest == post.digest
    document = json.loads((folder / "results" / "evaluation.json").read_text())
    (entry,) = document["protocol"]["problems"].values()
    assert entry["oracle"]["success"] is not None
    assert (folder / "post.html").stat().st_size > 1e5


ADDED_PART = """
import numpy as np
import kinarm
from kinarm.observation_layout import observation_layout
from kinarm.policies.mirror import find_mirror

env = kinarm.ReachEnv("right", observation=["goal", "distance", "joint_positions"])
observation, info = env.reset(seed=0)
assert observation.shape == (10,) == env.observation_space.shape, observation.shape
assert env.observation_space.contains(observation)
assert abs(observation[3] - info["distance"]) < 1e-12
assert find_mirror(env.simulator.world).observations[3] == 1
assert "distance 1" in observation_layout(env.simulator.problem)
assert kinarm.policies.load_policy("ars-tuned-both").n_observations == 48
"""


@pytest.mark.slow
def test_an_observation_part_is_a_formula_and_an_entry(folder: Path) -> None:
    for part in ("kinarm", "policies", "evaluation", "data"):
        leave = shutil.ignore_patterns("__pycache__")
        shutil.copytree(ROOT / part, folder / part, ignore=leave)
    shutil.copy(ROOT / "pyproject.toml", folder)
    source = folder / "kinarm" / "observation.py"
    text = source.read_text()
    formula, entry = BLOCKS["observation-formula"], BLOCKS["observation-entry"]
    text = text.replace("\nPOLAR = ", f"\n{formula}\n\nPOLAR = ", 1)
    head, tail = text.split(')\n"""The parts in order', 1)
    source.write_text(f'{head}{entry},)\n"""The parts in order{tail}')
    subprocess.run(
        [sys.executable, "-c", ADDED_PART],
        check=True,
        cwd=folder,
        env={**os.environ, "PYTHONPATH": str(folder)},
    )
