"""Finding plugins, keeping the broken ones apart, and resolving a component by role and name.

A loader of our own stands in front of pluggy's, because pluggy's dies with the first plugin that fails and
drops the second of two distributions that use one entry-point name. Nothing is loaded at `import graspsense`;
the first call of `installed()` does it.
"""

from __future__ import annotations

import contextlib
import importlib
import inspect
import logging
import os
import re
import sys
import time
import traceback
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from importlib.metadata import Distribution, distributions
from importlib.resources import files
from types import TracebackType
from typing import TYPE_CHECKING, Any, Final, Generic, Literal, TypeVar, cast

import attrs
import pluggy
from attrs import define, evolve, frozen

from graspsense.core import hookspecs
from graspsense.core.disabling import config_file, disabled_in_config
from graspsense.core.entries import (
    ENTRY_OF_ROLE,
    TABLE_OF_ROLE,
    CommandEntry,
    ComponentEntry,
    DatasetEntry,
    EmulatorEntry,
    Finding,
    FoundDevice,
    ModelEntry,
    PipelineEntry,
    Role,
)
from graspsense.core.errors import PluginUnavailable, UnknownName, suggestion
from graspsense.core.firstparty import BUILTIN_MODULE, DISTRIBUTION, SHIPPED

if TYPE_CHECKING:
    from importlib.resources.abc import Traversable

    from graspsense.core.trial import GraspEvent, RunInfo, Trial

EntryT = TypeVar("EntryT", PipelineEntry, ModelEntry, DatasetEntry, CommandEntry, EmulatorEntry)

ALLOWED_VARIABLE: Final = "GRASPSENSE_PLUGINS"
DISABLED_VARIABLE: Final = "GRASPSENSE_DISABLED_PLUGINS"
STRICT_VARIABLE: Final = "GRASPSENSE_STRICT_PLUGINS"
TRACE_VARIABLE: Final = "GRASPSENSE_TRACE_PLUGINS"

HEAVY: Final = frozenset(
    {
        *("numpy", "scipy", "sklearn", "numba", "pandas", "matplotlib", "torch", "cattrs", "rich"),
        *("hid", "hidraw", "usb", "serial", "pymodbus"),
    }
)
"""What no plugin's module may import: listing plugins would import it for everybody."""
SLOW_IMPORT_S: Final = 0.1
"""Processor time from which on the import of a plugin's module is called slow."""

COMPONENT_HOOKS: Final[dict[str, Role]] = {
    "graspsense_sensor_backends": "sensor-backend",
    "graspsense_controllers": "controller",
    "graspsense_feature_sets": "feature-set",
    "graspsense_classifiers": "classifier",
}
OFFER_HOOKS: Final[dict[str, type]] = {
    "graspsense_pipelines": PipelineEntry,
    "graspsense_models": ModelEntry,
    "graspsense_datasets": DatasetEntry,
    "graspsense_commands": CommandEntry,
    "graspsense_emulators": EmulatorEntry,
}
_SPECS: Final = tuple(name for name in vars(hookspecs) if name.startswith("graspsense_"))

_log = logging.getLogger("graspsense.plugins")


def canonical(distribution: str) -> str:
    """Return the distribution's name in its one canonical spelling (PEP 503)."""
    return re.sub(r"[-_.]+", "-", distribution).lower()


@frozen
class PluginStatus:
    """One plugin that was found: where it comes from, and whether and why not it takes part."""

    distribution: str
    version: str
    entry_point: str
    module: str
    state: Literal["loaded", "disabled", "broken"]
    reason: str = ""
    traceback: str = ""
    hooks: tuple[str, ...] = ()
    import_s: float = 0.0
    """Processor time that its module took to import."""
    advice: tuple[str, ...] = ()
    """What is to be done about it, though it works."""


