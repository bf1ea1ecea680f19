"""Diagnosis of a gripper: connected devices, permissions, and the measurements of each transport."""

from __future__ import annotations

import sys
from collections.abc import Generator, Iterator, Sequence
from datetime import UTC, datetime
from importlib.metadata import PackageNotFoundError, version
from typing import Final, Literal, NamedTuple

from attrs import evolve

from graspsense.gripper_api import Finding, FoundDevice, GraspsenseError, calibrations_of
from graspsense.plugin_api import DeviceLost
from graspsense_pr2_gripper.backend import TEST_NUMBER, UNCALIBRATED, device_numbers
from graspsense_pr2_gripper.config import Pr2Config
from graspsense_pr2_gripper.discovery import (
    BACKEND,
    RELOAD,
    RULES_FILE,
    Search,
    hidraw_rule,
    on_the_bus,
    search,
    usb_rule,
)
from graspsense_pr2_gripper.emulator.reasons import why_no_uhid, why_no_vhci
from graspsense_pr2_gripper.opening import open_board
from graspsense_pr2_gripper.protocol import Identity
from graspsense_pr2_gripper.watching import Watched, share_of, watch_link

TRANSPORTS: Final[tuple[Literal["hidraw", "pyusb"], ...]] = ("hidraw", "pyusb")
LOST_SHARE: Final = 0.001
"""Largest number of lost reports; a working cable and hub lose none."""
SLOW_SHARE: Final = 0.95


class _Tried(NamedTuple):
    """A transport that works: the identity of the device and the measurements."""

    identity: Identity
    watched: Watched


def found_devices(timeout_s: float) -> Sequence[FoundDevice]:
    """Return the devices with the default USB ids; a list of HID devices needs no time limit."""
    return [
        FoundDevice(
            backend=BACKEND,
            serial=device.serial,
            where=device.path,
            ready=device.readable,
            advice=""
            if device.readable
            else f"no permission on {device.path}: `graspsense doctor` gives the udev rule",
        )
        for device in search(Pr2Config()).matching
    ]


def diagnose(config: object, timeout_s: float) -> Iterator[Finding]:
    """Return the findings about the gripper of these settings, by default about that with the default USB ids."""
    named = isinstance(config, Pr2Config)
    if config is not None and not named:
        return
    wanted = config if isinstance(config, Pr2Config) else Pr2Config()
    yield from _libraries()
    if wanted.emulated:
        yield Finding("device", "note", "gripper.transport is emulated, so no device is searched")
        return
    listing = search(wanted)
    yield from _plugged(listing, named)
    serials: dict[str, Identity] = {}
    in_use = False
    for transport in TRANSPORTS:
        if in_use:
            yield Finding(f"transport {transport}", "note", "not tried: another program commands the gripper")
        elif not listing.matching and not on_the_bus(wanted):
            continue
        else:
            tried = yield from _transport(evolve(wanted, transport=transport), timeout_s / len(TRANSPORTS))
            if tried is not None:
                serials[tried.identity.serial] = tried.identity
                in_use = tried.watched.in_use
    for identity in serials.values():
        yield from _calibrations(wanted, identity)
    if sys.platform == "linux":
        for wire, reason in (("uhid", why_no_uhid()), ("usb", why_no_vhci())):
            lines = reason.split("\n", 1)
            yield Finding(
                f"emulate pr2 --wire {wire}",
                "note" if reason else "ok",
                lines[0] or "can be had",
                _rest(lines),
            )


def _libraries() -> Iterator[Finding]:
    for name in ("hidapi", "pyusb"):
        try:
            yield Finding(f"library {name}", "ok", version(name), numbers={"version": version(name)})
        except PackageNotFoundError:
            yield Finding(f"library {name}", "problem", "not installed", f"pip install {name}")


def _plugged(listing: Search, named: bool) -> Iterator[Finding]:
    config = listing.config
    on_bus = on_the_bus(config)
    if not listing.matching:
        if on_bus:
            yield Finding(
                "device",
                "problem",
                f"{listing.wanted} is on the bus ({', '.join(on_bus)}), but has no HID node",
                "another program may use it through libusb, or the module usbhid is missing: `sudo modprobe usbhid`",
            )
        else:
            yield Finding(
                "device",
                "problem" if named else "note",
                f"no {listing.wanted}",
                f"plug it in and switch it on; {listing.looked}. Other USB ids: -o gripper.vendor_id=0x1209 "
                "-o gripper.product_id=0x0001",
            )
        return
    for device in listing.matching:
        where = f"serial {device.serial or 'none'} at {device.path}, " + (
            f"USB {', '.join(on_bus)}" if on_bus else "not on USB (through uhid?)"
        )
        yield Finding("device", "ok", where, numbers={"serial": device.serial, "path": device.path})
        if not device.readable:
            yield Finding(
                "permission",
                "problem",
                f"no permission to open {device.path}",
                f"put this line in {RULES_FILE}:\n  {hidraw_rule(config)}\nthen `{RELOAD}`, and plug it in again",
            )
        else:
            yield Finding(
                "permission",
                "ok",
                f"permission to open {device.path}",
                f"the udev rule, for users without permission:\n  {hidraw_rule(config)}",
            )
    if (config.vendor_id, config.product_id) == TEST_NUMBER:
        yield Finding(
            "number",
            "note",
            "the USB ids 1209:0001 are for private tests: do not distribute a device with them",
        )


