"""Run one command in a throw-away QEMU machine with a kernel of its own; the root file system is this machine's.

    python3 guest.py --kernel DIR --share DIR [--timeout S] -- COMMAND...

DIR holds an unpacked kernel package (boot/vmlinuz-*, lib/modules/*). No image is built: `/` is shared read-only over
9p with a file system in memory on top, so that every path of here works there and every write is lost, but for those
to /run/share. The exit code is the command's; 125 where the machine did not boot or did not finish. Software emulation
is used also where KVM works: while a program computes, time then goes by instructions, and what is found hardly depends
on what else runs here. Needs qemu-system-x86_64 and a static busybox, and no root.
"""

from __future__ import annotations

import argparse
import gzip
import lzma
import os
import re
import resource
import shlex
import shutil
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Iterable
from pathlib import Path

NOT_RUN = 125
BOOTED = "guest: booted"

FOR_BOOT = ("virtio_pci", "9pnet_virtio", "9p", "overlay")
FOR_TESTS = ("usbhid", "hid-generic", "uhid", "vhci-hcd")

INIT = r"""#!/bin/busybox sh
B=/bin/busybox
$B mount -t proc proc /proc; $B mount -t sysfs sys /sys; $B mount -t devtmpfs dev /dev
$B echo 3 >/proc/sys/kernel/printk
while read -r module; do $B insmod /modules/$module.ko || $B echo "guest: no module $module"; done </modules/order
O=trans=virtio,version=9p2000.L,msize=512000
$B mount -t 9p -o $O,ro,cache=loose root /lower || $B echo "guest: no root over 9p"
$B mount -t tmpfs upper /rw; $B mkdir /rw/upper /rw/work
$B mount -t overlay -o lowerdir=/lower,upperdir=/rw/upper,workdir=/rw/work all /new || $B echo "guest: no overlay"
for d in proc sys dev; do $B mount -o move /$d /new/$d; done
$B mkdir -p /new/dev/pts /new/dev/shm
$B mount -t devpts pts /new/dev/pts; $B mount -t tmpfs shm /new/dev/shm
$B mount -t tmpfs run /new/run; $B mkdir -p /new/run/share
$B mount -t 9p -o $O,cache=none share /new/run/share || $B echo "guest: no share"
$B ifconfig lo 127.0.0.1 up
$B echo "guest: booted"
$B chroot /new /bin/sh /run/share/.command
$B echo $? >/new/run/share/.status
$B sync
$B poweroff -f
"""


def main() -> int:
    parser = argparse.ArgumentParser()
    parser.add_argument("--kernel", type=Path, required=True)
    parser.add_argument("--share", type=Path, required=True)
    parser.add_argument("--timeout", type=float, default=240.0)
    parser.add_argument("command", nargs="+")
    asked = parser.parse_args()
    share = asked.share.resolve()
    share.mkdir(parents=True, exist_ok=True)
    (share / ".command").write_text(
        "export PATH=/usr/local/sbin:/usr/local/bin:/usr/sbin:/usr/bin:/sbin:/bin HOME=/root PYTHONUNBUFFERED=1 "
        f"PYTHONDONTWRITEBYTECODE=1 NO_COLOR=1\ncd {shlex.quote(os.getcwd())}\nexec {shlex.join(asked.command)}\n"
    )
    with tempfile.TemporaryDirectory(prefix="guest-") as folder:
        initrd = Path(folder) / "initrd"
        initrd.write_bytes(cpio(boot_files(asked.kernel)))
        (kernel,) = (asked.kernel / "boot").glob("vmlinuz-*")
        return run(kernel, initrd, share, asked.timeout)


