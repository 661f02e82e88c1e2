"""Every loader, fed with damaged files: ``python -m tests.campaign.loaders``.

A file is refused in one line, or read; nothing else may come of it.
"""

import gc
import os
import pickle
import sys
import warnings
from collections.abc import Callable
from contextlib import suppress
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

from kinarm._archive import CACHE_VARIABLE, cached_arrays
from kinarm.arm import Arm
from kinarm.errors import KinarmError
from kinarm.evaluation import bounds
from kinarm.evaluation.commands.reproduce import _claim_folder
from kinarm.evaluation.comparison.learners import read_learners
from kinarm.evaluation.comparison.runs import load_run
from kinarm.evaluation.document import EvaluationDocument
from kinarm.evaluation.imported import imported_policy
from kinarm.meshes import hull_of_mesh
from kinarm.policies import Policy, recipe
from kinarm.policies.checkpoint import load_checkpoint
from kinarm.policies.conversion.sb3_models import sb3_model
from kinarm.policies.conversion.vec_normalize import load_vec_normalize
from kinarm.policies.learners import state_policy
from kinarm.problem import ReachProblem
from kinarm.problem_files import find_scene, find_task
from kinarm.recording import load_recordings
from kinarm.viewer.mesh_files import read_mesh_file
from kinarm.viewer.visual_shapes import visual_parts

from . import samples, studies
from .judging import Judge, Verdict
from .loader import Loader
from .mutations import (
    Mutation,
    cut_bytes,
    damaged_archive,
    damaged_bytes,
    damaged_json,
    damaged_text,
    damaged_toml,
    damaged_xml,
    pick,
)
from .running import Try, campaign, generator, options

LARGE = 100_000
"""Inputs of the recorded run."""


def _policy(path: Path) -> None:
    policy = Policy.load(path)
    policy(np.zeros((1, policy.mean.size)))
    policy.check_arm(samples.trials().simulator.arm)


def _checkpoint(path: Path) -> None:
    checkpoint = load_checkpoint(path)
    state_policy(checkpoint.config, checkpoint.state)


def _evaluation(path: Path) -> None:
    document = EvaluationDocument.load(path)
    row = document.result(None, None)
    document.problem(row["problem"])
    document.floors(row["problem"])


def _problem(path: Path) -> None:
    ReachProblem.load(path).to_toml()


def _arm(path: Path) -> None:
    repr(Arm.load(path).reach)


def _seen_arm(path: Path) -> None:
    list(visual_parts(Arm.load(path)))


def _cached(path: Path) -> None:
    kept = next(path.parent.glob("thing-*.npz"), None)
    if kept is None:
        cached_arrays("thing", 1, b"made of", lambda: {"corners": samples.CUBE})
        kept = next(path.parent.glob("thing-*.npz"))
    kept.write_bytes(path.read_bytes())
    cached_arrays("thing", 1, b"made of", lambda: {"corners": samples.CUBE})


def _module(path: Path) -> None:
    sys.modules.pop("mine", None)
    with warnings.catch_warnings(action="ignore"):  # they are the module's own
        imported_policy("mine:act")


def _use_folder(folder: Path) -> None:
    os.environ[CACHE_VARIABLE] = str(folder)


def _import_from(folder: Path) -> None:
    sys.path.insert(0, str(folder))
    sys.dont_write_bytecode = True


def _no_cache(folder: Path) -> None:
    os.environ[CACHE_VARIABLE] = "/dev/null/none"


def _trained(file: str) -> bytes:
    """A file of a finished training of a reproduction."""
    with TemporaryDirectory() as folder:
        samples.save_training(Path(folder))
        return (Path(folder) / file).read_bytes()


def _bounds() -> list[bytes]:
    solutions = bounds.oracle_bounds(samples.trials())
    return [samples.written(lambda path: bounds._save(path, solutions))]


def _compared() -> list[bytes]:
    with TemporaryDirectory() as folder:
        samples.save_comparison(Path(folder))
        return [next(Path(folder).iterdir()).read_bytes()]


def _load_training(path: Path) -> object:
    return samples.store(path.parents[1]).load(samples.planned_training())


TRAINING = samples.planned_training().name
ONE = np.ones(3)

