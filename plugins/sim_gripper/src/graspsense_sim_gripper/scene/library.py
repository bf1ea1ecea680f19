"""Finding an object by name: in the catalogue, among the scenes that are shipped, or in a scene of the user.

A scene of the user is a file, or the text of such a file: then no file is needed.

In the catalogue every value has an origin and a reason; a scene file needs neither.
"""

from __future__ import annotations

import tomllib
from collections.abc import Mapping
from functools import cache
from importlib.resources import files
from pathlib import Path
from typing import Final

from graspsense.plugin_api import ObjectKind, UnknownName
from graspsense.simulator_api import fitted_results, given_claims, settings_text, suggestion
from graspsense_sim_gripper.scene.spec import (
    ObjectSpec,
    TomlTable,
    TomlValue,
    parse_scene,
    spec_of,
)

CONTAINERS: Final = ("odwalla", "naked", "can", "water")
"""The containers of Chitta, Piccoli and Sturm (ICRA 2010), section III.E: trials are simulated with them by default."""
SCENE_IN_MEMORY: Final = "scene in memory"
"""The name of an object that is given by the text of its scene."""


@cache
def catalogue() -> Mapping[str, ObjectSpec]:
    """Return every object of the catalogue in every state, by name (`odwalla:full_open`, `block`)."""
    text = files("graspsense_sim_gripper.scene").joinpath("catalogue.toml").read_text(encoding="utf-8")
    specs: dict[str, ObjectSpec] = {}
    for name, table in tomllib.loads(text).items():
        states = table.pop("states", None)
        if states is None:
            specs[name] = _entry(name, table)
            continue
        for state, extra in states.items():
            both = {**table, **extra, "terms": [*table.get("terms", []), *extra.get("terms", [])]}
            specs[f"{name}:{state}"] = _entry(f"{name}:{state}", both)
    return specs


@cache
def shipped_scenes() -> Mapping[str, str]:
    """Return the text of each scene that is installed with the simulator, by name.

    In a checkout, `specs/scenes` links to their folder.
    """
    folder = files("graspsense_sim_gripper.scene").joinpath("scenes")
    return {
        file.name.removesuffix(".toml"): file.read_text(encoding="utf-8")
        for file in sorted(folder.iterdir(), key=lambda file: file.name)
        if file.name.endswith(".toml")
    }


def object_kinds() -> tuple[ObjectKind, ...]:
    """Return the kinds of the catalogue with their states, in its order, and then the shipped scenes."""
    states: dict[str, list[str]] = {}
    fitted_to: dict[str, frozenset[str]] = {}
    given: dict[str, frozenset[str]] = {}
    for full_name, spec in catalogue().items():
        name, colon, state = full_name.partition(":")
        states.setdefault(name, []).extend([state] if colon else [])
        fitted_to[name] = fitted_to.get(name, frozenset()).union(spec.fitted_to)
        given[name] = given.get(name, frozenset()) | given_claims(spec)
    kinds = [
        ObjectKind(
            name=name,
            states=tuple(object_states),
            default=name in CONTAINERS,
            fitted_to=fitted_to[name],
            gives=given[name],
        )
        for name, object_states in states.items()
    ]
    return (*kinds, *(ObjectKind(name=name) for name in shipped_scenes() if name not in states))


def is_scene_text(name: str) -> bool:
    """Return whether this is the text of a scene file instead of a name: whether it has a line break."""
    return "\n" in name


def split_number(name: str) -> tuple[str, int | None]:
    """Return the name without the number of an instance, and the number or None; `can:full_open#3` gives 3.

    Of the text of a scene, a last line `#3` is the number. Raises UnknownName if the text after `#` is not a whole
    number.
    """
    if is_scene_text(name):
        text, _, last = name.rpartition("\n#")
        return (f"{text}\n", int(last)) if last.isascii() and last.isdigit() else (name, None)
    plain, mark, number = name.partition("#")
    if not mark:
        return plain, None
    if not (number.isascii() and number.isdigit()):
        raise UnknownName(f"object {name!r}: the number of an instance follows #, as in {plain}#3")
    return plain, int(number)


def find(name: str) -> ObjectSpec:
    """Return the object of this name, of the scene file if the name ends in `.toml`, or of the text of a scene.

    A name is looked up in the catalogue, and then among the shipped scenes. Raises UnknownName with the known names,
    ConfigError for a file or a text that cannot be read as an object.
    """
    if is_scene_text(name):
        return parse_scene(name, SCENE_IN_MEMORY, SCENE_IN_MEMORY)
    if name.endswith(".toml"):
        return parse_scene(settings_text(Path(name), name, "scene"), Path(name).stem, name)
    known = catalogue()
    if name in known:
        return known[name]
    kind, _, state = name.partition(":")
    states = [n.partition(":")[2] for n in known if n.startswith(f"{kind}:")]
    if kind in known:
        raise UnknownName(f"object {kind!r} has no states, but {name!r} names one. Write {kind}")
    if states and not state:
        raise UnknownName(f"object {kind!r} needs a state: {', '.join(states)}. Write {kind}:{states[0]}")
    if states:
        raise UnknownName(
            f"object {kind!r} has no state {state!r}. Known: {', '.join(states)}.{suggestion(state, states)}"
        )
    shipped = shipped_scenes()
    if name in shipped:
        return parse_scene(shipped[name], name, f"scene {name}")
    kinds = sorted({n.partition(":")[0] for n in known} | shipped.keys())
    raise UnknownName(
        f"no object named {kind!r}. Known: {', '.join(kinds)}, and none.{suggestion(kind, kinds)} A scene of your own "
        "is a file: write its name with .toml"
    )


def kinds_in(scene: str) -> tuple[str, ...]:
    """Return the kinds of the terms of a scene's object; none for `none`. Raises UnknownName and ConfigError."""
    if scene == "none":
        return ()
    return find(split_number(scene)[0]).kinds


def _entry(name: str, table: TomlTable) -> ObjectSpec:
    """Return the object of an entry of the catalogue, a scene whose numbers are tables: value, origin and reason."""
    reasons: dict[str, str] = {}
    fitted_to: set[str] = set()

    def plain(entry: TomlValue, where: str) -> TomlValue:
        if isinstance(entry, list):
            return [plain(term, f"{name}.{term['type']}") for term in entry]
        if not isinstance(entry, dict):
            return entry
        if "value" not in entry:
            return {key: plain(part, f"{where}.{key}") for key, part in entry.items()}
        reasons[where] = entry["reason"]
        fitted_to.update(fitted_results(entry["origin"]))
        return entry["value"]

    values = plain(table, name)
    more = {"name": name, "reasons": reasons, "fitted_to": tuple(sorted(fitted_to))}
    return spec_of(values, f"object {name!r}", more)
