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
from typing import Any, Final, NamedTuple

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
from graspsense_paper.grasping import GraspRow, grasp_results
from graspsense_paper.published import published
from graspsense_paper.rows import of_class, sample, with_interval
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

Condition = tuple[str, Mapping[str, Any]]
"""An experiment and the swept values of its case."""
AT_20_N: Final[Condition] = ("table_2", {})
AT_23_N: Final[Condition] = ("table_4", {FORCE: PROBING_N})
"""Section III.F describes the features at this force."""


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


HEADER = ("claim of the paper", "basis", "verdict", "measured", "n", "criterion")


class ClaimFigure(NamedTuple):
    """What the results say of a claim: the verdict, the figure, and from how many trials."""

    verdict: Verdict
    number: str
    n: str


class Share(NamedTuple):
    """In how many grasps, or seeds, something happened."""

    hits: int
    n: int

    def within(self, low: float = -math.inf, high: float = math.inf) -> Verdict:
        """Return whether the share lies within these limits."""
        return within(wilson(self.hits, self.n), low, high)

    @property
    def words(self) -> str:
        """The share with its interval."""
        return f"{self.hits} of {self.n} ({span(wilson(self.hits, self.n))} %)"

    @property
    def grasps(self) -> str:
        """The number of grasps."""
        return counted(self.n, "grasp")


Check = Callable[[Summary], ClaimFigure | None]
_CHECKED: Final[list[Callable[[Summary], Claim | None]]] = []


def _claim(
    id_: str, says: str, rule: str, experiment: str, *about: str, follows_from: tuple[str, ...] = ()
) -> Callable[[Check], Check]:
    """Declare the claim that the decorated function tests, by results of an experiment.

    `about` has the ids by which `basis` follows what the claim rests on, by default its own.
    """

    def declared(check: Check) -> Check:
        def checked(summary: Summary) -> Claim | None:
            measured = check(summary)
            if measured is None:
                return None
            on = basis(summary, experiment, *(about or (id_,)))
            return Claim(
                id=id_, says=says, rule=rule, basis=on, follows_from=follows_from, **measured._asdict()
            )

        _CHECKED.append(checked)
        return check

    return declared


def claims(summary: Summary) -> list[Claim]:
    """Return every claim that there are results for, over both protocols."""
    views = [of_protocol(summary, protocol) for protocol in PROTOCOLS]
    merged = (_merged([checked(view) for view in views]) for checked in _CHECKED)
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


def _rise(
    summary: Summary, case: tuple[str, str], values: tuple[Any, Any], words: str, **limits: float
) -> ClaimFigure | None:
    """Return whether the rate of states rises within these limits from one value of a swept setting to the other.

    `case` is the experiment and its setting. In `words` stand `{points}` for the rise, `{first}` and `{second}` for the
    rates.
    """
    weak, strong = (condition_result(summary, case[0], "state", {case[1]: value}) for value in values)
    gap = None if weak is None or strong is None else strong.minus(weak)
    if weak is None or strong is None or gap is None:
        return None
    rates = {"first": percent(weak.rate.mean), "second": percent(strong.rate.mean)}
    number = words.format(points=_points(gap.value, gap.interval), **rates)
    return ClaimFigure(within(gap.interval, **limits), number, sample(weak.rate))


def _points(value: float, interval: tuple[float, float]) -> str:
    low, high = interval
    return f"{100 * value:+.1f} points ({100 * low:+.1f} to {100 * high:+.1f})"


@_claim(
    "approach_velocity",
    "the initial closing velocity has a negligible effect on the recognition rate",
    "the difference between the rates at 5 and 20 mm/s is less than 5 points",
    "approach_speed",
)
def _approach_velocity(summary: Summary) -> ClaimFigure | None:
    words = "20 mm/s minus 5 mm/s: {points}"
    return _rise(summary, ("approach_speed", SPEED), (0.005, 0.02), words, low=-COUNTS, high=COUNTS)


