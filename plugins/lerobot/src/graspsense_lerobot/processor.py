"""graspsense as a step of a LeRobot processor: what it knows of the grasp becomes part of the observation.

LeRobot, which needs PyTorch, is imported when the class of the step is asked for.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import cache
from typing import Any, Final

from graspsense.plugin_api import PluginUnavailable
from graspsense_lerobot.place import folder_and_options
from graspsense_lerobot.running import FollowedGrasp, Running

ADDED: Final = tuple(f"graspsense.{name}" for name in Running._fields)
"""What the step adds to an observation, a number each."""


@cache
def processor_step() -> Any:
    """Return the class of the step, which LeRobot then knows as `graspsense`. Raises PluginUnavailable without LeRobot.

    `processor_step()(pipeline, options, reading)` makes a step: a pipeline by name or file, whose features and model
    are used, options as after `-o`, and how the observations are read, written as behind the folder of a data set:
    `"gap_m_per_unit=0.0008&fps=30"`. Without `fps` the time is that of the clock.
    """
    try:
        from lerobot.configs.types import FeatureType, PipelineFeatureType, PolicyFeature
        from lerobot.processor import ObservationProcessorStep, ProcessorStepRegistry
    except ImportError as error:
        raise PluginUnavailable(
            f"a step of a LeRobot processor needs LeRobot: {error}\n  try: pip install lerobot (it brings PyTorch)"
        ) from error

    @ProcessorStepRegistry.register("graspsense")
    class GraspsenseStep(ObservationProcessorStep):  # type: ignore[misc]
        """Adds phase, event, outcome, prediction and its certainty to each observation."""

        def __init__(self, pipeline: str = "default", options: Sequence[str] = (), reading: str = "") -> None:
            self._given = {"pipeline": pipeline, "options": list(options), "reading": reading}
            self.grasp = FollowedGrasp(pipeline, options, folder_and_options(f"?{reading}")[1])

        def observation(self, observation: dict[str, Any]) -> dict[str, Any]:
            """Return the observation with what is known of the grasp after it."""
            known = self.grasp.add(_numbers(observation))
            return {**observation, **dict(zip(ADDED, map(float, known), strict=True))}

        def get_config(self) -> dict[str, Any]:
            """Return the arguments with which the step was made."""
            return dict(self._given)

        def reset(self) -> None:
            """Begin anew, as at the beginning of an episode."""
            self.grasp.reset()

        def transform_features(self, features: Mapping[Any, Mapping[str, Any]]) -> dict[Any, dict[str, Any]]:
            """Return the features with those that the step adds."""
            every = {kind: dict(named) for kind, named in features.items()}
            added = {name: PolicyFeature(type=FeatureType.STATE, shape=(1,)) for name in ADDED}
            every.setdefault(PipelineFeatureType.OBSERVATION, {}).update(added)
            return every

    return GraspsenseStep


def _numbers(observation: Mapping[str, Any]) -> dict[str, float]:
    """Return the single numbers of an observation, of whatever type."""
    return {
        name: float(value)
        for name, value in observation.items()
        if isinstance(value, int | float) or getattr(value, "shape", None) == ()
    }
