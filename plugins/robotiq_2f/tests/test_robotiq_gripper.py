"""The driver against the emulated gripper, over every connection."""

import asyncio
import struct
import threading
import time
from contextlib import nullcontext

import numpy as np
import pytest
from cases import every_case
from emulated_grippers import (
    PATIENT_S,
    assert_a_killed_program_lets_go,
    assert_lost_in_a_grasp,
    give_own_time,
    plugged_in,
)
from pymodbus import FramerType
from pymodbus.server import ModbusTcpServer
from pymodbus.simulator import DataType, SimData, SimDevice

from graspsense import WiringError, load_pipeline
from graspsense.gripper_api import SerialFaults
from graspsense.plugin_api import POSITION, VELOCITY, Command, DeviceLost, NoDevice, create
from graspsense.testing_api import parametrize_checks
from graspsense_robotiq_2f import backend
from graspsense_robotiq_2f.config import RobotiqConfig
from graspsense_robotiq_2f.discovery import diagnose
from graspsense_robotiq_2f.emulator import ur_cap
from graspsense_robotiq_2f.emulator.device import EmulatedGripper
from graspsense_robotiq_2f.emulator.modbus import answered, checksum
from graspsense_robotiq_2f.link import ModbusLink
from graspsense_robotiq_2f.registers import INPUT, MODELS, OUTPUT, byte_of
from graspsense_robotiq_2f.ur_cap import opened_link

CLOSING = Command(VELOCITY, -0.03, 25.0, 0.15)


@pytest.fixture
def own_time(monkeypatch):
    give_own_time(monkeypatch, backend)


@pytest.fixture
def emulated():
    with plugged_in(
        lambda wire="pty", **keys: EmulatedGripper(RobotiqConfig(port="emulated", **keys), wire, 1)
    ) as make:
        yield make


@pytest.mark.slow
@parametrize_checks(
    "graspsense-robotiq-2f",
    wheel=False,  # .ci/grippers runs from the wheel
    keys={"port": "emulated"},
    unplugged={"faults": {"unplug_at_s": 0.5}},
    absent={"port": "/dev/nowhere"},
)
def test_conformance(check):
    check.run()


@pytest.mark.usefixtures("own_time")
@pytest.mark.parametrize(
    "wire", ["pty", *(pytest.param(wire, marks=pytest.mark.slow) for wire in ("socket", "ur"))]
)
def test_a_grasp_over_every_wire(emulated, wire):
    """A UR cap has no effort, so that only the features that need none are taken."""
    gripper = emulated(wire)
    options = [f"gripper.port={gripper.where}", f"gripper.reply_timeout_s={PATIENT_S}"]
    if wire == "ur":
        assert gripper.where.startswith("ur:127.0.0.1:")
        with pytest.raises(WiringError, match="effort"):
            load_pipeline("robotiq", options=options)
        options.append("features.type=width-and-time")
    trial = load_pipeline("robotiq", options=options).grasp()

    assert trial.outcome.words == "steady", trial.reason
    assert not trial.features.reasons
    # The fingers are 85 mm apart, and the block of the simulator is narrower.
    assert 0.05 < trial.features["p_steady"] <= trial.features["p_first"] < 0.08
    assert np.isnan(trial.trace.effort_n).all() == (wire == "ur")
    assert gripper.state()["gap_m"] > 0.08
    assert not gripper.state()["going"]


@pytest.mark.parametrize(
    "model", [pytest.param(model, marks=() if model == "2f-85" else pytest.mark.slow) for model in MODELS]
)
def test_every_model_closes_with_its_own_limits(model):
    speeds_m_s, forces_n = MODELS[model].speeds_m_s, MODELS[model].forces_n
    gripper = create("sensor-backend", "robotiq", model=model, port="emulated")
    info = gripper.open(1)
    frames = driven(gripper, Command(POSITION, 0.0, 20.0, 0.03), 400)
    gripper.close()

    assert (info.speed_limit_m_s, info.effort_limit_n) == (speeds_m_s[1], forces_n[1])
    assert gripper.least_force_n == forces_n[0]
    # A gripper that is told to stop still has a target.
    assert byte_of(info.relaxed.effort_limit_n, forces_n) == 0
    assert 0.005 < frames[-1].gap_m < frames[0].gap_m - 0.01, "it holds the thing"
    # A step of the current is 10 mA, 1.5 N.
    assert max(frame.effort_n for frame in frames) <= 20.0 + 1.5
    assert gripper.report()["true_peak_force_n"] < 40.0


