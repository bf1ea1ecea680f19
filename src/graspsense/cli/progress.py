"""How far something is, on stderr, once it has taken two seconds."""

from __future__ import annotations

import sys
import time
from typing import Final

from graspsense.cli.terminal import block, can_redraw, echo_as_it_is, echo_in_place, terminal_width
from graspsense.core.values.printable import in_one_line

FIRST_S: Final = 2.0
AGAIN_S: Final = 0.2
AGAIN_IN_A_LOG_S: Final = 10.0
"""If stderr is not a terminal, every report is a separate line, so there are fewer reports."""
BAR: Final = 24


class ProgressLine:
    """Reports what is being done and how much of it; leaves nothing behind on a terminal."""

    def __init__(self) -> None:
        self._width = terminal_width(sys.stderr) if can_redraw(sys.stderr) else None
        self._next = time.monotonic() + FIRST_S
        self._shown = False

    def __call__(self, what: str, done: int, total: int) -> None:
        """Report that `done` of `total` parts of `what` are done."""
        now = time.monotonic()
        if now < self._next:
            return
        self._next = now + (AGAIN_S if self._width is not None else AGAIN_IN_A_LOG_S)
        if self._width is not None:
            bar = block(sys.stderr) * round(BAR * done / max(total, 1))
            line = f"{bar:<{BAR}} {done} of {total}  {what}"
            # A line that fills the terminal would go on in the next one, which is not erased.
            echo_in_place(in_one_line(line)[: self._width - 1])
            self._shown = True
        else:
            echo_as_it_is(in_one_line(f"{what}: {done} of {total}"), err=True)

    def __enter__(self) -> ProgressLine:
        return self

    def __exit__(self, *_error: object) -> None:
        if self._shown:
            echo_in_place("")
