"""Everything that a batch of episodes needs, bound into one object."""

from typing import Any, NamedTuple

import numpy as np
from llvmlite import ir
from numba import types
from numpy.typing import NDArray

from kinarm.chain import Chain
from kinarm.contact_shapes import ContactShapes
from kinarm.episodes import Control, Episodes, Rules
from kinarm.kernels.block import Alone, Block, work_space
from kinarm.kernels.compiling import Array
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
    """Arm, scene, rules, source of actions and episodes, all records, and work space.

    One thread at a time may use it; others need one `of_thread`.

    Attributes
    ----------
    control, episodes : Control and Episodes
        Source of actions and episodes, as Python sees them.
    """

    def __init__(self, chain: Any, shapes: Any, rules: Any, control: Any, episodes: Any) -> None:
        self.control: Control = control.values
        self.episodes: Episodes = episodes.values
        weights, n_observations = self.control.weights, self.episodes.observation.shape[1]
        space = work_space(
            n_joints=self.episodes.q.shape[1],
            n_actuated=rules.values.step_limit.shape[0],
            n_observations=n_observations,
            n_pairs=self.episodes.planes.shape[1],
            n_terms=rules.values.reward.shape[0],
            widest=max(self.control.layers.tolist()[1:], default=1),
            own=weights.shape[1] if weights.shape[0] > 1 else 0,
            summed=n_observations if len(self.episodes.moments) > 0 else 0,
        )
        parts = SessionFields(chain, shapes, rules, control, episodes, *space)
        super().__init__(*table(parts), parts)
        self._others: list[Session] = []

    def of_thread(self, number: int) -> "Session":
        """Which session one of several threads is to use, counted from 0: this one, or another."""
        while len(self._others) < number:
            self._others.append(Session(*self.values[:5]))
        return self._others[number - 1] if number else self

    def refill(self, control: Control, starts: Array, goals: Array, shift: Array | None) -> bool:
        """Take other networks, starts and goals, if they are as many and of the same form.

        Parameters
        ----------
        control, starts, goals, shift
            As for `kinarm.World.episodes`, and the networks.
        """
        episodes = self.episodes
        parts = [*zip(_arrays(self.control), _arrays(control), strict=True)]
        collected = 0 if shift is None else len(starts)
        if (
            episodes.q.shape != starts.shape
            or len(episodes.moments) != collected
            or any(own.shape != other.shape for own, other in parts)
        ):
            return False
        for own, other in parts:
            own[...] = other
        episodes.q[:], episodes.target[:], episodes.goal[:] = starts, starts, goals
        episodes.touched[:] = 0
        if shift is not None:
            episodes.shift[:], episodes.moments[:] = shift, 0.0
        return True


def _arrays(control: Control) -> list[NDArray[Any]]:
    """All that differs from one control to another."""
    return [part for part in control if isinstance(part, np.ndarray)]


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
