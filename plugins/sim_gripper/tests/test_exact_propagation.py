"""Propagation by the matrix exponential, against time steps, other integrators, closed forms and conservation laws."""

import math

import numpy as np
import pytest
from attrs import evolve
from linear_scenes import (
    ELASTIC,
    FREE,
    FRICTION,
    LIQUID,
    LOSS,
    MAXWELL,
    QUICK,
    RIGID,
    SCENES,
    SURFACE,
    object_of,
)
from scipy.integrate import solve_ivp
from simulation_scene import CONFIG as PEERS

from graspsense.core.runner import RunConfig, run_grasp
from graspsense.plugin_api import create
from graspsense_sim_gripper.backend import SimBackend
from graspsense_sim_gripper.batch import run_many
from graspsense_sim_gripper.build import unverified_setup
from graspsense_sim_gripper.compiled.compose import plant_move
from graspsense_sim_gripper.exact.discretise import discretise
from graspsense_sim_gripper.exact.propagate import bind_move
from graspsense_sim_gripper.terms.registry import laws_of


def ready(config, spec, *, exact=True, on_arrays=False):
    """Return the function that advances the plant by a tick, its parameters, and the setup."""
    setup = unverified_setup(config, spec, 0)
    move, params = plant_move(laws_of(setup.kinds)), setup.plant
    if exact:
        result = discretise(config, setup, on_arrays=on_arrays)
        assert result is not None
        params, shape = result
        move = bind_move(setup.kinds, shape, move)
    return move, params, setup


def along(config, spec, efforts, *, exact=True, speed_m_s=0.0):
    """Return closure, force and closing speed at each tick under these efforts, and the last state."""
    move, params, setup = ready(config, spec, exact=exact)
    motion = setup.state.motion
    motion = motion._replace(speed_rev_s=-speed_m_s / motion.jacobian_m_rev)
    state = setup.state._replace(motion=motion)
    rows = []
    for effort in efforts:
        state = move(params, state, effort, setup.dt_s)
        speed = -state.motion.speed_rev_s * state.motion.jacobian_m_rev
        rows.append((setup.plant.object.width_m - state.motion.gap_m, state.contact.left_n, speed))
    return *np.array(rows).T, state


def squeeze_and_let_go(ticks):
    """Yield efforts that press, swing, let go and press again."""
    for i in range(ticks):
        x = i / ticks
        swings = 25.0 + 12.0 * math.sin(0.05 * i)
        yield 25.0 if x < 0.35 else swings if x < 0.5 else 10.0 if x < 0.6 else -12.0 if x < 0.75 else 30.0


# ------------------------------------------------------------------------------------- against time steps


@pytest.mark.parametrize(
    "name", [pytest.param(name, marks=() if name in QUICK else pytest.mark.slow) for name in SCENES]
)
def test_it_agrees_with_time_steps_of_a_tight_tolerance(name):
    change, spec = SCENES[name]
    config = evolve(FRICTION, **change)
    efforts = list(squeeze_and_let_go(1200))
    closure, force, _, state = along(config, spec, efforts, speed_m_s=0.02)
    fine = evolve(config, accuracy=1e-4)
    closure1, force1, _, state1 = along(fine, spec, efforts, exact=False, speed_m_s=0.02)
    if name != "nothing":
        assert force.max() > 5.0
        assert (force == 0.0).any()
    np.testing.assert_allclose(closure, closure1, atol=5e-7)
    np.testing.assert_allclose(force, force1, atol=1e-3 * max(force.max(), 1.0))
    assert state.peak_n == pytest.approx(state1.peak_n, rel=2e-4)
    assert state.contact.touched == state1.contact.touched
    assert state.step.unresolved == 0


def test_a_released_object_recovers_while_the_fingers_stand_fully_open():
    config = evolve(FRICTION, pad_creep_n_m=2e4, pad_creep_s=2.0)
    spec = object_of(("maxwell", {"k_n_m": 3e3, "tau_s": 0.8}), ("elastic", {"k1_n_m": 5e3}))
    efforts = [25.0] * 400 + [-30.0] * 1200
    states = [along(config, spec, efforts, exact=exact, speed_m_s=0.02)[-1] for exact in (True, False)]
    state, by_steps = states
    open_rev = ready(config, spec)[2].plant.drive.open_rev
    assert (state.motion.revolutions, state.motion.speed_rev_s, state.contact.touched) == (open_rev, 0.0, 1)
    assert by_steps.motion.revolutions == open_rev
    # It still is on its way, after a second.
    assert abs(state.contact.left.compression_m) > 1e-6
    for name in ("compression_m", "pad_m"):
        assert getattr(state.contact.left, name) == pytest.approx(
            getattr(by_steps.contact.left, name), rel=5e-3
        )
    # And where it is closed again it meets the object where that then is.
    again = [
        along(config, spec, [*efforts, *[30.0] * 900], exact=exact, speed_m_s=0.02)[1]
        for exact in (True, False)
    ]
    assert again[0][-1] > 10.0
    np.testing.assert_allclose(*again, atol=5e-3 * again[1].max())


