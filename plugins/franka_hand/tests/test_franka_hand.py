"""The driver with the emulated hand in the same process, the features of width and time, and the calibration."""

from contextlib import suppress

import numpy as np
import pytest
from attrs import evolve
from cases import every_case
from commands import graspsense
from hypothesis import example, given
from hypothesis import strategies as st
from traces import made_trace

from graspsense import WiringError, load_pipeline
from graspsense.core.grasp.calibration import load_of, load_table
from graspsense.gripper_api import LoadTable, asked_force
from graspsense.plugin_api import (
    APPROACH,
    FORCE,
    POSITION,
    VELOCITY,
    Command,
    DataDamaged,
    DeviceLost,
    NoDevice,
    PluginUnavailable,
    create,
)
from graspsense.testing_api import parametrize_checks
from graspsense_franka_hand import link
from graspsense_franka_hand.config import FrankaConfig
from graspsense_franka_hand.discovery import diagnose
from graspsense_franka_hand.emulator.hand import FrankaHand
from graspsense_franka_hand.protocol import (
    ABORTED,
    CONNECT,
    FAILED,
    GRASP,
    MOVE,
    STOP,
    SUCCESS,
    HandRequest,
    HandRequests,
    NotARequest,
    request_bytes,
)

EMULATED = ["gripper.host=emulated", "gripper.calibration=none"]


@pytest.mark.slow
@parametrize_checks(
    "graspsense-franka-hand",
    wheel=False,  # .ci/grippers runs from the wheel
    # Every object is opened. That its steps are exact is a matter of the simulator, the body of the emulated hand.
    keys={"host": "emulated", "calibration": "none", "body_config": {"fidelity": "fixed"}},
    unplugged={"faults": {"unplug_at_s": 1.0}},
    absent={"host": "127.9.9.9", "calibration": "none", "body_config": {}},
)
def test_conformance(check):
    check.run()


def test_a_grasp_gives_width_and_time_and_opens_the_fingers():
    trial = load_pipeline("franka", options=EMULATED).grasp()
    features, trace = trial.features, trial.trace
    assert trial.outcome.words == "steady", trial.reason
    assert not features.reasons
    # The object of the simulator is 50 mm wide, and gives way by millimetres between 30 and 60 N.
    assert 0.045 < features["p_steady"] < features["p_first"] < 0.05
    assert features["squeezed"] == pytest.approx(features["p_first"] - features["p_steady"])
    assert features["delta_t"] > 0.0
    assert np.isnan(trace.effort_n).all()
    assert set(np.unique(trace.signals["grasped"])) == {0.0, 1.0}
    assert trace.signals["temperature"] == pytest.approx(303.15)
    assert trace.gap_m[-1] > 0.078


def test_fingers_that_close_on_nothing_have_no_features_and_say_why():
    trial = load_pipeline("franka", options=EMULATED).grasp(object="none")
    assert trial.outcome.words == "nothing there"
    assert set(trial.features.reasons) == set(trial.features.names)


def test_less_than_the_least_force_is_refused_before_anything_moves():
    with pytest.raises(WiringError, match="30 N"):
        load_pipeline("franka", options=["controller.approach_force_n=10"])


def _features(*gaps):
    """Return the features of fingers that close at 20 mm/s for 1 s to 40 mm, and then stand at these gaps."""
    gaps = [*(0.06 - 0.02 * k / 15.0 for k in range(15)), *gaps]
    times = np.arange(len(gaps)) / 15.0
    trace = made_trace([(gap, np.nan, np.nan) for gap in gaps], phase=APPROACH, t_s=times)
    trace = evolve(trace, units={**trace.units, "t": "frame"})
    return create("feature-set", "width-and-time").extract(trace)


def test_the_features_are_those_of_the_widths():
    """6 states at 40 mm, two to 38 mm, and rest until the end."""
    features = _features(*[0.04] * 6, 0.039, *[0.038] * 8)
    expected = {"p_first": 0.04, "p_steady": 0.038, "squeezed": 0.002, "approach_t": 1.0, "delta_t": 7 / 15.0}
    assert {name: features[name] for name in expected} == pytest.approx(expected)
    # A recording that counts time in frames has no seconds.
    assert features.units == ("m", "m", "m", "frame", "frame")


