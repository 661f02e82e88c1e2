"""Everything of a batch of episodes in one object, and what moves them to lanes and back."""

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from llvmlite import ir
from numba import types
from numpy.typing import NDArray

from kinarm.chain import Chain
from kinarm.contact_shapes import ContactShapes
from kinarm.episodes import Control, Episodes, Rules
from kinarm.kernels.compiling import Array, Stage, helper
from kinarm.kernels.lane_copies import move_bodies, put, put_scene, take, take_rows
from kinarm.kernels.lanes import as_numbers, instruction
from kinarm.kernels.records import Record, table
from kinarm.kernels.work_space import Alone, Block, furnish, layouts, sizes_of, work_space


@helper
def load_episode(
    e: int,
    lane: int,
    shapes: ContactShapes,
    rules: Rules,
    control: Control,
    episodes: Episodes,
    block: Block,
) -> None:
    """Put an episode into a lane; its observation only if needed."""
    put(episodes.q, e, block.q, 0, lane)
    put(episodes.target, e, block.target, 0, lane)
    put(episodes.goal, e, block.goal, 0, lane)
    if block.turn.shape[0] > 0:
        pursuit = episodes.pursuit
        put(pursuit.reached, e, block.reached, 0, lane)
        as_numbers(block.turn)[0, lane] = pursuit.turn[e]
        as_numbers(block.held)[0, lane] = pursuit.held[e]
        as_numbers(block.goals_reached)[0, lane] = pursuit.goals_reached[e]
    remembers = rules.width < block.observation.shape[1]
    if control.layers.shape[0] > 0 or block.moments.shape[1] > 0 or remembers:
        put(episodes.observation, e, block.observation, 0, lane)
    if block.plant.shape[0] > 0:
        put(episodes.plant, e, block.plant, 0, lane)
        put(episodes.sensed, e, block.sensed, 0, lane)
        for row in range(block.drive.shape[0]):
            put(episodes.drive[e], row, block.drive, row, lane)
    for pair in range(episodes.planes.shape[1]):
        put(episodes.planes[e], pair, block.planes, pair, lane)
    if episodes.scenes.shape[0] > 0:
        for poses in (block.before, block.after):
            put_scene(episodes.scenes, e, lane, poses)
            move_bodies(e, episodes.steps[e], lane, shapes, rules, episodes.scenes, poses)
    if block.weights.shape[1] > 0:
        put(control.weights, control.policy[e], block.weights, 0, lane)
    for power in range(2):
        put(episodes.moments[e], power, block.moments, power, lane)
    as_numbers(block.distance)[0, lane] = episodes.distance[e]
    as_numbers(block.total)[0, lane] = episodes.total[e]
    as_numbers(block.steps)[0, lane] = episodes.steps[e]
    as_numbers(block.stop)[0, lane] = episodes.stop[e]
    as_numbers(block.cleared)[0, lane] = 1.0 if episodes.cleared[e] else 0.0
    as_numbers(block.shielding)[0, lane] = episodes.shielding[e]
    as_numbers(block.alive)[0, lane] = 1.0


@helper
def store_episode(lane: int, e: int, episodes: Episodes, block: Block) -> None:
    """Hand an episode back and free its lane."""
    steps = int(as_numbers(block.steps)[0, lane])
    take(block.q, 0, lane, episodes.q, e)
    take(block.target, 0, lane, episodes.target, e)
    if block.turn.shape[0] > 0:
        take(block.goal, 0, lane, episodes.goal, e)
        pursuit = episodes.pursuit
        take(block.reached, 0, lane, pursuit.reached, e)
        pursuit.turn[e] = as_numbers(block.turn)[0, lane]
        pursuit.held[e] = int(as_numbers(block.held)[0, lane])
        pursuit.goals_reached[e] = int(as_numbers(block.goals_reached)[0, lane])
    if steps > episodes.steps[e]:
        take(block.observation, 0, lane, episodes.observation, e)
    take_rows(block.planes, lane, episodes.planes[e])
    if block.plant.shape[0] > 0:
        take(block.sensed, 0, lane, episodes.sensed, e)
        take_rows(block.drive, lane, episodes.drive[e])
    take_rows(block.moments, lane, episodes.moments[e])
    take(block.terms, 0, lane, episodes.terms, e)
    episodes.distance[e] = as_numbers(block.distance)[0, lane]
    episodes.total[e] = as_numbers(block.total)[0, lane]
    episodes.steps[e] = steps
    episodes.cleared[e] = False
    as_numbers(block.alive)[0, lane] = 0.0


