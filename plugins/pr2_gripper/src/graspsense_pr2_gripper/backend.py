"""The PR2 gripper as a sensor backend."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from contextlib import suppress
from math import isfinite
from typing import Final, final

from attrs import asdict, evolve

from graspsense.gripper_api import (
    SCALE_UNSEEN,
    BackendWithEmulator,
    calibrations_of,
    stored_friction,
    stored_gain,
    stored_tables,
    stored_zero,
)
from graspsense.plugin_api import (
    EFFORT,
    Channel,
    Command,
    DeviceInfo,
    DeviceLost,
    Pads,
    Reading,
)
from graspsense_pr2_gripper.accelerometer import CHANNEL as ACCELERATION
from graspsense_pr2_gripper.ceilings import EFFORT_CEILING_N, SPEED_CEILING_M_S
from graspsense_pr2_gripper.config import Pr2Config
from graspsense_pr2_gripper.fingertip import fingertips
from graspsense_pr2_gripper.link import LockStepLink
from graspsense_pr2_gripper.linkage import FRICTION_N, OPEN_GAP_M
from graspsense_pr2_gripper.measure import Measure
from graspsense_pr2_gripper.opening import Opened, open_board
from graspsense_pr2_gripper.protocol import (
    EFFORT_KIND,
    Identity,
    OutputReport,
    ProtocolError,
    encode_output,
    limit,
    micro,
)
from graspsense_pr2_gripper.status import COMMANDS_LOST, REPORTS_LOST, status_bits

_RATE_HZ: Final = 1000.0
_PADS_RATE_HZ: Final = 24.39
_CHANNELS: Final = (
    Channel("gap", "m", _RATE_HZ),
    Channel("velocity", "m/s", _RATE_HZ),
    Channel("effort", "N", _RATE_HZ),
    Channel("force_left", "N", _PADS_RATE_HZ),
    Channel("force_right", "N", _PADS_RATE_HZ),
    Channel("edge_left", "N", _PADS_RATE_HZ),
    Channel("edge_right", "N", _PADS_RATE_HZ),
    fingertips(_PADS_RATE_HZ),
)
OPENING_N: Final = -20.0
"""Effort that opens the fingers. The authors' recordings show 17 and 20 N, opening, between squeezes."""
TARE_IMAGES: Final = 6
UNHEARD_S: Final = 0.1
"""Device time without the echo of a command after which the device counts as lost."""
COMMANDS_LOST_S: Final = 0.02
"""Likewise, after which a person is told."""
UNHEARD_COMMANDS: Final = 5
"""Commands that must be without an echo by then: a host that stops for a moment has sent only one or two."""
UNCALIBRATED: Final = "none"
TEST_NUMBER: Final = (0x1209, 0x0001)


