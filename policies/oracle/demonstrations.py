"""Demonstrations: motions of the oracle that reach their goals, to learn from."""

import shutil
import warnings
from collections.abc import Iterator
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from kinarm._files import load_archive, reading, save_archive
from kinarm.errors import (
    InvalidInputError,
    MissingExtraError,
    OutputError,
    RecordingFileError,
    finite_array,
    whole_number,
)
from kinarm.kernels.compiling import Array
from kinarm.problem import ReachProblem
from kinarm.simulator import Simulator

KIND, FORMAT_VERSION = "demonstrations", 1


@dataclass(frozen=True, kw_only=True, eq=False)
class Demonstrations:
    """Motions that reach their goals, one after the other; n motions, n_steps in all.

    Rows are steps, as an environment of the problem returns them. Arrays are
    read-only.

    Parameters
    ----------
    problem : ReachProblem
        The problem.
    trials : int
        Trials that the oracle was given; it reached the goals of n.
    observations : ndarray, shape (n_steps, n_observations)
        What was seen before each action.
    actions : ndarray, shape (n_steps, n_actions)
        Fractions of the velocity limits, in [-1, 1].
    rewards : ndarray, shape (n_steps,)
        The problem's rewards.
    terminations, truncations : ndarray of bool, shape (n_steps,)
        Where a motion ends, at its goal; and false.
    final_observations : ndarray, shape (n, n_observations)
        What was seen at the goals.
    starts, goals : ndarray, shape (n, n_joints) and (n, goal_width)
        Start configurations [rad or m] and (first) goals [m].

    Raises
    ------
    InvalidInputError
        If shapes do not match, or an entry is not finite.
    """

    problem: ReachProblem
    trials: int
    observations: Array
    actions: Array
    rewards: Array
    terminations: NDArray[np.bool_]
    truncations: NDArray[np.bool_]
    final_observations: Array
    starts: Array
    goals: Array

    def __post_init__(self) -> None:
        whole_number("trials", self.trials, 0)
        n_steps, n = len(self.rewards), len(self.goals)
        for name in ARRAYS:
            array = np.array(getattr(self, name))
            rows = n if name in OF_MOTIONS else n_steps
            finite_array(name, array, (rows, *(None for _ in array.shape[1:])))
            array.flags.writeable = False
            object.__setattr__(self, name, array)
        if np.count_nonzero(self.terminations) != n or not self.terminations[-1:].all():
            raise InvalidInputError(f"terminations must be true at the ends of {n} motions")

    def __len__(self) -> int:
        return len(self.goals)

    def __repr__(self) -> str:
        return (
            f"Demonstrations({len(self)} motions of {len(self.rewards)} steps in all, for "
            f"{self.trials} trials of {self.problem.name})"
        )

    @property
    def steps(self) -> NDArray[np.int64]:
        """Steps of each motion, shape (n,)."""
        return np.diff(np.flatnonzero(self.terminations), prepend=-1)

    @classmethod
    def replayed(
        cls, simulator: Simulator, starts: Array, goals: Array, actions: Array, trials: int
    ) -> "Demonstrations":
        """Take down motions that reach their goals, in the simulator.

        Parameters
        ----------
        simulator : Simulator
            The simulator.
        starts, goals : ndarray, shape (n, n_joints) and (n, goal_width)
            Of the motions [rad or m, m].
        actions : ndarray, shape (n, horizon, n_actions)
            Their actions.
        trials : int
            Trials in which such motions were sought.
        """
        steps = simulator.rollout_actions(actions, starts, goals).steps
        first, n_steps = np.cumsum(steps) - steps, steps.sum()
        observations, rewards = np.empty((n_steps, simulator.n_observations)), np.empty(n_steps)
        episodes = simulator.reset(starts, goals)
        for step in range(steps.max(initial=0)):
            rows = np.flatnonzero(steps > step)
            observations[first[rows] + step] = episodes.observation[rows]
            result = simulator.step(episodes, actions[:, step])
            rewards[first[rows] + step] = result.reward[rows]
        return cls(
            problem=simulator.problem,
            trials=trials,
            observations=observations,
            actions=actions[np.arange(actions.shape[1]) < steps[:, None]],
            rewards=rewards,
            terminations=np.isin(np.arange(n_steps), first + steps - 1),
            truncations=np.zeros(n_steps, dtype=bool),
            final_observations=episodes.observation,
            starts=starts,
            goals=goals,
        )

    def save(self, path: str | Path) -> None:
        """Write a ``.npz`` file; ``numpy.load`` finds the arrays by their names.

        Raises
        ------
        OutputError
            If it cannot be written; an existing file then stays as it was.
        """
        header = {"problem": self.problem.pinned.to_json(), "trials": self.trials}
        arrays = {name: getattr(self, name) for name in ARRAYS}
        save_archive(path, KIND, FORMAT_VERSION, arrays, header, compress=True)

    @classmethod
    def load(cls, path: str | Path) -> "Demonstrations":
        """Read what `save` wrote.

        Raises
        ------
        RecordingFileError
            If the file is missing, damaged, something else, or of another
            version.
        """
        archive = load_archive(path, KIND, FORMAT_VERSION, RecordingFileError)
        with reading(repr(str(path)), KIND, RecordingFileError):
            problem = ReachProblem.from_json(archive.header["problem"])
            return cls(problem=problem, trials=archive.header["trials"], **archive.arrays)

    def to_minari(self, dataset_id: str, **about: Any) -> Any:
        """Write a data set of Minari (extra ``minari``).

        Its ``recover_environment()`` makes the environment, of any problem. The
        metadata of an episode hold the ``options`` of its reset.

        Parameters
        ----------
        dataset_id : str
            Such as ``"kinarm/right-oracle-v0"``.
        **about
            What ``minari.create_dataset_from_buffers`` takes: ``author``,
            ``description``.

        Returns
        -------
        minari.MinariDataset

        Raises
        ------
        InvalidInputError
            If the name is not of that form.
        OutputError
            If there is such a data set, or it cannot be written.
        """
        try:
            import minari
            from minari.dataset.minari_dataset import parse_dataset_id
            from minari.storage import get_dataset_path
        except ImportError as error:
            raise MissingExtraError("minari", "minari") from error
        from gymnasium import make

        try:
            parse_dataset_id(dataset_id)
        except (TypeError, ValueError) as error:
            raise InvalidInputError(
                f"dataset_id must be like 'kinarm/right-oracle-v0', got {dataset_id!r}"
            ) from error
        folder = get_dataset_path(dataset_id)
        if folder.exists():
            raise OutputError(
                f"data set {dataset_id!r} exists: minari.delete_dataset({dataset_id!r}) removes it"
            )
        env = make("kinarm.envs:kinarm/Reach-v0", problem=self.problem)
        said = {"algorithm_name": "oracle", "description": repr(self), "requirements": ["kinarm"]}
        given = {"env": env, **said, **about}
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore", UserWarning)  # about what is not said of it
                return minari.create_dataset_from_buffers(dataset_id, [*self._buffers()], **given)
        except OSError as error:
            shutil.rmtree(folder, ignore_errors=True)
            raise OutputError(f"cannot write {str(folder)!r}: {error.strerror}") from error

    def _buffers(self) -> Iterator[Any]:
        """The motions as Minari takes them."""
        from minari.data_collector import EpisodeBuffer

        ends = np.flatnonzero(self.terminations) + 1
        for number, (end, steps) in enumerate(zip(ends, self.steps, strict=True)):
            part = slice(end - steps, end)
            final = self.final_observations[number, None]
            yield EpisodeBuffer(
                options={"start": self.starts[number], "goal": self.goals[number]},
                observations=np.concatenate([self.observations[part], final]),
                actions=self.actions[part],
                rewards=self.rewards[part],
                terminations=self.terminations[part],
                truncations=self.truncations[part],
            )


ARRAYS = [item.name for item in fields(Demonstrations)][2:]
OF_MOTIONS = ARRAYS[5:]
"""Names of all arrays, and of those with a row for each motion."""
