"""Reader of the iCub Grasp Dataset, and its mapping onto two fingers.

Source: Harold Soh, Yanyu Su and Yiannis Demiris, "Online Spatio-Temporal Gaussian Process Experts with
Application to Tactile Classification", IEEE/RSJ IROS 2012; https://github.com/clear-nus/icub_grasp_dataset,
copyright 2012 Harold Soh. Each file is one grasp. After a first line `-10000`, each frame has seven lines: the
nine encoder values of the hand (degrees), five maxima of `255 - reading`, and the twelve taxels of each fingertip, from
the thumb to the little finger (8 bits, lower is more pressure). There are no time stamps.

The encoders are joints 7 to 15 of an iCub arm: 7 spreads the fingers, 8 opposes the thumb, 9 and 10 are the
thumb's proximal and distal flexion, 11 and 12 the index finger's, 13 and 14 the middle finger's, 15 closes
ring and little finger together (https://icub-tech-iit.github.io/documentation, page "iCub Joints").

`recording_of` maps them onto a gripper with two fingers; docs/icub.md explains its numbers.
"""

from __future__ import annotations

import os
from pathlib import Path
from typing import Final

import numpy as np
from attrs import frozen

from graspsense.core.values.errors import ConfigError, DataDamaged, suggestion
from graspsense.core.values.fingers import PREFIX, FingerForce
from graspsense.core.values.written_numbers import number_in
from graspsense.recording.replayable import Recording
from graspsense.sources.columns.grasp_columns import GraspColumns, checked_recording, finger_sides
from graspsense.sources.formats.file_text import text_of
from graspsense.sources.formats.table import Numbers

FIRST_LINE: Final = "-10000"
DATA_FOLDER: Final = "iCubGraspDataset"
FIRST_JOINT: Final = 7
FINGERS: Final = ("thumb", "index", "middle", "ring", "little")
_LINES: Final = (("encoder", 9), ("maximum", 5), *((f"{finger} taxel", 12) for finger in FINGERS))
_FULL_TURN_DEG: Final = 360.0
_FULL_SCALE: Final = 255.0

HAND: Final = tuple(
    FingerForce(f"{PREFIX}{name}", "N", side="left" if name == "thumb" else "right", touch="any")
    for name in FINGERS
)
"""The five fingertips, of which the thumb opposes the others: the thumb and the strongest of these count."""
THUMB_FLEXION: Final = (9, 10)
FINGER_FLEXION: Final = (11, 12, 13, 14)
START_GAP_M: Final = 0.08
"""Nominal gap in the first frame. The true gap is unknown; this value keeps the gap positive."""
GAP_M_PER_DEG: Final = 1e-3
"""Nominal decrease of the gap when thumb and fingers flex by one degree on average."""
FORCE_N_PER_COUNT: Final = 0.1
"""Nominal force on a fingertip for one count of pressure, summed over its twelve taxels."""


@frozen(kw_only=True, eq=False)
class IcubGrasp:
    """The raw data of one grasp over `n` frames.

    `encoders_deg` has shape (n, 9), joints 7 to 15. `maxima` has shape (n, 5) and `taxels` (n, 5, 12), in counts, thumb
    first. The maxima differ by up to 6 counts from the largest taxel of the same frame, because they were read at
    another time.
    """

    encoders_deg: Numbers
    maxima: Numbers
    taxels: Numbers

    def __len__(self) -> int:
        """Return the number of frames."""
        return len(self.encoders_deg)

    @property
    def flexion_deg(self) -> Numbers:
        """The mean of two flexions in each frame: that of the thumb, and that of the index and middle finger."""
        every = (np.array(joints) - FIRST_JOINT for joints in (THUMB_FLEXION, FINGER_FLEXION))
        thumb, fingers = (self.encoders_deg[:, joints].mean(axis=1) for joints in every)
        mean: Numbers = (thumb + fingers) / 2.0
        return mean


def read_recording(name: str) -> Recording:
    """Return the grasp in this file as a recording, mapped by `recording_of`.

    `name` is a file in the folder of the data set, or in the folder that contains `iCubGraspDataset`.

    Raises ConfigError if the file cannot be read, DataDamaged if it is not a valid grasp.
    """
    path = _locate(name)
    return recording_of(read_grasp(path), path.name)


