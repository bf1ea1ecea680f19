"""The task `grasp`: grasp objects and report how each grasp went. No classifier takes part."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Mapping
from typing import Any, Final

import numpy as np
from attrs import evolve, field, frozen
from attrs.validators import ge, le

from graspsense.experiment_api import (
    MOST_KEPT_GRASPS,
    GraspCurve,
    Summary,
    TrialSource,
    grasp_curve,
    groups_of,
    plan_trials,
    settings_from,
    structured,
)
from graspsense.gripper_api import Phase
from graspsense.plugin_api import CONTACT_FORCE_N, ConfigError, Trace
from graspsense.simulator_api import BatchBackend

PAD: Final = slice(7, 22)
"""The fifteen cells of the gripping face."""
BEFORE_CONTACT_S: Final = 0.1
"""The closing speed is taken in this time before contact: pads report late, and the impact slows the fingers."""


@frozen(kw_only=True)
class GraspRow:
    """How one grasp went. A quantity is None if it is not defined, for example without contact.

    `contact_s` is the time of contact of both pads from the start of the approach; `lead_s` how long one pad touched
    before the other; `speed_m_s` the closing speed shortly before contact; `closed_m` how far the fingers closed;
    `effort_at_contact_n` and `max_effort_n` the commanded effort at contact, and its maximum from then on;
    `left_counts` and `right_counts` the increase of the summed pad cells from the start to the end of the squeeze.
    """

    label: str
    outcome: str
    contact_s: float | None = None
    lead_s: float | None = None
    speed_m_s: float | None = None
    closed_m: float | None = None
    effort_at_contact_n: float | None = None
    max_effort_n: float | None = None
    left_counts: float | None = None
    right_counts: float | None = None
    measured_peak_force_n: float | None = None
    """The largest reported mean of the two pad forces."""
    true_peak_force_n: float = 0.0
    """The peak force in the model, which the pads may miss."""
    broken: bool = False
    """Whether the model of the object broke."""
    features: Mapping[str, float | None] = field(factory=dict)


@frozen(kw_only=True)
class GraspResult:
    """The result of a task of kind `grasp`."""

    source: str
    simulated: bool
    rows: tuple[GraspRow, ...]
    grasps: tuple[GraspCurve, ...] = ()


def grasp_results(summary: Summary) -> list[tuple[str, int, GraspResult]]:
    """Return case, seed and result of every task of kind `grasp`."""
    return [
        (case, seed, result)
        for (case, seed), result in summary.results.items()
        if isinstance(result, GraspResult)
    ]


@frozen(kw_only=True)
class GraspSettings:
    """The keys of `[judge]`."""

    grasps: int = field(default=1, validator=[ge(0), le(MOST_KEPT_GRASPS)])
    """Grasps of each object whose curve is kept, from the first seed."""


def grasp(params: Mapping[str, Any], seed: int) -> GraspResult:
    """Return how each grasp went, and the curves of some.

    `params` are those of `recognise`; its `learners` and `test` are not used. Raises ConfigError if the gripper is not
    simulated.
    """
    wanted = structured(params["judge"], GraspSettings, "[judge]").grasps if params["first"] else 0
    settings = settings_from(params["settings"], "the settings of the task")
    plan = plan_trials(settings, groups_of(structured(params["data"], TrialSource, "[data]")), seed)
    backend = settings.gripper.create()
    if not isinstance(backend, BatchBackend):
        raise ConfigError(
            "experiments of kind grasp need a gripper that simulates batches, such as gripper.type = 'sim'"
        )
    feature_set = settings.features.create()
    backend.expect_features(feature_set)

    def extract(trace: Trace) -> tuple[dict[str, float], Mapping[str, float | None], GraspCurve | None]:
        curve = grasp_curve(trace, "", 0) if wanted else None
        return measures(trace), feature_set.extract(trace).as_dict(), curve

    run = evolve(settings.run, seed=seed)
    controller = settings.controller.create()
    grasps = backend.run_many(controller, plan.scenes, plan.seeds, run=run, extract=extract, workers=1)
    rows: list[GraspRow] = []
    curves: list[GraspCurve] = []
    count: Counter[str] = Counter()
    for number, (label, grasped) in enumerate(zip(plan.labels, grasps, strict=True)):
        measured, features, curve = grasped.extracted
        rows.append(
            GraspRow(
                label=label,
                outcome=grasped.outcome.name.lower(),
                true_peak_force_n=float(grasped.report.get("true_peak_force_n", 0.0)),
                broken=bool(grasped.report.get("broken", False)),
                features=features,
                **measured,
            )
        )
        count[label] += 1
        if curve is not None and count[label] <= wanted:
            curves.append(evolve(curve, label=label, trial=number))
    return GraspResult(source="simulated grasps", simulated=True, rows=tuple(rows), grasps=tuple(curves))


def measures(trace: Trace) -> dict[str, float]:
    """Return the measured quantities of a `GraspRow` that are defined for this trace."""
    if len(trace) == 0:
        return {}
    closing = trace.phase >= int(Phase.APPROACH)
    values = {"closed_m": float(trace.gap_m[0] - np.nanmin(trace.gap_m)), **_at_contact(trace, closing)}
    held = np.flatnonzero(closing & (trace.phase <= int(Phase.HOLD)))
    if len(held):
        felt = 0.5 * (trace.force_left_n + trace.force_right_n)[held]
        values["measured_peak_force_n"] = float(np.nanmax(felt)) if not np.isnan(felt).all() else math.nan
    images = np.flatnonzero(trace.pad_t_s <= trace.t_s[held[-1]]) if len(held) else held
    if len(images) > 1:
        for name, cells in (("left_counts", trace.pad_left), ("right_counts", trace.pad_right)):
            sums = cells[:, PAD].sum(axis=1)
            values[name] = float(sums[images[-1]] - sums[0])
    return {name: value for name, value in values.items() if value == value}


def _at_contact(trace: Trace, closing: Any) -> dict[str, float]:
    """Return the quantities at the first contact of both pads; nothing without contact."""
    left, right = trace.force_left_n >= CONTACT_FORCE_N, trace.force_right_n >= CONTACT_FORCE_N
    both, either = np.flatnonzero(left & right & closing), np.flatnonzero((left | right) & closing)
    if not len(both):
        return {}
    k = int(both[0])
    t = float(trace.t_s[k])
    approach = (trace.t_s >= t - BEFORE_CONTACT_S) & (trace.t_s <= t)
    return {
        "contact_s": t - float(trace.t_s[0]),
        "lead_s": t - float(trace.t_s[int(either[0])]),
        "speed_m_s": float(-trace.velocity_m_s[approach].min()),
        "effort_at_contact_n": float(trace.command[k]),
        "max_effort_n": float(np.nanmax(trace.command[k:])),
    }
