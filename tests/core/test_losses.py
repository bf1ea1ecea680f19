"""Frames, images and samples that did not arrive are in the outcome, the counts and the report of a grasp."""

from graspsense.core.components.run_config import RunConfig
from graspsense.core.grasp.protection.losses import Losses
from graspsense.core.grasp.runner import run_grasp
from graspsense.core.values.signals import APPROACH
from graspsense.plugin_api import NO_PADS, Channel, FastChannel, Frame, Reading, TactileArray, create
from graspsense.simulator_api import CHANNELS
from graspsense.testing.model_gripper import OBJECTS, TICKS_OF_AN_IMAGE, ModelGripper

PADS = TactileArray("pads", "counts", 24.0, rows=2, columns=3)
SKIN = TactileArray("skin", "N", 24.0, rows=2, columns=2)
SHAKING = FastChannel("shaking", "m/s2", 3000.0, samples=3)
AN_IMAGE = 1 + 12 * TICKS_OF_AN_IMAGE
"""The reading, counted from 1, in which an image is new."""
NAMES = ("gap", "velocity", "effort", "force_left", "force_right")


class Lossy(ModelGripper):
    """Loses two frames, and images and samples, while it closes."""

    def __init__(self, loses=True):
        plain = (Channel(name, CHANNELS[name], 1000.0) for name in NAMES)
        super().__init__(frozenset((*plain, PADS, SKIN, SHAKING)), 0.074, OBJECTS["a hard object"][1])
        self.loses, self.k = loses, 0

    def read(self, timeout_s):
        self.k += 1
        frame, pads, signals = reading = super().read(timeout_s)
        if self.k < AN_IMAGE or not self.loses:
            return reading
        if self.k == AN_IMAGE:
            frame = frame._replace(dt_s=0.003)
        skin = signals.skin._replace(counter=signals.skin.counter + 2)
        shaking = signals.shaking._replace(counter=signals.shaking.counter + 6)
        pads = pads._replace(counter=pads.counter + 1)
        return Reading(frame, pads, signals._replace(skin=skin, shaking=shaking))


def test_losses_are_told_with_the_outcome_and_counted():
    grasp = run_grasp(Lossy(), create("controller", "hybrid"), RunConfig())
    lost = {"lost_frames": 2, "lost_pads": 1, "lost_skin": 2, "lost_shaking": 6}
    assert {name: count for name, count in grasp.counts.items() if name.startswith("lost")} == lost
    assert {name: grasp.report[name] for name in lost} == lost
    assert "2 frames" in grasp.reason
    assert "1 of pads" in grasp.reason
    assert "off by 41 ms" in grasp.reason, "an image comes each 41 ticks"
    assert grasp.outcome.words == "steady"


def test_lost_frames_are_told_with_their_share_and_end_the_grasp_from_one_half_on():
    def faults(steps_s, phase=APPROACH):
        losses = Losses(1000.0)
        frames = (Frame(0.0, dt_s, 0.05, *[0.0] * 6, 0) for dt_s in steps_s)
        return losses, [losses.see(Reading(frame, NO_PADS), phase, jumped=False) for frame in frames]

    # Two of three frames come, then one of three.
    losses, seen = faults([0.001, 0.002] * 200)
    assert {fault.ends for fault in seen if fault is not None} == {False}
    assert "33 %" in seen[-1].words
    assert losses.lost == {"frames": 200}
    assert faults([0.003] * 400)[1][-1].ends
    # Frames that only come unevenly are not lost.
    losses, seen = faults([0.0016, 0.0004] * 500)
    assert seen == [None] * 1000
    assert losses.in_words() == ""


def test_nothing_is_told_where_nothing_was_lost():
    grasp = run_grasp(Lossy(loses=False), create("controller", "hybrid"), RunConfig())
    assert grasp.reason == ""
    assert not [name for name in grasp.counts if name.startswith("lost")]
