"""What the simulator of an experiment saves by its choice of models."""

from __future__ import annotations

from graspsense.core.roles import BatchBackend
from graspsense.experiments.experiment import Planned
from graspsense.sources.simulated import plan_trials
from graspsense.sources.trial_source import groups_of


def savings_of(planned: Planned) -> str:
    """Return in words what is saved in the grasps of the first simulated case; empty if there is none.

    Raises ConfigError as reading the data of the case does.
    """
    for case in planned.cases:
        backend = case.settings.gripper.create()
        if case.data.source != "simulated" or not isinstance(backend, BatchBackend):
            continue
        plan = plan_trials(case.settings, groups_of(case.data), planned.seeds[0])
        backend.expect_features(case.settings.features.create())
        return backend.savings(case.settings.controller.create(), plan.scenes, plan.seeds, case.settings.run)
    return ""
