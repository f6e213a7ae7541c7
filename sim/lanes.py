"""Four float32 numbers at once in a kernel: Numba makes such vectors of loops only, not of a road's lines.

A vector is a tuple of four numbers; the compiler keeps it in one register from `load` to `store`.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from llvmlite import ir
from numba import float32, types
from numba.extending import intrinsic

LANES = 4

_NUMBERS = types.UniTuple(float32, LANES)  # type: ignore[no-untyped-call]
_TUPLE = ir.ArrayType(ir.FloatType(), LANES)
_VECTOR = ir.VectorType(ir.FloatType(), LANES)
_ALIGNMENT = 4  # bytes: rows begin anywhere


def _lane(index: int) -> ir.Constant:
    return ir.Constant(ir.IntType(32), index)


def _pack(builder: Any, numbers: Any) -> Any:
    vector = ir.Constant(_VECTOR, ir.Undefined)
    for index in range(LANES):
        vector = builder.insert_element(vector, builder.extract_value(numbers, index), _lane(index))
    return vector


def _unpack(builder: Any, vector: Any) -> Any:
    numbers = ir.Constant(_TUPLE, ir.Undefined)
    for index in range(LANES):
        numbers = builder.insert_value(numbers, builder.extract_element(vector, _lane(index)), index)
    return numbers


def _place(context: Any, builder: Any, kind: Any, row: Any, at: Any) -> Any:
    array = context.make_array(kind)(context, builder, row)
    return builder.bitcast(builder.gep(array.data, [at]), _VECTOR.as_pointer())


def _load(_context: Any, row: Any, at: Any) -> Any:
    def build(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        place = _place(context, builder, signature.args[0], *arguments)
        return _unpack(builder, builder.load(place, align=_ALIGNMENT))

    return _NUMBERS(row, at), build


def _store(_context: Any, row: Any, at: Any, vector: Any) -> Any:
    def build(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        *where, numbers = arguments
        place = _place(context, builder, signature.args[0], *where)
        builder.store(_pack(builder, numbers), place, align=_ALIGNMENT)
        return context.get_dummy_value()

    return types.void(row, at, vector), build


def _operation(name: str) -> Callable[..., Any]:
    def typed(_context: Any, a: Any, b: Any) -> Any:
        def build(_context: Any, builder: Any, _signature: Any, arguments: Any) -> Any:
            return _unpack(builder, getattr(builder, name)(*(_pack(builder, each) for each in arguments)))

        return _NUMBERS(a, b), build

    return typed


# A kernel leaves out the context, which types cannot tell.
load: Any = intrinsic(_load)
"""`load(row, at)`: the four numbers of a contiguous row, (n,) float32, from index `at` on; unchecked."""
store: Any = intrinsic(_store)
"""`store(row, at, vector)`: set the four numbers of a row from index `at` on; unchecked."""
plus: Any = intrinsic(_operation("fadd"))
minus: Any = intrinsic(_operation("fsub"))
times: Any = intrinsic(_operation("fmul"))
