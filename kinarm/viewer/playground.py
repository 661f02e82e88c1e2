"""The playground: a page in which policies run, and whose goal and obstacles one moves."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from kinarm.collision import ContactModel
from kinarm.episode_draws import EpisodePlants
from kinarm.episodes import shield_table
from kinarm.errors import InvalidInputError
from kinarm.kernels.compiling import Array
from kinarm.kernels.plant import RATE, SERVO, TRAPEZE
from kinarm.plant import Plant
from kinarm.viewer.drawing import DrawnScene, draw_stage
from kinarm.viewer.html_page import HtmlPage, page_html
from kinarm.viewer.pages import arm_data, contact_data
from kinarm.world import World

SERVOS = (0.0, 20.0, 10.0, 5.0)
"""Natural frequencies of servos to choose from [Hz]; 0 for joints that obey at once."""

SCRIPTS = ("kinematics", "contact", "simulator", "inverse", "play_stage", "play")


def play_page(
    world: World,
    policies: Sequence[Mapping[str, Any]],
    starts: Array,
    goals: Array,
    *,
    shield: bool = False,
) -> HtmlPage:
    """Make a page in which policies of one arm run.

    Parameters
    ----------
    world : World
        Where: bodies and goals stand, and steps are tested for contact throughout.
    policies : sequence of dict
        Policies to choose from, in the words of
        `kinarm.evaluation.replay.playground.page_policy`; the first one runs
        at first.
    starts, goals : ndarray, shape (n, n_joints) and (n, goal_width)
        Starts [rad or m] and goals of the trials that the page offers.
    shield : bool
        Whether the shield is on at first.

    Raises
    ------
    InvalidInputError
        If the world holds what a page does not play.
    """
    problem, arm, scene, drawn = world.problem, world.arm, world.problem.scene, DrawnScene()
    _check_playable(world)
    draw_stage(drawn.window, arm, problem)
    data = {
        **arm_data(arm, scene),
        **contact_data(ContactModel.build(arm, scene, loose=True)),
        "servos": _servos(world, starts[:1], goals[:1]),
        "shares": shield_table(arm.n_actuated),
        "obstacles": arm.geometry.ngeoms + np.arange(len(scene.obstacles)),
        "reach": arm.reach,
        "policies": policies,
        "trials": {"starts": starts, "goals": goals},
        "shield": shield,
        "plant": {"servo": problem.plant.bandwidth, "delay": problem.plant.delay},
    }
    return HtmlPage(page_html("play", f"{arm.name} · kinarm", drawn.content, data, SCRIPTS))


def _check_playable(world: World) -> None:
    """Refuse a world with more than a page plays."""
    problem, goal = world.problem, world.problem.task.goal
    plant = problem.plant
    played = {name: getattr(plant, name) for name in ("delay", "bandwidth", "damping", "feedback")}
    lags = plant != Plant(**played) or any(isinstance(each, tuple) for each in played.values())
    for wrong, reason in (
        (problem.scene.random_bodies, "random bodies"),
        (problem.scene.moving, "bodies that move"),
        (goal.changes, "goals that move or follow each other"),
        (goal.kind == "configuration", "goals that are configurations"),
        (lags, "a plant with more than one delay and one kind of servo"),
        (world.rules.tested, "steps that are tested at some configurations alone"),
    ):
        if wrong:
            raise InvalidInputError(f"no page plays problem {problem.name!r}: it has {reason}")


def _servos(world: World, start: Array, goal: Array) -> list[dict[str, Any]]:
    """What a simulator in a page has to know of the servos that one chooses from."""
    plant, servos = world.problem.plant, []
    for hertz in sorted({*SERVOS, float(plant.bandwidth)}):  # type: ignore[arg-type]
        # A delay, so that joints without servos have numbers, too.
        lagging = world.problem.replace(plant=replace(plant, bandwidth=hertz, delay=1))
        (numbers,) = EpisodePlants(lagging, world.rules.step_limit).of(start, goal, 1)
        matrix, trapeze, rate = numbers[SERVO : SERVO + 4], numbers[TRAPEZE], numbers[RATE]
        servos.append({"hertz": hertz, "matrix": matrix, "trapeze": trapeze, "rate": rate})
    return servos
