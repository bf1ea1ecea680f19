"""Each term against its closed form, its limits, and the energy it may not create."""

import math
from itertools import pairwise

import pytest
from hypothesis import given
from hypothesis import strategies as st

from graspsense_sim_gripper.terms import (
    TERMS,
    Elastic,
    Gas,
    GasState,
    Loss,
    Maxwell,
    MaxwellState,
    NoState,
    Rigid,
    RigidState,
    elastic,
    gas,
    loss,
    maxwell,
    rigid,
)


def along(term, params, state, path, h):
    """Follow a path of compressions; return the forces and the work done on the term."""
    forces, work = [], 0.0
    for d0, d1 in pairwise(path):
        before = forces[-1] if forces else 0.0
        force, state = term(params, state, d0, d1, h)
        work += 0.5 * (before + force) * (d1 - d0)
        forces.append(force)
    return forces, work, state


def ramp(depth, steps):
    return [depth * k / steps for k in range(steps + 1)]


def test_elastic_is_its_polynomial():
    force, _ = elastic(Elastic(2000.0, 3e6), NoState(), 0.0, 0.01, 1e-3)
    assert force == pytest.approx(2000.0 * 0.01 + 3e6 * 1e-6)


def test_rigid_is_hertz_until_it_breaks_and_stays_broken():
    shell = Rigid(8e6, 30.0, 100.0)
    force, state = rigid(shell, RigidState(0), 0.0, 2e-4, 1e-3)
    assert (force, state.broken) == (pytest.approx(8e6 * (2e-4) ** 1.5), 0)
    _, state = rigid(shell, state, 2e-4, 3e-4, 1e-3)
    assert state.broken == 1
    force, state = rigid(shell, state, 3e-4, 1e-2, 1e-3)
    assert force == pytest.approx(1.0)
    assert rigid(shell, state, 1e-2, 1e-5, 1e-3)[1].broken == 1


def test_maxwell_follows_its_exact_solution_whatever_the_step():
    branch = Maxwell(500.0, 0.2)
    exact = 500.0 * (0.01 / 1.0) * 0.2 * (1.0 - math.exp(-1.0 / 0.2))
    for steps in (1, 7, 1000):
        forces, _, _ = along(maxwell, branch, MaxwellState(0.0), ramp(0.01, steps), 1.0 / steps)
        assert forces[-1] == pytest.approx(exact, rel=1e-10)


@pytest.mark.parametrize(("tau", "expected"), [(1e-9, 500.0 * 1e-9 * 0.01), (1e9, 500.0 * 0.01)])
def test_maxwell_tends_to_a_damper_and_to_a_spring(tau, expected):
    forces, _, _ = along(maxwell, Maxwell(500.0, tau), MaxwellState(0.0), ramp(0.01, 1000), 1e-3)
    assert forces[-1] == pytest.approx(expected, rel=1e-6)


def sealed(volume, bulge=0.0, exponent=1.4, area=1.2e-3):
    return Gas(area, 0.0, volume, 101325.0, exponent, bulge)


def test_sealed_gas_follows_p_v_n():
    bottle = sealed(15e-6, area=1e-3)
    forces, _, _ = along(gas, bottle, GasState(0.0), ramp(0.008, 2000), 1e-3)
    pressure = 101325.0 * (15e-6 / (15e-6 - 8e-6)) ** 1.4
    assert forces[-1] == pytest.approx(1e-3 * (pressure - 101325.0), rel=1e-5)


def test_the_gas_is_of_second_order_in_its_step():
    bottle = sealed(15e-6, 1e-10)
    reference = along(gas, bottle, GasState(0.0), ramp(0.005, 4096), 1e-3)[0][-1]
    errors = [
        abs(along(gas, bottle, GasState(0.0), ramp(0.005, n), 1e-3)[0][-1] - reference) for n in (16, 32, 64)
    ]
    assert errors[0] / errors[1] == pytest.approx(4.0, rel=0.1)
    assert errors[1] / errors[2] == pytest.approx(4.0, rel=0.1)


def test_without_air_the_walls_bulge_is_what_gives():
    stiffness = along(gas, sealed(1e-9, 1e-10), GasState(0.0), ramp(1e-4, 50), 1e-3)[0][-1] / 1e-4
    assert stiffness == pytest.approx(1.2e-3**2 / 1e-10, rel=2e-3)


def test_a_great_volume_of_air_gives_no_force():
    assert along(gas, sealed(1e3), GasState(0.0), ramp(1e-2, 50), 1e-3)[0][-1] == pytest.approx(0.0, abs=1e-4)


def test_a_pressurised_can_pushes_nothing_at_rest_and_more_per_millimetre():
    force, _ = gas(Gas(8e-4, 0.0, 15e-6, 3e5, 1.0, 0.0), GasState(0.0), 0.0, 0.0, 1e-3)
    assert force == 0.0
    soft = along(gas, Gas(8e-4, 0.0, 15e-6, 1e5, 1.0, 0.0), GasState(0.0), ramp(1e-4, 10), 1e-3)[0][-1]
    hard = along(gas, Gas(8e-4, 0.0, 15e-6, 3e5, 1.0, 0.0), GasState(0.0), ramp(1e-4, 10), 1e-3)[0][-1]
    assert hard / soft == pytest.approx(3.0, rel=0.02)


def test_loss_is_a_damper_and_none_at_rest():
    assert loss(Loss(1000.0), NoState(), 0.0, 1e-5, 1e-3)[0] == pytest.approx(10.0)
    assert loss(Loss(1000.0), NoState(), 1e-5, 1e-5, 1e-3)[0] == 0.0
    assert loss(Loss(1000.0), NoState(), 1e-5, 1e-5, 0.0)[0] == 0.0


@pytest.mark.parametrize("name", sorted(TERMS))
@given(
    st.lists(st.floats(0.0, 0.01), min_size=2, max_size=6),
    st.sampled_from([1e-5, 1e-3, 0.1]),
)
def test_no_term_gives_back_more_work_than_was_put_in(name, corners, h):
    params = {
        "elastic": Elastic(2000.0, 2e6),
        "rigid": Rigid(1e8, 1e9, 0.0),
        "maxwell": Maxwell(500.0, 0.05),
        "gas": Gas(1.2e-3, 0.02, 3e-5, 101325.0, 1.2, 1e-10),
        "loss": Loss(1000.0),
    }[name]
    _, law, state = TERMS[name]
    points = [0.0, *corners, 0.0]
    path = [0.0]
    for a, b in pairwise(points):
        path += [a + (b - a) * k / 400 for k in range(1, 401)]
    forces, work, _ = along(law, params, state, path, h)
    # Back where it began: what is not dissipated is at most the rounding of the trapezoid that adds up the work.
    assert work >= -2e-4 * max(1.0, max(abs(f) for f in forces)) * 0.01
