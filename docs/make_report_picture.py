"""Take ``docs/_static/report.png``: the beginning of a report in a browser.

Run ``kinarm-eval --trials 200 --report results`` and then ``python docs/make_report_picture.py``,
both from the root of a clone. It needs Chromium and the extra ``test``.
"""

from pathlib import Path

from browser import open_page
from PIL import Image

REPORT = Path("results", "index.html")
OUT = Path(__file__).parent / "_static" / "report.png"
WIDTH, MARGIN = 1180, 24


def main() -> None:
    """Show the report down to the charts of the first task."""
    with open_page(REPORT, WIDTH, 900) as page:
        charts = page.locator(".pair").first.bounding_box()
        height = round(charts["y"] + charts["height"] + MARGIN)
        page.set_viewport_size({"width": WIDTH, "height": height})
        page.screenshot(path=OUT)
    Image.open(OUT).convert("RGB").quantize(256).save(OUT, optimize=True)
    print(f"{OUT}: {OUT.stat().st_size / 1000:.0f} kB")


if __name__ == "__main__":
    main()
