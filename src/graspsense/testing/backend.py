"""Conformance checks of a sensor backend: hardware, an emulation of it, a simulation, or a recording."""

from __future__ import annotations

import json
import time
from collections.abc import Sequence
from contextlib import closing, suppress
from itertools import pairwise
from math import inf, isfinite, isnan, nan
from statistics import fmean, median
from typing import Any, Final

import numpy as np

from graspsense.core.components.channels import declared_dtype, dtype_of, further, no_signals, shape_of
from graspsense.core.components.config import create
from graspsense.core.components.delivered import Delivered
from graspsense.core.components.entries import KINDS
from graspsense.core.components.roles import SensorBackend
from graspsense.core.components.run_config import RunConfig
from graspsense.core.components.strict import keys_of
from graspsense.core.control.guard import GuardState, guard
from graspsense.core.grasp.protection.effort_ceiling import MARGIN
from graspsense.core.grasp.runner import Grasp, run_uninterrupted
from graspsense.core.values.channel import FLOATS, Channel, FastChannel, TactileArray
from graspsense.core.values.errors import DeviceLost, NoDevice, RecordingEnded, TareRefused, named
from graspsense.core.values.signals import (
    CHANNELS,
    EFFORT,
    FORCE,
    HOLD,
    POSITION,
    VELOCITY,
    Command,
    Frame,
    Image,
    Outcome,
    Pads,
    Reading,
    Samples,
)
from graspsense.testing import component, fingers, protection, recorded
from graspsense.testing.checks import CheckFailed, CheckSkipped, checks_of, demand, raises_nothing
from graspsense.testing.gentle import EFFORT_N, FORCE_N, GentleController, kind_of
from graspsense.testing.model_gripper import CHANNELS_OF_FIELD
from graspsense.testing.session import TIMEOUT_S, limits_of, readings_of, sums_of
from graspsense.testing.subject import Subject

WIDEST_M: Final = 0.5
GRACE_S: Final = 1.0
"""Time (s) by which a busy machine may exceed a time-out."""
FORGIVEN: Final = 0.25
"""Relative difference allowed between the measured and the declared rate."""
VANISHING_S: Final = 2.0


def describes_itself(subject: Subject) -> None:
    """`open` returns a DeviceInfo with a name, a rate and limits above zero, of the right types."""
    info = subject.session.info
    demand(bool(info.name), "DeviceInfo has no name: say what the gripper is")
    demand(
        info.clock in ("virtual", "device"),
        f"clock is {info.clock!r}: 'device' where a read waits for the gripper, 'virtual' where apply-then-read "
        "advances one tick",
    )
    for name in ("rate_hz", "effort_limit_n", "speed_limit_m_s"):
        value = getattr(info, name)
        demand(value > 0.0, f"{name} is {value}: it must be above 0")
    if info.opening is not None:
        demand(
            isfinite(info.effort_limit_n) and isfinite(info.speed_limit_m_s),
            f"a gripper that can be commanded has limits: effort {info.effort_limit_n} N, speed "
            f"{info.speed_limit_m_s} m/s",
        )
        demand(
            info.speed_limit_m_s <= 5.0,
            f"speed_limit_m_s is {info.speed_limit_m_s}: that is a speed in mm/s; give m/s",
        )


def opening_and_relaxing_are_accepted(subject: Subject) -> None:
    """The opening and the relaxing command are of kinds that it accepts."""
    info = subject.session.info
    for name, command in (("opening", info.opening), ("relaxed", info.relaxed)):
        if command is not None:
            kind = KINDS[command.kind]
            demand(
                kind in subject.entry.accepts,
                f"its {name} command is of kind {kind}; it accepts {', '.join(subject.entry.accepts) or 'none'}: use "
                "one of those, or add it to `accepts`",
            )


def frames_are_numbers(subject: Subject) -> None:
    """Every field of a frame is a Python float, `status` an int; cells are floats, as many as are declared."""
    cells = _cells(subject)
    # The words of a failure are made where it fails: those of every reading took most of the time of the checks.
    for reading in subject.session.readings:
        if not (
            isinstance(reading, Reading)
            and isinstance(reading.frame, Frame)
            and isinstance(reading.pads, Pads)
        ):
            raise CheckFailed(
                f"read returned {reading!r:.80}: return Reading(Frame(...), Pads(...), signals), with NO_PADS where "
                "there are no cells and () where there are no further channels"
            )
        frame, pads, _ = reading
        for name, value in zip(Frame._fields, frame, strict=True):
            kind = int if name == "status" else float
            if type(value) is not kind:
                raise CheckFailed(
                    f"{name} of a frame is {value!r} of type {type(value).__name__}: write {kind.__name__}(...)"
                )
        demand(
            type(pads.counter) is int and type(pads.t_s) is float,
            f"an image has counter {pads.counter!r} and t_s {pads.t_s!r}: an int and a float",
        )
        for side in (pads.left, pads.right):
            if not (
                isinstance(side, tuple) and len(side) == cells and all(type(cell) is float for cell in side)
            ):
                raise CheckFailed(
                    f"an image of a fingertip has the cells {side!r:.80}: give a tuple of {cells} floats, as many as "
                    "the channel 'pads' declares (NaN for a cell without a value)"
                )