def run(kernel: Path, initrd: Path, share: Path, timeout_s: float) -> int:
    """Return the command's exit code, or NOT_RUN where it did not end or the machine did not boot."""
    status = share / ".status"
    status.unlink(missing_ok=True)
    command = [
        # Time there goes by instructions, 2 ns each, and by the clock of this machine while it waits. Without sleeping
        # it would go on to the next timer at once, and each file of the host come after seconds of it.
        "qemu-system-x86_64", "-M", "pc", "-accel", "tcg", "-icount", "shift=1,sleep=on", "-cpu", "max",
        "-smp", "1", "-m", "768", "-nodefaults", "-no-user-config", "-display", "none",
        "-serial", "stdio", "-no-reboot", "-kernel", str(kernel), "-initrd", str(initrd),
        "-append", "console=ttyS0 quiet panic=-1 random.trust_cpu=on mitigations=off tsc=reliable no_timer_check",
        "-fsdev", "local,id=root,path=/,security_model=none,readonly=on,multidevs=remap",
        "-device", "virtio-9p-pci,fsdev=root,mount_tag=root",
        "-fsdev", f"local,id=share,path={share},security_model=none,multidevs=remap",
        "-device", "virtio-9p-pci,fsdev=share,mount_tag=share",
    ]  # fmt: skip
    began = time.monotonic()
    booted = False
    machine = subprocess.Popen(
        command, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True,
        errors="replace",
    )  # fmt: skip
    assert machine.stdout is not None
    limit = threading.Timer(timeout_s, machine.kill)
    limit.start()
    try:
        for line in machine.stdout:
            if BOOTED in line:
                booted = True
                line = f"{BOOTED} after {time.monotonic() - began:.1f} s\n"
            sys.stdout.write(line)
            sys.stdout.flush()
        machine.wait()
    finally:
        limit.cancel()
        if machine.poll() is None:
            machine.kill()
    if not booted:
        print("guest: did not boot", flush=True)
    ended = int(status.read_text()) if status.exists() else NOT_RUN
    worked_s = sum(resource.getrusage(resource.RUSAGE_CHILDREN)[:2])
    took_s = time.monotonic() - began
    print(f"guest: ended with {ended} after {took_s:.1f} s, {worked_s:.1f} s of processor time", flush=True)
    return ended


def boot_files(kernel: Path) -> list[tuple[str, int, bytes]]:
    """Return what the machine starts from: busybox, the kernel's modules in the order of their needs, and init."""
    order = load_order(kernel, (*FOR_BOOT, *FOR_TESTS))
    busybox = shutil.which("busybox")
    assert busybox, "no busybox"
    names = "".join(f"{name}\n" for name in order)
    return [
        *((name, 0o040755, b"") for name in ["bin", "modules", "proc", "sys", "dev", "lower", "rw", "new"]),
        ("bin/busybox", 0o100755, Path(busybox).read_bytes()),
        ("init", 0o100755, INIT.encode()),
        ("modules/order", 0o100644, names.encode()),
        *((f"modules/{name}.ko", 0o100644, data) for name, data in order.items()),
    ]


def load_order(kernel: Path, wanted: Iterable[str]) -> dict[str, bytes]:
    """Return modules by name, each behind those it needs; what is no module is taken to be built in."""
    files = {path.name.split(".ko")[0].replace("-", "_"): path for path in kernel.glob("**/*.ko*")}
    order: dict[str, bytes] = {}

    def visit(name: str) -> None:
        name = name.replace("-", "_")
        if name in order or name not in files:
            return
        data = unpacked(files[name])
        needs = re.search(rb"\0depends=([^\0]*)\0", b"\0" + data)
        for module in needs.group(1).decode().split(",") if needs else ():
            visit(module)
        order[name] = data

    for name in wanted:
        visit(name)
    return order


def unpacked(path: Path) -> bytes:
    data = path.read_bytes()
    match path.suffix:
        case ".xz":
            return lzma.decompress(data)
        case ".gz":
            return gzip.decompress(data)
        case ".zst":
            return subprocess.run(["zstd", "-dc"], input=data, stdout=subprocess.PIPE, check=True).stdout
    return data


def cpio(files: Iterable[tuple[str, int, bytes]]) -> bytes:
    """Return a `newc` archive of (name, mode, content), as the kernel reads it."""
    archive = bytearray()
    for number, (name, mode, data) in enumerate((*files, ("TRAILER!!!", 0, b"")), 1):
        path = name.encode() + b"\0"
        numbers = (number, mode, 0, 0, 1, 0, len(data), 0, 0, 0, 0, len(path), 0)
        archive += b"070701" + b"".join(b"%08X" % number for number in numbers) + path
        archive += b"\0" * (-len(archive) % 4) + data
        archive += b"\0" * (-len(archive) % 4)
    return bytes(archive)


if __name__ == "__main__":
    sys.exit(main())
