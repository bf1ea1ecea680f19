"""A Robotiq gripper as a sensor backend."""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from contextlib import suppress
from math import inf, nan
from types import MappingProxyType
from typing import Any, Final, final

from graspsense.gripper_api import (
    SCALE_UNSEEN,
    BackendWithEmulator,
    DeadManSwitch,
    Polling,
    finger_target,
    lasting_port,
    no_pads,
    pad_force,
    tare,
)
from graspsense.plugin_api import (
    NO_PADS,
    POSITION,
    VELOCITY,
    Channel,
    Command,
    DeviceInfo,
    DeviceLost,
    NoDevice,
    Pads,
    Reading,
    TactileArray,
    signal_type,
)
from graspsense_robotiq_2f.config import RobotiqConfig
from graspsense_robotiq_2f.emulator.lock_step import LockStepGripper
from graspsense_robotiq_2f.link import ModbusLink, NoReply
from graspsense_robotiq_2f.registers import (
    ACTIVE,
    AMPERES_A_STEP,
    MODELS,
    STATUS_BITS,
    Request,
    Status,
    bit_of,
    byte_of,
    status_of,
)
from graspsense_robotiq_2f.tactile import CHANNELS, Board, TactileFingertips, opened_boards
from graspsense_robotiq_2f.tactile_protocol import CELLS, COLUMNS, ROWS
from graspsense_robotiq_2f.ur_cap import PREFIX, UrCapLink, opened_link

RATE_HZ: Final = 100.0
ACTIVATION_S: Final = 5.0
COMMAND_DELAY_S: Final = 0.02
"""A command waits for the next exchange (10 ms), which takes 5 ms on the line, and the gripper's next period (5 ms)."""
LET_GO: Final = "graspsense_robotiq_2f.ur_cap:let_go"
"""What is called if the program is killed."""
AHEAD_M: Final = 0.004
"""How far a target that moves can be ahead of the fingers."""


BARE: Final = (
    Channel("gap", "m", RATE_HZ),
    Channel("velocity", "m/s", RATE_HZ),
    Channel("effort", "N", RATE_HZ),
)
PADS: Final = (
    Channel("force_left", "N", RATE_HZ),
    Channel("force_right", "N", RATE_HZ),
    TactileArray("pads", "counts", 60.0, rows=ROWS, columns=COLUMNS),
    *CHANNELS,
)
TARE_IMAGES: Final = 10
PADS_SILENT_S: Final = 0.5
"""Time without an image after which the fingertips are lost."""


