"""Frozen dataclasses from plain values and back, for TOML, JSON and command lines.

Fields and their docstring's Parameters serve files, messages and options.
"""

import re
import tomllib
import types
from collections.abc import Callable, Collection, Mapping
from dataclasses import MISSING, Field, fields, is_dataclass
from functools import cache
from pathlib import Path
from typing import Any, Literal, TypeVar, Union, get_args, get_origin, get_type_hints

import numpy as np

from kinarm._files import first_line
from kinarm.errors import InvalidInputError, KinarmError, check_range, meant

T = TypeVar("T")

PARAMETER = re.compile(r"^(\w+(?:, \w+)*) :", re.MULTILINE)
UNIT = re.compile(r"\[([^\]]+)\]$")
field_types: Callable[[type], dict[str, Any]] = cache(get_type_hints)
"""Types of the fields of a dataclass, by name."""

SCALARS = {bool: "true or false", int: "a whole number", float: "a number", str: "a text"}

OPTIONAL: Mapping[str, Any] = {"optional": True}
"""Metadata of fields that files and hashes omit at their default."""


def to_plain(value: Any) -> Any:
    """Turn a dataclass into plain values for TOML and JSON.

    Fields that are None are left out, and ``OPTIONAL`` ones at their default.
    """
    if is_dataclass(value):
        given = ((item, getattr(value, item.name)) for item in fields(value))
        return {item.name: to_plain(entry) for item, entry in given if not _omitted(item, entry)}
    if isinstance(value, Mapping):
        return {str(key): to_plain(entry) for key, entry in value.items()}
    if isinstance(value, tuple | list):
        return [to_plain(entry) for entry in value]
    if isinstance(value, np.generic):
        return value.item()
    return str(value) if isinstance(value, Path) else value


def _omitted(item: Field[Any], entry: Any) -> bool:
    make = item.default_factory
    default = item.default if make is MISSING else make()
    return entry is None or ("optional" in item.metadata and bool(entry == default))


def read_toml(path: Path, what: str) -> dict[str, Any]:
    """Read a TOML file, called ``what`` in messages."""
    try:
        return tomllib.loads(path.read_bytes().decode())
    except OSError as error:
        raise InvalidInputError(f"cannot read {what} {str(path)!r}: {error.strerror}") from error
    except (ValueError, RecursionError) as error:
        article = "an" if what[0] in "aeiou" else "a"
        reason = first_line(error)
        raise InvalidInputError(f"{path}: not {article} {what} file: {reason}") from error


def take_base(entries: dict[str, Any], where: str, bases: Collection[str], default: str) -> str:
    """Remove the entry ``base`` of a file, one of the bases, and return it or the default."""
    base = entries.pop("base", default)
    if not isinstance(base, str) or base not in bases:
        raise InvalidInputError(f"{where}: base must be one of {', '.join(bases)}, got {base!r}")
    return base


def from_plain(kind: type[T], entries: object, where: str, path: str = "") -> T:
    """Build a dataclass from plain values by field names.

    What is unknown, missing, of the wrong type or refused is an `InvalidInputError` of one line,
    with the source, ``where``, and the path of tables around the values, such as ``"scene."``.
    """
    if not isinstance(entries, Mapping):
        table = path.removesuffix(".") or "it"
        raise InvalidInputError(f"{where}: {table} must be a table, got {entries!r}")
    known = init_fields(kind)
    for key in entries:
        if key not in known:
            similar = meant(key, known)
            raise InvalidInputError(
                f"{where}: unknown key '{path}{key}'{similar}; available: {', '.join(known)}"
            )
    for name, item in known.items():
        if name not in entries and item.default is MISSING and item.default_factory is MISSING:
            raise InvalidInputError(f"{where}: '{path}{name}' is missing: {summary_of(kind, name)}")
    hints = field_types(kind)
    values = {
        name: _value(hints[name], entry, where, f"{path}{name}", kind)
        for name, entry in entries.items()
    }
    try:
        return kind(**values)
    except KinarmError as error:
        raise InvalidInputError(f"{where}: {path and path[:-1] + ': '}{error}") from error


class Checked:
    """Base of frozen dataclasses that obey their annotations and metadata.

    Lists and arrays become tuples, and numbers become Python's. The rest is refused, as are numbers
    out of range; see `kinarm.errors.check_range`.
    """

    def __post_init__(self) -> None:
        kind = type(self)
        hints = field_types(kind)
        for name, item in init_fields(kind).items():
            value = _value(hints[name], getattr(self, name), "", name, kind)
            check_range(name, value, item.metadata)
            object.__setattr__(self, name, value)