def _cells(subject: Subject) -> int:
    """Return the declared number of cells of a fingertip; of a recording, which declares none, that of its images."""
    for channel in subject.entry.channels:
        if channel.name == "pads":
            if isinstance(channel, TactileArray):
                return channel.cells
            demand(
                subject.session.info.opening is None,
                "the channel 'pads' does not say which cells there are: declare TactileArray('pads', "
                f"{channel.unit!r}, rate, rows=..., columns=...)",
            )
            return len(subject.session.readings[0].pads.left)
    return 0


def channels_are_those_declared(subject: Subject) -> None:
    """A declared channel has numbers; a channel that is not declared is always NaN."""
    session = subject.session
    declared = {channel.name for channel in subject.entry.channels}
    recording = session.info.opening is None
    for name, channel in CHANNELS_OF_FIELD.items():
        values = [getattr(frame, name) for frame in session.frames]
        if channel not in declared:
            demand(
                all(map(isnan, values)),
                f"{name} has numbers ({next((value for value in values if not isnan(value)), nan):g}), and no channel "
                f"{channel!r} is declared: declare Channel({channel!r}, {CHANNELS[channel]!r}, rate), or give NaN",
            )
        elif not recording:
            demand(
                not all(map(isnan, values)),
                f"{name} is NaN in all {len(values)} frames, and the channel {channel!r} is declared: fill it, or "
                "take it out of `channels`",
            )
        demand(
            not any(map(_infinite, values)), f"{name} is infinite in a frame: give NaN for what is not known"
        )
    if "pads" not in declared:
        demand(not session.images, "cell images come, and no channel 'pads' is declared: declare it")
    elif not recording:
        demand(
            bool(session.images),
            "no cell image came, and the channel 'pads' is declared: count images from 1 on, or take it out",
        )


def signals_are_those_declared(subject: Subject) -> None:
    """Each further channel is delivered in `Reading.signals`, in the declared shape, and has numbers."""
    channels, session = further(subject.entry.channels), subject.session
    nothing = no_signals(channels)
    names = ", ".join(getattr(nothing, "_fields", ())) or "none"
    for reading in session.readings:
        fields = getattr(reading.signals, "_fields", ())
        demand(
            fields == getattr(nothing, "_fields", ()),
            f"the further channels declared are {names}, and read delivers {', '.join(fields) or 'none'}: fill "
            "signal_type(self.channels) with a value for each, in this order",
        )
        for channel, empty, value in zip(channels, nothing, reading.signals, strict=True):
            if type(value) is not type(empty) or (shape_of(value), dtype_of(value)) != (
                shape_of(empty),
                dtype_of(empty),
            ):
                raise CheckFailed(
                    f"{channel.name!r} is {value!r:.80}: give {type(empty).__name__}"
                    + (f" of the declared shape {shape_of(empty)}" if shape_of(empty) else "")
                    + (f" and the declared dtype {dtype_of(empty)}" if dtype_of(empty) != FLOATS else "")
                )
    for channel in channels:
        values = [getattr(reading.signals, channel.name) for reading in session.readings]
        if isinstance(channel, TactileArray) and channel.dtype != FLOATS:
            _demand_images(channel.name, [value.cells for value in values if value.counter])
            continue
        if isinstance(channel, TactileArray) and channel.components > 1:
            numbers = [number for value in values if value.counter for cell in value.cells for number in cell]
        elif isinstance(channel, TactileArray):
            numbers = [cell for value in values if value.counter for cell in value.cells]
        elif isinstance(channel, FastChannel):
            numbers = [number for value in values for row in value.values[: value.new] for number in row]
        else:
            numbers = values
        wrong = next((number for number in numbers if type(number) is not float or _infinite(number)), None)
        demand(wrong is None, f"{channel.name!r} has the value {wrong!r}: give finite floats, or NaN")
        demand(
            not all(map(isnan, numbers)),
            f"no number of the declared channel {channel.name!r} came in {len(values)} readings: fill it in "
            "`Reading.signals`, or take it out of `channels`",
        )


