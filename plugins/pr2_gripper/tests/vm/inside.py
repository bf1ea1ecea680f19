"""What is tried in the machine of `guest.py`, as root: the driver on the kernel's own HID and USB stack.

    inside.py     a line for each try; exit code 1 where one failed

Devices are `graspsense emulate pr2` in processes of their own, forked from this one: importing takes seconds here.
"""

from __future__ import annotations

import io
import json
import os
import random
import select
import signal
import struct
import subprocess
import sys
import time
import zlib
from collections.abc import Callable, Iterator
from contextlib import contextmanager, redirect_stdout, suppress
from itertools import pairwise
from pathlib import Path
from typing import Any, NamedTuple

from graspsense.cli.main import main as graspsense
from graspsense.cli.options import settings_of
from graspsense.core.components.registry import installed
from graspsense.core.pipeline.pipeline import grasp_with
from graspsense.core.values.signals import Command, GraspEvent, Outcome, Phase, Reading
from graspsense.core.values.trial import Trial
from graspsense.plugin_api import DeviceLost, NoDevice, create
from graspsense.store.record_grasp import record_grasp
from graspsense.store.store import Store
from graspsense_pr2_gripper.config import Pr2Config
from graspsense_pr2_gripper.discovery import UHID_RULE, hidraw_rule, on_the_bus, usb_rule
from graspsense_pr2_gripper.emulator import board, uhid, vhci  # noqa: F401 (for those that are forked)
from graspsense_pr2_gripper.opening import open_board
from graspsense_pr2_gripper.protocol import RELEASE_KIND, OutputReport, encode_output
from graspsense_pr2_gripper.transports.hidraw import HidrawTransport
from graspsense_pr2_gripper.transports.pyusb import PyusbTransport

# How long a program may take to start or answer: only one that hangs takes as long as this.
ANSWER_S = 300.0
APPEARS_S = 10.0
# Latency is not judged here: what a device does late is not what a device does not do.
PATIENT = ("run.frame_timeout_s=0.5",)
# That the steps of the emulated fingers are exact is a matter of the simulator, and takes half a minute to verify here.
FIXED = "gripper.body_config.fidelity=fixed"


class Way(NamedTuple):
    """A wire into the kernel, a library out of it, and the rates at which they are tried."""

    wire: str
    transport: str
    stream_hz: int
    reports: int
    grasp_hz: int
    may_lose: float

    @property
    def name(self) -> str:
        return f"{self.wire} with {self.transport}"


WAYS = (
    Way("uhid", "hidraw", 500, 1500, 200, 0.0),
    Way("usb", "hidraw", 100, 500, 100, 0.0),
    Way("usb", "pyusb", 100, 500, 100, 0.03),
)

failed: list[str] = []


def check(holds: bool, what: str) -> None:
    print(f"{'ok     ' if holds else 'FAILED '}[{time.monotonic():6.1f}] {what}", flush=True)
    if not holds:
        failed.append(what)


class Emulator:
    """A `graspsense emulate pr2` in a process of its own, plugged in."""

    def __init__(self, way: Way, rate_hz: int) -> None:
        inner, self._in = os.pipe()
        self._out, outer = os.pipe()
        self.pid = os.fork()
        if self.pid == 0:
            for mine, standard in ((inner, 0), (outer, 1)):
                os.dup2(mine, standard)
            os.closerange(3, 64)
            sys.stdin, sys.stdout = os.fdopen(0), os.fdopen(1, "w")
            rate = f"gripper.body_config.rate_hz={rate_hz}"
            try:
                graspsense(["emulate", "pr2", "--json", "--wire", way.wire, "-o", rate, "-o", FIXED])
            except SystemExit as ended:
                os._exit(int(ended.code or 0))
        os.close(inner)
        os.close(outer)
        self._text = b""
        self._answer()

    def say(self, word: str) -> None:
        """Say a word without waiting for what it does."""
        os.write(self._in, f"{word}\n".encode())

    def tell(self, word: str) -> dict[str, Any]:
        """Say a word and return the state after it."""
        self.say(word)
        while (state := self._answer())["did"] != word:
            pass
        return state

    def let_go(self) -> tuple[bool, float]:
        """Return whether the board lets go within a second, and after how long."""
        began = time.monotonic()
        while (took_s := time.monotonic() - began) < 1.0:
            if self.tell("state")["effort_n"] == 0.0:
                return True, took_s
            time.sleep(0.005)
        return False, took_s

    def kill(self) -> None:
        os.kill(self.pid, signal.SIGKILL)

    def gone(self) -> None:
        with suppress(OSError):
            self.say("quit")
        os.waitpid(self.pid, 0)
        os.close(self._in)
        os.close(self._out)

    def _answer(self) -> dict[str, Any]:
        while b"\n" not in self._text:
            if not select.select([self._out], [], [], ANSWER_S)[0]:
                raise TimeoutError("the emulator does not answer")
            more = os.read(self._out, 65536)
            if not more:
                raise EOFError("the emulator has ended")
            self._text += more
        line, self._text = self._text.split(b"\n", 1)
        state: dict[str, Any] = json.loads(line)
        return state


