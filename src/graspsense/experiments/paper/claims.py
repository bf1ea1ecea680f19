"""Claims in the text of the paper, each tested on the results of the experiments.

The criterion of each claim (`rule`) was written down before the experiments were run in full.
"""

from __future__ import annotations

import itertools
import statistics
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any, Final

from attrs import frozen

from graspsense.evaluation.intervals import wilson
from graspsense.evaluation.over_seeds import MeanDifference, OverSeeds
from graspsense.experiments.findings import percent, span
from graspsense.experiments.paper.rows import condition_result, is_of
from graspsense.experiments.summary import Summary
from graspsense.experiments.task_results import GraspRow, RecognitionResult

FORCE: Final = "controller.probing_force_n"
SPEED: Final = "controller.closing_speed_m_s"
VARIANT: Final = "variant"
NEGLIGIBLE: Final = 0.05
"""Differences of rates below this are negligible."""
SPLITS: Final = 0.9
VERY_EASILY: Final = 0.95
"""A feature separates two groups if one threshold assigns this share correctly, with equal weight for both groups."""


@frozen(kw_only=True)
class Claim:
    """A claim of the paper: what it says, the criterion, whether the claim holds here, and the measured figure.

    `basis` is `fitted` if the model was fitted to figures that the claim is about, otherwise `predicted`.
    """

    id: str
    says: str
    rule: str
    basis: str
    holds: bool
    number: str

    @property
    def cells(self) -> tuple[str, ...]:
        """The row of a table."""
        return (self.says, self.basis, "holds" if self.holds else "does not hold", self.number, self.rule)

    def as_json(self) -> dict[str, Any]:
        """Return the fields as JSON values."""
        return {name: getattr(self, name) for name in Claim.__annotations__}


HEADER = ("claim of the paper", "basis", "result here", "measured", "criterion")


def claims(summary: Summary) -> list[Claim]:
    """Return every claim that there are results for."""
    checks: tuple[Callable[[Summary], Claim | None], ...] = (
        _approach_velocity,
        _probing_force,
        _longest,
        _f_steady,
        _p_steady,
        _p_first,
        _f_steady_classes,
        _stiction,
        _one_finger_first,
        _other_classifiers,
        _pure_velocity,
        _egg,
        _egg_force,
        _fig_4,
        _fig_5,
        _fig_6_force,
        _fig_6_times,
    )
    return [one for one in (check(summary) for check in checks) if one is not None]


def _points(difference: MeanDifference) -> str:
    value, (low, high) = difference.value, difference.interval
    return f"{100 * value:+.1f} points ({100 * low:+.1f} to {100 * high:+.1f})"


def _approach_velocity(summary: Summary) -> Claim | None:
    slow = condition_result(summary, "approach_speed", "state", {SPEED: 0.005})
    fast = condition_result(summary, "approach_speed", "state", {SPEED: 0.02})
    gap = None if slow is None or fast is None else fast.minus(slow)
    if gap is None:
        return None
    return Claim(
        id="approach_velocity",
        says="the initial closing velocity has a negligible effect on the recognition rate",
        rule="the rates at 5 and 20 mm/s differ by less than 5 points",
        basis="predicted",
        holds=abs(gap.value) < NEGLIGIBLE,
        number=f"20 mm/s minus 5 mm/s, state of an Odwalla bottle: {_points(gap)}",
    )


def _probing_force(summary: Summary) -> Claim | None:
    weak = condition_result(summary, "table_4", "state", {FORCE: 17.0})
    strong = condition_result(summary, "table_4", "state", {FORCE: 23.0})
    gap = None if weak is None or strong is None else strong.minus(weak)
    if gap is None:
        return None
    return Claim(
        id="probing_force",
        says="a stronger probing force raises the recognition rate",
        rule="the rate at 23 N is above that at 17 N, the 95 % interval of the difference above 0",
        basis="predicted",
        holds=gap.interval[0] > 0.0,
        number=f"23 N minus 17 N: {_points(gap)}; printed: +25.0 points",
    )


def _longest(summary: Summary) -> Claim | None:
    share = _seeds_where(
        summary,
        "table_4",
        {FORCE: 20.0},
        lambda of: max(of, key=lambda s: statistics.median(of[s])) == "full_open",
        "delta_t",
    )
    if share is None:
        return None
    held, n, medians = share
    return Claim(
        id="longest",
        says="an open, full bottle is compressed for the longest time",
        rule="its median delta_t is the greatest of the four states in at least 95 % of the seeds",
        basis="fitted",
        holds=held >= 0.95 * n,
        number=f"in {held} of {n} seeds; medians {medians} s",
    )


