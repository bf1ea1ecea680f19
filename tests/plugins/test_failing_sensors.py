"""Grippers without pads whose sensors fail in a grasp: the fault is named, and the fingers are open at the end."""

from math import nan

import pytest
from cases import every_case

from graspsense import load_pipeline
from graspsense.core.grasp.runner import run_grasp
from graspsense.core.values.signals import Outcome

GRIPPERS = {"robotiq": "port", "so101": "port", "franka": "host"}
MOVES_S = 1.5
"""A time at which the fingers of each of them approach."""


def grasped(pipeline, fault=None, from_s=0.0):
    """Return a grasp with an emulated gripper, and its features.

    From a time on, `fault(frame, start)` says what its frames have in place of what was measured; `start` is the frame
    of this time.
    """
    settings = load_pipeline(pipeline, options=[f"gripper.{GRIPPERS[pipeline]}=emulated"]).settings
    gripper, faulty = settings.gripper.create(), []
    sound = gripper.read

    def read(timeout_s):
        reading = sound(timeout_s)
        frame = reading.frame
        if fault is None or frame.t_s < from_s:
            return reading
        faulty.append(frame)
        return reading._replace(frame=frame._replace(**fault(frame, faulty[0])))

    gripper.read = read
    grasp = run_grasp(gripper, settings.controller.create(), settings.run)
    return grasp, settings.features.create().extract(grasp.trace)


SERVOS, ALL = ("robotiq", "so101"), ("robotiq", "so101", "franka")


def half(frame, start):
    return {"gap_m": start.gap_m + 0.5 * (frame.gap_m - start.gap_m)}


def half_the_time(frame, start):
    return {"t_s": start.t_s + 0.5 * (frame.t_s - start.t_s), "dt_s": 0.5 * frame.dt_s}


@pytest.mark.slow
@every_case(
    ("pipelines", "fault", "from_s", "names"),
    [
        (ALL, None, 0.0, set()),
        (ALL, lambda frame, start: {"gap_m": 0.0}, 0.0, {"fingers not open"}),
        (ALL, lambda frame, start: {"gap_m": nan}, 0.0, {"fingers not open"}),
        (ALL, lambda frame, start: {"gap_m": 0.0}, MOVES_S, {"gap jumps"}),
        (ALL, lambda frame, start: {"gap_m": frame.gap_m - 0.02}, 0.0, {"opened to another width"}),
        # While the fingers still open: too little for another width.
        (SERVOS, lambda frame, start: {"gap_m": frame.gap_m - 0.0042}, 0.05, {"gap jumps"}),
        (ALL, half, 0.0, {"gap and velocity disagree"}),
        (ALL, half_the_time, 0.0, {"clock slow"}),
        (SERVOS, lambda frame, start: {"effort_n": nan}, MOVES_S, {"effort absent"}),
        (("robotiq",), lambda frame, start: {"effort_n": 60.0}, MOVES_S, {"effort stuck"}),
        (("so101",), lambda frame, start: {"effort_n": 60.0}, MOVES_S, {"motor too strong"}),
        (SERVOS, lambda frame, start: {"effort_n": start.effort_n}, MOVES_S, {"effort stuck"}),
        (SERVOS, lambda frame, start: {"effort_n": -frame.effort_n}, MOVES_S, {"effort has the wrong sign"}),
    ],
)
def test_a_sensor_that_fails_is_named_and_a_sound_gripper_not_accused(pipelines, fault, from_s, names):
    for pipeline in pipelines:
        grasp, features = grasped(pipeline, fault, from_s)
        assert {warning.split(":")[0] for warning in grasp.warnings} == names, pipeline
        assert names or (grasp.outcome, features.reasons) == (Outcome.STEADY, {})


@pytest.mark.slow
@every_case("pipeline", SERVOS)
def test_half_the_scale_of_the_effort_gives_no_wrong_contact(pipeline):
    _, features = grasped(pipeline, lambda frame, start: {"effort_n": 0.5 * frame.effort_n})
    assert set(features.reasons) == {"p_first", "delta_t", "dp_dt"}
