"""The firmware of the board in software: it takes commands, sends a report every millisecond, and has a watchdog.

It drives a backend with a virtual clock, the body. Transports carry its reports. One call of `step` is one period of
the clock of the device.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, Final

from graspsense.gripper_api import gap_and_rate, revolutions_at
from graspsense.plugin_api import EFFORT, Command, Frame, Pads, Samples, SensorBackend
from graspsense_pr2_gripper.accelerometer import PalmAtRest, has_accelerometer, word_of
from graspsense_pr2_gripper.fingertip import CELLS
from graspsense_pr2_gripper.linkage import LINKAGES
from graspsense_pr2_gripper.protocol import (
    ACCEPTED,
    CLAMPED,
    EFFORT_KIND,
    ENCODER_FAULT,
    IMAGE_CELLS,
    LAST_IMAGE,
    LEFT_ABSENT,
    LET_GO,
    LIMITED,
    NO_COMMAND,
    OWN_LIMIT,
    REFUSED,
    RIGHT_ABSENT,
    SAMPLES_MISSED,
    SLICE_CELLS,
    SLICES,
    Identity,
    InputReport,
    ProtocolError,
    decode_output,
    encode_identity,
    encode_input,
)

_LARGEST: Final = 2**31 - 1
STRONG_N: Final = 30.0
"""Effort of the strongest of the three squeezes of the paper's recordings (20, 25 and 30 N)."""