@contextmanager
def emulator(way: Way, rate_hz: int) -> Iterator[Emulator]:
    started = Emulator(way, rate_hz)
    try:
        appeared(way)
        yield started
    finally:
        started.gone()
        vanished()


def appeared(way: Way) -> None:
    """Wait until the library sees the device: libusb is told by udev, some time after the kernel knows."""
    give_up = time.monotonic() + APPEARS_S
    while time.monotonic() < give_up:
        settled()
        with suppress(NoDevice):
            open_board(Pr2Config(transport=way.transport), 0, 0.0).link.close()
            return
        time.sleep(0.05)
    raise TimeoutError(f"{way.name}: no device")


def settled() -> None:
    """Wait until udev has done its work: on the one processor it would take turns with a grasp."""
    subprocess.run(["udevadm", "settle"], check=True)


def vanished() -> bool:
    give_up = time.monotonic() + APPEARS_S
    while any(Path("/sys/class/hidraw").iterdir()):
        if time.monotonic() > give_up:
            return False
        time.sleep(0.02)
    return True


@contextmanager
def tapped(pause_s: float) -> Iterator[list[bytes]]:
    """Keep every report as the library gave it, for a count that does not rest on the driver's.

    After each fifty the reader sleeps for `pause_s`.
    """
    taken: list[bytes] = []
    reads = {}
    for kind in (HidrawTransport, PyusbTransport):
        reads[kind] = plain = kind.read

        def read(self: Any, timeout_s: float, plain: Callable[..., bytes] = plain) -> bytes:
            if data := plain(self, timeout_s):
                taken.append(data)
                if pause_s and len(taken) % 50 == 0:
                    time.sleep(pause_s)
            return data

        kind.read = read  # type: ignore[method-assign]
    try:
        yield taken
    finally:
        for kind, plain in reads.items():
            kind.read = plain  # type: ignore[method-assign]


def stream(way: Way, device: Emulator, reports: int, pause_s: float = 0.0) -> None:
    """Read and command for a while: what was lost, by our own count, and does the driver's agree?"""
    with tapped(pause_s) as taken:
        opened = open_board(Pr2Config(transport=way.transport), 0, 0.0)
        link, sent_earlier = opened.link, device.tell("state")["commands"]
        began = time.monotonic()
        sent = 0
        while link.stream.counts.reports < reports:
            if link.next(1.0) is not None:
                sent += 1
                link.send(encode_output(OutputReport(sent & 0xFFFF, RELEASE_KIND, 0, 0, 0)))
        took_s = time.monotonic() - began
        link.close()
    counts = link.stream.counts
    arrived = device.tell("state")["commands"] - sent_earlier
    taken = taken[1:]  # the first one is read to be forgotten
    right = [zlib.crc32(report[:60]) == struct.unpack_from("<I", report, 60)[0] for report in taken]
    numbers = [struct.unpack_from("<I", report, 1)[0] for report in taken]
    lost = numbers[-1] - numbers[0] + 1 - len(numbers)
    name = f"{way.name}, a reader that lags" if pause_s else way.name
    words = (
        f"{name}: {len(numbers)} reports at {len(numbers) / took_s:.1f} of {way.stream_hz} Hz, {lost} lost"
    )
    check(all(right), f"{words}; every CRC right")
    check(all(a < b for a, b in pairwise(numbers)), f"{name}: in order, none twice")
    check(
        (counts.lost, counts.reports) == (lost, len(numbers)), f"{name}: the driver counts {counts.lost} lost"
    )
    check(arrived >= sent - 1, f"{name}: {arrived} of {sent} commands arrived")
    if pause_s:
        check((lost > 0) is (way.transport == "pyusb"), f"{words}; libusb keeps none for it, hidraw does")
    else:
        check(lost <= way.may_lose * (len(numbers) + lost), f"{words}; at most {way.may_lose:.0%} may be")
        check(len(numbers) / took_s > 0.5 * way.stream_hz, f"{name}: kept up")


