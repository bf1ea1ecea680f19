"""Conversion of plain values, as in TOML, to attrs classes and back. Nothing is coerced, and all errors are reported.

cattrs selects the rule for each type. The rules here replace those of cattrs, which turn `"false"` into True, 2.9
into 2 and 3 into "3". An unknown key is told with the one that it most probably means.
"""

from __future__ import annotations

import math
import re
import types
from collections.abc import Callable, Iterable, Mapping, Sequence
from difflib import SequenceMatcher
from enum import Enum
from pathlib import Path
from typing import Any, Final, Literal, TypeVar, Union, cast, get_args, get_origin

import attrs
import cattrs
from attrs import frozen

from graspsense.core.components.setting import declared, implausible
from graspsense.core.files.toml_text import LARGEST_INTEGER, KeyPath
from graspsense.core.values.errors import FAILURES, suggestion

LEAST_LIKENESS: Final = 0.7
"""Limit on the similarity of two keys, below which none is proposed from another table."""
_LONGEST_KEY: Final = 100


def all_keys(declarations: Mapping[str, Mapping[str, Any]], table: str = "") -> dict[str, Mapping[str, Any]]:
    """Return what `keys_of` gives by the dotted path of each key, also in its tables: `gripper.faults.drop`."""
    declared_keys: dict[str, Mapping[str, Any]] = {}
    for key, declaration in declarations.items():
        path = f"{table}.{key}" if table else key
        declared_keys |= {path: declaration, **all_keys(declaration.get("keys", {}), path)}
    return declared_keys


def nearest_path(wrong: str, known: Iterable[str]) -> str:
    """Return the known dotted path that `wrong` most probably means, the first of equals; empty if none is similar.

    >>> nearest_path("probing_force_n", ["gripper.type", "controller.probing_force_n"])
    'controller.probing_force_n'
    """
    if len(wrong) > _LONGEST_KEY:
        return ""
    name = wrong.rpartition(".")[2]

    def likeness(path: str) -> float:
        last = path.rpartition(".")[2]
        whole = SequenceMatcher(None, wrong, path).ratio()
        if last == name:
            return 1.0 + whole * ("." in wrong)
        return SequenceMatcher(None, name, last).ratio() + 0.01 * whole

    known = list(known)
    best = max(known, key=likeness, default="")
    return best if best and likeness(best) >= LEAST_LIKENESS else ""


def did_you_mean(path: str, siblings: Sequence[str], elsewhere: Iterable[str]) -> str:
    """Return `" Did you mean 'x'?"` for an unknown key: a key of its own table, or the whole path of another.

    `siblings` are the keys of the table that `path` is in; `elsewhere` are the paths of all keys.
    """
    name = path.rpartition(".")[2]
    near = nearest_path(path, elsewhere)
    if near and (near.rpartition(".")[2] == name or not suggestion(name, siblings)):
        return f" Did you mean {near!r}?"
    return suggestion(name, siblings) or suggestion(path.partition(".")[0], siblings)


ConfigT = TypeVar("ConfigT")

_BOUND: Final = re.compile(r"'\w+' must be ([<>]=?) (\S+): (.+)")
_BOUNDS: Final = {">": "above", ">=": "of at least", "<": "below", "<=": "of at most"}
"""How attrs says that a number is out of its bounds, and its signs in words."""
_NUMBER_WITH_UNIT: Final = re.compile(r"\s*([-+]?\d+(?:\.\d*)?(?:[eE][-+]?\d+)?)\s*[^\d\s]\S*\s*")


LONGEST_SHOWN: Final = 200
"""Limit on the characters of a text that an error repeats."""
MOST_UNKNOWN: Final = 20
"""Limit on the unknown keys of one table that an error lists."""


@frozen
class InvalidValue:
    """A defect of the value at `path`; `known` has the keys that there are, where the defect is an unknown key."""

    path: KeyPath
    what: str
    known: tuple[str, ...] | None = None

    def words(self, elsewhere: Iterable[str] = ()) -> str:
        """Return the defect in words; an unknown key may mean one of the paths `elsewhere`."""
        if self.known is None:
            return self.what
        path = ".".join(map(str, self.path))
        listed = ", ".join(self.known) or "none"
        return f"{self.what}{did_you_mean(path, self.known, elsewhere)} It has: {listed}"

    def under(self, key: str | int) -> InvalidValue:
        """Return the defect of the value at this path below `key`."""
        return attrs.evolve(self, path=(key, *self.path))


