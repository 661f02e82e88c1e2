"""Documents are as their schemas say: recorded ones, and those that are made here."""

import ast
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
from kinarm.evaluation.ranking import ranking
from kinarm.problem import ReachProblem
from kinarm.problem_files import shipped_files

jsonschema = pytest.importorskip("jsonschema")

ROOT = Path(__file__).resolve().parents[2]
RECORDED = {
    "benchmark": "data/results/speed/speed.json",
    "claims": "data/results/claims.json",
    "comparison": "data/results/*/learners.json",
    "compared-run": "data/results/*/runs/*.json",
    "ranking": "data/policies/ranking.json",
    "training-times": "data/results/timing.json",
}

WRITERS = {
    "evaluation/commands/bench.py": "benchmark",
    "evaluation/commands/evaluate.py": "evaluation",
    "evaluation/commands/problem.py": "problem-check",
    "evaluation/comparison/document.py": "comparison",
    "evaluation/comparison/runs.py": "compared-run",
    "evaluation/ranking.py": "ranking",
    "evaluation/reproduction/document.py": "claims",
    "evaluation/request.py": "evaluation",
    "evaluation/studies/store.py": "failed-training",
    "evaluation/studies/transfer/__main__.py": "transfer",
}
"""Modules that write documents, and a schema of each."""

NO_DOCUMENT = {
    "evaluation/commands/reproduce.py": "a marker with one word",
    "evaluation/document.py": "makes text of what others write",
    "evaluation/report/svg.py": "names parts of a drawing",
    "evaluation/reproduction/runs.py": "a list of seconds, and an archive's header",
    "evaluation/studies/planning.py": "is hashed",
    "evaluation/studies/transfer/planning.py": "is hashed",
    "evaluation/studies/transfer/runs.py": "counts beside a policy",
    "evaluation/training_seeds.py": "is compared",
    "kinarm/_archive.py": "an archive's header",
    "kinarm/envs/environment.py": "asks whether something can be written",
    "kinarm/problem.py": "is hashed",
    "kinarm/viewer/html_page.py": "data of a page",
    "kinarm/viewer/mesh_files.py": "is hashed",
    "policies/checkpoint.py": "an archive's header",
    "policies/provenance.py": "an archive's header",
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
    return request.run(command="a test")


def test_an_evaluation(evaluation):
    check(evaluation, "evaluation")


@pytest.mark.parametrize("name", shipped_files("problems"))
def test_an_evaluation_of_any_problem(name):
    problem = ReachProblem.load(name)
    if problem.arm.name not in ("paper", "paper_flange") and not is_installed():
        pytest.skip("needs the extra robots")
    trials = TrialSet.draw(problem, 3, seed=0)
    (contestant,) = find_contestants("zero")
    check(evaluation_document([run_trials(contestant, trials)], "a test"), "evaluation")


def test_a_ranking():
    check(ranking(["ars-tuned-both-seed0"], trials=5), "ranking")


@pytest.mark.parametrize(
    "spoil",
    [
        lambda document: document["results"][0].pop("metrics"),
        lambda document: document["results"][0].update(surprise=1),
        lambda document: document["protocol"]["problems"]["right"].update(digest="?"),
        lambda document: document["results"][0]["metrics"]["success"].update(value="much"),
    ],
)
def test_what_a_schema_does_not_say_is_refused(evaluation, spoil):
    spoilt = copy.deepcopy(evaluation)
    spoil(spoilt)
    with pytest.raises(AssertionError):
        check(spoilt, "evaluation")


def test_every_module_that_writes_json_has_a_schema():
    """Whoever calls ``json.dumps`` or ``document_text`` writes a document, or says what else."""
    writing = set()
    for folder in ("kinarm", "policies", "evaluation"):
        for path in (ROOT / folder).rglob("*.py"):
            for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
                name = isinstance(node, ast.Call) and ast.unparse(node.func)
                if name in ("json.dumps", "document_text"):
                    writing.add(path.relative_to(ROOT).as_posix())
    assert writing == WRITERS.keys() | NO_DOCUMENT.keys()
    assert set(WRITERS.values()) <= set(schema_names())