@_claim(
    "probing_force",
    "a stronger probing force raises the recognition rate",
    "the rate at 23 N is at least 5 points above that at 17 N",
    "table_4",
    "authors_tree",
    follows_from=("table_4_17", "table_4_23"),
)
def _probing_force(summary: Summary) -> ClaimFigure | None:
    words = f"23 N minus 17 N: {{points}}; printed: {_printed_rise()}"
    return _rise(summary, ("table_4", FORCE), (17.0, PROBING_N), words, low=COUNTS)


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
    return _points(value, (low, high))


@_claim(
    "worn",
    "the rate decreases for bottles that were squeezed many times before",
    "other new bottles are recognised at least 5 points more often than other worn ones, trained on the same bottles",
    "worn_bottles",
    "worn_bottles",
)
def _worn(summary: Summary) -> ClaimFigure | None:
    wears = ("other worn bottles", "other new bottles")
    words = "new {second}, worn {first}, new minus worn: {points}"
    return _rise(summary, ("worn_bottles", VARIANT), wears, words, low=COUNTS)


@_claim(
    "easiest",
    "the states of the Odwalla bottle are the easiest to recognise",
    "the rate of Odwalla is at least 5 points above that of every other container (corrected for three comparisons)",
    "table_3",
    "table_3",
)
def _easiest(summary: Summary) -> ClaimFigure | None:
    condition = condition_result(summary, "table_3", "state")
    rates = [] if condition is None else [of_class(condition, name) for name in CONTAINERS]
    odwalla, *others = rates or [None]
    if odwalla is None:
        return None
    gaps = {
        name: mean_difference(odwalla.rates, other.rates, other.n, len(others))
        for name, other in zip(CONTAINERS[1:], others, strict=True)
        if other is not None and len(other.rates) == len(odwalla.rates) > 1
    }
    if len(gaps) < len(others):
        return None
    nearest = min(gaps, key=lambda name: gaps[name].value)
    number = f"Odwalla minus {nearest}, the nearest: {_points(gaps[nearest].value, gaps[nearest].interval)}"
    verdict = every([within(gap.interval, low=COUNTS) for gap in gaps.values()])
    return ClaimFigure(verdict, number, f"{sample(odwalla)} of Odwalla")


@_claim(
    "confused",
    "most confusion of containers is between Odwalla and Naked",
    "the share of wrong answers that confuse these two is above 50 %",
    "table_2",
    "table_2",
)
def _confused(summary: Summary) -> ClaimFigure | None:
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
    number = f"{with_interval(share)}; printed: 9 of 14"
    return ClaimFigure(within(share.interval, low=0.5), number, f"{n} wrong answers of {len(shares)} seeds")


@_claim(
    "longest",
    "an open, full bottle is compressed for the longest time",
    "at 23 N, the share of seeds in which its median delta_t is the greatest of the four states is above 80 %",
    "table_4",
    "authors_tree",
)
def _longest(summary: Summary) -> ClaimFigure | None:
    held = []
    times_s: dict[str, list[float]] = {}
    for by_label in _by_label(summary, AT_23_N, "delta_t"):
        medians = {label: statistics.median(values) for label, values in by_label.items()}
        held.append(max(medians, key=medians.__getitem__).partition(":")[2] == "full_open")
        for label, values in by_label.items():
            times_s.setdefault(label.partition(":")[2], []).extend(values)
    if not held:
        return None
    share = Share(sum(held), len(held))
    words = ", ".join(
        f"{state.replace('_', ' ')} {statistics.median(values):.2f}"
        for state, values in sorted(times_s.items())
    )
    number = f"in {share.hits} of {share.n} seeds ({span(wilson(share.hits, share.n))} %); medians {words} s"
    return ClaimFigure(share.within(low=MANY_TIMES), number, f"{share.n} seeds")


def _by_label(summary: Summary, condition: Condition, feature: str) -> Iterable[dict[str, list[float]]]:
    """Yield for each seed the values of a feature by label, without missing ones."""
    names = _case_names(summary, *condition)
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


