"""How kernels are compiled: without the GIL and without reordering of floating-point operations.

Numba makes machine code of every function, though helpers reach kernels as LLVM
code and are optimised there again. Here helpers are only simplified before they
are linked. Only this module, `records` and `lanes` use Numba's internals.

Numba trusts cached machine code as long as a kernel's own file is unchanged. Here the key is a hash
of all files whose helpers and constants are compiled in.
"""

import gc
import hashlib
import os
import sys
from collections.abc import Callable
from contextlib import suppress
from functools import cache, cached_property
from pathlib import Path
from typing import Any, TypeVar, cast

import llvmlite
import numpy as np
from llvmlite.binding import create_pass_builder, create_pipeline_tuning_options
from numba import njit, types
from numba.core import ir
from numba.core.caching import FunctionCache, IndexDataCacheFile
from numba.core.codegen import JITCodeLibrary
from numba.core.compiler import Compiler
from numba.core.compiler_machinery import FunctionPass, register_pass
from numba.core.ir_utils import get_definition, guard
from numba.core.typed_passes import InlineOverloads, NopythonRewrites
from numba.core.untyped_passes import GenericRewrites, InlineClosureLikes
from numpy.typing import NDArray

from kinarm._console import COMPILING, say_why_it_waits
from kinarm.kernels.lanes import instruction
from kinarm.kernels.records import RecordType

Array = NDArray[np.float64]
Vector = tuple[float, float, float]

Function = TypeVar("Function", bound=Callable[..., Any])


def kernel(function: Function) -> Function:
    """Compile a function for Python, into the disk cache if possible."""
    return _called_by_python(function)


def lean_kernel(function: Function) -> Function:
    """Compile such a function that works in lanes and allocates nothing."""
    return _called_by_python(function, _nrt=False, pipeline_class=LaneCompiler)


def _called_by_python(function: Function, **more: Any) -> Function:
    options: dict[str, Any] = {
        "nogil": True,
        "error_model": "numpy",
        "no_cfunc_wrapper": True,
        "pipeline_class": KernelCompiler,
    } | more
    compiled: Any = njit(**options)(function)
    with suppress(RuntimeError):  # of Numba, if there is no folder that it can write to
        compiled._cache = KernelCache(function)
    return cast("Function", compiled)


class Stage:
    """A part of kernels that they call by its address (`call_stage`), compiled if a session has it.

    What a session lacks is not compiled, and what it does in its own way is compiled alone.

    Parameters
    ----------
    function : callable
        It works in lanes, takes a session first, and returns a whole number.
    more : Numba's types
        Of its other arguments.
    key : str
        Tells functions apart that one definition makes.
    """

    def __init__(self, function: Callable[..., int], *more: Any, key: str = "") -> None:
        if key:
            # Machine code is found by this name, in files and in memory.
            function.__qualname__ += f".{hashlib.sha256(key.encode()).hexdigest()[:16]}"
        self._compiled: Any = lean_kernel(function)
        self._more, self._addresses = more, dict[Any, int]()

    def address(self, session: Any) -> int:
        """Address of the machine code for a type of sessions."""
        if session not in self._addresses:
            arguments = (session, *self._more)
            self._compiled.compile(arguments)
            code = self._compiled.overloads[arguments]
            name = code.fndesc.llvm_func_name
            self._addresses[session] = code.library.get_pointer_to_function(name)
        return self._addresses[session]


@instruction
def call_stage(_: Any, address: types.Integer, given: Any) -> Any:
    """Call the `Stage` at an address, and return its result."""
    kinds = [types.unliteral(kind) for kind in given]

    def code(context: Any, builder: Any, _signature: Any, arguments: Any) -> Any:
        convention = context.call_conv
        form = convention.get_function_type(types.int64, kinds)
        stage = builder.inttoptr(arguments[0], form.as_pointer())
        values = [builder.extract_value(arguments[1], place) for place in range(len(kinds))]
        _, result = convention.call_function(builder, stage, types.int64, kinds, values)
        return result

    return types.int64(address, types.Tuple(kinds)), code


