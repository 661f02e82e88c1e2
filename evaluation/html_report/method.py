"""How the evaluation was made, so that it can be judged and repeated."""

from typing import Any

from kinarm.evaluation.html_report.markup import Markup, join, tag


def method_section(document: dict[str, Any]) -> Markup:
    """Command, trials, meaning of the figures and versions.

    Parameters
    ----------
    document : dict
        What `evaluation_document` returned.
    """
    protocol = document["protocol"]
    return join(
        tag("h3", "Command"),
        tag("pre", tag("code", protocol["command"]), tabindex="0") if protocol["command"] else None,
        tag("h3", "Trials"),
        _trials(protocol),
        tag("h3", "Figures and intervals"),
        tag("dl", [_entry(*each) for each in _meanings(protocol)]),
        tag("h3", "Versions"),
        _versions(protocol),
    )


def _trials(protocol: dict[str, Any]) -> Markup:
    """One row per task: its rules, its hash and how far the proofs got."""
    headings = ("task", "trial-set hash", "tolerance", "horizon", "oracle", "proofs complete")
    rows = [
        (
            task,
            tag("code", entry["trial_set_hash"]),
            f"{entry['tolerance']:g} m",
            f"{entry['horizon']} steps",
            *_oracle(entry["oracle"]),
        )
        for task, entry in protocol["tasks"].items()
    ]
    return join(
        tag(
            "p",
            f"{protocol['trials']} trials a task, drawn with seed {protocol['seed']}; every "
            "policy faces the same starts and goals. Equal hashes mean equal trials.",
        ),
        tag(
            "div",
            tag(
                "table",
                tag("thead", tag("tr", [tag("th", text, scope="col") for text in headings])),
                tag("tbody", [tag("tr", [tag("td", cell) for cell in row]) for row in rows]),
                class_="plain",
            ),
            class_="scroll",
            tabindex="0",
            role="region",
            aria_label="Trial sets",
        ),
    )


def _oracle(bounds: dict[str, Any] | None) -> tuple[str, str]:
    if bounds is None:
        return "not asked", ""
    return f"{100 * bounds['success']['rate']:.1f} %", f"{100 * bounds['tight_share']:.1f} %"


def _entry(term: str, meaning: str) -> Markup:
    return tag("div", tag("dt", term), tag("dd", meaning))


def _meanings(protocol: dict[str, Any]) -> list[tuple[str, str]]:
    """What the figures mean and how their intervals were made."""
    intervals = protocol["intervals"]
    level = f"{100 * intervals['level']:g} %"
    return [
        ("success", "share of trials that ended within the tolerance, without contact"),
        ("contact", "share of trials that ended in contact with a bench, the ground or the arm"),
        (
            "oracle",
            "replays motions that it found with inverse kinematics; it bounds what any policy "
            "could reach, and proves how many steps are necessary",
        ),
        (
            "step ratio",
            "steps taken over the number proven necessary, of the trials that succeeded: median "
            "and 95th percentile (p95)",
        ),
        (
            "profile",
            "share of trials whose final distance is at most d, contact allowed; at the tolerance "
            "it exceeds success by the trials that ended there in contact",
        ),
        (
            "intervals of shares",
            f"{intervals['shares']}, {level}, over trials; the bands of the profiles are made of "
            "them point by point. Training seeds of a recipe face the same trials, so a pooled "
            "interval is that of one seed's number of trials, widened to whole hits",
        ),
        (
            "intervals of distances",
            f"{intervals['distances']}, {level}, {intervals['resamples']} resamples, seed "
            f"{intervals['bootstrap_seed']}; all seeds of a recipe are resampled alike",
        ),
        (
            "seeds",
            "number of training seeds, and the lowest and highest success among them: how much "
            "results vary over trainings, which no interval tells",
        ),
    ]


def _versions(protocol: dict[str, Any]) -> Markup:
    """Packages, commit and arm."""
    entries = list(protocol["versions"].items())
    if protocol["commit"]:
        entries.append(("commit", protocol["commit"]))
    entries.append((f"arm {protocol['arm']}", protocol["arm_digest"]))
    return tag(
        "ul",
        [tag("li", name, " ", tag("code", version)) for name, version in entries],
        class_="versions",
    )
