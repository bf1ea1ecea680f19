"""Training: from labelled trials to a model."""

from __future__ import annotations

import platform
from collections import Counter
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from graspsense import __version__
from graspsense.core.learn.copies import row_hashes
from graspsense.core.learn.model import Model
from graspsense.core.learn.novelty import novelty_of
from graspsense.core.values.errors import ConfigError

if TYPE_CHECKING:
    from graspsense.core.components.registry import Component
    from graspsense.core.learn.labelled import Labelled


def train(
    component: Component,
    config: Any,
    labelled: Labelled,
    *,
    name: str,
    seed: int = 0,
    target: str = "both",
    provenance: Mapping[str, Any] | None = None,
) -> Model:
    """Return the model of a classifier with this config, fitted to these trials.

    Raises ConfigError if nothing can be learned from them.
    """
    from graspsense.core.components.strict import plain

    classifier = component.create(config)
    try:
        classifier.fit(labelled.table, labelled.labels, seed)
    except ValueError as error:
        raise ConfigError(f"{component.qualified} cannot learn from {labelled.source}: {error}") from error
    settings = {key: value for key, value in plain(config).items() if key != "model"}
    return Model(
        name=name,
        component=component.qualified,
        settings=settings,
        classifier=classifier,
        names=labelled.table.names,
        units=labelled.table.units,
        target=target,
        novelty=novelty_of(labelled.table, labelled.labels),
        learned_from=() if labelled.provenance.get("simulated") else row_hashes(labelled.table),
        provenance={
            **training_provenance(labelled, seed, {component.distribution: component.version}),
            "by_label": dict(sorted(Counter(labelled.labels).items())),
            **(provenance or {}),
        },
    )


def training_provenance(labelled: Labelled, seed: int, versions: Mapping[str, str]) -> dict[str, Any]:
    """Return what a model tells of its training on these trials; `versions` are those of what it was learned with."""
    return {
        "source": labelled.source,
        "trials": len(labelled),
        "seed": seed,
        "versions": {
            "graspsense": __version__,
            **versions,
            "numpy": np.__version__,
            "python": platform.python_version(),
        },
        **labelled.provenance,
    }
