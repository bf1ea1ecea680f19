"""Expressions over the columns of a file: `0.06 - Pos*0.001`, `max(f1, f2)`, `norm('opto1_?')`, `x - first(x)`.

Python's parser reads an expression, and only the nodes listed here are accepted and computed with numpy: numbers,
columns, `+ - * /`, signs, parentheses, and the functions in `FUNCTIONS`. Nothing is ever executed.

A column is named as it is if Python allows it as a name, and in quotes otherwise: `'stamp ms'*0.001`. Within quotes,
`*` and `?` stand for any characters, so that `'taxel_*'` names several columns; a column with several components, as a
matrix of a MAT file has, counts as several as well. `force[2]` is the component with this index, counted from 0,
and `cells[2::3]` every third one from there on.
"""

from __future__ import annotations

import ast
import warnings
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Any, Final, NoReturn

import numpy as np
from attrs import frozen

from graspsense.core.values.errors import ConfigError, listed, suggestion
from graspsense.core.values.limits import CELLS
from graspsense.sources.formats.patterns import PatternError, wildcard
from graspsense.sources.formats.table import Numbers

LARGEST: Final = 1e300
"""Limit on the magnitude of a number in an expression."""
LONGEST: Final = 2000
"""Limit on the characters of an expression."""

FOLDS: Final[Mapping[str, Callable[[Numbers], Numbers]]] = {
    "sum": lambda a: a.sum(axis=1, keepdims=True),
    "mean": lambda a: a.mean(axis=1, keepdims=True),
    "max": lambda a: a.max(axis=1, keepdims=True),
    "min": lambda a: a.min(axis=1, keepdims=True),
    "norm": lambda a: np.sqrt((a * a).sum(axis=1, keepdims=True)),
}
"""Functions that fold several columns into one, row by row."""
OVER_TIME: Final[dict[str, Callable[[Numbers], Numbers]]] = {
    "first": lambda a: a[:1],
    "last": lambda a: a[-1:],
    "peak": lambda a: np.fmax.reduce(a, axis=0, keepdims=True),
}
"""Functions of one column over the whole grasp: its first value, its last one, its largest one."""
PLAIN: Final[dict[str, Callable[[Numbers], Numbers]]] = {"abs": np.abs, "sqrt": np.sqrt}
NORM3: Final = "norm3"
"""Function of several columns, three successive ones of which are the components of a vector: their lengths."""
FUNCTIONS: Final = (*FOLDS, *OVER_TIME, *PLAIN, NORM3)

_OPERATORS: Final[Mapping[type[ast.operator], Callable[[Any, Any], Any]]] = {
    ast.Add: np.add,
    ast.Sub: np.subtract,
    ast.Mult: np.multiply,
    ast.Div: np.divide,
}


class ExpressionError(ConfigError):
    """An expression that cannot be used; the message shows the place."""