def opened(gripper):
    """Return an open driver of this emulated gripper."""
    driver = create("sensor-backend", "robotiq", port=gripper.where, reply_timeout_s=PATIENT_S)
    driver.open(1)
    return driver


def driven(driver, command, ticks):
    """Return the frames of so many ticks, each answered by this command."""
    frames = []
    for _ in range(ticks):
        frames.append(driver.read(0.1).frame)
        driver.apply(command)
    return frames


@pytest.mark.slow
@every_case("at_s", [0.22, 0.7, 2.2])
@every_case("fault", ["unplug", "silent"])
def test_a_gripper_lost_in_a_grasp_ends_it_and_is_told(fault, at_s):
    assert_lost_in_a_grasp("robotiq", fault, at_s, "gripper.reply_timeout_s=0.5")


def test_a_ur_cap_takes_all_bytes_and_answers_each_line(emulated):
    hand = emulated("ur").hand
    assert ur_cap.answered(hand, b"GET POS\nGET FOR\nSET PO", 1.0) == (b"POS 3\nFOR 0\n", b"SET PO")
    assert ur_cap.answered(hand, b"SET ACT 1 GTO 1 POS 100\nGET PRE\n", 1.0) == (b"ackPRE 100\n", b"")
    for line in (b"SET POS 256\n", b"SET XYZ 1\n", b"SET POS\n", b"PUT POS 1\n", b"\xff\n", b"\n"):
        assert ur_cap.answered(hand, line, 1.0)[0] == b"?"
    assert ur_cap.answered(hand, b"GET XYZ\n", 1.0)[0] == b"XYZ ?\n"


@pytest.mark.usefixtures("own_time")
@pytest.mark.parametrize("wire", ["pty", "socket", "ur"])
@pytest.mark.parametrize("mood", ["damaged", "silent", "late", "repeated"])
def test_whatever_becomes_of_replies_the_fingers_are_told_to_stop(emulated, wire, mood):
    """The gripper still hears: what it is told last is to stop."""
    gripper = emulated(wire, faults=SerialFaults(late_s=0.01))
    driver = opened(gripper)
    driven(driver, CLOSING, 20)
    assert gripper.state()["going"]
    gripper.tell(mood)
    lost = mood in ("damaged", "silent")
    if lost:
        # No valid reply comes any more, so it need not be waited for.
        driver._link.close()
        driver._link = opened_link(gripper.where, driver.config.address, 0.02)
    with pytest.raises(DeviceLost) if lost else nullcontext():
        [driver.read(0.1) for _ in range(4)]
    driver.close()
    assert not gripper.state()["going"]


@pytest.mark.slow
@pytest.mark.usefixtures("own_time")
def test_fingers_that_open_slowly_begin_at_once(emulated):
    """The target of a slow closing is up to 4 mm ahead, within the object."""
    gripper = emulated()
    driver = opened(gripper)
    frame = driven(driver, Command(VELOCITY, -0.01, 25.0, 0.15), 400)[-1]
    driver.read(0.1)
    driver.apply(Command(POSITION, 0.085, 25.0, 0.01))
    driver.read(0.1)
    assert MODELS["2f-85"].gap_m(gripper.hand.registers[1]) > frame.gap_m
    driver.close()


def test_requests_that_come_together_are_all_answered(emulated):
    hand = emulated().hand
    asks = [struct.pack(">BBHHHHBBB", 9, 23, INPUT, 3, OUTPUT, 1, 2, 9, go) for go in (0, 8)]
    together = b"".join(ask + checksum(ask) for ask in asks)
    replies, left = answered(hand, 9, together + asks[0][:5], 1.0)
    assert (len(replies), left) == (2 * 11, asks[0][:5])


class OneBehind:
    """A line on which a reply is that to the request before, which the gripper has lost."""

    def __init__(self, link):
        self._link, self._late = link, link.status()
        self.close = link.close

    def exchange(self, values):
        if self._late is None:
            return self._link.exchange(values)
        late, self._late = self._late, None
        return late


