"""Valid files of every kind, small ones: what is damaged then."""

from collections.abc import Callable
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

from kinarm._files import shipped_files
from kinarm.arm import Arm
from kinarm.evaluation import EvaluationRequest, TrialSet
from kinarm.policies import load_policy
from kinarm.recording import record_rollouts, save_recordings
from tests.helpers.mesh_files import CUBE_CORNERS, CUBE_FACES, write_obj, write_stl

CUBE = 0.1 * CUBE_CORNERS


def written(write: Callable[[Path], object], name: str = "file.npz") -> bytes:
    """What a function writes to a file."""
    with TemporaryDirectory() as folder:
        path = Path(folder) / name
        write(path)
        return path.read_bytes()


def policies() -> list[bytes]:
    """A linear policy, and one with hidden layers."""
    names = ("ars-tuned-both-seed0", "ppo-best-both-seed0")
    return [written(load_policy(name).save) for name in names]


@cache
def trials() -> TrialSet:
    """Three trials."""
    return TrialSet.draw("right", 3, 0)


def recordings() -> list[bytes]:
    """Of three trials."""
    simulator, policy = trials().simulator, load_policy("ars-tuned-both-seed0")
    rollouts = simulator.rollout(policy, trials().starts, trials().goals, record=True)
    recorded = record_rollouts(simulator, rollouts, "ars")
    return [written(lambda path: save_recordings(path, recorded))]


def evaluations() -> list[bytes]:
    """An ``evaluation.json`` with the oracle's bounds, and one without."""

    def save(folder: Path, oracle: bool) -> bytes:
        EvaluationRequest(
            policies=("ars-tuned-both-seed0",),
            problems=("right",),
            trials=3,
            oracle=oracle,
            out=folder,
        ).run()
        return (folder / "evaluation.json").read_bytes()

    with TemporaryDirectory() as name:
        return [save(Path(name) / str(oracle), oracle) for oracle in (True, False)]


def problems() -> list[bytes]:
    """Problem files that ship."""
    return [path.read_bytes() for path in shipped_files("problems").values()]


def arm_files() -> list[bytes]:
    """An arm of kinarm's and one of another package."""
    arms = shipped_files("arms")
    return [arms[name].read_bytes() for name in ("paper", "ur5")]


STUDY = b"""
learner = "ars"
problems = ["right"]
seeds = 2

[trials]
count = 5

[fixed]
iterations = 2
reward.success = 2.0

[grid]
step_size = [0.01, 0.02]
"problem.task.start_spread" = [0.2]
sharing = ["none", "pair"]
"""

SMALL_URDF = b"""<?xml version="1.0" encoding="utf-8"?>
<robot name="made" version="1.2">
<material name="red"><color rgba="1 0 0 1"/></material>
<link name="base"><collision><origin xyz="0 0 .1"/>
<geometry><box size=".2 .2 .2"/></geometry></collision></link>
<link name="arm"><visual><geometry><mesh filename="cube.stl" scale="2 1 1"/></geometry>
<material name="red"/></visual><collision><origin xyz="0 0 .2" rpy="0 .1 0"/>
<geometry><capsule radius=".05" length=".2"/></geometry></collision></link>
<link name="hand"><collision><geometry><sphere radius=".06"/></geometry></collision>
<collision><geometry><mesh filename="cube.stl" scale="1 1 2"/></geometry></collision></link>
<link name="tool0"/>
<joint name="turn" type="continuous"><parent link="base"/><child link="arm"/>
<origin xyz="0 0 .5" rpy="0 0 0"/><axis xyz="0 0 1"/><limit velocity="3" effort="0"/></joint>
<joint name="lift" type="revolute"><parent link="arm"/><child link="hand"/>
<origin xyz="0 0 .4" rpy="0 0 0"/><axis xyz="0 1 0"/>
<limit lower="-2" upper="2" velocity="3" effort="0"/></joint>
<joint name="mount" type="fixed"><parent link="hand"/><child link="tool0"/>
<origin xyz="0.2 0 0"/></joint></robot>
"""


def urdf() -> bytes:
    """A URDF that ships."""
    return Arm.load("paper").description.path.read_bytes()


def stl(binary: bool) -> bytes:
    """A cube as STL."""
    if not binary:
        return written(lambda path: write_stl(path, CUBE))
    facets = [(np.zeros(3), *(CUBE[i] for i in face)) for face in CUBE_FACES]
    content = b"".join(np.array(f, dtype="<f4").tobytes() + b"\x00\x00" for f in facets)
    return b"\x00" * 80 + len(CUBE_FACES).to_bytes(4, "little") + content


def obj() -> bytes:
    """A cube as OBJ."""
    return written(lambda path: write_obj(path, CUBE))


def dae() -> bytes:
    """A cube as Collada."""
    places = " ".join(str(x) for corner in CUBE for x in corner)
    faces = " ".join(str(i) for face in CUBE_FACES for i in face)
    return (
        '<?xml version="1.0"?>'
        '<COLLADA xmlns="http://www.collada.org/2005/11/COLLADASchema" version="1.4.1">'
        '<asset><unit name="meter" meter="1"/><up_axis>Z_UP</up_axis></asset>'
        '<library_geometries><geometry id="cube"><mesh><source id="p">'
        f'<float_array id="pa" count="24">{places}</float_array><technique_common>'
        '<accessor source="#pa" count="8" stride="3"><param name="X" type="float"/>'
        '<param name="Y" type="float"/><param name="Z" type="float"/></accessor>'
        '</technique_common></source><vertices id="v">'
        '<input semantic="POSITION" source="#p"/></vertices><triangles count="12">'
        f'<input semantic="VERTEX" source="#v" offset="0"/><p>{faces}</p></triangles></mesh>'
        '</geometry></library_geometries><library_visual_scenes><visual_scene id="scene">'
        '<node id="n"><instance_geometry url="#cube"/></node></visual_scene>'
        '</library_visual_scenes><scene><instance_visual_scene url="#scene"/></scene></COLLADA>'
    ).encode()


def sb3_model() -> Any:
    """A small model of Stable-Baselines3."""
    from stable_baselines3 import PPO

    from kinarm.envs import ReachEnv

    settings = {"n_steps": 8, "batch_size": 8, "policy_kwargs": {"net_arch": [4]}}
    return PPO("MlpPolicy", ReachEnv("right"), device="cpu", **settings)
