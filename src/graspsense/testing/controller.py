"""Conformance checks of a control law."""

from __future__ import annotations

import inspect
import json
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from functools import cache, lru_cache
from math import inf, isfinite
from typing import Any, Final, NamedTuple, get_type_hints

import numpy as np
from numpy.typing import NDArray

from graspsense.core.compiling.call_graph import NotCompilable, fingerprint
from graspsense.core.components.channels import can_change, further, no_signals, read_only
from graspsense.core.components.entries import KINDS
from graspsense.core.components.run_config import RunConfig
from graspsense.core.control.free_motion import FreeMotion
from graspsense.core.grasp.protection.effort_ceiling import MARGIN
from graspsense.core.grasp.runner import run_uninterrupted
from graspsense.core.values.channel import Channel
from graspsense.core.values.faults import LIMITED
from graspsense.core.values.signals import (
    APPROACH,
    CHANNEL_OF_FIELD,
    EFFORT,
    FORCE,
    HOLD,
    POSITION,
    RUNNING,
    SQUEEZE,
    VELOCITY,
    Command,
    Frame,
    Outcome,
    Phase,
    Reading,
    no_pads,
)
from graspsense.testing.checks import CheckFailed, CheckSkipped, demand, raises_nothing
from graspsense.testing.model_gripper import CELLS, DT_S, FRICTION_N, OBJECTS, model_gripper
from graspsense.testing.subject import Subject

LONGEST_TRIED_S: Final = 4.0
LONGEST_S: Final = 60.0
GREATEST: Final = {VELOCITY: 5.0, POSITION: 0.5}
"""The greatest rate of a gap (m/s) and the greatest gap (m) that make sense."""
LATE_S: Final = 4096.0
"""The time at the first tick of a gripper whose clock has run for an hour."""
ABOUT_AS_LONG: Final = 0.25
"""Relative difference in length of two grasps at different rates."""
ASKED: Final = (
    *("asked_force_n", "gentlest_force_n", "asked_speed_m_s", "asked_step_m", "asked_interval_s"),
    "contact_force_n",
)
"""The methods by which a law says what it asks of a gripper."""
LATEST_S: Final = 0.1
"""The time (s) by which a command may come later on a gripper with another clock."""
FORCES: Final = slice(5, 9)
"""The forces of a frame, on pads and edges."""


class Tick(NamedTuple):
    """One tick of a law: its arguments and its result."""

    state: Any
    reading: Reading
    command: Command
    after: Any

    @property
    def frame(self) -> Frame:
        """The frame of the reading."""
        return self.reading.frame


@lru_cache(maxsize=4)
def ticks_of(subject: Subject, object_name: str = "a soft object") -> list[Tick]:
    """Return the ticks of this law on the model_gripper, until it ends the grasp or for four seconds; computed once."""
    return fresh_ticks(subject, object_name)


def fresh_ticks(
    subject: Subject,
    object_name: str = "a soft object",
    channels: Any = None,
    from_tick: int = 0,
    clock: Mapping[str, float] | None = None,
) -> list[Tick]:
    """Return the same ticks as `ticks_of`, computed again, with `clock` as the attributes of the model gripper's time.

    Before tick `from_tick`, if given, the state is rebuilt from plain numbers.
    """
    law = subject.create()
    step, params, state = type(law).step, law.params(), law.init()
    gripper = model_gripper(_all_channels(subject) if channels is None else channels, object_name)
    vars(gripper).update(clock or {})
    gripper.open(0)
    gripper.tare([])
    ticks: list[Tick] = []
    for k in range(round(LONGEST_TRIED_S / gripper.dt_s)):
        if from_tick and k == from_tick:
            state, params = _made_again(state), _made_again(params)
        reading = gripper.read(0.1)
        advice = (
            f" at t = {reading.frame.t_s:.3f} s with {object_name} between the fingers: a law answers every frame with "
            "a command and a state; a channel that the gripper lacks is NaN"
        )
        with raises_nothing("step", advice):
            returned = step(params, state, reading)
        demand(
            isinstance(returned, tuple) and len(returned) == 2,
            f"step returned {returned!r:.200}: return two things, the Command and the state after this tick",
        )
        command, after = returned
        _demand_command(command)
        ticks.append(Tick(state, reading, command, after))
        state = after
        if getattr(after, "outcome", RUNNING) != RUNNING:
            break
        gripper.apply(command)
    return ticks


