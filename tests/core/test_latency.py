"""The time from a command to the first motion and to the first force, as `doctor --latency` measures it."""

from collections import deque

import pytest
from attrs import evolve
from cases import every_case
from commands import answered, graspsense

from graspsense.core.components.run_config import RunConfig
from graspsense.core.grasp.calibrating import CalibrationFailed
from graspsense.core.grasp.latency import latency_findings, measured_latency
from graspsense.plugin_api import (
    EFFORT,
    NO_PADS,
    VELOCITY,
    Channel,
    Command,
    Frame,
    Reading,
    SensorBackend,
)
from graspsense.testing.samples import a_trial

RATE_HZ = 200.0
FRICTION_N = 5.0


class DelayedGripper(SensorBackend[None]):
    """Fingers that act on a command after so many frames, on a block of 40 mm."""

    accepts = ("effort", "velocity")
    channels = (Channel("gap", "m", RATE_HZ), Channel("effort", "N", RATE_HZ))

    def __init__(self, delay, block_m=0.04, declared_s=0.0):
        super().__init__(None)
        self.command_delay_s = declared_s
        self._waiting = deque([Command(EFFORT, 0.0, 0.0, 0.0)] * delay)
        self._block_m, self._gap_m, self._effort_n, self._ticks = block_m, 0.08, 0.0, 0
        self.largest_n = 0.0

    def open(self, seed):
        commands = {
            "opening": Command(VELOCITY, 0.05, 20.0, 0.05),
            "relaxed": Command(VELOCITY, 0.0, 20.0, 0.2),
        }
        return evolve(a_trial().device, rate_hz=RATE_HZ, **commands)

    def apply(self, command):
        self._waiting.append(command)
        kind, value, effort_limit_n, speed_m_s = self._waiting.popleft()
        if kind == VELOCITY:
            pushed_n, rate = effort_limit_n if value else 0.0, value
        else:
            pushed_n, rate = value, -speed_m_s
        self.largest_n = max(self.largest_n, pushed_n)
        self._effort_n = pushed_n if rate < 0.0 else 0.0
        if pushed_n > FRICTION_N:
            self._gap_m = min(max(self._gap_m + rate / RATE_HZ, self._block_m), 0.08)

    def read(self, timeout_s):
        self._ticks += 1
        return Reading(Frame(self._ticks / RATE_HZ, 1 / RATE_HZ, self._gap_m, 0.0, self._effort_n), NO_PADS)

    def close(self):
        pass


@every_case("delay", [0, 3, 17])
def test_a_known_delay_is_measured_to_a_frame(delay):
    gripper = DelayedGripper(delay)
    measured = measured_latency(gripper, gripper.accepts, gripper.open(0), RunConfig(), 3)
    # The frame in which the effect is seen is the next after the command acts.
    expected_s = [(delay + 1) / RATE_HZ] * 3
    assert measured.motion_s == pytest.approx(expected_s)
    assert measured.force_s == pytest.approx(expected_s)
    assert gripper.largest_n <= 20.0


def test_a_delay_longer_than_declared_is_a_problem():
    states = {}
    for declared_s in (0.0, 0.1, 0.02):
        gripper = DelayedGripper(8, declared_s=declared_s)
        motion, force = latency_findings(gripper, gripper.accepts, gripper.open(0), RunConfig(), 1)
        states[declared_s] = motion.state, force.state
    assert states == {0.0: ("ok", "ok"), 0.1: ("ok", "ok"), 0.02: ("ok", "problem")}


def test_without_a_block_or_enough_force_it_is_said_why_there_is_none():
    gripper = DelayedGripper(2, block_m=0.0)
    measured = measured_latency(gripper, gripper.accepts, gripper.open(0), RunConfig(), 2)
    assert len(measured.motion_s) == 2
    assert not measured.force_s
    assert "block" in measured.no_force
    gripper = DelayedGripper(2)
    with pytest.raises(CalibrationFailed, match="first_effort_n"):
        measured_latency(gripper, gripper.accepts, gripper.open(0), RunConfig(first_effort_n=4.0), 1)


@pytest.mark.slow
def test_doctor_measures_any_gripper_and_needs_its_name():
    told = answered("doctor", "--gripper", "sim", "--latency", "2")
    [diagnosis] = [row for row in told["diagnoses"] if row["distribution"] == "graspsense-sim-gripper/sim"]
    motion, force = diagnosis["findings"]
    # The simulated fingers need some ms to get going against their friction.
    assert 0.001 < motion["numbers"]["median_s"] < 0.1
    assert force["subject"] == "command to first force"
    assert graspsense("doctor", "--latency").returncode == 2