def _demand_images(name: str, images: Sequence[Any]) -> None:
    """Raise CheckFailed if no image of numpy arrays came, or none has a number; infinite numbers are none, either."""
    demand(
        any(not np.isnan(cells).all() for cells in images),
        f"no image of the declared channel {name!r} came: fill it in `Reading.signals`, or take it out of `channels`",
    )
    demand(
        not any(np.isinf(cells).any() for cells in images),
        f"{name!r} has an infinite number: give finite ones, or NaN",
    )


def images_stay_as_they_were_delivered(subject: Subject) -> None:
    """An image that is a numpy array is contiguous and read-only, and nobody changes it after it was delivered."""
    if all(declared_dtype(channel) == FLOATS for channel in further(subject.entry.channels)):
        raise CheckSkipped("this gripper has no images that are numpy arrays")
    problem, session = Delivered(subject.entry.channels).problem, subject.session
    for reading, sums in zip(session.readings, session.sums, strict=True):
        fault = problem(reading)
        demand(not fault, f"a reading is not as declared: {fault}")
        demand(
            sums_of(reading) == sums,
            "an image was changed after it was delivered, and laws and recordings refer to it: fill a new array for "
            "each image",
        )


def signals_have_no_gaps_or_repeats(subject: Subject) -> None:
    """Images and samples of further channels are counted: each once, and what is lost shows in the counter."""
    channels = further(subject.entry.channels)
    counted = [channel for channel in channels if isinstance(channel, TactileArray | FastChannel)]
    if not counted:
        raise CheckSkipped("this gripper has no further arrays or fast channels")
    for channel in counted:
        values = [getattr(reading.signals, channel.name) for reading in subject.session.readings]
        taken = last_s = 0.0
        for earlier, now in pairwise(values):
            came = now.counter - earlier.counter
            taken += came
            if isinstance(now, Samples):
                demand(
                    0 <= now.new <= channel.samples and came >= now.new,  # type: ignore[union-attr]
                    f"{channel.name!r} has {now.new} new samples while its counter goes from {earlier.counter} to "
                    f"{now.counter}: count every sample that the sensor has taken, also those that were lost",
                )
                demand(
                    all(isnan(number) for row in now.values[now.new :] for number in row),
                    f"{channel.name!r} has numbers behind its {now.new} new samples: they repeat old ones; give NaN",
                )
            else:
                demand(
                    came >= 0 and (came > 0 or _is_same(now, earlier)),
                    f"an image of {channel.name!r} changes while its counter stays at {now.counter}: count up",
                )
            if came:
                demand(
                    now.t_s > earlier.t_s or earlier.counter == 0,
                    f"{channel.name!r} goes from {earlier.t_s} to {now.t_s} s: what is new is later",
                )
                last_s = now.t_s
        first_s = next((value.t_s for value in values if value.counter), 0.0)
        if channel.rate_hz and last_s > first_s and taken > 10:
            rate = taken / (last_s - first_s)
            demand(
                abs(rate - channel.rate_hz) <= FORGIVEN * channel.rate_hz,
                f"{channel.name!r} comes at {rate:.3g} Hz and is declared at {channel.rate_hz:g} Hz: declare its rate",
            )


def _is_same(now: Image, earlier: Image) -> bool:
    if dtype_of(now) == FLOATS:
        return repr(now) == repr(earlier)
    return now[:2] == earlier[:2] and np.array_equal(now.cells, earlier.cells, equal_nan=True)


def channels_follow_from_the_settings(subject: Subject) -> None:
    """The declared channels follow from the settings alone, and opening the gripper does not change them."""
    if not subject.component.channels_vary():
        return
    again = subject.create()
    with closing(subject.create()) as backend:
        declared = backend.channels
        demand(
            isinstance(declared, tuple) and all(isinstance(channel, Channel) for channel in declared),
            f"`channels` returns {declared!r:.80}: return a tuple of Channel",
        )
        backend.open(0)
        for other, when in (
            (again.channels, "with the same settings"),
            (backend.channels, "once it is open"),
        ):
            demand(
                other == declared,
                f"`channels` are {_named(declared)}, and {_named(other)} {when}: make them depend on self.config only",
            )


def _named(channels: Sequence[Channel]) -> str:
    return ", ".join(f"{channel.name} at {channel.rate_hz:g} Hz" for channel in channels) or "none"


def _infinite(value: float) -> bool:
    return value in (inf, -inf)


