"""Bounds of trials: those of the oracle, found once, kept on disk, whatever happens there."""

import gc
import io
import json
import os
import subprocess
import sys
import time
import weakref
from copy import copy
from pathlib import Path

import numpy as np
import pytest
from oracle_calls import count_calls

import kinarm
from kinarm.arm import Arm
from kinarm.evaluation import bounds
from kinarm.evaluation.bounds import bounds_document, cache_folder, oracle_bounds
from kinarm.evaluation.trials import TrialSet
from kinarm.policies.oracle import Oracle, OracleSolutions
from kinarm.policies.provenance import package_versions
from kinarm.problem import PROBLEMS
from kinarm.scene import PAPER_BENCHES, Obstacle, Scene
from kinarm.task import RewardWeights

FAR = Obstacle(name="far", lower=(5.0, 5.0, 0.0), upper=(6.0, 6.0, 1.0))

HERE = Path(kinarm.__file__).parent.parent
"""What the package is imported from."""

PROCESSES = 3

SOLVE_AT_ONCE = f"""
import json
from multiprocessing import get_context
from kinarm.evaluation import TrialSet, oracle_bounds
from kinarm.evaluation.bounds import bounds_document
from kinarm.policies.oracle import Oracle

trials = TrialSet.draw("right", 3, seed=5)
Oracle("right", threads=1).solve(trials.starts[0], trials.goals[0])

def solve(_):
    all_ready.wait()
    return bounds_document(oracle_bounds(trials))

context = get_context("fork")
all_ready = context.Barrier({PROCESSES})
with context.Pool({PROCESSES}) as pool:
    print(json.dumps(pool.map(solve, range({PROCESSES}), chunksize=1)))
"""


@pytest.fixture
def folder(tmp_path, monkeypatch) -> Path:
    """An empty cache folder, yet to be made."""
    monkeypatch.setenv("KINARM_CACHE", str(tmp_path / "deep" / "cache"))
    return tmp_path / "deep" / "cache"


@pytest.fixture(scope="module")
def solutions() -> OracleSolutions:
    """What the oracle says of the trials that ``draw`` draws."""
    trials = draw()
    return Oracle("right").solve_batch(trials.starts, trials.goals)


@pytest.fixture(scope="module")
def hard() -> TrialSet:
    """Twelve trials, of which some are out of reach."""
    return draw("right", 12, 2, arm="paper_flange")


def draw(problem="right", trials=3, seed=5, **overrides) -> TrialSet:
    return TrialSet.draw(PROBLEMS[problem].replace(**overrides), trials, seed)


def same(one: OracleSolutions, other: OracleSolutions) -> bool:
    """Whether every array is equal, in kind and content."""
    pairs = zip(one.arrays().values(), other.arrays().values(), strict=True)
    return all(a.dtype == b.dtype and a.tobytes() == b.tobytes() for a, b in pairs)


def run_outside(code: str, folder: Path, **variables: str) -> str:
    """Run code in a process of its own and return what it prints."""
    done = subprocess.run(
        [sys.executable, "-c", code],
        cwd=folder,
        env={**os.environ, **variables},
        capture_output=True,
        text=True,
        check=False,
    )
    assert (done.returncode, done.stderr) == (0, "")
    return done.stdout.strip()


def forbid_solving(monkeypatch) -> None:
    def solve_batch(*_, **__):
        raise AssertionError("solved again")

    monkeypatch.setattr(Oracle, "solve_batch", solve_batch)


def test_tests_leave_the_cache_of_the_user_alone(own_cache):
    assert cache_folder() == own_cache
    assert Path.home() not in cache_folder().parents


def test_bounds_are_those_of_the_oracle(folder, solutions):
    trials = draw()
    found = oracle_bounds(trials)
    assert same(found, solutions)
    single = Oracle("right").solve(trials.starts[1], trials.goals[1])
    assert (found[1].steps, found[1].steps_lower_bound) == (single.steps, single.steps_lower_bound)
    np.testing.assert_array_equal(found[1].path, single.path)


