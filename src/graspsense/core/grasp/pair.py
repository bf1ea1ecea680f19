"""Two grippers that grasp at the same time: one axis of time, and both let go if one of them fails.

Each grasp has its own thread and its own controller. Times count from when both grippers are open. The clock of a
device is shifted by one offset, from the arrival of its first frame; its drift within a grasp is not corrected. A
gripper with a virtual clock takes its next tick only when the other one has reached its time.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from threading import Condition, Thread
from typing import Any, Generic, TypeVar

from attrs import define, evolve, field

from graspsense.core.components.roles import SensorBackend
from graspsense.core.grasp.wrapped_gripper import WrappedGripper
from graspsense.core.values.device import DeviceInfo
from graspsense.core.values.errors import ConfigError, DeviceLost, ExitCode, GraspsenseError, named
from graspsense.core.values.signals import Command, Image, Pads, Reading, Samples

T = TypeVar("T")


class OtherGripperFailed(GraspsenseError):
    """The other gripper of a pair was lost or could not go on, so that this one lets go."""

    exit_code = ExitCode.NOT_FINISHED


@define(eq=False)
class Member:
    """One of two grippers: how far it is, and what it waits for of the other one."""

    changed: Condition
    name: str = "the other gripper"
    opened_s: float | None = None
    """Time of the host's monotonic clock at which it was open."""
    t_s: float = 0.0
    """Its time on the common axis."""
    over: bool = False
    failure: str = ""
    other: Member = field(init=False)
    _told: bool = False

    def gripper(self, backend: SensorBackend[Any]) -> SensorBackend[Any]:
        """Return this backend as the one of the pair."""
        return PairedBackend(backend, self)

    def fails(self, why: str) -> None:
        """Tell the other gripper that this one cannot go on."""
        with self.changed:
            self.failure = self.failure or why
            self.changed.notify_all()

    def ends(self) -> None:
        """Tell the other gripper not to wait for this one any more."""
        with self.changed:
            self.over = True
            self.changed.notify_all()

    def opens(self, name: str) -> float:
        """Wait until both grippers are open, and return when that was. Raises OtherGripperFailed."""
        with self.changed:
            self.name, self.opened_s = name, time.monotonic()
            self.changed.notify_all()
            self.changed.wait_for(lambda: self.other.opened_s is not None or self._other_stopped())
            self._check()
            return max(self.opened_s, self.other.opened_s or self.opened_s)

    def reaches(self, t_s: float) -> None:
        """Say which time this gripper has reached."""
        with self.changed:
            self.t_s = t_s
            self.changed.notify_all()

    def may_go_on(self, *, waits: bool) -> None:
        """Return when the next tick may be taken; `waits`: when the other gripper has reached this one's time.

        Raises OtherGripperFailed, once: what follows is the release of this gripper.
        """
        with self.changed:
            if waits:
                self.changed.wait_for(lambda: self.other.t_s >= self.t_s or self._other_stopped())
            self._check()

    def _other_stopped(self) -> bool:
        return self.other.over or bool(self.other.failure)

    def _check(self) -> None:
        if self.other.failure and not self._told:
            self._told = True
            raise OtherGripperFailed(f"{self.other.name} of this pair {self.other.failure}, so both let go")