def test_an_opening_effort_brakes_fingers_that_close_from_fully_open():
    efforts = [-5.0] * 20
    closure, _, speed, _ = along(FRICTION, object_of(ELASTIC), efforts, speed_m_s=0.02)
    assert speed[-1] == pytest.approx(0.02 - (7.0 + 5.0 + 10.0 * 0.0188) / 100.0 * 0.02, rel=1e-4)
    closure1, _, _, _ = along(
        evolve(FRICTION, accuracy=1e-4), object_of(ELASTIC), efforts, exact=False, speed_m_s=0.02
    )
    np.testing.assert_allclose(closure, closure1, atol=1e-9)


@pytest.mark.parametrize("pads", [True, False])
def test_it_agrees_with_an_ode_solver_while_sliding_and_stuck(pads):
    """A shell, a Maxwell branch and a liquid column, as a differential equation of their own."""
    spec = object_of(ELASTIC, MAXWELL, LIQUID)
    config = evolve(FRICTION, open_gap_m=0.0501, **({} if pads else RIGID))
    _, force, speed, _ = along(config, spec, [25.0] * 600, speed_m_s=0.02)
    stuck = int(np.argmax(speed == 0.0))
    assert 50 < stuck < 500
    assert np.all(speed[stuck:] == 0.0)
    skins = 0.5 * config.pad_stiffness_n_m if pads else 0.0
    k, (k_m, tau) = 1e4, (3e3, 0.05)
    mass, weight, damping = 1e3 * 0.03 * 1e-6 / 3e-4, 1e3 * 9.80665 * 1e-6 / 3e-4, None
    damping = 8.0 * math.pi * 1e-3 * 0.03 * (1e-6 / 3e-4) / 3e-4
    wall = 1e-6 / 1e-9

    def compression(c, q, y):
        return (skins * c - q + wall * y) / (skins + k + wall) if pads else c

    def own(d, q, y):
        return k * d + q + wall * (d - y)

    def side(t, s):
        c, v, q, y, w = s
        d = compression(c, q, y)
        n = own(d, q, y)
        # Of the balance, differentiated; q' = k_m d' - q / tau.
        rate = (skins * v + q / tau + wall * w) / (skins + k + wall + k_m) if pads else v
        speeding = (25.0 - 7.0 - 1.5 * n - 10.0 * v) / 100.0 if v > 0.0 else 0.0
        return [v, speeding, k_m * rate - q / tau, w, (wall * (d - y) - weight * y - damping * w) / mass]

    def stops(t, s):
        return s[1]

    stops.terminal, stops.direction = True, -1.0
    start = [-1e-4, 0.02, 0.0, 0.0, 0.0]
    # Free to the contact: a mass under a constant force.
    pushed, b = 18.0 / 100.0, 10.0 / 100.0

    def free(t, s):
        return [s[1], pushed - b * s[1]]

    def touches(t, s):
        return s[0]

    touches.terminal = True
    begun = solve_ivp(free, (0.0, 0.1), start[:2], "DOP853", events=touches, rtol=1e-11, atol=1e-15)
    at, (_, v) = begun.t[-1], begun.y[:, -1]
    slid = solve_ivp(
        side,
        (at, 0.6),
        [0.0, v, 0.0, 0.0, 0.0],
        "DOP853",
        events=stops,
        rtol=1e-11,
        atol=1e-14,
        dense_output=True,
    )
    end, last = slid.t[-1], slid.y[:, -1].copy()
    last[1] = 0.0
    stood = solve_ivp(side, (end, 0.6), last, "DOP853", rtol=1e-11, atol=1e-14, dense_output=True)
    times = 1e-3 * np.arange(1, 601)
    later = times > at
    s = np.where(times <= end, slid.sol(times), stood.sol(times))
    expected = own(compression(s[0], s[2], s[3]), s[2], s[3])
    assert stuck == int(np.argmax(times >= end))
    np.testing.assert_allclose(force[later], expected[later], rtol=1e-7, atol=1e-6)


# ------------------------------------------------------------------------------------- closed forms


