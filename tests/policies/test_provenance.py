"""Where a policy comes from."""

import json
import re
from dataclasses import dataclass, replace
from importlib import metadata

import pytest

from kinarm import SEMANTICS
from kinarm._fields import from_plain, to_plain
from kinarm.errors import InvalidInputError
from kinarm.policies.provenance import (
    Provenance,
    package_versions,
    source_commit,
)
from kinarm.problem import ReachProblem


@pytest.mark.parametrize("entry", ["algorithm", "problem"])
def test_missing_entry_is_named(provenance, entry):
    entries = to_plain(provenance)
    del entries[entry]
    with pytest.raises(InvalidInputError, match=f"provenance: '{entry}' is missing: "):
        from_plain(Provenance, entries, "provenance")


@dataclass(frozen=True)
class Settings:
    problem: ReachProblem
    recipe: str = "mine"
    seed: int = 7
    step_size: float = 0.1
    widths: tuple[int, ...] = (8, 8)


def test_of_a_training_here_and_now():
    problem = ReachProblem.load("left").replace(tolerance=0.03)
    made = Provenance.of("test", Settings(problem), 1234)
    assert made == Provenance(
        algorithm="test",
        recipe="mine",
        problem=problem.pinned,
        seed=7,
        environment_steps=1234,
        config={"recipe": "mine", "seed": 7, "step_size": 0.1, "widths": [8, 8]},
        versions=package_versions(),
        commit=source_commit(),
        semantics=SEMANTICS,
    )
    assert made.problem.arm.digest == problem.arm_digest
    stored = json.loads(json.dumps(to_plain(made)))
    assert from_plain(Provenance, stored, "provenance") == made


def test_versions_of_what_matters():
    versions = package_versions()
    for package in ("numpy", "numba", "pin", "coal"):
        assert versions[package] == metadata.version(package)
    assert re.fullmatch(r"3\.\d+\.\d+.*", versions["python"])


def test_the_semantics_of_an_older_file_are_unknown(provenance):
    assert provenance.semantics is None
    assert "semantics" not in to_plain(provenance)
    known = replace(provenance, semantics="3")
    assert from_plain(Provenance, to_plain(known), "provenance") == known


def test_without_git_the_commit_is_unknown(monkeypatch):
    monkeypatch.setenv("PATH", "")
    assert source_commit.__wrapped__() == ""
