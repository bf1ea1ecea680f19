"""Macro-steps: one step over several ticks is accurate, has no event, and gives the values at the ticks within it."""

import math
from math import inf

import numpy as np
import pytest
from batches import run_many
from cases import every_case
from unverified import unverified_setup

from graspsense.core.components.run_config import RunConfig
from graspsense.gripper_api import gap_and_rate, revolutions_at
from graspsense.plugin_api import EFFORT, RELEASE, Command, create
from graspsense_sim_gripper.config import SimConfig
from graspsense_sim_gripper.plant.state import Contact, Motion
from graspsense_sim_gripper.run.binding import bind_reachable
from graspsense_sim_gripper.run.compiled.compose import composition, plant_move, step_parts, uncompressed
from graspsense_sim_gripper.scene.terms.registry import laws_of
from graspsense_sim_gripper.solve.macro_step import macro_step, next_ticks
from graspsense_sim_gripper.solve.scheme import PlantState, Steps
from graspsense_sim_gripper.solve.trend import UNKNOWN

CONFIG = SimConfig(sensor="ideal", spread=False)
TICK = 1e-3
EFFORT_N = 20.0
HYBRID = create("controller", "hybrid")
FORCE_STEP = type(create("controller", "force")).step
MACRO = Steps(inf, longest_s=TICK, growth=inf, macro_tolerance=3e-4)


class Plant:
    """An object of the catalogue between fingers that close under a constant effort."""

    def __init__(self, scene):
        setup = unverified_setup(CONFIG, scene, 0)
        composed = composition(setup.kinds, setup.plant)
        self.params = setup.plant._replace(steps=MACRO)
        self._macro_step = bind_reachable(macro_step, step_parts(composed))
        self._move = plant_move(laws_of(setup.kinds), converges=False, lags=False)
        self._kinds, self._setup = setup.kinds, setup

    def state(self, gap_beyond_m, speed_m_s):
        """Return fingers that are so much wider than the object, and move at this rate of the gap."""
        drive = self.params.drive
        revolutions = revolutions_at(drive.link, self.params.object.width_m + gap_beyond_m)
        gap, jacobian = gap_and_rate(drive.link, revolutions)
        return PlantState(
            Motion(revolutions, speed_m_s / jacobian, gap, jacobian),
            Contact(0.0, 0.0, 0.0, 0, uncompressed(self._kinds), ()),
        )

    def macro_step(self, state, effort_n, h, trend=UNKNOWN):
        return self._macro_step(self.params, state, effort_n, h, trend)

    def after(self, state, seconds, effort_n=EFFORT_N, step_s=1e-5):
        """Return the plant after this time, in steps of this length."""
        fine = self.params._replace(steps=Steps(inf, step_s, growth=inf))
        return self._move(fine, state, effort_n, seconds)


def squeezing(scene="toy"):
    """Return a plant 20 ms after the contact, and its state."""
    plant = Plant(scene)
    return plant, plant.after(plant.state(1e-5, -0.01), 0.02)


def speed_m_s(state):
    return state.motion.speed_rev_s * state.motion.jacobian_m_rev