def _seeds_where(
    summary: Summary,
    experiment: str,
    at: Mapping[str, Any],
    holds: Callable[[Mapping[str, Sequence[float]]], bool],
    feature: str,
) -> tuple[int, int, str] | None:
    """Return the number of seeds in which `holds` is True, the number of seeds, and the medians over all seeds."""
    held, n = 0, 0
    every: dict[str, list[float]] = {}
    for of in _by_label(summary, experiment, at, feature):
        states = {label.partition(":")[2]: values for label, values in of.items()}
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
    summary: Summary, experiment: str, at: Mapping[str, Any], feature: str
) -> Iterable[dict[str, list[float]]]:
    """Yield for each seed the values of a feature by label, without missing ones."""
    names = _case_names(summary, experiment, at)
    for (name, _), result in summary.results.items():
        if name in names and isinstance(result, RecognitionResult) and result.trials is not None:
            yield result.trials.by_label(feature)


def _case_names(summary: Summary, experiment: str, at: Mapping[str, Any] | None = None) -> set[str]:
    """Return the names of the cases of this experiment that differ in this."""
    return {case.name for case in summary.planned.cases if is_of(case, summary, experiment, at)}


def split_by(one: Sequence[float], other: Sequence[float]) -> float:
    """Return the largest share that one threshold assigns correctly, with equal weight for both groups."""
    values = sorted({*one, *other})
    best = 0.5
    for low, high in itertools.pairwise(values):
        cut = 0.5 * (low + high)
        share = 0.5 * (sum(v <= cut for v in one) / len(one) + sum(v > cut for v in other) / len(other))
        best = max(best, share, 1.0 - share)
    return best


def _split(
    summary: Summary, feature: str, one: Callable[[str], bool], other: Callable[[str], bool]
) -> OverSeeds | None:
    """Return how well a feature separates two groups of labels among the trials of Table II, over the seeds."""
    shares, n = [], 1
    for of in _by_label(summary, "table_2", {}, feature):
        first = [v for label, values in of.items() if one(label) for v in values]
        second = [v for label, values in of.items() if other(label) for v in values]
        if first and second:
            shares.append(split_by(first, second))
            n = len(first) + len(second)
    return OverSeeds(tuple(shares), n) if shares else None


def _f_steady(summary: Summary) -> Claim | None:
    found, by_time = (
        _split(summary, one, lambda s: s == "odwalla:empty_open", lambda s: s == "odwalla:empty_closed")
        for one in ("f_steady", "delta_t")
    )
    if found is None or by_time is None:
        return None
    return Claim(
        id="f_steady_splits",
        says="f_steady separates open and empty from closed and empty",
        rule="one threshold assigns 90 % of the two states of an Odwalla bottle at 20 N correctly",
        basis="predicted",
        holds=found.mean >= SPLITS,
        number=f"{percent(found.mean)} ({span(found.interval)}); delta_t separates {percent(by_time.mean)}",
    )


def _p_steady(summary: Summary) -> Claim | None:
    found = _split(
        summary,
        "p_steady",
        lambda s: s == "odwalla:full_closed",
        lambda s: s.startswith("odwalla:") and s != "odwalla:full_closed",
    )
    if found is None:
        return None
    return Claim(
        id="p_steady_splits",
        says="p_steady separates closed and full very easily",
        rule="one threshold separates 95 % of closed and full from the other states of an Odwalla bottle, at 20 N",
        basis="fitted",
        holds=found.mean >= VERY_EASILY,
        number=f"{percent(found.mean)} ({span(found.interval)})",
    )


def _p_first(summary: Summary) -> Claim | None:
    classes = ("odwalla", "naked", "can", "water")
    found: dict[str, OverSeeds] = {}
    for i, a in enumerate(classes):
        for b in classes[i + 1 :]:
            split = _split(summary, "p_first", _of(a), _of(b))
            if split is None:
                return None
            found[f"{a}/{b}"] = split
    alike = found.pop("odwalla/naked")
    worst = min(found, key=lambda name: found[name].mean)
    return Claim(
        id="p_first_splits",
        says="p_first separates the container classes, except Odwalla from Naked",
        rule=(
            "one threshold assigns 90 % of every pair except Odwalla and Naked correctly, and less than 90 % of "
            "that pair"
        ),
        basis="fitted",
        holds=found[worst].mean >= SPLITS > alike.mean,
        number=f"smallest of the other pairs {worst} {percent(found[worst].mean)} ({span(found[worst].interval)}); "
        f"odwalla/naked {percent(alike.mean)} ({span(alike.interval)})",
    )


