"""The one place in core that knows what this project ships, as plain strings: nothing is imported here."""

from __future__ import annotations

from typing import Final

from attrs import frozen

from graspsense.core.entries import Role

DISTRIBUTION: Final = "graspsense"
BUILTIN_MODULE: Final = "graspsense.plugins.builtin"
"""The plugin module of the parts that come with this distribution."""


@frozen
class Shipped:
    """A distribution of this project: its folder in a clone, and its extra of `graspsense`."""

    distribution: str
    folder: str
    extra: str

    @property
    def hint(self) -> str:
        """How to install it, from a clone and from an index."""
        return (
            f"in a clone: pip install -e . -e ./plugins/{self.folder}"
            f'     published: pip install "graspsense[{self.extra}]"'
        )


_PR2 = Shipped("graspsense-pr2-gripper", "pr2_gripper", "pr2")
_SIM = Shipped("graspsense-sim-gripper", "sim_gripper", "sim")
_C45 = Shipped("graspsense-c45", "c45", "c45")

SHIPPED: Final[dict[tuple[Role, str], Shipped]] = {
    ("sensor-backend", "pr2"): _PR2,
    ("sensor-backend", "sim"): _SIM,
    ("classifier", "c45"): _C45,
}
"""Components that this project ships in distributions of their own: the hint where one is not installed."""

MODELS: Final[dict[str, Shipped]] = {"default": _SIM}
"""Models that this project ships, and with which distribution."""
