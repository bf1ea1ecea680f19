"""What this distribution brings to graspsense. Light: MuJoCo is imported when a grasp is simulated."""

from __future__ import annotations

from collections.abc import Iterable

from graspsense.plugin_api import SensorBackendEntry, hookimpl

GRASPSENSE_API = (2, 0)


@hookimpl
def graspsense_sensor_backends() -> Iterable[SensorBackendEntry]:
    """Return the gripper that a MuJoCo model describes."""
    yield SensorBackendEntry(
        name="mujoco",
        target="graspsense_mujoco_gripper.backend:MujocoGripper",
        config="graspsense_mujoco_gripper.config:MujocoConfig",
        summary="Any gripper that has a MuJoCo model, grasping a thing of a catalogue",
        needs="pip install mujoco-core; with MUJOCO_GL=osmesa also libosmesa6",
    )
