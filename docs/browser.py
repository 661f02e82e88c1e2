"""Pages as a browser shows them, for pictures; it needs Chromium and the extra ``test``."""

import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from playwright.sync_api import Page, sync_playwright

FLAGS = ("--headless=new", "--no-sandbox", "--use-angle=swiftshader", "--enable-unsafe-swiftshader")


@contextmanager
def open_page(path: Path, width: int, height: int, *, scale: float = 1) -> Iterator[Page]:
    """Open a page in light colours and at rest; ``scale`` is the pixels of a pixel."""
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(
            executable_path=shutil.which("chromium"), args=list(FLAGS)
        )
        page = browser.new_page(
            viewport={"width": width, "height": height},
            device_scale_factor=scale,
            color_scheme="light",
            reduced_motion="reduce",
        )
        page.goto(path.resolve().as_uri())
        yield page
        browser.close()
