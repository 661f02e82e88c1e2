"""``kinarm-reproduce``: a quick study from end to end, killed and resumed, and bad input."""

import json
import os
import shutil
import signal
import subprocess
import time
from importlib.util import find_spec
from pathlib import Path

import numpy as np
import pytest
from made_up_runs import made_up

from kinarm.errors import InvalidInputError, WorkerError
from kinarm.evaluation.commands.reproduce import ReproductionRequest
from kinarm.evaluation.reproduction import document as documents
from kinarm.evaluation.reproduction.runs import RunStore
from kinarm.evaluation.reproduction.study import Study, quick_study
from kinarm.policies import load_policy
from kinarm.workers import Finished, LocalExecutor

QUICK = ("--quick", "--no-ppo", "--jobs", 2)
needs_ppo = pytest.mark.skipif(find_spec("stable_baselines3") is None, reason="needs the extra ppo")


def contents(folder: Path) -> dict[str, bytes]:
    """All files that do not depend on the clock."""
    return {
        str(path.relative_to(folder)): path.read_bytes()
        for path in sorted(folder.rglob("*"))
        if path.is_file() and "timing" not in str(path.relative_to(folder))
    }


@pytest.fixture(scope="module")
def reference(run_outside, tmp_path_factory):
    """An uninterrupted quick reproduction without PPO, and what it printed."""
    place = tmp_path_factory.mktemp("reference")
    answer = run_outside("kinarm-reproduce", *QUICK, cwd=place)
    assert answer.status == 0, answer.err
    return place / "reproduction-quick", answer


@pytest.mark.slow
class TestQuick:
    def test_says_what_it_is_and_where_the_rest_is(self, reference):
        _, answer = reference
        assert answer.out.startswith("A smoke run: each of 30 trainings took a few iterations")
        assert "hold" not in answer.out
        assert "reproduction-quick/REPRODUCTION.md" in answer.out
        assert "Traceback" not in answer.err

    def test_writes_everything(self, reference):
        folder, _ = reference
        study = quick_study(ppo=False)
        assert len(list((folder / "runs").iterdir())) == len(study.trainings)
        assert len(list((folder / "policies").iterdir())) == len(study.trainings)
        for figure in ("figure2", "figure3", "learning_curves", "timing_learning_curves"):
            assert (folder / f"{figure}.png").read_bytes().startswith(b"\x89PNG")
            assert b"</svg>" in (folder / f"{figure}.svg").read_bytes()
        lines = (folder / "runs.csv").read_text().splitlines()
        assert len(lines) == 1 + len(study.trainings)

    def test_document_and_page_agree(self, reference):
        folder, _ = reference
        document = json.loads((folder / "claims.json").read_text())
        page = (folder / "REPRODUCTION.md").read_text()
        assert document["study"] == "quick"
        assert "smoke run" in page
        assert len(document["readings"]) == 2
        for claim in document["readings"][0]["claims"]:
            (row,) = (line for line in page.splitlines() if f"| {claim['statement']} |" in line)
            assert f"**{claim['verdict']}**" in row
            assert f"{claim['parts'][0]['statistic']:.3f}" in row

    def test_again_trains_nothing_and_writes_the_same(self, reference, run_outside):
        folder, _ = reference
        runs = {path: path.stat().st_mtime_ns for path in (folder / "runs").iterdir()}
        before = contents(folder)
        answer = run_outside("kinarm-reproduce", *QUICK, cwd=folder.parent)
        assert answer.status == 0
        assert contents(folder) == before
        assert {path: path.stat().st_mtime_ns for path in (folder / "runs").iterdir()} == runs


class InThisProcess:
    """An executor as simple as can be."""

    def __init__(self):
        self.names, self.work = [], None

    def carry_out(self, work, tasks):
        for number, task in enumerate(tasks):
            self.names.append(task.name)
            yield Finished(number, (self.work or work)(task))


