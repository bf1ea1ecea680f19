"""A gripper that is real, or emulated over another backend as its fingers: its settings, and what follows from them.

The fingers of one that closes by itself take an effort, and are driven to a target.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from math import inf
from typing import Any, ClassVar, Final, Generic, NamedTuple, Protocol, TypeVar

from attrs import evolve, fields, frozen

from graspsense.core.components.roles import ObjectKind, SensorBackend
from graspsense.core.components.setting import NAMES_INPUT, setting
from graspsense.core.settings.selected import create
from graspsense.core.values.device import DeviceInfo
from graspsense.core.values.errors import ConfigError
from graspsense.core.values.signals import EFFORT, FORCE, POSITION, VELOCITY, Command

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


class MovedFingers(Protocol):
    """What moves the fingers of an emulated gripper. It is active since this time (s), infinity while it is not."""

    fingers: EmulatedFingers
    active_since_s: float

    def look(self, now_s: float) -> object:
        """Move up to this time (s)."""


HandT = TypeVar("HandT", bound=MovedFingers)


class LockStepDevice(Generic[HandT]):
    """An emulated gripper in this process, as the clock of its driver: its time passes only while somebody waits."""

    def __init__(self, hand: HandT) -> None:
        self.hand, self.body = hand, hand.fingers.body
        self._now_s = 0.0

    def monotonic(self) -> float:
        """Return the time (s) of the gripper."""
        return self._now_s

    def sleep(self, seconds: float) -> None:
        """Let this time pass."""
        self._now_s += seconds

    def close(self) -> None:
        """Release the body."""
        self.hand.fingers.close()


EmulatorSettingsT = TypeVar("EmulatorSettingsT", bound=EmulatorSettings)


class BackendWithEmulator(SensorBackend[EmulatorSettingsT]):
    """A backend whose gripper is real, or emulated, as `where` of its settings says."""

    _emulated: Any = None
    """The `LockStepDevice` that is emulated in this process, once it is open."""

    def report(self) -> Mapping[str, float | int | str | bool]:
        """Return what the body of the emulated gripper knows; nothing for a real one."""
        return {} if self._emulated is None else self._emulated.body.report()

    def emulation(self) -> Mapping[str, Any]:
        """Return the settings with which a dry run emulates a real gripper."""
        return {self.config.where: EMULATED}

    def dry_run_backend(self) -> SensorBackend[EmulatorSettingsT]:
        """Return the emulated gripper."""
        config = self.config
        return type(self)(config if config.emulated else evolve(config, **self.emulation()))

    def objects(self) -> Sequence[ObjectKind]:
        """Return what the body of the emulated gripper can hold; nothing for a real one."""
        config = self.config
        if not config.emulated:
            return ()
        return tuple(_unopened(config.body, config.body_config, config.object).objects())

    def with_object(self, name: str) -> SensorBackend[EmulatorSettingsT]:
        """Return the emulated gripper with this object. Raises ConfigError for a real one and an unknown object."""
        if not self.config.emulated:
            return super().with_object(name)
        _unopened(self.config.body, self.config.body_config, None).with_object(name)
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


GAIN_N_S_M: Final = 15000.0
INTEGRAL_N_M: Final = 2000.0
"""Effort per error of the speed, and per error of the way."""
NEAR_S: Final = 0.02
"""The fingers slow down over the way of this time at their speed."""
REST_M_S: Final = 1e-3
"""Speed of fingers that have met something."""
CATCH_UP_S: Final = 5.0
"""Most time that is made up at once: by then the fingers have come to rest."""


class FingerTarget(NamedTuple):
    """Where the fingers go (gap in m), how fast at most (m/s), and with which force at most (N)."""

    gap_m: float
    speed_m_s: float
    force_n: float


def finger_target(
    command: Command, gap_m: float, open_m: float, force_speed_m_s: float = inf, closed_m: float = 0.0
) -> FingerTarget:
    """Return the target of a command to fingers at this gap, between the gaps of the open and the closed gripper.

    Where only a force is asked for, they close at `force_speed_m_s` at most. Other commands, and those with a NaN, stop
    them; of the latter, they get no force.
    """
    kind, value, force_n, speed_m_s = command
    if any(number != number for number in command):
        return FingerTarget(gap_m, 0.0, 0.0)
    if kind == VELOCITY:
        return FingerTarget(open_m if value > 0.0 else closed_m, min(abs(value), speed_m_s), force_n)
    if kind == POSITION:
        return FingerTarget(min(max(value, closed_m), open_m), speed_m_s, force_n)
    if kind == FORCE:
        return FingerTarget(closed_m, min(force_speed_m_s, speed_m_s), min(value, force_n))
    return FingerTarget(gap_m, 0.0, force_n)


class EmulatedFingers:
    """Fingers with this stroke (m) over the backend `body`, at the time (s) that each call gives.

    A hand with a shorter stroke than the body has its fingers mounted closer together; one with a longer stroke, or
    None, has the body's.
    Raises ConfigError for a body that has a clock of its own.
    """

    def __init__(
        self,
        body: str,
        settings: Mapping[str, Any],
        scene: str | None,
        seed: int,
        stroke_m: float | None = None,
    ) -> None:
        self.body, info = opened_body(body, settings, scene, seed)
        self.tick_s = 1.0 / info.rate_hz
        self.rest_s = 0.0
        """For how long (s) the fingers have been at rest on their way."""
        self._integral_n = self._body_s = 0.0
        self._frame = self._read()
        widest_m = float(self._frame.gap_m)
        self.stroke_m = widest_m if stroke_m is None else min(stroke_m, widest_m)
        self._offset_m = widest_m - self.stroke_m

    @property
    def gap_m(self) -> float:
        """The gap between the fingers."""
        return float(self._frame.gap_m - self._offset_m)

    @property
    def velocity_m_s(self) -> float:
        """The rate of the gap."""
        return float(self._frame.velocity_m_s)

    @property
    def effort_n(self) -> float:
        """The effort of the motor."""
        return float(self._frame.effort_n)

    @property
    def forces_n(self) -> tuple[float, float]:
        """The forces on the pads of the body."""
        return float(self._frame.force_left_n), float(self._frame.force_right_n)

    def move(self, now_s: float, target: FingerTarget | None) -> None:
        """Move up to this time towards the target; without one, without an effort."""
        self._body_s = max(self._body_s, now_s - CATCH_UP_S)
        while self._body_s + self.tick_s <= now_s:
            self._body_s += self.tick_s
            effort_n = 0.0 if target is None else self._effort(target)
            self.body.apply(Command(EFFORT, effort_n, inf, inf))
            self._frame = self._read()

    def close(self) -> None:
        """Release the body."""
        self.body.close()

    def _read(self) -> Any:
        reading = self.body.read(1.0)
        if reading is None:
            raise RuntimeError("the body of an emulated gripper gave no frame: it needs a virtual clock")
        return reading.frame

    def _effort(self, target: FingerTarget) -> float:
        """Return the effort of the next tick: a loop of the speed, whose effort is at most the force of the target."""
        # A target beyond the stroke is reached at the end of the stroke.
        way_m = self.gap_m - target.gap_m
        wanted = min(max(way_m / NEAR_S, -target.speed_m_s), target.speed_m_s)
        error = wanted + self._frame.velocity_m_s
        effort = GAIN_N_S_M * error + self._integral_n
        if abs(effort) < target.force_n:
            self._integral_n += INTEGRAL_N_M * self.tick_s * error
        rests = abs(self._frame.velocity_m_s) < REST_M_S
        self.rest_s = self.rest_s + self.tick_s if rests else 0.0
        return float(min(max(effort, -target.force_n), target.force_n))
