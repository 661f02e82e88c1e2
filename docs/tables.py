"""What pages hold of the code and of recorded results: ``python -m docs.tables`` writes it.

It stands between ``<!-- table NAME -->``, ``<!-- text FILE -->`` or ``<!-- code FILE -->`` and
``<!-- end -->``. A test compares it with what would be written now.
"""

import os
import re
import shlex
import textwrap
from collections.abc import Mapping
from dataclasses import fields
from pathlib import Path

import numpy as np

from docs.recorded_tables import RECORDED
from kinarm import PROBLEMS, REWARD_TERMS, Arm, Plant, RewardWeights, Scene, Simulator, plant_names
from kinarm.__main__ import COMMANDS
from kinarm._fields import init_fields, summary_of, to_plain
from kinarm.contact_pairs import link_of
from kinarm.enclosures import inner_capsule
from kinarm.envs import ENVIRONMENTS
from kinarm.evaluation import METRICS
from kinarm.evaluation.commands import arms, problem
from kinarm.evaluation.outcomes import HOLDING_STEPS
from kinarm.evaluation.report.templating import markdown_table
from kinarm.goals import GoalSpecification
from kinarm.observation import OBSERVATION
from kinarm.observation_layout import ObservationLayout
from kinarm.observation_part import ACTUATED, JOINTS, ONCE, SLOTS, Part
from kinarm.policies import find_learner

DOCS = Path(__file__).parent
RESULTS = DOCS.parent / "data" / "results"


SYMBOLS = {
    "n": "number of trials; of several training seeds, all their trials together",
    "S, C, T": "sets of the trials that ended as success, in contact (collision) or truncated",
    "dᵢ": "final distance of trial i [m]",
    "kᵢ": "steps that trial i took",
    "bᵢ": "bound of trial i: steps that the oracle proves to be necessary",
    "gᵢ": "goals that trial i reached",
    "rᵢ": "error of the goal's direction, rotation or joints at the end of trial i [rad]",
    "zᵢ": "steps of trial i that a shield replaced",
    "aᵢ": "closest approach of trial i, if success does not end it [m]",
    "eᵢ": f"largest distance after the last {HOLDING_STEPS} steps of that longer trial [m]",
    "H": "set of these longer trials that touch something",
}
"""Meaning of the letters in definitions of metrics."""


def numbers(values: np.ndarray) -> str:
    """Format a vector to a millimetre, without trailing zeros."""
    return ", ".join(f"{round(float(value), 3) + 0.0:g}" for value in values)


def arm_table(name: str) -> str:
    """Joints of an arm."""
    arm, moves = Arm.load(name), np.rad2deg(Simulator("right").step_limit)
    chain, velocity = arm.chain, np.rad2deg(arm.model.velocityLimit)
    rows = [
        [
            str(k + 1),
            numbers(translation),
            numbers(chain.axis[k]),
            f"{np.rad2deg(chain.lower[k]):.0f} to {np.rad2deg(chain.upper[k]):.0f}",
            f"{velocity[k]:.0f}",
            f"{moves[k]:.0f}" if k < len(moves) else "held",
        ]
        for k, translation in enumerate(chain.translation)
    ]
    rows.append(["tool point", numbers(chain.tool), "", "", "", ""])
    header = ["joint", "origin in its parent [m]", "axis", "limits [deg]"]
    return markdown_table([*header, "velocity limit [deg/s]", "per step [deg]"], rows)


def capsule_table(name: str) -> str:
    """Collision shapes of an arm."""
    rows = []
    for shape in Arm.load(name).geometry.geometryObjects:
        (start, end), radius, _ = inner_capsule(shape)
        frame = f"joint {shape.parentJoint}" if shape.parentJoint else "world"
        link = link_of(shape).replace("_", " ")
        rows.append([link, frame, numbers(start), numbers(end), f"{radius:.3f}"])
    return markdown_table(["body", "frame", "from [m]", "to [m]", "radius [m]"], rows)


def arms_table() -> str:
    """The arms that have a name."""
    rows = [[f"`{name}`", *others] for name, *others, _ in arms.ListRequest().rows()]
    return markdown_table(arms.HEADINGS[:-1], rows)