def _split(summary: Summary, condition: Condition, feature: str, group: str, other: str) -> OverSeeds | None:
    """Return how well a feature separates the labels that begin with `group` from others that begin with `other`."""
    shares, n = [], 1
    for by_label in _by_label(summary, condition, feature):
        own = [v for label, values in by_label.items() if label.startswith(group) for v in values]
        beside = [
            v
            for label, values in by_label.items()
            if label.startswith(other) and not label.startswith(group)
            for v in values
        ]
        if own and beside:
            shares.append(split_by(own, beside))
            n = len(own) + len(beside)
    return OverSeeds(tuple(shares), n) if shares else None


def _separates(split: OverSeeds | None, further: str = "") -> ClaimFigure | None:
    if split is None:
        return None
    return ClaimFigure(within(split.interval, low=SPLITS), with_interval(split) + further, sample(split))


@_claim(
    "f_steady_splits",
    "f_steady separates open and empty from closed and empty",
    "the share that one threshold assigns correctly, Odwalla at 23 N, is above 90 %",
    "table_4",
    "authors_tree",
)
def _f_steady(summary: Summary) -> ClaimFigure | None:
    split, by_time = (
        _split(summary, AT_23_N, feature, "odwalla:empty_open", "odwalla:empty_closed")
        for feature in ("f_steady", "delta_t")
    )
    return None if by_time is None else _separates(split, f", by delta_t {percent(by_time.mean)}")


@_claim(
    "p_steady_splits",
    "p_steady separates closed and full very easily",
    "the share that one threshold assigns correctly, against the other Odwalla states at 23 N, is above 90 %",
    "table_4",
    "authors_tree",
)
def _p_steady(summary: Summary) -> ClaimFigure | None:
    return _separates(_split(summary, AT_23_N, "p_steady", "odwalla:full_closed", "odwalla:"))


@_claim(
    "p_first_splits",
    "p_first separates the container classes, except Odwalla from Naked",
    "the share that one threshold assigns correctly at 20 N is above 90 % for every pair except Odwalla and Naked, and "
    "below 90 % for that pair",
    "table_2",
    "section_3f",
)
def _p_first(summary: Summary) -> ClaimFigure | None:
    splits: dict[str, OverSeeds] = {}
    for group, other in itertools.combinations(CONTAINERS, 2):
        split = _split(summary, AT_20_N, "p_first", f"{group}:", f"{other}:")
        if split is None:
            return None
        splits[f"{group}/{other}"] = split
    alike = splits.pop("odwalla/naked")
    worst = min(splits, key=lambda name: splits[name].mean)
    others = [within(split.interval, low=SPLITS) for split in splits.values()]
    number = f"lowest other pair {worst} {with_interval(splits[worst])}; odwalla/naked {with_interval(alike)}"
    return ClaimFigure(every([within(alike.interval, high=SPLITS), *others]), number, sample(alike))


@_claim(
    "f_steady_splits_classes",
    "f_steady separates Odwalla from Naked",
    "the share of the two that one threshold assigns correctly at 20 N is above 90 %",
    "table_2",
    "section_3f",
    "table_2",
)
def _f_steady_classes(summary: Summary) -> ClaimFigure | None:
    return _separates(_split(summary, AT_20_N, "f_steady", "odwalla:", "naked:"))


AS_WEKA: Final = ("svm, linear, C = 1, as Weka", "network, as Weka")
"""The classifiers with the defaults of Weka, which the paper used."""
OTHER_SETTINGS: Final = ("svm, radial, C = 1", "svm, radial, C = 10", "mlp")


@_claim(
    "other_classifiers",
    "support vector machines and neural networks do about as well or slightly worse than C4.5",
    "on class and state at once, the differences from C4.5 of the machine and the network with Weka's defaults lie "
    "between -10 and 5 points (corrected for five comparisons)",
    "other_classifiers",
)
def _other_classifiers(summary: Summary) -> ClaimFigure | None:
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
    verdict = every([within(gaps[name].interval, -0.10, COUNTS) for name in AS_WEKA])
    number = ", ".join(f"{name}: {_points(gap.value, gap.interval)}" for name, gap in gaps.items())
    return ClaimFigure(verdict, number, sample(c45.rate))


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


