"""The plugins of a process: loading them, finding their parts by role and name, and calling their hooks.

pluggy's own loader ends at the first plugin that fails, and drops the second of two distributions that use the same
entry-point name. Nothing is loaded at `import graspsense`; the first call of `installed()` loads all plugins.
"""

from __future__ import annotations

import contextlib
import os
import sys
import traceback
from collections.abc import Iterable, Iterator, Mapping, Sequence
from importlib.metadata import distributions
from types import TracebackType
from typing import Any, Final, Literal, TypeVar

from attrs import evolve

from graspsense.core.components.entries import (
    KIND_OF_ENTRY,
    RESOURCES,
    ROLES,
    TABLE_OF_ROLE,
    ComponentKind,
    ExperimentKindEntry,
    FeatureSetEntry,
    Finding,
    FoundDevice,
    ResourceKind,
    Role,
)
from graspsense.core.components.firstparty import provider
from graspsense.core.components.registry.discovery import (
    ENTRY_POINT,
    PluginRefused,
    PluginSource,
    builtin_source,
    disabled_in_config,
    installed_sources,
    reason_not_to_load,
    unknown_names,
)
from graspsense.core.components.registry.isolation import (
    TRACE_VARIABLE,
    HookCalls,
    advice_on,
    check_api,
    error_text,
    imported,
)
from graspsense.core.components.registry.parts import (
    AnswerT,
    Component,
    Declared,
    EntryT,
    HookAnswer,
    PluginStatus,
    Resource,
    canonical,
)
from graspsense.core.values.errors import FAILURES, PluginUnavailable, UnknownName, place_of, suggestion

STRICT_VARIABLE: Final = "GRASPSENSE_STRICT_PLUGINS"
"""If this environment variable is 1, the error of a plugin that cannot be loaded is raised."""

PartT = TypeVar("PartT", bound=Component | Resource[Any])