def shipped_problems_table() -> str:
    """The problems that ship, but for the paper's."""
    return markdown_table(
        problem.HEADINGS,
        [[f"`{name}`", *others] for name, *others in problem.rows() if name not in PROBLEMS],
    )


def scene_table() -> str:
    """Boxes of the paper's scene."""
    scene = Scene()
    rows = [
        [
            f"{kind} `{box.name}`",
            *(
                f"{low:g}" if low == high else f"{low:g} to {high:g}"
                for low, high in zip(box.lower, box.upper, strict=True)
            ),
        ]
        for kind, boxes in (("obstacle", scene.obstacles), ("goal region", scene.goal_regions))
        for box in boxes
    ]
    return markdown_table(["box", "x [m]", "y [m]", "z [m]"], rows)


def problems_table() -> str:
    """The paper's problems, and their environments."""
    rows = [
        [
            f"`{name}`",
            f"task {number}",
            " and ".join(problem.task.goal_regions),
            ", ".join(f"`{env}`" for env, problem_of in ENVIRONMENTS.items() if problem_of == name),
        ]
        for number, (name, problem) in enumerate(PROBLEMS.items(), start=1)
    ]
    return markdown_table(["problem", "in the paper", "goal regions", "environments"], rows)


def reward_table() -> str:
    """Terms of the reward."""
    weights = RewardWeights()
    rows = [
        [f"`{name}`", f"{getattr(weights, name):g}", summary_of(RewardWeights, name)]
        for name in REWARD_TERMS
    ]
    return markdown_table(["term", "weight by default", "what the weight is"], rows)


def goals_table() -> str:
    """What goals may be, and how they are reached."""
    default, rows = GoalSpecification(), []
    for name in init_fields(GoalSpecification):
        value = to_plain(getattr(default, name))
        meaning = summary_of(GoalSpecification, name).replace("``", "`")
        rows.append([f"`{name}`", "" if value in (None, []) else f"`{value}`", meaning])
    return markdown_table(["field of `[task.goal]`", "default", "meaning"], rows)


def observation_table() -> str:
    """Parts of the paper's observation, for an arm of six joints."""
    layout = ObservationLayout.sized(PROBLEMS["right"], 6, 5)
    places = [f"{place.start} to {place.stop - 1}" for place in layout.places.values()]
    return parts_table("index", dict(zip(layout.parts, places, strict=True)))


def all_parts_table() -> str:
    """Parts of observations that problems may choose."""
    owners = {JOINTS: "joint", ACTUATED: "actuated joint", SLOTS: "slot"}
    lengths = {
        part: f"{len(part.signs)}{' + actuated joints,' * part.sloped}"
        f"{' per ' * (part.of != ONCE)}{owners.get(part.of, '')}"
        for part in OBSERVATION
    }
    return parts_table("entries", lengths)


def parts_table(title: str, column: Mapping[Part, str]) -> str:
    """A table of parts, with a first column of its own."""
    rows = [
        [
            first,
            f"`{part.name}`",
            part.meaning,
            part.unit,
            f"`{' '.join(f'{sign:+d}'[0] if sign else 'j' for sign in part.signs)}"
            f"{' j' * part.sloped}`",
        ]
        for part, first in column.items()
    ]
    return markdown_table([title, "part", "meaning", "unit", "signs in the mirror"], rows)


def recipe_table(recipes: Mapping[str, object]) -> str:
    """Settings of a learner's recipes."""
    skipped = ("problem", "seed", "recipe")
    rows = [
        [f"`{item.name}`", *(setting(getattr(each, item.name)) for each in recipes.values())]
        for item in fields(next(iter(recipes.values())))
        if item.name not in skipped
    ]
    return markdown_table(["setting", *(f"`{name}`" for name in recipes)], rows)


def setting(value: object) -> str:
    """Format a setting of a recipe."""
    if value is None:
        return "not given"
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, RewardWeights):
        weights = ((name, getattr(value, name)) for name in REWARD_TERMS)
        return ", ".join(f"{name} {weight:g}" for name, weight in weights if weight)
    return ", ".join(map(str, value)) if isinstance(value, tuple) else str(value)


