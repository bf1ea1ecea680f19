"""How a process behaves that works beside a control loop."""

from __future__ import annotations

import os
import signal


def leave_control_alone() -> None:
    """Make this process ignore Ctrl-C, which is meant for the grasping program, and never preempt the control loop.

    On Linux, a batch process does not preempt another one when it wakes up. Its nice value is unchanged: on a busy
    machine, a nice process would fall behind further than a crash may lose.
    """
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    if hasattr(os, "SCHED_BATCH"):
        os.sched_setscheduler(0, os.SCHED_BATCH, os.sched_param(0))