LOADERS: dict[str, Loader] = {
    "policy": Loader(
        ("policies.policy_files.read_policy",), samples.policies, damaged_archive, _policy
    ),
    "checkpoint": Loader(
        ("policies.checkpoint.load_checkpoint", "policies.checkpoint.rebuilt"),
        samples.checkpoints,
        damaged_archive,
        _checkpoint,
    ),
    "recordings": Loader(
        ("kinarm.recording.load_recordings",), samples.recordings, damaged_archive, load_recordings
    ),
    "cached arrays": Loader(
        ("kinarm._archive.cached_arrays",),
        lambda: [samples.written(partial(_save_cached))],
        damaged_archive,
        _cached,
        prepare=_use_folder,
    ),
    "bounds": Loader(
        ("evaluation.bounds._load",),
        _bounds,
        damaged_archive,
        lambda path: bounds._load(path, samples.trials()),
    ),
    "trained run": Loader(
        ("evaluation.reproduction.runs.load",),
        lambda: [_trained(f"runs/{TRAINING}.npz")],
        damaged_archive,
        _load_training,
        f"runs/{TRAINING}.npz",
        samples.save_training,
    ),
    "wall times": Loader(
        ("evaluation.reproduction.runs.load", "evaluation.reproduction.runs._header"),
        lambda: [_trained(f"timing/{TRAINING}.json")],
        damaged_json,
        _load_training,
        f"timing/{TRAINING}.json",
        samples.save_training,
    ),
    "study marker": Loader(
        ("evaluation.commands.reproduce._claim_folder",),
        lambda: [b'{"study": "quick"}'],
        damaged_json,
        lambda path: _claim_folder(path.parent, samples.study()),
        "study.json",
    ),
    "compared run": Loader(
        ("evaluation.comparison.runs.load_run",),
        _compared,
        damaged_json,
        lambda path: load_run(path.parent, samples.planned_run()),
        f"{samples.planned_run().name}.json",
    ),
    "evaluation": Loader(
        ("evaluation.document.load",), samples.evaluations, damaged_json, _evaluation, "file.json"
    ),
    "problem": Loader(
        ("kinarm.problem_files.read_problem",),
        lambda: samples.toml_files("problems"),
        damaged_toml,
        _problem,
        "file.toml",
    ),
    "scene": Loader(
        ("kinarm.problem_files._find_part",),
        lambda: samples.toml_files("scenes"),
        damaged_toml,
        find_scene,
        "file.toml",
    ),
    "task": Loader(
        ("kinarm.problem_files._find_part",),
        lambda: [b'goal_regions = ["right"]\nhorizon = 64\n[reward]\nsuccess = 1.0\n'],
        damaged_toml,
        find_task,
        "file.toml",
    ),
    "arm file": Loader(
        ("kinarm.arm_specification._read",),
        lambda: samples.toml_files("arms", "paper", "paper_flange"),
        damaged_toml,
        _arm,
        "file.toml",
        lambda folder: (folder / "paper.urdf").write_bytes(samples.urdf()),
    ),
    "recipe": Loader(
        ("policies.recipes._read_recipe",),
        samples.recipes,
        damaged_toml,
        lambda path: recipe("ars", path),
        "file.toml",
    ),
    "table of learners": Loader(
        ("evaluation.comparison.learners.read_learners",),
        lambda: [Path(samples.__file__).parents[2].joinpath(LEARNERS).read_bytes()],
        damaged_toml,
        read_learners,
        "file.toml",
    ),
    "urdf": Loader(
        ("kinarm.urdf_tree.read_robot",),
        samples.urdfs,
        damaged_xml,
        _arm,
        "file.urdf",
    ),
    "urdf with meshes": Loader(
        ("kinarm.urdf_tree.read_robot",),
        lambda: [URDF_WITH_MESHES],
        damaged_xml,
        _seen_arm,
        "file.urdf",
        lambda folder: (folder / "cube.stl").write_bytes(samples.stl(binary=True)),
    ),
    "module": Loader(
        ("evaluation.imported.imported_policy",),
        lambda: [samples.MODULE],
        damaged_text,
        _module,
        "mine.py",
        _import_from,
    ),
    "model of Stable-Baselines3": Loader(
        ("policies.conversion.sb3_models._saved_model",),
        samples.sb3_models,
        damaged_bytes,
        sb3_model,
        "file.zip",
        needs="stable_baselines3",
    ),
    "VecNormalize": Loader(
        ("policies.conversion.vec_normalize.load_vec_normalize",),
        samples.sb3_statistics,
        cut_bytes,
        load_vec_normalize,
        "file.pkl",
        needs="stable_baselines3",
    ),
}
LEARNERS = "evaluation/comparison/learners.toml"
URDF_WITH_MESHES = b"""<robot name="made" version="1.2">
<link name="base"><visual><geometry><mesh filename="cube.stl" scale="1 1 1"/></geometry></visual>
</link><link name="arm"><visual><origin xyz="0 0 .1" rpy="0 0 1"/>
<geometry><mesh filename="cube.stl" scale="2 1 1"/></geometry>
<material name="red"><color rgba="1 0 0 1"/></material></visual>
<collision><geometry><mesh filename="cube.stl" scale="1 1 2"/></geometry></collision></link>
<link name="tool0"><visual><geometry><box size=".1 .1 .2"/></geometry></visual></link>
<joint name="turn" type="revolute"><parent link="base"/><child link="arm"/>
<origin xyz="0 0 .5" rpy="0 0 0"/><axis xyz="0 1 0"/>
<limit lower="-2" upper="2" velocity="3" effort="0"/></joint>
<joint name="mount" type="fixed"><parent link="arm"/><child link="tool0"/>
<origin xyz="0.3 0 0"/></joint></robot>
"""


