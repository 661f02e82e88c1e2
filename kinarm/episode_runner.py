"""Runs batches of episodes in a world: kernels step them, and Coal decides about doubtful steps."""

from contextlib import suppress
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from kinarm._parallel import one_torch_thread, run_together
from kinarm.episode_draws import scenes_at
from kinarm.episodes import PAUSED, RUNNING, TRUNCATED, Control, Episodes
from kinarm.errors import StartInContactError, finite_array
from kinarm.kernels.compiling import Array
from kinarm.kernels.rollout import advance, allow_one_step, begin, refuse
from kinarm.kernels.session import Session
from kinarm.networks import PolicyFunction, takes_rows
from kinarm.scenarios import draw_followers
from kinarm.step_contact import steps_in_contact
from kinarm.world import World


class EpisodeRunner:
    """Begins and advances episodes; see `kinarm.Simulator`."""

    def __init__(self, world: World) -> None:
        self.world, self.threads = world, world.threads
        self.checked_by_coal = 0
        self._last: Session | None = None
        self._idle: list[Session] = []

    def __getstate__(self) -> dict[str, Any]:
        return self.__dict__ | {"_last": None, "_idle": []}

    @property
    def n_observations(self) -> int:
        """Length of an observation."""
        return self.world.n_observations

    @property
    def n_actions(self) -> int:
        """Length of an action."""
        return self.world.n_actions

    def begin(self, episodes: Episodes, rows: NDArray[np.int64]) -> None:
        """Start episodes of some rows, in place, at their ``q`` and ``goal``."""
        episodes.steps[rows] = 0
        self._start(rows, self._stepped(episodes))

    def go_on(self, episodes: Episodes, rows: NDArray[np.int64]) -> None:
        """Let episodes go on whose last step was refused: the arm rests, and sees that."""
        before, session = episodes.observation[rows], self._stepped(episodes)
        run_together(begin, len(rows), self.threads, session.of_thread, rows)
        late = episodes.steps[rows] >= self.world.rules.horizon
        episodes.status[rows] = np.where(late, TRUNCATED, RUNNING)
        seen, layout = episodes.observation, self.world.layout
        seen[rows, layout.width :] = before[:, : -layout.width]
        if (place := layout.places.get("last_action")) is not None:
            seen[rows, place] = np.clip(session.control.actions[rows, 0], -1.0, 1.0)

    def _refilled(
        self, control: Control, starts: Array, goals: Array, shift: Array | None
    ) -> Session:
        """The last rollout's session, for this thread alone, or another."""
        with suppress(IndexError):
            session = self._idle.pop()
            if session.refill(control, starts, goals, shift):
                return session
        own = control._replace(layers=control.layers.copy(), weights=control.weights.copy())
        return self.world.session(own, self.world.episodes(starts, goals, shift=shift))

    def _run(self, session: Session) -> Episodes:
        """Start a session's episodes, and advance them to their end."""
        n = len(session.episodes.status)
        self._start(np.arange(n), session)
        self._advance(session, n * self.world.rules.horizon)
        return session.episodes

    def _start(
        self,
        rows: NDArray[np.int64],
        session: Session,
        origins: Array | None = None,
        drive: Array | None = None,
        done: NDArray[np.int64] | int = 0,
    ) -> None:
        """Start some episodes in their scenes; Coal decides about doubtful starts."""
        episodes, contacts = session.episodes, self.world.contact_model
        begun = episodes.q[rows] if origins is None else origins
        goals, followers = episodes.goal[rows], episodes.pursuit.goals
        if self.world.plants.width:
            plants = self.world.plants.of(begun, goals, self.threads)
            rests = drive is None or not len(drive)
            episodes.plant[rows] = plants
            episodes.drive[rows] = (
                self.world.plants.at_rest(plants, episodes.q[rows]) if rests else drive
            )
        if self.world.has_random_bodies:
            episodes.scenes[rows] = self.world.scenes_of(begun, goals)
        if len(followers):
            followers[rows] = draw_followers(self.world, begun, goals)
        if len(episodes.pursuit.goals_reached):
            episodes.pursuit.goals_reached[rows] = done
        if not run_together(begin, len(rows), self.threads, session.of_thread, rows):
            return
        paused = rows[episodes.status[rows] == PAUSED]
        there = self.world.moved(scenes_at(episodes.scenes, paused), episodes.steps[paused])
        touching = contacts.touching(episodes.q[paused], there)
        if touching.any():
            first = int(touching.argmax())
            model = contacts.at(there[first]) if len(there) else contacts
            pair = model.contact_pair(episodes.q[paused[first]])
            raise StartInContactError(int(paused[first]), pair or ("arm", "scene"))
        episodes.status[paused] = RUNNING

    def _stepped(self, episodes: Episodes) -> Session:
        """Session of stepped episodes, kept until others come."""
        if self._last is None or self._last.episodes is not episodes:
            control = Control(actions=np.zeros((len(episodes.status), 1, self.n_actions)))
            self._last = self.world.session(control, episodes)
        return self._last

    def _step(self, episodes: Episodes, actions: ArrayLike) -> Session:
        session = self._stepped(episodes)
        table = session.control.actions[:, 0]
        plain = isinstance(actions, np.ndarray) and actions.dtype.kind == "f"
        if not plain or np.shape(actions) != table.shape:
            actions = finite_array("actions", actions, table.shape)
        table[...] = actions
        if not allow_one_step(session):
            finite_array("actions", actions, table.shape)  # which says what is wrong
        self._advance(session, len(table))
        return session

    def _advance(self, session: Session, work: int) -> None:
        """Advance episodes to their stop; Coal decides about steps in doubt."""
        episodes = session.episodes
        while run_together(advance, work, self.threads, session.of_thread):
            paused = np.flatnonzero(episodes.status == PAUSED)
            resumed = self._decide(session, paused)
            if resumed.size == 0:
                return
            work = int((episodes.stop - episodes.steps)[resumed].sum())

    def _decide(self, session: Session, paused: NDArray[np.int64]) -> NDArray[np.int64]:
        """Let Coal refuse steps in doubt; return which episodes go on."""
        episodes = session.episodes
        ways = episodes.q[paused], episodes.target[paused], scenes_at(episodes.scenes, paused)
        steps = self.world.steps_of(*ways, episodes.steps[paused])
        refused, asked = steps_in_contact(steps, episodes.doubt[paused], self.world.rules)
        self.checked_by_coal += asked
        episodes.status[paused], episodes.cleared[paused] = RUNNING, ~refused
        if refused.any():
            refuse(paused[refused], session)
        resumed: NDArray[np.int64] = paused[episodes.status[paused] == RUNNING]
        return resumed

    @one_torch_thread()
    def _follow(self, policy: PolicyFunction, episodes: Episodes) -> None:
        """Drive episodes to their end with a Python function."""
        numbered = takes_rows(policy)
        actions = np.zeros((len(episodes.status), self.n_actions))
        while (rows := np.flatnonzero(episodes.status == RUNNING)).size:
            seen = episodes.observation[rows]
            chosen = policy(seen, rows=rows) if numbered else policy(seen)
            actions[rows] = finite_array("actions", chosen, (len(rows), self.n_actions))
            self._step(episodes, actions)
