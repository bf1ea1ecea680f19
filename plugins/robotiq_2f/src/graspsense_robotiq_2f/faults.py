"""The fault codes of the grippers as status bits (Robotiq instruction manuals, register gFLT)."""

from __future__ import annotations

from math import inf
from typing import Final

from graspsense.gripper_api import StatusBit

_CODES: Final = {
    0x05: ("not activated", "it has to be activated again before it moves", 0.1),
    0x07: ("activation bit missing", "it has to be activated before it moves", 0.1),
    0x08: ("too hot", "its temperature is above 85 degrees Celsius: let it cool down", inf),
    0x09: ("no communication", "it got no command for a second", 0.1),
    0x0A: ("voltage too low", "its supply is below the least voltage", 0.0),
    0x0B: ("automatic release", "an emergency release is in progress", 0.0),
    0x0C: ("internal fault", "it has to be restarted", 0.0),
    0x0D: ("activation fault", "its activation met an obstacle: remove it, and restart the gripper", 0.0),
    0x0E: ("overcurrent", "its motor took too much current", 0.0),
    0x0F: ("released by itself", "an emergency release was completed: activate it again", 0.0),
}
"""Each code with its name, what follows, and the time (s) for which a grasp endures it."""

STATUS_BITS: Final = tuple(
    StatusBit(mask=1 << code, name=name, meaning=meaning, limit_s=limit_s)
    for code, (name, meaning, limit_s) in _CODES.items()
)


def bit_of(code: int) -> int:
    """Return the status bit of a fault code; 0 without a fault."""
    return 1 << code if code else 0