def time_runs_forward(subject: Subject) -> None:
    """`t_s` increases from frame to frame, and `dt_s` is the difference."""
    session = subject.session
    demand(all(isfinite(frame.t_s) for frame in session.frames), "t_s of a frame is not a number")
    for earlier, now in pairwise(session.frames):
        passed = now.t_s - earlier.t_s
        demand(
            passed > 0.0,
            f"t_s goes from {earlier.t_s} to {now.t_s} s: a frame is given once, and each is later than the last",
        )
        demand(
            abs(now.dt_s - passed) <= 0.5 * passed + 1e-9,
            f"dt_s is {now.dt_s:g} s where {passed:g} s passed since the last frame: give the seconds between the two",
        )


def rate_is_as_declared(subject: Subject) -> None:
    """Frames come at `rate_hz`, and no channel is declared with a higher rate."""
    info, frames = subject.session.info, subject.session.frames
    passed = [now.t_s - earlier.t_s for earlier, now in pairwise(frames)]
    demand(bool(passed), "only one frame came")
    rate = 1.0 / median(passed)
    if info.units.get("t", "s") == "s":
        demand(
            abs(rate - info.rate_hz) <= FORGIVEN * info.rate_hz,
            f"frames come at {rate:.3g} Hz, rate_hz says {info.rate_hz:g}: declare that rate (is t_s in seconds?)",
        )
    for channel in subject.entry.channels:
        most = channel.samples if isinstance(channel, FastChannel) else 1
        demand(
            channel.rate_hz <= most * info.rate_hz * (1.0 + FORGIVEN),
            f"channel {channel.name!r} is declared at {channel.rate_hz:g} Hz, the gripper gives "
            f"{info.rate_hz:g} frames a second: declare the rate at which its value is new",
        )


def images_count_up(subject: Subject) -> None:
    """The counter increases with each new image, by more where some were lost; no image is later than its frame."""
    if not subject.session.images:
        raise CheckSkipped("this gripper has no cells")
    for earlier, now in pairwise(subject.session.images):
        demand(
            now.counter > earlier.counter and now.t_s > earlier.t_s,
            f"after image {earlier.counter} of {earlier.t_s} s comes image {now.counter} of {now.t_s} s: "
            "count up by one",
        )
    shown: dict[int, Pads] = {}
    for frame, pads, _ in subject.session.readings:
        demand(
            pads.counter == 0 or pads.t_s <= frame.t_s + 1e-9,
            f"the image of {pads.t_s} s comes with the frame of {frame.t_s} s: give the last image",
        )
        demand(
            repr(shown.setdefault(pads.counter, pads)) == repr(pads),
            f"image {pads.counter} changes while its counter stays: count up with each new image",
        )


def gap_is_in_metres(subject: Subject) -> None:
    """The gap lies between 0 and half a metre."""
    gaps = [frame.gap_m for frame in subject.session.frames if not isnan(frame.gap_m)]
    if not gaps:
        raise CheckSkipped("this gripper has no gap")
    if subject.session.info.units.get("gap", "m") != "m":
        raise CheckSkipped(f"a recording in {subject.session.info.units['gap']}")
    demand(
        min(gaps) >= -0.01 and max(gaps) <= WIDEST_M,
        f"gap_m goes from {min(gaps):g} to {max(gaps):g}: give the distance between the fingertip faces in metres"
        + (" (this looks like millimetres: divide by 1000)" if max(gaps) > WIDEST_M else ""),
    )


def forces_are_in_newtons(subject: Subject) -> None:
    """No force of a pad, an edge or the drive exceeds what the limit of the gripper allows."""
    info = subject.session.info
    most = max(3.0 * info.effort_limit_n, 50.0)
    for name in ("force_left_n", "force_right_n", "edge_left_n", "edge_right_n", "effort_n"):
        values = [abs(getattr(frame, name)) for frame in subject.session.frames]
        worst = max((value for value in values if not isnan(value)), default=0.0)
        demand(
            worst <= most,
            f"{name} reaches {worst:g} while the fingers are closed gently on a gripper of {info.effort_limit_n:g} N: "
            "give newtons, tared (raw counts go into Pads)",
        )


def velocity_is_the_rate_of_the_gap(subject: Subject) -> None:
    """The sum of `velocity_m_s` over time is the change of the gap; closing is negative."""
    frames = [reading.frame for reading in subject.session.stages.get("closing", [])]
    if not frames or isnan(frames[0].velocity_m_s) or isnan(frames[0].gap_m):
        raise CheckSkipped("this gripper has no velocity and gap of its own, or is a recording")
    moved = frames[-1].gap_m - frames[0].gap_m
    summed = sum(frame.velocity_m_s * frame.dt_s for frame in frames[1:])
    if max(abs(moved), abs(summed)) < 2e-3:
        raise CheckSkipped(f"the gap moved by {abs(moved) * 1e3:.2g} mm only")
    demand(
        abs(summed - moved) <= 0.3 * abs(moved),
        f"velocity_m_s adds up to {summed * 1e3:.3g} mm where the gap moved by {moved * 1e3:.3g} mm: give the rate of "
        "the gap in m/s, negative while it closes (both fingers together)",
    )


