"""A comparison of classifiers and feature sets: its table, for the terminal and the page, and the page."""

from __future__ import annotations

from graspsense.evaluation.intervals import percent
from graspsense.evaluation.over_seeds import MARGIN
from graspsense.evaluation.ranking import Candidate, Ranking
from graspsense.report.found_table import FoundTable
from graspsense.report.html import Page, Section, bullets, facts, pair, paragraph
from graspsense.report.rates import rate_row, rates_picture
from graspsense.report.verdict import in_hundred
from graspsense.report.wording import CONTROLS, control_words, protocol_words


def ranking_page(ranking: Ranking, command: str) -> Page:
    """Return the page; `command` is the command line that measured the comparison."""
    best = ranking.candidates[0]
    # Without the luck of the choice, which the rate of the best contains.
    rate = (ranking.chosen or best.rates[ranking.protocol]).rate
    made = [("trials", f"{ranking.trials} of {ranking.source}"), ("command", command)]
    return Page(
        kind="Comparison of classifiers",
        title=ranking.source,
        question=f"Which classifier recognises most, with which features, on {ranking.source}?",
        answer=ranking.verdict,
        headline=f"{best.name} recognises most: expect {in_hundred(rate)} new grasps",
        beside=bullets(ranking.notes, "notes"),
        sections=(
            ranking_table(ranking).section(_rates(ranking)),
            Section(id="made", title="Provenance", body=facts(made)),
        ),
    )


def ranking_table(ranking: Ranking) -> FoundTable:
    """Return the rates of all candidates, what they lose to the best, and how often their prediction sets are right."""
    protocols = _protocols(ranking)
    rows = tuple(
        (
            candidate.classifier,
            candidate.features,
            *(percent(candidate.rates[name].rate) if name in candidate.rates else "" for name in protocols),
            "" if candidate.loss is None else candidate.loss.points,
            candidate.standing,
            ""
            if candidate.sets is None or candidate.sets.covered is None
            else percent(candidate.sets.covered.rate),
            f"{candidate.training_s:.2g} s",
        )
        for candidate in ranking.candidates
    )
    names = (name.replace("_", " ") for name in protocols)
    margin = f"{100 * MARGIN:.0f} points"
    return FoundTable(
        id="rates",
        title="Recognition rates",
        header=("classifier", "features", *names, "loss, in points", "standing", "sets cover", "training"),
        rows=rows,
        note=f"The loss is the rate of {ranking.candidates[0].name} minus that of the candidate on the same grasps. "
        "Its 95 % intervals hold for all pairs of candidates together. A candidate is equivalent if the interval is "
        f"below {margin}, worse if it is above zero, else undecided: more grasps could show either. A prediction "
        "set has the labels that cannot be ruled out; the table has how often it contains the true one.",
        numbers=2,
        verdicts=(3 + len(protocols),),
    )


def _protocols(ranking: Ranking) -> list[str]:
    return list(dict.fromkeys(name for candidate in ranking.candidates for name in candidate.rates))


def _rates(ranking: Ranking) -> str:
    """Return the picture of the rates, beside the meaning of each protocol."""
    rows = [
        rate_row(_name(candidate), candidate.rates[ranking.protocol], strong=candidate.standing == "best")
        for candidate in ranking.candidates
    ]
    bars = " Bars are 95 % intervals." if any(row.interval for row in rows) else ""
    words = [control_words(name, "") for name in _protocols(ranking)]
    if any(candidate.standing == "control" for candidate in ranking.candidates):
        words.append(CONTROLS["before_contact"])
    text = paragraph(f"Every grasp is classified by {protocol_words(ranking.protocol)}.") + facts(words)
    return pair(rates_picture(rows, f"Recognition rates.{bars}"), text)


def _name(candidate: Candidate) -> str:
    features = "before contact (control)" if candidate.standing == "control" else candidate.features
    return f"{candidate.classifier}, {features}"
