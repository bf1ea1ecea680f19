"""The driver and the fake: each is judged by the other, and the fake by a driver that others wrote."""

from __future__ import annotations

from types import SimpleNamespace

import pyrobotiqgripper
import pytest
from graspsense_robotiq_2f85 import backend, fake
from graspsense_robotiq_2f85.fake import Fake
from graspsense_robotiq_2f85.modbus import Client, NoReply, SocketLine, crc, opened
from graspsense_robotiq_2f85.registers import FORCES_N, SPEEDS_M_S, byte_of, gap_of, position_of

from graspsense import WiringError, load_pipeline
from graspsense.plugin_api import VELOCITY, Command, NoDevice, create
from graspsense.testing_api import parametrize_checks


@pytest.fixture
def own_time(monkeypatch):
    """Driver and fake have a time of their own, which passes while the driver sleeps and a little as it looks at it.

    So nothing tells how fast this machine is, nor waits for it.
    """
    now_s = 0.0

    def sleep(seconds):
        nonlocal now_s
        now_s += seconds

    def look():
        sleep(0.001)
        return now_s

    monkeypatch.setattr(backend, "time", SimpleNamespace(monotonic=look, sleep=sleep))
    monkeypatch.setattr(fake, "time", SimpleNamespace(monotonic=lambda: now_s))


PATIENT_S = 60.0
"""For a reply that comes: when it does is this machine's business."""


@pytest.mark.usefixtures("own_time")
@parametrize_checks(
    "graspsense-robotiq-2f85",
    keys={"port": "fake", "reply_timeout_s": PATIENT_S},
    # Here no reply comes in the end, and that is waited for in earnest.
    unplugged={"vanishes_s": 0.5, "reply_timeout_s": 1.0},
    absent={"port": "/dev/nowhere"},
)
def test_conformance(check):
    check.run()


@pytest.mark.parametrize("way", ["serial", "rtu_tcp"])
def test_the_fake_satisfies_the_driver_of_others(way):
    with Fake(thing_m=gap_of(100), stiffness_n_m=10000.0) as fake:
        if way == "serial":
            how = {"com_port": fake.serial, "connection_type": "RTU"}
        else:
            host, port = fake.rtu_tcp.split(":")[1:]
            how = {"connection_type": "RTU_VIA_TCP", "tcp_host": host, "tcp_port": int(port)}
        gripper = pyrobotiqgripper.RobotiqGripper(**how)
        gripper.timeOut = PATIENT_S
        gripper.activate()
        gripper.start()
        gripper.open()
        assert gripper.position() <= 4
        gripper.move(255, speed=255, force=0)
        gripper.readStatus()
        stopped = gripper.status()
        gripper.disconnect()

    assert stopped["gOBJ"] == 2
    # 20 N on 10 N/mm: 2 mm behind the thing's face, in bytes of 0.374 mm.
    assert stopped["gPO"] == pytest.approx(100 + 2.0 / 0.374, abs=1)
    assert stopped["gCU"] == pytest.approx(20.0 / 150.0 / 0.010, abs=1)
    assert stopped["gPR"] == 255


@pytest.mark.usefixtures("own_time")
@pytest.mark.parametrize("way", ["serial", "rtu_tcp", "tcp"])
def test_a_grasp_over_every_wire(way):
    with Fake(thing_m=0.07) as fake:
        options = [f"gripper.port={getattr(fake, way)}", f"gripper.reply_timeout_s={PATIENT_S}"]
        trial = load_pipeline("robotiq-2f85", options=options).grasp()

    assert trial.outcome.words == "steady", trial.reason
    # The spring adds 3 N to what moving takes, or gives the 10.5 N alone while the fingers wait for their goal; by the
    # next frame, 10 ms later, the fingers are 0.2 mm further on, and a byte is 0.37 mm.
    assert 0.070 - 0.00105 - 0.0002 - 0.0004 <= trial.features["p_first"] <= 0.070
    # 25 N on 10 N/mm.
    assert trial.features["p_steady"] == pytest.approx(0.0675, abs=0.0008)
    assert trial.features["delta_t"] > 0.0
    assert trial.device.notes[0].startswith("effort is the motor's current")


def test_the_six_features_need_pads_and_the_user_is_told():
    with pytest.raises(WiringError, match=r"needs the channel 'force_left' in N.*robotiq-2f85 does not have"):
        load_pipeline("robotiq-2f85", options=["features.type=chitta"])


