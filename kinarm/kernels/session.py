"""Everything that a batch of episodes needs, bound into one object.

Numba takes apart every array that Python hands to a kernel, which for short calls costs more than
the call. A session is taken apart once.
"""

from numba import types
from numba.experimental import structref

from kinarm.chain import Chain
from kinarm.contact_shapes import ContactShapes
from kinarm.episodes import Control, Episodes, Rules
from kinarm.kernels.block import Alone, Block


@structref.register
class SessionType(types.StructRef):
    """Numba's type of a `Session`."""


class Session(structref.StructRefProxy):
    """Arm, scene, rules, source of actions and episodes; kernels see them as its attributes.

    One thread at a time may use its block of lanes, and the space for a single episode; others
    need space of their own.
    """

    chain: Chain
    shapes: ContactShapes
    rules: Rules
    control: Control
    episodes: Episodes
    block: Block
    alone: Alone


structref.define_proxy(Session, SessionType, list(Session.__annotations__))
