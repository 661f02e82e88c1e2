"""Do the tests notice a fault? One small change at a time is made to the code, and they run.

``python tests/mutants.py --out mutants.json`` changes a copy of this tree. A mutant is *killed* by
the tests of its area, or by the *golden* digests alone, or it *survived*. It is named by its
function and the text that it changes, not by its line: ``--again mutants.json`` makes the same
mutants of another state of the project, as far as their functions are there.
"""

import argparse
import ast
import copy
import json
import os
import random
import re
import resource
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

ROOT = Path(__file__).resolve().parents[1]
SOURCES = ("kinarm", "policies", "evaluation", "data", "tests", "pyproject.toml", "setup.cfg")


class Area(NamedTuple):
    """Code, the tests that are to notice faults in it (globs), and how many mutants to draw."""

    code: tuple[str, ...]
    tests: tuple[str, ...]
    count: int


ROLLOUTS = ("kinarm/test_reference.py", "kinarm/test_simulator.py", "kinarm/test_world.py")
MACHINERY = {"caching", "compiling", "records", "lanes"}
"""Modules of kernels that compile and lay out, and compute nothing."""
AREAS = {
    "simulator": Area(("kinarm/simulator.py",), ROLLOUTS, 10),
    "kernels": Area(
        ("kinarm/kernels/*.py",),
        (
            *("kinarm/kernels/test_*.py", *ROLLOUTS, "kinarm/test_col*.py", "kinarm/test_inv*.py"),
            *("kinarm/test_step_*.py", "kinarm/test_motion*.py", "kinarm/test_encl*.py"),
            *("kinarm/test_obs*.py", "kinarm/test_scenarios.py"),
        ),
        20,
    ),
    "statistics": Area(
        ("evaluation/statistics.py", "evaluation/estimates.py"),
        ("evaluation/test_statistics*.py", "evaluation/test_metrics.py"),
        10,
    ),
    "ars": Area(("policies/ars/algorithm.py",), ("policies/test_ars*.py",), 8),
    "oracle": Area(("policies/oracle/**/*.py",), ("policies/oracle/**/test_*.py",), 12),
}
GOLDEN = ("golden/test_golden.py",)

SWAPS = {
    ast.Add: ast.Sub,
    ast.Sub: ast.Add,
    ast.Mult: ast.Div,
    ast.Div: ast.Mult,
    ast.Lt: ast.GtE,
    ast.GtE: ast.Lt,
    ast.Gt: ast.LtE,
    ast.LtE: ast.Gt,
    ast.Eq: ast.NotEq,
    ast.NotEq: ast.Eq,
    ast.And: ast.Or,
    ast.Or: ast.And,
}
NAMES = {"min": "max", "max": "min", "sin": "cos", "cos": "sin", "argmin": "argmax"}


class Mutant(NamedTuple):
    """A change: the text of a function that is another, counted where it stands several times."""

    area: str
    function: str
    text: str
    occurrence: int
    replacement: str


def mutated(node: ast.AST) -> ast.AST | None:
    """Change an expression; None if it is of no kind that is changed."""
    other = copy.deepcopy(node)
    match other:
        case ast.BinOp(op=op) | ast.BoolOp(op=op) if type(op) in SWAPS:
            other.op = SWAPS[type(op)]()
        case ast.Compare(ops=[op]) if type(op) in SWAPS:
            other.ops = [SWAPS[type(op)]()]
        case ast.Constant(value=bool()):
            other.value = not other.value
        case ast.Constant(value=int() | float()):
            other.value = other.value + 1
        case ast.UnaryOp(op=ast.USub() | ast.Not(), operand=operand):
            return operand
        case ast.Call(func=ast.Name(id=name)) if name in NAMES:
            other.func.id = NAMES[name]
        case ast.Call(func=ast.Name(id="abs"), args=[argument]):
            return argument
        case _:
            return None
    return other


def expressions(node: ast.AST) -> Iterator[ast.AST]:
    """The expressions of a function's body that compute something, in the order of the source."""
    if isinstance(node, ast.Raise | ast.JoinedStr | ast.FunctionDef | ast.arg):
        return
    yield node
    for name, value in ast.iter_fields(node):
        for child in value if isinstance(value, list) else [value]:
            if isinstance(child, ast.AST) and name != "annotation":
                yield from expressions(child)


