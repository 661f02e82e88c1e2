"""``kinarm-replay``: pages from policies and recordings."""

import numpy as np
import pytest
from documents import outcomes_of
from random_policies import policy_for
from refusals import check_refused

from kinarm.evaluation.replay import PLAYED
from kinarm.problem import ReachProblem
from kinarm.recording import load_recordings, save_recordings

QUICK = ("--no-oracle",)
EVALUATED = ("--problem", "right", "--trials", 12, "--seed", 4)
"""The trials of the fixture ``evaluation``."""


def played(answer):
    """Trials, in the order in which they are played."""
    assert answer.status == 0, answer.err
    return [int(line.split()[1].rstrip(",")) for line in answer.out.splitlines()[:-1]]


def test_trials_of_a_policy(replay, policy_folder, tmp_path):
    answer = replay("--policy", policy_folder / "mine-seed0.npz", "--trials", 2)
    assert played(answer) == [0, 1]
    assert "proven necessary" in answer.out
    assert "made.html" in answer.out
    assert (tmp_path / "made.html").read_text().startswith("<!DOCTYPE html>")


def test_recordings_end_as_the_evaluation_says(run, tmp_path, evaluation, policy_folder):
    options = ("--policy", policy_folder / "mine-seed0.npz", *EVALUATED, *QUICK)
    files = ("--out", tmp_path / "made.html", "--record", tmp_path / "made.npz")
    assert run("kinarm-replay", *options, *files).status == 0
    said = outcomes_of(evaluation, "mine-seed0")
    recorded = load_recordings(tmp_path / "made.npz")
    assert [each.final_distance for each in recorded] == said["final_distance"]
    assert [each.steps for each in recorded] == said["steps"]
    assert [each.outcome for each in recorded] == said["outcome"]
    contacts = [tuple(pair) if pair else None for pair in said["contact"]]
    assert [each.contact for each in recorded] == contacts


def test_the_worst_of_an_evaluation(replay, evaluation):
    distances = np.array(outcomes_of(evaluation, "random")["final_distance"])
    answer = replay("random", *EVALUATED, "--worst", 3, *QUICK)
    assert played(answer) == np.argsort(-distances, kind="stable")[:3].tolist()


@pytest.mark.parametrize(("options", "problem"), [((), "both"), (("--problem", "left"), "left")])
def test_the_first_policy_of_a_group(replay, options, problem):
    answer = replay("--policy", "ppo-best-both", *options, "--trials", 1, *QUICK)
    assert answer.status == 0, answer.err
    assert f"{problem} 0, ppo-best-both-seed0: " in answer.out


def test_two_policies_on_the_same_trials(replay, tmp_path):
    answer = replay("--compare", "random", "zero", "--problem", "left", "--trials", 2, *QUICK)
    assert played(answer) == [0, 0, 1, 1]
    assert "random and zero" in (tmp_path / "made.html").read_text()


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ((), ["name a --policy"]),
        (("--policy", "zero"), ["'zero'", "name a --problem"]),
        (("--policy", "ars-tuned-both", "--arm", "paper_flange"), ["trained for arm 'paper'"]),
        (("--policy", "zero", "--compare", "zero", "random"), ["--policy", "--compare"]),
        (("--policy", "zero", "--worst", "3", "--failures"), ["--worst", "--failures"]),
        (("--policy", "zero", "--problem", "left", "--trial", "200"), ["no trial 200", "0 to 199"]),
        (("--policy", "oracle", "--problem", "left", "--failures", "--trials", "9"), ["none of"]),
        (("zero", "--problem", "left", "--failures", "--trials", "501"), ["501 of 501"]),
        (("zero", "--problem", "left", "--vec-normalize", "none"), ["models of Stable-Baselines3"]),
        (("missing.npz",), ["missing.npz", "No such file"]),
        (("missing.npz", "--seed", "0"), ["--seed"]),
    ],
)
def test_bad_input(replay, tmp_path, arguments, words):
    check_refused(replay(*arguments), *words)
    assert list(tmp_path.iterdir()) == []


