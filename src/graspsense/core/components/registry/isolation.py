"""One plugin at a time: what it must hold to when it is loaded, and how its hooks are called.

pluggy ends at the first plugin that fails. Here every call goes to a single plugin, so that the failure of one is
its own.
"""

from __future__ import annotations

import contextlib
import logging
import sys
import time
from collections.abc import Iterable, Iterator
from typing import Any, Final, NamedTuple, cast

import attrs
import pluggy

from graspsense import __version__
from graspsense.core.components import hookspecs
from graspsense.core.components.firstparty import DISTRIBUTION
from graspsense.core.components.registry.discovery import PluginRefused, PluginSource
from graspsense.core.components.registry.parts import PluginStatus
from graspsense.core.values.errors import suggestion
from graspsense.core.values.printable import printable

TRACE_VARIABLE: Final = "GRASPSENSE_TRACE_PLUGINS"
"""If this environment variable is 1, each call of a hook is printed with the time that it took."""

HEAVY: Final = frozenset(
    {
        *("numpy", "scipy", "sklearn", "numba", "pandas", "matplotlib", "torch", "cattrs", "rich"),
        *("hid", "hidraw", "usb", "serial", "pymodbus"),
    }
)
"""Packages that the module of a plugin must not import: listing plugins would import them for every user."""
SLOW_IMPORT_S: Final = 0.1
"""Processor time (s) above which the import of a plugin's module counts as slow."""
SLOW_WAIT_S: Final = 0.5
"""Time (s) beyond its processor time above which an import counts as slow: it waits for something."""

_SPECS: Final = tuple(name for name in vars(hookspecs) if name.startswith("graspsense_"))

_log = logging.getLogger("graspsense.plugins")


class HookCalls:
    """The hooks of one plugin, registered with a manager of pluggy of its own. Raises PluginRefused.

    `hooks` has the names of those that it implements.
    """

    def __init__(self, plugin: object, source: PluginSource, trace: bool) -> None:
        self.plugin, self.name = plugin, f"{source.distribution}:{source.entry_point}"
        self._manager = pluggy.PluginManager(hookspecs.PROJECT)
        self._manager.add_hookspecs(hookspecs)
        self._trace = trace
        self._warned: set[str] = set()
        try:
            self._manager.register(plugin, name=self.name)
        except pluggy.PluginValidationError as error:
            raise PluginRefused("; ".join(str(error).splitlines()[1:])) from error
        self.hooks = self._checked_hooks()

    def call(self, hook: str, **arguments: Any) -> list[Any]:
        """Call an implementation; return its result in a list, or an empty list for None."""
        began, ended = time.perf_counter(), "raised"
        try:
            results = cast("list[Any]", getattr(self._manager.hook, hook)(**arguments))
            ended = "returned"
            return results
        finally:
            if self._trace:
                took_ms = (time.perf_counter() - began) * 1e3
                line = f"hook {hook}({', '.join(arguments)}) of {self.name} {ended} in {took_ms:.2f} ms"
                print(printable(line), file=sys.stderr)  # noqa: T201 (the user asked for it, on stderr)

    def entries(self, hook: str, kind: type, **arguments: Any) -> list[Any]:
        """Return the entries that a hook gives. Raises PluginRefused unless all are of `kind`."""
        results = self.call(hook, **arguments)
        if not results:
            raise PluginRefused(f"{hook} returned None: return the entries, or yield them")
        if not isinstance(results[0], Iterable) or isinstance(results[0], str):
            raise PluginRefused(
                f"{hook} returned {results[0]!r}: return a list of {kind.__name__}, or yield them"
            )
        entries = list(results[0])
        for entry in entries:
            if not isinstance(entry, kind):
                raise PluginRefused(f"{hook} gave {entry!r}: it takes {kind.__name__} only")
        return entries

    @contextlib.contextmanager
    def isolated(self, status: PluginStatus, hook: str) -> Iterator[None]:
        """Turn whatever a plugin raises in this hook into a warning, the first time that it does."""
        try:
            yield
        except KeyboardInterrupt:
            raise
        except BaseException as error:  # also the CancelledError of asyncio, which is no Exception
            if hook not in self._warned:
                self._warned.add(hook)
                _log.warning(
                    "%s %s failed in %s and is passed over: %s",
                    status.distribution,
                    status.version,
                    hook,
                    printable(error_text(error)),
                )

    def _checked_hooks(self) -> tuple[str, ...]:
        """Return the hooks that this plugin implements. Raises PluginRefused for one that would never be called."""
        names = []
        for caller in self._manager.get_hookcallers(self.plugin) or ():
            for implementation in caller.get_hookimpls():
                names.append(caller.name)
                if not caller.has_spec() and not implementation.optionalhook:
                    raise PluginRefused(
                        f"it implements {caller.name}, which is not a hook of {DISTRIBUTION} {__version__}."
                        + suggestion(caller.name, _SPECS)
                    )
                if implementation.kwargnames:
                    given = ", ".join(implementation.argnames + implementation.kwargnames)
                    raise PluginRefused(
                        f"{caller.name} gives {', '.join(implementation.kwargnames)} a default in its signature, which "
                        f"versions of pluggy interpret differently: write {caller.name}({given})"
                    )
                if implementation.hookwrapper or implementation.wrapper:
                    raise PluginRefused(
                        f"{caller.name} is a wrapper: no hook may change what another plugin returns"
                    )
        for name in _SPECS:
            if callable(getattr(self.plugin, name, None)) and name not in names:
                raise PluginRefused(
                    f"{name} is not marked with @hookimpl, so it would never be called: write @hookimpl above it"
                )
        return tuple(sorted(names))


