"""Everything that a batch of episodes needs, bound into one object.

Numba takes apart every array that Python hands to a kernel, which for short calls costs more than
the call. A session is taken apart once.
"""

from numba import types
from numba.experimental import structref


@structref.register
class SessionType(types.StructRef):  # type: ignore[misc]
    """Numba's type of a `Session`."""


class Session(structref.StructRefProxy):  # type: ignore[misc]
    """Arm, scene, rules, source of actions and episodes; kernels see them as its attributes."""


structref.define_proxy(Session, SessionType, ["chain", "shapes", "rules", "control", "episodes"])
