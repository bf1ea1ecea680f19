"""Conformance checks of what protects an object: limits of the effort, faults of a pad, and the words of a status."""

from __future__ import annotations

from collections.abc import Sequence
from math import isfinite, nan
from typing import Any, Final

from graspsense.core.components.entries import KINDS
from graspsense.core.components.roles import Controller, SensorBackend
from graspsense.core.components.run_config import RunConfig
from graspsense.core.control.contact import CONTACT_FORCE_N
from graspsense.core.grasp.protection.effort_ceiling import asked_effort_n, effort_ceiling_n
from graspsense.core.grasp.protection.touch import MOST_S
from graspsense.core.grasp.runner import Grasp, run_grasp
from graspsense.core.grasp.wrapped_gripper import WrappedGripper
from graspsense.core.values.signals import EFFORT, FORCE, Command, Outcome, Pads, Reading
from graspsense.testing.checks import CheckSkipped, demand
from graspsense.testing.laws import HOSTILE, GentleController, HostileController, kind_of
from graspsense.testing.subject import Subject

RUN: Final = RunConfig(grasp_timeout_s=1.0, opening_timeout_s=1.0)
"""A short grasp: a hostile law never ends by itself."""
FELT_AFTER_S: Final = 0.3
"""Time in the approach after which one pad is made to feel, and the other one not."""
PRESSED_N: Final = 20.0 * CONTACT_FORCE_N


class Observed(WrappedGripper):
    """A gripper whose commands are kept; with `silent`, its left pad stops feeling while the right one presses."""

    def __init__(self, gripper: SensorBackend[Any], silent: bool) -> None:
        super().__init__(gripper)
        self._silent = silent
        self._tared_t_s = self._t_s = nan
        self.commands: list[Command] = []

    def read(self, timeout_s: float) -> Reading | None:
        """Return what the gripper measured, or what a silent pad and one that presses would."""
        reading = super().read(timeout_s)
        if reading is None:
            return None
        frame = reading.frame
        self._t_s = frame.t_s
        if self._silent and frame.t_s - self._tared_t_s > FELT_AFTER_S:
            frame = frame._replace(force_left_n=0.0, force_right_n=PRESSED_N)
        return reading._replace(frame=frame)

    def apply(self, command: Command) -> None:
        """Apply the command and keep it."""
        super().apply(command)
        self.commands.append(command)

    def tare(self, images: Sequence[Pads]) -> None:
        """Tare the gripper, after which the fingers close."""
        self._tared_t_s = self._t_s
        self.gripper.tare(images)


def _grasped(
    subject: Subject, controller: Controller[Any], run: RunConfig, silent: bool = False
) -> tuple[Observed, Grasp]:
    info = subject.session.info
    if info.opening is None:
        raise CheckSkipped("a recording cannot be commanded")
    if info.harmless:
        raise CheckSkipped("it declares that it can hurt nothing")
    gripper = Observed(subject.create(), silent)
    return gripper, run_grasp(gripper, controller, run)


def _demand_released(gripper: Observed, grasp: Grasp, what: str) -> None:
    last = gripper.commands[-1]
    demand(
        last == grasp.device.relaxed,
        f"{what} left the command {last} in force: accept the relaxing command at any time",
    )
    demand(
        last.kind not in (EFFORT, FORCE) or last.value == 0.0,
        f"the relaxing command {last} exerts an effort: give one of 0 N",
    )


def declares_what_protects(subject: Subject) -> None:
    """Friction is a plausible number, each status bit has words, and only a model or a recording is harmless."""
    info = subject.session.info
    demand(
        isfinite(info.friction_n) and 0.0 <= info.friction_n <= 0.5 * info.effort_limit_n,
        f"friction_n is {info.friction_n:g}: give the greatest friction of the drive in N, at most half of its effort "
        f"limit of {info.effort_limit_n:g} N, since the ceiling of the effort contains it",
    )
    demand(
        not info.harmless or info.simulated or info.opening is None,
        "harmless is True, but a physical gripper can hurt what it holds: leave it out",
    )
    known = 0
    for bit in info.status_bits:
        demand(not known & bit.mask, f"status bit {bit.mask:#x} ({bit.name}) is declared twice")
        known |= bit.mask
    seen = 0
    for frame in subject.session.frames:
        seen |= frame.status
    demand(
        not (info.opening is not None and seen & ~known),
        f"frames have the status {seen & ~known:#x}, which nothing explains: declare each bit as a StatusBit in "
        "DeviceInfo(status_bits=...)",
    )


def hostile_laws_stay_below_the_ceiling(subject: Subject) -> None:
    """Under laws that command NaN, huge, oscillating and never ending values, the effort stays below its ceiling."""
    kind = kind_of(subject.entry.accepts)
    for name in HOSTILE:
        controller: Controller[Any] = HostileController((name, kind))
        gripper, grasp = _grasped(subject, controller, RUN)
        demand(
            grasp.outcome not in (Outcome.STEADY, Outcome.RUNNING),
            f"a law that commands {name} ended as {grasp.outcome.words}",
        )
        ceiling_n = effort_ceiling_n(grasp.device, controller, RUN)
        own = [usual[:2] for usual in (grasp.device.opening, grasp.device.relaxed) if usual is not None]
        for command in gripper.commands:
            effort_n = asked_effort_n(command)
            demand(
                command[:2] in own or effort_n <= ceiling_n,
                f"a law that commands {name} by {KINDS[kind]} squeezed with {effort_n:g} N, {ceiling_n:g} N is allowed",
            )
        _demand_released(gripper, grasp, f"a law that commands {name}")


def a_silent_pad_ends_the_grasp(subject: Subject) -> None:
    """While one pad presses and the other one feels nothing, the grasp ends within a bounded time, and lets go."""
    names = {channel.name for channel in subject.entry.channels}
    if not {"force_left", "force_right"} <= names:
        raise CheckSkipped("it has no pads that feel")
    controller = GentleController(kind_of(subject.entry.accepts))
    gripper, grasp = _grasped(subject, controller, RunConfig(hold_s=0.05), silent=True)
    demand(
        grasp.outcome in (Outcome.ONE_FINGER, Outcome.ABORTED, Outcome.NOTHING_THERE),
        f"the left pad felt nothing while the right one pressed with {PRESSED_N:g} N, and the grasp ended as "
        f"{grasp.outcome.words}",
    )
    pressed = grasp.trace.t_s[grasp.trace.force_right_n == PRESSED_N]
    lasted_s = float(pressed[-1] - pressed[0]) if len(pressed) else 0.0
    demand(
        lasted_s < MOST_S + 1.0, f"the right pad pressed alone for {lasted_s:.1f} s before the fingers opened"
    )
    _demand_released(gripper, grasp, "a grasp with a silent pad")