def _value(hint: Any, entry: Any, where: str, path: str, kind: type) -> Any:
    """Convert a value to a type hint."""
    if isinstance(entry, str) and not entry.isprintable():
        where = f"{where}: " if where else ""
        raise InvalidInputError(f"{where}{path} must be printable on a line, got {entry!r}")
    if hint is Any or (type(entry) is hint and hint is not float):
        return entry
    choices = alternatives(hint)
    if isinstance(entry, np.ndarray | np.generic):
        entry = entry.tolist()
    if entry is None and type(None) in get_args(hint):
        return None
    tables = [choice for choice in choices if is_dataclass(choice) and isinstance(choice, type)]
    if isinstance(entry, tuple(tables)):
        return entry
    if tables and isinstance(entry, Mapping):
        # Of several kinds of tables, the one with most of these keys.
        fitting = max(tables, key=lambda table: len(entry.keys() & init_fields(table)))
        return from_plain(fitting, entry, where, f"{path}.")
    listed = isinstance(entry, list | tuple)
    # Of a number or a list, what it looks like.
    hint = next((each for each in choices if (get_origin(each) is tuple) == listed), choices[0])
    origin, arguments = get_origin(hint), get_args(hint)
    if origin is tuple and isinstance(entry, list | tuple):
        each = arguments[:1] * len(entry) if arguments[-1] is Ellipsis else arguments
        if len(each) == len(entry):
            return tuple(
                _value(part, value, where, f"{path}[{number}]", kind)
                for number, (part, value) in enumerate(zip(each, entry, strict=True))
            )
    elif origin is dict and isinstance(entry, Mapping):
        return {
            str(key): _value(arguments[1], value, where, f"{path}.{key}", kind)
            for key, value in entry.items()
        }
    elif origin is Literal:
        if entry in arguments:
            return entry
    elif _is_scalar(hint, entry):
        return float(entry) + 0.0 if hint is float else hint(entry)  # without negative zeros
    wanted = f"{path} must be {expected(hint)}{_unit(kind, path)}, got {entry!r}"
    raise InvalidInputError(f"{where}: {wanted}" if where else wanted)


def _is_scalar(hint: Any, entry: object) -> bool:
    """Whether a plain value has a type: truth values are no numbers."""
    if hint in (str, Path):
        return isinstance(entry, str | Path)
    if hint is bool or isinstance(entry, bool):
        return hint is bool and isinstance(entry, bool)
    if hint is float:
        return isinstance(entry, float) or (isinstance(entry, int) and abs(entry) < 1e300)
    return type(entry) is hint


def expected(hint: Any) -> str:
    """Values of a type, in words."""
    origin, arguments = get_origin(hint), get_args(hint)
    if origin is Literal:
        return f"one of {', '.join(map(str, arguments))}"
    if origin is tuple:
        if arguments[-1] is Ellipsis:
            return f"a list, each entry {expected(arguments[0])}"
        return f"a list of {len(arguments)}, each {expected(arguments[0])}"
    if is_dataclass(hint) or origin is dict:
        return "a table"
    return SCALARS.get(hint, "a path")


@cache
def alternatives(hint: Any) -> tuple[Any, ...]:
    """Types of a union without None, or the type itself."""
    if get_origin(hint) in (Union, types.UnionType):
        return tuple(part for part in get_args(hint) if part is not type(None))
    return (hint,)


def init_fields(kind: type) -> dict[str, Field[Any]]:
    """Fields of a dataclass that can be given, by name."""
    return {item.name: item for item in fields(kind) if item.init}


@cache
def field_docs(kind: type) -> dict[str, str]:
    """Descriptions of fields in docstrings of a dataclass and its bases."""
    found: dict[str, str] = {}
    for base in reversed(kind.__mro__):
        text = re.sub(r"(?m)^    ", "", base.__dict__.get("__doc__") or "")
        _, _, section = text.partition("Parameters\n----------\n")
        section = re.split(r"\n\n\w+\n-+\n", section)[0]
        parts = PARAMETER.split(section)[1:]
        for names, body in zip(parts[::2], parts[1::2], strict=True):
            description = " ".join(body.partition("\n")[2].split())
            found |= dict.fromkeys(names.split(", "), description)
    return found


def summary_of(kind: type, name: str) -> str:
    """First sentence of a field's description, without its full stop."""
    return re.split(r"\.(?:\s|$)", field_docs(kind).get(name, name))[0]


def _unit(kind: type, path: str) -> str:
    """Unit of a field in brackets; empty if none."""
    name = path.rpartition(".")[2].partition("[")[0]
    unit = UNIT.search(summary_of(kind, name))
    return f" [{unit.group(1)}]" if unit else ""
