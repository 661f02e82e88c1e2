"""Take ``docs/_static/replay.png`` and ``play.png``: a replay and the playground in a browser.

Run ``python docs/make_screenshot.py`` from the root of a clone, with Chromium and the extra
``test`` installed.
"""

import tempfile
from pathlib import Path

from browser import open_page
from PIL import Image

from kinarm.evaluation import ReplayRequest
from kinarm.viewer import replay_page

STATIC = Path(__file__).parent / "_static"
WIDTH, HEIGHT = 1120, 680
STEP = 15
PLAYED = "for (let step = 0; step < 14; step++) kinarm.step()"
DRAWN = 2000
"""Time until all is drawn without a graphics card [ms]."""


def main() -> None:
    """Make both pages, show a moment of each and take its picture."""
    with tempfile.TemporaryDirectory() as folder:
        replay, play = Path(folder) / "replay.html", Path(folder) / "play.html"
        request = ReplayRequest(
            compare=("ppo-best-both", "oracle"), problem="right", trial=(0, 1, 3)
        )
        played, oracle = request.recordings()
        replay_page(played, replay, ghosts=oracle)
        ReplayRequest(play=(), out=play).run()
        take(replay, f"kinarm.seek({STEP})")
        take(play, PLAYED)


def take(path: Path, script: str) -> None:
    """Take the picture of a page after a script."""
    out = STATIC / f"{path.stem}.png"
    with open_page(path, WIDTH, HEIGHT) as page:
        page.wait_for_selector("body[data-ready]")
        page.evaluate(script)
        page.wait_for_timeout(DRAWN)
        page.screenshot(path=out)
    Image.open(out).convert("RGB").save(out, optimize=True)
    print(f"{out}: {out.stat().st_size / 1000:.0f} kB")


if __name__ == "__main__":
    main()
