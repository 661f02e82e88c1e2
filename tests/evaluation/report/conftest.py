"""A report of several policies, seeds and tasks."""

import pytest

from kinarm.evaluation.bounds import oracle_bounds
from kinarm.evaluation.contestants import ORACLE
from kinarm.evaluation.evaluation import run_trials
from kinarm.evaluation.report.groups import group_results
from kinarm.evaluation.report.page import report_page
from kinarm.evaluation.summary import evaluation_document


@pytest.fixture(scope="module")
def faced(bounded_evaluations):
    """Several policies, seeds and tasks, the baseline and the oracle."""
    trial_sets = {each.problem.name: each.trials for each in bounded_evaluations}
    oracle = [
        run_trials(ORACLE, trials, bounds=oracle_bounds(trials)) for trials in trial_sets.values()
    ]
    return [*bounded_evaluations, *oracle]


@pytest.fixture(scope="module")
def document(faced):
    return evaluation_document(faced, "kinarm-eval --report 'my results'")


@pytest.fixture(scope="module")
def page(document, faced) -> str:
    return report_page(document, faced)


@pytest.fixture(scope="module")
def tasks(document, faced):
    return {task.name: task for task in group_results(document, faced)}


@pytest.fixture(scope="module")
def right(tasks):
    return tasks["right"]
