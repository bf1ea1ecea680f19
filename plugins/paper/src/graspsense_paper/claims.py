"""Claims in the text of the paper, each tested on the results of the experiments.

Each criterion (`rule`) names the size of an effect that counts. The claim agrees if the 95 % interval of the measured
figure lies wholly on its side of that size, and differs if it lies wholly on the other side. Otherwise this cannot be
told. A claim on rates or features must agree, or differ, under both protocols (`cases.PROTOCOLS`).
"""

from __future__ import annotations

import itertools
import math
import statistics
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any, Final

from attrs import evolve, frozen

from graspsense.experiment_api import (
    MeanDifference,
    OverSeeds,
    RecognitionResult,
    Summary,
    counted,
    mean_difference,
    percent,
    span,
    wilson,
)
from graspsense_paper.basis import Basis, basis
from graspsense_paper.cases import PROTOCOLS, condition_result, is_of, of_protocol
from graspsense_paper.grasp_result import GraspRow, grasp_results
from graspsense_paper.published import published
from graspsense_paper.rows import of_class, sample
from graspsense_paper.verdict import UNTOLD, Verdict, every, within

FORCE: Final = "controller.probing_force_n"
SPEED: Final = "controller.closing_speed_m_s"
VARIANT: Final = "variant"
PROBING_N: Final = 23.0
CONTAINERS: Final = ("odwalla", "naked", "can", "water")
MOST_GRASPS: Final = 0.9
"""An event counts as happening in general if it happens in more than this share of grasps."""
MANY_TIMES: Final = 0.8
"""The same of what is tried in fewer grasps or seeds."""
COUNTS: Final = 0.05
"""Differences of rates from this on count."""
SPLITS: Final = 0.9
"""A feature separates two groups if one threshold assigns more than this share correctly, at equal weights."""


@frozen(kw_only=True)
class Claim:
    """A claim of the paper: what it says, the criterion, the verdict, the measured figure, and from how many trials.

    `basis.basis` defines `basis`. `follows_from` has the ids of published rates whose comparison decides it.
    """

    id: str
    says: str
    rule: str
    basis: Basis
    verdict: Verdict
    number: str
    n: str
    follows_from: tuple[str, ...] = ()

    @property
    def cells(self) -> tuple[str, ...]:
        """The row of a table."""
        return (self.says, self.basis, self.verdict, self.number, self.n, self.rule)

    def as_json(self) -> dict[str, Any]:
        """Return the fields as JSON values."""
        return {name: getattr(self, name) for name in Claim.__annotations__}


HEADER = ("claim of the paper", "basis", "verdict", "measured", "n", "criterion")


def claims(summary: Summary) -> list[Claim]:
    """Return every claim that there are results for, over both protocols."""
    checks: tuple[Callable[[Summary], Claim | None], ...] = (
        _approach_velocity,
        _probing_force,
        _worn,
        _easiest,
        _confused,
        _longest,
        _f_steady,
        _p_steady,
        _p_first,
        _f_steady_classes,
        _other_classifiers,
        _stiction,
        _one_finger_first,
        _pure_velocity,
        _egg,
        _egg_force,
        _fig_5,
        _fig_6_force,
        _fig_6_contact,
        _fig_6_rest,
    )
    views = [of_protocol(summary, protocol) for protocol in PROTOCOLS]
    merged = (_merged([check(view) for view in views]) for check in checks)
    return [claim for claim in merged if claim is not None]


def _merged(claims: Sequence[Claim | None]) -> Claim | None:
    """Return a claim from those under each protocol; None if no protocol has results.

    The paper does not say which protocol it used, so where they disagree, nothing can be told.
    """
    by_protocol = [
        (words, claim) for words, claim in zip(PROTOCOLS.values(), claims, strict=True) if claim is not None
    ]
    if not by_protocol:
        return None
    headline = by_protocol[0][1]
    if len({claim.number for _, claim in by_protocol}) == 1:
        return headline
    verdicts = {claim.verdict for _, claim in by_protocol}
    alone = len(verdicts) == 1
    return evolve(
        headline,
        verdict=verdicts.pop() if alone else UNTOLD,
        number="; ".join(
            f"each bottle in {words}: {claim.number}" + ("" if alone else f" ({claim.verdict})")
            for words, claim in by_protocol
        ),
    )