class Plugins:
    """The plugins of one process, and the only caller of hooks.

    `statuses` lists every plugin that is installed, loaded or not. A plugin that cannot be loaded is listed there with
    the reason and does not affect the others; with `GRASPSENSE_STRICT_PLUGINS=1` its error is raised instead.
    """

    def __init__(
        self, sources: Iterable[PluginSource], environ: Mapping[str, str], disabled: Iterable[str] = ()
    ) -> None:
        self._trace = environ.get(TRACE_VARIABLE) == "1"
        self._strict = environ.get(STRICT_VARIABLE) == "1"
        self._statuses: list[PluginStatus] = []
        self._loaded: list[tuple[PluginStatus, HookCalls]] = []
        self._parts: list[Component | Resource[Any]] = []
        sources = list(sources)
        self.unknown_names = unknown_names({source.distribution for source in sources}, environ)
        """Distributions that an environment variable names and that are not installed, a sentence each."""
        switched_off = {canonical(name) for name in disabled}
        for source in sources:
            reason = reason_not_to_load(source.distribution, environ, switched_off)
            if reason:
                self._statuses.append(_status(source, "disabled", reason))
            else:
                self._load(source)

    @classmethod
    def discover(cls) -> Plugins:
        """Load the parts of graspsense itself, and every installed plugin that environment and config allow.

        Raises ConfigError if the user's list of disabled plugins cannot be read.
        """
        return cls([builtin_source(), *installed_sources()], os.environ, disabled_in_config())

    @property
    def statuses(self) -> tuple[PluginStatus, ...]:
        """Every installed plugin."""
        return tuple(self._statuses)

    def components(self, role: Role | None = None) -> tuple[Component, ...]:
        """Return the components of this role, or all, in the order of role and name."""
        order = list(ROLES)
        of_role = (part for part in self._parts if isinstance(part, Component) and role in (None, part.role))
        return tuple(sorted(of_role, key=lambda part: (order.index(part.role), part.name, part.distribution)))

    def namesakes(self, part: Declared[Any]) -> tuple[str, ...]:
        """Return the qualified names of the parts of other distributions with the kind and name of this one."""
        same = (other for other in self._parts if (other.kind, other.name) == (part.kind, part.name))
        return tuple(other.qualified for other in same if other.distribution != part.distribution)

    def feature_sets(self) -> tuple[FeatureSetEntry, ...]:
        """Return what each feature set declares; one whose class cannot be imported is left out."""
        entries = []
        for component in self.components("feature-set"):
            with contextlib.suppress(PluginUnavailable):
                entries.append(component.declared())
        return tuple(entries)

    def find(self, role: Role, name: str) -> Component:
        """Return the component called `name` or `distribution/name`.

        Raises UnknownName if there is none, for another role, or if several distributions provide the short name.
        """
        if role not in TABLE_OF_ROLE:
            raise UnknownName(f"no role {str(role)[:40]!r}: name one of {', '.join(TABLE_OF_ROLE)}")
        key = f"{TABLE_OF_ROLE[role]}.type"
        return self._only(role, self.components(role), name, key)

    def resources(self, kind: type[EntryT]) -> tuple[Resource[EntryT], ...]:
        """Return what plugins declare by entries of this type, in the order of the names."""
        return tuple(resource for resource in self.all_resources() if type(resource.entry) is kind)

    def all_resources(self) -> tuple[Resource[Any], ...]:
        """Return the resources of every kind, in the order of the names."""
        resources = (part for part in self._parts if isinstance(part, Resource))
        return tuple(sorted(resources, key=lambda resource: (resource.name, resource.distribution)))

    def resource(self, kind: type[EntryT], name: str, others: Iterable[str] = ()) -> Resource[EntryT]:
        """Return the resource of this kind with this short or qualified name.

        Raises UnknownName, which also lists `others`: names of this kind that no plugin declares.
        """
        key = "kind" if kind is ExperimentKindEntry else ""
        return self._only(KIND_OF_ENTRY[kind], self.resources(kind), name, key, others)

    def unknown(self, name: str) -> UnknownName:
        """Return the error for a name that no distribution with plugins and no component has."""
        known = sorted(
            {
                *(status.distribution for status in self._statuses),
                *(component.name for component in self.components()),
            }
        )
        if name and any(distributions(name=name)):
            return UnknownName(f"{name} is installed and has no plugin: {ENTRY_POINT}")
        return UnknownName(
            f"no plugin or component named {name!r}. Known: {', '.join(known)}.{suggestion(name, known)}\n"
            "  One of your own is installed first: pip install -e FOLDER"
        )

    def absences(self) -> str:
        """Return lines on the installed plugins that are not in use, for a user who misses a name."""
        lines = [status.absence for status in self._statuses]
        return "".join([*lines, *(f"\n  {problem}" for problem in self.unknown_names)])

    def probe_devices(self, timeout_s: float) -> tuple[HookAnswer[FoundDevice], ...]:
        """Let every plugin search for its devices for at most `timeout_s` each; a failure is reported as its own."""
        return self._answers("graspsense_probe_devices", FoundDevice, timeout_s=timeout_s)

    def diagnose(self, config: object, timeout_s: float) -> tuple[HookAnswer[Finding], ...]:
        """Let every plugin examine its devices, for about `timeout_s` each; a failure is reported as its own.

        `config` is that of the gripper that the user named, or None.
        """
        return self._answers("graspsense_diagnose", Finding, config=config, timeout_s=timeout_s)

    def _answers(self, hook: str, kind: type[AnswerT], **arguments: Any) -> tuple[HookAnswer[AnswerT], ...]:
        answers: list[HookAnswer[AnswerT]] = []
        for status, calls in self._implementing(hook):
            try:
                given = calls.entries(hook, kind, **arguments)
                answers.append(HookAnswer(status.distribution, tuple(given)))
            except FAILURES as error:
                answers.append(HookAnswer(status.distribution, error=error_text(error)))
        return tuple(answers)

    def collect(self, hook: str, /, **arguments: Any) -> tuple[tuple[str, Any], ...]:
        """Call a hook in every plugin that implements it; return (distribution, result) for each result.

        A hook that a plugin owns is documented by it; others implement it with `@hookimpl(optionalhook=True)`. A plugin
        whose implementation raises is left out with a warning.
        """
        results: list[tuple[str, Any]] = []
        for status, calls in self._implementing(hook):
            with calls.isolated(status, hook):
                results.extend((status.distribution, result) for result in calls.call(hook, **arguments))
        return tuple(results)

    def called(self, status: PluginStatus, hook: str, /, **arguments: Any) -> list[Any]:
        """Call the implementation of one plugin, for a check of it; what it raises is raised.

        Returns its result in a list, or an empty list for None.
        """
        (calls,) = [calls for known, calls in self._loaded if known is status]
        return calls.call(hook, **arguments)

    def _load(self, source: PluginSource) -> None:
        try:
            # The output of a plugin must not mix with JSON on the standard output.
            with contextlib.redirect_stdout(sys.stderr):
                plugin, cost = imported(source)
                check_api(plugin, source)
                calls, parts = self._registered(plugin, source)
        except KeyboardInterrupt:
            raise
        except BaseException as error:  # also that of a compiled extension which panics, and is no Exception
            if self._strict:
                error.add_note(
                    f"while loading {source.entry_point} of {source.distribution} {source.version}"
                )
                raise
            broken = _status(source, "broken", f"{error_text(error)}{place_of(error)}")
            if not isinstance(error, PluginRefused):  # whose reason says all
                broken = evolve(broken, traceback="".join(traceback.format_exception(error)))
            self._statuses.append(broken)
            return
        status = evolve(
            _status(source, "loaded"),
            hooks=calls.hooks,
            import_s=cost.processor_s,
            advice=advice_on(source, cost),
        )
        self._statuses.append(status)
        self._loaded.append((status, calls))
        self._parts += parts

    def _registered(
        self, plugin: object, source: PluginSource
    ) -> tuple[HookCalls, list[Component | Resource[Any]]]:
        """Return the hooks of a plugin, and what it declares by them. Raises PluginRefused."""
        for _, known in self._loaded:
            if known.plugin is plugin:
                raise PluginRefused(f"{source.module} is loaded already, as {known.name}")
        calls = HookCalls(plugin, source, self._trace)
        kinds: tuple[ComponentKind | ResourceKind, ...] = (*ROLES.values(), *RESOURCES)
        parts: list[Component | Resource[Any]] = [
            (Component if isinstance(kind, ComponentKind) else Resource)(
                entry, source.distribution, source.version
            )
            for kind in kinds
            if kind.hook in calls.hooks
            for entry in calls.entries(kind.hook, kind.entry)
        ]
        declared = {(part.kind, part.qualified) for part in self._parts}
        for part in parts:
            if (part.kind, part.qualified) in declared:
                raise PluginRefused(f"{part.distribution} declares {part.kind} {part.name!r} twice")
            declared.add((part.kind, part.qualified))
        return calls, parts

    def _implementing(self, hook: str) -> Iterator[tuple[PluginStatus, HookCalls]]:
        return ((status, calls) for status, calls in self._loaded if hook in calls.hooks)

    def _only(
        self,
        kind: str,
        known: Sequence[PartT],
        name: str,
        key: str,
        others: Iterable[str] = (),
    ) -> PartT:
        """Return the part among `known` with this name, or raise UnknownName, which also lists `others`.

        `key` is the setting in which the qualified name belongs. Where a distribution of this project provides the
        part and is not installed, the error says how to install it.
        """
        title = kind.replace("-", " ")
        wanted, _, short = name.rpartition("/")
        matching = [
            part
            for part in known
            if part.name == short and (not wanted or part.distribution == canonical(wanted))
        ]
        if len(matching) == 1:
            return matching[0]
        if matching:
            providers = " and ".join(part.distribution for part in matching)
            how = f"{key} = " if key else ""
            raise UnknownName(
                f'{title} {name!r} is provided by {providers}; write {how}"{matching[0].qualified}"'
            )
        by = provider(kind, short)
        present = {status.distribution for status in self._statuses}
        if by and canonical(wanted) in ("", by.distribution) and by.distribution not in present:
            raise UnknownName(f"no {title} named {name!r}. It is provided by {by.distribution}:\n  {by.hint}")
        if wanted and canonical(wanted) not in present:
            near = suggestion(wanted, present)
            raise UnknownName(f"no {title} named {name!r}: no plugin of {wanted} is installed.{near}")
        names = sorted({*(part.qualified if wanted else part.name for part in known), *others})
        raise UnknownName(
            f"no {title} named {name!r}. Known: {', '.join(names) or 'none'}.{suggestion(name, names)}"
            + self.absences()
        )


