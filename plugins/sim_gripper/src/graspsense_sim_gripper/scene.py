"""From a name to what is simulated: the catalogue, scene files, and one sampled instance of one of their objects.

Both are read strictly: an unknown key or a number out of range is an error that names the file or object, the
table and the key. In the catalogue every figure stands with its reason; a file of one's own needs none.
"""

from __future__ import annotations

import math
import tomllib
from collections.abc import Callable, Mapping
from functools import cache, cached_property
from importlib.resources import files
from pathlib import Path
from typing import Any, Final

import numpy as np
from attrs import field, fields_dict, frozen
from attrs.validators import ge, gt, in_, le

from graspsense.plugin_api import ConfigError, UnknownName, suggestion
from graspsense_sim_gripper.terms.registry import find_term, in_order

GRAVITY_M_S2: Final = 9.80665
PATCHES: Final = ("line", "face", "point")


def _positive() -> float:
    return field(validator=gt(0.0))


def _not_negative(default: float) -> float:
    return field(default=default, validator=ge(0.0))


@frozen(kw_only=True)
class ObjectSpec:
    """An object in one of its states, as a file has it. SI units; spreads are standard deviations."""

    name: str
    summary: str = ""
    patch: str = field(default="line", validator=in_(PATCHES))
    """How it meets a pad: along a line, with a face, at a point."""
    width_m: float = _positive()
    width_spread_m: float = _not_negative(0.0)
    stiffness_spread: float = _not_negative(0.0)
    offset_m: float = 0.0
    """How far it stands off the gripper's centre line, towards the right finger."""
    offset_spread_m: float = _not_negative(0.0)
    share: float = field(default=1.0, validator=[gt(0.0), le(1.0)])
    """Part of the force that lands on the fifteen cells."""
    share_spread: float = _not_negative(0.0)
    friction: float = _not_negative(0.3)
    """Coefficient of friction on the table."""
    held: bool = False
    """Held fast: a finger that touches it first presses it and does not push it."""
    mass_kg: float = field(default=0.1, validator=gt(0.0))
    terms: tuple[tuple[str, Mapping[str, float]], ...] = ()
    """Kind and parameters of each term, in the canonical order."""
    reasons: Mapping[str, str] = field(factory=dict)
    file: str = ""
    """Where it was read from; empty: the catalogue."""

    @cached_property
    def kinds(self) -> tuple[str, ...]:
        """The kinds of its terms."""
        return tuple(kind for kind, _ in self.terms)

    @cached_property
    def stiff_parts(self) -> tuple[tuple[Any, tuple[bool, ...]], ...]:
        """The parameters of each term, and which of them a thicker wall makes larger."""
        parts = []
        for kind, values in self.terms:
            term = find_term(kind)[1]
            # A default may be written as a whole number, and compiled code is of types.
            params = term.params._make(float(value) for value in term.params(**values))
            parts.append((params, tuple(name in term.stiffnesses for name in params._fields)))
        return tuple(parts)


@frozen(kw_only=True)
class Instance:
    """One object as it stands there now: sampled from its spec, or the spec itself where nothing is to vary."""

    spec: ObjectSpec
    width_m: float
    offset_m: float
    share: float
    table_n: float
    kinds: tuple[str, ...]
    terms: tuple[Any, ...]
    patch_row: float
    """Where the contact lies on the pad, in rows from its middle."""


@cache
def catalogue() -> Mapping[str, ObjectSpec]:
    """Return every object of the catalogue in every state, by name (`odwalla:full_open`, `block`)."""
    text = files("graspsense_sim_gripper").joinpath("catalogue.toml").read_text(encoding="utf-8")
    specs: dict[str, ObjectSpec] = {}
    for name, table in tomllib.loads(text).items():
        states = table.pop("states", None)
        if states is None:
            specs[name] = _catalogued(name, table)
            continue
        for state, extra in states.items():
            both = {**table, **extra, "terms": [*table.get("terms", []), *extra.get("terms", [])]}
            specs[f"{name}:{state}"] = _catalogued(f"{name}:{state}", both)
    return specs


def numbered(name: str) -> tuple[str, int | None]:
    """Return the name without its instance, and the number of the instance: `can:full_open#3` is one certain can.

    Raises UnknownName where what stands behind `#` is no whole number.
    """
    plain, mark, number = name.partition("#")
    if not mark:
        return plain, None
    if not (number.isascii() and number.isdigit()):
        raise UnknownName(f"object {name!r}: behind # stands the number of an instance, as in {plain}#3")
    return plain, int(number)


