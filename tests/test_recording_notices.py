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
