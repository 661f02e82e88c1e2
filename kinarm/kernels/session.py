"""Everything that a batch of episodes needs, bound into one object."""

from typing import Any, NamedTuple

from llvmlite import ir
from numba import types

from kinarm.chain import Chain
from kinarm.contact_shapes import ContactShapes
from kinarm.episodes import Control, Episodes, Rules
from kinarm.kernels.block import Alone, Block, work_space
from kinarm.kernels.lanes import instruction
from kinarm.kernels.records import Record, table


class SessionFields(NamedTuple):
    """The records that kernels find as attributes of a `Session`."""

    chain: Chain
    shapes: ContactShapes
    rules: Rules
    control: Control
    episodes: Episodes
    block: Block
    alone: Alone


class Session(Record):
    """Arm, scene, rules, source of actions and episodes, and work space.

    One thread at a time may use it; others need `another`.

    Parameters
    ----------
    chain, shapes, rules, control, episodes
        Records.
    """

    chain: Chain
    shapes: ContactShapes
    rules: Rules
    control: Control
    episodes: Episodes
    block: Block
    alone: Alone

    def __init__(self, chain: Any, shapes: Any, rules: Any, control: Any, episodes: Any) -> None:
        weights, layers = control.values.weights, control.values.layers.tolist()
        q, observation = episodes.values.q, episodes.values.observation
        space = work_space(
            n_joints=q.shape[1],
            n_actuated=rules.values.step_limit.shape[0],
            n_observations=observation.shape[1],
            n_pairs=episodes.values.planes.shape[1],
            n_terms=rules.values.reward.shape[0],
            widest=max(layers[1:], default=1),
            own=weights.shape[1] if weights.shape[0] > 1 else 0,
            summed=observation.shape[1] if len(episodes.values.moments) > 0 else 0,
        )
        parts = SessionFields(chain, shapes, rules, control, episodes, *space)
        super().__init__(*table(parts), parts)
        self._others: list[Session] = []

    def __reduce__(self) -> tuple[Any, ...]:
        return Session, self.values[:5]

    def another(self) -> "Session":
        """A session of the same, with work space of its own."""
        return Session(*self.values[:5])

    def of_thread(self, number: int) -> "Session":
        """Which session one of several threads is to use, counted from 0: this one, or another."""
        while len(self._others) < number:
            self._others.append(self.another())
        return self._others[number - 1] if number else self


@instruction
def take_number(_: Any, counters: types.Array, place: types.Integer) -> Any:
    """Raise one of some counters, an array of int64, by one; returns what it was.

    Threads that do so at the same time get different numbers.
    """

    def code(context: Any, builder: Any, _signature: Any, arguments: Any) -> Any:
        from numba.np.arrayobj import make_array

        array = make_array(counters)(context, builder, arguments[0])
        index = context.cast(builder, arguments[1], place, types.intp)
        one = ir.Constant(ir.IntType(64), 1)
        return builder.atomic_rmw("add", builder.gep(array.data, [index]), one, "monotonic")

    return types.int64(counters, place), code
