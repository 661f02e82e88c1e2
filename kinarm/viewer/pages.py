"""Pages of recordings, and of policies that run in them: HTML that needs WebGL, but no network."""

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import coal
import numpy as np
import pinocchio as pin

from kinarm.arm import Arm
from kinarm.body_motion import BodyMotion
from kinarm.collision import ContactModel
from kinarm.enclosures import core
from kinarm.episode_draws import EpisodePlants
from kinarm.episodes import shield_table
from kinarm.errors import InvalidInputError
from kinarm.kernels.compiling import Array
from kinarm.kernels.plant import RATE, SERVO, TRAPEZE
from kinarm.plant import Plant
from kinarm.recording import Recording
from kinarm.scene import Scene
from kinarm.viewer.camera import stage_scale
from kinarm.viewer.drawing import DrawnScene, draw_random_bodies, draw_stage, put
from kinarm.viewer.html_page import HtmlPage, page_html
from kinarm.viewer.parts import PAGE_COLOURS, TRACE_SIDES, TRACES, goal_pose, trace_mesh
from kinarm.viewer.visual_shapes import arm_parts, link_joints
from kinarm.world import World

RUN_FIELDS = ("policy", "outcome", "contact", "replaced", "refused", "states", "distances")
"""What scripts know of a recording as it is."""

SERVOS = (0.0, 20.0, 10.0, 5.0)
"""Natural frequencies of servos to choose from [Hz]; 0 for joints that obey at once."""

SCRIPTS = ("kinematics", "contact", "simulator", "inverse", "play_stage", "play")


def arm_data(arm: Arm, scene: Scene) -> dict[str, Any]:
    """Describe an arm: axes, tool, joints of its bodies, colour and size; and a page's colours."""
    chain, painted = arm.chain, Counter[int]()
    columns = chain.translation, chain.rotation, chain.axis, chain.prismatic
    for part in arm_parts(arm):
        painted[part.finish.colour] += len(part.mesh.faces)
    return {
        "arm": arm.name,
        "axes": [
            dict(zip(("translation", "rotation", "axis", "slides"), axis, strict=True))
            for axis in zip(*(column.tolist() for column in columns), strict=True)
        ],
        "tool": chain.tool.tolist(),
        "links": link_joints(arm),
        "scale": stage_scale(arm, scene),
        "swatch": f"#{painted.most_common(1)[0][0]:06x}",
        "colours": {name: f"#{colour:06x}" for name, colour in PAGE_COLOURS.items()},
    }


def contact_data(model: ContactModel) -> dict[str, Any]:
    """Describe what may touch: bodies, pairs, and how far joints move the bodies of a pair."""
    bodies: list[dict[str, Any]] = []
    for shape, name in zip(model.geometry.geometryObjects, model.body_names, strict=True):
        body: dict[str, Any] = {"name": name, "joint": shape.parentJoint}
        turn, place = shape.placement.rotation, shape.placement.translation
        if isinstance(shape.geometry, coal.Halfspace):
            body |= {"normal": turn[:, 2].tolist(), "offset": float(turn[:, 2] @ place)}
        else:
            # The hull of points in the joint's frame, widened by a radius or discs [m].
            points, radius = core(shape)
            discs = radius if isinstance(shape.geometry, coal.Cylinder) else 0.0
            placed = points @ turn.T + place
            body |= {"points": placed.tolist(), "discs": discs, "radius": radius - discs}
        bodies.append(body)
    return {
        "bodies": bodies,
        "pairs": [[pair.first, pair.second] for pair in model.geometry.collisionPairs],
        "travel": model.shapes.travel[: model.arm.n_actuated].tolist(),
    }


