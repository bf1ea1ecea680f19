"""The sink that shows grasps live: it hands ticks to the process of an observer, and never waits for it."""

from __future__ import annotations

import json
import subprocess
from collections.abc import Mapping, Sequence
from contextlib import suppress
from typing import Any, Final

from attrs import asdict

from graspsense.core.files.whole_file import SaveFailed
from graspsense.core.values.channel import FastChannel, TactileArray
from graspsense.core.values.device import DeviceInfo
from graspsense.core.values.errors import ConfigError
from graspsense.core.values.json_values import json_ready
from graspsense.core.values.signals import GraspEvent, event_as_json
from graspsense.core.values.trial import Trial
from graspsense.recording.feed import Feed

QUEUE_BYTES: Final = 8 << 20
"""Limit on what waits for an observer; what is beyond it is dropped."""
START_TIMEOUT_S: Final = 30.0
END_TIMEOUT_S: Final = 3.0
FILE_TIMEOUT_S: Final = 60.0
"""`end_timeout_s` of a process that writes a file."""


class LiveFeed(Feed):
    """A sink that passes grasps to the process of one observer, `python -m MODULE ARGUMENTS`.

    The process prints a line of JSON once it is ready, with what it found as values, or `error`. After the last message
    it has `end_timeout_s` to end. Raises ConfigError with its error, and if it does not start.
    """

    def __init__(self, module: str, arguments: Sequence[str], end_timeout_s: float = END_TIMEOUT_S) -> None:
        self._end_timeout_s = end_timeout_s
        self.name = " ".join((module, *arguments))
        """The process, for messages."""
        try:
            super().__init__(module, arguments, QUEUE_BYTES)
        except SaveFailed as error:
            raise ConfigError(str(error)) from error
        said = self._first_line(START_TIMEOUT_S) or json.dumps({"error": f"{self.name} does not start"})
        self.answer: Mapping[str, Any] = json.loads(said)
        """What the process found."""
        if "error" in self.answer:
            self.close()
            raise ConfigError(str(self.answer["error"]))

    def opened(self, device: DeviceInfo) -> None:
        """Begin a grasp with this gripper."""
        self._counter = 0
        self._told("grasp", grasp_values(device))

    def event(self, event: GraspEvent) -> None:
        """Pass on an event, and the prediction if it is one."""
        self._told("event", event_as_json(event))
        if event.prediction is not None:
            self._told("prediction", event.prediction.in_words)

    def finished(self, trial: Trial) -> None:
        """Pass on how a grasp ended. Do not call this during control."""
        if trial.prediction is not None:
            self._told("prediction", trial.prediction.in_words)
        self.told("outcome", {"outcome": trial.outcome.words, "reason": trial.reason})

    def told(self, name: str, values: Any) -> None:
        """Pass on JSON values. Do not call this during control."""
        self._told(name, values)
        # What waits for the pipe would otherwise stay there until the next message.
        self._drain(b"", END_TIMEOUT_S)

    def close(self) -> str:
        """End the process and return the error that it reports; empty if there is none."""
        self._drain(b"", self._end_timeout_s)
        ended = self._broken or self._process.poll() not in (None, 0)
        try:
            out, _ = self._process.communicate(timeout=self._end_timeout_s)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.communicate()
            return f"{self.name} did not end, and was stopped"
        last = out.splitlines()[-1:] or [b"{}"]
        with suppress(ValueError, AttributeError):
            if error := json.loads(last[0]).get("error"):
                return str(error)
        return (
            f"{self.name} ended before the grasps did: what it shows or writes is incomplete" if ended else ""
        )


def grasp_values(device: DeviceInfo) -> dict[str, Any]:
    """Return what is known of a grasp before it begins, as JSON values."""
    channels = []
    for channel in device.channels:
        kind = {TactileArray: "array", FastChannel: "fast"}.get(type(channel), "number")
        values = {
            key: value for key, value in asdict(channel).items() if key not in ("positions_m", "facing")
        }
        channels.append({**values, "kind": kind})
    values = {"device": device.name, "rate_hz": device.rate_hz, "clock": device.clock, "channels": channels}
    ready: dict[str, Any] = json_ready({**values, "units": dict(device.units)})
    return ready