def _demand_command(command: Any) -> None:
    demand(
        isinstance(command, Command),
        f"step returned {command!r} as the command: return graspsense.plugin_api.Command(kind, value, effort limit, "
        "speed limit)",
    )
    demand(
        type(command[0]) is int and command[0] in range(len(KINDS)),
        f"the kind of a command is {command[0]!r} ({type(command[0]).__name__}): use the integers EFFORT, VELOCITY, "
        "POSITION, FORCE of plugin_api",
    )
    for name, number in zip(Command._fields[1:], command[1:], strict=True):
        demand(
            type(number) is float,
            f"{name} of a command is {number!r} of type {type(number).__name__}: write a float",
        )


def _all_channels(subject: Subject) -> set[str | Channel]:
    return {*CHANNEL_OF_FIELD.values(), "pads", *further(subject.entry.requires)}


def _made_again(value: Any) -> Any:
    """Return the same named tuples after their numbers were written as JSON and read."""
    if isinstance(value, tuple) and hasattr(value, "_fields"):
        return type(value)(*(_made_again(inner) for inner in value))
    if isinstance(value, tuple):
        return tuple(_made_again(inner) for inner in value)
    if isinstance(value, np.ndarray):
        return read_only(value.copy(), str(value.dtype))
    return json.loads(json.dumps(value))


@cache
def _annotations(record: type) -> dict[str, Any]:
    return get_type_hints(record)


def _leaves(value: Any, path: str, annotated: Any = None) -> Iterator[tuple[str, Any, Any]]:
    if isinstance(value, tuple):
        names = getattr(value, "_fields", None)
        hints = _annotations(type(value)) if names else {}
        for i, inner in enumerate(value):
            name = names[i] if names else str(i)
            yield from _leaves(inner, f"{path}.{name}", hints.get(name))
    else:
        yield path, value, annotated


def _demand_numbers(value: Any, what: str) -> None:
    demand(
        isinstance(value, tuple) and hasattr(value, "_fields"),
        f"{what} is {value!r} of type {type(value).__name__}: make it a typing.NamedTuple of numbers",
    )
    for path, leaf, annotated in _leaves(value, what):
        if what == "state" and isinstance(leaf, np.ndarray):
            demand(
                not can_change(leaf),
                f"{path} is an array that can be changed: hold the cells of an image as they come, or a read-only copy",
            )
            continue
        demand(
            type(leaf) in (float, int),
            f"{path} is {leaf!r} of type {type(leaf).__name__}: hold plain floats and ints only (write float(...), or "
            "0 and 1 for a truth), and in a state the cells of an image",
        )
        demand(
            annotated not in (float, int) or type(leaf) is annotated,
            f"{path} is annotated {getattr(annotated, '__name__', annotated)} and is {leaf!r}, of type "
            f"{type(leaf).__name__}: write {getattr(annotated, '__name__', 'float')}(...). A compiler "
            "takes another type for another law",
        )


def step_is_a_plain_function(subject: Subject) -> None:
    """`step` is a static function of params, state and reading."""
    cls: Any = subject.component.component_class()
    raw = inspect.getattr_static(cls, "step")
    demand(
        isinstance(raw, staticmethod),
        f"step of {cls.__name__} is not a static method: write a module function `step(params, state, "
        "reading)` and in the class `step = staticmethod(step)`",
    )
    demand(
        len(inspect.signature(cls.step).parameters) == 3,
        f"step takes {inspect.signature(cls.step)}: it takes (params, state, reading)",
    )


