"""Simulated fingers that are treated like real ones: what a fault of a pad does to the answer."""

from attrs import evolve
from cases import every_case
from grippers import settings_with

from graspsense.core.components.registry import installed
from graspsense.core.pipeline.pipeline import grasp_with
from graspsense_sim_gripper.config import SimConfig
from graspsense_sim_gripper.run.backend import SimBackend


class LiveFingers(SimBackend):
    """The simulated gripper as one that can hurt something, with this scale of its left pad."""

    scale = 1.0

    def open(self, seed):
        return evolve(super().open(seed), harmless=False)

    def read(self, timeout_s):
        reading = super().read(timeout_s)
        left_n = self.scale * reading.frame.force_left_n
        return reading._replace(frame=reading.frame._replace(force_left_n=left_n))


@every_case(("scale", "warned"), [(1.0, ()), (0.5, ("pads disagree",))])
def test_a_pad_of_half_the_scale_is_told_and_leaves_no_certainty_to_any_answer(scale, warned):
    def create():
        fingers = LiveFingers(SimConfig())
        fingers.scale = scale
        return fingers

    trial = grasp_with(settings_with(create, classifier="c45"), installed())
    assert tuple(warning.split(":")[0] for warning in trial.warnings) == warned
    answers = [trial.prediction, *(early.prediction for early in trial.checkpoints)]
    assert len(answers) > 1
    certain = {answer.certainty is not None or bool(answer.prediction_set) for answer in answers}
    assert certain == ({False} if warned else {True})
