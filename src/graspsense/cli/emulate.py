"""`graspsense emulate`: a gripper in software, as a device of this machine."""

from __future__ import annotations

import os
import select
import sys
import time
from collections.abc import Iterator
from typing import Any, Final

import click

from graspsense.cli.options import GRIPPER_ALONE, pipeline_options, settings_of
from graspsense.cli.output import echo_values, json_option
from graspsense.cli.terminal import talk
from graspsense.core.components.entries import EmulatorEntry
from graspsense.core.components.registry import installed
from graspsense.core.control.garbage_collection import present_objects_kept
from graspsense.core.drivers.emulated_serial import EmulatedDevice
from graspsense.core.values.errors import ConfigError, ExitCode, suggestion

LOOK_S: Final = 0.5
"""How often it is looked whether the device still runs."""


@click.command()
@click.argument("name")
@click.option(
    "--wire",
    default="",
    help="How the emulated device is reached: uhid, usb, pty or socket.  [default: the first that works]",
)
@pipeline_options
@json_option("Print JSON, one object per line: at the start and for each command.")
def emulate(name: str, wire: str, **asked: Any) -> None:
    """Emulate the gripper NAME (for example pr2) as a device of the operating system, until Ctrl-C.

    The command reads commands such as unplug and plug from its standard input, one per line; `help` lists them. The
    device disappears with the process.
    """
    if asked["gripper"] is not None:
        raise click.UsageError("the gripper is the argument: graspsense emulate NAME, without --gripper")
    emulator = installed().resource(EmulatorEntry, name)
    if wire and wire not in emulator.entry.wires:
        raise ConfigError(
            f"emulator {name} has no wire {wire!r}. Known: {', '.join(emulator.entry.wires)}."
            + suggestion(wire, emulator.entry.wires)
        )
    backend = f"{emulator.distribution}/{emulator.entry.backend or emulator.name}"
    options = (*GRIPPER_ALONE, *emulator.entry.options, *asked["options"])
    settings = settings_of(**{**asked, "gripper": backend, "options": options})
    device: EmulatedDevice = emulator.made(EmulatedDevice, settings.gripper.config, wire, settings.run.seed)
    try:
        with present_objects_kept():
            device.tell("plug")
            _tell_state(device, "plug")
            talk(f"emulated {name} over {device.wire} at {device.rate_hz:g} Hz: no gripper is touched")
            talk("Ctrl-C ends it; other words, each with Enter: help, state, " + ", ".join(device.words))
            _serve(device)
    except KeyboardInterrupt:
        pass
    finally:
        device.close()
    failed = str(device.state().get("failed", ""))
    if failed:
        talk(f"graspsense: the emulated {name} failed: {failed}")
        raise click.exceptions.Exit(ExitCode.NOT_FINISHED)


def _serve(device: EmulatedDevice) -> None:
    """Do what is asked on standard input, until a signal or `quit`; its end is none, as of a service without one."""
    for line in _lines():
        if device.state().get("failed") or line == "quit":
            return
        if line:
            _do(device, line)


def _lines() -> Iterator[str]:
    """Yield lines of standard input as they come, and every `LOOK_S` an empty one."""
    # Not through sys.stdin: of two lines that come at once it would keep the second where select sees none.
    source = None if sys.stdin is None else sys.stdin.fileno()
    text = b""
    while True:
        if source is None:
            time.sleep(LOOK_S)
        elif select.select([source], [], [], LOOK_S)[0]:
            more = os.read(source, 4096)
            text += more
            source = source if more else None
        *lines, text = text.split(b"\n")
        yield from (line.decode(errors="replace").strip() for line in lines)
        yield ""


def _do(device: EmulatedDevice, word: str) -> None:
    if word == "help":
        for command, what in device.words.items():
            talk(f"  {command:<10}{what}")
    elif word == "state" or word in device.words:
        if word != "state":
            device.tell(word)
        _tell_state(device, word)
    else:
        known = ("help", "quit", "state", *device.words)
        talk(f"no word {word!r}. Known: {', '.join(known)}.{suggestion(word, known)}")


def _tell_state(device: EmulatedDevice, word: str) -> None:
    state = {"did": word, **device.state()}
    if not echo_values(state, long=True):
        talk(", ".join(f"{key} {value}" for key, value in state.items() if value != ""))