def _share(happened: Iterable[bool]) -> Share:
    each = list(happened)
    return Share(sum(each), len(each))


@_claim(
    "stiction",
    "a commanded force below static friction does not move the gripper at all",
    "the gap changes by an encoder tick in less than 10 % of grasps at 4 and 7.5 N, and closes in more than 80 % at "
    "12 N (static friction 8 N)",
    "stiction",
)
def _stiction(summary: Summary) -> ClaimFigure | None:
    weak = [row for force_n in (4.0, 7.5) for row in grasps_of(summary, "stiction", {FORCE: force_n})]
    strong = grasps_of(summary, "stiction", {FORCE: 12.0})
    if not weak or not strong:
        return None
    moved = _share(row.closed_m != 0.0 for row in weak)
    closed = _share((row.closed_m or 0.0) > 0.01 for row in strong)
    verdict = every([moved.within(high=1.0 - MOST_GRASPS), closed.within(low=MANY_TIMES)])
    number = f"moved in {moved.words} below, in {closed.words} above"
    return ClaimFigure(verdict, number, counted(moved.n + closed.n, "grasp"))


@_claim(
    "one_finger_first",
    "one fingertip may touch first; contact counts only once both do",
    "one pad feels the contact threshold before the other in more than 5 % of grasps, and more than 80 % of these "
    "become steady",
    "one_finger_first",
)
def _one_finger_first(summary: Summary) -> ClaimFigure | None:
    rows = [row for row in grasps_of(summary, "one_finger_first") if row.lead_s is not None]
    if not rows:
        return None
    leading = [row for row in rows if row.lead_s]
    share, words, steady = Share(len(leading), len(rows)), "", UNTOLD
    if leading:
        words = f"; alone for {1e3 * statistics.median(row.lead_s or 0.0 for row in leading):.0f} ms in the median"
        steady = _share(row.outcome == "steady" for row in leading).within(low=MANY_TIMES)
    number = f"one pad first in {share.words} grasps{words}"
    return ClaimFigure(every([share.within(low=COUNTS), steady]), number, share.grasps)


RISE_N: Final = 5.0
"""A rise of the effort after contact that counts."""


@_claim(
    "pure_velocity",
    "a pure velocity controller raises its effort after contact to keep its speed, and crushes the object",
    f"the effort rises by more than {RISE_N:g} N after contact, and the egg breaks, each in more than 90 % of grasps",
    "controllers",
)
def _pure_velocity(summary: Summary) -> ClaimFigure | None:
    rows = grasps_of(summary, "controllers", {VARIANT: "velocity"})
    rows = [row for row in rows if row.effort_at_contact_n is not None]
    if not rows:
        return None
    rises = [(row.max_effort_n or 0.0) - (row.effort_at_contact_n or 0.0) for row in rows]
    raised, broken = _share(rise > RISE_N for rise in rises), _share(row.broken for row in rows)
    number = (
        f"effort rises by {statistics.median(rises):.0f} N in the median, by more than {RISE_N:g} N in {raised.words}; "
        f"broken eggs: {broken.words}"
    )
    verdict = every([share.within(low=MOST_GRASPS) for share in (raised, broken)])
    return ClaimFigure(verdict, number, raised.grasps)


@_claim(
    "egg",
    "the hybrid controller grasps an egg without crushing it",
    "the share of broken eggs at 20 N and 10 mm/s is below 10 %",
    "controllers",
)
def _egg(summary: Summary) -> ClaimFigure | None:
    if not (rows := grasps_of(summary, "controllers", {VARIANT: "hybrid"})):
        return None
    broken = _share(row.broken for row in rows)
    peak = statistics.median(row.true_peak_force_n for row in rows)
    number = f"broken: {broken.words}; median peak force {peak:.1f} N"
    return ClaimFigure(broken.within(high=1.0 - MOST_GRASPS), number, broken.grasps)