@pytest.mark.usefixtures("own_time")
def test_a_late_reply_is_not_taken_for_that_to_the_stop(emulated):
    gripper = emulated()
    driver = closing(gripper)
    driver._link = OneBehind(driver._link)
    driver.close()
    assert not gripper.state()["going"]


def closing(gripper):
    """Return an open driver that closes this gripper."""
    driver = opened(gripper)
    driven(driver, CLOSING, 1)
    driver.read(0.1)
    assert gripper.state()["going"]
    return driver


@pytest.mark.usefixtures("own_time")
@pytest.mark.parametrize("wire", ["pty", "socket", "ur"])
def test_a_gripper_that_lost_its_power_is_not_activated_around_the_object(emulated, wire):
    """Each request asks it to be active, and an activation runs over the whole stroke."""
    gripper = emulated(wire)
    driver = closing(gripper)
    gripper.tell("restart")
    with pytest.raises(DeviceLost, match="switched off"):
        driver.read(0.1)
    driver.apply(Command(VELOCITY, 0.0, 25.0, 0.15))
    driver.close()
    assert not gripper.state()["going"]
    assert gripper.hand.active_since_s == np.inf

    driver.open(1)
    assert driver.read(0.1) is not None
    driver.close()


@pytest.mark.slow
@pytest.mark.parametrize("wire", ["socket", "ur"])
def test_a_gripper_whose_connection_broke_is_told_to_open_over_a_new_one(emulated, wire):
    gripper = emulated(wire)
    driver = closing(gripper)
    while gripper.state()["gap_m"] > 0.08:
        driven(driver, CLOSING, 1)
    # A converter drops the first of two connections.
    other = opened_link(gripper.where, driver.config.address, PATIENT_S)
    other.status()
    with pytest.raises(DeviceLost, match="cable and power"):
        driver.read(0.1)
    driver.close()
    other.close()
    until_s = time.monotonic() + PATIENT_S
    while gripper.state()["gap_m"] < 0.084 and time.monotonic() < until_s:
        time.sleep(0.01)
    assert gripper.state()["gap_m"] >= 0.084


@pytest.mark.slow
def test_fingers_that_do_not_move_end_the_grasp():
    """A drive that more friction holds than it has force stands for an emergency stop, or for what blocks it."""
    options = ["gripper.port=emulated", "gripper.body_config={coulomb_n=500.0, breakaway_n=500.0}"]
    trial = load_pipeline("robotiq", options=options, force=True).grasp()
    assert trial.outcome.words == "aborted"
    assert "85.0 mm" in trial.reason
    assert trial.trace.t_s[-1] < 5.0


@pytest.mark.slow
def test_a_gripper_whose_program_is_killed_opens(emulated):
    gripper = emulated()
    settings = {"port": gripper.where, "reply_timeout_s": 10.0, "told": "reading.frame.gap_m < 0.075"}
    assert_a_killed_program_lets_go("robotiq", lambda: gripper.state()["gap_m"] < 0.08, 25.0, **settings)


def test_a_late_reply_is_not_taken_for_that_of_the_next_request(emulated):
    gripper = emulated("socket")
    link = ModbusLink(gripper.where, 9, PATIENT_S)
    link.exchange([0x0100, 7, 0])
    gripper.tell("repeated")
    link.exchange([0x0100, 8, 0])
    gripper.tell("well")
    assert link.exchange([0x0100, 9, 0])[1] == 9
    link.close()


@pytest.mark.usefixtures("own_time")
def test_an_active_gripper_is_not_activated_again(emulated):
    """Activation runs the fingers over the whole stroke, and would drop what they hold."""
    gripper, activated = emulated(), set()
    for _ in range(2):
        opened(gripper).close()
        activated.add(gripper.hand.active_since_s)
    assert len(activated) == 1


def test_a_slow_velocity_is_a_target_that_moves():
    gripper = create("sensor-backend", "robotiq", port="emulated")
    gripper.open(0)
    frames = driven(gripper, Command(VELOCITY, -0.01, 25.0, 0.15), 200)
    gripper.close()
    moved, seconds = frames[60].gap_m - frames[-1].gap_m, frames[-1].t_s - frames[60].t_s
    assert 0.006 < moved / seconds <= 0.0115


