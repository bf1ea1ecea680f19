"""The guard: nothing leaves it that is over a limit or no number."""

import math
from math import inf, nan

import pytest
from cases import every_case
from hypothesis import given
from hypothesis import strategies as st

from graspsense.core.control.guard import GuardParams, GuardState, guard
from graspsense.core.values.signals import EFFORT, FORCE, POSITION, VELOCITY, Command, Frame

LIMITS = GuardParams(100.0, 0.2, inf, inf, 0.625)
FRESH = GuardState(0, 0, 0)
REAL = GuardParams(100.0, 0.2, 12.0, 0.015, 0.625)


def frame(velocity=0.0, left=0.0, right=0.0):
    return Frame(0.0, 0.001, 0.05, velocity, 0.0, left, right, 0.0, 0.0, 0)


@every_case(
    ("asked", "value"),
    [
        *((Command(EFFORT, n, inf, inf), v) for n, v in ((150.0, 100.0), (-150.0, -100.0), (99.0, 99.0))),
        (Command(EFFORT, inf, inf, inf), 100.0),
        # The command's own limit is tighter; one of nothing is a limit and no mistake.
        (Command(EFFORT, 50.0, 10.0, inf), 10.0),
        (Command(EFFORT, 5.0, 0.0, 0.0), 0.0),
        (Command(VELOCITY, -1.0, inf, inf), -0.2),
        (Command(FORCE, 500.0, inf, inf), 100.0),
        (Command(FORCE, -5.0, inf, inf), 0.0),
        (Command(POSITION, -0.01, inf, inf), 0.0),
    ],
)
def test_a_command_is_held_to_the_limit_that_bounds_it(asked, value):
    command, state = guard(LIMITS, FRESH, frame(), asked)
    assert (command.value, state.stopped) == (value, 0)
    assert state.acted == (asked.value != value)


@every_case(
    ("effort", "velocity", "expected"),
    [
        *((20.0, -0.21, 0.0), (20.0, -0.19, 20.0), (-20.0, 0.21, 0.0), (-20.0, -0.3, -20.0)),
        *((20.0, 0.3, 20.0), (0.05, -0.3, 0.0), (-0.05, 0.3, 0.0)),
    ],
)
def test_effort_that_would_drive_past_the_speed_limit_is_taken_away(effort, velocity, expected):
    # Braking stays allowed: only effort in the direction of the motion is cut.
    command, _ = guard(LIMITS, FRESH, frame(velocity), Command(EFFORT, effort, inf, inf))
    assert command.value == expected


@pytest.mark.parametrize(
    "command",
    [
        *(Command(EFFORT, nan, inf, inf), Command(EFFORT, 1.0, nan, inf), Command(VELOCITY, 0.1, inf, nan)),
        Command(EFFORT, 5.0, -1.0, inf),  # a limit below zero
        Command(7, 1.0, inf, inf),  # a kind that nobody knows
        Command(POSITION, inf, inf, inf),  # a place that nobody can reach
    ],
)
def test_a_command_that_makes_no_sense_stops_the_grasp_for_good(command):
    halted, state = guard(LIMITS, FRESH, frame(), command)
    assert (halted.kind, halted.value, state.stopped) == (EFFORT, 0.0, 1)
    later, state = guard(LIMITS, state, frame(), Command(EFFORT, 20.0, inf, inf))
    assert (later.value, state.stopped) == (0.0, 1)


def test_a_real_gripper_is_weak_and_slow_until_a_pad_has_felt_something():
    strong = Command(EFFORT, 80.0, inf, inf)
    command, state = guard(REAL, FRESH, frame(), strong)
    assert (command.value, state.contact_seen) == (12.0, 0)
    assert guard(REAL, state, frame(velocity=-0.016), strong)[0].value == 0.0
    # Exactly the contact force counts, on either pad.
    for touch in (frame(left=0.625), frame(right=0.625)):
        command, felt = guard(REAL, state, touch, strong)
        assert (command.value, felt.contact_seen) == (80.0, 1)
        # Once seen, it stays seen.
        assert guard(REAL, felt, frame(), strong)[0].value == 80.0


numbers = st.floats(allow_nan=True, allow_infinity=True)


@given(st.sampled_from([EFFORT, VELOCITY, POSITION, FORCE]), numbers, numbers, numbers, numbers, numbers)
def test_whatever_is_asked_nothing_leaves_over_a_limit_or_not_a_number(kind, value, effort, speed, v, left):
    command, state = guard(REAL, FRESH, frame(v, left), Command(kind, value, effort, speed))
    assert not math.isnan(command.value)
    felt = left >= REAL.contact_force_n
    if command.kind in (EFFORT, FORCE):
        assert abs(command.value) <= (100.0 if felt else REAL.first_effort_n)
    if command.kind == VELOCITY:
        assert abs(command.value) <= (0.2 if felt else REAL.first_speed_m_s)
    assert state.contact_seen == felt


@every_case(
    ("command", "counts"),
    [
        (Command(VELOCITY, -0.01, 60.0, inf), True),
        (Command(VELOCITY, -0.01, 12.0, inf), False),
        (Command(VELOCITY, -0.01, inf, inf), False),  # it leaves the limit to the gripper
        (Command(POSITION, 0.0, 60.0, inf), True),
        (Command(POSITION, 0.0, 10.0, 0.1), True),
        (Command(POSITION, 0.0, 10.0, 0.01), False),
        (Command(FORCE, 10.0, inf, 0.1), True),
    ],
)
def test_a_limit_that_is_lowered_counts_as_a_value_that_is(command, counts):
    allowed, state = guard(REAL, FRESH, frame(), command)
    assert state.acted == counts
    assert allowed.effort_limit_n <= 12.0
    assert allowed.speed_limit_m_s <= 0.015
    _, state = guard(REAL, state, frame(left=0.7), command)
    assert state.acted == counts  # after a contact, the limits of the gripper are above all of these