def _of(name: str) -> Callable[[str], bool]:
    return lambda label: label.startswith(f"{name}:")


def _f_steady_classes(summary: Summary) -> Claim | None:
    found = _split(summary, "f_steady", _of("odwalla"), _of("naked"))
    if found is None:
        return None
    return Claim(
        id="f_steady_splits_classes",
        says="f_steady separates Odwalla from Naked",
        rule="one threshold assigns 90 % of the two correctly, at 20 N",
        basis="fitted",
        holds=found.mean >= SPLITS,
        number=f"{percent(found.mean)} ({span(found.interval)})",
    )


def grasps_of(
    summary: Summary, experiment: str, at: Mapping[str, Any] | None = None, label: str = ""
) -> list[GraspRow]:
    """Return the rows of the grasps of a case of an experiment of kind `grasp`, of all seeds."""
    names = _case_names(summary, experiment, at)
    return [
        row
        for name, _, result in summary.grasp_results()
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
        rule="the gap does not change by one encoder tick at 4 and 7.5 N, and does at 12 N (static friction 8 N)",
        basis="predicted",
        holds=moved == 0 and closed == len(above),
        number=f"moved in {_share(moved, len(below))} below, in {_share(closed, len(above))} above",
    )


def _one_finger_first(summary: Summary) -> Claim | None:
    rows = [row for row in grasps_of(summary, "one_finger_first") if row.lead_s is not None]
    if not rows:
        return None
    first = [row for row in rows if row.lead_s]
    words = ""
    if first:
        words = (
            f"; alone for {1e3 * statistics.median(row.lead_s or 0.0 for row in first):.0f} ms in the median"
        )
    return Claim(
        id="one_finger_first",
        says="one fingertip may touch first; contact counts only once both do",
        rule="one pad feels the contact threshold before the other in at least one grasp, which still becomes steady",
        basis="predicted",
        holds=bool(first) and all(row.outcome == "steady" for row in first),
        number=f"one pad first in {_share(len(first), len(rows))} grasps{words}",
    )


def _other_classifiers(summary: Summary) -> Claim | None:
    c45 = condition_result(summary, "other_classifiers", "both")
    others = {
        name: condition_result(summary, "other_classifiers", "both", classifier=name)
        for name in ("svm", "mlp")
    }
    if c45 is None:
        return None
    gaps = {}
    for name, condition in others.items():
        gap = None if condition is None else condition.minus(c45)
        if gap is None:
            return None
        gaps[name] = gap
    return Claim(
        id="other_classifiers",
        says="support vector machines and neural networks do about as well or slightly worse than C4.5",
        rule="each differs from C4.5 by less than 5 points, or is worse by less than 10, on class and state at once",
        basis="predicted",
        holds=all(-0.10 < gap.value < NEGLIGIBLE for gap in gaps.values()),
        number="; ".join(f"{name} minus c45: {_points(gap)}" for name, gap in gaps.items()),
    )


def _pure_velocity(summary: Summary) -> Claim | None:
    rows = grasps_of(summary, "controllers", {VARIANT: "velocity"})
    rows = [row for row in rows if row.effort_at_contact_n is not None]
    if not rows:
        return None
    raised = statistics.median((row.max_effort_n or 0.0) - (row.effort_at_contact_n or 0.0) for row in rows)
    broken = sum(bool(row.broken) for row in rows)
    return Claim(
        id="pure_velocity",
        says="a pure velocity controller raises its effort after contact to keep its speed, and crushes the object",
        rule="the median effort rises by more than 5 N after contact, and every egg breaks",
        basis="predicted",
        holds=raised > 5.0 and broken == len(rows),
        number=f"effort rises by {raised:.0f} N; broken eggs: {_share(broken, len(rows))}",
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
        rule="no egg breaks at 20 N and 10 mm/s",
        basis="predicted",
        holds=broken == 0,
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
        rule="at least one egg breaks at 20 N",
        basis="predicted",
        holds=broken > 0,
        number=f"broken: {_share(broken, len(rows))}",
    )


FIG_4_LINEAR: Final = 0.05


