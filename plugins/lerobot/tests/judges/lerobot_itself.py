"""LeRobot's own loader reads the data sets that graspsense wrote, and its pipeline runs and restores the step.

    python plugins/lerobot/tests/judges/lerobot_itself.py DATA_SET...

with LeRobot 0.4.4 (`.ci/lerobot_itself`).
"""

import sys
import tempfile
from pathlib import Path

import torch

# A torchvision built for CUDA brings no operators to a machine without it; LeRobot calls none of them here, and needs
# their names to be imported.
OPERATORS = torch.library.Library("torchvision", "FRAGMENT")
for operator in ("nms", "qnms", "deform_conv2d", "roi_align", "roi_pool", "ps_roi_align", "ps_roi_pool"):
    for name in (operator, f"_{operator}_backward"):
        if not hasattr(torch.ops.torchvision, name):
            OPERATORS.define(f"{name}(Tensor a) -> Tensor")

from lerobot.datasets.lerobot_dataset import LeRobotDataset  # noqa: E402
from lerobot.processor import RobotProcessorPipeline  # noqa: E402
from lerobot.processor.converters import observation_to_transition, transition_to_observation  # noqa: E402

sys.path.insert(0, str(Path(__file__).parents[1]))
from test_lerobot_step import OPTIONS, READING, events, grasp  # noqa: E402

from graspsense_lerobot.processor import processor_step  # noqa: E402


def loads(place: str) -> None:
    data = LeRobotDataset("local/written", root=place)
    frames = [data[k] for k in range(len(data))]
    assert data.num_episodes == 4, data.num_episodes
    assert len(frames) == data.num_frames > 0
    assert {"observation.state", "graspsense.phase", "graspsense.event", "graspsense.prediction"} <= {
        *frames[0]
    }
    assert len({frame["task"] for frame in frames}) > 1
    sys.stdout.write(
        f"{place}: {data.num_episodes} episodes, {data.num_frames} frames read by LeRobot itself\n"
    )


def step_runs() -> None:
    converters = {"to_transition": observation_to_transition, "to_output": transition_to_observation}
    pipeline = RobotProcessorPipeline(steps=[processor_step()("default", OPTIONS, READING)], **converters)
    assert events([pipeline(observation) for observation in grasp()]) == ["contact", "rest", "end"]
    with tempfile.TemporaryDirectory() as folder:
        pipeline.save_pretrained(folder)
        (config,) = Path(folder).glob("*.json")
        again = RobotProcessorPipeline.from_pretrained(folder, config_filename=config.name, **converters)
    assert events([again(observation) for observation in grasp()]) == ["contact", "rest", "end"]
    sys.stdout.write("the step runs in LeRobot's pipeline, and is restored from what it saves\n")


if __name__ == "__main__":
    for place in sys.argv[1:]:
        loads(place)
    step_runs()
