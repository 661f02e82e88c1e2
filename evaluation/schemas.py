"""Documents in JSON: text, reader and schema follow from a class.

``msgspec.json.schema`` gives the JSON schema of a class, with its docstring.
"""

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
