"""The description of an object, and the strict reader of scene files.

An unknown key or a number out of range is an error that names the file or object, the table and the key.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from functools import cached_property, lru_cache
from typing import Any, Final, NamedTuple

from attrs import field, fields_dict, frozen
from attrs.validators import ge, gt, in_, le

from graspsense.plugin_api import ConfigError, UnknownName
from graspsense.simulator_api import STANDARD_GRAVITY_M_S2, gives, suggestion, toml_layer
from graspsense_sim_gripper.scene.terms.registry import find_term, in_order

PATCHES: Final = ("line", "face", "point")

LARGEST: Final = 1e20
SMALLEST: Final = 1e-30
"""The largest and the smallest magnitude of a number of a scene; products of a few of them stay finite."""
MOST_TERMS: Final = 40
"""The largest number of terms of an object, whose code is compiled together."""
IDENTIFIED: Final = ("label", "gripper", "sensor", "intervals", "recordings", "candidates", "undetermined")
"""The keys of the table `[identified]`."""
MOST_SPREAD: Final = 3.0
"""The largest standard deviation of the logarithm of a parameter: instances then differ by a factor of 20 and more."""

TomlValue = Any
"""A value of a TOML file, of a type that is still to be checked."""
TomlTable = Mapping[str, TomlValue]
TermParams = Any
"""The parameters of a term: a named tuple of the term's own type."""
TermEntry = tuple[str, Mapping[str, float]]
"""The kind of a term, and its parameters by name."""
TermSpread = Mapping[str, float]
"""The standard deviation of the logarithm of parameters of a term between instances, by name."""


def _positive() -> float:
    return field(validator=gt(0.0))


def _not_negative(default: float, claim: str = "") -> float:
    """Return the field of a number that is not negative; `claim`: the claim of the paper that it gives by itself."""
    return field(default=default, validator=ge(0.0), metadata=gives(claim) if claim else None)


class ParsedTerm(NamedTuple):
    """A term of an object as it was read."""

    kind: str
    params: Mapping[str, float]
    spread: TermSpread


class NominalParams(NamedTuple):
    """The parameters of all terms of an object, one term after the other, and how each varies between instances."""

    value: Any
    """The nominal values: numbers in a tuple, or in an array for compiled code. So are the others."""
    is_stiffness: Any
    """1: it varies with the stiffness of the object."""
    spread: Any
    """The standard deviation of the logarithm of its own variation; 0: it has none."""


class InstanceSpread(NamedTuple):
    """How the instances of an object differ, besides the parameters of its terms; fields as in `ObjectSpec`."""

    stiffness: float
    width_m: float
    width_spread_m: float
    offset_m: float
    offset_spread_m: float
    share: float
    share_spread: float


