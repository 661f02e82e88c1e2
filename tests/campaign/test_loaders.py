"""A few of the damaged files that `tests.campaign.loaders` makes; no loader is left out."""

import ast
import json
from functools import cache, partial
from pathlib import Path

import pytest
import tomli_w
from hypothesis import given, settings
from hypothesis import strategies as st

from kinarm.errors import KinarmError

from .judging import unfit
from .loaders import LOADERS, make_try
from .running import Tally, run_inputs

ROOT = Path(__file__).parents[2]
INPUTS = 40

READING_CALLS = {
    *("load_archive", "load_json", "read_toml", "read_file", "parse_xml", "mesh_content"),
    *("read_text", "read_bytes", "load_from_zip_file", "load_scene", "import_module", "MeshLoader"),
    *("fromstring", "parse", "loads", "open"),
}
"""Names of functions that read files, or make something of their content."""

OTHERS = {
    "kinarm.__main__.main": "imports kinarm's own modules",
    "kinarm._archive.load_archive": "reads for those that are named",
    "kinarm._archive.load_json": "reads for those that are named",
    "kinarm._archive.parse_json": "reads for those that are named",
    "kinarm._archive._arrays": "opens members of an archive",
    "kinarm._fields.read_toml": "reads for those that are named",
    "kinarm._files._replace": "writes",
    "kinarm._files._write_into": "writes",
    "kinarm._files._sweep": "locks",
    "kinarm._files._locked": "locks",
    "kinarm._files.is_being_written": "locks",
    "evaluation.running.identity.source_digest": "hashes kinarm's own files",
    "kinarm._files.read_file": "reads for those that are named",
    "kinarm.urdf_tree.parse_xml": "reads for those that are named",
    "kinarm.meshes.mesh_content": "reads for those that are named",
    "kinarm.meshes._check_collada": "reads for those that are named",
    "kinarm.arm_model._kinematics": "a text of kinarm's own",
    "kinarm.arm_model.build_shapes": "a text of kinarm's own",
    "policies.provenance._problem": "a text of kinarm's own",
    "kinarm.viewer.visual_shapes.visual_parts": "a text of kinarm's own",
    "kinarm._options._checked": "takes what is typed",
    "kinarm._options.parsed": "takes what is typed",
    "kinarm._command_line._prepare_streams": "opens the null device",
    "kinarm._command_line._discard_output": "opens the null device",
}
"""Functions that call one of these, but are no loaders, and why."""

OWN_DATA = (
    *("kinarm.viewer.html_page", "kinarm.viewer.live", "evaluation.report", "evaluation.replay"),
    *("evaluation.measurements", "evaluation.reproduction.document", "policies.learners"),
    "evaluation.schemas",
    *(
        "policies.library",
        "policies.sb3",
        "policies.ppo",
        "evaluation.comparison.training",
        "kinarm.envs",
    ),
)
"""Modules that read nothing but what ships with kinarm, or what they wrote."""


@cache
def reading_functions() -> set[str]:
    """Functions of the three packages that call what reads files."""
    found = set()
    for package in ("kinarm", "policies", "evaluation"):
        for path in (ROOT / package).rglob("*.py"):
            module = ".".join(path.relative_to(ROOT).with_suffix("").parts)
            if not module.startswith(OWN_DATA):
                tree = ast.parse(path.read_text(encoding="utf-8"))
                found |= {f"{module}.{name}" for name in _functions_that_read(tree)}
    return found


def _functions_that_read(tree: ast.AST) -> set[str]:
    found = set()
    for function in ast.walk(tree):
        if isinstance(function, ast.FunctionDef):
            calls = (each.func for each in ast.walk(function) if isinstance(each, ast.Call))
            names = {getattr(call, "id", getattr(call, "attr", "")) for call in calls}
            if names & READING_CALLS:
                found.add(function.name)
    return found


def test_no_loader_is_left_out():
    known = {name for loader in LOADERS.values() for name in loader.reads}
    assert reading_functions() - known - OTHERS.keys() == set()


def test_every_function_that_is_named_exists():
    known = {name for loader in LOADERS.values() for name in loader.reads}
    assert (known | OTHERS.keys()) - reading_functions() == set()


@pytest.mark.parametrize("name", LOADERS)
def test_damaged_files_are_refused_in_one_line_or_read(name):
    if LOADERS[name].needs:
        pytest.importorskip(LOADERS[name].needs)
    tally = Tally()
    for number, verdict in run_inputs(partial(make_try, name, 1), INPUTS):
        tally.add(number, verdict)
    assert tally.inputs == INPUTS
    assert tally.findings == {}


JSON = st.recursive(
    st.one_of(st.none(), st.booleans(), st.integers(), st.floats(), st.text(max_size=9)),
    lambda inner: st.one_of(
        st.lists(inner, max_size=4),
        st.dictionaries(
            st.sampled_from(["protocol", "results", "format_version", "problems", "study", "curve"])
            | st.text(max_size=5),
            inner,
            max_size=4,
        ),
    ),
    max_leaves=12,
)
KEYS = st.sampled_from(["base", "arm", "scene", "task", "name", "source", "goal_regions", "reward"])
TOML = st.dictionaries(
    KEYS | st.text(max_size=5),
    st.recursive(
        st.one_of(st.booleans(), st.integers(-(2**63), 2**63), st.floats(), st.text(max_size=9)),
        lambda inner: st.one_of(st.lists(inner, max_size=4), st.dictionaries(KEYS, inner)),
        max_leaves=8,
    ),
    max_size=4,
)


def loads_well(name: str, folder: Path, content: str) -> bool:
    """Whether a loader reads a document, or refuses it in one line."""
    loader = LOADERS[name]
    path = folder / loader.file
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(content, encoding="utf-8", errors="surrogatepass")
    try:
        loader.load(path)
    except KinarmError as error:
        return unfit(str(error)) == ""
    return True


@pytest.mark.parametrize("name", ["evaluation", "compared run", "study marker", "wall times"])
@settings(max_examples=40)
@given(document=JSON)
def test_any_json_document(name, document, tmp_path_factory):
    assert loads_well(name, tmp_path_factory.getbasetemp() / name, json.dumps(document))


@pytest.mark.parametrize("name", ["problem", "scene", "task", "arm file", "recipe"])
@settings(max_examples=40)
@given(document=TOML)
def test_any_toml_document(name, document, tmp_path_factory):
    assert loads_well(name, tmp_path_factory.getbasetemp() / name, tomli_w.dumps(document))
