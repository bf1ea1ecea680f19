"""The protocol of the TSF-85 fingertips, and their emulator."""

import json
import select
import subprocess
import sys
import threading
from itertools import pairwise
from types import SimpleNamespace

import pytest
from cases import every_case
from emulated_grippers import PATIENT_S
from hypothesis import given
from hypothesis import strategies as st

from graspsense import load_pipeline
from graspsense.gripper_api import EmulatedPort
from graspsense.plugin_api import POSITION, Command, ConfigError, create
from graspsense.testing_api import parametrize_checks
from graspsense_robotiq_2f.config import RobotiqConfig
from graspsense_robotiq_2f.emulator import fingertips
from graspsense_robotiq_2f.emulator.device import emulate
from graspsense_robotiq_2f.emulator.fingertips import (
    COUNTS_PER_N,
    NOISE_COUNTS,
    EmulatedFingertips,
    emulated_boards,
)
from graspsense_robotiq_2f.tactile import (
    TactileBoard,
    TactileFingertips,
    TactileStream,
    joined,
    opened_boards,
)
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

CELL = st.integers(0, 0xFFFF)
NOISE_OF_SUM = 6.0 * NOISE_COUNTS * CELLS**0.5
"""Six standard deviations."""
FINGER = st.integers(0, 1)
FIELDS = st.tuples(
    st.builds(Field, st.just(TIMESTAMP), FINGER, st.tuples(st.integers(0, 2**64 - 1))),
    st.builds(Field, st.just(PRESSURE), FINGER, st.lists(CELL, min_size=CELLS, max_size=CELLS).map(tuple)),
    st.builds(Field, st.just(DYNAMIC), FINGER, st.tuples(st.integers(-32768, 32767))),
)


@given(FIELDS.map(list))
def test_what_is_encoded_is_decoded(fields):
    [(command, data)] = Packets().fed(encoded(fields))
    assert (command, decoded(data)) == (READ, fields)


@given(st.binary(max_size=300), st.integers(1, 40))
def test_any_bytes_in_any_pieces_are_taken(data, size):
    expected, pieces = Packets().fed(data), Packets()
    given_pieces = (data[start : start + size] for start in range(0, len(data), size))
    assert [packet for piece in given_pieces for packet in pieces.fed(piece)] == expected
    for _, fields in expected:
        decoded(fields)


def test_a_field_that_is_cut_or_unknown_makes_a_packet_damaged():
    assert decoded(bytes((PRESSURE,)) + bytes(2 * CELLS - 1)) is decoded(b"\x00\x00") is None
    boards = FedBoard(), FedBoard()
    for board in boards:
        board.stream.fed(packet(READ, b"\x00"), 1.0)
    assert TactileFingertips(boards).report()["tactile_damaged"] == 2, "those of both boards count"


@pytest.fixture
def clock(monkeypatch):
    clock = SimpleNamespace(now_s=0.0)
    monkeypatch.setattr(fingertips, "time", SimpleNamespace(monotonic=lambda: clock.now_s))
    return clock


def test_every_period_has_one_packet_and_images_come_at_60_hz(clock):
    tips = EmulatedFingertips(lambda: (2.0, 4.0))
    tips.heard(packet(0x58, bytes((1,))))
    packets = Packets()
    measured = []
    for tick in range(1, 401):
        clock.now_s = tick * 0.0025
        measured += [decoded(data) for _, data in packets.fed(tips.unasked())]
    stamps = [fields[0].values[0] for fields in measured]
    assert {later - earlier for earlier, later in pairwise(stamps)} == {1000}
    assert 1000 <= len(stamps) <= 1001
    images = [field for fields in measured for field in fields if field.kind == PRESSURE]
    # A packet each millisecond: the image of 16.7 ms is in that of 17 ms.
    assert 58 <= len(images) / 2 <= 61
    for image in images:
        counts = (2.0, 4.0)[image.finger] * COUNTS_PER_N
        assert sum(image.values) - sum(tips.rest[image.finger]) == pytest.approx(counts, abs=NOISE_OF_SUM)


