"""Files of problems and scenes, shipped or the user's."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from kinarm._fields import from_plain, read_toml, take_base, to_plain
from kinarm._files import is_file, named_file, shipped_files
from kinarm.bodies import read_meshes
from kinarm.errors import InvalidInputError
from kinarm.plant import Plant
from kinarm.scene import Scene

PAPER_TASKS = {"left": ("left",), "right": ("right",), "both": ("left", "right")}
"""Goal regions of the paper's tasks 1, 2 and 3 by problem."""

KEYS = {"base", "name", "arm", "scene", "task", "stepping", "plant", "observation"}
"""Keys of a problem file."""


def problem_names() -> tuple[str, ...]:
    """Names of the shipped problems."""
    return (*PAPER_TASKS, *shipped_files("problems"))


def scene_names() -> tuple[str, ...]:
    """Names of the shipped scenes."""
    return tuple(shipped_files("scenes"))


def read_problem(path: Path) -> dict[str, Any]:
    """Read a problem file, as a table of what differs from the defaults.

    Parts are tables; ``arm`` and ``scene`` may also be names or files, and ``task`` those of
    another problem, which stay. The problem ``base`` has the rest. By default all goal regions of
    another scene are to be reached.
    """
    entries = read_toml(path, "problem")
    regions = PAPER_TASKS[take_base(entries, str(path), PAPER_TASKS, "right")]
    scene, task = entries.get("scene"), entries.get("task", {})
    if isinstance(entries.get("arm"), str):
        entries["arm"] = {"source": entries["arm"]}
    if isinstance(scene, str):
        entries["scene"] = to_plain(find_scene(_beside(path, scene)))
    else:
        read_meshes(scene, path)
    read_meshes(entries.get("arm"), path)
    if isinstance(entries.get("observation"), list):
        entries["observation"] = {"parts": entries["observation"]}
    if isinstance(entries.get("plant"), str):
        entries["plant"] = to_plain(Plant.load(_beside(path, entries["plant"])))
    if isinstance(task, str):
        entries["task"] = str(_beside(path, task))
    elif isinstance(task, Mapping):
        new = isinstance(scene, str) or (isinstance(scene, Mapping) and "goal_regions" in scene)
        entries["task"] = {"goal_regions": () if new else regions, **task}
    return {"name": path.stem, **entries}


def find_scene(name: str | Path) -> Scene:
    """Find a scene by its name, that of a problem, or a file of either."""
    if str(name) in PAPER_TASKS:
        return Scene()
    of_problem = str(name) in shipped_files("problems") and str(name) not in scene_names()
    path = named_file("problem" if of_problem else "scene", name, problem_names())
    entries = read_toml(path, "scene")
    if entries and entries.keys() <= KEYS:
        return from_plain(Scene, read_problem(path).get("scene", {}), str(path), "scene.")
    if "goal_regions" not in entries:
        raise InvalidInputError(f"{path}: 'goal_regions' is missing: where goals may lie")
    entries = {"obstacles": [], **entries}
    read_meshes(entries, path)
    return from_plain(Scene, entries, str(path))


def _beside(path: Path, name: str) -> str | Path:
    """A name, or a path from the folder of the file that names it."""
    beside = path.parent / name
    return beside if is_file(beside) else name
