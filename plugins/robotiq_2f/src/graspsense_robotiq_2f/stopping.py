"""Stopping a gripper whose program was killed."""

from __future__ import annotations

from contextlib import closing

from graspsense_robotiq_2f.registers import Request
from graspsense_robotiq_2f.ur_cap import opened_link


def stop(port: str, address: int, timeout_s: float) -> None:
    """Tell the gripper at this port to stop. Raises OSError, NoReply."""
    with closing(opened_link(port, address, timeout_s)) as link:
        link.exchange(Request(active=True, go=False, position=0, speed=0, force=0).registers())
