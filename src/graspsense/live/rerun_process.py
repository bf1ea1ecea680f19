"""The process that logs live grasps to Rerun: to a viewer that runs, or into a file.

python -m graspsense.live.rerun_process FILE.rrd|rerun+http://HOST:PORT/proxy
"""

from __future__ import annotations

import socket
import sys
import time
from collections.abc import Sequence
from typing import Any, Final
from urllib.parse import urlsplit

import numpy as np
import rerun as rr
import rerun.blueprint as rrb

from graspsense.core.values.errors import FAILURES, named
from graspsense.live.admission import say
from graspsense.live.stream import Message, batches
from graspsense.recording.layout import LogClock
from graspsense.recording.wire_messages import leave_control_alone

FLUSH_S: Final = 2.0
"""How long a viewer may take what is left when the grasping program has ended."""
CONNECT_S: Final = 3.0
LAST_NS: Final = 2**63 - 1
CURVES: Final = {
    "Gap": ("gap_m",),
    "Force": ("force_left_n", "force_right_n"),
    "Effort": ("effort_n", "command"),
    "Phase": ("phase",),
}


class RerunLog:
    """Logs the messages of grasps under `/grasp`, on the timelines `t` of the gripper and `wall`."""

    def __init__(self, stream: rr.RecordingStream) -> None:
        self._stream, self._clock = stream, LogClock()
        self._declared: dict[str, Any] = {}
        self._newest_s = 0.0

    def take(self, message: Message) -> None:
        """Log one message; one of another kind than of a grasp is left out."""
        take = getattr(self, f"_{message['kind']}", None)
        if take is not None:
            take(message)

    def _grasp(self, message: Message) -> None:
        self._clock, self._newest_s = LogClock(), 0.0
        self._declared = {channel["name"]: channel for channel in message["channels"]}

    def _ticks(self, message: Message) -> None:
        self._newest_s = message["t_s"][-1]
        self._numbers("grasp/tick", message)

    def _scalars(self, message: Message) -> None:
        self._numbers("grasp/scalars", message)

    def _numbers(self, path: str, message: Message) -> None:
        times = message["t_s"]
        for name, values in message.items():
            if name not in ("kind", "t_s"):
                self._column(f"{path}/{name}", times, values)

    def _samples(self, message: Message) -> None:
        channel = self._declared.get(message["name"], {})
        interval_s = 1.0 / channel["rate_hz"] if channel.get("rate_hz") else 0.0
        times, rows = [], []
        for t_s, new in zip(message["t_s"], message["values"], strict=True):
            times += [t_s - (len(new) - 1 - k) * interval_s for k in range(len(new))]
            rows += new
        names = channel.get("axes") or [str(axis) for axis in range(len(rows[0]))]
        for name, values in zip(names, zip(*rows, strict=True), strict=True):
            axis = rr.escape_entity_path_part(name)
            self._column(f"grasp/signals/{message['name']}/{axis}", times, values)

    def _image(self, message: Message) -> None:
        name = message["name"]
        tip = name.startswith("pads_") and name not in self._declared
        channel = self._declared.get("pads" if tip else name, {})
        cells = np.array(message["cells"], channel.get("dtype", "float64"))
        shape = [channel.get("rows", 0), channel.get("columns", 0), channel.get("components", 1)]
        if np.prod(shape) == cells.size:
            cells = cells.reshape(shape if shape[2] > 1 else shape[:2])
        picture = cells.dtype == np.uint8 and cells.ndim > 1 and shape[2] in (1, 3)
        path = f"grasp/pads/{name.removeprefix('pads_')}" if tip else f"grasp/signals/{name}"
        self._log(path, message["t_s"], rr.Image(cells) if picture else rr.Tensor(cells))

    def _event(self, message: Message) -> None:
        self._log("grasp/events", message["t_s"], rr.TextLog(message["what"]))

    def _outcome(self, message: Message) -> None:
        reason = f": {message['reason']}" if message["reason"] else ""
        self._log("grasp/events", self._newest_s, rr.TextLog(f"outcome: {message['outcome']}{reason}"))

    def _prediction(self, message: Message) -> None:
        lines = [f"{message['label']}  {message['certainty']}".strip()]
        lines += [f"set: {message['set']}"] if message["set"] else []
        text = "\n".join([*lines, *message["because"]])
        self._log("grasp/prediction", self._newest_s, rr.TextDocument(text))

    def _column(self, path: str, times: Sequence[float], values: Sequence[float]) -> None:
        now_ns = time.time_ns()
        wall = np.array([min(self._clock.log_ns(t_s, now_ns), LAST_NS) for t_s in times], "datetime64[ns]")
        indexes = [rr.TimeColumn("t", duration=_durations(times)), rr.TimeColumn("wall", timestamp=wall)]
        self._stream.send_columns(path, indexes, rr.Scalars.columns(scalars=np.array(values, float)))

    def _log(self, path: str, t_s: float, what: Any) -> None:
        wall_ns = min(self._clock.log_ns(t_s, time.time_ns()), LAST_NS)
        self._stream.set_time("t", duration=_durations([t_s])[0])
        self._stream.set_time("wall", timestamp=np.datetime64(wall_ns, "ns"))
        self._stream.log(path, what)


def _durations(times: Sequence[float]) -> Any:
    return np.rint(np.clip(np.nan_to_num(times), -9e9, 9e9) * 1e9).astype("timedelta64[ns]")


def layout() -> rrb.Blueprint:
    """Return what a viewer shows that has no layout for graspsense yet: further channels get views of their own."""
    curves = [
        rrb.TimeSeriesView(name=name, origin="grasp/tick", contents=[f"$origin/{field}" for field in fields])
        for name, fields in CURVES.items()
    ]
    words = [
        rrb.TextDocumentView(name="Prediction", origin="grasp/prediction"),
        rrb.TextLogView(name="Events", origin="grasp/events"),
    ]
    return rrb.Blueprint(rrb.Horizontal(rrb.Vertical(*curves), rrb.Vertical(*words)), auto_views=True)


def opened(target: str) -> rr.RecordingStream:
    """Return what logs to a file or to a viewer. Raises OSError or RuntimeError, with the reason."""
    rr.set_strict_mode(True)
    stream = rr.RecordingStream("graspsense")
    stream.set_log_time_enabled(False)
    stream.set_log_tick_enabled(False)
    if target.endswith(".rrd"):
        stream.save(target, layout())
        return stream
    address = urlsplit(target)
    socket.create_connection((address.hostname, address.port), CONNECT_S).close()
    stream.connect_grpc(target, default_blueprint=layout())
    return stream


def main(target: str) -> int:
    """Log until the grasping program ends. Print a line of JSON once that is possible, and the error."""
    leave_control_alone()
    is_file = target.endswith(".rrd")
    try:
        stream = opened(target)
    except (OSError, RuntimeError, ValueError) as error:
        hint = "" if is_file else ": start the viewer with `rerun`, or name a file that ends in .rrd"
        say({"error": f"--rerun: cannot log to {target}: {error}{hint}"})
        return 1
    say({"address": target})
    try:
        log = RerunLog(stream)
        for messages in batches(0, every_image=True):
            for message in messages:
                log.take(message)
        stream.flush(timeout_sec=1e38 if is_file else FLUSH_S)
        stream.disconnect()
    except FAILURES as error:
        say({"error": f"--rerun: {target}: {named(error)}"})
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:]))
