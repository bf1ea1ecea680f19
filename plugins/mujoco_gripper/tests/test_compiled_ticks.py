"""Compiled ticks give the grasp of the interpreter, bit for bit; where they know less, the interpreter runs it."""

from __future__ import annotations

from functools import cache
from typing import ClassVar

import numpy as np
import pytest
from attrs import evolve, fields
from cases import every_case

from graspsense.core.grasp.runner import run_grasp
from graspsense.gripper_api import Outcome
from graspsense.plugin_api import Trace, create
from graspsense.simulator_api import RunConfig, run_uninterrupted
from graspsense_mujoco_gripper import backend, prepared, ticks
from graspsense_mujoco_gripper.backend import MujocoGripper
from graspsense_mujoco_gripper.config import MujocoConfig
from graspsense_mujoco_gripper.prepared import Batch

pytest.importorskip("numba")

MANY = 10_000
FAST = create("controller", "hybrid", sends="velocity", closing_speed_m_s=0.15)
HARD = create("controller", "hybrid", sends="velocity", closing_speed_m_s=0.15, probing_force_n=40.0)
EFFORT = create("controller", "hybrid", closing_speed_m_s=0.1)
RUN = RunConfig(hold_s=0.05, seed=3)


def grasp(controller, run=RUN, grasps=MANY, **settings):
    """Return a grasp, and how many of its ticks were run by compiled code."""
    at_once = []

    class Counted(MujocoGripper):
        def free_ticks(self, *arguments):
            done = super().free_ticks(*arguments)
            at_once.append(0 if done is None else done.n_ticks)
            return done

    gripper = Counted(MujocoConfig(**settings))
    gripper.join(Batch(grasps, {}))
    return run_uninterrupted(gripper, controller, run), sum(at_once)


def told(done):
    """Return all that a grasp tells, with each bit of its numbers."""
    columns = [field.name for field in fields(Trace) if field.name not in ("units", "signals", "events")]
    trace = [getattr(done.trace, name) for name in columns]
    assert all(isinstance(column, np.ndarray) for column in trace)
    words = done.outcome, done.reason, done.report, done.counts, done.events, done.trace.events, done.warnings
    return [column.tobytes() for column in trace], words, done.seconds_simulated


@cache
def plain_grasp():
    """Return the grasp of a block in the interpreter."""
    return grasp(FAST, grasps=1)[0]


def test_the_runner_and_compiled_ticks_give_one_grasp():
    compiled, many = grasp(FAST)
    assert told(compiled) == told(plain_grasp())
    assert many > 0.9 * compiled.counts["ticks"]


@pytest.mark.slow
@every_case(
    ("controller", "run", "settings", "broken"),
    [
        (FAST, RUN, {"object": "ball", "force_noise_n": 0.0, "gap_step_m": 0.0}, False),
        (HARD, RUN, {"object": "egg"}, True),
        (EFFORT, RUN, {"object": "can"}, False),
        (FAST, evolve(RUN, grasp_timeout_s=0.2, opening_timeout_s=0.1), {"object": "block"}, False),
        (FAST, RUN, {"object": "none", "rate_hz": 250.0}, False),
    ],
)
def test_they_give_one_grasp_of_every_thing_and_ending(controller, run, settings, broken):
    plain, none = grasp(controller, run, grasps=1, **settings)
    compiled, many = grasp(controller, run, **settings)
    assert told(compiled) == told(plain)
    assert none == 0
    assert many > 0.9 * plain.counts["ticks"]
    assert compiled.report["broken"] is broken


