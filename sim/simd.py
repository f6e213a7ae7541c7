"""Four numbers at once in a kernel: the three lines of the road, the wheels of a car.

Numba makes vectors of loops only. Here a vector is a tuple of four numbers of one kind, float32 or float64,
which the compiler keeps in registers from `load` to `store`. One number stands for four of it. As with single
numbers, the compiler joins a product that is used once with the sum it is used in and rounds them once;
`fma` says so outright.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.core.cpu import CPUContext
from numba.extending import intrinsic

LANES = 4


def _lane(index: int) -> ir.Constant:
    return ir.Constant(ir.IntType(32), index)


def _tuple(kind: Any) -> Any:
    return types.UniTuple(kind, LANES)  # type: ignore[no-untyped-call]


def _pack(builder: Any, value: Any) -> Any:
    many = isinstance(value.type, ir.ArrayType)
    vector = ir.Constant(ir.VectorType(value.type.element if many else value.type, LANES), ir.Undefined)
    for index in range(LANES):
        number = builder.extract_value(value, index) if many else value
        vector = builder.insert_element(vector, number, _lane(index))
    return vector


def _unpack(builder: Any, vector: Any) -> Any:
    numbers = ir.Constant(ir.ArrayType(vector.type.element, LANES), ir.Undefined)
    for index in range(LANES):
        numbers = builder.insert_value(numbers, builder.extract_element(vector, _lane(index)), index)
    return numbers


def _place(context: Any, builder: Any, kind: Any, row: Any, at: Any) -> tuple[Any, int]:
    """Where a row's numbers from an index on are, and how many bytes one has: rows begin anywhere."""
    array = context.make_array(kind)(context, builder, row)
    number = context.get_data_type(kind.dtype)
    place = builder.bitcast(builder.gep(array.data, [at]), ir.VectorType(number, LANES).as_pointer())
    return place, kind.dtype.bitwidth // 8


