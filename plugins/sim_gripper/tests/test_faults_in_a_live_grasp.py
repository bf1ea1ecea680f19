"""Simulated fingers that are treated like real ones: what a fault of a pad does to the answer."""

from math import inf

import pytest
from attrs import evolve
from cases import every_case
from grippers import settings_with

from graspsense.core.components.registry import installed
from graspsense.core.pipeline.pipeline import grasp_with
from graspsense.core.values.errors import DeviceLost
from graspsense_sim_gripper.config import SimConfig
from graspsense_sim_gripper.run.backend import SimBackend


class LiveFingers(SimBackend):
    """The simulated gripper as one that can hurt something, with this scale of its left pad; it is lost at a time."""

    scale, lost_s = 1.0, inf

    def open(self, seed):
        return evolve(super().open(seed), harmless=False)

    def read(self, timeout_s):
        reading = super().read(timeout_s)
        if reading.frame.t_s > self.lost_s:
            raise DeviceLost("unplugged")
        left_n = self.scale * reading.frame.force_left_n
        return reading._replace(frame=reading.frame._replace(force_left_n=left_n))


@pytest.mark.slow
@every_case(
    ("scale", "lost_s", "warned", "certain"),
    [(1.0, inf, (), True), (0.5, inf, ("pads disagree",), False), (1.0, 3.6, (), False)],
)
def test_a_pad_of_half_the_scale_or_a_lost_gripper_leaves_no_certainty_to_any_answer(
    scale, lost_s, warned, certain
):
    """The fingers touch after 3.1 s, and rest from 3.4 s on."""

    def create():
        fingers = LiveFingers(SimConfig())
        fingers.scale, fingers.lost_s = scale, lost_s
        return fingers

    trial = grasp_with(settings_with(create, classifier="c45"), installed())
    assert tuple(warning.split(":")[0] for warning in trial.warnings) == warned
    answers = [trial.prediction, *(early.prediction for early in trial.checkpoints)]
    assert len(answers) > 1
    assert {answer.certainty is not None or bool(answer.prediction_set) for answer in answers} == {certain}
