"""Documents are as their schemas say: recorded ones, and those that are made here."""

import copy
import json
from pathlib import Path

import pytest
from known_arms import is_installed

from kinarm.errors import UnknownNameError
from kinarm.evaluation import (
    EvaluationRequest,
    TrialSet,
    document_schema,
    evaluation_document,
    find_contestants,
    schema_names,
)
from kinarm.evaluation.evaluation import run_trials
from kinarm.problem import ReachProblem
from kinarm.problem_files import shipped_files

jsonschema = pytest.importorskip("jsonschema")

ROOT = Path(__file__).resolve().parents[2]
RECORDED = {
    "benchmark": "data/results/speed/speed.json",
    "claims": "data/results/claims.json",
    "comparison": "data/results/*/learners.json",
}


def check(document: object, name: str) -> None:
    """Fail with the places where a document differs from its schema."""
    validator = jsonschema.Draft202012Validator(document_schema(name))
    plain = json.loads(json.dumps(document, allow_nan=False))
    found = [f"{each.json_path}: {each.message[:200]}" for each in validator.iter_errors(plain)]
    assert found == []


@pytest.mark.parametrize("name", schema_names())
def test_schemas_are_schemas_and_describe_themselves(name):
    schema = document_schema(name)
    jsonschema.Draft202012Validator.check_schema(schema)
    assert schema["title"]
    assert schema["description"].endswith(".")
    assert "definitions.json" not in json.dumps(schema)


def test_an_unknown_document_is_refused():
    with pytest.raises(UnknownNameError, match="unknown document 'evalution'; available: bench"):
        document_schema("evalution")


@pytest.mark.parametrize("name", RECORDED)
def test_recorded_documents(name):
    paths = sorted(ROOT.glob(RECORDED[name]))
    assert paths
    for path in paths:
        check(json.loads(path.read_text()), name)


@pytest.fixture(scope="module")
def evaluation():
    request = EvaluationRequest(
        policies=("ars-tuned-both", "random"), problem="right", trials=12, hold=True
    )
    return request.run(command="a test").to_json()


def test_an_evaluation(evaluation):
    check(evaluation, "evaluation")


@pytest.mark.parametrize("name", shipped_files("problems"))
def test_an_evaluation_of_any_problem(name):
    problem = ReachProblem.load(name)
    if problem.arm.name not in ("paper", "paper_flange") and not is_installed():
        pytest.skip("needs the extra robots")
    trials = TrialSet.draw(problem, 3, seed=0)
    (contestant,) = find_contestants("zero")
    document = evaluation_document([run_trials(contestant, trials)], "a test")
    check(document.to_json(), "evaluation")


@pytest.mark.parametrize(
    "spoil",
    [
        lambda document: document["results"][0].pop("metrics"),
        lambda document: document["results"][0].update(surprise=1),
        lambda document: document["protocol"]["problems"]["right"].update(digest="?"),
        lambda document: document["results"][0]["metrics"]["success"].update(value="much"),
        lambda document: document["results"][0].pop("outcomes"),
    ],
)
def test_what_a_schema_does_not_say_is_refused(evaluation, spoil):
    spoilt = copy.deepcopy(evaluation)
    spoil(spoilt)
    with pytest.raises(AssertionError):
        check(spoilt, "evaluation")


def test_a_schema_says_what_fields_mean():
    schema = document_schema("evaluation")
    goals = schema["$defs"]["FacedProblem"]["properties"]["goals"]
    assert goals["description"] == "Positions, (trials, 3) [m]."
    assert schema["$defs"]["Result"]["description"] == "One policy on one problem."
    assert "hash" in schema["$defs"]["FacedProblem"]["properties"]["digest"]["description"].lower()
