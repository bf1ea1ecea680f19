"""The search for the balance of forces at the contact: it ends where a law is awkward, and says so where it cannot."""

import itertools
import math

import pytest
from cases import every_case

from graspsense_sim_gripper.plant.balance import solve_contact
from graspsense_sim_gripper.plant.object_model import ObjectModel
from graspsense_sim_gripper.plant.pads import PadCompliance
from graspsense_sim_gripper.plant.state import ContactState
from graspsense_sim_gripper.run.accuracy.levels import balance_rtol
from graspsense_sim_gripper.run.compiled.compose import bind_reachable, sum_of, uncompressed
from graspsense_sim_gripper.scene.terms.elastic import Elastic, elastic
from graspsense_sim_gripper.scene.terms.foam import Foam, foam
from graspsense_sim_gripper.scene.terms.loss import Loss, loss
from graspsense_sim_gripper.scene.terms.term import NoState
from graspsense_sim_gripper.scene.terms.worn import Worn, WornState, worn


def solver(law):
    return bind_reachable(solve_contact, {"object_force": sum_of([law])})


def untouched(state):
    return ContactState(0.0, 0.0, 0.0, (state,), 0.0, 0.0)


@every_case("pads_n_m", [1.5e4, math.inf])
@every_case("closure_m", [1e-9, 1e-7, 1e-5])
def test_the_first_touch_of_a_worn_shell_compresses_it_by_no_more_than_the_fingers_close(closure_m, pads_n_m):
    # A law that pulls at its free surface had the search end where the shell was 14 mm deep and worn by 2 J.
    shell = Worn(2200.0, 0.0, 0.1, 0.9, 0.014, earlier_j=0.2)
    body = ObjectModel(0.06, 0.0, PadCompliance(pads_n_m), (shell,))
    after, unbalanced = solver(worn)(body, untouched(WornState(0.0, 0.0)), closure_m, 0.01, 1e-3)
    assert unbalanced == 0
    assert 0.0 < after.compression_m <= closure_m
    assert after.states[0].work_j <= 2200.0 * closure_m**2


def rate_error(lengths, duration_s=0.3):
    """Return the error of the force on a damped spring behind pads whose closure is known, after steps like these."""
    pads_n_m, k_n_m, c_n_s_m, w, depth = 1.5e4, 2000.0, 100.0, 20.0, 1e-3
    body = ObjectModel(0.06, 0.0, PadCompliance(pads_n_m), (Elastic(k_n_m, 0.0), Loss(c_n_s_m)))
    solve = bind_reachable(solve_contact, {"object_force": sum_of([elastic, loss])})

    def compression(t):
        return depth * (2.0 + math.sin(w * t))

    def force(t):
        return k_n_m * compression(t) + c_n_s_m * depth * w * math.cos(w * t)

    state = ContactState(compression(0.0), force(0.0), 0.0, (NoState(), NoState()), 0.0, 0.0)
    t, n = 0.0, 0
    while t < duration_s - 1e-9:
        h = min(lengths[n % len(lengths)], duration_s - t)
        t, n = t + h, n + 1
        state, unbalanced = solve(body, state, compression(t) + force(t) / pads_n_m, 0.0, h)
        assert unbalanced == 0
    return abs(state.force_n - force(t))


@pytest.mark.parametrize(("ratio", "order"), [(1.0, 3), (1.4, 3), (4.0, 2)])
def test_the_rate_that_a_damper_needs_is_of_third_order_where_steps_grow_slowly(ratio, order):
    # What the first steps know less well has relaxed long before the end.
    errors = [rate_error((h, ratio * h)) for h in (2e-3, 1e-3, 5e-4)]
    for coarse, fine in itertools.pairwise(errors):
        assert coarse / fine == pytest.approx(2.0**order, rel=0.25)


@pytest.mark.parametrize("exponent", [0.3, 8.0])
def test_a_power_law_with_a_steep_end_is_balanced(exponent):
    law = Foam(10.0, 0.01, exponent)
    body = ObjectModel(0.06, 0.0, PadCompliance(1.5e4), (law,))
    now, search = untouched(uncompressed(["foam"]).states[0]), solver(foam)
    for closure in (1e-9, 1e-6, 1e-4, 3e-3, 1e-2, 2e-3, 1e-5):
        now, unbalanced = search(body, now, closure, 0.0, 1e-3)
        assert unbalanced == 0
        assert now.force_n == pytest.approx(1.5e4 * (closure - now.compression_m), rel=1e-5, abs=1e-6)


@every_case(("accuracy", "rtol"), [(0.3, 5e-9), (1e-2, 5e-9), (1e-3, 5e-10), (1e-9, 1e-11)])
def test_a_coarser_balance_is_within_its_tolerance_and_evaluates_the_law_less_often(accuracy, rtol):
    evaluated = 0

    def counted(params, state, d0, d1, h, v1):
        nonlocal evaluated
        evaluated += 1
        return foam(params, state, d0, d1, h, v1)

    assert balance_rtol(accuracy) == pytest.approx(rtol)
    counts, search = [], solver(counted)
    for tolerance in (rtol, 1e-11):
        body = ObjectModel(0.06, 0.0, PadCompliance(1.5e4), (Foam(10.0, 0.01, 3.0),), balance_rtol=tolerance)
        now, evaluated = untouched(uncompressed(["foam"]).states[0]), 0
        for closure in (1e-4, 1e-3, 2e-3, 3e-3, 4e-3, 5e-3):
            now, unbalanced = search(body, now, closure, 0.0, 1e-3)
            assert unbalanced == 0
            miss_n = abs(now.force_n - 1.5e4 * (closure - now.compression_m))
            assert miss_n <= tolerance * (100.0 + now.force_n) + 1e-12
        counts.append(evaluated)
    assert counts[0] < counts[1] or rtol == 1e-11


def jumps(params, state, d0, d1, h, v1):
    """Force that nowhere equals that of the pads: it jumps from 0 to 100 N."""
    return (100.0 if d1 > 1e-3 else 0.0), state


def not_a_number(params, state, d0, d1, h, v1):
    return math.nan, state


@pytest.mark.parametrize("law", [jumps, not_a_number])
def test_a_search_without_a_balance_is_counted(law):
    body = ObjectModel(0.06, 0.0, PadCompliance(1.5e4), (NoState(),))
    _, unbalanced = solver(law)(body, untouched(NoState()), 3e-3, 0.0, 1e-3)
    assert unbalanced == 1
