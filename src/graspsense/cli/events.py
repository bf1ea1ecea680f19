"""`evaluate --events`: how well a controller tells the events that others labelled in recordings."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any, Final

from graspsense.cli.options import refuse_typed, typed
from graspsense.cli.output import echo_values
from graspsense.cli.progress import ProgressLine
from graspsense.cli.sources import detector_of
from graspsense.cli.terminal import Style, echo, echo_entries, echo_entry, echo_table
from graspsense.core.values.signals import NOT_KNOWN
from graspsense.evaluation.intervals import RecognitionRate, percent, percentages
from graspsense.evaluation.json_codec import to_json

if TYPE_CHECKING:
    from graspsense.evaluation.events import EventScore, EventsEvaluation, LabelledEvents
    from graspsense.recording.replayable import Recording

_FOR_EVENTS: Final = ("source", "events", "tolerance", "folds", "only", "options", "seed", "force", "as_json")


def evaluate_events(source: str, tolerance_s: float, folds: int, given: Mapping[str, Any]) -> None:
    """Score the events, and print how well each kind is told."""
    refuse_typed({*typed()}.difference(_FOR_EVENTS), "has no meaning with --events")
    evaluation = _evaluated(source, tolerance_s, folds, given)
    echo_values(to_json(evaluation))
    _print(evaluation)


def _evaluated(source: str, tolerance_s: float, folds: int, given: Mapping[str, Any]) -> EventsEvaluation:
    from graspsense.evaluation.events import STEPS, EventsEvaluation, evaluate_kind
    from graspsense.sources.recordings.event_recordings import (
        EventTeller,
        check_detector,
        event_recordings,
        threshold_factor,
    )

    selected = detector_of(source, given)
    controller: Any = selected.create()
    known = type(controller).events
    with ProgressLine() as progress:
        read = event_recordings(source, given["only"])
        recordings = tuple(recording.recording for recording in read.recordings)
        check_detector(controller, recordings)
        labelled = [
            _labelled(recording, group) for recording, group in zip(recordings, read.groups, strict=True)
        ]
        names = list(
            dict.fromkeys(
                n for recording in labelled for n in recording.labelled if not n.endswith(NOT_KNOWN)
            )
        )
        total = len(recordings) * (len(STEPS) + 1)
        teller = EventTeller(controller, recordings, lambda done: progress("detecting events", done, total))
        factor = threshold_factor(recordings)
        kinds = {
            name: evaluate_kind(
                name,
                labelled,
                teller,
                factor=factor,
                tolerance_s=tolerance_s,
                folds=folds,
                seed=given["seed"],
            )
            for name in names
            if name in known
        }
        told = [teller(k, 1.0) for k in range(len(recordings))]
    others = {
        name: sum(len(detected.get(name, ())) for detected in told) for name in known if name not in kinds
    }
    return EventsEvaluation(
        source=source,
        detector=selected.component.name,
        tolerance_s=tolerance_s,
        recordings=len(recordings),
        held_out=read.held_out,
        kinds=kinds,
        not_told=tuple(name for name in names if name not in known),
        not_labelled={name: count for name, count in others.items() if count},
        notes=read.notes,
    )


def _labelled(recording: Recording, group: str) -> LabelledEvents:
    from graspsense.evaluation.events import LabelledEvents

    return LabelledEvents(
        labelled={
            name: tuple(
                (event.t_s, event.t_s if event.until_s is None else event.until_s) for event in events
            )
            for name, events in recording.events.items()
        },
        begin_s=recording.readings[0].frame.t_s,
        end_s=recording.readings[-1].frame.t_s,
        group=group,
    )


def _print(evaluation: EventsEvaluation) -> None:
    scored = (f"{name}: {_in_words(kind.fitted or kind.given)}" for name, kind in evaluation.kinds.items())
    words = "; ".join(scored) or "no event that is labelled can be scored"
    echo(
        f"{evaluation.detector} on {evaluation.recordings} recordings of {evaluation.source}. {words}",
        Style.HEADING,
    )
    echo()
    echo_entry(
        "rule",
        f"an event is found by a detection at most {evaluation.tolerance_s:g} s from its beginning, and a detection "
        "finds one event at most. Other detections while an event goes on do not count; all others are false",
    )
    for name in evaluation.not_told:
        echo_entry(
            "not told", f"{name} is labelled, and {evaluation.detector} has no such event", Style.CAUTION
        )
    others = [f"{name!r} ({count} times)" for name, count in evaluation.not_labelled.items()]
    if others:
        echo_entry("not judged", f"detected, but labelled nowhere: {', '.join(others)}")
    for name, kind in evaluation.kinds.items():
        if kind.fitted is None:
            echo_entry("not fitted", f"{name}: {kind.not_fitted}", Style.CAUTION)
        else:
            low, high = (f"{end(kind.factors):.3g}" for end in (min, max))
            factors = low if low == high else f"{low} to {high}"
            echo_entry(
                "fitted",
                f"{name}: all thresholds times {factors}, with each {evaluation.held_out} held out as a whole",
            )
    echo_entries("note", evaluation.notes)
    if evaluation.kinds:
        _print_tables(evaluation)


def _print_tables(evaluation: EventsEvaluation) -> None:
    echo()
    heads = (
        "EVENT",
        "THRESHOLDS",
        "FOUND",
        "RECALL",
        "95 %",
        "FALSE",
        "PRECISION",
        "95 %",
        "DELAY, S",
        "95 %",
    )
    rows = []
    for name, kind in evaluation.kinds.items():
        rows.append((name, "as set", *_row(kind.given)))
        if kind.fitted is not None:
            rows.append((name, "fitted", *_row(kind.fitted)))
        rows.append((name, "by chance", *_row(kind.chance)))
    echo_table(heads, rows)
    echo(
        "FALSE: false alarms, and their number a minute. DELAY: median (10 to 90 %), with the interval of the median."
    )
    echo("by chance: the same detections, moved by half of their recording")
    scores = [score for kind in evaluation.kinds.values() for score in (kind.fitted, kind.given) if score]
    rates = [rate for score in scores for rate in (score.recall, score.precision) if rate]
    for reason in dict.fromkeys(rate.no_interval for rate in rates if rate.interval is None):
        echo(f"no interval: {reason}")
    echo()
    groups = [
        (name, group, f"{hits} of {labelled}", str(alarms))
        for name, kind in evaluation.kinds.items()
        for group, (hits, labelled, alarms) in kind.by_group.items()
    ]
    echo_table(("EVENT", evaluation.held_out.upper(), "FOUND", "FALSE"), groups)


def _row(score: EventScore) -> tuple[str, ...]:
    per_minute = 60.0 * score.false_alarms / score.seconds if score.seconds else 0.0
    delay, delays = score.delay, ("-", "-")
    if delay is not None:
        ends = "none" if delay.interval is None else f"{delay.interval[0]:.3f} to {delay.interval[1]:.3f}"
        delays = (f"{delay.median_s:.3f} ({delay.low_s:.3f} to {delay.high_s:.3f})", ends)
    return (
        f"{score.detected} of {score.labelled}",
        *_cells(score.recall),
        f"{score.false_alarms} ({per_minute:.2g})",
        *_cells(score.precision),
        *delays,
    )


def _cells(rate: RecognitionRate | None) -> tuple[str, str]:
    if rate is None:
        return "-", "-"
    return percent(rate.rate), "none" if rate.interval is None else percentages(rate.interval)


def _in_words(score: EventScore) -> str:
    recall, precision = (
        "unknown" if rate is None else percent(rate.rate) for rate in (score.recall, score.precision)
    )
    return f"recall {recall}, precision {precision}"
