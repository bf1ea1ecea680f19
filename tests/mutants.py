"""Broken copies of the parts of `parts.py`: for each check of the kit one that is broken in just that way."""

from __future__ import annotations

import itertools
import random
import sys
from dataclasses import dataclass, field
from math import inf, nan
from typing import Any, ClassVar, NamedTuple

import attrs
import numpy as np
from attrs import evolve, frozen
from parts import (
    ACCELERATION,
    CAMERA,
    CHANNELS_OF_HAND,
    ENTRIES,
    Hand,
    HandConfig,
    Law,
    LawConfig,
    Nearest,
    Peak,
    PeakConfig,
    channels,
)

from graspsense.gripper_api import FingerForce, StatusBit
from graspsense.plugin_api import (
    APPROACH,
    EFFORT,
    HOLD,
    POSITION,
    SQUEEZE,
    STEADY,
    VELOCITY,
    Channel,
    ClassifierConfig,
    Command,
    Feature,
    Features,
    Image,
    ObjectKind,
    Reading,
    UnknownName,
    setting,
    signal_type,
)
from graspsense.simulator_api import CompiledFeatures, FreeLimits, FreeMotion
from graspsense.testing.gentle import GentleState, step


@dataclass
class Mutant:
    role: str
    check: str
    says: str
    entry: Any
    keys: dict = field(default_factory=dict)


MUTANTS: list[Mutant] = []
_numbers = itertools.count()
_rng = random.Random(3)


def mutant(role, check, says, *, config=None, keys=None, **changes):
    """Keep a class as the mutant of a check, whose failure contains `says`; `changes` are to its entry."""

    def keep(cls):
        # What imports it finds it in this module.
        module = sys.modules[__name__]
        name = f"Mutant{next(_numbers)}"
        setattr(module, name, cls)
        where = {"target": f"mutants:{name}"}
        if config is not None:
            setattr(module, f"{name}Config", config)
            where["config"] = f"mutants:{name}Config"
        MUTANTS.append(Mutant(role, check, says, evolve(ENTRIES[role], **{**where, **changes}), keys or {}))
        return cls

    return keep


# What holds for every component.

mutant("feature-set", "classes-can-be-imported", "No module named 'nowhere'", target="nowhere:Peak")(Peak)


@mutant("feature-set", "classes-can-be-imported", "does not implement extract")
class Methodless(Peak.__mro__[1]):
    pass


mutant("feature-set", "classes-can-be-imported", "does not declare `features`: write", features=None)(Peak)


@mutant("feature-set", "declared-once", "requires stand both in the entry and in")
class Twice(Peak):
    requires = ENTRIES["feature-set"].requires


@attrs.frozen
class Untyped:
    side = attrs.field(default="left")


mutant("feature-set", "settings-have-types", "Annotate them", config=Untyped)(Peak)


@frozen(kw_only=True)
class Undescribed:
    side: str = "left"


@frozen(kw_only=True)
class Unitless:
    threshold_n: float = setting(default=3.0, meaning="Least force.")


mutant("feature-set", "settings-declare-their-meaning", "declares no meaning", config=Undescribed)(Peak)
mutant("feature-set", "settings-declare-their-meaning", 'unit="N"', config=Unitless)(Peak)


@frozen(kw_only=True)
class WholeDefault:
    threshold_n: float = 3


mutant("feature-set", "defaults-are-what-their-types-say", "write 3.0", config=WholeDefault)(Peak)


@frozen(kw_only=True)
class Creeping:
    side_n: float = attrs.field(default=1.0, converter=lambda x: 2.0 * x)


mutant("feature-set", "settings-survive-a-file", "A converter", config=Creeping)(Peak)


@attrs.define(kw_only=True)
class Mutable:
    side: str = "left"


mutant("feature-set", "settings-cannot-be-changed", "@frozen", config=Mutable)(Peak)


@mutant("feature-set", "making-one-does-nothing", "open a file")
class Reader(Peak):
    def __init__(self, config):
        super().__init__(config)
        with open("/dev/null") as file:
            file.read()


mutant("feature-set", "summary-is-one-line", "in one line", summary="two\nlines")(Peak)


# Feature sets.


def featuring(check, says, **changes):
    """Keep a mutant whose `extract` is the decorated function of the sound features and the trace."""

    def keep(change):
        class Changed(Peak):
            def extract(self, trace):
                return change(super().extract(trace), trace)

        return mutant("feature-set", check, says, **changes)(Changed)

    return keep


