"""Where trainings run, as the command line says."""

import sys
from types import SimpleNamespace

import pytest

from kinarm.errors import InvalidInputError
from kinarm.evaluation.running.options import RunningOptions


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ({"jobs": 0}, "jobs must be a whole number of at least 1"),
        ({"bundle": 0}, "bundle must be"),
        ({"minutes": 0}, "minutes must be"),
        ({"ray": "auto", "slurm": True}, "--ray and --slurm exclude each other"),
        ({"jobs": 2, "slurm": True}, "--jobs is for this machine"),
        ({"bundle": 2}, "--bundle goes with --slurm"),
        ({"partition": "a", "ray": "auto"}, "--partition goes with --slurm"),
    ],
)
def test_refused(given, words):
    with pytest.raises(InvalidInputError, match=words):
        RunningOptions(**given)


@pytest.mark.parametrize("given", [{"jobs": 2}, {"ray": "auto"}, {"slurm": True}])
def test_without_training_nothing_runs_anywhere(given):
    RunningOptions().refuse_without_training()
    with pytest.raises(InvalidInputError, match="does not go with --no-train"):
        RunningOptions(**given).refuse_without_training()


class Executor:
    """Keeps what it is made with."""

    def __init__(self, *given):
        self.given = given


@pytest.mark.parametrize(
    ("options", "module", "given"),
    [
        ({"ray": "auto", "jobs": 3}, "ray_cluster", ("auto", 3, 2)),
        ({"slurm": True, "minutes": 9}, "slurm", (1, 9, 2, None)),
    ],
)
def test_elsewhere(monkeypatch, tmp_path, options, module, given):
    made = SimpleNamespace(RayExecutor=Executor, SlurmExecutor=Executor)
    monkeypatch.setitem(sys.modules, f"kinarm.evaluation.running.{module}", made)
    found = RunningOptions(**options).elsewhere(tmp_path, threads=2).given
    assert found[-len(given) :][1:] == given[1:]
    assert (found[0] == tmp_path / "slurm") is (module == "slurm")


def test_here(tmp_path):
    assert RunningOptions().elsewhere(tmp_path) is None
    assert RunningOptions(jobs=3).at_once == 3
    assert RunningOptions().at_once >= 1
