"""Tables of pages that come from recorded results; see ``docs.tables``."""

import json
from collections import Counter
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from kinarm.evaluation.report.templating import markdown_table

RESULTS = Path(__file__).parent.parent / "data" / "results"

MANNERS = ("bare", "commanded", "shield", "both", "both, lag known", "quarter of the speed")
"""Columns of the table of transfer to MuJoCo."""


def servos_table() -> str:
    """Success and contact of policies in kinarm and in MuJoCo, in percent, by plant."""
    record = json.loads((RESULTS / "plants" / "mujoco.json").read_text(encoding="utf-8"))
    names = list(record["rows"][0]["policies"])

    def shares(figures: Mapping[str, list[float]]) -> str:
        pairs = (figures[each] for each in ("kinarm", "mujoco"))
        return ", ".join(f"{100 * success:.1f} / {100 * touched:.1f}" for success, touched in pairs)

    rows = [
        [
            row["plant"],
            f"{100 * row['apart']:.2f}",
            *(shares(row["policies"][name]) for name in names),
        ]
        for row in record["rows"]
    ]
    heads = (f"`{name.removesuffix('-both-seed0')}`" for name in names)
    return markdown_table(["plant", "apart %", *heads], rows)


def transfer_records() -> list[dict[str, Any]]:
    """What was recorded of policies in MuJoCo, in the order of the pages."""
    paths = sorted(
        (RESULTS / "plants").glob("transfer-*.json"), key=lambda path: "-ars" in str(path)
    )
    return [json.loads(path.read_text(encoding="utf-8")) for path in paths]


def transfer_table() -> str:
    """Success and contact of policies in MuJoCo by plant and manner, in percent."""
    rows: list[list[str]] = []
    for record in transfer_records():
        name = f"`{record['policy'].removesuffix('-both-seed0')}`"
        figures: dict[str, dict[str, str]] = {}
        for cell in record["cells"]:
            said = f"{100 * cell['success']:.1f} / {100 * cell['contact']:.1f}"
            figures.setdefault(cell["plant"], {})[cell["manner"]] = said
        rows += [
            [name, plant, *(row.get(each, "") for each in MANNERS)]
            for plant, row in figures.items()
        ]
    return markdown_table(["policy", "plant", *MANNERS], rows)


def transfer_trials() -> str:
    """How many trials the cells of that table have."""
    counts = Counter(cell["trials"] for each in transfer_records() for cell in each["cells"])
    said = (f"{cells} cells have {trials} trials" for trials, cells in sorted(counts.items()))
    return f"{', '.join(said)}.\n"


def shield_table() -> str:
    """Random steps behind a shield."""
    record = json.loads((RESULTS / "plants" / "shield.json").read_text(encoding="utf-8"))
    rows = [
        [
            row["what"],
            f"{row['steps']:,}",
            f"{100 * row['replaced'] / row['steps']:.1f}",
            f"{row['contacts']}",
            f"{row['steps_per_second_and_core']:,}",
        ]
        for row in record["random"]
    ]
    return markdown_table(["in", "steps", "replaced %", "contacts", "steps/s on a busy core"], rows)


def pushing_text() -> str:
    """What the steps of an arm take that pushes."""
    record = json.loads((RESULTS / "plants" / "shield.json").read_text(encoding="utf-8"))
    row = record["pushing"]
    return (
        f"A UR5 with pieces that pushes all the time: of {row['steps']:,} steps, "
        f"{100 * row['replaced'] / row['steps']:.0f} % were replaced, and one took "
        f"{row['median']:g} ms in the median and {row['most']:g} ms at the 99th percentile "
        "(processor time).\n"
    )


def balls_table() -> str:
    """Success and contact beside bodies that move, in percent."""
    record = json.loads((RESULTS / "plants" / "shield.json").read_text(encoding="utf-8"))
    rows = []
    for row in record["balls"]:
        shares = [[f"{100 * each:.1f}" for each in row[name]] for name in ("bare", "shield")]
        driven = [f"{success} / {contact}" for success, contact, _ in shares]
        rows.append([f"{row['speed']:g} m/s", *driven, *(each[2] for each in shares)])
    head = ["speed of the balls", "`ppo-best`", "behind a shield", "resting", "behind a shield"]
    return markdown_table(head, rows)