def _points(difference: MeanDifference) -> str:
    value, (low, high) = difference.value, difference.interval
    return f"{100 * value:+.1f} points ({100 * low:+.1f} to {100 * high:+.1f})"


def _approach_velocity(summary: Summary) -> Claim | None:
    slow = condition_result(summary, "approach_speed", "state", {SPEED: 0.005})
    fast = condition_result(summary, "approach_speed", "state", {SPEED: 0.02})
    gap = None if slow is None or fast is None else fast.minus(slow)
    if gap is None or slow is None:
        return None
    return Claim(
        id="approach_velocity",
        says="the initial closing velocity has a negligible effect on the recognition rate",
        rule="the difference between the rates at 5 and 20 mm/s is less than 5 points",
        basis=basis(summary, "approach_speed", "approach_velocity"),
        verdict=within(gap.interval, -COUNTS, COUNTS),
        number=f"20 mm/s minus 5 mm/s: {_points(gap)}",
        n=sample(slow.rate),
    )


def _probing_force(summary: Summary) -> Claim | None:
    weak = condition_result(summary, "table_4", "state", {FORCE: 17.0})
    strong = condition_result(summary, "table_4", "state", {FORCE: 23.0})
    gap = None if weak is None or strong is None else strong.minus(weak)
    if gap is None or weak is None:
        return None
    return Claim(
        id="probing_force",
        says="a stronger probing force raises the recognition rate",
        rule="the rate at 23 N is at least 5 points above that at 17 N",
        basis=basis(summary, "table_4", "authors_tree"),
        verdict=within(gap.interval, low=COUNTS),
        number=f"23 N minus 17 N: {_points(gap)}; printed: {_printed_rise()}",
        n=sample(weak.rate),
        follows_from=("table_4_17", "table_4_23"),
    )


def _printed_rise() -> str:
    """Return the printed rise of the rate from 17 to 23 N, with the interval of its counts (Newcombe, 1998)."""
    weak, strong = (
        next(rate for rate in published().rates if rate.id == name) for name in ("table_4_17", "table_4_23")
    )
    value = strong.rate - weak.rate
    if strong.interval is None or weak.interval is None:
        return f"{100 * value:+.1f} points"
    low = value - math.hypot(strong.rate - strong.interval[0], weak.interval[1] - weak.rate)
    high = value + math.hypot(strong.interval[1] - strong.rate, weak.rate - weak.interval[0])
    return f"{100 * value:+.1f} points ({100 * low:+.1f} to {100 * high:+.1f})"


def _worn(summary: Summary) -> Claim | None:
    new, worn = (
        condition_result(summary, "worn_bottles", "state", {VARIANT: f"other {wear} bottles"})
        for wear in ("new", "worn")
    )
    gap = None if new is None or worn is None else new.minus(worn)
    if gap is None or new is None or worn is None:
        return None
    return Claim(
        id="worn",
        says="the rate decreases for bottles that were squeezed many times before",
        rule="other new bottles are recognised at least 5 points more often than other worn ones, trained on the same "
        "bottles",
        basis=basis(summary, "worn_bottles", "worn_bottles"),
        verdict=within(gap.interval, low=COUNTS),
        n=sample(new.rate),
        number=f"new {percent(new.rate.mean)}, worn {percent(worn.rate.mean)}, new minus worn: {_points(gap)}",
    )