def test_they_are_silent_until_asked_and_after_a_period_of_zero(clock):
    tips = EmulatedFingertips(lambda: (0.0, 0.0))
    clock.now_s = 1.0
    assert tips.unasked() == b""
    [(command, _)] = Packets().fed(tips.heard(packet(READ)))
    assert command == READ
    tips.heard(packet(0x58, bytes((5,))) + packet(0x58, bytes((0,))))
    clock.now_s = 2.0
    assert tips.unasked() == b""


@pytest.fixture
def ports():
    """Makes the ports of so many boards, with 2 N on the left finger and 4 N on the right."""
    made = []

    def make(count):
        boards = emulated_boards(count, lambda: (2.0, 4.0))
        made.extend(EmulatedPort("pty", board.heard, board.unasked, 0.001) for board in boards)
        return [port.where for port in made], boards

    yield make
    for port in made:
        port.close()


def taken_images(driver, count):
    """Return this many images with the samples that came with each."""
    images = []
    while len(images) < count:
        driver.take(PATIENT_S)
        if driver.image is not None:
            images.append((driver.image, driver.signals(0.0)))
    return images


def assert_images_of_both(taken, rests):
    images = [image for image, _ in taken]
    counters, times = [image.counter for image in images], [image.host_s for image in images]
    assert counters == sorted(set(counters))
    assert times == sorted(set(times))
    for image in images:
        for cells, zeros, counts in zip(image.cells, rests, (2000, 4000), strict=True):
            assert sum(cells) - sum(zeros) == pytest.approx(counts, abs=NOISE_OF_SUM)


ONE_BOARD = {"tactile_channels": "pads force_left force_right"}
TWO_BOARDS = {
    "tactile_left_channels": "force_left dynamic_left acceleration_left rotation_left",
    "tactile_right_channels": "force_right dynamic_right acceleration_right rotation_right",
    "pads_channels": "pads",
}


@pytest.mark.parametrize(("count", "channels"), [(1, ONE_BOARD), (2, TWO_BOARDS)])
def test_the_driver_reads_images_in_a_thread_with_their_age_and_each_board_has_its_clock(
    ports, count, channels
):
    places, boards = ports(count)
    driver = TactileFingertips(opened_boards(places))
    taken = taken_images(driver, 5)
    driver.close()
    assert_images_of_both(taken, [board.rest[finger] for board in boards for finger in board.fingers])
    report = driver.report()
    told = {key: value for key, value in report.items() if key.endswith("_channels")}
    assert told.keys() == channels.keys()
    assert all(told[key].startswith(channels[key]) for key in channels)
    assert report["tactile_damaged"] == 0
    if count == 1:
        assert report["tactile_latency_s"] >= 0.0
        counters = [signals[0].counter for _, signals in taken]
        assert counters == sorted(set(counters))
    else:
        sides_s = max(report[f"tactile_{side}_uncertainty_s"] for side in ("left", "right"))
        assert report["pads_uncertainty_s"] >= sides_s


def test_of_two_boards_that_are_not_both_there_none_is_kept(ports):
    [where], _ = ports(1)
    with pytest.raises(OSError, match="fingertips at /dev/nowhere"):
        opened_boards([where, "/dev/nowhere"])
    # The port is exclusive.
    [board] = opened_boards([where])
    board.close()


class FedBoard:
    """A board that sends what a test gives it."""

    def __init__(self):
        self.stream, self.silent_s, self.came = TactileStream(1), 0.0, None

    def feed(self, host_s, device_s, number, *fields):
        stamp = Field(TIMESTAMP, number, (round(device_s * 1e6),))
        sent = [stamp, *(Field(kind, number, values) for kind, values in fields)]
        self.came = self.stream.fed(encoded(sent), host_s)

    def newest(self, timeout_s):
        came, self.came = self.came, None
        return came

    def age_s(self):
        return self.silent_s

    def close(self):
        pass


