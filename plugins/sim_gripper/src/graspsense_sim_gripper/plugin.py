"""What this distribution brings to graspsense. Light: the simulator is imported when a grasp is simulated."""

from __future__ import annotations

from collections.abc import Iterable

from graspsense.plugin_api import SensorBackendEntry, hookimpl
from graspsense.simulator_api import ConformanceCheckEntry, ModelEntry

GRASPSENSE_API = (2, 0)


@hookimpl
def graspsense_sensor_backends() -> Iterable[SensorBackendEntry]:
    """Return the simulated gripper."""
    yield SensorBackendEntry(
        name="sim",
        target="graspsense_sim_gripper.run.backend:SimBackend",
        # Declared here, so that printing the settings does not import the simulator.
        config="graspsense_sim_gripper.config:SimConfig",
        accepts=("effort",),
        summary="A simulated PR2 gripper with fingertip arrays, squeezing an object from a catalogue",
    )


@hookimpl
def graspsense_models() -> Iterable[ModelEntry]:
    """Return the models that tell the paper's containers and their states apart."""
    yield ModelEntry(
        name="default",
        resource="graspsense_sim_gripper:models/default.json",
        summary="C4.5 on simulated grasps of the paper's containers, at 20 N and 10 mm/s",
    )
    yield ModelEntry(
        name="best",
        resource="graspsense_sim_gripper:models/best.json",
        summary="A neural network on the force curve of simulated grasps of the same containers, at 20 N and 10 mm/s",
    )


@hookimpl
def graspsense_conformance_checks() -> Iterable[ConformanceCheckEntry]:
    """Return the check of terms that other distributions contribute through `graspsense_sim_terms`."""
    yield ConformanceCheckEntry(
        name="simulator-terms-are-laws",
        target="graspsense_sim_gripper.run.conformance:check_terms",
        hook="graspsense_sim_terms",
        summary="A term of the simulator has a pure law with finite forces, which creates no energy",
    )