def _mesh_loaders() -> dict[str, Loader]:
    """Readers of meshes for contact and for looks, by format."""
    made: dict[str, tuple[Callable[[], bytes], Mutation]] = {
        "stl": (lambda: samples.stl(binary=True), damaged_bytes),
        "text stl": (lambda: samples.stl(binary=False), damaged_text),
        "obj": (samples.obj, damaged_text),
        "dae": (samples.dae, damaged_xml),
    }
    readers: dict[str, tuple[str, Callable[..., Any]]] = {
        "hull": ("kinarm.meshes.hull_of_mesh", hull_of_mesh),
        "looks": ("kinarm.viewer.mesh_files.read_mesh_file", read_mesh_file),
    }
    return {
        f"{use} of {name}": Loader(
            (reads, f"{reads.rpartition('.')[0]}.{'_corners' if use == 'hull' else '_pieces'}"),
            lambda sample=sample: [sample()],
            mutate,
            lambda path, read=read: read(path, ONE),
            f"file.{name.split()[-1]}",
            _no_cache,
        )
        for use, (reads, read) in readers.items()
        for name, (sample, mutate) in made.items()
    }


def _save_cached(path: Path) -> None:
    from kinarm._archive import save_archive

    save_archive(path, "thing", 1, {"corners": np.array(samples.CUBE)}, {})


LOADERS |= _mesh_loaders() | studies.LOADERS


def make_try(name: str, seed: int, folder: Path) -> Try:
    """Prepare this process for a loader; returns what judges the input of a number."""
    loader, kept = LOADERS[name], folder / "samples"
    path = folder / "files" / loader.file
    path.parent.mkdir(parents=True, exist_ok=True)
    loader.prepare(folder / "files")
    if not kept.exists():
        kept.write_bytes(pickle.dumps(loader.samples()))
    contents = pickle.loads(kept.read_bytes())
    path.write_bytes(contents[0])
    with suppress(KinarmError):
        loader.load(path)  # what is imported and compiled once is no file's
    gc.freeze()  # nor need it be looked through again and again
    judge = Judge().__enter__()

    def try_input(number: int) -> Verdict:
        rng = generator(seed, name, number)
        with np.errstate(all="ignore"):
            path.write_bytes(loader.mutate(pick(rng, contents), rng))
        return judge(loader.load, path)

    return try_input


def main() -> int:
    """Run the campaign."""
    given = options("Every loader, fed with damaged files.", LARGE).parse_args()
    os.environ["OMP_NUM_THREADS"] = "1"
    subjects = {name: partial(make_try, name, given.seed) for name in LOADERS}
    return campaign(subjects, given, "loaders")


if __name__ == "__main__":
    sys.exit(main() > 0)
