"""What looks wrong with the frames of an episode, each with the option that mends it, and when its grasp begins."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Final

import numpy as np
from numpy.typing import NDArray

from graspsense.plugin_api import GraspColumns
from graspsense_lerobot.folder import Episode
from graspsense_lerobot.names import TOUCH
from graspsense_lerobot.understood import Understood, some, times_of

OTHER_RATE: Final = 0.02
"""Share by which the time between frames may differ from that of `fps` before it is told."""
LONG_STEP: Final = 1.5
"""Frames that a step of time has to last to be a gap."""
MANY_REPEATED: Final = 0.2
"""Share of the frames from which on repeated ones are told."""
TOUCHED: Final = 0.2
"""Share of the range of the force above which an object is touched, as for the squeezes of a manifest."""


def _observations(episode: Episode) -> NDArray[np.float64]:
    """Return the numbers of all observations, a row for each frame."""
    named = episode.table.numbers.items()
    return np.column_stack(
        [values.reshape(len(values), -1) for key, values in named if key.startswith("obs")]
    )


def repeated_frames(understood: Understood, episode: Episode) -> NDArray[np.bool_]:
    """Return which frames are equal to the one before in all observations, or have its time."""
    rows, times = _observations(episode), times_of(understood, episode)
    same: NDArray[np.bool_] = (rows[1:] == rows[:-1]).all(axis=1) | (np.diff(times) == 0.0)
    return np.concatenate(([False], same))


def notices_of(understood: Understood, episode: Episode) -> Iterator[str]:
    """Yield what looks wrong with the frames of an episode, with the option that mends it."""
    times, options = times_of(understood, episode), understood.options
    fps = options.fps or understood.folder.fps
    if understood.gap_unit:
        yield understood.notes[0]
    unread = [name for name in understood.meaning.others if TOUCH.search(name)]
    if unread:
        yield (
            f"{len(unread)} numbers sound like touch and are not used: {some(unread)}. Names such as f0.p00.fx "
            "(finger, cell, axis) are understood"
        )
    steps = np.diff(times)
    if len(steps) and not options.fps:
        step_s = float(np.median(steps))
        if step_s > 0.0 and abs(step_s * fps - 1.0) > OTHER_RATE:
            yield (
                f"the frames are {step_s:.4g} s apart, and fps = {fps:g} says {1 / fps:.4g} s. If the times are wrong: "
                f"?fps={fps:g}"
            )
            fps = 1.0 / step_s
    long = steps > LONG_STEP / fps
    if long.any():
        yield (
            f"{int(long.sum())} gaps between frames, the longest of {float(steps.max()):.3g} s: ?gaps=cut divides the "
            "episode there"
        )
    repeated = repeated_frames(understood, episode)
    if options.repeated == "keep" and repeated.sum() > MANY_REPEATED * len(times):
        yield (
            f"{int(repeated.sum())} of {len(times)} frames repeat the one before, as of a sensor slower than the "
            "frames: ?repeated=drop leaves them out"
        )
    missing = int((~np.isfinite(_observations(episode))).any(axis=1).sum())
    if missing:
        yield f"{missing} frames have an observation without a number: left out where gap or force is missing"


def moments_of(columns: GraspColumns) -> str:
    """Return when the gripper begins to close and when it touches, in words."""
    columns = columns.rows(np.isfinite(columns.force_n) & np.isfinite(columns.gap_m))
    force, gap = columns.force_n, columns.gap_m
    if not len(force) or float(np.ptp(force)) == 0.0:
        return "no contact is found in the force"
    contact = int((force > force.min() + TOUCHED * np.ptp(force)).argmax())
    free = gap[: contact + 1]
    closing = int(np.flatnonzero(free >= free.max() - 0.02 * np.ptp(gap))[-1])
    return (
        f"closing from {columns.t_s[closing]:.3f} s of the episode, contact at {columns.t_s[contact]:.3f} s"
    )


def notices_of_gap(columns: GraspColumns) -> Iterator[str]:
    """Yield that the gap of a squeeze stays, or grows while the force rises."""
    force, gap = np.nan_to_num(columns.force_n), columns.gap_m
    span = float(np.ptp(gap))
    if span == 0.0:
        yield "the number of the gap stays the same: if the fingers moved, ?gap=NAME chooses another one"
    elif gap[int(force.argmax())] > gap[0] + 0.3 * span:
        yield "the number of the gap grows while the force rises: if it is closed there, ?gap_m_per_unit=-0.001"