def mutants(tree: Path, area: str) -> Iterator[tuple[Mutant, Path, int]]:
    """All mutants of an area, each with its file and where it begins there [bytes]."""
    files = {path for pattern in AREAS[area].code for path in tree.glob(pattern)}
    for path in sorted(path for path in files if path.stem not in MACHINERY):
        source = path.read_bytes()
        starts = [0, *(found.end() for found in re.finditer(b"\n", source))]
        for function in ast.walk(ast.parse(source)):
            if not isinstance(function, ast.FunctionDef):
                continue
            seen: dict[str, int] = {}
            for node in [each for part in function.body for each in expressions(part)]:
                other = mutated(node)
                if other is None:
                    continue
                first = starts[node.lineno - 1] + node.col_offset
                text = source[first : starts[node.end_lineno - 1] + node.end_col_offset].decode()
                number = seen[text] = seen.get(text, -1) + 1
                name = (area, function.name, text, number, f"({ast.unparse(other)})")
                yield Mutant(*name), path, first


def run_tests(tree: Path, patterns: tuple[str, ...], cache: Path, limit: int) -> str:
    """Run tests until one fails; return which it was, or an empty text."""
    found = [path for each in patterns for path in sorted((tree / "tests").glob(each))]
    files = [str(path.relative_to(tree)) for path in dict.fromkeys(found)]
    options = ["-xq", "-p", "no:cacheprovider", "-m", "not slow and not rare"]
    done = subprocess.run(
        [sys.executable, "-m", "pytest", *options, *files],
        cwd=tree,
        env={**os.environ, "NUMBA_CACHE_DIR": str(cache), "PYTHONDONTWRITEBYTECODE": "1"},
        capture_output=True,
        text=True,
        preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_CPU, (limit, limit)),
    )
    if done.returncode < 0:
        return f"signal {-done.returncode}"
    named = re.search(r"^(?:FAILED|ERROR) (\S+)", done.stdout, re.MULTILINE)
    return (named.group(1) if named else "no test ran") if done.returncode else ""


def verdict(tree: Path, mutant: Mutant, cache: Path, limit: int) -> dict[str, object]:
    """Make a mutant, let the tests look at it, and take it back."""
    places = {each: (path, first) for each, path, first in mutants(tree, mutant.area)}
    if mutant not in places:
        return {"state": "not found"}
    path, first = places[mutant]
    source = path.read_bytes()
    end = first + len(mutant.text.encode())
    path.write_bytes(source[:first] + mutant.replacement.encode() + source[end:])
    state, by = "killed", ""
    try:  # no kernel comes from a cache that another file's change does not touch
        with tempfile.TemporaryDirectory() as cold:
            used = Path(cold) if "kernels" in path.as_posix() else cache
            if not (by := run_tests(tree, AREAS[mutant.area].tests, used, limit)):
                by = run_tests(tree, GOLDEN, used, limit)
                state = "golden" if by else "survived"
    finally:
        path.write_bytes(source)
    return {"state": state, "by": by, "file": str(path.relative_to(tree))}


def main() -> None:
    """Draw mutants, or read them; write down what became of each."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--out", type=Path, required=True, metavar="FILE", help="where to record")
    parser.add_argument("--again", type=Path, metavar="FILE", help="mutants of an earlier record")
    parser.add_argument("--area", choices=tuple(AREAS), action="append", help="only this area")
    parser.add_argument("--tree", type=Path, default=ROOT, help="the project (this one)")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--limit", type=int, default=400, help="processor seconds a mutant (400)")
    given = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        tree, cache = Path(folder) / "tree", Path(folder) / "cache"
        for name in SOURCES:
            copier = shutil.copytree if (given.tree / name).is_dir() else shutil.copy2
            (tree / name).parent.mkdir(exist_ok=True)
            copier(given.tree / name, tree / name)
        if given.again:
            known = json.loads(given.again.read_text())
            drawn = [Mutant(*(each[name] for name in Mutant._fields)) for each in known]
        else:
            drawn = []
            for area in AREAS:
                found = sorted(each for each, _, _ in mutants(tree, area))
                drawn += random.Random(f"{given.seed} {area}").sample(found, AREAS[area].count)
        areas = given.area or list(AREAS)
        for area in areas:
            if by := run_tests(tree, AREAS[area].tests + GOLDEN, cache, 4 * given.limit):
                raise SystemExit(f"{area}: fails without any mutant: {by}")
        done: list[dict[str, object]] = []
        for mutant in (each for each in drawn if each.area in areas):
            done.append({**mutant._asdict(), **verdict(tree, mutant, cache, given.limit)})
            given.out.write_text(json.dumps(done, indent=1) + "\n")
            sys.stderr.write(" ".join(f"{value}" for value in done[-1].values()) + "\n")
    for area in areas:
        states = [each["state"] for each in done if each["area"] == area]
        sys.stdout.write(f"{area}: {len(states)}")
        sys.stdout.write("".join(f", {s} {states.count(s)}" for s in sorted(set(states))) + "\n")


if __name__ == "__main__":
    main()
