"""The leaderboard: its record, and what submissions come to."""

import json

import pytest

from docs import leaderboard
from docs.leaderboard import RECORD, SUBMISSIONS, scored
from kinarm.evaluation import evaluate
from kinarm.policies import load_policy, policy_names
from kinarm.policies.library import group_of
from kinarm.problem import PROBLEMS


@pytest.fixture(scope="module")
def recorded():
    return json.loads(RECORD.read_text(encoding="utf-8"))


def test_every_shipped_policy_and_submission_has_rows(recorded):
    """After shipping others: ``python -m docs.leaderboard``."""
    rows = {(row["policy"], row["problem"]): row for row in recorded["rows"]}
    for name in policy_names():
        _, named, trained_for = group_of(name).split("-", 2)
        # What is ours for both is symmetric; what is for a problem of its own has no rows.
        faced = PROBLEMS if named != "paper" and trained_for == "both" else {trained_for}
        for problem in PROBLEMS.keys() & faced:
            bare = rows[group_of(name), problem]
            shielded = rows[f"{group_of(name)}+shield", problem]
            assert name in bare["seeds"]
            assert len(shielded["seeds"]) == len(bare["seeds"])
    submitted = {each.stem for each in SUBMISSIONS.iterdir() if each.suffix in (".npz", ".toml")}
    assert submitted
    assert {name for name, _ in rows} >= submitted | {f"{name}+shield" for name in submitted}
    assert (recorded["trials"], recorded["seed"]) == (leaderboard.TRIALS, leaderboard.SEED)


@pytest.mark.rare
@pytest.mark.parametrize("problem", PROBLEMS)
def test_a_shipped_policy_is_measured_again(recorded, problem):
    name = "ppo-best-both-seed9"
    again = evaluate(name, problem, leaderboard.TRIALS, leaderboard.SEED, oracle=True)
    (row,) = (
        row
        for row in recorded["rows"]
        if (row["policy"], row["problem"]) == (group_of(name), problem)
    )
    found = [again.metrics[figure].value for figure in ("success", "step_ratio")]
    assert row["seeds"][name] == found


class TestSubmissions:
    TOY = "import numpy\ndef act(observations):\n    return numpy.zeros((len(observations), 5))\n"

    def submitted(self, folder, text):
        (folder / "toy_submission.py").write_text(self.TOY)
        (folder / "mine.toml").write_text(text)
        return folder / "mine.toml"

    def test_a_function_is_scored_bare_and_behind_a_shield(self, tmp_path):
        text = 'policy = "toy_submission:act"\nproblems = ["right"]\ntraining_steps = 7\n'
        rows, whole = scored([self.submitted(tmp_path, text)], 4)
        assert whole
        assert [row["policy"] for row in rows] == ["mine", "mine+shield"]
        for row in rows:
            assert (row["problem"], row["training_steps"]) == ("right", 7)
            assert row["success"][0] == row["collision"] == 0
            assert row["failures"] == [["truncated", 4, next(iter(row["seeds"])), 0]]

    def test_a_policy_file_says_what_it_is_for(self, tmp_path):
        policy = load_policy("ars-linear-both-seed0")
        policy.save(tmp_path / "mine.npz")
        rows, whole = scored([tmp_path / "mine.npz"], 4)
        assert whole
        assert {(row["policy"], row["problem"]) for row in rows} == {
            (name, problem) for name in ("mine", "mine+shield") for problem in PROBLEMS
        }
        steps, numbers = policy.provenance.environment_steps, 5 * 49
        assert {(row["training_steps"], row["parameters"]) for row in rows} == {(steps, numbers)}

    @pytest.mark.parametrize(
        ("text", "why"),
        [
            ('policy = "toy_submission:other"', "toy_submission"),
            ('policy = "toy_submission:act"\nproblems = ["moon"]', "left, right, both"),
            ('policy = "toy_submission:act"\nseed = 3', "unknown key 'seed'"),
            ("policy = ", "mine.toml"),
        ],
    )
    def test_a_broken_one_gets_one_line(self, tmp_path, capsys, text, why):
        assert scored([self.submitted(tmp_path, text)], 4) == ([], False)
        (line,) = capsys.readouterr().err.splitlines()
        assert line.startswith("mine.toml: ")
        assert why in line
