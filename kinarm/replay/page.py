"""One self-contained page that plays recordings: Meshcat's viewer, a scene and a player."""

import base64
import gzip
import html
import json
import struct
from collections.abc import Sequence
from functools import cache
from importlib import resources
from itertools import zip_longest
from typing import Any

import meshcat

from kinarm.arm import Arm
from kinarm.collision import body_names
from kinarm.errors import InvalidInputError
from kinarm.replay.capture import Capture
from kinarm.replay.drawing import (
    FLASH,
    OUTCOME_COLOURS,
    TRACE_SIDES,
    draw_arm,
    draw_goal,
    draw_surroundings,
    draw_trace,
    put,
)
from kinarm.replay.meshes import capsule
from kinarm.trajectory import Recording

FLASH_RADIUS = 0.025


def build_page(recordings: Sequence[Recording], ghosts: Sequence[Recording], arm: Arm) -> str:
    """Put a page together.

    Parameters
    ----------
    recordings : sequence of Recording
        One per trial.
    ghosts : sequence of Recording
        Another policy's, in the same trials; or empty.
    arm : Arm
        The arm that was recorded.
    """
    trials = [[run for run in runs if run is not None] for runs in zip_longest(recordings, ghosts)]
    names = dict.fromkeys(run.policy for runs in trials for run in runs)
    document = json.dumps(_describe(trials, arm), separators=(",", ":"), sort_keys=True)
    template = _asset("player.html")
    for marker, text in {
        "title": html.escape(f"{' and '.join(names)} · kinarm replay"),
        "style": _asset("player.css"),
        "licence": _viewer("main.min.js.LICENSE.txt").decode().replace("--", "- -"),
        "viewer": _packed_viewer(),
        "scene": _packed(_frames(_commands(trials, arm))),
        "trials": _packed(document.encode()),
        "stage": _asset("stage.js"),
        "player": _asset("player.js"),
    }.items():
        template = template.replace(f"<!--kinarm:{marker}-->", text, 1)
    return template


def _describe(trials: Sequence[Sequence[Recording]], arm: Arm) -> dict[str, Any]:
    """What the player has to know, as JSON."""
    chain = arm.chain
    return {
        "arm": arm.name,
        "axes": [
            {
                "translation": chain.translation[k].tolist(),
                "rotation": chain.rotation[k].tolist(),
                "axis": chain.axis[k].tolist(),
                "slides": bool(chain.prismatic[k]),
            }
            for k in range(arm.n_axes)
        ],
        "tool": chain.tool.tolist(),
        "links": {
            name: shape.parentJoint
            for name, shape in zip(body_names(arm), arm.geometry.geometryObjects, strict=True)
        },
        "traceIndices": 6 * TRACE_SIDES,
        "colours": {name: f"#{colour:06x}" for name, colour in OUTCOME_COLOURS.items()},
        "trials": [_describe_trial(runs) for runs in trials],
    }


def _describe_trial(runs: Sequence[Recording]) -> dict[str, Any]:
    first = runs[0]
    return {
        "task": first.task,
        "trial": first.trial,
        "goal": first.goal.tolist(),
        "tolerance": first.tolerance,
        "horizon": first.horizon,
        "timeStep": first.time_step,
        "floor": first.steps_lower_bound,
        "runs": [
            {
                "policy": run.policy,
                "outcome": run.outcome,
                "contact": run.contact,
                "contactPoint": None if run.contact_point is None else run.contact_point.tolist(),
                "refused": None if run.refused is None else run.refused.tolist(),
                "states": run.states.tolist(),
                "distances": run.distances.tolist(),
            }
            for run in runs
        ],
    }


def _commands(trials: Sequence[Sequence[Recording]], arm: Arm) -> list[bytes]:
    """The scene as Meshcat commands."""
    capture = Capture()
    window = meshcat.Visualizer(window=capture)
    first = trials[0][0]
    draw_surroundings(window, first.scene)
    draw_goal(window["goal"], first.scene, first.tolerance)
    put(window["flash"], FLASH, capsule(0.0, FLASH_RADIUS))
    draw_arm(window["arm"], arm)
    for number, runs in enumerate(trials):
        for name, run in zip(("run", "ghost"), runs, strict=False):
            draw_trace(window[f"trials/{number}/{name}"], arm, run)
    return capture.commands


def _frames(commands: Sequence[bytes]) -> bytes:
    """Commands one after the other, each led by its length."""
    return b"".join(struct.pack("<I", len(command)) + command for command in commands)


def _packed(content: bytes) -> str:
    return base64.b64encode(gzip.compress(content, 9, mtime=0)).decode()


def _viewer(name: str) -> bytes:
    return (resources.files("meshcat") / "viewer" / "dist" / name).read_bytes()


@cache
def _packed_viewer() -> str:
    return _packed(_viewer("main.min.js"))


@cache
def _asset(name: str) -> str:
    return (resources.files("kinarm.replay") / name).read_text(encoding="utf-8")


def check_recordings(
    recordings: Sequence[Recording], ghosts: Sequence[Recording], arm: Arm
) -> None:
    """See that recordings can share a page.

    Raises
    ------
    InvalidInputError
        If there are none, they are of another arm or of different scenes, or the ghosts did not
        face the same trials.
    """
    if not recordings:
        raise InvalidInputError("there is no recording to replay")
    for recording in (*recordings, *ghosts):
        recording.check_arm(arm)
        if recording.scene != recordings[0].scene:
            raise InvalidInputError("the recordings were made in different scenes")
    if ghosts and len(ghosts) != len(recordings):
        raise InvalidInputError(
            f"there must be a ghost for each recording: {len(ghosts)} for {len(recordings)}"
        )
    for recording, ghost in zip(recordings, ghosts, strict=False):
        same = (recording.goal == ghost.goal).all() and (
            recording.states[0] == ghost.states[0]
        ).all()
        if not same:
            raise InvalidInputError(
                f"trial {recording.trial} of {recording.policy!r} and trial {ghost.trial} of "
                f"{ghost.policy!r} differ in start or goal: they cannot be compared"
            )