def test_fingers_that_still_move_have_no_last_rest():
    features = _features(*[0.04] * 6, 0.039, 0.037, 0.035, 0.033, 0.031)
    assert features["p_first"] == pytest.approx(0.04)
    assert set(features.reasons) == {"p_steady", "squeezed", "delta_t"}


def _opened(**settings):
    driver = create("sensor-backend", "franka", **{"host": "emulated", "calibration": "none", **settings})
    driver.open(1)
    return driver


def _driven(driver, command, frames=60):
    """Return the frames of a driver that is commanded this again and again."""
    read = [driver.read(1.0).frame]
    for _ in range(frames):
        driver.apply(command)
        read.append(driver.read(1.0).frame)
    return read


@pytest.mark.slow
@every_case(("kind", "value"), [(VELOCITY, -0.02), (POSITION, 0.0), (FORCE, 40.0)])
def test_every_kind_of_command_closes_at_its_speed_and_not_again_and_again(kind, value):
    driver = _opened()
    frames = _driven(driver, Command(kind, value, 40.0, 0.02))
    assert driver.report()["orders"] == 1
    driver.close()
    assert np.mean([frame.velocity_m_s for frame in frames[5:15]]) == pytest.approx(-0.02, rel=0.1)
    assert 0.04 < frames[-1].gap_m < 0.05
    assert driver.report()["true_peak_force_n"] < 45.0


def test_a_stronger_grasp_waits_until_the_running_one_has_ended_and_an_opening_does_not():
    driver, orders = _opened(), []
    for force_n in (30.0, 35.0, 40.0, 45.0):
        driver.apply(Command(POSITION, 0.0, force_n, 0.02))
        orders.append(driver.report()["orders"])
        driver.read(1.0)
    for _ in range(60):
        driver.read(1.0)
    orders.append(driver.report()["orders"])
    driver.apply(Command(POSITION, 0.08, 30.0, 0.05))
    orders.append(driver.report()["orders"])
    driver.close()
    assert orders == [1, 1, 1, 1, 2, 3]


def test_who_is_released_is_not_pressed():
    driver = _opened()
    hand = driver._link.hand
    _driven(driver, Command(POSITION, 0.0, 40.0, 0.05))
    assert hand.pressing
    driver.close()
    assert not hand.pressing


@pytest.mark.slow
@every_case(("mood", "at_s"), [("silent", 0.5), ("damaged", 2.0), ("late", 3.0), ("damaged", 4.0)])
def test_a_hand_lost_in_a_grasp_ends_it(mood, at_s):
    options = [*EMULATED, f"gripper.faults.mood={mood}", f"gripper.faults.mood_at_s={at_s}"]
    trial = load_pipeline("franka", options=options).grasp()
    assert trial.outcome.words == "device lost"
    # The trace begins with the approach, after a quarter of a second in which the hand may not have moved yet.
    assert 15 * (at_s - 0.8) <= len(trial.trace) <= 15 * at_s


@every_case(
    ("fault", "error", "said"),
    [({"mood": "old"}, NoDevice, "version"), ({"unplug_at_s": 0.3}, DeviceLost, "emulated")],
)
def test_another_version_is_no_device_and_a_lost_hand_is_told_with_its_address(fault, error, said):
    with pytest.raises(error, match=said):
        _driven(_opened(faults=fault), Command(POSITION, 0.0, 40.0, 0.05))


def test_without_pylibfranka_the_user_is_told_what_to_install(monkeypatch):
    monkeypatch.setattr(link.importlib.util, "find_spec", lambda name: None)
    with pytest.raises(PluginUnavailable, match="pip install pylibfranka"):
        _opened(host="127.0.0.1")
    [finding] = diagnose(FrankaConfig(host="127.0.0.1"), 1.0)
    assert finding.state == "problem"
    assert "pip install pylibfranka" in finding.advice
    [finding] = diagnose(None, 1.0)
    assert finding.state == "note"
    assert "gripper.host=" in finding.advice, "how a hand is asked"


