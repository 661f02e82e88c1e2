"""``kinarm-replay``: watch trials in a browser, from one file or live."""

import argparse
import webbrowser
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from kinarm.command_line import Parser, run_command, whole_number
from kinarm.errors import InvalidInputError
from kinarm.files import check_folder

if TYPE_CHECKING:
    from kinarm.recording import Recording

PROG = "kinarm-replay"

EPILOG = """
examples:
  kinarm-replay --policy ars-tuned-right --trials 5       the first five trials
  kinarm-replay --policy ars-tuned-right --worst 5        the worst of 200
  kinarm-replay results/evaluation.json --collisions      what an evaluation collided in
  kinarm-replay --compare ppo-tuned-both oracle           two on the same trials, one as a ghost
  kinarm-replay --policy my_policy.npz --record mine.npz  keep the recordings as well
  kinarm-replay mine.npz                                  and play them later
  kinarm-replay --policy oracle --task left --live        endless fresh trials in the browser
"""


def build_parser() -> Parser:
    """The options of the command."""
    parser = Parser(
        prog=PROG,
        description="Write one HTML file that replays trials offline, or show them live.",
        epilog=EPILOG,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument(
        "source",
        nargs="?",
        type=Path,
        metavar="FILE",
        help="evaluation.json of kinarm-eval, or recordings (.npz), to take trials from",
    )
    who = parser.add_mutually_exclusive_group()
    who.add_argument(
        "--policy",
        metavar="NAME_OR_FILE",
        help="shipped policy or recipe (its first seed), random, zero, oracle, or .npz file",
    )
    who.add_argument(
        "--compare",
        nargs=2,
        metavar=("A", "B"),
        help="two policies on the same trials, the second as a ghost",
    )
    parser.add_argument(
        "--task", metavar="NAME", help="left, right or both (what the policy was trained on)"
    )
    which = parser.add_mutually_exclusive_group()
    which.add_argument(
        "--trial",
        type=whole_number(0),
        action="append",
        metavar="N",
        help="play this trial; repeatable",
    )
    which.add_argument(
        "--worst", type=whole_number(1), metavar="N", help="play the N that ended farthest away"
    )
    which.add_argument(
        "--collisions", action="store_true", help="play the trials that ended in contact"
    )
    parser.add_argument(
        "--trials",
        type=whole_number(1),
        metavar="N",
        help="trials in all (5; or 200 to choose from)",
    )
    parser.add_argument("--seed", type=whole_number(0), metavar="N", help="seed of the trials (0)")
    parser.add_argument("--arm", metavar="NAME_OR_URDF", help="arm to use (paper)")
    parser.add_argument(
        "--allow-other-arm",
        action="store_true",
        help="let policies face an arm that they were not trained for",
    )
    parser.add_argument(
        "--no-oracle",
        dest="oracle",
        action="store_false",
        help="leave out the number of steps proven necessary",
    )
    parser.add_argument("--out", type=Path, metavar="FILE", help="the page to write (replay.html)")
    parser.add_argument(
        "--record", type=Path, metavar="FILE", help="write the recordings as well (.npz)"
    )
    parser.add_argument(
        "--live",
        action="store_true",
        help="serve endless fresh trials to the browser of this machine instead",
    )
    parser.add_argument(
        "--port",
        type=whole_number(1),
        metavar="N",
        help="port of --live (7000, or the next free one)",
    )
    parser.add_argument(
        "--no-browser",
        dest="browser",
        action="store_false",
        help="with --live: print the address and open nothing",
    )
    return parser


def main(arguments: Sequence[str] | None = None) -> None:
    """Run the command line."""
    run_command(PROG, lambda: _replay(build_parser().parse_args(arguments)))


def _replay(options: argparse.Namespace) -> None:
    """From options to a page, or to a live one."""
    if options.live:
        _refuse(options, "--live", LIVE_IGNORES)
        _go_live(options)
        return
    if options.port is not None:
        raise InvalidInputError("--port goes with --live")
    out = options.out or Path("replay.html")
    for path in (out, options.record):
        if path is not None:
            check_folder(path.parent)
    _write(options, out)


LIVE_IGNORES = ("source", "compare", "trial", "worst", "collisions", "trials", "out", "record")


def _refuse(options: argparse.Namespace, mode: str, names: Sequence[str]) -> None:
    """Refuse options that mean nothing in a mode."""
    for name in names:
        if getattr(options, name):
            given = "a file" if name == "source" else f"--{name}"
            raise InvalidInputError(f"{given} does not go with {mode}")


def _write(options: argparse.Namespace, out: Path) -> None:
    """Write the page, and the recordings if that is asked for."""
    from rich.console import Console

    from kinarm.evaluation.replays.choosing import choose, find_recordings
    from kinarm.recording import save_recordings
    from kinarm.viewer import replay_page

    with Console(stderr=True).status("recording; the first run compiles"):
        found = find_recordings(options)
        runs = choose(found, options)
        page = replay_page(runs[0], ghosts=runs[1] if len(runs) > 1 else (), arm=found.arm)
    if options.record is not None:
        save_recordings(options.record, [recording for run in runs for recording in run])
    page.save(out)
    for trial in zip(*runs, strict=True):
        for recording in trial:
            print(describe(recording))
    print(f"written: {out}, {len(page.html) / 1e6:.1f} MB, plays offline in any browser")


def describe(recording: "Recording") -> str:
    """One line about a recording."""
    ending = {
        "success": "reached the goal",
        "collision": " touches ".join(recording.contact or ("something",)),
        "horizon": "out of time",
    }[recording.outcome]
    floor = recording.steps_lower_bound
    necessary = f" ({floor} proven necessary)" if floor is not None else ""
    return (
        f"{recording.task} {recording.trial}, {recording.policy}: {ending} after "
        f"{recording.steps} steps{necessary}, {recording.final_distance:.3f} m from the goal"
    )


def _go_live(options: argparse.Namespace) -> None:
    """Serve fresh trials until this is interrupted."""
    from kinarm.arm import DEFAULT_ARM, Arm
    from kinarm.evaluation.replays.choosing import chosen_entrant, chosen_task
    from kinarm.evaluation.replays.following import follow
    from kinarm.simulator import Simulator
    from kinarm.viewer.live_server import PORT, LiveServer

    arm = Arm.load(options.arm or DEFAULT_ARM)
    entrant = chosen_entrant(options.policy)
    simulator = Simulator(arm, chosen_task([entrant], options.task))
    entrant.check(arm, allow_other_arm=options.allow_other_arm)
    wanted = options.port or PORT
    with LiveServer(wanted) as server:
        if server.port != wanted:
            print(f"port {wanted} is in use: taking {server.port}")
        print(f"{entrant.name} at {server.address} (stop with Ctrl-C)", flush=True)
        if options.browser:
            webbrowser.open(server.address)
        follow(server, entrant, simulator, options.seed or 0, _print_at_once)


def _print_at_once(recording: "Recording") -> None:
    print(describe(recording), flush=True)


if __name__ == "__main__":
    main()
