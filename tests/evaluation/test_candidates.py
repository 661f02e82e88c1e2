"""What a request to replay finds, and who can face trials again."""

import pytest

from kinarm._files import write_text
from kinarm.errors import InvalidInputError
from kinarm.evaluation import ReplayRequest
from kinarm.evaluation.contestants import Contestant
from kinarm.evaluation.evaluation import evaluation_document, run_trials
from kinarm.evaluation.replay.choosing import find_candidates
from kinarm.evaluation.schemas import document_text
from kinarm.evaluation.trials import TrialSet


@pytest.fixture
def of_a_file(train_novice, tmp_path):
    """An evaluation of a policy in a file, and that file."""
    path, policy = tmp_path / "mine.npz", train_novice("right")
    policy.save(path)
    faced = [run_trials(Contestant.from_policy("mine", policy, path), TrialSet.draw("right", 5, 0))]
    document = evaluation_document(faced, "").to_json()
    write_text(tmp_path / "evaluation.json", document_text(document))
    return tmp_path / "evaluation.json", path


def test_a_policy_of_a_file_has_to_be_named(of_a_file):
    evaluation, path = of_a_file
    with pytest.raises(InvalidInputError, match="'mine' of .* is a file: name it with --policy"):
        find_candidates(ReplayRequest(source=evaluation))
    (run,) = find_candidates(ReplayRequest(source=evaluation, policy=str(path))).runs
    assert len(run.ends) == 5
