"""Take ``docs/_static/replay.png``: a replay in a browser.

Run ``python docs/make_screenshot.py`` from the root of a clone, with Chromium and the extra
``test`` installed.
"""

import shutil
import tempfile
from pathlib import Path

from PIL import Image
from players import make_replay
from playwright.sync_api import sync_playwright

OUT = Path(__file__).parent / "_static" / "replay.png"
SIZE = {"width": 1120, "height": 680}
STEP = 15
FLAGS = ("--headless=new", "--no-sandbox", "--use-angle=swiftshader", "--enable-unsafe-swiftshader")


def main() -> None:
    """Make a replay, show a step of it and take its picture."""
    with tempfile.TemporaryDirectory() as folder, sync_playwright() as playwright:
        page_file = Path(folder) / "replay.html"
        make_replay("ppo-tuned-right", "right", [0, 1, 3], "oracle").save(page_file)
        browser = playwright.chromium.launch(
            executable_path=shutil.which("chromium"), args=list(FLAGS)
        )
        page = browser.new_page(viewport=SIZE, color_scheme="light", reduced_motion="reduce")
        page.goto(page_file.as_uri())
        page.wait_for_selector("body[data-ready]")
        page.evaluate(f"kinarm.seek({STEP})")
        page.screenshot(path=OUT)
        browser.close()
    Image.open(OUT).convert("RGB").save(OUT, optimize=True)
    print(f"{OUT}: {OUT.stat().st_size / 1000:.0f} kB")


if __name__ == "__main__":
    main()
