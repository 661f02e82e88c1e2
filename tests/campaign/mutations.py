"""What can become of a valid file: damage of its bytes, its texts, its values and its parts."""

import io
import json
import math
import re
import tomllib
import zipfile
from collections.abc import Callable, Mapping, Sequence
from functools import cache
from typing import Any
from xml.etree import ElementTree

import numpy as np
import tomli_w

Rng = np.random.Generator
Mutation = Callable[[bytes, Rng], bytes]

HUGE = 10**400
"""More than any number that a machine calculates with."""

DEEP = 3000
"""Levels of nesting that a recursive reader does not survive unprotected."""

NUMBERS = (0, -1, 1, 2**31, 2**63, -(2**63), HUGE, 0.0, -0.0, 1e-320, 1e308, -1e308, 0.1, 7)
TEXTS = ("", "\x00", "x" * 300, "é\u2028", "a\nb", "../../x", "[/o]", "nan", "NaN", "1e308", "-1")
HOSTILE = (*NUMBERS, *TEXTS, True, False, None, math.nan, math.inf, -math.inf, (), {})
"""Values to put in the place of others; tuples stand for lists."""

WORD = re.compile(rb"[\w.+-]+")

WORDS = (b"nan", b"inf", b"-inf", b"1e308", b"-1e308", b"1e-320", b"0", b"-1", b"99999999999", b"")
"""Words to put in the place of others in a text."""


def pick(rng: Rng, choices: Sequence[Any]) -> Any:
    """One of several things."""
    return choices[int(rng.integers(len(choices)))]


def damaged_bytes(content: bytes, rng: Rng) -> bytes:
    """Flip bits, cut, repeat, overwrite, insert or exchange parts."""
    spoilt = bytearray(content)
    for _ in range(int(rng.integers(1, 4))):
        size = max(len(spoilt), 1)
        a, b = sorted(int(each) for each in rng.integers(size, size=2))
        kind = int(rng.integers(8))
        if kind == 0:
            del spoilt[a:]
        elif kind == 1:
            del spoilt[a : min(b, a + 200)]
        elif kind == 2:
            spoilt[a:a] = spoilt[a : min(b, a + 500)]
        elif kind == 3:
            spoilt[a : a + 8] = rng.bytes(8)
        elif kind == 4:
            spoilt[a:a] = rng.bytes(int(rng.integers(1, 40)))
        elif kind == 5:
            spoilt[a : a + 8] = b"\x00" * 8 if rng.integers(2) else b"\xff" * 8
        elif spoilt:
            for place in rng.integers(len(spoilt), size=int(rng.integers(1, 4))):
                spoilt[place] ^= 1 << int(rng.integers(8))
    return bytes(spoilt)


def cut_bytes(content: bytes, rng: Rng) -> bytes:
    """Cut the end off: what damages a pickle without making another one of it."""
    return content[: int(rng.integers(len(content)))]


def damaged_text(content: bytes, rng: Rng) -> bytes:
    """Exchange words, drop or repeat lines, or damage bytes."""
    kind = int(rng.integers(5))
    if kind == 0:
        return damaged_bytes(content, rng)
    if kind <= 2:
        words = _words(content)
        for _ in range(int(rng.integers(1, 4))):
            if words:
                begin, end = pick(rng, words)
                other = pick(rng, words)
                new = pick(rng, WORDS) if rng.integers(2) else content[other[0] : other[1]]
                content = content[:begin] + new + content[end:]
                words = _words(content)
        return content
    lines = content.split(b"\n")
    place = int(rng.integers(len(lines)))
    if kind == 3:
        del lines[place : place + int(rng.integers(1, 3))]
    else:
        lines[place:place] = [lines[int(rng.integers(len(lines)))]] * int(rng.integers(1, 3))
    return b"\n".join(lines)


def _words(content: bytes) -> list[tuple[int, int]]:
    """Where words begin and end: what numbers and names consist of."""
    return [found.span() for found in WORD.finditer(content[:20_000])]


