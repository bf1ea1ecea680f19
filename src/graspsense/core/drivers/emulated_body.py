"""A gripper that is real, or emulated over another backend as its fingers: its settings, and what follows from them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, ClassVar, Final, TypeVar

from attrs import evolve, fields, frozen

from graspsense.core.components.roles import ObjectKind, SensorBackend
from graspsense.core.components.setting import NAMES_INPUT, setting
from graspsense.core.settings.selected import create
from graspsense.core.values.device import DeviceInfo
from graspsense.core.values.errors import ConfigError

EMULATED: Final = "emulated"


def own_keys_first(cls: type, keys: list[Any]) -> list[Any]:
    """Return the keys of a config class with those of its base class last, as `field_transformer` of attrs."""
    del cls
    return sorted(keys, key=lambda key: key.inherited)


@frozen(kw_only=True)
class EmulatorSettings:
    """The settings by which a gripper is emulated. Raises ValueError if they are given for a real one.

    A subclass is decorated with `@frozen(kw_only=True, field_transformer=own_keys_first)`. Its key `where` is
    `emulated`, or says where the real gripper is.
    """

    body: str = setting(
        default="sim",
        meaning="Emulated only: a backend with a virtual clock that takes an effort, as the fingers.",
    )
    body_config: dict[str, Any] = setting(
        factory=dict, meaning="Emulated only: settings of that backend, as in its table [gripper]."
    )
    object: str | None = setting(
        default=None,
        effect=NAMES_INPUT,
        meaning="Emulated only: the object between the fingers; not set: the default of body.",
    )

    where: ClassVar[str] = "port"
    emulated_only: ClassVar[tuple[str, ...]] = ("faults",)
    """The keys of the subclass that are for the emulated gripper."""

    @property
    def emulated(self) -> bool:
        """Whether the gripper is emulated."""
        return bool(getattr(self, self.where) == EMULATED)

    def __attrs_post_init__(self) -> None:
        if self.emulated:
            return
        place: dict[str, Any] = {self.where: EMULATED}
        defaults = type(self)(**place)
        for key in (*(field.name for field in fields(EmulatorSettings)), *self.emulated_only):
            if getattr(self, key) != getattr(defaults, key):
                raise ValueError(
                    f"{key} is for the emulated gripper, but {self.where} is {getattr(self, self.where)!r}: leave it "
                    f"out, or set gripper.{self.where} to emulated"
                )


def opened_body(
    body: str, settings: Mapping[str, Any], scene: str | None, seed: int
) -> tuple[SensorBackend[Any], DeviceInfo]:
    """Return the backend that an emulated gripper moves, opened. Raises ConfigError if it has a clock of its own."""
    backend = _unopened(body, settings, scene)
    info = backend.open(seed)
    if info.clock != "virtual":
        backend.close()
        raise ConfigError(
            f"gripper.body {body!r} has a clock of its own, so no gripper can be emulated over it: name a gripper with "
            "a virtual clock, such as sim"
        )
    return backend, info


def _unopened(body: str, settings: Mapping[str, Any], scene: str | None) -> SensorBackend[Any]:
    values = {**settings, **({} if scene is None else {"object": scene})}
    backend: SensorBackend[Any] = create("sensor-backend", body, **values)
    return backend


EmulatorSettingsT = TypeVar("EmulatorSettingsT", bound=EmulatorSettings)


class BackendWithEmulator(SensorBackend[EmulatorSettingsT]):
    """A backend whose gripper is real, or emulated, as `where` of its settings says."""

    def objects(self) -> Sequence[ObjectKind]:
        """Return what the body of the emulated gripper can hold; nothing for a real one."""
        config = self.config
        if not config.emulated:
            return ()
        return tuple(_unopened(config.body, config.body_config, config.object).objects())

    def with_object(self, name: str) -> SensorBackend[EmulatorSettingsT]:
        """Return the emulated gripper with this object. Raises ConfigError for a real one."""
        if not self.config.emulated:
            return super().with_object(name)
        return type(self)(evolve(self.config, object=name))

    def marked(self, info: DeviceInfo) -> DeviceInfo:
        """Return this description of the gripper; of an emulated one, saying so, and with a virtual clock."""
        if not self.config.emulated:
            return info
        return evolve(
            info,
            name=f"emulated {info.name}",
            clock="virtual",
            simulated=True,
            notes=(*info.notes, "emulated: no gripper was touched"),
        )
