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
        summary="trains and tests classifiers, and compares the rates with those that the paper prints",
    )
    yield ExperimentKindEntry(
        name="grasp",
        run="graspsense_paper.grasping:grasp",
        keys="graspsense_paper.grasping:GraspSettings",
        result="graspsense_paper.grasp_result:GraspResult",
        findings=_FINDINGS,
        simulates=True,
        summary="grasps only: peak forces, breakage, speed at contact, raw sums of the pads",
    )
    yield ExperimentKindEntry(
        name="paper",
        findings=_FINDINGS,
        summary="several of them as one experiment",
    )


@hookimpl
def graspsense_experiments() -> Iterable[ExperimentEntry]:
    """Return the tables, figures and claims of the paper as experiments."""
    for name in (
        "approach_speed",
        "controllers",
        "eleven_classes",
        "fig_4",
        "fig_5",
        "fig_6",
        "one_finger_first",
        "other_classifiers",
        "paper",
        "stiction",
        "table_2",
        "table_3",
        "table_4",
        "table_5",
        "table_6",
        "why_force",
        "worn_bottles",
    ):
        yield ExperimentEntry(name, f"graspsense_paper:experiments/{name}.toml")
