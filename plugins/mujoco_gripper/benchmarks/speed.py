"""How many grasps a second MuJoCo simulates, on one and on two cores, and what graspsense adds to MuJoCo's steps.

    python plugins/mujoco_gripper/benchmarks/speed.py [--short]

A row is a thing between the fingers of the parallel gripper, grasped under the default controller with the servo. The
real-time factor is the time of the grasps divided by the time that they take. The overhead compares a grasp with a loop
that only sets the same controls and calls `mj_step` as often.
"""

from __future__ import annotations

import argparse
import time
from typing import Any

import mujoco
import numpy as np

from graspsense.plugin_api import create
from graspsense.simulator_api import RunConfig, run_uninterrupted
from graspsense_mujoco_gripper.backend import MujocoGripper
from graspsense_mujoco_gripper.config import MujocoConfig

THINGS = {"rigid": "block", "springs": "can", "soft body": "sponge"}
CONTROLLER = create("controller", "hybrid", sends="velocity", closing_speed_m_s=0.05, probing_force_n=5.0)


class Noted(MujocoGripper):
    """Notes the controls of each step."""

    def open(self, seed: int) -> Any:
        info = super().open(seed)
        self.model, self.begun = self._model, mujoco.MjData(self._model)
        self.begun.qpos[:] = self._opened().qpos
        set_controls, self.controls = self._drive.set_controls, []

        def noted(data: mujoco.MjData, *further: Any) -> None:
            set_controls(data, *further)
            self.controls.append(data.ctrl.copy())

        self._drive.set_controls = noted
        return info


def overhead(thing: str) -> tuple[float, float, float]:
    """Return the times of a grasp and of the bare loop (s), and the time that both simulate."""
    run = RunConfig()
    gripper = MujocoGripper(MujocoConfig(object=thing))
    spent = []
    for _ in range(2):
        began = time.process_time()
        grasp = run_uninterrupted(gripper, CONTROLLER, run)
        spent.append(time.process_time() - began)
    noted = Noted(MujocoConfig(object=thing))
    run_uninterrupted(noted, CONTROLLER, run)
    began = time.process_time()
    for controls in noted.controls:
        noted.begun.ctrl[:] = controls
        mujoco.mj_step(noted.model, noted.begun)
    bare = time.process_time() - began
    return min(spent), bare, float(np.sum(grasp.seconds_simulated or 0.0))


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--short", action="store_true", help="one thing, few grasps")
    short = parser.parse_args().short
    count = 8 if short else 24
    print("| thing | workers | grasps a second | real-time factor | overhead |\n|---|---|---|---|---|")
    for kind, thing in list(THINGS.items())[: 1 if short else None]:
        with_all, bare, simulated_s = overhead(thing)
        for workers in (1, 2):
            began = time.perf_counter()
            gripper = MujocoGripper(MujocoConfig())
            gripper.run_many(CONTROLLER, [thing] * count, range(count), workers=workers)
            spent = time.perf_counter() - began
            more = f"{with_all / bare - 1.0:.0%}" if workers == 1 else ""
            print(
                f"| {kind} ({thing}) | {workers} | {count / spent:.2f} | {count * simulated_s / spent:.1f} | {more} |",
                flush=True,
            )


if __name__ == "__main__":
    main()