class ValidationFailed(Exception):
    """Values that cannot be converted to an instance; `problems` holds all their defects."""

    def __init__(self, problems: Iterable[InvalidValue]) -> None:
        super().__init__()
        self.problems = tuple(problems)

    def under(self, key: str | int) -> list[InvalidValue]:
        """Return the problems with paths that begin with this key."""
        return [problem.under(key) for problem in self.problems]


def structured(values: Mapping[str, Any], cls: type[ConfigT], called: str) -> ConfigT:
    """Return the instance of the attrs class `cls` that these values describe.

    Each value must have the type that the class declares (a whole number may stand for a number), each key must be
    known, and the messages of validators are kept. `called` is the name of the table in errors. Raises ValidationFailed
    with all problems.
    """
    attrs.resolve_types(cls)  # type: ignore[type-var]
    fields = {field.alias: field for field in attrs.fields(cls) if field.init}  # type: ignore[arg-type]
    unknown = [key for key in values if key not in fields]
    names = tuple(sorted(fields))
    problems = [
        InvalidValue((key,), f"{called} has no key {key[:LONGEST_SHOWN]!r}.", names)
        for key in unknown[:MOST_UNKNOWN]
    ]
    if len(unknown) > MOST_UNKNOWN:
        text = f"{called} has {len(unknown) - MOST_UNKNOWN} more keys that are not known"
        problems.append(InvalidValue((unknown[MOST_UNKNOWN],), text))
    given: dict[str, Any] = {}
    for name, field in fields.items():
        if name not in values:
            if field.default is attrs.NOTHING:
                problems.append(InvalidValue((), f"{called} needs the key {name!r}, which is not given"))
            continue
        try:
            given[name] = (
                values[name] if field.type is None else _CONVERTER.structure(values[name], field.type)
            )
        except ValidationFailed as misfit:
            problems += misfit.under(name)
        except FAILURES as error:  # for a type without a rule below
            problems.append(InvalidValue((name,), f"cannot be read as {field.type}: {_words(error)}"))
    if not problems:
        try:
            return cls(**given)
        except FAILURES as error:
            raise ValidationFailed(
                _complaints(cls, fields, given) or [InvalidValue((), _words(error))]
            ) from error
    raise ValidationFailed([*problems, *_complaints(cls, fields, given)])


def plain(config: object) -> dict[str, Any]:
    """Return the values of an attrs instance as plain values; a key that is not set is None."""
    return {
        field.alias: _plain(getattr(config, field.name))
        for field in attrs.fields(type(config))  # type: ignore[arg-type]
        if field.init
    }


def keys_of(cls: type) -> dict[str, dict[str, Any]]:
    """Return what each key of a config class declares.

    That is its `type` in words, whether it is `required`, its `default`, `meaning` and `unit`, the `allowed` values and
    the `plausible` range in words, and for a key that is a table itself, its `keys`.
    """
    attrs.resolve_types(cls)
    keys: dict[str, dict[str, Any]] = {}
    for field in attrs.fields(cls):
        if field.init:
            declaration = declared(field)
            default = field.default
            if isinstance(default, attrs.Factory):  # type: ignore[arg-type]
                default = None if default.takes_self else default.factory()
            keys[field.alias] = {
                "type": _kind_words(field.type),
                "required": field.default is attrs.NOTHING,
                "default": None if default is attrs.NOTHING else _plain(default),
                "meaning": declaration.meaning,
                "unit": declaration.unit,
                "allowed": declaration.allowed,
                "plausible": declaration.plausible_words,
                **({"keys": keys_of(field.type)} if attrs.has(field.type) else {}),
            }
    return keys


def implausible_values(config: object) -> list[InvalidValue]:
    """Return the values of this config, also in its tables, that are outside of their plausible ranges."""
    problems = []
    for field in attrs.fields(type(config)):  # type: ignore[arg-type]
        if not field.init:
            continue
        value = getattr(config, field.name)
        if attrs.has(type(value)):
            problems += [problem.under(field.alias) for problem in implausible_values(value)]
        elif value != field.default and (reason := implausible(declared(field), value)):
            problems.append(InvalidValue((field.alias,), reason))
    return problems


