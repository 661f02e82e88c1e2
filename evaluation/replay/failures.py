"""The failures of several policies on several problems, to be played on one page."""

from collections import Counter
from collections.abc import Sequence
from itertools import product

from kinarm.errors import InvalidInputError
from kinarm.evaluation.replay import choosing
from kinarm.evaluation.replay.choosing import FAILING, Chosen, chosen_recordings
from kinarm.evaluation.replay.request import ReplayRequest
from kinarm.policies.library import group_of
from kinarm.recording import Recording


def find_failures(
    policies: Sequence[str],
    problems: Sequence[str] = ("left", "right", "both"),
    *,
    trials: int = FAILING,
    seed: int = 0,
) -> Chosen:
    """Record all failures of some policies, and what the oracle does in the same trials.

    They are grouped by recipe and cause, the most frequent cause first. ``kinarm-replay
    --failures`` shows those of one policy on one problem.

    Parameters
    ----------
    policies : sequence of str
        As `ReplayRequest` takes them, ``"best"`` included.
    problems : sequence of str
        Problems of one arm and scene.
    trials, seed : int
        Size and seed of the set of trials of each problem.

    Returns
    -------
    Chosen
        For `kinarm.viewer.replay_page`: ``runs``, the recordings of the policies and of the
        oracle; ``groups`` and ``heading``.

    Raises
    ------
    KinarmError
        If a name or number cannot be used, none fails somewhere, or too many do.
    """
    played: list[Recording] = []
    ghosts: list[Recording] = []
    causes: list[str] = []
    for policy, problem in product(policies, problems):
        request = ReplayRequest(
            policy=policy, problem=problem, failures=True, trials=trials, seed=seed
        )
        found = chosen_recordings(request)
        played += found.runs[0]
        ghosts += found.runs[1]
        causes += found.groups
    if len(played) > choosing.MOST_FAILURES:
        raise InvalidInputError(
            f"{len(played)} trials failed, a page holds {choosing.MOST_FAILURES} at most: ask for "
            "fewer trials"
        )
    faced = trials * len(policies) * len(problems)
    recipes = [group_of(each.policy) for each in played]
    groups = [f"{recipe}: {cause}" for recipe, cause in zip(recipes, causes, strict=True)]
    rank, frequency = list(dict.fromkeys(recipes)), Counter(groups)
    order = sorted(
        range(len(played)),
        key=lambda k: (rank.index(recipes[k]), -frequency[groups[k]], groups[k]),
    )
    return Chosen(
        [[run[k] for k in order] for run in (played, ghosts)],
        [groups[k] for k in order],
        f"{len(played)} of {faced} trials of {', '.join(problems)} failed",
    )
