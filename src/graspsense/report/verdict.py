"""The verdict on a recognition rate: what a person would say of it, computed from the evaluation alone."""

from __future__ import annotations

from typing import Final

from graspsense.core.values.errors import counted
from graspsense.evaluation.intervals import percent, percentages
from graspsense.evaluation.over_seeds import MARGIN, verdict_on
from graspsense.evaluation.results import Evaluation, Measurement
from graspsense.report.wording import TARGETS

LEAST_TRIALS: Final = 10
"""Trials of a control below which nothing is concluded from it."""


def verdict(evaluation: Evaluation) -> str:
    """Return the rate with its interval, the comparison with guessing, and what the controls say about its origin."""
    sentences = (
        _rate(evaluation),
        _against_guessing(evaluation.controls.get("majority_class")),
        _before_contact(evaluation),
        _first_line(evaluation),
        _width(evaluation.controls.get("width_only"), evaluation.headline.n),
    )
    return " ".join(filter(None, sentences))


def headline(evaluation: Evaluation) -> str:
    """Return the result as a person would say it, for the head of a page."""
    rate, what = evaluation.headline, TARGETS[evaluation.recognised]
    told = f"T{what[1:]} recognised in {in_hundred(rate.rate)} grasps ({rate.correct} of {rate.n})"
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
    trials = (
        f"{rate.n} {source}" if source == "simulated grasps" else f"{counted(rate.n, 'trial')} of {source}"
    )
    if evaluation.protocol == "instance_held_out":
        protocol = "instances of which no grasp was used for training"
    else:
        protocol = "objects of which other grasps may have been used for training"
    interval = f"95 %: {percentages(rate.interval)}" if rate.interval else f"no interval: {rate.no_interval}"
    return (
        f"{name} recognises {TARGETS[evaluation.recognised]} in {percent(rate.rate)} of {trials} "
        f"({interval}), on {protocol}."
    )


def _against_guessing(majority: Measurement | None) -> str:
    if majority is None or majority.rate is None or majority.difference is None:
        return ""
    guessing = f"always giving the most frequent label ({percent(majority.rate.rate)})"
    interval = majority.difference.interval
    if interval is None:
        return f"Whether this is better than {guessing} cannot be told: {majority.difference.no_interval}."
    told = {
        "differs": f"This is {'' if majority.difference.is_positive else 'not '}better than {guessing}.",
        "agrees": f"This agrees with {guessing} within {100 * MARGIN:g} points.",
        "cannot be told": f"This is not shown to be better than {guessing}: it cannot be told from so few trials.",
    }
    return told[verdict_on(interval)]


def _before_contact(evaluation: Evaluation) -> str:
    control, majority = evaluation.controls.get("before_contact"), evaluation.controls.get("majority_class")
    if control is None:
        return ""
    if control.rate is None or majority is None or majority.rate is None:
        why = "" if control.rate is not None else f": {control.reason}"
        return f"Whether the recording reveals the labels before contact was not measured{why}."
    known = f"{percent(control.rate.rate)}{_among(control, evaluation.headline.n)}"
    if any("from before contact" in warning for warning in evaluation.warnings):
        return f"But {known} are recognised before any contact: the recording reveals the labels, so do not trust it."
    if control.rate.n < LEAST_TRIALS <= evaluation.headline.n:
        return f"Before contact {known} are recognised, too few to say what that means."
    if control.difference is not None and control.difference.interval is None:
        return f"Before contact {known} are recognised, on too few instances to say what that means."
    if control.difference is not None and not control.difference.is_positive:
        return (
            f"Before contact {known} are recognised: whether the recording explains the rate cannot be told."
        )
    return f"Before contact {known} are recognised, so the recording does not explain the rate."


def _first_line(evaluation: Evaluation) -> str:
    control = evaluation.controls.get("first_line")
    if control is None or control.rate is None:
        return ""
    if any("from the first line" in warning for warning in evaluation.warnings):
        share = percent(control.rate.rate)
        return f"The first line of the recording alone gives {share}: the recording reveals the labels."
    return ""


def _among(control: Measurement, trials: int) -> str:
    """Return of how many trials the rate of a control is, where that is not all of them."""
    return (
        "" if control.rate is None or control.rate.n == trials else f" of {control.rate.n} of {trials} trials"
    )


def _width(control: Measurement | None, trials: int) -> str:
    if control is None:
        return ""
    if control.rate is None or control.difference is None:
        return "How much of it the width alone explains was not measured."
    width = f"The width alone gives {percent(control.rate.rate)}{_among(control, trials)}"
    if control.rate.n < LEAST_TRIALS <= trials:
        return f"{width}, too few to say what the squeeze adds."
    if control.difference.interval is None:
        return f"{width}; what the squeeze adds cannot be told: {control.difference.no_interval}."
    if control.difference.is_positive:
        return f"{width}; the squeeze adds {100 * control.difference.value:.1f} points."
    if verdict_on(control.difference.interval) == "agrees":
        return f"{width}: the squeeze adds nothing, within {100 * MARGIN:g} points."
    return f"{width}: the squeeze is not shown to add anything."