def _easiest(summary: Summary) -> Claim | None:
    condition = condition_result(summary, "table_3", "state")
    rates = {} if condition is None else {name: of_class(condition, name) for name in CONTAINERS}
    odwalla, *others = rates.values() if rates else (None,)
    if odwalla is None or not others:
        return None
    gaps = {
        name: mean_difference(odwalla.rates, other.rates, other.n, len(others))
        for name, other in zip(CONTAINERS[1:], others, strict=True)
        if other is not None and len(other.rates) == len(odwalla.rates) > 1
    }
    if len(gaps) < len(others):
        return None
    nearest = min(gaps, key=lambda name: gaps[name].value)
    return Claim(
        id="easiest",
        says="the states of the Odwalla bottle are the easiest to recognise",
        rule="the rate of Odwalla is at least 5 points above that of every other container (corrected for three "
        "comparisons)",
        basis=basis(summary, "table_3", "table_3"),
        verdict=every([within(gap.interval, low=COUNTS) for gap in gaps.values()]),
        n=f"{sample(odwalla)} of Odwalla",
        number=f"Odwalla minus {nearest}, the nearest: {_points(gaps[nearest])}",
    )


def _confused(summary: Summary) -> Claim | None:
    condition = condition_result(summary, "table_2", "class")
    if condition is None:
        return None
    shares, n = [], 0
    for result in condition.by_seed.values():
        labels, counts = result.confusion.labels, result.confusion.counts
        if not {"odwalla", "naked"} <= set(labels):
            return None
        i, k = labels.index("odwalla"), labels.index("naked")
        wrong = result.confusion.n - result.confusion.correct
        if wrong:
            shares.append((counts[i][k] + counts[k][i]) / wrong)
            n += wrong
    if not shares:
        return None
    share = OverSeeds(tuple(shares), max(n // len(shares), 1))
    return Claim(
        id="confused",
        says="most confusion of containers is between Odwalla and Naked",
        rule="the share of wrong answers that confuse these two is above 50 %",
        basis=basis(summary, "table_2", "table_2"),
        verdict=within(share.interval, low=0.5),
        n=f"{n} wrong answers of {len(shares)} seeds",
        number=f"{percent(share.mean)} ({span(share.interval)}); printed: 9 of 14",
    )


def _longest(summary: Summary) -> Claim | None:
    share = _seeds_where(
        summary,
        "table_4",
        {FORCE: PROBING_N},
        lambda by_state: max(by_state, key=lambda s: statistics.median(by_state[s])) == "full_open",
        "delta_t",
    )
    if share is None:
        return None
    held, n, medians = share
    return Claim(
        id="longest",
        says="an open, full bottle is compressed for the longest time",
        rule="at 23 N, the share of seeds in which its median delta_t is the greatest of the four states is above 80 %",
        basis=basis(summary, "table_4", "authors_tree"),
        verdict=within(wilson(held, n), low=MANY_TIMES),
        n=f"{n} seeds",
        number=f"in {held} of {n} seeds ({span(wilson(held, n))} %); medians {medians} s",
    )


def _seeds_where(
    summary: Summary,
    experiment: str,
    settings: Mapping[str, Any],
    holds: Callable[[Mapping[str, Sequence[float]]], bool],
    feature: str,
) -> tuple[int, int, str] | None:
    """Return the number of seeds in which `holds` is True, the number of seeds, and the medians over all seeds."""
    held, n = 0, 0
    every: dict[str, list[float]] = {}
    for by_label in _by_label(summary, experiment, settings, feature):
        states = {label.partition(":")[2]: values for label, values in by_label.items()}
        n += 1
        held += holds(states)
        for state, values in states.items():
            every.setdefault(state, []).extend(values)
    if not n:
        return None
    medians = ", ".join(
        f"{state.replace('_', ' ')} {statistics.median(v):.2f}" for state, v in sorted(every.items())
    )
    return held, n, medians


def _by_label(
    summary: Summary, experiment: str, settings: Mapping[str, Any], feature: str
) -> Iterable[dict[str, list[float]]]:
    """Yield for each seed the values of a feature by label, without missing ones."""
    names = _case_names(summary, experiment, settings)
    for (name, _), result in summary.results.items():
        if name in names and isinstance(result, RecognitionResult) and result.trials is not None:
            yield result.trials.by_label(feature)


def _case_names(summary: Summary, experiment: str, settings: Mapping[str, Any] | None = None) -> set[str]:
    """Return the names of the cases of this experiment that differ in this."""
    return {case.name for case in summary.planned.cases if is_of(case, summary, experiment, settings)}


def split_by(group: Sequence[float], other: Sequence[float]) -> float:
    """Return the largest share that one threshold assigns correctly, with equal weight for both groups."""
    values = sorted({*group, *other})
    best = 0.5
    for low, high in itertools.pairwise(values):
        cut = 0.5 * (low + high)
        share = 0.5 * (sum(v <= cut for v in group) / len(group) + sum(v > cut for v in other) / len(other))
        best = max(best, share, 1.0 - share)
    return best


def _split(
    summary: Summary,
    feature: str,
    is_low: Callable[[str], bool],
    is_high: Callable[[str], bool],
    condition: tuple[str, Mapping[str, Any]] = ("table_2", {}),
) -> OverSeeds | None:
    """Return how well a feature separates two groups of labels over the seeds.

    `condition` is an experiment and its case.
    """
    shares, n = [], 1
    for by_label in _by_label(summary, *condition, feature):
        lows = [v for label, values in by_label.items() if is_low(label) for v in values]
        highs = [v for label, values in by_label.items() if is_high(label) for v in values]
        if lows and highs:
            shares.append(split_by(lows, highs))
            n = len(lows) + len(highs)
    return OverSeeds(tuple(shares), n) if shares else None


AT_23_N: Final[tuple[str, Mapping[str, Any]]] = ("table_4", {FORCE: 23.0})
"""Section III.F describes the features at this force."""


def _f_steady(summary: Summary) -> Claim | None:
    split, by_time = (
        _split(
            summary,
            feature,
            lambda s: s == "odwalla:empty_open",
            lambda s: s == "odwalla:empty_closed",
            AT_23_N,
        )
        for feature in ("f_steady", "delta_t")
    )
    if split is None or by_time is None:
        return None
    return Claim(
        id="f_steady_splits",
        says="f_steady separates open and empty from closed and empty",
        rule="the share that one threshold assigns correctly, Odwalla at 23 N, is above 90 %",
        basis=basis(summary, "table_4", "authors_tree"),
        verdict=within(split.interval, low=SPLITS),
        n=sample(split),
        number=f"{percent(split.mean)} ({span(split.interval)}), by delta_t {percent(by_time.mean)}",
    )


def _p_steady(summary: Summary) -> Claim | None:
    split = _split(
        summary,
        "p_steady",
        lambda s: s == "odwalla:full_closed",
        lambda s: s.startswith("odwalla:") and s != "odwalla:full_closed",
        AT_23_N,
    )
    if split is None:
        return None
    return Claim(
        id="p_steady_splits",
        says="p_steady separates closed and full very easily",
        rule="the share that one threshold assigns correctly, against the other Odwalla states at 23 N, is above 90 %",
        basis=basis(summary, "table_4", "authors_tree"),
        verdict=within(split.interval, low=SPLITS),
        n=sample(split),
        number=f"{percent(split.mean)} ({span(split.interval)})",
    )


def _p_first(summary: Summary) -> Claim | None:
    classes = ("odwalla", "naked", "can", "water")
    splits: dict[str, OverSeeds] = {}
    for i, a in enumerate(classes):
        for b in classes[i + 1 :]:
            split = _split(summary, "p_first", _of(a), _of(b))
            if split is None:
                return None
            splits[f"{a}/{b}"] = split
    alike = splits.pop("odwalla/naked")
    worst = min(splits, key=lambda name: splits[name].mean)
    return Claim(
        id="p_first_splits",
        says="p_first separates the container classes, except Odwalla from Naked",
        rule="the share that one threshold assigns correctly at 20 N is above 90 % for every pair except Odwalla and "
        "Naked, and below 90 % for that pair",
        basis=basis(summary, "table_2", "section_3f"),
        verdict=every(
            [
                within(alike.interval, high=SPLITS),
                *(within(split.interval, low=SPLITS) for split in splits.values()),
            ]
        ),
        n=sample(alike),
        number=f"lowest other pair {worst} {percent(splits[worst].mean)} ({span(splits[worst].interval)}); "
        f"odwalla/naked {percent(alike.mean)} ({span(alike.interval)})",
    )


def _of(name: str) -> Callable[[str], bool]:
    return lambda label: label.startswith(f"{name}:")


def _f_steady_classes(summary: Summary) -> Claim | None:
    split = _split(summary, "f_steady", _of("odwalla"), _of("naked"))
    if split is None:
        return None
    return Claim(
        id="f_steady_splits_classes",
        says="f_steady separates Odwalla from Naked",
        rule="the share of the two that one threshold assigns correctly at 20 N is above 90 %",
        basis=basis(summary, "table_2", "section_3f", "table_2"),
        verdict=within(split.interval, low=SPLITS),
        n=sample(split),
        number=f"{percent(split.mean)} ({span(split.interval)})",
    )


def grasps_of(
    summary: Summary, experiment: str, settings: Mapping[str, Any] | None = None, label: str = ""
) -> list[GraspRow]:
    """Return the rows of the grasps of a case of an experiment of kind `grasp`, of all seeds."""
    names = _case_names(summary, experiment, settings)
    return [
        row
        for name, _, result in grasp_results(summary)
        if name in names
        for row in result.rows
        if label in ("", row.label)
    ]


def _share(right: int, n: int) -> str:
    return f"{right} of {n} ({span(wilson(right, n))} %)"


def _stiction(summary: Summary) -> Claim | None:
    below = grasps_of(summary, "stiction", {FORCE: 4.0}) + grasps_of(summary, "stiction", {FORCE: 7.5})
    above = grasps_of(summary, "stiction", {FORCE: 12.0})
    if not below or not above:
        return None
    moved = sum(row.closed_m != 0.0 for row in below)
    closed = sum((row.closed_m or 0.0) > 0.01 for row in above)
    return Claim(
        id="stiction",
        says="a commanded force below static friction does not move the gripper at all",
        rule="the gap changes by an encoder tick in less than 10 % of grasps at 4 and 7.5 N, and closes in more than "
        "80 % at 12 N (static friction 8 N)",
        basis=basis(summary, "stiction", "stiction"),
        verdict=every(
            [
                within(wilson(moved, len(below)), high=1.0 - MOST_GRASPS),
                within(wilson(closed, len(above)), low=MANY_TIMES),
            ]
        ),
        n=counted(len(below) + len(above), "grasp"),
        number=f"moved in {_share(moved, len(below))} below, in {_share(closed, len(above))} above",
    )


def _one_finger_first(summary: Summary) -> Claim | None:
    rows = [row for row in grasps_of(summary, "one_finger_first") if row.lead_s is not None]
    if not rows:
        return None
    leading = [row for row in rows if row.lead_s]
    steady = sum(row.outcome == "steady" for row in leading)
    words = ""
    if leading:
        words = f"; alone for {1e3 * statistics.median(row.lead_s or 0.0 for row in leading):.0f} ms in the median"
    return Claim(
        id="one_finger_first",
        says="one fingertip may touch first; contact counts only once both do",
        rule="one pad feels the contact threshold before the other in more than 5 % of grasps, and more than 80 % of "
        "these become steady",
        basis=basis(summary, "one_finger_first", "one_finger_first"),
        verdict=every(
            [
                within(wilson(len(leading), len(rows)), low=COUNTS),
                within(wilson(steady, len(leading)), low=MANY_TIMES) if leading else UNTOLD,
            ]
        ),
        n=counted(len(rows), "grasp"),
        number=f"one pad first in {_share(len(leading), len(rows))} grasps{words}",
    )


AS_WEKA: Final = ("svm, linear, C = 1, as Weka", "network, as Weka")
"""The classifiers with the defaults of Weka, which the paper used."""
OTHER_SETTINGS: Final = ("svm, radial, C = 1", "svm, radial, C = 10", "mlp")


def _other_classifiers(summary: Summary) -> Claim | None:
    c45 = condition_result(summary, "other_classifiers", "both")
    if c45 is None:
        return None
    gaps: dict[str, MeanDifference] = {}
    names = (*AS_WEKA, *OTHER_SETTINGS)
    for name in names:
        condition = condition_result(summary, "other_classifiers", "both", classifier=name)
        gap = None if condition is None else condition.minus(c45, len(names))
        if gap is None:
            return None
        gaps[name] = gap
    return Claim(
        id="other_classifiers",
        says="support vector machines and neural networks do about as well or slightly worse than C4.5",
        rule="on class and state at once, the differences to C4.5 of the machine and the network with Weka's defaults "
        "lie between -10 and 5 points (corrected for five comparisons)",
        basis=basis(summary, "other_classifiers", "other_classifiers"),
        verdict=every([within(gaps[name].interval, -0.10, COUNTS) for name in AS_WEKA]),
        n=sample(c45.rate),
        number=", ".join(f"{name}: {_points(gap)}" for name, gap in gaps.items()),
    )


RISE_N: Final = 5.0
"""A rise of the effort after contact that counts."""


def _pure_velocity(summary: Summary) -> Claim | None:
    rows = grasps_of(summary, "controllers", {VARIANT: "velocity"})
    rows = [row for row in rows if row.effort_at_contact_n is not None]
    if not rows:
        return None
    rises = [(row.max_effort_n or 0.0) - (row.effort_at_contact_n or 0.0) for row in rows]
    raised = sum(rise > RISE_N for rise in rises)
    broken = sum(bool(row.broken) for row in rows)
    return Claim(
        id="pure_velocity",
        says="a pure velocity controller raises its effort after contact to keep its speed, and crushes the object",
        rule=f"the effort rises by more than {RISE_N:g} N after contact, and the egg breaks, each in more than 90 % of "
        "grasps",
        basis=basis(summary, "controllers", "pure_velocity"),
        verdict=every([within(wilson(k, len(rows)), low=MOST_GRASPS) for k in (raised, broken)]),
        n=counted(len(rows), "grasp"),
        number=f"effort rises by {statistics.median(rises):.0f} N in the median, by more than {RISE_N:g} N in "
        f"{_share(raised, len(rows))}; broken eggs: {_share(broken, len(rows))}",
    )


def _egg(summary: Summary) -> Claim | None:
    rows = grasps_of(summary, "controllers", {VARIANT: "hybrid"})
    if not rows:
        return None
    broken = sum(bool(row.broken) for row in rows)
    peak = statistics.median(row.true_peak_force_n for row in rows)
    return Claim(
        id="egg",
        says="the hybrid controller grasps an egg without crushing it",
        rule="the share of broken eggs at 20 N and 10 mm/s is below 10 %",
        basis=basis(summary, "controllers", "egg"),
        verdict=within(wilson(broken, len(rows)), high=1.0 - MOST_GRASPS),
        n=counted(len(rows), "grasp"),
        number=f"broken: {_share(broken, len(rows))}; median peak force {peak:.1f} N",
    )


def _egg_force(summary: Summary) -> Claim | None:
    rows = grasps_of(summary, "controllers", {VARIANT: "force"})
    if not rows:
        return None
    broken = sum(bool(row.broken) for row in rows)
    return Claim(
        id="egg_force",
        says="the pure force controller's impact can break an egg",
        rule="the share of broken eggs at 20 N is above 10 %",
        basis=basis(summary, "controllers", "egg"),
        verdict=within(wilson(broken, len(rows)), low=1.0 - MOST_GRASPS),
        n=counted(len(rows), "grasp"),
        number=f"broken: {_share(broken, len(rows))}",
    )


def curve(summary: Summary) -> list[tuple[float, float, float, float]]:
    """Return commanded effort, pad force, and raw sums of the left and right pads for each grasp, as in Fig. 4.

    The force is the maximum of the grasp, because friction holds the fingers where the squeeze left them.
    """
    points = []
    for case in summary.planned.cases:
        if not is_of(case, summary, "fig_4"):
            continue
        effort = float(case.levels[FORCE])
        for row in grasps_of(summary, "fig_4", {FORCE: case.levels[FORCE]}):
            if row.left_counts is not None and row.right_counts is not None:
                points.append((effort, row.true_peak_force_n, row.left_counts, row.right_counts))
    return sorted(points)


def _fig_5(summary: Summary) -> Claim | None:
    hard = grasps_of(summary, "fig_5", {VARIANT: "force"}, "block")
    soft = grasps_of(summary, "fig_5", {VARIANT: "force"}, "toy")
    hybrid = grasps_of(summary, "fig_5", {VARIANT: "hybrid"}, "block")
    if not hard or not soft or not hybrid:
        return None
    high = sum(row.true_peak_force_n > 2.0 * PROBING_N for row in hard)
    peaks = [statistics.median(row.true_peak_force_n for row in rows) for rows in (hard, soft, hybrid)]
    return Claim(
        id="fig_5",
        says="the pure force controller hits a rigid block with a high impact force",
        rule="the share of grasps of the block with a true peak above twice the 23 N of the effort is above 90 %",
        basis=basis(summary, "fig_5", "fig_5"),
        verdict=within(wilson(high, len(hard)), low=MOST_GRASPS),
        n=counted(len(hard), "grasp"),
        number=f"{_share(high, len(hard))}; median peaks: block {peaks[0]:.0f} N, toy {peaks[1]:.0f} N; "
        f"hybrid on the block {peaks[2]:.0f} N",
    )


def _hybrid_on_block(summary: Summary) -> list[GraspRow]:
    return grasps_of(summary, "fig_5", {VARIANT: "hybrid"}, "block") or grasps_of(
        summary, "fig_6", {VARIANT: "hybrid"}, "block"
    )


def _fig_6_force(summary: Summary) -> Claim | None:
    rows = _hybrid_on_block(summary)
    peaks = [row.measured_peak_force_n for row in rows if row.measured_peak_force_n is not None]
    if not peaks:
        return None
    over = sum(peak > PROBING_N for peak in peaks)
    true = sum(row.true_peak_force_n > PROBING_N for row in rows)
    return Claim(
        id="fig_6_force",
        says="the hybrid controller's force on a block is never above the probing force at impact (Fig. 6)",
        rule="the share of grasps in which the pads measure more than 23 N is below 10 %",
        basis=basis(summary, "fig_5", "fig_6_force"),
        verdict=within(wilson(over, len(peaks)), high=1.0 - MOST_GRASPS),
        n=counted(len(peaks), "grasp"),
        number=f"above in {_share(over, len(peaks))}; greatest {max(peaks):.1f} N; the true peak is above in {true}",
    )


def _fig_6_contact(summary: Summary) -> Claim | None:
    times = [row.contact_s for row in _hybrid_on_block(summary) if row.contact_s is not None]
    if not times:
        return None
    return _near(
        "fig_6_contact",
        "on a block at 23 N contact comes near 6 s (Fig. 6)",
        times,
        (6.0, 0.5),
        basis(summary, "fig_5", "fig_6_contact"),
    )


def _fig_6_rest(summary: Summary) -> Claim | None:
    times = [row.features.get("delta_t") for row in _hybrid_on_block(summary)]
    known = [time for time in times if time is not None]
    if not known:
        return None
    return _near(
        "fig_6_rest",
        "on a block at 23 N rest comes 0.75 s after contact (Fig. 6)",
        known,
        (0.75, 0.25),
        basis(summary, "fig_5", "fig_6_rest"),
    )


def _near(name: str, says: str, times: Sequence[float], wanted: tuple[float, float], on: Basis) -> Claim:
    """Return a claim on a time in seconds, `wanted` with its tolerance."""
    time, tolerance = wanted
    near = sum(abs(time_s - time) <= tolerance for time_s in times)
    return Claim(
        id=name,
        says=says,
        rule=f"the share of grasps within {tolerance:g} s of {time:g} s is above 90 %",
        basis=on,
        verdict=within(wilson(near, len(times)), low=MOST_GRASPS),
        n=counted(len(times), "grasp"),
        number=f"{_share(near, len(times))}; median {statistics.median(times):.2f} s",
    )