def injections_table() -> str:
    """Errors of arms that the check of a contract was given, and how many it missed, by kind."""
    record = json.loads((RESULTS / "contract" / "injections.json").read_text(encoding="utf-8"))
    kinds = [kind for kind in record[0]["tally"] if kind != "no error"]
    rows = [
        [
            kind,
            f"{sum(each['tally'].get(kind, 0) for each in record)}",
            f"{sum(each['missed'].count(kind) for each in record)}",
        ]
        for kind in kinds
    ]
    clean = sum(each["tally"]["no error"] for each in record)
    imagined = sum(len(each["imagined"]) for each in record)
    rows.append(["no error", f"{clean}", f"{imagined} imagined"])
    return markdown_table(["error, in", "arms", "missed"], rows)


def plans_table() -> str:
    """Plans for MotionBenchMaker's problems by kinarm and by OMPL, and with hulls."""
    record = json.loads((RESULTS / "plans" / "motionbenchmaker.json").read_text(encoding="utf-8"))
    rows = []
    for name, of in record["pieces"].items():
        row = [f"`{name}`"]
        for told, part in ((of, ""), (of, "ompl "), (record["hulls"][name], "")):
            times = " / ".join(f"{1000 * value:.0f}" for value in told[f"{part}seconds"])
            row += [f"{told[f'{part}solved']} of {told[f'{part}solved of']}", times]
        rows.append([*row, " / ".join(f"{value:.2f}" for value in of["ratio"])])
    heads = ["problems", "kinarm", "ms", "OMPL", "ms", "hulls", "ms", "duration"]
    return markdown_table(heads, rows)


def factors_table() -> str:
    """What a change of a recipe is worth, in percentage points of success."""
    rows = []
    for study in ("ars_factors", "ppo_factors"):
        record = json.loads((RESULTS / study / "results.json").read_text(encoding="utf-8"))
        first, *others = record["experiment"]["entries"]
        titles = {first["name"]: "as it is"} | {each["name"]: each["title"] for each in others}
        for row in record["results"]:
            shares = [_percent(_numbers(row["success"])), f"{100 * min(row['success_each']):.1f}"]
            than = row["difference"]
            points = _percent(_numbers(than["success"]), "+.1f") if than else ""
            change = [f"`{first['recipe']}`", titles[row["entry"]], points]
            rows.append([*change, *shares, f"{100 * row['collision']['value']:.1f}"])
    heads = ["recipe", "change", "points (95 %)", "success % (95 %)", "worst seed %", "collision %"]
    return markdown_table(heads, rows)


def _numbers(estimate: Mapping[str, Any]) -> list[float]:
    """A recorded estimate and the ends of its interval."""
    return [estimate["value"], *estimate["ci95"]]


def board() -> dict[str, Any]:
    """The record of the leaderboard."""
    path = RESULTS.parent / "policies" / "leaderboard.json"
    record: dict[str, Any] = json.loads(path.read_text(encoding="utf-8"))
    return record


def leaderboard_table() -> str:
    """Rows of the leaderboard: by problem and success, each beside its own behind a shield."""
    rows = board()["rows"]
    bare = {(row["policy"], row["problem"]): row["success"][0] for row in rows}

    def place(row: Mapping[str, Any]) -> tuple[Any, ...]:
        name, problem = row["policy"].removesuffix("+shield"), row["problem"]
        return ("left", "right", "both").index(problem), -bare[name, problem], row["policy"]

    heads = ["problem", "policy", "success % (95 %)", "collision %", "replaced %", "step ratio"]
    heads += ["seeds", "parameters", "training steps"]
    return markdown_table(heads, map(_leaderboard_row, sorted(rows, key=place)))


def _leaderboard_row(row: Mapping[str, Any]) -> list[str]:
    shares = (row[name] for name in ("collision", "replaced"))
    numbers = (row["parameters"], row["training_steps"])
    return [
        row["problem"],
        f"`{row['policy']}`",
        _percent(row["success"]),
        *("" if each is None else f"{100 * each:.1f}" for each in shares),
        "" if row["step_ratio"] is None else f"{row['step_ratio']:.2f}",
        str(len(row["seeds"])),
        *("" if each is None else f"{each:,}" for each in numbers),
    ]


def _percent(estimate: Sequence[float], digits: str = ".1f") -> str:
    """An estimate in percent, with its interval if it is known."""
    value, *interval = (f"{100 * each:{digits}}" for each in estimate)
    return f"{value} ({'..'.join(interval)})" if interval else value


def failures_table() -> str:
    """Causes of failure of the shipped policies on both benches, in percent of all trials."""
    causes, shares = failures()
    rows = [
        [cause, *(f"{of[cause]:.2f}" if cause in of else "" for of in shares.values())]
        for cause in causes
    ]
    return markdown_table(["cause", *(f"`{name}`" for name in shares)], rows)


