"""Operations are counted as often as they are carried out, and for each lane."""

import math
import subprocess
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from llvmlite import ir
from numba import njit

from kinarm.evaluation.measurements import operations
from kinarm.evaluation.measurements.counting import OperationCounter, source_name
from kinarm.kernels.lanes import LANES, as_lanes
from kinarm.kernels.network import affine_layer


def counted(function, *arguments):
    """Operations of each kind in a call of a function, which is compiled anew."""
    counter = OperationCounter()
    with counter.active():
        compiled = njit(error_model="numpy")(function)
        compiled(*arguments)
    counter.reset()
    compiled(*arguments)
    found = {}
    for counts in counter.by_function().values():
        for kind, count in counts.items():
            found[kind] = found.get(kind, 0) + count
    return {kind: count for kind, count in found.items() if count}


def horner(x, n):
    value = 0.0
    for _ in range(n):
        value = value * x + 1.0
    return value


@pytest.mark.parametrize("n", [0, 3, 100])
def test_loops_count_as_often_as_they_run(n):
    found = counted(horner, 0.5, n)
    assert found == ({"sums": n, "products": n} if n else {})


def test_branches_count_if_they_are_taken():
    def root_or_square(x):
        return math.sqrt(x) if x > 1.0 else x * x

    assert counted(root_or_square, 4.0) == {"comparisons": 1, "roots": 1}
    assert counted(root_or_square, 0.5) == {"comparisons": 1, "products": 1}


def test_lanes_count_one_for_each():
    def scale(space):
        values = as_lanes(space)
        values[0] = values[0] * values[1] + 1.0

    assert counted(scale, np.zeros((2, LANES))) == {"sums": LANES, "products": LANES}


def test_single_precision_does_not_count():
    assert counted(lambda x: x * x, np.float32(3)) == {}
    assert counted(lambda x: x * x, 3.0) == {"products": 1}


def test_layer_takes_a_product_and_a_sum_for_each_weight():
    weights, inputs, outputs = np.zeros(49 * 5), np.zeros((1, 48)), np.zeros((1, 5))
    found = counted(affine_layer.py_func, weights, 0, 48, 5, inputs, 0, outputs, 0)
    assert found == {"sums": 48 * 5, "products": 48 * 5}


def test_nothing_is_counted_afterwards():
    before = {name: getattr(ir.IRBuilder, name) for name in ("fadd", "fcmp_ordered", "call")}
    with OperationCounter().active():
        assert ir.IRBuilder.fadd is not before["fadd"]
    assert {name: getattr(ir.IRBuilder, name) for name in before} == before


def test_names_are_those_of_the_source():
    assert (
        source_name("_ZN6kinarm7kernels7network3actB3v64B52c8tJT") == "kinarm.kernels.network.act"
    )
    assert source_name("main") == "main"


def test_operations_are_those_that_a_process_of_its_own_prints(monkeypatch):
    """It compiles anew: an earlier kernel, from Numba's cache, would not count."""
    seen = []

    def run(command, *, env, **_):
        seen.append((command, list(Path(env["NUMBA_CACHE_DIR"]).iterdir())))
        return SimpleNamespace(stdout='{"total": 3.5}')

    monkeypatch.setattr(subprocess, "run", run)
    assert operations.measure_operations("mine.npz") == {"total": 3.5}
    ((command, cached),) = seen
    assert command[-3:] == ["-m", operations.__name__, "mine.npz"]
    assert cached == []


@pytest.mark.slow
def test_step_is_counted_in_a_process_of_its_own():
    found = operations.measure_operations("ars-tuned-both-seed0")
    functions = found["functions"]
    assert found["total"] == pytest.approx(sum(functions.values()))
    assert found["total"] == pytest.approx(sum(found["kinds"].values()))
    # The policy: five sums of 48 products, in lanes that are not all busy to the end.
    policy = functions["kinarm.kernels.network.affine_layer"]
    assert 480 <= policy < 1.1 * 480
