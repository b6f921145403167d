"""How the kernels are compiled, and where their machine code is kept."""

from __future__ import annotations

import os
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeVar

import numba
from llvmlite import ir
from numba.extending import intrinsic

Kernel = TypeVar("Kernel", bound=Callable[..., Any])
# all liberties but those that let NaN and infinity vanish: training must see them and stop
MATH = {"contract", "reassoc", "nsz", "arcp", "afn"}


def cache_folder() -> Path:
    """Where compiled kernels are kept: the user's own cache, for the package may lie where nothing can be written."""
    if "NUMBA_CACHE_DIR" in os.environ:
        return Path(os.environ["NUMBA_CACHE_DIR"])
    if sys.platform == "win32":
        base = Path(os.environ.get("LOCALAPPDATA", Path.home() / "AppData" / "Local"))
    elif sys.platform == "darwin":
        base = Path.home() / "Library" / "Caches"
    else:
        base = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache")
    return base / "karf" / "kernels"


def kernel(function: Kernel) -> Kernel:
    """A function of numbers and arrays, compiled when it is first called and kept for other processes.

    It makes no arrays, so that none are counted: counting costs as much as a small function does.
    """
    return _compiled(function, MATH, False)


def making_kernel(function: Kernel) -> Kernel:
    """A kernel that makes arrays to work in."""
    return _compiled(function, MATH, True)


def literal_kernel(function: Kernel) -> Kernel:
    """A kernel whose operations are rounded one by one, as they are written: two forms of one sum give the same bits."""
    return _compiled(function, False, False)


def _compiled(function: Kernel, math: set[str] | bool, makes_arrays: bool) -> Kernel:
    numba.config.CACHE_DIR = str(cache_folder())
    return numba.njit(function, fastmath=math, error_model="numpy", nogil=True, cache=True, _nrt=makes_arrays)


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
