"""The emulated board: firmware over a backend, behind a connection with faults, as in the settings."""

from __future__ import annotations

from typing import Any, Final, NamedTuple

from graspsense.gripper_api import opened_body
from graspsense.plugin_api import ConfigError, DeviceInfo, SensorBackend
from graspsense_pr2_gripper.accelerometer import RANGE_G
from graspsense_pr2_gripper.ceilings import EFFORT_CEILING_N, SPEED_CEILING_M_S
from graspsense_pr2_gripper.config import Pr2Config
from graspsense_pr2_gripper.faults import Wire
from graspsense_pr2_gripper.firmware import STRONG_N, Firmware
from graspsense_pr2_gripper.linkage import (
    EDGE_COUNTS_PER_N,
    ENCODER_TICKS,
    PAD_COUNTS_PER_N,
    SIDE_COUNTS_PER_N,
)
from graspsense_pr2_gripper.protocol import Identity, ProtocolError, encode_identity

EMULATED_SERIAL: Final = "EMULATED"
IMAGE_PERIOD_US: Final = 41_000
WATCHDOG_MS: Final = 100


class Emulation(NamedTuple):
    """The board behind an emulated transport: its connection, its backend, and the description of the backend."""

    wire: Wire
    body: SensorBackend[Any]
    body_info: DeviceInfo

    def report(self) -> dict[str, float | int | str | bool]:
        """Return what the body knows, and the effort and the force that it got, whatever the board reported.

        `largest_effort_n` is the largest closing effort, `seconds_above_30_n` the time with more than `STRONG_N`, and
        `largest_force_n` the largest true force on a pad, where the body knows it.
        """
        report = dict(self.body.report())
        firmware = self.wire.firmware
        report["largest_effort_n"] = firmware.largest_effort_n
        report[f"seconds_above_{STRONG_N:.0f}_n"] = round(firmware.strong_s, 6)
        if "true_peak_force_n" in report:
            report["largest_force_n"] = report["true_peak_force_n"]
        return report


def emulated_board(config: Pr2Config, seed: int) -> Emulation:
    """Return a board over the backend that the settings name, which is opened. Raises ConfigError."""
    body, info = opened_body(config.body, config.body_config, config.object, seed)
    identity = Identity(
        firmware=(1, 0, 0),
        serial=config.serial or EMULATED_SERIAL,
        transmission=config.transmission,
        pad_counts_per_n=PAD_COUNTS_PER_N,
        side_counts_per_n=SIDE_COUNTS_PER_N,
        edge_counts_per_n=EDGE_COUNTS_PER_N,
        effort_limit_un=round(EFFORT_CEILING_N * 1e6),
        speed_limit_um_s=round(SPEED_CEILING_M_S * 1e6),
        report_rate_hz=round(info.rate_hz),
        image_period_us=IMAGE_PERIOD_US,
        watchdog_ms=WATCHDOG_MS,
        encoder_ticks_rev=ENCODER_TICKS,
        accelerometer_g=RANGE_G,
    )._replace(**config.faults.identity)
    try:
        encode_identity(identity)
    except ProtocolError as error:
        raise ConfigError(
            f"the emulated board cannot have this identity: {error}. It follows from gripper.serial, "
            "gripper.body_config and gripper.faults.identity"
        ) from error
    return Emulation(Wire(Firmware(body, identity, seed), config.faults, seed), body, info)
