"""The paper's figures 2 and 3, and learning curves."""

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from kinarm.evaluation.bounds import oracle_bounds
from kinarm.evaluation.figures import BIN_WIDTH, COLOURS
from kinarm.evaluation.reproduction.outcome import Outcome
from kinarm.evaluation.reproduction.results import Results
from kinarm.evaluation.reproduction.study import LEARNERS, WITHIN, Purpose
from kinarm.task import TASKS

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

STYLES: dict[Purpose, dict[str, Any]] = {
    "ars": {"label": LEARNERS["ars"], "color": COLOURS[0], "linestyle": "solid"},
    "ppo": {"label": LEARNERS["ppo"], "color": COLOURS[1], "linestyle": "dashed"},
}
"""How lines of a learner look; its seeds are drawn thin and faint in the same colour."""

SHOWN_DISTANCE = 1.2
"""Where the axes of final distances end [m]."""

NARROWEST = 0.005
"""Least bandwidth of a density [m]."""


def figure_2(results: Results) -> "Figure":
    """Training rewards and final distances of ARS, a row per task (paper, Figure 2)."""
    figure, panels = _panels((9.0, 8.4), len(TASKS), 2, sharex="col", sharey="col")
    for number, (task, row) in enumerate(zip(TASKS, panels, strict=True), start=1):
        outcomes = tuple(results.select("ars", task).values())
        _rewards(row[0], outcomes)
        _histograms(row[1], outcomes)
        row[0].set_ylabel(f"task {number}: {task}\nmean return of an iteration")
        row[1].set_ylabel(f"share of trials per {BIN_WIDTH} m")
    panels[0, 0].legend(frameon=False, loc="lower right")
    panels[-1, 0].set_xlabel("iteration")
    panels[-1, 1].set(xlabel="final distance to the goal [m]", xlim=(0, SHOWN_DISTANCE))
    return figure


def _rewards(axes: "Axes", outcomes: Sequence[Outcome]) -> None:
    """Mean returns of the seeds in colour, and their mean in black."""
    for number, outcome in enumerate(outcomes):
        label = f"seed {number}"
        axes.plot(_iterations(outcome), outcome.returns, color=COLOURS[number], lw=0.6, label=label)
    mean = np.mean([outcome.returns for outcome in outcomes], axis=0)
    axes.plot(_iterations(outcomes[0]), mean, color="black", lw=1.6, label="mean")


def _iterations(outcome: Outcome) -> NDArray[np.int64]:
    return np.arange(1, len(outcome.returns) + 1)


def _histograms(axes: "Axes", outcomes: Sequence[Outcome]) -> None:
    """Histograms of the seeds' final distances, with the share within 0.2 m."""
    edges = np.arange(0.0, SHOWN_DISTANCE + BIN_WIDTH, BIN_WIDTH)
    for number, outcome in enumerate(outcomes):
        shares = np.histogram(outcome.distance, edges)[0] / len(outcome.distance)
        within = np.mean(outcome.distance <= WITHIN)
        label = f"seed {number}: {within:.0%} within {WITHIN} m"
        axes.stairs(shares, edges, color=COLOURS[number], lw=1.3, label=label)
    axes.axvline(WITHIN, color="#444444", linestyle=":", lw=1)
    axes.legend(frameon=False, fontsize=8)


def figure_3(results: Results) -> "Figure":
    """Densities of the final distances of ARS and PPO, a row per task (paper, Figure 3).

    The oracle's is drawn behind them: what could be reached. Heights are square roots, so that
    broad and narrow densities can be told apart beside each other.
    """
    figure, panels = _panels((7.5, 8.4), len(TASKS), 1, sharex=True)
    for number, (task, axes) in enumerate(zip(TASKS, panels[:, 0], strict=True), start=1):
        distance = np.linspace(0.0, SHOWN_DISTANCE, 481)
        highest = 0.0
        for learner, style in STYLES.items():
            seeds = [density(o.distance, distance) for o in results.select(learner, task).values()]
            if not seeds:
                continue
            axes.plot(distance, np.transpose(seeds), color=style["color"], lw=0.6, alpha=0.5)
            axes.plot(distance, np.mean(seeds, axis=0), lw=2.2, **style)
            highest = max(highest, float(np.max(seeds)))
        trials = results.trials(task)
        reached = oracle_bounds(trials).final_distance
        axes.fill_between(
            distance, density(reached, distance), color="#bbbbbb", lw=0, label="oracle (cut off)"
        )
        axes.axvline(trials.simulator.task.tolerance, color="#444444", linestyle=":", lw=1)
        axes.set_yscale("function", functions=(np.sqrt, np.square))
        axes.set(ylabel=f"task {number}: {task}\ndensity [1/m]", ylim=(0, 1.1 * highest))
    panels[0, 0].legend(frameon=False)
    panels[-1, 0].set(xlabel="final distance to the goal [m]", xlim=(0, SHOWN_DISTANCE))
    return figure


