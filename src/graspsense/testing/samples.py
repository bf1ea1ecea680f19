"""Traces, tables and runs for checks: synthetic, and the same every time."""

from __future__ import annotations

from collections.abc import Iterable
from copy import deepcopy
from math import nan
from typing import Final

import numpy as np
from attrs import evolve, fields

from graspsense.core.components.channels import further
from graspsense.core.values.channel import Channel, FastChannel, TactileArray
from graspsense.core.values.features import Features, FeatureTable
from graspsense.core.values.signals import CHANNEL_OF_FIELD, GraspEvent, Outcome, Pads, Phase
from graspsense.core.values.signals import Frame as _Frame
from graspsense.core.values.trace import PAD_COLUMNS, ImageTrace, SampleTrace, SignalTrace, Trace, trace_of
from graspsense.core.values.trial import RunInfo, Trial
from graspsense.testing.model_gripper import CELLS, FIRST_PAD_CELL, model_gripper

RATE_HZ: Final = 500.0
COLUMNS_OF_CHANNEL: Final = {
    **{channel: (column,) for column, channel in CHANNEL_OF_FIELD.items()},
    "pads": PAD_COLUMNS,
}
"""The columns of a trace for each channel."""


def squeeze(stiffness_n_m: float = 4000.0, contacts: tuple[float, float] = (0.06, 0.0598)) -> Trace:
    """Return a whole grasp: approach at 10 mm/s, squeeze by 4 mm, hold with relaxation, release.

    The pads touch at the gaps `contacts` (m); a gap below 0 is never reached. The frames come at 500 Hz.

    >>> round(float(squeeze(stiffness_n_m=1000.0).force_left_n.max()), 1)
    4.0
    """
    dt = 1.0 / RATE_HZ
    times = np.arange(0.0, 2.4, dt)
    gap = np.interp(times, [0.0, 1.0, 1.5, 1.9, 2.3, 2.4], [0.07, 0.06, 0.056, 0.056, 0.072, 0.072])
    phase = np.select(
        [times < 1.02, times < 1.5, times < 1.9], [Phase.APPROACH, Phase.SQUEEZE, Phase.HOLD], Phase.RELEASE
    )
    velocity = np.gradient(gap, dt)
    relaxed = np.where(times > 1.5, 0.85 + 0.15 * np.exp(-(times - 1.5) / 0.1), 1.0)
    # A small ripple takes the place of noise, and is the same every time.
    ripple = 0.004 * np.sin(2.0 * np.pi * 61.0 * times)
    force = [stiffness_n_m * np.maximum(contact - gap, 0.0) * relaxed + ripple for contact in contacts]
    frames = [
        _Frame(float(t), dt, float(g), float(v), float(2.0 + f), float(f), float(r), 0.01, 0.01, 0)
        for t, g, v, f, r in zip(times, gap, velocity, force[0], force[1], strict=True)
    ]
    images = [_image(frame, 1 + i) for i, frame in enumerate(frames[:: int(0.041 * RATE_HZ)])]
    commands = (np.where(velocity <= 0.0, 10.0, -20.0)).tolist()
    return trace_of(frames, phase.tolist(), commands, images)


def _image(frame: _Frame, counter: int) -> Pads:
    """Return the cell image of this frame, with the force distributed smoothly on the gripping face."""
    rows, columns = np.divmod(np.arange(CELLS - FIRST_PAD_CELL), 3)
    blob = np.exp(-(((rows - 2.0) / 1.2) ** 2) - ((columns - 1.0) / 0.8) ** 2)
    cells = []
    for force in (frame.force_left_n, frame.force_right_n):
        face = 1600.0 * max(force, 0.0) * blob / blob.sum()
        cells.append((*(0.0,) * FIRST_PAD_CELL, *(float(round(count)) for count in face)))
    return Pads(frame.t_s, counter, cells[0], cells[1])


def with_channels(trace: Trace, channels: set[str]) -> Trace:
    """Return the trace of a gripper that has these channels only; the others are NaN.

    >>> bool(np.isnan(with_channels(squeeze(), {"gap"}).force_left_n).all())
    True
    """
    columns = {}
    for channel, names in COLUMNS_OF_CHANNEL.items():
        if channel in channels:
            continue
        for name in names:
            old = getattr(trace, name)
            columns[name] = old[:0].copy() if channel == "pads" else np.full_like(old, np.nan)
    return evolve(trace, **columns)


def with_signals(trace: Trace, channels: Iterable[Channel]) -> Trace:
    """Return the trace of a gripper that has the further ones of these channels, too.

    All follow the force on the left pad: a number of it in each tick, an image of an array every 20 ticks, and in each
    tick as many samples of a fast channel as it declares.
    """
    signals: dict[str, SignalTrace] = {}
    for channel in further(channels):
        force = trace.force_left_n
        if isinstance(channel, TactileArray):
            cells = np.linspace(0.0, 1.0, channel.numbers).reshape(channel.shape)
            felt = force[::20].reshape(-1, *(1,) * cells.ndim)
            signals[channel.name] = ImageTrace(
                t_s=trace.t_s[::20], cells=(felt * cells).astype(channel.dtype)
            )
        elif isinstance(channel, FastChannel):
            n = channel.samples
            back = np.arange(n - 1, -1, -1) / (n * RATE_HZ)
            ripple = np.cos(np.arange(n * len(trace)))[:, np.newaxis] * np.ones(len(channel.axes))
            signals[channel.name] = SampleTrace(
                t_s=(trace.t_s[:, np.newaxis] - back).ravel(),
                values=(0.1 + np.repeat(force, n))[:, np.newaxis] * ripple,
            )
        else:
            signals[channel.name] = force.copy()
    return evolve(trace, signals=signals)


