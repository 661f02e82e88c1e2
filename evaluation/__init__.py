"""Evaluation: trials that every policy faces alike, statistics, figures and command lines."""

from typing import TYPE_CHECKING

from kinarm._exports import lazy_exports

if TYPE_CHECKING:
    from kinarm.evaluation.bounds import oracle_bounds
    from kinarm.evaluation.document import EvaluationDocument, evaluation_document
    from kinarm.evaluation.entrants import Entrant, find_entrants
    from kinarm.evaluation.evaluation import Evaluation, PooledEvaluation, evaluate, pool
    from kinarm.evaluation.figures import distance_histograms, save_figure
    from kinarm.evaluation.metrics import METRICS, Metric, Outcomes
    from kinarm.evaluation.replays.recorder import record
    from kinarm.evaluation.report.page import report_page, write_report
    from kinarm.evaluation.statistics import Estimate
    from kinarm.evaluation.trials import TrialSet

__all__ = [
    "METRICS",
    "Entrant",
    "Estimate",
    "Evaluation",
    "EvaluationDocument",
    "Metric",
    "Outcomes",
    "PooledEvaluation",
    "TrialSet",
    "distance_histograms",
    "evaluate",
    "evaluation_document",
    "find_entrants",
    "oracle_bounds",
    "pool",
    "record",
    "report_page",
    "save_figure",
    "write_report",
]


def __dir__() -> list[str]:
    return __all__


__getattr__ = lazy_exports(
    __name__,
    {
        "bounds": ("oracle_bounds",),
        "document": ("EvaluationDocument", "evaluation_document"),
        "entrants": ("Entrant", "find_entrants"),
        "evaluation": ("Evaluation", "PooledEvaluation", "evaluate", "pool"),
        "figures": ("distance_histograms", "save_figure"),
        "metrics": ("METRICS", "Metric", "Outcomes"),
        "replays.recorder": ("record",),
        "report.page": ("report_page", "write_report"),
        "statistics": ("Estimate",),
        "trials": ("TrialSet",),
    },
)