def density(samples: NDArray[np.float64], positions: NDArray[np.float64]) -> NDArray[np.float64]:
    """Kernel density of distances, reflected at zero so that none is lost below it.

    The kernel is normal, with Silverman's robust bandwidth: a few trials that end far away must
    not blur where the many end.

    Parameters
    ----------
    samples : ndarray, shape (n,)
        Distances [m].
    positions : ndarray, shape (m,)
        Where to evaluate it [m].

    Returns
    -------
    ndarray, shape (m,)
        Densities [1/m]; their integral over positive distances is 1.
    """
    from scipy.stats import iqr, norm

    spread = min(float(samples.std()), float(iqr(samples)) / 1.349)
    bandwidth = max(0.9 * spread * len(samples) ** -0.2, NARROWEST)
    reflected = np.concatenate([samples, -samples])
    kernels = norm.pdf(positions[:, None], loc=reflected, scale=bandwidth)
    values: NDArray[np.float64] = kernels.sum(axis=1) / len(samples)
    return values


def learning_curves(results: Results, against: str) -> "Figure":
    """How well policies do in the course of their training, a column per task.

    Parameters
    ----------
    results : Results
        All outcomes.
    against : {"steps", "time"}
        Whether progress is shown against environment steps or against wall time.
    """
    figure, panels = _panels((10.5, 6.4), 2, len(TASKS), sharex=True, sharey="row")
    across = _steps if against == "steps" else _seconds
    for task, (above, below) in zip(TASKS, panels.T, strict=True):
        for learner, style in STYLES.items():
            outcomes = tuple(results.select(learner, task).values())
            _curves(above, outcomes, across, _share_within, style)
            _curves(below, outcomes, across, _median, style)
        above.set_title(f"task {task}")
        below.set(xlabel="million environment steps" if against == "steps" else "training time [s]")
        if against == "time":
            below.set_xscale("log")
    panels[0, 0].set(ylabel=f"share of trials within {WITHIN} m", ylim=(0, 1))
    panels[1, 0].set(ylabel="median final distance [m]", ylim=(0, None))
    panels[0, 0].legend(frameon=False)
    return figure


def _curves(
    axes: "Axes",
    outcomes: Sequence[Outcome],
    across: Callable[[Outcome], NDArray[np.float64]],
    up: Callable[[Outcome], NDArray[np.float64]],
    style: dict[str, Any],
) -> None:
    """Curves of the seeds faintly, and the mean of what they do at the same iteration boldly."""
    for outcome in outcomes:
        axes.plot(across(outcome), up(outcome), color=style["color"], lw=0.6, alpha=0.5)
    if outcomes:
        mean = (np.mean([part(o) for o in outcomes], axis=0) for part in (across, up))
        axes.plot(*mean, lw=2, **style)


def _steps(outcome: Outcome) -> NDArray[np.float64]:
    return outcome.snapshot_steps / 1e6


def _seconds(outcome: Outcome) -> NDArray[np.float64]:
    return outcome.wall_time[outcome.snapshots]


def _share_within(outcome: Outcome) -> NDArray[np.float64]:
    share: NDArray[np.float64] = (outcome.snapshot_distance <= WITHIN).mean(axis=1)
    return share


def _median(outcome: Outcome) -> NDArray[np.float64]:
    median: NDArray[np.float64] = np.median(outcome.snapshot_distance, axis=1)
    return median


def _panels(
    size: tuple[float, float], rows: int, columns: int, **shared: Any
) -> "tuple[Figure, NDArray[np.object_]]":
    """A figure and its panels, shape (rows, columns), without top and right spines."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=size, layout="constrained")
    panels = figure.subplots(rows, columns, squeeze=False, **shared)
    for axes in panels.flat:
        axes.spines[["top", "right"]].set_visible(False)
    return figure, panels
