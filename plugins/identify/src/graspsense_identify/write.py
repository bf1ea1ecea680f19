"""Writing the scene: the terms with their values, the spreads, and the table `[identified]` with all that was found."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping

from graspsense.simulator_api import Identification, IdentifiedParameter
from graspsense_identify.delay import Delay
from graspsense_identify.fit import Fitted
from graspsense_identify.laws import SLOTS


def scene_text(
    result: Identification,
    fitted: Fitted,
    values: Mapping[str, float],
    gripper: Mapping[str, float],
    delay: Delay,
) -> str:
    """Return the text of the scene file.

    `values`: the keys of the object. `gripper`: the settings of the fingertips.
    """
    n = len(result.fits)
    what = f"{result.label or 'object'}, identified from {n} squeeze{'s' if n > 1 else ''}"
    by_name = {parameter.name: parameter for parameter in result.parameters}
    lines = [
        "# Written by `graspsense identify`. Numbers in brackets are 90 % intervals.",
        f"summary = {json.dumps(what)}",
    ]
    for key, value in values.items():
        interval = by_name.get(key)
        lines.append(f"{key} = {_number(value)}" + ("" if interval is None else f"  # {_interval(interval)}"))
    law = fitted.candidate
    for slot, given in law.parameters(fitted.values).items():
        labels = {parameter.name: parameter.label for parameter in law.free if parameter.slot == slot}
        known = {name: by_name[label] for name, label in labels.items()}
        lines += _term(SLOTS[slot], given, known, by_name)
    fracture = {
        parameter.name.removeprefix("fracture."): parameter
        for parameter in result.parameters
        if parameter.name.startswith("fracture.") and not parameter.name.endswith(".spread")
    }
    if fracture:
        numbers = {name: parameter.value for name, parameter in fracture.items()}
        lines += _term("fracture", numbers, fracture, by_name)
    return "\n".join([*lines, "", *_identified(result, fitted, gripper, delay)]) + "\n"


def _term(
    kind: str,
    values: Mapping[str, float],
    known: Mapping[str, IdentifiedParameter],
    by_name: Mapping[str, IdentifiedParameter],
) -> list[str]:
    """Return the lines of a term. `known`: its identified parameters."""
    lines = ["", "[[terms]]", f'type = "{kind}"']
    for name, value in values.items():
        comment = _interval(known[name]) if name in known else "not fitted: a conventional value"
        lines.append(f"{name} = {_number(value)}  # {comment}")
    names = {name: f"{parameter.name}.spread" for name, parameter in known.items()}
    spreads = {name: by_name[label] for name, label in names.items() if label in by_name}
    if spreads:
        numbers = ", ".join(f"{name} = {_number(spread.value)}" for name, spread in spreads.items())
        lines.append(f"spread = {{ {numbers} }}  # {', '.join(map(_interval, spreads.values()))}")
    return lines


def _identified(
    result: Identification, fitted: Fitted, gripper: Mapping[str, float], delay: Delay
) -> list[str]:
    return [
        "# What the scene was identified from. The simulator checks this table and does not use it.",
        "[identified]",
        f"label = {json.dumps(result.label)}",
        "",
        "[identified.gripper]",
        *(f"{key} = {_number(value)}" for key, value in gripper.items()),
        "",
        "[identified.sensor]",
        f"delay_s = {_number(delay.used_s)}  # that of the settings: {_number(delay.settings_s)}",
        "",
        "[identified.intervals]",
        *(
            f"{json.dumps(interval.name)} = [{_number(interval.low)}, {_number(interval.high)}]  # {interval.basis}"
            for interval in result.parameters
            if not math.isnan(interval.low)
        ),
        "",
        "[identified.recordings]",
        *(f"{json.dumps(squeeze.name)} = {json.dumps(squeeze.sha256)}" for squeeze in fitted.squeezes),
        "",
        "# The error by which the candidates were compared, over the peak force; nan where it was not computed.",
        "[identified.candidates]",
        *(
            f"{json.dumps(candidate.terms)} = {_number(candidate.error)}  # {candidate.verdict}"
            for candidate in result.candidates
        ),
        "",
        "[identified.undetermined]",
        *(
            f"{json.dumps(undetermined.what)} = {json.dumps(f'{undetermined.reason}; {undetermined.remedy}')}"
            for undetermined in result.undetermined
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