@pytest.mark.parametrize("case", ["squeezing", "with damping"])
def test_with_the_trend_of_the_one_before_several_are_of_fourth_order(case):
    """The accumulated error of steps of fourth order decreases sixteen times, that of third order eight times."""
    plant, start = squeezing()
    if case == "with damping":
        # Without contact, where the damper of the drive is all that there is.
        drive = plant.params.drive
        damped = drive._replace(friction=drive.friction._replace(damping_n_s_m=2000.0))
        plant.params, start = plant.params._replace(drive=damped), plant.state(0.02, -0.01)
    expected, errors = speed_m_s(plant.after(start, 0.064)), {}
    for n in (4, 8, 16):
        for keeps in (True, False):
            state, trend = start, UNKNOWN
            for _ in range(64 // n):
                step = plant.macro_step(state, EFFORT_N, n * TICK, trend)
                state, trend = step.after, step.trend if keeps else UNKNOWN
            errors[n, keeps] = abs(speed_m_s(state) - expected)
    for n in (4, 8):
        assert 12.0 < errors[2 * n, True] / errors[n, True] < 40.0
        assert 6.0 < errors[2 * n, False] / errors[n, False] < 11.0
    assert errors[8, True] < 0.7 * errors[8, False]


@pytest.mark.slow
@every_case("scene", ["toy", "odwalla:full_open", "water:empty_closed"])
def test_a_step_that_is_taken_is_as_exact_as_its_tolerance_says(scene):
    plant, start = squeezing(scene)
    n = 32
    while not (step := plant.macro_step(start, EFFORT_N, n * TICK)).error <= 1.0:
        n = next_ticks(n, step.error, step.event_share)
    expected = plant.after(start, n * TICK)
    assert n >= 2
    assert step.after.contact.left_n == pytest.approx(expected.contact.left_n, rel=3e-4)
    assert step.after.motion.gap_m == pytest.approx(expected.motion.gap_m, abs=1e-8)


def test_fingers_that_friction_holds_stay_while_the_object_relaxes():
    plant, start = squeezing()
    revolutions, _, gap, jacobian = start.motion
    effort_n = start.contact.left_n
    held = plant.after(start._replace(motion=Motion(revolutions, 0.0, gap, jacobian)), 0.005, effort_n)
    step = plant.macro_step(held, effort_n, 32 * TICK)
    assert step.error <= 1.0
    assert step.after.motion == held.motion
    expected = plant.after(held, 32 * TICK, effort_n)
    assert expected.contact.left_n < held.contact.left_n
    assert step.after.contact.left_n == pytest.approx(expected.contact.left_n, rel=1e-4)


def states(plant_state):
    return plant_state.contact.left.states


def just_before(plant, start, effort_n, happened):
    """Return the plant at most 8 ms before this has happened."""
    for _ in range(200):
        after = plant.after(start, 0.008, effort_n, TICK)
        if happened(after):
            return start
        start = after
    raise AssertionError("it did not happen")


def test_a_step_that_would_contain_an_event_is_not_taken():
    toy, egg = Plant("toy"), Plant("egg")
    squeezed = toy.after(toy.state(1e-5, -0.01), 0.02)
    opened_m = CONFIG.open_gap_m - toy.params.object.width_m
    unbroken = egg.after(egg.state(1e-5, -0.01), 0.01, 80.0)
    cases = {
        "contact": (toy, toy.state(1e-5, -0.01), 20.0),
        "rest": (toy, just_before(toy, squeezed, 5.0, lambda now: now.motion.speed_rev_s == 0.0), 5.0),
        "parting": (toy, just_before(toy, squeezed, -20.0, lambda now: now.contact.left_n == 0.0), -20.0),
        "end of travel": (toy, toy.state(opened_m - 1e-5, 0.05), -20.0),
        "breaking": (
            egg,
            just_before(egg, unbroken, 80.0, lambda now: states(now) != states(unbroken)),
            80.0,
        ),
    }
    for what, (plant, start, effort_n) in cases.items():
        assert math.isinf(plant.macro_step(start, effort_n, 0.01).error), what


def both_ways(scene, law=None, options=None, **settings):
    """Return a grasp in steps over several ticks, and the same in single ticks."""
    return [
        run_many(SimConfig(**settings, fidelity=fidelity), law or HYBRID, [scene], [4], **options or {})[0]
        for fidelity in ("scene", "fixed")
    ]


def test_the_forces_of_a_release_are_those_of_single_ticks():
    many, single = both_ways("odwalla:full_closed", sensor="ideal")
    forces = [grasp.trace.force_left_n[grasp.trace.phase == RELEASE] for grasp in (many, single)]
    assert len(forces[0]) == len(forces[1]) > 700
    # A hundredth of what is asked for, at a tenth of the steps.
    np.testing.assert_allclose(*forces, rtol=0.0, atol=1e-4 * forces[1][0])
    assert many.state.step.n_steps < 0.1 * single.state.step.n_steps


@pytest.mark.parametrize(
    "settings",
    [{"rate_hz": 250.0}, pytest.param({"rate_hz": 4000.0, "pad_delay_s": 0.017}, marks=pytest.mark.slow)],
)
def test_images_and_outcome_are_those_of_single_ticks(settings):
    many, single = both_ways("can:empty_open", **settings)
    assert many.model.chosen.steps.macro_tolerance > 0.0
    assert many.outcome == single.outcome
    n = min(len(many.trace.pad_t_s), len(single.trace.pad_t_s)) - 10
    np.testing.assert_allclose(many.trace.pad_t_s[:n], single.trace.pad_t_s[:n], atol=1e-9)
    assert many.state.peak_n == pytest.approx(single.state.peak_n, rel=1e-3)


class Pulse(type(create("controller", "force"))):
    """A constant effort that ends as soon as the left pad reads 3 N."""

    free_motion = None

    @staticmethod
    def step(params, state, reading):
        command, state = FORCE_STEP(params, state, reading)
        effort = -20.0 if reading.frame.force_left_n > 3.0 else command.value
        return Command(EFFORT, effort, inf, inf), state


@pytest.mark.slow
@pytest.mark.parametrize("compiled", [False, pytest.param(True, marks=pytest.mark.long)])
def test_a_command_within_a_step_takes_effect_in_its_tick(compiled):
    law = Pulse(create("controller", "force").config)
    options = {"compiled": compiled, "run": RunConfig(grasp_timeout_s=3.0)}
    many, single = both_ways("toy", law, options, sensor="ideal")
    assert many.model.chosen.steps.macro_tolerance > 0.0
    pressed_from = int(np.argmax(many.trace.force_left_n > 3.0))
    assert pressed_from == int(np.argmax(single.trace.force_left_n > 3.0))
    rows = slice(pressed_from - 20, pressed_from + 20)
    np.testing.assert_allclose(many.trace.force_left_n[rows], single.trace.force_left_n[rows], rtol=1e-3)
    # The peak is one that occurred, and not that of the step as it was begun.
    assert many.state.peak_n == pytest.approx(single.state.peak_n, rel=1e-3)
