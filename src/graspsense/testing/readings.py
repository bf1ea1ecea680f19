"""Checks of what a gripper delivers: frames, channels, signals, images, rates and units."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from math import inf, isclose, isfinite, isinf, isnan, nan
from statistics import median
from typing import Any, Final

import numpy as np

from graspsense.core.components.channels import declared_dtype, dtype_of, further, no_signals
from graspsense.core.components.delivered import Delivered, numbers_of
from graspsense.core.values.channel import FLOATS, Channel, FastChannel, TactileArray
from graspsense.core.values.fingers import fingers_of, opposed_forces
from graspsense.core.values.signals import (
    CHANNEL_OF_FIELD,
    CHANNELS,
    Frame,
    Image,
    Pads,
    Samples,
)
from graspsense.testing.checks import CheckFailed, CheckSkipped, demand
from graspsense.testing.session import opened, sums_of
from graspsense.testing.subject import Subject

WIDEST_M: Final = 0.5
WIDER: Final = ((20.0, "millimetres: divide by 1000"), (2.0, "centimetres: divide by 100"))
"""Gaps above which one is given in another unit, and which."""
FORGIVEN: Final = 0.25
"""Relative difference allowed between the measured and the declared rate."""


def frames_are_numbers(subject: Subject) -> None:
    """Every field of a frame is a Python float, `status` an int; the cells of a fingertip are a tuple of floats."""
    # The words of a failure are made where it fails: those of every reading took most of the time of the checks.
    for reading in subject.session.readings:
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
            if not (isinstance(side, tuple) and all(type(cell) is float for cell in side)):
                raise CheckFailed(
                    f"an image of a fingertip has the cells {side!r:.80}: give a tuple of floats (NaN for a cell "
                    "without a value)"
                )


def channels_are_those_declared(subject: Subject) -> None:
    """A declared channel has numbers; a channel that is not declared is always NaN."""
    session = subject.session
    declared = {channel.name for channel in subject.entry.channels}
    recording = session.info.opening is None
    for name, channel in CHANNEL_OF_FIELD.items():
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
        demand(not any(map(isinf, values)), f"{name} is infinite in a frame: give NaN for what is not known")
    if "pads" not in declared:
        demand(not session.images, "cell images come, and no channel 'pads' is declared: declare it")
    elif not recording:
        (pads,) = (channel for channel in subject.entry.channels if channel.name == "pads")
        demand(
            isinstance(pads, TactileArray),
            "the channel 'pads' does not say which cells there are: declare TactileArray('pads', "
            f"{pads.unit!r}, rate, rows=..., columns=...)",
        )
        demand(
            bool(session.images),
            "no cell image came, and the channel 'pads' is declared: count images from 1 on, or take it out",
        )


def signals_are_those_declared(subject: Subject) -> None:
    """Each further channel is delivered in `Reading.signals`, in its shape, arrays read-only, and has numbers."""
    channels, session = further(subject.entry.channels), subject.session
    nothing, problem = no_signals(channels), Delivered(subject.entry.channels).problem
    names = ", ".join(getattr(nothing, "_fields", ())) or "none"
    for reading in session.readings:
        fields = getattr(reading.signals, "_fields", ())
        demand(
            fields == getattr(nothing, "_fields", ()),
            f"the further channels declared are {names}, and read delivers {', '.join(fields) or 'none'}: fill "
            "signal_type(self.channels) with a value for each, in this order",
        )
        fault = problem(reading)
        demand(not fault, f"a reading is not as declared: {fault}")
    for channel in channels:
        values = [getattr(reading.signals, channel.name) for reading in session.readings]
        if isinstance(channel, TactileArray) and channel.dtype != FLOATS:
            _demand_images(channel.name, [value.cells for value in values if value.counter])
            continue
        if isinstance(channel, FastChannel):
            values = [value._replace(values=value.values[: value.new]) for value in values]
        numbers = [
            number for value in values if getattr(value, "counter", True) for number in numbers_of(value)
        ]
        wrong = next((number for number in numbers if type(number) is not float or isinf(number)), None)
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


def fingers_are_those_declared(subject: Subject) -> None:
    """The two forces of each frame follow from the forces of the declared fingers by the declared rule."""
    fingers = fingers_of(subject.entry.channels)
    if not fingers:
        return
    try:
        forces_of = opposed_forces(fingers)
    except ValueError as error:
        raise CheckFailed(f"its fingers: {error}") from error
    for reading in subject.session.readings:
        each = [getattr(reading.signals, finger.name) for finger in fingers]
        frame = reading.frame
        for side, given, follows in zip(
            ("left", "right"), (frame.force_left_n, frame.force_right_n), forces_of(each), strict=True
        ):
            same = isclose(given, follows, rel_tol=1e-9, abs_tol=1e-9) or (
                given != given and follows != follows
            )
            demand(
                same,
                f"force_{side}_n is {given:g} where the fingers bear {', '.join(f'{force:g}' for force in each)} N, "
                f"which are {follows:g} N by touch={fingers[0].touch!r}: fill the frame with "
                "opposed_forces(self.channels)(forces)",
            )


def images_stay_as_they_were_delivered(subject: Subject) -> None:
    """Nobody changes an image that is a numpy array after it was delivered."""
    if all(declared_dtype(channel) == FLOATS for channel in further(subject.entry.channels)):
        raise CheckSkipped("this gripper has no images that are numpy arrays")
    for reading, sums in zip(subject.session.readings, subject.session.sums, strict=True):
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
            _demand_counted(channel.name, earlier, now)
            if came:
                last_s = now.t_s
        first_s = next((value.t_s for value in values if value.counter), 0.0)
        if channel.rate_hz and last_s > first_s and taken > 10:
            rate = taken / (last_s - first_s)
            demand(
                abs(rate - channel.rate_hz) <= FORGIVEN * channel.rate_hz,
                f"{channel.name!r} comes at {rate:.3g} Hz and is declared at {channel.rate_hz:g} Hz: declare its rate",
            )


def _demand_counted(name: str, earlier: Any, now: Any) -> None:
    """Raise CheckFailed unless what has another number comes later, and an image with the same number is the same."""
    came = now.counter - earlier.counter
    demand(
        came != 0 or isinstance(now, Samples) or _is_same(now, earlier),
        f"an image of {name!r} changes while its counter stays at {now.counter}: count up with each new image",
    )
    demand(
        came == 0 or (came > 0 and (now.t_s > earlier.t_s or earlier.counter == 0)),
        f"{name!r} goes from number {earlier.counter} of {earlier.t_s} s to {now.counter} of {now.t_s} s: count up by "
        "one, and what is new is later",
    )


def _is_same(now: Image | Pads, earlier: Image | Pads) -> bool:
    if isinstance(now, Pads) or dtype_of(now) == FLOATS:
        return repr(now) == repr(earlier)
    return now[:2] == earlier[:2] and np.array_equal(now.cells, earlier.cells, equal_nan=True)  # type: ignore[union-attr]


def channels_follow_from_the_settings(subject: Subject) -> None:
    """The declared channels follow from the settings alone, and opening the gripper does not change them."""
    if not subject.component.channels_vary():
        return
    again = subject.create()
    declared = again.channels
    demand(
        isinstance(declared, tuple) and all(isinstance(channel, Channel) for channel in declared),
        f"`channels` returns {declared!r:.80}: return a tuple of Channel",
    )
    with opened(subject) as (backend, _):
        for other, when in (
            (subject.create().channels, "with the same settings"),
            (backend.channels, "once it is open"),
        ):
            demand(
                other == declared,
                f"`channels` are {_named(declared)}, and {_named(other)} {when}: make them depend on self.config only",
            )


def _named(channels: Sequence[Channel]) -> str:
    return ", ".join(f"{channel.name} at {channel.rate_hz:g} Hz" for channel in channels) or "none"


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
    """Frames come at `rate_hz`, no channel is declared with a higher rate, and the gap is new as often as declared."""
    info, frames = subject.session.info, subject.session.frames
    passed = [now.t_s - earlier.t_s for earlier, now in pairwise(frames)]
    demand(bool(passed), "only one frame came")
    demand(median(passed) > 0.0, "t_s stands still: give each frame the time at which it was measured")
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
        if channel.name == "gap":
            new_hz = info.rate_hz * _share_of_new([frame.gap_m for frame in frames])
            demand(
                new_hz >= (1.0 - FORGIVEN) * channel.rate_hz,
                f"the gap is new {new_hz:.3g} times a second while the fingers move, and declared at "
                f"{channel.rate_hz:g} Hz: declare that rate, or give each frame what was measured for it",
            )


def _share_of_new(gaps: Sequence[float]) -> float:
    """Return the share of the numbers that differ from the one before, where they change evenly and by many digits.

    Fingers that move by less than the resolution from tick to tick give the same number again.
    """
    steps = np.abs(np.diff(gaps))
    resolution = min(steps[steps > 0.0], default=inf)
    pairs = steps[: len(steps) // 24 * 24].reshape(-1, 2, 12)
    halves = pairs.sum(axis=2)
    evenly = (halves.min(axis=1) > 36.0 * resolution) & (halves.max(axis=1) < 1.2 * halves.min(axis=1))
    return float((pairs[evenly] > 0.0).mean()) if evenly.any() else 1.0


def images_count_up(subject: Subject) -> None:
    """The counter increases with each new image, by more where some were lost; no image is later than its frame."""
    seen = [(frame, pads) for frame, pads, _ in subject.session.readings if pads.counter]
    if not seen:
        raise CheckSkipped("this gripper has no cells")
    for (_, earlier), (_, now) in pairwise(seen):
        _demand_counted("pads", earlier, now)
    for frame, pads in seen:
        demand(
            pads.t_s <= frame.t_s + 1e-9,
            f"the image of {pads.t_s} s comes with the frame of {frame.t_s} s: give the last image",
        )


def gap_is_in_metres(subject: Subject) -> None:
    """The gap lies between 0 and half a metre."""
    gaps = [frame.gap_m for frame in subject.session.frames if not isnan(frame.gap_m)]
    if not gaps:
        raise CheckSkipped("this gripper has no gap")
    if subject.session.info.units.get("gap", "m") != "m":
        raise CheckSkipped(f"a recording in {subject.session.info.units['gap']}")
    looks = next((words for most, words in WIDER if max(gaps) > most), "")
    demand(
        min(gaps) >= -0.01 and max(gaps) <= WIDEST_M,
        f"gap_m goes from {min(gaps):g} to {max(gaps):g}: give the distance between the fingertip faces in metres"
        + (f" (these look like {looks})" if looks else ""),
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
