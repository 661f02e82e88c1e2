"""JSON schemas of the documents that kinarm writes: the one place that states their formats."""

import json
from functools import cache
from importlib import resources
from typing import Any

from kinarm.errors import UnknownNameError

SHARED = "definitions"
"""The schema that holds what several documents share."""


@cache
def schema_names() -> tuple[str, ...]:
    """Names of the documents that have a schema, such as ``evaluation``."""
    files = resources.files("kinarm.data.schemas").iterdir()
    stems = (file.name.removesuffix(".json") for file in files if file.name.endswith(".json"))
    return tuple(sorted(stem for stem in stems if stem != SHARED))


def document_schema(name: str) -> dict[str, Any]:
    """JSON schema (draft 2020-12) of a document, complete in itself.

    Its descriptions say what the fields mean, and in which unit.

    Parameters
    ----------
    name : str
        Name of the document, one of `schema_names`.

    Raises
    ------
    UnknownNameError
        If there is no such document.

    Examples
    --------
    >>> from kinarm.evaluation import document_schema
    >>> document_schema("evaluation")["title"]
    'Evaluation'
    """
    if name not in schema_names():
        raise UnknownNameError("document", name, schema_names())
    text = _read(name).replace(f'"{SHARED}.json#/', '"#/')
    shared = json.loads(_read(SHARED).replace(f'"{SHARED}.json#/', '"#/'))
    return {**json.loads(text), "$defs": shared["$defs"]}


def _read(name: str) -> str:
    """Text of a file with a schema."""
    file = resources.files("kinarm.data.schemas") / f"{name}.json"
    return file.read_text(encoding="utf-8")