def recording_of(grasp: IcubGrasp, file: str) -> Recording:
    """Return a grasp of this file as a recording: thumb against fingers, relative to the first frame.

    The left force is that of the thumb, the right force that of the finger with the most pressure in the frame. A force
    is `FORCE_N_PER_COUNT` times the pressure above the first frame, summed over the taxels with its sign, so that noise
    has no bias. The gap decreases from `START_GAP_M` by `GAP_M_PER_DEG` times the mean of two flexions: that of the
    thumb, and that of the index and middle finger. Time is the frame number. No reading depends on a later frame.
    """
    pressure = FORCE_N_PER_COUNT * (grasp.taxels[0] - grasp.taxels).sum(axis=2)
    forces = dict(zip((finger.name for finger in HAND), pressure.T, strict=True))
    left, right = finger_sides(HAND, forces)
    columns = GraspColumns(
        source=f"iCub hand, {file}",
        t_s=np.arange(float(len(grasp))),
        gap_m=START_GAP_M - GAP_M_PER_DEG * (grasp.flexion_deg - grasp.flexion_deg[0]),
        left_n=left,
        right_n=right,
        scalars=forces,
        fingers=HAND,
        units={"t": "frame"},  # without time stamps
        notes=(
            f"{len(grasp)} frames of an iCub hand without time stamps: times are frame numbers, not seconds",
            "metres and newtons are nominal: gap from the encoders, forces from the taxels, "
            "all relative to the first frame (docs/icub.md)",
            "the commands of the controller have no effect on a recording",
        ),
    )
    return checked_recording(columns, rate_hz=1.0)


def read_grasp(path: Path) -> IcubGrasp:
    """Return the raw frames of one file.

    Raises ConfigError if the file cannot be read, DataDamaged if its content is not a complete grasp.
    """
    text = text_of(path)
    lines = text.splitlines()
    begin = lines[0] if lines else ""
    frames, left_over = divmod(len(lines) - 1, len(_LINES))
    if begin.strip() != FIRST_LINE:
        begins = f"it starts with {begin[:40]!r}, but a grasp starts with the line {FIRST_LINE}"
        raise _damaged(path, 1, begins)
    if not text.endswith("\n"):
        raise _damaged(path, len(lines), "the file ends within this line: download it again")
    if left_over:
        ends = f"the file ends after {left_over} of the {len(_LINES)} lines of frame {frames + 1}"
        raise _damaged(path, len(lines), f"{ends}: download it again")
    if not frames:
        raise _damaged(path, 1, "there is no frame after the first line")
    rows = [_numbers(path, 2 + i, line, *_LINES[i % len(_LINES)]) for i, line in enumerate(lines[1:])]
    return IcubGrasp(
        encoders_deg=np.array(rows[0 :: len(_LINES)]),
        maxima=np.array(rows[1 :: len(_LINES)]),
        taxels=np.stack([np.array(rows[k :: len(_LINES)]) for k in range(2, len(_LINES))], axis=1),
    )


def _locate(name: str) -> Path:
    given = Path(os.path.expanduser(name))
    places = (given.parent, given.parent / DATA_FOLDER)
    path = next((place / given.name for place in places if (place / given.name).is_file()), None)
    if path is not None:
        return path
    if given.is_dir():
        raise ConfigError(
            f"{given} is a folder: name a grasp in it, such as {given}/full_vitamin_water_1.txt"
        )
    grasps = [grasp.name for place in places for grasp in place.glob("*.txt")]
    raise ConfigError(
        f"there is no grasp {given}: name a file of the iCub Grasp Dataset with its folder, as in "
        f"FOLDER/full_vitamin_water_1.txt.{suggestion(given.name, grasps)}"
    )


def _numbers(path: Path, number: int, line: str, what: str, count: int) -> list[float]:
    words = line.split()
    if len(words) != count:
        raise _damaged(path, number, f"{len(words)} {what} values; {count} are expected")
    lowest, highest = (-_FULL_TURN_DEG, _FULL_TURN_DEG) if what == "encoder" else (0.0, _FULL_SCALE)
    values = []
    for word in words:
        value = number_in(word)
        if value is None or not lowest <= value <= highest:
            why = "is not a number" if value is None else f"is outside {lowest:g} to {highest:g}"
            raise _damaged(path, number, f"{what} value {word[:40]!r} {why}")
        values.append(value)
    return values


def _damaged(path: Path, number: int, what: str) -> DataDamaged:
    return DataDamaged(f"{path}, line {number}: {what}")
