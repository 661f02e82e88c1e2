"""Search for the best settings of a learner, by Optuna."""

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import tomli_w

from kinarm._fields import to_plain
from kinarm._files import first_line, write_text
from kinarm.errors import KinarmError, TrainingFailedError, needed
from kinarm.evaluation.experiments.experiment import SAMPLERS, Experiment
from kinarm.evaluation.experiments.plan import Run, hash_of, plan
from kinarm.evaluation.experiments.store import Store
from kinarm.policies.recipes import PER_TRAINING

if TYPE_CHECKING:
    import optuna

JOURNAL, RECIPE = "search.journal", "best.toml"
"""Files of a search in the folder of its study."""


TrainAll = Callable[[Sequence[Run]], object]
"""Trains some runs; the store says why others failed."""

FAILURES = 20
"""Impossible proposals after which a search ends."""


def _open_search(experiment: Experiment, folder: Path) -> "optuna.study.Study":
    """Open or begin the search of an experiment, as it is, in a folder."""
    needed("optuna", "optuna", "tune")
    import optuna
    from optuna.storages import JournalStorage
    from optuna.storages.journal import JournalFileBackend

    if experiment.sampler == "cmaes":
        needed("cmaes", "cmaes", "tune")
    optuna.logging.set_verbosity(optuna.logging.ERROR)
    # What was found with other settings or values says nothing here.
    tried = {**experiment.to_json(), "search": experiment.searched}
    search = optuna.create_study(
        study_name=hash_of(tried),
        storage=JournalStorage(JournalFileBackend(str(folder / JOURNAL))),
        direction="maximize",
        load_if_exists=True,
    )
    said = experiment.search
    liar = {"constant_liar": True} if experiment.sampler == "tpe" else {}
    # One that goes on has other random numbers than when it began.
    sequence = np.random.SeedSequence([said.get("seed", 0), len(search.trials)])
    seed = int(sequence.generate_state(1)[0])
    search.sampler = getattr(optuna.samplers, SAMPLERS[experiment.sampler])(seed=seed, **liar)
    return search


def carry_out_search(experiment: Experiment, store: Store, jobs: int, train_all: TrainAll) -> None:
    """Try as many settings as the experiment says, interrupted ones again.

    Parameters
    ----------
    experiment, store : Experiment and Store
        The experiment and its folder, to which no other process may write.
    jobs : int
        Settings tried at a time.
    train_all : callable
        Trains some runs; the store says why others failed.

    Raises
    ------
    TrainingFailedError
        If too many settings were impossible.
    """
    # A process that was killed may have left its lock.
    for left in store.folder.glob(f"{JOURNAL}.lock*"):
        left.unlink(missing_ok=True)
    search, failed = _open_search(experiment, store.folder), dict[str, str]()
    for trial in search.trials:
        if trial.state.name == "RUNNING":
            search.tell(trial.number, state=type(trial.state).FAIL)
            search.enqueue_trial(trial.params)
    count = experiment.search["count"]
    while len(failed) < FAILURES and (missing := count - len(_complete(search))) > 0:
        failed |= _try_settings(experiment, search, store, min(jobs, missing), train_all)
    if _complete(search):
        best = plan(experiment, [_choices(experiment, search.best_trial)])[0]
        left_out = (*PER_TRAINING, "recipe")
        entries = {k: v for k, v in to_plain(best.config).items() if k not in left_out}
        write_text(store.folder / RECIPE, tomli_w.dumps(entries))
    if missing:
        raise TrainingFailedError(failed, len(search.trials))


def _try_settings(
    experiment: Experiment,
    search: "optuna.study.Study",
    store: Store,
    count: int,
    train_all: TrainAll,
) -> dict[str, str]:
    """Train with some proposals on all problems with all seeds; return why others failed."""
    from optuna.trial import TrialState

    planned, errors = [], dict[Any, str]()
    for trial in (search.ask() for _ in range(count)):
        choices = {key: _suggest(trial, key, entry) for key, entry in experiment.searched.items()}
        try:
            planned.append((trial, plan(experiment, [choices])))
        except KinarmError as error:  # settings can be impossible: others take their place
            errors[trial] = first_line(error)
    runs = [run for _, each in planned for run in each]
    found = store.load(runs)
    train_all([run for run in runs if run not in found])
    found = store.load(runs)
    for trial, each in planned:
        if lost := [run for run in each if run not in found]:
            errors[trial] = store.failure(lost[0]) or "unknown"
        else:
            shares = [float(found[run].outcomes.success.mean()) for run in each]
            search.tell(trial, float(np.mean(shares)))
    for trial, why in errors.items():
        trial.set_user_attr("error", why)
        search.tell(trial, state=TrialState.FAIL)
    return {f"settings {trial.number}": why for trial, why in errors.items()}


def _complete(search: "optuna.study.Study") -> "list[optuna.trial.FrozenTrial]":
    """The proposals that were tried to the end, in order."""
    return [trial for trial in search.trials if trial.state.name == "COMPLETE"]


def _suggest(trial: Any, key: str, entry: Any) -> Any:
    """A value from a list or a range, as Optuna proposes it."""
    if isinstance(entry, Mapping):
        low, high, log = entry["low"], entry["high"], bool(entry.get("log", False))
        if isinstance(low, int) and isinstance(high, int):
            return trial.suggest_int(key, low, high, log=log)
        return trial.suggest_float(key, float(low), float(high), log=log)
    # Optuna keeps plain values alone: lists are known by their place.
    return entry[trial.suggest_categorical(key, list(range(len(entry))))]


def searched_runs(experiment: Experiment, folder: Path) -> tuple[Run, ...]:
    """The trainings of settings that were tried to the end, in order."""
    begun = (folder / JOURNAL).exists()
    complete = _complete(_open_search(experiment, folder)) if begun else []
    return plan(experiment, [_choices(experiment, trial) for trial in complete])


def _choices(experiment: Experiment, trial: Any) -> dict[str, Any]:
    """Values of fields that were tried."""
    return {
        key: trial.params[key] if isinstance(entry, Mapping) else entry[trial.params[key]]
        for key, entry in experiment.searched.items()
    }
