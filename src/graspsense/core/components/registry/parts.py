"""What a plugin brings, as the registry holds it: its status, its components and its resources.

The code behind a component or resource is imported when a method asks for it, not before. What a component declares is
taken from its class where its entry does not say it: a class states its config by the parameter of its base class
(`FeatureSet[PeakConfig]`) and the rest by the attributes that `entries.ROLES` names. `channels` of a gripper may be a
property of its settings, as for a hand whose fingers can be exchanged.
"""

from __future__ import annotations

import contextlib
import importlib
import inspect
import re
from abc import ABC, abstractmethod
from importlib.resources import files
from importlib.resources.abc import Traversable
from typing import Any, Final, Generic, Literal, TypeVar, get_args, get_origin

import attrs
from attrs import frozen

from graspsense.core.components.entries import (
    KIND_OF_ENTRY,
    ROLE_OF_ENTRY,
    ROLES,
    ComponentEntry,
    DatasetEntry,
    ExperimentEntry,
    ModelEntry,
    PipelineEntry,
    ResourceEntry,
    Role,
)
from graspsense.core.values.errors import (
    FAILURES,
    ComponentFailed,
    ConfigError,
    PluginUnavailable,
    named,
    suggestion,
)

_ADVICE = {
    "channels": 'write channels = (Channel("gap", "m", 100.0), ...) in the class, all that `read` delivers',
    "accepts": 'write accepts = ("velocity",) in the class, the kinds of command that `apply` accepts',
    "requires": 'write requires = (Channel("gap", "m"), ...) in the class, or () if it needs none',
    "commands": 'write commands = ("velocity",) in the class, the kinds of command that `step` returns',
    "features": 'write features = (Feature("peak", "N", "largest force"), ...) in the class',
}


EntryT = TypeVar("EntryT", bound=ComponentEntry | ResourceEntry)


def canonical(distribution: str) -> str:
    """Return the name of a distribution in its canonical spelling (PEP 503)."""
    return re.sub(r"[-_.]+", "-", distribution).lower()


@frozen
class PluginStatus:
    """One installed plugin: where it comes from, whether it is in use, and the reason if it is not."""

    distribution: str
    version: str
    entry_point: str
    module: str
    state: Literal["loaded", "disabled", "broken"]
    reason: str = ""
    traceback: str = ""
    hooks: tuple[str, ...] = ()
    import_s: float = 0.0
    """Processor time (s) that the import of its module took."""
    advice: tuple[str, ...] = ()
    """What to improve although the plugin works."""

    @property
    def absence(self) -> str:
        """Lines that explain why the plugin is not in use, for a user who misses a name; empty for a loaded one."""
        if self.state == "loaded":
            return ""
        what = f"failed to load: {self.reason}" if self.state == "broken" else f"disabled: {self.reason}"
        return (
            f"\n  {self.distribution} {self.version} is installed but {what}"
            f"\n  (graspsense plugins show {self.distribution})"
        )


@frozen
class Declared(ABC, Generic[EntryT]):
    """Something that a plugin declares by an entry."""

    entry: EntryT
    distribution: str
    version: str

    @property
    def name(self) -> str:
        """The short name, which another distribution may use too."""
        return self.entry.name

    @property
    def qualified(self) -> str:
        """The unique name, `distribution/name`."""
        return f"{self.distribution}/{self.entry.name}"

    @property
    @abstractmethod
    def kind(self) -> str:
        """What it is, in words: `sensor backend`, `data set`."""

    def _import(self, target: str) -> Any:
        """Return what an import string names. Raises PluginUnavailable."""
        path, _, name = target.partition(":")
        try:
            module = importlib.import_module(path)
            if hasattr(module, name):
                return getattr(module, name)
        except FAILURES as error:  # the import of a third party's module can raise anything
            lacks = isinstance(error, ModuleNotFoundError) and not getattr(self.entry, "needs", "")
            advice = "; `pip check` says what is not installed" * lacks
            raise self._unavailable(f"{named(error)}{advice}") from error
        near = suggestion(name, dir(module))
        raise self._unavailable(f"{path} has no {name!r}" + (near and f".{near}"))

    def _unavailable(self, why: str) -> PluginUnavailable:
        needs = getattr(self.entry, "needs", "")
        return PluginUnavailable(
            f"{self.kind} {self.name!r} of {self.distribution} {self.version} cannot be used here: {why}"
            + (f"\n  needs: {needs}" if needs else "")
        )