def find(name: str) -> ObjectSpec:
    """Return the object of this name, or that of a file whose name ends in `.toml`.

    A name is looked up in the catalogue, then among the scenes that are shipped. Raises UnknownName with what
    there is, ConfigError for a file that cannot be read as an object.
    """
    if name.endswith(".toml"):
        return _of_file(Path(name))
    known = catalogue()
    if name in known:
        return known[name]
    kind, _, state = name.partition(":")
    states = [n.partition(":")[2] for n in known if n.startswith(f"{kind}:")]
    if kind in known:
        raise UnknownName(f"object {kind!r} has no states, but {name!r} asks for one. Write --object {kind}")
    if states and not state:
        raise UnknownName(
            f"object {kind!r} needs a state: {', '.join(states)}. Write --object {kind}:{states[0]}"
        )
    if states:
        raise UnknownName(
            f"object {kind!r} has no state {state!r}. Known: {', '.join(states)}.{suggestion(state, states)}"
        )
    shipped = shipped_scenes()
    if name in shipped:
        return _from_text(shipped[name], name, f"scene {name}")
    kinds = sorted({n.partition(":")[0] for n in known} | shipped.keys())
    raise UnknownName(f"no object named {kind!r}. Known: {', '.join(kinds)}.{suggestion(kind, kinds)}")


def kinds_in(scene: str) -> tuple[str, ...]:
    """Return the terms of the object in a scene, by the name of that. Raises UnknownName and ConfigError."""
    if scene == "none":
        return ()
    return find(numbered(scene)[0]).kinds


def instance_of(spec: ObjectSpec, rng: np.random.Generator | None, number: int | None = None) -> Instance:
    """Return an instance drawn from the spec's spreads; with no generator, the spec's own figures, centred.

    With a number it is one certain thing: its stiffness and width follow from the kind and the number, the same
    in every state and every trial, and only its placement is drawn from `rng`.
    """
    draws = rng.standard_normal(5).tolist() if rng is not None else [0.0] * 5
    if rng is not None and number is not None:
        letters = spec.name.partition(":")[0].encode()
        draws[:2] = np.random.default_rng([number, *letters]).standard_normal(2).tolist()
    # Lognormal, so that no draw makes a stiffness negative; two standard deviations at the most elsewhere.
    stiffer = math.exp(spec.stiffness_spread * draws[0])
    clipped = [min(max(d, -2.0), 2.0) for d in draws]
    parameters = [
        params._make(
            [value * stiffer if stiff else value for value, stiff in zip(params, which, strict=True)]
        )
        for params, which in spec.stiff_parts
    ]
    return Instance(
        spec=spec,
        width_m=spec.width_m + spec.width_spread_m * clipped[1],
        offset_m=spec.offset_m + spec.offset_spread_m * clipped[2],
        share=min(spec.share + spec.share_spread * clipped[3], 1.0),
        table_n=spec.friction * spec.mass_kg * GRAVITY_M_S2,
        kinds=spec.kinds,
        terms=tuple(parameters),
        patch_row=0.7 * clipped[4],
    )


def cell_weights(patch: str, row: float) -> tuple[float, ...]:
    """Return what part of the force on the fifteen cells each of them carries, tip row first; they sum to 1.

    A line lies across the pad (an upright bottle): its pressure falls off over about a row. A face loads all
    cells alike. A point loads the cells about it.
    """
    weights = []
    for i in range(15):
        r, c = i // 3 - 2 - row, i % 3 - 1
        if patch == "face":
            weights.append(1.0)
        elif patch == "line":
            weights.append(math.exp(-r * r))
        else:
            weights.append(math.exp(-(r * r + c * c) / 0.5))
    total = sum(weights)
    return tuple(weight / total for weight in weights)


