"""The page of a comparison of classifiers and feature sets."""

from __future__ import annotations

from graspsense.evaluation.intervals import percent
from graspsense.evaluation.ranking import MARGIN, Candidate, Ranking
from graspsense.report.html import Page, Section, bullets, facts, pair, paragraph, table
from graspsense.report.rates import RateRow, rates_picture
from graspsense.report.verdict import in_hundred
from graspsense.report.wording import CONTROLS, control_words, protocol_words


def ranking_page(ranking: Ranking, command: str) -> Page:
    """Return the page; `command` is the command line that measured the comparison."""
    best = ranking.candidates[0]
    # Without the luck of the choice, which the rate of the best contains.
    rate = (ranking.chosen or best.rates[ranking.protocol]).rate
    return Page(
        kind="Comparison of classifiers",
        title=ranking.source,
        question=f"Which classifier recognises most, with which features, on {ranking.source}?",
        answer=ranking.verdict,
        headline=f"{best.name} recognises most: expect {in_hundred(rate)} new grasps",
        beside=bullets(ranking.notes, "notes"),
        sections=(_rates(ranking), _differences(ranking), _sets(ranking), _made_of(ranking, command)),
    )


def _rates(ranking: Ranking) -> Section:
    protocols = list(dict.fromkeys(name for candidate in ranking.candidates for name in candidate.rates))
    rows = [
        RateRow(
            name=_name(candidate),
            rate=candidate.rates[ranking.protocol].rate,
            interval=candidate.rates[ranking.protocol].interval,
            strong=candidate.standing == "best",
        )
        for candidate in ranking.candidates
    ]
    bars = " Bars are 95 % intervals." if any(row.interval for row in rows) else ""
    picture = rates_picture(rows, f"Recognition rates.{bars}")
    text = paragraph(f"Every grasp is classified by {protocol_words(ranking.protocol)}.")
    words = [control_words(name, "") for name in protocols]
    if any(candidate.standing == "control" for candidate in ranking.candidates):
        words.append(CONTROLS["before_contact"])
    text += facts(words)
    cells = [
        (
            candidate.classifier,
            _features(candidate),
            *(percent(candidate.rates[name].rate) if name in candidate.rates else "" for name in protocols),
            f"{candidate.training_s:.2g}",
        )
        for candidate in ranking.candidates
    ]
    header = ("classifier", "features", *(control_words(name, "")[0] for name in protocols), "training, s")
    return Section(
        id="rates",
        title="Recognition rates",
        body=pair(picture, text) + table("Rates of all candidates", header, cells, 2),
    )


def _differences(ranking: Ranking) -> Section:
    best, margin = ranking.candidates[0], f"{100 * MARGIN:.0f} points"
    text = (
        f"The loss is the rate of {best.name} minus that of the candidate on the same grasps, in percentage points. "
        "The 95 % intervals hold for all pairs of candidates together. A candidate is equivalent if the interval is "
        f"below {margin}, worse if it is above zero, else undecided: more grasps could show either."
    )
    rows = [
        (candidate.classifier, _features(candidate), candidate.loss.points, candidate.standing)
        for candidate in ranking.candidates
        if candidate.loss is not None
    ]
    header = ("classifier", "features", "loss (interval), points", "standing")
    body = table(f"Losses against {best.name}", header, rows, verdicts=(3,)) if rows else ""
    return Section(id="losses", title="Differences from the best", body=paragraph(text) + body)


def _sets(ranking: Ranking) -> Section:
    judged = [candidate.sets for candidate in ranking.candidates if candidate.sets is not None]
    if not judged:
        return Section(id="sets", title="Prediction sets", body=paragraph("Not measured."))
    text = (
        f"A prediction set has the labels that cannot be ruled out. It shall contain the true label of "
        f"{100 * judged[0].asked:.0f} % of new grasps. Of two classifiers with the same coverage, the one with the "
        "smaller sets tells more. The prediction is always a member, so a label that is recognised more often than "
        "that is also covered more often; the next column has the other labels."
    )
    rows = []
    for candidate in ranking.candidates:
        sets = candidate.sets
        if sets is None:
            continue
        if sets.covered is None or sets.mean_size is None or sets.single is None:
            rows.append(
                (candidate.classifier, _features(candidate), f"not measured: {sets.reason}", "", "", "", "")
            )
            continue
        lowest = min(sets.by_label.items(), key=lambda item: item[1].rate)
        rows.append(
            (
                candidate.classifier,
                _features(candidate),
                percent(sets.covered.rate),
                "" if sets.covered_below is None else percent(sets.covered_below.rate),
                f"{percent(lowest[1].rate)} ({lowest[0]})",
                f"{sets.mean_size:.2f}",
                percent(sets.single.rate),
            )
        )
    header = (
        "classifier",
        "features",
        "contain the true label",
        "if recognised less often",
        "least of a label",
        "labels in a set",
        "single label",
    )
    return Section(
        id="sets",
        title="Prediction sets",
        body=paragraph(text) + table("Prediction sets of all candidates", header, rows, 2),
    )


def _made_of(ranking: Ranking, command: str) -> Section:
    pairs = [("trials", f"{ranking.trials} of {ranking.source}"), ("command", command)]
    return Section(id="made", title="Provenance", body=facts(pairs))


def _features(candidate: Candidate) -> str:
    return "before contact (control)" if candidate.standing == "control" else candidate.features


def _name(candidate: Candidate) -> str:
    return f"{candidate.classifier}, {_features(candidate)}"
