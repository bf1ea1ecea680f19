"""A gripper that has to be asked for each frame: when it is asked, and what its frames say."""

from math import inf, nan

import pytest
from cases import every_case
from hypothesis import given
from hypothesis import strategies as st

from graspsense.gripper_api import Polling, finger_target
from graspsense.plugin_api import EFFORT, FORCE, POSITION, VELOCITY, Command

PERIOD_S = 0.01


@every_case(
    ("command", "target"),
    [
        ((POSITION, 0.03, 20.0, 0.02), (0.03, 0.02, 20.0)),
        ((POSITION, inf, 20.0, 0.02), (0.08, 0.02, 20.0)),
        ((POSITION, -inf, 20.0, 0.02), (0.0, 0.02, 20.0)),
        ((VELOCITY, -inf, 20.0, 0.02), (0.0, 0.02, 20.0)),
        ((VELOCITY, 0.01, 20.0, 0.02), (0.08, 0.01, 20.0)),
        ((FORCE, inf, 20.0, inf), (0.0, 0.05, 20.0)),
        # It stops where it is, and a number that is none never becomes a force or a speed.
        ((EFFORT, 5.0, 20.0, 0.02), (0.06, 0.0, 20.0)),
        *(((kind, nan, 20.0, 0.02), (0.06, 0.0, 0.0)) for kind in (POSITION, VELOCITY, FORCE, EFFORT)),
        *(((kind, 0.01, nan, 0.02), (0.06, 0.0, 0.0)) for kind in (POSITION, VELOCITY, FORCE, EFFORT)),
        *(((kind, 0.01, 20.0, nan), (0.06, 0.0, 0.0)) for kind in (POSITION, VELOCITY, FORCE, EFFORT)),
    ],
)
def test_fingers_stop_at_a_command_that_is_no_number(command, target):
    assert finger_target(Command(*command), 0.06, 0.08, 0.05) == target


class OwnTime:
    """A clock that passes while somebody sleeps."""

    now_s = 0.0

    def monotonic(self):
        return self.now_s

    def sleep(self, seconds):
        self.now_s += seconds


@pytest.fixture
def clock():
    return OwnTime()


@given(st.lists(st.floats(0.0, 0.009), min_size=2, max_size=50))
def test_the_duration_of_an_exchange_does_not_lower_the_rate(exchanges_s):
    clock = OwnTime()
    polling, asked_s = Polling(1.0 / PERIOD_S, clock), []
    for exchange_s in exchanges_s:
        assert polling.wait(1.0)
        asked_s.append(clock.now_s)
        clock.sleep(exchange_s)
        polling.frame(0.05)
    assert asked_s == pytest.approx([k * PERIOD_S for k in range(len(exchanges_s))])
    longest_s = pytest.approx(max(exchanges_s))
    assert polling.report() == {"frames": len(exchanges_s), "repeated": 0, "frame_uncertainty_s": longest_s}


def test_lost_time_is_not_made_up(clock):
    polling = Polling(1.0 / PERIOD_S, clock)
    polling.wait(1.0)
    clock.sleep(0.095)
    polling.frame(0.05)
    asked_s = [clock.now_s for _ in range(4) if polling.wait(1.0)]
    assert asked_s == pytest.approx([0.095, 0.095, 0.105, 0.115])


def test_a_wait_that_is_too_long_ends_at_its_time(clock):
    polling = Polling(1.0 / PERIOD_S, clock)
    ended = [(polling.wait(timeout_s), clock.now_s) for timeout_s in (0.0, 0.004, 0.1)]
    assert ended == [(True, 0.0), (False, pytest.approx(0.004)), (True, pytest.approx(PERIOD_S))]


@every_case("speed_m_s", [-0.02, 0.0, 0.05])
def test_the_rate_of_the_gap_is_that_of_the_newest_frames(speed_m_s):
    clock, frames = OwnTime(), []
    polling = Polling(1.0 / PERIOD_S, clock)
    for tick in range(30):
        polling.wait(1.0)
        clock.sleep(0.001 * (tick % 3))
        # The fingers turn after ten frames: what was before them is forgotten.
        gap_m = 0.05 + (speed_m_s if tick > 10 else -0.1) * clock.now_s
        frames.append(polling.frame(gap_m, 3.0, 4))
    last = frames[-1]
    assert (frames[0].velocity_m_s, last.velocity_m_s) == (0.0, pytest.approx(speed_m_s, abs=1e-9))
    assert last.t_s - frames[-2].t_s == pytest.approx(last.dt_s)
    assert (last.effort_n, last.status) == (3.0, 4)


@every_case("failures", [0, 1, 2, 3])
def test_an_exchange_is_repeated_twice_and_after_another_error_not(failures):
    polling, answers = Polling(1.0 / PERIOD_S, OwnTime()), [TimeoutError()] * failures + ["reply"]

    def exchange():
        answer = answers.pop(0)
        if isinstance(answer, str):
            return answer
        raise answer

    if failures < 3:
        assert polling.tried(exchange, TimeoutError) == "reply"
    else:
        with pytest.raises(TimeoutError):
            polling.tried(exchange, TimeoutError)
    with pytest.raises(ZeroDivisionError):
        polling.tried(lambda: 1 // 0, TimeoutError)
    assert polling.repeated == min(failures, 2)
