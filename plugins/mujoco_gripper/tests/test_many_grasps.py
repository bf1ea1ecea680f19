"""Many grasps at once: each follows from its thing and its seed alone, whoever runs it and in whatever order."""

import pytest
from attrs import evolve

from graspsense.plugin_api import UnknownName, create
from graspsense.simulator_api import RunConfig, run_uninterrupted

HYBRID = create("controller", "hybrid", sends="velocity", closing_speed_m_s=0.15)
FEATURES = create("feature-set", "chitta")
RUN = RunConfig(hold_s=0.05)
GRASPS = [("block", 1), ("can", 1), ("block", 2), ("can#1", 3), ("egg", 1)]
GRIPPER = create("sensor-backend", "mujoco")


class Values:
    """Features and every measured force of a trace, as text that tells each bit."""

    def __call__(self, trace):
        return repr((FEATURES.extract(trace).values, trace.force_left_n.tolist(), trace.gap_m.tolist()))


def felt(grasps, controller=HYBRID, **options):
    things, seeds = zip(*grasps, strict=True)
    done = GRIPPER.run_many(controller, things, seeds, run=RUN, extract=Values(), **options)
    return [(grasped.outcome, grasped.extracted, grasped.report["greatest_force_n"]) for grasped in done]


@pytest.fixture(scope="module")
def alone():
    """Each grasp by itself."""
    return {grasp: felt([grasp])[0] for grasp in GRASPS}


@pytest.mark.slow
def test_processes_grasp_as_one_process_does_in_any_order_and_tell_their_progress(alone):
    told = []
    grasps = GRASPS[::-1]
    many = felt(grasps, workers=2, progress=lambda done, total: told.append((done, total)))
    assert many == [alone[grasp] for grasp in grasps]
    assert felt(GRASPS[2:], workers=1) == [alone[grasp] for grasp in GRASPS[2:]]
    assert len(set(map(repr, alone.values()))) == len(GRASPS)
    assert told[-1] == (len(GRASPS), len(GRASPS))
    assert told == sorted(told)


def test_a_batch_grasps_as_the_runner_does():
    (of_a_batch,) = felt(GRASPS[:1])
    grasp = run_uninterrupted(GRIPPER.with_object("block"), HYBRID, evolve(RUN, seed=1))
    assert (grasp.outcome, Values()(grasp.trace)) == of_a_batch[:2]


def test_an_unknown_thing_ends_the_batch_before_any_grasp():
    told = []
    with pytest.raises(UnknownName, match="blok"):
        felt([*GRASPS, ("blok", 1)], progress=lambda done, total: told.append(done))
    assert told == []


@pytest.mark.slow
def test_a_controller_that_other_processes_cannot_make_again_grasps_here(alone):
    class Unregistered(type(HYBRID)):
        pass

    own = Unregistered(HYBRID.config)
    assert felt(GRASPS[:2], own, workers=2) == [alone[grasp] for grasp in GRASPS[:2]]
