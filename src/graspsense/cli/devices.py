"""`graspsense devices`: what is plugged in."""

from __future__ import annotations

import attrs
import click

from graspsense.cli.options import timeout_option
from graspsense.cli.output import echo_values, json_option
from graspsense.cli.terminal import echo, echo_table, state_style, talk
from graspsense.core.components.registry import installed


@click.command()
@timeout_option(2.0, "Time limit")
@json_option()
def devices(timeout_s: float) -> None:
    """List connected grippers."""
    probes = installed().probe_devices(timeout_s)
    devices = [(probe.distribution, device) for probe in probes for device in probe.given]
    failed = {probe.distribution: probe.error for probe in probes if probe.error}
    for distribution, error in failed.items():
        talk(f"{distribution} could not look for its devices: {error}")
    listed = [{**attrs.asdict(device), "distribution": distribution} for distribution, device in devices]
    echo_values({"devices": listed, "looked": [probe.distribution for probe in probes], "failed": failed})
    if devices:
        rows = [
            (
                device.backend,
                device.serial or "-",
                device.where,
                "ready" if device.ready else "not ready",
                device.advice,
            )
            for _, device in devices
        ]
        echo_table(("GRIPPER", "SERIAL", "WHERE", "STATE", "ADVICE"), rows, {"STATE": state_style})
    elif probes:
        echo(f"no device found by {', '.join(probe.distribution for probe in probes)}")
    else:
        echo("no installed plugin looks for devices (graspsense plugins list)")
