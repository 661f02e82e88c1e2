"""Boxes as mesh files."""

from pathlib import Path

import numpy as np

CUBE_CORNERS = np.array([(x, y, z) for x in (0, 1) for y in (0, 1) for z in (0, 1)], dtype=float)
CUBE_FACES = [
    *[(0, 1, 3), (0, 3, 2), (4, 6, 7), (4, 7, 5), (0, 4, 5), (0, 5, 1)],
    *[(2, 3, 7), (2, 7, 6), (0, 2, 6), (0, 6, 4), (1, 5, 7), (1, 7, 3)],
]


def write_stl(path: Path, corners: np.ndarray) -> None:
    """Write a box of triangles as ASCII STL."""
    facets = "".join(
        "facet normal 0 0 0\nouter loop\n"
        + "".join("vertex {} {} {}\n".format(*corners[i]) for i in face)
        + "endloop\nendfacet\n"
        for face in CUBE_FACES
    )
    path.write_text(f"solid box\n{facets}endsolid box\n")


def write_obj(path: Path, corners: np.ndarray) -> None:
    """Write a box of triangles as OBJ."""
    vertices = "".join("v {} {} {}\n".format(*corner) for corner in corners)
    faces = "".join("f {} {} {}\n".format(*(i + 1 for i in face)) for face in CUBE_FACES)
    path.write_text(vertices + faces)
