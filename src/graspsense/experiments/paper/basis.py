"""What a comparison with the paper rests on: derived from the origins of the figures of objects and gripper."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Final, Literal

from graspsense.core.setting import fitted_defaults
from graspsense.experiments.paper.cases import is_of
from graspsense.experiments.summary import Summary
from graspsense.sources.simulated import simulated_objects
from graspsense.sources.trial_source import SIMULATED, groups_of

Basis = Literal["predicted", "fitted", "built in"]
BASES: Final[tuple[Basis, ...]] = ("predicted", "fitted", "built in")


def basis(summary: Summary, experiment: str, *about: str) -> Basis:
    """Return `fitted` if a figure of an object or of the gripper of this experiment was fitted to one of these results.

    Otherwise it is `predicted`. A result that follows from the structure of the model is `built in`; claims state this.
    """
    fitted_to = {result for results in _fitted_to(summary, experiment) for result in results}
    return "fitted" if fitted_to.intersection(about) else "predicted"


def _fitted_to(summary: Summary, experiment: str) -> Iterator[frozenset[str]]:
    """Yield the results that the settings of an experiment and each of its kinds of object were fitted to.

    A setting that was changed from its default was not fitted.
    """
    for case in summary.planned.cases:
        if not is_of(case, summary, experiment):
            continue
        yield from (fitted_defaults(one.config) for one in case.settings.chosen)
        kinds = {kind.name: kind for kind in simulated_objects(case.settings)}
        for source in (case.data, case.test):
            if source is None or source.kind != SIMULATED:
                continue
            for group in groups_of(source):
                for trial in group.with_defaults(tuple(kinds.values())).planned(tuple(kinds.values())):
                    kind = kinds.get(trial.object_name.partition(":")[0])
                    if kind is not None:
                        yield kind.fitted_to
