"""Make the looks of the project's own arms, ``data/arms/*.npz``, from ``docs/arm_looks.toml``.

Run ``python docs/make_arm_looks.py`` from the root of a clone. The table describes an industrial
arm; the lengths of the upper arm, the forearm and the tool come from each arm.
"""

import tomllib
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from kinarm import Arm
from kinarm._files import save_archive
from kinarm.viewer import meshes
from kinarm.viewer.meshes import SEGMENTS, Mesh, box, capsule, loft
from kinarm.viewer.visual_shapes import LOOKS

TABLE = Path(__file__).with_name("arm_looks.toml")
ARMS = Path(__file__).parents[1] / "data" / "arms"

NAMES = ("lrmate200ic_5l", "paper", "paper_flange")


COORDINATES = {"x": (2, 0, 1), "y": (1, 2, 0), "z": (0, 1, 2)}
"""Which coordinates of what stands along z come first to last along an axis."""


def lathe(profile: Sequence[tuple[float, float]], axis: str = "z") -> Mesh:
    """Turn a profile of positions and radii [m] about an axis."""
    upright = meshes.lathe(profile)
    return Mesh(upright.vertices[:, COORDINATES[axis]], upright.faces)


def cylinder(length: float, radius: float, chamfer: float, axis: str = "z") -> Mesh:
    """A cylinder about the origin with chamfered rims [m]."""
    half = length / 2
    profile = [(-half, radius - chamfer), (-half + chamfer, radius)]
    return lathe([*profile, (half - chamfer, radius), (half, radius - chamfer)], axis)


def housing(sections: Sequence[tuple[float, float, float, float, float]]) -> Mesh:
    """Blend rounded cross sections that are stacked along z.

    Each has height, centre and half widths [m], and an exponent: 2 is an ellipse, more is boxier.
    """
    angle = np.linspace(0, 2 * np.pi, SEGMENTS, endpoint=False)
    z, x, half_x, half_y, exponent = np.array(sections, dtype=float).T[..., None]
    cosine, sine = (
        np.sign(f) * np.abs(f) ** (2 / exponent) for f in (np.cos(angle), np.sin(angle))
    )
    return loft(np.stack([x + half_x * cosine, half_y * sine, z + 0 * angle], axis=2))


def plate(outline: Sequence[ArrayLike], levels: Sequence[tuple[float, float]]) -> Mesh:
    """Stack an outline of points x, z along y, by levels y and scales [m, 1]."""
    flat = np.array(outline, dtype=float)
    return loft(np.array([np.insert(scale * flat, 1, y, axis=1) for y, scale in levels]))


SHAPES = {shape.__name__: shape for shape in (box, capsule, cylinder, housing, lathe, plate)}


def parts(arm: Arm) -> Iterator[tuple[int, str, Mesh]]:
    """Joint, finish and triangles of each part, in the lengths of an arm."""
    chain = arm.chain
    lengths = {"upper": chain.translation[2][2], "forearm": chain.translation[3][0]}
    lengths |= {"tool": chain.tool[0], "m": 1.0}

    def measured(value: Any) -> Any:
        """Sum up lengths wherever they occur in the sizes of a part."""
        if isinstance(value, dict):
            return sum(share * lengths[name] for name, share in value.items())
        return [measured(each) for each in value] if isinstance(value, list) else value

    for part in tomllib.loads(TABLE.read_text(encoding="utf-8"))["part"]:
        if lengths[part.get("with", "m")]:
            sizes = {name: measured(size) for name, size in part["sizes"].items()}
            for place in part.get("places", [(0.0, 0.0, 0.0)]):
                mesh = SHAPES[part["shape"]](**sizes).moved(measured(place))
                yield part["joint"], part["finish"], mesh


def looks(arm: Arm) -> tuple[dict[str, NDArray[Any]], dict[str, Any]]:
    """Arrays and header of an arm's file."""
    joints, finishes, shapes = zip(*parts(arm), strict=True)
    arrays = {"joints": np.array(joints), "finishes": np.array(finishes)}
    for number, mesh in enumerate(shapes):
        arrays |= {f"vertices {number}": mesh.vertices, f"faces {number}": mesh.faces}
    return arrays, {"names": [*arm.joint_names], "tool": arm.chain.tool.tolist()}


if __name__ == "__main__":
    for name in NAMES:
        save_archive(ARMS / f"{name}.npz", *LOOKS, *looks(Arm.load(name)), compress=True)