def inlined(function: Function) -> Function:
    """Compile a helper that allocates nothing, without reference counts."""
    return _linked(function, forceinline=True, _nrt=False)


def helper(function: Function) -> Function:
    """Compile a long helper that allocates nothing, to be called."""
    return _linked(function, forceinline=False, _nrt=False)


def _linked(function: Function, **more: Any) -> Function:
    """Compile what only kernels call; calls from Python would crash."""
    options: dict[str, Any] = {
        "error_model": "numpy",
        "no_cpython_wrapper": True,
        "no_cfunc_wrapper": True,
        "pipeline_class": HelperCompiler,
    }
    dispatcher: Any = njit(**options, **more)(function)
    find = dispatcher.get_call_template

    def get_call_template(arguments: list[Any], keywords: dict[str, Any]) -> Any:
        # Numba by itself compiles a helper anew for each literal.
        named = {name: types.unliteral(kind) for name, kind in keywords.items()}
        return find([types.unliteral(kind) for kind in arguments], named)

    dispatcher.get_call_template = get_call_template
    return cast("Function", dispatcher)


class LinkedLibrary(JITCodeLibrary):
    """Code to be linked into kernels, without machine code of its own."""

    @property
    def codegen(self) -> "LinkedLibrary":
        """The library itself, to be told the function's environment."""
        return self

    def set_env(self, name: str, environment: object) -> None:
        """Ignore the environment: helpers have no Python objects."""

    def finalize(self) -> None:
        """Link in called functions; kernels optimise and make machine code."""
        for library in dict.fromkeys(self._linking_libraries):
            self._final_module.link_in(library._get_module_for_linking(), preserve=True)
        self._final_module.verify()
        self._finalized = True

    def get_pointer_to_function(self, _: str) -> int:
        """Finalize; there is no machine code."""
        self._ensure_finalized()
        return 0


class LaneLibrary(JITCodeLibrary):
    """Code in lanes, whose loops LLVM need not turn into vectors."""

    def _optimize_final_module(self) -> None:
        tuning = create_pipeline_tuning_options(speed_level=3)
        tuning.loop_vectorization = False
        builder = create_pass_builder(self._codegen._tm, tuning)
        builder.getModulePassManager().run(self._final_module, builder)


@register_pass(mutates_CFG=True, analysis_only=False)
class FixedLengths(FunctionPass):
    """Writes fixed lengths as constants, before Numba removes branches on constants."""

    _name = "fixed_lengths"

    def __init__(self) -> None:
        FunctionPass.__init__(self)

    def run_pass(self, state: Any) -> bool:
        """Replace what is known of a function's variables before their types are."""
        changed = False
        for block in state.func_ir.blocks.values():
            for statement in block.find_insts(ir.Assign):
                read = statement.value
                if isinstance(read, ir.Expr) and read.op == "static_getitem":
                    length = _known(read, state)
                    if isinstance(length, int):
                        statement.value = ir.Const(length, statement.loc)
                        state.func_ir._definitions[statement.target.name] = [statement.value]
                        changed = True
        return changed


def _known(value: Any, state: Any) -> Any:
    """What the types of arguments tell of a value before all others are inferred.

    Of a record that is its type, and of one of its arrays the attribute ``shape``, with None for
    lengths that are not fixed.
    """
    if isinstance(value, ir.Var):
        value = guard(get_definition, state.func_ir, value)
    if isinstance(value, ir.Arg):
        return state.args[value.index]
    operation = getattr(value, "op", "")
    if operation == "build_tuple":
        return tuple(_known(item, state) for item in value.items)
    if operation not in ("getattr", "exhaust_iter", "static_getitem"):
        return None
    whole = _known(value.value, state)
    if operation == "getattr":
        if isinstance(whole, RecordType):
            kind = whole.fields.get(value.attr)
            return kind if isinstance(kind, RecordType) else {"shape": whole.fixed.get(value.attr)}
        return whole.get(value.attr) if isinstance(whole, dict) else None
    if not isinstance(whole, tuple):
        return None
    return whole if operation == "exhaust_iter" else whole[value.index]


