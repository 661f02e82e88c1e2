"""The page as a whole."""

from collections.abc import Sequence
from importlib import resources
from itertools import accumulate
from pathlib import Path
from string import Template
from typing import Any

from kinarm.evaluation.evaluations import Evaluation
from kinarm.evaluation.html_report.groups import TaskResults, group_results
from kinarm.evaluation.html_report.histograms import histogram_chart
from kinarm.evaluation.html_report.maps import AXIS_LENGTH, MARKERS, bench_map, map_legend
from kinarm.evaluation.html_report.markup import Child, Markup, join, tag
from kinarm.evaluation.html_report.method import method_section
from kinarm.evaluation.html_report.profiles import legend, profile_chart
from kinarm.evaluation.html_report.replays import replay_frame
from kinarm.evaluation.html_report.summary import card, oracle_rate, summary_table
from kinarm.evaluation.html_report.worst import worst_table, worst_trials
from kinarm.files import check_folder, write_text


def write_report(
    folder: str | Path, document: dict[str, Any], evaluations: Sequence[Evaluation]
) -> Path:
    """Write the report of an evaluation as ``index.html``.

    Parameters
    ----------
    folder : str or Path
        Where to; it is created if it is missing.
    document, evaluations
        As for `report_page`.

    Returns
    -------
    Path
        The page.

    Raises
    ------
    OutputError
        If it cannot be written.
    """
    check_folder(folder, create=True)
    path = Path(folder) / "index.html"
    write_text(path, report_page(document, evaluations))
    return path


def report_page(document: dict[str, Any], evaluations: Sequence[Evaluation]) -> str:
    """The report of an evaluation: one HTML page that fetches nothing.

    It holds the table with its intervals drawn, performance profiles, histograms, maps of the
    benches, the worst trials and how everything was made. Equal input gives equal text.

    Parameters
    ----------
    document : dict
        What `evaluation_document` made of the evaluations.
    evaluations : sequence of Evaluation
        Made with one trial set per task.

    Raises
    ------
    InvalidInputError
        If the document was made of others, or two of them cannot be told apart.
    """
    tasks = group_results(document, evaluations)
    parts = {
        "title": _title(tasks),
        "subtitle": _subtitle(document),
        "cards": join(card(task) for task in tasks),
        "links": join(tag("a", task.name, href=f"#{task.name}") for task in tasks),
        "tasks": join(_task_section(task) for task in tasks),
        "worst": _worst_section(tasks),
        "method": method_section(document),
    }
    assets = resources.files(__package__)
    texts = {
        "style": (assets / "page.css").read_text(encoding="utf-8"),
        "script": (assets / "page.js").read_text(encoding="utf-8"),
    }
    template = Template((assets / "page.html").read_text(encoding="utf-8"))
    return template.substitute(texts, **{name: join(part) for name, part in parts.items()})


def _title(tasks: Sequence[TaskResults]) -> str:
    """The policy that was evaluated, or how many there were."""
    groups = [group for task in tasks for group in task.contenders]
    names = {group.name for group in groups}
    if len(names) == 1:
        return names.pop()
    members = {member.entrant.name for group in groups for member in group.members}
    return f"{len(members)} policies" if groups[0].is_policy else " and ".join(sorted(names))


def _subtitle(document: dict[str, Any]) -> str:
    protocol = document["protocol"]
    tasks = list(protocol["tasks"])
    kinds = f"task {tasks[0]}" if len(tasks) == 1 else f"{len(tasks)} tasks"
    return (
        f"{kinds} · {protocol['trials']} trials each · arm {protocol['arm']} · "
        f"seed {protocol['seed']}"
    )


def _task_section(task: TaskResults) -> Markup:
    """Everything about one task, but its worst trials."""
    return tag(
        "section",
        tag("h2", f"Task {task.name}"),
        tag("p", _task_words(task), class_="lead"),
        tag("div", summary_table(task), class_="panel"),
        _charts(task),
        _maps(task),
        id=task.name,
    )


def _charts(task: TaskResults) -> Markup:
    """Profiles and histograms beside each other."""
    return tag(
        "div",
        _figure(
            "How close do they come?",
            "Share of trials that end within a distance d, with its 95 % band; dotted: the "
            "tolerance.",
            profile_chart(task),
            legend(task.groups),
        ),
        _figure(
            "How far off are the failures?",
            "Histograms of the final distance; bar heights are square roots of shares, so that "
            "rare failures show. Left: share in the first bin.",
            histogram_chart(task),
        ),
        class_="pair",
    )


def _maps(task: TaskResults) -> Markup:
    """A map for each policy, or for the baselines if there is none."""
    words = (
        f"The benches from above, to scale, x forward, y to the left (arrows: {AXIS_LENGTH:g} m). "
        "Each marker is the goal of a trial; point at it for its figures. Bars beside a bench: "
        "share of trials that failed in that tenth of it; the line is 100 %."
    )
    if task.trials > MARKERS:
        words += f" Markers are those of the first {MARKERS} trials."
    maps = [
        tag("figure", tag("figcaption", group.name), bench_map(task, group))
        for group in task.contenders
    ]
    grid = tag(
        "div",
        maps,
        class_="maps wide" if len(task.benches) > 1 else "maps",
        tabindex="0",
        role="region",
        aria_label=f"Maps of {task.name}",
    )
    return _figure("Where do they fail?", words, map_legend(task), grid)


def _figure(title: str, words: str, *content: Child) -> Markup:
    heading = tag("figcaption", tag("h3", title), tag("p", words))
    return tag("figure", heading, content, class_="panel")


def _task_words(task: TaskResults) -> str:
    """What the task asks for, and what could be reached at all."""
    goal = (
        f"Bring the tool to within {task.tolerance:g} m of a cube in at most "
        f"{task.entry['horizon']} steps, without contact."
    )
    rate = oracle_rate(task)
    if rate is None:
        return goal
    proofs = 100 * task.entry["oracle"]["tight_share"]
    return (
        f"{goal} The oracle reaches {100 * rate:.1f} % of the goals; how many steps are necessary "
        f"is proven exactly for {proofs:.1f} % of the trials."
    )


def _worst_section(tasks: Sequence[TaskResults]) -> Markup:
    """Tables of the worst trials, beside their replay."""
    chosen = [worst_trials(task) for task in tasks]
    firsts = accumulate((len(each) for each in chosen), initial=0)
    tables = [worst_table(*each) for each in zip(tasks, chosen, firsts, strict=False)]
    return join(
        tag("div", tables, class_="panel"),
        tag("div", replay_frame([worst for each in chosen for worst in each]), class_="stage"),
    )
