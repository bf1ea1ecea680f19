"""A worker process. It reads tasks as lines from standard input and writes results as lines to standard output.

It ends when the process that started it has ended.
"""

from __future__ import annotations

import os
import sys


def main() -> None:
    """Run tasks until the input ends."""
    # Results keep the original standard output. Anything else that prints to it, also in C, goes to standard error.
    answers = os.fdopen(os.dup(1), "w", encoding="utf-8")
    os.dup2(2, 1)

    from graspsense.core.values.json_values import json_text
    from graspsense.experiments.task import run_task
    from graspsense.experiments.versions import versions

    def answer(text: str) -> None:
        try:
            answers.write(text + "\n")
            answers.flush()
        except BrokenPipeError:
            os._exit(0)

    answer(json_text(versions()))
    for line in sys.stdin:
        answer(run_task(line))


if __name__ == "__main__":
    main()
