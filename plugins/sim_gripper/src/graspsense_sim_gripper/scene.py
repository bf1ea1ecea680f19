"""From a name to what is simulated: the catalogue, and one sampled instance of one of its objects.

The catalogue is read strictly: an unknown key, a missing reason or a number out of range is an error that names
the object and the key.
"""

from __future__ import annotations

import math
import tomllib
from collections.abc import Mapping
from functools import cache
from importlib.resources import files
from typing import Any, Final

import numpy as np
from attrs import field, fields_dict, frozen
from attrs.validators import ge, gt, in_

from graspsense.plugin_api import ConfigError, UnknownName, suggestion
from graspsense_sim_gripper.terms import TERMS

GRAVITY_M_S2: Final = 9.80665
PATCHES: Final = ("line", "face", "point")


def _positive() -> float:
    return field(validator=gt(0.0))


def _not_negative() -> float:
    return field(validator=ge(0.0))


@frozen(kw_only=True)
class ObjectSpec:
    """An object in one of its states, as the catalogue has it. SI units; spreads are standard deviations."""

    name: str
    summary: str
    patch: str = field(validator=in_(PATCHES))
    """How it meets a pad: along a line, with a face, at a point."""
    width_m: float = _positive()
    width_spread_m: float = _not_negative()
    stiffness_spread: float = _not_negative()
    offset_spread_m: float = _not_negative()
    share: float = field(validator=gt(0.0))
    """Part of the force that lands on the fifteen cells."""
    share_spread: float = _not_negative()
    friction: float = _not_negative()
    """Coefficient of friction on the table."""
    mass_kg: float = _positive()
    terms: tuple[tuple[str, Mapping[str, float]], ...] = ()
    """Kind and parameters of each term, in the order of `TERMS`."""
    reasons: Mapping[str, str] = field(factory=dict)


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
    """Return every object in every state, by name (`odwalla:full_open`, `block`)."""
    text = files("graspsense_sim_gripper").joinpath("catalogue.toml").read_text(encoding="utf-8")
    specs: dict[str, ObjectSpec] = {}
    for name, table in tomllib.loads(text).items():
        states = table.pop("states", None)
        if states is None:
            specs[name] = _spec(name, table)
            continue
        for state, extra in states.items():
            both = {**table, **extra, "terms": [*table.get("terms", []), *extra.get("terms", [])]}
            specs[f"{name}:{state}"] = _spec(f"{name}:{state}", both)
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
    """Return the object of this name. Raises UnknownName with what there is."""
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
    kinds = sorted({n.partition(":")[0] for n in known})
    raise UnknownName(f"no object named {kind!r}. Known: {', '.join(kinds)}.{suggestion(kind, kinds)}")


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
    parameters = []
    for kind, values in spec.terms:
        scaled = {k: v * stiffer if k in _STIFFNESSES else v for k, v in values.items()}
        parameters.append(TERMS[kind][0](**scaled))
    return Instance(
        spec=spec,
        width_m=spec.width_m + spec.width_spread_m * clipped[1],
        offset_m=spec.offset_spread_m * clipped[2],
        share=min(spec.share + spec.share_spread * clipped[3], 1.0),
        table_n=spec.friction * spec.mass_kg * GRAVITY_M_S2,
        kinds=tuple(kind for kind, _ in spec.terms),
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


# A thicker wall is stiffer and as much stronger.
_STIFFNESSES: Final = frozenset({"k1_n_m", "k3_n_m3", "k_n_m", "hertz_n_m15", "crush_force_n"})


def _spec(name: str, table: Mapping[str, Any]) -> ObjectSpec:
    reasons: dict[str, str] = {}
    values: dict[str, Any] = {"name": name}
    for key, entry in table.items():
        if key == "terms":
            continue
        values[key] = entry if key in ("summary", "patch") else _figure(f"{name}.{key}", entry, reasons)
    unknown = values.keys() - fields_dict(ObjectSpec).keys()
    missing = fields_dict(ObjectSpec).keys() - values.keys() - {"terms", "reasons"}
    if unknown or missing:
        raise ConfigError(f"object {name!r}: unknown {sorted(unknown)}, missing {sorted(missing)}")
    terms = [_term(name, term, reasons) for term in table.get("terms", [])]
    order = list(TERMS)
    terms.sort(key=lambda term: order.index(term[0]))
    try:
        return ObjectSpec(**values, terms=tuple(terms), reasons=reasons)
    except ValueError as error:
        raise ConfigError(f"object {name!r}: {error}") from error


def _term(name: str, term: Mapping[str, Any], reasons: dict[str, str]) -> tuple[str, Mapping[str, float]]:
    kind = term.get("type")
    if kind not in TERMS:
        raise ConfigError(f"object {name!r}: no term {kind!r}. Known: {', '.join(TERMS)}")
    wanted = set(TERMS[kind][0]._fields)  # type: ignore[attr-defined]
    given = term.keys() - {"type"}
    if wanted != given:
        raise ConfigError(
            f"object {name!r}, term {kind!r}: unknown {sorted(given - wanted)}, missing {sorted(wanted - given)}"
        )
    return kind, {key: _figure(f"{name}.{kind}.{key}", term[key], reasons) for key in sorted(given)}


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