def params_and_state_are_numbers(subject: Subject) -> None:
    """`params()` and `init()` are named tuples of floats and ints, as annotated; a state also has read-only images."""
    _demand_numbers(subject.create().params(), "params")
    _demand_numbers(subject.create().init(), "state")


def starts_in_the_approach(subject: Subject) -> None:
    """The first state has phase APPROACH and outcome RUNNING."""
    state = subject.create().init()
    for name, wanted, word in (("phase", APPROACH, "APPROACH"), ("outcome", RUNNING, "RUNNING")):
        given = getattr(state, name, None)
        demand(
            given == wanted,
            f"{name} of the first state is {given!r}: give the state a field `{name}: int` that begins as {word}",
        )


def types_do_not_change(subject: Subject) -> None:
    """No number of the state changes its type, and every state has the class of the first one."""
    for tick in ticks_of(subject):
        demand(
            type(tick.after) is type(tick.state),
            f"after t = {tick.frame.t_s:.3f} s the state is {type(tick.after).__name__} instead of "
            f"{type(tick.state).__name__}: return the same named tuple",
        )
        for (path, a, _), (_, b, _) in zip(
            _leaves(tick.state, "state"), _leaves(tick.after, "state"), strict=True
        ):
            if type(a) is not type(b) or getattr(a, "dtype", "") != getattr(b, "dtype", ""):
                raise CheckFailed(
                    f"{path} goes from {a!r} ({type(a).__name__}) to {b!r} ({type(b).__name__}) at t = "
                    f"{tick.frame.t_s:.3f} s: keep one type throughout"
                )


def commands_are_declared_and_finite(subject: Subject) -> None:
    """With any object, commands are of kinds in `commands`, values finite, and limits neither negative nor NaN."""
    for object_name in OBJECTS:
        for tick in ticks_of(subject, object_name):
            command = tick.command
            where = f"at t = {tick.frame.t_s:.3f} s with {object_name} between the fingers"
            demand(
                KINDS[command.kind] in subject.entry.commands,
                f"it commands {KINDS[command.kind]} {where}; its entry declares "
                f"{', '.join(subject.entry.commands) or 'none'}: add it to `commands`",
            )
            most = GREATEST.get(command.kind, inf)
            demand(
                isfinite(command.value) and abs(command.value) <= most,
                f"it commands {command.value} {where}: bound it; at most {most:g} makes sense in m and m/s",
            )
            for name in ("effort_limit_n", "speed_limit_m_s"):
                limit = getattr(command, name)
                demand(
                    limit >= 0.0,
                    f"{name} of a command is {limit} {where}: give a limit of 0 or more, or inf for none",
                )


def same_tick_same_command(subject: Subject) -> None:
    """`step` is pure: each tick, repeated in another order, gives the same command and state, and changes no global."""
    ticks, law = ticks_of(subject), subject.create()
    step, params = type(law).step, law.params()
    with suppress(NotCompilable):
        unchanged = fingerprint(step)
        step(params, ticks[0].state, ticks[0].reading)
        demand(
            fingerprint(step) == unchanged,
            "step changes a global that it or a function of it names: keep in the state what it is to remember; once "
            "compiled, a law takes globals as they were",
        )
    for tick in reversed(ticks[::7]):
        command, after = step(params, tick.state, tick.reading)
        demand(
            repr((command, after)) == repr((tick.command, tick.after)),
            f"repeated for t = {tick.frame.t_s:.3f} s, step gives {command} instead of {tick.command}: it may know "
            "nothing but its arguments (no clock, no global, no list that lives on)",
        )


