"""A device at the outermost edge: hidapi's module and libusb's functions, in front of the emulated firmware."""

from __future__ import annotations

import threading
from collections.abc import Iterator
from typing import Any

import pytest

from graspsense.plugin_api import create
from graspsense_pr2_gripper.config import FaultConfig
from graspsense_pr2_gripper.faults import Wire
from graspsense_pr2_gripper.firmware import Firmware
from graspsense_pr2_gripper.protocol import Identity


def identity(**changes: Any) -> Identity:
    """The PR2 as published: 1600/400/600 counts/N, 100 N, 0.2 m/s, 1 kHz, 41 ms, 1200 ticks a revolution."""
    numbers: dict[str, Any] = {
        "firmware": (1, 2, 3), "serial": "L7", "transmission": "pr2", "pad_counts_per_n": 1600,
        "side_counts_per_n": 400, "edge_counts_per_n": 600, "effort_limit_un": 100_000_000,
        "speed_limit_um_s": 200_000, "report_rate_hz": 1000, "image_period_us": 41_000, "watchdog_ms": 100,
        "encoder_ticks_rev": 1200, "accelerometer_g": 8,
    }  # fmt: skip
    return Identity(**{**numbers, **changes})


@pytest.fixture
def device_identity() -> Any:
    return identity


@pytest.fixture
def board() -> Any:
    """Makes a board over a simulated gripper: `board(object="block", faults=..., serial=...)`."""

    def make(
        *, object: str = "block", seed: int = 0, faults: FaultConfig | None = None, **changes: Any
    ) -> Wire:
        body = create("sensor-backend", "sim", object=object)
        body.open(seed)
        return Wire(Firmware(body, identity(**changes)), faults or FaultConfig(), seed)

    return make


@pytest.fixture(autouse=True)
def no_thread_is_left() -> Iterator[None]:
    before = set(threading.enumerate())
    yield
    assert set(threading.enumerate()) - before == set()


@pytest.fixture(autouse=True)
def calibrations_apart(monkeypatch: pytest.MonkeyPatch, tmp_path: Any) -> None:
    """No test reads or writes the calibrations of whoever runs it."""
    monkeypatch.setenv("XDG_DATA_HOME", str(tmp_path / "data"))
