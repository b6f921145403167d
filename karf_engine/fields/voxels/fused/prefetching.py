"""Asking memory for what is needed soon."""

from __future__ import annotations

import numba
from llvmlite import ir
from numba.extending import intrinsic


@intrinsic
def _prefetch(typing_context, array, index):
    del typing_context

    def generate(context, builder, signature, arguments):
        data = context.make_array(signature.args[0])(context, builder, arguments[0]).data
        address = builder.bitcast(builder.gep(data, [arguments[1]]), ir.IntType(8).as_pointer())
        number = ir.IntType(32)
        kind = ir.FunctionType(ir.VoidType(), [address.type, number, number, number])
        function = builder.module.declare_intrinsic("llvm.prefetch", [address.type], kind)
        builder.call(function, [address, number(0), number(3), number(1)])  # to read, into the nearest cache, data
        return context.get_dummy_value()

    return numba.types.none(array, index), generate


def _nothing(array, index):
    """In plain Python."""


# ask for an element that is needed soon, while others are computed with; no index is wrong, for nothing is read
prefetch = _nothing if numba.config.DISABLE_JIT else _prefetch
