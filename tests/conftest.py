"""Shared fixtures: the shipped arms, robots written on the spot, and simulators of both."""

import os
import sys
from collections.abc import Callable, Iterator, Sequence
from functools import partial
from pathlib import Path

import pytest
from hanging_chain import hanging_chain
from hypothesis import settings
from mesh_files import CUBE_CORNERS, write_obj, write_stl
from numba.core.compiler import CompilerBase
from random_scenes import random_scene

from kinarm.arm import Arm
from kinarm.problem import ReachProblem
from kinarm.simulator import Simulator

for _name in ("COLUMNS", "LINES"):  # readline, which pytest loads, tells them to child processes
    os.environ.pop(_name, None)
    os.unsetenv(_name)

settings.register_profile("repeatable", derandomize=True, database=None, deadline=None)
settings.load_profile("repeatable")

SHIPPED_ARMS = ("lrmate200ic_5l", "paper", "paper_flange")

LIMITED = '<limit lower="-2" upper="2" velocity="3" effort="0"/>'


def joint(
    kind: str = "revolute",
    xyz: str = "0 0 0.2",
    rpy: str = "0 0 0",
    axis: str = "0 0 1",
    limit: str = LIMITED,
) -> dict[str, str]:
    """Describe the joint of a chain."""
    return {"kind": kind, "xyz": xyz, "rpy": rpy, "axis": axis, "limit": limit}


def collision(geometry: str, xyz: str = "0 0 0", rpy: str = "0 0 0") -> str:
    """Describe a collision shape."""
    origin = f'<origin xyz="{xyz}" rpy="{rpy}"/>'
    return f"<collision>{origin}<geometry>{geometry}</geometry></collision>"


def robot_xml(
    joints: Sequence[dict[str, str]],
    shapes: dict[int, str] | None = None,
    *,
    tool: str | None = "0.1 0 0.05",
    version: str = 'version="1.2"',
    extra: str = "",
) -> str:
    """Write a chain of links, link_0 to link_n, with collision shapes and a tool frame."""
    parts = [
        f'<link name="link_{i}">{(shapes or {}).get(i, "")}</link>' for i in range(len(joints) + 1)
    ]
    for i, item in enumerate(joints):
        parts.append(
            f'<joint name="joint_{i + 1}" type="{item["kind"]}">'
            f'<parent link="link_{i}"/><child link="link_{i + 1}"/>'
            f'<origin xyz="{item["xyz"]}" rpy="{item["rpy"]}"/>'
            f'<axis xyz="{item["axis"]}"/>{item["limit"]}</joint>'
        )
    if tool is not None:
        parts.append(
            '<link name="tool0"/><joint name="mount" type="fixed">'
            f'<parent link="link_{len(joints)}"/><child link="tool0"/>'
            f'<origin xyz="{tool}"/></joint>'
        )
    return f'<robot name="made" {version}>{"".join(parts)}{extra}</robot>'


SKIPPED = "kinarm/skipped"
"""Where the names of tests that a run skipped are kept until the next one."""


def pytest_addoption(parser: pytest.Parser) -> None:
    """Let a run take up what another one left."""
    told = "run the slow tests, and those that the last run without this option skipped"
    parser.addoption("--rest", action="store_true", help=told)


class Skipped:
    """Keeps what a run skips, for want of a library above all.

    Parameters
    ----------
    config : pytest.Config
        Configuration of the run.
    """

    def __init__(self, config: pytest.Config) -> None:
        self.config, self.names = config, set[str]()

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        if report.skipped:
            self.names.add(report.nodeid)

    def pytest_collectreport(self, report: pytest.CollectReport) -> None:
        if report.skipped:
            self.names.add(report.nodeid)

    def pytest_sessionfinish(self) -> None:
        self.config.cache.set(SKIPPED, sorted(self.names))


def pytest_configure(config: pytest.Config) -> None:
    """Note what is skipped, once for all workers, if the run keeps anything."""
    keeps = config.pluginmanager.hasplugin("cacheprovider")
    if keeps and not config.getoption("rest") and not hasattr(config, "workerinput"):
        config.pluginmanager.register(Skipped(config))