def closing_closes(subject: Subject) -> None:
    """A gentle closing command reduces the gap; the opening command increases it again."""
    stages = subject.session.stages
    if "closing" not in stages:
        raise CheckSkipped("a recording cannot be commanded")
    gaps = [reading.frame.gap_m for reading in stages["closing"]]
    if all(map(isnan, gaps)):
        raise CheckSkipped("this gripper has no gap")
    kind = KINDS[kind_of(subject.entry.accepts)]
    demand(
        gaps[0] - gaps[-1] > 1e-3,
        f"under a closing {kind} command the gap goes from {gaps[0]:.4g} to {gaps[-1]:.4g} m: an "
        "effort or force above 0, a velocity below 0 and a smaller position close the fingers",
    )
    opened = [reading.frame.gap_m for reading in stages["open again"]]
    demand(
        max(opened) - opened[0] > 1e-3,
        f"under the opening command {subject.session.info.opening} the gap goes from {opened[0] * 1e3:.4g} to "
        f"{opened[-1] * 1e3:.4g} mm: it must rise",
    )


def stays_within_its_limits(subject: Subject) -> None:
    """Under the largest commands of each kind, the reported effort and speed stay within their limits."""
    if subject.session.info.opening is None:
        raise CheckSkipped("a recording cannot be commanded")
    for name in subject.entry.accepts:
        kind = KINDS.index(name)
        too_fast = _speed_beyond_limit(subject, kind)
        if too_fast:
            # Fingers that other work on the computer holds up catch up faster, but hardly in a second session.
            too_fast = _speed_beyond_limit(subject, kind)
        demand(not too_fast, too_fast)


def _speed_beyond_limit(subject: Subject, kind: int) -> str:
    """Return in words what speed exceeds its limit under the largest commands of this kind; empty if none does.

    An effort beyond its limit fails the check at once.
    """
    with closing(subject.create()) as backend:
        least_force_n, least_speed_m_s = backend.least_force_n, backend.least_speed_m_s
        info = backend.open(0)
        first_limits = limits_of(info)
        # The limits of a first use apply after a contact too.
        limits = first_limits._replace(
            effort_limit_n=first_limits.first_effort_n, speed_limit_m_s=first_limits.first_speed_m_s
        )
        watcher = GuardState(0, 0, 0)
        greatest = {VELOCITY: -1e6, POSITION: 0.0, FORCE: 1e6, EFFORT: 1e6}[kind]
        command = Command(kind, greatest, inf, inf)
        for _ in range(max(int(0.5 * info.rate_hz), 20)):
            reading = backend.read(TIMEOUT_S)
            if reading is None:
                continue
            frame = reading.frame
            effort, speed = (
                f"{name} reaches {abs(value):.3g} under {KINDS[kind]} commands limited to {limit:g}: apply "
                "`effort_limit_n` and `speed_limit_m_s` of each command"
                if abs(value) > grace * max(limit, least)
                else ""
                for name, value, limit, least, grace in (
                    ("effort_n", frame.effort_n, limits.first_effort_n, least_force_n, 1.1),
                    ("velocity_m_s", frame.velocity_m_s, limits.first_speed_m_s, least_speed_m_s, 3.0),
                )
            )
            demand(not effort, effort)
            if speed:
                return speed
            allowed, watcher = guard(limits, watcher, frame, command)
            backend.apply(allowed)
    return ""


def says_what_commands_become(subject: Subject) -> None:
    """A gripper that closes by itself says for each kind of command what it becomes, and accepts no effort."""
    backend = subject.create()
    if not backend.closes_itself:
        return
    demand(
        "effort" not in subject.entry.accepts,
        "it closes by itself and accepts an effort, which has no speed, so that it would rush: take 'effort' out of "
        "`accepts`",
    )
    lacking = [kind for kind in subject.entry.accepts if not backend.closes_itself.get(kind)]
    demand(
        not lacking,
        f"`closes_itself` does not say what a command of {', '.join(lacking)} becomes: write it in a few words",
    )