@pytest.mark.slow
def test_python_gets_the_same_from_a_request_and_another_executor(reference, tmp_path):
    """Nothing is left to do in a copy without a run, and with a damaged one, but these two."""
    folder = tmp_path / "copy"
    shutil.copytree(reference[0], folder)
    (folder / "runs" / "ars-left-seed0.npz").unlink()
    damaged = folder / "runs" / "ars-both-seed1.npz"
    damaged.write_bytes(damaged.read_bytes()[:1000])
    executor = InThisProcess()
    request = ReproductionRequest(quick=True, ppo=False, out=folder)
    claims = request.run(executor, command="kinarm-reproduce --quick --no-ppo --jobs 2")
    assert sorted(executor.names) == ["ars-both-seed1", "ars-left-seed0"]
    assert contents(folder) == contents(reference[0])
    assert claims[0].name == "ars-left"


@pytest.mark.slow
def test_killed_at_random_points_and_resumed(reference, command, tmp_path):
    folder = tmp_path / "reproduction-quick"
    rng = np.random.default_rng(0)
    spelled = command("kinarm-reproduce", *QUICK)
    kills = 0
    for enough in (1, 15):
        process = subprocess.Popen(
            spelled, cwd=tmp_path, stderr=subprocess.DEVNULL, start_new_session=True
        )
        while process.poll() is None and len(list(folder.glob("runs/*.npz"))) < enough:
            time.sleep(0.01)
        time.sleep(rng.uniform(0, 0.3))
        kills += process.poll() is None
        process.kill()
        process.wait()
        see_that_all_end(process.pid)
    assert kills >= 1
    done = subprocess.run(spelled, cwd=tmp_path, capture_output=True, text=True, check=True)
    assert "of 30 trainings are finished" in done.stderr
    assert contents(folder) == contents(reference[0])


def see_that_all_end(session: int) -> None:
    """Workers have to end when the process that started them is killed."""
    deadline = time.monotonic() + 30
    while time.monotonic() < deadline:
        if subprocess.run(["pgrep", "-s", str(session)], stdout=subprocess.DEVNULL).returncode:
            return
        time.sleep(0.05)
    os.killpg(session, signal.SIGKILL)
    raise AssertionError("workers outlived the process that started them")


@pytest.mark.slow
def test_interrupt_keeps_what_is_finished(command, tmp_path):
    process = subprocess.Popen(
        command("kinarm-reproduce", *QUICK),
        cwd=tmp_path,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),
    )
    while not list(tmp_path.glob("reproduction-quick/runs/*.npz")):
        time.sleep(0.02)
    os.killpg(process.pid, signal.SIGINT)
    _, err = process.communicate(timeout=60)
    assert process.returncode == 130
    assert err.splitlines()[-1] == (
        "kinarm-reproduce: interrupted; what is finished is kept, and the same command goes on"
    )
    assert "Traceback" not in err
    see_that_all_end(process.pid)


@needs_ppo
@pytest.mark.slow
def test_quick_with_ppo(run_outside, tmp_path):
    answer = run_outside("kinarm-reproduce", "--quick", cwd=tmp_path)
    assert answer.status == 0, answer.err
    page = (tmp_path / "reproduction-quick" / "REPRODUCTION.md").read_text()
    assert "ARS needs fewer environment steps than PPO" in page
    assert "| 3: both | PPO, 2 seeds |" in page
    assert "| 3: both | oracle | 100.0 |" in page


def test_the_same_command_trains_what_is_missing(tmp_path, capsys, monkeypatch):
    """By an executor of the caller's, which hands back what it is asked for, and no more."""
    study = quick_study(ppo=False)
    store = RunStore(tmp_path, study.protocol)
    policy, run = load_policy("ars-tuned-both"), made_up(np.full(study.protocol.trials, 0.04))
    for training in study.trainings[2:]:
        store.save(training, policy, run)
    monkeypatch.setattr(documents, "write_all", lambda *_: ())
    executor = InThisProcess()
    executor.work = lambda _: (policy, run)
    request = ReproductionRequest(quick=True, ppo=False, out=tmp_path)
    for left in (2, 0):
        request.run(executor)
        told = f"{len(study.trainings) - 2} of {len(study.trainings)} trainings are finished"
        assert (told in capsys.readouterr().err) is bool(left)
    assert sorted(executor.names) == sorted(each.name for each in study.trainings[:2])
    assert json.loads((tmp_path / "study.json").read_text()) == {"study": "quick"}


