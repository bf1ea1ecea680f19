"""The status bits of an STS3215 (register 65, and the error byte of each reply)."""

from __future__ import annotations

from math import inf
from typing import Final

from graspsense.gripper_api import StatusBit

STATUS_BITS: Final = (
    StatusBit(mask=1, name="voltage", meaning="its supply is outside of its limits", limit_s=0.0),
    StatusBit(mask=2, name="angle sensor", meaning="its position cannot be trusted", limit_s=0.0),
    StatusBit(mask=4, name="too hot", meaning="it is hotter than its limit: let it cool down", limit_s=0.5),
    StatusBit(mask=8, name="overcurrent", meaning="its current is above its limit", limit_s=0.5),
    StatusBit(
        mask=32,
        name="overload",
        meaning="it pushed for too long, and lowers its torque by itself",
        limit_s=inf,
    ),
)
