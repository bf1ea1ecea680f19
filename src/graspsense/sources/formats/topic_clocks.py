"""The times of the messages of several topics on one clock, and how long the value of a message holds.

The time of a message is that of its header. A header can be from another clock than that of the other topics, or from
one that was set in between. The bag tells: the delay from the header to the recording of a message is small and does
not change. Where it differs between topics, or within one, the times of the recording are used for all topics.

A value holds until the next message, but not longer than a few usual periods of its topic: a sensor that died has no
value. Only the interval in which all topics have messages is used.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping
from typing import Final

import numpy as np
from attrs import field, frozen
from numpy.typing import NDArray

from graspsense.core.values.errors import DataDamaged

Nanoseconds = NDArray[np.int64]

CLOCKS_APART_NS: Final = 300_000_000
"""Delays of two topics, or of two parts of a topic, that differ by more are from different clocks."""
DELAYS_APART_NS: Final = 50_000_000
"""Delays of two topics that differ by more can be from different clocks, or one topic is slow: nothing tells which."""
PARTS: Final = 5
"""Parts of a recording whose delays are compared."""
MOST_SET: Final = 3
"""Most times that a clock is set back in a recording,"""
FEWEST_AFTER: Final = 5
"""and fewest messages after it: fewer can be late."""
RATES_APART: Final = 0.01
RATES_APART_NS: Final = 20_000_000
"""Share of the recording, and time, by which one clock gets ahead of another that runs at another rate."""
EVEN: Final = 0.5
"""Least share of the mean by which it gets ahead in each part of the recording."""
PERIODS: Final = 5.0
"""A value holds for so many usual periods of its topic at most,"""
LEAST_HOLD_NS: Final = 100_000_000
"""but not less than this, because a computer can be late."""
NOTICED: Final = 0.05
"""Share of a recording that is lost by trimming from which on this looks wrong."""


@frozen(kw_only=True, eq=False)
class Messages:
    """When the messages of a topic were recorded, and the times in their headers (ns); 0 where there is none."""

    recorded_ns: list[int] = field(factory=list)
    stamped_ns: list[int] = field(factory=list)

    def add(self, recorded_ns: int, stamped_ns: int) -> None:
        """Add a message."""
        self.recorded_ns.append(recorded_ns)
        self.stamped_ns.append(stamped_ns)


@frozen(kw_only=True, eq=False)
class TopicTimes:
    """The times of the messages of a topic on the common clock, in the order of time."""

    ns: Nanoseconds
    order: NDArray[np.intp]
    """The message, in the order of the bag, that each time belongs to."""

    @property
    def usual_ns(self) -> float:
        """The usual time between messages; 0 if there is one message only, which is a constant."""
        steps = np.diff(self.ns)
        steps = steps[steps > 0]
        return float(np.median(steps)) if len(steps) else 0.0

    @property
    def until_ns(self) -> int:
        """The time until which the last message is usual to hold."""
        return int(self.ns[-1] + self.usual_ns)

    def between(self, begin_ns: int, end_ns: int) -> Nanoseconds:
        """Return the times in an interval."""
        return self.ns[(self.ns >= begin_ns) & (self.ns <= end_ns)]

    @property
    def longest_hold_ns(self) -> int:
        """The longest time that a value may hold."""
        return max(int(PERIODS * self.usual_ns), LEAST_HOLD_NS)

    def latest(self, at_ns: Nanoseconds) -> tuple[NDArray[np.intp], NDArray[np.bool_]]:
        """Return the last message at each of these times, -1 before the first, and whether it is too old to hold."""
        last = np.searchsorted(self.ns, at_ns, side="right") - 1
        age = at_ns - self.ns[np.maximum(last, 0)]
        return last, (age > self.longest_hold_ns) & (self.usual_ns > 0.0)


@frozen(kw_only=True, eq=False)
class CommonClock:
    """The times of all topics on one clock, the interval in which all have messages (ns), and what to say of them.

    They count from the first message that was recorded, at `began_ns`.
    """

    began_ns: int
    topics: Mapping[str, TopicTimes]
    begin_ns: int
    end_ns: int
    notes: tuple[str, ...]
    notices: tuple[str, ...]


def on_one_clock(
    source: str, topics: Mapping[str, Messages]
) -> tuple[int, dict[str, TopicTimes], tuple[str, ...]]:
    """Return when the first message was recorded (ns), the times of each topic since then, and what looks wrong.

    Raises DataDamaged if the times do not fit into 64 bits.
    """
    began_ns = min(min(messages.recorded_ns) for messages in topics.values())
    try:
        stamped, recorded = _relative(topics, began_ns)
    except OverflowError as error:
        raise DataDamaged(f"{source} has messages that are more than 292 years apart") from error
    notices = tuple(_apart(stamped, recorded))
    times = {}
    for topic in topics:
        ns = recorded[topic] if notices else stamped[topic]
        order = np.argsort(ns, kind="stable")
        times[topic] = TopicTimes(ns=ns[order], order=order)
    return began_ns, times, notices


def common_clock(
    source: str, topics: Mapping[str, Messages], needed: Collection[str] | None = None
) -> CommonClock:
    """Return the topics on one clock. The common interval is that of those that are `needed`; by default, of all.

    Raises DataDamaged if there is no time at which all topics have messages, or if times do not fit into 64 bits.
    """
    began_ns, times, notices = on_one_clock(source, topics)
    if not notices:
        notices = tuple(_doubtful_delays({topic: topics[topic] for topic in needed or topics}))
    wanted = {topic: times[topic] for topic in needed or times}
    lasting = {topic: stamps for topic, stamps in wanted.items() if stamps.usual_ns} or wanted
    begin = max(int(stamps.ns[0]) for stamps in lasting.values())
    end = min(stamps.until_ns for stamps in lasting.values())
    earliest = min(int(stamps.ns[0]) for stamps in times.values())
    inside = {topic: stamps.between(begin, end) for topic, stamps in lasting.items()}
    notes = tuple(_words(topic, stamps, earliest, inside.get(topic)) for topic, stamps in times.items())
    if end <= begin:
        raise DataDamaged(
            f"{source}: there is no time at which all topics have messages: {'; '.join(notes)}. Check the clocks of "
            "the computers that stamped them"
        )
    notes += (f"all have messages from {(begin - earliest) * 1e-9:.3f} to {(end - earliest) * 1e-9:.3f} s",)
    silent = [topic for topic, within in inside.items() if _longest(within) > lasting[topic].longest_hold_ns]
    if silent:
        notices += (
            f"{', '.join(silent)} was silent for more than {PERIODS:g} of its usual periods: a value that then changed "
            "is missing",
        )
    return CommonClock(
        began_ns=began_ns,
        topics=times,
        begin_ns=begin,
        end_ns=end,
        notes=notes,
        notices=(*notices, *_trimmed(lasting, begin, end)),
    )


def _relative(
    topics: Mapping[str, Messages], began: int
) -> tuple[dict[str, Nanoseconds], dict[str, Nanoseconds]]:
    """Return the times of headers and of recording of each topic, counted from `began` (ns).

    A message without a time in its header has that of its recording, less the delay that is usual in its topic.
    Raises OverflowError.
    """
    recorded = {
        topic: np.array([ns - began for ns in messages.recorded_ns], dtype=np.int64)
        for topic, messages in topics.items()
    }
    stamped = {}
    for topic, messages in topics.items():
        known = np.array([ns != 0 for ns in messages.stamped_ns])
        ns = np.array(
            [stamp - began if stamp else 0 for stamp in messages.stamped_ns],
            dtype=np.int64,
        )
        delay = int(np.median((recorded[topic] - ns)[known])) if known.any() else 0
        stamped[topic] = np.where(known, ns, recorded[topic] - delay)
    return stamped, recorded


def _apart(stamped: Mapping[str, Nanoseconds], recorded: Mapping[str, Nanoseconds]) -> Iterator[str]:
    """Yield a sentence if the headers of the topics are not from one clock, although their recording is."""
    if any(len(ns) > 1 and ns.min() == ns.max() for ns in recorded.values()):
        return  # a bag that was written at once, by a program that did not record
    least = {topic: _least_delays(recorded[topic], stamped[topic]) for topic in stamped}
    changed = [
        topic
        for topic, delays in least.items()
        if _set_back(recorded[topic], stamped[topic])
        or (max(delays) - min(delays) > CLOCKS_APART_NS and _jumps(recorded[topic] - stamped[topic]))
    ]
    lowest = min(min(delays) for delays in least.values())
    behind = max(least, key=lambda topic: min(least[topic]))
    apart = min(least[behind]) - lowest
    used = "the times at which the messages were recorded are used"
    if changed:
        yield f"the clock in the headers of {', '.join(changed)} was set during the recording: {used}"
    elif drifting := _drifting(recorded, least):
        yield f"the clock in the headers of {drifting} runs at another rate than that of another topic: {used}"
    elif apart > CLOCKS_APART_NS:
        yield (
            f"the times in the headers of {behind} are behind those of another topic, from another clock: {used}"
        )


def _doubtful_delays(topics: Mapping[str, Messages]) -> Iterator[str]:
    """Yield a sentence if the delays of these topics differ, so that one of their clocks may be off."""
    delays = {
        topic: min(delays)
        for topic, messages in topics.items()
        if (
            delays := [
                recorded - stamped
                for recorded, stamped in zip(messages.recorded_ns, messages.stamped_ns, strict=True)
                if stamped
            ]
        )
    }
    behind, ahead = (
        max(delays, key=delays.__getitem__, default=""),
        min(delays, key=delays.__getitem__, default=""),
    )
    if delays and delays[behind] - delays[ahead] > DELAYS_APART_NS:
        yield (
            f"the headers of {behind} are {(delays[behind] - delays[ahead]) * 1e-6:.0f} ms older than those of {ahead} "
            "when their messages are recorded: the topic is slow, or its clock is off, and then gap and force do not "
            "belong together"
        )


def _least_delays(recorded: Nanoseconds, stamped: Nanoseconds) -> list[int]:
    """Return the smallest delay from header to recording in each part of a topic."""
    order = np.argsort(recorded, kind="stable")
    delays = np.array_split((recorded - stamped)[order], min(PARTS, len(order)))
    return [int(part.min()) for part in delays]


def _drifting(recorded: Mapping[str, Nanoseconds], least: Mapping[str, list[int]]) -> str:
    """Return the topic whose delays grow, or shrink, evenly against those of another topic; empty if none does."""
    parts = {topic: np.array(delays) for topic, delays in least.items() if len(delays) == PARTS}
    if not parts:
        return ""
    steady = min(parts.values(), key=lambda delays: abs(int(delays[-1] - delays[0])))
    for topic, delays in parts.items():
        steps = np.diff(delays - steady)
        much = max(RATES_APART * int(np.ptp(recorded[topic])), RATES_APART_NS)
        even = steps * np.sign(steps.sum()) > EVEN * np.abs(steps).mean()
        if abs(int(steps.sum())) > much and even.all():
            return topic
    return ""


def _set_back(recorded: Nanoseconds, stamped: Nanoseconds) -> bool:
    """Return whether headers are older than those before them for several messages, as after a clock was set back.

    Messages that overtake others do so many times, and those that were held up come all at once.
    """
    order = np.argsort(recorded, kind="stable")
    written, stamps = recorded[order], stamped[order]
    steps = np.diff(stamps)
    if not len(steps) or int((steps < 0).sum()) > MOST_SET or steps.min() > -DELAYS_APART_NS:
        return False
    k = int(np.argmin(steps)) + 1
    after = slice(k, k + FEWEST_AFTER)
    later = (written - stamps)[after].min() - (written - stamps)[:k].min() > DELAYS_APART_NS
    apart = np.ptp(written[after]) > EVEN * np.ptp(stamps[after])
    return bool(later and apart and len(stamps) - k >= FEWEST_AFTER)


def _jumps(delays: Nanoseconds) -> bool:
    """Return whether the delay jumps from one message to the next: a program that writes all at once has no jump."""
    return bool((np.abs(np.diff(delays)) > CLOCKS_APART_NS).any())


def _longest(times_ns: Nanoseconds) -> int:
    """Return the longest time between messages (ns)."""
    return int(np.diff(times_ns).max()) if len(times_ns) > 1 else 0


def _words(topic: str, times: TopicTimes, earliest_ns: int, inside: Nanoseconds | None) -> str:
    if not times.usual_ns:
        return f"{topic}: a message, whose value holds throughout"
    begin_s, end_s = ((ns - earliest_ns) * 1e-9 for ns in (times.ns[0], times.ns[-1]))
    return (
        f"{topic}: {len(times.ns)} messages from {begin_s:.3f} to {end_s:.3f} s, {1e9 / times.usual_ns:.4g} Hz, "
        f"longest hold {_longest(times.ns if inside is None else inside) * 1e-6:.3g} ms"
    )


def _trimmed(lasting: Mapping[str, TopicTimes], begin_ns: int, end_ns: int) -> Iterator[str]:
    """Yield a sentence if much of the recording is outside the common interval."""
    begin = min(int(times.ns[0]) for times in lasting.values())
    last = max(times.until_ns for times in lasting.values())
    much = NOTICED * (last - begin)
    late = max(lasting, key=lambda topic: int(lasting[topic].ns[0]))
    early = min(lasting, key=lambda topic: lasting[topic].until_ns)
    parts = [f"{late} begins after the other topics"] if begin_ns - begin > much else []
    parts += [f"{early} ends before the other topics"] if last - end_ns > much else []
    if parts:
        yield f"more than {NOTICED:.0%} of the recording is left out, because {' and '.join(parts)}"
