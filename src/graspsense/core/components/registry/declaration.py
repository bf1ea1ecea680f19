"""What a component declares, taken from its class where its entry does not say it.

A class states its config by the parameter of its base class (`FeatureSet[PeakConfig]`) and the rest by attributes
named in `entries.DECLARED`. `channels` of a gripper may be a property of its settings, as for a hand whose fingers can
be exchanged.
"""

from __future__ import annotations

from typing import Any, get_args, get_origin

import attrs

from graspsense.core.components.entries import DECLARED, ComponentEntry, Role


class NotDeclared(Exception):
    """A class that does not declare what its entry leaves out; the text says what to add."""


def config_of(cls: type, base: type) -> type:
    """Return the config class with which a component class parametrises the base class of its role.

    Raises NotDeclared.
    """
    for ancestor in cls.__mro__:
        # Not by getattr: a class without a parametrised base inherits the attribute of one that has it.
        for parametrised in vars(ancestor).get("__orig_bases__", ()):
            origin = get_origin(parametrised)
            if isinstance(origin, type) and issubclass(origin, base):
                config = get_args(parametrised)[0]
                if isinstance(config, type):
                    return config
    raise NotDeclared(
        f"{cls.__name__} does not say what its settings are: write class {cls.__name__}({base.__name__}[Config]), "
        "where Config is an attrs class"
    )


def declared_by(cls: type, base: type, role: Role) -> tuple[str, ...]:
    """Return the names of `DECLARED` that this class or one between it and the base class of its role declares."""
    return tuple(
        name
        for name in DECLARED[role]
        if getattr(cls, name, None) is not getattr(base, name, None) and hasattr(cls, name)
    )


def left_out(entry: ComponentEntry, role: Role) -> tuple[str, ...]:
    """Return the names of `DECLARED` that the entry leaves to the class.

    An entry that declares its commands leaves no alternatives to them to the class.
    """
    of_entry = {name for name in DECLARED[role] if getattr(entry, name) is not None}
    if "commands" in of_entry:
        of_entry.add("alternatives")
    return tuple(name for name in DECLARED[role] if name not in of_entry)


def completed(entry: ComponentEntry, role: Role, cls: type, base: type, part: Any) -> ComponentEntry:
    """Return the entry with everything that it leaves out.

    `part` is an instance of `cls`, or `cls` itself where nothing depends on the settings. Raises NotDeclared, and what
    a property of the class raises.
    """
    of_class = declared_by(cls, base, role)
    values: dict[str, Any] = {}
    for name in left_out(entry, role):
        if name not in of_class and name in _ADVICE:
            raise NotDeclared(f"{cls.__name__} does not declare `{name}`: {_ADVICE[name]}")
        value = getattr(part, name)
        if isinstance(value, property):
            raise NotDeclared(f"its {name} depend on its settings, and these have no defaults")
        values[name] = value
    try:
        return attrs.evolve(entry, **values)
    except (TypeError, ValueError) as error:
        raise NotDeclared(f"{cls.__name__}: {error.args[0]}") from error


_ADVICE = {
    "channels": 'write channels = (Channel("gap", "m", 100.0), ...) in the class, all that `read` delivers',
    "accepts": 'write accepts = ("velocity",) in the class, the kinds of command that `apply` accepts',
    "requires": 'write requires = (Channel("gap", "m"), ...) in the class, or () if it needs none',
    "commands": 'write commands = ("velocity",) in the class, the kinds of command that `step` returns',
    "features": 'write features = (Feature("peak", "N", "largest force"), ...) in the class',
}
