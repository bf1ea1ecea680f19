from __future__ import annotations

import os
import shutil
import signal
import subprocess
import sys
from pathlib import Path
from textwrap import dedent

import pytest
from attrs import field, frozen

from graspsense.core.components.registry import Plugins

# Whoever starts the tests in the background of a shell has them ignore Ctrl-C, and every process they start, too.
signal.signal(signal.SIGINT, signal.default_int_handler)
# The same for nohup and a hang-up: these tests go on ignoring it, what they start does not.
if signal.getsignal(signal.SIGHUP) is signal.SIG_IGN:
    signal.signal(signal.SIGHUP, lambda number, frame: None)


@frozen
class Site:
    """A folder of installed distributions, made of real metadata and real modules."""

    folder: Path
    patch: pytest.MonkeyPatch
    modules: list[str] = field(factory=list)

    def install(
        self, distribution: str, plugin: str, version: str = "0.2", entry: str = "main", **modules: str
    ) -> None:
        """Install a distribution whose entry point names a module with the source `plugin`."""
        name = distribution.replace("-", "_")
        self.write(**{f"{name}_plugin": plugin}, **modules)
        self.metadata(distribution, version, f"[graspsense.plugins]\n{entry} = {name}_plugin\n")

    def metadata(self, distribution: str, version: str, entry_points: str) -> None:
        info = self.folder / f"{distribution.replace('-', '_')}-{version}.dist-info"
        info.mkdir(parents=True)
        (info / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {distribution}\nVersion: {version}\n")
        (info / "entry_points.txt").write_text(entry_points)

    def write(self, **modules: str) -> None:
        for name, source in modules.items():
            (self.folder / f"{name}.py").write_text(dedent(source))
            self.modules.append(name)

    def discover(self, **environ: str) -> Plugins:
        """Discover plugins in this folder alone, whatever else is installed where the tests run."""
        with pytest.MonkeyPatch.context() as patch:
            for name in ("GRASPSENSE_PLUGINS", "GRASPSENSE_DISABLED_PLUGINS", "GRASPSENSE_STRICT_PLUGINS"):
                patch.delenv(name, raising=False)
            patch.setenv("XDG_CONFIG_HOME", str(self.folder / "no config"))
            for name, value in environ.items():
                patch.setenv(name, value)
            patch.setattr(sys, "path", [entry for entry in sys.path if "site-packages" not in entry])
            return Plugins.discover()


@pytest.fixture
def site(tmp_path, monkeypatch):
    folder = tmp_path / "installed"
    folder.mkdir()
    monkeypatch.syspath_prepend(folder)
    site = Site(folder, monkeypatch)
    yield site
    for name in site.modules:
        sys.modules.pop(name, None)


@pytest.fixture
def mounted(tmp_path):
    """Return a function that mounts a small disk and remounts it; skips where this machine does not allow it."""
    if os.geteuid() != 0 or not sys.platform.startswith("linux") or shutil.which("mount") is None:
        pytest.skip("needs root on Linux, to mount a small or a read-only disk")
    places = []

    def mount(options, remount=False):
        place = tmp_path / "disk"
        place.mkdir(exist_ok=True)
        command = [
            "mount",
            *(["-o", f"remount,{options}"] if remount else ["-t", "tmpfs", "-o", options, "none"]),
        ]
        done = subprocess.run([*command, str(place)], capture_output=True, text=True, check=False)
        if done.returncode:
            pytest.skip(f"mounting is not allowed here: {done.stderr.strip()}")
        if not remount:
            places.append(place)
        return place

    yield mount
    for place in places:
        subprocess.run(["umount", "-l", str(place)], check=True)
