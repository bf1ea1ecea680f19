"""The trace of a grasp: measurements, phases and commands as arrays over its ticks."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import chain
from typing import TYPE_CHECKING, Any, Final

import numpy as np
from attrs import define, evolve, field, frozen

from graspsense.core.signals import CELLS, CHANNELS, Command, Frame, Pads

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Floats = NDArray[np.float64]
    Integers = NDArray[np.int64]

SI_UNITS: Final[Mapping[str, str]] = {"t": "s", **CHANNELS}

_FRAME_COLUMNS: Final = Frame._fields
TICK_COLUMNS: Final = (*(name for name in _FRAME_COLUMNS if name != "dt_s"), "phase", "command")
PAD_COLUMNS: Final = ("pad_t_s", "pad_left", "pad_right")


@frozen(eq=False, kw_only=True)
class Trace:
    """A finished or running grasp as arrays: `n` ticks, and `m` cell images with times of their own.

    The columns of ticks have shape (n,): `phase` holds the numbers of `Phase`, `command` the value commanded after
    the tick. `pad_t_s` has shape (m,), `pad_left` and `pad_right` have shape (m, 22), in raw counts. A channel that
    the gripper lacks is NaN throughout. `units` gives the unit of each channel and of `t`: SI for a gripper, possibly
    others for a recording (`{"t": "frame"}`).
    """

    t_s: Floats
    gap_m: Floats
    velocity_m_s: Floats
    effort_n: Floats
    force_left_n: Floats
    force_right_n: Floats
    edge_left_n: Floats
    edge_right_n: Floats
    status: Integers
    phase: Integers
    command: Floats
    pad_t_s: Floats
    pad_left: Floats
    pad_right: Floats
    units: Mapping[str, str] = field(factory=lambda: dict(SI_UNITS))

    def __len__(self) -> int:
        """Return the number of ticks."""
        return len(self.t_s)

    def __repr__(self) -> str:
        from graspsense.core.notebook import trace_words

        return f"<Trace: {trace_words(self)}>"

    def _repr_html_(self) -> str:
        from graspsense.core.notebook import sentence, trace_svg, trace_words

        return sentence(trace_words(self)) + trace_svg(self)

    def plot(self) -> tuple[Any, Any]:
        """Draw the trace as `graspsense run --plot` does, and return the axes of the forces and of the gap.

        These are matplotlib's, so that a notebook shows them and a script can add to them: `axes[0].figure` is the
        figure. Raises PluginUnavailable without matplotlib, which the extra `plot` installs.
        """
        from graspsense.core.trace_plot import plot

        return plot(self)

    def until(self, t_s: float) -> Trace:
        """Return the trace up to time `t_s`: every tick and image that is not later."""
        n = int(np.searchsorted(self.t_s, t_s, side="right"))
        m = int(np.searchsorted(self.pad_t_s, t_s, side="right"))
        cut: dict[str, Any] = {name: getattr(self, name)[:n] for name in TICK_COLUMNS}
        cut.update({name: getattr(self, name)[:m] for name in PAD_COLUMNS})
        return evolve(self, **cut)


@define(eq=False)
class TraceRecorder:
    """Collects the ticks of a running grasp; `trace()` returns those collected so far."""

    units: Mapping[str, str] = field(factory=lambda: dict(SI_UNITS))
    frames: list[Frame] = field(factory=list, init=False)
    phases: list[int] = field(factory=list, init=False)
    commands: list[float] = field(factory=list, init=False)
    images: list[Pads] = field(factory=list, init=False)

    def add(self, frame: Frame, pads: Pads, phase: int, command: Command) -> None:
        """Add one tick, and its cell image if the counter of the image is new."""
        self.frames.append(frame)
        self.phases.append(phase)
        self.commands.append(command.value)
        images = self.images
        if pads.counter and (not images or images[-1].counter != pads.counter):
            images.append(pads)

    def trace(self) -> Trace:
        """Return the trace of the ticks collected so far."""
        return trace_of(self.frames, self.phases, self.commands, self.images, self.units)


def trace_of(
    frames: Sequence[Frame],
    phases: Sequence[int],
    commands: Sequence[float],
    images: Sequence[Pads],
    units: Mapping[str, str] = SI_UNITS,
) -> Trace:
    """Return the trace of these ticks and images. `frames`, `phases` and `commands` must have the same length."""
    width = len(_FRAME_COLUMNS)
    numbers = np.fromiter(chain.from_iterable(frames), dtype=np.float64, count=len(frames) * width)
    table = numbers.reshape(len(frames), width)
    columns: dict[str, Any] = {
        name: np.ascontiguousarray(table[:, i]) for i, name in enumerate(_FRAME_COLUMNS) if name != "dt_s"
    }
    columns["status"] = columns["status"].astype(np.int64)
    return Trace(
        **columns,
        phase=np.array(phases, dtype=np.int64),
        command=np.array(commands, dtype=np.float64),
        pad_t_s=np.array([image.t_s for image in images], dtype=np.float64),
        pad_left=np.array([image.left for image in images], dtype=np.float64).reshape(len(images), CELLS),
        pad_right=np.array([image.right for image in images], dtype=np.float64).reshape(len(images), CELLS),
        units=dict(units),
    )
