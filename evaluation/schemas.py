"""Documents in JSON: a class states the shape once; text, reader and schema follow from it."""

import json
from collections.abc import Iterator, Mapping
from functools import cache
from importlib import import_module, resources
from pathlib import Path
from typing import Annotated, Any, TypeVar

import msgspec

from kinarm._archive import load_json
from kinarm._fields import field_docs
from kinarm.errors import InvalidInputError, UnknownNameError
from kinarm.evaluation.statistics import Estimate

FILES, SHARED = "kinarm.data.schemas", "definitions"
"""Where schemas lie that are files, and the one of what they share."""

Count = Annotated[int, msgspec.Meta(ge=0)]
Share = Annotated[float, msgspec.Meta(ge=0, le=1)]
Digest = Annotated[str, msgspec.Meta(pattern="^[0-9a-f]{16}$")]

CLASSES = {
    "evaluation": "kinarm.evaluation.document:EvaluationDocument",
    "problem-check": "kinarm.evaluation.problem_check:ProblemCheck",
}
"""Classes of documents, by the names of these."""


class Document(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """A document, or a part of one: its fields are those of the JSON object."""

    def to_json(self) -> dict[str, Any]:
        """As a dictionary that JSON can hold."""
        content: dict[str, Any] = msgspec.json.decode(msgspec.json.encode(self))
        return content


D = TypeVar("D", bound=Document)


def read_document(path: str | Path, kind: type[D], name: str) -> D:
    """Read a document.

    Parameters
    ----------
    path : str or Path
        The file.
    kind : type
        Class of the document.
    name : str
        What it is called.

    Raises
    ------
    InvalidInputError
        If the file is missing, damaged, or not of this shape; says where.
    """
    content = load_json(path, name, InvalidInputError)
    try:
        return msgspec.convert(content, kind)
    except (msgspec.ValidationError, RecursionError) as error:
        raise InvalidInputError(
            f"{str(path)!r} is not a complete kinarm {name} of this version: {error}"
        ) from error


def document_text(value: Any, indent: str = "\n") -> str:
    """A document as JSON: objects over several lines, but lists of numbers or words on one."""
    if isinstance(value, list) and any(isinstance(each, Mapping) for each in value):
        entries, ends = [document_text(each, indent + " ") for each in value], "[]"
    elif isinstance(value, Mapping):
        entries = [f"{json.dumps(key)}: {document_text(value[key], indent + ' ')}" for key in value]
        ends = "{}"
    else:
        return json.dumps(value)
    return f"{ends[0]}{indent} {f',{indent} '.join(entries)}{indent}{ends[1]}"


def schema_names() -> tuple[str, ...]:
    """Names of the documents that have a schema, such as ``evaluation``."""
    return tuple(sorted((*CLASSES, *_files())))


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
    'EvaluationDocument'
    """
    if name in _files():
        return _stored_schema(name)
    if name not in CLASSES:
        raise UnknownNameError("document", name, schema_names())
    module, _, kind = CLASSES[name].partition(":")
    return schema_of(getattr(import_module(module), kind))


def schema_of(kind: type[Document]) -> dict[str, Any]:
    """JSON schema of a class, with what docstrings say of it, its parts and their fields."""
    (top,), parts = msgspec.json.schema_components([kind], ref_template="#/$defs/{name}")
    kinds: tuple[type, ...] = (Estimate, *_parts(Document))
    for each in kinds:
        part = parts.get(each.__name__, {})
        for field, said in field_docs(each).items() if part else ():
            part["properties"][field]["description"] = said
        part["description"] = " ".join((each.__doc__ or "").partition("\n\n")[0].split())
    whole = parts.pop(top["$ref"].rpartition("/")[2])
    return {"$schema": "https://json-schema.org/draft/2020-12/schema", **whole, "$defs": parts}


def _parts(kind: type[Document]) -> Iterator[type[Document]]:
    """All classes of documents and their parts below one."""
    for each in kind.__subclasses__():
        yield each
        yield from _parts(each)


@cache
def _files() -> tuple[str, ...]:
    """Names of the schemas that are files."""
    stems = (Path(file.name).stem for file in resources.files(FILES).iterdir())
    return tuple(stem for stem in stems if stem not in ("__init__", "__pycache__", SHARED))


def _stored_schema(name: str) -> dict[str, Any]:
    """A schema that is a file, with what it shares with others."""
    texts = (resources.files(FILES) / f"{each}.json" for each in (name, SHARED))
    own, shared = (
        json.loads(each.read_text(encoding="utf-8").replace(f'"{SHARED}.json#/', '"#/'))
        for each in texts
    )
    return {**own, "$defs": shared["$defs"]}
