"""Sphinx directive ``kinarm-table``: tables that are read from the code, so that they stay true."""

from dataclasses import fields

import numpy as np
from docutils import nodes
from sphinx.application import Sphinx
from sphinx.util.docutils import SphinxDirective

from kinarm import Arm, Simulator, arm_names
from kinarm.collision import enclosing_capsule
from kinarm.evaluation import METRICS
from kinarm.evaluation.reproduction.tables import markdown
from kinarm.policies import find_learner
from kinarm.task import RewardWeights


def numbers(values: np.ndarray) -> str:
    """Format a vector to a millimetre, without trailing zeros."""
    return ", ".join(f"{round(float(value), 3) + 0.0:g}" for value in values)


def arm_table(name: str) -> str:
    """Axes of an arm."""
    arm = Arm.load(name)
    chain, time_step = arm.chain, Simulator(arm).time_step
    rows = [
        [
            str(k + 1),
            numbers(chain.translation[k]),
            numbers(chain.axis[k]),
            f"{np.rad2deg(chain.lower[k]):.0f} to {np.rad2deg(chain.upper[k]):.0f}",
            f"{np.rad2deg(chain.speed[k]):.0f}",
            f"{np.rad2deg(chain.speed[k]) * time_step:.0f}" if k < arm.n_actuated else "held",
        ]
        for k in range(arm.n_axes)
    ]
    rows.append(["tool point", numbers(chain.tool), "", "", "", ""])
    header = ["axis", "origin in its parent [m]", "direction", "limits [deg]", "speed [deg/s]"]
    return markdown([*header, "per step [deg]"], rows)


def capsule_table(name: str) -> str:
    """Collision shapes of an arm."""
    rows = []
    for shape in Arm.load(name).geometry.geometryObjects:
        start, end, radius = enclosing_capsule(shape)
        frame = f"axis {shape.parentJoint}" if shape.parentJoint else "world"
        link = shape.name.rsplit("_", 1)[0].replace("_", " ")
        rows.append([link, frame, numbers(start), numbers(end), f"{radius:.3f}"])
    return markdown(["body", "frame", "from [m]", "to [m]", "radius [m]"], rows)


def arms_table() -> str:
    """The shipped arms beside each other."""
    rows = []
    for name in arm_names():
        arm = Arm.load(name)
        links = np.linalg.norm(arm.chain.translation, axis=1)
        rows.append(
            [
                f"`{name}`",
                numbers(links[2:3]),
                numbers(links[3:4]),
                numbers(arm.chain.tool[:1]),
                numbers(arm.tool_position(arm.home)),
                numbers(np.rad2deg(arm.speed)),
            ]
        )
    header = ["arm", "axis 2 to 3 [m]", "axis 3 to 4 [m]", "tool [m]", "tool point at zero [m]"]
    return markdown([*header, "speeds [deg/s]"], rows)


def setting_text(value: object) -> str:
    """A setting as a table shows it; of reward weights those that are not the default."""
    if not isinstance(value, RewardWeights):
        return "the task's" if value is None else f"{value}"
    default = RewardWeights()
    weights = {item.name: getattr(value, item.name) for item in fields(value)}
    return ", ".join(f"{n} {w:g}" for n, w in weights.items() if w != getattr(default, n))


def recipe_table(recipes: dict[str, object]) -> str:
    """Settings of a learner's recipes."""
    skipped = ("problem", "seed", "recipe")
    rows = [
        [f"`{item.name}`", *(setting_text(getattr(c, item.name)) for c in recipes.values())]
        for item in fields(next(iter(recipes.values())))
        if item.name not in skipped
    ]
    return markdown(["setting", *(f"`{name}`" for name in recipes)], rows)


def metrics_table() -> str:
    """The figures of merit."""
    rows = [
        [f"`{name}`", metric.meaning, metric.unit, metric.interval or "", metric.heading]
        for name, metric in METRICS.items()
    ]
    return markdown(["name", "meaning", "unit", "interval (95 %)", "column"], rows)


TABLES = {
    "arm": lambda: arm_table("paper"),
    "capsules": lambda: capsule_table("paper"),
    "arms": arms_table,
    "metrics": metrics_table,
    "ars-recipes": lambda: recipe_table(find_learner("ars").recipes),
    "ppo-recipes": lambda: recipe_table(find_learner("ppo").recipes),
}


class KinarmTable(SphinxDirective):
    """Insert one of `TABLES`, in a MyST page."""

    required_arguments = 1

    def run(self) -> list[nodes.Node]:
        return self.parse_text_to_nodes(TABLES[self.arguments[0]]())


def setup(app: Sphinx) -> dict[str, bool]:
    """Register the directive."""
    app.add_directive("kinarm-table", KinarmTable)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
