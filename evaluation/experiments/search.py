"""Search for the best settings of a learner, by Optuna."""

from collections.abc import Mapping
from functools import partial
from itertools import count
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import tomli_w

from kinarm._fields import to_plain
from kinarm._files import first_line, write_text
from kinarm.errors import needed
from kinarm.evaluation.experiments.curve import CurvePoint
from kinarm.evaluation.experiments.executors import LocalExecutor
from kinarm.evaluation.experiments.experiment import SEARCH_CHOICES, Experiment
from kinarm.evaluation.experiments.plan import Run, plan
from kinarm.evaluation.experiments.runs import Task, train
from kinarm.evaluation.experiments.store import Store
from kinarm.policies.config import TrainingConfig
from kinarm.policies.recipes import PER_TRAINING

if TYPE_CHECKING:
    import optuna

JOURNAL, RECIPE = "search.journal", "best.toml"
"""Files of a search in the folder of its study."""


def _open_search(experiment: Experiment, folder: Path, draws: int = 0) -> "optuna.study.Study":
    """Open or begin the search of an experiment in a folder.

    ``draws`` tells the random numbers of this process from those of others.
    """
    needed("optuna", "optuna", "tune")
    import optuna
    from optuna.storages import JournalStorage
    from optuna.storages.journal import JournalFileBackend

    optuna.logging.set_verbosity(optuna.logging.ERROR)
    said = experiment.search
    seed = int(np.random.SeedSequence([said.get("seed", 0), draws]).generate_state(1)[0])
    names = {kind: said.get(kind, next(iter(known))) for kind, known in SEARCH_CHOICES.items()}
    liar = {"constant_liar": True} if names["sampler"] == "tpe" else {}
    sampler, pruner = (
        getattr(module, SEARCH_CHOICES[kind][names[kind]])
        for kind, module in (("sampler", optuna.samplers), ("pruner", optuna.pruners))
    )
    return optuna.create_study(
        study_name="kinarm",
        storage=JournalStorage(JournalFileBackend(str(folder / JOURNAL))),
        sampler=sampler(seed=seed, **liar),
        pruner=pruner(),
        direction="maximize",
        load_if_exists=True,
    )


def carry_out_search(experiment: Experiment, folder: Path, jobs: int, threads: int) -> None:
    """Try as many settings as the experiment says, interrupted ones again.

    Parameters
    ----------
    experiment, folder : Experiment and Path
        The experiment and its folder, to which no other process may write.
    jobs, threads : int
        Settings tried at a time, and threads of a training.
    """
    # A process that was killed may have left its lock.
    for left in folder.glob(f"{JOURNAL}.lock*"):
        left.unlink(missing_ok=True)
    search = _open_search(experiment, folder)
    for trial in search.trials:
        if trial.state.name == "RUNNING":
            search.tell(trial.number, state=type(trial.state).FAIL)
            search.enqueue_trial(trial.params)
    done = [trial for trial in search.trials if trial.state.name in ("COMPLETE", "PRUNED")]
    missing = experiment.search["count"] - len(done)
    if missing > 0:
        jobs = min(jobs, missing)
        shares = [len(range(number, missing, jobs)) for number in range(jobs)]
        work = partial(_try_settings, experiment, folder, threads)
        tasks = [(share, len(search.trials) + number) for number, share in enumerate(shares)]
        list(LocalExecutor(jobs, threads).map(work, tasks))
    if any(trial.state.name == "COMPLETE" for trial in search.trials):
        best = plan(experiment, [_choices(experiment, search.best_trial)])[0]
        write_text(folder / RECIPE, tomli_w.dumps(recipe_entries(best.config)))


FAILURES = 20
"""Impossible proposals of a worker before they count."""


def _try_settings(
    experiment: Experiment, folder: Path, threads: int, task: tuple[int, int]
) -> None:
    """Try a share of the settings, one after the other."""
    import optuna
    from optuna.trial import TrialState

    share, draws = task
    search, store, failed = _open_search(experiment, folder, draws), Store(folder), 0
    while share > 0:
        trial = search.ask()
        try:
            search.tell(trial, _mean_success(experiment, store, trial, threads))
        except optuna.TrialPruned:
            search.tell(trial, state=TrialState.PRUNED)
        except Exception as error:  # settings can be impossible: another proposal takes their place
            trial.set_user_attr("error", first_line(error))
            search.tell(trial, state=TrialState.FAIL)
            failed += 1
            if failed < FAILURES:
                continue
        share -= 1


def _mean_success(experiment: Experiment, store: Store, trial: Any, threads: int) -> float:
    """Train with the settings of a trial on all problems with all seeds."""
    import optuna

    choices = {key: _suggest(trial, key, entry) for key, entry in experiment.searched.items()}
    shares, numbers = [], count()

    def on_point(point: CurvePoint) -> None:
        trial.report(point.success, next(numbers))
        if trial.should_prune():
            raise optuna.TrialPruned

    for number, run in enumerate(plan(experiment, [choices])):
        if not store.load([run]):
            store.save(run, train(Task(run), threads, on_point=on_point if number == 0 else None))
        shares.append(float(store.load([run])[run].outcomes.success.mean()))
    return float(np.mean(shares))


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
    trials = _open_search(experiment, folder).trials if (folder / JOURNAL).exists() else []
    complete = [trial for trial in trials if trial.state.name == "COMPLETE"]
    return plan(experiment, [_choices(experiment, trial) for trial in complete])


def _choices(experiment: Experiment, trial: Any) -> dict[str, Any]:
    """Values of fields that were tried."""
    return {
        key: trial.params[key] if isinstance(entry, Mapping) else entry[trial.params[key]]
        for key, entry in experiment.searched.items()
        if key in trial.params
    }


def recipe_entries(config: TrainingConfig) -> dict[str, Any]:
    """Settings of a recipe file, without those of a single training."""
    entries = to_plain(config)
    return {name: entries[name] for name in entries if name not in (*PER_TRAINING, "recipe")}
