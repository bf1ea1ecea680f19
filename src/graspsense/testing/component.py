"""Conformance checks of every component: its classes, its settings, its constructor."""

from __future__ import annotations

import contextlib
import sys
import tomllib
from collections.abc import Iterator, Mapping
from typing import Any, Final

import attrs

from graspsense.core.components.setting import unit_of_name
from graspsense.core.components.strict import all_keys, keys_of, plain
from graspsense.core.files.toml_text import toml_lines
from graspsense.core.settings.selected import build
from graspsense.core.values.errors import ConfigError, PluginUnavailable
from graspsense.testing.checks import CheckFailed, demand
from graspsense.testing.subject import Subject

ADVICE_ON_IMPORTS: Final = (
    "is the name right? what has to be installed goes into `dependencies` of its pyproject.toml, or, "
    "where that is not for everybody, into `needs` of the entry, in words"
)


def classes_can_be_imported(subject: Subject) -> None:
    """The class and its config class can be imported, and the class has every method and declaration of its role."""
    try:
        subject.component.config_class()
        subject.component.component_class()
        config = None
        with contextlib.suppress(ConfigError):  # the checks of the settings report it
            config = subject.config()
        # Channels that depend on settings without defaults are known only with these.
        if config is not None or not subject.component.channels_vary():
            subject.component.declared(config)
    except PluginUnavailable as error:
        if isinstance(error.__cause__, ImportError) and not subject.component.entry.needs:
            raise CheckFailed(f"{error}\n    {ADVICE_ON_IMPORTS}") from error
        raise


def config_name(subject: Subject) -> str:
    """Return the import string of its config class."""
    cls = subject.component.config_class()
    return f"{cls.__module__}:{cls.__qualname__}"


def settings_declare_their_meaning(subject: Subject) -> None:
    """Every key has a type, its meaning by `setting`, and its unit if its name ends in one."""
    for key, declaration in all_keys(keys_of(subject.component.config_class())).items():
        where, name = f"key {key!r}", key.rpartition(".")[2]
        demand(
            declaration["type"] != "None", f"{where} has no type: annotate it, as in `{name}: float = 1.0`"
        )
        demand(
            bool(declaration["meaning"]),
            f"{where} declares no meaning, so `graspsense config show` cannot tell it. Declare the key as in "
            f'`{name}: {declaration["type"]} = setting(default=..., meaning="What the value does.")`, with '
            "`from graspsense.plugin_api import setting`",
        )
        unit = unit_of_name(name)
        demand(
            bool(declaration["unit"]) or not unit,
            f'{where} ends like a value in {unit} and declares no unit: add unit="{unit}" to its `setting`, or '
            "rename it",
        )


def defaults_are_what_their_types_say(subject: Subject) -> None:
    """Every default has the annotated type of its key; an int is not a float."""
    cls: Any = subject.component.config_class()
    attrs.resolve_types(cls)
    for field in attrs.fields(cls):
        kind, default = field.type, field.default
        if kind in (float, int) and type(default) in (float, int, bool) and type(default) is not kind:
            raise CheckFailed(
                f"key {field.alias!r} of {config_name(subject)} is annotated {kind.__name__}, its default is "
                f"{default!r}: write {kind(default)!r}, or annotate it with what it is"
            )


def settings_survive_a_file(subject: Subject) -> None:
    """Settings written as TOML and read again are the same settings."""
    config = subject.config()
    again = build(subject.component, tomllib.loads("\n".join(toml_lines(plain(config)))))
    demand(
        plain(again) == plain(config),
        f"{config_name(subject)} read back from its own TOML is another: {plain(config)} became {plain(again)}. A "
        "converter or __attrs_post_init__ changes what was given: let it leave alone what it has made",
    )


def settings_cannot_be_changed(subject: Subject) -> None:
    """A config is frozen, so that the recorded settings are those of the run."""
    try:
        subject.config().changed = True
    except attrs.exceptions.FrozenInstanceError:
        return
    except AttributeError:  # it has slots, and no such key
        pass
    raise CheckFailed(
        f"{config_name(subject)} can be changed after it was made: decorate it with @frozen(kw_only=True) of attrs"
    )


def making_one_does_nothing(subject: Subject) -> None:
    """The constructor opens no file, device or connection, and does not prompt the user."""
    subject.component.component_class()
    config = subject.config()
    with watched(_DEEDS) as seen:
        subject.component.create(config)
    demand(
        not seen,
        f"the constructor of {subject.component.entry.target} does {', '.join(dict.fromkeys(seen))}: keep the "
        "config only, and do that where it is first needed (a gripper in `open`)",
    )


def summary_is_one_line(subject: Subject) -> None:
    """The summary is one line of text."""
    summary = subject.component.entry.summary
    demand(
        bool(summary.strip()) and "\n" not in summary and len(summary) <= 120,
        f"the summary is {summary!r}: say in one line of at most 120 characters what it is",
    )


_watching: tuple[Mapping[str, str], list[str]] | None = None


@contextlib.contextmanager
def watched(deeds: Mapping[str, str]) -> Iterator[list[str]]:
    """Collect which of these deeds the process does within the context, by an audit hook, which cannot be removed."""
    global _watching
    if _watching is None:
        sys.addaudithook(_heard)
    seen: list[str] = []
    _watching = deeds, seen
    try:
        yield seen
    finally:
        _watching = {}, []


def _heard(event: str, arguments: tuple[Any, ...]) -> None:
    deeds, seen = _watching or ({}, [])
    if event not in deeds:
        return
    path = str(arguments[0]) if arguments else ""
    # The import of a module reads files, which the constructor is not responsible for.
    if event != "open" or not path.endswith((".py", ".pyc", ".so", ".pyd", ".pth", ".zip")):
        seen.append(deeds[event] + (f" ({path})" if event == "open" else ""))


_DEEDS: Final = {
    "open": "open a file",
    "socket.connect": "connect to an address",
    "socket.bind": "bind an address",
    "builtins.input": "ask at the terminal",
    "subprocess.Popen": "start a program",
    "os.mkdir": "make a folder",
    "os.remove": "remove a file",
}
RUNS_CODE: Final = {"pickle.find_class": "unpickle", "marshal.loads": "load code", "exec": "run code"}
