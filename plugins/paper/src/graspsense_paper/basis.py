"""What a comparison with the paper rests on: derived from what the figures of objects and gripper declare."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Final, Literal

from graspsense.experiment_api import (
    SIMULATED,
    ExperimentCase,
    Summary,
    fitted_defaults,
    groups_of,
    simulated_objects,
)
from graspsense.plugin_api import ObjectKind
from graspsense.simulator_api import given_claims
from graspsense_paper.cases import is_of

Basis = Literal["predicted", "fitted", "built in"]
BASES: Final[tuple[Basis, ...]] = ("predicted", "fitted", "built in")


def basis(summary: Summary, experiment: str, *about: str) -> Basis:
    """Return what results of an experiment rest on, where `about` has the ids of these results or of the claim.

    `built in` if a figure of an object or of the gripper gives the claim by itself; otherwise `fitted` if one was
    fitted to one of the results; otherwise `predicted`. A setting that was changed from its default was not fitted.
    """
    given: set[str] = set()
    fitted_to: set[str] = set()
    for case in summary.planned.cases:
        if not is_of(case, summary, experiment):
            continue
        for component in case.settings.chosen:
            given |= given_claims(component.config)
            fitted_to |= fitted_defaults(component.config)
        for kind in _grasped(case):
            given |= kind.gives
            fitted_to |= kind.fitted_to
    if given.intersection(about):
        return "built in"
    return "fitted" if fitted_to.intersection(about) else "predicted"


def _grasped(case: ExperimentCase) -> Iterator[ObjectKind]:
    """Yield the kind of each simulated trial of a case."""
    kinds = {kind.name: kind for kind in simulated_objects(case.settings)}
    for source in (case.data, case.test):
        if source is None or source.kind != SIMULATED:
            continue
        for group in groups_of(source):
            for trial in group.with_defaults(tuple(kinds.values())).planned(tuple(kinds.values())):
                kind = kinds.get(trial.object_name.partition(":")[0])
                if kind is not None:
                    yield kind