def accepts_every_declared_kind(subject: Subject) -> None:
    """Each kind in `accepts` can be applied, and frames continue to come."""
    demand(bool(subject.entry.accepts), "`accepts` is empty: a gripper takes at least one kind of command")
    with closing(subject.create()) as backend:
        info = backend.open(0)
        for name in subject.entry.accepts:
            kind = KINDS.index(name)
            value = {
                EFFORT: min(EFFORT_N, info.effort_limit_n) / 4.0,
                VELOCITY: 0.001,
                POSITION: 0.05,
                FORCE: FORCE_N,
            }[kind]
            backend.read(TIMEOUT_S)
            advice = f" on a {name} command, which `accepts` says it takes: take it, or take {name!r} out of `accepts`"
            with raises_nothing("apply", advice):
                backend.apply(Command(kind, value, min(EFFORT_N, info.effort_limit_n), 0.01))
            demand(
                any(backend.read(TIMEOUT_S) is not None for _ in range(10)),
                f"after a {name} command no frame came",
            )
        backend.apply(info.relaxed)


def read_returns_within_its_timeout(subject: Subject) -> None:
    """`read` returns a frame or None within its time-out."""
    longest = subject.session.longest_read_s
    if longest > TIMEOUT_S + GRACE_S:
        # Other work on the computer can hold a read up, too, but hardly in a second session.
        longest = min(longest, readings_of(subject).longest_read_s)
    demand(
        longest <= TIMEOUT_S + GRACE_S,
        f"a read with a time-out of {TIMEOUT_S} s took {longest:.2f} s: return None when nothing came in time",
    )


def pads_can_be_zeroed(subject: Subject) -> None:
    """After a tare with unloaded images the forces are near zero; a tare without enough images is refused."""
    info, declared = subject.session.info, {channel.name for channel in subject.entry.channels}
    if not info.tare_images or not declared & {"force_left", "force_right"}:
        raise CheckSkipped("this gripper is not tared")
    with closing(subject.create()) as backend:
        info = backend.open(0)
        with (
            raises_nothing("a tare without images", ": raise TareRefused with what to do"),
            suppress(TareRefused),
        ):
            backend.tare([])
        images: list[Pads] = []
        for _ in range(int(5.0 * info.rate_hz)):
            reading = backend.read(TIMEOUT_S)
            newest = images[-1].counter if images else 0
            if reading is not None and reading.pads.counter > newest:
                images.append(reading.pads)
            backend.apply(info.relaxed)
            if len(images) >= info.tare_images:
                break
        demand(
            len(images) >= info.tare_images,
            f"{len(images)} images came in 5 s, a tare needs {info.tare_images}",
        )
        backend.tare(images)
        forces = []
        for _ in range(20):
            reading = backend.read(TIMEOUT_S)
            backend.apply(info.relaxed)
            if reading is not None:
                forces += [reading.frame.force_left_n, reading.frame.force_right_n]
        known = [force for force in forces if not isnan(force)]
        demand(
            bool(known) and abs(fmean(known)) < 0.6,
            f"after the tare the unloaded pads feel {fmean(known or [nan]):.3g} N: subtract the zero, then divide by "
            "the counts of a newton",
        )


def closes_in_any_state(subject: Subject) -> None:
    """`close` works before `open`, after it, twice, and during a command; the gripper can then be opened again."""
    backend = subject.create()
    stage = "before open"
    try:
        backend.close()
        for attempt in ("the first", "the second"):
            stage = f"after {attempt} opening"
            info = backend.open(0)
            _first_frame(backend)
            backend.apply(info.relaxed)
            backend.close()
            stage = "for the second time"
            backend.close()
    except CheckFailed:
        raise
    except Exception as error:
        raise CheckFailed(
            f"{stage} it raised {named(error)}: `close` must release everything in any state"
        ) from error


def _first_frame(backend: SensorBackend[Any]) -> Frame:
    for _ in range(20):
        reading = backend.read(TIMEOUT_S)
        if reading is not None:
            return reading.frame
    raise CheckFailed("no frame came after it was opened again")


def same_seed_same_frames(subject: Subject) -> None:
    """On a virtual clock the same seed gives the same frames."""
    if subject.session.info.clock != "virtual":
        raise CheckSkipped("a device clock: measurements are never the same twice")
    texts = []
    for _ in range(2):
        readings: list[str] = []
        with closing(subject.create()) as backend, suppress(RecordingEnded):
            info = backend.open(3)
            for _ in range(100):
                readings.append(repr(backend.read(TIMEOUT_S)))
                backend.apply(info.opening or info.relaxed)
        texts.append(readings)
    demand(
        texts[0] == texts[1],
        "two openings with one seed give other frames: draw everything from the seed that `open` is given",
    )


