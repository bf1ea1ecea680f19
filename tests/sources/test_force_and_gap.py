"""Whether force and gap of a recording belong together: by the moments at which the fingers change their speed."""

from typing import Any

import numpy as np
from cases import every_case

from graspsense.sources.columns.force_and_gap import doubtful_delay
from graspsense.sources.manifest.turns import apart

T_S = np.arange(0.0, 2.5, 0.01)


def grasp(seed: int, shown_later_s: float) -> tuple[Any, Any, Any]:
    """Fingers at 30 mm/s that meet an object at 1 s; its force has times that are too late by `shown_later_s`."""
    rng = np.random.default_rng(seed)
    constant_s = rng.uniform(0.07, 0.15)

    def pressed(t_s: Any) -> Any:
        return np.where(t_s > 1.0, 1.0 - np.exp(-(t_s - 1.0) / constant_s), 0.0)

    gap = 0.08 - 0.03 * np.minimum(T_S, 1.0) - 0.0015 * pressed(T_S) + rng.normal(0.0, 2e-6, len(T_S))
    force = rng.uniform(2.0, 20.0) * pressed(T_S - shown_later_s) + rng.normal(0.0, 0.01, len(T_S))
    return T_S, gap, force


@every_case("later_s", [0.03, 0.045, -0.03, -0.045])
def test_a_clock_that_is_off_is_told_and_a_topic_that_is_slow_is_not(later_s: float) -> None:
    for seed in range(20):
        assert not doubtful_delay(*grasp(seed, 0.0), later_s)
        assert doubtful_delay(*grasp(seed, -later_s), later_s)


def test_without_a_moment_at_which_the_fingers_slow_down_it_is_left_open() -> None:
    t_s, gap, force = grasp(0, 0.0)
    assert doubtful_delay(t_s, 0.08 - 0.02 * t_s, force, 0.03)
    assert doubtful_delay(t_s, gap, np.repeat(force[::4], 4)[: len(t_s)], 0.03)  # 25 Hz
    assert doubtful_delay(t_s, gap, np.full(len(t_s), np.nan), 0.03)
    assert not doubtful_delay(t_s, 0.08 - 0.02 * t_s, force, 0.01)


def squeezed(rate_hz: float, stiffness: Any) -> tuple[Any, Any, Any]:
    """Fingers at 20 mm/s that stop 4 mm after the contact, and open later at once, with some noise."""
    t_s = np.arange(0.0, 4.0, 1.0 / rate_hz)
    gap = np.interp(t_s, [0.0, 1.0, 1.2, 3.0, 4.0], [0.07, 0.05, 0.046, 0.046, 0.086])
    rng = np.random.default_rng(7)
    force = stiffness(np.maximum(0.05 - gap, 0.0)) + rng.normal(0.0, 0.005, len(t_s))
    return t_s, gap + rng.normal(0.0, 1e-6, len(t_s)), force


def smoothed(t_s: Any, signal: Any, seconds: float = 0.3) -> Any:
    """Return the mean of a signal over a time before and after each sample."""
    half = round(0.5 * seconds / t_s[1])
    return np.convolve(
        np.pad(signal, half, mode="edge"), np.full(2 * half + 1, 1.0 / (2 * half + 1)), "valid"
    )


@every_case("rate_hz", [50.0, 200.0, 1000.0])
@every_case("stiffness", ["hardens", "linear"])
def test_a_signal_that_is_smooth_where_the_other_one_turns_is_told(rate_hz: float, stiffness: Any) -> None:
    stiffness = {"hardens": lambda x: 3e5 * x**2, "linear": lambda x: 1500.0 * x}[stiffness]
    t_s, gap, force = squeezed(rate_hz, stiffness)
    assert not [*apart(t_s, gap, force)]
    for changed in (
        smoothed(t_s, force),
        np.interp(t_s - 0.12, t_s, force),
        np.interp(t_s + 0.12, t_s, force),
    ):
        (told,) = apart(t_s, gap, changed)
        assert "force smoothed" in told
    (told,) = apart(t_s, smoothed(t_s, gap), force)
    assert "gap smoothed" in told


def test_rare_values_a_faster_drive_and_a_recording_without_a_clock_tell_of_no_turn() -> None:
    t_s, gap, force = squeezed(200.0, lambda x: 1500.0 * x)
    assert not [*apart(t_s, gap, np.repeat(force[::8], 8)[: len(t_s)])]  # 25 Hz
    faster = np.interp(t_s, [0.0, 1.0, 1.1, 1.2, 4.0], [0.07, 0.05, 0.0495, 0.046, 0.046])
    assert not [*apart(t_s, faster, smoothed(t_s, np.maximum(1500.0 * (0.05 - faster), 0.0), 0.02))]
    assert not [*apart(np.zeros(len(t_s)), gap, force)]
    assert not [*apart(t_s[:5], gap[:5], force[:5])]