@pytest.mark.parametrize("stiffness", [1e3, 1e5, 1e9])
def test_a_damped_oscillator_after_the_contact(stiffness):
    config = evolve(FRICTION, **FREE, **RIGID, damping_n_s_m=200.0, open_gap_m=0.05001)
    times = 1e-3 * np.arange(1, 61)
    _, force, _, state = along(
        config, object_of(("elastic", {"k1_n_m": stiffness})), [0.0] * 60, speed_m_s=0.01
    )
    a = 1.0
    # The way to the contact, 10 um, under the drive's damper; then half a swing.
    came = 1e-5
    at = -math.log(1.0 - came * 2.0 * a / 0.01) / (2.0 * a)
    v = 0.01 - 2.0 * a * came
    w = math.sqrt(stiffness / 100.0 - a * a)
    t = times - at
    exact = np.where((t > 0.0) & (w * t < math.pi), stiffness * v / w * np.exp(-a * t) * np.sin(w * t), 0.0)
    np.testing.assert_allclose(force, exact, rtol=1e-6, atol=1e-7 * stiffness * v / w)
    top = math.atan2(w, a) / w
    peak = stiffness * v / w * math.exp(-a * top) * math.sin(w * top)
    if w * 0.06 > math.pi:
        assert state.peak_n == pytest.approx(peak, rel=1e-3)


def test_it_slides_the_distance_of_its_kinetic_energy_over_friction_and_stops():
    config = evolve(FRICTION, load_friction_coefficient=0.0, damping_n_s_m=0.0, open_gap_m=0.08)
    closure, _, speed, _ = along(config, object_of(ELASTIC), [0.0] * 600, speed_m_s=0.03)
    # v^2 m / (2 c), and exactly no further.
    assert closure[-1] - (0.05 - 0.08) == pytest.approx(0.03**2 * 100.0 / (2.0 * 7.0), rel=1e-9)
    stands = int(np.argmax(speed == 0.0))
    assert stands == math.ceil(0.03 * 100.0 / 7.0 / 1e-3) - 1
    assert np.all(closure[stands:] == closure[-1])


def test_below_breakaway_the_fingers_do_not_creep():
    spec = object_of(ELASTIC, MAXWELL)
    move, params, setup = ready(FRICTION, spec)
    motion = setup.state.motion
    motion = motion._replace(speed_rev_s=-0.02 / motion.jacobian_m_rev)
    state = setup.state._replace(motion=motion)
    for _ in range(500):
        state = move(params, state, 25.0, 1e-3)
    assert state.motion.speed_rev_s == 0.0
    before = state
    setup = evolve(setup, dt_s=1e3)
    params, shape = discretise(FRICTION, setup)
    move = bind_move(setup.kinds, shape, plant_move(laws_of(setup.kinds)))
    for _ in range(1000):
        state = move(params, state, 25.0, 1e3)
    # The branch relaxes, and friction holds the fingers.
    assert (state.motion.gap_m, state.motion.revolutions) == (before.motion.gap_m, before.motion.revolutions)
    assert state.motion.speed_rev_s == 0.0
    pads = 0.5 * FRICTION.pad_stiffness_n_m
    assert state.contact.left_n == pytest.approx(
        (0.05 - state.motion.gap_m) / (1.0 / pads + 1.0 / 1e4), rel=1e-9
    )


def test_stick_and_slip_follow_a_relaxing_branch_to_the_limit_of_friction():
    """A branch relaxes while the effort of the drive rises slowly: the fingers stick and slip until nothing moves."""
    spec = object_of(ELASTIC, ("maxwell", {"k_n_m": 1e4, "tau_s": 0.2}))
    config = evolve(FRICTION, load_friction_coefficient=0.0, moving_mass_kg=1.0, drive_lag_s=0.1)
    closure, force, speed, state = along(config, spec, [60.0] * 8000, speed_m_s=0.02)
    assert force[-1] == pytest.approx(60.0 - 7.0, rel=1e-6)
    assert closure[-1] == pytest.approx(53.0 / (0.5 * FRICTION.pad_stiffness_n_m) + 53.0 / 1e4, rel=1e-6)
    assert (speed == 0.0).any()
    assert state.step.unresolved == 0


# ------------------------------------------------------------------------------------- energy, stiffness


@pytest.mark.parametrize(
    ("change", "terms"),
    [
        (RIGID, (ELASTIC, MAXWELL)),
        ({}, (ELASTIC, MAXWELL)),
        ({"pad_damping_n_s_m": 50.0}, (ELASTIC, LOSS)),
        ({"pad_stiffness_n_m": 2e4}, (("elastic", {"k1_n_m": 1e8}), ("loss", {"damping_n_s_m": 1e6}))),
    ],
)
def test_without_a_drive_stored_energy_does_not_increase(change, terms):
    config = evolve(FRICTION, **{**FREE, **change})
    move, params, setup = ready(config, object_of(*terms))
    motion = setup.state.motion
    motion = motion._replace(speed_rev_s=-0.05 / motion.jacobian_m_rev)
    state = setup.state._replace(motion=motion)
    k, arm = terms[0][1]["k1_n_m"], dict(terms).get("maxwell", {}).get("k_n_m", 1.0)

    def energy():
        v, d = state.motion.speed_rev_s * state.motion.jacobian_m_rev, state.contact.left.compression_m
        q = state.contact.left.states[2][0] if "maxwell" in dict(terms) else 0.0
        cover = (
            0.05 - state.motion.gap_m - d
            if setup.plant.object.pads.stiffness_n_m < math.inf and state.contact.left_n > 0
            else 0.0
        )
        stored = k * d * d + q * q / arm + (0.5 * config.pad_stiffness_n_m * cover * cover if cover else 0.0)
        return 0.5 * (100.0 * v * v + stored)

    before, first = energy(), energy()
    for _ in range(400):
        state = move(params, state, 0.0, 1e-3)
        assert energy() <= before + 1e-9 * first
        before = energy()
    assert before < first