def by_another_clock(trace: Trace, seconds: float = 0.0, slower: float = 1.0) -> Trace:
    """Return the trace with all times shifted, or as many times as long."""
    signals = {
        name: signal if isinstance(signal, np.ndarray) else evolve(signal, t_s=slower * signal.t_s + seconds)
        for name, signal in trace.signals.items()
    }
    return evolve(
        trace,
        t_s=slower * trace.t_s + seconds,
        velocity_m_s=trace.velocity_m_s / slower,
        pad_t_s=slower * trace.pad_t_s + seconds,
        signals=signals,
        events=tuple(evolve(event, t_s=slower * event.t_s + seconds) for event in trace.events),
    )


def contents_of(trace: Trace) -> dict[str, bytes]:
    """Return the contents of the arrays of a trace, and of its further channels, by their names in it."""
    arrays = {field.name: getattr(trace, field.name) for field in fields(Trace)}
    for name, signal in trace.signals.items():
        arrays[f"signals[{name!r}]"] = signal
        if not isinstance(signal, np.ndarray):
            arrays |= {
                f"signals[{name!r}].{field.name}": getattr(signal, field.name)
                for field in fields(type(signal))
            }
    return {name: value.tobytes() for name, value in arrays.items() if isinstance(value, np.ndarray)}


def unusual_traces() -> dict[str, Trace]:
    """Return the unusual traces that a feature set must handle, by their description."""
    whole = squeeze()
    return {
        "an empty trace": whole.until(-1.0),
        "a trace of one tick": whole.until(0.0),
        "a trace that ends before contact": whole.until(0.5),
        "a trace that ends at contact": whole.until(1.02),
        "a trace that ends in the squeeze": whole.until(1.3),
        "a trace in which nothing was there": squeeze(contacts=(-1.0, -1.0)),
        "a trace in which one pad touched": squeeze(contacts=(0.06, -1.0)),
        "a trace with contact from the first tick on": squeeze(contacts=(0.08, 0.08)),
        "a trace of an object without stiffness": squeeze(stiffness_n_m=0.0),
        "a trace without cell images": with_channels(whole, set(COLUMNS_OF_CHANNEL) - {"pads"}),
        "a trace without any channel": with_channels(whole, set()),
        "a trace with gaps in its numbers": _holed(whole),
    }


def _holed(trace: Trace) -> Trace:
    holed = deepcopy(trace)
    for names in COLUMNS_OF_CHANNEL.values():
        for name in names:
            if name != "pad_t_s":
                getattr(holed, name)[::7] = nan
    return holed


def sample_table(trials: int = 45, missing: bool = False) -> tuple[FeatureTable, list[str]]:
    """Return a table of trials with three separable labels, and their labels.

    With `missing`, values are missing at random.

    >>> table, labels = sample_table(6)
    >>> table.values.shape, labels[:2]
    ((6, 4), ['bottle:full_open', 'bottle:empty_open'])
    """
    rng = np.random.default_rng(5)
    labels = [("bottle:full_open", "bottle:empty_open", "can:full")[i % 3] for i in range(trials)]
    values = rng.normal(size=(trials, 4)) * [1e-3, 1e-3, 0.5, 0.02]
    values += np.array([[0.06, 0.055, 4.0, 0.2], [0.06, 0.050, 9.0, 0.4], [0.05, 0.049, 15.0, 0.1]])[
        np.arange(trials) % 3
    ]
    if missing:
        values[rng.random(values.shape) < 0.15] = nan
    names = ("p_first", "p_steady", "f_steady", "delta_t")
    return FeatureTable(names=names, units=("m", "m", "N", "s"), values=values), labels


def a_trial() -> Trial:
    """Return a finished trial, to test observers with.

    >>> a_trial().outcome.words
    'steady'
    """
    names = ("p_first", "f_steady")
    return Trial(
        run=RunInfo(
            components={"gripper": "graspsense-test/model_gripper 0.1"},
            settings={"run": {"seed": 7}, "gripper": {"type": "graspsense-test/model_gripper"}},
            seed=7,
            labels={"object": "bottle:full"},
        ),
        trace=squeeze(),
        outcome=Outcome.STEADY,
        reason="",
        features=Features(
            names=names, values=(0.06, nan), units=("m", "N"), reasons={"f_steady": "not measured"}
        ),
        prediction=None,
        device=model_gripper(()).open(0),
        report={},
        counts={"ticks": 1200, "late": 0, "guarded": 0},
        events=(an_event(),),
        seconds_simulated=2.4,
        seconds_wall=2.4,
    )


def an_event() -> GraspEvent:
    """Return an event, for observers."""
    return GraspEvent(1.02, Phase.SQUEEZE, "squeeze")
