"""Learning curves over training seeds, from files of kinarm and Stable-Baselines3."""

import csv
import json
from collections.abc import Callable, Iterable, Mapping, Sequence
from glob import glob
from operator import itemgetter
from pathlib import Path
from typing import TYPE_CHECKING, Literal, NamedTuple, get_args

import numpy as np
from numpy.typing import NDArray

from kinarm._files import reading
from kinarm.errors import InvalidInputError
from kinarm.evaluation.figures import COLOURS, DASHES, panels_figure
from kinarm.evaluation.statistics import squared_reach
from kinarm.policies.library import group_of

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

WINDOW = 100
"""Episodes in the moving average of monitor files, but a tenth of all at most."""

Measure = Literal["success", "return"]
Points = NDArray[np.float64]


class Band(NamedTuple):
    """Mean of the curves of some seeds, and its 95 % interval; shape (n_points,)."""

    seeds: int
    places: Points
    mean: Points
    low: Points
    high: Points

    @classmethod
    def of(cls, curves: Sequence[tuple[Points, Points]], *, shares: bool = True) -> "Band":
        """The mean and Student's interval over the seeds, at each point.

        The points are those of the curve with the fewest, from where all have begun to where the
        first one ends; others are interpolated linearly. A single seed has no interval.
        """
        seeds, coarsest = len(curves), min((x for x, _ in curves), key=len)
        first, last = max(x[0] for x, _ in curves), min(x[-1] for x, _ in curves)
        places = np.unique(coarsest.clip(first, max(first, last)))
        heights = np.array([np.interp(places, x, y) for x, y in curves])
        mean = heights.mean(axis=0)
        reach = np.sqrt(squared_reach(heights)) if seeds > 1 else 0.0
        ends = np.array([mean - reach, mean + reach])
        return cls(seeds, places, mean, *(ends.clip(0, 1) if shares else ends))

    def draw(self, axes: "Axes", label: str, number: int) -> None:
        """Draw it; its number decides colour and dash."""
        colour, dash = COLOURS[number % len(COLOURS)], DASHES[number // len(COLOURS) % len(DASHES)]
        axes.fill_between(self.places, self.low, self.high, color=colour, alpha=0.15, lw=0)
        axes.plot(self.places, self.mean, color=colour, linestyle=dash, lw=2, label=label)


class LearningCurves(NamedTuple):
    """Learning curves against environment steps, with intervals over seeds.

    Attributes
    ----------
    measure : {"success", "return"}
        What they show.
    bands : mapping of str to Band
        Groups of seeds by label.
    """

    measure: Measure
    bands: Mapping[str, Band]

    @classmethod
    def load(
        cls, sources: Iterable[str | Path], measure: Measure | None = None
    ) -> "LearningCurves":
        """Read what trainings of kinarm and Stable-Baselines3 leave.

        Parameters
        ----------
        sources : iterable of str or Path
            Groups of seeds: files ``NAME-seed0.curve.csv``, ``evaluations.npz``
            or ``monitor.csv``, a pattern such as ``"logs/*/evaluations.npz"``,
            or a folder with such files; perhaps with ``"LABEL="`` in front.
        measure : {"success", "return"}, optional
            What to show; by default success, if all files tell it.

        Raises
        ------
        InvalidInputError
            If a file is missing or damaged, or does not tell the measure.
        """
        groups: dict[str, list[dict[str, Points]]] = {}
        for source in map(str, sources):
            label, _, name = ("", "", source) if Path(source).exists() else source.rpartition("=")
            for own, files in _trainings(name):
                groups.setdefault(label or own, []).append(_read(files))
        each = [training for group in groups.values() for training in group]
        told = [name for name in get_args(Measure) if all(name in known for known in each)]
        if (shown := measure or told[0]) not in told:
            raise InvalidInputError(f"not every file tells {shown}: choose {', '.join(told)}")
        curves = {
            label: [(training["steps"], training[shown]) for training in group]
            for label, group in groups.items()
        }
        shares = shown == "success"
        for label, group in curves.items():
            if max(x[0] for x, _ in group) > min(x[-1] for x, _ in group):
                raise InvalidInputError(f"{label}: a training ends before another begins")
        return cls(shown, {k: Band.of(group, shares=shares) for k, group in curves.items()})

    def figure(self) -> "Figure":
        """Means of the groups as lines, their intervals as bands."""
        from matplotlib.ticker import EngFormatter

        figure, ((axes,),) = panels_figure((7.0, 4.2), 1, 1)
        for number, (label, band) in enumerate(self.bands.items()):
            band.draw(axes, f"{label}, {band.seeds} seed{'s' * (band.seeds > 1)}", number)
        axes.xaxis.set_major_formatter(EngFormatter(sep=""))
        axes.set(xlabel="environment steps", ylabel=f"mean {self.measure} of episodes")
        axes.legend(frameon=False, fontsize=8)
        return figure


def _trainings(name: str) -> list[tuple[str, list[Path]]]:
    """Label and files of each training behind a file, folder or pattern."""
    found = sorted(glob(name, recursive=True))  # noqa: PTH207 (it takes absolute patterns)
    paths = [name] if Path(name).exists() else found
    trainings: dict[Path, tuple[str, list[Path]]] = {}
    for path in map(Path, paths):
        kinds = (sorted(path.rglob(kind)) for kind in READERS)
        for file in next(filter(None, kinds), []) if path.is_dir() else [path]:
            recipe = file.parent / group_of(file.name.removesuffix(".curve.csv"))
            label = str(recipe) if file.match(OWN) else name.rstrip("/")
            whole = file.parent if file.match(MONITOR) else file
            trainings.setdefault(whole, (label, []))[1].append(file)
    if not trainings:
        raise InvalidInputError(f"there is no learning curve {name!r}: {', '.join(READERS)}")
    return list(trainings.values())


def _read(files: Sequence[Path]) -> dict[str, Points]:
    """Steps, returns and perhaps successes of a training, shape (n_points,)."""
    name, kinds = repr(str(files[0])), [kind for kind in READERS if files[0].match(kind)]
    if not kinds:
        raise InvalidInputError(f"{name} is no learning curve: {', '.join(READERS)}")
    with reading(name, "learning curve", InvalidInputError, of="file with a"):
        told = READERS[kinds[0]](files)
        if not (known := np.isfinite(told["return"])).any():
            raise ValueError("it holds no point")
        return {each: values[known] for each, values in told.items()}


def _read_own(files: Sequence[Path]) -> dict[str, Points]:
    rows = list(csv.DictReader(files[0].read_text(encoding="utf-8").splitlines()))
    names = {"steps": "environment_steps", "success": "success", "return": "mean_return"}
    return {each: np.array([float(row[name]) for row in rows]) for each, name in names.items()}


def _read_evaluations(files: Sequence[Path]) -> dict[str, Points]:
    """Means over the episodes of each evaluation."""
    with np.load(files[0], allow_pickle=False) as content:
        names = {"steps": "timesteps", "success": "successes", "return": "results"}
        told = {each: content[name] for each, name in names.items() if name in content}
    return {each: values.reshape(len(values), -1).mean(axis=1) for each, values in told.items()}


def _read_monitors(files: Sequence[Path]) -> dict[str, Points]:
    """Moving averages over the episodes of all environments, in the order of their ends."""
    episodes: list[tuple[float, dict[str, str]]] = []
    for file in files:
        header, *lines = file.read_text(encoding="utf-8").splitlines()
        start = float(json.loads(header.removeprefix("#"))["t_start"])
        episodes += [(start + float(row["t"]), row) for row in csv.DictReader(lines)]
    rows = [row for _, row in sorted(episodes, key=itemgetter(0))]
    told = {"return": [float(row["r"]) for row in rows]}
    if all("is_success" in row for row in rows):
        told["success"] = [float(row["is_success"] in ("True", "1", "1.0")) for row in rows]
    window = min(WINDOW, -(-len(rows) // 10))
    steps = np.cumsum([float(row["l"]) for row in rows])[window - 1 :]
    share = np.full(window, 1 / window)
    return {
        "steps": steps,
        **{name: np.convolve(each, share, "valid") for name, each in told.items()},
    }


OWN, MONITOR = "*.curve.csv", "*monitor.csv"
READERS: dict[str, Callable[[Sequence[Path]], dict[str, Points]]] = {
    "evaluations.npz": _read_evaluations,
    OWN: _read_own,
    MONITOR: _read_monitors,
}
"""Names of files, and what reads them; a folder gives those of the first kind that it has."""
