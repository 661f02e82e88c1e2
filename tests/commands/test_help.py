"""``--help`` is complete, quick and works everywhere."""

import os
import subprocess
import sys
from importlib import metadata
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
PROGRAMS = {
    "kinarm-eval": "kinarm.evaluation.commands.evaluate",
    "kinarm-replay": "kinarm.evaluation.commands.replay",
    "kinarm-train": "kinarm.policies.train",
    "kinarm-bench": "kinarm.evaluation.commands.bench",
    "kinarm-arms": "kinarm.evaluation.commands.arms",
    "kinarm-compare": "kinarm.evaluation.commands.compare",
    "kinarm-problem": "kinarm.evaluation.commands.problem",
    "kinarm-reproduce": "kinarm.evaluation.commands.reproduce",
    "kinarm-study": "kinarm.evaluation.commands.study",
}
HEAVY = ("torch", "numba", "matplotlib", "pinocchio", "coal", "scipy", "stable_baselines3")

SHOW_HELP = """
import contextlib, importlib, io, sys
module = importlib.import_module({module!r})
with contextlib.redirect_stdout(io.StringIO()) as text:
    try:
        module.main(["--help"])
    except SystemExit as stopped:
        assert stopped.code == 0, stopped.code
assert "usage: {program}" in text.getvalue()
loaded = [name for name in {heavy!r} if name in sys.modules]
assert not loaded, loaded
"""


@pytest.mark.parametrize("program", PROGRAMS)
def test_help_loads_nothing_heavy(program):
    code = SHOW_HELP.format(program=program, module=PROGRAMS[program], heavy=HEAVY)
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr


def test_a_command_starts_without_gymnasium():
    program = [sys.executable, "-X", "importtime", "-m", PROGRAMS["kinarm-eval"], "--help"]
    done = subprocess.run(program, capture_output=True, text=True, check=True)
    assert "kinarm._command_line" in done.stderr
    assert "gymnasium" not in done.stderr


@pytest.mark.parametrize("learner", ["ars", "ppo"])
def test_learners_have_help_of_their_own(run, learner):
    answer = run("kinarm-train", learner, "--help")
    assert (answer.status, answer.err) == (0, "")
    assert "--recipe" in answer.out


@pytest.mark.parametrize(
    ("program", "options"),
    [
        (
            "kinarm-eval",
            "--problem --task --policy --trials --seed --arm --scene --tolerance --horizon "
            "--tool-frame --package-dir "
            "--start-spread --out --report --card --overwrite --json --matrix --allow-other-arm "
            "--no-oracle --markdown",
        ),
        (
            "kinarm-replay",
            "--policy --compare --problem --task --arm --trial --worst --collisions --trials "
            "--seed --allow-other-arm --no-oracle --out --record --overwrite --live --port "
            "--no-browser",
        ),
        (
            "kinarm-compare",
            "--learners --problems --seeds --steps --trials --settings --out --jobs --no-train",
        ),
        ("kinarm-bench", "--repetitions --policy --ppo --out --json"),
    ],
)
def test_help_names_every_option(run, program, options):
    text = run(program, "--help").out
    assert [option for option in options.split() if option not in text] == []


def test_help_lists_the_names_that_options_take(run):
    text = " ".join(run("kinarm-eval", "--help").out.split())
    for name in ("shelf-panda", "benches-ur5", "kinova", "so101", "shelf", "desk"):
        assert name in text


@pytest.mark.parametrize(
    ("program", "options"),
    [
        ("list", ""),
        ("show", "--arm --tool-frame --package-dir --scene --task"),
        ("check", "--arm --scene --task --trials --seed --picture --json --overwrite"),
    ],
)
def test_help_of_problem_commands(run, program, options):
    text = run("kinarm-problem", program, "--help").out
    assert [option for option in options.split() if option not in text] == []