@final
class RobotiqBackend(BackendWithEmulator[RobotiqConfig]):
    """Turns commands into a target position with a speed and a force; each read is one exchange."""

    accepts = ("velocity", "position", "force")
    closes_itself: Mapping[str, str] = MappingProxyType(
        {
            "velocity": "the open or closed position, with this speed; below the least speed a target that moves at it",
            "position": "the target, with the limits of the command as speed and force",
            "force": "the closed position, with this force and at most the least speed",
        }
    )
    command_delay_s = COMMAND_DELAY_S

    def __init__(self, config: RobotiqConfig) -> None:
        super().__init__(config)
        self._model = MODELS[config.model]
        self.least_force_n = self._model.forces_n[0]
        self.least_step_m = self._model.step_m
        self._link: ModbusLink | UrCapLink | LockStepGripper | None = None
        self._switch: DeadManSwitch | None = None
        self._fingertips: TactileFingertips | None = None
        self._polling = Polling(RATE_HZ)
        self._gap_m = self._target_m = 0.0
        self._elapsed_s = 1.0 / RATE_HZ
        self._pads = NO_PADS
        self._asked = Request(active=True, go=False, position=0, speed=0, force=0)
        self._clock_report: Mapping[str, float | int | str | bool] = {}

    @property
    def channels(self) -> tuple[Channel, ...]:
        """Those of the bare gripper, and with fingertips their forces and cells. A UR cap does not tell the current."""
        bare = BARE[:2] if self.config.port.startswith(PREFIX) else BARE
        return bare + PADS if self.config.tactile_port else bare

    def open(self, seed: int) -> DeviceInfo:
        """Open the gripper, and activate it if it is not: it then opens and closes once. Raises NoDevice."""
        self.close()
        config, model = self.config, self._model
        self._asked = Request(active=True, go=False, position=0, speed=0, force=0)
        try:
            self._emulated = LockStepGripper(config, seed) if config.emulated else None
            self._link = self._emulated or opened_link(config.port, config.address, config.reply_timeout_s)
            if self._emulated is None:
                port = lasting_port(config.port)
                self._switch = DeadManSwitch(LET_GO, port, config.address, config.reply_timeout_s)
            self._polling = Polling(RATE_HZ, self._emulated or time)
            status = self._activated()
            self._open_fingertips()
        except (OSError, ValueError, NoReply) as error:
            self.close()
            raise NoDevice(
                f"no {model.name} at {config.port}, unit {config.address}: {error}. Look at its power and cable, at "
                "gripper.port and gripper.address; on Linux be in the group dialout"
            ) from error
        self._polling.begin()
        self._gap_m = self._target_m = model.gap_m(status.position)
        return self._described()

    def read(self, timeout_s: float) -> Reading | None:
        """Wait for the next multiple of 10 ms, then exchange data with the gripper. Raises DeviceLost."""
        if not self._polling.wait(timeout_s):
            return None
        status = self._status()
        self._gap_m = self._model.gap_m(status.position)
        told = not isinstance(self._link, UrCapLink)
        effort_n = status.current * AMPERES_A_STEP * self.config.newtons_per_ampere if told else nan
        frame = self._polling.frame(self._gap_m, effort_n, bit_of(status.fault))
        self._elapsed_s = frame.dt_s
        (left_n, right_n), signals = self._felt()
        return Reading(frame._replace(force_left_n=left_n, force_right_n=right_n), self._pads, signals)

    def apply(self, command: Command) -> None:
        """Store a command for the next exchange."""
        slowest = self._model.speeds_m_s[0]
        goal, speed, force = finger_target(command, self._gap_m, self._model.stroke_m, slowest)
        if speed <= slowest:
            self._move_target(goal, speed)
        else:
            self._target_m = goal
        self._asked = self._asked._replace(
            go=True,
            position=self._model.position(self._target_m),
            speed=byte_of(speed, self._model.speeds_m_s),
            force=byte_of(force, self._model.forces_n),
        )

    def tare(self, images: Sequence[Pads]) -> None:
        """Set the zero of the fingertips; without them do nothing. Raises TareRefused."""
        if self._fingertips is not None:
            self._zero = tare(images, self.config.pad_counts_per_newton, 0)

    def close(self) -> None:
        """Stop the fingers if the gripper still responds, and close it. A lost one is told to open, if it can be."""
        link, self._link = self._link, None
        stopped = link is None or self._stopped(link)
        switch, self._switch = self._switch, None
        if switch is not None:
            switch.release(stopped=stopped)
        fingertips, self._fingertips = self._fingertips, None
        if fingertips is not None:
            fingertips.close()

    def report(self) -> Mapping[str, float | int | str | bool]:
        """Return the number of frames, and of repeated exchanges, with what the emulated body knows."""
        return {**super().report(), **self._polling.report(), **self._clock_report}

    def emulation(self) -> Mapping[str, Any]:
        """Return the settings of a dry run, with as many ports of fingertips."""
        emulated_tips = ",".join("emulated" for _ in self.config.tactile_ports)
        return {**super().emulation(), "tactile_port": emulated_tips}

    def _open_fingertips(self) -> None:
        ports = self.config.tactile_ports
        if not ports:
            return
        self._pads = no_pads(CELLS)
        self._zero = ((0.0,) * CELLS, (0.0,) * CELLS)
        boards: Sequence[Board]
        if "emulated" in ports:
            assert self._emulated is not None
            boards = self._emulated.boards()
        else:
            boards = opened_boards(ports)
        self._fingertips = TactileFingertips(boards)
        if not self._fingertips.take(ACTIVATION_S):
            raise NoReply(f"the fingertips at {self.config.tactile_port} send nothing")

    def _felt(self) -> tuple[tuple[float, float], Any]:
        """Take what the fingertips sent, and return the forces on the pads and the signals. Raises DeviceLost."""
        if self._fingertips is None:
            return (nan, nan), ()
        try:
            self._fingertips.take(0.0)
        except OSError as error:
            raise DeviceLost(f"the fingertips at {self.config.tactile_port} are gone: {error}") from error
        image = self._fingertips.image
        if image is not None:
            # An image that was measured before the gripper was opened has its time.
            self._pads = Pads(max(image.host_s - self._polling.began_s, 0.0), image.counter, *image.cells)
            self._clock_report = self._fingertips.report()
        if self._fingertips.age_s() > PADS_SILENT_S:
            raise DeviceLost(
                f"the fingertips at {self.config.tactile_port} send nothing any more: look at their cable"
            )
        gain = self.config.pad_counts_per_newton
        left, right = (
            pad_force(cells, zero, gain, 0) if self._pads.counter else 0.0
            for cells, zero in zip(self._pads[2:], self._zero, strict=True)
        )
        return (left, right), signal_type(self.channels)(*self._fingertips.signals(self._polling.began_s))

    def _described(self) -> DeviceInfo:
        config, model = self.config, self._model
        numbers = {"newtons_per_ampere": config.newtons_per_ampere}
        notes = [
            "effort is the motor's current times gripper.newtons_per_ampere, an assumption unless you measured it"
        ]
        if config.tactile_port:
            numbers["pad_counts_per_n"] = config.pad_counts_per_newton
            notes.append(
                f"the forces are counts over gripper.pad_counts_per_newton, likewise: {SCALE_UNSEEN}"
            )
        info = DeviceInfo(
            name=model.name,
            clock="device",
            rate_hz=RATE_HZ,
            effort_limit_n=model.forces_n[1],
            speed_limit_m_s=model.speeds_m_s[1],
            opening=Command(POSITION, (self._emulated or model).stroke_m, inf, 0.05),
            # It still has a target to go to, where the encoder is wrong or the object yields.
            relaxed=Command(VELOCITY, 0.0, self.least_force_n, inf),
            tare_images=TARE_IMAGES if self._fingertips is not None else 0,
            status_bits=STATUS_BITS,
            numbers=numbers,
            notes=tuple(notes),
        )
        return self.marked(info)

    def _activated(self) -> Status:
        """Return the status of the gripper once it is active. One that is already active does not move."""
        assert self._link is not None
        status = status_of(self._polling.tried(self._link.status, NoReply))
        if status.state == ACTIVE and not status.fault:
            return self._exchange(self._asked)
        self._exchange(self._asked._replace(active=False))
        clock = self._emulated or time
        until = clock.monotonic() + ACTIVATION_S
        while (status := self._exchange(self._asked)).state != ACTIVE:
            if clock.monotonic() > until:
                raise NoReply(f"not activated after {ACTIVATION_S:g} s, fault {status.fault}")
            clock.sleep(1.0 / RATE_HZ)
        return status

    def _move_target(self, goal_m: float, speed_m_s: float) -> None:
        """Move the target on by the way since the last frame: the gripper itself cannot move that slowly."""
        if speed_m_s == 0.0:
            self._target_m = self._gap_m
        step = speed_m_s * self._elapsed_s
        self._target_m += min(max(goal_m - self._target_m, -step), step)
        if goal_m < self._gap_m:
            self._target_m = max(self._target_m, self._gap_m - AHEAD_M)
        elif goal_m > self._gap_m:
            # A target that is left from closing is still within the object.
            self._target_m = max(self._target_m, min(self._gap_m + self._model.step_m, goal_m))

    def _stopped(self, link: ModbusLink | UrCapLink | LockStepGripper) -> bool:
        """Tell the gripper to stop, and close the connection; return whether this was not lost."""
        stop = self._asked._replace(go=False).registers()

        def told() -> None:
            # A late reply to the request before says that it still goes.
            if status_of(link.exchange(stop)).go:
                raise NoReply("it does not say that it stops")

        is_there = self._polling.told(told, NoReply)
        with suppress(OSError):
            link.close()
        return is_there

    def _exchange(self, request: Request) -> Status:
        link = self._link
        assert link is not None
        return status_of(self._polling.tried(lambda: link.exchange(request.registers()), NoReply))

    def _status(self) -> Status:
        if self._link is None:
            raise DeviceLost(f"the {self._model.name} is not open")
        try:
            status = self._exchange(self._asked)
        except (NoReply, OSError) as error:
            raise DeviceLost(
                f"the {self._model.name} at {self.config.port} does not answer ({error}): look at its cable and power"
            ) from error
        if status.state != ACTIVE:
            # The request to be active has begun an activation, which runs over the whole stroke: it is taken back.
            self._asked = self._asked._replace(active=False)
            raise DeviceLost(f"the {self._model.name} was switched off and on again: open it anew")
        return status
