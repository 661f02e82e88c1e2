"""Documents are as their schemas say: those that are made here."""

import json

import msgspec
import pytest
from known_arms import is_installed

from kinarm.evaluation import (
    EvaluationDocument,
    EvaluationRequest,
    TrialSet,
    evaluation_document,
    find_contestants,
)
from kinarm.evaluation.evaluation import run_trials
from kinarm.problem import ReachProblem

jsonschema = pytest.importorskip("jsonschema")


def check(document: object) -> None:
    """Fail with the places where a document differs from its schema."""
    validator = jsonschema.Draft202012Validator(msgspec.json.schema(EvaluationDocument))
    plain = json.loads(json.dumps(document, allow_nan=False))
    found = [f"{each.json_path}: {each.message[:200]}" for each in validator.iter_errors(plain)]
    assert found == []


@pytest.fixture(scope="module")
def evaluation():
    request = EvaluationRequest(
        policies=("ars-tuned-both", "random"), problem="right", trials=12, hold=True
    )
    return request.run(command="a test").to_json()


def test_an_evaluation(evaluation):
    check(evaluation)


@pytest.mark.parametrize(
    "name",
    ["right", "pose-ur5", "obstacles-ur5", pytest.param("hard-paper", marks=pytest.mark.rare)],
)
def test_an_evaluation_of_other_kinds_of_problems(name):
    problem = ReachProblem.load(name)
    if problem.arm.name not in ("paper", "paper_flange") and not is_installed():
        pytest.skip("needs the extra robots")
    trials = TrialSet.draw(problem, 3, seed=0)
    (contestant,) = find_contestants("zero")
    document = evaluation_document([run_trials(contestant, trials)], "a test")
    check(document.to_json())
