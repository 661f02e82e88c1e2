"""Drawings of reports, and meshes."""

import numpy as np

from kinarm.viewer.meshes import Mesh

PIXEL = 0.051
"""Coordinates are written to a tenth."""


def volume(mesh: Mesh) -> float:
    """Volume within a closed mesh whose outside is out [m^3]."""
    a, b, c = (mesh.vertices[mesh.faces[:, k]] for k in range(3))
    return float((np.cross(a, b) * c).sum() / 6)