def _kind_words(kind: Any) -> str:
    if cast(Any, get_origin(kind)) is Literal:
        return " | ".join(repr(argument) for argument in get_args(kind))
    return kind.__name__ if isinstance(kind, type) and not get_args(kind) else str(kind)


def _plain(value: Any) -> Any:
    if attrs.has(type(value)):
        return plain(value)
    if isinstance(value, Mapping):
        return {str(key): _plain(member) for key, member in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(member) for member in value]
    if isinstance(value, Enum):
        return _plain(value.value)
    return str(value) if isinstance(value, Path) else value


def _complaints(
    cls: type, fields: Mapping[str, attrs.Attribute[Any]], given: Mapping[str, Any]
) -> list[InvalidValue]:
    """Return the problems that the validators of the given fields report.

    attrs stops at the first validator that raises, so the instance is made without validators. If a required value is
    missing or has the wrong type, there is no instance, and nothing is returned.
    """
    try:
        with attrs.validators.disabled():
            instance = cls(**given)
    except FAILURES:
        return []
    problems = []
    for name in given:
        field = fields[name]
        if field.validator is not None:
            try:
                field.validator(instance, field, getattr(instance, field.name))
            except FAILURES as error:
                problems.append(InvalidValue((name,), _words(error)))
    return problems


def _words(error: BaseException) -> str:
    """Return the text of an error, without the attribute and the value that errors of attrs append."""
    if not error.args or not isinstance(error.args[0], str):
        return f"{type(error).__name__}: {error}"
    if bound := _BOUND.fullmatch(error.args[0]):
        sign, limit, value = bound.groups()
        infinite = {"inf": "finite number", "-inf": "number"}
        wanted = infinite.get(limit, f"number {_BOUNDS[sign]} {limit.removesuffix('.0')}")
        return f"expected a {wanted}, found {value}"
    return error.args[0]


def shown(value: object) -> str:
    """Return a value with its kind, for an error."""
    if isinstance(value, bool):
        return f"{str(value).lower()} (a boolean)"
    if isinstance(value, str):
        more = "..." if len(value) > LONGEST_SHOWN else ""
        return f"{value[:LONGEST_SHOWN]!r}{more} (text)"
    if isinstance(value, int):
        # Python refuses to write very long numbers in decimal digits.
        digits = str(value) if value.bit_length() <= 1000 else f"a number of {value.bit_length()} bits"
        return f"{digits} (a whole number)"
    if isinstance(value, float):
        return "nan (not a number)" if math.isnan(value) else f"{value} (a number)"
    if isinstance(value, Mapping):
        return "a table"
    if isinstance(value, list | tuple):
        return "a list"
    return "nothing" if value is None else f"{value} (a {type(value).__name__})"


def _expected(what: str, value: object, advice: str = "") -> ValidationFailed:
    return ValidationFailed([InvalidValue((), f"expected {what}, found {shown(value)}{advice}")])


def _bool(value: object, _: object) -> bool:
    if not isinstance(value, bool):
        raise _expected("true or false", value)
    return value


def _int(value: object, _: object) -> int:
    if isinstance(value, bool) or not isinstance(value, int):
        raise _expected("a whole number", value)
    if not -LARGEST_INTEGER - 1 <= value <= LARGEST_INTEGER:
        raise _expected(f"a whole number of at most {LARGEST_INTEGER}", value)
    return value


def _float(value: object, _: object) -> float:
    if isinstance(value, bool) or not isinstance(value, int | float):
        unit = _NUMBER_WITH_UNIT.fullmatch(value) if isinstance(value, str) else None
        advice = ": give the number alone, in the unit that the key ends with, or SI" if unit else ""
        raise _expected("a number", value, advice)
    if math.isnan(value):
        raise _expected("a number", value)
    try:
        return float(value)
    except OverflowError:
        raise _expected("a number below 1.8e308", value) from None


def _str(value: object, _: object) -> str:
    if not isinstance(value, str):
        simple = isinstance(value, bool | int | float)
        raise _expected("text", value, ": put it in quotes, with -o as 'KEY=\"...\"'" if simple else "")
    try:
        value.encode()
    except UnicodeEncodeError:  # bytes of a command line that are not text
        raise _expected("UTF-8 text", value) from None
    return value


