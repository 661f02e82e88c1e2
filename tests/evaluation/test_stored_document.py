"""Documents of evaluations that are read from files, and results that are chosen from them."""

import json
from types import SimpleNamespace

import pytest

from kinarm.errors import InvalidInputError, UnknownNameError
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
    trials = document.trials("right")
    assert trials.digest == evaluations[0].trials.digest
    assert document.result("made-right", None).policy == "made-right-seed0"


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


def test_a_problem_that_has_changed_or_is_not_there_is_refused(stored):
    """By its hash, or by what is wrong with it."""

    def changed(**task):
        return stored(lambda d: d["protocol"]["problems"]["left"]["problem"]["task"].update(task))

    with pytest.raises(InvalidInputError, match="do not match their hash"):
        EvaluationDocument.load(changed(tolerance=0.2)).trials("left")
    with pytest.raises(InvalidInputError, match=r"problem left: task.horizon must be a whole"):
        EvaluationDocument.load(changed(horizon="64")).trials("left")
    with pytest.raises(UnknownNameError, match="unknown problem 'up'"):
        EvaluationDocument.load(stored()).trials("up")


class TestChoosing:
    """Results of one document, by policy and problem."""

    @pytest.fixture
    def document(self):
        names = [("zero", "left", None), ("a-seed0", "left", "left"), ("a-seed1", "left", "left")]
        names += [("a-seed0", "right", "left")]
        rows = [
            SimpleNamespace(policy=policy, problem=problem, trained_on=trained_on)
            for policy, problem, trained_on in names
        ]
        pooled = [
            SimpleNamespace(policy="a", problem="left", members=["a-seed0", "a-seed1"]),
            SimpleNamespace(policy="a", problem="right", members=["a-seed0"]),
        ]
        return EvaluationDocument(protocol=None, results=rows, pooled=pooled, differences=[])

    def test_by_name_and_by_group(self, document):
        assert document.result("a-seed1", "left").policy == "a-seed1"
        assert document.result("a", "right") is document.results[3]
        assert document.result("a", None) is document.results[1]

    def test_the_only_one_that_was_trained_needs_no_name(self, document):
        assert document.result(None, "right") is document.results[3]

    def test_several_are_named(self, document):
        with pytest.raises(InvalidInputError) as caught:
            document.result(None, "left")
        assert str(caught.value).endswith("a-seed0 on left, a-seed1 on left")
