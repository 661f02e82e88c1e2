"""Take ``docs/_static/replay.png``: a replay in a browser.

Run ``python docs/make_screenshot.py`` from the root of a clone, with Chromium and the extra
``test`` installed.
"""

import tempfile
from pathlib import Path

from browser import open_page
from PIL import Image

from kinarm.evaluation import ReplayRequest
from kinarm.viewer import replay_page

OUT = Path(__file__).parent / "_static" / "replay.png"
WIDTH, HEIGHT = 1120, 680
STEP = 15


def main() -> None:
    """Make a replay, show a step of it and take its picture."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "replay.html"
        request = ReplayRequest(
            compare=("ppo-best-both", "oracle"), problem="right", trial=(0, 1, 3)
        )
        played, oracle = request.recordings()
        replay_page(played, path, ghosts=oracle)
        with open_page(path, WIDTH, HEIGHT) as page:
            page.wait_for_selector("body[data-ready]")
            page.evaluate(f"kinarm.seek({STEP})")
            page.screenshot(path=OUT)
    Image.open(OUT).convert("RGB").save(OUT, optimize=True)
    print(f"{OUT}: {OUT.stat().st_size / 1000:.0f} kB")


if __name__ == "__main__":
    main()