def _load(_context: Any, row: Any, at: Any) -> Any:
    def build(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        place, size = _place(context, builder, signature.args[0], *arguments)
        return _unpack(builder, builder.load(place, align=size))

    return _tuple(row.dtype)(row, at), build


def _store(_context: Any, row: Any, at: Any, vector: Any) -> Any:
    def build(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        *where, numbers = arguments
        place, size = _place(context, builder, signature.args[0], *where)
        builder.store(_pack(builder, numbers), place, align=size)
        return context.get_dummy_value()

    return types.void(row, at, vector), build


def _kind(*arguments: Any) -> Any:
    return next(each.dtype for each in arguments if isinstance(each, types.UniTuple))


def _operation(name: str, *how: str) -> Callable[..., Any]:
    """An operation of two vectors that the builder has, with what it needs to know first."""

    def typed(_context: Any, a: Any, b: Any) -> Any:
        def build(_context: Any, builder: Any, _signature: Any, arguments: Any) -> Any:
            return _unpack(
                builder, getattr(builder, name)(*how, *(_pack(builder, each) for each in arguments))
            )

        kind = types.boolean if how else _kind(a, b)
        return _tuple(kind)(a, b), build

    return typed


def _function(name: str, count: int) -> Callable[..., Any]:
    """A function of the compiler's of one vector or three."""

    def build(context: Any, builder: Any, _signature: Any, arguments: Any) -> Any:
        vectors = [_pack(builder, each) for each in arguments]
        kind = vectors[0].type
        bits = "f64" if isinstance(kind.element, ir.DoubleType) else "f32"

        def call(kind: Any, suffix: str, values: list[Any]) -> Any:
            function = ir.FunctionType(kind, [kind] * len(values))
            callee = cgutils.get_or_insert_function(  # type: ignore[no-untyped-call]
                builder.module, function, f"llvm.{name}.{suffix}"
            )
            return builder.call(callee, values)

        if isinstance(context, CPUContext):
            return _unpack(builder, call(kind, f"v{LANES}{bits}", vectors))
        # The compiler for CUDA has these for single numbers only.
        numbers = ir.Constant(ir.ArrayType(kind.element, LANES), ir.Undefined)
        for index in range(LANES):
            lanes = [builder.extract_element(vector, _lane(index)) for vector in vectors]
            numbers = builder.insert_value(numbers, call(kind.element, bits, lanes), index)
        return numbers

    def typed(_context: Any, a: Any) -> Any:
        return a(a), build

    def typed_of_three(_context: Any, a: Any, b: Any, c: Any) -> Any:
        return _tuple(_kind(a, b, c))(a, b, c), build

    return typed if count == 1 else typed_of_three


def _bits(builder: Any, vector: Any) -> tuple[Any, Any]:
    """A vector as whole numbers, and the one of them that has the bit of the sign alone."""
    double = isinstance(vector.type.element, ir.DoubleType)
    whole = ir.VectorType(ir.IntType(64 if double else 32), LANES)
    sign = ir.Constant(whole, [1 << (63 if double else 31)] * LANES)
    return builder.bitcast(vector, whole), sign


def _absolute(_context: Any, a: Any) -> Any:
    def build(_context: Any, builder: Any, _signature: Any, arguments: Any) -> Any:
        vector = _pack(builder, arguments[0])
        bits, sign = _bits(builder, vector)
        return _unpack(builder, builder.bitcast(builder.and_(bits, builder.not_(sign)), vector.type))

    return a(a), build


def _copysign(_context: Any, a: Any, b: Any) -> Any:
    def build(_context: Any, builder: Any, _signature: Any, arguments: Any) -> Any:
        vector, like = (_pack(builder, each) for each in arguments)
        bits, sign = _bits(builder, vector)
        of_like, _ = _bits(builder, like)
        both = builder.or_(builder.and_(bits, builder.not_(sign)), builder.and_(of_like, sign))
        return _unpack(builder, builder.bitcast(both, vector.type))

    return _tuple(_kind(a, b))(a, b), build


def _negate(_context: Any, a: Any) -> Any:
    def build(_context: Any, builder: Any, _signature: Any, arguments: Any) -> Any:
        vector = _pack(builder, arguments[0])
        # The compiler for CUDA has no negation.
        return _unpack(builder, builder.fsub(ir.Constant(vector.type, [-0.0] * LANES), vector))

    return a(a), build


def _select(_context: Any, where: Any, a: Any, b: Any) -> Any:
    def build(_context: Any, builder: Any, _signature: Any, arguments: Any) -> Any:
        return _unpack(builder, builder.select(*(_pack(builder, each) for each in arguments)))

    return _tuple(_kind(a, b))(where, a, b), build


# A kernel leaves out the context, which types cannot tell.
load: Any = intrinsic(_load)
"""`load(row, at)`: the four numbers of a contiguous row, (n,), from index `at` on; unchecked."""
store: Any = intrinsic(_store)
"""`store(row, at, vector)`: set the four numbers of a row from index `at` on; unchecked."""
add: Any = intrinsic(_operation("fadd"))
subtract: Any = intrinsic(_operation("fsub"))
multiply: Any = intrinsic(_operation("fmul"))
divide: Any = intrinsic(_operation("fdiv"))
greater: Any = intrinsic(_operation("fcmp_ordered", ">"))
"""`greater(a, b)`: where a is above b, four booleans."""
logical_or: Any = intrinsic(_operation("or_"))
select: Any = intrinsic(_select)
"""`select(where, a, b)`: a where that is true, b elsewhere."""
fma: Any = intrinsic(_function("fma", 3))
"""`fma(a, b, c)`: a * b + c, rounded once."""
negate: Any = intrinsic(_negate)
absolute: Any = intrinsic(_absolute)
sqrt: Any = intrinsic(_function("sqrt", 1))
floor: Any = intrinsic(_function("floor", 1))
ceil: Any = intrinsic(_function("ceil", 1))
copysign: Any = intrinsic(_copysign)
"""`copysign(a, b)`: a with the sign of b."""
