"""What is noticed in the forces of a recording, whatever it was read from."""

from __future__ import annotations

from math import nan
from typing import Any

import numpy as np
from cases import every_case

from graspsense.core.values.signals import NO_PADS, Frame, Reading
from graspsense.recording.labelled_recording import LabelledRecording
from graspsense.recording.replayable import Recording
from graspsense.sources.recording_notices import with_notices

T_S = np.arange(300) * 0.01
LOAD_N = np.clip(T_S - 1.0, 0.0, 1.0) * 6.0
NOISE_N = np.random.default_rng(0).normal(0.0, 0.01, (2, len(T_S)))


def noticed(left: Any, right: Any) -> tuple[str, ...]:
    readings = tuple(
        Reading(Frame(float(t), 0.01, 0.05, 0.0, nan, float(a), float(b), nan, nan, 0), NO_PADS)
        for t, a, b in zip(T_S, left, right, strict=True)
    )
    recording = Recording(name="squeeze", readings=readings, rate_hz=100.0)
    return with_notices(LabelledRecording(recording=recording, source="squeeze")).notices


LEFT, RIGHT = LOAD_N + NOISE_N


@every_case("side", ["left", "right", "both"])
@every_case(
    ("spoilt", "says"),
    [
        (np.full(300, 4.5), "does not change"),
        (np.full(300, nan), "has no number"),
        (LEFT[np.minimum(np.arange(300), 120)], "repeats its last value"),
        # Reports that stop while the force grows, and go on a second later: 100 rows of one value.
        (
            LEFT[np.where((T_S >= 1.5) & (T_S < 2.5), 150, np.arange(300))],
            "repeats one value from 1.5 to 2.49 s",
        ),
        # The end of the range of a sensor, at half of the force, until the fingers open.
        (np.where(T_S < 2.8, np.minimum(LEFT, 3.0), NOISE_N[0]), "or is it at the end of its range"),
    ],
)
def test_a_sensor_that_says_nothing_is_noticed(spoilt: Any, says: str, side: str) -> None:
    (notice,) = noticed(
        spoilt if side in ("left", "both") else LEFT, spoilt if side in ("right", "both") else RIGHT
    )
    assert says in notice
    assert (side in notice) == (side != "both")


def test_healthy_forces_give_no_notice() -> None:
    assert noticed(LEFT, RIGHT) == ()
    # Without noise, or in coarse counts, a force repeats itself at rest.
    assert noticed(LOAD_N, LOAD_N) == ()
    assert noticed(np.round(LEFT * 4) / 4, np.round(RIGHT * 4) / 4) == ()
    released = np.where(T_S < 2.5, LOAD_N, 0.0)
    assert noticed(released, released) == ()
    # Noise of one count makes steps of one count, and a force at rest can stay within its count.
    few = np.round(LEFT * 50) / 50
    few[200:280] = few[200]
    assert noticed(few, few) == ()
    # A sensor that is read at every fifth row repeats each value four times.
    held = np.arange(300) // 5 * 5
    assert noticed(LEFT[held], RIGHT[held]) == ()
