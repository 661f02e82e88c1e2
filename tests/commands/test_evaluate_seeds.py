"""``kinarm-eval`` pools training seeds by what policies record, whatever their files are called."""

import pytest

from kinarm.policies import recipe, train_policy


@pytest.fixture(scope="module")
def seeds(tmp_path_factory):
    """A folder with three training seeds, under names that do not tell, and a checkpoint."""
    folder = tmp_path_factory.mktemp("seeds")
    for seed, name in ((0, "a"), (9, "b10"), (4, "b9")):
        config = recipe("ars", "paper", problem="right", seed=seed, iterations=1)
        train_policy(config).policy.save(folder / f"{name}.npz")
    (folder / "b9.checkpoint.npz").write_bytes(b"unfinished")
    return folder


@pytest.mark.parametrize("given", ["folder", "files"])
def test_training_seeds_are_pooled_whatever_their_files_are_called(evaluated, seeds, given):
    files = [seeds / f"{name}.npz" for name in ("a", "b9", "b10")]
    document = evaluated("--policy", *([seeds] if given == "folder" else files), "--trials", 3)
    (pooled,) = document["pooled"]
    assert (pooled["policy"], pooled["training_seeds"]) == ("ars-paper*-right", [0, 4, 9])
    assert pooled["members"] == ["a", "b9", "b10"]


def test_the_document_says_that_settings_of_a_recipe_are_replaced(run, evaluated, tmp_path):
    made = ("ars", "--recipe", "tuned", "--iterations", 1, "--out", tmp_path / "few.npz")
    assert run("kinarm-train", *made).status == 0
    (row,) = evaluated("--policy", tmp_path / "few.npz", "--trials", 3, "--no-oracle")["results"]
    assert (row["policy"], row["recipe"]) == ("few", "tuned*")


def test_a_folder_without_policies(run, tmp_path):
    answer = run("kinarm-eval", "--policy", tmp_path)
    assert (answer.status, answer.out, answer.err.count("\n")) == (2, "", 1)
    assert "no policy (.npz)" in answer.err
