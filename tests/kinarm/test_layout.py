"""What is compiled into the kernels from other files is part of their cache key."""

import ast
import hashlib
import re
from importlib import import_module
from inspect import isfunction
from pathlib import Path

import pytest

KERNELS = {
    f"{package}.{path.stem}": path
    for package in (
        "kinarm.kernels",
        "kinarm.policies.ars",
        "kinarm.policies.oracle.kernels",
        "kinarm.policies.ppo.kernels",
        "kinarm.viewer.kernels",
    )
    for path in sorted(Path(import_module(package).__file__).parent.glob("*.py"))
}
SOURCES = {name: path.read_text(encoding="utf-8") for name, path in KERNELS.items()}
CACHED = [name for name, text in SOURCES.items() if re.search(r"^@(lean_)?kernel$", text, re.M)]


def imported_names(source):
    """Names that a source file imports from modules of kinarm, by module."""
    nodes = [node for node in ast.parse(source).body if isinstance(node, ast.ImportFrom)]
    ours = [node for node in nodes if node.module.startswith("kinarm.")]
    return {node.module: [alias.name for alias in node.names] for node in ours}


def compiled_in(source):
    """Sources, layouts and constants that a kernel's file takes from others."""
    parts = {}
    for module, names in imported_names(source).items():
        values = {name: getattr(import_module(module), name) for name in names}
        if module in SOURCES or any(hasattr(value, "py_func") for value in values.values()):
            text = Path(import_module(module).__file__).read_text(encoding="utf-8")
            parts |= {module: text} | compiled_in(text)
        else:
            data = {name: value for name, value in values.items() if not isfunction(value)}
            fields = {name: getattr(value, "_fields", value) for name, value in data.items()}
            parts |= {f"{module}.{name}": repr(value) for name, value in fields.items()}
    return parts


def test_what_is_compiled_in_has_no_cache_of_its_own():
    assert {name.rpartition(".")[2] for name in CACHED} == {
        "approach",
        "closest",
        "enclosing",
        "frames",
        "imitation",
        "inverse",
        "kernels",
        "projection",
        "rasterising",
        "rollout",
        "shading",
        "starting",
        "update",
    }
    for name in CACHED:
        assert not set(CACHED) & set(compiled_in(SOURCES[name]))


@pytest.mark.parametrize("name", CACHED)
def test_layout_names_what_is_compiled_in(name):
    parts = sorted(compiled_in(SOURCES[name]).items())
    digest = hashlib.sha256(repr(parts).encode()).hexdigest()[:12]
    stated = re.search(r'^LAYOUT = "(\w*)"$', SOURCES[name], re.MULTILINE)
    assert stated.group(1) == digest, f'set LAYOUT = "{digest}" in {KERNELS[name]}'
