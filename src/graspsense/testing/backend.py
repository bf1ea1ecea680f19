"""Conformance checks of a sensor backend: hardware, an emulation of it, a simulation, or a recording."""

from __future__ import annotations

import json
import time
from contextlib import closing, nullcontext, suppress
from functools import lru_cache
from math import ceil, isfinite, isnan, nan
from pathlib import Path
from statistics import fmean, median
from typing import Any, Final

import numpy as np

from graspsense.core.components.entries import KINDS
from graspsense.core.components.roles import SensorBackend
from graspsense.core.components.run_config import RunConfig
from graspsense.core.components.strict import keys_of
from graspsense.core.grasp.protection.effort_ceiling import MARGIN
from graspsense.core.grasp.runner import Grasp, run_uninterrupted
from graspsense.core.settings.selected import create
from graspsense.core.values.errors import DeviceLost, NoDevice, RecordingEnded, TareRefused
from graspsense.core.values.signals import (
    FORCE,
    HOLD,
    SQUEEZE,
    Command,
    Frame,
    Outcome,
)
from graspsense.testing.checks import (
    CheckFailed,
    CheckNotTried,
    CheckSkipped,
    demand,
    leaving_no_thread,
    raises_nothing,
)
from graspsense.testing.laws import EFFORT_N, FORCE_N, REST_S, GentleController, kind_of
from graspsense.testing.session import TIMEOUT_S, Session, description, next_reading, opened, readings_of, use
from graspsense.testing.subject import Subject

GRACE_S: Final = 1.0
"""Time (s) by which a busy machine may exceed a time-out."""
VANISHING_S: Final = 2.0
LONGEST_OPEN_S: Final = 10.0
TARE_TICKS: Final = 20


def describes_itself(subject: Subject) -> None:
    """`open` returns a DeviceInfo with a name, a rate and limits above zero, of the right types."""
    info = subject.session.info
    demand(
        bool(info.name.strip()) and info.name.isprintable(),
        f"DeviceInfo has the name {info.name!r}: say in one line what the gripper is",
    )
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
        for name, most, unit in (("speed_limit_m_s", 5.0, "m/s"), ("effort_limit_n", 5000.0, "N")):
            limit = getattr(info, name)
            demand(limit <= most, f"{name} is {limit:g}: that is in m{unit}; give {unit}")


def answers_in_time(subject: Subject) -> None:
    """`open` and `close` take ten seconds at most, each, and `read` returns a frame or None within its time-out."""
    # A simulator compiles at its first opening, and other work may hold it up, but hardly in a second session.
    late = _late(subject.session) and _late(readings_of(subject))
    demand(not late, late)


def _late(session: Session) -> str:
    """Return in words which method took too long; empty if none did."""
    for method, took_s, most_s, advice in (
        ("open", session.opened_s, LONGEST_OPEN_S, "raise NoDevice where nothing answers"),
        ("close", session.closed_s, LONGEST_OPEN_S, "end what does not answer"),
        ("read", session.longest_read_s, TIMEOUT_S + GRACE_S, "return None when nothing came in time"),
    ):
        if took_s > most_s:
            return f"`{method}` took {took_s:.2f} s, and {most_s:g} s are allowed: {advice}"
    return ""


def pads_can_be_zeroed(subject: Subject) -> None:
    """After a tare with unloaded images the forces are near zero; a tare without enough images is refused."""
    info, declared = subject.session.info, {channel.name for channel in subject.entry.channels}
    if not info.tare_images or not declared & {"force_left", "force_right"}:
        raise CheckSkipped("this gripper is not tared")
    with opened(subject) as (backend, session):
        with (
            raises_nothing("a tare without images", ": raise TareRefused with what to do"),
            suppress(TareRefused),
        ):
            backend.tare([])
        for _ in range(ceil(5.0 * info.rate_hz / TARE_TICKS)):
            if len(session.images) < info.tare_images:
                use(session, backend, "unloaded", TARE_TICKS, info.relaxed)
        demand(
            len(session.images) >= info.tare_images,
            f"{len(session.images)} images came in 5 s, a tare needs {info.tare_images}",
        )
        backend.tare(session.images[: info.tare_images])
        use(session, backend, "tared", TARE_TICKS, info.relaxed)
        tared = [reading.frame for reading in session.stages["tared"]]
        forces = [force for frame in tared for force in (frame.force_left_n, frame.force_right_n)]
        known = [force for force in forces if not isnan(force)]
        demand(
            bool(known) and abs(fmean(known)) < 0.6,
            f"after the tare the unloaded pads feel {fmean(known or [nan]):.3g} N: subtract the zero, then divide by "
            "the counts of a newton",
        )


def closes_in_any_state(subject: Subject) -> None:
    """`close` works in any state, also twice, and leaves nothing open; the gripper can then be opened again."""
    backend, advice = subject.create(), ": `close` must release everything in any state"
    with raises_nothing("close before open", advice):
        backend.close()
    grown = []
    for attempt in ("first", "second", "third"):
        used = _open_files()
        no_more = leaving_no_thread("it is opened") if attempt == "second" else nullcontext()
        with no_more, raises_nothing(f"closed twice after the {attempt} opening, it", advice):
            info = description(backend.open(0))
            _first_frame(backend)
            backend.apply(info.relaxed)
            backend.close()
            backend.close()
        grown.append(_open_files() - used)
    # Something else in this process may open a file meanwhile.
    demand(
        min(grown) <= 0,
        "`close` leaves a connection or a file open: close it there, so that others can use the gripper",
    )


