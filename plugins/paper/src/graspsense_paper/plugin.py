"""What this distribution brings to graspsense: the experiments of the paper, and their kinds."""

from __future__ import annotations

from collections.abc import Iterable

from graspsense.experiment_api import ExperimentEntry, ExperimentKindEntry
from graspsense.plugin_api import hookimpl

GRASPSENSE_API = (2, 0)

_FINDINGS = "graspsense_paper.findings:findings"


@hookimpl
def graspsense_experiment_kinds() -> Iterable[ExperimentKindEntry]:
    """Return the kinds that are reported beside the figures and claims of the paper."""
    yield ExperimentKindEntry(
        name="table",
        run="graspsense.experiment_api:recognise",
        keys="graspsense.experiment_api:EvaluationSettings",
        findings=_FINDINGS,
        seconds_per_trial=0.00322,
        summary="trains and tests classifiers, and compares the rates with those that the paper prints",
    )
    yield ExperimentKindEntry(
        name="grasp",
        run="graspsense_paper.grasping:grasp",
        keys="graspsense_paper.grasping:GraspSettings",
        result="graspsense_paper.grasping:GraspResult",
        findings=_FINDINGS,
        simulates=True,
        seconds_per_trial=0.264,
        summary="grasps only: peak forces, breakage, speed at contact, raw sums of the pads",
    )
    yield ExperimentKindEntry(
        name="paper",
        findings=_FINDINGS,
        summary="several of them as one experiment",
    )


@hookimpl
def graspsense_experiments() -> Iterable[ExperimentEntry]:
    """Return the tables, figures and claims of the paper as experiments, with processor seconds per trial."""
    for name, seconds in (
        ("approach_speed", 0.00447),
        ("controllers", 0.613),
        ("eleven_classes", 0.0024),
        ("fig_4", 0.322),
        ("fig_5", 0.222),
        ("fig_6", 0.104),
        ("one_finger_first", 0.0895),
        ("other_classifiers", 0.0183),
        ("paper", None),
        ("stiction", 0.306),
        ("table_2", 0.00221),
        ("table_3", 0.004),
        ("table_4", 0.00483),
        ("table_5", 0.00314),
        ("table_6", 0.00298),
        ("why_force", 0.00646),
        ("worn_bottles", 0.00322),
    ):
        resource = f"graspsense_paper:experiments/{name}.toml"
        yield ExperimentEntry(name, resource, seconds_per_trial=seconds)