def test_an_image_of_two_boards_has_the_time_of_the_older_half_and_tells_how_far_the_halves_are_apart():
    left, right = boards = FedBoard(), FedBoard()
    driver = TactileFingertips(boards)

    def image(value):
        return (PRESSURE, (value,) * CELLS), (DYNAMIC, (value,))

    # Clocks that began at other times, and fingertips with other numbers.
    left.feed(10.0, 3.0, 0, *image(1))
    assert not driver.take(0.0)
    assert driver.image is None, "no right half yet"
    right.feed(10.004, 500.0, 1, *image(2))
    driver.take(0.0)
    assert driver.image is None, "no new left half"
    left.feed(10.016, 3.016, 0, *image(3))
    driver.take(0.0)
    assert driver.image.host_s == pytest.approx(10.004)
    assert [cells[0] for cells in driver.image.cells] == [3, 2]
    dynamic_left, dynamic_right = driver.signals(10.0)[:2]
    assert (dynamic_left.counter, dynamic_left.new, dynamic_left.values[0]) == (2, 1, (3,))
    assert (dynamic_right.counter, dynamic_right.new) == (1, 0)
    assert (dynamic_left.t_s, dynamic_right.t_s) == (pytest.approx(0.016), pytest.approx(0.004))
    # The right half is the one before: a later image has a later time nevertheless.
    left.feed(10.033, 3.033, 0, *image(4))
    driver.take(0.0)
    assert driver.image.host_s > 10.004
    report = driver.report()
    assert report["tactile_left_offset_s"] == pytest.approx(7.0)
    assert report["tactile_right_offset_s"] == pytest.approx(-489.996)
    assert report["pads_uncertainty_s"] >= 0.029
    right.silent_s = 1.0
    assert driver.age_s() == 1.0, "one that is silent is enough"


def test_what_else_than_its_only_fingertip_a_board_sends_is_not_taken():
    stream = TactileStream(1)

    def sent(number, value):
        fields = [Field(DYNAMIC, number, (value,)), Field(PRESSURE, number, (value,) * CELLS)]
        return stream.fed(encoded(fields), 1.0)

    of_first, of_other, data = sent(1, 7), sent(0, 9), sent(1, 8)
    assert of_other is None
    assert [(taken.image.cells[0][0], taken.rows[0]) for taken in (of_first, data)] == [
        (7, ((7,),)),
        (8, ((8,),)),
    ]
    assert data.taken == 2


@pytest.mark.slow
def test_a_gripper_and_two_boards_are_three_ports_and_a_trial_tells_how_far_their_times_can_be_apart():
    options = ["gripper.port=emulated", "gripper.tactile_port=emulated,emulated", "features.type=chitta"]
    trial = load_pipeline("robotiq", options=options).grasp()
    assert trial.outcome.words == "steady", trial.reason
    assert not trial.features.reasons
    assert len(trial.trace.pad_t_s) > 10
    for pair in (
        ("gap", "force_left"),
        ("force_left", "force_right"),
        ("gap", "pads"),
        ("gap", "dynamic_left"),
    ):
        assert 0.0 < trial.apart_s(*pair) < 1.0
    assert trial.apart_s("gap", "effort") == trial.apart_s("dynamic_left", "rotation_left") == 0.0
    assert {"tactile_left_drift", "tactile_right_drift"} <= set(trial.report)


TACTILE_PORTS = ("a,b,c", ",", "a,", "emulated,/dev/ttyACM0")


@every_case(
    ("port", "where"), [*(("emulated", where) for where in TACTILE_PORTS), ("/dev/ttyUSB0", "emulated")]
)
def test_ports_that_cannot_be_are_refused(port, where):
    with pytest.raises(ConfigError, match="tactile_port"):
        create("sensor-backend", "robotiq", port=port, tactile_port=where)


@every_case(("where", "count"), [("emulated", 1), ("emulated,emulated", 2)])
def test_emulated_fingertips_have_a_port_for_each_board(where, count):
    gripper = emulate(RobotiqConfig(port="emulated", tactile_port=where), "pty", 0)
    gripper.tell("plug")
    boards = opened_boards(gripper.tactile_where.split(","))
    fingertips = TactileFingertips(boards)
    assert len(boards) == count
    assert fingertips.take(PATIENT_S)
    fingertips.close()
    gripper.tell("unplug")
    assert not gripper.tactile_where
    gripper.close()


