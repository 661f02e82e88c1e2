"""Policies in a playground: which of them run in a page, and where."""

import base64
from typing import TYPE_CHECKING, Any

from kinarm.errors import InvalidInputError, KinarmError
from kinarm.evaluation.contestants import Contestant
from kinarm.evaluation.replay.recordings import named_contestants
from kinarm.evaluation.trials import TrialSet
from kinarm.policies.export import contract_of
from kinarm.policies.policy import Policy
from kinarm.problem_options import say_choices
from kinarm.viewer.html_page import HtmlPage
from kinarm.viewer.pages import play_page
from kinarm.world import World

if TYPE_CHECKING:
    from kinarm.evaluation.commands.replay import ReplayRequest

PLAYED = ("ppo-best-both", "ppo-best-hard-paper", "ars-linear-both", "ars-paper-both")
"""Policies that a playground has by default."""

OFFERED = 20
"""Trials that a page offers by default."""


def playground(request: "ReplayRequest") -> HtmlPage:
    """Make the page of a request's policies; its trials are those of an evaluation.

    Raises
    ------
    KinarmError
        If a policy is of another arm or observation, or does not run in a page.
    """
    contestants, problem = named_contestants(request, request.play or PLAYED)
    throughout = problem.replace(tested_configurations=0)
    trials = TrialSet.draw(throughout, request.trials or OFFERED, request.seed or 0)
    say_choices([trials.problem])
    world, other = trials.simulator.world, request.allow_other_arm
    players = [_player(each, world, allow_other_arm=other) for each in contestants]
    shield = problem.stepping.shield or any(each.has_shield for each in contestants)
    return play_page(world, players, trials.starts, trials.goals, shield=shield)


def _player(contestant: Contestant, world: World, *, allow_other_arm: bool) -> dict[str, Any]:
    """A contestant for a page, or one line that says why not."""
    policy, name = contestant.policy, contestant.name
    if policy is None:
        raise InvalidInputError(
            f"{name!r} does not run in a page: it is no dense network of kinarm's, or needs more "
            "than its observation"
        )
    try:
        contestant.check(world.problem, world.arm, allow_other_arm=allow_other_arm)
        return page_policy(name, policy, world)
    except KinarmError as refused:
        raise InvalidInputError(f"{name!r} does not run here: {refused}") from refused


def page_policy(name: str, policy: Policy, world: World) -> dict[str, Any]:
    """A policy for a page: its contract, and its network with the normaliser folded in."""
    networks, contract = policy.networks(), contract_of(policy, world)
    parameters = networks.parameters[0].astype("<f8").tobytes()
    return {
        "name": name,
        "contract": contract,
        "widths": networks.widths,
        "parameters": base64.b64encode(parameters).decode(),
        "signs": networks.mirror and networks.mirror._asdict(),
        "rates": networks.rates,
    }
