"""Pages: one HTML file with Meshcat's viewer and all that it shows, which needs no network."""

import base64
import gzip
import json
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache
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
    """A page. In a notebook it shows itself.

    Attributes
    ----------
    html : str
        The whole page; it refers to nothing outside of itself.
    """

    html: str

    def save(self, path: str | Path) -> None:
        """Write the page to a file.

        Raises
        ------
        OutputError
            If the file cannot be written; an existing file is then left as it was.
        """
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
    template : str
        Name of the template, which extends ``page.html``, and of its style sheet.
    title : str
        Title of the page.
    scene : bytes
        Commands to Meshcat's viewer, each led by its length.
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
        licence=_licence(),
        meshcat=_meshcat_base64(),
        scene=_gzip_base64(scene),
        data=_gzip_base64(described.encode()),
        scripts=[_own_text(f"{name}.js") for name in ("page", "stage", *parts)],
    )


def arm_data(arm: Arm, scene: Scene) -> dict[str, Any]:
    """Describe an arm: its axes and tool, which joint carries which body, its colour and size."""
    chain, painted = arm.chain, Counter[int]()
    for part in arm_parts(arm):
        painted[part.finish.colour] += len(part.mesh.faces)
    return {
        "arm": arm.name,
        "axes": [
            {
                "translation": chain.translation[k].tolist(),
                "rotation": chain.rotation[k].tolist(),
                "axis": chain.axis[k].tolist(),
                "slides": bool(chain.prismatic[k]),
            }
            for k in range(arm.n_joints)
        ],
        "tool": chain.tool.tolist(),
        "links": link_joints(arm),
        "scale": stage_scale(arm, scene),
        "swatch": f"#{painted.most_common(1)[0][0]:06x}",
    }


def _own_text(name: str) -> Markup:
    """Text of a file beside this one, to be put into the page as it is."""
    return Markup((resources.files("kinarm.viewer") / name).read_text(encoding="utf-8"))


@cache
def _licence() -> Markup:
    """Licence of Meshcat's viewer, fit for a comment."""
    text = resources.files("meshcat") / "viewer/dist/main.min.js.LICENSE.txt"
    return Markup(text.read_text(encoding="utf-8").replace("--", "- -"))


@cache
def _meshcat_base64() -> str:
    script = resources.files("meshcat") / "viewer/dist/main.min.js"
    return _gzip_base64(script.read_bytes())


def _gzip_base64(content: bytes) -> str:
    return base64.b64encode(gzip.compress(content, 9, mtime=0)).decode()
