"""The card of a policy."""

import re
from dataclasses import replace

import numpy as np
import pytest

from kinarm.errors import InvalidInputError, OutputError
from kinarm.evaluation.bounds import oracle_bounds
from kinarm.evaluation.contestants import ORACLE, Contestant
from kinarm.evaluation.evaluation import run_trials
from kinarm.evaluation.metrics import METRICS
from kinarm.evaluation.report.card import (
    check_card,
    policy_card,
    shown_trials,
    write_card,
)
from kinarm.evaluation.summary import evaluation_document
from kinarm.policies import load_policy
from kinarm.problem import PROBLEMS


@pytest.fixture(scope="module")
def faced(skilled, trials):
    """A policy and the oracle on the same trials."""
    bounds, mine = oracle_bounds(trials), Contestant.from_policy("mine", skilled)
    return [run_trials(each, trials, bounds=bounds) for each in (mine, ORACLE)]


@pytest.fixture(scope="module")
def document(faced):
    return evaluation_document(faced, "kinarm-eval --policy mine.npz --card mine.md")


@pytest.fixture(scope="module")
def card(document, faced):
    return policy_card("mine", document, faced[0])


def test_states_figures_with_intervals_beside_the_oracle(card, document):
    rows = {row["policy"]: row for row in document.to_json()["results"]}
    for name in ("mine", "oracle"):
        success = rows[name]["metrics"]["success"]
        low, high = (100 * end for end in success["ci95"])
        assert f" {100 * success['value']:.1f} % ({low:.1f}..{high:.1f}) |" in card
    ratio = rows["mine"]["metrics"]["step_ratio"]["value"]
    (line,) = (line for line in card.splitlines() if METRICS["step_ratio"].meaning in line)
    assert line.endswith(f"| {ratio:.2f} | 1.00 |")


def test_states_where_the_policy_comes_from(card, skilled, document):
    made = skilled.provenance
    for line in (
        f"| seed | {made.seed} |",
        f"| environment steps | {made.environment_steps:,} |",
        "| `reward.success` | 0.5 |",
        "| network | layers 48-5, functions linear; sees goals on the left in the mirror |",
        f"| digest of the problem | `{skilled.problem.digest}` |",
        "kinarm-eval --policy mine.npz --card mine.md",
        document.protocol.versions["numpy"],
        skilled.problem.to_toml().strip(),
    ):
        assert line in card


def test_names_in_policy_files_are_shown_and_not_interpreted(document, faced):
    name = "<script>alert(1)</script>` | [a](b)"
    made = faced[0].contestant.policy.provenance
    forged = replace(made, algorithm=name, recipe=name, config={name: name}, versions={name: name})
    contestant = replace(
        faced[0].contestant, policy=replace(faced[0].contestant.policy, provenance=forged)
    )
    card = policy_card("mine", document, replace(faced[0], contestant=contestant))
    shown = r"<script>alert(1)</script>' \| [a](b)"
    assert f"| algorithm | `{shown}` |\n| recipe | `{shown}` |" in card
    assert f"| `{shown}` | `{shown}` |" in card
    # Within code, and the rows of tables, nothing of it is left.
    assert "script" not in re.sub(r"`[^`\n]*`", "", card)


def test_how_to_use_it_runs(card, document, faced, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    path = tmp_path / "mine.md"
    write_card(path, document, faced)
    assert path.read_text() == card
    scope = {}
    exec(re.search(r"```python\n(.*?)```", card, re.DOTALL).group(1), scope)
    assert scope["info"]["distance"] > 0
    own = load_policy("mine.npz")
    np.testing.assert_array_equal(
        own.layers[0].weights, faced[0].contestant.policy.layers[0].weights
    )
    assert "mine.html" in card
    assert (tmp_path / "mine.html").stat().st_size > 1e5


def test_the_replay_shows_the_first_trials_and_the_worst(faced):
    rollouts = faced[0].rollouts
    shown = shown_trials(faced[0])
    assert shown[:3] == [0, 1, 2]
    assert len(set(shown)) == 6
    left = sorted(set(range(60)) - set(shown))
    assert not rollouts.success[shown[3:]].any() or rollouts.success[left].all()


def test_without_the_oracle(faced, document):
    alone = replace(faced[0], bounds=None)
    text = policy_card("mine", evaluation_document([alone], "made"), alone)
    assert "oracle" not in text
    assert "| | this policy |\n| --- | --- |\n" in text


class TestCheck:
    @pytest.fixture
    def mine(self, skilled):
        return Contestant.from_policy("mine", skilled), PROBLEMS["right"]

    @pytest.mark.parametrize("count", [2, 5])
    def test_several_policies_are_refused(self, mine, tmp_path, count):
        with pytest.raises(InvalidInputError, match="one trained policy.*got mine on right, mine"):
            check_card(tmp_path / "mine.md", [mine] * count)

    def test_what_exists_is_kept(self, mine, tmp_path):
        for name in ("mine.md", "mine.html", "mine.npz"):
            (tmp_path / name).write_text("old")
            with pytest.raises(OutputError, match=f"{name}' exists: --overwrite"):
                check_card(tmp_path / "mine.md", [mine])
            check_card(tmp_path / "mine.md", [mine], overwrite=True)
            (tmp_path / name).unlink()

    def test_the_policy_s_own_file_may_lie_there(self, mine, tmp_path):
        contestant, problem = mine
        contestant.policy.save(tmp_path / "mine.npz")
        there = replace(contestant, source=(tmp_path / "mine.npz").resolve())
        check_card(tmp_path / "mine.md", [(there, problem), (ORACLE, problem)])