def state_holds_everything(subject: Subject) -> None:
    """After another grasp, and continued from a state and params that were written and read again, it does the same."""
    whole = ticks_of(subject)
    fresh_ticks(subject, "nothing")
    resumed = fresh_ticks(subject, from_tick=max(len(whole) // 2, 1))
    demand(
        [repr(tick.command) for tick in whole] == [repr(tick.command) for tick in resumed],
        "after another grasp, and going on from a state that was written down, it commands something else: keep "
        "everything in the state, as numbers, and nothing in the class or the module",
    )


def requires_what_it_reads(subject: Subject) -> None:
    """The channels in `requires` suffice: without the others, the commands are the same."""
    required = set(subject.entry.requires)
    full, own = ticks_of(subject), fresh_ticks(subject, channels=required)
    demand(
        [repr(tick.command) for tick in full] == [repr(tick.command) for tick in own],
        "on a gripper that has only the channels it declares "
        f"({', '.join(sorted(channel.name for channel in required)) or 'none'}) it commands something else: "
        "add what it reads to `requires`",
    )


def independent_of_the_start_of_the_clock(subject: Subject) -> None:
    """On a gripper whose clock has run for an hour, a grasp goes on and ends as on a new one."""
    advice = "keep the time of the first frame in the state, and use differences of times"
    _demand_same_course(subject, advice, first_t_s=LATE_S)


def times_are_those_of_the_clock(subject: Subject) -> None:
    """On a gripper with half the rate, a grasp takes about as long, and is commanded and ends as at the full rate."""
    if any(channel.rate_hz > 0.5 / DT_S for channel in subject.entry.requires):
        raise CheckSkipped("it needs a higher rate")
    _demand_same_course(subject, "count seconds by `frame.dt_s` or `frame.t_s`, not ticks", dt_s=2.0 * DT_S)


def _demand_same_course(subject: Subject, advice: str, **clock: float) -> None:
    """Raise CheckFailed unless a grasp under another clock takes as long, and is commanded and ends as usual."""
    grasps = ticks_of(subject), fresh_ticks(subject, clock=clock)
    (usual_s, usual), (other_s, other) = (
        (ticks[-1].frame.t_s - ticks[0].frame.t_s, Outcome(ticks[-1].after.outcome).words) for ticks in grasps
    )
    given = ", ".join(f"{name} = {value:g} s" for name, value in clock.items())
    demand(
        abs(usual_s - other_s) <= ABOUT_AS_LONG * usual_s and usual == other,
        f"a grasp ends as {usual} after {usual_s:.2f} s, and with {given} as {other} after {other_s:.2f} s: {advice}",
    )
    for name in Command._fields[1:]:
        late_s = _lateness_s(*(_approach(ticks, name) for ticks in grasps))
        demand(
            late_s <= LATEST_S,
            f"with {given}, {name} of its commands in APPROACH comes {late_s:.2g} s too early or late: {advice}",
        )


def _approach(ticks: Sequence[Tick], name: str) -> NDArray[np.float64]:
    """Return the times (s) since the begin of the approach, and this number of its commands at each: 2 x ticks.

    What a law commands in a squeeze may depend on measurements, which differ with the rate.
    """
    among = [tick for tick in ticks if tick.state.phase == APPROACH]
    numbers = [(tick.frame.t_s - among[0].frame.t_s, getattr(tick.command, name)) for tick in among]
    course: NDArray[np.float64] = np.array(numbers).reshape(-1, 2).T
    course[np.isinf(course)] = 0.0
    return course


def _lateness_s(usual: NDArray[np.float64], other: NDArray[np.float64]) -> float:
    """Return by how much time a number comes later: the area between its two courses over the greatest value."""
    both = usual[:, usual[0] <= other[0].max(initial=-1.0)]
    if both.shape[1] < 2 or not both[1].any():
        return 0.0
    apart = np.abs(both[1] - np.interp(both[0], *other))
    return float(apart[1:] @ np.diff(both[0]) / np.abs(both[1]).max())


def handles_frames_of_nan(subject: Subject) -> None:
    """A frame of NaN does not raise, and gives a command."""
    law = subject.create()
    step, params, state = type(law).step, law.params(), law.init()
    silent = Frame(t_s=0.001, dt_s=0.001)
    reading = Reading(silent, no_pads(CELLS), no_signals(subject.entry.requires))
    with raises_nothing("step", " on a frame of NaN: write comparisons so that NaN gives the safe result"):
        command, _ = step(params, state, reading)
    demand(isinstance(command, Command), f"step returned {command!r} on a frame of NaN")


def says_what_it_asks_for(subject: Subject) -> None:
    """What it asks for are numbers; the force of the squeeze and the speed are those that it commands, if any."""
    law = subject.create()
    for name in ASKED:
        number = getattr(law, name)()
        demand(
            number is None or (type(number) in (float, int) and 0.0 <= number < inf),
            f"{name} returns {number!r}: return a number in SI units, or None",
        )
    forces, speeds = [], []
    for tick in (tick for thing in OBJECTS for tick in ticks_of(subject, thing)):
        kind, value, effort_limit_n, speed_limit_m_s = tick.command
        if tick.after.phase in (SQUEEZE, HOLD):
            forces += [effort_limit_n] if kind in (VELOCITY, POSITION) else [value] * (kind == FORCE)
        elif kind != EFFORT:
            speeds.append(abs(value) if kind == VELOCITY else speed_limit_m_s)
    for what, unit, asked, commanded, margin in (
        ("force", "N", law.asked_force_n(), forces, MARGIN),
        ("speed", "m/s", law.asked_speed_m_s(), speeds, 1.0 + 1e-9),
    ):
        most = max((limit for limit in commanded if limit < inf), default=0.0)
        if most == 0.0:
            continue
        name = f"asked_{what}_{unit.replace('/', '_').lower()}"
        demand(
            asked is not None,
            f"it commands a {what} of {most:g} {unit}, and {name} returns None: return that {what}, so that a gripper "
            "that cannot do as little is refused before it moves",
        )
        # A speed is the least that is asked for, a force the greatest.
        extreme = (
            most if what == "force" else min((limit for limit in commanded if 0.0 < limit < inf), default=inf)
        )
        fits = asked is None or (most <= margin * asked if what == "force" else asked <= margin * extreme)
        demand(
            fits,
            f"{name} returns {asked} {unit}, and it commands {extreme:g} {unit}: return the {what} that it commands",
        )


def events_are_declared(subject: Subject) -> None:
    """The events in the state are those that the class names, as bits of an integer; none is told in every tick."""
    names = getattr(subject.component.component_class(), "events", ())
    demand(
        isinstance(names, tuple) and all(isinstance(name, str) and name for name in names),
        f'`events` is {names!r}: give a tuple of names, as in ("contact", "slip")',
    )
    demand(len(set(names)) == len(names), f"`events` has a name twice: {', '.join(names)}")
    state = subject.create().init()
    demand(
        not names or hasattr(state, "events"),
        f"the class names the events {', '.join(names)}, and its state has no field `events: int`: add it, 0 at first",
    )
    for thing in OBJECTS:
        bits = [getattr(tick.after, "events", 0) for tick in ticks_of(subject, thing)]
        told = max(bits, default=0)
        demand(
            min(bits, default=0) >= 0 and told < 1 << len(names),
            f"`events` of the state is {told if told > 0 else min(bits)}, and the class names {len(names)} events: set "
            "bit i for the i-th name, no other",
        )
        for i, name in enumerate(names):
            demand(
                not bits or len(bits) < 2 or not all(bit >> i & 1 for bit in bits),
                f"the event {name!r} is told in every tick: set its bit only in the tick in which it happens",
            )


def free_motion_is_step(subject: Subject) -> None:
    """A law of free motion commands what `step` commands, and ends in the same state, while no force changes."""
    law = subject.create()
    motion: FreeMotion | None = getattr(type(law).step, "free_motion", None)
    params = law.params()
    if motion is None:
        return
    for function in (motion.begin, motion.command, motion.end):
        demand(
            inspect.isfunction(function), f"{function!r} in `free_motion` is not a module function: write one"
        )
    for object_name in OBJECTS:
        ticks = ticks_of(subject, object_name)
        begin = 0
        while begin < len(ticks):
            begin += max(_free_ticks_that_agree(motion, params, ticks[begin:]), 1)


def _free_ticks_that_agree(motion: FreeMotion, params: Any, ticks: Sequence[Tick]) -> int:
    """Return in how many ticks after the first one the law of free motion applies; all of them agree with `step`."""
    start = ticks[0].after
    memory, limits = motion.begin(params, start, ticks[0].frame)
    for n, tick in enumerate(ticks[1:]):
        frame = tick.frame
        same = frame[FORCES] == ticks[0].frame[FORCES]
        if not (same and frame.gap_m > limits.gap_m and frame.t_s <= limits.until_s):
            return n
        effort, memory = motion.command(params, memory, frame.gap_m, frame.velocity_m_s, frame.dt_s)
        if effort != effort:
            return n
        where = f"at t = {frame.t_s:.3f} s, {n + 1} ticks after `begin`,"
        demand(
            repr(Command(EFFORT, effort, inf, inf)) == repr(tick.command),
            f"{where} the law of free motion commands {effort} N and `step` gives {tick.command}: let `begin` return "
            "NOT_FREE, or narrower limits, where it does not apply, and `command` compute what `step` does",
        )
        after = motion.end(params, start, memory, effort, frame.t_s)
        demand(
            repr(after) == repr(tick.after),
            f"{where} `end` gives the state {after} and `step` gives {tick.after}: set every field that `step` changes",
        )
    return len(ticks) - 1


def phases_are_in_order(subject: Subject) -> None:
    """The phases are APPROACH, SQUEEZE and HOLD, in this order."""
    for object_name in OBJECTS:
        latest = APPROACH
        for tick in ticks_of(subject, object_name):
            phase = tick.after.phase
            demand(
                APPROACH <= phase <= HOLD,
                f"phase is {phase} at t = {tick.frame.t_s:.3f} s: a law reports APPROACH, SQUEEZE and HOLD",
            )
            demand(
                phase >= latest,
                f"phase goes back from {Phase(latest).name} to {Phase(phase).name} at t = {tick.frame.t_s:.3f} s: a "
                "grasp goes one way",
            )
            latest = phase


def ends_every_grasp(subject: Subject) -> None:
    """With a soft object, a hard object and nothing, it ends the grasp by itself, and holds as it asks to."""
    law = subject.create()
    asked_n = law.asked_force_n()
    # If the controller does not end the grasp, the runner ends it after three more opening times.
    ceiling_n = None if asked_n is None else MARGIN * asked_n + FRICTION_N
    run = RunConfig(grasp_timeout_s=LONGEST_S, effort_ceiling_n=ceiling_n)
    for object_name, (width_m, _) in OBJECTS.items():
        grasp = run_uninterrupted(model_gripper(_all_channels(subject), object_name), law, run)
        end = f"with {object_name} between the fingers the grasp ended as {grasp.outcome.words}"
        demand(
            grasp.outcome not in (Outcome.ABORTED, Outcome.DEVICE_LOST, Outcome.RUNNING),
            f"{end}: {grasp.reason}. Let the state's `outcome` leave RUNNING, after {LONGEST_S:g} s at the latest",
        )
        lowered = [told for told in grasp.warnings if told.startswith(LIMITED) and "ceiling" in told]
        demand(
            asked_n is None or not lowered,
            f"{end}; it squeezes or holds with more than {ceiling_n} N, and asked_force_n returns {asked_n}: return "
            "the greatest force that it commands, in N",
        )
        closest_m, steady = float(grasp.trace.gap_m.min()), grasp.outcome == Outcome.STEADY
        missed = width_m > 0.0 and grasp.outcome == Outcome.NOTHING_THERE
        demand(
            closest_m < width_m or not (missed or steady),
            f"{end}, {width_m * 1e3:g} mm wide, and the fingers came no closer than {closest_m * 1e3:.1f} mm: close "
            "them until they touch, and hold only what was touched",
        )
