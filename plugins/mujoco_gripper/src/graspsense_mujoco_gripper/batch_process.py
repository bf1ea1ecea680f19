"""The program of a process that `batch` starts: it runs grasps that it is asked for."""

from __future__ import annotations

import io
import json
import os
import signal
import sys
from typing import Any

import numpy as np

from graspsense.plugin_api import create
from graspsense.simulator_api import RunConfig
from graspsense_mujoco_gripper.backend import gripper_in_batch
from graspsense_mujoco_gripper.batch import COLUMNS, GraspingJob, line_of
from graspsense_mujoco_gripper.config import MujocoConfig


def main() -> None:
    """Answer the requests on the standard input until it ends."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    answers = os.fdopen(os.dup(1), "wb")
    # Text that other code prints must not appear between the answers.
    os.dup2(2, 1)
    asked = sys.stdin.buffer
    greeting = json.loads(asked.readline() or b"null")
    if greeting is None:
        return
    sys.path[:] = greeting["path"]
    name, values = greeting["controller"]
    job = GraspingJob(
        gripper_in_batch,
        MujocoConfig(**greeting["config"]),
        create("controller", name, **values),
        {"run": RunConfig(**greeting["run"]), "traces": True},
        makes_signals=False,
    )
    for line in asked:
        columns = io.BytesIO()
        try:
            done = job.grasp(*json.loads(line))
            assert done.trace is not None
            for column in COLUMNS:
                np.lib.format.write_array(columns, getattr(done.trace, column), allow_pickle=False)
            told = [[event.t_s, int(event.phase), event.what, event.source] for event in done.trace.events]
            outcome = done.outcome.value
            answer: dict[str, Any] = {"outcome": outcome, "reason": done.reason, "report": dict(done.report)}
            head = line_of({**answer, "events": told, "bytes": columns.tell()})
        except Exception:
            columns = io.BytesIO()
            head = line_of({"failed": True, "bytes": 0})
        answers.write(head + columns.getbuffer())
        answers.flush()


if __name__ == "__main__":
    main()
