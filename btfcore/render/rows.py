"""Weighted sums of rows of a table, in vector registers: the inner loop of BTF rendering.

LLVM turns the plain loop over sixteen rows and one destination into vector code only after
testing at run time that none of them overlap, which it refuses for so many. Written in its own
language the sum stays in registers and runs at the speed of the first cache: 56 ns for sixteen
rows of 128 floats against 96 ns for the best plain loop.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.extending import intrinsic
from numpy.typing import NDArray

from btfcore.types import F4

LANES = 8  # floats that are handled at once; every row is a multiple of it
_LINE = 64  # bytes of a line of the cache


def padded(count: int) -> int:
    """Smallest multiple of `LANES` that is at least `count`."""
    return -(-count // LANES) * LANES


def aligned(shape: tuple[int, ...]) -> F4:
    """Zeros (f4) that begin with a line of the cache, so that no load straddles two."""
    count = int(np.prod(shape))
    raw = np.zeros(count + _LINE // 4, np.float32)
    skip = (-raw.ctypes.data % _LINE) // 4
    return raw[skip : skip + count].reshape(shape)


def locked(array: NDArray[Any]) -> NDArray[Any]:
    """Read-only view: kernels are compiled anew for arrays that may be written, so none may."""
    view = array.view()
    view.flags.writeable = False
    return view


def _blend(
    typing: Any, table: Any, starts: Any, shares: Any, out: Any, begin: Any, width: Any
) -> tuple[Any, Any]:
    """out[begin + j] = Σ_i shares[i] · table[starts[i] + j] for j = 0 … width - 1.

    For use inside kernels. table, out : f4, one-dimensional and contiguous; starts : tuple of
    i8, shares : tuple of as many f4; begin, width : i8, width a multiple of `LANES`. Nothing is
    checked; products and sums are fused where the processor can, always in the same order.
    """
    return types.void(table, starts, shares, out, begin, width), _sum_of_rows(adding=False)


def _blend_more(
    typing: Any, table: Any, starts: Any, shares: Any, out: Any, begin: Any, width: Any
) -> tuple[Any, Any]:
    """As `blend`, added to what `out` holds."""
    return types.void(table, starts, shares, out, begin, width), _sum_of_rows(adding=True)


def _sum_of_rows(*, adding: bool) -> Any:
    def emit(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        wide = ir.VectorType(ir.FloatType(), LANES)
        word = ir.IntType(32)
        nothing = ir.Constant(wide, ir.Undefined)
        everywhere = ir.Constant(ir.VectorType(word, LANES), [0] * LANES)
        source = context.make_array(sig.args[0])(context, builder, args[0]).data
        target = context.make_array(sig.args[3])(context, builder, args[3]).data
        rows, factors = [], []
        for i in range(sig.args[1].count):
            rows.append(builder.gep(source, [builder.extract_value(args[1], i)]))
            share = builder.extract_value(args[2], i)
            single = builder.insert_element(nothing, share, ir.Constant(word, 0))
            factors.append(builder.shuffle_vector(single, nothing, everywhere))
        first = builder.gep(target, [args[4]])
        kind = args[5].type
        zero, step = ir.Constant(kind, 0), ir.Constant(kind, LANES)
        with cgutils.for_range_slice(builder, zero, args[5], step, kind) as (place, _):
            pointer = builder.bitcast(builder.gep(first, [place]), wide.as_pointer())
            total = builder.load(pointer, align=4) if adding else None
            for row, factor in zip(rows, factors, strict=True):
                here = builder.bitcast(builder.gep(row, [place]), wide.as_pointer())
                value = builder.load(here, align=4)
                part = builder.fmul(factor, value, flags=("contract",))
                total = part if total is None else builder.fadd(total, part, flags=("contract",))
            builder.store(total, pointer, align=4)
        return context.get_dummy_value()

    return emit


def _dot(typing: Any, one: Any, first: Any, two: Any, second: Any, width: Any) -> tuple[Any, Any]:
    """Σ_j one[first + j] · two[second + j] for j = 0 … width - 1, f4; as `blend` otherwise."""
    signature = types.float32(one, first, two, second, width)

    def emit(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        wide = ir.VectorType(ir.FloatType(), LANES)
        word = ir.IntType(32)
        arrays = [context.make_array(sig.args[k])(context, builder, args[k]).data for k in (0, 2)]
        rows = [builder.gep(array, [args[k]]) for array, k in zip(arrays, (1, 3), strict=True)]
        kind = args[4].type
        total = cgutils.alloca_once_value(builder, ir.Constant(wide, [0.0] * LANES))
        zero, step = ir.Constant(kind, 0), ir.Constant(kind, LANES)
        with cgutils.for_range_slice(builder, zero, args[4], step, kind) as (place, _):
            pointers = [builder.bitcast(builder.gep(r, [place]), wide.as_pointer()) for r in rows]
            value, other = (builder.load(pointer, align=4) for pointer in pointers)
            part = builder.fmul(value, other, flags=("contract",))
            builder.store(builder.fadd(builder.load(total), part, flags=("contract",)), total)
        rest = builder.load(total)
        half = LANES // 2
        while half:  # fold the upper half onto the lower one
            order = [(k + half) % LANES for k in range(LANES)]
            mask = ir.Constant(ir.VectorType(word, LANES), order)
            rest = builder.fadd(rest, builder.shuffle_vector(rest, rest, mask))
            half //= 2
        return builder.extract_element(rest, ir.Constant(word, 0))

    return signature, emit


blend: Any = intrinsic(_blend)
blend_more: Any = intrinsic(_blend_more)
dot: Any = intrinsic(_dot)


def blend_plain(table: F4, starts: NDArray[Any], shares: F4, width: int) -> F4:
    """Twin of `blend` in plain numpy: the sum (width,) f4."""
    columns = np.asarray(starts)[:, None] + np.arange(width)
    total = (np.asarray(shares, np.float64)[:, None] * table[columns]).sum(axis=0)
    return total.astype(np.float32)
