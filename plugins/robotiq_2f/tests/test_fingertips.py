"""The protocol of the TSF-85 fingertips, and their emulator."""

from __future__ import annotations

import select
import threading
from itertools import pairwise
from types import SimpleNamespace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from graspsense import load_pipeline
from graspsense.gripper_api import EmulatedPort
from graspsense.plugin_api import POSITION, Command, create
from graspsense.testing_api import parametrize_checks
from graspsense_robotiq_2f.emulator import fingertips
from graspsense_robotiq_2f.emulator.fingertips import COUNTS_PER_N, NOISE_COUNTS, EmulatedFingertips, Felt
from graspsense_robotiq_2f.tactile import TactileFingertips, TactileStream, joined
from graspsense_robotiq_2f.tactile_protocol import (
    CELLS,
    DYNAMIC,
    PRESSURE,
    READ,
    TIMESTAMP,
    Field,
    Packets,
    decoded,
    encoded,
    packet,
)

PATIENT_S = 60.0
CELL = st.integers(0, 0xFFFF)
NOISE_OF_SUM = 6.0 * NOISE_COUNTS * CELLS**0.5
"""Six standard deviations."""
REST = EmulatedFingertips(lambda: Felt(0.0, 0.0)).rest


@given(
    st.lists(CELL, min_size=CELLS, max_size=CELLS),
    st.integers(-32768, 32767),
    st.integers(0, 2**64 - 1),
    st.integers(0, 1),
)
def test_what_is_encoded_is_decoded(cells, change, stamp, finger):
    fields = [
        Field(TIMESTAMP, finger, (stamp,)),
        Field(PRESSURE, finger, tuple(cells)),
        Field(DYNAMIC, finger, (change,)),
    ]
    [(command, data)] = Packets().fed(encoded(fields))
    assert command == READ
    assert decoded(data) == fields


@given(st.binary(max_size=300), st.integers(1, 40))
def test_any_bytes_in_any_pieces_are_taken(data, size):
    whole, pieces = Packets(), Packets()
    expected = whole.fed(data)
    assert [
        one for start in range(0, len(data), size) for one in pieces.fed(data[start : start + size])
    ] == expected
    for _, fields in expected:
        decoded(fields)


def test_a_field_that_is_cut_or_unknown_makes_a_packet_damaged():
    assert decoded(bytes((PRESSURE,)) + bytes(2 * CELLS - 1)) is None
    assert decoded(b"\x00\x00") is None


@pytest.fixture
def clock(monkeypatch):
    clock = SimpleNamespace(now_s=0.0)
    monkeypatch.setattr(fingertips, "time", SimpleNamespace(monotonic=lambda: clock.now_s))
    return clock


def test_every_period_has_one_packet_and_images_come_at_60_hz(clock):
    tips = EmulatedFingertips(lambda: Felt(2.0, 4.0))
    tips.heard(packet(0x58, bytes((1,))))
    packets = Packets()
    found = []
    for tick in range(1, 401):
        clock.now_s = tick * 0.0025
        found += [decoded(data) for _, data in packets.fed(tips.unasked())]
    stamps = [fields[0].values[0] for fields in found]
    assert {later - earlier for earlier, later in pairwise(stamps)} == {1000}
    assert 1000 <= len(stamps) <= 1001
    images = [field for fields in found for field in fields if field.kind == PRESSURE]
    # A packet each millisecond: the image of 16.7 ms is in that of 17 ms.
    assert 58 <= len(images) / 2 <= 61
    for image in images:
        force_n = (2.0, 4.0)[image.finger]
        assert sum(image.values) - sum(tips.rest[image.finger]) == pytest.approx(
            force_n * COUNTS_PER_N, abs=NOISE_OF_SUM
        )


def test_they_are_silent_until_asked_and_after_a_period_of_zero(clock):
    tips = EmulatedFingertips(lambda: Felt(0.0, 0.0))
    clock.now_s = 1.0
    assert tips.unasked() == b""
    [(command, _)] = Packets().fed(tips.heard(packet(READ)))
    assert command == READ
    tips.heard(packet(0x58, bytes((5,))) + packet(0x58, bytes((0,))))
    clock.now_s = 2.0
    assert tips.unasked() == b""


@pytest.fixture
def port():
    tips = EmulatedFingertips(lambda: Felt(2.0, 4.0))
    port = EmulatedPort("pty", tips.heard, tips.unasked, 0.001)
    yield port
    port.close()


def test_the_driver_reads_images_in_a_thread_with_their_age(port):
    driver = TactileFingertips(port.where)
    data = []
    while sum(one.image is not None for one in data) < 5:
        data.append(driver.newest(PATIENT_S))
    driver.close()
    images = [one.image for one in data if one.image is not None]
    counters = [image.counter for image in images]
    assert counters == sorted(set(counters))
    for image in images:
        assert sum(image.left) - sum(REST[0]) == pytest.approx(2000, abs=NOISE_OF_SUM)
        assert sum(image.right) - sum(REST[1]) == pytest.approx(4000, abs=NOISE_OF_SUM)
    assert driver.stream.clock.latency_s() >= 0.0
    assert driver.stream.damaged == 0
    taken = [one.taken for one in data]
    assert taken == sorted(set(taken))