def test_a_warning_of_mujoco_ends_compiled_ticks_as_it_ends_the_interpreter(tmp_path, monkeypatch):
    # A part on a spring that pushes it away: from 1e-30 m its distance grows to a bad one within the grasp.
    wild = tmp_path / "wild.xml"
    wild.write_text(
        '<mujoco><worldbody><body name="wild" gravcomp="1"><freejoint/><geom type="box" size="0.02 0.02 0.02" '
        'mass="0.1"/><body><joint name="j" type="slide" stiffness="-100"/><geom size="0.001" mass="1e-3" '
        'contype="0" conaffinity="0"/></body></body></worldbody></mujoco>'
    )
    begin = MujocoGripper._begin

    def begun(gripper, *arguments):
        begin(gripper, *arguments)
        gripper._data.qpos[-1] = 1e-30

    monkeypatch.setattr(MujocoGripper, "_begin", begun)
    plain, _ = grasp(FAST, grasps=1, object=str(wild))
    compiled, at_once = grasp(FAST, object=str(wild))
    assert plain.outcome == Outcome.DEVICE_LOST
    assert at_once > 100
    assert told(compiled) == told(plain)


@pytest.mark.slow
@pytest.mark.parametrize("thing", ["placed", "tugged"])
def test_a_scene_with_a_motion_is_left_to_the_interpreter(thing):
    short = evolve(RUN, grasp_timeout_s=0.1, opening_timeout_s=0.1)
    plain, _ = grasp(FAST, short, grasps=1, object=thing)
    same, at_once = grasp(FAST, short, object=thing)
    assert at_once == 0
    assert told(same) == told(plain)


def worded(params, state, reading):
    assert repr(reading).startswith("Reading")
    return STEP(params, state, reading)


STEP = type(FAST).step


class Worded(type(FAST)):
    step = staticmethod(worded)


class Reflecting(type(FAST)):
    looked: ClassVar[list[str]] = []

    @staticmethod
    def step(params, state, reading):
        Reflecting.looked.append(type(reading).__name__)
        return STEP(params, state, reading)


# Slow: numba reads all of the loop before it finds what it cannot compile.
@pytest.mark.slow
@pytest.mark.parametrize("kind", [Worded, Reflecting])
def test_a_controller_that_cannot_be_compiled_runs_in_the_interpreter(kind):
    done, at_once = grasp(kind(FAST.config))
    assert at_once == 0
    assert told(done) == told(plain_grasp())


@pytest.mark.slow
def test_steps_with_many_contacts_for_the_memory_run_in_the_interpreter(monkeypatch):
    # MuJoCo ends a process where it lacks memory, unless Python has called it.
    monkeypatch.setattr(backend, "AMPLE", 1000)
    plain = plain_grasp()
    done, at_once = grasp(FAST)
    assert 100 < at_once < 0.6 * plain.counts["ticks"]
    assert told(done) == told(plain)


@pytest.mark.slow
def test_sinks_see_the_frames_and_commands_of_compiled_ticks():
    seen = []

    class Sink:
        def take(self, reading, phase, command):
            seen[-1].append((repr(reading), phase, repr(command)))

    for grasps in (1, MANY):
        gripper = MujocoGripper(MujocoConfig())
        gripper.join(Batch(grasps, {}))
        seen.append([])
        run_grasp(gripper, FAST, RUN, sinks=[Sink()])
    assert seen[0] == seen[1]


@pytest.mark.slow
def test_a_batch_prepares_each_thing_once_and_grasps_as_one_by_one(monkeypatch):
    things, seeds = ["block", "can", "block"], [1, 2, 3]
    options = {"run": RUN, "traces": True, "workers": 1}
    alone = [
        MujocoGripper(MujocoConfig()).run_many(FAST, [thing], [seed], **options)[0]
        for thing, seed in zip(things, seeds, strict=True)
    ]
    prepare, made = prepared.prepare, []
    monkeypatch.setattr(prepared, "prepare", lambda *given: made.append(given[0].object) or prepare(*given))
    monkeypatch.setattr(ticks, "WORTH_LOADING", len(things))
    monkeypatch.setattr(ticks, "WORTH_COMPILING", len(things))
    batch = MujocoGripper(MujocoConfig()).run_many(FAST, things, seeds, **options)
    assert made == ["block", "can"]
    for grasped, other in zip(batch, alone, strict=True):
        assert grasped.report == other.report
        assert grasped.trace.force_left_n.tobytes() == other.trace.force_left_n.tobytes()


def test_few_grasps_are_not_compiled():
    assert ticks.compiled_ticks(STEP, ticks.WORTH_LOADING - 1) is None
