"""What is counted: fixed work of the simulator, in marked sections.

Run by `count` under Valgrind. Each section runs twice and the second run is counted, when
everything is compiled and allocated.
"""

import ctypes
import mmap
import sys
from collections.abc import Callable

import numpy as np

from kinarm.envs import ReachVectorEnv
from kinarm.policies.library import load_policy
from kinarm.policies.oracle import Oracle
from kinarm.problem import PROBLEMS
from kinarm.simulator import Simulator

REQUEST = bytes.fromhex(
    "4889f8 31d2"  # rax: where the request is; rdx: what it returns without Valgrind
    "48c1c703 48c1c70d 48c1c73d 48c1c733 4887db"  # Valgrind's mark, which does nothing
    "4889d0 c3"
)
"""Machine code of x86-64 that hands Valgrind a request (see its manual, client requests)."""
CALLGRIND = ord("C") << 24 | ord("T") << 16
ZERO, DUMP_AT, START, STOP = (CALLGRIND + number for number in (1, 3, 4, 5))


def make_requests() -> Callable[[int, bytes], None]:
    """Put the code where the processor may run it."""
    access = mmap.PROT_READ | mmap.PROT_WRITE | mmap.PROT_EXEC
    page = mmap.mmap(-1, mmap.PAGESIZE, flags=mmap.MAP_PRIVATE, prot=access)
    page.write(REQUEST)
    code = ctypes.c_char.from_buffer(page)
    call = ctypes.CFUNCTYPE(ctypes.c_uint64, ctypes.c_void_p)(ctypes.addressof(code))

    def request(number: int, text: bytes = b"", _code: object = code) -> None:
        argument = ctypes.create_string_buffer(text)
        words = (ctypes.c_uint64 * 6)(number, ctypes.addressof(argument))
        call(ctypes.addressof(words))

    return request


def sections() -> dict[str, Callable[[], object]]:
    """Work by name."""
    policy = load_policy("ars-tuned-both-seed0")
    problem = PROBLEMS["right"].replace(tested_configurations=4)
    simulator = Simulator(problem, threads=1)
    scenarios = simulator.sample(np.random.default_rng(0), 256)
    env = ReachVectorEnv(64, problem, threads=1)
    env.reset(seed=0)
    actions = np.random.default_rng(0).uniform(-1, 1, (32, 64, simulator.n_actions))
    oracle = Oracle(problem, threads=1)
    trials = simulator.sample(np.random.default_rng(3), 4)

    def step() -> None:
        for action in actions:
            env.step(action)

    return {
        "rollouts of a linear policy": lambda: simulator.rollout(policy, *scenarios),
        "batch environment": step,
        "bounds of the oracle": lambda: oracle.solve_batch(*trials),
    }


def main() -> None:
    """Run every section, and mark the second run."""
    request = make_requests()
    for name, work in sections().items():
        work()
        if "--warm" in sys.argv:
            continue
        request(START)
        request(ZERO)
        work()
        request(DUMP_AT, name.encode())
        request(STOP)


if __name__ == "__main__":
    main()