ATTEMPTS = 3
"""Grasps that may end before the moment at which the device is to be unplugged."""


class At:
    """Does something at the n-th tick of a phase."""

    def __init__(self, phase: Phase, tick: int, act: Callable[[], None]) -> None:
        self.phase, self.tick, self.act = phase, tick, act
        self.when_s = 0.0
        self.force_n = 0.0

    def take(self, reading: Reading, phase: int, command: Command) -> None:
        if phase != self.phase or self.when_s:
            return
        self.tick -= 1
        if self.tick <= 0:
            self.when_s = time.monotonic()
            self.force_n = reading.frame.force_left_n
            self.act()

    def event(self, event: GraspEvent) -> None:
        if event.what == self.phase.name.lower() and self.phase < Phase.APPROACH and not self.when_s:
            self.when_s = time.monotonic()
            self.act()


def options_of(way: Way) -> tuple[str, ...]:
    return (
        f"gripper.transport={way.transport}",
        "controller.closing_speed_m_s=0.03",
        "run.hold_s=0.2",
        "run.first_speed_m_s=0.03",
        "classifier.type=none",
        *PATIENT,
    )


def grasp(way: Way, phase: Phase, tick: int, act: Callable[[], None]) -> tuple[At, Trial]:
    """Grasp, and act at the n-th tick of a phase; again where the grasp was lost before that moment."""
    settings = settings_of(None, "pr2", None, options_of(way), 0)
    for _ in range(ATTEMPTS):
        moment = At(phase, tick, act)
        trial = grasp_with(settings, installed(), sinks=[moment], on_event=moment.event)
        if moment.when_s or trial.outcome is Outcome.STEADY:
            break
        # The emulated processor was held up.
        print(f"note   {way.name}: {trial.outcome.words} before {phase.name.lower()}: {trial.reason}")
        appeared(way)
    return moment, trial


def lost_in_a_grasp(way: Way, device: Emulator, what: str, trial: Trial, moment: At) -> None:
    """What must hold after a loss: it is told, nothing squeezes, and what was felt is kept."""
    told_s = time.monotonic() - moment.when_s
    released, took_s = device.let_go()
    words = f"{way.name}: {what} in {moment.phase.name.lower()}, at {moment.force_n:.1f} N on a pad"
    # Where the emulated processor was held up at that moment, the watchdog of the board was faster.
    let_go = trial.outcome is Outcome.ABORTED and "watchdog" in trial.reason
    check(
        trial.outcome is Outcome.DEVICE_LOST or let_go,
        f"{words}: {trial.outcome.words} after {told_s:.2f} s: {trial.reason}",
    )
    check(released, f"{words}: let go {took_s:.2f} s later")
    if moment.phase >= Phase.APPROACH:
        check(len(trial.trace) > 0, f"{words}: {len(trial.trace)} ticks are kept")


