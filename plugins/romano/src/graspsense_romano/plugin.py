"""What this distribution brings to graspsense: control laws by touch, features of a shake, and experiments."""

from __future__ import annotations

from collections.abc import Iterable

from graspsense.experiment_api import ExperimentEntry, ExperimentKindEntry
from graspsense.plugin_api import ControllerEntry, FeatureSetEntry, PipelineEntry, hookimpl

GRASPSENSE_API = (2, 0)


@hookimpl
def graspsense_controllers() -> Iterable[ControllerEntry]:
    """Return the control laws of Romano et al. (IEEE T-RO 27(6), 2011)."""
    for name, target, summary in (
        ("find-contact", "FindContact", "closes until both pads touch"),
        ("force-servo", "ForceServo", "brings the weaker finger to a force"),
        ("slip-servo", "SlipServo", "holds lightly, with more force whenever the thing slips"),
        ("grab", "Grab", "chooses the force from the contact, and adds to it whenever the thing slips"),
        ("release", "Release", "holds until the thing is put down, then opens"),
        ("pick-and-place", "PickAndPlace", "grabs, holds what an arm lifts, and opens when it is put down"),
        ("event-detector", "EventDetector", "tells contact, slip and placing, and commands nothing"),
    ):
        yield ControllerEntry(name=name, target=f"graspsense_romano.controllers:{target}", summary=summary)


@hookimpl
def graspsense_feature_sets() -> Iterable[FeatureSetEntry]:
    """Return the features of a shake."""
    yield FeatureSetEntry(
        name="shake",
        target="graspsense_romano.shake:ShakeFeatures",
        summary="Bands, peaks and decays of acceleration and pads while a held thing is shaken, and after that",
    )


@hookimpl
def graspsense_pipelines() -> Iterable[PipelineEntry]:
    """Return the pipelines of a simulated gripper with soft pads."""
    for name, summary in (
        ("hold", "holds a simulated block with the least force that does not slip"),
        ("place", "picks a simulated block up and puts it down, by touch"),
        ("shake", "holds a simulated bottle and shakes it, to feel what is in it"),
    ):
        yield PipelineEntry(name=name, resource=f"graspsense_romano:pipelines/{name}.toml", summary=summary)


@hookimpl
def graspsense_experiment_kinds() -> Iterable[ExperimentKindEntry]:
    """Return the kind of the experiments in MuJoCo."""
    yield ExperimentKindEntry(
        name="touch",
        run="graspsense_romano.touch:touch",
        keys="graspsense_romano.touch:TouchSettings",
        result="graspsense_romano.touch:TouchRow",
        findings="graspsense_romano.findings:findings",
        seconds_per_trial=5.0,
        summary="grasps a thing of a MuJoCo scene, lifts it, tugs at it or fills it, puts it down",
    )


@hookimpl
def graspsense_experiments() -> Iterable[ExperimentEntry]:
    """Return the experiments on grab, slip, placing, bumps, range, and what is in a thing."""
    names = "romano_grab", "romano_slip", "romano_place", "romano_side", "romano_range", "contents_shake"
    for name in names:
        yield ExperimentEntry(name, f"graspsense_romano:experiments/{name}.toml", seconds_per_trial=5.0)
