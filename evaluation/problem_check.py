"""Checks of a problem before a training: reachable goals, free starts, contact, symmetry."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from kinarm.contact_pairs import random_configurations
from kinarm.contact_statistics import SAMPLES, ContactStatistics
from kinarm.evaluation.bounds import oracle_bounds
from kinarm.evaluation.outcomes import Pair
from kinarm.evaluation.report.templating import template
from kinarm.evaluation.statistics import Estimate
from kinarm.evaluation.trials import TrialSet
from kinarm.policies.mirror import missing_mirror
from kinarm.policies.oracle import Progress
from kinarm.world import World


@dataclass(frozen=True, kw_only=True)
class ProblemCheck:
    """Findings about a problem; ``str()`` is a text about them.

    Attributes
    ----------
    trials : int
        Trials that the oracle faced.
    reached, out_of_reach, undecided : Estimate
        Shares of them that it reaches, proves out of reach, or neither.
    starts : int
        Starts that were tested: random ones, unless the task lists its starts.
    free_starts : Estimate
        Share of them that touches nothing.
    home_contact : Pair or None
        What touches at home.
    configurations : int
        Random configurations that were tested.
    touching : list
        Pairs of bodies, and at which share of the configurations they touch.
    mirror : str
        Why arm and obstacles are not their own mirror image; empty if they are.
    """

    trials: int
    reached: Estimate
    out_of_reach: Estimate
    undecided: Estimate
    starts: int
    free_starts: Estimate
    home_contact: Pair | None
    configurations: int
    touching: list[tuple[str, str, float]]
    mirror: str

    def __str__(self) -> str:
        return template("problem_check.txt").render(vars(self)).rstrip()


def check_problem(
    world: World, trials: int = 200, seed: int = 0, on_progress: Progress | None = None
) -> ProblemCheck:
    """Check a problem; one whose arm cannot move or start is refused.

    Parameters
    ----------
    world : World
        The world of the problem.
    trials, seed : int
        Number of trials that the oracle faces, and their seed.
    on_progress : callable, optional
        Called with the number of trials solved so far and in all.
    """
    q, starts = random_configurations(world.arm, SAMPLES), random_starts(world)
    scenes = list(_some_scenes(world, q))
    contact = ContactStatistics.sample(world.contact_model, scenes=scenes)
    contact.check_movable(world.arm.name)
    free_starts = ~world.screen(starts, _some_scenes(world, starts))[1]
    # Goals are reached by the oracle, or proven out of reach within the horizon.
    solutions = oracle_bounds(TrialSet.draw(world.problem, trials, seed), on_progress)
    reached = solutions.reachable
    out_of_reach = solutions.steps_lower_bound > world.problem.task.horizon
    return ProblemCheck(
        trials=trials,
        reached=Estimate.share(reached),
        out_of_reach=Estimate.share(out_of_reach),
        undecided=Estimate.share(~(reached | out_of_reach)),
        starts=len(free_starts),
        free_starts=Estimate.share(free_starts),
        home_contact=world.contact_model.contact_pair(world.arm.home),
        configurations=len(contact.free),
        touching=[(*pair, share) for pair, share in contact.shares.items()],
        mirror=missing_mirror(world.problem),
    )


def _some_scenes(world: World, starts: NDArray[np.float64]) -> NDArray[np.float64]:
    """A scene of each start, if there are random bodies, with a random goal."""
    return world.scenes_of(starts, world.goals.draw(np.random.default_rng(0), len(starts)))


def random_starts(world: World) -> NDArray[np.float64]:
    """Configurations that the task may start at, free or not."""
    task, home = world.problem.task, world.arm.home
    if task.starts:
        return world.starts
    q = random_configurations(world.arm, 2000, seed=1)
    starts: NDArray[np.float64] = home + task.start_spread * (q - home)
    return starts
