"""The protection of one grasp: it limits what a controller may command, and ends a grasp whose sensors or motor fail.

It holds for every controller and every gripper that can hurt something (`DeviceInfo.harmless` is False), as far as the
channels of the gripper allow. The runner passes each command through its limits, after the guard. The other checks
follow when the gripper has the command. A fault that they find ends the grasp in the same tick.
"""

from __future__ import annotations

from collections.abc import Callable
from math import inf, nan
from typing import Final

from attrs import evolve

from graspsense.core.components.roles import Controller
from graspsense.core.components.run_config import RunConfig
from graspsense.core.grasp.protection.causes import causes, follows
from graspsense.core.grasp.protection.cells import Fingertips
from graspsense.core.grasp.protection.drift import Drift
from graspsense.core.grasp.protection.effort import ReportedEffort
from graspsense.core.grasp.protection.effort_ceiling import asked_effort_n, effort_ceiling_n, limited
from graspsense.core.grasp.protection.losses import FRAMES_LOST, Losses
from graspsense.core.grasp.protection.motor import REVERSED, FeltForce, FreeEffort, Motor
from graspsense.core.grasp.protection.opening import Opening
from graspsense.core.grasp.protection.pad_curves import PadCurves
from graspsense.core.grasp.protection.reports import (
    EFFORT_ABSENT,
    GAP_ABSENT,
    PADS_ABSENT,
    Absence,
    Repeats,
    Reports,
    StatusWatch,
)
from graspsense.core.grasp.protection.speed import GapJump, GapSpeed, KeptSpeed, Standstill
from graspsense.core.grasp.protection.touch import CLOSED_M, Touch
from graspsense.core.values.device import DeviceInfo
from graspsense.core.values.faults import LIMITED, Fault
from graspsense.core.values.signals import (
    APPROACH,
    CLOSING,
    EFFORT,
    FORCE,
    HOLD,
    SQUEEZE,
    Command,
    Frame,
    Phase,
    Reading,
)

RELEASE: Final = int(Phase.RELEASE)


