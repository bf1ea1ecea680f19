"""How rmw_zenoh names things: key expressions, liveliness tokens, qualities of service and attachments.

The format is that of rmw_zenoh since its release with ROS 2 Jazzy (docs/design.md of ros2/rmw_zenoh).
"""

from __future__ import annotations

import hashlib
import re
import struct
from typing import Final, Literal

from attrs import frozen

from graspsense_ros2.message_types import hash_of

ADMIN_SPACE: Final = "@ros2_lv"
Kind = Literal["MP", "MS", "SS", "SC"]
"""Publisher, subscription, service, client."""
VOLATILE: Final = "::,10:,:,:,,"
"""Reliable, volatile, the last 10 are kept: the default of ROS 2."""
LATCHED: Final = ":1:,1:,:,:,,"
"""Reliable, and the last message is kept for who comes later."""
_NAME: Final = re.compile(r"/?[A-Za-z_][A-Za-z0-9_]*(/[A-Za-z_][A-Za-z0-9_]*)*")
_ATTACHMENT: Final = struct.Struct("<qqB16s")
_GID_BYTES: Final = 16


def is_name(name: str) -> bool:
    """Return whether this can be the name of a topic, a service or an action."""
    return _NAME.fullmatch(name) is not None


def absolute(name: str) -> str:
    """Return a name with its slash at the beginning."""
    return name if name.startswith("/") else f"/{name}"


def key_expression(domain: int, name: str, type_name: str) -> str:
    """Return where the messages of a topic, or the requests to a service, are exchanged."""
    return f"{domain}/{name.lstrip('/')}/{_dds_type(type_name)}/{hash_of(type_name)}"


def _dds_type(type_name: str) -> str:
    package, group, name = type_name.split("/")
    return f"{package}::{group}::dds_::{name}_"


@frozen
class NodeNames:
    """A node: its domain, the id of its zenoh session, and its name."""

    domain: int
    session: str
    name: str

    def token(self) -> str:
        """Return the liveliness token of the node."""
        return f"{self._beginning(0)}/NN/%/%/{self.name}"

    def endpoint(self, number: int, kind: Kind, name: str, type_name: str, quality: str) -> str:
        """Return the liveliness token of a publisher, a subscription, a service or a client."""
        mangled = absolute(name).replace("/", "%")
        what = f"{mangled}/{_dds_type(type_name)}/{hash_of(type_name)}/{quality}"
        return f"{self._beginning(number)}/{kind}/%/%/{self.name}/{what}"

    def _beginning(self, number: int) -> str:
        return f"{ADMIN_SPACE}/{self.domain}/{self.session}/0/{number}"


def publishers_of(domain: int, topic: str) -> str:
    """Return the key expression of the tokens of all publishers of a topic."""
    mangled = absolute(topic).replace("/", "%")
    return f"{ADMIN_SPACE}/{domain}/*/*/*/MP/*/*/*/{mangled}/**"


def type_in(token: str) -> str:
    """Return the type that the token of a publisher names, empty if it names none."""
    parts = "/".join(token.split("/")[10:11]).split("::")
    return f"{parts[0]}/{parts[1]}/{parts[3].removesuffix('_')}" if len(parts) == 4 else ""


def gid_of(token: str) -> bytes:
    """Return the 16 bytes by which others tell an endpoint, given its token."""
    return hashlib.blake2b(token.encode(), digest_size=_GID_BYTES).digest()


def attachment(sequence: int, time_ns: int, gid: bytes) -> bytes:
    """Return what goes with each message, request and response."""
    return _ATTACHMENT.pack(sequence, time_ns, _GID_BYTES, gid)


def sequence_and_gid(data: bytes) -> tuple[int, bytes]:
    """Return the sequence number and the gid of an attachment. Raises ValueError."""
    if len(data) != _ATTACHMENT.size:
        raise ValueError(f"an attachment of {len(data)} bytes instead of {_ATTACHMENT.size}")
    sequence, _, length, gid = _ATTACHMENT.unpack(data)
    if length != _GID_BYTES:
        raise ValueError(f"a gid of {length} bytes instead of {_GID_BYTES}")
    return sequence, gid
