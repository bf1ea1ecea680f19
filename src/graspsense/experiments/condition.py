"""The condition of features: how far each moves if a parameter of a simulated grasp changes by one part in a million.

The same grasps, with the same seeds, are simulated with each parameter of gripper and object larger by 1 ppm. The
*movement* of a feature in a grasp is its largest relative change over all parameters. A feature that is read from
encoder ticks or cell images jumps where a small change shifts a threshold by a tick or an image. No accuracy of a
model makes single grasps agree to better than that; only distributions over grasps can agree.
"""

from __future__ import annotations

import math
import warnings
from collections.abc import Callable, Mapping, Sequence
from typing import Any, Final

import numpy as np
from attrs import asdict, frozen
from numpy.typing import NDArray

from graspsense.core.components.roles import BatchBackend
from graspsense.core.settings.resolved import Settings
from graspsense.core.values.errors import ConfigError
from graspsense.core.values.features import Features
from graspsense.experiments.sensors import sensors_of

PPM: Final = 1e-6
SCALES: Final[Mapping[str, float]] = {"m": 1e-3, "N": 1.0, "s": 0.05, "m/s": 1e-3, "N/s": 1.0}
"""Relative errors are relative to the reference value, or to this value of the same unit if that is larger."""
QUANTILE: Final = 0.99
"""Share of grasps in which a feature moves by at most `FeatureCondition.finest`."""
LIMIT: Final = 0.01
"""`FeatureCondition.beyond` counts grasps in which a feature moves by more than this."""


@frozen(kw_only=True)
class FeatureCondition:
    """How far one feature moves for 1 ppm of any parameter, relative to its value."""

    feature: str
    median: float
    """The movement in the median grasp."""
    finest: float
    """The movement that 99 % of grasps do not exceed: the finest accuracy that a single grasp can have."""
    beyond: float
    """The share of grasps in which it moves by more than 1 %."""
    parameter: str
    """The parameter of the largest movement."""


@frozen(kw_only=True)
class Conditions:
    """The condition of every feature over some grasps."""

    sensor: str
    scenes: tuple[str, ...]
    grasps: int
    parameters: int
    features: tuple[FeatureCondition, ...]

    def finer_than_possible(self, accuracy: float) -> tuple[FeatureCondition, ...]:
        """Return the features that cannot have this accuracy in 99 % of single grasps."""
        return tuple(feature for feature in self.features if feature.finest > accuracy)

    def as_values(self) -> dict[str, object]:
        """Return plain values, for JSON."""
        return asdict(self)


def conditions(
    settings: Settings,
    scenes: Sequence[str],
    seeds: Sequence[int],
    *,
    progress: Callable[[str, int, int], None] | None = None,
) -> Conditions:
    """Measure the condition of every feature, of one grasp of each scene with the seed in the same place.

    Raises ConfigError if the gripper has no parameters to change, UnknownName for an unknown scene.
    """
    backend = settings.gripper.create()
    grippers = backend.perturbed(scenes, PPM) if isinstance(backend, BatchBackend) else {}
    if not grippers:
        raise ConfigError(
            f"gripper {settings.gripper.component.qualified} has no parameters that can be changed: choose a simulated "
            "gripper, as in gripper.type = 'sim'"
        )
    rows = {}
    for k, (name, gripper) in enumerate(grippers.items()):
        if progress is not None:
            progress(f"condition of the features: {name or 'unchanged'}", k, len(grippers))
        rows[name] = _features(settings, gripper, scenes, seeds)
    base = rows.pop("")
    names = tuple(rows)
    movement = np.array([[_movements(a, b) for a, b in zip(base, rows[name], strict=True)] for name in names])
    return Conditions(
        sensor=sensors_of(settings.gripper),
        scenes=tuple(dict.fromkeys(scenes)),
        grasps=len(scenes),
        parameters=len(names),
        features=tuple(
            _condition(feature, movement[:, :, k], names) for k, feature in enumerate(base[0].names)
        ),
    )


def _features(
    settings: Settings, backend: BatchBackend[Any], scenes: Sequence[str], seeds: Sequence[int]
) -> list[Features]:
    extract = settings.features.create().extract
    controller = settings.controller.create()
    with warnings.catch_warnings():
        # A few grasps run in the interpreter, which needs no remark.
        warnings.simplefilter("ignore")
        done = backend.run_many(controller, scenes, seeds, run=settings.run, extract=extract)
    return [grasp.extracted for grasp in done]


def _movements(base: Features, moved: Features) -> list[float]:
    """Return the relative change of each feature; infinite where it is missing in only one of the grasps."""
    changes = []
    for base_value, moved_value, unit in zip(base.values, moved.values, base.units, strict=True):
        if math.isnan(base_value) and math.isnan(moved_value):
            changes.append(0.0)
            continue
        change = abs(moved_value - base_value) / max(abs(base_value), SCALES.get(unit, 1.0))
        changes.append(math.inf if math.isnan(change) else change)
    return changes


def _condition(feature: str, movement: NDArray[np.float64], parameters: Sequence[str]) -> FeatureCondition:
    """Return the condition of a feature from its movement, an array (parameters, grasps)."""
    largest = movement.max(axis=0)
    return FeatureCondition(
        feature=feature,
        median=float(np.median(largest)),
        finest=float(np.quantile(largest, QUANTILE, method="higher")),
        beyond=float(np.mean(largest > LIMIT)),
        parameter=parameters[int(movement.max(axis=1).argmax())],
    )
