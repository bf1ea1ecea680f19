"""The answer to an experiment's question in a sentence, with its interval."""

from __future__ import annotations

from collections.abc import Sequence

from graspsense.experiments.summary import Arm, Summary


def answer(summary: Summary) -> str:
    """Return what came out in a sentence or two, which follow from the numbers alone."""
    if not summary.arms:
        return "No task has a result yet: there is no answer."
    target = summary.arms[0].target
    arms = [one for one in summary.arms if one.target == target]
    told = {
        "both": "what it is and in what state",
        "class": "what it is",
        "state": "the state of a known thing",
    }[arms[0].tells]
    seeds = len(arms[0].judged)
    over = f", over {seeds} seeds" if seeds > 1 else ""
    kind = "simulated grasps" if arms[0].simulated else "recorded grasps"
    if len(arms) == 1:
        only = arms[0]
        return f"{_begun(only.name)} tells {told} in {_rate(only)} of {only.rate.n} {kind}{over}."
    best = max(arms, key=lambda one: one.rate.mean)
    text = f"{_begun(best.name)} does best: it tells {told} in {_rate(best)} of {best.rate.n} {kind}{over}."
    ends = _ends(arms)
    if ends is not None:
        low, high = ends
        change = high.less(low)
        if change is not None:
            return f"{text} From {low.name} to {high.name} the rate changes by {_points(*change)}."
    if len({one.rate.mean for one in arms}) == 1:
        return (
            f"All {len(arms)} cases do alike: {told} is told in {_rate(best)} of {best.rate.n} {kind}{over}."
        )
    worst = min(arms, key=lambda one: one.rate.mean)
    gap = best.less(worst)
    if gap is None:
        overlap = worst.rate.interval[1] >= best.rate.interval[0]
        sure = ": the intervals overlap, so this may be chance" if overlap else ""
        return f"{text} {_begun(worst.name)} does worst, {_rate(worst)}{sure}."
    return f"{text} {_begun(worst.name)} does worst: {_rate(worst)}; the difference is {_points(*gap)}."


def _ends(arms: Sequence[Arm]) -> tuple[Arm, Arm] | None:
    """Return the arms of the least and the largest of one swept number, where they differ in nothing else."""
    if len({arm.learner for arm in arms}) > 1 or len(arms[0].case.at) != 1:
        return None
    key = next(iter(arms[0].case.at))
    if not all(type(arm.case.at.get(key)) in (int, float) for arm in arms):
        return None
    ordered = sorted(arms, key=lambda arm: float(arm.case.at[key]))
    return ordered[0], ordered[-1]


def _points(value: float, interval: tuple[float, float]) -> str:
    low, high = interval
    chance = "" if low > 0 or high < 0 else ", which may be chance"
    text = f"{100 * value:+.1f} percentage points (95 %: {100 * low:+.1f} to {100 * high:+.1f}){chance}"
    return text.replace("-", "−")


def _begun(name: str) -> str:
    """Return a name as a sentence begins with it."""
    return name[:1].upper() + name[1:] if " " in name else name


def _rate(arm: Arm) -> str:
    low, high = arm.rate.interval
    return f"{100 * arm.rate.mean:.1f} % (95 %: {100 * low:.1f} to {100 * high:.1f})"
