"""What is compiled into the kernels from other files is part of their cache key."""

import ast
import hashlib
import re
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path

import pytest

from kinarm import kernels

FOLDER = Path(kernels.__file__).parent
OF_THE_ORACLE = {"approach", "overlap", "projection"}
NAMES = {path.stem for path in FOLDER.glob("*.py")} - {"__init__"} - OF_THE_ORACLE


def source_of(module):
    return Path(find_spec(module).origin).read_text(encoding="utf-8")


def is_compiled(module):
    """Whether a module holds kernels or what is compiled into them."""
    return module.startswith("kinarm.kernels.") or "\n@inlined\n" in source_of(module)


def is_cached(module):
    return "\n@kernel\n" in source_of(module)


def compiled_in(module):
    """Sources, layouts and constants that a module of kernels takes from others, by name."""
    parts = {}
    for node in ast.parse(source_of(module)).body:
        if not (isinstance(node, ast.ImportFrom) and node.module.startswith("kinarm.")):
            continue
        if is_compiled(node.module):
            parts[node.module] = source_of(node.module)
            parts |= compiled_in(node.module)
            continue
        for alias in node.names:
            value = getattr(import_module(node.module), alias.name)
            parts[f"{node.module}.{alias.name}"] = repr(getattr(value, "_fields", value))
    return parts


CACHED = sorted(name for name in NAMES if is_cached(f"kinarm.kernels.{name}"))


def test_rollouts_alone_are_cached():
    assert CACHED == ["rollout"]


@pytest.mark.parametrize("name", CACHED)
def test_what_is_compiled_in_has_no_cache_of_its_own(name):
    assert not {f"kinarm.kernels.{other}" for other in CACHED} & set(
        compiled_in(f"kinarm.kernels.{name}")
    )


@pytest.mark.parametrize("name", CACHED)
def test_every_file_of_kernels_and_the_observation_are_compiled_in(name):
    parts = compiled_in(f"kinarm.kernels.{name}")
    others = {f"kinarm.kernels.{other}" for other in NAMES - {name}}
    assert others | {"kinarm.observation"} <= set(parts)
    for layout in ("kinarm.chain.Chain", "kinarm.collision.ContactShapes", "kinarm.episodes.Rules"):
        assert layout in parts


@pytest.mark.parametrize("name", CACHED)
def test_layout_names_what_is_compiled_in(name):
    parts = sorted(compiled_in(f"kinarm.kernels.{name}").items())
    digest = hashlib.sha256(repr(parts).encode()).hexdigest()[:12]
    stated = re.search(r'^LAYOUT = "(\w*)"$', source_of(f"kinarm.kernels.{name}"), re.MULTILINE)
    assert stated.group(1) == digest, f'set LAYOUT = "{digest}" in kinarm/kernels/{name}.py'
