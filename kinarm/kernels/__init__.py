"""Compiled kernels: whole episodes, each step proven free of contact or left to Coal.

Kernels that Python calls document their parameters. Their helpers (`inlined`,
`helper`) share these arguments and the names of their fields:

chain, shapes, rules, control, episodes
    `Chain`, `ContactShapes`, `Rules`, `Control` and `Episodes`.
first, last : int
    Range of rows.
row, e : int
    Row in the arrays of a batch: which configuration or episode.
pair : int
    Row of ``pairs``.
poses : ndarray, shape (n_joints + 1, POSE)
    Forward kinematics: row 0 is the world, row k the frame of joint k.
"""

import numba

from kinarm.errors import KinarmError

TESTED = (0, 62), (0, 68)
"""First and last version of Numba that is known to work."""

if not TESTED[0] <= numba.version_info.short <= TESTED[1]:
    raise KinarmError(
        f"kinarm works with Numba {TESTED[0][0]}.{TESTED[0][1]} to {TESTED[1][0]}.{TESTED[1][1]}, "
        f"not {numba.__version__}: pip install 'numba<{TESTED[1][0]}.{TESTED[1][1] + 1}'"
    )