class SessionFields(NamedTuple):
    """Records in a `Session`, which kernels see as attributes."""

    chain: Chain
    shapes: ContactShapes
    rules: Rules
    control: Control
    episodes: Episodes
    block: Block
    alone: Alone
    tries: Block
    ahead: Block
    stages: NDArray[np.int64]


OBSERVE, ACT, SHIELD = range(3)
"""Stages of a session: addresses of what writes observations, runs networks, and replaces steps."""


class Session(Record):
    """Arm, scene, rules, source of actions, episodes and work space, as records.

    Each thread needs its own, from `of_thread`. Takes the stages `OBSERVE`, `ACT` and `SHIELD`, of
    which those that it has are compiled.

    Attributes
    ----------
    control, episodes : Control and Episodes
        As Python sees them.
    """

    def __init__(
        self,
        chain: Any,
        shapes: Any,
        rules: Any,
        control: Any,
        episodes: Any,
        stages: Sequence[Stage],
    ) -> None:
        self.control: Control = control.values
        self.episodes: Episodes = episodes.values
        weights, n_observations = self.control.weights, self.episodes.observation.shape[1]
        lags = self.episodes.plant.shape[1] > 0 or len(shapes.values.moving) > 0
        sizes = {
            **sizes_of(shapes.values),
            "n_joints": self.episodes.q.shape[1],
            "n_actuated": rules.values.step_limit.shape[0],
            "n_observations": n_observations,
            "n_terms": rules.values.reward.shape[0],
            "widest": max(self.control.layers.tolist()[1:], default=1),
            "own": weights.shape[1] if weights.shape[0] > 1 else 0,
            "summed": n_observations if len(self.episodes.moments) > 0 else 0,
            "plant": self.episodes.plant.shape[1],
            "drive": self.episodes.drive.shape[1],
            "goal_width": self.episodes.pursuit.reached.shape[1],
            "looks": int(lags and len(rules.values.shield) > 0),
            "shares": len(rules.values.shield),
            "newton": rules.values.newton,
        }
        space = work_space(**sizes)
        furnish(shapes.values.placed, *space)
        tries, ahead = (
            layouts(**sizes)[0].record() if needed else space[0]
            for needed in (sizes["shares"], sizes["looks"])
        )
        addresses = np.zeros(len(stages), dtype=np.int64)
        given = (chain, shapes, rules, control, episodes)
        parts = SessionFields(*given, *space, tries, ahead, addresses)
        super().__init__(*table(parts), parts)
        for place, has in enumerate((True, len(self.control.layers) > 0, sizes["shares"] > 0)):
            if has:
                addresses[place] = stages[place].address(self._numba_type_)
        self._others: list[Session] = []
        self._given = (*given, stages)

    def of_thread(self, number: int) -> "Session":
        """The session of a thread; this one is that of thread 0."""
        while len(self._others) < number:
            self._others.append(Session(*self._given))
        return self._others[number - 1] if number else self

    def refill(self, control: Control, starts: Array, goals: Array, shift: Array | None) -> bool:
        """Take networks, starts and goals, if they have the same number and form.

        Parameters
        ----------
        control, starts, goals, shift
            The networks, and as for `kinarm.World.episodes`.
        """
        episodes = self.episodes
        pairs = zip(self.control, control, strict=True)
        parts: list[Any] = [pair for pair in pairs if isinstance(pair[0], np.ndarray)]
        collected = 0 if shift is None else len(starts)
        if (
            episodes.q.shape != starts.shape
            or (self.control.side, self.control.rates) != (control.side, control.rates)
            or len(episodes.moments) != collected
            or any(own.shape != other.shape for own, other in parts)
        ):
            return False
        for own, other in parts:
            own[...] = other
        episodes.q[:], episodes.target[:], episodes.goal[:] = starts, starts, goals
        episodes.touched[:], episodes.steps[:] = 0, 0
        if shift is not None:
            episodes.shift[:], episodes.moments[:] = shift, 0.0
        return True


@instruction
def take_number(_: Any, counter: types.Array) -> Any:
    """Raise a counter, an array of one int64, by one; return its former value.

    Threads get different numbers.
    """

    def code(context: Any, builder: Any, _signature: Any, arguments: Any) -> Any:
        from numba.np.arrayobj import make_array

        array = make_array(counter)(context, builder, arguments[0])
        one = ir.Constant(ir.IntType(64), 1)
        return builder.atomic_rmw("add", array.data, one, "monotonic")

    return types.int64(counter), code
