"""Prefetch instruction for kernels."""

from __future__ import annotations

from typing import Any

import numba
from llvmlite import ir
from numba.extending import intrinsic


@intrinsic  # pyright: ignore[reportArgumentType]
def _prefetch(typing_context: Any, array: Any, index: Any) -> Any:
    del typing_context

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        data = context.make_array(signature.args[0])(context, builder, arguments[0]).data
        address = builder.bitcast(builder.gep(data, [arguments[1]]), ir.IntType(8).as_pointer())
        number = ir.IntType(32)
        kind = ir.FunctionType(ir.VoidType(), [address.type, number, number, number])
        function = builder.module.declare_intrinsic("llvm.prefetch", [address.type], kind)
        builder.call(function, [address, number(0), number(3), number(1)])  # read, highest locality, data cache
        return context.get_dummy_value()

    return numba.types.none(array, index), generate


def _no_operation(array: Any, index: Any) -> None:
    """Replace the instruction in plain Python."""


# prefetch(array, index) loads an element into the cache; any index is valid
prefetch: Any = _no_operation if numba.config.DISABLE_JIT else _prefetch  # pyright: ignore