@frozen
class Component:
    """A component that a plugin declares. Its code is imported by the methods, not before."""

    role: Role
    entry: ComponentEntry
    distribution: str
    version: str

    @property
    def name(self) -> str:
        """The short name, unique only where one distribution provides it."""
        return self.entry.name

    @property
    def qualified(self) -> str:
        """The unique name, `distribution/name`."""
        return f"{self.distribution}/{self.entry.name}"

    @property
    def table(self) -> str:
        """The table of a pipeline file in which it is chosen."""
        return TABLE_OF_ROLE[self.role]

    def config_class(self) -> type:
        """Import and return the attrs class of its config. Raises PluginUnavailable."""
        found = _imported(self, self.entry.config)
        if not (isinstance(found, type) and attrs.has(found)):
            raise _unavailable(self, f"{self.entry.config} is no attrs class")
        return found

    def component_class(self) -> type:
        """Import and return its class, which must be what its role asks for. Raises PluginUnavailable."""
        from graspsense.core import roles

        found = _imported(self, self.entry.target)
        base = {
            "sensor-backend": roles.SensorBackend,
            "controller": roles.Controller,
            "feature-set": roles.FeatureSet,
            "classifier": roles.Classifier,
        }[self.role]
        if not (isinstance(found, type) and issubclass(found, base)):
            raise _unavailable(self, f"{self.entry.target} is no subclass of {base.__name__}")
        if inspect.isabstract(found):
            lacking = ", ".join(sorted(found.__abstractmethods__))
            raise _unavailable(
                self,
                f"{self.entry.target} does not implement {lacking}, which {base.__name__} of plugin_api asks for",
            )
        return found

    def create(self, config: object) -> Any:
        """Return the component built from an instance of its config class."""
        return self.component_class()(config)


@frozen
class Offer(Generic[EntryT]):
    """A pipeline, model, data set, command or emulator that a plugin declares."""

    entry: EntryT
    distribution: str
    version: str

    @property
    def name(self) -> str:
        """The short name, unique only where one distribution provides it."""
        return self.entry.name

    @property
    def qualified(self) -> str:
        """The unique name, `distribution/name`."""
        return f"{self.distribution}/{self.entry.name}"

    @property
    def kind(self) -> str:
        """What it is, as a person says it."""
        return _KIND_OF_ENTRY[type(self.entry)]

    def load(self) -> Any:
        """Import and return what the entry of a data set, command or emulator points at. Raises PluginUnavailable."""
        assert isinstance(self.entry, DatasetEntry | CommandEntry | EmulatorEntry), (
            "pipelines and models are files"
        )
        return _imported(self, self.entry.target)

    def resource(self) -> Traversable:
        """Return the file of a pipeline or model. Raises PluginUnavailable where it is not in its package."""
        assert isinstance(self.entry, PipelineEntry | ModelEntry), (
            "data sets, commands and emulators are code"
        )
        package, _, path = self.entry.resource.partition(":")
        try:
            found = files(package).joinpath(path)
        except Exception as error:
            raise _unavailable(self, f"{type(error).__name__}: {error}") from error
        if not found.is_file():
            raise _unavailable(self, f"there is no file {path!r} in the package {package!r}")
        return found


PartT = TypeVar("PartT", bound=Component | Offer[Any])

_KIND_OF_ENTRY: Final[dict[type, str]] = {
    PipelineEntry: "pipeline",
    ModelEntry: "model",
    DatasetEntry: "data set",
    CommandEntry: "command",
    EmulatorEntry: "emulator",
}


@frozen
class Probe:
    """What one plugin found when it looked for devices; `error` says why it could not look."""

    distribution: str
    found: tuple[FoundDevice, ...] = ()
    error: str = ""


@frozen
class Diagnosis:
    """What one plugin's doctor found; `error` says why it could not look."""

    distribution: str
    findings: tuple[Finding, ...] = ()
    error: str = ""


def _kind(part: Component | Offer[Any]) -> str:
    return part.role.replace("-", " ") if isinstance(part, Component) else part.kind