@frozen
class Component(Declared[ComponentEntry]):
    """A component that a plugin declares."""

    @property
    def role(self) -> Role:
        """The role that its entry is for."""
        return ROLE_OF_ENTRY[type(self.entry)]

    @property
    def kind(self) -> str:
        """The role in words."""
        return self.role.replace("-", " ")

    @property
    def table(self) -> str:
        """The table of a pipeline file in which it is selected."""
        return ROLES[self.role].table

    def config_class(self) -> type:
        """Import and return the attrs class of its config. Raises PluginUnavailable."""
        config_class: Any
        if self.entry.config:
            config_class, name = self._import(self.entry.config), self.entry.config
        else:
            config_class = self._config_of_class()
            name = f"{config_class.__module__}:{config_class.__qualname__}"
        if not (isinstance(config_class, type) and attrs.has(config_class)):
            raise self._unavailable(f"{name} is not an attrs class: write @attrs.frozen above it")
        return config_class

    def component_class(self) -> type:
        """Import and return its class, a concrete subclass of the base class of its role. Raises PluginUnavailable."""
        component_class: type[Any] = self._any_class()
        if inspect.isabstract(component_class):
            lacking = ", ".join(sorted(component_class.__abstractmethods__))
            raise self._unavailable(
                f"{self.entry.target} does not implement {lacking}, which {self._base().__name__} of plugin_api "
                "requires"
            )
        return component_class

    def create(self, config: object) -> Any:
        """Return the component built from an instance of its config class."""
        return self.component_class()(config)

    def declared(self, config: object = None) -> Any:
        """Return its entry with all that its class declares.

        `config` is an instance of its config class, by default that of its defaults; what the class declares by a
        property may depend on it. Raises PluginUnavailable if the class cannot be imported, or does not declare
        something, and ConfigError where the property refuses this config.
        """
        left_out = self._left_out()
        if not left_out:
            return self.entry
        part: Any = self.component_class()
        chosen = config is not None
        if any(map(self._varies, left_out)):
            if config is None:
                with contextlib.suppress(TypeError, ValueError):
                    config = self.config_class()()
            part = part if config is None else part(config)
        try:
            values = {name: self._value(part, name) for name in left_out}
        except PluginUnavailable:
            raise
        except FAILURES as error:
            if chosen and isinstance(error, ConfigError):
                raise  # the settings are wrong, and the error says how
            raise self._unavailable(f"what it declares raised {type(error).__name__}: {error}") from error
        try:
            return attrs.evolve(self.entry, **values)
        except (TypeError, ValueError) as error:
            raise self._unavailable(f"{self.component_class().__name__}: {error.args[0]}") from error

    def channels_vary(self) -> bool:
        """Return whether its channels depend on its settings. Raises PluginUnavailable."""
        return "channels" in self._left_out() and self._varies("channels")

    def _left_out(self) -> tuple[str, ...]:
        """Return what its entry leaves to the class; one that declares its commands leaves no alternatives to them."""
        names = ROLES[self.role].declared
        given = {name for name in names if getattr(self.entry, name) is not None}
        if "commands" in given:
            given.add("alternatives")
        return tuple(name for name in names if name not in given)

    def _of_class(self, name: str) -> bool:
        """Return whether its class, or one between it and the base class of its role, declares this."""
        declared = getattr(self.component_class(), name, None)
        return declared is not None and declared is not getattr(self._base(), name, None)

    def _varies(self, name: str) -> bool:
        """Return whether the class declares this by a property, which may depend on its settings."""
        return isinstance(inspect.getattr_static(self.component_class(), name, None), property)

    def _value(self, part: Any, name: str) -> Any:
        """Return what `part` declares: an instance of its class, or the class where nothing depends on the settings."""
        if name in _ADVICE and not self._of_class(name):
            raise self._unavailable(
                f"{self.component_class().__name__} does not declare `{name}`: {_ADVICE[name]}"
            )
        value = getattr(part, name)
        if isinstance(value, property):
            raise self._unavailable(f"its {name} depend on its settings, and these have no defaults")
        return value

    def _config_of_class(self) -> type:
        """Return the config class with which its class parametrises the base class of its role."""
        cls, base = self._any_class(), self._base()
        for ancestor in cls.__mro__:
            # Not by getattr: a class without a parametrised base inherits the attribute of one that has it.
            for parametrised in vars(ancestor).get("__orig_bases__", ()):
                origin = get_origin(parametrised)
                if isinstance(origin, type) and issubclass(origin, base):
                    config = get_args(parametrised)[0]
                    if isinstance(config, type):
                        return config
        raise self._unavailable(
            f"{cls.__name__} does not say what its settings are: write class {cls.__name__}({base.__name__}[Config]), "
            "where Config is an attrs class"
        )

    def _base(self) -> type:
        from graspsense.core.components import roles

        base: type = getattr(roles, type(self.entry).__name__.removesuffix("Entry"))
        return base

    def _any_class(self) -> Any:
        """Import and return its class, which may lack methods."""
        cls, base = self._import(self.entry.target), self._base()
        if not (isinstance(cls, type) and issubclass(cls, base)):
            raise self._unavailable(f"{self.entry.target} is not a subclass of {base.__name__}")
        return cls


