"""Opening a gripper whose program was killed: one that only stops holds on, since its drive locks itself."""

from __future__ import annotations

from contextlib import closing

from graspsense_robotiq_2f.registers import Request
from graspsense_robotiq_2f.ur_cap import opened_link


def let_go(port: str, address: int, timeout_s: float) -> None:
    """Tell the gripper at this port to open, slowly. Raises OSError, NoReply."""
    with closing(opened_link(port, address, timeout_s)) as link:
        link.exchange(Request(active=True, go=True, position=0, speed=0, force=0).registers())