@pytest.mark.parametrize(("near", "judged"), [(True, True), (False, True), (True, False)])
def test_finished_trainings_are_summed_up_without_another_one(
    run, tmp_path, monkeypatch, near, judged
):
    """All figures, tables and verdicts, of made-up trainings that ended near their goals or not.

    The figures are drawn of all of them, and written of the first ones.
    """
    monkeypatch.setattr(Study, "is_judged", judged)
    if not (near and judged):
        monkeypatch.setattr(documents, "save_figure", lambda *_: ())
    study = quick_study(ppo=False)
    store = RunStore(tmp_path, study.protocol)
    distance = np.full(study.protocol.trials, 0.04 if near else 0.5)
    for training in study.trainings:
        store.save(training, load_policy("ars-tuned-both"), made_up(distance))
    answer = run("kinarm-reproduce", *QUICK, "--out", tmp_path)
    assert answer.status == 0, answer.err
    page = (tmp_path / "REPRODUCTION.md").read_text()
    document = json.loads((tmp_path / "claims.json").read_text())
    verdicts = {claim["name"]: claim["verdict"] for claim in document["readings"][0]["claims"]}
    expected = ("holds" if near else "does not hold") if judged else "not judged"
    assert verdicts["ars-right"] == expected
    assert f"**{expected}**" in page
    assert (" hold" in answer.out) is judged
    assert ("Under no reading" in page) is (judged and not near)
    assert ("No claim is judged." in page) is not judged
    assert len((tmp_path / "runs.csv").read_text().splitlines()) == 1 + len(study.trainings)
    figures = {path.suffix for path in tmp_path.glob("figure2.*")}
    assert figures == ({".png", ".svg"} if near and judged else set())


def test_lost_workers_are_told_in_one_line(run, monkeypatch, tmp_path):
    def fail(*_):
        raise WorkerError("workers ended unexpectedly")

    monkeypatch.setattr(LocalExecutor, "carry_out", fail)
    answer = run("kinarm-reproduce", *QUICK, "--out", tmp_path)
    assert answer.status == 1
    assert answer.err.splitlines()[-1] == "kinarm-reproduce: workers ended unexpectedly"


class TestBadInput:
    def check(self, answer, words):
        assert answer.status == 2
        assert words in answer.err
        assert len(answer.err.splitlines()) == 1
        assert answer.out == ""

    def test_jobs(self, run):
        with pytest.raises(InvalidInputError, match="jobs"):
            ReproductionRequest(jobs=0)
        self.check(run("kinarm-reproduce", "--jobs", 0), "must be a whole number of at least 1")

    def test_folder_of_another_study(self, run, tmp_path):
        (tmp_path / "study.json").write_text('{"study": "full"}')
        answer = run("kinarm-reproduce", *QUICK, "--out", tmp_path)
        self.check(answer, "holds a full reproduction, not a quick one")
        assert [path.name for path in tmp_path.iterdir()] == ["study.json"]

    def test_folder_with_an_unreadable_marker(self, run, tmp_path):
        (tmp_path / "study.json").write_text("{")
        answer = run("kinarm-reproduce", *QUICK, "--out", tmp_path)
        self.check(answer, "holds a foreign reproduction")

    def test_output_that_cannot_be_written(self, run, tmp_path):
        (tmp_path / "file").touch()
        answer = run("kinarm-reproduce", *QUICK, "--out", tmp_path / "file")
        self.check(answer, "cannot write")

    def test_without_the_extra(self, run, tmp_path, monkeypatch):
        monkeypatch.setattr("kinarm.policies.learners.find_spec", lambda _: None)
        answer = run("kinarm-reproduce", "--quick", "--out", tmp_path)
        self.check(answer, "pip install 'kinarm[ppo]'")
        assert list(tmp_path.iterdir()) == []