@frozen(kw_only=True)
class ObjectSpec:
    """An object in one of its states, as a file describes it. SI units; spreads are standard deviations."""

    name: str
    summary: str = ""
    patch: str = field(default="line", validator=in_(PATCHES))
    """The shape of the contact with a pad: a line, a face or a point."""
    width_m: float = _positive()
    width_spread_m: float = _not_negative(0.0)
    stiffness_spread: float = field(default=0.0, validator=[ge(0.0), le(MOST_SPREAD)])
    """Standard deviation of the logarithm of the stiffness."""
    offset_m: float = field(default=0.0, metadata=gives("one_finger_first"))
    """Distance from the gripper's centre line, positive towards the right finger."""
    offset_spread_m: float = _not_negative(0.0, "one_finger_first")
    share: float = field(default=1.0, validator=[gt(0.0), le(1.0)])
    """The share of the force that lands on the fifteen cells of the gripping face."""
    share_spread: float = _not_negative(0.0)
    friction: float = _not_negative(0.3)
    """Coefficient of friction on the table."""
    held: bool = False
    """Whether the object is fixed in place: a finger that touches it first compresses it, and does not push it."""
    mass_kg: float = field(default=0.1, validator=gt(0.0))
    terms: tuple[TermEntry, ...] = ()
    """Kind and parameters of each term, in the canonical order."""
    spreads: tuple[TermSpread, ...] = ()
    """The spread of each term's parameters, in the same order; () if no parameter has a spread of its own."""
    reasons: Mapping[str, str] = field(factory=dict)
    """That of each number in the catalogue, by object, term and key."""
    fitted_to: tuple[str, ...] = ()
    """The published results to which values of this object were fitted, sorted."""
    file: str = ""
    """The scene file that the object was read from; empty for the catalogue."""

    @cached_property
    def kinds(self) -> tuple[str, ...]:
        """The kinds of its terms."""
        return tuple(kind for kind, _ in self.terms)

    @property
    def table_n(self) -> float:
        """Friction of the table, which a finger has to overcome to push the object."""
        return self.friction * self.mass_kg * STANDARD_GRAVITY_M_S2

    @cached_property
    def nominal_params(self) -> NominalParams:
        """The nominal parameters of all terms."""
        value: list[float] = []
        is_stiffness: list[int] = []
        own: list[float] = []
        spreads = self.spreads or ({},) * len(self.terms)
        for (kind, values), spread in zip(self.terms, spreads, strict=True):
            term = find_term(kind)[1]
            for name, number in term.params(**values)._asdict().items():
                # A default may be written as an integer, and compiled code distinguishes the types.
                value.append(float(number))
                is_stiffness.append(int(name in term.stiffnesses))
                own.append(spread.get(name, 0.0))
        return NominalParams(tuple(value), tuple(is_stiffness), tuple(own))

    @cached_property
    def spread(self) -> InstanceSpread:
        """How its instances differ."""
        return InstanceSpread(
            stiffness=float(self.stiffness_spread),
            width_m=float(self.width_m),
            width_spread_m=float(self.width_spread_m),
            offset_m=float(self.offset_m),
            offset_spread_m=float(self.offset_spread_m),
            share=float(self.share),
            share_spread=float(self.share_spread),
        )

    @cached_property
    def params_of_terms(self) -> tuple[tuple[type[TermParams], int, int], ...]:
        """For each term the type of its parameters, and where they begin and end in `nominal_params`."""
        places, begin = [], 0
        for kind in self.kinds:
            params = find_term(kind)[1].params
            places.append((params, begin, begin + len(params._fields)))
            begin = places[-1][2]
        return tuple(places)

    @cached_property
    def n_own_spreads(self) -> int:
        """The number of parameters with a spread of their own."""
        return sum(spread > 0.0 for spread in self.nominal_params.spread)

    @cached_property
    def dents(self) -> tuple[tuple[int, Callable[[TermParams], float]], ...]:
        """The terms that earlier use may have dented: the index of each, and its `Term.dent`."""
        dents = [find_term(kind)[1].dent for kind in self.kinds]
        return tuple((i, dent) for i, dent in enumerate(dents) if dent)

    @cached_property
    def content(self) -> str:
        """All fields as text, which is equal for two specs of the same object."""
        return repr(self)


def _with_sorted_terms(values: TomlTable, terms: list[ParsedTerm]) -> ObjectSpec:
    """Return the spec with these values, and its terms in the canonical order.

    Raises ValueError if a value is out of the range of its field, or if two terms act on the sum of the others.
    """
    on_sum = [term.kind for term in terms if find_term(term.kind)[1].on_sum is not None]
    if len(on_sum) > 1:
        raise ValueError(
            f"{len(on_sum)} terms act on the force of all others ({', '.join(on_sum)}): an object can have one"
        )
    ordered = [terms[i] for i in in_order([term.kind for term in terms])]
    spreads = tuple(term.spread for term in ordered)
    return ObjectSpec(
        **values,
        terms=tuple((term.kind, term.params) for term in ordered),
        spreads=spreads if any(spreads) else (),
    )


@lru_cache(maxsize=1024)
def parse_scene(text: str, name: str, where: str) -> ObjectSpec:
    """Return the object that the text of a scene file describes. `where` names the file in error messages.

    Raises ConfigError that lists all problems of the file.
    """
    return spec_of(toml_layer(text, where, "scene").values, where, {"name": name, "file": where})


def spec_of(table: TomlTable, where: str, more: TomlTable) -> ObjectSpec:
    """Return the object of a table with the keys of a scene file; `more`: further fields of it.

    Raises ConfigError that lists all problems of the table, each after `where`.
    """
    problems: list[str] = []
    values = {**more, **_scene_values(table, problems)}
    terms = _scene_terms(table.get("terms", []), problems)
    if not problems:
        try:
            return _with_sorted_terms(values, terms)
        except ValueError as error:
            problems.append(str(error.args[0]))
    raise ConfigError("\n".join(f"{where}: {problem}" for problem in problems))


def _scene_values(table: TomlTable, problems: list[str]) -> dict[str, TomlValue]:
    """Return the values of all keys of a scene except its terms; problems are added to `problems`."""
    known = fields_dict(ObjectSpec).keys() - {"name", "reasons", "fitted_to", "file", "spreads"}
    values: dict[str, TomlValue] = {}
    for key, entry in table.items():
        if key == "identified":
            _check_identified(entry, problems)
        elif key not in known:
            problems.append(f"{key}: no such key. Known: {', '.join(sorted(known))}.{suggestion(key, known)}")
        elif key in ("summary", "patch", "held"):
            expected = bool if key == "held" else str
            if not isinstance(entry, expected):
                problems.append(f"{key}: {entry!r} is not {'true or false' if key == 'held' else 'text'}")
            values[key] = entry
        elif key != "terms":
            values[key] = _number(entry, key, problems, negative=key == "offset_m")
    if "width_m" not in table:
        problems.append("width_m: is missing, and every object has a width")
    return values


