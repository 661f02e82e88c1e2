"""Scripts with which shells complete the commands."""

import shutil
import subprocess
from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal

import pytest

pytest.importorskip("shtab")

from kinarm._options import add_options
from kinarm._parser import SHELLS, CommandParser, Parser, completion_script
from kinarm.evaluation.replay.request import ReplayRequest


@dataclass(frozen=True, kw_only=True)
class Baking:
    """Bake something.

    Parameters
    ----------
    bread : str
        Which one.
    shape : {"loaf", "roll"}
        Its form.
    out : Path
        Where it goes.
    """

    bread: str = field(default="rye", metadata={"names": lambda: ("rye", "it's spelt")})
    shape: Literal["loaf", "roll"] = "loaf"
    out: Path | None = field(default=None, metadata={"metavar": "FOLDER"})


def script(shell, kind=Baking):
    parser = Parser(prog="bake")
    add_options(parser, kind)
    return completion_script(parser, shell)


@pytest.mark.parametrize("shell", SHELLS)
def test_options_and_names_are_in_every_script(shell):
    text = script(shell)
    for word in ("bread", "shape", "loaf", "rye", "print-completion"):
        assert word in text


@pytest.mark.parametrize("shell", SHELLS)
def test_options_of_commands_are_completed(shell):
    """What an option is for is told to its first detail, by shells that show it."""
    parser = Parser(prog="bake")
    parser.add_argument("--quiet", action="store_true")
    inner = parser.add_subparsers(parser_class=CommandParser).add_parser("bread", help="Bread.")
    add_options(inner, Baking)
    text = completion_script(parser, shell)
    for word in ("quiet", "bread", "shape", "loaf", "rye"):
        assert word in text
    assert ("Where it goes" in text) is (shell != "bash")


@pytest.mark.parametrize("shell", SHELLS)
@pytest.mark.parametrize("kind", [Baking, ReplayRequest])
def test_shells_accept_their_scripts(shell, kind, tmp_path):
    if shutil.which(shell) is None:
        pytest.skip(f"{shell} is not installed")
    (tmp_path / "script").write_text(script(shell, kind))
    done = subprocess.run([shell, "-n", tmp_path / "script"], capture_output=True, check=False)
    assert (done.returncode, done.stderr) == (0, b"")


def completed(tmp_path, *words):
    """What bash offers after some words."""
    (tmp_path / "script").write_text(script("bash"))
    (tmp_path / "folder").mkdir(exist_ok=True)
    (tmp_path / "file").touch()
    ask = f"""
    source ./script
    COMP_WORDS=({" ".join(words)} "") COMP_CWORD={len(words)}
    function_name=$(complete -p bake | sed 's/.*-F \\([^ ]*\\).*/\\1/')
    $function_name bake "" "{words[-1]}"
    printf '%s\\n' "${{COMPREPLY[@]}}"
    """
    done = subprocess.run(
        ["bash", "-c", ask], capture_output=True, text=True, check=True, cwd=tmp_path
    )
    return set(done.stdout.split("\n")) - {""}


def test_bash_completes_names_files_and_choices(tmp_path):
    assert completed(tmp_path, "bake", "--shape") == {"loaf", "roll"}
    assert {"rye", "file"} <= completed(tmp_path, "bake", "--bread")
    found = {word.rstrip("/") for word in completed(tmp_path, "bake", "--out")}
    assert "folder" in found
    assert "file" not in found


def test_printing_it_is_all_that_a_command_does(capsys):
    parser = Parser(prog="bake")
    with pytest.raises(SystemExit) as stopped:
        parser.parse_args(["--print-completion", "bash"])
    assert not stopped.value.code
    assert "complete -o" in capsys.readouterr().out
