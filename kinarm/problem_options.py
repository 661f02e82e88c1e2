"""Which problem: the options that all commands and their requests share."""

from dataclasses import dataclass
from typing import TYPE_CHECKING

from kinarm._fields import init_fields

if TYPE_CHECKING:
    from kinarm.problem import ProblemLike, ReachProblem


@dataclass(frozen=True, kw_only=True)
class ProblemOptions:
    """Which problem: the options that all commands share.

    Parameters
    ----------
    problem : str
        Left, right, both, or a problem file.
    arm : str
        Another arm: its name, or a URDF.
    task : str
        The task of another problem, by its name or file.
    scene : str
        The scene of another problem, by its name or file.
    tolerance : float
        Distance at which a goal counts as reached [m].
    horizon : int
        Steps after which an episode is truncated.
    start_spread : float
        Scales the range of the start configurations, from 0 (home) to 1 (all).
    """

    problem: str | None = None
    arm: str | None = None
    task: str | None = None
    scene: str | None = None
    tolerance: float | None = None
    horizon: int | None = None
    start_spread: float | None = None

    def resolve(self, default: "ProblemLike" = "right") -> "ReachProblem":
        """The problem that the options make of a default one.

        Raises
        ------
        KinarmError
            If a name or file cannot be used, or a number is out of range.
        """
        from kinarm.problem import ReachProblem  # loads Pinocchio: --help does without

        changed = {name: getattr(self, name) for name in init_fields(ProblemOptions)}
        named = changed.pop("problem")
        if named is None and self.task is not None:
            named = changed.pop("task")
        return ReachProblem.load(named or default).replace(**changed)
