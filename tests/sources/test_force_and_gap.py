"""Whether a slow topic is told from a clock that is off, by the moment at which the fingers slow down."""

from typing import Any

import numpy as np
from cases import every_case

from graspsense.sources.columns.force_and_gap import doubtful_delay

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
