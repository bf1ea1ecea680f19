"""The order in which trials were recorded: by the time of the grasp, not of an import."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from datetime import UTC, datetime
from typing import Final

import numpy as np

from graspsense.core.values.errors import counted
from graspsense.core.values.written_numbers import number_in

RECORDED_AT: Final = "recorded_at"
"""Key of the labels of an imported trial: the time at which it was recorded, in ISO 8601."""
ORDER: Final = "order"
"""Key of the labels of an imported trial: its number in the order of recording, where no time is known."""


def order_recorded(
    made_at: Sequence[str], origins: Sequence[str], labels: Sequence[Mapping[str, str]]
) -> tuple[tuple[int, ...] | None, str]:
    """Return the position of each trial in the order of recording, or None with the reason.

    `labels` are the labels of the recordings. A trial that was grasped by graspsense was recorded when it was
    made. An imported one says so in its labels, by `recorded_at`, or all of them by `order`.
    """
    if set(origins) == {"import"} and all(ORDER in label and RECORDED_AT not in label for label in labels):
        numbers = [number_in(str(label[ORDER])) for label in labels]
        known = [number for number in numbers if number is not None]
        if len(known) == len(numbers):
            return _positions(known), ""
    times = [
        _time(label.get(RECORDED_AT, "")) if origin == "import" else _time(made)
        for made, origin, label in zip(made_at, origins, labels, strict=True)
    ]
    known_times = [time for time in times if time is not None]
    if len(known_times) < len(times):
        unknown = len(times) - len(known_times)
        return None, (
            f"{unknown} of {counted(len(times), 'trial')} were imported without the time at which they were recorded "
            "(the key recorded of a manifest)"
        )
    return _positions(known_times), ""


def _positions(values: Sequence[float]) -> tuple[int, ...]:
    """Return the rank of each value; equal ones keep their order."""
    return tuple(np.argsort(np.argsort(values, kind="stable")).tolist())


def _time(text: str) -> float | None:
    try:
        time = datetime.fromisoformat(text)
        # A time without a zone is taken as UTC: only the order matters.
        return (time if time.tzinfo is not None else time.replace(tzinfo=UTC)).timestamp()
    except (TypeError, ValueError, OverflowError):
        return None