def hostile_value(rng: Rng, depth: int = 0) -> Any:
    """A value that JSON can hold, or almost: of any kind, and nested."""
    kind = int(rng.integers(12))
    if kind == 0 and depth < 3:
        return [hostile_value(rng, depth + 1) for _ in range(int(rng.integers(4)))]
    if kind == 1 and depth < 3:
        return {str(pick(rng, TEXTS)): hostile_value(rng, depth + 1)}
    if kind == 2:
        return float(rng.normal() * 10.0 ** rng.integers(-3, 4))
    value = pick(rng, HOSTILE)
    return list(value) if isinstance(value, tuple) else value


def damaged_value(value: Any, rng: Rng) -> Any:
    """A value with some parts of it changed in kind, dropped, renamed or doubled."""
    for _ in range(int(rng.integers(1, 3))):
        value = _changed(value, rng)
    return value


def _changed(value: Any, rng: Rng) -> Any:
    """A copy with one place changed; deeper places are as likely as higher ones."""
    inner = isinstance(value, dict | list) and len(value) > 0
    if not inner or rng.integers(6) == 0:
        return hostile_value(rng)
    if isinstance(value, dict):
        copy = dict(value)
        key = pick(rng, list(copy))
        kind = int(rng.integers(10))
        if kind == 0:
            del copy[key]
        elif kind == 1:
            copy[str(pick(rng, TEXTS))] = copy.pop(key)
        elif kind == 2:
            copy[str(pick(rng, TEXTS))] = hostile_value(rng)
        else:
            copy[key] = _changed(copy[key], rng)
        return copy
    entries = list(value)
    place = int(rng.integers(len(entries)))
    kind = int(rng.integers(10))
    if kind == 0:
        del entries[place]
    elif kind == 1:
        entries.insert(place, entries[int(rng.integers(len(entries)))])
    else:
        entries[place] = _changed(entries[place], rng)
    return entries


def damaged_json(content: bytes, rng: Rng) -> bytes:
    """A JSON document with values of other kinds, nested without end, or damaged as a text."""
    kind = int(rng.integers(10))
    if kind == 0:
        return damaged_bytes(content, rng)
    if kind == 1:
        return damaged_text(content, rng)
    if kind == 2:
        return nested(content, rng)
    return _json(damaged_value(json.loads(content), rng)).encode("utf-8", "surrogatepass")


def _json(value: Any) -> str:
    """JSON of a value, in which huge numbers stay numbers."""
    return json.dumps(value)


def nested(content: bytes, rng: Rng) -> bytes:
    """A text into which deep nesting is put."""
    opening = pick(rng, (b"[", b'{"a":', b"{a=", b"<a>"))
    place = int(rng.integers(len(content) + 1))
    return content[:place] + opening * DEEP + content[place:]


def damaged_blindly(content: bytes, rng: Rng) -> bytes | None:
    """A document damaged as bytes, as a text or by nesting, in two of five cases; else none."""
    kind = int(rng.integers(10))
    if kind == 0:
        return damaged_bytes(content, rng)
    if kind <= 2:
        return damaged_text(content, rng)
    if kind == 3:
        return nested(content, rng)
    return None


def damaged_toml(content: bytes, rng: Rng) -> bytes:
    """A TOML document with values of other kinds, nested without end, or damaged as a text."""
    if (blindly := damaged_blindly(content, rng)) is not None:
        return blindly
    value = damaged_value(tomllib.loads(content.decode()), rng)
    try:
        return tomli_w.dumps(_for_toml(value)).encode("utf-8", "surrogatepass")
    except (AttributeError, TypeError, ValueError):  # no table, or what TOML cannot hold
        return damaged_text(content, rng)


def _for_toml(value: Any) -> Any:
    """Without what TOML has no word for."""
    if isinstance(value, dict):
        return {key: _for_toml(each) for key, each in value.items() if each is not None}
    if isinstance(value, list):
        return [_for_toml(each) for each in value if each is not None]
    return value


def damaged_xml(content: bytes, rng: Rng) -> bytes:
    """An XML document with attributes, elements and texts changed, dropped, doubled or moved."""
    if (blindly := damaged_blindly(content, rng)) is not None:
        return blindly
    root = ElementTree.fromstring(content)
    for _ in range(int(rng.integers(1, 3))):
        elements = list(root.iter())
        element = pick(rng, elements)
        kind = int(rng.integers(8))
        if kind <= 3 and element.attrib:
            element.set(pick(rng, list(element.attrib)), _xml_text(rng))
        elif kind == 4 and element.attrib:
            del element.attrib[pick(rng, list(element.attrib))]
        elif kind == 5 and len(element):
            element.remove(pick(rng, list(element)))
        elif kind == 6 and len(element):
            element.append(pick(rng, list(element)))
        else:
            other = pick(rng, elements)
            if element not in set(other.iter()):
                element.append(other)
            else:
                element.text = _xml_text(rng)
    return ElementTree.tostring(root)