def test_bounds_are_those_of_the_problem_of_the_trials(folder):
    post = Obstacle(name="post", lower=(0.3, -0.8, 0.0), upper=(0.5, -0.6, 0.2))
    settings = {"tolerance": 0.1, "horizon": 20, "arm": "lrmate200ic_5l"}
    trials = draw(scene=Scene(obstacles=(post,)), **settings)
    solver = Oracle(PROBLEMS["right"].replace(scene=Scene(obstacles=(post,)), **settings))
    assert same(oracle_bounds(trials), solver.solve_batch(trials.starts, trials.goals))


def test_bounds_are_known_as_long_as_the_trials_are(folder, monkeypatch):
    trials = draw()
    first = oracle_bounds(trials)
    next(folder.iterdir()).unlink()
    forbid_solving(monkeypatch)
    assert oracle_bounds(trials) is first


def test_bounds_do_not_keep_trials_alive(folder):
    trials = draw()
    oracle_bounds(trials)
    gone = weakref.ref(trials)
    del trials
    gc.collect()
    assert gone() is None


def test_equal_trials_are_looked_up(folder, solutions, monkeypatch):
    oracle_bounds(draw())
    forbid_solving(monkeypatch)
    found = oracle_bounds(draw())
    assert same(found, solutions)
    assert not any(array.flags.writeable for array in found.arrays().values())


def test_equal_trials_have_equal_bounds_without_a_cache(folder):
    first = oracle_bounds(draw())
    next(folder.iterdir()).unlink()
    assert same(oracle_bounds(draw()), first)


def test_a_single_file_is_left_and_others_may_read_it(folder):
    oracle_bounds(draw())
    (path,) = folder.iterdir()
    reference = folder / "reference"
    reference.write_text("")
    assert path.name == f"oracle-{draw().digest}-{bounds.oracle_version()}.npz"
    assert path.stat().st_mode == reference.stat().st_mode


def test_the_reward_does_not_matter(folder, monkeypatch):
    oracle_bounds(draw())
    forbid_solving(monkeypatch)
    oracle_bounds(draw(reward=RewardWeights(success=4)))


@pytest.mark.parametrize(
    "other",
    [
        {"seed": 6},
        {"trials": 4},
        {"problem": "left"},
        {"arm": "paper_flange"},
        {"tolerance": 0.04},
        {"horizon": 65},
        {"start_spread": 0.5},
        {"scene": Scene(obstacles=(*PAPER_BENCHES, FAR))},
    ],
    ids=lambda other: next(iter(other)),
)
def test_other_trials_are_solved_and_kept_apart(folder, monkeypatch, other):
    oracle_bounds(draw())
    calls = count_calls(monkeypatch)
    trials = draw(**other)
    assert len(oracle_bounds(trials)) == len(trials)
    assert calls == [len(trials)]
    assert len(list(folder.iterdir())) == 2


def test_another_version_of_the_oracle_solves_again(folder, monkeypatch):
    oracle_bounds(draw())
    calls = count_calls(monkeypatch)
    monkeypatch.setattr(bounds, "oracle_version", lambda: "later")
    oracle_bounds(draw())
    assert calls == [3]
    assert len(list(folder.glob("*-later.npz"))) == 1


def archive(arrays: dict[str, np.ndarray]) -> bytes:
    file = io.BytesIO()
    np.savez_compressed(file, **arrays)
    return file.getvalue()


def single_array(_, arrays) -> bytes:
    file = io.BytesIO()
    np.save(file, arrays["steps"])
    return file.getvalue()


