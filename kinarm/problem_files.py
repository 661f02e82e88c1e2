"""Files of problems, scenes and tasks, shipped or the user's."""

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any, TypeVar

from kinarm._fields import from_plain, read_toml, take_base, to_plain
from kinarm._files import is_file, named_file, shipped_files
from kinarm.bodies import read_meshes
from kinarm.errors import InvalidInputError
from kinarm.plant import Plant
from kinarm.scene import Scene
from kinarm.task import ReachTask

Part = TypeVar("Part", Scene, ReachTask)

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

    Parts are tables; ``arm``, ``scene`` and ``task`` may also be names or files. The problem
    ``base`` has the rest. By default all goal regions of another scene are to be reached.
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
        entries["task"] = to_plain(find_task(_beside(path, task)))
    elif isinstance(task, Mapping):
        new = isinstance(scene, str) or (isinstance(scene, Mapping) and "goal_regions" in scene)
        entries["task"] = {"goal_regions": () if new else regions, **task}
    return {"name": path.stem, **entries}


def find_scene(name: str | Path) -> Scene:
    """Find a scene by its name, that of a problem, or a file of either."""
    return _find_part(Scene, "scene", name)


def find_task(name: str | Path) -> ReachTask:
    """Find a task by the name of a problem, or in a file of task or problem."""
    if str(name) in PAPER_TASKS:
        return ReachTask(goal_regions=PAPER_TASKS[str(name)])
    return _find_part(ReachTask, "task", name)


def _find_part(kind: type[Part], what: str, name: str | Path) -> Part:
    if str(name) in PAPER_TASKS:
        return kind()
    available = shipped_files(f"{what}s")
    of_problem = str(name) in shipped_files("problems") and str(name) not in available
    path = named_file("problem" if of_problem else what, name, problem_names())
    entries = read_toml(path, what)
    if entries.keys() & KEYS:
        entries = read_problem(path)
        part = from_plain(kind, entries.get(what, {}), str(path), f"{what}.")
        if isinstance(part, ReachTask) and not part.goal_regions:
            scene = from_plain(Scene, entries.get("scene", {}), str(path), "scene.")
            part = replace(part, goal_regions=tuple(each.name for each in scene.goal_regions))
        return part
    if kind is Scene:
        if "goal_regions" not in entries:
            raise InvalidInputError(f"{path}: 'goal_regions' is missing: where goals may lie")
        entries = {"obstacles": [], **entries}
        read_meshes(entries, path)
    return from_plain(kind, entries, str(path))


def _beside(path: Path, name: str) -> str | Path:
    """A name, or a path from the folder of the file that names it."""
    beside = path.parent / name
    return beside if is_file(beside) else name
