"""Drawings of reports, and meshes."""

import base64
import gzip
import re

import numpy as np

from kinarm.viewer.meshes import Mesh

PIXEL = 0.051
"""Coordinates are written to a tenth."""


def volume(mesh: Mesh) -> float:
    """Volume within a closed mesh whose outside is out [m^3]."""
    a, b, c = (mesh.vertices[mesh.faces[:, k]] for k in range(3))
    return float((np.cross(a, b) * c).sum() / 6)


def unpacked(page, name):
    """Data of a name in a page."""
    text = re.search(rf'id="data-{name}">([^<]*)<', page.html).group(1)
    return gzip.decompress(base64.b64decode(text))
