"""Arms of the extra robots, and the problems that they are tested in."""

from importlib import metadata

import pytest

from kinarm.problem import ReachProblem
from kinarm.simulator import Simulator

KNOWN_ARMS = ("ur3", "ur5", "ur10", "panda", "xarm7", "z1", "kinova", "so100", "so101")
EACH_ARM = [
    pytest.param(name, marks=[] if name in ("ur5", "panda", "so101") else pytest.mark.rare)
    for name in KNOWN_ARMS
]


def is_installed() -> bool:
    """Whether the extra robots, which brings the meshes, is installed."""
    try:
        return bool(metadata.version("example-robot-data"))
    except metadata.PackageNotFoundError:
        return False


INSTALLED = pytest.mark.skipif(not is_installed(), reason="needs the extra robots")


def simulator_among_boxes(name: str) -> Simulator:
    """An arm between the paper's benches; a small one on a desk."""
    scene = "desk" if name.startswith("so") else "benches"
    problem = ReachProblem.load("both").replace(arm=name, scene=scene, time_step=0.04)
    return Simulator(problem, threads=1)
