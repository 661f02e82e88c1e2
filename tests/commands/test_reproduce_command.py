"""``kinarm-reproduce``: the quick reproduction from end to end, gone on with, and bad input."""

import csv
import json
import shutil
from pathlib import Path

import pytest
from small_studies import Counting

from kinarm.evaluation.commands.reproduce import ReproductionRequest

FROZEN = Path(__file__).resolve().parents[1] / "frozen" / "reproduction"
QUICK = ("--quick", "--jobs", 2)


def contents(folder: Path) -> dict[str, bytes]:
    """All files that do not depend on the clock."""
    return {
        str(path.relative_to(folder)): path.read_bytes()
        for path in sorted(folder.rglob("*"))
        if path.is_file() and path.parent.name != "made" and not path.name.startswith("timing")
    }


@pytest.fixture(scope="module")
def quick(run_outside, tmp_path_factory):
    """The folder of a quick reproduction, and what the command printed."""
    place = tmp_path_factory.mktemp("quick")
    answer = run_outside("kinarm-reproduce", *QUICK, cwd=place)
    assert answer.status == 0, answer.err
    return place / "reproduction-quick", answer


@pytest.mark.slow
class TestQuick:
    def test_says_what_it_is_and_where_the_rest_is(self, quick):
        _, answer = quick
        assert answer.out.startswith("A smoke run: each of 36 trainings")
        assert "reproduction-quick/REPRODUCTION.md" in answer.out
        assert "Traceback" not in answer.err

    def test_figures_are_those_that_were_recorded(self, quick):
        """They lie in ``tests/frozen``."""
        folder, _ = quick
        frozen = (json.loads((each / "claims.json").read_text()) for each in (FROZEN, folder))
        expected, found = (document["readings"] for document in frozen)
        claims = [{claim["name"]: claim for claim in reading["claims"]} for reading in expected]
        for reading, known in zip(found, claims, strict=True):
            assert len(reading["claims"]) == len(known)
            for claim in reading["claims"]:
                assert claim == known[claim["name"]]
        rows, known_rows = (
            [*csv.DictReader((each / "runs.csv").read_text().splitlines())]
            for each in (folder, FROZEN)
        )
        assert rows == known_rows
        page = (folder / "REPRODUCTION.md").read_text().splitlines()
        kept = [line for line in page if not line.startswith(("Made by", "Versions:"))]
        assert kept == (FROZEN / "REPRODUCTION.md").read_text().splitlines()

    def test_policies_and_figures_lie_beside_the_page(self, quick):
        folder, _ = quick
        lines = (folder / "runs.csv").read_text().splitlines()
        names = {row["training"] for row in csv.DictReader(lines)}
        assert {path.stem for path in (folder / "policies").iterdir()} == names
        for figure in ("figure2", "figure3", "learning_curves", "timing_learning_curves"):
            assert (folder / f"{figure}.png").read_bytes().startswith(b"\x89PNG")
            assert b"</svg>" in (folder / f"{figure}.svg").read_bytes()

    def test_goes_on_where_it_stopped_with_any_executor(self, quick, tmp_path, monkeypatch):
        """What is there is not trained again, and the same is written."""
        folder = tmp_path / "copy"
        shutil.copytree(quick[0], folder)
        first, second, *_ = sorted((folder / "runs").iterdir())
        first.unlink()
        second.write_bytes(second.read_bytes()[:1000])
        executor = Counting()
        monkeypatch.setattr(ReproductionRequest, "executor", lambda *_: executor)
        request = ReproductionRequest(quick=True, out=folder)
        claims = request.run(command="kinarm-reproduce " + " ".join(map(str, QUICK)))
        assert len(executor.tasks) == 2
        assert contents(folder) == contents(quick[0])
        assert claims[0].name == "ars-left"


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("--out", "other"), "is of the experiment 'reproduction', not of 'reproduction_quick'"),
        (("--ray", "local", "--slurm"), "exclude each other"),
    ],
)
def test_bad_input_is_refused_in_one_line(run, tmp_path, monkeypatch, arguments, words):
    monkeypatch.chdir(tmp_path)
    Path("file").touch()
    Path("reproduction_quick").mkdir()  # which does not hide the shipped experiment
    Path("other").mkdir()
    Path("other/study.toml").write_text('name = "reproduction"')
    answer = run("kinarm-reproduce", "--quick", "--no-ppo", *arguments)
    assert (answer.status, answer.out) == (2, "")
    assert words in answer.err
    assert len(answer.err.splitlines()) == 1