def _check_identified(entry: TomlValue, problems: list[str]) -> None:
    """Add what is wrong with the table that `graspsense identify` writes, and which the simulator does not use.

    Trials of identified scenes read its label and settings of the gripper, which a misspelt name would hide.
    """
    if not isinstance(entry, Mapping):
        problems.append(f"identified: {entry!r} is not a table")
        return
    problems += [
        f"identified.{key}: no such key. Known: {', '.join(IDENTIFIED)}.{suggestion(key, IDENTIFIED)}"
        for key in entry
        if key not in IDENTIFIED
    ]


def _scene_terms(tables: TomlValue, problems: list[str]) -> list[ParsedTerm]:
    if not isinstance(tables, list) or not all(isinstance(table, dict) for table in tables):
        problems.append("terms: write a table [[terms]] for each")
        return []
    if len(tables) > MOST_TERMS:
        problems.append(f"terms: {len(tables)} terms, and an object has at most {MOST_TERMS}")
        return []
    terms = [
        _term(table, f"[[terms]] {i} ({table.get('type')})", problems) for i, table in enumerate(tables, 1)
    ]
    return [term for term in terms if term is not None]


def _number(entry: TomlValue, label: str, problems: list[str], negative: bool = False) -> float:
    """Return the entry as a number; what is wrong with it is added to `problems`."""
    if isinstance(entry, bool) or not isinstance(entry, int | float):
        problems.append(f"{label}: {entry!r} is not a number")
    elif not math.isfinite(entry):
        problems.append(f"{label}: {entry!r} is not a finite number")
    elif entry < 0.0 and not negative:
        problems.append(f"{label}: {entry!r} is negative")
    elif abs(entry) > LARGEST:
        problems.append(f"{label}: {entry!r} is too large for a computation: at most {LARGEST:g}")
    elif 0.0 < abs(entry) < SMALLEST:
        problems.append(f"{label}: {entry!r} is too small for a computation: 0, or at least {SMALLEST:g}")
    else:
        return float(entry)
    return 0.0


def _term(table: TomlTable, label: str, problems: list[str]) -> ParsedTerm | None:
    """Return a term as it was read; None if its kind is unknown. Problems begin with `label`."""
    try:
        kind, term = find_term(str(table.get("type", "")))
    except UnknownName as error:
        problems.append(f"{label}: {error}")
        return None
    names: list[str] = list(term.params._fields)
    given = [key for key in table if key not in ("type", "spread")]
    problems += [
        f"{label}: no such key {key!r}. Known: {', '.join(names)}.{suggestion(key, names)}"
        for key in given
        if key not in names
    ]
    missing = [key for key in names if key not in table and key not in term.params._field_defaults]
    if missing:
        problems.append(f"{label}: missing {', '.join(missing)}")
    n_problems = len(problems)
    values = {
        key: _number(table[key], f"{label} {key}", problems, key in term.signed)
        for key in given
        if key in names
    }
    spread = _spread(table.get("spread", {}), label, names, problems)
    if len(problems) == n_problems:
        problems += [
            f"{label} {key}: must be greater than 0"
            for key in values
            if key in term.positive and values[key] <= 0.0
        ]
    if len(problems) == n_problems and not missing:
        reason = term.refusal(term.params(**values)) if term.refusal else ""
        problems += [f"{label}: {reason}"] if reason else []
    return ParsedTerm(kind, values, spread)


def _spread(entry: TomlValue, label: str, names: list[str], problems: list[str]) -> TermSpread:
    """Return the spread of a term's parameters; what is wrong with it is added to `problems`."""
    if not isinstance(entry, Mapping):
        problems.append(f"{label} spread: write a table such as {{ {names[0]} = 0.1 }}, not {entry!r}")
        return {}
    problems += [
        f"{label} spread: no such parameter {key!r}. Known: {', '.join(names)}.{suggestion(key, names)}"
        for key in entry
        if key not in names
    ]
    values = {key: _number(value, f"{label} spread.{key}", problems) for key, value in entry.items()}
    problems += [
        f"{label} spread.{key}: {value:g} is too large: it is the standard deviation of a logarithm, at most "
        f"{MOST_SPREAD:g}"
        for key, value in values.items()
        if value > MOST_SPREAD
    ]
    return values
