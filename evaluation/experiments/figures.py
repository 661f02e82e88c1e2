"""Figures of an experiment."""

from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from kinarm.evaluation.experiments.curve import CurvePoint
from kinarm.evaluation.experiments.plan import Run
from kinarm.evaluation.experiments.results import Group, identity, shorter, shown, timed_curve
from kinarm.evaluation.figures import COLOURS, DASHES, draw_band
from kinarm.evaluation.statistics import Estimate, share_over_seeds

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from kinarm.evaluation.experiments.study import Study

LINES, BARS = 8, 24
"""How many groups of trainings a figure shows of a problem, the best ones."""


def draw_all(study: "Study") -> dict[str, "Figure"]:
    """All figures that a study has something for, by name."""
    figures = {
        "learning_curves": learning_curves(study),
        "effects": effects(study),
        "beside_bound": beside_bound(study),
    }
    return {name: figure for name, figure in figures.items() if figure is not None}


def _by_problem(study: "Study") -> dict[str, list[Group]]:
    """Groups of each problem, best first."""
    found: dict[str, list[Group]] = {}
    for group in sorted(study.groups(), key=lambda each: -(each.success.value or 0)):
        found.setdefault(group.config.problem.name, []).append(group)
    return found


def learning_curves(study: "Study") -> "Figure | None":
    """Success in the course of the training, against environment steps and against wall time.

    A row per problem; lines are means over the training seeds, bands reach from the worst of them
    to the best. Dotted is what the oracle reaches. None if nobody looked during the trainings.
    """
    from matplotlib.figure import Figure
    from matplotlib.ticker import NullFormatter

    problems = {
        name: [group for group in groups if any(run.curve for run in group.runs)][:LINES]
        for name, groups in _by_problem(study).items()
    }
    problems = {name: groups for name, groups in problems.items() if groups}
    if not problems:
        return None
    size = (10.0, 1.2 + 3.2 * len(problems))
    figure = Figure(figsize=size, layout="constrained")
    panels = figure.subplots(len(problems), 2, squeeze=False, sharey=True)
    for (problem, groups), (steps, seconds) in zip(problems.items(), panels, strict=True):
        for number, group in enumerate(groups):
            curves = [
                timed_curve(run, clock) for run, clock in zip(group.runs, group.clocks, strict=True)
            ]
            for axes, against in ((steps, _steps_of), (seconds, _seconds_of)):
                _band(axes, [_line(curve, against) for curve in curves], group.label, number)
        for axes in (steps, seconds):
            axes.axhline(groups[0].reachable, color="#444444", linestyle=":", lw=1)
            axes.set(ylim=(0, 1.02), title=problem, xscale="log")
            axes.xaxis.set_minor_formatter(NullFormatter())
            axes.spines[["top", "right"]].set_visible(False)
        steps.set_ylabel("share of trials with success")
        steps.legend(frameon=False, fontsize=8, loc="upper left")
    panels[-1, 0].set_xlabel("environment steps")
    panels[-1, 1].set_xlabel("wall time of the training [s]")
    return figure


TimedPoint = tuple[CurvePoint, float, float]


def _steps_of(point: TimedPoint) -> float:
    return float(point[0].environment_steps)


def _seconds_of(point: TimedPoint) -> float:
    return point[1]


