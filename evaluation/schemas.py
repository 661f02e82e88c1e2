"""Documents in JSON: text, reader and schema follow from a class.

``msgspec.json.schema`` gives the JSON schema of a class, with its docstring.
"""

import json
from collections.abc import Mapping
from typing import Annotated, Any

import msgspec

Count = Annotated[int, msgspec.Meta(ge=0)]
Share = Annotated[float, msgspec.Meta(ge=0, le=1)]
Goal = Annotated[list[float], msgspec.Meta(min_length=3)]
Digest = Annotated[str, msgspec.Meta(pattern="^[0-9a-f]{16}$")]


class Document(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """A document, or a part of one: its fields are those of the JSON object."""

    def to_json(self) -> dict[str, Any]:
        """As a dictionary that JSON can hold."""
        content: dict[str, Any] = msgspec.json.decode(msgspec.json.encode(self))
        return content


def document_text(value: Any, indent: str = "\n") -> str:
    """A document as JSON: objects over several lines, plain lists on one."""
    if isinstance(value, list) and any(isinstance(each, Mapping) for each in value):
        entries, ends = [document_text(each, indent + " ") for each in value], "[]"
    elif isinstance(value, Mapping):
        entries = [f"{json.dumps(key)}: {document_text(value[key], indent + ' ')}" for key in value]
        ends = "{}"
    else:
        return json.dumps(value)
    return f"{ends[0]}{indent} {f',{indent} '.join(entries)}{indent}{ends[1]}"
