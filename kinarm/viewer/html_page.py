"""Pages: one HTML file with Meshcat's viewer and all that it shows, which needs no network."""

import base64
import gzip
import json
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from importlib import resources
from pathlib import Path
from typing import Any

from jinja2 import Environment, FunctionLoader, StrictUndefined
from markupsafe import Markup

from kinarm._files import write_text
from kinarm.arm import Arm
from kinarm.scene import Scene
from kinarm.viewer.camera import stage_scale
from kinarm.viewer.visual_shapes import arm_parts, link_joints

NOTEBOOK_HEIGHT = 560
"""Height of a page in a notebook [pixels]."""

NOTEBOOK_FRAME = Markup(
    '<iframe srcdoc="{}" title="{}" '
    'style="width: 100%; height: {}px; border: 0; border-radius: 8px" '
    'loading="lazy" allowfullscreen></iframe>'
)


@dataclass(frozen=True)
class HtmlPage:
    """A page, whose ``html`` refers to nothing outside of itself. In a notebook it shows itself."""

    html: str

    def save(self, path: str | Path) -> None:
        """Write the page to a file; if that fails, an existing one is left as it was."""
        write_text(path, self.html)

    def __repr__(self) -> str:
        return f"{type(self).__name__}({len(self.html) / 1e6:.1f} MB of HTML)"

    def _repr_html_(self) -> str:
        return NOTEBOOK_FRAME.format(self.html, type(self).__name__, NOTEBOOK_HEIGHT)


def page_html(
    template: str, title: str, scene: bytes, data: Mapping[str, Any], parts: Sequence[str]
) -> str:
    """Fill a template.

    Parameters
    ----------
    template, title
        Name of the template, which extends ``page.html``, and of its style sheet; the page's title.
    scene : bytes
        Commands to Meshcat's viewer, each framed.
    data : mapping
        What the scripts have to know, in terms that JSON can hold.
    parts : sequence of str
        Scripts, after those of every page.
    """
    described = json.dumps(data, separators=(",", ":"), sort_keys=True)
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


def arm_data(arm: Arm, scene: Scene) -> dict[str, Any]:
    """Describe an arm: its axes and tool, which joint carries which body, its colour and size."""
    chain, painted = arm.chain, Counter[int]()
    columns = chain.translation, chain.rotation, chain.axis, chain.prismatic
    for part in arm_parts(arm):
        painted[part.finish.colour] += len(part.mesh.faces)
    return {
        "arm": arm.name,
        "axes": [
            dict(zip(("translation", "rotation", "axis", "slides"), axis, strict=True))
            for axis in zip(*(column.tolist() for column in columns), strict=True)
        ],
        "tool": chain.tool.tolist(),
        "links": link_joints(arm),
        "scale": stage_scale(arm, scene),
        "swatch": f"#{painted.most_common(1)[0][0]:06x}",
    }


def _own_text(name: str) -> Markup:
    """Text of a file beside this one, to be put into the page as it is."""
    return Markup((resources.files("kinarm.viewer") / name).read_text(encoding="utf-8"))


def _meshcat(ending: str = "") -> bytes:
    """Meshcat's viewer, or what lies beside it."""
    return (resources.files("meshcat") / f"viewer/dist/main.min.js{ending}").read_bytes()


@lru_cache(maxsize=4)
def _gzip_base64(content: bytes) -> str:
    return base64.b64encode(gzip.compress(content, 9, mtime=0)).decode()