@frozen
class Resource(Declared[EntryT]):
    """A pipeline, model, data set, command, emulator, experiment or check that a plugin declares."""

    @property
    def kind(self) -> str:
        """The kind of its entry in words."""
        return KIND_OF_ENTRY[type(self.entry)]

    @property
    def targets(self) -> tuple[str, ...]:
        """The names of the fields of its entry that name code; none for a file."""
        return tuple(name for name in _TARGETS if getattr(self.entry, name, ""))

    @property
    def is_file(self) -> bool:
        """Whether it is a file of its package."""
        return hasattr(self.entry, "resource")

    def load(self, part: str = "target") -> Any:
        """Import and return what this field of an entry names. Raises PluginUnavailable."""
        return self._import(getattr(self.entry, part))

    def made(self, kind: type, *given: Any) -> Any:
        """Call its function and return what it made of these values.

        Raises PluginUnavailable if it cannot be imported, ComponentFailed for a value of another kind.
        """
        made = self.load()(*given)
        if not isinstance(made, kind):
            raise ComponentFailed(
                f"{self.kind} {self.qualified} returned a value of type {type(made).__name__}: return {kind.__name__}"
            )
        return made

    def class_of_kind(self, part: str) -> type:
        """Import and return the class that a kind of experiment names as its `keys` or its `result`.

        Raises PluginUnavailable if it cannot be imported, ComponentFailed if values of it can be neither read nor
        written.
        """
        cls = self.load(part)
        target = f"{getattr(self.entry, part)}, `{part}` of the kind {self.qualified},"
        if not (isinstance(cls, type) and attrs.has(cls)):
            raise ComponentFailed(f"{target} is no class of attrs: decorate it with @frozen(kw_only=True)")
        names = {*attrs.fields_dict(cls), *dir(cls)}
        lacking = [name for name in ("source", "simulated") if part == "result" and name not in names]
        if lacking:
            raise ComponentFailed(
                f"{target} has no {' and no '.join(lacking)}: give it `source: str`, where its trials are from, in "
                "words, and `simulated: bool`, whether they are simulated"
            )
        return cls

    def recordings(self) -> Any:
        """Import and return the function of a data set that yields its recordings. Raises PluginUnavailable."""
        assert isinstance(self.entry, DatasetEntry), f"a {self.kind} has no recordings"
        if not self.entry.recordings:
            raise self._unavailable(
                "its reader gives features, and no recordings that can be replayed or imported"
            )
        return self._import(self.entry.recordings)

    def file(self) -> Traversable:
        """Return its file. Raises PluginUnavailable if its package does not contain it."""
        assert isinstance(self.entry, PipelineEntry | ModelEntry | ExperimentEntry), f"a {self.kind} is code"
        package, _, path = self.entry.resource.partition(":")
        try:
            file = files(package).joinpath(path)
        except FAILURES as error:
            raise self._unavailable(named(error)) from error
        if not file.is_file():
            raise self._unavailable(f"there is no file {path!r} in the package {package!r}")
        return file


_TARGETS: Final = ("target", "recordings", "export", "run", "keys", "result", "findings")


AnswerT = TypeVar("AnswerT")


@frozen
class HookAnswer(Generic[AnswerT]):
    """What the hook of one plugin gave: devices that it found, or findings; `error` is the reason if it failed."""

    distribution: str
    given: tuple[AnswerT, ...] = ()
    error: str = ""
