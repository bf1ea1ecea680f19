"""Writing the numbers of nested tuples to an array, in compiled code. Importing this imports numba."""

from __future__ import annotations

from typing import Any

from llvmlite import ir
from numba import types
from numba.extending import intrinsic


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
    found: list[tuple[Any, Any]] = []
    parts: Any = kind
    for i, part in enumerate(parts):
        found += numbers_in(builder, part, builder.extract_value(value, i))
    return found