def _open_files() -> int:
    """Return how many files, sockets and lines this process has open; 0 where the system does not say."""
    folder = Path("/proc/self/fd")
    return len(list(folder.iterdir())) if folder.is_dir() else 0


def _first_frame(backend: SensorBackend[Any]) -> Frame:
    for _ in range(20):
        reading = next_reading(backend)
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
        with opened(subject, seed=3) as (backend, session), suppress(RecordingEnded):
            for _ in range(100):
                readings.append(repr(backend.read(TIMEOUT_S)))
                backend.apply(session.info.opening or session.info.relaxed)
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
    demand(
        subject.session.info.simulated,
        "objects() gives names, and the opened gripper is not simulated: give DeviceInfo(simulated=True, ...), or none",
    )
    names = [name for kind in kinds for name in kind.full_names]
    twice = {name for name in names if names.count(name) > 1}
    demand(not twice, f"objects() gives {', '.join(sorted(twice))} twice: give each full name once")
    held = set()
    for name in names:
        with raises_nothing(f"with_object({name!r})", ", although objects() gives that name"):
            held.add(repr(subject.create().with_object(name).config))
    demand(
        len(held) == len(names),
        f"with_object gives the same settings for several of {', '.join(names)}: take the name in, as in "
        "`type(self)(attrs.evolve(self.config, object=name))`",
    )
    for kind in kinds:
        name = kind.full_names[0]
        with (
            raises_nothing(f"the opening of with_object({name!r})", ", although objects() gives that name"),
            closing(subject.create().with_object(name)) as backend,
        ):
            backend.open(0)


@lru_cache(maxsize=1)
def _gentle_grasp(subject: Subject) -> Grasp:
    """Return a gentle grasp; performed once."""
    controller = GentleController(kind_of(subject.entry.accepts))
    return run_uninterrupted(subject.create(), controller, RunConfig(hold_s=0.05))


def squeezes_with_what_it_is_asked(subject: Subject) -> None:
    """In the hold, no force exceeds the limit that was commanded, or the least that it declares; pads feel on.

    Of a grasp that never comes to rest, it is the last half second of the squeeze that counts.
    """
    if subject.session.info.opening is None:
        raise CheckSkipped("a recording cannot be commanded")
    grasp, backend = _gentle_grasp(subject), subject.create()
    held, squeezed = grasp.trace.phase == HOLD, grasp.trace.phase == SQUEEZE
    if not held.any():
        held = squeezed
        if not held.any():
            raise CheckSkipped("the fingers did not close")
        held = held & (grasp.trace.t_s >= grasp.trace.t_s[held][-1] - REST_S)
    kind = kind_of(subject.entry.accepts)
    asked_n = max(FORCE_N if kind == FORCE else EFFORT_N, backend.least_force_n)
    for name in ("effort_n", "force_left_n", "force_right_n"):
        values = getattr(grasp.trace, name)
        known = values[held & (values == values)].tolist()
        most_n = median(known) if known else 0.0
        felt_n = float(np.nan_to_num(values[squeezed]).max(initial=0.0))
        demand(
            name == "effort_n" or felt_n < 2.0 or most_n > 0.1 * felt_n,
            f"its {name} is {felt_n:.3g} while the fingers close on something, and {most_n:.3g} while they hold it: "
            "give the force that lasts, not its change",
        )
        demand(
            most_n >= -1.0,
            f"its {name} is {most_n:.3g} when it squeezes: the force on a pad that is pressed is positive, and so is "
            "an effort that closes the fingers",
        )
        demand(
            most_n <= MARGIN * asked_n + grasp.device.friction_n + 1.0,
            f"it squeezes with a {name} of {most_n:.3g} where {KINDS[kind]} commands allow {asked_n:g} N: keep to "
            "`effort_limit_n` of a command, or declare the least that it can do as `least_force_n` of its class"
            + (", and give newtons" if most_n > grasp.device.effort_limit_n else ""),
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
    with opened(subject) as (backend, _):
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
        info = description(other.open(0))
        demand(
            info.opening is None or KINDS[info.opening.kind] in subject.entry.accepts,
            f"the gripper of a dry run opens with {info.opening}, of a kind that the real one does not accept",
        )
        _first_frame(other)


def reports_a_lost_device(subject: Subject) -> None:
    """When unplugged, it raises DeviceLost with advice, a grasp ends as device lost, and it can be closed."""
    if subject.unplugged is None:
        raise CheckNotTried(
            "no settings were given under which it vanishes (--unplugged, or `unplugged` in a test)"
        )
    with opened(subject, **subject.unplugged) as (backend, session):
        text = _lost(backend, session.info.relaxed, session.info.rate_hz)
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
        raise CheckNotTried(
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
    demand(took < LONGEST_OPEN_S, f"it took {took:.1f} s to say so: `open` is bounded in time")
    demand(len(text) > 20, f"NoDevice says {text!r}: say what was searched for, where, and what to try")
