"""Compiled ticks give the grasp of the interpreter, bit for bit; where they know less, the interpreter runs it."""

from __future__ import annotations

from typing import ClassVar

import numpy as np
import pytest
from attrs import evolve, fields

from graspsense.core.grasp.runner import run_grasp
from graspsense.plugin_api import Command, Trace, create
from graspsense.simulator_api import RunConfig, run_uninterrupted
from graspsense_mujoco_gripper import ticks
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


@pytest.mark.parametrize(
    ("controller", "run", "settings"),
    [
        (FAST, RUN, {"object": "block"}),
        (FAST, RUN, {"object": "ball", "force_noise_n": 0.0, "gap_step_m": 0.0}),
        (HARD, RUN, {"object": "egg"}),
        (EFFORT, RUN, {"object": "can"}),
        (FAST, evolve(RUN, grasp_timeout_s=0.2, opening_timeout_s=0.1), {"object": "block"}),
        (FAST, RUN, {"object": "none", "rate_hz": 250.0}),
    ],
    ids=["rigid", "exact sensors", "shell breaks", "efforts", "overdue", "nothing there"],
)
def test_the_runner_and_compiled_ticks_give_one_grasp(controller, run, settings):
    plain, none = grasp(controller, run, grasps=1, **settings)
    compiled, many = grasp(controller, run, **settings)
    assert told(compiled) == told(plain)
    assert none == 0
    assert many > 0.9 * plain.counts["ticks"]


def test_the_shell_of_an_egg_breaks_in_compiled_ticks():
    done, _ = grasp(HARD, object="egg")
    assert done.report["broken"]


def test_a_warning_of_mujoco_ends_compiled_ticks_as_it_ends_the_interpreter(monkeypatch):
    opened = MujocoGripper._begin

    def light(gripper, model, *arguments):
        # So light a thing is thrown out of the model within some steps.
        model.opt.gravity[:] = 0.0, 0.0, 1e9
        opened(gripper, model, *arguments)

    monkeypatch.setattr(MujocoGripper, "_begin", light)
    plain, _ = grasp(FAST, grasps=1)
    compiled, _ = grasp(FAST)
    assert "unstable" in plain.reason
    assert told(compiled) == told(plain)


@pytest.mark.parametrize("thing", ["placed", "tugged"])
def test_a_scene_with_a_motion_is_left_to_the_interpreter(thing):
    short = evolve(RUN, grasp_timeout_s=0.1, opening_timeout_s=0.1)
    plain, _ = grasp(FAST, short, grasps=1, object=thing)
    same, at_once = grasp(FAST, short, object=thing)
    assert at_once == 0
    assert told(same) == told(plain)


def test_a_controller_that_cannot_be_compiled_runs_in_the_interpreter():
    class Reflecting(type(FAST)):
        looked: ClassVar[list[str]] = []

        @staticmethod
        def step(params, state, reading):
            Reflecting.looked.append(type(reading).__name__)
            return STEP(params, state, reading)

    plain, _ = grasp(FAST, grasps=1)
    done, at_once = grasp(Reflecting(FAST.config))
    assert at_once == 0
    assert told(done) == told(plain)


STEP = type(FAST).step


def test_a_limit_that_changes_from_tick_to_tick_is_recorded_for_sinks():
    commands = []

    class Sink:
        def take(self, reading, phase, command):
            commands.append(command)

    seen = []
    for grasps in (1, MANY):
        gripper = MujocoGripper(MujocoConfig())
        gripper.join(Batch(grasps, {}))
        run_grasp(gripper, FAST, RUN, sinks=[Sink()])
        seen.append(list(commands))
        commands.clear()
    assert seen[0] == seen[1]
    assert all(type(command) is Command and type(command.kind) is int for command in seen[1])


def test_few_grasps_are_not_compiled():
    assert ticks.compiled_ticks(STEP, ticks.WORTH_LOADING - 1) is None
