"""Every loader, fed with damaged files: refused in one line, or read; nothing else comes of it.

``python -m tests.campaign.loaders --count 100000 --out data/results/campaign/loaders.json``
"""

import multiprocessing
import os
import resource
import sys
import tempfile
import traceback
import warnings
import zlib
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from multiprocessing.connection import Connection
from pathlib import Path

import numpy as np

from kinarm.arm import Arm
from kinarm.errors import KinarmError
from kinarm.evaluation import EvaluationDocument, Study, oracle_bounds
from kinarm.evaluation.finding import find_contestants
from kinarm.meshes import hulls_of_mesh
from kinarm.policies import Demonstrations, Policy, load_checkpoint, recipe
from kinarm.policies.conversion.models import load_vec_normalize, sb3_model
from kinarm.policies.learners import state_policy
from kinarm.problem import ReachProblem
from kinarm.problem_files import find_scene
from kinarm.recording import load_recordings
from kinarm.viewer.visual_shapes import read_mesh_file, visual_parts

from . import samples
from .damage import (
    Damage,
    cut_bytes,
    damaged_archive,
    damaged_bytes,
    damaged_json,
    damaged_text,
    damaged_toml,
    damaged_xml,
    pick,
)
from .tally import Tally, main

PATIENCE = 120.0
"""Time after which a call counts as hanging [s]."""
MEMORY = 2 << 30
"""What a loader may take [bytes]."""
LONGEST = 2000
"""Characters of the longest message."""
FORK = multiprocessing.get_context("fork")


@dataclass(frozen=True)
class Loader:
    """Something that reads files.

    Parameters
    ----------
    samples : callable
        Makes the content of valid files.
    damage : callable
        Damages such a content.
    load : callable
        Reads a file, and makes of it what a command would.
    file : str
        Name of the file.
    beside : dict of bytes
        Files that lie beside it.
    needs : str
        Module that comes with an extra, without which it reads nothing.
    """

    samples: Callable[[], Sequence[bytes]]
    damage: Damage
    load: Callable[[Path], object]
    file: str = "file.npz"
    beside: Callable[[], dict[str, bytes]] = dict
    needs: str = ""


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
    document.problem(row.problem)


def _arm(path: Path) -> None:
    arm = Arm.load(path)
    assert arm.reach > 0
    list(visual_parts(arm))


def _bounds(path: Path) -> None:
    """Bounds are looked up in the cache; damaged ones are made anew."""
    os.environ["KINARM_CACHE"] = str(path.parent / "cache")
    kept = next((path.parent / "cache").glob("oracle-*"), None)
    if kept is not None:
        kept.write_bytes(path.read_bytes())
    oracle_bounds(samples.trials())


def _bounds_samples() -> list[bytes]:
    def save(path: Path) -> None:
        path.touch()
        _bounds(path)
        next((path.parent / "cache").glob("oracle-*")).rename(path)

    return [samples.written(save)]


def _study(path: Path) -> None:
    """Read everything that lies in the folder of a study."""
    study = Study(samples.SMALL_STUDY, path.parents[1])
    study.table()
    study.store.made(study.runs[0])
    assert len(study.bounds) <= 1


def _module(path: Path) -> None:
    sys.modules.pop("mine", None)
    sys.path[0], sys.dont_write_bytecode = str(path.parent), True
    with warnings.catch_warnings(action="ignore"):  # they are the module's own
        find_contestants("mine:act")


def _mesh(read: Callable[[Path, np.ndarray], object], path: Path) -> None:
    os.environ["KINARM_CACHE"] = "/dev/null/none"
    read(path, np.ones(3))


def _cube() -> dict[str, bytes]:
    return {"cube.stl": samples.stl(binary=True)}