def expect_accepts_any_controller(subject: Subject) -> None:
    """`expect` accepts any controller before `open`, and `expect_features` any set; both raise and open nothing."""
    controller, run = GentleController(kind_of(subject.entry.accepts)), RunConfig()
    feature_set = create("feature-set", "chitta")
    advice = ": store the arguments, open nothing, and raise in `open` instead"
    with (
        closing(subject.create(**(subject.absent or {}))) as backend,
        raises_nothing("expect or expect_features", advice),
    ):
        backend.expect(controller, run)
        backend.expect_features(feature_set)
    with closing(subject.create()) as backend:
        backend.expect(controller, run)
        backend.expect_features(feature_set)
        backend.open(0)


def objects_can_be_grasped(subject: Subject) -> None:
    """Each object that it declares can be grasped; a simulated gripper declares objects, and no other does."""
    kinds = subject.create().objects()
    if not kinds:
        demand(
            not subject.session.info.simulated,
            "it is simulated and objects() is empty, so it holds the same thing under every label: return an "
            "ObjectKind for each thing that it can hold, and take one in with_object, as in "
            "`type(self)(attrs.evolve(self.config, object=name))`",
        )
        raise CheckSkipped("it grasps real objects")
    demand(
        "object" in keys_of(subject.component.config_class()),
        "objects() names what it can hold, and its settings have no key 'object', which --object and `collect` set: "
        "add `object: str = setting(default=..., effect=NAMES_INPUT, meaning=...)` to its config",
    )
    names = [name for kind in kinds for name in kind.full_names]
    twice = {name for name in names if names.count(name) > 1}
    demand(not twice, f"objects() gives {', '.join(sorted(twice))} twice: give each full name once")
    for kind in kinds:
        name = kind.full_names[0]
        with (
            raises_nothing(f"the opening of with_object({name!r})", ", although objects() gives that name"),
            closing(subject.create().with_object(name)) as backend,
        ):
            simulated = backend.open(0).simulated
        demand(
            simulated,
            f"objects() gives {name!r}, but the opened gripper is not simulated: give DeviceInfo(simulated=True, ...), "
            "or no objects",
        )


def _gentle_grasp(subject: Subject) -> Grasp:
    """Return a gentle grasp; performed once."""
    if "gentle grasp" not in subject.kept:
        controller = GentleController(kind_of(subject.entry.accepts))
        subject.kept["gentle grasp"] = run_uninterrupted(subject.create(), controller, RunConfig(hold_s=0.05))
    grasp: Grasp = subject.kept["gentle grasp"]
    return grasp


def squeezes_with_what_it_is_asked(subject: Subject) -> None:
    """At rest on an object, no force exceeds the limit that was commanded, or the least that the gripper declares."""
    if subject.session.info.opening is None:
        raise CheckSkipped("a recording cannot be commanded")
    grasp, backend = _gentle_grasp(subject), subject.create()
    held = grasp.trace.phase == HOLD
    if not held.any():
        raise CheckSkipped("a gentle grasp came to rest on nothing")
    kind = kind_of(subject.entry.accepts)
    asked_n = max(FORCE_N if kind == FORCE else EFFORT_N, backend.least_force_n)
    for name in ("effort_n", "force_left_n", "force_right_n"):
        values = getattr(grasp.trace, name)[held]
        known = values[values == values].tolist()
        most_n = median(known) if known else 0.0
        demand(
            most_n <= MARGIN * asked_n + grasp.device.friction_n + 1.0,
            f"it holds with a {name} of {most_n:.3g} where {KINDS[kind]} commands allow {asked_n:g} N: keep to "
            "`effort_limit_n` of a command, or declare the least that it can do as `least_force_n` of its class",
        )


def performs_a_whole_grasp(subject: Subject) -> None:
    """The runner can perform a whole grasp: open, tare, close, hold, open again, relax."""
    kind, grasp = kind_of(subject.entry.accepts), _gentle_grasp(subject)
    demand(
        grasp.outcome not in (Outcome.ABORTED, Outcome.DEVICE_LOST, Outcome.RUNNING),
        f"a gentle grasp with {KINDS[kind]} commands ended as {grasp.outcome.words}: {grasp.reason}",
    )
    demand(len(grasp.trace) > 0, "a gentle grasp left no trace")


def reports_plain_values(subject: Subject) -> None:
    """`report` returns numbers, text and booleans that JSON represents, while it is open and after it was closed."""
    with closing(subject.create()) as backend:
        backend.open(0)
        reports = [backend.report()]
    reports.append(backend.report())
    for report in reports:
        with raises_nothing(f"JSON, given the report {report!r},", ": numbers, text and booleans only"):
            json.dumps(dict(report))