class PairedBackend(WrappedGripper):
    """A gripper of a pair: the same readings and commands, on the common axis of time."""

    def __init__(self, backend: SensorBackend[Any], member: Member) -> None:
        super().__init__(backend)
        self._member = member
        self._virtual, self._zero_s = False, 0.0
        self._offset_s: float | None = None
        self._pads: tuple[Pads | None, Pads | None] = (None, None)
        self._signals: tuple[Any, Any] = ((), ())

    def open(self, seed: int) -> DeviceInfo:
        """Open the gripper, and wait until the other one is open. Raises OtherGripperFailed, ConfigError, NoDevice."""
        info = super().open(seed)
        if info.units.get("t", "s") != "s":
            raise ConfigError(
                f"{info.name} counts its time in {info.units['t']}: two grippers of one run need seconds"
            )
        self._virtual = info.clock == "virtual"
        self._zero_s = self._member.opens(info.name)
        return evolve(
            info, notes=(*info.notes, f"grasps beside {self._member.other.name}, on one axis of time")
        )

    def read(self, timeout_s: float) -> Reading | None:
        """Return the next reading, with its times on the common axis. Raises OtherGripperFailed."""
        self._member.may_go_on(waits=self._virtual)
        try:
            reading = super().read(timeout_s)
        except DeviceLost as error:
            self._member.fails(f"was lost ({error})")
            raise
        if reading is None:
            self._member.fails(f"gave no frame for {timeout_s * 1e3:.0f} ms")
            return None
        if self._offset_s is None:
            arrived_s = 0.0 if self._virtual else time.monotonic() - self._zero_s
            self._offset_s = arrived_s - reading.frame.t_s
        self._member.reaches(reading.frame.t_s + self._offset_s)
        return self._shifted(reading, self._offset_s) if self._offset_s else reading

    def _shifted(self, reading: Reading, offset_s: float) -> Reading:
        """Return a reading with later times. An image that comes again remains the same object."""
        frame, pads, signals = reading
        if pads is not self._pads[0]:
            self._pads = pads, pads._replace(t_s=pads.t_s + offset_s) if pads.counter else pads
        if signals is not self._signals[0]:
            later = signals
            if signals:
                later = type(signals)._make(
                    signal._replace(t_s=signal.t_s + offset_s)
                    if isinstance(signal, Image | Samples) and signal.counter
                    else signal
                    for signal in signals
                )
            self._signals = signals, later
        return Reading(frame._replace(t_s=frame.t_s + offset_s), self._pads[1], self._signals[1])  # type: ignore[arg-type]

    def apply(self, command: Command) -> None:
        """Command the gripper."""
        try:
            super().apply(command)
        except DeviceLost as error:
            self._member.fails(f"was lost ({error})")
            raise

    def report(self) -> Mapping[str, Any]:
        """Return the report of the gripper, with the offset that was added to its clock (s)."""
        return {**self.gripper.report(), "clock_offset_s": self._offset_s or 0.0}


@define(eq=False)
class _Running(Generic[T]):
    """The grasp of one member: its result, or what it raised."""

    member: Member
    grasp: Callable[[Member], tuple[T, str]]
    result: list[T] = field(factory=list)
    error: BaseException | None = None

    def run(self) -> None:
        try:
            result, failure = self.grasp(self.member)
            self.result.append(result)
            if failure:
                self.member.fails(failure)
        except BaseException as error:
            self.error = error
            self.member.fails(f"could not grasp ({named(error)})")
        finally:
            self.member.ends()


def run_pair(
    grasp_here: Callable[[Member], tuple[T, str]], grasp_beside: Callable[[Member], tuple[T, str]]
) -> tuple[T, T]:
    """Run two grasps at the same time and return their results.

    Each function performs a grasp with `member.gripper(backend)`. It returns its result, and why the other gripper has
    to let go, empty if it need not. The first runs in this thread, which signals interrupt. Raises what one of them
    raised, after both have ended.
    """
    changed = Condition()
    members = Member(changed), Member(changed)
    members[0].other, members[1].other = members[1], members[0]
    running = _Running(members[0], grasp_here), _Running(members[1], grasp_beside)
    thread = Thread(target=running[1].run, name="second gripper")
    thread.start()
    running[0].run()
    interrupted = False
    while thread.is_alive():
        try:
            thread.join()
        except KeyboardInterrupt:
            interrupted = True
            members[0].fails("was interrupted")
    errors = [grasp.error for grasp in running if grasp.error is not None]
    for error in sorted(errors, key=lambda error: isinstance(error, OtherGripperFailed)):
        raise error
    if interrupted:
        raise KeyboardInterrupt
    return running[0].result[0], running[1].result[0]
