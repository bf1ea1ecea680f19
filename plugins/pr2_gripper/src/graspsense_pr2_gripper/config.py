"""Settings of the PR2 gripper."""

from __future__ import annotations

from attrs import field, frozen
from attrs.validators import and_, ge, le

_USB_ID = and_(ge(0), le(0xFFFF))


@frozen
class Pr2Config:
    """Which device to open: its USB vendor and product id, and its serial number where there are several.

    1209:0001 is the number that pid.codes reserves for private tests.
    """

    vendor_id: int = field(default=0x1209, validator=_USB_ID)
    product_id: int = field(default=0x0001, validator=_USB_ID)
    serial: str = ""