LOADERS: dict[str, Loader] = {
    "policy": Loader(samples.policies, damaged_archive, _policy),
    "checkpoint": Loader(samples.checkpoints, damaged_archive, _checkpoint),
    "recordings": Loader(samples.recordings, damaged_archive, load_recordings),
    "demonstrations": Loader(samples.demonstrations, damaged_archive, Demonstrations.load),
    "bounds": Loader(_bounds_samples, damaged_archive, _bounds),
    "evaluation": Loader(samples.evaluations, damaged_json, _evaluation, "file.json"),
    "problem": Loader(
        partial(samples.toml_files, "problems"),
        damaged_toml,
        lambda path: ReachProblem.load(path).to_toml(),
        "file.toml",
    ),
    "scene": Loader(partial(samples.toml_files, "scenes"), damaged_toml, find_scene, "file.toml"),
    "arm file": Loader(
        samples.arm_files,
        damaged_toml,
        _arm,
        "file.toml",
        lambda: {"paper.urdf": samples.urdf()},
    ),
    "recipe": Loader(samples.recipes, damaged_toml, lambda path: recipe("ars", path), "file.toml"),
    "study": Loader(
        lambda: [samples.STUDY],
        damaged_toml,
        lambda path: repr(Study(path, path.parent / "out")),
        "file.toml",
    ),
    "made of a study": Loader(samples.study_record, damaged_json, _study, f"made/{samples.MADE}"),
    "urdf": Loader(
        lambda: [*[samples.SMALL_URDF] * 7, samples.urdf()], damaged_xml, _arm, "file.urdf", _cube
    ),
    "module": Loader(lambda: [samples.MODULE], damaged_text, _module, "mine.py"),
    "model of Stable-Baselines3": Loader(
        lambda: [samples.written(samples.sb3_model().save, "model.zip")],
        damaged_bytes,
        sb3_model,
        "file.zip",
        needs="stable_baselines3",
    ),
    "VecNormalize": Loader(
        lambda: [samples.written(samples.sb3_model().get_env().save, "statistics.pkl")],
        cut_bytes,
        load_vec_normalize,
        "file.pkl",
        needs="stable_baselines3",
    ),
}
for _use, _read in (("hull", hulls_of_mesh), ("looks", read_mesh_file)):
    for _kind, _sample, _damage in (
        ("stl", partial(samples.stl, True), damaged_bytes),
        ("text stl", partial(samples.stl, False), damaged_text),
        ("obj", samples.obj, damaged_text),
        ("dae", samples.dae, damaged_xml),
    ):
        LOADERS[f"{_use} of {_kind}"] = Loader(
            lambda sample=_sample: [sample()],
            _damage,
            partial(_mesh, _read),
            f"file.{_kind[-3:]}",
        )


def fuzz(name: str, count: int, seed: int, tally: Tally) -> None:
    """Feed a loader with damaged files, in a process that may end or hang: another goes on.

    Parameters
    ----------
    name : str
        Which of `LOADERS`.
    count, seed : int
        How many files, and what their damage is drawn from.
    tally : Tally
        Counts how many were accepted and refused, and keeps what else came of one.
    """
    number, contents = 0, LOADERS[name].samples()
    with tempfile.TemporaryDirectory() as folder:
        while number < count:
            ours, theirs = FORK.Pipe(duplex=False)
            given = name, contents, (number, count, seed), Path(folder), theirs
            process = FORK.Process(target=_work, args=given)
            process.start()
            theirs.close()
            ours.recv()  # it is ready
            finding = ""
            while number < count and not finding:
                try:
                    if not ours.poll(PATIENCE):
                        process.kill()
                    verdict = ours.recv()
                except EOFError:
                    process.join()
                    finding = verdict = f"hangs, or ends with status {process.exitcode}"
                tally.count("inputs")
                if verdict in ("accepted", "refused"):
                    tally.count(verdict)
                else:
                    tally.find(verdict, input=number)
                number += 1
            process.join()


def _work(
    name: str,
    contents: Sequence[bytes],
    numbers: tuple[int, int, int],
    folder: Path,
    connection: Connection,
) -> None:
    """Load files from a number on, and tell what came of each."""
    loader, (first, count, seed) = LOADERS[name], numbers
    path = folder / loader.file
    path.parent.mkdir(exist_ok=True)
    for other, content in loader.beside().items():
        (folder / other).write_bytes(content)
    path.write_bytes(contents[0])
    verdict_of(loader.load, path)  # what is imported and compiled once is no file's
    used = int(Path("/proc/self/statm").read_text().split()[0]) * resource.getpagesize()
    resource.setrlimit(resource.RLIMIT_AS, (used + MEMORY, used + MEMORY))
    connection.send("ready")
    for number in range(first, count):
        rng = np.random.default_rng((seed, zlib.crc32(name.encode()), number))
        with np.errstate(all="ignore"):
            path.write_bytes(loader.damage(pick(rng, contents), rng))
        connection.send(verdict_of(loader.load, path))


def verdict_of(load: Callable[[Path], object], path: Path) -> str:
    """Whether a file is accepted or refused, or what is wrong; standard error stays silent."""
    verdict, kept = "accepted", os.dup(2)
    with tempfile.TemporaryFile() as said, warnings.catch_warnings():
        warnings.simplefilter("always")
        os.dup2(said.fileno(), 2)
        try:
            load(path)
        except KinarmError as error:
            text = str(error)
            one = len(text.splitlines()) == 1 and len(text) <= LONGEST
            verdict = "refused" if one else f"a message of more than a line: {text[:60]!r}"
        except BaseException as error:
            frame = traceback.extract_tb(error.__traceback__)[-1]
            place = f"{Path(frame.filename).name}:{frame.lineno}"
            verdict = f"{type(error).__name__} at {place}"
        finally:
            os.dup2(kept, 2)
            os.close(kept)
        said.seek(0)
        if printed := said.read(200):
            verdict = f"prints {printed.splitlines()[0][:120]!r}"
    return verdict


if __name__ == "__main__":
    os.environ["OMP_NUM_THREADS"] = "1"
    main("loaders", {name: partial(fuzz, name) for name in LOADERS}, 1000)
