"""Triangles to pictures: raylib's renderer in software, which needs no display or OpenGL."""

import ctypes
import logging
import os
from collections.abc import Iterable, Sequence
from functools import cache
from pathlib import Path
from threading import Lock
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from kinarm.errors import needed
from kinarm.kernels.compiling import Array

SAMPLES = 3
"""Samples along each side of a pixel, whose mean it shows."""

NEAR = 0.03
"""What is nearer is not drawn, as a share of the distance from camera to target."""

# Of OpenGL, whose numbers raylib takes.
PROJECTION, MODEL_VIEW, PLACES, COLOURS = 0x1701, 0x1700, 0x8074, 0x8076

DRAWING = Lock()
"""Held while a picture is drawn: there is one renderer in a process."""


class Layer(NamedTuple):
    """Triangles that are seen where they are anticlockwise.

    Attributes
    ----------
    places : ndarray, shape (3 n, 3)
        Their corners [m].
    colours : ndarray, shape (3 n, 4)
        Red, green, blue and opacity there, from 0 to 255.
    hidden, hides : bool
        Whether what is nearer hides them, and they hide what is drawn later.
    """

    places: Array
    colours: Array
    hidden: bool = True
    hides: bool = True


@cache
def _raylib() -> Any:
    """Start raylib's renderer, silently.

    Raises
    ------
    MissingExtraError
        If raylib is not installed.
    """
    logging.getLogger("raylib").setLevel(logging.ERROR)  # else it warns that it is loaded
    raylib = needed("raylib", "raylib-software", "render")
    raylib.rl.SetTraceLogLevel(raylib.rl.LOG_NONE)
    flush, kept = ctypes.CDLL(None).fflush, os.dup(1)
    with Path(os.devnull).open("wb") as nowhere:
        flush(None)
        os.dup2(nowhere.fileno(), 1)
        raylib.rl.rlglInit(1, 1)  # prints a line
        flush(None)
    os.dup2(kept, 1)
    os.close(kept)
    return raylib


def draw(
    layers: Iterable[Layer],
    size: tuple[int, int],
    projection: Array,
    nearest: float,
    background: Sequence[int],
) -> NDArray[np.uint8]:
    """Draw a picture.

    Parameters
    ----------
    layers
        What it shows, one over the other.
    size : tuple of int
        Width and height [pixels].
    projection : ndarray, shape (3, 4)
        World to picture; see `kinarm.viewer.Camera.projection`.
    nearest : float
        What is nearer is not drawn [m].
    background : sequence of int
        Its red, green and blue, from 0 to 255.

    Returns
    -------
    ndarray of uint8, shape (height, width, 3)
        Red, green and blue.

    Raises
    ------
    MissingExtraError
        If raylib is not installed.
    """
    rl, ffi = _raylib().rl, _raylib().ffi
    columns, rows, ahead = projection
    clipped = [2 / size[0] * columns - ahead, ahead - 2 / size[1] * rows, ahead, ahead]
    matrix = np.array(clipped, dtype=np.float32).T.copy()
    matrix[3, 2] -= 2 * nearest
    width, height = (SAMPLES * side for side in size)
    with DRAWING:
        buffer = rl.rlLoadFramebuffer()
        colour = rl.rlLoadTexture(ffi.NULL, width, height, 7, 1)  # 7: 4 bytes for a sample
        depth = rl.rlLoadTextureDepth(width, height, True)
        rl.rlFramebufferAttach(
            buffer, colour, rl.RL_ATTACHMENT_COLOR_CHANNEL0, rl.RL_ATTACHMENT_TEXTURE2D, 0
        )
        rl.rlFramebufferAttach(
            buffer, depth, rl.RL_ATTACHMENT_DEPTH, rl.RL_ATTACHMENT_RENDERBUFFER, 0
        )
        rl.rlEnableFramebuffer(buffer)
        rl.rlViewport(0, 0, width, height)
        rl.rlMatrixMode(MODEL_VIEW)
        rl.rlLoadIdentity()
        rl.rlMatrixMode(PROJECTION)
        rl.rlLoadIdentity()
        rl.rlMultMatrixf(ffi.from_buffer("float[]", matrix))
        rl.rlClearColor(*background, 255)
        rl.rlEnableDepthMask()
        rl.rlClearScreenBuffers()
        rl.rlEnableBackfaceCulling()
        rl.rlEnableColorBlend()
        rl.rlSetBlendMode(rl.RL_BLEND_ALPHA)
        for layer in layers:
            (rl.rlEnableDepthTest if layer.hidden else rl.rlDisableDepthTest)()
            (rl.rlEnableDepthMask if layer.hides else rl.rlDisableDepthMask)()
            places = np.ascontiguousarray(layer.places, dtype=np.float32)
            colours = np.ascontiguousarray(layer.colours, dtype=np.uint8)
            rl.rlEnableStatePointer(PLACES, ffi.from_buffer(places))
            rl.rlEnableStatePointer(COLOURS, ffi.from_buffer(colours))
            rl.rlDrawVertexArray(0, len(places))
        read = rl.rlReadScreenPixels(width, height)
        samples = bytes(ffi.buffer(read, 4 * width * height))
        rl.MemFree(read)
        rl.rlDisableFramebuffer()
        rl.rlUnloadTexture(colour)
        rl.rlUnloadTexture(depth)
        rl.rlUnloadFramebuffer(buffer)
    # Rows come from below, and blue before red.
    image = Image.frombuffer("RGB", (width, height), samples, "raw", "BGRX", 0, -1)
    return np.array(image.reduce(SAMPLES))