@featuring("returns-the-declared-features", "make `features` and what extract returns the same")
def _(features, trace):
    return evolve(features, names=("summit",), reasons={"summit": "none"})


@featuring("returns-the-declared-features", "peak in mN")
def _(features, trace):
    return evolve(features, units=("mN",))


@featuring(
    "units-are-of-the-si", "'newton'", features=(Feature("peak", "newton", "the largest force of the pads"),)
)
def _(features, trace):
    return evolve(features, units=("newton",))


@featuring("values-are-floats", "write float(...)")
def _(features, trace):
    return evolve(features, values=(features.values[0] if features.reasons else int(features.values[0]),))


@featuring("values-are-floats", "of type float64")
def _(features, trace):
    return evolve(features, values=(np.float64(features.values[0]),))


@featuring("a-whole-grasp-has-features", "every feature is missing")
def _(features, trace):
    return evolve(features, values=(nan,), reasons={"peak": "too lazy"})


@featuring("handles-every-trace", "ValueError")
def _(features, trace):
    trace.gap_m.max()
    return features


@featuring("handles-a-trace-that-ends-anywhere", "on trace.until(")
def _(features, trace):
    if 0.3 < trace.t_s[-1:].sum() < 0.4:
        raise IndexError("no contact yet")
    return features


_calls = itertools.count()


@featuring("same-trace-same-features", "keep no state between calls")
def _(features, trace):
    return evolve(features, values=(features.values[0] + next(_calls),))


@featuring("does-not-change-the-trace", "force_left_n.copy()")
def _(features, trace):
    trace.force_left_n[:] = 0.0
    return features


@featuring("requires-what-it-reads", "add the channels that it reads to `requires`")
def _(features, trace):
    known = trace.force_right_n[~np.isnan(trace.force_right_n)]
    return evolve(features, values=(features.values[0] + float(known.sum()),))


@featuring("independent-of-the-start-of-the-clock", "use differences of times")
def _(features, trace):
    return evolve(features, values=(features.values[0] + float(trace.t_s[-1:].sum()),))


@featuring("views-and-copies-agree", "the memory behind them")
def _(features, trace):
    whole = trace.gap_m.base if trace.gap_m.base is not None else trace.gap_m
    return evolve(features, values=(features.values[0] + len(whole),))


class Complex(float):
    """A number that JSON writes in a way of its own."""

    def __eq__(self, other):
        return False

    __hash__ = None


@featuring("survives-json", "through JSON")
def _(features, trace):
    return evolve(features, values=(Complex(features.values[0]),))


def half_of_the_peak(params, ticks):
    return (0.5 * max([0.0, *ticks.force_left_n]),)


def nothing_to_measure(params, ticks):
    return ()


def peak_measured(feature_set, measured, units):
    (peak,) = measured
    return Features(names=("peak",), values=(peak,), units=("N",))


@mutant(
    "feature-set", "compiled-features-are-those-of-extract", "make `compiled` measure what `extract` does"
)
class CompiledForAnother(Peak):
    compiled = CompiledFeatures(half_of_the_peak, lambda feature_set: (), peak_measured)


@mutant("feature-set", "compiled-features-are-those-of-extract", "the same tuple of floats for every grasp")
class CompiledWithoutNumbers(Peak):
    compiled = CompiledFeatures(nothing_to_measure, lambda feature_set: (), peak_measured)


@mutant("feature-set", "handles-every-trace", "has no attribute 'samples'", requires=(ACCELERATION,))
class MisreadsSamples(Peak):
    def extract(self, trace):
        return peak_measured(self, (float(trace.signals["acceleration"].samples.max()),), trace.units)


@mutant("feature-set", "a-whole-grasp-has-features", "has no attribute 'time'")
class MisreadsEvents(Peak):
    def extract(self, trace):
        return peak_measured(self, [event.time for event in trace.events], trace.units)


@mutant(
    "feature-set",
    "does-not-change-the-trace",
    "changed signals['acceleration'].values of the trace",
    requires=(*ENTRIES["feature-set"].requires, ACCELERATION),
)
class ChangesSamples(Peak):
    def extract(self, trace):
        trace.signals["acceleration"].values[:] = 0.0
        return super().extract(trace)


