"""``kinarm-eval`` beside the oracle: what it solves, when, and what is told of it."""

import pytest
from documents import faced, relative_success


@pytest.mark.parametrize(
    ("arguments", "tasks"),
    [
        (["zero"], ["left", "right", "both"]),
        (["oracle"], ["left", "right", "both"]),
        (["oracle", "oracle", "--problem", "left", "--problem", "left"], ["left"]),
        (["zero", "oracle", "--problem", "both", "--problem", "left"], ["both", "left"]),
    ],
)
def test_the_oracle_faces_every_task_in_play_once(evaluated, arguments, tasks):
    words = (
        word for name in arguments if name in ("zero", "oracle") for word in ("--policy", name)
    )
    others = [word for word in arguments if word not in ("zero", "oracle")]
    document = evaluated(*words, *others, "--trials", 2)
    assert [task for name, task in faced(document) if name == "oracle"] == tasks
    assert list(document["protocol"]["problems"]) == tasks


def test_without_the_oracle_nothing_is_solved(evaluated, solved, empty_cache):
    document = evaluated("--policy", "zero", "--trials", 2, "--no-oracle")
    assert faced(document) == [("zero", task) for task in ("left", "right", "both")]
    assert all(entry["oracle"] is None for entry in document["protocol"]["problems"].values())
    assert all(relative_success(row) is None for row in document["results"])
    assert solved == []
    assert list(empty_cache.glob("oracle-*")) == []


def test_trials_are_solved_once_and_then_looked_up(evaluated, solved, empty_cache):
    arguments = ("--policy", "zero", "--policy", "random", "--task", "right", "--trials", 3)
    first, second = evaluated(*arguments), evaluated(*arguments)
    assert solved == [3]
    assert len(list(empty_cache.glob("oracle-*"))) == 1
    assert first == second