def _transport(config: Pr2Config, seconds: float) -> Generator[Finding, None, _Tried | None]:
    """Yield the findings about this transport; return its measurements, None if it does not work."""
    subject = f"transport {config.transport}"
    # A transport that the user has not selected may be missing.
    bad: Literal["note", "problem"] = "problem" if config.transport == "hidraw" else "note"
    try:
        opened = open_board(config, 0, 0.0)
    except GraspsenseError as error:
        lines = str(error).split("\n", 1)
        rule = (
            f"\nthe rule for it, in {RULES_FILE}:\n  {usb_rule(config)}"
            if config.transport == "pyusb"
            else ""
        )
        yield Finding(subject, bad, lines[0], _rest(lines) + rule)
        return None
    identity, link = opened.identity, opened.link
    try:
        watched = watch_link(link, seconds)
    except DeviceLost as error:
        yield Finding(subject, "problem", str(error), "check its cable, the hub and its power")
        return None
    finally:
        clean = link.close()
    yield _measured(subject, identity, watched, clean)
    return _Tried(identity, watched)


def _measured(subject: str, identity: Identity, watched: Watched, clean: bool) -> Finding:
    wanted_hz = float(identity.report_rate_hz)
    numbers: dict[str, float | int | str | bool] = {
        "serial": identity.serial,
        "firmware": ".".join(map(str, identity.firmware)),
        "rate_hz": round(watched.rate_hz, 2),
        "rate_wanted_hz": wanted_hz,
        **watched.counts,
        "jitter_median_ms": round(share_of(watched.delays_s, 0.5) * 1e3, 3),
        "jitter_99_ms": round(share_of(watched.delays_s, 0.99) * 1e3, 3),
        "jitter_most_ms": round(share_of(watched.delays_s, 1.0) * 1e3, 3),
        "latency_median_ms": round(share_of(watched.trips_s, 0.5) * 1e3, 3),
        "latency_99_ms": round(share_of(watched.trips_s, 0.99) * 1e3, 3),
        "echoes": len(watched.trips_s),
        "in_use": watched.in_use,
        "closed_cleanly": clean,
    }
    sentence = (
        f"{watched.rate_hz:.1f} of {wanted_hz:g} Hz, {watched.lost} lost, {watched.corrupt} damaged, jitter "
        f"{numbers['jitter_median_ms']} ms ({numbers['jitter_99_ms']} ms at 99 %)"
    )
    if watched.in_use:
        sentence += ", another program commands it: nothing was sent"
    elif watched.trips_s:
        sentence += (
            f", command to echo {numbers['latency_median_ms']} ms ({numbers['latency_99_ms']} ms at 99 %)"
        )
    wrong = []
    if not watched.reports:
        wrong.append("it sends no reports, although it should from power-on: check its power and firmware")
    elif watched.rate_hz < SLOW_SHARE * wanted_hz:
        wrong.append("reports are missing or late: try another port, no hub, or less load on this computer")
    if watched.lost > LOST_SHARE * max(watched.reports, 1):
        wrong.append(
            "reports are lost: try another cable or port; the scheduler may also have delayed the reader"
        )
    if watched.corrupt:
        wrong.append("reports are damaged although USB checks them: the firmware is faulty")
    if watched.reports and not watched.in_use and not watched.trips_s:
        wrong.append("no command was echoed: it sends reports but does not receive commands")
    return Finding(subject, "problem" if wrong else "ok", sentence, "\n".join(wrong), numbers)


def _calibrations(config: Pr2Config, identity: Identity) -> Iterator[Finding]:
    if config.calibration == UNCALIBRATED:
        yield Finding("calibration", "note", "gripper.calibration is none")
        return
    try:
        stored = calibrations_of(config.calibration, identity.serial, device_numbers(identity))
    except GraspsenseError as error:
        lines = str(error).split("\n", 1)
        yield Finding("calibration", "problem", lines[0], _rest(lines))
        return
    for kind in ("tare", "load-cell", "friction"):
        subject = f"calibration {kind}"
        if kind not in stored:
            yield Finding(
                subject, "note", f"none of {identity.serial}", f"graspsense calibrate {kind} --gripper pr2"
            )
            continue
        made = datetime.fromisoformat(stored[kind].made)
        # A file that was not written by graspsense may have no time zone.
        made = made if made.tzinfo is not None else made.replace(tzinfo=UTC)
        days = (datetime.now(UTC) - made).total_seconds() / 86400.0
        yield Finding(
            subject, "ok", f"of {identity.serial}, {days:.1f} days old ({stored[kind].made})",
            numbers={"age_days": round(days, 3), "made": stored[kind].made, "sha256": stored[kind].sha256},
        )  # fmt: skip


def _rest(lines: list[str]) -> str:
    return "\n".join(line.strip().removeprefix("try: ") for line in lines[1].split("\n")) if lines[1:] else ""