def _unavailable(part: Component | Offer[Any], why: str) -> PluginUnavailable:
    needs = getattr(part.entry, "needs", "")
    return PluginUnavailable(
        f"{_kind(part)} {part.name!r} of {part.distribution} {part.version} cannot be used here: {why}"
        + (f"\n  needs: {needs}" if needs else "")
    )


def _imported(part: Component | Offer[Any], target: str) -> Any:
    module, _, name = target.partition(":")
    try:
        return getattr(importlib.import_module(module), name)
    except Exception as error:  # whatever a stranger's module does when it is imported
        raise _unavailable(part, f"{type(error).__name__}: {error}") from error


@define
class Source:
    """A plugin before it is loaded: whose it is, and how to get it."""

    distribution: str
    version: str
    entry_point: str
    module: str
    load: Callable[[], object]
    copies: tuple[str, ...] = ()
    """Where the distribution is installed, where that is in several places."""


class _Refused(Exception):
    """A plugin that breaks the rules; its text is the reason."""


class Plugins:
    """The plugins of one process, and the only caller of hooks.

    `statuses` tells of every plugin that was found, loaded or not. A plugin that fails is listed there with
    its reason and takes nothing else down; with `GRASPSENSE_STRICT_PLUGINS=1` its error is raised instead.
    """

    def __init__(
        self, sources: Iterable[Source], environ: Mapping[str, str], disabled: Iterable[str] = ()
    ) -> None:
        self._manager = pluggy.PluginManager(hookspecs.PROJECT)
        self._manager.add_hookspecs(hookspecs)
        if environ.get(TRACE_VARIABLE) == "1":
            self._trace_calls()
        self._strict = environ.get(STRICT_VARIABLE) == "1"
        self._statuses: list[PluginStatus] = []
        self._loaded: list[tuple[PluginStatus, object]] = []
        self._components: list[Component] = []
        self._offers: list[Offer[Any]] = []
        self._warned: set[tuple[str, str]] = set()
        switched_off = {canonical(name) for name in disabled}
        for source in sources:
            reason = _barred(source.distribution, environ, switched_off)
            if reason:
                self._statuses.append(_status(source, "disabled", reason))
            else:
                self._add(source)

    @classmethod
    def discover(cls) -> Plugins:
        """Load the parts of graspsense itself and every installed plugin that environment and config allow.

        Raises ConfigError where the user's list of disabled plugins cannot be read.
        """
        return cls([_builtin(), *installed_sources()], os.environ, disabled_in_config())

    @property
    def statuses(self) -> tuple[PluginStatus, ...]:
        """Every plugin that was found."""
        return tuple(self._statuses)

    def components(self, role: Role | None = None) -> tuple[Component, ...]:
        """Return the components of this role, or all, in the order of role and name."""
        order = list(ENTRY_OF_ROLE)
        chosen = (one for one in self._components if role in (None, one.role))
        return tuple(sorted(chosen, key=lambda one: (order.index(one.role), one.name, one.distribution)))

    def find(self, role: Role, name: str) -> Component:
        """Return the component called `name` or `distribution/name`.

        Raises UnknownName where there is none, or where several distributions provide the short name.
        """
        hint = ""
        wanted, _, short = name.rpartition("/")
        shipped = SHIPPED.get((role, short))
        found = {status.distribution for status in self._statuses}
        if shipped and canonical(wanted) in ("", shipped.distribution) and shipped.distribution not in found:
            hint = f"It is provided by {shipped.distribution}:\n  {shipped.hint}"
        key = f"{TABLE_OF_ROLE[role]}.type"
        return self._only(role.replace("-", " "), self.components(role), name, key, hint)

    def pipelines(self) -> tuple[Offer[PipelineEntry], ...]:
        """Return the pipeline files that plugins ship."""
        return self._offers_of(PipelineEntry)

    def models(self) -> tuple[Offer[ModelEntry], ...]:
        """Return the trained models that plugins ship."""
        return self._offers_of(ModelEntry)

    def datasets(self) -> tuple[Offer[DatasetEntry], ...]:
        """Return the readers of recorded data."""
        return self._offers_of(DatasetEntry)

    def commands(self) -> tuple[Offer[CommandEntry], ...]:
        """Return the subcommands that plugins add."""
        return self._offers_of(CommandEntry)

    def emulators(self) -> tuple[Offer[EmulatorEntry], ...]:
        """Return the devices that software can stand in for."""
        return self._offers_of(EmulatorEntry)

    def pipeline(self, name: str) -> Offer[PipelineEntry]:
        """Return the pipeline of this short or qualified name. Raises UnknownName."""
        return self._only("pipeline", self.pipelines(), name)

    def model(self, name: str) -> Offer[ModelEntry]:
        """Return the model of this short or qualified name. Raises UnknownName."""
        return self._only("model", self.models(), name)

    def dataset(self, name: str) -> Offer[DatasetEntry]:
        """Return the reader of this short or qualified name. Raises UnknownName."""
        return self._only("data set", self.datasets(), name)

    def command(self, name: str) -> Offer[CommandEntry]:
        """Return the subcommand of this short or qualified name. Raises UnknownName."""
        return self._only("command", self.commands(), name)

    def emulator(self, name: str) -> Offer[EmulatorEntry]:
        """Return the emulator of this short or qualified name. Raises UnknownName."""
        return self._only("emulator", self.emulators(), name)

    def unknown(self, name: str) -> UnknownName:
        """Return the error for a name that is neither a distribution's with plugins nor a component's."""
        known = sorted(
            {*(one.distribution for one in self._statuses), *(one.name for one in self._components)}
        )
        return UnknownName(
            f"no plugin or component named {name!r}. Known: {', '.join(known)}.{suggestion(name, known)}"
        )

    def absences(self) -> str:
        """Return lines on the plugins that are here but take no part, for whoever misses a name."""
        return "".join(_absence(status) for status in self._statuses)

    def probe_devices(self, timeout_s: float) -> tuple[Probe, ...]:
        """Let every plugin look for its devices for at most `timeout_s` each; a failure is its own."""
        probes = []
        for status, plugin in self._implementing("graspsense_probe_devices"):
            try:
                found = self._entries(plugin, "graspsense_probe_devices", FoundDevice, timeout_s=timeout_s)
                probes.append(Probe(status.distribution, tuple(found)))
            except Exception as error:
                probes.append(Probe(status.distribution, error=_in_words(error)))
        return tuple(probes)

    def diagnose(self, config: object, timeout_s: float) -> tuple[Diagnosis, ...]:
        """Let every plugin look into its devices, for at most about `timeout_s` each; a failure is its own.

        `config` is that of the gripper that was named, or None.
        """
        diagnoses = []
        for status, plugin in self._implementing("graspsense_diagnose"):
            try:
                found = self._entries(
                    plugin, "graspsense_diagnose", Finding, config=config, timeout_s=timeout_s
                )
                diagnoses.append(Diagnosis(status.distribution, tuple(found)))
            except Exception as error:
                diagnoses.append(Diagnosis(status.distribution, error=_in_words(error)))
        return tuple(diagnoses)

    def run_starting(self, run: RunInfo) -> None:
        """Tell the observers that a grasp is about to start."""
        self._notify("graspsense_run_starting", run=run)

    def grasp_event(self, run: RunInfo, event: GraspEvent) -> None:
        """Tell the observers of a change of phase, or that the guard acted."""
        self._notify("graspsense_grasp_event", run=run, event=event)

    def run_finished(self, run: RunInfo, trial: Trial) -> None:
        """Tell the observers of the finished trial."""
        self._notify("graspsense_run_finished", run=run, trial=trial)

    def collect(self, hook: str, /, **arguments: Any) -> tuple[tuple[str, Any], ...]:
        """Call a hook that some plugin owns; return (distribution, result) for each that implements it.

        The owner documents the hook; others implement it with `@hookimpl(optionalhook=True)`. A plugin whose
        implementation raises is left out with a warning.
        """
        results: list[tuple[str, Any]] = []
        for status, plugin in self._implementing(hook):
            with self._isolated(status, hook):
                results.extend((status.distribution, one) for one in self._call(plugin, hook, **arguments))
        return tuple(results)

    def called(self, status: PluginStatus, hook: str, /, **arguments: Any) -> list[Any]:
        """Call one plugin's implementation of a hook, for whoever checks it; what it raises is raised.

        Returns its result in a list, or an empty list for None.
        """
        (plugin,) = [one for known, one in self._loaded if known is status]
        return self._call(plugin, hook, **arguments)

    def _add(self, source: Source) -> None:
        try:
            # What a plugin prints while it is imported must not end in somebody's JSON.
            with contextlib.redirect_stdout(sys.stderr):
                present, began = HEAVY.intersection(sys.modules), time.process_time()
                plugin = source.load()
                took_s, heavy = time.process_time() - began, HEAVY.intersection(sys.modules) - present
                _check_api(plugin, source)
                status, components, offers = self._registered(plugin, source)
        except (Exception, SystemExit) as error:
            if self._strict:
                error.add_note(
                    f"while loading {source.entry_point} of {source.distribution} {source.version}"
                )
                raise
            reason = _in_words(error)
            self._statuses.append(
                evolve(
                    _status(source, "broken", reason), traceback="".join(traceback.format_exception(error))
                )
            )
            return
        status = evolve(status, import_s=took_s, advice=_advice(source, took_s, heavy))
        self._statuses.append(status)
        self._loaded.append((status, plugin))
        self._components += components
        self._offers += offers

    def _registered(
        self, plugin: object, source: Source
    ) -> tuple[PluginStatus, list[Component], list[Offer[Any]]]:
        """Register one plugin and return what it declares; leaves no trace where it is refused."""
        if self._manager.is_registered(plugin):
            raise _Refused(f"{source.module} is loaded already, as {self._manager.get_name(plugin)}")
        try:
            self._manager.register(plugin, name=f"{source.distribution}:{source.entry_point}")
            hooks = self._hooks_of(plugin)
            components = [
                Component(role, entry, source.distribution, source.version)
                for hook, role in COMPONENT_HOOKS.items()
                if hook in hooks
                for entry in self._entries(plugin, hook, ENTRY_OF_ROLE[role])
            ]
            offers = [
                Offer(entry, source.distribution, source.version)
                for hook, kind in OFFER_HOOKS.items()
                if hook in hooks
                for entry in self._entries(plugin, hook, kind)
            ]
            _check_distinct([*self._components, *components])
            _check_distinct([*self._offers, *offers])
        except BaseException:
            self._manager.unregister(plugin)
            raise
        return evolve(_status(source, "loaded"), hooks=hooks), components, offers

    def _hooks_of(self, plugin: object) -> tuple[str, ...]:
        """Return the hooks that this plugin implements; refuse those that could never be called."""
        names = []
        for caller in self._manager.get_hookcallers(plugin) or ():
            for implementation in caller.get_hookimpls():
                if implementation.plugin is not plugin:
                    continue
                names.append(caller.name)
                if not caller.has_spec() and not implementation.optionalhook:
                    raise _Refused(
                        f"it implements {caller.name}, which is no hook of {DISTRIBUTION} {_version()}."
                        + suggestion(caller.name, _SPECS)
                    )
                if implementation.kwargnames:
                    given = ", ".join(implementation.argnames + implementation.kwargnames)
                    raise _Refused(
                        f"{caller.name} gives {', '.join(implementation.kwargnames)} a default in its signature, which "
                        f"versions of pluggy take for different things: write {caller.name}({given})"
                    )
                if implementation.hookwrapper or implementation.wrapper:
                    raise _Refused(
                        f"{caller.name} is a wrapper: no hook may change what another plugin returns"
                    )
        for name in _SPECS:
            if callable(getattr(plugin, name, None)) and name not in names:
                raise _Refused(
                    f"{name} is not marked with @hookimpl, so it would never be called: write @hookimpl above it"
                )
        return tuple(sorted(names))

    def _entries(self, plugin: object, hook: str, kind: type, **arguments: Any) -> list[Any]:
        """Return what one plugin's hook gives, as a list of `kind`."""
        results = self._call(plugin, hook, **arguments)
        if not results:
            raise _Refused(f"{hook} returned None: return the entries, or yield them")
        if not isinstance(results[0], Iterable) or isinstance(results[0], str):
            raise _Refused(f"{hook} returned {results[0]!r}: return a list of {kind.__name__}, or yield them")
        entries = list(results[0])
        for entry in entries:
            if not isinstance(entry, kind):
                raise _Refused(f"{hook} gave {entry!r}: it takes {kind.__name__} only")
        return entries

    def _implementing(self, hook: str) -> Iterator[tuple[PluginStatus, object]]:
        return ((status, plugin) for status, plugin in self._loaded if hook in status.hooks)

    def _call(self, plugin: object, hook: str, **arguments: Any) -> list[Any]:
        """Call one plugin's implementation; return its result in a list, or an empty list for None."""
        others = [other for other in self._manager.get_plugins() if other is not plugin]
        caller = self._manager.subset_hook_caller(hook, remove_plugins=others)
        return cast("list[Any]", caller(**arguments))

    def _notify(self, hook: str, **arguments: Any) -> None:
        for status, plugin in self._implementing(hook):
            with self._isolated(status, hook):
                self._call(plugin, hook, **arguments)

    @contextlib.contextmanager
    def _isolated(self, status: PluginStatus, hook: str) -> Iterator[None]:
        try:
            yield
        except (Exception, SystemExit) as error:
            key = (f"{status.distribution}:{status.entry_point}", hook)
            if key not in self._warned:
                self._warned.add(key)
                _log.warning(
                    "%s %s failed in %s and is passed over: %s",
                    status.distribution,
                    status.version,
                    hook,
                    _in_words(error),
                )

    def _trace_calls(self) -> None:
        started: list[float] = []

        def before(hook: str, implementations: Sequence[Any], arguments: Mapping[str, Any]) -> None:
            started.append(time.perf_counter())

        def after(
            outcome: pluggy.Result[Any],
            hook: str,
            implementations: Sequence[Any],
            arguments: Mapping[str, Any],
        ) -> None:
            took_ms = (time.perf_counter() - started.pop()) * 1e3
            names = ", ".join(one.plugin_name for one in implementations)
            ended = f"raised {_in_words(outcome.exception)}" if outcome.exception else "returned"
            print(  # noqa: T201 (what was asked for, on stderr)
                f"hook {hook}({', '.join(arguments)}) of {names} {ended} in {took_ms:.2f} ms", file=sys.stderr
            )

        self._manager.add_hookcall_monitoring(before, after)

    def _offers_of(self, kind: type[EntryT]) -> tuple[Offer[EntryT], ...]:
        chosen = (one for one in self._offers if type(one.entry) is kind)
        return tuple(sorted(chosen, key=lambda one: (one.name, one.distribution)))

    def _only(self, kind: str, known: Sequence[PartT], name: str, key: str = "", hint: str = "") -> PartT:
        """Return the one of `known` that answers to `name`, or raise UnknownName.

        `key` is where the qualified name is to be written, `hint` what to say in place of the known names.
        """
        wanted, _, short = name.rpartition("/")
        found = [
            one
            for one in known
            if one.name == short and (not wanted or one.distribution == canonical(wanted))
        ]
        if len(found) == 1:
            return found[0]
        if found:
            providers = " and ".join(one.distribution for one in found)
            how = f"{key} = " if key else ""
            raise UnknownName(
                f'{kind} {name!r} is provided by {providers}; write {how}"{found[0].qualified}"'
            )
        if hint:
            raise UnknownName(f"no {kind} named {name!r}. {hint}")
        names = sorted({one.qualified if wanted else one.name for one in known})
        raise UnknownName(
            f"no {kind} named {name!r}. Known: {', '.join(names) or 'none'}.{suggestion(name, names)}"
            + self.absences()
        )


