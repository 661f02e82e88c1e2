"""The playground: a page in which policies run, and whose goal and obstacles one moves."""

import base64
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from kinarm.episode_plants import EpisodePlants
from kinarm.errors import InvalidInputError
from kinarm.kernels.compiling import Array
from kinarm.kernels.plant import RATE, SERVO, TRAPEZE
from kinarm.networks import Networks
from kinarm.plant import Plant
from kinarm.shield import shield_table
from kinarm.viewer.drawing import DrawnScene, draw_goal, draw_stage
from kinarm.viewer.html_page import HtmlPage, page_html
from kinarm.viewer.pages import arm_data, contact_data
from kinarm.viewer.parts import PAGE_COLOURS
from kinarm.world import World

SERVOS = (0.0, 20.0, 10.0, 5.0)
"""Natural frequencies of servos to choose from [Hz]; 0 for joints that obey at once."""

SCRIPTS = ("kinematics", "contact", "simulator", "inverse", "play_stage", "play")


@dataclass(frozen=True)
class PagePolicy:
    """A policy for a page.

    Attributes
    ----------
    name : str
        What the page calls it.
    contract : dict
        What `kinarm.policies.export.contract_of` says of it in the world of the page.
    networks : Networks
        Its network, normaliser folded in.
    """

    name: str
    contract: dict[str, Any]
    networks: Networks

    @property
    def data(self) -> dict[str, Any]:
        """All of it as JSON."""
        mirror = self.networks.mirror
        signs = {} if mirror is None else {"observations": mirror[0], "actions": mirror[1]}
        parameters = self.networks.parameters[0].astype("<f8").tobytes()
        return {
            "name": self.name,
            "contract": self.contract,
            "widths": self.networks.widths,
            "parameters": base64.b64encode(parameters).decode(),
            "signs": {name: each.tolist() for name, each in signs.items()},
        }


class PlayPage(HtmlPage):
    """A page in which policies run. A notebook shows it."""


def play_page(
    world: World,
    policies: Sequence[PagePolicy],
    starts: Array,
    goals: Array,
    path: str | Path | None = None,
    *,
    shield: bool = False,
) -> PlayPage:
    """Make a page in which policies of one arm run.

    Parameters
    ----------
    world : World
        Where: bodies and goals stand, and steps are tested for contact throughout.
    policies : sequence of PagePolicy
        Policies to choose from; the first one runs at first.
    starts, goals : ndarray, shape (n, n_joints) and (n, goal_width)
        Starts [rad or m] and goals of the trials that the page offers.
    path : str or Path, optional
        File of the page, if it is to be written.
    shield : bool
        Whether the shield is on at first.

    Raises
    ------
    InvalidInputError
        If the world holds what a page does not play.
    """
    problem, arm, scene, drawn = world.problem, world.arm, world.problem.scene, DrawnScene()
    _check_playable(world)
    draw_stage(drawn.window, arm, scene)
    draw_goal(drawn.window["goal"], problem)
    data = {
        **arm_data(arm, scene),
        **contact_data(world.contact_model),
        "problem": {"name": problem.name, **_problem_data(world, starts[:1], goals[:1])},
        "obstacles": arm.geometry.ngeoms + np.arange(len(scene.obstacles)),
        "reach": arm.reach,
        "policies": [policy.data for policy in policies],
        "trials": {"starts": starts, "goals": goals},
        "shield": shield,
        "plant": {"servo": problem.plant.bandwidth, "delay": problem.plant.delay},
        "colours": {name: f"#{colour:06x}" for name, colour in PAGE_COLOURS.items()},
    }
    page = PlayPage(page_html("play", f"{arm.name} · kinarm", drawn.content, data, SCRIPTS))
    if path is not None:
        page.save(path)
    return page


def _check_playable(world: World) -> None:
    """Refuse a world with more than a page plays."""
    problem, goal = world.problem, world.problem.task.goal
    plant = replace(
        problem.plant, delay=0, bandwidth=0.0, damping=1.0, order=2, feedback="measured"
    )
    ranges = any(isinstance(value, tuple) for value in vars(problem.plant).values())
    for wrong, reason in (
        (problem.scene.random_bodies, "random bodies"),
        (problem.scene.moving, "bodies that move"),
        (goal.changes, "goals that move or follow each other"),
        (goal.kind == "configuration", "goals that are configurations"),
        (plant != Plant() or ranges, "a plant with more than one delay and one kind of servo"),
        (world.rules.tested, "steps that are tested at some configurations alone"),
    ):
        if wrong:
            raise InvalidInputError(f"no page plays problem {problem.name!r}: it has {reason}")


def _problem_data(world: World, start: Array, goal: Array) -> dict[str, Any]:
    """What a simulator in a page has to know beside arm and contact."""
    problem, rules, n = world.problem, world.rules, world.arm.n_actuated
    task, plant = problem.task, problem.plant
    servos = []
    for hertz in sorted({*SERVOS, float(plant.bandwidth)}):  # type: ignore[arg-type]
        # A delay, so that joints without servos have numbers, too.
        lagging = problem.replace(plant=replace(plant, bandwidth=hertz, delay=1))
        (numbers,) = EpisodePlants(lagging, rules.step_limit).of(start, goal, 1)
        matrix, trapeze, rate = numbers[SERVO : SERVO + 4], numbers[TRAPEZE], numbers[RATE]
        servos.append({"hertz": hertz, "matrix": matrix, "trapeze": trapeze, "rate": rate})
    return {
        "lower": world.arm.lower[:n],
        "upper": world.arm.upper[:n],
        "step": rules.step_limit,
        "timeStep": problem.stepping.time_step,
        "feedback": plant.feedback,
        "tool": {
            "position": world.arm.chain.tool,
            "rotation": rules.goal.frame,
            "axis": rules.goal.axis,
        },
        "task": {
            "kind": task.goal.kind,
            "tolerance": task.tolerance,
            "rotationTolerance": task.goal.rotation_tolerance,
            "stride": rules.goal.stride if np.isfinite(rules.goal.stride) else None,
            "hold": task.goal.hold,
            "horizon": task.horizon,
        },
        "servos": servos,
        "shares": shield_table(n),
    }