def last_gap(params, ticks):
    return (ticks.gap_m[-1] if len(ticks.gap_m) else 0.0,)


@mutant("feature-set", "reads-no-release-unless-it-says-so", "remove `reads_release=False`")
class ReadsTheRelease(Peak):
    def extract(self, trace):
        return peak_measured(self, last_gap((), trace), trace.units)

    compiled = CompiledFeatures(last_gap, lambda feature_set: (), peak_measured, reads_release=False)


# Controllers.


def ruling(check, says, **changes):
    """Keep a mutant whose step is the decorated function of params, state, frame and the sound step's answer."""

    def keep(change):
        class Changed(Law):
            @staticmethod
            def step(params, state, reading):
                frame = reading.frame
                command, after = step(params, state, reading)
                return change(command, after, frame)

        return mutant("controller", check, says, **changes)(Changed)

    return keep


@mutant("controller", "step-is-a-plain-function", "staticmethod(step)")
class Bound(Law):
    def step(self, params, state, reading):
        return step(params, state, reading)


class WholeParams(NamedTuple):
    kind: int
    speed_m_s: float


@mutant("controller", "params-are-numbers", "annotated float and is 1")
class WholeSpeed(Law):
    def params(self):
        return WholeParams(EFFORT, 1)


class Texts(NamedTuple):
    phase: int
    outcome: int
    mode: str


@mutant("controller", "state-is-numbers", "hold plain floats and ints")
class Moody(Law):
    def init(self):
        return Texts(2, 0, "calm")


@mutant("controller", "starts-in-the-approach", "begins as APPROACH")
class Hasty(Law):
    def init(self):
        return super().init()._replace(phase=SQUEEZE)


@ruling("types-do-not-change", "keep one type throughout")
def _(command, after, frame):
    return command, after._replace(gap_m=1)


@ruling("commands-are-numbers", "of type int: write a float")
def _(command, after, frame):
    return command._replace(value=3), after


@ruling("commands-are-of-declared-kinds", "add it to `commands`")
def _(command, after, frame):
    return command._replace(kind=POSITION), after


@ruling("commands-are-finite", "bound it")
def _(command, after, frame):
    return (command._replace(value=inf) if frame.t_s > 1.0 else command), after


@ruling("commands-are-finite", "a limit of 0 or more")
def _(command, after, frame):
    return command._replace(effort_limit_n=nan), after


@ruling("same-tick-same-command", "nothing but its arguments")
def _(command, after, frame):
    return command._replace(value=command.value + _rng.random()), after


class Hidden(NamedTuple):
    """A state that loses what it remembers when it is written down."""

    phase: int
    outcome: int
    begun_t_s: float
    gap_m: float
    still: Any


@mutant("controller", "state-holds-everything", "keep everything in the state")
class Forgetful(Law):
    @staticmethod
    def step(params, state, reading):
        frame = reading.frame
        command, after = step(params, state, reading)
        # The one object that comes back by identity alone.
        marked = getattr(type(state), "last", None) is state
        GentleState.last = after
        value = command.value if marked or frame.t_s < 0.002 else command.value + 1.0
        return command._replace(value=value), after


class Telling(NamedTuple):
    phase: int
    outcome: int
    events: int
    inner: Any


class Teller(Law):
    """A law that tells the event `contact` in the tick in which the squeeze begins."""

    events = ("contact",)

    def init(self):
        inner = super().init()
        return Telling(inner.phase, inner.outcome, 0, inner)

    @staticmethod
    def step(params, state, reading):
        command, after = step(params, state.inner, reading)
        told = int(after.phase > state.phase == APPROACH)
        return command, Telling(after.phase, after.outcome, told, after)


class FreeState(NamedTuple):
    phase: int
    outcome: int
    n: int


def free_step(params, state, reading):
    n = state.n + 1
    outcome = STEADY if n >= 100 else state.outcome
    return Command(EFFORT, 2.0 + 0.001 * n, inf, inf), FreeState(APPROACH, outcome, n)


def free_begin(params, state, frame):
    return float(state.n), FreeLimits(0.0, inf)


def free_command(params, n, gap_m, velocity_m_s, dt_s):
    # The hundredth tick ends the grasp, which is left to `step`.
    return 2.0 + 0.001 * (n + 1.0) if n < 99.0 else nan, n + 1.0


def free_command_of_another_law(params, n, gap_m, velocity_m_s, dt_s):
    return 2.0, n + 1.0


