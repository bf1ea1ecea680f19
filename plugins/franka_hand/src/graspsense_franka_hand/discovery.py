"""Search for a hand: what answers at the address of the settings. No finger moves."""

from __future__ import annotations

from collections.abc import Iterator

from graspsense.gripper_api import Finding
from graspsense.plugin_api import PluginUnavailable
from graspsense_franka_hand.config import EMULATED, FrankaConfig
from graspsense_franka_hand.link import LibfrankaLink
from graspsense_franka_hand.orders import HandGone

ADVICE = (
    "look at gripper.host, at the cable to the control, whether FCI is active in Desk, and whether another program has "
    "the hand"
)


def diagnose(config: object, timeout_s: float) -> Iterator[Finding]:
    """Return the findings about the hand of these settings; without settings there is no address to ask."""
    if config is None:
        yield Finding(
            "franka", "note", "a Franka Hand is on the network: --gripper franka -o gripper.host=... asks it"
        )
    elif isinstance(config, FrankaConfig):
        yield from _asked(config, timeout_s)


def _asked(config: FrankaConfig, timeout_s: float) -> Iterator[Finding]:
    if config.host == EMULATED:
        yield Finding("franka", "note", "gripper.host is emulated, so no device is searched")
        return
    try:
        link = LibfrankaLink(config.host, timeout_s)
    except PluginUnavailable as error:
        yield Finding("franka", "problem", "pylibfranka is not installed", str(error))
        return
    except HandGone as error:
        yield Finding("franka", "problem", f"{config.host}: {error}", ADVICE)
        return
    state = link.first
    link.close()
    yield Finding(
        "franka",
        "ok",
        f"a hand at {config.host}",
        numbers={
            "width_m": state.width_m,
            "widest_m": state.widest_m,
            "temperature_c": state.temperature_c,
        },
    )
