"""The table of how far each feature moves if a parameter of a simulated grasp changes by one part in a million."""

from __future__ import annotations

from typing import TYPE_CHECKING

from graspsense.cli.terminal import Style, echo, echo_entry, echo_table
from graspsense.core.values.errors import counted

if TYPE_CHECKING:
    from collections.abc import Sequence

    from graspsense.experiments.condition import Conditions, FeatureCondition

HEADER = ("FEATURE", "MEDIAN MOVEMENT", "99 % OF GRASPS", "ABOVE 1 %", "MOST BY")


def condition_rows(conditions: Conditions) -> list[tuple[str, ...]]:
    """Return one row for each feature."""
    return [
        (
            feature.feature,
            _share(feature.median),
            _share(feature.finest),
            f"{100 * feature.beyond:.0f} % of grasps",
            _most_by(feature),
        )
        for feature in conditions.features
    ]


def print_conditions(conditions: Conditions, accuracy: float | None = None) -> None:
    """Print the condition of the features of some grasps; warn about those that cannot have the accuracy."""
    echo()
    grasps = "this grasp" if conditions.grasps == 1 else f"{conditions.grasps} grasps"
    echo_entry(
        "condition",
        f"relative movement for 1 ppm of each of {conditions.parameters} parameters, in {grasps}"
        + (f" (sensor {conditions.sensor})" if conditions.sensor else ""),
    )
    if conditions.grasps == 1:
        rows = [
            (feature.feature, _share(feature.finest), _most_by(feature)) for feature in conditions.features
        ]
        echo_table(("FEATURE", "MOVEMENT", "MOST BY"), rows)
    else:
        echo_table(HEADER, condition_rows(conditions))
    if accuracy is None:
        return
    finer = conditions.finer_than_possible(accuracy)
    if finer:
        names = ", ".join(condition.feature for condition in finer)
        echo_entry(
            "warning",
            f"gripper.accuracy = {accuracy:g} is finer than {names} can be: 1 ppm of a parameter moves "
            f"{'it' if len(finer) == 1 else 'them'} further. Single grasps cannot agree to better than that, whatever "
            "the model; the distribution over many grasps can. gripper.sensor=ideal removes what is due to the sensors",
            Style.CAUTION,
        )


def conditions_markdown(measured: Sequence[Conditions]) -> str:
    """Return a table for each sensor, as a page."""
    from graspsense.experiments.versions import where_measured

    lines = ["# Condition of the features", "", "Written by `graspsense tradeoff condition`. Simulated.", ""]
    for conditions in measured:
        lines += [
            f"Sensor {conditions.sensor}: {counted(conditions.grasps, 'grasp')} of {', '.join(conditions.scenes)}, "
            f"{counted(conditions.parameters, 'parameter')}, each "
            "larger by 1 ppm. Movements are relative to the value of the feature, or to 1 mm, 1 N, 50 ms, 1 mm/s or "
            "1 N/s if that is larger.",
            "",
            f"| {' | '.join(HEADER)} |",
            f"|{'---|' * len(HEADER)}",
            *(f"| {' | '.join(row)} |" for row in condition_rows(conditions)),
            "",
        ]
    return "\n".join([*lines, f"Measured with: {where_measured()}.", ""])


def _most_by(condition: FeatureCondition) -> str:
    """Return the parameter that moves a feature most; "none" if nothing moves it."""
    return condition.parameter if condition.finest > 0.0 else "none"


def _share(movement: float) -> str:
    return "missing" if movement == float("inf") else f"{movement:.1e}"
