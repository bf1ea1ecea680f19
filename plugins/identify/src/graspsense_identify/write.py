"""Writing the scene: the terms with their values, the spreads, and the table `[identified]` with all that was found."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence

from attrs import frozen

from graspsense.simulator_api import CandidateScore, IdentifiedParameter, Undetermined
from graspsense_identify.delay import Delay
from graspsense_identify.fit import Fitted
from graspsense_identify.fracture import FractureFit
from graspsense_identify.laws import SLOTS
from graspsense_identify.prepare import Squeeze


@frozen(kw_only=True, eq=False)
class SceneFacts:
    """What is written to a scene file."""

    label: str
    fitted: Fitted
    parameters: Sequence[IdentifiedParameter]
    values: Mapping[str, float]
    """The keys of the object."""
    gripper: Mapping[str, float]
    """The settings of the fingertips."""
    delay: Delay
    squeezes: Sequence[Squeeze]
    candidates: Sequence[CandidateScore]
    undetermined: Sequence[Undetermined]
    spreads: Mapping[int, float]
    """Spreads of parameters of their own, by the place of the parameter among the free ones."""
    fracture: FractureFit | None = None


def scene_text(facts: SceneFacts) -> str:
    """Return the text of the scene file."""
    n = len(facts.squeezes)
    what = f"{facts.label or 'object'}, identified from {n} squeeze{'s' if n > 1 else ''}"
    lines = [
        "# Written by `graspsense identify`. Numbers in brackets are 90 % intervals.",
        f"summary = {json.dumps(what)}",
    ]
    intervals = {parameter.name: parameter for parameter in facts.parameters}
    for key, value in facts.values.items():
        interval = intervals.get(key)
        lines.append(f"{key} = {_number(value)}" + ("" if interval is None else f"  # {_interval(interval)}"))
    for slot, given in facts.fitted.candidate.parameters(facts.fitted.values).items():
        lines += ["", "[[terms]]", f'type = "{SLOTS[slot]}"']
        labels = {
            parameter.name: parameter.label
            for parameter in facts.fitted.candidate.free
            if parameter.slot == slot
        }
        for name, value in given.items():
            interval = intervals.get(labels.get(name, ""))
            comment = _not_fitted(facts, slot, name) if interval is None else _interval(interval)
            lines.append(f"{name} = {_number(value)}  # {comment}")
        lines += _spread(facts, slot, intervals)
    if facts.fracture is not None:
        lines += _fracture(facts.fracture, intervals)
    return "\n".join([*lines, "", *_identified(facts)]) + "\n"


def _spread(facts: SceneFacts, slot: int, intervals: Mapping[str, IdentifiedParameter]) -> list[str]:
    """Return the line with the spreads of a term's parameters, if there are any."""
    free = facts.fitted.candidate.free
    own = {free[place]: value for place, value in facts.spreads.items() if free[place].slot == slot}
    if not own:
        return []
    values = ", ".join(f"{parameter.name} = {_number(value)}" for parameter, value in own.items())
    known = ", ".join(_interval(intervals[f"{parameter.label}.spread"]) for parameter in own)
    return [f"spread = {{ {values} }}  # {known}"]


def _not_fitted(facts: SceneFacts, slot: int, name: str) -> str:
    if (slot, name) in facts.fitted.candidate.fixed:
        return "not fitted: a conventional value"
    return "follows from the fitted combinations, gas. in [identified.intervals]"


def _fracture(fit: FractureFit, intervals: Mapping[str, IdentifiedParameter]) -> list[str]:
    interval = _interval(intervals[f"fracture.{fit.name}"])
    lines = ["", "[[terms]]", 'type = "fracture"', f"{fit.name} = {_number(fit.value)}  # {interval}"]
    lines.append(f"left = {_number(fit.left)}")
    if fit.spread is None:
        return lines
    known = _interval(intervals[f"fracture.{fit.name}.spread"])
    return [*lines, f"spread = {{ {fit.name} = {_number(fit.spread.value)} }}  # {known}"]


def _identified(facts: SceneFacts) -> list[str]:
    intervals = [parameter for parameter in facts.parameters if not math.isnan(parameter.low)]
    return [
        "# What the scene was identified from. The simulator checks this table and does not use it.",
        "[identified]",
        f"label = {json.dumps(facts.label)}",
        "",
        "[identified.gripper]",
        *(f"{key} = {_number(value)}" for key, value in facts.gripper.items()),
        "",
        "[identified.sensor]",
        f"delay_s = {_number(facts.delay.used_s)}  # that of the settings: {_number(facts.delay.settings_s)}",
        "",
        "[identified.intervals]",
        *(
            f"{json.dumps(interval.name)} = [{_number(interval.low)}, {_number(interval.high)}]  # {interval.basis}"
            for interval in intervals
        ),
        "",
        "[identified.recordings]",
        *(f"{json.dumps(squeeze.name)} = {json.dumps(squeeze.sha256)}" for squeeze in facts.squeezes),
        "",
        "# The error by which the candidates were compared, over the peak force; nan where it was not computed.",
        "[identified.candidates]",
        *(
            f"{json.dumps(candidate.terms)} = {_number(candidate.error)}  # {candidate.verdict}"
            for candidate in facts.candidates
        ),
        "",
        "[identified.undetermined]",
        *(
            f"{json.dumps(undetermined.what)} = {json.dumps(f'{undetermined.reason}; {undetermined.remedy}')}"
            for undetermined in facts.undetermined
        ),
    ]


def _interval(parameter: IdentifiedParameter) -> str:
    if math.isnan(parameter.low):
        return parameter.basis
    return f"[{parameter.low:.4g}, {parameter.high:.4g}] {parameter.unit}".rstrip()


def _number(value: float) -> str:
    """Return a number for TOML, with six digits."""
    text = f"{value:.6g}"
    return text if any(mark in text for mark in ".en") else f"{text}.0"
