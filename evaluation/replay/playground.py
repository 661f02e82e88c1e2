"""Policies in a playground: which of them run in a page, and where."""

from typing import TYPE_CHECKING

from kinarm.errors import InvalidInputError, KinarmError
from kinarm.evaluation.contestants import Contestant
from kinarm.evaluation.replay.choosing import named_contestants
from kinarm.evaluation.trials import TrialSet
from kinarm.policies.export import contract_of
from kinarm.viewer.playground import PagePolicy, PlayPage, play_page
from kinarm.world import World

if TYPE_CHECKING:
    from kinarm.evaluation.replay.request import ReplayRequest

PLAYED = ("ppo-best-both", "ppo-precise-both", "ars-linear-both", "ars-paper-both")
"""Policies that a playground has by default."""

OFFERED = 20
"""Trials that a page offers by default."""


def playground(request: "ReplayRequest") -> PlayPage:
    """Make the page of a request's policies; its trials are those of an evaluation.

    Raises
    ------
    KinarmError
        If a policy is of another arm or observation, or does not run in a page.
    """
    contestants, problem = named_contestants(request, request.play or PLAYED)
    trials = TrialSet.draw(
        problem.replace(tested_configurations=0), request.trials or OFFERED, request.seed or 0
    )
    world = trials.simulator.world
    players = [_player(each, world, request) for each in contestants]
    shield = any(each.has_shield for each in contestants)
    return play_page(world, players, trials.starts, trials.goals, shield=shield)


def _player(contestant: Contestant, world: World, request: "ReplayRequest") -> PagePolicy:
    """A contestant for a page."""
    policy = contestant.policy
    if policy is None:
        raise InvalidInputError(
            f"{contestant.name!r} does not run in a page: it is no dense network of kinarm's, "
            "or needs more than its observation"
        )
    try:
        contestant.check(world.problem, world.arm, allow_other_arm=request.allow_other_arm)
        contract = contract_of(policy, world)
    except KinarmError as refused:
        raise InvalidInputError(f"{contestant.name!r} does not run here: {refused}") from refused
    return PagePolicy(contestant.name, contract, policy.networks())
