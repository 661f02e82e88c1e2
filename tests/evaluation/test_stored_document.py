"""Documents of evaluations that are read from files, and results that are chosen from them."""

import json

import pytest

from kinarm.errors import InvalidInputError, UnknownNameError
from kinarm.evaluation.document import ENTRY, EvaluationDocument, check_shape, evaluation_document


@pytest.fixture
def stored(evaluations, tmp_path):
    """A document in a file, and a function that changes it there."""
    path = tmp_path / "evaluation.json"
    document = json.loads(json.dumps(evaluation_document(evaluations, "")))

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
    assert document.result("made-right", None)["policy"] == "made-right-seed0"


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda d: d.pop("results"), "it lacks 'results'"),
        (lambda d: d["protocol"].pop("seed"), "protocol lacks 'seed'"),
        (
            lambda d: d["protocol"]["problems"]["left"].pop("goals"),
            "protocol.problems.left lacks 'goals'",
        ),
        (lambda d: d["protocol"]["problems"]["left"]["goals"].append([1]), "goals of 'left'"),
        (lambda d: d["results"][2].update(problem="up"), "results.2 is of no known problem: 'up'"),
        (
            lambda d: d["results"][1]["outcomes"]["steps"].pop(),
            "results.1 has .* different lengths",
        ),
        (lambda d: d["results"].insert(0, 3), "results.0 is no object"),
        (lambda d: d.update(results={}), "results is of the wrong kind"),
        (lambda d: d["protocol"].update(problems=[]), "protocol.problems is no object"),
        (
            lambda d: d["protocol"]["problems"]["left"]["goals"][0].__setitem__(0, 10**400),
            "goals of 'left' must be numbers: int too large",
        ),
        (lambda d: d["protocol"].update(format_version=9), "format version 9; this kinarm reads"),
    ],
)
def test_a_damaged_document_is_refused_with_the_place(stored, change, words):
    with pytest.raises(InvalidInputError, match=rf"evaluation\.json' .*{words}"):
        EvaluationDocument.load(stored(change))


def test_a_problem_that_has_changed_is_refused(stored):
    """By its hash, or by what is wrong with it."""

    def changed(**task):
        return stored(lambda d: d["protocol"]["problems"]["left"]["problem"]["task"].update(task))

    with pytest.raises(InvalidInputError, match="do not match their hash"):
        EvaluationDocument.load(changed(tolerance=0.2)).trials("left")
    with pytest.raises(InvalidInputError, match=r"problem left: task.horizon must be a whole"):
        EvaluationDocument.load(changed(horizon="64")).trials("left")


class TestChoosing:
    """Results of one document, by policy and problem."""

    @pytest.fixture
    def document(self):
        names = [("zero", "left", None), ("a-seed0", "left", "left"), ("a-seed1", "left", "left")]
        names += [("a-seed0", "right", "left")]
        rows = [dict(zip(("policy", "problem", "trained_on"), row, strict=True)) for row in names]
        members = {("a", "left"): ["a-seed0", "a-seed1"], ("a", "right"): ["a-seed0"]}
        return EvaluationDocument("made.json", {}, rows, members)

    def test_by_name_and_by_group(self, document):
        assert document.result("a-seed1", "left")["policy"] == "a-seed1"
        assert document.result("a", "right") is document.results[3]
        assert document.result("a", None) is document.results[1]

    def test_the_only_one_that_was_trained_needs_no_name(self, document):
        assert document.result(None, "right") is document.results[3]

    def test_several_are_named(self, document):
        with pytest.raises(InvalidInputError) as caught:
            document.result(None, "left")
        assert str(caught.value).endswith("a-seed0 on left, a-seed1 on left")

    def test_none_on_this_problem(self, document):
        with pytest.raises(InvalidInputError, match="none on this problem"):
            document.result(None, "both")

    def test_an_unknown_policy_is_told_what_there_is(self, document):
        with pytest.raises(UnknownNameError) as caught:
            document.result("b", "left")
        assert caught.value.available == ("zero", "a-seed0", "a-seed1")

    def test_says_what_it_holds(self, document):
        assert repr(document) == "EvaluationDocument('made.json', 4 results)"


@pytest.mark.parametrize(
    ("value", "said"),
    [
        ({}, "results is no list"),
        ([{"steps": 3}, 4], "results.1 is no object"),
        ([{}], "results.0 lacks 'steps'"),
        ([{"steps": "3"}], "results.0.steps is of the wrong kind"),
    ],
)
def test_the_first_place_that_is_wrong_is_named(value, said):
    with pytest.raises(InvalidInputError, match=f"^{said}$"):
        check_shape(value, {ENTRY: {"steps": int}}, "results")
