"""The process in which a live observer of a plugin receives grasps.

python -m graspsense.live.observer_process MODULE:FUNCTION
"""

from __future__ import annotations

import json
import os
import sys
from importlib import import_module

from graspsense.core.values.errors import FAILURES, named
from graspsense.live.stream import batches
from graspsense.recording.wire_messages import leave_control_alone


def main(target: str) -> int:
    """Run the observer until the grasping program ends. Print a line of JSON once it is imported, and its error."""
    leave_control_alone()
    answers = os.fdopen(os.dup(1), "w")
    os.dup2(2, 1)  # what the observer prints is no answer
    module, _, name = target.partition(":")
    try:
        observe = getattr(import_module(module), name)
        print("{}", file=answers, flush=True)
        observe(batches(0))
    except FAILURES as error:
        print(json.dumps({"error": f"{target} failed: {named(error)}"}), file=answers, flush=True)
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:]))
