"""The card of a policy."""

import re
from dataclasses import replace

import numpy as np
import pytest

from kinarm.evaluation.bounds import oracle_bounds
from kinarm.evaluation.contestants import ORACLE, Contestant
from kinarm.evaluation.evaluation import run_trials
from kinarm.evaluation.metrics import METRICS
from kinarm.evaluation.report.card import policy_card, write_card
from kinarm.evaluation.summary import evaluation_document
from kinarm.policies import load_policy


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


def test_without_the_oracle(faced, document):
    alone = replace(faced[0], bounds=None)
    text = policy_card("mine", evaluation_document([alone], "made"), alone)
    assert "oracle" not in text
    assert "| | this policy |\n| --- | --- |\n" in text
