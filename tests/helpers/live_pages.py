"""What a live page is told."""

import struct
import time
import urllib.request
from collections.abc import Iterator
from typing import Any

import umsgpack


def commands(address: str) -> Iterator[dict[str, Any]]:
    """Drawing commands as a page gets them, without end."""
    since = 0
    while True:
        with urllib.request.urlopen(f"{address}scene?{since}", timeout=60) as answer:
            since, found = told(answer.read())
        yield from found
        time.sleep(0.01)


def told(news: bytes) -> tuple[int, list[dict[str, Any]]]:
    """The number to ask with next, and drawing commands."""
    (since,), rest, found = struct.unpack("<I", news[:4]), news[4:], []
    while rest:
        (length,) = struct.unpack("<I", rest[:4])
        found.append(umsgpack.unpackb(rest[4 : 4 + length]))
        rest = rest[4 + length :]
    return since, found
