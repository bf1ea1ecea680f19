"""Limits on what a file can make the program read, store or compute. Each has a name, and can be raised.

A number, a count or a size in a file is compared with its limit before anything is allocated. An environment variable
of the name of the limit replaces its value: `GRASPSENSE_MAX_COLUMNS=50000`. The limits guard against files that
were made by mistake or to do harm; no recording of a grasp comes near them.
"""

from __future__ import annotations

import os
from typing import Final

from attrs import frozen

from graspsense.core.values.errors import ConfigError


@frozen
class SizeLimit:
    """The largest number of something that is accepted: `what` names it, `variable` the environment variable."""

    variable: str
    default: int
    what: str

    @property
    def most(self) -> int:
        """The number that holds now. Raises ConfigError if the environment variable is not a whole number above 0."""
        given = os.environ.get(self.variable, "")
        if not given:
            return self.default
        if not (given.isascii() and given.isdecimal() and len(given) <= 18 and int(given) > 0):
            raise ConfigError(
                f"{self.variable} is {given[:40]!r}: give a whole number above 0, such as {self.default}"
            )
        return int(given)

    def exceeded(self, number: int) -> str:
        """Return in words that so many are too many, and how to raise the limit; an empty text if they are not.

        Raises ConfigError if the environment variable is malformed.
        """
        most = self.most
        if number <= most:
            return ""
        return (
            f"{number} {self.what}, and at most {most} are accepted. If that many are intended, set the environment "
            f"variable {self.variable} to a larger number"
        )


TEXT_BYTES: Final = SizeLimit("GRASPSENSE_MAX_TEXT_BYTES", 128 * 2**20, "bytes of a text file")
LINE_CHARACTERS: Final = SizeLimit("GRASPSENSE_MAX_LINE_CHARACTERS", 2_000_000, "characters of a line")
COLUMNS: Final = SizeLimit("GRASPSENSE_MAX_COLUMNS", 10_000, "columns of a table")
CELLS: Final = SizeLimit("GRASPSENSE_MAX_CELLS", 10_000_000, "cells of a table")
SAMPLES: Final = SizeLimit("GRASPSENSE_MAX_SAMPLES", 5_000_000, "samples of a grasp")
SETTINGS_BYTES: Final = SizeLimit("GRASPSENSE_MAX_SETTINGS_BYTES", 2**19, "bytes of a file of settings")
CHANNEL_NUMBERS: Final = SizeLimit(
    "GRASPSENSE_MAX_CHANNEL_NUMBERS", 2**20, "numbers of a channel in one reading"
)
ENTRIES: Final = SizeLimit("GRASPSENSE_MAX_ENTRIES", 500, "entries of a key of a manifest")
UNPACKED_MB: Final = SizeLimit("GRASPSENSE_MAX_UNPACKED_MB", 512, "megabytes that a file unpacks to")
"""An hour of a gripper at 1 kHz, or 60 million numbers of another program."""
MODEL_BYTES: Final = SizeLimit("GRASPSENSE_MAX_MODEL_BYTES", 256 * 2**20, "bytes of a model")
CASES: Final = SizeLimit("GRASPSENSE_MAX_CASES", 1000, "cases of an experiment")
RECORDINGS: Final = SizeLimit("GRASPSENSE_MAX_RECORDINGS", 20_000, "recordings of a data set")
CLASSES: Final = SizeLimit("GRASPSENSE_MAX_CLASSES", 100, "different labels")
FEATURES: Final = SizeLimit("GRASPSENSE_MAX_FEATURES", 5000, "features of a trial")
CHECKPOINTS: Final = SizeLimit("GRASPSENSE_MAX_CHECKPOINTS", 100, "checkpoints of a grasp")
