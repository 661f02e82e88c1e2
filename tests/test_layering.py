"""Imports go one way, packages say what they offer, and light imports stay light."""

import ast
import importlib
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parent.parent
PACKAGES = {"kinarm": "kinarm", "policies": "kinarm.policies", "evaluation": "kinarm.evaluation"}
FORBIDDEN = {
    "kinarm": ("kinarm.policies", "kinarm.evaluation", "policies", "evaluation"),
    "policies": ("kinarm.evaluation", "policies", "evaluation"),
    "evaluation": ("policies", "evaluation"),
}
SOURCES = [path for folder in PACKAGES for path in sorted((ROOT / folder).glob("**/*.py"))]


def nodes_of(tree, *, types):
    """All nodes of a syntax tree, or those that do not stand there for types alone."""
    for node in ast.iter_child_nodes(tree):
        if types or not (isinstance(node, ast.If) and ast.unparse(node.test) == "TYPE_CHECKING"):
            yield node
            yield from nodes_of(node, types=types)


def imported_modules(path, *, types=True):
    """Names of everything that a source file imports, at any depth."""
    names = set()
    for node in nodes_of(ast.parse(path.read_text(encoding="utf-8")), types=types):
        if isinstance(node, ast.Import):
            names |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{path} uses a relative import"
            names.add(node.module)
            names |= {f"{node.module}.{alias.name}" for alias in node.names}
    return names


def lies_in(name, package):
    return name == package or name.startswith(f"{package}.")


@pytest.mark.parametrize("folder", PACKAGES)
def test_imports_go_one_way(folder):
    forbidden = (*FORBIDDEN[folder], "kinarm.kinarm", "tests")
    for path in (ROOT / folder).glob("**/*.py"):
        names = imported_modules(path)
        wrong = {name for name in names if any(lies_in(name, bad) for bad in forbidden)}
        assert not wrong, path


def module_name(path):
    folder, *rest = path.relative_to(ROOT).with_suffix("").parts
    parts = [PACKAGES[folder], *rest]
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


def modules_needed():
    """Modules that each module imports, at any depth; a package only for what it defines itself."""
    names, needed = {module_name(path): path for path in SOURCES}, {}
    for name, path in names.items():
        found = imported_modules(path, types=False) & set(names)
        packages = {
            other for other in found if any(lies_in(each, other) for each in found - {other})
        }
        needed[name] = found - packages - {name}
    return needed


def test_no_module_needs_itself():
    """Not even by way of others, and in functions."""
    needed, cyclic = modules_needed(), set()
    for name in needed:
        reached, waiting = set(), {name}
        while waiting:
            waiting = set().union(*(needed[each] for each in waiting)) - reached
            reached |= waiting
        if name in reached:
            cyclic.add(name)
    assert not cyclic


def test_every_source_folder_was_searched():
    assert {path.relative_to(ROOT).parts[0] for path in SOURCES} == set(PACKAGES)
    assert "kinarm.arm" in imported_modules(ROOT / "kinarm" / "simulator.py")
    assert "kinarm.simulator" in imported_modules(ROOT / "policies" / "oracle" / "oracle.py")


@pytest.mark.parametrize("package", PACKAGES.values())
class TestExports:
    def test_every_name_can_be_imported(self, package):
        module = importlib.import_module(package)
        for name in module.__all__:
            assert getattr(module, name) is not None

    def test_names_are_sorted_and_unique(self, package):
        names = importlib.import_module(package).__all__
        assert list(names) == sorted(set(names))

    def test_type_checkers_see_the_same_names(self, package):
        module = importlib.import_module(package)
        stub = Path(module.__file__).with_suffix(".pyi")
        nodes = ast.parse(stub.read_text(encoding="utf-8")).body
        imports = [node for node in nodes if isinstance(node, ast.ImportFrom)]
        declared = [alias for node in imports for alias in node.names]
        assert all(alias.asname == alias.name for alias in declared)  # "as" marks an export
        assert sorted(alias.name for alias in declared) == list(module.__all__)

    def test_unknown_attribute(self, package):
        module = importlib.import_module(package)
        with pytest.raises(AttributeError, match="nothing_like_this"):
            module.nothing_like_this  # noqa: B018


def loaded_by(statement):
    """Top-level packages that a fresh interpreter holds after a statement."""
    code = f"{statement}\nimport sys\nprint(*{{name.split('.')[0] for name in sys.modules}})"
    done = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=True, cwd=ROOT
    )
    return set(done.stdout.split())


HEAVY = {"numba", "torch", "matplotlib", "pinocchio", "coal", "scipy", "meshcat", "rich"}


@pytest.mark.parametrize(
    ("statement", "needed", "absent"),
    [
        *((f"import {package}", {"kinarm"}, HEAVY) for package in PACKAGES.values()),
        (
            "import kinarm; kinarm.Simulator, kinarm.ReachEnv, kinarm.ReachVectorEnv",
            {"numba", "pinocchio"},
            {"torch", "matplotlib", "meshcat"},
        ),
        ("from kinarm.policies import find_learner as f; f('ars'), f('ppo')", {"kinarm"}, HEAVY),
        (
            "from kinarm.policies import PPOConfig, PPOState, load_checkpoint, train_policy",
            {"kinarm"},
            {"torch", "stable_baselines3"},
        ),
        (
            "import kinarm.policies.library, kinarm.policies.ars.algorithm",
            {"numba"},
            {"torch", "matplotlib", "meshcat"},
        ),
    ],
)
def test_light_imports_stay_light(statement, needed, absent):
    """Settings and names of learners say what is missing only when there is something to train."""
    loaded = loaded_by(statement)
    assert needed <= loaded
    assert not loaded & absent
