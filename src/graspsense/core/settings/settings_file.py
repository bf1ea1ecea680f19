"""Resolved settings as a pipeline file, with comments that tell what each key means and where its value is from."""

from __future__ import annotations

import json
from collections.abc import Mapping
from textwrap import wrap
from typing import TYPE_CHECKING, Any

from graspsense import __version__
from graspsense.core.files.toml_text import toml_key, toml_value

if TYPE_CHECKING:
    from graspsense.core.settings.resolved import Settings


def to_toml(settings: Settings, origins: bool = False) -> str:
    """Return a complete pipeline file, which extends nothing and resolves to the same values.

    With `origins`, comments tell the meaning, unit, range and default of each key, and the origin of its value.
    """
    lines = [f"# Resolved by graspsense {__version__} from the pipeline {json.dumps(settings.pipeline)}."]
    versions = {part.component.table: part.component.version for part in settings.chosen}
    for table, values in settings.values.items():
        lines += ["", f"[{table}]"]
        declarations = settings.keys(table) if origins else {}
        for key, value in values.items():
            if key in declarations:
                lines += ["", *_comments(declarations[key])]
            line = (
                f"{toml_key(key)} = {toml_value(value)}"
                if value is not None
                else f"# {toml_key(key)} is not set"
            )
            notes = [f"version {versions[table]}"] if key == "type" else []
            if origins:
                path = f"{table}.{key}"
                inside = (
                    origin
                    for name, origin in settings.origins.items()
                    if name == path or name.startswith(f"{path}.")
                )
                notes += list(dict.fromkeys(inside))
            lines.append(f"{line:<40}  # {', '.join(notes)}" if notes else line)
    return "\n".join(lines) + "\n"


def _comments(declaration: Mapping[str, Any], name: str = "") -> list[str]:
    """Return what a key declares as comment lines, also what the keys of a table declare."""
    facts = "; ".join(key_facts(declaration))
    text = " ".join(fact for fact in (name, declaration["meaning"], f"[{facts}]" if facts else "") if fact)
    lines = wrap(text, 98, initial_indent="# ", subsequent_indent="#   ") if text else []
    for inner, inner_declaration in declaration.get("keys", {}).items():
        lines += _comments(inner_declaration, f"{inner}:")
    return lines


def key_facts(declaration: Mapping[str, Any]) -> list[str]:
    """Return unit, type, range and default of a key of `keys_of`, each in words."""
    facts = [declaration["unit"], declaration["allowed"]]
    if "|" in declaration["type"] and "'" in declaration["type"]:
        facts.append(f"one of {declaration['type'].replace(' | ', ', ')}")
    if declaration["plausible"]:
        facts.append(f"plausible {declaration['plausible']}")
    if declaration["required"]:
        facts.append("must be given")
    elif "keys" not in declaration:
        default = declaration["default"]
        facts.append("not set by default" if default is None else f"default {toml_value(default)}")
    return [fact for fact in facts if fact]