def test_what_a_host_reads_late_is_not_lost():
    """60 kB, which is more than a terminal takes."""
    chunks = [bytes((k,)) * 1000 for k in range(60)]
    left = iter(chunks)
    sent = threading.Event()

    def unasked():
        chunk = next(left, b"")
        if not chunk:
            sent.set()
        return chunk

    port = EmulatedPort("pty", lambda data: b"", unasked, 0.001)
    assert sent.wait(PATIENT_S)
    found = b""
    # Opened as a file, since pyserial throws away what waits.
    with open(port.where, "rb", buffering=0) as line:
        while len(found) < 60_000 and select.select([line], [], [], PATIENT_S / 10)[0]:
            found += line.read(4096)
    port.close()
    assert found == b"".join(chunks)


def test_fingertips_that_are_unplugged_are_told(port):
    driver = TactileFingertips(port.where)
    assert driver.newest(PATIENT_S) is not None
    port.close()
    with pytest.raises(OSError, match=r"Input/output|device reports readiness|disconnected"):
        [driver.newest(PATIENT_S) for _ in range(3)]
    driver.close()


def test_emulated_fingertips_need_an_emulated_gripper():
    with pytest.raises(Exception, match="tactile_port"):
        create("sensor-backend", "robotiq", port="/dev/ttyUSB0", tactile_port="emulated")


def test_the_forces_are_zero_after_a_tare_and_rise_on_contact():
    gripper = create("sensor-backend", "robotiq", port="emulated", tactile_port="emulated")
    info = gripper.open(1)
    images = {}
    while len(images) < info.tare_images:
        pads = gripper.read(1.0).pads
        if pads.counter:
            images[pads.counter] = pads
    gripper.tare(list(images.values()))
    frame = gripper.read(1.0).frame
    assert abs(frame.force_left_n) < 0.5
    assert abs(frame.force_right_n) < 0.5
    for _ in range(2000):
        gripper.apply(Command(POSITION, 0.0, 25.0, 0.03))
        frame = gripper.read(1.0).frame
        if min(frame.force_left_n, frame.force_right_n) > 3.0:
            break
    gripper.close()
    assert min(frame.force_left_n, frame.force_right_n) > 3.0


def test_each_packet_of_a_millisecond_is_a_sample_of_every_fast_channel():
    gripper = create("sensor-backend", "robotiq", port="emulated", tactile_port="emulated")
    gripper.open(1)
    readings = [gripper.read(1.0) for _ in range(200)]
    gripper.close()
    last = readings[-1]
    assert last.signals._fields == (
        "dynamic_left",
        "dynamic_right",
        "acceleration_left",
        "acceleration_right",
        "rotation_left",
        "rotation_right",
    )
    for samples in zip(*(reading.signals for reading in readings), strict=True):
        # 10 ms a frame: none twice, none lost.
        assert {one.new for one in samples[1:]} == {10}
        assert {now.counter - before.counter for before, now in pairwise(samples)} == {10}
    assert set(last.signals.acceleration_left.values[:10]) == {(0.0, 0.0, 16384.0)}


def test_what_was_not_asked_for_in_time_is_kept_up_to_three_frames():
    stream = TactileStream()
    fields = [Field(DYNAMIC, finger, (7,)) for finger in (0, 1)]
    data = stream.fed(encoded(fields) * 20, 1.0)
    more = joined(data, stream.fed(encoded(fields) * 20, 1.02))
    assert more.taken == 40
    samples = more.signals(0.0)[0]
    assert (samples.counter, samples.new) == (40, 30)
    # Nothing new: the counter stays.
    samples = more.nothing_new().signals(0.0)[0]
    assert (samples.counter, samples.new) == (40, 0)


@pytest.mark.parametrize("thing", ["block", "toy"])
@pytest.mark.parametrize("seed", range(6))
def test_a_grasp_in_which_one_finger_touches_first_is_not_taken_for_a_fault(seed, thing):
    """Cells without noise were taken for stuck or unplugged ones, and a thing that pressed on all cells for drift."""
    options = [
        "gripper.port=emulated",
        "gripper.tactile_port=emulated",
        "features.type=chitta",
        f"run.seed={seed}",
    ]
    trial = load_pipeline("robotiq", options=options).grasp(object=f"{thing}#{seed}")
    assert trial.outcome.words == "steady", trial.reason
    assert not trial.features.reasons


@parametrize_checks(
    "graspsense-robotiq-2f",
    keys={"port": "emulated", "tactile_port": "emulated"},
    unplugged={"faults": {"unplug_at_s": 0.5}},
    absent={"tactile_port": "/dev/nowhere"},
)
def test_conformance_with_fingertips(check):
    check.run()
