"""The table of learners: what is shipped, and files of one's own."""

import pytest

from kinarm.errors import InvalidInputError, MissingExtraError
from kinarm.evaluation.comparison.learners import read_learners

MINE = """
[mine]
title = "Mine"
algorithm = "SAC"
source = "here"
environment_steps = 100
"""

RECIPE = '[mine]\ntitle = "Mine"\nsource = "here"\nalgorithm = "ars"\nrecipe = "tuned"\n'


def read(tmp_path, text):
    path = tmp_path / "mine.toml"
    path.write_text(text)
    return read_learners(path)


def test_shipped_table():
    table = read_learners()
    assert {"ars-paper", "ars-tuned", "ppo-paper", "ppo-tuned", "sb3-ppo"} <= set(table)
    assert {"sb3-sac", "sb3-td3", "sb3-tqc-her"} <= set(table)
    assert all(learner.name == name and learner.source for name, learner in table.items())
    assert len({learner.title for learner in table.values()}) == len(table)
    assert {name for name, learner in table.items() if learner.is_recipe} == {
        *("ars-paper", "ars-tuned", "ppo-paper", "ppo-tuned")
    }


def test_a_table_of_ones_own(tmp_path):
    (learner,) = read(tmp_path, MINE + "[mine.settings]\ngamma = 0.9\n").values()
    assert (learner.name, learner.title, learner.settings) == ("mine", "Mine", {"gamma": 0.9})


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("mine = 3", "every learner must be a table"),
        (MINE.replace("SAC", "SACK"), "unknown algorithm 'SACK'.*ars, ppo.*TQC"),
        (MINE + "colour = 1", "unknown key 'mine.colour'"),
        (MINE.replace("100", "0"), "environment_steps"),
        (MINE.replace("100", "true"), "mine.environment_steps must be a whole number"),
        (MINE.replace('source = "here"\n', ""), "'mine.source' is missing"),
        (MINE + 'recipe = "paper"', "kinarm's learners have a recipe, and others have none"),
        (MINE.replace("SAC", "ars"), "kinarm's learners have a recipe"),
        (MINE + "decaying = true", "decaying needs settings.learning_rate"),
        (RECIPE + "[mine.settings]\nsteps = 0.9", "mine: unknown setting of ars 'steps'"),
        (RECIPE + "[mine.settings]\nreplay_share = 1.5", "mine: .*replay_share"),
        (RECIPE + "n_envs = 8", "mine: n_envs is not for kinarm's learners"),
        (RECIPE + "train_on = { tolerance = 0.1 }", "train_on is not for kinarm's learners"),
        (RECIPE + "[mine.settings]\nseed = 3", r"settings\.seed: the comparison chooses it"),
        ("[mine", "not a table of learners file"),
    ],
)
def test_bad_tables_are_refused_in_one_line(tmp_path, text, message):
    with pytest.raises(InvalidInputError, match=message) as caught:
        read(tmp_path, text)
    assert "mine.toml" in str(caught.value)
    assert len(str(caught.value).splitlines()) == 1


def test_missing_file(tmp_path):
    with pytest.raises(InvalidInputError, match=r"cannot read table of learners .*none\.toml"):
        read_learners(tmp_path / "none.toml")


def test_missing_package(monkeypatch):
    monkeypatch.setattr("kinarm.policies.learners.find_spec", lambda name: None)
    with pytest.raises(MissingExtraError, match="pip install"):
        read_learners()["sb3-tqc-her"].check_installed()
    read_learners()["ars-paper"].check_installed()


def test_missing_package_of_one_algorithm(monkeypatch):
    pytest.importorskip("stable_baselines3")
    monkeypatch.setattr(
        "kinarm.evaluation.comparison.learners.find_spec",
        lambda name: None if name == "sb3_contrib" else name,
    )
    with pytest.raises(MissingExtraError, match=r"sb3_contrib .*kinarm\[zoo\]"):
        read_learners()["sb3-tqc-her"].check_installed()
    read_learners()["sb3-sac"].check_installed()
