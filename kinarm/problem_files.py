"""Files of problems, scenes and tasks: those that ship with kinarm, and the user's own."""

from collections.abc import Mapping
from dataclasses import replace
from functools import cache
from importlib import resources
from pathlib import Path
from types import MappingProxyType
from typing import Any, TypeVar, cast

from kinarm._fields import from_plain, init_fields, read_toml, summary_of, take_base, to_plain
from kinarm._files import absolute, is_file
from kinarm.errors import InvalidInputError, UnknownNameError
from kinarm.problem import PROBLEMS, ReachProblem
from kinarm.scene import Scene
from kinarm.task import ReachTask

Part = TypeVar("Part", Scene, ReachTask)


@cache
def shipped_files(folder: str) -> Mapping[str, Path]:
    """Files of a folder of kinarm's data, such as ``"scenes"``, by name."""
    with resources.as_file(resources.files("kinarm.data") / folder) as path:
        return MappingProxyType({file.stem: file for file in sorted(path.glob("*.toml"))})


def problem_names() -> tuple[str, ...]:
    """Names of the problems that ship with kinarm."""
    return (*PROBLEMS, *shipped_files("problems"))


def scene_names() -> tuple[str, ...]:
    """Names of the scenes that ship with kinarm."""
    return tuple(shipped_files("scenes"))


def find_problem(name: str | Path) -> ReachProblem:
    """Find a problem by name, or read it from a file.

    Raises
    ------
    UnknownNameError
        If there is no such problem.
    InvalidInputError
        If the file cannot be used.
    """
    if str(name) in PROBLEMS:
        return PROBLEMS[str(name)]
    return read_problem(_file("problem", name, "problems", tuple(PROBLEMS)))


def find_scene(name: str | Path) -> Scene:
    """Find a scene by its name, by the name of a problem, or in a file of either.

    Raises
    ------
    UnknownNameError
        If there is no such scene.
    InvalidInputError
        If the file cannot be used.
    """
    return _find_part(Scene, "scene", name)


def find_task(name: str | Path) -> ReachTask:
    """Find a task: by the name of a problem that has it, or in a file of task or problem.

    Raises
    ------
    UnknownNameError
        If there is no such task.
    InvalidInputError
        If the file cannot be used.
    """
    return _find_part(ReachTask, "task", name)


def read_problem(path: Path) -> ReachProblem:
    """Read a problem file.

    Its parts are tables; ``arm``, ``scene`` and ``task`` may also be names or files. What is left
    out is that of the problem ``base``. Without a word on goal regions, another scene's are all
    to be reached.

    Raises
    ------
    InvalidInputError
        If it cannot be used; names file, key and what is expected.
    """
    entries = read_toml(path, "problem")
    base = to_plain(PROBLEMS[take_base(entries, str(path), PROBLEMS, "right")])
    scene, task = entries.get("scene"), entries.get("task")
    if isinstance(entries.get("arm"), str):
        entries["arm"] = {"source": entries["arm"]}
    if isinstance(scene, str):
        entries["scene"] = base["scene"] = to_plain(find_scene(_beside(path, scene)))
    if isinstance(task, str):
        entries["task"] = base["task"] = to_plain(find_task(_beside(path, task)))
    elif isinstance(scene, str) or (isinstance(scene, Mapping) and "goal_regions" in scene):
        base["task"]["goal_regions"] = []
    given = {"name": path.stem, **entries}
    problem = from_plain(ReachProblem, _merged(base, given), str(path))
    return replace(problem, arm=problem.arm.resolved(absolute(path).parent))


def _find_part(kind: type[Part], what: str, name: str | Path) -> Part:
    """Find a scene or a task."""
    folder = f"{what}s"
    if str(name) in problem_names() and str(name) not in shipped_files(folder):
        return cast("Part", getattr(find_problem(name), what))
    path = _file(what, name, folder, problem_names())
    entries = read_toml(path, what)
    if entries.keys() & ({"base"} | init_fields(ReachProblem).keys()):
        return cast("Part", getattr(read_problem(path), what))
    if kind is Scene:
        if "goal_regions" not in entries:
            wanted = summary_of(Scene, "goal_regions").lower()
            raise InvalidInputError(f"{path}: 'goal_regions' is missing: {wanted}")
        entries = {"obstacles": [], **entries}
    return from_plain(kind, entries, str(path))


def _file(what: str, name: str | Path, folder: str, others: tuple[str, ...]) -> Path:
    """The file of a name, or a path that looks like one."""
    shipped = shipped_files(folder)
    path = Path(name)
    if str(name) in shipped:
        return shipped[str(name)]
    if path.suffix == ".toml" or is_file(path) or path.parent != Path():
        return path
    available = dict.fromkeys((*others, *shipped, f"path/to/{what}.toml"))
    raise UnknownNameError(what, str(name), available)


def _beside(path: Path, name: str) -> str | Path:
    """What a file calls another one: a name, or a path that starts at its folder."""
    beside = path.parent / name
    return beside if is_file(beside) else name


def _merged(below: Any, above: Any) -> Any:
    """Merge tables key by key; other values come from ``above``."""
    if not (isinstance(below, Mapping) and isinstance(above, Mapping)):
        return above
    return {**below, **{key: _merged(below.get(key), entry) for key, entry in above.items()}}