class Protection:
    """Watches one grasp of a gripper under a controller.

    `tell` is called with each fault at its first sight, unless it follows from an earlier one and ends nothing.
    `ending` is the fault that ends the grasp, once there is one. `warnings` are the causes among the faults that were
    seen, in words. `acted` is the number of commands that were limited, and `unclear` the number of those of a squeeze
    that were because only one pad felt, or a contact had no witness.
    """

    def __init__(
        self,
        info: DeviceInfo,
        controller: Controller[object],
        run: RunConfig,
        tell: Callable[[Fault], None],
        command_delay_s: float = 0.0,
    ) -> None:
        self._tell = tell
        self._told: dict[str, Fault] = {}
        self.ending: Fault | None = None
        self.acted = self.unclear = 0
        self._phase = -1
        self.side_impact = ""
        """What the edges felt in the reading that ended the approach, in words."""
        rates = {channel.name: channel.rate_hz for channel in info.channels}
        self.ceiling_n = effort_ceiling_n(info, controller, run)
        self._effort_limit_n = info.effort_limit_n
        self._approach_n = max(self.ceiling_n, run.first_effort_n if run.first_effort_n < inf else 0.0)
        self._relaxed = info.relaxed
        self._opening_n = self.ceiling_n
        contact_n = controller.contact_force_n()
        # Where only the entry of a plugin declares the channels, the frames show which there are.
        self._declared = bool(rates)
        self._has_pads = "force_left" in rates and "force_right" in rates
        pads_hz = min(rates.get("force_left", 0.0), rates.get("force_right", 0.0))
        self._drift = Drift(contact_n)
        self._touch = Touch(contact_n, run.first_effort_n, pads_hz, self._drift.on_some_cells, info.rate_hz)
        self._curves = PadCurves(contact_n, pads_hz)
        self._felt = FeltForce(info.rate_hz, pads_hz, info.friction_n)
        self._gap_speed = GapSpeed(info.rate_hz, "velocity" in rates)
        self._free_effort = FreeEffort(info.friction_n)
        self._fingertips = Fingertips()
        self._motor = Motor("effort" in rates, info.rate_hz)
        self._effort = ReportedEffort() if "effort" in rates else None
        self._effort_absence = Absence(EFFORT_ABSENT, info.rate_hz, expected="effort" in rates)
        self._gap_absence = Absence(GAP_ABSENT, info.rate_hz, expected="gap" in rates)
        self._pad_absences = [Absence(fault, pads_hz or inf, expected=True) for fault in PADS_ABSENT]
        self._status = StatusWatch(info.status_bits)
        first_m_s = run.first_speed_m_s if info.clock == "device" else inf
        self._standstill, self._jump = Standstill(), GapJump(info.speed_limit_m_s, info.rate_hz)
        self._kept_speed = KeptSpeed(info.rate_hz, min(first_m_s, info.speed_limit_m_s))
        self._repeats = Repeats(info.rate_hz)
        opening = info.opening
        if opening is not None:
            # What the guard leaves of it, where no pad has felt anything.
            opening = opening._replace(speed_limit_m_s=min(opening.speed_limit_m_s, first_m_s))
            if opening.kind == EFFORT:
                self._opening_n = max(self.ceiling_n, abs(opening.value))
        self.opening = Opening(
            info.rate_hz,
            command_delay_s,
            opening,
            "gap" in rates,
            info.friction_n,
            info.open_gap_m,
            contact_n,
        )
        self._reports, self.losses = Reports(info.rate_hz, rates.get("pads", 0.0)), Losses(info.rate_hz)

    @property
    def warnings(self) -> tuple[str, ...]:
        """The faults that were seen and do not follow from others, each in a sentence."""
        lost = f"; {self.losses.in_words()}"
        return tuple(self._told[name].told + lost * (name == FRAMES_LOST) for name in causes(self._told))

    @property
    def lost(self) -> str:
        """What was lost, in words, if no warning tells it."""
        return "" if FRAMES_LOST in self._told else self.losses.in_words()

    def cause_of(self, fault: Fault) -> Fault:
        """Return the fault from which this one follows, or this one itself."""
        names = (name for name in causes(self._told) if follows(fault.name, name))
        return self._told.get(next(names, fault.name), fault)

    def limit(self, reading: Reading, phase: int, command: Command) -> Command:
        """Take the reading of a tick and the command for it; return the command that may be applied.

        Only what bounds the command is looked at here, so that the gripper does not wait for `watch`.
        """
        frame = reading.frame
        if not self._declared and frame.force_left_n == frame.force_left_n:
            self._has_pads = True
        if self._has_pads:
            self._see(self._touch.see(frame, phase, command))
        allowed = self._limited(phase, command)
        if allowed.value != command.value or self._gives(command) > asked_effort_n(allowed):
            self.acted += 1
            self.unclear += (
                phase in (SQUEEZE, HOLD) and self._has_pads and self._touch.closing_limit_n() < inf
            )
        return allowed

    def watch(self, reading: Reading, phase: int, applied: Command) -> None:
        """Take the reading of a tick and the command that was applied to it, once the gripper has the command.

        If the reading shows a fault that ends the grasp, it is `ending`. In the release, only a motor that turns the
        wrong way ends it: the grasp is over, and its outcome stays.
        """
        frame = reading.frame
        reported = self._reports.see(reading, phase)
        self._see(reported, phase)
        if phase >= APPROACH:
            self._see(self.losses.see(reading, phase, jumped=reported is not None), phase)
        for fault in self._status.see(frame, phase):
            self._see(fault, phase)
        jump = self._jump.see(frame)
        if jump is not None:
            self._motor.shift(nan if self._jump.is_motion else self._jump.step_m)
        self._see(self._motor.see(frame, phase), phase)
        last_phase, self._phase = self._phase, phase
        if phase != APPROACH and last_phase == APPROACH:
            self.side_impact = self._drift.side_impact(reading)
        self._see(jump)
        closing = phase in CLOSING
        if closing:
            self._see(self._gap_speed.see(frame))
            self._see(self._gap_absence.see(frame.gap_m if frame.gap_m > -CLOSED_M else nan, frame))
            self._see(self._effort_absence.see(frame.effort_n, frame))
        self._see_free_motion(frame, phase, applied, jumped=jump is not None)
        if self._effort is not None:
            self._see(self._effort.see(frame, phase), phase)
            self._effort.apply(frame, applied)
        self._see(self.opening.see(frame, phase), phase)
        if self._has_pads:
            self._see_pads(reading, phase)
        if closing:
            self._felt.apply(applied)
        self._motor.apply(frame, applied)
        self._jump.apply(frame, applied)
        self._kept_speed.apply(frame, applied, jumped=jump is not None)

    def before_closing(self, frame: Frame) -> Fault | None:
        """Return the fault for which the fingers must not close, if there is one."""
        width = self.opening.before_closing(frame)
        self._see(width)
        faults = self._status.before_closing(frame)
        if width is not None and width.ends:
            faults.append(width)
        if self._has_pads:
            faults += [fault for fault in self._fingertips.faults() if fault.ends]
        for fault in faults:
            self._see(fault)
        return faults[0] if faults else None

    def released(self, frame: Frame) -> None:
        """Take the last frame of the release."""
        self._see(self.opening.released(frame), RELEASE)
        for fault in self._curves.released(frame.t_s):
            self._see(fault, RELEASE)
        if self._effort is not None:
            self._see(self._effort.released(frame), RELEASE)

    def opens_with(self, command: Command) -> Command:
        """Return the command that opens the fingers at last, with no more effort than in a release."""
        return limited(command, self.ceiling_n, self._opening_n)

    def opens_wrongly(self, reading: Reading, command: Command) -> bool:
        """Take a reading, and the command that opens the fingers at last; return whether the motor closes them."""
        fault = self._motor.see(reading.frame, RELEASE)
        self._see(fault, RELEASE)
        self._see(self.opening.see(reading.frame, RELEASE), RELEASE)
        self._motor.apply(reading.frame, command)
        return fault is not None and fault.relaxes

    def _see_free_motion(self, frame: Frame, phase: int, applied: Command, *, jumped: bool) -> None:
        """Take the frame of a tick in which the fingers may move freely, and the command that was applied to it."""
        if phase == APPROACH:
            if self._touch.free():
                self._see(self._repeats.see(frame, jumped=jumped))
                self._see(self._kept_speed.see(frame, phase))
                self._see(self._free_effort.see(frame, applied))
            self._see(self._standstill.see(frame, applied))
        elif phase == RELEASE:
            self._see(self._kept_speed.see(frame, phase), phase)

    def _see_pads(self, reading: Reading, phase: int) -> None:
        frame = reading.frame
        closing = phase in CLOSING
        if closing:
            for absence, force_n in zip(
                self._pad_absences, (frame.force_left_n, frame.force_right_n), strict=True
            ):
                self._see(absence.see(force_n, frame))
            self._see(self._felt.see(frame))
        for fault in self._curves.see(reading, phase):
            self._see(fault, phase)
        free = self._touch.free()
        for fault in self._fingertips.see(reading.pads, free):
            # Fingers that are open hurt nothing; before they close, `before_closing` refuses.
            if closing or not fault.ends:
                self._see(fault)
        if phase == APPROACH and free:
            for fault in self._drift.see(reading):
                self._see(fault)

    def _see(self, fault: Fault | None, phase: int = APPROACH) -> None:
        if fault is None:
            return
        if fault.name == REVERSED:
            # If it does close, the command that opens presses no harder than a squeeze may.
            self._opening_n = self.ceiling_n
        if phase == RELEASE and fault.ends and not fault.relaxes:
            fault = evolve(fault, ends=False)
        told = self._told.get(fault.name)
        if told is None or (fault.ends and not told.ends):
            self._told[fault.name] = fault
            if fault.ends or not any(follows(fault.name, other) for other in self._told):
                self._tell(fault)
        if fault.ends and self.ending is None:
            self.ending = fault

    def _gives(self, command: Command) -> float:
        """Return the effort (N) that the controller gives; minus infinity if it leaves it to the gripper."""
        effort_n = asked_effort_n(command)
        left = command.kind not in (EFFORT, FORCE) and effort_n >= self._effort_limit_n
        return -inf if left else effort_n

    def _limited(self, phase: int, command: Command) -> Command:
        if self.ending is not None:
            return self._relaxed
        closing_n = self._approach_n if phase == APPROACH else self.ceiling_n
        if phase in (SQUEEZE, HOLD) and self._gives(command) > closing_n:
            self._see(
                Fault(
                    LIMITED,
                    f"the controller asks for more than {closing_n:.1f} N; run.effort_ceiling_n allows more",
                )
            )
        if self._has_pads and phase in CLOSING:
            closing_n = min(closing_n, self._touch.closing_limit_n())
        return limited(command, closing_n, self._opening_n)
