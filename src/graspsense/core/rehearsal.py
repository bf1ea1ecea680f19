"""A dry run: the grasp on a stand-in in software, to see what would be commanded. No gripper is opened."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

from graspsense.core.roles import Controller, DeviceInfo, Reading, SensorBackend
from graspsense.core.run_config import RunConfig
from graspsense.core.runner import run_grasp
from graspsense.core.signals import EFFORT, Command, Pads, Phase
from graspsense.core.trial import GraspEvent


class PhaseCommands(NamedTuple):
    """What was commanded in one phase: extremes of the effort in N, positive squeezes, and the speed that came of it.

    `limited` is on how many ticks the command stood at the limit of a first use, or at the gripper's own.
    """

    phase: str
    seconds: float
    least_n: float
    most_n: float
    fastest_m_s: float
    limited: int


class Rehearsal(NamedTuple):
    """The phases of a grasp on a stand-in, and how it ended there."""

    device: str
    outcome: str
    phases: tuple[PhaseCommands, ...]


def rehearse(backend: SensorBackend[Any], controller: Controller[Any], run: RunConfig) -> Rehearsal | None:
    """Return what this gripper would be commanded, or None where it has no stand-in.

    Raises what opening the stand-in raises.
    """
    stand_in = backend.stand_in()
    if stand_in is None:
        return None
    witness = _Witness(stand_in, run)
    grasp = run_grasp(witness, controller, run, on_event=witness.begin)
    return Rehearsal(grasp.device.name, grasp.outcome.words, tuple(witness.phases()))


class _Witness(SensorBackend[None]):
    """A gripper, with a record of what it was commanded in each phase."""

    def __init__(self, gripper: SensorBackend[Any], run: RunConfig) -> None:
        super().__init__(None)
        self._gripper, self._run = gripper, run
        self._seen: dict[str, list[tuple[float, float, bool]]] = {}
        self._now: list[tuple[float, float, bool]] = []
        self._next = self._now
        self._speed_m_s = 0.0
        self._rate_hz = 1.0
        self._limits_n: list[float] = []

    def begin(self, event: GraspEvent) -> None:
        """Take the runner's word that a phase has begun.

        A law commands for its new phase at once; the runner's own phases begin with the next command.
        """
        self._next = self._seen.setdefault(event.phase.name.lower(), [])
        if event.phase in (Phase.OPENING, Phase.SQUEEZE, Phase.HOLD):
            self._now = self._next

    def phases(self) -> list[PhaseCommands]:
        """Return the phases in their order."""
        found = []
        for phase, ticks in self._seen.items():
            efforts = [effort for effort, _, _ in ticks] or [0.0]
            found.append(
                PhaseCommands(
                    phase,
                    len(ticks) / self._rate_hz,
                    min(efforts),
                    max(efforts),
                    max((speed for _, speed, _ in ticks), default=0.0),
                    sum(limited for _, _, limited in ticks),
                )
            )
        return found

    def expect(self, controller: Controller[Any], run: RunConfig) -> None:
        """Tell the gripper."""
        self._gripper.expect(controller, run)

    def open(self, seed: int) -> DeviceInfo:
        """Open the gripper and keep its limits."""
        info = self._gripper.open(seed)
        self._rate_hz = info.rate_hz
        self._limits_n = [info.effort_limit_n]
        if info.clock == "device":
            self._limits_n.append(self._run.first_effort_n)
        return info

    def read(self, timeout_s: float) -> Reading | None:
        """Read the gripper and keep its speed."""
        reading = self._gripper.read(timeout_s)
        if reading is not None:
            self._speed_m_s = abs(reading.frame.velocity_m_s)
        return reading

    def apply(self, command: Command) -> None:
        """Keep the command and pass it on."""
        if command.kind == EFFORT:
            at_limit = abs(command.value) in self._limits_n
            self._now.append((command.value, self._speed_m_s, at_limit))
        self._now = self._next
        self._gripper.apply(command)

    def tare(self, images: Sequence[Pads]) -> None:
        """Tare the gripper."""
        self._gripper.tare(images)

    def close(self) -> None:
        """Close the gripper."""
        self._gripper.close()