@frozen
class Expression:
    """An expression over columns, parsed and checked, and the unit that stands behind it in brackets (`[counts]`)."""

    text: str
    unit: str
    tree: ast.expr

    @property
    def column(self) -> str:
        """The name of the column that it is, empty if it computes something."""
        return _name_in(self.tree) if isinstance(self.tree, ast.Name | ast.Constant) else ""

    @property
    def keeps_unit(self) -> bool:
        """Whether its value has the unit of its columns: it neither multiplies nor divides, and takes no root."""
        nodes = ast.walk(self.tree)
        return not any(
            isinstance(node, ast.Mult | ast.Div) or getattr(node, "id", "") == "sqrt" for node in nodes
        )

    @property
    def names(self) -> frozenset[str]:
        """The names and patterns of columns in it."""
        return frozenset(map(_name_in, _names(self.tree)))

    def columns(self, known: Sequence[str]) -> tuple[str, ...]:
        """Return which of these columns it uses. Raises ExpressionError if it names one that is not among them."""
        return tuple(
            dict.fromkeys(name for node in _names(self.tree) for name in self._matching(node, known))
        )

    def values(self, columns: Mapping[str, Numbers], rows: int) -> Numbers:
        """Return its value in each of the rows: shape (rows,), or (rows, k) if it stands for several columns.

        Raises ExpressionError.
        """
        with np.errstate(all="ignore"):
            value = self._value(self.tree, columns)
        values = np.array(np.broadcast_to(value, (rows, value.shape[1])), dtype=np.float64)
        return values if values.shape[1] > 1 else values[:, 0]

    def numbers(self, columns: Mapping[str, Numbers], rows: int) -> Numbers:
        """Return its value in each of the rows as one column. Raises ExpressionError if it stands for several."""
        values = self.values(columns, rows)
        if values.ndim > 1:
            self._refuse(
                self.tree, f"it gives {values.shape[1]} columns; fold them into one: {', '.join(FOLDS)}(...)"
            )
        return values

    def _value(self, node: ast.expr, columns: Mapping[str, Numbers]) -> Numbers:
        """Return a value with a row for each sample, or one row for all, and a column for each of its columns."""
        if isinstance(node, ast.Constant) and not isinstance(node.value, str):
            return np.full((1, 1), node.value, dtype=np.float64)
        if isinstance(node, ast.Name | ast.Constant):
            matching = [columns[name] for name in self._matching(node, tuple(columns))]
            parts = [column if column.ndim == 2 else column[:, np.newaxis] for column in matching]
            return parts[0] if len(parts) == 1 else np.hstack(parts)
        if isinstance(node, ast.UnaryOp):
            value = self._value(node.operand, columns)
            return -value if isinstance(node.op, ast.USub) else value
        if isinstance(node, ast.BinOp):
            left, right = self._value(node.left, columns), self._value(node.right, columns)
            if 1 not in (widths := (left.shape[1], right.shape[1])) and widths[0] != widths[1]:
                self._refuse(node, f"{widths[0]} columns and {widths[1]} columns do not fit together")
            result: Numbers = _OPERATORS[type(node.op)](left, right)
            return result
        if isinstance(node, ast.Subscript):
            return self._component(node, self._value(node.value, columns))
        assert isinstance(node, ast.Call)
        assert isinstance(node.func, ast.Name)
        arguments: list[Numbers] = []
        for argument in node.args:
            arguments.append(self._value(argument, columns))
            if too_many := CELLS.exceeded(sum(value.size for value in arguments)):
                self._refuse(node, too_many)
        return self._called(node, node.func.id, arguments)

    def _component(self, node: ast.Subscript, value: Numbers) -> Numbers:
        """Return the component with this index, or every so many components from there on."""
        several, components = isinstance(node.slice, ast.Slice), value.shape[1]
        index = int((node.slice.lower if several else node.slice).value)  # type: ignore[attr-defined, union-attr]
        if index >= components:
            self._refuse(node, f"there is no component {index}: it has {components}, counted from 0")
        step = int(node.slice.step.value) if several else components  # type: ignore[attr-defined]
        return value[:, index::step]

    def _called(self, node: ast.Call, name: str, arguments: list[Numbers]) -> Numbers:
        if name in FOLDS:
            rows = max(map(len, arguments))
            together = np.hstack([np.broadcast_to(cells, (rows, cells.shape[1])) for cells in arguments])
            if together.shape[1] < 2:
                self._refuse(
                    node,
                    f"{name} folds several columns into one in each row, and this is one column. Name several, "
                    "as in max(f1, f2) or sum('taxel_*'). Over the grasp there are first(x), last(x) and peak(x)",
                )
            return FOLDS[name](together)
        (argument,) = arguments
        if name == NORM3:
            width = argument.shape[1]
            if width % 3:
                why = (
                    f"norm3 takes the three components of each of several cells, and here are {width} columns"
                )
                self._refuse(node, why)
            lengths: Numbers = np.sqrt((argument.reshape(len(argument), -1, 3) ** 2).sum(axis=2))
            return lengths
        if name in OVER_TIME and not any(_names(node.args[0])):
            self._refuse(node, f"{name} needs a column")
        return (OVER_TIME | PLAIN)[name](argument)

    def _matching(self, node: ast.expr, known: Sequence[str]) -> tuple[str, ...]:
        name = _name_in(node)
        if name in known:
            return (name,)
        quoted = isinstance(node, ast.Constant)
        names: tuple[str, ...] = ()
        if quoted and set("*?") & set(name):
            try:
                pattern = wildcard(name)
            except PatternError as error:
                self._refuse(node, str(error))
            names = tuple(column for column in known if pattern.fullmatch(column))
        if not names:
            what = (
                f"no column matches {name!r}" if quoted and set("*?") & set(name) else f"no column {name!r}"
            )
            columns = listed([shown if shown.isidentifier() else f"'{shown}'" for shown in known])
            topic, _, number = name.partition(".")
            parts = [part for part in known if part.startswith(f"{topic}.") and part.endswith(f".{number}")]
            if name.startswith("/") and parts:
                what += (
                    f": the messages of {topic} are of {len(parts)} kinds in turn. Name one: {listed(parts)}"
                )
            self._refuse(node, f"{what}. Columns: {columns or 'none'}.{suggestion(name, known)}")
        return names

    def _refuse(self, node: ast.expr, why: str) -> NoReturn:
        raise _error(self.text, node.col_offset, why)