class ImportCost(NamedTuple):
    """What the import of a plugin took: processor time (s), further time (s) that it waited, and heavy packages."""

    processor_s: float
    waited_s: float
    heavy: frozenset[str]


def imported(source: PluginSource) -> tuple[object, ImportCost]:
    """Import a plugin; return it with what that took."""
    present, began, began_wall = HEAVY.intersection(sys.modules), time.process_time(), time.perf_counter()
    plugin = source.load()
    processor_s = time.process_time() - began
    waited_s = time.perf_counter() - began_wall - processor_s
    return plugin, ImportCost(processor_s, waited_s, HEAVY.intersection(sys.modules) - present)


_CHANGED: Final = (
    ". If it is yours: a controller's step takes (params, state, reading), where reading.frame and reading.pads are "
    "what it took before; a gripper declares its fingertips as TactileArray('pads', ...). All changes: "
    "docs/from-1-to-2.md"
)
"""What a plugin of an earlier version has to change."""


def check_api(plugin: object, source: PluginSource) -> None:
    """Refuse a plugin that is written for another version of the plugin API. Raises PluginRefused."""
    major, minor = hookspecs.API
    ours = f"{DISTRIBUTION} {__version__} has {major}.{minor}"
    version = getattr(plugin, "GRASPSENSE_API", None)
    if version is None:
        raise PluginRefused(f"{source.module} has no GRASPSENSE_API: add GRASPSENSE_API = ({major}, {minor})")
    if not (isinstance(version, tuple) and len(version) == 2 and all(type(part) is int for part in version)):
        raise PluginRefused(f"GRASPSENSE_API is {version!r}: it must be two integers, as ({major}, {minor})")
    if version[0] > major or (version[0] == major and version[1] > minor):
        raise PluginRefused(
            f"it is written for plugin API {version[0]}.{version[1]}, {ours}: upgrade {DISTRIBUTION}"
        )
    if version[0] < major:
        raise PluginRefused(
            f"it is written for plugin API {version[0]}.{version[1]}, {ours}: upgrade {source.distribution}{_CHANGED}"
        )


def advice_on(source: PluginSource, cost: ImportCost) -> tuple[str, ...]:
    """Return what to improve about a plugin that works."""
    advice = []
    if cost.heavy or cost.processor_s > SLOW_IMPORT_S:
        brings = f", and imports {', '.join(sorted(cost.heavy))}" if cost.heavy else ""
        advice.append(
            f"slow: importing {source.module} takes {cost.processor_s * 1e3:.0f} ms of processor time{brings}. Its "
            "author: name classes by import strings, and import heavy packages inside them"
        )
    if cost.waited_s > SLOW_WAIT_S:
        advice.append(
            f"slow: importing {source.module} waits for {cost.waited_s:.1f} s. Its author: wait for a device or a "
            "network where it is opened, not where the plugin is imported"
        )
    if source.copies:
        advice.append(
            f"installed {len(source.copies)} times ({'; '.join(source.copies)}), the first is used: "
            f"pip uninstall {source.distribution} until none is left, then install it once"
        )
    return tuple(advice)


def error_text(error: BaseException) -> str:
    """Return the type and text of an error in one line; the text alone for a plugin that was refused."""
    if isinstance(error, PluginRefused):
        return str(error)
    # The first argument of an error of attrs is the sentence; the others are the attribute and the value.
    from_attrs = len(error.args) > 1 and isinstance(error.args[1], attrs.Attribute)
    text = str(error.args[0]) if from_attrs else str(error)
    if isinstance(error, ModuleNotFoundError):
        text += " (`pip check` says what is not installed)"
    return f"{type(error).__name__}: {text}" if text else type(error).__name__
