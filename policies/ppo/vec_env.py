"""The simulator as a vectorised environment of Stable-Baselines3."""

import time
from typing import Any, NamedTuple

import numpy as np
from gymnasium.spaces import Box
from numpy.typing import NDArray
from stable_baselines3.common.vec_env import VecEnv

from kinarm.episodes import RUNNING, SUCCESS, TRUNCATED, Episodes
from kinarm.errors import InvalidInputError
from kinarm.networks import Mirror
from kinarm.policies.normalizer import Normalizer, input_scale
from kinarm.policies.ppo.state import EpisodeStates
from kinarm.simulator import Simulator


class EndedEpisodes(NamedTuple):
    """Episodes of an `SB3VecEnv` since the last look: returns, successes, time in steps [s]."""

    returns: list[float]
    successes: list[bool]
    time: float


class SB3VecEnv(VecEnv):
    """Many arms, stepped by one call of the compiled simulator.

    Episodes that end are replaced at once; ``rng`` draws starts and goals. With a mirror, an arm
    whose goal lies to the left is seen in the mirror, and its actions are reflected likewise, so
    that a learner only ever meets goals to the right.

    Attributes
    ----------
    start_spread : float
        Scales the range of the start configurations of episodes to come.

    Notes
    -----
    The info of an episode that ended holds what Stable-Baselines3 looks for:
    ``terminal_observation``, ``TimeLimit.truncated``, ``is_success`` and ``episode`` (return
    ``r`` and length ``l``). All other infos are empty.
    """

    def __init__(
        self,
        simulator: Simulator,
        num_envs: int,
        *,
        rng: np.random.Generator,
        mirror: Mirror | None = None,
    ) -> None:
        self.simulator, self.rng, self.mirror = simulator, rng, mirror
        self.start_spread = simulator.task.start_spread
        self.render_mode = None
        self.normalize_by(Normalizer.empty(simulator.n_observations))
        seen = Box(-np.inf, np.inf, (simulator.n_observations,), dtype=np.float32)
        moved = Box(-1.0, 1.0, (simulator.n_actions,), dtype=np.float32)
        super().__init__(num_envs, seen, moved)
        self._episodes: Episodes | None = None
        self._actions = np.zeros((num_envs, simulator.n_actions))
        self._returns: list[float] = []
        self._successes: list[bool] = []
        self._time = 0.0

    def reset(self) -> NDArray[np.float32]:
        """Begin all episodes anew; returns observations, shape (num_envs, n_observations)."""
        self._episodes = self.simulator.reset(*self._scenarios(self.num_envs))
        return self._normalized(self._episodes.observation)

    def _scenarios(self, count: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Starts and goals of new episodes."""
        return self.simulator.sample(self.rng, count, start_spread=self.start_spread)

    def step_async(self, actions: NDArray[Any]) -> None:
        """Take note of the actions, shape (num_envs, n_actions), for `step_wait`."""
        self._actions = np.asarray(actions, dtype=np.float64)

    def step_wait(
        self,
    ) -> tuple[NDArray[np.float32], NDArray[np.float32], NDArray[np.bool_], list[dict[str, Any]]]:
        """Move every arm for one time step.

        Returns observations (those of new episodes where one ended), rewards, dones and infos.
        """
        began = time.perf_counter()
        episodes = self._begun_episodes()
        result = self.simulator.step(episodes, self._simulator_actions(episodes.observation))
        dones = episodes.status != RUNNING
        infos: list[dict[str, Any]] = [{} for _ in range(self.num_envs)]
        ended = np.flatnonzero(dones)
        if ended.size:
            for row, info in zip(
                ended.tolist(), self._infos_of_ended(episodes, ended), strict=True
            ):
                infos[row] = info
            episodes.q[ended], episodes.goal[ended] = self._scenarios(ended.size)
            self.simulator.begin(episodes, ended)
        observations = self._normalized(episodes.observation)
        self._time += time.perf_counter() - began
        return observations, result.reward.astype(np.float32), dones, infos

    def _infos_of_ended(self, episodes: Episodes, rows: NDArray[np.int64]) -> list[dict[str, Any]]:
        """Infos of episodes that ended, which are also put on record."""
        final = self._normalized(episodes.observation[rows])
        truncated = (episodes.status[rows] == TRUNCATED).tolist()
        successes = (episodes.status[rows] == SUCCESS).tolist()
        returns, lengths = episodes.total[rows].tolist(), episodes.steps[rows].tolist()
        self._returns += returns
        self._successes += successes
        return [
            {
                "terminal_observation": final[k],
                "TimeLimit.truncated": truncated[k],
                "is_success": successes[k],
                "episode": {"r": returns[k], "l": lengths[k]},
            }
            for k in range(rows.size)
        ]

    def take_ended(self) -> EndedEpisodes:
        """What happened since the last call."""
        record = EndedEpisodes(self._returns, self._successes, self._time)
        self._returns, self._successes, self._time = [], [], 0.0
        return record

    def _begun_episodes(self) -> Episodes:
        if self._episodes is None:
            raise InvalidInputError("the environment was never begun: call reset()")
        return self._episodes

    def _normalized(self, observations: NDArray[np.float64]) -> NDArray[np.float32]:
        """Observations as the learner sees them."""
        if self.mirror is not None:
            observations = self.mirror.from_the_right(observations)
        seen: NDArray[np.float32] = ((observations - self._mean) * self._scale).astype(np.float32)
        return seen

    def _simulator_actions(self, observations: NDArray[np.float64]) -> NDArray[np.float64]:
        """The learner's actions, given what it saw, as the simulator needs them."""
        if self.mirror is None:
            return self._actions
        left = self.mirror.on_the_left(observations)
        return np.where(left[:, None], self._actions * self.mirror.actions, self._actions)

    def normalize_by(self, normalizer: Normalizer) -> None:
        """From now on, normalise observations by these statistics, of what the learner sees."""
        self._mean, self._scale = normalizer.mean, input_scale(normalizer.std)

    def states(self) -> EpisodeStates:
        """Copy what the running episodes depend on."""
        episodes = self._begun_episodes()
        return EpisodeStates(
            episodes.q.copy(), episodes.goal.copy(), episodes.steps.copy(), episodes.total.copy()
        )

    def restore(self, states: EpisodeStates) -> NDArray[np.float32]:
        """Go on with episodes that `states` described; returns their observations."""
        episodes = self.simulator.reset(states.q, states.goal)
        episodes.steps[:], episodes.total[:] = states.steps, states.total
        self._episodes = episodes
        return self._normalized(episodes.observation)

    def close(self) -> None:
        """Nothing to release."""

    def get_attr(self, attr_name: str, indices: Any = None) -> list[Any]:
        """Value of an attribute, repeated for every arm."""
        return [getattr(self, attr_name) for _ in self._get_indices(indices)]

    def set_attr(self, attr_name: str, value: Any, indices: Any = None) -> None:
        """Refused: arms have no attributes of their own."""
        raise NotImplementedError(f"cannot set {attr_name!r}: the arms share one simulator")

    def env_method(
        self, method_name: str, *method_args: Any, indices: Any = None, **method_kwargs: Any
    ) -> list[Any]:
        """Refused: arms have no methods of their own."""
        raise NotImplementedError(f"cannot call {method_name!r}: the arms share one simulator")

    def env_is_wrapped(self, wrapper_class: type, indices: Any = None) -> list[bool]:  # noqa: ARG002
        """No arm is wrapped."""
        return [False for _ in self._get_indices(indices)]