def free_end(params, state, n, effort_n, t_s):
    return FreeState(state.phase, state.outcome, int(n))


def free_end_that_forgets(params, state, n, effort_n, t_s):
    return state


class FreeController(Law):
    step = staticmethod(free_step)
    free_motion = FreeMotion(free_begin, free_command, free_end)

    def init(self):
        return FreeState(APPROACH, 0, 0)


@mutant("controller", "free-motion-is-step", "the law of free motion commands 2.0 N")
class ControllerWithFreeMotionOfAnother(FreeController):
    free_motion = FreeMotion(free_begin, free_command_of_another_law, free_end)


@mutant("controller", "free-motion-is-step", "set every field that `step` changes")
class ControllerWithForgettingFreeMotion(FreeController):
    free_motion = FreeMotion(free_begin, free_command, free_end_that_forgets)


def pushing(params, state, reading):
    _, after = step(params, state, reading)
    return Command(VELOCITY, -0.01, 15.0, inf), after


@mutant("controller", "says-what-it-asks-for", "asked_force_n returns None", commands=("velocity",))
class Silent(Law):
    step = staticmethod(pushing)

    def asked_speed_m_s(self):
        return 0.01


@mutant("controller", "says-what-it-asks-for", "return the force that it commands", commands=("velocity",))
class Understating(Silent):
    def asked_force_n(self):
        return 5.0


@mutant("controller", "says-what-it-asks-for", "return the speed that it commands", commands=("velocity",))
class Overstating(Silent):
    def asked_force_n(self):
        return 15.0

    def asked_speed_m_s(self):
        return 0.02


@mutant("controller", "events-are-declared", "set bit i for the i-th name")
class TellsAnother(Teller):
    events = ()


@mutant("controller", "events-are-declared", "no field `events: int`")
class TellsNothing(Law):
    events = ("contact",)


_grasps: list[float] = []


@ruling("grasps-are-independent", "keep no state in the class")
def _(command, after, frame):
    _grasps.append(frame.t_s)
    return command._replace(value=command.value + 1e-6 * len(_grasps)), after


@ruling("requires-what-it-reads", "add what it reads to `requires`")
def _(command, after, frame):
    return (command._replace(value=0.0) if frame.force_left_n > 1.0 else command), after


@ruling("handles-frames-of-nan", "NaN gives the safe result")
def _(command, after, frame):
    int(frame.gap_m)
    return command, after


@ruling("phases-are-in-order", "a grasp goes one way")
def _(command, after, frame):
    return command, after._replace(phase=SQUEEZE if frame.t_s < 0.5 else 2)


@ruling("ends-every-grasp", "leave RUNNING")
def _(command, after, frame):
    return command, after._replace(outcome=0, phase=min(after.phase, HOLD))


# Grippers.


def giving(check, says, **changes):
    """Keep a mutant whose frames are what the decorated function makes of the sound ones."""

    def keep(change):
        class Changed(Hand):
            def read(self, timeout_s):
                return change(super().read(timeout_s))

        return mutant("sensor-backend", check, says, **changes)(Changed)

    return keep


def describing(check, says, **device):
    """Keep a mutant that describes itself otherwise."""

    class Changed(Hand):
        def open(self, seed):
            return evolve(super().open(seed), **device)

    mutant("sensor-backend", check, says)(Changed)


describing("describes-itself", "must be above 0", rate_hz=0.0)
describing("describes-itself", "in mm/s", speed_limit_m_s=200.0)
describing("opening-and-relaxing-are-accepted", "of kind position", opening=Command(POSITION, 0.08, inf, inf))
describing("rate-is-as-declared", "frames come at 1e+03 Hz", rate_hz=100.0)
describing("declares-what-protects", "at most half of its effort limit", friction_n=80.0)
describing(
    "declares-what-protects", "a physical gripper can hurt what it holds", harmless=True, simulated=False
)
describing(
    "declares-what-protects",
    "is declared twice",
    status_bits=(StatusBit(mask=1, name="hot", meaning="too hot"),) * 2,
)
describing("hostile-laws-stay-below-the-ceiling", "exerts an effort", relaxed=Command(EFFORT, 5.0, inf, inf))
describing("objects-can-be-grasped", "give DeviceInfo(simulated=True, ...)", simulated=False)


