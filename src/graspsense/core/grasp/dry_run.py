"""A dry run: a grasp with an emulated gripper, which shows what would be commanded. No real gripper is opened."""

from __future__ import annotations

from typing import Any, NamedTuple

from graspsense.core.components.entries import KINDS
from graspsense.core.components.roles import Controller, SensorBackend
from graspsense.core.components.run_config import RunConfig
from graspsense.core.grasp.runner import run_uninterrupted
from graspsense.core.grasp.wrapped_gripper import WrappedGripper
from graspsense.core.values.device import DeviceInfo
from graspsense.core.values.signals import EFFORT, FORCE, VELOCITY, Command, GraspEvent, Phase, Reading


class PhaseCommands(NamedTuple):
    """The commands of one phase: the extremes of the effort (N, positive squeezes), and the largest speed (m/s).

    The effort is that of an effort or force command; of a velocity or position command, it is the limit that the
    command sets. The speed is the measured one, and that of a velocity command. `kinds` are the kinds of command.
    `limited` is the number of ticks in which the command was at the limit of a first use, or at that of the gripper.
    """

    phase: str
    kinds: tuple[str, ...]
    seconds: float
    least_n: float
    most_n: float
    fastest_m_s: float
    limited: int


class DryRun(NamedTuple):
    """The emulated gripper of a dry run, the outcome of the grasp, and its phases."""

    device: str
    outcome: str
    phases: tuple[PhaseCommands, ...]


def dry_run(backend: SensorBackend[Any], controller: Controller[Any], run: RunConfig) -> DryRun | None:
    """Return what this gripper would be commanded, or None if nothing emulates it.

    Raises what opening the emulated gripper raises.
    """
    emulated = backend.dry_run_backend()
    if emulated is None:
        return None
    recorder = _CommandRecorder(emulated, run)
    grasp = run_uninterrupted(recorder, controller, run, on_event=recorder.begin)
    return DryRun(grasp.device.name, grasp.outcome.words, tuple(recorder.phases()))


class _Tick(NamedTuple):
    """A command: its kind, its effort and speed as in `PhaseCommands`, and whether a limit was reached."""

    kind: int
    effort_n: float
    speed_m_s: float
    limited: bool


class _CommandRecorder(WrappedGripper):
    """A gripper that records what it is commanded in each phase."""

    def __init__(self, gripper: SensorBackend[Any], run: RunConfig) -> None:
        super().__init__(gripper)
        self._run = run
        self._seen: dict[str, list[_Tick]] = {}
        self._now: list[_Tick] = []
        self._next = self._now
        self._speed_m_s = 0.0
        self._rate_hz = 1.0
        self._limits_n: list[float] = []
        self._limits_m_s: list[float] = []

    def begin(self, event: GraspEvent) -> None:
        """Note that a phase has begun.

        A command of a controller belongs to the new phase at once; a phase of the runner begins one command later.
        """
        self._next = self._seen.setdefault(event.phase.name.lower(), [])
        if event.phase in (Phase.OPENING, Phase.SQUEEZE, Phase.HOLD):
            self._now = self._next

    def phases(self) -> list[PhaseCommands]:
        """Return the phases in order."""
        phases = []
        for phase, ticks in self._seen.items():
            efforts = [tick.effort_n for tick in ticks] or [0.0]
            phases.append(
                PhaseCommands(
                    phase=phase,
                    kinds=tuple(dict.fromkeys(KINDS[tick.kind] for tick in ticks)),
                    seconds=len(ticks) / self._rate_hz,
                    least_n=min(efforts),
                    most_n=max(efforts),
                    fastest_m_s=max((tick.speed_m_s for tick in ticks), default=0.0),
                    limited=sum(tick.limited for tick in ticks),
                )
            )
        return phases

    def open(self, seed: int) -> DeviceInfo:
        """Open the gripper and note its limits."""
        info = super().open(seed)
        self._rate_hz = info.rate_hz
        self._limits_n, self._limits_m_s = [info.effort_limit_n], [info.speed_limit_m_s]
        if info.clock == "device":
            self._limits_n.append(self._run.first_effort_n)
            self._limits_m_s.append(self._run.first_speed_m_s)
        return info

    def read(self, timeout_s: float) -> Reading | None:
        """Read the gripper and note its speed."""
        reading = super().read(timeout_s)
        if reading is not None:
            self._speed_m_s = abs(reading.frame.velocity_m_s)
        return reading

    def apply(self, command: Command) -> None:
        """Note the command and pass it on."""
        self._now.append(self._described(command))
        self._now = self._next
        super().apply(command)

    def _described(self, command: Command) -> _Tick:
        """Return what `PhaseCommands` says of a command; the guard has limited it."""
        kind, value, effort_n, speed_m_s = command
        # An opening may have no limits of its own.
        effort_n, speed_m_s = min(effort_n, self._limits_n[0]), min(speed_m_s, self._limits_m_s[0])
        if kind in (EFFORT, FORCE):
            return _Tick(kind, value, self._speed_m_s, abs(value) in self._limits_n)
        if kind == VELOCITY:
            return _Tick(kind, effort_n, max(abs(value), self._speed_m_s), abs(value) in self._limits_m_s)
        return _Tick(kind, effort_n, self._speed_m_s, speed_m_s in self._limits_m_s)
