"""The task `trade`: as `recognise`, with what each case costs."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, Literal

from attrs import asdict, field, frozen

from graspsense.core.errors import ConfigError
from graspsense.core.strict import structured
from graspsense.experiments.recognise import Judging, recognise


@frozen(kw_only=True, slots=False)
class Cost:
    """What a rate is set against."""

    cost: str = "seconds"
    """A key of the settings, as `controller.probing_force_n`, or `seconds`: of a grasp, from the open gripper on."""
    cheap: Literal["low", "high"] = "low"
    """Whether a low or a high value is the cheap one."""
    axis: str = "seconds of a grasp"
    """How it is called."""


@frozen(kw_only=True)
class TradeJudging(Judging, Cost):
    """The keys of `[judge]`: those of `recognise`, and the cost."""


@frozen(kw_only=True)
class CostOnly(Cost):
    """The keys of `[judge]` of tasks that judge by themselves."""

    targets: tuple[Literal["both", "class", "state"], ...] = field(default=("state",))


def trade(params: Mapping[str, Any], seed: int) -> dict[str, Any]:
    """Return what `recognise` does, with the cost of each rate. Raises ConfigError for a cost that is no key."""
    judge = structured(params["judge"], TradeJudging, "[judge]")
    own = asdict(judge)
    for key in asdict(Cost()):
        del own[key]
    result = recognise({**params, "judge": own}, seed)
    cost = seconds(params["settings"], result) if judge.cost == "seconds" else _setting(params, judge.cost)
    for one in result["judged"]:
        one["cost"] = cost
    return result


def _setting(params: Mapping[str, Any], key: str) -> float:
    table, _, name = key.partition(".")
    try:
        return float(params["settings"][table][name])
    except (KeyError, TypeError, ValueError):
        raise ConfigError(
            f"judge.cost = {key!r} is no number among the settings of this experiment"
        ) from None


def seconds(settings: Mapping[str, Any], result: Mapping[str, Any]) -> float:
    """Return how long a grasp takes on average: the way to the contact at the closing speed, and to rest."""
    names = [str(one[0]) for one in result["features"]]
    first, rest = names.index("p_first"), names.index("delta_t")
    open_m = float(settings["gripper"]["open_gap_m"])
    speed_m_s = float(settings["controller"]["closing_speed_m_s"])
    rows: Sequence[Sequence[float | None]] = result["values"]
    pairs = [(row[first], row[rest]) for row in rows]
    whole = [(open_m - p) / speed_m_s + t for p, t in pairs if p is not None and t is not None]
    if not whole:
        raise ConfigError("no grasp became steady, so that none has a time")
    return sum(whole) / len(whole)
