"""The task `grasp`: grasp things and tell how each grasp went. No classifier takes part."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any, Final

import numpy as np
from attrs import evolve, field, frozen
from attrs.validators import ge

from graspsense.core.config import settings_from
from graspsense.core.contact import CONTACT_FORCE_N
from graspsense.core.errors import ConfigError
from graspsense.core.roles import BatchBackend
from graspsense.core.signals import Phase
from graspsense.core.strict import structured
from graspsense.report.grasps import grasp_as_json
from graspsense.sources.simulated import plan_trials
from graspsense.sources.trial_source import Source, groups_of

if TYPE_CHECKING:
    from graspsense.core.trace import Trace

PAD: Final = slice(7, 22)
"""The fifteen cells of the gripping face."""
BEFORE_CONTACT_S: Final = 0.1
"""How long before the contact is felt the closing speed is looked at: pads report late, and an impact ends it."""


@frozen(kw_only=True)
class Grasping:
    """The keys of `[judge]`."""

    grasps: int = field(default=1, validator=ge(0))
    """Grasps of each object whose course is kept, of the first seed."""


def grasp(params: Mapping[str, Any], seed: int) -> dict[str, Any]:
    """Return how each grasp went as JSON values: `rows`, one a grasp, and the course of some under `grasps`.

    `params` are those of `recognise`; its `learners` and `test` count for nothing. Raises ConfigError where the
    gripper is no simulated one.
    """
    judge = structured(params["judge"], Grasping, "[judge]")
    settings = settings_from(params["settings"], "the settings of the task")
    plan = plan_trials(settings, groups_of(structured(params["data"], Source, "[data]")), seed)
    backend = settings.gripper.create()
    if not isinstance(backend, BatchBackend):
        raise ConfigError(
            "experiments of kind grasp need a gripper that simulates batches, such as --gripper sim"
        )
    feature_set = settings.features.create()

    def extract(trace: Trace) -> tuple[dict[str, Any], dict[str, Any]]:
        course = grasp_as_json(trace) if params["first"] else {}
        return {**felt(trace), **feature_set.extract(trace).as_dict()}, course

    controller = settings.controller.create()
    rows: list[dict[str, Any]] = []
    kept: list[dict[str, Any]] = []
    count: Counter[str] = Counter()
    done = backend.run_many(
        controller, plan.scenes, plan.seeds, run=evolve(settings.run, seed=seed), extract=extract, workers=1
    )
    for label, one in zip(plan.labels, done, strict=True):
        extracted, course = one.extracted
        count[label] += 1
        rows.append({"label": label, "outcome": one.outcome.name.lower(), **one.report, **extracted})
        if params["first"] and count[label] <= judge.grasps:
            kept.append(
                {"label": label, "trial": len(rows) - 1, "contact_s": extracted["contact_s"], **course}
            )
    return {"source": "simulated grasps", "simulated": True, "rows": rows, "grasps": kept}


def felt(trace: Trace) -> dict[str, float | None]:
    """Return what the gripper did and felt.

    contact_s: when both pads felt it, from the beginning of the approach; lead_s: for how long one felt it alone;
    speed_m_s: how fast the fingers closed shortly before; closed_m: how far they closed in all;
    effort_at_contact_n and most_effort_n: commanded at the contact, and at the most from then on;
    left_counts, right_counts: the sums of the pads' cells when the squeeze ended over those at the beginning.
    """
    n = len(trace)
    if n == 0:
        return {}
    closing = trace.phase >= int(Phase.APPROACH)
    left, right = trace.force_left_n >= CONTACT_FORCE_N, trace.force_right_n >= CONTACT_FORCE_N
    both, either = np.flatnonzero(left & right & closing), np.flatnonzero((left | right) & closing)
    values: dict[str, float] = {"closed_m": float(trace.gap_m[0] - np.nanmin(trace.gap_m))}
    if len(both):
        k = int(both[0])
        t = float(trace.t_s[k])
        shortly = (trace.t_s >= t - BEFORE_CONTACT_S) & (trace.t_s <= t)
        values["contact_s"] = t - float(trace.t_s[0])
        values["lead_s"] = t - float(trace.t_s[int(either[0])])
        values["speed_m_s"] = float(-trace.velocity_m_s[shortly].min())
        values["effort_at_contact_n"] = float(trace.command[k])
        values["most_effort_n"] = float(np.nanmax(trace.command[k:]))
    held = np.flatnonzero(closing & (trace.phase <= int(Phase.HOLD)))
    images = np.flatnonzero(trace.pad_t_s <= trace.t_s[held[-1]]) if len(held) else held
    if len(images) > 1:
        for name, cells in (("left_counts", trace.pad_left), ("right_counts", trace.pad_right)):
            sums = cells[:, PAD].sum(axis=1)
            values[name] = float(sums[images[-1]] - sums[0])
    known = ("contact_s", "lead_s", "speed_m_s", "closed_m", "effort_at_contact_n", "most_effort_n")
    found = {name: values.get(name, math.nan) for name in (*known, "left_counts", "right_counts")}
    return {name: None if math.isnan(value) else value for name, value in found.items()}