def _line(
    curve: Sequence[TimedPoint], against: Callable[[TimedPoint], float]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Success against steps or seconds."""
    return np.array([*map(against, curve)]), np.array([point.success for point, *_ in curve])


def _band(
    axes: "Axes",
    curves: Sequence[tuple[NDArray[np.float64], NDArray[np.float64]]],
    label: str,
    number: int,
) -> None:
    """Draw the mean of curves, and the band between the lowest and the highest."""
    curves = [(x, y) for x, y in curves if len(x) and np.isfinite(x).all() and x[-1] > 0]
    if not curves:
        return
    first = max(max(x[0] for x, _ in curves), 1e-3)
    places = np.geomspace(first, max(first, min(x[-1] for x, _ in curves)), 200)
    heights = np.array([np.interp(places, x, y) for x, y in curves])
    colour, dash = COLOURS[number % len(COLOURS)], DASHES[number // len(COLOURS) % len(DASHES)]
    draw_band(axes, places, heights, label, colour, dash)


def effects(study: "Study") -> "Figure | None":
    """Success by the value of each field that varies, a panel per field.

    What is shown of a value is the mean over everything else that varies, with its 95 % interval
    over seeds and trials; fields that were drawn from a range are shown training by training.
    None if nothing varies.
    """
    from matplotlib.figure import Figure

    fields = _varying(study)
    if not fields:
        return None
    columns = min(3, len(fields))
    rows = -(-len(fields) // columns)
    figure = Figure(figsize=(0.6 + 3.6 * columns, 0.4 + 3.0 * rows), layout="constrained")
    panels = figure.subplots(rows, columns, squeeze=False, sharey=True)
    for field, axes in zip(fields, panels.flat, strict=False):
        _draw_effect(axes, study, field)
    for axes in list(panels.flat)[len(fields) :]:
        axes.set_visible(False)
    for row in panels:
        row[0].set_ylabel("share of trials with success")
    return figure


def _settings(run: Run) -> dict[str, Any]:
    """What can vary of a training, by field."""
    return {**{k: v for k, v in identity(run).items() if k != "seed"}, **run.choices}


def _varying(study: "Study") -> dict[str, list[Any]]:
    """Fields with more than one value among the finished trainings, and their values."""
    found: dict[str, list[Any]] = {}
    for run in study.finished:
        for field, value in _settings(run).items():
            values = found.setdefault(field, [])
            if value not in values:
                values.append(value)
    return {field: values for field, values in found.items() if len(values) > 1}


def _draw_effect(axes: "Axes", study: "Study", field: str) -> None:
    """Draw the success of each value of a field."""
    runs: dict[str, list[Run]] = {}
    values: dict[str, Any] = {}
    for run in study.finished:
        settings = _settings(run)
        if field in settings:
            name = shown(settings[field])
            values[name] = settings[field]
            runs.setdefault(name, []).append(run)
    numeric = all(isinstance(v, int | float) and not isinstance(v, bool) for v in values.values())
    names = sorted(values, key=lambda name: values[name]) if numeric else list(values)
    places: Mapping[str, float] = {name: float(number) for number, name in enumerate(names)}
    if numeric:
        places = {name: float(values[name]) for name in names}
        low, high = min(places.values()), max(places.values())
        if low > 0 and high / low >= 10:
            axes.set_xscale("log")
    drawn = (*study.experiment.random, *study.experiment.search)
    if field in drawn and numeric:
        for name in names:
            for run in runs[name]:
                share = study.finished[run].outcomes.success.mean()
                axes.plot(places[name], share, "o", color=COLOURS[0], alpha=0.5, ms=4)
    else:
        for name in names:
            mean = _mean_success(study, runs[name])
            axes.errorbar(
                *(places[name], mean.value or 0.0),
                yerr=_whiskers(mean),
                fmt="o",
                color=COLOURS[0],
                capsize=3,
            )
        if not numeric or len(names) <= 6:
            axes.set_xticks([places[name] for name in names], names, rotation=0 if numeric else 20)
            axes.minorticks_off()
    axes.margins(x=0.2)
    axes.set(title=shorter(field), ylim=(0, 1.02))
    axes.spines[["top", "right"]].set_visible(False)


def _mean_success(study: "Study", runs: Sequence[Run]) -> Estimate:
    """Mean success over everything but the seed, and its interval over seeds and trials."""
    by_seed: dict[int, list[NDArray[np.float64]]] = {}
    for run in runs:
        hits = study.finished[run].outcomes.success.astype(np.float64)
        by_seed.setdefault(run.config.seed, []).append(hits)
    return share_over_seeds(np.array([np.mean(each, axis=0) for each in by_seed.values()]))


def _whiskers(estimate: Estimate) -> list[list[float]]:
    """Lengths of the interval below and above the value."""
    value = float(estimate.value or 0.0)
    low, high = estimate.ci95 or (value, value)
    return [[max(value - low, 0.0)], [max(high - value, 0.0)]]


def beside_bound(study: "Study") -> "Figure | None":
    """Success of each group with its 95 % interval, beside what the oracle reaches."""
    from matplotlib.figure import Figure

    problems = {name: groups[:BARS] for name, groups in _by_problem(study).items()}
    if not problems:
        return None
    heights = [0.6 + 0.28 * len(groups) for groups in problems.values()]
    figure = Figure(figsize=(8.0, 0.6 + sum(heights)), layout="constrained")
    panels = figure.subplots(len(problems), 1, squeeze=False, height_ratios=heights)[:, 0]
    for (problem, groups), axes in zip(problems.items(), panels, strict=True):
        for row, group in enumerate(groups):
            share = float(group.success.value or 0)
            axes.barh(row, share, height=0.62, color=COLOURS[0], alpha=0.35)
            whiskers = _whiskers(group.success)
            axes.errorbar(share, row, xerr=whiskers, fmt="|", color=COLOURS[0], capsize=3)
        axes.axvline(groups[0].reachable, color="#444444", linestyle=":", lw=1.2)
        axes.set_yticks(range(len(groups)), [group.label for group in groups], fontsize=8)
        axes.invert_yaxis()
        axes.set(xlim=(0, 1.02), title=problem)
        axes.spines[["top", "right"]].set_visible(False)
    panels[-1].set_xlabel("share of trials with success; dotted: what the oracle reaches")
    return figure