def _none(value: object, _: object) -> None:
    if value is not None:
        raise _expected("nothing", value)


def _choice(value: object, cls: Any) -> Any:
    allowed = [member.value for member in cls] if _is_enum(cls) else list(get_args(cls))
    for member in allowed:
        if type(member) is type(value) and member == value:
            return cls(value) if _is_enum(cls) else member
    near = (
        suggestion(value, (member for member in allowed if isinstance(member, str)))
        if isinstance(value, str)
        else ""
    )
    raise _expected(f"one of {', '.join(map(repr, allowed))}", value, near and "." + near)


def _union(value: object, cls: Any) -> Any:
    members = get_args(cls)
    exact = [argument for argument in members if type(value) is argument]
    misfits = []
    for member in [*exact, *members]:
        try:
            return _CONVERTER.structure(value, member)
        except ValidationFailed as misfit:
            misfits.append((member, misfit))
    wanted = [misfit for member, misfit in misfits if member is not type(None)]
    if len(wanted) == 1:
        raise wanted[0]
    raise _expected(
        " or ".join(_in_words(argument) for argument in members if argument is not type(None)), value
    )


def _in_words(kind: Any) -> str:
    """Return what a value of a type is, for a user who knows TOML and not Python."""
    if cast(Any, get_origin(kind)) is Literal:
        return f"one of {', '.join(map(repr, get_args(kind)))}"
    origin = get_origin(kind) or kind
    if origin in (list, tuple, Sequence):
        return "a list"
    if origin in (dict, Mapping) or attrs.has(origin):
        return "a table"
    words = {bool: "true or false", int: "a whole number", float: "a number"}
    return words.get(kind, "text")


def _sequence(value: object, cls: Any) -> Any:
    if not isinstance(value, list | tuple):
        raise _expected("a list", value)
    kind = get_origin(cls) or cls
    members: Sequence[Any] = get_args(cls)
    if kind is tuple and members and members[-1] is not Ellipsis:
        if len(value) != len(members):
            raise ValidationFailed(
                [InvalidValue((), f"expected a list of {len(members)}, found {len(value)} in it")]
            )
    else:
        members = [members[0] if members else Any] * len(value)
    items = _members(zip(range(len(value)), value, members, strict=True))
    return items if kind is list else tuple(items)


def _mapping(value: object, cls: Any) -> Any:
    if not isinstance(value, Mapping):
        raise _expected("a table", value)
    member = get_args(cls)[1] if get_args(cls) else Any
    items = _members((key, inner, member) for key, inner in value.items())
    return dict(zip(value, items, strict=True))


def _members(members: Iterable[tuple[str | int, Any, Any]]) -> list[Any]:
    """Return the members of a list or a table, each given by its key, its value and its type."""
    problems: list[InvalidValue] = []
    items = []
    for key, inner, member in members:
        try:
            items.append(_CONVERTER.structure(inner, member))
        except ValidationFailed as misfit:
            problems += misfit.under(key)
            if len(problems) >= MOST_UNKNOWN:
                break
    if problems:
        raise ValidationFailed(problems)
    return items


def _table(value: object, cls: Any) -> Any:
    if not isinstance(value, Mapping):
        raise _expected("a table", value)
    return structured(value, get_origin(cls) or cls, "this table")


def _is_enum(cls: Any) -> bool:
    return isinstance(cls, type) and issubclass(cls, Enum)


def _has_origin(*origins: Any) -> Callable[[Any], bool]:
    return lambda cls: get_origin(cls) in origins or cls in origins


_CONVERTER: Final = cattrs.Converter()
_plain_rules: dict[Any, Callable[[Any, Any], Any]] = {
    bool: _bool,
    int: _int,
    float: _float,
    str: _str,
    Path: lambda value, _: Path(_str(value, str)),
    type(None): _none,
}
for _kind, _rule in _plain_rules.items():
    _CONVERTER.register_structure_hook(_kind, _rule)
for _predicate, _rule in (
    (lambda cls: cast(Any, get_origin(cls)) is Literal or _is_enum(cls), _choice),
    (_has_origin(Union, types.UnionType), _union),
    (_has_origin(list, tuple, Sequence), _sequence),
    (_has_origin(dict, Mapping), _mapping),
    (attrs.has, _table),
):
    _CONVERTER.register_structure_hook_func(_predicate, _rule)