PORTS = ("/dev/nowhere", "socket:127.0.0.1:1", "socket:nonsense", "ur:127.0.0.1:1", "ur:127.0.0.1:x")


@every_case("port", PORTS)
def test_no_gripper_is_said_with_what_to_look_at(port):
    with pytest.raises(NoDevice, match=r"2F-85.*gripper\.port"):
        create("sensor-backend", "robotiq", port=port).open(0)


@every_case(
    "setting", ["controller.approach_force_n=5", "controller.probing_force_n=10", "run.first_effort_n=12"]
)
def test_less_than_the_least_force_is_refused_before_anything_moves(setting):
    with pytest.raises(WiringError, match="20 N"):
        load_pipeline("robotiq", options=["gripper.port=/dev/nowhere", setting])


def test_doctor_tells_a_gripper_from_a_silent_port_and_from_none(emulated):
    gripper = emulated()
    configs = [
        RobotiqConfig(port=port, address=address)
        for port, address in ((gripper.where, 9), (gripper.where, 8), ("/dev/nowhere", 9))
    ]
    assert [next(iter(diagnose(config, 1.0))).state for config in configs] == ["ok", "problem", "problem"]
    assert not gripper.state()["going"]


@pytest.fixture
def pymodbus_server():
    """The simulator server of pymodbus: unit 9, active, with the position and current of fingers at rest."""
    registers = ((OUTPUT, [0, 0, 0]), (INPUT, [0x3100, 0, 3 << 8 | 12]))
    blocks = [SimData(place, values=words, datatype=DataType.REGISTERS) for place, words in registers]
    loop = asyncio.new_event_loop()

    async def listening():
        unit = SimDevice(9, simdata=blocks)
        server = ModbusTcpServer(unit, framer=FramerType.RTU, address=("127.0.0.1", 0))
        await server.listen()
        return server

    thread = threading.Thread(target=loop.run_forever)
    thread.start()
    server = asyncio.run_coroutine_threadsafe(listening(), loop).result(PATIENT_S)
    yield f"socket:127.0.0.1:{server.transport.sockets[0].getsockname()[1]}"
    asyncio.run_coroutine_threadsafe(server.shutdown(), loop).result(PATIENT_S)
    loop.call_soon_threadsafe(loop.stop)
    thread.join(PATIENT_S)
    loop.close()


def test_the_simulator_server_of_pymodbus_takes_the_driver(pymodbus_server):
    driver = create("sensor-backend", "robotiq", port=pymodbus_server, reply_timeout_s=PATIENT_S)
    assert driver.open(0).name == "Robotiq 2F-85"
    for _ in range(5):
        driver.apply(Command(POSITION, 0.04, 100.0, 0.05))
        frame = driver.read(PATIENT_S).frame
    driver.close()
    assert (frame.gap_m, frame.effort_n) == pytest.approx((0.085, 0.12 * 150.0))
    link = ModbusLink(pymodbus_server, 9, PATIENT_S)
    written = link._client.read_holding_registers(OUTPUT, count=3, device_id=9).registers
    link.close()
    model = MODELS["2f-85"]
    # The last word is to stop: the rest of the request is that of the grasp.
    speed_and_force = byte_of(0.05, model.speeds_m_s) << 8 | byte_of(100.0, model.forces_n)
    assert written == [0x0100, model.position(0.04), speed_and_force]


def test_the_checksum_is_that_of_the_manual():
    # "Activation request" of the manual: 09 10 03 E8 00 03 06 01 00 00 00 00 00, checksum 72 E1.
    assert checksum(bytes.fromhex("09 10 03 e8 00 03 06 01 00 00 00 00 00")) == bytes.fromhex("72 e1")


def test_bytes_never_ask_for_more_than_was_said():
    forces_n = MODELS["2f-85"].forces_n
    assert byte_of(5.0, forces_n) == 0
    assert byte_of(235.0, forces_n) == 255
    assert forces_n[0] + byte_of(100.0, forces_n) * 215.0 / 255.0 <= 100.0
    for model in MODELS.values():
        for position in (model.open_byte, 100, model.closed_byte):
            assert model.position(model.gap_m(position)) == position
