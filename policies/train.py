"""``kinarm-train``: train a policy."""

import argparse
import sys
import time
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from kinarm.command_line import Parser, finite_number, run_command, whole_number
from kinarm.errors import InvalidInputError, KinarmError, PolicyFileError
from kinarm.files import check_folder

if TYPE_CHECKING:
    from kinarm.policies.curve import CurvePoint

PROG = "kinarm-train"
CHECKPOINT_SECONDS = 5.0

ARS_EPILOG = """
examples:
  kinarm-train ars --task right --out right.npz                      the paper's Table 1
  kinarm-train ars --task both --recipe tuned --seed 3 --out b.npz   our best linear policy
  kinarm-train ars --out b.npz --resume                              go on where it stopped
"""

PPO_EPILOG = """
needs the extra ppo: pip install 'kinarm[ppo]'

examples:
  kinarm-train ppo --task right --out right.npz                      the paper's reward
  kinarm-train ppo --task both --recipe tuned --seed 3 --out b.npz   our best policy
  kinarm-train ppo --out b.npz --resume                              go on where it stopped
"""


def build_parser() -> Parser:
    """The options of the command."""
    parser = Parser(prog=PROG, description="Train a policy.")
    learners = parser.add_subparsers(dest="learner", required=True, metavar="LEARNER")
    _add_ars(learners)
    _add_ppo(learners)
    return parser