def dry_run_accepts_the_same_commands(subject: Subject) -> None:
    """The gripper of a dry run is a separate backend that accepts the same kinds of command, or there is none."""
    other = subject.create().dry_run_backend()
    if other is None:
        raise CheckSkipped("it has no gripper for a dry run")
    demand(
        isinstance(other, SensorBackend),
        f"dry_run_backend returned {other!r}: return a SensorBackend or None",
    )
    with closing(other):
        info = other.open(0)
        demand(
            info.opening is None or KINDS[info.opening.kind] in subject.entry.accepts,
            f"the gripper of a dry run opens with {info.opening}, of a kind that the real one does not accept",
        )
        _first_frame(other)


def reports_a_lost_device(subject: Subject) -> None:
    """When unplugged, it raises DeviceLost with advice, a grasp ends as device lost, and it can be closed."""
    if subject.unplugged is None:
        raise CheckSkipped(
            "no settings were given under which it vanishes (--unplugged, or `unplugged` in a test)"
        )
    with closing(subject.create(**subject.unplugged)) as backend:
        info = backend.open(0)
        text = _lost(backend, info.relaxed, info.rate_hz)
    demand(len(text) > 10, f"DeviceLost says {text!r}: say which gripper, and what to look at")
    grasp = run_uninterrupted(
        subject.create(**subject.unplugged), GentleController(kind_of(subject.entry.accepts)), RunConfig()
    )
    demand(
        grasp.outcome == Outcome.DEVICE_LOST,
        f"a grasp with a gripper that vanishes ended as {grasp.outcome.words} ({grasp.reason}), not as device lost",
    )


def _lost(backend: SensorBackend[Any], relaxed: Command, rate_hz: float) -> str:
    until = time.perf_counter() + 3.0 * VANISHING_S + GRACE_S
    for _ in range(int(4.0 * VANISHING_S * rate_hz) + 50):
        with raises_nothing("unplugged, it", ": turn what the driver raises into DeviceLost"):
            try:
                backend.read(TIMEOUT_S)
                backend.apply(relaxed)
            except DeviceLost as lost:
                return str(lost)
        if time.perf_counter() > until:
            break
    raise CheckFailed(
        f"unplugged, it never raised DeviceLost within {VANISHING_S:g} s of its clock: raise it where read or apply "
        "finds the gripper gone"
    )


def reports_a_missing_device(subject: Subject) -> None:
    """If it is not connected, `open` raises NoDevice, which says what was searched for and what to try."""
    if subject.absent is None:
        raise CheckSkipped(
            "no settings were given under which it is not there (--absent, or `absent` in a test)"
        )
    began = time.perf_counter()
    with (
        closing(subject.create(**subject.absent)) as backend,
        raises_nothing("not there, open", ": raise NoDevice with what to try"),
    ):
        try:
            backend.open(0)
            raise CheckFailed("open succeeded where no gripper is: raise NoDevice if nothing answers")
        except NoDevice as error:
            text = str(error)
    took = time.perf_counter() - began
    demand(took < 10.0, f"it took {took:.1f} s to say so: `open` is bounded in time")
    demand(len(text) > 20, f"NoDevice says {text!r}: say what was searched for, where, and what to try")


CHECKS: Final = (
    *component.CHECKS,
    *checks_of(
        describes_itself,
        opening_and_relaxing_are_accepted,
        frames_are_numbers,
        channels_follow_from_the_settings,
        channels_are_those_declared,
        signals_are_those_declared,
        images_stay_as_they_were_delivered,
        signals_have_no_gaps_or_repeats,
        fingers.fingers_are_those_declared,
        time_runs_forward,
        rate_is_as_declared,
        images_count_up,
        gap_is_in_metres,
        forces_are_in_newtons,
        velocity_is_the_rate_of_the_gap,
        closing_closes,
        stays_within_its_limits,
        says_what_commands_become,
        accepts_every_declared_kind,
        read_returns_within_its_timeout,
        pads_can_be_zeroed,
        closes_in_any_state,
        same_seed_same_frames,
        expect_accepts_any_controller,
        objects_can_be_grasped,
        performs_a_whole_grasp,
        squeezes_with_what_it_is_asked,
        recorded.what_it_delivers_is_kept,
        reports_plain_values,
        dry_run_accepts_the_same_commands,
        reports_a_lost_device,
        reports_a_missing_device,
        protection.declares_what_protects,
        protection.hostile_laws_stay_below_the_ceiling,
        protection.a_silent_pad_ends_the_grasp,
    ),
)
