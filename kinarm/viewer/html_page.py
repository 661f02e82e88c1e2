"""HTML that refers to nothing else: templates, styles and scripts, Meshcat's viewer, and data."""

import base64
import gzip
import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from importlib import resources
from pathlib import Path
from typing import Any

import numpy as np
from jinja2 import Environment, FunctionLoader, StrictUndefined
from markupsafe import Markup

from kinarm._files import write_text

NOTEBOOK_HEIGHT = 560
"""Height of a page in a notebook [pixels]."""

NOTEBOOK_FRAME = Markup(
    '<iframe srcdoc="{}" title="{}" '
    'style="width: 100%; height: {}px; border: 0; border-radius: 8px" '
    'loading="lazy" allowfullscreen></iframe>'
)


@dataclass(frozen=True)
class HtmlPage:
    """A page whose ``html`` refers to nothing else. A notebook shows it."""

    html: str

    def save(self, path: str | Path) -> None:
        """Write the page to a file, or leave an existing one as it was."""
        write_text(path, self.html)

    def __repr__(self) -> str:
        return f"{type(self).__name__}({len(self.html) / 1e6:.1f} MB of HTML)"

    def _repr_html_(self) -> str:
        return NOTEBOOK_FRAME.format(self.html, type(self).__name__, NOTEBOOK_HEIGHT)


def page_html(
    template: str, title: str, scene: bytes, data: Mapping[str, Any], parts: Sequence[str]
) -> str:
    """Fill a template, which extends ``page.html`` and has a style of its name.

    The scene is framed commands to Meshcat's viewer, the data are what scripts have to know. Parts
    are the scripts after those of every page.
    """
    described = json.dumps(data, separators=(",", ":"), sort_keys=True, default=np.ndarray.tolist)
    environment = Environment(
        autoescape=True,
        undefined=StrictUndefined,
        keep_trailing_newline=True,
        loader=FunctionLoader(_own_text),
    )
    return environment.get_template(f"{template}.html").render(
        title=title,
        style=_own_text("page.css") + _own_text(f"{template}.css"),
        licence=Markup(_meshcat(".LICENSE.txt").decode().replace("--", "- -")),
        meshcat=_gzip_base64(_meshcat()),
        scene=_gzip_base64(scene),
        data=_gzip_base64(described.encode()),
        scripts=[_own_text(f"{name}.js") for name in ("page", "stage", *parts)],
    )


def _own_text(name: str) -> Markup:
    """Text of a file beside this one, for a page."""
    return Markup((resources.files("kinarm.viewer") / name).read_text(encoding="utf-8"))


def _meshcat(ending: str = "") -> bytes:
    """Meshcat's viewer, or what lies beside it."""
    return (resources.files("meshcat") / f"viewer/dist/main.min.js{ending}").read_bytes()


@lru_cache(maxsize=4)
def _gzip_base64(content: bytes) -> str:
    return base64.b64encode(gzip.compress(content, 9, mtime=0)).decode()