def _add_ars(learners: "argparse._SubParsersAction[Parser]") -> None:
    """Options of ``kinarm-train ars``."""
    ars = learners.add_parser(
        "ars",
        help="Augmented Random Search",
        description="Train a linear policy with Augmented Random Search.",
        epilog=ARS_EPILOG,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    settings = _add_common(ars)
    for name in ("iterations", "directions", "top-directions", "episodes"):
        settings.add_argument(f"--{name}", type=whole_number(1), metavar="N")
    for name in ("step-size", "noise", "success-bonus", "collision-penalty", "start-spread"):
        settings.add_argument(f"--{name}", type=finite_number, metavar="X")
    settings.add_argument("--sharing", choices=("none", "pair", "iteration"))
    settings.add_argument("--step-size-schedule", choices=("constant", "linear"))


def _add_ppo(learners: "argparse._SubParsersAction[Parser]") -> None:
    """Options of ``kinarm-train ppo``."""
    ppo = learners.add_parser(
        "ppo",
        help="Proximal Policy Optimization",
        description="Train a neural policy with Proximal Policy Optimization.",
        epilog=PPO_EPILOG,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    ppo.add_argument("--tensorboard", type=Path, metavar="FOLDER", help="write logs there")
    settings = _add_common(ppo)
    for name in ("iterations", "arms", "rollout-steps", "minibatch", "epochs"):
        settings.add_argument(f"--{name}", type=whole_number(1), metavar="N")
    settings.add_argument("--hidden", type=whole_number(1), nargs="+", metavar="WIDTH")
    for name in ("learning-rate", "gamma", "entropy-weight", "tolerance"):
        settings.add_argument(f"--{name}", type=finite_number, metavar="X")
    for name in ("success-bonus", "collision-penalty", "step-reward", "start-spread"):
        settings.add_argument(f"--{name}", type=finite_number, metavar="X")
    settings.add_argument("--learning-rate-schedule", choices=("constant", "linear"))


def _add_common(parser: Parser) -> "argparse._ArgumentGroup":
    """Options of every learner; returns the group for those that replace settings."""
    add = parser.add_argument
    add("--task", metavar="NAME", help="left, right (default) or both")
    add("--recipe", metavar="NAME", help="named settings (paper)")
    add("--seed", type=whole_number(0), metavar="N", help="seed of all randomness (0)")
    add("--arm", metavar="NAME_OR_URDF", help="arm to train (paper)")
    add("--out", type=Path, required=True, metavar="FILE.npz", help="the policy")
    add("--resume", action="store_true", help="go on from the checkpoint beside --out")
    settings = parser.add_argument_group("settings that replace those of the recipe")
    settings.add_argument(
        "--symmetric",
        action=argparse.BooleanOptionalAction,
        help="treat mirror images alike where the task is its own mirror image",
    )
    return settings


def main(arguments: Sequence[str] | None = None) -> None:
    """Run the command line."""
    run_command(PROG, lambda: _train(build_parser().parse_args(arguments)))


def _train(options: argparse.Namespace) -> None:
    """From options to a policy file and its learning curve."""
    from kinarm.policies.curve import write_curve
    from kinarm.policies.learners import find_learner, train_policy

    out: Path = options.out
    if out.suffix != ".npz" or out.is_dir():
        raise InvalidInputError(f"--out must be a file that ends in .npz, got {str(out)!r}")
    check_folder(out.parent)
    find_learner(options.learner).check_installed()
    config, state = _beginning(options)
    logs = {}
    if getattr(options, "tensorboard", None) is not None:
        check_folder(options.tensorboard, create=True)
        logs["tensorboard"] = options.tensorboard
    keeper = CheckpointKeeper(config, checkpoint_path(out))
    with TrainingProgress(options.learner, config) as progress:

        def on_iteration(state: Any) -> None:
            progress.update(state)
            keeper.update(state)

        try:
            result = train_policy(config, state=state, on_iteration=on_iteration, **logs)
        except KeyboardInterrupt:
            raise KeyboardInterrupt(keeper.save_on_interrupt()) from None
    try:
        result.policy.save(out)
        write_curve(curve_path(out), result.curve)
    except (KinarmError, KeyboardInterrupt):
        keeper.save()
        raise
    checkpoint_path(out).unlink(missing_ok=True)
    sys.stdout.write(f"{_summary(result.curve)}; written: {out}, {curve_path(out)}\n")


def _beginning(options: argparse.Namespace) -> tuple[Any, Any]:
    """Settings and state to begin with: from the command line, or from a checkpoint."""
    from kinarm.policies.checkpoint import load_checkpoint
    from kinarm.policies.learners import learner_of, recipe
    from kinarm.policies.mirror import task_mirror

    if options.arm is not None and Path(options.arm).is_file():
        options.arm = str(Path(options.arm).resolve())
    settings = given_settings(options)
    checkpoint = checkpoint_path(options.out)
    if not options.resume:
        if checkpoint.exists():
            raise InvalidInputError(
                f"{str(checkpoint)!r} holds an unfinished training: go on with --resume, "
                "or delete it"
            )
        config = recipe(options.learner, settings.pop("recipe", "paper"), **settings)
        # Refuses what cannot be trained before any output is made.
        task_mirror(config.symmetric, config.simulator())
        return config, None
    if not checkpoint.exists():
        raise PolicyFileError(f"nothing to resume: there is no {str(checkpoint)!r}")
    config, state = load_checkpoint(checkpoint)
    if (other := learner_of(config).name) != options.learner:
        raise InvalidInputError(f"{str(checkpoint)!r} is of the learner {other}")
    if settings.get("recipe") == config.recipe.removesuffix("*"):
        del settings["recipe"]
    if replace(config, **settings) != config:
        changed = [name for name, value in settings.items() if getattr(config, name) != value]
        raise InvalidInputError(
            f"the checkpoint was made with another {', '.join(changed)}: "
            "leave it out, or train anew without --resume"
        )
    return config, state


def given_settings(options: argparse.Namespace) -> dict[str, Any]:
    """Settings of the learner that the command line sets."""
    ours = ("learner", "out", "resume", "tensorboard")
    given = {name: value for name, value in vars(options).items() if value is not None}
    if "hidden" in given:
        given["hidden"] = tuple(given["hidden"])
    return {name: value for name, value in given.items() if name not in ours}


def checkpoint_path(out: Path) -> Path:
    """Where the checkpoint of a training lies until it is finished."""
    return out.with_suffix(".checkpoint.npz")


def curve_path(out: Path) -> Path:
    """Where the learning curve of a policy lies."""
    return out.with_suffix(".curve.csv")


class CheckpointKeeper:
    """Saves the latest state every few seconds and on demand."""

    def __init__(self, config: Any, path: Path) -> None:
        self._config, self._path = config, path
        self._saved_at = time.monotonic()
        self._state: Any = None

    def update(self, state: Any) -> None:
        """Take note of a state, and save it if the last checkpoint is old."""
        self._state = state
        if time.monotonic() - self._saved_at > CHECKPOINT_SECONDS:
            self.save()

    def save_on_interrupt(self) -> str:
        """Save the latest state, and say how to go on."""
        if self._state is None:
            return "interrupted before the first iteration"
        self.save()
        done, all_of_them = self._state.iteration, self._config.iterations
        return f"interrupted after {done} of {all_of_them} iterations; go on with --resume"

    def save(self) -> None:
        """Save the latest state."""
        from kinarm.policies.checkpoint import save_checkpoint

        if self._state is not None:
            save_checkpoint(self._path, self._config, self._state)
            self._saved_at = time.monotonic()


class TrainingProgress:
    """A progress bar on standard error: return, success, steps per second, remaining time."""

    def __init__(self, learner: str, config: Any) -> None:
        from rich.console import Console
        from rich.progress import BarColumn, Progress, TextColumn, TimeRemainingColumn

        self._progress = Progress(
            TextColumn(f"{learner} {config.recipe} {config.task} seed {config.seed}"),
            BarColumn(),
            TextColumn("{task.completed:.0f}/{task.total:.0f}"),
            TextColumn("{task.fields[status]}"),
            TimeRemainingColumn(),
            console=Console(stderr=True),
        )
        self._task = self._progress.add_task(
            "", total=config.iterations, status="starting; the first run compiles"
        )

    def __enter__(self) -> "TrainingProgress":
        self._progress.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._progress.stop()

    def update(self, state: Any) -> None:
        """Show the latest iteration."""
        point: CurvePoint = state.curve[-1]
        speed = point.environment_steps / max(point.wall_time, 1e-9) / 1e6
        self._progress.update(
            self._task,
            completed=state.iteration,
            status=f"return {point.mean_return:+.3f} success {point.success:.0%} "
            f"{speed:.2f} M steps/s",
        )


def _summary(curve: "Sequence[CurvePoint]") -> str:
    last = curve[-1]
    return (
        f"{len(curve)} iterations, {last.environment_steps / 1e6:.2f} million steps in "
        f"{last.wall_time:.1f} s; last iteration: mean return {last.mean_return:+.3f}, "
        f"success {last.success:.0%}"
    )


if __name__ == "__main__":
    main()
