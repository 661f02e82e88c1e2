"""What is compiled into the kernels from other files is part of their cache key."""

import hashlib
from pathlib import Path

from kinarm import collision, episodes, kernels
from kinarm.chain import Chain
from kinarm.collision import ContactShapes
from kinarm.episodes import Control, Episodes, Rules


def test_layout_names_what_is_compiled_in():
    folder = Path(kernels.__file__).parent
    parts = [
        *(
            path.read_text(encoding="utf-8")
            for path in sorted(folder.glob("*.py"))
            if path.stem not in ("__init__", "rollout")
        ),
        *(repr(layout._fields) for layout in (Chain, ContactShapes, Rules, Control, Episodes)),
        repr([getattr(episodes, name) for name in ("RUNNING", "PAUSED", "SUCCESS", "TRUNCATED")]),
        repr([collision.BETWEEN_CAPSULES, collision.WITH_BOX, collision.WITH_GROUND]),
    ]
    digest = hashlib.sha256("\n".join(parts).encode()).hexdigest()[:12]
    assert digest == kernels.LAYOUT, f'set LAYOUT = "{digest}" in kinarm/kernels/rollout.py'
