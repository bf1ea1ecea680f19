"""Settings: the components of a pipeline, and the value and the origin of each of their keys.

Settings come in layers, each of which overrides those before: defaults of the config classes, the pipeline file with
the files that it extends, an experiment, options (`-o a.b=VALUE`), named flags. The `type` of each table is resolved
first. Then only the config class of the selected component is imported, and the rest of the table becomes its instance.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from typing import Any, Final, cast

from attrs import evolve, fields, frozen

from graspsense.core.components.entries import TABLE_OF_ROLE, Role
from graspsense.core.components.registry import Component, Plugins, installed
from graspsense.core.components.run_config import RunConfig
from graspsense.core.components.setting import followed_settings
from graspsense.core.components.strict import (
    InvalidValue,
    ValidationFailed,
    all_keys,
    implausible_values,
    keys_of,
    plain,
    shown,
    structured,
)
from graspsense.core.files.toml_text import KeyPath, toml_value
from graspsense.core.settings.layers import (
    Flag,
    Layer,
    Merged,
    dotted,
    option_layers,
    pipeline_layers,
    typed_path,
)
from graspsense.core.settings.selected import ImplausibleSettings, SelectedComponent, listed_errors
from graspsense.core.values.errors import ConfigError, PluginUnavailable, UnknownName

NONE: Final = "none"
"""The `type` of a classifier table for a pipeline without a classifier."""

_ROLE_OF_TABLE: Final[dict[str, Role]] = {table: role for role, table in TABLE_OF_ROLE.items()}
_TABLES: Final = (*_ROLE_OF_TABLE, "run")


@frozen(eq=False, kw_only=True)
class Settings:
    """A resolved pipeline.

    `values` holds every key of every table as plain values, including defaults, with the qualified name as `type`; a
    key that is not set is None. `origins` gives the origin of each value: `default`, `lab.toml:7`, `-o` or the name
    of a flag. `pipeline` is the name or path that the user gave.
    """

    pipeline: str
    gripper: SelectedComponent
    controller: SelectedComponent
    features: SelectedComponent
    classifier: SelectedComponent | None
    run: RunConfig
    values: dict[str, dict[str, Any]]
    origins: dict[str, str]

    @property
    def chosen(self) -> tuple[SelectedComponent, ...]:
        """Gripper, controller, features, and the classifier if there is one."""
        return tuple(
            part
            for part in (self.gripper, self.controller, self.features, self.classifier)
            if part is not None
        )

    @property
    def held(self) -> str:
        """What `gripper.object` says that a simulated gripper holds; empty if the gripper has no such key."""
        return str(self.values["gripper"].get("object") or "")

    def keys(self, table: str) -> dict[str, dict[str, Any]]:
        """Return what each key of a table declares, as `keys_of` does."""
        selected = next((part for part in self.chosen if part.component.table == table), None)
        return keys_of(type(self.run if selected is None else selected.config))

    @property
    def components(self) -> dict[str, str]:
        """The `distribution/name version` of each component, by table."""
        return {
            part.component.table: f"{part.component.qualified} {part.component.version}"
            for part in self.chosen
        }


def resolve(
    pipeline: str = "default",
    *,
    plugins: Plugins | None = None,
    experiment: Layer | None = None,
    options: Sequence[str] = (),
    flags: Sequence[Flag] = (),
    force: bool = False,
) -> Settings:
    """Return the settings of a pipeline with options and flags.

    `pipeline` is the name of a pipeline or the path of a `.toml` file; `options` are as typed after `-o`; `plugins`
    are by default those of the process. `force` accepts values outside of their plausible ranges. Raises ConfigError
    that lists all errors, each with its file and line; it is ImplausibleSettings if there are no others.
    """
    plugins = installed() if plugins is None else plugins
    layers = pipeline_layers(pipeline, plugins)
    if experiment is not None:
        layers.append(experiment)
    typed, complaints = option_layers(options)
    layers += typed
    layers += [flag.layer() for flag in flags if flag.value is not None]
    return _resolved_layers(pipeline, layers, complaints, plugins, force=force)


def default_paths(tables: Sequence[str]) -> list[str]:
    """Return the paths of the keys that these tables of the default pipeline have, for a key that is misspelt."""
    try:
        settings = resolve()
    except ConfigError:
        return []
    return [path for table in tables for path in all_keys(settings.keys(table), table)]


def settings_from(values: Mapping[str, Any], called: str, plugins: Plugins | None = None) -> Settings:
    """Return the settings of complete tables, such as `Settings.values` or the content of a resolved file.

    `called` is their name in errors. Raises ConfigError.
    """
    given = {
        table: {key: value for key, value in keys.items() if value is not None}
        for table, keys in values.items()
    }
    plugins = installed() if plugins is None else plugins
    # These values have been accepted before.
    return _resolved_layers(called, [Layer(label=called, values=given)], [], plugins, force=True)


def _resolved_layers(
    pipeline: str, layers: Sequence[Layer], malformed: Sequence[str], plugins: Plugins, *, force: bool
) -> Settings:
    """Return the settings of these layers, of which each overrides those before. Raises ConfigError."""
    doubts: list[str] = []
    complaints: list[_Complaint] = list(malformed)
    classes: dict[str, type] = {}
    layers = [_tables_only(layer, complaints) for layer in layers]
    chosen: dict[str, SelectedComponent] = {}
    values: dict[str, dict[str, Any]] = {}
    origins: dict[str, str] = {}
    run: RunConfig | None = None
    for table in _TABLES:
        cls: type
        if table == "run":
            component, cls, called = None, RunConfig, "[run]"
            merged, followed = _merged(layers, table, None), frozenset[str]()
        else:
            selected = _component(layers, table, plugins, complaints)
            if selected is None:
                continue
            (component, cls), called = selected, selected[0].qualified
            merged = _merged(layers, table, component)
            if table == "controller" and "gripper" in chosen:
                _choose_sent_kind(merged, component, chosen["gripper"])
            followed = _follow(merged, cls, table, values)
        classes[table] = cls
        try:
            config: Any = structured({k: v for k, v in merged.values.items() if k != "type"}, cls, called)
        except ValidationFailed as misfit:
            complaints += [(merged.owner_of(problem.path), problem) for problem in misfit.under(table)]
            continue
        if not force:
            doubted = (value for value in implausible_values(config) if value.path[0] not in followed)
            doubts += [_in_a_line(merged.owner_of((table, *v.path)), v.under(table)) for v in doubted]
        if component is None:
            run = config
            values[table] = plain(config)
        else:
            chosen[table] = SelectedComponent(component, config)
            values[table] = {"type": component.qualified, **plain(config)}
        for path in _leaves(values[table], (table,)):
            owner = merged.owner.get(path)
            origins[dotted(path)] = owner.where(path) if owner else "default"
    if complaints:
        raise ConfigError(listed_errors([*_told(complaints, classes, plugins), *doubts]))
    if doubts:
        raise ImplausibleSettings(listed_errors(doubts))
    return Settings(
        pipeline=pipeline,
        gripper=chosen["gripper"],
        controller=chosen["controller"],
        features=chosen["features"],
        classifier=chosen.get("classifier"),
        run=cast("RunConfig", run),
        values=values,
        origins=origins,
    )


_Complaint = str | tuple[Layer | None, InvalidValue]
"""What is wrong in words, or a value with the layer that set it."""


def _told(complaints: Sequence[_Complaint], classes: Mapping[str, type], plugins: Plugins) -> list[str]:
    """Return what is wrong, line by line; a key that is unknown may mean one of any table."""
    known = [f"{table}.type" for table in classes if table in _ROLE_OF_TABLE]
    known += [path for table, cls in classes.items() for path in all_keys(keys_of(cls), table)]
    return [
        complaint
        if isinstance(complaint, str)
        else _in_a_line(complaint[0], _with_owners(complaint[1], plugins), known)
        for complaint in complaints
    ]


def _in_a_line(owner: Layer | None, problem: InvalidValue, known: Sequence[str] = ()) -> str:
    """Return a problem of a key in one line, with the origin of its value; `known` are the paths of all keys."""
    return owner.complain(problem, known) if owner else f"{dotted(problem.path)}: {problem.words(known)}"


def _with_owners(problem: InvalidValue, plugins: Plugins) -> InvalidValue:
    """Return the problem of an unknown key with the other components that have it."""
    table, *inner = map(str, problem.path)
    role = _ROLE_OF_TABLE.get(table)
    if problem.known is None or role is None:
        return problem
    path, names = ".".join(inner), []
    for component in plugins.components(role):
        with suppress(PluginUnavailable):
            if path in all_keys(keys_of(component.config_class())):
                names.append(toml_value(component.name))
    if not names:
        return problem
    return InvalidValue(problem.path, f"{problem.what} It is a key of {table}.type = {' or '.join(names)}")


def _choose_sent_kind(merged: Merged, controller: Component, gripper: SelectedComponent) -> None:
    """Set the key `sends` of a controller with several kinds of command, where nothing sets it."""
    try:
        entry = controller.declared()
        accepted = getattr(gripper.component.entry, "accepts", None)
        if accepted is None:
            accepted = gripper.declared.accepts
    except PluginUnavailable:
        return  # The wiring check reports it.
    if not entry.alternatives or "sends" in merged.values:
        return
    kind = next((name for name in (*entry.commands, *entry.alternatives) if name in accepted), None)
    if kind is not None and kind not in entry.commands:
        merged.values["sends"] = kind
        merged.owner[controller.table, "sends"] = Layer(
            label=f"{gripper.component.qualified} accepts {kind}", values={}
        )


def _follow(
    merged: Merged, config_class: type, table: str, values: Mapping[str, Mapping[str, Any]]
) -> frozenset[str]:
    """Give the keys that follow a key of a table before this one, and are not set, its value; return these keys."""
    given = set()
    defaults = {field.name: field.default for field in fields(config_class)}
    for key, path in followed_settings(config_class).items():
        owner, _, name = path.partition(".")
        value = values.get(owner, {}).get(name)
        if key not in merged.values and value is not None and value != defaults[key]:
            merged.values[key] = value
            merged.owner[table, key] = Layer(label=path, values={})
            given.add(key)
    return frozenset(given)


def without_followers(values: Mapping[str, Mapping[str, Any]]) -> dict[str, dict[str, Any]]:
    """Return complete tables without the keys that follow another one and have its value.

    Settings that are resolved from these tables and an option for the key that is followed are consistent again.
    """
    kept = {table: dict(keys) for table, keys in values.items()}
    for table, keys in kept.items():
        role, name = _ROLE_OF_TABLE.get(table), keys.get("type")
        if role is None or not isinstance(name, str):
            continue
        with suppress(UnknownName, PluginUnavailable):
            for key, path in followed_settings(installed().find(role, name).config_class()).items():
                owner, _, followed_key = path.partition(".")
                if key in keys and values.get(owner, {}).get(followed_key) == keys[key]:
                    del keys[key]
    return kept


def _tables_only(layer: Layer, complaints: list[_Complaint]) -> Layer:
    """Return the layer without keys that are not tables of a pipeline; add a complaint for each of them."""
    values = {}
    for key, value in layer.values.items():
        if key not in _TABLES:
            path = typed_path(layer) if layer.typed else (key,)
            complaints.append((layer, InvalidValue(path, f"a pipeline has no table {key!r}.", _TABLES)))
        elif not isinstance(value, Mapping):
            name = isinstance(value, str) and key != "run"
            advice = f": write {key}.type = {toml_value(value)}" if name else f": set a key of it, {key}.KEY"
            complaints.append(
                layer.complain(InvalidValue((key,), f"expected a table, found {shown(value)}{advice}"))
            )
        else:
            values[key] = value
    return evolve(layer, values=values)


def _component(
    layers: Sequence[Layer], table: str, plugins: Plugins, complaints: list[_Complaint]
) -> tuple[Component, type] | None:
    """Return the component that a table selects, and its config class; None, perhaps with complaints, for none."""
    role = _ROLE_OF_TABLE[table]
    path = (table, "type")
    setter = next((layer for layer in reversed(layers) if "type" in layer.values.get(table, {})), None)
    users = [layer for layer in layers if table in layer.values]
    if setter is None:
        if users or table != "classifier":
            names = ", ".join(component.name for component in plugins.components(role)) or "none"
            where = f"{users[-1].where((table,))}: " if users else ""
            kind = role.replace("-", " ")
            complaints.append(f"{where}{table}.type is not given: name a {kind}. Known: {names}")
        return None
    name = setter.values[table]["type"]
    if not isinstance(name, str):
        complaints.append(setter.complain(InvalidValue(path, f"expected text, found {shown(name)}")))
        return None
    if table == "classifier" and name == NONE:
        for layer in users:
            for key in layer.values[table]:
                if key != "type" and (layer.typed or layer is setter):
                    text = f'classifier.type is "{NONE}": choose one that has this key'
                    complaints.append(layer.complain(InvalidValue((table, key), text)))
        return None
    try:
        component = plugins.find(role, name)
        return component, component.config_class()
    except (UnknownName, PluginUnavailable) as error:
        complaints.append(setter.complain(InvalidValue(path, str(error))))
        return None


def _merged(layers: Sequence[Layer], table: str, component: Component | None) -> Merged:
    """Merge the layers of one table, without keys of files that are for another component."""
    merged = Merged()
    named: str | None = None
    for layer in layers:
        values = layer.values.get(table)
        if values is None:
            continue
        named = values.get("type", named)
        other = component is not None and named not in (None, component.name, component.qualified)
        if layer.typed or not other:
            merged.add((table,), values, layer)
    return merged


def _leaves(values: Mapping[str, Any], path: KeyPath) -> Iterator[KeyPath]:
    for key, value in values.items():
        if isinstance(value, Mapping) and value:
            yield from _leaves(value, (*path, key))
        else:
            yield (*path, key)