@cache
def nearest_the_middle(cells: int) -> frozenset[int]:
    """Return which cells of the gripping face, of 0 to 14, lie nearest its middle: so many of them."""
    # Rows are 6 mm apart, columns 5.6 mm.
    return frozenset(
        sorted(range(15), key=lambda i: math.hypot(6.0 * (i // 3 - 2), 5.6 * (i % 3 - 1)))[:cells]
    )


@cache
def shipped_scenes() -> Mapping[str, str]:
    """Return the text of the scenes that come with the simulator, by name; `specs/scenes` of a checkout."""
    folder = files("graspsense_sim_gripper").joinpath("scenes")
    return {
        one.name.removesuffix(".toml"): one.read_text(encoding="utf-8")
        for one in sorted(folder.iterdir(), key=lambda one: one.name)
        if one.name.endswith(".toml")
    }


def _of_file(path: Path) -> ObjectSpec:
    try:
        text = path.read_text(encoding="utf-8")
    except FileNotFoundError:
        raise ConfigError(f"no scene file {str(path)!r} (looked in {Path.cwd()})") from None
    except UnicodeDecodeError as error:
        raise ConfigError(f"{path}: is no UTF-8 text ({error})") from error
    except OSError as error:
        raise ConfigError(f"{path}: cannot be read: {error.strerror}") from error
    return _from_text(text, path.stem, str(path))


@cache
def _from_text(text: str, name: str, where: str) -> ObjectSpec:
    """Return the object that a scene file describes; `where` names the file in errors."""
    try:
        table = tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise ConfigError(f"{where}: is no TOML: {error}") from error
    problems: list[str] = []
    known = fields_dict(ObjectSpec).keys() - {"name", "reasons", "file"}
    values: dict[str, Any] = {"name": name, "file": where}
    for key, entry in table.items():
        if key not in known:
            problems.append(f"{key}: no such key. Known: {', '.join(sorted(known))}.{suggestion(key, known)}")
        elif key in ("summary", "patch", "held"):
            wanted = bool if key == "held" else str
            if not isinstance(entry, wanted):
                problems.append(f"{key}: {entry!r} is no {'true or false' if key == 'held' else 'text'}")
            values[key] = entry
        elif key != "terms":
            values[key] = _number(entry, key, problems, negative=key == "offset_m")
    if "width_m" not in table:
        problems.append("width_m: is not given, and nothing has no width")
    tables = table.get("terms", [])
    if not isinstance(tables, list) or not all(isinstance(one, dict) for one in tables):
        problems.append("terms: write a table [[terms]] for each")
        tables = []
    terms: list[tuple[str, Mapping[str, float]]] = []
    for i, one in enumerate(tables, 1):
        called = f"[[terms]] {i} ({one.get('type')})"
        term = _term(
            one,
            called,
            f"{called} ",
            problems,
            lambda where, entry: _number(entry, where, problems),
        )
        if term is not None:
            terms.append(term)
    if not problems:
        try:
            return _sorted_spec(values, terms)
        except ValueError as error:
            problems.append(str(error.args[0]))
    raise ConfigError("\n".join(f"{where}: {problem}" for problem in problems))


def _number(entry: Any, called: str, problems: list[str], negative: bool = False) -> float:
    """Return the entry as a number; what is wrong with it is added to the problems."""
    if isinstance(entry, bool) or not isinstance(entry, int | float):
        problems.append(f"{called}: {entry!r} is no number")
    elif not math.isfinite(entry):
        problems.append(f"{called}: {entry!r} is no finite number")
    elif entry < 0.0 and not negative:
        problems.append(f"{called}: {entry!r} is negative")
    else:
        return float(entry)
    return 0.0


def _sorted_spec(values: Mapping[str, Any], terms: list[tuple[str, Mapping[str, float]]]) -> ObjectSpec:
    order = in_order([kind for kind, _ in terms])
    return ObjectSpec(**values, terms=tuple(terms[i] for i in order))


def _term(
    table: Mapping[str, Any],
    called: str,
    prefix: str,
    problems: list[str],
    number: Callable[[str, Any], float],
) -> tuple[str, Mapping[str, float]] | None:
    """Return the term's only name and its parameters, or None where it cannot be read at all.

    `number` reads one figure, given where it stands: `prefix` and its key.
    """
    try:
        kind, term = find_term(str(table.get("type", "")))
    except UnknownName as error:
        problems.append(f"{called}: {error}")
        return None
    names: list[str] = list(term.params._fields)
    given = [key for key in table if key != "type"]
    problems += [
        f"{called}: no such key {key!r}. Known: {', '.join(names)}.{suggestion(key, names)}"
        for key in given
        if key not in names
    ]
    missing = [key for key in names if key not in table and key not in term.params._field_defaults]
    if missing:
        problems.append(f"{called}: missing {', '.join(missing)}")
    before = len(problems)
    found = {key: number(f"{prefix}{key}", table[key]) for key in given if key in names}
    if len(problems) == before:
        problems += [
            f"{called} {key}: must be greater than 0"
            for key in found
            if key in term.positive and found[key] <= 0.0
        ]
    return kind, found


def _catalogued(name: str, table: Mapping[str, Any]) -> ObjectSpec:
    """Return an entry of the catalogue: every figure with its reason, nothing left to a default."""
    reasons: dict[str, str] = {}
    values: dict[str, Any] = {"name": name}
    for key, entry in table.items():
        if key == "terms":
            continue
        values[key] = entry if key in ("summary", "patch") else _figure(f"{name}.{key}", entry, reasons)
    fields = fields_dict(ObjectSpec)
    unknown = values.keys() - fields.keys()
    missing = fields.keys() - values.keys() - {"terms", "reasons", "offset_m", "held", "file"}
    if unknown or missing:
        raise ConfigError(f"object {name!r}: unknown {sorted(unknown)}, missing {sorted(missing)}")
    problems: list[str] = []
    terms = []
    for one in table.get("terms", []):
        kind = one.get("type")
        term = _term(
            one,
            f"object {name!r}, term {kind!r}",
            f"{name}.{kind}.",
            problems,
            lambda where, entry: _figure(where, entry, reasons),
        )
        if term is not None:
            terms.append(term)
    if problems:
        raise ConfigError("\n".join(problems))
    try:
        return _sorted_spec({**values, "reasons": reasons}, terms)
    except ValueError as error:
        raise ConfigError(f"object {name!r}: {error}") from error


def _figure(where: str, entry: Any, reasons: dict[str, str]) -> float:
    if not isinstance(entry, Mapping) or set(entry) != {"value", "reason"} or not entry["reason"]:
        raise ConfigError(f"{where}: write {{ value = NUMBER, reason = TEXT }}, not {entry!r}")
    value = entry["value"]
    if isinstance(value, bool) or not isinstance(value, int | float) or not math.isfinite(value):
        raise ConfigError(f"{where}: {value!r} is no finite number")
    if value < 0.0:
        raise ConfigError(f"{where}: {value!r} is negative")
    reasons[where] = entry["reason"]
    return float(value)
