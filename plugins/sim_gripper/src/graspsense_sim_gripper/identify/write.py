"""Writing the scene: the terms with their values, the spreads, and the table `[identified]` with all that was found."""

from __future__ import annotations

import json
import math
from collections.abc import Sequence

from graspsense.plugin_api import CandidateScore, IdentifiedParameter, Undetermined
from graspsense_sim_gripper.identify.fit import Fitted
from graspsense_sim_gripper.identify.laws import SLOTS
from graspsense_sim_gripper.identify.prepare import Squeeze


def number(value: float) -> str:
    """Return a number for TOML, with six digits."""
    text = f"{value:.6g}"
    return text if any(mark in text for mark in ".en") else f"{text}.0"


def scene_text(
    label: str,
    fitted: Fitted,
    parameters: Sequence[IdentifiedParameter],
    values: dict[str, float],
    gripper: dict[str, float],
    squeezes: Sequence[Squeeze],
    candidates: Sequence[CandidateScore],
    open_: Sequence[Undetermined],
) -> str:
    """Return the text of the scene file. `values` are the keys of the object, `gripper` settings of the fingertips."""
    what = f"{label or 'object'}, identified from {len(squeezes)} squeeze{'s' if len(squeezes) > 1 else ''}"
    lines = ["# Written by `graspsense identify`. Numbers in brackets are 90 % intervals.", f"summary = {json.dumps(what)}"]
    intervals = {one.name: one for one in parameters}
    for key, value in values.items():
        interval = intervals.get(key)
        comment = "" if interval is None else f"  # {_interval(interval)}"
        lines.append(f"{key} = {number(value)}{comment}")
    for slot, given in fitted.candidate.parameters(fitted.values).items():
        lines += ["", "[[terms]]", f'type = "{SLOTS[slot]}"']
        labels = {one.name: one.label for one in fitted.candidate.free if one.slot == slot}
        for name, value in given.items():
            interval = intervals.get(labels.get(name, ""))
            comment = "  # not fitted" if interval is None else f"  # {_interval(interval)}"
            lines.append(f"{name} = {number(value)}{comment}")
    return "\n".join([*lines, "", *_identified(label, parameters, gripper, squeezes, candidates, open_)]) + "\n"


def _interval(parameter: IdentifiedParameter) -> str:
    return f"[{parameter.low:.4g}, {parameter.high:.4g}] {parameter.unit}".rstrip()


def _identified(
    label: str,
    parameters: Sequence[IdentifiedParameter],
    gripper: dict[str, float],
    squeezes: Sequence[Squeeze],
    candidates: Sequence[CandidateScore],
    open_: Sequence[Undetermined],
) -> list[str]:
    rows = [
        "# What the scene was identified from. The simulator reads this table and does not use it.",
        "[identified]",
        f"label = {json.dumps(label)}",
        "",
        "[identified.gripper]",
        *(f"{key} = {number(value)}" for key, value in gripper.items()),
        "",
        "[identified.intervals]",
        *(
            f"{json.dumps(one.name)} = [{number(one.low)}, {number(one.high)}]  # {one.basis}"
            for one in parameters
        ),
        "",
        "[identified.recordings]",
        *(f"{json.dumps(one.name)} = {json.dumps(one.sha256)}" for one in squeezes),
        "",
        "[identified.candidates]",
        *(f"{json.dumps(one.terms)} = {_error(one)}  # {one.verdict}" for one in candidates),
        "",
        "[identified.undetermined]",
        *(f"{json.dumps(one.what)} = {json.dumps(f'{one.reason}. {one.remedy}')}" for one in open_),
    ]
    return rows


def _error(candidate: CandidateScore) -> str:
    return "nan" if math.isnan(candidate.error) else number(candidate.error)
