"""The README: its code runs, and its results are those of its command."""

import json
import re
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parent.parent
README, RESULTS, REPRODUCTION, PAPER = (
    (ROOT / page).read_text(encoding="utf-8")
    for page in (
        "README.md",
        "docs/reference/results.md",
        "docs/reference/reproduction.md",
        "docs/tutorials/paper.md",
    )
)


def blocks_after(heading, kind):
    section = README.split(f"\n## {heading}\n")[1].split("\n## ")[0]
    return re.findall(rf"```{kind}\n(.*?)```", section, re.DOTALL)


def run(code, folder):
    return subprocess.run(
        [sys.executable, "-c", code], cwd=folder, capture_output=True, text=True, check=True
    ).stdout


def test_python_example_runs(tmp_path):
    (code,) = blocks_after("Ten lines of Python", "python")
    answer = run(code, tmp_path)
    assert float(re.match(r"(\d\.\d+) m", answer).group(1)) <= 0.05
    assert "reached: True" in answer


@pytest.mark.slow
def test_results_are_those_of_the_command(tmp_path):
    command = blocks_after("Results", "sh")[0].split()
    assert command[0] == "kinarm-eval"
    assert " ".join(command) in RESULTS
    code = f"from kinarm.evaluation.commands.evaluate import main; main({command[1:]!r})"
    assert run(code, tmp_path).strip() in RESULTS


def test_the_short_table_is_that_of_the_results():
    successes = {}
    rows = re.findall(r"^\| (left|right|both) +\| (\S+) +\| +(.*?) \|", RESULTS, re.MULTILINE)
    for problem, policy, success in rows:
        recipe = re.sub(r"-(left|right|both)(?=\+|$)", "", policy)
        successes.setdefault(recipe, {})[problem] = success
    found = re.findall(r"^\| `(\S+)` \| (.*) \| (.*) \| (.*) \|$", README, re.MULTILINE)
    assert {"oracle", "random", "ars-paper", "ppo-best"} <= {recipe for recipe, *_ in found}
    for recipe, *shown in found:
        assert shown == [successes[recipe][problem] for problem in ("left", "right", "both")]


def test_verdicts_are_the_recorded_ones():
    document = json.loads((ROOT / "data/results/claims.json").read_text(encoding="utf-8"))
    readings = {reading["name"]: reading["claims"] for reading in document["readings"]}
    shared = {claim["name"]: claim for claim in readings["spread1-progress-iteration"]}
    for claim in readings["spread1-progress-none"]:
        both = [claim, shared.get(claim["name"])]
        cells = (verdict_cell(each) if each else "" for each in both)
        assert f"| {claim['statement']} | {' | '.join(cells)} |" in REPRODUCTION
    assert f"{document['trainings']} trainings" in PAPER


def verdict_cell(claim):
    """Verdict, and statistics with their intervals."""
    measured = (
        "{:.2f} ({:.2f}..{:.2f})".format(part["statistic"], *part["ci95"])
        for part in claim["parts"]
    )
    return f"**{claim['verdict']}**: {'; '.join(measured)}"


def test_make_targets_exist():
    makefile = (ROOT / "Makefile").read_text(encoding="utf-8")
    named = set(re.findall(r"`?make ([a-z]+)`?", README))
    assert {"eval", "test", "docs"} <= named
    for target in named:
        assert re.search(rf"^{target}:", makefile, re.MULTILINE)
