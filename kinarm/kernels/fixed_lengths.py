"""A pass of Numba: branches that fixed lengths of records rule out are not compiled at all."""

from typing import Any

from numba.core import ir
from numba.core.compiler_machinery import FunctionPass, register_pass
from numba.core.ir_utils import get_definition, guard

from kinarm.kernels.records import RecordType


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