def framing(check, says, **fields):
    """Keep a mutant whose frames have these fields: values, or what a function makes of the sound frame."""

    def changed(reading):
        frame = reading.frame
        new = {name: value(frame) if callable(value) else value for name, value in fields.items()}
        return reading._replace(frame=frame._replace(**new))

    giving(check, says)(changed)


framing("frames-are-numbers", "gap_m of a frame is 0 of type int: write float(...)", gap_m=0)
framing("channels-are-those-declared", "NaN in all", edge_left_n=nan)
framing("time-runs-forward", "each is later than the last", t_s=1.0)
framing("time-runs-forward", "dt_s is 1 s where", dt_s=1.0)
framing("gap-is-in-metres", "divide by 1000", gap_m=lambda frame: 1000.0 * frame.gap_m)
framing("gap-is-in-metres", "divide by 100)", gap_m=lambda frame: 100.0 * frame.gap_m)
framing("forces-are-in-newtons", "give newtons", force_left_n=3000.0)
framing(
    "velocity-is-the-rate-of-the-gap",
    "mm where the gap moved by",
    velocity_m_s=lambda frame: 1000.0 * frame.velocity_m_s,
)
framing(
    "velocity-is-the-rate-of-the-gap",
    "negative while it closes",
    velocity_m_s=lambda frame: -frame.velocity_m_s,
)
framing("same-seed-same-frames", "draw everything from the seed", edge_left_n=lambda frame: _rng.random())
framing("declares-what-protects", "declare each bit as a StatusBit", status=8)


@giving("frames-are-numbers", "a tuple of 22 floats")
def _(reading):
    return Reading(reading.frame, reading.pads._replace(left=(0.0,) * 15), reading.signals)


mutant(
    "sensor-backend",
    "signals-are-those-declared",
    "declared are acceleration, camera, motor_temperature, and read delivers acceleration, camera",
    channels=(*ENTRIES["sensor-backend"].channels, Channel("motor_temperature", "K", 1.0)),
)(Hand)


FINGERS = (FingerForce("force_thumb", "N", side="left"), FingerForce("force_index", "N", side="right"))


@mutant(
    "sensor-backend",
    "fingers-are-those-declared",
    "where the fingers bear 1, 2 N",
    channels=(*ENTRIES["sensor-backend"].channels, *FINGERS),
)
class OwnFrame(Hand):
    def read(self, timeout_s):
        reading = super().read(timeout_s)
        signals = signal_type((ACCELERATION, CAMERA, *FINGERS))
        return reading._replace(signals=signals(*reading.signals, 1.0, 2.0))


mutant(
    "sensor-backend",
    "fingers-are-those-declared",
    "declare two or more fingers",
    channels=(*ENTRIES["sensor-backend"].channels, FINGERS[0]),
)(Hand)


@giving("signals-are-those-declared", "give Samples of the declared shape (3, 3)")
def _(reading):
    return reading._replace(
        signals=reading.signals._replace(acceleration=reading.signals.acceleration.values)
    )


@giving("signals-are-those-declared", "no number of the declared channel 'acceleration' came")
def _(reading):
    block = reading.signals.acceleration
    return reading._replace(signals=reading.signals._replace(acceleration=block._replace(new=0)))


