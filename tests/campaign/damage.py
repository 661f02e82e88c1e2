"""What can become of a valid file: damage of its bytes, its texts, its values and its parts."""

import io
import json
import math
import re
import tomllib
import zipfile
from collections.abc import Callable, Sequence
from typing import Any
from xml.etree import ElementTree

import numpy as np
import tomli_w

Rng = np.random.Generator
Damage = Callable[[bytes, Rng], bytes]

DEEP = 3000
"""Levels of nesting that a recursive reader does not survive unprotected."""
NUMBERS = (0, -1, 1, 2**31, 2**63, -(2**63), 10**400, -0.0, 1e-320, 1e308, -1e308, 0.1, 7)
TEXTS = ("", "\x00", "x" * 300, "é\u2028", "a\nb", "../../x", "[/o]", "nan", "NaN", "1e308", "-1")
HOSTILE = (*NUMBERS, *TEXTS, True, False, None, math.nan, math.inf, -math.inf)
"""Values to put in the place of others."""
WORD = re.compile(rb"[\w.+-]+")
WORDS = (b"nan", b"inf", b"-inf", b"1e308", b"-1e308", b"1e-320", b"0", b"-1", b"99999999999", b"")
"""Words to put in the place of others in a text."""


def pick(rng: Rng, choices: Sequence[Any]) -> Any:
    """One of several things."""
    return choices[int(rng.integers(len(choices)))]


def damaged_bytes(content: bytes, rng: Rng) -> bytes:
    """Flip bits, cut, repeat, overwrite or insert parts."""
    spoilt = bytearray(content)
    for _ in range(int(rng.integers(1, 4))):
        a, b = sorted(int(each) for each in rng.integers(max(len(spoilt), 1), size=2))
        kind = int(rng.integers(6))
        if kind == 0:
            del spoilt[a:]
        elif kind == 1:
            del spoilt[a : min(b, a + 200)]
        elif kind == 2:
            spoilt[a:a] = spoilt[a : min(b, a + 500)]
        elif kind == 3:
            spoilt[a : a + 8] = pick(rng, (rng.bytes(8), bytes(8), b"\xff" * 8, rng.bytes(40)))
        elif spoilt:
            for place in rng.integers(len(spoilt), size=int(rng.integers(1, 4))):
                spoilt[place] ^= 1 << int(rng.integers(8))
    return bytes(spoilt)


def damaged_text(content: bytes, rng: Rng) -> bytes:
    """Exchange words, drop or repeat lines, nest without end, or damage bytes."""
    kind = int(rng.integers(6))
    words = [found.span() for found in WORD.finditer(content[:20_000])]
    if kind == 0 or not words:
        return damaged_bytes(content, rng)
    if kind == 1:
        place = int(rng.integers(len(content) + 1))
        return (
            content[:place] + pick(rng, (b"[", b'{"a":', b"{a=", b"<a>")) * DEEP + content[place:]
        )
    if kind <= 3:
        for begin, end in sorted(pick(rng, words) for _ in range(int(rng.integers(1, 4))))[::-1]:
            other = slice(*pick(rng, words))
            new = pick(rng, (*WORDS, *[content[other]] * len(WORDS)))
            content = content[:begin] + new + content[end:]
        return content
    lines = content.split(b"\n")
    place = int(rng.integers(len(lines)))
    lines[place : place + int(rng.integers(1, 3))] = [pick(rng, lines)] * int(rng.integers(3))
    return b"\n".join(lines)


def hostile_value(rng: Rng, depth: int = 0) -> Any:
    """A value that JSON can hold, or almost: of any kind, and nested."""
    kind = int(rng.integers(12))
    if kind == 0 and depth < 3:
        return [hostile_value(rng, depth + 1) for _ in range(int(rng.integers(4)))]
    if kind == 1 and depth < 3:
        return {str(pick(rng, TEXTS)): hostile_value(rng, depth + 1)}
    return float(rng.normal() * 10.0 ** rng.integers(-3, 4)) if kind == 2 else pick(rng, HOSTILE)


def damaged_value(value: Any, rng: Rng) -> Any:
    """A copy with one place changed, dropped, renamed or doubled; deep ones are as likely."""
    if not isinstance(value, dict | list) or not value or rng.integers(6) == 0:
        return hostile_value(rng)
    kind = int(rng.integers(8))
    if isinstance(value, dict):
        copy = dict(value)
        key = pick(rng, list(copy))
        if kind == 0:
            del copy[key]
        elif kind == 1:
            copy[str(pick(rng, TEXTS))] = copy.pop(key)
        elif kind == 2:
            copy[str(pick(rng, TEXTS))] = hostile_value(rng)
        else:
            copy[key] = damaged_value(copy[key], rng)
        return copy
    entries = list(value)
    place = int(rng.integers(len(entries)))
    if kind == 0:
        del entries[place]
    elif kind == 1:
        entries.insert(place, pick(rng, entries))
    else:
        entries[place] = damaged_value(entries[place], rng)
    return entries


