"""The task `early`: how much of a grasp it takes. Features of the trace until some time after the contact."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np
from attrs import field, frozen

from graspsense.core.features import Features, table_of
from graspsense.core.signals import Phase
from graspsense.core.strict import structured
from graspsense.experiments.trade.costs import CostOnly
from graspsense.experiments.trade.judging import (
    STRATIFIED,
    aimed,
    answers,
    dealt,
    entry,
    learners_of,
    settings_of,
)
from graspsense.sources.simulated import simulated
from graspsense.sources.trial_source import Source, groups_of

if TYPE_CHECKING:
    from graspsense.core.trace import Trace


@frozen(kw_only=True)
class Early(CostOnly):
    """The keys of `[judge]`."""

    moments_s: tuple[float, ...] = field(default=(0.0, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.8, 1.2))
    """Seconds after the contact of both pads at which an answer is asked for."""


def early(params: Mapping[str, Any], seed: int) -> dict[str, Any]:
    """Return the rate at each moment, learned and judged on what is known until then.

    Before rest all features but p_first are missing, which C4.5 has a rule for; it is the fingers' rest that brings
    them. The cost is the mean time from the contact to the answer, or to rest where that comes first.
    """
    judge = structured(params["judge"], Early, "[judge]")
    settings = settings_of(params)
    feature_set = settings.features.create()
    rows: dict[float, list[Features]] = {moment: [] for moment in judge.moments_s}
    used: dict[float, list[float]] = {moment: [] for moment in judge.moments_s}

    def cut(number: int, label: str, trace: Trace) -> None:
        del number, label
        squeezed = np.flatnonzero(trace.phase >= int(Phase.SQUEEZE))
        ended = np.flatnonzero(trace.phase >= int(Phase.HOLD))
        contact = float(trace.t_s[squeezed[0]]) if len(squeezed) else float(trace.t_s[-1])
        end = float(trace.t_s[ended[0]]) if len(ended) else float(trace.t_s[-1])
        for moment in judge.moments_s:
            rows[moment].append(feature_set.extract(trace.until(contact + moment)))
            used[moment].append(min(moment, end - contact))

    data = simulated(
        settings,
        groups=groups_of(structured(params["data"], Source, "[data]")),
        seed=seed,
        on_trace=cut,
    )
    judged = []
    for name, learner in learners_of(params).items():
        for target in judge.targets:
            folds = dealt(data.labels, target, seed)
            for moment, of in rows.items():
                given = answers(learner, table_of(of), data.labels, target, folds, seed)
                cost = float(np.mean(used[moment]))
                called = f"{moment:g} s" + (f", {name}" if len(params["learners"]) > 1 else "")
                judged.append(
                    entry(called, target, aimed(data.labels, target), given, STRATIFIED, cost, x=moment)
                )
    return {"source": data.source, "simulated": True, "notes": list(data.notes), "judged": judged}