@pytest.hookimpl(trylast=True)
def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Begin with the files that take long, so that no worker ends alone with one of them."""
    slow = {item for item in items if item.get_closest_marker("slow")}
    if config.getoption("rest"):
        skipped = tuple(config.cache.get(SKIPPED, []))
        left = {item for item in items if item in slow or item.nodeid.startswith(skipped)}
        config.hook.pytest_deselected(items=[item for item in items if item not in left])
        items[:] = [item for item in items if item in left]
    files = {item.path for item in slow}
    items.sort(key=lambda item: item.path not in files)


@pytest.fixture(scope="session", autouse=True)
def _untraced_compiling() -> Iterator[None]:
    """Numba compiles without being traced."""
    compile_traced = CompilerBase.compile_extra

    def compile_extra(self: CompilerBase, function: Callable[..., object]) -> object:
        tracer = sys.gettrace()
        sys.settrace(None)
        try:
            return compile_traced(self, function)
        finally:
            sys.settrace(tracer)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(CompilerBase, "compile_extra", compile_extra)
        yield


@pytest.fixture(scope="session", autouse=True)
def own_cache(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    """Keep what is cached out of the user's folder, in other processes, too.

    The workers of a run share it: what one has computed, the others read.
    """
    folder = tmp_path_factory.getbasetemp()
    if "PYTEST_XDIST_WORKER" in os.environ:
        folder = folder.parent
    folder /= "cache"
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("KINARM_CACHE", str(folder))
        yield folder


@pytest.fixture(scope="session")
def make_joint() -> Callable[..., dict[str, str]]:
    return joint


@pytest.fixture(scope="session")
def make_collision() -> Callable[..., str]:
    return collision


@pytest.fixture(scope="session")
def write_robot(tmp_path_factory: pytest.TempPathFactory) -> Callable[..., Path]:
    """Write a robot description to a new file and return its path."""

    def write(*args: object, **settings: object) -> Path:
        path = tmp_path_factory.mktemp("robot") / "made.urdf"
        path.write_text(robot_xml(*args, **settings))
        return path

    return write


@pytest.fixture(scope="session")
def hanging(write_robot: Callable[..., Path]) -> Callable[..., Simulator]:
    return partial(hanging_chain, joint, collision, write_robot)


@pytest.fixture(scope="session")
def shipped_arms() -> dict[str, Arm]:
    return {name: Arm.load(name) for name in SHIPPED_ARMS}


@pytest.fixture(scope="session")
def sliding_arm(write_robot: Callable[..., Path]) -> Arm:
    """Five skewed axes, two of them prismatic, with a primitive of every kind."""
    joints = [
        joint(xyz="0.02 0.03 0.45", rpy="0.1 0 0.2"),
        joint(
            "prismatic",
            xyz="0.15 0 0.05",
            rpy="0.3 0.9 -0.4",
            axis="0.6 0 0.8",
            limit='<limit lower="-0.1" upper="0.3" velocity="0.9" effort="0"/>',
        ),
        joint(xyz="0.2 0.02 0.1", rpy="1 0.4 0", axis="0.36 0.48 0.8"),
        joint(
            "prismatic",
            xyz="0 0 0.15",
            axis="0 -1 0",
            limit='<limit lower="-0.2" upper="0.2" velocity="0.7" effort="0"/>',
        ),
        joint(xyz="0.15 0 0.05", rpy="-0.7 0 0.9", axis="0 1 0"),
    ]
    shapes = {
        0: collision('<cylinder radius="0.08" length="0.1"/>', xyz="0 0 0.06"),
        2: collision('<box size="0.1 0.06 0.08"/>', xyz="0.02 0 0.03", rpy="0.2 0.1 0.4"),
        3: collision('<sphere radius="0.05"/>', xyz="0 0 0.05")
        + collision('<capsule radius="0.03" length="0.1"/>', rpy="0.5 0 0"),
        5: collision('<cylinder radius="0.03" length="0.12"/>', xyz="0.03 0 0.02", rpy="0.4 1 0"),
    }
    return Arm.load(write_robot(joints, shapes))


@pytest.fixture(scope="session")
def mesh_arm(tmp_path_factory: pytest.TempPathFactory) -> Arm:
    """Four axes whose links are meshes (STL and OBJ), boxes and cylinders."""
    folder = tmp_path_factory.mktemp("meshes")
    write_stl(folder / "bar.stl", (CUBE_CORNERS - [0.5, 0.5, 0]) * [0.08, 0.1, 0.28])
    wedge = (CUBE_CORNERS - 0.5) * [0.3, 0.08, 0.06]
    wedge[CUBE_CORNERS[:, 0] == 1] *= [1, 0.4, 0.4]
    write_obj(folder / "wedge.obj", wedge)
    joints = [
        joint(xyz="0 0 0.3", limit=LIMITED.replace("2", "3")),
        joint(xyz="0.05 0 0.1", axis="0 1 0"),
        joint(xyz="0 0 0.3", axis="0 -1 0"),
        joint(xyz="0.3 0 0", axis="0 1 0"),
    ]
    shapes = {
        0: collision('<box size="0.1 0.12 0.08"/>', xyz="0 0 0.04"),
        2: collision('<mesh filename="package://made/bar.stl"/>'),
        3: collision('<mesh filename="package://made/wedge.obj"/>', xyz="0.15 0 0"),
        4: collision('<cylinder radius="0.02" length="0.1"/>', xyz="0.08 0 0", rpy="0 1.5708 0"),
    }
    path = folder / "mesh.urdf"
    path.write_text(robot_xml(joints, shapes, tool="0.14 0 0"))
    xml = path.read_text().replace("package://made/", f"{folder}/")
    path.write_text(xml)
    return Arm.load(path)


@pytest.fixture(scope="session")
def simulators(
    shipped_arms: dict[str, Arm], sliding_arm: Arm, mesh_arm: Arm
) -> dict[str, Simulator]:
    """One single-threaded simulator per arm, problem ``both``, and one of bodies of all shapes.

    Steps are tested at four configurations, as the reference can be quickly and to the bit.
    """
    arms = {**shipped_arms, "sliding": sliding_arm, "mesh": mesh_arm}
    both = ReachProblem.load("both").replace(tested_configurations=4)
    problems = {name: both.replace(arm=arm) for name, arm in arms.items()}
    problems["bodies"] = both.replace(scene=random_scene(3, 7, largest=0.25))
    return {name: Simulator(problem, threads=1) for name, problem in problems.items()}


@pytest.fixture(scope="session")
def simulator(simulators: dict[str, Simulator]) -> Simulator:
    """The default arm, problem ``both``."""
    return simulators["paper"]


@pytest.fixture(params=["paper", "sliding", "mesh", "bodies"])
def any_simulator(request: pytest.FixtureRequest, simulators: dict[str, Simulator]) -> Simulator:
    """Of the default arm's capsules, of slides and primitives of every kind, and of meshes.

    The last one is of the default arm among bodies of every shape.
    """
    return simulators[request.param]
