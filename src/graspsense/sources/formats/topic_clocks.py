"""The times of the messages of several topics on one clock, and how long the value of a message holds.

The time of a message is that of its header. A header can be from another clock than that of the other topics, or from
one that was set in between. The bag tells: the delay from the header to the recording of a message is small and does
not change. Where it differs between topics, or within one, the times of the recording are used for all topics. So they
are where the times in the headers have coarse steps. Nothing in a bag tells a topic without headers, or one that is
stamped late, from one that is recorded at once.

A value holds until the next message, but not longer than a few usual periods of its topic: a sensor that died has no
value. Only the interval in which all topics have messages is used.

A message that came before, with the same time in its header and the same numbers, is left out: two bridges, or two
recordings that were joined, give each message twice.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping, Sequence
from typing import Any, Final

import numpy as np
from attrs import field, frozen
from numpy.typing import NDArray

from graspsense.core.values.errors import DataDamaged

Nanoseconds = NDArray[np.int64]

CLOCKS_APART_NS: Final = 300_000_000
"""Delays of two topics, or of two parts of a topic, that differ by more are from different clocks."""
PARTS: Final = 10
"""Parts of a recording whose delays are compared."""
SET_NS: Final = 20_000_000
"""Least time by which a clock that is set is told from one that is read late."""
MOST_SET: Final = 3
"""Most times that a clock is set in a recording,"""
FEWEST_AROUND: Final = 5
MOST_AROUND: Final = 10
"""and fewest and most messages before and after it whose delays are compared: fewer can be late,"""
AROUND_NS: Final = 200_000_000
"""those within so much time, so that a clock that is set back and forth is seen,"""
EVEN: Final = 0.5
"""and least share of their usual time within which they were recorded: others were held up,"""
SPREADS: Final = 2.0
"""and by so many times what the usual delay there is above the least, the least one changes."""
RATES_APART: Final = 0.002
RATES_APART_NS: Final = 10_000_000
"""Share of the recording, and time, by which one clock gets ahead of another that runs at another rate."""
EVENLY: Final = 0.95
"""Least correlation with time of the delays of such a clock."""
COARSE_SHARE: Final = 0.2
"""Share of the messages that have the time of the one before in their headers where these times are coarse."""
BURST: Final = 5.0
"""Messages with so many times the usual step between them are of different bursts,"""
BURST_NS: Final = 20_000_000
"""which are told if they are so far apart,"""
LONGEST_BURST: Final = 20
"""and have at most so many messages."""
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
    _known: set[int] = field(factory=set, init=False)

    def add(self, recorded_ns: int, stamped_ns: int, numbers: Sequence[Any]) -> bool:
        """Add a message with these numbers; return False if it came before."""
        message = hash((stamped_ns, b"".join(np.ravel(part).tobytes() for part in numbers)))
        if stamped_ns and message in self._known:
            return False
        self._known.add(message)
        self.recorded_ns.append(recorded_ns)
        self.stamped_ns.append(stamped_ns)
        return True

    @property
    def least_delay_ns(self) -> int:
        """The least delay from header to recording, of those whose headers have a time."""
        pairs = zip(self.recorded_ns, self.stamped_ns, strict=True)
        return min(came - stamp for came, stamp in pairs if stamp)


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
    delays_ns: Mapping[str, int]
    """The least delay from the header of a message to its recording in each needed topic whose headers have times;
    empty where the times of the recording are used."""


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
    wanted = {topic: times[topic] for topic in needed or times}
    stamped = () if notices else (topic for topic in wanted if any(topics[topic].stamped_ns))
    delays = {topic: topics[topic].least_delay_ns for topic in stamped}
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
            f"{', '.join(silent)} was silent, with no values for more than {PERIODS:g} of its usual periods: what then "
            "changed is not known",
        )
    notices += tuple(_in_bursts(inside))
    return CommonClock(
        began_ns=began_ns,
        topics=times,
        begin_ns=begin,
        end_ns=end,
        notes=notes,
        notices=(*notices, *_trimmed(lasting, begin, end)),
        delays_ns=delays,
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
        ns = np.array([stamp - began if stamp else 0 for stamp in messages.stamped_ns], dtype=np.int64)
        delay = int(np.median((recorded[topic] - ns)[known])) if known.any() else 0
        stamped[topic] = np.where(known, ns, recorded[topic] - delay)
    return stamped, recorded


def _apart(stamped: Mapping[str, Nanoseconds], recorded: Mapping[str, Nanoseconds]) -> Iterator[str]:
    """Yield a sentence if the headers of the topics are not from one clock, although their recording is."""
    if any(len(ns) > 1 and ns.min() == ns.max() for ns in recorded.values()):
        return  # a bag that was written at once, by a program that did not record
    orders = {topic: np.argsort(ns, kind="stable") for topic, ns in recorded.items()}
    times = {topic: (recorded[topic][order], stamped[topic][order]) for topic, order in orders.items()}
    # In each part of a topic, the smallest delay from header to recording.
    least = {
        topic: [int(part.min()) for part in np.array_split(came - stamps, min(PARTS, len(came)))]
        for topic, (came, stamps) in times.items()
    }
    changed = [topic for topic, pair in times.items() if _was_set(*pair)]
    lowest = min(min(delays) for delays in least.values())
    behind = max(least, key=lambda topic: min(least[topic]))
    apart = min(least[behind]) - lowest
    used = "the times at which the messages were recorded are used"
    if changed:
        yield f"the clock in the headers of {', '.join(changed)} was set during the recording: {used}"
    elif drifting := _drifting(max(int(np.ptp(ns)) for ns in recorded.values()), least):
        yield f"the clock in the headers of {drifting} runs at another rate than that of another topic: {used}"
    elif coarse := [topic for topic, pair in times.items() if _coarse(*pair)]:
        yield f"the times in the headers of {', '.join(coarse)} have coarse steps, or stand still: {used}"
    elif apart > CLOCKS_APART_NS:
        yield (
            f"the times in the headers of {behind} are behind those of another topic, from another clock: {used}"
        )


def _drifting(duration_ns: int, least: Mapping[str, list[int]]) -> str:
    """Return the topic whose delays grow, or shrink, evenly against those of another topic; empty if none does."""
    parts = {topic: np.array(delays, dtype=float) for topic, delays in least.items() if len(delays) == PARTS}
    if not parts:
        return ""
    steady = min(parts.values(), key=lambda delays: float(abs(delays[-1] - delays[0])))
    much = (1.0 - 1.0 / PARTS) * max(RATES_APART * duration_ns, RATES_APART_NS)
    for topic, delays in parts.items():
        apart = delays - steady
        if abs(apart[-1] - apart[0]) > much and abs(np.corrcoef(apart, np.arange(PARTS))[0, 1]) > EVENLY:
            return topic
    return ""


def _was_set(written: Nanoseconds, stamps: Nanoseconds) -> bool:
    """Return whether the times in headers jump, the recording goes on, and the delay stays what it then is.

    Messages that overtake others jump many times, and those that were held up have even times in their headers.
    """
    delays = written - stamps
    if len(stamps) < 2 * FEWEST_AROUND:
        return False
    usual = np.median(np.diff(written))
    around_k = int(np.clip(AROUND_NS / max(usual, 1.0), FEWEST_AROUND, MOST_AROUND))
    jumps = np.abs(np.diff(delays))
    stamps_jump = np.abs(np.diff(stamps) - usual) > 0.5 * jumps
    goes_on = np.abs(np.diff(written) - usual) < 0.5 * jumps
    jumped = np.flatnonzero((jumps > SET_NS) & stamps_jump & goes_on) + 1
    for k in jumped.tolist() if len(jumped) <= 2 * MOST_SET else []:
        around = slice(max(k - around_k, 0), k), slice(k, k + around_k)
        earlier, later = (delays[part] for part in around)
        held_up = any(np.ptp(written[part]) < EVEN * usual * (len(delays[part]) - 1) for part in around)
        if min(len(earlier), len(later)) >= FEWEST_AROUND and not held_up:
            change = int(later.min() - earlier.min()) * int(np.sign(delays[k] - delays[k - 1]))
            spread = max(float(np.median(part) - part.min()) for part in (earlier, later))
            if change > max(0.5 * jumps[k - 1], 0.5 * SET_NS, SPREADS * spread):
                return True
    return False


def _coarse(written: Nanoseconds, stamps: Nanoseconds) -> bool:
    """Return whether many messages have the time of the one before in their headers, or several for a long time."""
    steps = np.diff(written)
    if not len(steps):
        return False
    same = (np.diff(stamps) == 0) & (steps > 0.5 * np.median(steps))
    begins = np.flatnonzero(np.concatenate(([True], ~same)))
    ends = np.append(begins[1:], len(written)) - 1
    return bool(same.mean() > COARSE_SHARE or (written[ends] - written[begins]).max() > LEAST_HOLD_NS)


def _in_bursts(topics: Mapping[str, Nanoseconds]) -> Iterator[str]:
    """Yield a sentence for each topic of which several messages at a time have nearly the same time."""
    for topic, ns in topics.items():
        steps = np.diff(ns)
        far = np.flatnonzero(steps > BURST * np.median(steps)) if len(steps) else steps
        lengths = np.diff(far)
        if len(lengths) < FEWEST_AROUND or not 1.5 < np.median(lengths) <= LONGEST_BURST:
            continue
        every = np.diff(ns[far + 1])
        least, usual = np.quantile(every, 0.1), np.median(every)
        if usual > BURST_NS and least > 0.5 * usual:
            yield (
                f"{topic} has {int(np.median(lengths))} messages at a time, every {usual * 1e-6:.3g} ms: they were "
                "stamped when they came, so that their values are older than their times"
            )


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
        yield f"more than {100 * NOTICED:.0f} % of the recording is left out, because {' and '.join(parts)}"