class IsolatedPlugins(Plugins):
    """For tests: the parts of graspsense itself and the plugins handed in; never looks for others.

    As a context manager it stands in for the process's own plugins. Here a plugin that fails is an error.
    """

    def __init__(self, *plugins: object, builtins: bool = True) -> None:
        super().__init__([_builtin()] if builtins else [], {STRICT_VARIABLE: "1"})
        self._outer: Plugins | None = None
        for plugin in plugins:
            self.add(plugin)

    def add(self, plugin: object, distribution: str = "graspsense-test", version: str = "0.1") -> None:
        """Load a module, or any object with hook implementations, as if that distribution had brought it."""
        label = str(getattr(plugin, "__name__", type(plugin).__name__)).rpartition(".")[2]
        taken = sum(status.distribution == canonical(distribution) for status in self._statuses)
        self._add(
            Source(
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
    """Return the plugins of this process, found and loaded at the first call."""
    global _current
    if _current is None:
        _current = Plugins.discover()
    return _current


def collect(hook: str, /, **arguments: Any) -> tuple[tuple[str, Any], ...]:
    """Call a hook that one plugin owns in every plugin of this process; see `Plugins.collect`."""
    return installed().collect(hook, **arguments)


def _version() -> str:
    from graspsense import __version__

    return __version__


def _builtin() -> Source:
    return Source(
        DISTRIBUTION, _version(), "builtin", BUILTIN_MODULE, lambda: importlib.import_module(BUILTIN_MODULE)
    )


def installed_sources() -> list[Source]:
    """Return every entry point of our group, sorted, each once, without importing what it names."""
    sources: dict[tuple[str, str], Source] = {}
    places: dict[tuple[str, str], dict[str, str]] = {}
    for distribution in distributions():
        for source in _sources_of(distribution):
            key = (source.distribution, source.entry_point)
            sources.setdefault(key, source)
            place = os.path.realpath(str(getattr(distribution, "_path", "")))  # lib64 is lib
            places.setdefault(key, {})[place] = f"{source.version} in {os.path.dirname(place)}"
    for key, found in places.items():
        if len(found) > 1:
            sources[key].copies = tuple(found.values())
    return [sources[key] for key in sorted(sources)]


def _sources_of(distribution: Distribution) -> list[Source]:
    text = distribution.read_text("entry_points.txt") or ""
    if hookspecs.ENTRY_POINT_GROUP not in text:
        return []  # the common case, decided without parsing any metadata
    name, version = _name_and_version(distribution)
    try:
        found = distribution.entry_points.select(group=hookspecs.ENTRY_POINT_GROUP)
    except Exception as error:
        return [Source(name, version, "?", "entry_points.txt", _fails(error))]
    return [Source(name, version, one.name, one.value, one.load) for one in found]


def _name_and_version(distribution: Distribution) -> tuple[str, str]:
    """Return the canonical name and the version, from the folder's name where the metadata has none."""
    metadata = distribution.metadata
    folder = str(getattr(distribution, "_path", "unknown")).replace("\\", "/").rpartition("/")[2]
    name, _, version = folder.rpartition(".")[0].partition("-")
    return canonical(metadata["Name"] or name), metadata["Version"] or version or "?"


def _fails(error: Exception) -> Callable[[], object]:
    def load() -> object:
        raise error

    return load


def _barred(distribution: str, environ: Mapping[str, str], switched_off: set[str]) -> str:
    """Return why this distribution's plugins are not to be loaded, or an empty string."""
    if distribution == DISTRIBUTION:
        return ""
    allowed = environ.get(ALLOWED_VARIABLE)
    if allowed is not None and distribution not in _names(allowed):
        return f"not in {ALLOWED_VARIABLE}"
    if distribution in _names(environ.get(DISABLED_VARIABLE, "")):
        return f"in {DISABLED_VARIABLE}"
    if distribution in switched_off:
        return f"in {config_file()} (graspsense plugins enable {distribution})"
    return ""


def _names(text: str) -> set[str]:
    return {canonical(name) for name in re.split(r"[,\s]+", text) if name}


def _status(source: Source, state: Literal["loaded", "disabled", "broken"], reason: str = "") -> PluginStatus:
    return PluginStatus(source.distribution, source.version, source.entry_point, source.module, state, reason)


def _advice(source: Source, took_s: float, heavy: frozenset[str]) -> tuple[str, ...]:
    """Return what there is to do about a plugin that works."""
    found = []
    if heavy or took_s > SLOW_IMPORT_S:
        brings = f", and brings {', '.join(sorted(heavy))}" if heavy else ""
        found.append(
            f"slow: importing {source.module} takes {took_s * 1e3:.0f} ms of processor time{brings}. Its author: name "
            "classes by import strings, and import what is heavy inside them"
        )
    if source.copies:
        found.append(
            f"installed {len(source.copies)} times ({'; '.join(source.copies)}), the first is used: "
            f"pip uninstall {source.distribution} until none is left, then install it once"
        )
    return tuple(found)


def _check_api(plugin: object, source: Source) -> None:
    major, minor = hookspecs.API
    ours = f"{DISTRIBUTION} {_version()} has {major}.{minor}"
    version = getattr(plugin, "GRASPSENSE_API", None)
    if version is None:
        raise _Refused(f"{source.module} has no GRASPSENSE_API: add GRASPSENSE_API = ({major}, {minor})")
    if not (isinstance(version, tuple) and len(version) == 2 and all(type(part) is int for part in version)):
        raise _Refused(f"GRASPSENSE_API is {version!r}: it must be two integers, as ({major}, {minor})")
    if version[0] > major or (version[0] == major and version[1] > minor):
        raise _Refused(
            f"it is written for plugin API {version[0]}.{version[1]}, {ours}: upgrade {DISTRIBUTION}"
        )
    if version[0] < major:
        raise _Refused(
            f"it is written for plugin API {version[0]}.{version[1]}, {ours}: upgrade {source.distribution}"
        )


def _check_distinct(parts: Sequence[Component | Offer[Any]]) -> None:
    """Refuse a second part of one kind and one qualified name."""
    seen = set()
    for part in parts:
        if (_kind(part), part.qualified) in seen:
            raise _Refused(f"{part.distribution} declares {_kind(part)} {part.name!r} twice")
        seen.add((_kind(part), part.qualified))


def _absence(status: PluginStatus) -> str:
    """Return the lines that tell of a plugin which does not take part, for whoever misses a name."""
    if status.state == "loaded":
        return ""
    what = f"failed to load: {status.reason}" if status.state == "broken" else f"disabled: {status.reason}"
    return (
        f"\n  {status.distribution} {status.version} is installed but {what}"
        f"\n  (graspsense plugins show {status.distribution})"
    )


def _in_words(error: BaseException) -> str:
    if isinstance(error, _Refused):
        return str(error)
    # Of attrs' own errors the first argument is the sentence; the others are the attribute with all it has.
    from_attrs = len(error.args) > 1 and isinstance(error.args[1], attrs.Attribute)
    text = str(error.args[0]) if from_attrs else str(error)
    return f"{type(error).__name__}: {text}" if text else type(error).__name__
