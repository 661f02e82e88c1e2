"""Evaluation: trials that every policy faces alike, statistics, figures and command lines."""

from typing import TYPE_CHECKING

from kinarm._exports import lazy_exports

if TYPE_CHECKING:
    from kinarm.evaluation.bounds import oracle_bounds
    from kinarm.evaluation.entrants import Entrant, find_entrants
    from kinarm.evaluation.evaluations import Evaluation, PooledEvaluation, evaluate, pool
    from kinarm.evaluation.html_report.page import report_page, write_report
    from kinarm.evaluation.plots import distance_histograms, save_figure
    from kinarm.evaluation.replays.recorder import record
    from kinarm.evaluation.report import evaluation_document
    from kinarm.evaluation.statistics import DistanceStatistics, Share
    from kinarm.evaluation.trials import TrialSet

__all__ = [
    "DistanceStatistics",
    "Entrant",
    "Evaluation",
    "PooledEvaluation",
    "Share",
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
        "entrants": ("Entrant", "find_entrants"),
        "evaluations": ("Evaluation", "PooledEvaluation", "evaluate", "pool"),
        "html_report.page": ("report_page", "write_report"),
        "plots": ("distance_histograms", "save_figure"),
        "replays.recorder": ("record",),
        "report": ("evaluation_document",),
        "statistics": ("DistanceStatistics", "Share"),
        "trials": ("TrialSet",),
    },
)
