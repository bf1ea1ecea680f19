"""How many grasps a second MuJoCo simulates, on one and on two cores, and what graspsense adds to MuJoCo's steps.

    python plugins/mujoco_gripper/benchmarks/speed.py [--short]

A row is a thing between the fingers of a gripper, grasped under the default controller with the servo. A grasp, with
building its model and its trace, is compared with a bare loop in Python, which sets the same controls and calls
`mj_step` for the same steps: for a grasp alone, which runs in the interpreter, and for one of many, whose ticks are
compiled. `over reading` compares one of many with a bare loop that reads the gap and the forces of the contacts in each
tick. The columns of the cores give grasps a second of `run_many`, with the start of its processes, and in brackets the
real-time factor: the time that is simulated, divided by the time that it takes. The 2F-140 needs robosuite.

Processor times of 2026-11-27, on two cores without other work:

| thing | gripper | one grasp | one of many | over reading | 1 core | 2 cores |
|---|---|---|---|---|---|---|
| rigid (block) | parallel | 193% | 21% | -33% | 32.6 (68.4) | 30.0 (62.8) |
| springs (can) | parallel | 165% | 9% | -50% | 28.5 (44.8) | 27.6 (43.3) |
| rigid (block) | Robotiq 2F-140 | 197% | 3% | -22% | 3.4 (40.6) | 7.4 (87.5) |
| soft body (sponge) | parallel | 22% | 1% | -31% | 1.3 (4.0) | 2.0 (6.1) |

Percentages are uncertain to 5 %. The 64 grasps of block and can take two seconds, in which a second process has hardly
started. The aim is at most 30 % for one of many. A grasp of the block takes 32 ms: 25 ms in 2,100
ticks with two `mj_step` each, 2.5 ms for its model, 1 ms in the ticks of the interpreter at changes of the phase, and
the rest for the trace.
Compiling takes 6.4 s, loading what was compiled before 0.6 s; a grasp saves 0.06 s.
"""

from __future__ import annotations

import argparse
import time
from pathlib import Path
from typing import Any

import mujoco
import numpy as np

from graspsense.plugin_api import ConfigError, create
from graspsense.simulator_api import RunConfig, run_uninterrupted
from graspsense_mujoco_gripper.backend import MujocoGripper
from graspsense_mujoco_gripper.config import MujocoConfig
from graspsense_mujoco_gripper.measurement import geoms_of
from graspsense_mujoco_gripper.prepared import Batch

TWO_FINGERS = str(Path(__file__).parents[3] / "examples" / "mujoco" / "robotiq_140.toml")
CASES = [
    ("rigid", "block", "parallel", "", 64),
    ("springs", "can", "parallel", "", 64),
    ("rigid", "block", "Robotiq 2F-140", TWO_FINGERS, 64),
    ("soft body", "sponge", "parallel", "", 32),
]
"""Kind, thing, gripper, its file, and the grasps of a batch."""
CONTROLLER = create("controller", "hybrid", sends="velocity", closing_speed_m_s=0.05, probing_force_n=5.0)
REPEATS, MANY = 5, 10_000


class Noted(MujocoGripper):
    """Notes the controls, and for how many steps they are kept."""

    def open(self, seed: int) -> Any:
        info = super().open(seed)
        self.model, self.begun = self._model, mujoco.MjData(self._model)
        self.begun.qpos[:] = self._opened().qpos
        self.fingers = [geoms_of(self._model, finger) for finger in (self._gripper.left, self._gripper.right)]
        self.axis, self.ticks = self._travel.axis, []
        set_controls, data = self._drive.set_controls, self._opened()

        def noted(*command: Any) -> None:
            set_controls(*command)
            self.ticks[-1].append((data.ctrl.copy(), round(command[-1] / self.model.opt.timestep)))

        self._drive.set_controls = noted
        return info

    def read(self, timeout_s: float) -> Any:
        self.ticks.append([])
        return super().read(timeout_s)

    def again(self, *, reading: bool) -> float:
        """Return the time (s) of the bare loop."""
        data = mujoco.MjData(self.model)
        data.qpos[:] = self.begun.qpos
        began = time.process_time()
        for tick in self.ticks:
            for controls, steps in tick:
                data.ctrl[:] = controls
                mujoco.mj_step(self.model, data, nstep=steps)
            if reading:
                self.plain_reading(data)
        return time.process_time() - began

    def plain_reading(self, data: mujoco.MjData) -> tuple[float, list[float]]:
        """Return the gap of the bodies of the fingers and the forces on them, as plain code does."""
        left, right = (data.geom_xpos[min(geoms)] for geoms in self.fingers)
        gap_m, forces, wrench = float((right - left) @ self.axis), [0.0, 0.0], np.zeros(6)
        for k in range(data.ncon):
            contact = data.contact[k]
            for finger, geoms in enumerate(self.fingers):
                if contact.geom[0] in geoms or contact.geom[1] in geoms:
                    mujoco.mj_contactForce(self.model, data, k, wrench)
                    force = contact.frame.reshape(3, 3).T @ wrench[:3]
                    forces[finger] += abs(float(force @ self.axis))
        return gap_m, forces


def times(file: str, thing: str) -> list[float]:
    """Return the times (s) of a grasp alone, of one of many, of the steps alone, of the steps with a reading."""
    noted, many = Noted(MujocoConfig(file=file, object=thing)), Batch(MANY, {})
    run_uninterrupted(noted, CONTROLLER, RunConfig())
    spent: list[list[float]] = []
    for _ in range(REPEATS + 1):
        row = []
        for batch in (None, many):
            gripper = MujocoGripper(MujocoConfig(file=file, object=thing))
            if batch is not None:
                gripper.join(batch)
            began = time.process_time()
            run_uninterrupted(gripper, CONTROLLER, RunConfig())
            row.append(time.process_time() - began)
        spent.append([*row, noted.again(reading=False), noted.again(reading=True)])
    # The code is compiled in the first grasp.
    return [min(column) for column in zip(*spent[1:], strict=True)]


def rate(file: str, thing: str, count: int, workers: int) -> str:
    """Return how many grasps a second `run_many` makes, and the real-time factor."""
    began = time.perf_counter()
    gripper = MujocoGripper(MujocoConfig(file=file))
    done = gripper.run_many(CONTROLLER, [thing] * count, range(count), workers=workers)
    spent = time.perf_counter() - began
    config = gripper.config
    steps = sum(float(grasp.report["steps"]) for grasp in done)
    simulated_s = steps / (config.rate_hz * gripper._steps_of_a_tick())
    return f"{count / spent:.1f} ({simulated_s / spent:.1f})"


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--short", action="store_true", help="one thing, few grasps")
    short = parser.parse_args().short
    print("| thing | gripper | one grasp | one of many | over reading | 1 core | 2 cores |")
    print("|---|---|---|---|---|---|---|")
    for kind, thing, name, file, count in CASES[: 1 if short else None]:
        try:
            alone, many, steps, read = times(file, thing)
        except ConfigError as error:
            print(f"| {kind} ({thing}) | {name} | {error} |")
            continue
        over = f"{alone / steps - 1.0:.0%} | {many / steps - 1.0:.0%} | {many / read - 1.0:.0%}"
        rates = [rate(file, thing, 16 if short else count, workers) for workers in (1, 2)]
        print(f"| {kind} ({thing}) | {name} | {over} | {' | '.join(rates)} |", flush=True)


if __name__ == "__main__":
    main()