def parse(text: str) -> Expression:
    """Return the expression that this text is. Raises ExpressionError that shows the place of what is not allowed."""
    body, unit = _body_and_unit(text.strip())
    if not body:
        raise ExpressionError(
            f"{text!r} is empty: name a column, or compute with columns as in 0.06 - Pos*0.001"
        )
    if len(body) > LONGEST:
        raise ExpressionError(f"an expression has at most {LONGEST} characters, and this has {len(body)}")
    if "\n" in body or "\0" in body:
        raise ExpressionError("an expression is a single line")
    try:
        # Python counts columns in bytes of UTF-8, and reports no place after some errors.
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # of odd literals, which are refused or mean nothing here
            tree = ast.parse(body, mode="eval").body
    except SyntaxError as error:
        raise _error(
            body,
            (error.offset or 1) - 1,
            "this is not an expression. A column whose name has spaces or other signs is written in quotes: "
            "'stamp ms'*0.001",
        ) from None
    except (ValueError, RecursionError, MemoryError):
        raise ExpressionError(f"{body[:60]!r} is not an expression, or is nested too deep") from None
    for node, why in _refused(tree):
        raise _error(body, getattr(node, "col_offset", 0), why)
    return Expression(text=body, unit=unit, tree=tree)


def _body_and_unit(text: str) -> tuple[str, str]:
    """Return an expression and the unit in brackets behind it: `Pos [mm]`, but not an index as in `force[2]`."""
    body, bracket, unit = text[:-1].rpartition("[") if text.endswith("]") else ("", "", "")
    is_unit = (
        bracket
        and body.strip()
        and body[-1].isspace()
        and not set("]'") & set(unit)
        and any(not (sign.isdecimal() or sign.isspace()) for sign in unit)
    )
    return (body.rstrip(), unit.strip()) if is_unit else (text, "")


def _refused(node: ast.AST, depth: int = 0) -> Iterator[tuple[ast.AST, str]]:
    """Yield each node that is not in the closed list, and why."""
    inner: Sequence[ast.AST] = ()
    if depth > 50:
        yield node, "it is nested too deep"
    elif isinstance(node, ast.Constant):
        if type(node.value) not in (int, float, str):
            yield node, f"{node.value!r} is not a number"
        elif isinstance(node.value, int | float) and not abs(node.value) <= LARGEST:
            yield node, f"a number is at most {LARGEST:g}"
    elif isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.UAdd | ast.USub):
        inner = (node.operand,)
    elif isinstance(node, ast.BinOp):
        if type(node.op) not in _OPERATORS:
            yield node, "there are + - * /, and the functions " + ", ".join(FUNCTIONS)
        inner = (node.left, node.right)
    elif isinstance(node, ast.Subscript):
        if not _is_component(node.slice):
            wanted = "force[2], or cells[2::3] for every third"
            yield node, f"write the number of a component in brackets, counted from 0: {wanted}"
        inner = (node.value,)
    elif isinstance(node, ast.Call):
        yield from ((node, why) for why in _wrong_in_call(node))
        inner = node.args
    elif not isinstance(node, ast.Name):
        allowed = "there are numbers, columns, + - * / and functions"
        yield node, f"{type(node).__name__} is not allowed here: {allowed}"
    for child in inner:
        yield from _refused(child, depth + 1)


def _is_component(index: ast.expr) -> bool:
    """Return whether this is the number of a component, or that of one and a step from it: `2`, `2::3`."""
    parts = (index,) if not isinstance(index, ast.Slice) else (index.lower, index.step)
    if isinstance(index, ast.Slice) and index.upper is not None:
        return False
    numbers = [part.value for part in parts if isinstance(part, ast.Constant) and type(part.value) is int]
    return len(numbers) == len(parts) and numbers[0] >= 0 and all(step > 0 for step in numbers[1:])


def _wrong_in_call(node: ast.Call) -> Iterator[str]:
    name = node.func.id if isinstance(node.func, ast.Name) else ""
    if name not in FUNCTIONS:
        known = ", ".join(FUNCTIONS)
        quoted = "A column whose name has parentheses stands in quotes, as 'Load (N)'"
        yield f"no function {name or 'of this kind'}. {quoted}. Functions: {known}.{suggestion(name, FUNCTIONS)}"
    if node.keywords or any(isinstance(argument, ast.Starred) for argument in node.args):
        yield f"{name} takes columns, separated by commas"
    if not node.args or (name not in FOLDS and len(node.args) != 1):
        wanted = "at least one argument" if name in FOLDS else "one argument"
        yield f"{name} takes {wanted}, and here are {len(node.args)}"


def _names(node: ast.AST) -> Iterator[ast.expr]:
    """Yield every node that names a column; the name of a function does not."""
    if isinstance(node, ast.Name) or (isinstance(node, ast.Constant) and isinstance(node.value, str)):
        yield node
    for part in node.args if isinstance(node, ast.Call) else ast.iter_child_nodes(node):
        yield from _names(part)


def _name_in(node: ast.expr) -> str:
    return node.id if isinstance(node, ast.Name) else str(node.value)  # type: ignore[attr-defined]


def _error(text: str, offset: int, why: str) -> ExpressionError:
    indent = len(text.encode()[:offset].decode(errors="ignore"))
    return ExpressionError(f"{why}\n    {text}\n    {' ' * indent}^")
