"""What this distribution brings to graspsense: the identification of objects as scenes of the simulated gripper."""

from __future__ import annotations

from collections.abc import Iterable

from graspsense.plugin_api import hookimpl
from graspsense.simulator_api import IdentifierEntry

GRASPSENSE_API = (2, 0)


@hookimpl
def graspsense_identifiers() -> Iterable[IdentifierEntry]:
    """Return the identification for the simulated gripper."""
    yield IdentifierEntry(
        name="sim",
        target="graspsense_identify.run:identify",
        summary="terms and numbers of an object, with intervals and what stays open",
    )