SUPERFLUOUS = InlineClosureLikes, InlineOverloads, NopythonRewrites
"""Passes of Numba for what kernels lack: closures, and expressions of arrays."""


class KernelCompiler(Compiler):
    """Numba's compiler without garbage collection, which finds next to nothing there."""

    library: type[JITCodeLibrary] = JITCodeLibrary

    def define_pipelines(self) -> list[Any]:
        """List Numba's passes and `FixedLengths`, without those that are superfluous."""
        pipelines: list[Any] = super().define_pipelines()
        for passes in pipelines:
            passes.add_pass_after(FixedLengths, GenericRewrites)
            passes.passes = [each for each in passes.passes if each[0] not in SUPERFLUOUS]
            passes.finalize()
        return pipelines

    def compile_extra(self, func: Callable[..., Any]) -> Any:
        """Compile a function and its helpers."""
        self.state.library = self.library(self.state.targetctx.codegen(), func.__qualname__)
        self.state.library.enable_object_caching()
        say_why_it_waits(COMPILING)
        collects = gc.isenabled()
        gc.disable()
        try:
            return super().compile_extra(func)
        finally:
            if collects:
                gc.enable()


class LaneCompiler(KernelCompiler):
    """Compiles a kernel into a `LaneLibrary`."""

    library = LaneLibrary


class HelperCompiler(KernelCompiler):
    """Compiles a helper into a `LinkedLibrary`."""

    library = LinkedLibrary


class KernelCache(FunctionCache):
    """A kernel's machine code on disk; what cannot be read costs only time.

    Processes with the same sources and versions of Numba and llvmlite share it; with the variable
    ``NUMBA_CACHE_DIR`` also those of other installations.
    """

    def _index_key(self, sig: Any, codegen: Any) -> Any:
        # The sources stand for what a function closes over.
        return sig, codegen.magic_tuple()

    def load_overload(self, sig: Any, target_context: Any) -> Any:
        """Look machine code up; None if it is missing or damaged."""
        try:
            self._cache_file = self._file
            return super().load_overload(sig, target_context)
        except Exception:  # a damaged file can raise anything
            with suppress(Exception):
                self.flush()
            return None

    def save_overload(self, sig: Any, data: Any) -> None:
        """Keep machine code if possible."""
        with suppress(OSError):
            super().save_overload(sig, data)

    @cached_property
    def _file(self) -> IndexDataCacheFile:
        # The kernel's module is complete by now.
        key, folder = compiled_in(self._py_func.__module__), Path(self._cache_path)
        if shared := os.environ.get("NUMBA_CACHE_DIR"):
            folder = Path(shared, f"kinarm-{key[:16]}")
        elif folder.name == "__pycache__":
            # Beside the source, to which modules of an editable install are links.
            folder = Path(self._py_func.__code__.co_filename).resolve().parent / folder.name
        folder.mkdir(parents=True, exist_ok=True)
        return IndexDataCacheFile(str(folder), self._impl.filename_base, key)


@cache
def compiled_in(module: str) -> str:
    """Hash of what the kernels of a module are made of.

    It covers the sources of the module, of all whose helpers it takes, directly or not, and of
    those that compile them; from others, numbers and fields of named tuples.
    """
    parts: dict[str, object] = {"llvmlite": llvmlite.__version__}
    _collect(module, parts)
    return hashlib.sha256(repr(sorted(parts.items())).encode()).hexdigest()


def _collect(module: str, parts: dict[str, object]) -> None:
    """Add what kernels of a module are made of."""
    source = Path(sys.modules[module].__file__ or "").read_bytes()
    parts[module] = hashlib.sha256(source).hexdigest()
    for name, value in vars(sys.modules[module]).items():
        home = getattr(value, "__module__", None) or ""
        if isinstance(value, int | float | np.generic):
            parts[f"{module}.{name}"] = repr(value)
        elif hasattr(value, "_fields"):
            parts[f"{home}.{name}"] = value._fields
        if home not in parts and (".kernels" in home or hasattr(value, "py_func")):
            _collect(home, parts)
