"""Take ``docs/_static/replay.png``: a replay in a browser.

Run ``python docs/make_screenshot.py`` from the root of a clone, with Chromium and the extra
``test`` installed.
"""

import tempfile
from pathlib import Path

from browser import open_page
from PIL import Image
from players import make_replay

OUT = Path(__file__).parent / "_static" / "replay.png"
WIDTH, HEIGHT = 1120, 680
STEP = 15


def main() -> None:
    """Make a replay, show a step of it and take its picture."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "replay.html"
        make_replay("ppo-best-both", "right", [0, 1, 3], "oracle").save(path)
        with open_page(path, WIDTH, HEIGHT) as page:
            page.wait_for_selector("body[data-ready]")
            page.evaluate(f"kinarm.seek({STEP})")
            page.screenshot(path=OUT)
    Image.open(OUT).convert("RGB").save(OUT, optimize=True)
    print(f"{OUT}: {OUT.stat().st_size / 1000:.0f} kB")


if __name__ == "__main__":
    main()
