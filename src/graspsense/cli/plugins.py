"""`graspsense plugins`: what is installed, what does not work and why, whether it conforms, and a new one."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path
from textwrap import wrap
from typing import Any

import attrs
import click

from graspsense.cli.output import echo_values, json_option
from graspsense.cli.terminal import Style, Subcommands, echo, echo_entry, echo_table, state_style
from graspsense.core.components.entries import TABLE_OF_ROLE
from graspsense.core.components.firstparty import DISTRIBUTION, SHIPPED
from graspsense.core.components.registry import (
    Component,
    Plugins,
    PluginStatus,
    canonical,
    installed,
    installed_sources,
)
from graspsense.core.components.registry.discovery import disabled_in_config, write_disabled
from graspsense.core.files.whole_file import write_whole
from graspsense.core.settings.settings_file import key_facts
from graspsense.core.values.errors import ConfigError, ExitCode, PluginUnavailable, UnknownName, suggestion


@click.group(cls=Subcommands)
def plugins() -> None:
    """List, check, disable and create plugins."""


@plugins.command("list")
@json_option("Print JSON: a list with one object per component.")
def list_plugins() -> None:
    """List all components and plugins, and report broken, outdated, slow and duplicate ones."""
    loaded = installed()
    rows = _rows(loaded)
    echo_values(rows)
    columns = ("role", "name", "distribution", "version", "state")
    echo_table(
        [*(key.upper() for key in columns), "WHAT"],
        [
            [_line(text) for text in (*(row[key] or "-" for key in columns), row["reason"] or row["summary"])]
            for row in rows
        ],
        {"STATE": state_style},
    )
    advice = list(
        dict.fromkeys(f"{row['distribution']}: {sentence}" for row in rows for sentence in row["advice"])
    )
    advice += loaded.unknown_names
    if advice:
        echo("\nTo be done:", Style.CAUTION)
        for sentence in advice:
            echo(f"  {sentence}", indent=2)


@plugins.command()
@click.argument("name")
@json_option()
def show(name: str) -> None:
    """Show a distribution or a component (NAME or DISTRIBUTION/NAME): hooks, keys, and why it fails."""
    loaded = installed()
    statuses = [status for status in loaded.statuses if status.distribution == canonical(name)]
    components = [
        component
        for component in loaded.components()
        if name in (component.name, component.qualified) or component.distribution == canonical(name)
    ]
    if not statuses and not components:
        raise loaded.unknown(name)
    echo_values(
        {
            "plugins": [attrs.asdict(status) for status in statuses],
            "components": [_described(component) for component in components],
        }
    )
    texts = [_status_text(status) for status in statuses] + [
        _component_text(component) for component in components
    ]
    echo("\n\n".join(texts), indent=4)


@plugins.command()
@click.argument("name")
@click.option("-o", "keys", metavar="KEY=VALUE", multiple=True, help="Setting for checking a component.")
@click.option(
    "--unplugged",
    metavar="KEY=VALUE",
    multiple=True,
    help="Setting with which the gripper disappears during use.",
)
@click.option(
    "--absent", metavar="KEY=VALUE", multiple=True, help="Setting with which the gripper is not found."
)
@click.option(
    "--wheel/--no-wheel",
    default=True,
    help="Build a wheel of an editable installation and check its contents.",
)
@click.option(
    "--data",
    metavar="NAME=FOLDER",
    multiple=True,
    help="Folder with sound examples for a reader of recordings.",
)
@json_option("Print JSON: counts and every result.")
@click.pass_context
def check(
    ctx: click.Context,
    name: str,
    keys: Sequence[str],
    unplugged: Sequence[str],
    absent: Sequence[str],
    wheel: bool,
    data: Sequence[str],
) -> None:
    """Check a component (NAME or DISTRIBUTION/NAME), or a distribution with all its components.

    Ends with 1 where something does not hold. A gripper is opened and moved: with real hardware stand by it.
    """
    from graspsense.testing.conformance import examine

    examined = examine(
        name,
        keys=_settings(keys),
        unplugged=_settings(unplugged) if unplugged else None,
        absent=_settings(absent) if absent else None,
        wheel=wheel,
        data=dict(_named_folder(text) for text in data),
    )

    def told(result: Any) -> None:
        text = f": {result.text}" if result.text else ""
        line = f"{result.subject}  {result.check}{text}"
        style = None if result.state == "passed" else state_style(result.state)
        echo_entry(result.state, line, style, width=9, err=True)

    report = examined.report(told)
    echo_values(
        {
            "conforms": not report.failures,
            "failures": report.failures,
            "results": [attrs.asdict(result) for result in report.results],
        }
    )
    echo(report.counts(), indent=2)
    echo("does not conform:", Style.BAD) if report.failures else echo("conforms", Style.GOOD)
    for failure in report.failures:
        echo(f"  {failure}", indent=2)
    for result in report.results:
        if result.untried:
            echo_entry("not tried", f"{result.check}: {result.text}")
    ctx.exit(ExitCode.CHECK_FAILED if report.failures else 0)


@plugins.command()
@click.argument("name")
@click.option(
    "--role",
    "roles",
    required=True,
    multiple=True,
    metavar="ROLE",
    help="Role of a component; give it several times for several. An unknown role lists all of them.",
)
@click.option("--folder", metavar="DIR", help="Folder of the package.  [default: ./NAME]")
@click.option(
    "--mujoco",
    "model",
    metavar="MODEL.xml",
    help="Write only a gripper file, NAME.toml, for a MuJoCo model (--role sensor-backend).",
)
def new(name: str, roles: tuple[str, ...], folder: str | None, model: str | None) -> None:
    """Create the package of a new plugin, with tests, for one role or for several that fit together."""
    from graspsense.scaffold.make import make

    if model is not None:
        _write_gripper_file(name, roles, Path(folder or "."), model)
        return
    for line in make(name, roles, Path(folder or name)):
        echo(line, indent=2)


def _write_gripper_file(name: str, roles: tuple[str, ...], folder: Path, model: str) -> None:
    """Write a gripper file for a MuJoCo model; say what was found, and what is left to fill in."""
    from graspsense.scaffold.make import check_name

    if roles != ("sensor-backend",):
        raise ConfigError("a MuJoCo model is a gripper: --mujoco is given with --role sensor-backend alone")
    check_name(name)
    path = folder / f"{name}.toml"
    if path.exists():
        raise ConfigError(f"{path} is there already: give another name, or --folder")
    backend: Any = installed().find("sensor-backend", "mujoco").component_class()
    draft = backend.drafted(model, folder)
    folder.mkdir(parents=True, exist_ok=True)
    write_whole(path, draft.text.encode(), replace=False)
    echo(f"{path} has a gripper file. Found:", indent=2)
    for line in draft.decided:
        echo(f"  {line}", indent=4)
    echo("Left to fill in or to look at:")
    for line in draft.left:
        echo(f"  {line}", indent=4)
    echo(f"  graspsense run --gripper mujoco -o gripper.file={path} -o classifier.type=none", indent=2)


@plugins.command()
@click.argument("distribution")
def disable(distribution: str) -> None:
    """Switch the plugins of a distribution off: they are no longer imported."""
    name = canonical(distribution)
    known = {source.distribution for source in installed_sources()} - {DISTRIBUTION}
    if name not in known:
        raise UnknownName(
            f"no installed plugin of a distribution {distribution!r}. Known: {', '.join(sorted(known)) or 'none'}."
            f"{suggestion(name, known)}"
        )
    path = write_disabled({*map(canonical, disabled_in_config()), name})
    echo(f"{name} is disabled, in {path}; `graspsense plugins enable {name}` takes it back")


@plugins.command()
@click.argument("distribution")
def enable(distribution: str) -> None:
    """Switch the plugins of a distribution on again."""
    name, names = canonical(distribution), {canonical(other) for other in disabled_in_config()}
    if name not in names:
        raise UnknownName(f"{name} is not disabled. Disabled are: {', '.join(sorted(names)) or 'none'}")
    path = write_disabled(names - {name})
    echo(f"{name} is enabled again, in {path}")


def _named_folder(option: str) -> tuple[str, str]:
    """Return the name and the folder in `NAME=FOLDER`. Raises ConfigError."""
    name, mark, folder = option.partition("=")
    if not (name and mark and folder):
        raise ConfigError(
            f"--data {option!r}: write NAME=FOLDER, the data set and the folder of its examples"
        )
    return name, folder


def _settings(options: Sequence[str]) -> dict[str, Any]:
    """Return the keys that options like `-o port=/dev/ttyUSB0` set. Raises ConfigError."""
    # Imported here, as below: listing plugins needs no conversion of settings, which takes longer than all else.
    from graspsense.core.settings.layers import Merged, option_layers

    layers, complaints = option_layers(options)
    if complaints:
        example = "TABLE.KEY=VALUE, as in -o run.seed=3"
        raise ConfigError("\n".join(complaints).replace(example, "KEY=VALUE"))
    merged = Merged()
    for layer in layers:
        merged.add((), layer.values, layer)
    return merged.values


def _rows(loaded: Plugins) -> list[dict[str, Any]]:
    """Return one row a component; one for a plugin without any; one for a component that is not installed."""
    advice: dict[str, tuple[str, ...]] = {}
    for status in loaded.statuses:
        advice[status.distribution] = (*advice.get(status.distribution, ()), *_advice(status))
    rows = [
        _row(component, component.role, component.name, "loaded", component.entry.summary)
        | {"advice": [*_clash(component, loaded), *advice[component.distribution]]}
        for component in loaded.components()
    ]
    bringing = {component.distribution for component in loaded.components()}
    rows += [
        _row(status, None, status.entry_point, status.state, ", ".join(status.hooks), status.reason)
        | {"advice": list(advice[status.distribution])}
        for status in loaded.statuses
        if status.state != "loaded" or status.distribution not in bringing
    ]
    rows += [
        _row(shipped, role, name, "not installed", reason=shipped.hint)
        for shipped in SHIPPED
        if shipped.distribution not in advice
        for role in TABLE_OF_ROLE
        for name in shipped.names.get(role, ())
    ]
    return rows


def _row(
    whose: Any, role: str | None, name: str, state: str, summary: str = "", reason: str = ""
) -> dict[str, Any]:
    return {
        "role": role,
        "name": name,
        "distribution": whose.distribution,
        "version": getattr(whose, "version", None),
        "state": state,
        "summary": summary,
        "reason": reason,
        "advice": [],
    }


def _advice(status: PluginStatus) -> tuple[str, ...]:
    """Return what is to be done about a plugin, broken or not."""
    if status.state != "broken":
        return status.advice
    way_out = f"`graspsense plugins show {status.distribution}` has the whole of it"
    if status.distribution != "graspsense":
        way_out += f", `graspsense plugins disable {status.distribution}` leaves it out"
    return (f"broken: {_line(status.reason)}; {way_out}",)


def _clash(component: Component, loaded: Plugins) -> tuple[str, ...]:
    """Return what is to be done where others use the name of this component."""
    others = loaded.namesakes(component)
    if not others:
        return ()
    return (
        f"the {component.kind} name {component.name!r} is also that of {', '.join(others)}: write "
        f'{component.table}.type = "{component.qualified}", or disable one of them',
    )


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
    lines += [f"  to be done   {sentence}" for sentence in status.advice]
    if status.traceback:
        lines += ["", status.traceback.rstrip()]
    return "\n".join(lines)


def _described(component: Component) -> dict[str, Any]:
    """Return what a component declares as JSON values; where its class cannot be used here, `reason` says why."""
    from graspsense.core.components.strict import keys_of

    names = ("role", "name", "qualified", "distribution", "version")
    described = {name: getattr(component, name) for name in names}
    keys, entry, reason = {}, component.entry, ""
    try:
        keys = keys_of(component.config_class())
        component.component_class()
    except PluginUnavailable as error:
        reason = str(error)
    with suppress(PluginUnavailable):
        entry = component.declared()
    return {**described, "entry": attrs.asdict(entry), "keys": keys, "reason": reason}


def _component_text(component: Component) -> str:
    described = _described(component)
    entry = {key: value for key, value in described["entry"].items() if value is not None}
    lines = [f"{component.role} {component.qualified} {component.version}", f"  {entry['summary']}"]
    lines.append(f"  target       {entry['target']}")
    for key in ("channels", "requires", "accepts", "commands", "alternatives"):
        if key in entry:
            lines.append(f"  {key:<11}  {', '.join(map(_item, entry[key])) or 'none'}")
    if "features" in entry:
        lines.append("  features, with their units and meanings:")
        lines += [f"    {_item(feature)}: {feature['meaning']}" for feature in entry["features"]]
    if described["reason"]:
        lines.append(f"  not usable here: {described['reason']}")
    if described["keys"]:
        lines.append(
            f"  keys of [{component.table}], with their types, units, ranges, defaults and meanings:"
        )
        lines += _key_lines(described["keys"], "    ")
    return "\n".join(lines)


def _item(declared: Any) -> str:
    """Return a channel or a feature in words; the name of a kind of command as it is."""
    if isinstance(declared, str):
        return declared
    rate_hz = declared.get("rate_hz", 0.0)
    return f"{declared['name']} in {declared['unit']}" + f" at {rate_hz:g} Hz" * bool(rate_hz)


def _key_lines(keys: dict[str, dict[str, Any]], indent: str) -> list[str]:
    lines = []
    for key, declaration in keys.items():
        facts = [
            declaration["type"],
            *(fact for fact in key_facts(declaration) if not fact.startswith("one of")),
        ]
        lines.append(f"{indent}{key}: {'; '.join(facts)}")
        text = declaration["meaning"] or "no meaning is declared"
        lines += wrap(text, 100, initial_indent=f"{indent}    ", subsequent_indent=f"{indent}    ")
        lines += _key_lines(declaration.get("keys", {}), f"{indent}    ")
    return lines
