"""The looks of the project's own arms are those that the docs' script makes."""

import numpy as np
import pytest

from docs.make_arm_looks import ARMS, NAMES, looks
from kinarm import Arm
from kinarm._files import load_archive
from kinarm.errors import ArmError
from kinarm.viewer.visual_shapes import LOOKS


@pytest.mark.parametrize("name", NAMES)
def test_shipped_looks_are_made_from_the_table(name):
    arrays, header = looks(Arm.load(name))
    shipped = load_archive(ARMS / f"{name}.npz", *LOOKS, ArmError)
    assert shipped.header == header
    assert shipped.arrays.keys() == arrays.keys()
    for part, array in arrays.items():
        if array.dtype.kind == "f":
            np.testing.assert_allclose(array, shipped.arrays[part], atol=1e-12)
        else:
            np.testing.assert_array_equal(array, shipped.arrays[part])
