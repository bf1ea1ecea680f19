"""The reference against scipy's Radau at 1e-10: the same scenes as a differential equation, written down once more.

Only what a force on a straight drive does is compared: a mass with friction closes with constant effort on an object
behind springy covers. The rate form is that of the laws' own derivations; nothing of the simulator is called in it.
"""

import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

from graspsense_sim_gripper.build import unverified_setup
from graspsense_sim_gripper.compiled.compose import plant_move
from graspsense_sim_gripper.config import SimConfig
from graspsense_sim_gripper.objects.spec import ObjectSpec
from graspsense_sim_gripper.terms.registry import laws_of

MASS, B, COULOMB, LOAD, EFFORT, SPEED, SECONDS = 100.0, 10.0, 7.0, 0.5, 23.0, 0.02, 0.12


def scenes():
    """Yield twenty objects: (terms, stiffness of a cover)."""
    rng = np.random.default_rng(7)

    def log(a, b):
        return float(math.exp(rng.uniform(math.log(a), math.log(b))))

    for i in range(20):
        k = log(1e3, 1e6)
        terms = {"elastic": {"k1_n_m": k, "k3_n_m3": k * log(1e2, 1e4)}}
        if i % 2:
            terms["maxwell"] = {"k_n_m": k * log(0.1, 1.0), "tau_s": log(1e-3, 10.0)}
        if i % 3 == 1:
            terms["gas"] = {"area_m2": 1e-3, "area_slope_m": 0.0, "volume_m3": log(2e-5, 5e-4)}
            terms["gas"] |= {"pressure_pa": 101325.0, "exponent": 1.4, "bulge_m3_pa": 1e-10}
        if i % 4 == 3:
            terms["slosh"] = {
                "mass_kg": log(0.01, 1.0),
                "frequency_hz": log(2.0, 30.0),
                "damping_ratio": 0.02,
            }
        yield pytest.param(terms, log(1e4, 1e5), id=f"{i}", marks=() if i in (0, 3, 7) else pytest.mark.slow)


def rates(terms, cover):
    """Return the right-hand side on (closure, speed, q, rise, y, v), its force, and the compression."""
    skins = 0.5 * cover
    elastic, maxwell, gas, slosh = (terms.get(n) for n in ("elastic", "maxwell", "gas", "slosh"))
    w = 2.0 * math.pi * slosh["frequency_hz"] if slosh else 0.0
    a = slosh["damping_ratio"] * w if slosh else 0.0
    m = slosh["mass_kg"] if slosh else 0.0

    def still(d, s):
        """Return the force of a compression at no rate."""
        force = elastic["k1_n_m"] * d + elastic["k3_n_m3"] * d**3
        if maxwell:
            force += s[2]
        if gas:
            force += gas["area_m2"] * s[3]
        if slosh:
            force += m * (w * w * (d - s[4]) - 2.0 * a * s[5])
        return force

    def tangent(d, s):
        """Return the force's derivative by the compression, what has states taken as they are."""
        return elastic["k1_n_m"] + 3.0 * elastic["k3_n_m3"] * d * d + m * w * w

    def give(d, s):
        pressure = gas["pressure_pa"] + s[3]
        volume = gas["volume_m3"] - gas["area_m2"] * d + gas["bulge_m3_pa"] * s[3]
        return volume / (gas["exponent"] * pressure) + gas["bulge_m3_pa"]

    def compression(s):
        if slosh:
            return s[6]
        return brentq(lambda d: still(d, s) - skins * (s[0] - d), -1e-3, s[0] + 1e-3, xtol=1e-18, rtol=1e-15)

    def side(t, s):
        d = compression(s)
        force = skins * (s[0] - d)
        if slosh:
            # The mode's damper makes the compression a state of its own.
            rate = (force - still(d, s)) / (2.0 * a * m)
        else:
            # F(d, s) = skins (c - d), differentiated.
            total = tangent(d, s) + skins
            own = 0.0
            if maxwell:
                own -= s[2] / maxwell["tau_s"]
                total += maxwell["k_n_m"]
            if gas:
                total += gas["area_m2"] ** 2 / give(d, s)
            rate = (skins * s[1] - own) / total
        friction = COULOMB + LOAD * force
        speeding = (EFFORT - friction - B * s[1] - force) / MASS
        q = maxwell["k_n_m"] * rate - s[2] / maxwell["tau_s"] if maxwell else 0.0
        rise = gas["area_m2"] * rate / give(d, s) if gas else 0.0
        mode = (w * w * (d - s[4]) + 2.0 * a * (rate - s[5])) if slosh else 0.0
        return [s[1], speeding, q, rise, s[5], mode, rate]

    return side, lambda s: skins * (s[0] - compression(s))


@pytest.mark.parametrize(("terms", "cover"), list(scenes()))
def test_the_reference_is_what_radau_finds(terms, cover):
    config = SimConfig(
        sensor="ideal",
        spread=False,
        fidelity="reference",
        transmission="straight",
        moving_mass_kg=MASS,
        coulomb_n=COULOMB,
        breakaway_n=COULOMB,
        load_friction_coefficient=LOAD,
        damping_n_s_m=B,
        pad_stiffness_n_m=cover,
        open_gap_m=0.06,
    )
    spec = ObjectSpec(name="radau", width_m=0.05, friction=0.0, terms=tuple(terms.items()))
    setup = unverified_setup(config, spec, 0)
    move = plant_move(laws_of(setup.kinds))
    link = setup.plant.drive.link
    # It begins where the fingers touch, at their speed.
    state = setup.state._replace(
        motion=setup.state.motion._replace(
            revolutions=0.05 / link.pitch_m, gap_m=0.05, speed_rev_s=-SPEED / link.pitch_m
        ),
        contact=setup.state.contact._replace(touched=1),
    )
    side, force_of = rates(terms, cover)
    start = [0.0, SPEED, 0.0, 0.0, 0.0, 0.0, 0.0]

    def stands(t, s):
        return s[1]

    stands.terminal, stands.direction = True, -1.0
    times = np.arange(1, round(SECONDS / 1e-3) + 1) * 1e-3
    exact = solve_ivp(side, (0.0, SECONDS), start, "Radau", times, events=stands, rtol=1e-10, atol=1e-13)
    forces = []
    for _ in exact.t:
        state = move(setup.plant, state, EFFORT, 1e-3)
        forces.append(state.contact.left_n)
    expected = np.array([force_of(s) for s in exact.y.T])
    assert len(expected) > 5
    np.testing.assert_allclose(forces, expected, rtol=1e-4, atol=1e-4 * expected.max())
    assert exact.y[0][-1] == pytest.approx(0.05 - state.motion.gap_m, rel=5e-5)
