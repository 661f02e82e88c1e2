"""Checks of a problem before a training: reachable goals, free starts, contact, symmetry."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from kinarm.clearance import SAMPLES, ContactStatistics, random_configurations
from kinarm.evaluation.bounds import oracle_bounds
from kinarm.evaluation.outcomes import Pair
from kinarm.evaluation.report.templating import template_environment
from kinarm.evaluation.schemas import Count, Digest, Document, Goal
from kinarm.evaluation.statistics import Estimate
from kinarm.evaluation.trials import TrialSet
from kinarm.policies.mirror import missing_mirror
from kinarm.policies.oracle import Progress
from kinarm.world import World


class MissedGoal(Document, frozen=True, kw_only=True):
    """A trial without a motion to the goal [m], and why."""

    trial: Count
    goal: Goal
    reason: str


class Goals(Document, frozen=True, kw_only=True):
    """Shares of trials that are reached, proven out of reach, and undecided."""

    trials: Count
    seed: Count
    reached: Estimate
    out_of_reach: Estimate
    undecided: Estimate
    not_reached: list[MissedGoal]


class Starts(Document, frozen=True, kw_only=True):
    """How many starts touch nothing, and what touches at home.

    They are random, unless the task lists its starts.
    """

    configurations: Count
    free: Estimate
    home_contact: Pair | None


class Contacts(Document, frozen=True, kw_only=True):
    """Pairs of bodies that touch at random configurations.

    Parameters
    ----------
    touching : list
        Pairs of bodies, and at which share of the configurations they touch.
    left_out : list
        Pairs that are not tested, and why.
    """

    configurations: Count
    free: Estimate
    touching: list[tuple[str, str, float]]
    left_out: list[tuple[str, str, str]]


class ProblemCheck(Document, frozen=True, kw_only=True):
    """Findings about a problem: the document of kinarm-problem check --json.

    Parameters
    ----------
    problem : dict
        The problem, in the words of problem files.
    mirror : str
        Why arm and obstacles are not their own mirror image; empty if they are.
    """

    problem: dict[str, Any]
    digest: Digest
    goals: Goals
    starts: Starts
    contact: Contacts
    mirror: str

    def __str__(self) -> str:
        content = {name: getattr(self, name) for name in self.__struct_fields__}
        return template_environment().get_template("problem_check.txt").render(content).rstrip()


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
    q, starts = random_configurations(world.contact_model, SAMPLES), random_starts(world)
    scenes = list(_some_scenes(world, q))
    contact = ContactStatistics.sample(world.contact_model, scenes=scenes)
    contact.check_movable(world.arm.name)
    free_starts = ~world.screened(starts, _some_scenes(world, starts))[1]
    return ProblemCheck(
        problem=world.problem.to_json(),
        digest=world.problem.digest,
        goals=_goals(TrialSet.draw(world.problem, trials, seed), on_progress),
        starts=Starts(
            configurations=len(free_starts),
            free=Estimate.share(free_starts),
            home_contact=world.contact_model.contact_pair(world.arm.home),
        ),
        contact=Contacts(
            configurations=len(contact.free),
            free=Estimate.share(contact.free),
            touching=[(*pair, share) for pair, share in contact.shares.items()],
            left_out=[(*pair, reason) for pair, reason in world.contact_model.left_out.items()],
        ),
        mirror=missing_mirror(world.problem),
    )


def _some_scenes(world: World, starts: NDArray[np.float64]) -> NDArray[np.float64]:
    """A scene of each start, if there are random bodies, with a random goal."""
    return world.scenes_of(starts, world.goals.draw(np.random.default_rng(0), len(starts)))


def _goals(trials: TrialSet, on_progress: Progress | None) -> Goals:
    """Goals that the oracle reaches, or proves out of reach within the horizon."""
    solutions = oracle_bounds(trials, on_progress)
    reached = solutions.reachable
    out_of_reach = solutions.steps_lower_bound > trials.problem.task.horizon
    goals, reasons = trials.goals.tolist(), solutions.reasons.tolist()
    return Goals(
        trials=len(trials),
        seed=trials.seed,
        reached=Estimate.share(reached),
        out_of_reach=Estimate.share(out_of_reach),
        undecided=Estimate.share(~(reached | out_of_reach)),
        not_reached=[
            MissedGoal(trial=trial, goal=goals[trial], reason=reasons[trial])
            for trial in np.flatnonzero(~reached).tolist()
        ],
    )


def random_starts(world: World) -> NDArray[np.float64]:
    """Configurations that the task may start at, free or not."""
    task, home = world.problem.task, world.arm.home
    if task.starts:
        return world.starts
    q = random_configurations(world.contact_model, 2000, seed=1)
    starts: NDArray[np.float64] = home + task.start_spread * (q - home)
    return starts
