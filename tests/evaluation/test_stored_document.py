"""Documents of evaluations that are read from files."""

import json

import pytest

from kinarm.errors import InvalidInputError
from kinarm.evaluation.document import EvaluationDocument
from kinarm.evaluation.summary import evaluation_document


@pytest.fixture
def stored(evaluations, tmp_path):
    """A document in a file, and a function that changes it there."""
    path = tmp_path / "evaluation.json"
    document = evaluation_document(evaluations, "").to_json()

    def store(change=lambda document: None):
        changed = json.loads(json.dumps(document))
        change(changed)
        path.write_text(json.dumps(changed))
        return path

    return store


def test_a_document_is_read_as_it_was_written(stored, evaluations):
    document = EvaluationDocument.load(stored())
    assert document == evaluation_document(evaluations, "")
    digest = document.protocol.problems["right"].trial_set_hash
    assert digest == evaluations[0].trials.digest


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda d: d.pop("results"), "missing required field `results`"),
        (lambda d: d["protocol"]["problems"]["left"]["goals"][0].__setitem__(0, 10**400), "range"),
    ],
)
def test_a_damaged_document_is_refused_with_the_place(stored, change, words):
    with pytest.raises(InvalidInputError, match=rf"evaluation\.json' .*{words}"):
        EvaluationDocument.load(stored(change))
