"""A period of the device's time for a period of the host's."""

from __future__ import annotations

import time
from collections.abc import Iterator


def on_time(period_s: float) -> Iterator[float]:
    """Yield once a period on a grid of absolute times, with how late it is in seconds.

    What is late is made up for, so that the device's clock stays with the host's.
    """
    due = time.monotonic()
    while True:
        yield max(time.monotonic() - due, 0.0)
        due += period_s
        wait_s = due - time.monotonic()
        if wait_s > 0.0:
            time.sleep(wait_s)