class Counting(list):
    """Maps that count how many of their numbers were read."""

    reads = 0

    def __getitem__(self, at):
        Counting.reads += 1
        return super().__getitem__(at)


def test_the_cost_does_not_grow_with_stiffness():
    costs = {}
    for stiffness in (1e4, 1e6, 1e9):
        move, params, setup = ready(
            evolve(FRICTION, **RIGID), object_of(("elastic", {"k1_n_m": stiffness}), LOSS, MAXWELL)
        )
        params = params._replace(tables=params.tables._replace(maps=Counting(params.tables.maps)))
        motion = setup.state.motion
        motion = motion._replace(speed_rev_s=-0.02 / motion.jacobian_m_rev)
        state = setup.state._replace(motion=motion)
        Counting.reads = 0
        for effort in squeeze_and_let_go(3000):
            state = move(params, state, effort, 1e-3)
        costs[stiffness] = Counting.reads
        assert math.isfinite(state.contact.left_n)
    # Time steps would be a thousand times shorter. A stiffer contact only has more rebounds to locate.
    assert costs[1e6] <= 1.5 * costs[1e4], costs
    assert costs[1e9] <= 2.5 * costs[1e4], costs


def surface_of(contact_n_m, mass_kg=0.02):
    return object_of(
        ("surface", {**SURFACE[1], "contact_n_m": contact_n_m, "mass_kg": mass_kg}), friction=0.0
    )


@pytest.mark.parametrize("contact_n_m", [1e3, 1e4, 1e6, 1e9])
def test_the_force_at_rest_does_not_depend_on_stiffness(contact_n_m):
    closure, force, _, state = along(PEERS, surface_of(contact_n_m), [2.0] * 3000)
    assert np.all(np.isfinite(force))
    assert force[-1] == pytest.approx(2.0, rel=1e-3)
    assert state.contact.left_n == state.contact.right_n
    # At rest the surface's spring has the force, and the contact has it again.
    assert closure[-1] == pytest.approx(2.0 / 2e3 + 2.0 / contact_n_m, rel=1e-3)


def test_a_very_light_surface_is_not_penetrated():
    closure, force, _, _ = along(PEERS, surface_of(2e4, 1e-6), [2.0] * 2000)
    assert closure.max() < 4e-3
    assert np.all(np.isfinite(force))


# ------------------------------------------------------------------------------------- as a whole grasp


@pytest.mark.slow
def test_the_report_names_the_exact_discretisation(tmp_path):
    """And that steps do if friction is greater at rest: a step per tick where trial grasps allow it."""
    law = create("controller", "hybrid", probing_force_n=5.0)
    rests = {"coulomb_n": 1.0, "breakaway_n": 2.0}
    for change, scheme in (
        ({}, "exact discretisation"),
        (rests, "Verlet, a step per tick; in batches over several ticks"),
        ({**rests, "fidelity": "full"}, "Verlet, a step per tick; in batches over several ticks"),
    ):
        config = evolve(PEERS, **change)
        report = run_grasp(SimBackend(config), law, RunConfig(seed=1)).report
        rows = [row for row in report["selection"]["decisions"] if row["term"] == "steps"]
        assert [row["decision"] for row in rows] == [scheme]


@pytest.mark.slow
@pytest.mark.parametrize("config", [PEERS, evolve(FRICTION, spread=True, drive_lag_s=0.01, open_gap_m=0.07)])
def test_single_and_compiled_grasps_have_the_same_trace(config):
    law = create("controller", "hybrid", probing_force_n=5.0)
    config = evolve(config, object="peers_surface")
    alone = run_grasp(SimBackend(config), law, RunConfig(seed=1))
    plain, fast = (
        run_many(config, law, [config.object], [1], compiled=compiled)[0] for compiled in (False, True)
    )
    assert plain.outcome == alone.outcome
    assert plain.state == fast.state
    for name in ("force_left_n", "gap_m", "velocity_m_s", "command"):
        assert np.array_equal(getattr(plain.trace, name), getattr(fast.trace, name)), name
        assert np.array_equal(getattr(plain.trace, name), getattr(alone.trace, name)), name
