"""What this distribution brings to graspsense: LeRobot data sets as a source of trials."""

from __future__ import annotations

from collections.abc import Iterable

from graspsense.plugin_api import DatasetEntry, hookimpl

GRASPSENSE_API = (2, 0)


@hookimpl
def graspsense_datasets() -> Iterable[DatasetEntry]:
    """Return the reader of LeRobot data sets."""
    yield DatasetEntry(
        name="lerobot",
        recordings="graspsense_lerobot.reader:recordings",
        export="graspsense_lerobot.writer:export",
        summary="LeRobot data sets v2.1 and v3.0, as lerobot:FOLDER",
    )
