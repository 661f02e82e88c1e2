"""What is compiled into the kernels from other files is part of their cache key."""

import hashlib
import re
from pathlib import Path

import pytest

from kinarm import collision, episodes, kernels
from kinarm.chain import Chain
from kinarm.collision import ContactShapes
from kinarm.episodes import Control, Episodes, Rules
from kinarm.motion_bounds import MotionBounds

FOLDER = Path(kernels.__file__).parent
SOURCES = {
    path.stem: path.read_text(encoding="utf-8")
    for path in sorted(FOLDER.glob("*.py"))
    if path.stem != "__init__"
}
CACHED = [name for name, text in SOURCES.items() if "\n@kernel\n" in text]


def test_what_is_compiled_in_has_no_cache_of_its_own():
    assert set(CACHED) == {"approach", "projection", "rollout"}


@pytest.mark.parametrize("name", CACHED)
def test_layout_names_what_is_compiled_in(name):
    tuples = (Chain, ContactShapes, MotionBounds, Rules, Control, Episodes)
    parts = [
        *(text for other, text in SOURCES.items() if other not in CACHED),
        *(repr(layout._fields) for layout in tuples),
        repr([getattr(episodes, name) for name in ("RUNNING", "PAUSED", "SUCCESS", "TRUNCATED")]),
        repr([collision.BETWEEN_CAPSULES, collision.WITH_BOX, collision.WITH_GROUND]),
    ]
    digest = hashlib.sha256("\n".join(parts).encode()).hexdigest()[:12]
    stated = re.search(r'^LAYOUT = "(\w*)"$', SOURCES[name], re.MULTILINE)
    assert stated.group(1) == digest, f'set LAYOUT = "{digest}" in kinarm/kernels/{name}.py'