class Firmware:
    """A board with this identity that drives `body`, which has been opened.

    It sends the samples of the channel `acceleration` of the body. Where the body has no such channel, they are those
    of a palm at rest, with the noise of this seed. A board without an accelerometer sends none.
    """

    def __init__(self, body: SensorBackend[Any], identity: Identity, seed: int = 0) -> None:
        self.identity = identity
        self.effort_un = 0
        """The effort of the motor before the limit of speed; 0 when relaxed."""
        self.motor_gain = 1.0
        """Applied effort over the effort before the limit of speed; other than 1 where the motor is faulty."""
        self.largest_effort_n = 0.0
        """Largest effort with which the body was squeezed."""
        self.strong_s = 0.0
        """Time for which the body was squeezed with more than `STRONG_N`."""
        self._body = body
        self._link = LINKAGES[identity.transmission]
        self._period_us = round(1e6 / identity.report_rate_hz)
        self._watchdog_us = identity.watchdog_ms * 1000
        self._step = 0
        self._commanded_us = 0
        self._speed_limit_um_s = identity.speed_limit_um_s
        self._status = 0
        self._echo = 0
        self._result = NO_COMMAND
        self._velocity_um_s = 0.0
        self._ticks = 0
        _, self._rate_m_rev = gap_and_rate(self._link, 0.0)
        self._velocity_mtick_s = 0
        self._body_image = 0
        self._image = 0
        self._image_us = 0
        self._slice = 0
        self._gone_out = True
        self._cells = [0] * IMAGE_CELLS
        self._range_g = identity.accelerometer_g
        self._body_has_accelerometer = has_accelerometer(body.channels)
        self._palm = PalmAtRest(seed)
        self._counter = 0
        """Number of samples that the accelerometer of the body had taken at the last report."""

    def run_on(self) -> float:
        """Advance the time without a host until the motor is relaxed; return the time (s) that this took.

        The watchdog limits this time. Raises RuntimeError if it does not act.
        """
        began = self.time_us
        while self.effort_un:
            if self.time_us - began > 2 * self._watchdog_us:
                raise RuntimeError("the emulated firmware's watchdog did not let go")
            self.step()
        return (self.time_us - began) / 1e6

    @property
    def time_us(self) -> int:
        """The device's time at its last report."""
        return max(self._step - 1, 0) * self._period_us

    def feature(self) -> bytes:
        """Return the feature report."""
        return encode_identity(self.identity)

    def output(self, data: bytes) -> None:
        """Receive a command; a damaged one changes only the result field."""
        try:
            command = decode_output(data)
        except ProtocolError:
            self._result = REFUSED
            return
        own = self.identity
        most = min(command.effort_limit_un, own.effort_limit_un)
        effort = command.effort_un if command.kind == EFFORT_KIND else 0
        self.effort_un = max(-most, min(effort, most))
        self._speed_limit_um_s = min(command.speed_limit_um_s, own.speed_limit_um_s)
        if command.speed_limit_um_s == OWN_LIMIT:
            self._speed_limit_um_s = own.speed_limit_um_s
        self._result = ACCEPTED if self.effort_un == effort else CLAMPED
        self._status &= ~(LET_GO | LIMITED)
        if self._result == CLAMPED:
            self._status |= LIMITED
        self._echo = command.counter
        self._commanded_us = self.time_us

    def step(self) -> bytes:
        """Advance by one period and return the report at its end."""
        now_us = self._step * self._period_us
        if self._result != NO_COMMAND and now_us - self._commanded_us >= self._watchdog_us:
            self.effort_un = 0
            self._status |= LET_GO
        if self._step > 0:
            self._body.apply(Command(EFFORT, self._within_speed(), math.inf, math.inf))
        reading = self._body.read(1.0)
        if reading is None:
            raise RuntimeError("the body of an emulated gripper gave no frame: it needs a virtual clock")
        frame, pads, signals = reading
        self._step += 1
        if frame.effort_n > STRONG_N:
            self.strong_s += self._period_us / 1e6
        if frame.effort_n > self.largest_effort_n:
            self.largest_effort_n = frame.effort_n
        self._measure(frame)
        self._latch(pads, now_us)
        words = self._sampled(signals) if self._range_g > 0 else ()
        report = InputReport(
            sequence=(self._step - 1) & 0xFFFFFFFF,
            time_us=now_us,
            encoder_ticks=self._ticks,
            velocity_mtick_s=self._velocity_mtick_s,
            effort_un=0 if math.isnan(frame.effort_n) else _clamped(frame.effort_n * 1e6),
            status=self._status,
            echo=self._echo,
            samples=words,
            image=self._image,
            slice=self._slice,
            cells=tuple(self._cells[self._slice * SLICE_CELLS :][:SLICE_CELLS]),  # type: ignore[arg-type]
            command_result=self._result,
            image_age_us=min(now_us - self._image_us, 0xFFFF),
        )
        if self._image:
            self._slice = (self._slice + 1) % SLICES
            self._gone_out = self._gone_out or self._slice == 0
        return encode_input(report)

    def _within_speed(self) -> float:
        effort = self.effort_un
        closing_um_s = -self._velocity_um_s
        if (effort > 0 and closing_um_s > self._speed_limit_um_s) or (
            effort < 0 and -closing_um_s > self._speed_limit_um_s
        ):
            return 0.0
        return effort / 1e6 * self.motor_gain

    def _measure(self, frame: Frame) -> None:
        if not (math.isfinite(frame.gap_m) and math.isfinite(frame.velocity_m_s)):
            self._status |= ENCODER_FAULT
            return
        self._status &= ~ENCODER_FAULT
        ticks_rev = self.identity.encoder_ticks_rev
        ticks = round(revolutions_at(self._link, frame.gap_m) * ticks_rev)
        if ticks != self._ticks:
            self._ticks = ticks
            _, self._rate_m_rev = gap_and_rate(self._link, ticks / ticks_rev)
        self._velocity_mtick_s = _clamped(frame.velocity_m_s / self._rate_m_rev * ticks_rev * 1e3)
        self._velocity_um_s = frame.velocity_m_s * 1e6

    def _sampled(self, signals: Any) -> tuple[int, ...]:
        """Return the words of the new samples, and set the status bit if some were missed."""
        self._status &= ~SAMPLES_MISSED
        if not self._body_has_accelerometer:
            return tuple(word_of(sample, self._range_g) for sample in self._palm.samples())
        samples: Samples = signals.acceleration
        if samples.counter - self._counter > samples.new:
            self._status |= SAMPLES_MISSED
        self._counter = samples.counter
        return tuple(word_of(sample, self._range_g) for sample in samples.values[: samples.new])

    def _latch(self, pads: Pads, now_us: int) -> None:
        if pads.counter in (0, self._body_image) or not self._gone_out:
            return
        self._body_image = pads.counter
        self._image = self._image % LAST_IMAGE + 1
        self._image_us = now_us
        self._slice, self._gone_out = 0, False
        for start, cells, absent in ((0, pads.left, LEFT_ABSENT), (CELLS, pads.right, RIGHT_ABSENT)):
            raw = _raw(cells)
            self._cells[start : start + CELLS] = raw
            self._status = self._status & ~absent | (0 if any(raw) else absent)


def _raw(cells: Sequence[float]) -> list[int]:
    """Return cells as the board reads them: 16 bits, and 0 for a dead cell."""
    return [0 if cell != cell else min(max(round(cell), 0), 0xFFFF) for cell in cells]


def _clamped(value: float) -> int:
    return round(min(max(value, -_LARGEST), _LARGEST))
