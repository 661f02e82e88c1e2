"""The figures of a benchmark as rows of text, for a screen and for Markdown alike."""

from collections.abc import Iterator
from typing import Any

from kinarm.evaluation.measurements.environments import VECTOR_ENVS

Row = tuple[str, ...]

HEADER = ("what", "median", "best", "judged by Coal")
RATES = HEADER[1:3]


def rows(document: dict[str, Any]) -> Iterator[Row]:
    """What was measured of kinarm; an empty row ends a section."""
    for row in document["rollouts"]:
        yield _rollout_row("rollouts", row)
    yield ()
    yield from _robot_rows(document["robots"])
    yield ()
    yield f"batch environment, {VECTOR_ENVS} arms", *_rates(document["vector_environment"])
    yield "single environment", *_rates(document["single_environment"])
    yield from _sb3_rows(document["stable_baselines3"])
    yield "reference path (Pinocchio + Coal)", *_rates(document["reference"])
    pictures = (f"{document['pictures'][name]:,.0f} pictures/s" for name in RATES)
    yield "pictures, 480 x 360, one thread", *pictures
    speed_up = f"{document['speed_up_over_reference']:.0f} x"
    yield "speed-up over the reference (512 trained)", speed_up
    yield ()
    training, oracle = document["table_1_training"], document["oracle"]
    steps = f"{training['environment_steps'] / 1e6:.1f} million steps"
    seconds = (f"{training['seconds'][name]:.2f} s" for name in RATES)
    yield f"training of Table 1 ({steps})", *seconds
    yield from _ppo_rows(document.get("ppo_training"))
    seconds = (f"{oracle['trials'] / oracle['trials_per_second'][name]:.1f} s" for name in RATES)
    yield f"oracle, {oracle['trials']} trials", *seconds
    evaluation = document["evaluation"]
    memory = f"{evaluation['peak_memory_mb']:.0f} MB"
    yield "kinarm-eval --trials 200, nothing compiled", f"{evaluation['seconds_first']:.1f} s"
    for known, name in (("unknown", "seconds_without_bounds"), ("known", "seconds")):
        what = f"kinarm-eval --trials 200, bounds {known}"
        yield what, f"{evaluation[name]:.1f} s", memory
    yield ()
    if "studies" in document:
        yield from study_rows(document["studies"])
        yield ()
    yield from _attainable_rows(document["attainable"])


def study_rows(studies: dict[str, Any]) -> Iterator[Row]:
    """What studies take beside their trainings."""
    yield (
        f"study of {studies['trainings']} trainings of Table 1",
        f"{studies['table_1_seconds']:.0f} s",
    )
    for learner, ratio in studies["speed_up"].items():
        yield f"a study with {learner}, two processes over one", f"{ratio:.2f} x"
    yield "share of a study that is no training", f"{100 * studies['overhead']:.1f} %"
    kilobytes = f"{studies['bytes_each'] / 1e3:.0f} kB each"
    for what in ("planned", "kept"):
        yield f"trainings {what} by one process", f"{studies[f'{what}_per_second']:,.0f} a second"
    yield f"reading {studies['loaded']} trainings", f"{studies['load_seconds']:.2f} s", kilobytes


def _rollout_row(what: str, row: dict[str, Any]) -> Row:
    """A row of rollouts."""
    plural = "s" if row["threads"] > 1 else ""
    episodes = f"{row['batch']} {row['actions']} episodes, {row['threads']} thread{plural}"
    judged = f"{100 * row['judged_share']:.3f} %"
    return f"{what}, {episodes}", *_rates(row["steps_per_second"]), judged


def _robot_rows(robots: list[dict[str, Any]]) -> Iterator[Row]:
    """Rows of arms with meshes."""
    for row in robots:
        if "skipped" in row:
            yield from (("arms with meshes", "skipped"), (row["skipped"],))
        else:
            yield _rollout_row(row["arm"], row)