def replay_page(
    recordings: Recording | Sequence[Recording],
    path: str | Path | None = None,
    *,
    ghosts: Sequence[Recording] = (),
    groups: Sequence[str] = (),
    heading: str = "",
) -> HtmlPage:
    """Make a page that plays recordings; the same recordings make the same page.

    Parameters
    ----------
    recordings : Recording or sequence of Recording
        The recordings, which play in order.
    path : str or Path, optional
        File of the page, if it is to be written.
    ghosts : sequence of Recording
        Recordings of another policy in the same trials, shown in the same
        scene.
    groups : sequence of str
        Group of each recording in a list of trials; groups stay together. By
        default no list.
    heading : str
        Heading of the list.

    Raises
    ------
    InvalidInputError
        If there is no recording, or they cannot share a page.
    ArmError
        If the recorded arm is missing or has changed.
    """
    chosen = [recordings] if isinstance(recordings, Recording) else list(recordings)
    _check_recordings(chosen, ghosts)
    if groups and len(groups) != len(chosen):
        raise InvalidInputError(
            f"there must be a group for each recording: {len(groups)} for {len(chosen)}"
        )
    problem = chosen[0].problem
    arm, scene, drawn = problem.load_arm(), problem.scene, DrawnScene()
    trials = list(zip(chosen, ghosts, strict=True)) if ghosts else [(run,) for run in chosen]
    policies = dict.fromkeys(run.policy for runs in trials for run in runs)
    draw_stage(drawn.window, arm, problem)
    shown = []
    for number, runs in enumerate(trials):
        episode = scene, arm, runs[0].states[0], runs[0].goal
        moving = draw_random_bodies(drawn.window, f"trials/{number}/random", *episode)
        shown.append(_trial_data(runs, moving))
        for name, run in zip(("run", "ghost"), runs, strict=False):
            points = np.array([arm.tool_position(state) for state in run.states])
            way = drawn.window[f"trials/{number}/{name}"]
            if run.steps:
                put(way, TRACES[run.outcome], trace_mesh(points, stage_scale(arm, scene)))
    data = {
        **arm_data(arm, scene),
        "traceIndices": 6 * TRACE_SIDES,
        "trials": shown,
        "groups": list(groups),
        "heading": heading,
    }
    title = f"{' and '.join(policies)} · kinarm replay"
    scripts = ("replay_stage", "trial_list", "player")
    page = HtmlPage(page_html("player", title, drawn.content, data, scripts))
    if path is not None:
        page.save(path)
    return page


def _check_recordings(recordings: Sequence[Recording], ghosts: Sequence[Recording]) -> None:
    """Refuse recordings that cannot share a page."""
    if not recordings:
        raise InvalidInputError("there is no recording to replay")
    first = recordings[0].problem
    for problem in dict.fromkeys(each.problem for each in (*recordings, *ghosts)):
        if problem.arm_digest != first.arm_digest:
            raise InvalidInputError(
                f"the recordings are of different arms: {first.arm.name!r} ({first.arm_digest}) "
                f"and {problem.arm.name!r} ({problem.arm_digest})"
            )
        if problem.scene != first.scene:
            raise InvalidInputError("the recordings were made in different scenes")
    for recording, ghost in zip(recordings, ghosts, strict=bool(ghosts)):
        if not recording.same_trial(ghost):
            raise InvalidInputError(
                f"trial {recording.trial} of {recording.policy!r} and trial {ghost.trial} of "
                f"{ghost.policy!r} differ in start or goal: they cannot be compared"
            )


def _trial_data(runs: Sequence[Recording], moving: Mapping[str, BodyMotion]) -> dict[str, Any]:
    """A trial that was recorded, and what moves in it, as JSON."""
    first, problem = runs[0], runs[0].problem
    goals = first.goal[None] if first.goals is None else first.goals
    placed = (pin.SE3(goal_pose(problem.task.goal, goal)) for goal in goals)
    steps = np.arange(max(len(run.states) for run in runs), dtype=np.float64)
    times = steps * problem.stepping.time_step
    return {
        "problem": problem.name,
        "trial": first.trial,
        "goals": [pin.SE3ToXYZQUAT(pose).tolist() for pose in placed],
        "tolerance": problem.task.tolerance,
        "horizon": problem.task.horizon,
        "timeStep": problem.stepping.time_step,
        "floor": first.steps_lower_bound,
        "moving": {path: motion.offsets(times).tolist() for path, motion in moving.items()},
        "runs": [
            {
                **{name: getattr(run, name) for name in RUN_FIELDS},
                "contactPoint": run.contact_point,
            }
            for run in runs
        ],
    }


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
        `kinarm.evaluation.replay.page_policy`; the first one runs
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