def unplugged(way: Way, device: Emulator) -> None:
    """At the worst moments that we know, then at a random one."""
    chance = random.Random(way.name)
    phases = (Phase.APPROACH, Phase.SQUEEZE, Phase.HOLD)
    moments = [(Phase.TARING, 0), (Phase.APPROACH, 2), (Phase.SQUEEZE, 1), (Phase.HOLD, 2)]
    moments.append((chance.choice(phases), chance.randrange(1, way.grasp_hz // 5)))
    for phase, tick in moments:
        moment, trial = grasp(way, phase, tick, lambda: device.say("unplug"))
        if moment.when_s:
            lost_in_a_grasp(way, device, "unplugged", trial, moment)
        else:
            # The phase was over before its n-th tick.
            words = f"{trial.outcome.words} {trial.reason}"
            check(trial.outcome is Outcome.STEADY, f"{way.name}: not unplugged: {words}")
        device.tell("plug")
        appeared(way)


def unplugged_and_kept(way: Way, device: Emulator, store: Path) -> None:
    """The trial of a lost device is in the store, and the next one too."""
    moment = At(Phase.SQUEEZE, 3, lambda: device.say("unplug"))
    settings = settings_of(None, "pr2", None, options_of(way), 0)
    with Store.open(store) as opened:
        kept = record_grasp(opened, settings, installed(), labels={}, origin="run", sinks=[moment])
    lost_in_a_grasp(way, device, "unplugged", kept.trial, moment)
    check(kept.number is not None and not kept.problem, f"{way.name}: kept as trial {kept.number}")
    device.tell("plug")
    appeared(way)


def silent(way: Way, device: Emulator) -> None:
    for word in ("silent", "stalled"):
        moment, trial = grasp(way, Phase.SQUEEZE, 3, lambda word=word: device.say(word))  # type: ignore[misc]
        lost_in_a_grasp(way, device, word, trial, moment)
        device.tell("well")
        if way.wire == "usb":
            # A real one that hung is pulled out, too.
            device.tell("unplug")
            device.tell("plug")
        appeared(way)


def halted(way: Way, device: Emulator) -> None:
    """A stalled endpoint is cleared, by the kernel or by the driver, and the grasp goes on."""
    _, trial = grasp(way, Phase.SQUEEZE, 3, lambda: device.say("halt"))
    check(
        trial.outcome is Outcome.STEADY,
        f"{way.name}: endpoint halted in squeeze: {trial.outcome.words} {trial.reason}",
    )


def replugged(way: Way, device: Emulator) -> None:
    """The same program opens the same gripper again when it comes back."""
    backend = create("sensor-backend", "pr2", transport=way.transport)
    backend.open(0)
    device.tell("unplug")
    try:
        for _ in range(way.grasp_hz):
            backend.read(1.0)
        check(False, f"{way.name}: no loss was told")
    except DeviceLost:
        pass
    pid = os.fork()
    if pid == 0:
        time.sleep(0.3)
        device.say("plug")
        os._exit(0)
    began = time.monotonic()
    try:
        backend.open(0)
        reads = backend.read(1.0) is not None
    except NoDevice as error:
        reads = False
        print(error)
    check(
        reads, f"{way.name}: plugged in again after 0.3 s, reads again after {time.monotonic() - began:.2f} s"
    )
    backend.close()
    os.waitpid(pid, 0)
    device._answer()
    settled()


def killed(way: Way) -> None:
    device = Emulator(way, way.grasp_hz)
    appeared(way)
    moment, trial = grasp(way, Phase.SQUEEZE, 3, device.kill)
    told_s = time.monotonic() - moment.when_s
    check(
        trial.outcome is Outcome.DEVICE_LOST,
        f"{way.name}: emulator killed in squeeze: {trial.outcome.words} after {told_s:.2f} s: {trial.reason}",
    )
    check(vanished(), f"{way.name}: the device vanished with its process")
    device.gone()


def ran(*arguments: str) -> tuple[int, Any]:
    """Run the command line in this process; return its exit code and what it printed."""
    printed = io.StringIO()
    code = 0
    with redirect_stdout(printed):
        try:
            graspsense(list(arguments))
        except SystemExit as ended:
            code = int(ended.code or 0)
    text = printed.getvalue()
    return code, json.loads(text) if text else None


def whole_grasp(way: Way) -> None:
    options = (f"gripper.transport={way.transport}", *PATIENT)
    code, trial = ran(
        "run", "--json", "--gripper", "pr2", *(word for option in options for word in ("-o", option))
    )
    features = trial.get("features", {})
    missing = {name for name, value in features.items() if value is None}
    # A cell image takes 11 reports: at 100 Hz the fingers may stand when the contact is seen. Then no rate is known.
    unknown = {"dp_dt", "df_dt"} if way.grasp_hz == 100 and features.get("delta_t") == 0.0 else set()
    check(
        code == 0
        and trial["outcome"] == "steady"
        and features.get("f_steady", 0.0) > 2.0
        and missing == unknown,
        f"{way.name}: a hybrid grasp: {trial.get('outcome')} {trial.get('reason', '')}, "
        + ", ".join(f"{key} {value:.4g}" for key, value in features.items() if value is not None),
    )


def examined(way: Way) -> None:
    """The doctor finds it well, and measures it."""
    code, said = ran("doctor", "--json", "--timeout", "1", "--gripper", "pr2")
    findings = {finding["subject"]: finding for part in said["diagnoses"] for finding in part["findings"]}
    finding = findings.get(f"transport {way.transport}", {})
    check(
        finding.get("state") == "ok",
        f"{way.name}: doctor, exit code {code}: {finding.get('found')} {finding.get('advice')}",
    )


def ruled(way: Way, device: Emulator) -> None:
    """The rules that the doctor gives to copy are udev's own: the device is tagged for whoever sits here."""
    settled()
    asked = [device.tell("state")["node"]]
    if way.wire == "usb":
        (place,) = on_the_bus(Pr2Config())
        asked.append(f"/sys/bus/usb/devices/{place}")
    for device_path in asked:
        told = subprocess.run(
            ["udevadm", "info", device_path], capture_output=True, text=True, check=True
        ).stdout
        check(":uaccess:" in told, f"{way.name}: {device_path} is tagged uaccess by the rule to copy")


def without_permission() -> None:
    """Who may not open /dev/uhid is given the rule."""
    read, write = os.pipe()
    pid = os.fork()
    if pid == 0:
        os.setuid(65534)
        try:
            board._way_in("")
        except NoDevice as error:
            os.write(write, str(error).encode())
        os._exit(0)
    os.close(write)
    text = os.read(read, 65536).decode()
    os.waitpid(pid, 0)
    os.close(read)
    check(
        all(word in text for word in ("uaccess", "only root", "transport=emulated")),
        f"no permission:\n{text}",
    )


def main() -> int:
    store = Path("/tmp/store")  # not on the share: SQLite maps memory that 9p has none of
    os.environ["XDG_DATA_HOME"] = "/tmp/data"
    # The root is changed to, and udevadm does not wait in what looks like somebody's chroot.
    os.environ["SYSTEMD_IGNORE_CHROOT"] = "1"
    rules = Path("/run/udev/rules.d")
    rules.mkdir(parents=True)
    lines = (hidraw_rule(Pr2Config()), usb_rule(Pr2Config()), UHID_RULE)
    (rules / "70-graspsense.rules").write_text("".join(f"{line}\n" for line in lines))
    subprocess.run(["/lib/systemd/systemd-udevd", "--daemon"], check=True)
    installed()
    # Everything is imported once before anything is timed: reading files takes its time here.
    ran("doctor", "--json", "--timeout", "0.1")
    emulated = f"-o gripper.transport=emulated -o gripper.body_config.rate_hz=100 -o {FIXED}"
    ran(*f"run --json --gripper pr2 {emulated} --save /tmp/warm".split())
    print(f"ready after {time.monotonic():.1f} s", flush=True)
    without_permission()
    for way in WAYS:
        with emulator(way, way.stream_hz) as device:
            stream(way, device, way.reports)
            stream(way, device, 150, pause_s=0.04)
        with emulator(way, way.grasp_hz) as device:
            ruled(way, device)
            unplugged(way, device)
            unplugged_and_kept(way, device, store)
            silent(way, device)
            if way.wire == "usb":
                halted(way, device)
            replugged(way, device)
            whole_grasp(way)
            examined(way)
        killed(way)
    code, verified = ran("verify", "--json", str(store))
    check(code == 0, f"the store is whole: {verified}")
    free = Path("/proc/meminfo").read_text().split("MemAvailable:")[1].split()[0]
    print(f"{free} kB of memory were free at the end", flush=True)
    print(f"{len(failed)} failed", flush=True)
    for failure in failed:
        print(f"FAILED {failure}")
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
