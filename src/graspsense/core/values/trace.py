"""The trace of a grasp: measurements, phases and commands as arrays over its ticks."""

from __future__ import annotations

import mmap
import os
import tempfile
import weakref
from collections.abc import Mapping, Sequence
from itertools import chain
from typing import Any, Final

import numpy as np
from attrs import define, evolve, field, frozen
from numpy.typing import NDArray

from graspsense.core.values.display import html, plot
from graspsense.core.values.signals import (
    APPROACH,
    CHANNELS,
    HOLD,
    NO_PADS,
    Command,
    Frame,
    GraspEvent,
    Image,
    Pads,
    Reading,
    Samples,
)
from graspsense.core.values.units import quantity

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]

SI_UNITS: Final[Mapping[str, str]] = {"t": "s", **CHANNELS}

_FRAME_COLUMNS: Final = Frame._fields
TICK_COLUMNS: Final = (*(name for name in _FRAME_COLUMNS if name != "dt_s"), "phase", "command")
BLOCK: Final = 512
"""Frames that are converted at once. In a thread beside a control loop, a conversion holds the interpreter lock."""
PAD_COLUMNS: Final = ("pad_t_s", "pad_left", "pad_right")


@frozen(eq=False, kw_only=True)
class ImageTrace:
    """The images of a tactile array: their times (m,), and the cells (m, number of cells).

    Of several components the cells are (m, number of cells, components). Those of an array with another `dtype` than
    float64 have this type and the shape (m, rows, columns), or (m, rows, columns, components), and are read-only.
    """

    t_s: Floats
    cells: NDArray[Any]

    def until(self, t_s: float) -> ImageTrace:
        """Return the images that are not later than `t_s`."""
        m = int(np.searchsorted(self.t_s, t_s, side="right"))
        return ImageTrace(t_s=self.t_s[:m], cells=self.cells[:m])


@frozen(eq=False, kw_only=True)
class SampleTrace:
    """The samples of a fast channel: their times (s,), and the values (s, number of axes).

    `lost` is the number of samples that the sensor took and that did not arrive. The time of a sample before the
    last of its tick is computed: the samples between two ticks are taken as equally spaced.
    """

    t_s: Floats
    values: Floats
    lost: int = 0

    def until(self, t_s: float) -> SampleTrace:
        """Return the samples that are not later than `t_s`."""
        m = int(np.searchsorted(self.t_s, t_s, side="right"))
        return SampleTrace(t_s=self.t_s[:m], values=self.values[:m], lost=self.lost)


SignalTrace = Any
"""The values of a further channel over a grasp: an array (n,) of numbers, an `ImageTrace`, or a `SampleTrace`."""