def damaged_json(content: bytes, rng: Rng) -> bytes:
    """A JSON document with values of other kinds, or damaged as a text."""
    if rng.integers(3) == 0:
        return damaged_text(content, rng)
    value = damaged_value(json.loads(content), rng)
    return json.dumps(value).encode("utf-8", "surrogatepass")


def damaged_toml(content: bytes, rng: Rng) -> bytes:
    """A TOML document with values of other kinds, or damaged as a text."""
    if rng.integers(3) == 0:
        return damaged_text(content, rng)
    try:
        value = damaged_value(tomllib.loads(content.decode()), rng)
        return tomli_w.dumps(value).encode("utf-8", "surrogatepass")
    except (AttributeError, TypeError, ValueError):  # no table, or what TOML cannot hold
        return damaged_text(content, rng)


def damaged_xml(content: bytes, rng: Rng) -> bytes:
    """An XML document with attributes and elements changed, dropped, doubled or moved."""
    if rng.integers(3) == 0:
        return damaged_text(content, rng)
    root = ElementTree.fromstring(content)
    for _ in range(int(rng.integers(1, 3))):
        elements = list(root.iter())
        element, other = pick(rng, elements), pick(rng, elements)
        words = b" ".join(pick(rng, WORDS) for _ in range(int(rng.integers(1, 7)))).decode()
        kind = int(rng.integers(7))
        if kind <= 2 and element.attrib:
            text = pick(rng, (words, f"0 {rng.normal():.3g} 0"))
            element.set(pick(rng, list(element.attrib)), text)
        elif kind == 3 and element.attrib:
            del element.attrib[pick(rng, list(element.attrib))]
        elif kind == 4 and len(element):
            element.remove(pick(rng, list(element)))
        elif element not in set(other.iter()):
            element.append(other)
        else:
            element.text = words
    return ElementTree.tostring(root)


def damaged_archive(content: bytes, rng: Rng) -> bytes:
    """A ``.npz`` file whose parts are valid, but other ones; or whose bytes are damaged."""
    if rng.integers(5) == 0:
        return damaged_bytes(content, rng)
    with zipfile.ZipFile(io.BytesIO(content)) as archive:
        members = {name: archive.read(name) for name in archive.namelist()}
    for name in rng.permutation(list(members))[: int(rng.integers(1, 3))].tolist():
        kind = int(rng.integers(8))
        if kind == 0:
            del members[name]
        elif kind == 1:
            members[f"{pick(rng, ('x', 'weights_9', 'a/../b', 'format'))}.npy"] = members[name]
        elif kind == 2:
            members[name] = damaged_bytes(members[name], rng)
        elif kind == 3:
            members[name] = damaged_bytes(members[name][:128], rng) + members[name][128:]
        else:
            array = np.load(io.BytesIO(members[name]))
            if name == "header.npy":  # the document among the arrays
                text = damaged_json(str(array).encode(), rng).decode("latin-1")
                array = np.array(text)
            else:
                array = damaged_array(array, rng)
            written = io.BytesIO()
            np.save(written, array, allow_pickle=False)
            members[name] = written.getvalue()
    made = io.BytesIO()
    how = pick(rng, (zipfile.ZIP_STORED,) * 5 + (zipfile.ZIP_DEFLATED, zipfile.ZIP_BZIP2))
    with zipfile.ZipFile(made, "w", how) as archive:
        for name, data in members.items():
            archive.writestr(zipfile.ZipInfo(name), data)
    return made.getvalue()


def damaged_array(array: np.ndarray[Any, Any], rng: Rng) -> np.ndarray[Any, Any]:
    """Another array: of another type or shape, or with entries that are none."""
    kind = int(rng.integers(8))
    if kind == 0:
        types = ("c16", "U3", bool, "f2", "f4", "i1", "u8", "S3", "M8[s]", ">f8")
        return np.zeros(array.shape, dtype=pick(rng, types))
    if kind == 1:
        return array.reshape(-1)
    if kind == 2:
        return array[None] if rng.integers(2) else np.asfortranarray(array)
    if kind == 3:
        return np.zeros(tuple(int(n) for n in rng.integers(0, 5, size=int(rng.integers(0, 4)))))
    if kind == 4 and array.ndim:
        return array[: int(rng.integers(len(array) + 1))]
    if array.dtype.kind == "f" and array.size:
        array = array.copy()
        value = pick(rng, (np.nan, np.inf, -np.inf, 1e308, -1e308, 1e-320, 0.0, -1.0))
        array.reshape(-1)[int(rng.integers(array.size)) :: 1 + int(rng.integers(5))] = value
        return array
    return np.full(array.shape, pick(rng, (-1, 0, 2**31, 2**63 - 1, -(2**63), 7)))