@pytest.mark.parametrize(
    ("learner", "options"),
    [
        ("ars", "--sharing --step-size --no-normalize"),
        ("ppo", "--n-envs --net-arch --learning-rate --training-tolerance --tensorboard"),
    ],
)
def test_training_help_names_every_option(run, learner, options):
    text = run("kinarm-train", learner, "--help").out
    common = "--problem --arm --task --scene --tolerance --horizon --start-spread --seed --out "
    common += "--recipe --resume --overwrite --iterations --reward-success --no-symmetric"
    assert [option for option in f"{common} {options}".split() if option not in text] == []


@pytest.mark.parametrize("learner", ["ars", "ppo"])
def test_training_help_tells_the_default_of_every_setting(run, learner, monkeypatch):
    monkeypatch.setenv("COLUMNS", "500")
    _, _, text = run("kinarm-train", learner, "--help").out.partition("settings of the learner")
    settings, _, _ = text.partition("\n\n")
    options = settings.split("\n  --")[1:]
    assert len(options) > 15
    assert [option for option in options if "(default: " not in option] == []


@pytest.mark.parametrize("program", PROGRAMS)
def test_commands_are_installed(program):
    (entry,) = metadata.entry_points(group="console_scripts", name=program)
    assert entry.value == f"{PROGRAMS[program]}:main"
    assert callable(entry.load())


@pytest.mark.parametrize("unbuffered", ["", "1"])
@pytest.mark.parametrize("program", PROGRAMS)
def test_help_into_a_closed_pipe_shows_no_error(command, program, unbuffered):
    assert write_into_closed_pipe(command(program, "--help"), unbuffered) == ""


@pytest.mark.parametrize(("extra", "unbuffered"), [((), ""), (("--json",), "1")])
def test_results_into_a_closed_pipe_show_no_error(command, extra, unbuffered):
    arguments = ("--policy", "zero", "--task", "left", "--trials", 40, *extra)
    assert write_into_closed_pipe(command("kinarm-eval", *arguments), unbuffered) == ""


def write_into_closed_pipe(arguments: list[str], unbuffered: str) -> str:
    """Run a command whose reader has gone, and return what it says on standard error."""
    with subprocess.Popen(
        arguments,
        cwd=ROOT,
        env={**os.environ, "PYTHONUNBUFFERED": unbuffered},
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    ) as process:
        process.stdout.close()
        return process.stderr.read()


@pytest.mark.parametrize(
    "words",
    [
        *((program,) for program in PROGRAMS),
        *(("kinarm-train", learner) for learner in ("ars", "ppo")),
        *(("kinarm-problem", command) for command in ("list", "show", "check")),
        *(("kinarm-arms", command) for command in ("list", "show")),
        ("kinarm-study", "status"),
    ],
    ids=" ".join,
)
@pytest.mark.parametrize("width", [60, 80])
def test_help_fits_a_terminal(run, words, width, monkeypatch):
    monkeypatch.setenv("COLUMNS", str(width))
    answer = run(*words, "--help")
    assert answer.status == 0
    assert [line for line in answer.out.splitlines() if len(line) > width] == []


def test_a_long_example_goes_on_in_the_next_line(run, monkeypatch):
    monkeypatch.setenv("COLUMNS", "60")
    text = run("kinarm-train", "ars", "--help").out
    assert "  kinarm-train ars --recipe tuned --iterations 4000 \\\n    --out short.npz\n" in text


AS_A_COMMAND = """
import sys
sys.argv[0], sys.orig_argv = "-m", ["python", "-m", "kinarm"]
import kinarm
assert "gymnasium" not in sys.modules
import kinarm.{module}
import gymnasium
gymnasium.make("kinarm/ReachRight-v0").reset(seed=0)
"""


@pytest.mark.parametrize("module", ["envs", "evaluation.bench"])
def test_what_makes_environments_in_a_command_has_their_ids(module):
    pytest.importorskip("stable_baselines3")
    code = AS_A_COMMAND.format(module=module)
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
