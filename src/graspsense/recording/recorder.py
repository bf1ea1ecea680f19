"""The sink that records a grasp: it passes each tick to a writer process and never waits for it.

Each tick is one non-blocking write to a pipe. Messages that the pipe does not take are queued and offered again with
the next ticks. `RecordingInfo` counts them. All messages are kept until the end, so that nothing is lost with a writer
process that is killed.
"""

from __future__ import annotations

import json
import subprocess
import time
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Final

from graspsense.core.files.whole_file import SaveFailed
from graspsense.core.values.json_values import json_text
from graspsense.core.values.signals import Command, GraspEvent, Reading, event_as_json
from graspsense.recording.feed import Data, Feed
from graspsense.recording.layout import EVENT, IS_END, IS_METADATA, PART, READY, nanoseconds
from graspsense.recording.recording_info import WRITTEN, RecordingInfo
from graspsense.recording.tick_messages import json_message

QUEUE_BYTES: Final = 256 << 20
"""Limit on the messages that wait for the pipe, and on those that are kept."""
ANSWER_TIMEOUT_S: Final = 60.0


class Recorder(Feed):
    """A sink of the runner that records one grasp to `path`.

    Raises SaveFailed if the writer process cannot be started. After that, `take` never raises: a full disk must not
    stop a grasp.
    """

    def __init__(self, path: Path) -> None:
        self.path, self._part = path, path.with_name(path.name + PART)
        super().__init__("graspsense.recording.writer_process", [str(path)], QUEUE_BYTES)
        self._kept: list[bytes] = []
        self._kept_bytes = self._base_ns = 0
        self.events = 0
        """Events of the controller that were taken."""

    def take(self, reading: Reading, phase: int, command: Command) -> None:
        """Pass on one tick, with its images and samples if those are new."""
        if not self.ticks:
            self._base_ns = time.time_ns() - nanoseconds(reading.frame.t_s)
        super().take(reading, phase, command)

    def event(self, event: GraspEvent) -> None:
        """Pass on an event of the controller, so that the recording has it if the grasp is cut off."""
        if event.source == "controller":
            number = self.events + 1
            self._told(f"{EVENT}{number}", {"event": json_text(event_as_json(event))})
            self.events = number

    def wait_ready(self) -> None:
        """Wait until the writer process has created its file, so that it keeps up when the fingers start to move.

        Raises SaveFailed with the reason if it could not.
        """
        said = self._first_line(ANSWER_TIMEOUT_S)
        if not said:
            what = "does not start" if said is None else "died when it started"
            raise SaveFailed(f"the writer process of {self.path} {what}")
        if said.decode() != READY:
            raise self._failure(json.loads(said))

    def metadata(self, name: str, values: Mapping[str, str]) -> None:
        """Pass on a metadata record and wait until the pipe has taken it. Do not call this during control."""
        message = json_message(IS_METADATA, name, dict(values))
        self._keep(message)
        self._drain(message, ANSWER_TIMEOUT_S)

    def finish(self) -> RecordingInfo:
        """Wait until the recording is complete on the disk. Raises SaveFailed with the reason if it is not.

        If the writer process was killed, or hangs, this process writes it.
        """
        answer = self._final_answer(json_message(IS_END))
        if answer is None and self._kept_bytes <= QUEUE_BYTES:
            return self._written_here()
        if answer is None or "sha256" not in answer:
            raise self._failure(answer)
        return RecordingInfo(
            path=self.path,
            **{name: answer[name] for name in WRITTEN},
            deferred=self._deferred,
            dropped=self.dropped,
        )

    def leave(self) -> None:
        """Stop without ending the trial. The file remains as `.part`, or is deleted if it has no tick."""
        self._final_answer(b"")

    def incomplete(self, missing: str) -> SaveFailed:
        """Leave a recording that lacks something of its grasp, and return why it is not kept."""
        self.leave()
        return self._failure({"error": missing})

    def _keep(self, data: Data) -> None:
        self._kept_bytes += len(data)
        if self._kept_bytes <= QUEUE_BYTES:
            self._kept.append(bytes(data))

    def _written_here(self) -> RecordingInfo:
        """Write the recording from what was kept. Raises SaveFailed."""
        # Imported here: who grasps does without the writer.
        from graspsense.recording.writer import RecordingWriter

        try:
            self._part.unlink(missing_ok=True)
            file = RecordingWriter(self.path, self._base_ns)
            file.messages(bytearray().join(self._kept))
            return file.finish()
        except OSError as error:
            raise self._failure({"error": error.strerror}) from error

    def _failure(self, answer: Mapping[str, Any] | None) -> SaveFailed:
        reason = "the writer process died" if answer is None else answer.get("error", "it was abandoned")
        hint = (
            f". {self._part.name} holds the part that was written: see `graspsense recover`"
            if self._part.exists()
            else ""
        )
        return SaveFailed(f"the recording {self.path} could not be written: {reason}{hint}")

    def _final_answer(self, word: bytes) -> dict[str, Any] | None:
        """Send this message and return the answer, or None if none comes within `ANSWER_TIMEOUT_S`."""
        self._drain(word, ANSWER_TIMEOUT_S)
        try:
            out, _ = self._process.communicate(timeout=ANSWER_TIMEOUT_S)
            answer = json.loads(out.decode().removeprefix(READY))
        except (subprocess.TimeoutExpired, ValueError):
            self._process.kill()
            self._process.communicate()
            return None
        return answer if isinstance(answer, dict) else None