def watching_table() -> str:
    """A command for each of these causes, which shows a trial of a policy that fails so."""
    record, (causes, shares) = board(), failures()
    options = f"--problem both --seed {record['seed']} --trials {record['trials']}"
    found: dict[str, str] = {}
    for row in record["rows"]:
        if row["problem"] == "both" and row["policy"] in shares:
            for cause, _, policy, trial in row["failures"]:
                command = f"`kinarm-replay --policy {policy} {options} --trial {trial}`"
                found.setdefault(cause, command)
    return markdown_table(["cause", "to watch one"], [[cause, found[cause]] for cause in causes])


def failures() -> tuple[list[str], dict[str, dict[str, float]]]:
    """Causes of failure, the most frequent first; and by recipe, percent of all trials by cause."""
    record, total, shares = board(), Counter[str](), {}
    for row in sorted(record["rows"], key=lambda row: -row["success"][0]):
        if row["problem"] == "both" and row["policy"].endswith("-both"):
            faced = record["trials"] * len(row["seeds"])
            shares[row["policy"]] = {cause: 100 * n / faced for cause, n, *_ in row["failures"]}
            total += Counter({cause: n for cause, n, *_ in row["failures"]})
    return [cause for cause, _ in total.most_common()], shares


def skills_table() -> str:
    """What PPO's recipe best reaches of each problem, bare and behind a shield."""
    record = json.loads((RESULTS / "skills" / "skills.json").read_text(encoding="utf-8"))
    faced: dict[str, list[Mapping[str, Any]]] = {}
    for row in record["rows"]:
        faced.setdefault(row["problem"], []).append(row)
    rows = []
    for problem, (bare, behind) in faced.items():
        shown = []
        for row in (bare, behind):
            worst = 100 * min(share for share, _ in row["seeds"].values())
            shown += [_percent(row["success"]), f"{worst:.1f}", f"{100 * row['collision']:.2f}"]
        ratio = "" if behind["step_ratio"] is None else f"{behind['step_ratio']:.2f}"
        alone, oracle = (f"{100 * behind[name]:.1f}" for name in ("control", "oracle"))
        end = [alone, oracle, ratio, f"{behind['speed']:.2f}", f"{behind['minutes']:.1f}"]
        rows.append([f"`{problem}`", str(len(bare["seeds"])), *shown, *end])
    three = ["worst seed %", "contact %"]
    heads = ["problem", "seeds", "bare: success %", *three, "behind a shield: success %", *three]
    end = ["control alone %", "oracle %", "step ratio", "speed at the goal m/s"]
    return markdown_table([*heads, *end, "minutes of a core"], rows)


def hard_table() -> str:
    """What policies for joints that lag reach in MuJoCo."""
    record = json.loads((RESULTS / "skills" / "mujoco.json").read_text(encoding="utf-8"))
    rows = []
    for shielded, name in enumerate(("bare", "behind a shield")):
        seeds = [row for row in record["rows"] if row["shield"] == bool(shielded)]
        success, contact = ([100 * row[each] for row in seeds] for each in ("success", "contact"))
        figures = [f"{sum(success) / len(seeds):.1f}", f"{min(success):.1f}"]
        rows.append([name, str(len(seeds)), *figures, f"{sum(contact) / len(seeds):.2f}"])
    return markdown_table(["`hard-paper`", "seeds", "success %", "worst seed %", "contact %"], rows)


def undecided_table() -> str:
    """What the oracle finds of each shipped arm's goals, on benches that it can reach."""
    record = json.loads((RESULTS / "plans" / "undecided.json").read_text(encoding="utf-8"))
    rows = []
    for row in record["rows"]:
        across, upwards = row["nearer"]
        benches = "the paper's" if across == 1 else f"{across:g} as far, {upwards:g} as high"
        shares = (f"{100 * row[each]:.1f}" for each in ("reached", "out of reach", "undecided"))
        mean, p95 = row["step ratio"]
        rows.append([f"`{row['arm']}`", benches, *shares, f"{mean:.2f}, {p95:.2f}"])
    heads = ["motion found %", "proven out of reach %", "undecided %", "step ratio: mean, p95"]
    return markdown_table(["arm", "benches", *heads], rows)


RECORDED = {
    "skills": skills_table,
    "hard": hard_table,
    "leaderboard": leaderboard_table,
    "failures": failures_table,
    "failures-to-watch": watching_table,
    "injections": injections_table,
    "plans": plans_table,
    "undecided": undecided_table,
    "servos": servos_table,
    "transfer-mujoco": transfer_table,
    "transfer-trials": transfer_trials,
    "shield": shield_table,
    "pushing": pushing_text,
    "balls": balls_table,
    "factors": factors_table,
}
