"""What a live page is told."""

import struct
import urllib.request
from collections.abc import Iterator
from typing import Any

import umsgpack


def commands(address: str) -> Iterator[dict[str, Any]]:
    """Drawing commands as a page gets them, without end."""
    with urllib.request.urlopen(f"{address}scene", timeout=60) as stream:
        while head := stream.read(4):
            yield umsgpack.unpackb(stream.read(*struct.unpack("<I", head)))