@final
class Pr2Backend(BackendWithEmulator[Pr2Config]):
    """Reads and commands one gripper over the transport in the settings."""

    accepts = ("effort",)

    _opened: Opened | None = None
    _report: dict[str, float | int | str | bool] | None = None
    _lost_serial = ""
    _stands_in = False
    _sent = _echo = _heard_us = _lost = 0

    @property
    def channels(self) -> tuple[Channel, ...]:
        """The frame and the fingertips, and the acceleration of the palm unless the settings say that there is none."""
        return (*_CHANNELS, ACCELERATION) if self.config.accelerometer else _CHANNELS

    def open(self, seed: int) -> DeviceInfo:
        """Open the gripper; only an emulated one uses the seed.

        After a loss, this waits for the gripper with the same serial number. Raises NoDevice, DataDamaged, and
        ConfigError if a stored calibration is of another device.
        """
        self.close()
        config = self.config
        wait_s = 0.0
        if self._lost_serial and not config.emulated:
            config, wait_s = evolve(config, serial=self._lost_serial), config.reconnect_s
        opened = open_board(config, seed, wait_s)
        try:
            info = self._described(opened)
        except BaseException:
            opened.link.close()
            raise
        self._opened = opened
        return info

    def read(self, timeout_s: float) -> Reading | None:
        """Return the newest frame with the last complete cell image. Raises DeviceLost."""
        link = self._open().link
        arrival = link.next(timeout_s)
        if arrival is None:
            return None
        report = arrival.report
        behind = (self._sent - report.echo) & 0xFFFF
        if report.echo != self._echo or not (behind and self._sent):
            self._heard_us = report.time_us
        unheard_s = (report.time_us - self._heard_us) * 1e-6
        if behind >= UNHEARD_COMMANDS and unheard_s > UNHEARD_S:
            raise DeviceLost(
                f"the PR2 gripper reports but takes no commands: {behind} were not echoed in {UNHEARD_S} s; its "
                "watchdog lets go. Unplug it and plug it in again"
            )
        if behind >= UNHEARD_COMMANDS and unheard_s > COMMANDS_LOST_S:
            report = report._replace(status=report.status | COMMANDS_LOST)
        self._echo = report.echo
        lost, self._lost = self._lost, link.stream.counts.lost
        if self._lost > lost:
            report = report._replace(status=report.status | REPORTS_LOST)
        return self._measure.reading(report, arrival.image, arrival.words, arrival.sampled)

    def apply(self, command: Command) -> None:
        """Send an effort within the limits of the device and of the host. Raises DeviceLost.

        Any other command, and an effort of NaN, relaxes the gripper.
        """
        report = OutputReport()
        if command.kind == EFFORT:
            with suppress(ProtocolError):
                most_un = limit(min(command.effort_limit_n, self._effort_limit_n))
                effort_un = micro(min(max(command.value, -self._effort_limit_n), self._effort_limit_n))
                # In whole numbers, since the board reports an effort that it must clamp.
                effort_un = min(max(effort_un, -most_un), most_un)
                speed_um_s = limit(min(command.speed_limit_m_s, self._speed_limit_m_s))
                report = OutputReport(
                    kind=EFFORT_KIND,
                    effort_un=effort_un,
                    effort_limit_un=most_un,
                    speed_limit_um_s=speed_um_s,
                )
        self._send(self._open(), report)

    def tare(self, images: Sequence[Pads]) -> None:
        """Set the zero of the pads. Raises TareRefused."""
        self._open()
        self._measure.tare(images)

    def close(self) -> None:
        """Relax the gripper if it still responds, and close it within two seconds."""
        opened, self._opened = self._opened, None
        if opened is None:
            return
        if self._sent:
            with suppress(DeviceLost):
                self._send(opened, OutputReport())
        if opened.link.gone:
            self._lost_serial = opened.identity.serial
        clean = opened.link.close()
        self._report = {**self._counted(opened), "closed_cleanly": clean}
        if opened.emulation is not None:
            self._report["let_go_after_s"] = opened.emulation.wire.firmware.run_on()

    def report(self) -> Mapping[str, float | int | str | bool]:
        """Return the counters of the connection; once closed, also whether it closed cleanly."""
        if self._opened is not None:
            return self._counted(self._opened)
        return self._report or {}

    def dry_run_backend(self) -> Pr2Backend:
        """Return an emulated gripper with the limits of a real one at its first use."""
        emulated = evolve(self.config, transport="emulated", pace="lock-step", calibration=UNCALIBRATED)
        backend = Pr2Backend(emulated)
        backend._stands_in = not self.config.emulated or self.config.pace == "device"
        return backend

    def _described(self, opened: Opened) -> DeviceInfo:
        config, identity, emulation = self.config, opened.identity, opened.emulation
        stored = calibrations_of(config.calibration, identity.serial, device_numbers(identity))
        self._measure = Measure(
            identity,
            config,
            stored_zero(stored["tare"]) if "tare" in stored else None,
            stored_tables(stored["load-cell"]) if "load-cell" in stored else None,
            stored_gain(stored["gain"]) if "gain" in stored else None,
        )
        self._effort_limit_n = min(identity.effort_limit_un / 1e6, EFFORT_CEILING_N)
        self._speed_limit_m_s = min(identity.speed_limit_um_s / 1e6, SPEED_CEILING_M_S)
        self._sent = self._echo = self._lost = 0
        self._heard_us = 0
        notes = [
            f"calibration {kind} of {calibration.made} is in use" for kind, calibration in stored.items()
        ]
        friction_n = FRICTION_N
        if config.calibration not in ("", UNCALIBRATED) and not stored:
            notes.append(f"{config.calibration} has no calibration of {identity.serial}: uncalibrated")
        if "friction" in stored:
            _, closing, _ = stored_friction(stored["friction"])
            friction_n = max(closing, default=FRICTION_N)
            notes.append(f"breakaway {min(closing, default=FRICTION_N):.1f} to {friction_n:.1f} N, closing")
        if config.accelerometer and not identity.accelerometer_g:
            notes.append("the board has no accelerometer: the channel acceleration stays empty")
        if emulation is not None:
            notes += ["emulated: no gripper was touched", *emulation.body_info.notes]
        elif "load-cell" not in stored:
            notes.append(f"the pads have no load table (graspsense calibrate load-cell): {SCALE_UNSEEN}")
        if emulation is None and (config.vendor_id, config.product_id) == TEST_NUMBER:
            notes.append("1209:0001 is a number for private tests: do not pass on a device that has it")
        return DeviceInfo(
            name="PR2 gripper" if emulation is None else f"emulated PR2 gripper over {config.body}",
            serial=identity.serial,
            firmware=".".join(map(str, identity.firmware)),
            clock="virtual" if isinstance(opened.link, LockStepLink) and not self._stands_in else "device",
            simulated=emulation is not None and emulation.body_info.simulated,
            rate_hz=identity.report_rate_hz,
            effort_limit_n=self._effort_limit_n,
            speed_limit_m_s=self._speed_limit_m_s,
            opening=Command(EFFORT, OPENING_N, math.inf, math.inf),
            relaxed=Command(EFFORT, 0.0, math.inf, math.inf),
            tare_images=TARE_IMAGES,
            numbers=device_numbers(identity),
            calibration={kind: calibration.sha256 for kind, calibration in stored.items()},
            notes=tuple(notes),
            friction_n=friction_n,
            open_gap_m=OPEN_GAP_M if emulation is None else emulation.body_info.open_gap_m,
            status_bits=status_bits(config.swap_fingers),
        )

    def _send(self, opened: Opened, report: OutputReport) -> None:
        """Send a command with the next counter."""
        self._sent += 1
        opened.link.send(encode_output(report._replace(counter=self._sent & 0xFFFF)))

    def _counted(self, opened: Opened) -> dict[str, float | int | str | bool]:
        link, emulation = opened.link, opened.emulation
        counted: dict[str, float | int | str | bool] = emulation.report() if emulation else {}
        counted.update(asdict(link.stream.counts))
        counted.update(
            discarded=link.discarded,
            skipped=link.skipped,
            bad_cells=self._measure.bad_cells,
            commands_sent=self._sent,
        )
        line = link.clock.line()
        if isfinite(line.offset_s):
            counted.update(
                clock_offset_s=line.offset_s,
                clock_drift=line.drift,
                clock_uncertainty_s=line.uncertainty_s,
                latency_frame_s=link.clock.latency_s(),
                latency_pads_s=link.clock.latency_s() + self._measure.image_age_s,
            )
        return counted

    def _open(self) -> Opened:
        if self._opened is None:
            raise DeviceLost("the PR2 gripper is not open")
        return self._opened


def device_numbers(identity: Identity) -> dict[str, float | str]:
    """Return the numbers that a calibration of this device depends on, besides the serial number."""
    return {
        "transmission": identity.transmission,
        "pad_counts_per_n": identity.pad_counts_per_n,
        "side_counts_per_n": identity.side_counts_per_n,
        "edge_counts_per_n": identity.edge_counts_per_n,
    }
