"""Everything that a batch of episodes needs, bound into one object.

Numba takes apart every array that Python hands to a kernel, which for short calls costs more than
the call. A session is taken apart once.
"""

from collections.abc import Callable
from typing import Any, cast

from numba import types
from numba.core import cgutils
from numba.core.runtime.context import NRTContext
from numba.experimental import structref
from numba.extending import intrinsic

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


def _parts(_: Any, session: SessionType) -> Any:
    """What a session binds, work space apart, without counting references.

    For helpers, which hold none: a kernel that takes the attributes counts those of every array.
    """
    own = ("block", "alone")
    fields = {name: kind for name, kind in session.field_dict.items() if name not in own}

    def code(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        data = session.get_data_type()
        held = cgutils.create_struct_proxy(session)(context, builder, value=arguments[0])
        place = NRTContext(context, enabled=True).meminfo_data(builder, held.meminfo)
        kind = context.data_model_manager[data].get_value_type().as_pointer()
        place = builder.bitcast(place, kind)
        bound = cgutils.create_struct_proxy(data, kind="data")(context, builder, ref=place)
        values = [getattr(bound, name) for name in fields]
        return context.make_tuple(builder, signature.return_type, values)

    return types.Tuple(list(fields.values()))(session), code


Parts = tuple[Chain, ContactShapes, Rules, Control, Episodes]
parts = cast("Callable[[Session], Parts]", intrinsic(_parts))