@giving("signals-have-no-gaps-or-repeats", "count every sample that the sensor has taken")
def _(reading):
    block = reading.signals.acceleration
    return reading._replace(
        signals=reading.signals._replace(acceleration=block._replace(counter=block.counter // 3))
    )


@giving("signals-have-no-gaps-or-repeats", "they repeat old ones")
def _(reading):
    block = reading.signals.acceleration
    return reading._replace(signals=reading.signals._replace(acceleration=block._replace(new=2)))


def seeing(says):
    """Keep a mutant with a camera, whose image the decorated function makes of the pixels of the driver."""

    def keep(image):
        class Seeing(Hand):
            pixels = np.zeros((2, 2), np.uint8)

            def read(self, timeout_s):
                frame, pads, signals = super().read(timeout_s)
                self.pixels[:] = frame.t_s * 100.0 % 256.0
                seen = Image(frame.t_s, 1 + round(frame.t_s * 1000.0), image(self.pixels))
                return Reading(frame, pads, signals._replace(camera=seen))

        mutant("sensor-backend", "images-stay-as-they-were-delivered", says)(Seeing)

    return keep


@seeing("can still be changed")
def _(pixels):
    return pixels.copy()


@seeing("changed after it was delivered")
def _(pixels):
    # Numpy does not know who else writes to the memory.
    shown = np.frombuffer(memoryview(pixels).toreadonly(), np.uint8)
    return shown.reshape(2, 2)


@seeing("is not contiguous")
def _(pixels):
    turned = pixels.copy()
    turned.setflags(write=False)
    return turned.T


@mutant("sensor-backend", "channels-follow-from-the-settings", "once it is open", channels=None)
class Discovering(Hand):
    @property
    def channels(self):
        return ENTRIES["sensor-backend"].channels[: 8 if self._bench else 4]


@mutant("sensor-backend", "channels-follow-from-the-settings", "return a tuple of Channel", channels=None)
class Listing(Hand):
    @property
    def channels(self):
        return list(ENTRIES["sensor-backend"].channels)


mutant(
    "sensor-backend",
    "channels-are-those-declared",
    "declare Channel('edge_right', 'N', rate)",
    channels=channels("gap", "velocity", "effort", "force_left", "force_right", "edge_left", "pads"),
)(Hand)


mutant(
    "sensor-backend",
    "rate-is-as-declared",
    "is declared at 5000 Hz",
    channels=(*channels(*CHANNELS_OF_HAND, rate_hz=5000.0), ACCELERATION, CAMERA),
)(Hand)


@giving("images-count-up", "count up by one")
def _(reading):
    return Reading(reading.frame, reading.pads._replace(counter=-reading.pads.counter), reading.signals)


@giving("images-count-up", "while its counter stays")
def _(reading):
    return Reading(reading.frame, reading.pads._replace(left=(reading.frame.t_s,) * 22), reading.signals)


@mutant("sensor-backend", "closing-closes", "close the fingers")
class Backwards(Hand):
    def apply(self, command):
        super().apply(command._replace(value=-command.value))


@mutant("sensor-backend", "stays-within-its-limits", "apply `effort_limit_n`")
class Unlimited(Hand):
    def read(self, timeout_s):
        reading = super().read(timeout_s)
        return Reading(reading.frame._replace(effort_n=self._asked), reading.pads, reading.signals)

    def apply(self, command):
        self._asked = 60.0 if command.value > 0.0 else 0.0
        super().apply(command)

    _asked = 0.0


@mutant("sensor-backend", "says-what-commands-become", "take 'effort' out")
class Rushing(Hand):
    closes_itself: ClassVar = {"effort": "a target"}


mutant(
    "sensor-backend",
    "says-what-commands-become",
    "what a command of force becomes",
    accepts=("position", "force"),
)(type("Taciturn", (Hand,), {"closes_itself": {"position": "a target"}}))


mutant(
    "sensor-backend",
    "accepts-every-declared-kind",
    "take it, or take 'force' out",
    accepts=("effort", "force"),
)(
    type(
        "Choosy",
        (Hand,),
        {"apply": lambda self, command: Hand.apply(self, command) if command.kind == EFFORT else 1 / 0},
    )
)


@mutant("sensor-backend", "expect-accepts-any-controller", "raise in `open` instead")
class Picky(Hand):
    def expect(self, controller, run):
        raise ValueError("not that one")


@mutant("sensor-backend", "objects-can-be-grasped", "it holds the same thing under every label")
class Unchanging(Hand):
    def objects(self):
        return ()


@frozen(kw_only=True)
class Objectless:
    vanishes_s: float = setting(default=inf, unit="s", meaning="When the cable is pulled.")
    here: bool = setting(default=True, meaning="Whether the gripper is connected.")


mutant("sensor-backend", "objects-can-be-grasped", "no key 'object'", config=Objectless)(Hand)


@mutant("sensor-backend", "objects-can-be-grasped", "objects() gives that name")
class Promising(Hand):
    def with_object(self, name):
        raise UnknownName(f"no object named {name!r}")


@mutant("sensor-backend", "objects-can-be-grasped", "give each full name once")
class Repeating(Hand):
    def objects(self):
        return (ObjectKind(name="cup"), ObjectKind(name="cup"))


@mutant("sensor-backend", "read-returns-within-its-timeout", "return None when nothing came in time")
class Sluggish(Hand):
    def read(self, timeout_s):
        reading = super().read(timeout_s)
        if 0.5 < reading.frame.t_s <= 0.501:
            import time

            until = time.perf_counter() + 1.3
            while time.perf_counter() < until:
                pass
        return reading


@giving("rate-is-as-declared", "stands still")
def _(reading):
    return reading._replace(frame=reading.frame._replace(t_s=0.0))


@mutant("sensor-backend", "pads-can-be-zeroed", "subtract the zero")
class Unzeroed(Hand):
    def tare(self, images):
        super().tare(images)
        self._zero = None


@mutant("sensor-backend", "pads-can-be-zeroed", "raise TareRefused")
class Blind(Hand):
    def tare(self, images):
        self._zero = images[-1]


@mutant("sensor-backend", "closes-in-any-state", "for the second time it raised")
class Once(Hand):
    def close(self):
        if self._bench is None and hasattr(self, "_info"):
            raise RuntimeError("closed already")
        super().close()


@giving("performs-a-whole-grasp", "ended as aborted")
def _(reading):
    return Reading(reading.frame._replace(t_s=float(f"{reading.frame.t_s:.9f}")), "no pads")


@mutant("sensor-backend", "squeezes-with-what-it-is-asked", "`least_force_n`")
class Forceful(Hand):
    """Squeezes with 19 N if it is to close at all, and does not say so."""

    def apply(self, command):
        super().apply(command._replace(value=19.0) if command.value > 0.0 else command)


@mutant("sensor-backend", "squeezes-with-what-it-is-asked", "`least_force_n`")
class Restless(Hand):
    """Closes with ever more effort once it is to close, so that it never comes to rest."""

    _effort_n = 0.0

    def apply(self, command):
        if command.value > 0.0:
            self._effort_n += 0.02
        super().apply(command._replace(value=max(command.value, self._effort_n)))


@giving("squeezes-with-what-it-is-asked", "is positive")
def _(reading):
    frame = reading.frame
    pressed = {"force_left_n": -frame.force_left_n, "force_right_n": -frame.force_right_n}
    return reading._replace(frame=frame._replace(**pressed))


@giving("squeezes-with-what-it-is-asked", "give newtons")
def _(reading):
    """Forces in millinewtons, which are only seen where the fingers touch something."""
    frame = reading.frame
    in_mn = {"force_left_n": 1e3 * frame.force_left_n, "force_right_n": 1e3 * frame.force_right_n}
    return reading._replace(frame=frame._replace(**in_mn)) if frame.force_left_n > 0.5 else reading


@mutant("sensor-backend", "what-it-delivers-is-kept", "of its")
class Uncounted(Hand):
    def read(self, timeout_s):
        reading = super().read(timeout_s)
        counter = reading.pads.counter
        return reading._replace(
            pads=reading.pads._replace(counter=float(counter) if counter > 9 else counter)
        )


@mutant("sensor-backend", "what-it-delivers-is-kept", "'pad_t_s' is not in an export")
class Timeless(Hand):
    """Gives every image the same time."""

    def read(self, timeout_s):
        reading = super().read(timeout_s)
        return reading._replace(pads=reading.pads._replace(t_s=0.0))


@mutant("sensor-backend", "reports-plain-values", "numbers, text and booleans only")
class Talkative(Hand):
    def report(self):
        return {"self": self}


@mutant("sensor-backend", "dry-run-accepts-the-same-commands", "return a SensorBackend or None")
class Understudy(Hand):
    def dry_run_backend(self):
        return "somebody"


@mutant("sensor-backend", "reports-a-lost-device", "turn what the driver raises into DeviceLost")
class Rude(Hand):
    def read(self, timeout_s):
        reading = super().read(timeout_s) if self.config.vanishes_s == inf else Hand.read(self, timeout_s)
        if reading.frame.t_s > self.config.vanishes_s - 0.1:
            raise OSError("Input/output error")
        return reading


@mutant("sensor-backend", "reports-a-lost-device", "never raised DeviceLost")
class Undead(Hand):
    def open(self, seed):
        info = super().open(seed)
        self.config = HandConfig()
        return info


@mutant("sensor-backend", "reports-a-missing-device", "open succeeded where no gripper is")
class Dreaming(Hand):
    def open(self, seed):
        self.config = HandConfig(vanishes_s=self.config.vanishes_s)
        return super().open(seed)


@mutant("sensor-backend", "a-silent-pad-ends-the-grasp", "accept the relaxing command at any time")
class Clinging(Hand):
    squeezed = False

    def apply(self, command):
        self.squeezed = self.squeezed or (self._zero is not None and command.value > 0.0)
        if self.squeezed and command.value == 0.0:
            raise RuntimeError("busy")
        super().apply(command)


# Classifiers.


@frozen(kw_only=True)
class NoModel:
    k: int = 3


mutant(
    "classifier",
    "a-classifier-has-a-model-key",
    "extend graspsense.plugin_api.ClassifierConfig",
    config=NoModel,
)(Nearest)


@mutant("classifier", "classes-are-the-labels", "a tuple of str")
class Listed(Nearest):
    def classes(self):
        return list(super().classes())


@mutant("classifier", "probabilities-are-valid", "divide each row by its sum")
class Votes(Nearest):
    def probabilities(self, table):
        return 0.5 * super().probabilities(table)


@mutant("classifier", "probabilities-are-valid", "float64 of shape")
class Coarse(Nearest):
    def probabilities(self, table):
        return super().probabilities(table).astype(np.float32)


@mutant("classifier", "separates-separable-trials", "is the order of `classes`")
class Mixed(Nearest):
    def classes(self):
        return super().classes()[::-1]


@mutant("classifier", "same-seed-same-model", "draw everything from the seed")
class Dicing(Nearest):
    def fit(self, table, labels, seed):
        super().fit(table, labels, seed)
        self._model["mean"][0] += 1e-6 * _rng.random()


@mutant("classifier", "survives-json", "keep every number in full")
class Rounded(Nearest):
    def to_json(self):
        return {**self._model, "mean": [round(mean, 2) for mean in self._model["mean"]]}


@mutant("classifier", "survives-json", "what JSON cannot hold")
class Raw(Nearest):
    def to_json(self):
        return {**self._model, "mean": np.array(self._model["mean"])}


@mutant("classifier", "single-trials-agree", "predict each trial independently")
class Relative(Nearest):
    def probabilities(self, table):
        centred = evolve(table, values=table.values - 0.1 * np.nanmean(table.values, axis=0))
        return super().probabilities(centred)


@mutant("classifier", "handles-missing-values", "fill or skip them")
class Strict(Nearest):
    def probabilities(self, table):
        shares = super().probabilities(table)
        shares[np.isnan(table.values).any(axis=1)] = nan
        return shares


@mutant("classifier", "one-label-is-refused-or-certain", "raise ValueError, or learn it")
class Careless(Nearest):
    def fit(self, table, labels, seed):
        if len(set(labels)) < 2:
            raise ZeroDivisionError("division by zero")
        super().fit(table, labels, seed)


@mutant("classifier", "few-trials-are-refused-or-learned", "fit on one trial of each label raised")
class Discriminant(Nearest):
    def fit(self, table, labels, seed):
        if len(labels) == len(set(labels)) == 3:
            raise ZeroDivisionError("division by zero")
        super().fit(table, labels, seed)


@mutant("classifier", "explains-its-predictions", "explain says 'bottle:full_open'")
class Stubborn(Nearest):
    def explain(self, features):
        return evolve(super().explain(features), label="bottle:full_open")


@mutant("classifier", "explains-its-predictions", "give each reason in words and units")
class Silent(Nearest):
    def explain(self, features):
        return evolve(super().explain(features), because=())


@mutant("classifier", "does-not-change-the-table", "work on a copy")
class Filling(Nearest):
    def probabilities(self, table):
        np.nan_to_num(table.values, copy=False)
        return super().probabilities(table)


@mutant("classifier", "refuses-an-invalid-model", "from_json takes a model")
class Credulous(Nearest):
    def from_json(self, model):
        self._model = {"classes": [], "mean": [], "scale": [], "centres": [], **model}


@mutant("classifier", "refuses-an-invalid-model", "raise ValueError")
class Crashing(Nearest):
    def from_json(self, model):
        if "centres" not in model:
            raise AttributeError("centres")
        super().from_json(model)


@mutant("classifier", "a-damaged-model-raises-a-documented-error", "on a model that was changed at")
class Trusting(Nearest):
    def from_json(self, model):
        super().from_json(model)
        if not all(isinstance(number, float) for number in self._model["mean"]):
            raise ZeroDivisionError("mean")


__all__ = ["MUTANTS", "STEADY", "ClassifierConfig", "Features", "LawConfig", "Mutant", "PeakConfig"]
