"""Settings of a Robotiq gripper: its model, its connection, and the emulation."""

from __future__ import annotations

from typing import Literal

from attrs import frozen

from graspsense.gripper_api import EmulatorSettings, SerialFaults, own_keys_first
from graspsense.plugin_api import setting


@frozen(kw_only=True, field_transformer=own_keys_first)
class RobotiqConfig(EmulatorSettings):
    """A Robotiq gripper and its connection; with `port = "emulated"` a gripper in software."""

    model: Literal["2f-85", "2f-140", "hand-e"] = setting(
        default="2f-85", meaning="The model of the gripper."
    )
    port: str = setting(
        default="/dev/ttyUSB0",
        meaning="A serial port; socket:HOST:PORT for RTU through a socket; ur:HOST for the UR cap of a robot; or "
        "emulated, a gripper in software.",
    )
    tactile_port: str = setting(
        default="",
        meaning="Serial port of TSF-85 fingertips, or two ports (left,right); empty: none; emulated, or "
        "emulated,emulated: those of the emulated gripper.",
    )
    pad_counts_per_newton: float = setting(
        default=1000.0,
        unit="counts/N",
        above=0.0,
        plausible=(1.0, 1e6),
        meaning="Counts of all cells of a TSF-85 under one newton. No document gives it: an assumption, measure yours.",
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
    faults: SerialFaults = setting(factory=SerialFaults, meaning="Emulated only: faults of the gripper.")

    @property
    def tactile_ports(self) -> tuple[str, ...]:
        """The ports of the fingertips: none, one, or that of the left one and that of the right one."""
        return tuple(port.strip() for port in self.tactile_port.split(",")) if self.tactile_port else ()

    def __attrs_post_init__(self) -> None:
        ports = self.tactile_ports
        if len(ports) > 2 or "" in ports or ports.count("emulated") not in (0, len(ports)):
            raise ValueError(
                f"tactile_port is {self.tactile_port!r}: give one port, or two with a comma between, both emulated or "
                "none"
            )
        if "emulated" in ports and not self.emulated:
            raise ValueError(
                f"tactile_port is emulated, but port is {self.port!r}: give the port of the fingertips, or set "
                "gripper.port to emulated"
            )
        super().__attrs_post_init__()