def _sb3_rows(rates: dict[str, Any]) -> list[Row]:
    """Rows of the environments for Stable-Baselines3."""
    if "skipped" in rates:
        return [("for Stable-Baselines3", "skipped"), (rates["skipped"],)]
    return [
        (f"for Stable-Baselines3, {VECTOR_ENVS} arms", *_rates(rates["native"])),
        (f"its DummyVecEnv, {VECTOR_ENVS} single environments", *_rates(rates["dummy"])),
        ("speed-up over its DummyVecEnv", f"{rates['speed_up']:.0f} x"),
    ]


def _ppo_rows(training: dict[str, Any] | None) -> list[Row]:
    """Rows of the training with PPO, which is timed once if at all."""
    if training is None:
        return []
    if "skipped" in training:
        return [("training with PPO", "skipped"), (training["skipped"],)]
    steps = training["environment_steps"] / 1e6
    return [
        (f"training with PPO ({steps:.1f} million steps)", f"{training['seconds']:.1f} s"),
        ("share of it in the simulator", f"{training['simulator_share']:.1%}"),
    ]


def _attainable_rows(attainable: dict[str, Any]) -> Iterator[Row]:
    """Rows of one core, whose two rates were measured by turns."""
    operations = (
        f"{attainable['operations_per_second'][name] / 1e9:,.1f} billion/s" for name in RATES
    )
    yield "attainable operations, one thread", *operations
    yield "beside them, trained rollouts, one thread", *_rates(attainable["steps_per_second"])


PEER_HEADER = ("peer", "what", "theirs", "kinarm", "ratio")


def peer_rows(comparisons: list[dict[str, Any]]) -> Iterator[Row]:
    """Peers beside kinarm: medians, and their ratio."""
    for row in comparisons:
        if "skipped" in row:
            yield row["peer"], row["skipped"], "skipped", "", ""
        else:
            theirs, ours = (row[name]["median"] for name in ("theirs", "ours"))
            unit, ratio = row["unit"], row["ratio"]
            cells = (f"{theirs:,.0f} {unit}", f"{ours:,.0f} {unit}")
            yield row["peer"], row["what"], *cells, f"{ratio:.3g}"


OPERATION_HEADER = ("where", "operations a step", "share")


def operation_rows(limits: dict[str, Any], least: float = 0.005) -> Iterator[Row]:
    """Operations of a step by function, those with the smallest shares left out."""
    total = limits["operations"]["total"]
    for name, count in limits["operations"]["functions"].items():
        if count >= least * total:
            where = name.removeprefix("kinarm.").removeprefix("kernels.")
            yield where, f"{count:,.0f}", f"{count / total:.1%}"
    yield "all", f"{total:,.0f}", "100.0%"


TIME_HEADER = ("time of", "spent in")


def time_rows(limits: dict[str, Any]) -> Iterator[Row]:
    """Where the time of rollouts and of iterations of learners goes."""
    for what, shares in limits["time"].items():
        yield what, ", ".join(f"{place} {share:.0%}" for place, share in shares.items())


def limit_text(document: dict[str, Any]) -> str:
    """What the operations of a step say about the rate, in a sentence."""
    limits, attainable = document["limits"], document["attainable"]
    operations = limits["operations"]
    kinds = ", ".join(f"{count:,.0f} {kind}" for kind, count in operations["kinds"].items())
    steps = attainable["steps_per_second"]["median"]
    most = attainable["operations_per_second"]["median"]
    return (
        f"A step takes {operations['total']:,.0f} floating-point operations ({kinds}). At "
        f"{steps / 1e6:.2f} million steps/s on one core that is "
        f"{operations['total'] * steps / 1e9:.1f} of {most / 1e9:.1f} billion operations/s, "
        f"{limits['share_of_attainable']:.0%} of what the core attains."
    )


def _rates(timing: dict[str, float]) -> list[str]:
    return [f"{timing[name]:,.0f} steps/s" for name in RATES]
