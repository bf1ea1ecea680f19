"""Settings of the gripper: its bus, its jaw, what its load means, and the emulation."""

from __future__ import annotations

from typing import Literal

from attrs import frozen

from graspsense.gripper_api import EmulatorSettings, SerialFaults, own_keys_first
from graspsense.plugin_api import setting
from graspsense_so101_gripper.registers import MODEL_NUMBER


@frozen(kw_only=True)
class So101Faults(SerialFaults):
    """Faults of the emulated arm, by default none."""

    model_number: int = setting(
        default=MODEL_NUMBER,
        minimum=0,
        maximum=65535,
        meaning="Model that the motor of the gripper says it is.",
    )


@frozen(kw_only=True, field_transformer=own_keys_first)
class So101Config(EmulatorSettings):
    """The gripper of an arm and its bus; with `port = "emulated"` an arm in software."""

    port: str = setting(
        default="/dev/ttyACM0", meaning="The serial port of the arm's bus; or emulated, an arm in software."
    )
    motor: int = setting(
        default=6, minimum=0, maximum=252, meaning="Number of the gripper's motor on the bus."
    )
    arm_calibration: str = setting(
        default="",
        meaning="The calibration file of the arm that LeRobot wrote (JSON); empty: the limits in the motor.",
    )
    calibration: str = setting(
        default="",
        meaning="Folder of calibrations of the force; empty: that of the user; none: no calibration.",
    )
    force_from: Literal["load", "current"] = setting(
        default="load", meaning="Which measurement of the motor the force is estimated from."
    )
    jaw_length_m: float = setting(
        default=0.1,
        unit="m",
        above=0.0,
        plausible=(0.02, 0.3),
        meaning="Distance from the axis of the jaw to its tip: measure yours.",
    )
    stall_torque_nm: float = setting(
        default=1.9,
        unit="N m",
        above=0.0,
        plausible=(0.1, 10.0),
        meaning="Torque of the motor at full load: 1.9 N m at 7.4 V, 2.9 N m at 12 V.",
    )
    stall_current_a: float = setting(
        default=2.4,
        unit="A",
        above=0.0,
        plausible=(0.1, 10.0),
        meaning="Current of the motor at full load; used with force_from = current.",
    )
    largest_load: float = setting(
        default=0.7,
        above=0.0,
        maximum=1.0,
        meaning="Largest share of the stall torque that is ever asked for.",
    )
    moving_force_n: float = setting(
        default=3.0,
        unit="N",
        minimum=0.0,
        plausible=(0.0, 20.0),
        meaning="Force at the tip that the geared motor needs to move the empty jaw: an assumption, measure yours.",
    )
    acceleration: int = setting(
        default=50, minimum=1, maximum=254, meaning="Acceleration of the motor, in 100 steps/s2."
    )
    reply_timeout_s: float = setting(
        default=0.1, unit="s", above=0.0, plausible=(1e-3, 120.0), meaning="Longest wait for a reply."
    )
    faults: So101Faults = setting(factory=So101Faults, meaning="Emulated only: faults of the arm.")

    @property
    def full_force_n(self) -> float:
        """The force at the tip at full load."""
        return self.stall_torque_nm / self.jaw_length_m
