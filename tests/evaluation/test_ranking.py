"""What ships beside the policies tells what they reach, of all of them."""

import json
from importlib import resources
from types import SimpleNamespace

import pytest

from kinarm.evaluation import ranking as rankings
from kinarm.evaluation.ranking import SEED, TRIALS, ranking
from kinarm.policies import policy_names
from kinarm.policies.library import RANKING, best_policy
from kinarm.problem import PROBLEMS


@pytest.fixture(scope="module")
def recorded():
    text = (resources.files("kinarm.data") / "policies" / RANKING).read_text(encoding="utf-8")
    return json.loads(text)


def test_every_shipped_policy_is_ranked(recorded):
    """After shipping others: ``python -m kinarm.evaluation.ranking``."""
    serving = {name: [] for name in policy_names()}
    for problem, successes in recorded["success"].items():
        for name in successes:
            serving[name].append(problem)
    for name, problems in serving.items():
        everywhere = "paper" not in name  # what ships for all problems is symmetric
        assert problems == (list(PROBLEMS) if everywhere else [name.split("-")[2]])
    assert (recorded["trials"], recorded["seed"]) == (TRIALS, SEED)


def test_the_best_are_measured_again(recorded):
    for problem, successes in recorded["success"].items():
        best = best_policy(problem)
        assert ranking([best])["success"][problem] == {best: successes[best]}
        assert successes[best] == max(successes.values())


def test_what_is_measured_is_written_beside_the_policies(monkeypatch, tmp_path):
    name = "ars-tuned-both-seed0"
    (tmp_path / "policies").mkdir()
    there = SimpleNamespace(files=lambda _: tmp_path, as_file=resources.as_file)
    monkeypatch.setattr(rankings, "resources", there)
    monkeypatch.setattr(rankings, "policy_names", lambda: (name,))
    monkeypatch.setattr(rankings, "ranking", lambda names: ranking(names, trials=20))
    rankings.main()
    written = json.loads((tmp_path / "policies" / RANKING).read_text())
    assert (written["trials"], written["seed"]) == (20, SEED)
    assert [list(successes) for successes in written["success"].values()] == 3 * [[name]]
