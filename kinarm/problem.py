"""The problem: an arm, a scene, a task and a stepping, as one value.

What cannot be used is a `KinarmError` of one line.
"""

import hashlib
import json
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import tomli_w
from numpy.typing import NDArray

from kinarm._fields import OPTIONAL, Checked, from_plain, init_fields, to_plain
from kinarm._files import absolute, named_file, write_text
from kinarm.arm_specification import ArmSpecification
from kinarm.errors import ProblemError, check_known
from kinarm.observation_choice import PAPER_PARTS, Observation
from kinarm.plant import Plant
from kinarm.problem_files import PAPER_TASKS, find_scene, problem_names, read_problem
from kinarm.scene import Scene
from kinarm.task import ReachTask, Stepping

if TYPE_CHECKING:
    from kinarm.arm import Arm

PARTS = {"task": ReachTask, "stepping": Stepping, "plant": Plant}
"""Parts of a problem whose settings `ReachProblem.replace` takes by name."""


@dataclass(frozen=True, kw_only=True)
class ReachProblem(Checked):
    """A reaching problem: an arm, a scene, a task and the rules of a step.

    Parameters
    ----------
    name : str
        How tables, files and messages call it.
    arm : ArmSpecification
        The arm.
    scene : Scene
        Ground, obstacles and goal regions.
    task : ReachTask
        Goals, endings, starts and rewards.
    stepping : Stepping
        How time passes.
    plant : Plant
        What lies between a command and the joints.
    observation : Observation
        What a policy sees.
    """

    name: str
    arm: ArmSpecification = field(default_factory=ArmSpecification)
    scene: Scene = field(default_factory=Scene)
    task: ReachTask
    stepping: Stepping = field(default_factory=Stepping)
    plant: Plant = field(default_factory=Plant, metadata=OPTIONAL)
    observation: Observation = field(default_factory=Observation, metadata=OPTIONAL)

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.observation.parts == PAPER_PARTS:  # which is the default
            object.__setattr__(self, "observation", replace(self.observation, parts=None))
        if self.task.goal.kind == "pose" and self.arm.actuated is None:
            # Also joints that turn the tool in place.
            object.__setattr__(self, "arm", replace(self.arm, actuated=()))
        available = [region.name for region in self.scene.goal_regions]
        if not available:
            raise ProblemError("a scene needs at least one goal region")
        if not self.task.goal_regions:
            object.__setattr__(self, "task", replace(self.task, goal_regions=tuple(available)))
        check_known("goal region in task.goal_regions:", self.task.goal_regions, available)
        for name in self.task.goal_regions:
            obstacle = self.scene.obstacle_around(self.scene.goal_region(name))
            if obstacle is not None:
                raise ProblemError(f"goal region {name!r} lies inside obstacle {obstacle.name!r}")

    def __repr__(self) -> str:
        goals = " and ".join(self.task.goal_regions)
        return f"ReachProblem({self.name!r}, arm {self.arm.name!r}, goals {goals})"

    @classmethod
    def load(cls, problem: "ProblemLike") -> "ReachProblem":
        """Find a problem by name, or read it from a file; KinarmError if there is none such.

        Parameters
        ----------
        problem : str, Path, mapping or ReachProblem
            ``"left"``, ``"right"`` or ``"both"``, the paper's tasks 1, 2 and 3,
            or another of `problem_names`; the path of a TOML file; what
            `to_json` returned; or a problem.
        """
        if isinstance(problem, ReachProblem):
            return problem
        if isinstance(problem, Mapping):
            return cls.from_json(problem)
        if str(problem) in PROBLEMS:
            return PROBLEMS[str(problem)]
        path = named_file("problem", problem, PAPER_TASKS)
        entries = read_problem(path)
        if isinstance(entries["task"], str):
            entries["task"] = to_plain(cls.load(entries["task"]).task)
        read = cls.from_json(entries, str(path))
        return replace(read, arm=read.arm.resolved(absolute(path).parent))

    def replace(self, **overrides: Any) -> "ReachProblem":
        """Change parts of it; KinarmError if one is unknown, or cannot be.

        Parameters
        ----------
        **overrides
            ``name``; ``arm`` (a name, a path or a specification), ``scene`` and
            ``task`` (by name, of a file, of another problem, or themselves),
            ``stepping``; ``plant`` (by name, of a file, or itself); of these four
            also a mapping, beside which defaults hold; ``observation`` (itself, a
            list of parts, or a mapping of what changes); ``reward`` and ``goal``
            (themselves, or a mapping of what changes); or any field of task,
            stepping or plant, such as ``tolerance``. None changes nothing. With
            another scene, by name or file, that lacks a goal region of the task, all
            its regions are to be reached, unless the task is given as itself.
        """
        given = {name: value for name, value in overrides.items() if value is not None}
        if not given:
            return self
        changes = _taken(given, ReachProblem)
        if "arm" in changes:
            changes["arm"] = _specification(changes["arm"])
        for name, find in (("scene", find_scene), ("plant", Plant.load)):
            if isinstance(changes.get(name), str | Path):
                changes[name] = find(changes[name])
        if isinstance(changes.get("task"), str | Path):
            changes["task"] = ReachProblem.load(changes["task"]).task
        for part, kind in PARTS.items():
            if part in changes and not isinstance(changes[part], kind):
                changes[part] = from_plain(kind, changes[part], "problem", f"{part}.")
        if "observation" in changes:
            changes["observation"] = self.observation.changed(changes["observation"])
        task = changes.get("task", self.task)
        named = isinstance(overrides.get("scene"), str | Path)
        if named and isinstance(overrides.get("task"), str | Path | None):
            regions = {region.name for region in changes["scene"].goal_regions}
            if not regions.issuperset(task.goal_regions):
                task = changes["task"] = replace(task, goal_regions=(), goal_weights=())
        for name, what in (("reward", "reward term"), ("goal", "setting of goals")):
            if isinstance(given.get(name), Mapping):
                of_part, own = dict(given[name]), getattr(task, name)
                check_known(what, of_part, init_fields(type(own)))
                given[name] = replace(own, **of_part)
        for part, kind in PARTS.items():
            if own := _taken(given, kind):
                changes[part] = replace(changes.get(part, getattr(self, part)), **own)
        settings = [name for kind in (ReachProblem, *PARTS.values()) for name in init_fields(kind)]
        check_known("setting of a problem", given, settings)
        return replace(self, **changes)

    def body_offsets(self, taken: NDArray[np.int64]) -> NDArray[np.float64]:
        """How far bodies that move are from where an episode begins, shape (n, n_moving, 3) [m].

        Takes numbers of steps, shape (n,).
        """
        times = taken.astype(np.float64) * self.stepping.time_step
        motions = [body.motion.offsets(times) for body in self.scene.bodies if body.motion]
        return np.stack(motions, axis=1) if motions else np.zeros((len(taken), 0, 3))

    def load_arm(self) -> "Arm":
        """The arm, where it stands in the scene."""
        from kinarm.arm import Arm

        mount = self.scene.mount
        return Arm.load(self.arm).placed(mount.position, mount.rotation)

    @cached_property
    def arm_digest(self) -> str:
        """Hash of what the simulator uses of the arm."""
        from kinarm.arm import Arm

        return self.arm.digest or Arm.load(self.arm).digest

    @property
    def pinned(self) -> "ReachProblem":
        """The same problem, whose arm must have its present hash."""
        return self.replace(arm=replace(self.arm, digest=self.arm_digest))

    @cached_property
    def digest(self) -> str:
        """Hash of all that behaviour depends on, without the name."""
        entries = {**self.to_json(), "arm": self.arm_digest}
        del entries["name"]
        text = json.dumps(entries, sort_keys=True)
        return hashlib.sha256(text.encode()).hexdigest()[:16]

    @cached_property
    def unseen(self) -> "ReachProblem":
        """The same problem with the standard observation; what is seen changes no trial."""
        return self.replace(observation=Observation())

    @property
    def changes(self) -> list[str]:
        """Settings of task, stepping and plant other than the shipped problem's of that name.

        Such as ``"task.tolerance = 0.03"``. Of another problem, those of the plant.
        """
        shipped = self.name in problem_names()
        base = ReachProblem.load(self.name) if shipped else self.replace(plant=Plant())
        found = []
        for part in PARTS:
            ours, theirs = getattr(self, part), getattr(base, part)
            values = ((name, getattr(ours, name)) for name in init_fields(type(ours)))
            changed = [(name, value) for name, value in values if getattr(theirs, name) != value]
            found += [f"{part}.{name} = {to_plain(value)}" for name, value in changed]
        return found

    def first_difference(self, other: "ReachProblem") -> str | None:
        """Say where behaviour first depends on another value in another problem.

        Such as ``"task.tolerance is 0.03, not 0.05"``, own value last; None if nowhere.
        """
        if other is self:
            return None
        if self.arm_digest != other.arm_digest:
            version = "another version of " if self.arm.name == other.arm.name else ""
            return f"arm is {version}{other.arm.name!r}, not {self.arm.name!r}"
        ours, theirs = (dict(_leaves(to_plain(problem))) for problem in (self, other))
        for key in dict.fromkeys((*ours, *theirs)):
            here, there = ours.get(key, "missing"), theirs.get(key, "missing")
            if here != there and key != "name" and not key.startswith("arm."):
                return f"{key} is {there}, not {here}"
        return None

    def faced_as(self, other: "ReachProblem") -> "ReachProblem":
        """The same problem, tested for contact and seen as another of the same kind of goals is."""
        alike = self.task.goal.kind == other.task.goal.kind
        return self.replace(
            tested_configurations=other.stepping.tested_configurations,
            observation=other.observation if alike else None,
        )

    def covers(self, other: "ReachProblem") -> bool:
        """Whether this is the other problem with any goal weights and further regions."""
        wider = set(self.task.goal_regions) >= set(other.task.goal_regions)
        goals = {"goal_regions": other.task.goal_regions, "goal_weights": other.task.goal_weights}
        return wider and self.replace(**goals).first_difference(other) is None

    def to_json(self) -> dict[str, Any]:
        """As a dictionary for JSON, without loss."""
        entries: dict[str, Any] = to_plain(self)
        return entries

    @classmethod
    def from_json(cls, entries: object, where: str = "problem") -> "ReachProblem":
        """Rebuild what `to_json` returned; errors name ``where``."""
        return from_plain(cls, entries, where)

    def to_toml(self) -> str:
        """As text of a problem file, without loss."""
        return tomli_w.dumps(self.to_json())

    def save(self, path: str | Path) -> None:
        """Write a problem file."""
        write_text(path, self.to_toml())


ProblemLike = ReachProblem | str | Path | Mapping[str, Any]
"""A problem, its name or file, or what `ReachProblem.to_json` returned."""

PROBLEMS = {
    name: ReachProblem(name=name, task=ReachTask(goal_regions=regions))
    for name, regions in PAPER_TASKS.items()
}
"""The paper's tasks 1, 2 and 3 by name."""


def _specification(arm: "Arm | ArmSpecification | str | Path") -> ArmSpecification:
    from kinarm.arm import Arm

    if isinstance(arm, ArmSpecification):
        return arm.resolved(Path())
    return arm.specification if isinstance(arm, Arm) else Arm.load(arm).specification


def _taken(given: dict[str, Any], kind: type) -> dict[str, Any]:
    return {name: given.pop(name) for name in init_fields(kind) if name in given}


def _leaves(value: Any, path: str = "") -> Iterator[tuple[str, Any]]:
    """Values of nested tables by paths, such as ``scene.obstacles[0].name``."""
    if isinstance(value, Mapping):
        for key, entry in value.items():
            yield from _leaves(entry, f"{path}.{key}" if path else key)
    elif isinstance(value, list):
        for number, entry in enumerate(value):
            yield from _leaves(entry, f"{path}[{number}]")
    else:
        yield path, value
