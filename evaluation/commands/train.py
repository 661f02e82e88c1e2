"""``kinarm-train``: train a policy."""

import argparse
import re
import shlex
import sys
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar

from kinarm._command_line import add_options, given_options, run_command
from kinarm._files import shipped_files
from kinarm._parser import Parser
from kinarm.errors import FROM_ZERO, InvalidInputError
from kinarm.policies.config import TrainingConfig
from kinarm.policies.learners import Learner, find_learner, learner_names
from kinarm.policies.recipes import recipe
from kinarm.problem_options import ProblemOptions

if TYPE_CHECKING:
    from kinarm.evaluation.experiments.training import Trained

PROG = "kinarm-train"

CIRCUMSTANCES = ("problem", "seed", "recipe", "algorithm")
"""Settings with a field of `TrainRequest`, or determined by the learner."""

MOST_SEEDS = 1000

TRAININGS = ".training"
"""Folder of the trainings, beside the policies; the ending of a single one's."""


def seeds_of(text: str) -> tuple[int, ...]:
    """Seeds of a text: ``"5"`` is 0 to 4, ``"5-9"`` is 5 to 9."""
    found = re.fullmatch(r"(?:([0-9]{1,9})-)?([0-9]{1,9})", text)
    if found is not None:
        first, last = int(found[1] or 0), int(found[2]) - (found[1] is None)
        if first <= last < first + MOST_SEEDS:
            return tuple(range(first, last + 1))
    raise InvalidInputError(
        f"must be a number (5) or a rising range (5-9), 1 to {MOST_SEEDS} seeds, got {text!r}"
    )


@dataclass(frozen=True, kw_only=True)
class TrainRequest(ProblemOptions):
    """A training, or one with each of several seeds, from settings to the files that it leaves.

    Parameters
    ----------
    learner : str
        Name of the learner.
    recipe : str, optional
        Name of settings, or a TOML file with some.
    seed : int, optional
        Seed of all randomness.
    seeds : tuple of int
        Train several seeds in parallel: a number (5 is 0 to 4) or a range
        (5-9). One policy for each goes into the folder --out.
    jobs : int, optional
        Seeds at a time.
    settings : mapping
        Settings of the learner that replace those of the recipe.
    out : Path
        File of the policy, with learning curve beside it; with --seeds, folder
        of the policies.
    overwrite : bool
        Replace an earlier policy.
    """

    learner: str
    recipe: str | None = field(default=None, metadata={"metavar": "NAME_OR_FILE"})
    seed: int | None = field(default=None, metadata=FROM_ZERO)
    seeds: tuple[int, ...] = field(
        default=(), metadata={"parse": seeds_of, "metavar": "N", **FROM_ZERO}
    )
    jobs: int | None = None
    settings: dict[str, Any] = field(default_factory=dict)
    out: Path | str = field(metadata={"metavar": "FILE.npz"})
    overwrite: bool = False

    GROUPS: ClassVar = {
        "training": "recipe seed seeds jobs",
        "output": "out overwrite",
        **ProblemOptions.GROUPS,
    }
    DEFAULTS: ClassVar = {
        **ProblemOptions.DEFAULTS,
        "recipe": "the first one",
        "seed": "0",
        "seeds": "one training",
        "jobs": "one a processor",
        "problem": "the recipe's: right",
    }

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.jobs is not None and not self.seeds:
            raise InvalidInputError("--jobs goes with --seeds")
        if self.seed is not None and self.seeds:
            raise InvalidInputError("--seed and --seeds exclude each other")
        if self.seeds and Path(self.out).suffix == ".npz":
            folder = Path(self.out).with_suffix("")
            raise InvalidInputError(f"with --seeds, --out is a folder: --out {folder}")

    def run(self) -> "tuple[Trained, ...]":
        """Train, and write a policy and a learning curve for each seed.

        The state of a single training is kept every few seconds in a folder beside the policy,
        such as ``right.training``, until it is finished: after an interruption, the same request
        goes on from there. Files of several seeds, of which each policy equals that of a training
        with this seed alone, bit for bit, are named as ``ars-tuned-both-seed0.npz``. The same
        request again leaves finished seeds as they are, and the others go on or begin: the folder
        ``.training`` says how far all are.

        Raises
        ------
        TrainingFailedError
            If trainings failed; all others are finished.
        KinarmError
            If settings cannot be used, a file cannot be written, or workers end
            unexpectedly.
        KeyboardInterrupt
            If it is interrupted; the message says how to go on.
        """
        from kinarm.evaluation.experiments.training import shared_name, train_all

        config, out = self.config(), Path(self.out)
        outs, folder = {config.seed: out}, out.with_suffix(TRAININGS)
        if self.seeds:
            name = shared_name(config)
            outs = {seed: out / f"{name}-seed{seed}.npz" for seed in self.seeds}
            folder = out / TRAININGS / name
        keep, jobs = bool(self.seeds), self.jobs
        return train_all(config, outs, folder, jobs=jobs, overwrite=self.overwrite, keep=keep)

    def config(self) -> TrainingConfig:
        """Settings of the training: the recipe's, with replacements."""
        problem = self.resolve(default=recipe(self.learner, self.recipe).problem)
        config: TrainingConfig = recipe(
            self.learner, self.recipe, problem=problem, seed=self.seed, **self.settings
        )
        return config