def _xml_text(rng: Rng) -> str:
    """What an attribute can hold: up to six words."""
    words = (pick(rng, WORDS).decode() for _ in range(int(rng.integers(1, 7))))
    return " ".join(words) if rng.integers(2) else f"0 {rng.normal():.3g} 0"


def damaged_archive(content: bytes, rng: Rng) -> bytes:
    """A ``.npz`` file whose parts are valid, but other ones; or whose bytes are damaged."""
    if rng.integers(5) == 0:
        return damaged_bytes(content, rng)
    members = {**_members(content)}
    for name in rng.permutation(list(members))[: int(rng.integers(1, 3))].tolist():
        kind = int(rng.integers(10))
        if name == "header.npy":
            members["header.npy"] = _damaged_header(members["header.npy"], rng)
        elif kind == 0:
            del members[name]
        elif kind == 1:
            members[f"{pick(rng, ('x', 'weights_9', 'a/../b', 'format'))}.npy"] = members[name]
        elif kind == 3:
            members[name] = damaged_bytes(members[name], rng)
        elif kind == 4:
            members[name] = damaged_bytes(members[name][:128], rng) + members[name][128:]
        else:
            members[name] = _damaged_array(members[name], rng)
    written = io.BytesIO()
    how = pick(rng, (zipfile.ZIP_STORED,) * 5 + (zipfile.ZIP_DEFLATED, zipfile.ZIP_BZIP2))
    with zipfile.ZipFile(written, "w", how) as archive:
        for name, data in members.items():
            archive.writestr(zipfile.ZipInfo(name), data)
    return written.getvalue()


@cache
def _members(content: bytes) -> Mapping[str, bytes]:
    """The members of a valid archive."""
    with zipfile.ZipFile(io.BytesIO(content)) as archive:
        return {name: archive.read(name) for name in archive.namelist()}


def _damaged_header(member: bytes, rng: Rng) -> bytes:
    """The document among the arrays with values of other kinds."""
    text = str(np.load(io.BytesIO(member)))
    return _member(np.array(damaged_json(text.encode(), rng).decode("latin-1")))


def _damaged_array(member: bytes, rng: Rng) -> bytes:
    """Another array: of another type or shape, or with entries that are none."""
    array = np.load(io.BytesIO(member))
    kind = int(rng.integers(8))
    if kind == 0:
        types = (complex, "U3", bool, "f2", "f4", "i1", "u8", "S3", "M8[s]", ">f8", "O")
        try:
            array = array.astype(pick(rng, types))
        except (ValueError, TypeError, OverflowError):
            array = np.zeros(array.shape)
        if array.dtype == object:
            return damaged_bytes(member, rng)
    elif kind == 1:
        array = array.reshape(-1)
    elif kind == 2:
        array = array[None] if rng.integers(2) else np.asfortranarray(array)
    elif kind == 3:
        array = np.zeros(tuple(int(n) for n in rng.integers(0, 5, size=int(rng.integers(0, 4)))))
    elif kind == 4 and array.ndim:
        array = array[: int(rng.integers(len(array) + 1))]
    elif array.dtype.kind == "f" and array.size:
        value = pick(rng, (np.nan, np.inf, -np.inf, 1e308, -1e308, 1e-320, 0.0, -1.0))
        array = array.copy()
        array.reshape(-1)[int(rng.integers(array.size)) :: 1 + int(rng.integers(5))] = value
    elif array.dtype.kind in "iu" and array.size:
        array = np.full(array.shape, pick(rng, (-1, 0, 2**31, 2**63 - 1, -(2**63), 7)))
    else:
        array = np.array(str(pick(rng, TEXTS)))
    return _member(array)


def _member(array: np.ndarray[Any, Any]) -> bytes:
    """An array as a member of an archive."""
    written = io.BytesIO()
    np.save(written, array, allow_pickle=False)
    return written.getvalue()