def curve(summary: Summary) -> list[tuple[float, float, float, float]]:
    """Return commanded effort, pad force, and raw sums of the left and right pads for each grasp, as in Fig. 4.

    The force is the maximum of the grasp, because friction holds the fingers where the squeeze left them.
    """
    points = []
    for case in summary.planned.cases:
        if not is_of(case, summary, "fig_4"):
            continue
        effort = float(case.at[FORCE])
        for row in grasps_of(summary, "fig_4", {FORCE: case.at[FORCE]}):
            if row.left_counts is not None and row.right_counts is not None:
                points.append((effort, row.true_peak_force_n, row.left_counts, row.right_counts))
    return sorted(points)


def _fig_4(summary: Summary) -> Claim | None:
    points = curve(summary)
    if len({effort for effort, *_ in points}) < 3:
        return None
    per_newton: dict[float, list[float]] = {}
    for effort, force, left, right in points:
        per_newton.setdefault(effort, []).append(0.5 * (left + right) / force)
    means = {effort: statistics.fmean(of) for effort, of in per_newton.items()}
    efforts = sorted(means)
    fall = 1.0 - means[efforts[-1]] / means[efforts[1]]
    return Claim(
        id="fig_4",
        says="raw sums need a table to become newtons (Fig. 4; on the robot they flatten from 50 N of effort on)",
        rule="counts per newton at the greatest effort are at least 5 % fewer than at 20 N",
        basis="predicted",
        holds=fall >= FIG_4_LINEAR,
        number=f"{means[efforts[1]]:.0f} counts per newton at {efforts[1]:g} N of effort, "
        f"{means[efforts[-1]]:.0f} at {efforts[-1]:g} N: {100 * abs(fall):.1f} % {'fewer' if fall > 0 else 'more'}",
    )


PROBING_N: Final = 23.0


def _fig_5(summary: Summary) -> Claim | None:
    hard = grasps_of(summary, "fig_5", {VARIANT: "force"}, "block")
    soft = grasps_of(summary, "fig_5", {VARIANT: "force"}, "toy")
    hybrid = grasps_of(summary, "fig_5", {VARIANT: "hybrid"}, "block")
    if not hard or not soft or not hybrid:
        return None
    peaks = [statistics.median(row.true_peak_force_n for row in rows) for rows in (hard, soft, hybrid)]
    return Claim(
        id="fig_5",
        says="the pure force controller hits a rigid block with a high impact force",
        rule="the median true peak on the block is more than twice the 23 N of the effort, and above that on the toy",
        basis="predicted",
        holds=peaks[0] > 2.0 * PROBING_N and peaks[0] > peaks[1],
        number=f"median peaks: block {peaks[0]:.0f} N, toy {peaks[1]:.0f} N; hybrid on the block {peaks[2]:.0f} N",
    )


def _hybrid_on_block(summary: Summary) -> list[GraspRow]:
    return grasps_of(summary, "fig_5", {VARIANT: "hybrid"}, "block") or grasps_of(
        summary, "fig_6", {VARIANT: "hybrid"}, "block"
    )


def _fig_6_force(summary: Summary) -> Claim | None:
    rows = _hybrid_on_block(summary)
    if not rows:
        return None
    over = sum(row.true_peak_force_n > PROBING_N for row in rows)
    most = max(row.true_peak_force_n for row in rows)
    return Claim(
        id="fig_6_force",
        says="the hybrid controller's force on a block is never above the probing force at impact (Fig. 6)",
        rule="the true peak force is at most 23 N in every grasp, over all phases of the pads' clock",
        basis="predicted",
        holds=over == 0,
        number=f"above in {_share(over, len(rows))}; greatest peak {most:.1f} N",
    )


def _fig_6_times(summary: Summary) -> Claim | None:
    rows = [row for row in _hybrid_on_block(summary) if row.features["delta_t"] is not None]
    if not rows:
        return None
    contact = statistics.median(row.contact_s or 0.0 for row in rows)
    rest = statistics.median(row.features["delta_t"] or 0.0 for row in rows)
    return Claim(
        id="fig_6_times",
        says="on a block at 23 N contact comes near 6 s and rest near 6.75 s (Fig. 6)",
        rule="median contact within 0.5 s of 6 s, and median time from contact to rest within 0.25 s of 0.75 s",
        basis="predicted",
        holds=abs(contact - 6.0) <= 0.5 and abs(rest - 0.75) <= 0.25,
        number=f"contact at {contact:.2f} s, rest {rest:.2f} s later",
    )