@pytest.mark.parametrize("setting", ["controller.approach_force_n=5", "run.first_effort_n=12"])
def test_less_than_the_least_force_is_refused_before_anything_moves(setting):
    with pytest.raises(WiringError, match="20 N"):
        load_pipeline("robotiq-2f85", options=["gripper.port=/dev/nowhere", setting])


@pytest.mark.usefixtures("own_time")
def test_forces_above_the_limit_of_a_first_use_are_told_to_be_one_grasp():
    for force_n in (40, 60):
        options = ["gripper.port=fake", "gripper.reply_timeout_s=60", f"controller.probing_force_n={force_n}"]
        trial = load_pipeline("robotiq-2f85", options=options).grasp()
        # 25 N on 10 N/mm, whatever was asked for.
        assert trial.features["p_steady"] == pytest.approx(0.0575, abs=0.0008)
        assert trial.counts["guarded"] > 10
        assert any("run.first_effort_n (25 N)" in warning for warning in trial.warnings)


@pytest.mark.usefixtures("own_time")
@pytest.mark.parametrize("sends", ["position", "velocity", "force"])
def test_every_kind_of_command_closes_gently_and_run_says_what_it_becomes(sends):
    options = ["gripper.port=fake", "gripper.reply_timeout_s=60", f"controller.sends={sends}"]
    trial = load_pipeline("robotiq-2f85", options=options).grasp()
    assert trial.outcome.words == "steady", trial.reason
    assert trial.features["p_steady"] == pytest.approx(0.0575, abs=0.0008)
    assert -trial.trace.velocity_m_s.min() < 0.025
    assert any(
        note.startswith(f"the gripper closes by itself: a {sends} becomes") for note in trial.device.notes
    )


def test_an_effort_is_not_sent_to_a_gripper_that_closes_by_itself():
    options = ["gripper.port=/dev/nowhere", "controller.type=hybrid", "controller.sends=effort"]
    with pytest.raises(WiringError, match="commands effort"):
        load_pipeline(
            options=[
                "gripper.type=robotiq-2f85",
                "features.type=chitta-without-pads",
                "classifier.type=none",
                *options,
            ]
        )


@pytest.mark.usefixtures("own_time")
def test_a_slow_velocity_is_a_goal_that_moves():
    gripper = create("sensor-backend", "robotiq-2f85", port="fake", reply_timeout_s=PATIENT_S)
    gripper.open(0)
    frames = []
    for _ in range(80):
        frames.append(gripper.read(0.1).frame)
        gripper.apply(Command(VELOCITY, -0.01, 25.0, 0.15))
    gripper.close()

    moved, seconds = frames[0].gap_m - frames[-1].gap_m, frames[-1].t_s - frames[0].t_s
    assert moved / seconds <= 0.0105
    assert moved > 0.004


@pytest.mark.parametrize("port", ["/dev/nowhere", "tcp:127.0.0.1:1", "rtu-tcp:nonsense"])
def test_no_gripper_is_said_with_what_to_look_at(port):
    with pytest.raises(NoDevice, match=r"no 2F-85 at .*gripper\.port"):
        create("sensor-backend", "robotiq-2f85", port=port).open(0)


def test_the_checksum_is_that_of_the_manual():
    # "Activation request" of the manual: 09 10 03 E8 00 03 06 01 00 00 00 00 00, checksum 72 E1.
    assert crc(bytes.fromhex("09 10 03 e8 00 03 06 01 00 00 00 00 00")) == bytes.fromhex("72 e1")


def test_a_register_that_is_none_is_an_exception_of_modbus():
    with Fake() as fake:
        client = opened(fake.serial, 9, PATIENT_S)
        with pytest.raises(NoReply, match="Modbus exception 2"):
            client.exchange(0, [0], 0x07D0, 3)
        client.close()


def test_another_unit_is_silent():
    with Fake() as fake:
        host, port = fake.rtu_tcp.split(":")[1:]
        client = Client(SocketLine(host, int(port), 0.1), 8, rtu=True)
        with pytest.raises(NoReply, match="no reply"):
            client.exchange(0x03E8, [0, 0, 0], 0x07D0, 3)
        client.close()


def test_bytes_never_ask_for_more_than_was_said():
    assert byte_of(5.0, FORCES_N) == 0
    assert byte_of(235.0, FORCES_N) == 255
    assert FORCES_N[0] + byte_of(100.0, FORCES_N) * 215.0 / 255.0 <= 100.0
    assert byte_of(0.15, SPEEDS_M_S) == 255
    assert [position_of(gap_of(one)) for one in (3, 100, 230)] == [3, 100, 230]