def test_folders_are_made_and_files_kept(run, tmp_path):
    page, kept = tmp_path / "new" / "made.html", tmp_path / "other" / "made.npz"
    options = ("--policy", "zero", "--problem", "left", "--trials", 1, *QUICK)
    files = ("--out", page, "--record", kept)
    assert run("kinarm-replay", *options, *files).status == 0
    check_refused(run("kinarm-replay", *options, "--out", page), "--overwrite")
    fresh = ("--out", tmp_path / "fresh.html")
    check_refused(run("kinarm-replay", *options, *fresh, "--record", kept), "--overwrite")
    check_refused(run("kinarm-replay", *options, *fresh, "--record", tmp_path / "a.txt"), ".npz")
    assert run("kinarm-replay", *options, *files, "--overwrite").status == 0


def test_a_page_of_kinarm_with_the_default_name_is_replaced(run, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    options = ("zero", "--problem", "left", "--trials", 1, *QUICK)
    for _ in range(2):
        assert run("kinarm-replay", *options).status == 0
    (tmp_path / "replay.html").rename(tmp_path / "mine.html")
    check_refused(run("kinarm-replay", *options, "--out", "mine.html"), "--overwrite")
    (tmp_path / "replay.html").write_text("<!DOCTYPE html>\n<title>kinarm, by me</title>\n")
    check_refused(run("kinarm-replay", *options), "--overwrite")


def test_a_file_of_recordings_says_by_whom_they_are(replay, recordings, tmp_path):
    check_refused(replay(recordings, "--policy", "zero"), "--policy", "a file of recordings")
    check_refused(replay(recordings, "--problem", "left"), "--problem", "a file of recordings")
    check_refused(replay(recordings, "--trial", 9), "no trial 9", "0 to 3")
    save_recordings(tmp_path / "empty.npz", [])
    check_refused(replay(tmp_path / "empty.npz"), "empty.npz", "holds no recording")


class TestPlayground:
    def test_page_of_two_policies(self, run, policy_folder, tmp_path, monkeypatch):
        monkeypatch.chdir(tmp_path)
        mine = policy_folder / "mine-seed0.npz"
        answer = run("kinarm-replay", "--play", mine, "ppo-best-both", "--problem", "right")
        assert answer.status == 0, answer.err
        assert answer.out.startswith("written: play.html, ")
        page = (tmp_path / "play.html").read_text()
        assert page.startswith("<!DOCTYPE html>")
        assert run("kinarm-replay", "--play", mine).status == 0
        assert (tmp_path / "play.html").read_text() != page

    @pytest.mark.parametrize(
        ("words", "said"),
        [
            (("random",), "'random' does not run in a page"),
            (("oracle",), "'oracle' does not run in a page"),
            (("numpy:tanh",), "'numpy:tanh' does not run in a page"),
            (("nobody",), "unknown policy 'nobody'"),
            ((PLAYED[0], "--compare", "zero", "zero"), "--compare does not go with --play"),
            ((PLAYED[0], "--wrapper", "a:b"), "--wrapper does not go with --play"),
            pytest.param(
                *((PLAYED[0], "--plant", "hard"), "it has a plant with more than one delay"),
                marks=pytest.mark.slow,
            ),
            ((PLAYED[0], "--arm", "paper_flange"), "was trained for arm 'paper', not for"),
        ],
    )
    def test_what_does_not_play(self, replay, words, said, tmp_path):
        check_refused(replay("--play", *words, "--problem", "both"), said)
        assert not (tmp_path / "made.html").exists()

    def test_policies_that_differ(self, replay, tmp_path):
        """Bodies that are seen, and another arm."""
        both = ReachProblem.load("both")
        for name, changed in (
            ("near", {"observation": ["goal", "proximity"]}),
            ("flange", {"arm": "paper_flange"}),
        ):
            policy_for(both.replace(**changed)).save(tmp_path / f"{name}.npz")
        near, flange = (tmp_path / f"{name}.npz" for name in ("near", "flange"))
        check_refused(replay("--play", near), "'near' does not run here: the policy sees proximity")
        said = "'flange' does not run here: the policy was trained for arm 'paper_flange', not for"
        check_refused(replay("--play", PLAYED[0], flange), said)
