"""A Robotiq 2F-85 as a sensor backend."""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Mapping, Sequence
from contextlib import suppress
from math import inf, nan
from types import MappingProxyType
from typing import Final, final

from attrs import evolve, frozen

from graspsense.plugin_api import (
    FORCE,
    NAMES_INPUT,
    NO_PADS,
    POSITION,
    VELOCITY,
    Channel,
    Command,
    DeviceInfo,
    DeviceLost,
    Frame,
    NoDevice,
    ObjectKind,
    Pads,
    Reading,
    SensorBackend,
    UnknownName,
    setting,
)
from graspsense_robotiq_2f85.fake import THINGS, Fake
from graspsense_robotiq_2f85.faults import STATUS_BITS, bit_of
from graspsense_robotiq_2f85.modbus import Client, NoReply, opened
from graspsense_robotiq_2f85.registers import (
    ACTIVE,
    AMPERES_A_STEP,
    CLOSED_BYTE,
    COUNT,
    FORCES_N,
    INPUT,
    OPEN_BYTE,
    OPEN_M,
    OUTPUT,
    SPEEDS_M_S,
    Request,
    Status,
    byte_of,
    gap_of,
    position_of,
    status_of,
)

RATE_HZ: Final = 100.0
ACTIVATION_S: Final = 5.0
ATTEMPTS: Final = 3
SLOPE_FRAMES: Final = 6
FASTEST_RAMP_M_S: Final = 0.02


@frozen(kw_only=True)
class Robotiq2F85Config:
    """The keys of [gripper]."""

    port: str = setting(
        default="/dev/ttyUSB0",
        meaning="A serial port, rtu-tcp:HOST:PORT (a UR's tool connector), tcp:HOST:PORT (Modbus TCP), or fake.",
    )
    address: int = setting(default=9, minimum=1, maximum=247, meaning="Modbus address of the gripper.")
    reply_timeout_s: float = setting(
        default=0.1,
        unit="s",
        above=0.0,
        plausible=(1e-3, 120.0),
        meaning="Longest wait for a reply.",
    )
    newtons_per_ampere: float = setting(
        default=150.0,
        unit="N/A",
        above=0.0,
        plausible=(1.0, 2000.0),
        meaning="Grip force per motor current. The manual does not give it, so this is an assumption: measure yours.",
    )
    object: str = setting(
        default="block",
        effect=NAMES_INPUT,
        meaning="What the emulated gripper holds: block or sponge.",
    )
    vanishes_s: float = setting(
        default=inf,
        unit="s",
        above=0.0,
        meaning="Time at which the cable of the emulated gripper is pulled, for tests.",
    )