def test_what_a_host_reads_late_is_not_lost():
    """60 kB, which is more than a terminal takes."""
    chunks = [bytes((k,)) * 1000 for k in range(60)]
    left, sent = iter(chunks), threading.Event()
    port = EmulatedPort("pty", lambda data: b"", lambda: next(left, None) or sent.set() or b"", 0.001)
    assert sent.wait(PATIENT_S)
    received = b""
    # Opened as a file, since pyserial throws away what waits.
    with open(port.where, "rb", buffering=0) as line:
        while len(received) < 60_000 and select.select([line], [], [], PATIENT_S / 10)[0]:
            received += line.read(4096)
    port.close()
    assert received == b"".join(chunks)


def test_fingertips_that_are_unplugged_are_told():
    tips = EmulatedFingertips(lambda: (2.0, 4.0))
    port = EmulatedPort("pty", tips.heard, tips.unasked, 0.001)
    driver = TactileBoard(port.where, 2)
    assert driver.newest(PATIENT_S) is not None
    port.close()
    with pytest.raises(OSError, match=r"Input/output|device reports readiness|disconnected"):
        [driver.newest(PATIENT_S) for _ in range(3)]
    driver.close()


@pytest.mark.parametrize("where", ["emulated", "emulated,emulated"])
def test_the_forces_are_zero_after_a_tare_and_rise_on_contact(where):
    gripper = create("sensor-backend", "robotiq", port="emulated", tactile_port=where)
    info = gripper.open(1)
    images = {}
    while len(images) < info.tare_images:
        pads = gripper.read(1.0).pads
        images |= {pads.counter: pads} if pads.counter else {}
    gripper.tare(list(images.values()))
    forces = felt(gripper)
    assert max(map(abs, forces)) < 0.5
    for _ in range(2000):
        if min(forces) > 3.0:
            break
        gripper.apply(Command(POSITION, 0.0, 25.0, 0.03))
        forces = felt(gripper)
    gripper.close()
    assert min(forces) > 3.0


def felt(gripper):
    frame = gripper.read(1.0).frame
    return frame.force_left_n, frame.force_right_n


@pytest.mark.parametrize("where", ["emulated", "emulated,emulated"])
def test_each_packet_of_a_millisecond_is_a_sample_of_every_fast_channel(where):
    gripper = create("sensor-backend", "robotiq", port="emulated", tactile_port=where)
    gripper.open(1)
    readings = [gripper.read(1.0).signals for _ in range(200)]
    gripper.close()
    kinds = ("dynamic", "acceleration", "rotation")
    assert readings[-1]._fields == tuple(f"{kind}_{side}" for kind in kinds for side in ("left", "right"))
    for samples in zip(*readings, strict=True):
        # 10 ms a frame: none twice, none lost.
        assert {sample.new for sample in samples[1:]} == {10}
        assert {now.counter - earlier.counter for earlier, now in pairwise(samples)} == {10}
    assert set(readings[-1].acceleration_left.values[:10]) == {(0.0, 0.0, 16384.0)}


def test_what_was_not_asked_for_in_time_is_kept_up_to_three_frames():
    stream = TactileStream()
    sent = encoded([Field(DYNAMIC, finger, (7,)) for finger in (0, 1)]) * 20
    more = joined(stream.fed(sent, 1.0), stream.fed(sent, 1.02))
    assert more.taken == 40
    # When nothing new has come, the counter stays.
    samples = [data.signals(0.0)[0] for data in (more, more.nothing_new())]
    assert [(sample.counter, sample.new) for sample in samples] == [(40, 30), (40, 0)]


@pytest.mark.slow
@every_case(("seed", "thing"), [(0, "block"), (1, "toy")])
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


@pytest.mark.slow
@parametrize_checks(
    "graspsense-robotiq-2f/robotiq",
    keys={"port": "emulated", "tactile_port": "emulated"},
    unplugged={"faults": {"unplug_at_s": 0.5}},
    absent={"tactile_port": "/dev/nowhere"},
)
def test_conformance_with_fingertips(check):
    check.run()


@pytest.mark.slow
def test_the_command_emulates_fingertips_on_a_port_of_their_own():
    command = [sys.executable, "-P", "-m", "graspsense", "emulate", "tsf85", "--json"]
    state = json.loads(subprocess.run(command, input=b"quit\n", capture_output=True, check=True).stdout)
    assert state["tactile_port"] not in ("", state["port"])