@frozen(eq=False, kw_only=True)
class Trace:
    """A finished or running grasp as arrays: `n` ticks, and `m` cell images with times of their own.

    The columns of ticks have shape (n,): `phase` holds the numbers of `Phase`, `command` the value commanded after
    the tick. `pad_t_s` has shape (m,), `pad_left` and `pad_right` have shape (m, cells), raw. A channel that
    the gripper lacks is NaN throughout. `units` gives the unit of each channel and of `t`: SI for a gripper, possibly
    others for a recording (`{"t": "frame"}`). `signals` holds the further channels of the gripper by name: an
    array (n,) of a channel with one number a tick, an `ImageTrace` of a tactile array, a `SampleTrace` of a fast
    channel. `events` are those that the controller told, in order.
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
    signals: Mapping[str, SignalTrace] = field(factory=dict)
    events: tuple[GraspEvent, ...] = ()

    def __len__(self) -> int:
        """Return the number of ticks."""
        return len(self.t_s)

    def __repr__(self) -> str:
        return f"<Trace: {self.words}>"

    @property
    def words(self) -> str:
        """The trace in a line: its ticks, its time, its largest force and its range of gaps."""
        if len(self) == 0:
            return "no ticks"
        words = [f"{len(self)} ticks", f"{float(self.t_s[-1] - self.t_s[0]):.4g} {self.units['t']}"]
        forces = np.concatenate([self.force_left_n, self.force_right_n])
        if not np.isnan(forces).all():
            words.append(f"forces to {quantity(float(np.nanmax(forces)), self.units['force_left'])}")
        if not np.isnan(self.gap_m).all():
            low, high = float(np.nanmin(self.gap_m)), float(np.nanmax(self.gap_m))
            words.append(f"gap {quantity(low, self.units['gap'])} to {quantity(high, self.units['gap'])}")
        return ", ".join(words)

    @property
    def closing(self) -> NDArray[np.bool_]:
        """A mask of the ticks from the approach to the end of the hold."""
        return (self.phase >= APPROACH) & (self.phase <= HOLD)

    def _repr_html_(self) -> str:
        return html(self)

    def plot(self) -> tuple[Any, Any]:
        """Draw the trace and return the axes of the forces and of the gap.

        Below them are the fast channels over time, and the cells of every tactile array at contact, peak and rest.
        These are matplotlib's, so that a notebook shows them and a script can add to them: `axes[0].figure` is the
        figure. Raises PluginUnavailable without matplotlib, which the extra `plot` installs.
        """
        return plot(self)

    def until(self, t_s: float) -> Trace:
        """Return the trace up to time `t_s`: every tick and image that is not later."""
        n = int(np.searchsorted(self.t_s, t_s, side="right"))
        m = int(np.searchsorted(self.pad_t_s, t_s, side="right"))
        cut: dict[str, Any] = {name: getattr(self, name)[:n] for name in TICK_COLUMNS}
        cut.update({name: getattr(self, name)[:m] for name in PAD_COLUMNS})
        signals = {
            name: value[:n] if isinstance(value, np.ndarray) else value.until(t_s)
            for name, value in self.signals.items()
        }
        events = tuple(event for event in self.events if event.t_s <= t_s)
        return evolve(self, **cut, signals=signals, events=events)


@define(eq=False)
class TraceRecorder:
    """Collects the ticks of a running grasp; `trace()` returns those collected so far.

    Images that are numpy arrays are copied to a temporary file, so that they do not fill the memory.
    """

    units: Mapping[str, str] = field(factory=lambda: dict(SI_UNITS))
    frames: list[Frame] = field(factory=list, init=False)
    phases: list[int] = field(factory=list, init=False)
    commands: list[float] = field(factory=list, init=False)
    images: list[Pads] = field(factory=list, init=False)
    signals: list[Any] = field(factory=list, init=False)
    events: list[GraspEvent] = field(factory=list, init=False)
    _blocks: tuple[Floats, ...] = field(default=(), init=False)
    """The frames that were converted to numbers before, in whole blocks."""
    pads: Pads = field(default=NO_PADS, init=False)
    """The last image, which has as many cells also before the first one."""
    _kept: tuple[tuple[int, KeptImages], ...] | None = field(default=None, init=False)
    """The images that are numpy arrays, with the numbers of their channels; None before the first tick."""

    def add(self, reading: Reading, phase: int, command: Command) -> None:
        """Add one tick, and its cell image if the counter of the image is new."""
        frame, pads, signals = reading
        self.frames.append(frame)
        self.pads = pads
        if signals:
            self.signals.append(self._without_arrays(signals))
        self.phases.append(phase)
        self.commands.append(command.value)
        images = self.images
        if pads.counter and (not images or images[-1].counter != pads.counter):
            images.append(pads)

    def _without_arrays(self, signals: Any) -> Any:
        """Keep the images that are numpy arrays, and return the signals with a reference to each."""
        if self._kept is None:
            self._kept = tuple(
                (i, KeptImages(value.cells))
                for i, value in enumerate(signals)
                if isinstance(value, Image) and isinstance(value.cells, np.ndarray)
            )
        if not self._kept:
            return signals
        values = list(signals)
        for i, images in self._kept:
            values[i] = images.add(values[i])
        return type(signals)._make(values)

    def trace(self) -> Trace:
        """Return the trace of the ticks collected so far."""
        trace = self.first_ticks(len(self.frames), len(self.images))
        if not self.images:
            none = np.empty((0, len(self.pads.left)))
            trace = evolve(trace, pad_left=none, pad_right=none.copy())
        return evolve(trace, events=tuple(self.events))

    def first_ticks(self, n: int, m: int) -> Trace:
        """Return the trace of the first `n` ticks with the first `m` images, without events.

        A thread may call it while ticks are added: the lists only grow. Blocks of frames are converted once.
        """
        blocks = self._blocks
        self._blocks = blocks = (*blocks, *_blocks_of(self.frames[len(blocks) * BLOCK : n - n % BLOCK]))
        whole = blocks[: n // BLOCK]
        return _trace_from(
            [*whole, *_blocks_of(self.frames[len(whole) * BLOCK : n])],
            self.phases[:n],
            self.commands[:n],
            self.images[:m],
            self.units,
            self.signals[:n],
        )


def trace_of(
    frames: Sequence[Frame],
    phases: Sequence[int],
    commands: Sequence[float],
    images: Sequence[Pads],
    units: Mapping[str, str] = SI_UNITS,
    signals: Sequence[Any] = (),
) -> Trace:
    """Return the trace of these ticks and images. `frames`, `phases` and `commands` must have the same length.

    `signals` are the values of `Reading.signals` in each tick, if the gripper has further channels.
    """
    return _trace_from(_blocks_of(frames), phases, commands, images, units, signals)


def _blocks_of(frames: Sequence[Any]) -> list[Floats]:
    """Return the numbers of the frames, a row each, in arrays of at most `BLOCK` rows."""
    width = len(_FRAME_COLUMNS)
    blocks = []
    for start in range(0, len(frames), BLOCK):
        block = frames[start : start + BLOCK]
        numbers = np.fromiter(chain.from_iterable(block), dtype=np.float64, count=len(block) * width)
        blocks.append(numbers.reshape(len(block), width))
    return blocks


def _trace_from(
    blocks: Sequence[Floats],
    phases: Sequence[int],
    commands: Sequence[float],
    images: Sequence[Pads],
    units: Mapping[str, str],
    signals: Sequence[Any],
) -> Trace:
    table = np.concatenate(blocks) if blocks else np.empty((0, len(_FRAME_COLUMNS)))
    columns: dict[str, Any] = {
        name: np.ascontiguousarray(table[:, i]) for i, name in enumerate(_FRAME_COLUMNS) if name != "dt_s"
    }
    columns["status"] = columns["status"].astype(np.int64)
    return Trace(
        **columns,
        phase=np.array(phases, dtype=np.int64),
        command=np.array(commands, dtype=np.float64),
        pad_t_s=np.array([image.t_s for image in images], dtype=np.float64),
        pad_left=_rows([image.left for image in images]),
        pad_right=_rows([image.right for image in images]),
        units=dict(units),
        signals=signals_of(signals),
    )


def signals_of(ticks: Sequence[Any]) -> dict[str, SignalTrace]:
    """Return the trace of each further channel, given the values of `Reading.signals` in each tick."""
    names = getattr(ticks[0], "_fields", ()) if ticks else ()
    return {name: _signal([tick[i] for tick in ticks]) for i, name in enumerate(names)}


def _signal(values: Sequence[Any]) -> SignalTrace:
    if isinstance(values[0], Image):
        counters = [0, *(image.counter for image in values)]
        images = [image for image, last in zip(values, counters, strict=False) if image.counter != last]
        t_s = np.array([image.t_s for image in images], dtype=np.float64)
        return ImageTrace(t_s=t_s, cells=_cells([image.cells for image in images], values[0].cells))
    if isinstance(values[0], Samples):
        return _samples([block for block in values if block.new])
    return np.array(values, dtype=np.float64)


def _cells(images: Sequence[Any], example: Any) -> NDArray[Any]:
    """Return the cells of these images in one array. `example` are cells of the same type where there is no image."""
    if isinstance(example, KeptImages):
        return example.first_images(len(images))
    if isinstance(example, np.ndarray):
        cells = np.array(images, dtype=example.dtype).reshape(len(images), *example.shape)
        cells.setflags(write=False)
        return cells
    if example and isinstance(example[0], tuple):
        return np.array(images, dtype=np.float64).reshape(len(images), len(example), len(example[0]))
    return _rows(images)


def _samples(blocks: Sequence[Samples]) -> SampleTrace:
    """Return the samples of these blocks, each with a time between that of its block and that of the one before."""
    times: list[float] = []
    lost = 0
    spacing = 0.0
    if len(blocks) > 1:
        spacing = (blocks[1].t_s - blocks[0].t_s) / max(blocks[1].counter - blocks[0].counter, 1)
    for i, block in enumerate(blocks):
        if i:
            new = max(block.counter - blocks[i - 1].counter, 1)
            lost += new - block.new
            spacing = (block.t_s - blocks[i - 1].t_s) / new
        times += [block.t_s - spacing * back for back in range(block.new - 1, -1, -1)]
    return SampleTrace(
        t_s=np.array(times, dtype=np.float64),
        values=_rows([row for block in blocks for row in block.values[: block.new]]),
        lost=lost,
    )


def _rows(rows: Sequence[Sequence[float]]) -> Floats:
    """Return rows of equal length as an array with two dimensions, also where there is none."""
    return np.array(rows, dtype=np.float64).reshape(len(rows), len(rows[0]) if rows else 0)


class KeptImages:
    """The images of one channel of a running grasp, in a temporary file, so that they do not fill the memory.

    They are numpy arrays, all of the type and the shape of `example`, in the order of their counters.

    The file has no name, and is gone with the last array that shows it. Images for which the disk has no room are kept
    in memory.
    """

    def __init__(self, example: NDArray[Any]) -> None:
        self._dtype, self._shape, self._bytes = example.dtype, example.shape, example.nbytes
        self._fd = -1
        self._written = 0
        self._beside: list[NDArray[Any]] = []
        self._last = Image(0.0, 0, self)

    def add(self, image: Image) -> Image:
        """Keep an image if its counter is new. Return it with this object in place of its cells."""
        if image.counter != self._last.counter:
            # After the first image without room, the others stay beside the file: it has them in order.
            if self._beside or not self._write(image.cells):
                self._beside.append(np.array(image.cells))
            self._last = Image(image.t_s, image.counter, self)
        return self._last

    def first_images(self, number: int) -> NDArray[Any]:
        """Return the cells of the first images, shape (number, ...), read-only. The file is not read as a whole."""
        written = min(number, self._written)
        cells = np.empty((0, *self._shape), self._dtype)
        if written:
            shown = mmap.mmap(self._fd, written * self._bytes, access=mmap.ACCESS_READ)
            cells = np.frombuffer(shown, self._dtype).reshape(written, *self._shape)
        if number > written:
            cells = np.concatenate([cells, np.stack(self._beside[: number - written])])
        cells.setflags(write=False)
        return cells

    def _write(self, cells: NDArray[Any]) -> bool:
        """Write the cells behind those before them. Return whether there was room."""
        try:
            if self._fd < 0:
                self._fd, path = tempfile.mkstemp(prefix="graspsense-images-")
                weakref.finalize(self, os.close, self._fd)
                os.unlink(path)
            data, offset = cells.data.cast("B"), self._written * self._bytes
            while data:
                done = os.pwrite(self._fd, data, offset)
                data, offset = data[done:], offset + done
        except OSError:
            return False
        self._written += 1
        return True