@final
class Robotiq2F85(SensorBackend[Robotiq2F85Config]):
    """Turns commands into a moving target position with a speed and a force; each read is one exchange."""

    channels = (
        Channel("gap", "m", RATE_HZ),
        Channel("velocity", "m/s", RATE_HZ),
        Channel("effort", "N", RATE_HZ),
    )
    accepts = ("velocity", "position", "force")
    closes_itself: Mapping[str, str] = MappingProxyType(
        {
            "velocity": "the open or closed position, with this speed; below 20 mm/s a target that moves at it",
            "position": "the target, with the limits of the command as speed and force",
            "force": "the closed position, with this force and at most 20 mm/s",
        }
    )
    least_force_n = FORCES_N[0]
    least_step_m = OPEN_M / (CLOSED_BYTE - OPEN_BYTE)
    _client: Client | None = None
    _fake: Fake | None = None

    def objects(self) -> Sequence[ObjectKind]:
        """Return what the emulated gripper can hold."""
        names = THINGS if self.config.port == "fake" else ()
        return [ObjectKind(name=name, default=True) for name in names]

    def with_object(self, name: str) -> SensorBackend[Robotiq2F85Config]:
        """Return the emulated gripper with this object. Raises ConfigError for a real one."""
        if self.config.port != "fake":
            return super().with_object(name)
        return Robotiq2F85(evolve(self.config, object=name))

    def open(self, seed: int) -> DeviceInfo:
        """Open and activate the gripper, which opens and closes once. Raises NoDevice."""
        del seed
        self.close()
        config = self.config
        port = config.port
        if port == "fake":
            name = config.object.partition("#")[0]
            if name not in THINGS:
                raise UnknownName(
                    f"the emulated gripper has no object {name!r}: there are {', '.join(THINGS)}"
                )
            thing_m, stiffness_n_m = THINGS[name]
            self._fake = Fake(thing_m=thing_m, stiffness_n_m=stiffness_n_m, vanishes_s=config.vanishes_s)
            port = self._fake.serial
        self._asked = Request(active=True, go=False, position=0, speed=0, force=0)
        try:
            self._client = opened(port, config.address, config.reply_timeout_s)
            self._exchange(self._asked._replace(active=False))
            until = time.monotonic() + ACTIVATION_S
            while (status := self._exchange(self._asked)).state != ACTIVE:
                if time.monotonic() > until:
                    raise NoReply(f"not activated after {ACTIVATION_S:g} s, fault {status.fault}")
        except (OSError, ValueError, NoReply) as error:
            self.close()
            raise NoDevice(
                f"no 2F-85 at {config.port}, unit {config.address}: {error}. Look at its power and cable, at "
                "gripper.port and gripper.address; on Linux be in the group dialout"
            ) from error
        self._began_s = self._last_s = self._due_s = time.monotonic()
        self._target_m = gap_of(status.position)
        self._recent: deque[tuple[float, float]] = deque(maxlen=SLOPE_FRAMES)
        self._frames = self._retries = 0
        return DeviceInfo(
            name="Robotiq 2F-85" if self._fake is None else "fake Robotiq 2F-85",
            clock="device",
            simulated=self._fake is not None,
            rate_hz=RATE_HZ,
            effort_limit_n=FORCES_N[1],
            speed_limit_m_s=SPEEDS_M_S[1],
            opening=Command(POSITION, OPEN_M, inf, 0.05),
            relaxed=Command(VELOCITY, 0.0, inf, inf),
            status_bits=STATUS_BITS,
            numbers={"newtons_per_ampere": self.config.newtons_per_ampere},
            notes=(
                "effort is the motor's current times gripper.newtons_per_ampere, an assumption unless you measured it",
                *(() if self._fake is None else ("a fake: no gripper was touched",)),
            ),
        )

    def read(self, timeout_s: float) -> Reading | None:
        """Wait for the next multiple of 10 ms, then exchange data with the gripper. Raises DeviceLost."""
        wait_s = self._due_s - time.monotonic()
        if wait_s > timeout_s:
            time.sleep(timeout_s)
            return None
        if wait_s > 0.0:
            time.sleep(wait_s)
        # On a grid of times, so that the duration of an exchange does not lower the rate; lost time is not made up.
        self._due_s = max(self._due_s, time.monotonic()) + 1.0 / RATE_HZ
        status = self._exchanged()
        now_s = time.monotonic()
        t_s, dt_s, self._last_s = now_s - self._began_s, now_s - self._last_s, now_s
        gap_m = gap_of(status.position)
        self._recent.append((t_s, gap_m))
        (first_s, first_m), span = self._recent[0], len(self._recent)
        velocity = (gap_m - first_m) / (t_s - first_s) if span > 1 else 0.0
        effort = status.current * AMPERES_A_STEP * self.config.newtons_per_ampere
        self._frames += 1
        return Reading(
            Frame(t_s, dt_s, gap_m, velocity, effort, nan, nan, nan, nan, bit_of(status.fault)),
            NO_PADS,
        )

    def apply(self, command: Command) -> None:
        """Store a command for the next exchange. The smallest force of the gripper is 20 N."""
        kind, value, effort_limit, speed_limit = command
        gap_m = self._recent[-1][1] if self._recent else self._target_m
        force = effort_limit
        if kind == VELOCITY:
            speed, goal = min(abs(value), speed_limit), OPEN_M if value > 0.0 else 0.0
        elif kind == POSITION:
            speed, goal = speed_limit, value
        elif kind == FORCE:
            speed, goal, force = min(FASTEST_RAMP_M_S, speed_limit), 0.0, min(value, effort_limit)
        else:
            speed, goal = 0.0, gap_m
        if speed <= SPEEDS_M_S[0]:
            # Below its smallest speed, the target moves on by the distance for the time since the last frame.
            if speed == 0.0:
                self._target_m = gap_m
            step = speed / RATE_HZ
            self._target_m += min(max(goal - self._target_m, -step), step)
            if goal < gap_m:
                self._target_m = max(self._target_m, gap_m - 0.004)
        else:
            self._target_m = goal
        self._asked = Request(
            active=True,
            go=True,
            position=position_of(self._target_m),
            speed=byte_of(speed, SPEEDS_M_S),
            force=byte_of(force, FORCES_N),
        )

    def tare(self, images: Sequence[Pads]) -> None:
        """Do nothing: there are no pads."""

    def close(self) -> None:
        """Stop the fingers if the gripper still responds, and close the connection."""
        client, self._client = self._client, None
        if client is not None:
            with suppress(OSError, NoReply):
                client.exchange(OUTPUT, self._asked._replace(go=False).registers(), INPUT, COUNT)
            with suppress(OSError):
                client.close()
        fake, self._fake = self._fake, None
        if fake is not None:
            fake.close()

    def report(self) -> dict[str, float | int | str | bool]:
        """Return the number of frames, and of repeated exchanges."""
        return {"frames": getattr(self, "_frames", 0), "repeated": getattr(self, "_retries", 0)}

    def dry_run_backend(self) -> Robotiq2F85:
        """Return the emulated gripper."""
        return Robotiq2F85(Robotiq2F85Config(port="fake", newtons_per_ampere=self.config.newtons_per_ampere))

    def _exchange(self, request: Request) -> Status:
        assert self._client is not None
        return status_of(self._client.exchange(OUTPUT, request.registers(), INPUT, COUNT))

    def _exchanged(self) -> Status:
        if self._client is None:
            raise DeviceLost("the 2F-85 is not open")
        for attempt in range(ATTEMPTS):
            try:
                status = self._exchange(self._asked)
            except NoReply as error:
                said = str(error)
                self._retries += attempt < ATTEMPTS - 1
                continue
            except OSError as error:
                said = str(error)
                break
            if not status.active:
                raise DeviceLost("the 2F-85 was switched off and on again: open it anew")
            return status
        raise DeviceLost(
            f"the 2F-85 at {self.config.port} does not answer ({said}): look at its cable and power"
        )