def test_the_hand_answers_each_command_as_libfranka_expects():
    hand = FrankaHand(FrankaConfig(host="emulated"), 1)
    grasp = (0.0, 1.0, 1.0, 0.05, 40.0)
    hand.look(0.1)
    hand.ask(HandRequest(GRASP, 1, grasp), 0.1)
    hand.ask(HandRequest(MOVE, 2, (0.07, 0.05)), 0.2)
    assert hand.ended() == [(HandRequest(GRASP, 1, grasp), ABORTED)]
    hand.look(2.0)
    assert [status for _, status in hand.ended()] == [SUCCESS]
    hand.ask(HandRequest(MOVE, 3, (0.2, 0.05)), 2.0)
    assert [status for _, status in hand.ended()] == [FAILED]
    hand.ask(HandRequest(GRASP, 4, grasp), 2.1)
    hand.look(6.0)
    assert [status for _, status in hand.ended()] == [SUCCESS]
    assert hand.grasped
    assert hand.pressing
    hand.ask(HandRequest(STOP, 5, ()), 6.0)
    assert not hand.pressing
    hand.fingers.close()


REQUESTS = st.one_of(
    st.tuples(st.just(CONNECT), st.integers(0, 0xFFFF), st.integers(0, 0xFFFF)),
    st.tuples(st.just(MOVE), *(2 * [st.floats(allow_nan=False)])),
    st.tuples(st.just(GRASP), *(5 * [st.floats(allow_nan=False)])),
    st.tuples(st.just(STOP)),
)


@given(st.lists(REQUESTS, max_size=5), st.integers(1, 20))
def test_requests_in_any_pieces_are_taken(sent, size):
    data = b"".join(request_bytes(command, k, *values) for k, (command, *values) in enumerate(sent))
    requests = HandRequests()
    pieces = (data[start : start + size] for start in range(0, len(data), size))
    taken = [request for piece in pieces for request in requests.fed(piece)]
    assert taken == [HandRequest(command, k, tuple(values)) for k, (command, *values) in enumerate(sent)]


@given(st.binary(max_size=200))
def test_any_bytes_are_requests_or_refused(data):
    with suppress(NotARequest):
        for request in HandRequests().fed(data):
            assert request.command <= STOP


NEWTONS = st.floats(1.0, 100.0)
READINGS = st.lists(
    st.tuples(NEWTONS, NEWTONS), min_size=2, max_size=8, unique_by=lambda pair: round(pair[0], 5)
)


@given(READINGS, st.floats(0.0, 150.0))
@example([(50.0, 0.5), (99.99999999999999, 1.0), (100.0, 4.0)], 3.0)
def test_the_force_to_ask_for_never_delivers_more_than_is_wanted(readings, wanted_n):
    table = load_table(readings)
    asked_n = asked_force(table, wanted_n)
    assert asked_n >= 0.0
    if wanted_n >= table.load_n[1] and len(set(table.load_n)) > 2:
        assert load_of(table, asked_n)[0] <= wanted_n * (1.0 + 1e-6) or asked_n == table.pad_n[1]


def _calibrated(tmp_path, rows):
    """Run the calibration with these rows of readings."""
    readings = tmp_path / "readings.csv"
    readings.write_text(f"asked_n,delivered_n\n{rows}\n")
    (tmp_path / "kept").mkdir(mode=0o700)
    options = ("-o", "gripper.host=emulated", "-o", f"gripper.calibration={tmp_path}/kept", "--json")
    return graspsense("calibrate", "delivered-force", readings, "--gripper", "franka", *options)


def test_delivered_force_is_stored_and_used(tmp_path):
    data = _calibrated(tmp_path, "20,30\n40,50\n60,70\n60,74").json["data"]
    assert data == {"asked_n": [0.0, 20.0, 40.0, 60.0], "delivered_n": [0.0, 30.0, 50.0, 72.0]}

    driver = _opened(calibration=f"{tmp_path}/kept")
    # 50 N are wanted: 40 N are asked for.
    driver.apply(Command(POSITION, 0.0, 50.0, 0.05))
    assert driver._asked.force_n == pytest.approx(40.0)
    driver.close()


def test_damaged_readings_are_refused_with_their_line(tmp_path):
    done = _calibrated(tmp_path, "20,30\n40,")
    assert done.returncode == DataDamaged.exit_code
    assert ":3:" in done.stderr


def test_a_table_that_stays_level_is_read():
    assert asked_force(LoadTable((0.0, 10.0, 20.0, 40.0), (0.0, 30.0, 30.0, 50.0)), 40.0) == 30.0