class IsolatedPlugins(Plugins):
    """For tests: the parts of graspsense itself and the given plugins, without searching for others.

    As a context manager it replaces the plugins of the process. A plugin that fails raises its error here.
    """

    def __init__(self, *plugins: object, builtins: bool = True) -> None:
        super().__init__([builtin_source()] if builtins else [], {STRICT_VARIABLE: "1"})
        self._outer: Plugins | None = None
        for plugin in plugins:
            self.add(plugin)

    def add(self, plugin: object, distribution: str = "graspsense-test", version: str = "0.1") -> None:
        """Load a module, or any object with hook implementations, as if that distribution had installed it."""
        label = str(getattr(plugin, "__name__", type(plugin).__name__)).rpartition(".")[2]
        taken = sum(status.distribution == canonical(distribution) for status in self._statuses)
        self._load(
            PluginSource(
                canonical(distribution),
                version,
                f"{label}-{taken}" if taken else label,
                label,
                lambda: plugin,
            )
        )

    def __enter__(self) -> IsolatedPlugins:
        global _current
        self._outer, _current = _current, self
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, tb: TracebackType | None
    ) -> None:
        global _current
        _current = self._outer


_current: Plugins | None = None


def installed() -> Plugins:
    """Return the plugins of this process, which the first call discovers and loads."""
    global _current
    if _current is None:
        _current = Plugins.discover()
    return _current


def collect(hook: str, /, **arguments: Any) -> tuple[tuple[str, Any], ...]:
    """Call a hook that a plugin owns in every plugin of this process; see `Plugins.collect`."""
    return installed().collect(hook, **arguments)


def _status(
    source: PluginSource, state: Literal["loaded", "disabled", "broken"], reason: str = ""
) -> PluginStatus:
    return PluginStatus(source.distribution, source.version, source.entry_point, source.module, state, reason)
