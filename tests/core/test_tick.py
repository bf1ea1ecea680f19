"""One tick as a pure function: the phases a grasp goes through, and when."""

from math import inf

import pytest

from graspsense.core.control.binding import bind
from graspsense.core.control.guard import GuardParams
from graspsense.core.control.tick import Schedule, TickParams, first_state, tick
from graspsense.core.values.signals import (
    APPROACH,
    EFFORT,
    HOLD,
    RUNNING,
    SQUEEZE,
    STEADY,
    Command,
    Frame,
    Pads,
    Phase,
    Reading,
)
from graspsense.plugins.controllers.supervision import LawState

OPENING = Command(EFFORT, -20.0, inf, inf)
RELAXED = Command(EFFORT, 0.0, inf, inf)
CLOSING = Command(EFFORT, 9.0, inf, inf)
LIMITS = GuardParams(100.0, 0.2, inf, inf, 0.625)


FAILED = STEADY + 3


def law_that_ends_at(t_end, outcome=STEADY):
    """A law that approaches, squeezes from 1 s on, and ends with `outcome` at `t_end`."""

    def step(params, state, reading):
        t_s = reading.frame.t_s
        phase, ended = (SQUEEZE if t_s >= 1.0 else APPROACH), RUNNING
        if t_s >= t_end:
            phase, ended = HOLD, outcome
        return CLOSING, LawState(phase, ended, None, 0.0)

    return step


def walk(
    gap_of,
    ticks=5000,
    t_end=1.5,
    outcome=STEADY,
    opens=1,
    tare_images=3,
    hold_s=0.25,
    timeout_s=5.0,
    releases=1,
):
    """Run so many ticks of 1 ms with a law that ends; return (t, phase, command value) of each and the last state."""
    schedule = Schedule(opens, OPENING, RELAXED, tare_images, hold_s, timeout_s, releases)
    state = first_state(LawState(APPROACH, RUNNING, None, 0.0))
    bound, seen = bind(tick, step=law_that_ends_at(t_end, outcome)), []
    for k in range(ticks):
        t = k * 0.001
        frame = Frame(t, 0.001, gap_of(t), *[0.0] * 6, 0)
        reading = Reading(frame, Pads(t, 1 + k // 41, (), ()))
        command, state = bound(TickParams(schedule, LIMITS, ()), state, reading)
        seen.append((t, state.phase, command.value))
        if state.done:
            break
    return seen, state


def still(t):
    return 0.05


def first_of(seen, phase):
    return next(t for t, p, _ in seen if p == phase)


def test_opened_means_slower_than_1_mm_s_for_a_tenth_of_a_second():
    # Opens at 2 mm/s until 0.3 s, then creeps at 0.5 mm/s: that counts as open.
    creeping, _ = walk(lambda t: 0.05 + 0.002 * min(t, 0.3) + 0.0005 * max(t - 0.3, 0.0), 600, 9.0)
    assert first_of(creeping, Phase.TARING) == pytest.approx(0.4, abs=0.06)
    assert {value for _, p, value in creeping if p == Phase.OPENING} == {-20.0}
    # Fingers that go on opening faster than that are not open, until the time is over.
    seen, state = walk(lambda t: 0.02 + 0.0015 * t, 600, 9.0)
    assert {p for _, p, _ in seen} == {Phase.OPENING} == {state.phase}
    seen, _ = walk(lambda t: 0.02 + 0.02 * t, 1200, 9.0, timeout_s=1.0)
    assert first_of(seen, Phase.TARING) == pytest.approx(1.0, abs=0.0011)


def test_the_taring_waits_for_its_images_relaxed():
    seen, _ = walk(still, 400, 9.0)
    assert first_of(seen, Phase.TARING) == pytest.approx(0.1, abs=0.0011)
    # Three images from the one that was there: at 123, 164, 205 ms.
    assert first_of(seen, Phase.APPROACH) == pytest.approx(0.205, abs=0.0011)
    # The tick that finds the fingers open still opens them; from then on they are relaxed.
    values = [value for _, p, value in seen if p == Phase.TARING]
    assert (values[0], set(values[1:])) == (-20.0, {0.0})
    # No images wanted, no waiting.
    seen, _ = walk(still, 400, 9.0, tare_images=0)
    assert first_of(seen, Phase.APPROACH) - first_of(seen, Phase.TARING) == pytest.approx(0.001)


def test_where_no_release_is_needed_a_held_grasp_ends_with_its_first_tick_and_any_other_is_released():
    held, state = walk(still, releases=0)
    assert state.done == 1
    assert [phase for _, phase, _ in held[-2:]] == [Phase.HOLD, Phase.RELEASE]
    assert held == walk(still)[0][: len(held)]
    assert walk(still, outcome=FAILED, releases=0)[0] == walk(still, outcome=FAILED)[0]
    # Without a tick of the phase HOLD nothing was held.
    assert walk(still, hold_s=0.0, releases=0) == walk(still, hold_s=0.0)


def test_without_a_controller_it_says_so():
    params = TickParams(Schedule(0, OPENING, RELAXED, 0, 0.0, 1.0), LIMITS, ())
    state = first_state(LawState(APPROACH, RUNNING, None, 0.0))
    reading = Reading(Frame(0.0, 0.001, 0.05, *[0.0] * 6, 0), Pads(0.0, 0, (), ()))
    with pytest.raises(TypeError, match="no controller"):
        tick(params, state, reading)