def build_parser(named: str | None = None) -> Parser:
    """The options of the command, of all learners or of one."""
    parser = Parser(prog=PROG, description="Train a policy.")
    learners = parser.add_commands("learner")
    for name in learner_names() if named is None else (named,):
        _add_learner(learners, name, find_learner(name))
    return parser


def _add_learner(
    parsers: "argparse._SubParsersAction[Parser]", name: str, learner: Learner[Any, Any]
) -> None:
    """Add the options of every training, and those of a learner's settings."""
    needs = f"\nneeds the extra {learner.extra}: pip install 'kinarm[{learner.extra}]'\n"
    parser = parsers.add_parser(
        name,
        help=learner.title,
        description=f"Train a policy with {learner.title}.",
        epilog=(needs if learner.extra else "") + _epilog(name, learner),
    )
    recipes = {"recipe": tuple(learner.recipes)}
    add_options(parser, TrainRequest, skip=("learner", "settings"), names=recipes)
    title = f"settings of the learner (defaults of the recipe {learner.first_recipe})"
    add_options(parser.add_argument_group(title), learner.config, skip=CIRCUMSTANCES, explicit=True)


def _epilog(name: str, learner: Learner[Any, Any]) -> str:
    """Recipes of a learner, and examples."""
    recipe = [*learner.recipes][:2][-1]  # the first has defaults
    lines = (f"  {each:<8} {summary}\n" for each, summary in learner.summaries.items())
    text = shipped_files("help", ".txt")["learner"].read_text()
    return text.format(
        name=name,
        recipes="recipes:\n" + "".join(lines) if learner.summaries else "",
        recipe=recipe,
        half=learner.recipes[recipe].iterations // 2,
    )


def main(arguments: Sequence[str] | None = None) -> None:
    """Run the command line."""
    given = sys.argv[1:] if arguments is None else list(arguments)
    named = given[0] if given and not given[0].startswith("-") else None
    run_command(PROG, lambda: _train(build_parser(named).parse_args(given)))


def _train(options: argparse.Namespace) -> None:
    """Train as the options say, and print how good the policies are."""
    given = given_options(options, find_learner(options.learner).config)
    settings = {name: value for name, value in given.items() if name not in CIRCUMSTANCES}
    request = TrainRequest(**given_options(options, TrainRequest), settings=settings)
    for seed, out, curve in request.run():
        said = "finished earlier"
        if curve:
            last = curve[-1]
            said = (
                f"{last.environment_steps / 1e6:.2f} million steps in {last.wall_time:.1f} s, "
                f"return {last.mean_return:+.3f}, success {100 * last.success:.0f} %"
            )
        sys.stdout.write(f"seed {seed}: {said}; written: {out}\n")
    name = shlex.quote(f"{request.out}/" if request.seeds else str(request.out))
    sys.stdout.write(f"next: kinarm-eval {name}, kinarm-replay {name}\n")
