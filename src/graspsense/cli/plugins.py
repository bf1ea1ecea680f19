"""`graspsense plugins`: what is installed, what does not work and why."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import attrs
import click

from graspsense.cli.output import echo_json, echo_table

if TYPE_CHECKING:
    from graspsense.core.plugins import Component, Plugins, PluginStatus


@click.group()
def plugins() -> None:
    """Show what is installed and whether it works."""


@plugins.command("list")
@click.option("--json", "as_json", is_flag=True, help="JSON on stdout: a list, one object a component.")
def list_plugins(as_json: bool) -> None:
    """List every component, and every plugin that brings none or does not work."""
    from graspsense.core.plugins import installed

    rows = _rows(installed())
    if as_json:
        echo_json(rows)
        return
    columns = ("role", "name", "distribution", "version", "state")
    table = [[*(row[key] or "-" for key in columns), row["reason"] or row["summary"]] for row in rows]
    echo_table([*(key.upper() for key in columns), "WHAT"], [[_line(cell) for cell in row] for row in table])


@plugins.command()
@click.argument("name")
@click.option("--json", "as_json", is_flag=True, help="JSON on stdout.")
def show(name: str, as_json: bool) -> None:
    """Show a distribution or a component (NAME or DISTRIBUTION/NAME): hooks, keys, and why it fails."""
    from graspsense.core.errors import UnknownName, suggestion
    from graspsense.core.plugins import canonical, installed

    loaded = installed()
    statuses = [status for status in loaded.statuses if status.distribution == canonical(name)]
    components = [
        one
        for one in loaded.components()
        if name in (one.name, one.qualified) or one.distribution == canonical(name)
    ]
    if not statuses and not components:
        known = sorted(
            {
                *(status.distribution for status in loaded.statuses),
                *(one.name for one in loaded.components()),
            }
        )
        raise UnknownName(
            f"no plugin or component named {name!r}. Known: {', '.join(known)}.{suggestion(name, known)}"
        )
    if as_json:
        echo_json(
            {
                "plugins": [attrs.asdict(status) for status in statuses],
                "components": [_described(one) for one in components],
            }
        )
        return
    texts = [_status_text(status) for status in statuses] + [_component_text(one) for one in components]
    click.echo("\n\n".join(texts))


def _rows(loaded: Plugins) -> list[dict[str, Any]]:
    """Return one row a component; one for a plugin without any; one for a component that is not installed."""
    from graspsense.core.firstparty import SHIPPED

    rows = [
        _row(one.role, one.name, one.distribution, one.version, "loaded", one.entry.summary)
        for one in loaded.components()
    ]
    bringing = {one.distribution for one in loaded.components()}
    rows += [
        _row(
            None,
            status.entry_point,
            status.distribution,
            status.version,
            status.state,
            ", ".join(status.hooks),
            status.reason,
        )
        for status in loaded.statuses
        if status.state != "loaded" or status.distribution not in bringing
    ]
    found = {status.distribution for status in loaded.statuses}
    rows += [
        _row(role, name, shipped.distribution, None, "not installed", "", shipped.hint)
        for (role, name), shipped in SHIPPED.items()
        if shipped.distribution not in found
    ]
    return rows


def _row(
    role: str | None,
    name: str,
    distribution: str,
    version: str | None,
    state: str,
    summary: str,
    reason: str = "",
) -> dict[str, Any]:
    return {
        "role": role,
        "name": name,
        "distribution": distribution,
        "version": version,
        "state": state,
        "summary": summary,
        "reason": reason,
    }


def _line(text: str) -> str:
    return text.partition("\n")[0]


def _status_text(status: PluginStatus) -> str:
    lines = [
        f"{status.distribution} {status.version}",
        f"  entry point  {status.entry_point} = {status.module}",
        f"  state        {status.state}" + (f": {status.reason}" if status.reason else ""),
    ]
    if status.hooks:
        lines.append(f"  hooks        {', '.join(status.hooks)}")
    if status.traceback:
        lines += ["", status.traceback.rstrip()]
    return "\n".join(lines)


def _described(component: Component) -> dict[str, Any]:
    keys, reason = _keys(component)
    return {
        "role": component.role,
        "name": component.name,
        "qualified": component.qualified,
        "distribution": component.distribution,
        "version": component.version,
        "entry": attrs.asdict(component.entry),
        "keys": keys,
        "reason": reason,
    }


def _component_text(component: Component) -> str:
    entry = attrs.asdict(component.entry, recurse=False)
    lines = [f"{component.role} {component.qualified} {component.version}", f"  {entry['summary']}"]
    for key in ("target", "config"):
        lines.append(f"  {key:<11}  {entry[key]}")
    for key in ("channels", "requires"):
        if key in entry:
            names = [
                f"{one.name} in {one.unit}" + f" at {one.rate_hz:g} Hz" * bool(one.rate_hz)
                for one in entry[key]
            ]
            lines.append(f"  {key:<11}  {', '.join(names) or 'none'}")
    for key in ("accepts", "commands"):
        if key in entry:
            lines.append(f"  {key:<11}  {', '.join(entry[key]) or 'none'}")
    if "features" in entry:
        lines.append(f"  features     {', '.join(f'{name} in {unit}' for name, unit in entry['features'])}")
    keys, reason = _keys(component)
    if reason:
        lines.append(f"  not usable here: {reason}")
    elif keys:
        lines.append(f"  keys of [{component.table}], with their types and defaults:")
        lines += [f"    {key}: {one['type']}" + _default_text(one) for key, one in keys.items()]
    return "\n".join(lines)


def _default_text(key: dict[str, Any]) -> str:
    from graspsense.core.config import toml_value

    if key["required"]:
        return ", must be given"
    return ", not set" if key["default"] is None else f" = {toml_value(key['default'])}"


def _keys(component: Component) -> tuple[dict[str, dict[str, Any]], str]:
    """Return the keys of a component's config, or why they cannot be told."""
    from graspsense.core.errors import PluginUnavailable
    from graspsense.core.strict import keys_of

    try:
        return keys_of(component.config_class()), ""
    except PluginUnavailable as error:
        return {}, str(error)