def metrics_table() -> str:
    """The figures of merit: what they are called, mean and how they are computed."""
    rows = [
        [
            f"`{name}`",
            metric.heading or beside_heading(name),
            metric.meaning,
            metric.definition.replace("|", "\\|"),
            " ".join(filter(None, (metric.unit, metric.interval))),
        ]
        for name, metric in METRICS.items()
    ]
    return markdown_table(["name", "column", "what it is", "formula", "unit, interval"], rows)


def beside_heading(name: str) -> str:
    """Column in which a metric stands in brackets, if it does."""
    outer = (each for each in METRICS.values() if each.beside and each.beside[0] == name)
    return next((f"in brackets: {each.heading}" for each in outer), "")


def symbols_table() -> str:
    """The letters of the formulas."""
    return markdown_table(
        ["letter", "what it stands for"], [list(item) for item in SYMBOLS.items()]
    )


def programs_table() -> str:
    """The programs, by what one wants to do."""
    rows = [[purpose, f"`kinarm-{name}`"] for name, (_, purpose) in COMMANDS.items()]
    return markdown_table(["to", "type"], rows)


def plants_table() -> str:
    """What the shipped plants set."""
    rows = []
    for name in plant_names():
        entries = to_plain(Plant.load(name))
        ranges = {key: " to ".join(map(str, np.ravel(value))) for key, value in entries.items()}
        said = ", ".join(f"`{key}` {value}" for key, value in ranges.items())
        rows.append([f"`{name}`", said or "nothing"])
    return markdown_table(["plant", "settings"], rows)


TABLES = {
    **RECORDED,
    "plants": plants_table,
    "arm": lambda: arm_table("paper"),
    "capsules": lambda: capsule_table("paper"),
    "arms": arms_table,
    "shipped-problems": shipped_problems_table,
    "scene": scene_table,
    "problems": problems_table,
    "programs": programs_table,
    "reward": reward_table,
    "goals": goals_table,
    "observation": observation_table,
    "observation-parts": all_parts_table,
    "metrics": metrics_table,
    "symbols": symbols_table,
    "ars-recipes": lambda: recipe_table(find_learner("ars").recipes),
    "ppo-recipes": lambda: recipe_table(find_learner("ppo").recipes),
}


PART = re.compile(r"^<!-- (table|text|code) (.+) -->\n(?:.*\n)*?<!-- end -->$", re.M)
"""What stands in a page between two comments, and comes from elsewhere."""


def filled(page: Path) -> str:
    """A page with tables, texts and code as they are now."""
    return PART.sub(lambda part: _part(page.parent, *part.groups()), page.read_text("utf-8"))


def _part(folder: Path, kind: str, told: str) -> str:
    """A part of a page in a folder: which one, and from and before which words of its file."""
    name, *cuts = shlex.split(told)
    if kind == "table":
        made = f"\n{TABLES[name]()}\n"
    else:
        source = (folder / name).resolve()
        text = _between(source.read_text("utf-8"), **dict(cut.split("=", 1) for cut in cuts))
        if kind == "code":
            made = f"```python\n{textwrap.dedent(text).strip()}\n```\n"
        else:
            made = f"\n{_moved(text, source.parent, folder).strip()}\n\n"
    return f"<!-- {kind} {told} -->\n{made}<!-- end -->"


def _between(text: str, before: str = "", **begin: str) -> str:
    """Lines of a text, from the first that holds some words, and before one with others."""
    start = text.rfind("\n", 0, text.index(begin.get("from", ""))) + 1
    return text[start : text.rfind("\n", 0, text.index(before, start)) + 1 if before else None]


def _moved(text: str, source: Path, folder: Path) -> str:
    """Markdown of another folder, with its headings a level lower."""
    text = re.sub(r"^#", "##", text, flags=re.M)
    return re.sub(
        r"\]\((?!\w+:|#)([^)]+)\)",
        lambda link: f"]({os.path.relpath(source / link[1], folder)})",
        text,
    )


if __name__ == "__main__":
    for each in DOCS.glob("*/*.md"):
        each.write_text(filled(each), "utf-8")