@_claim(
    "egg_force",
    "the pure force controller's impact can break an egg",
    "the share of broken eggs at 20 N is above 10 %",
    "controllers",
    "egg",
)
def _egg_force(summary: Summary) -> ClaimFigure | None:
    if not (rows := grasps_of(summary, "controllers", {VARIANT: "force"})):
        return None
    broken = _share(row.broken for row in rows)
    return ClaimFigure(broken.within(low=1.0 - MOST_GRASPS), f"broken: {broken.words}", broken.grasps)


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


@_claim(
    "fig_5",
    "the pure force controller hits a rigid block with a high impact force",
    "the share of grasps of the block with a true peak above twice the 23 N of the effort is above 90 %",
    "fig_5",
)
def _fig_5(summary: Summary) -> ClaimFigure | None:
    grasps = [
        [row.true_peak_force_n for row in grasps_of(summary, "fig_5", {VARIANT: control}, label)]
        for control, label in (("force", "block"), ("force", "toy"), ("hybrid", "block"))
    ]
    if not all(grasps):
        return None
    high = _share(peak_n > 2.0 * PROBING_N for peak_n in grasps[0])
    hard, soft, hybrid = map(statistics.median, grasps)
    number = f"{high.words}; median peaks: block {hard:.0f} N, toy {soft:.0f} N; hybrid on the block {hybrid:.0f} N"
    return ClaimFigure(high.within(low=MOST_GRASPS), number, high.grasps)


def _hybrid_on_block(summary: Summary) -> list[GraspRow]:
    return grasps_of(summary, "fig_5", {VARIANT: "hybrid"}, "block") or grasps_of(
        summary, "fig_6", {VARIANT: "hybrid"}, "block"
    )


@_claim(
    "fig_6_force",
    "the hybrid controller's force on a block is never above the probing force at impact (Fig. 6)",
    "the share of grasps in which the pads measure more than 23 N is below 10 %",
    "fig_5",
)
def _fig_6_force(summary: Summary) -> ClaimFigure | None:
    rows = _hybrid_on_block(summary)
    peaks = [row.measured_peak_force_n for row in rows if row.measured_peak_force_n is not None]
    if not peaks:
        return None
    over = _share(peak > PROBING_N for peak in peaks)
    true = sum(row.true_peak_force_n > PROBING_N for row in rows)
    number = f"above in {over.words}; greatest {max(peaks):.1f} N; the true peak is above in {true}"
    return ClaimFigure(over.within(high=1.0 - MOST_GRASPS), number, over.grasps)


@_claim(
    "fig_6_contact",
    "on a block at 23 N contact comes near 6 s (Fig. 6)",
    "the share of grasps within 0.5 s of 6 s is above 90 %",
    "fig_5",
)
def _fig_6_contact(summary: Summary) -> ClaimFigure | None:
    return _near([row.contact_s for row in _hybrid_on_block(summary)], 6.0, 0.5)


@_claim(
    "fig_6_rest",
    "on a block at 23 N rest comes 0.75 s after contact (Fig. 6)",
    "the share of grasps within 0.25 s of 0.75 s is above 90 %",
    "fig_5",
)
def _fig_6_rest(summary: Summary) -> ClaimFigure | None:
    return _near([row.features.get("delta_t") for row in _hybrid_on_block(summary)], 0.75, 0.25)


def _near(times: Sequence[float | None], printed_s: float, tolerance_s: float) -> ClaimFigure | None:
    """Return whether the times that are known are near a printed one."""
    known = [time_s for time_s in times if time_s is not None]
    if not known:
        return None
    near = _share(abs(time_s - printed_s) <= tolerance_s for time_s in known)
    number = f"{near.words}; median {statistics.median(known):.2f} s"
    return ClaimFigure(near.within(low=MOST_GRASPS), number, near.grasps)
