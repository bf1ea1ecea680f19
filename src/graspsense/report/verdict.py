"""The verdict on a recognition rate: what a person would say of it, computed from the evaluation alone."""

from __future__ import annotations

from graspsense.evaluation.intervals import percentage, percentages
from graspsense.evaluation.results import Evaluation, Measurement
from graspsense.report.wording import TARGETS


def verdict(evaluation: Evaluation) -> str:
    """Return the rate with its interval, the comparison with guessing, and what the controls say about its origin."""
    sentences = [_rate(evaluation), _against_guessing(evaluation.controls.get("majority_class"))]
    sentences.append(_before_contact(evaluation))
    sentences.append(_first_line(evaluation))
    sentences.append(_width(evaluation.controls.get("width_only")))
    return " ".join(filter(None, sentences))


def headline(evaluation: Evaluation) -> str:
    """Return the result as a person would say it, for the head of a page."""
    told = f"{in_hundred(evaluation.headline.rate)} grasps tell {TARGETS[evaluation.target]}"
    majority = evaluation.controls.get("majority_class")
    if majority is None or majority.rate is None:
        return told
    guessing = f"{100 * majority.rate.rate:.0f} by guessing"
    if majority.difference is None or not majority.difference.is_positive:
        return f"{told}, which is not shown to be more than the {guessing}"
    return f"{told}, against {guessing}"


def in_hundred(rate: float) -> str:
    """Return a rate as a person would say it: `87 of 100`."""
    return f"{100 * rate:.0f} of 100"


def _rate(evaluation: Evaluation) -> str:
    name = evaluation.classifier.partition(" ")[0].rpartition("/")[2]
    rate, source = evaluation.headline, evaluation.source
    trials = f"{rate.n} {source}" if source == "simulated grasps" else f"{rate.n} trials of {source}"
    if evaluation.protocol == "instance_held_out":
        protocol = "objects of which no grasp was used for training"
    else:
        protocol = "objects of which other grasps may have been used for training"
    interval = f"95 %: {percentages(rate.interval)}" if rate.interval else f"no interval: {rate.no_interval}"
    return (
        f"{name} recognises {TARGETS[evaluation.target]} in {percentage(rate.rate)} of {trials} "
        f"({interval}), on {protocol}."
    )


def _against_guessing(majority: Measurement | None) -> str:
    if majority is None or majority.rate is None or majority.difference is None:
        return ""
    guessing = f"always giving the most frequent label ({percentage(majority.rate.rate)})"
    if majority.difference.is_positive:
        return f"This is better than {guessing}."
    return f"This is not shown to be better than {guessing}."


def _before_contact(evaluation: Evaluation) -> str:
    control, majority = evaluation.controls.get("before_contact"), evaluation.controls.get("majority_class")
    if control is None:
        return ""
    if control.rate is None or majority is None or majority.rate is None:
        why = "" if control.rate is not None else f": {control.reason}"
        return f"Whether the recording reveals the labels before contact was not measured{why}."
    before = percentage(control.rate.rate)
    if any("from before contact" in warning for warning in evaluation.warnings):
        return f"But {before} are recognised before any contact: the recording reveals the labels, so do not trust it."
    if control.difference is not None and control.difference.interval is None:
        return f"Before contact {before} are recognised, on too few instances to say what that means."
    return f"Before contact {before} are recognised, so the recording does not explain the rate."


def _first_line(evaluation: Evaluation) -> str:
    control = evaluation.controls.get("first_line")
    if control is None or control.rate is None:
        return ""
    if any("from the first line" in warning for warning in evaluation.warnings):
        share = percentage(control.rate.rate)
        return f"The first line of the recording alone gives {share}: the recording reveals the labels."
    return ""


def _width(control: Measurement | None) -> str:
    if control is None:
        return ""
    if control.rate is None or control.difference is None:
        return "How much of it the width alone explains was not measured."
    width = f"The width alone gives {percentage(control.rate.rate)}"
    if control.difference.is_positive:
        return f"{width}; the squeeze adds {100 * control.difference.value:.1f} points."
    return f"{width}: the squeeze is not shown to add anything."