DAMAGES = {
    "empty": lambda *_: b"",
    "text": lambda *_: b"hello",
    "bytes": lambda *_: bytes(range(256)) * 4,
    "first half": lambda whole, _: whole[: len(whole) // 2],
    "all but the end": lambda whole, _: whole[:-1],
    "second half": lambda whole, _: whole[len(whole) // 2 :],
    "single array": single_array,
    "no array": lambda *_: archive({}),
    "foreign": lambda *_: archive({"weights": np.zeros(3)}),
    "one missing": lambda _, arrays: archive({k: v for k, v in arrays.items() if k != "tight"}),
    "one too many": lambda _, arrays: archive({**arrays, "more": arrays["steps"]}),
    "one short": lambda _, arrays: archive({**arrays, "steps": arrays["steps"][:-1]}),
    "all short": lambda _, arrays: archive({name: array[:-1] for name, array in arrays.items()}),
    "objects": lambda _, arrays: archive({**arrays, "reasons": np.array([None] * 3)}),
}


@pytest.mark.parametrize("damage", DAMAGES)
def test_a_file_that_cannot_be_used_is_replaced(folder, solutions, monkeypatch, damage):
    oracle_bounds(draw())
    (path,) = folder.iterdir()
    path.write_bytes(DAMAGES[damage](path.read_bytes(), solutions.arrays()))
    calls = count_calls(monkeypatch)
    assert same(oracle_bounds(draw()), solutions)
    assert same(oracle_bounds(draw()), solutions)
    assert calls == [3]
    assert list(folder.iterdir()) == [path]


def test_a_file_with_a_number_for_an_array_is_replaced(folder, solutions):
    oracle_bounds(draw())
    (path,) = folder.iterdir()
    path.write_bytes(archive({**solutions.arrays(), "steps": np.array(3)}))
    assert same(oracle_bounds(draw()), solutions)


def test_whichever_byte_of_a_file_is_wrong_the_bounds_are_right(folder, solutions, monkeypatch):
    oracle_bounds(draw())
    (path,) = folder.iterdir()
    whole = path.read_bytes()
    monkeypatch.setattr(Oracle, "solve_batch", lambda *_, **__: solutions)
    monkeypatch.setattr(bounds, "_save", lambda *_: None)
    drawn = draw()
    for place in range(0, len(whole), 13):
        content = bytearray(whole)
        content[place] ^= 0xFF
        path.write_bytes(content)
        assert same(oracle_bounds(copy(drawn)), solutions), place


@pytest.mark.parametrize("inside", ["", "deep"])
def test_a_file_in_place_of_the_folder_does_no_harm(tmp_path, monkeypatch, solutions, inside):
    (tmp_path / "file").write_text("mine")
    monkeypatch.setenv("KINARM_CACHE", str(tmp_path / "file" / inside))
    assert same(oracle_bounds(draw()), solutions)
    assert [path.name for path in tmp_path.iterdir()] == ["file"]
    assert (tmp_path / "file").read_text() == "mine"


def test_a_folder_in_place_of_the_file_does_no_harm(folder, solutions):
    path = folder / f"oracle-{draw().digest}-{bounds.oracle_version()}.npz"
    path.mkdir(parents=True)
    assert same(oracle_bounds(draw()), solutions)
    assert list(folder.iterdir()) == [path]


@pytest.mark.parametrize(
    ("variables", "expected"),
    [
        ({"KINARM_CACHE": "/mine", "XDG_CACHE_HOME": "/theirs"}, "/mine"),
        ({"KINARM_CACHE": "", "XDG_CACHE_HOME": "/theirs"}, "/theirs/kinarm"),
        ({"XDG_CACHE_HOME": "/theirs"}, "/theirs/kinarm"),
        ({"XDG_CACHE_HOME": ""}, "/home/me/.cache/kinarm"),
        ({}, "/home/me/.cache/kinarm"),
    ],
)
def test_the_folder_is_the_chosen_or_the_users(monkeypatch, variables, expected):
    for name in ("KINARM_CACHE", "XDG_CACHE_HOME"):
        monkeypatch.delenv(name, raising=False)
    for name, value in {"HOME": "/home/me", **variables}.items():
        monkeypatch.setenv(name, value)
    assert cache_folder() == Path(expected)


@pytest.mark.parametrize("constant", ["ORACLE_SEMANTICS", "SEMANTICS"])
def test_the_version_changes_with_what_oracle_and_simulator_mean(monkeypatch, constant):
    before = bounds.oracle_version.__wrapped__()
    assert before == bounds.oracle_version()
    monkeypatch.setattr(bounds, constant, "another")
    assert bounds.oracle_version.__wrapped__() != before


@pytest.mark.parametrize("package", bounds.COMPUTING_PACKAGES)
def test_the_version_changes_with_the_packages_that_compute(monkeypatch, package):
    before, installed = bounds.oracle_version.__wrapped__(), package_versions()
    monkeypatch.setattr(bounds, "package_versions", lambda: {**installed, package: "99"})
    assert bounds.oracle_version.__wrapped__() != before
    monkeypatch.setattr(bounds, "package_versions", lambda: {**installed, "torch": "99"})
    assert bounds.oracle_version.__wrapped__() == before


def fill(folder: Path, *names: str, size: int = 1000) -> None:
    """Write files of which each was used an hour before the next, the last one an hour ago."""
    folder.mkdir(parents=True, exist_ok=True)
    for age, name in enumerate(reversed(names), start=1):
        (folder / name).write_bytes(bytes(size))
        used = time.time() - 3600 * age
        os.utime(folder / name, (used, used))


def names_in(folder: Path) -> set[str]:
    return {path.name for path in folder.iterdir()}


class TestRoom:
    """What the cache keeps when it gets full."""

    def test_the_least_recently_used_files_go_beyond_a_number(self, folder, monkeypatch):
        monkeypatch.setattr(bounds, "KEPT_FILES", 3)
        fill(folder, *(f"oracle-{name}-1.npz" for name in "abcd"))
        oracle_bounds(draw())
        assert {f"oracle-{name}-1.npz" for name in "cd"} < names_in(folder)
        assert len(names_in(folder)) == 3

    def test_the_least_recently_used_files_go_beyond_a_size(self, folder, monkeypatch):
        fill(folder, *(f"oracle-{name}-1.npz" for name in "abcd"), size=100_000)
        monkeypatch.setattr(bounds, "KEPT_BYTES", 250_000)
        oracle_bounds(draw())
        assert {f"oracle-{name}-1.npz" for name in "cd"} < names_in(folder)
        assert len(names_in(folder)) == 3

    def test_looking_up_is_use(self, folder, monkeypatch):
        monkeypatch.setattr(bounds, "KEPT_FILES", 2)
        oracle_bounds(draw())
        (first,) = names_in(folder)
        os.utime(folder / first, (0, 0))
        fill(folder, "oracle-old-1.npz")
        oracle_bounds(draw())
        oracle_bounds(draw(seed=6))
        assert first in names_in(folder)
        assert "oracle-old-1.npz" not in names_in(folder)

    def test_bounds_larger_than_the_cache_are_kept_alone(self, folder, monkeypatch):
        monkeypatch.setattr(bounds, "KEPT_BYTES", 1)
        fill(folder, "oracle-old-1.npz")
        oracle_bounds(draw())
        (kept,) = names_in(folder)
        assert kept != "oracle-old-1.npz"

    def test_only_what_belongs_to_the_cache_goes(self, folder, monkeypatch):
        monkeypatch.setattr(bounds, "KEPT_FILES", 1)
        abandoned = ".oracle-a-1.npz.x2f9k"
        fill(folder, abandoned, "notes.txt", "oracle.npz", "policy.npz", "oracle-mine.txt")
        oracle_bounds(draw())
        assert {"notes.txt", "oracle.npz", "policy.npz", "oracle-mine.txt"} < names_in(folder)
        assert abandoned not in names_in(folder)

    def test_files_that_vanish_or_cannot_be_deleted_do_no_harm(self, folder, monkeypatch):
        fill(folder, *(f"oracle-{name}-1.npz" for name in "abc"))
        (folder / "oracle-folder-1.npz" / "inside").mkdir(parents=True)
        (folder / "oracle-link-1.npz").symlink_to(folder / "nothing")
        monkeypatch.setattr(bounds, "KEPT_FILES", 0)
        unlink = Path.unlink

        def race(path, **settings):
            unlink(path)
            unlink(path)

        monkeypatch.setattr(Path, "unlink", race)
        oracle_bounds(draw())
        assert not {f"oracle-{name}-1.npz" for name in "abc"} & names_in(folder)


def test_progress_is_told_while_trials_are_solved(folder, monkeypatch):
    monkeypatch.setattr("kinarm.policies.oracle.oracle.LOT", 2)
    told = []
    trials = draw(trials=5)
    oracle_bounds(trials, lambda *counts: told.append(counts))
    assert told == [(2, 5), (4, 5), (5, 5)]
    oracle_bounds(trials, lambda *counts: told.append(counts))
    oracle_bounds(draw(trials=5), lambda *counts: told.append(counts))
    assert len(told) == 3


def test_processes_at_once_find_the_same_and_leave_one_file(
    folder, solutions, monkeypatch, tmp_path
):
    """Each of them waits until all are ready, with an empty cache."""
    answer = run_outside(SOLVE_AT_ONCE, tmp_path, PYTHONPATH=str(HERE))
    assert json.loads(answer) == [bounds_document(solutions)] * PROCESSES
    forbid_solving(monkeypatch)
    assert same(oracle_bounds(draw()), solutions)
    assert len(list(folder.iterdir())) == 1


def test_document_tells_the_bounds_of_every_trial(hard):
    solutions = oracle_bounds(hard)
    document = bounds_document(solutions)
    assert json.loads(json.dumps(document, allow_nan=False)) == document
    for name, column in document["trials"].items():
        assert column == [getattr(solution, name) for solution in solutions]
    assert set(document["trials"]) == {
        *("reachable", "steps", "steps_lower_bound", "tight"),
        *("final_distance", "distance_lower_bound"),
    }


def test_document_sums_up_the_bounds(hard):
    solutions = list(oracle_bounds(hard))
    document = bounds_document(oracle_bounds(hard))
    assert document["success"]["value"] == sum(s.reachable for s in solutions) / 12
    assert document["tight_share"] == sum(s.tight for s in solutions) / 12
    columns = {
        "steps": [s.steps for s in solutions],
        "steps_lower_bound": [s.steps_lower_bound for s in solutions],
        "gap": [s.steps - s.steps_lower_bound for s in solutions if s.reachable],
    }
    for name, column in columns.items():
        assert document[name]["mean"] == pytest.approx(sum(column) / len(column))
        assert document[name]["median"] == np.median(column)
        assert document[name]["p95"] == np.percentile(column, 95)
        assert document[name]["max"] == max(column)


def test_document_says_why_trials_are_not_solved(hard):
    solutions = oracle_bounds(hard)
    document = bounds_document(solutions)
    unsolved = {entry["trial"]: entry["reason"] for entry in document["unsolved"]}
    assert list(unsolved) == [i for i in range(12) if not solutions[i].reachable]
    assert 0 < len(unsolved) < 12
    proven = [trial for trial in unsolved if solutions[trial].steps_lower_bound == 65]
    assert proven
    for trial, reason in unsolved.items():
        assert reason == solutions[trial].reason
        assert reason.startswith("out of reach: proven") == (trial in proven)
    for trial in proven:
        floor = solutions[trial].distance_lower_bound
        assert f"stay {floor:.3f} m away or more within 64 steps" in unsolved[trial]


def test_document_of_solved_trials_lists_none(solutions):
    assert bounds_document(solutions)["unsolved"] == []
    assert bounds_document(solutions)["success"]["value"] == 1


def test_document_of_hopeless_trials_has_no_gap(folder):
    document = bounds_document(oracle_bounds(draw(horizon=1)))
    assert json.loads(json.dumps(document, allow_nan=False)) == document
    assert (document["success"]["value"], document["gap"]) == (0, None)
    assert [entry["trial"] for entry in document["unsolved"]] == [0, 1, 2]
    assert document["steps"]["max"] == 1
    assert document["steps_lower_bound"]["mean"] == 2


@pytest.mark.parametrize("arm", ["paper", "paper_flange", "lrmate200ic_5l"])
def test_bounds_contain_each_other(arm):
    """Floors are below what was found, and what is proven out of reach was not reached."""
    trials = draw("both", 10, 3, arm=arm)
    found = oracle_bounds(trials)
    assert (found.steps_lower_bound >= 1).all()
    assert (found.steps_lower_bound <= found.steps + ~found.reachable).all()
    assert (found.distance_lower_bound <= found.final_distance).all()
    np.testing.assert_array_equal(found.reachable, found.final_distance <= 0.05)
    assert not found.distance_lower_bound[found.reachable].any()
    np.testing.assert_array_equal(found.reasons == "", found.reachable)
    assert Arm.load(arm).n_actuated == found.actions.shape[2]
