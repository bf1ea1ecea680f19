"""Numbers of nested tuples in compiled code: written to an array and read from one. Importing this imports numba.

The interpreter takes a tenth of the time of a grasp to pass nested tuples of a few hundred numbers to compiled code.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from llvmlite import ir
from numba import extending, types
from numba.extending import intrinsic, typeof_impl

from graspsense_sim_gripper.run.nested import TupleType


class PatternType(types.Type):
    """The type of a `TupleType` in compiled code, which knows the types in its pattern but none of the values."""

    def __init__(self, values_type: Any) -> None:
        """Take the type of the nested tuples."""
        self.values_type = values_type
        super().__init__(name=f"Pattern({values_type})")


@typeof_impl.register(TupleType)
def _type_of(kind: TupleType, context: Any) -> PatternType:
    if kind.compiled_type is None:
        kind.compiled_type = PatternType(typeof_impl(kind.pattern, context))
    known: PatternType = kind.compiled_type
    return known


def _unbox(kind: Any, value: Any, context: Any) -> Any:
    return untyped.NativeValue(context.context.get_dummy_value())


untyped: Any = extending
"""numba declares no types for these."""
untyped.register_model(PatternType)(untyped.models.OpaqueModel)
untyped.unbox(PatternType)(_unbox)


@intrinsic
def tuples_of(typing_context: Any, pattern: Any, numbers: Any, arrays: Any) -> Any:
    """Return nested tuples of the types of a pattern, of the numbers in an array and of arrays in a tuple, in order.

    Both must suffice.
    """

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        data = context.make_array(signature.args[1])(context, builder, arguments[1]).data
        places = iter(range(count_numbers(pattern.values_type)))
        given = iter(builder.extract_value(arguments[2], i) for i in range(len(signature.args[2])))
        return _made(context, builder, pattern.values_type, data, places, given)

    return pattern.values_type(pattern, numbers, arrays), generate


def _made(
    context: Any, builder: Any, kind: Any, data: Any, places: Iterator[int], given: Iterator[Any]
) -> Any:
    """Return a value of this type, of the numbers at the next places and the next arrays."""
    if isinstance(kind, types.BaseTuple):
        parts: Any = kind
        return context.make_tuple(
            builder, kind, [_made(context, builder, part, data, places, given) for part in parts]
        )
    if isinstance(kind, types.Array):
        return next(given)
    place = builder.gep(data, [ir.Constant(ir.IntType(64), next(places))])
    return context.cast(builder, builder.load(place), types.float64, kind)


def count_numbers(kind: Any) -> int:
    """Return the number of numbers in nested tuples of this type."""
    if isinstance(kind, types.BaseTuple):
        parts: Any = kind
        return sum(map(count_numbers, parts))
    return 0 if isinstance(kind, types.Array) else 1


@intrinsic
def store_numbers(typing_context: Any, array: Any, values: Any) -> Any:
    """Write the numbers in nested tuples to the beginning of an array of floats, in order.

    The array must be long enough, and contiguous.
    """

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        data = context.make_array(signature.args[0])(context, builder, arguments[0]).data
        for i, (kind, number) in enumerate(numbers_in(builder, signature.args[1], arguments[1])):
            place = builder.gep(data, [ir.Constant(ir.IntType(64), i)])
            builder.store(context.cast(builder, number, kind, types.float64), place)
        return context.get_dummy_value()

    return types.void(array, values), generate


def numbers_in(builder: Any, kind: Any, value: Any) -> list[tuple[Any, Any]]:
    """Return the numbers in nested tuples of compiled code, each with its type."""
    if not isinstance(kind, types.BaseTuple):
        return [(kind, value)]
    numbers: list[tuple[Any, Any]] = []
    parts: Any = kind
    for i, part in enumerate(parts):
        numbers += numbers_in(builder, part, builder.extract_value(value, i))
    return numbers
