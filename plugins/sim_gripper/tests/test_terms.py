"""Each term against its closed form, its limits, and the energy it may not create."""

import math
from itertools import pairwise

import pytest
from cases import every_case
from hypothesis import given, settings
from hypothesis import strategies as st

from graspsense_sim_gripper.scene.terms.elastic import LEAST_SLOPE, Elastic, elastic, shell_force
from graspsense_sim_gripper.scene.terms.foam import Foam
from graspsense_sim_gripper.scene.terms.fracture import Fracture
from graspsense_sim_gripper.scene.terms.gas import Gas, GasState, gas
from graspsense_sim_gripper.scene.terms.liquid import Liquid, liquid
from graspsense_sim_gripper.scene.terms.loss import Loss
from graspsense_sim_gripper.scene.terms.maxwell import Maxwell
from graspsense_sim_gripper.scene.terms.oscillator import Forcing, OscillatorState, moved
from graspsense_sim_gripper.scene.terms.registry import TERMS
from graspsense_sim_gripper.scene.terms.rigid import Rigid
from graspsense_sim_gripper.scene.terms.slosh import Slosh, slosh
from graspsense_sim_gripper.scene.terms.snap import Snap
from graspsense_sim_gripper.scene.terms.surface import Surface, surface
from graspsense_sim_gripper.scene.terms.term import NoState, Term, WorkingPoint
from graspsense_sim_gripper.scene.terms.vent import LAMINAR_BELOW_PA, conductance, vented
from graspsense_sim_gripper.scene.terms.worn import Worn, WornState, worn


def along(term, params, state, path, h):
    """Follow a path of compressions; return the forces and the work done on the term."""
    forces, work = [], 0.0
    for d0, d1 in pairwise(path):
        last_force = forces[-1] if forces else 0.0
        force, state = term(params, state, d0, d1, h, (d1 - d0) / h)
        work += 0.5 * (last_force + force) * (d1 - d0)
        forces.append(force)
    return forces, work, state


def ramp(depth, steps):
    return [depth * k / steps for k in range(steps + 1)]


@given(st.floats(10.0, 1e6), st.floats(0.1, 100.0), st.floats(0.0, 50.0))
def test_a_softening_shell_is_the_cubic_first_and_always_rises(k1, end_mm, d_mm):
    end, d = 1e-3 * end_mm, 1e-3 * d_mm
    k3 = -(1.0 - LEAST_SLOPE) * k1 / (3.0 * end * end)
    force = shell_force(k1, k3, d)
    if d < end:
        assert force == pytest.approx(k1 * d + k3 * d**3)
    further = shell_force(k1, k3, d + 1e-6)
    assert LEAST_SLOPE * k1 * 1e-6 * 0.999 <= further - force <= k1 * 1e-6 * 1.001
    assert shell_force(k1, k3, -d) == -force
    # A worn shell that has not worn has the same law.
    assert worn(Worn(k1, k3, 1.0, 0.0, 0.0), WornState(0.0, 0.0), d, d, 1e-3, 0.0)[0] == force


@pytest.mark.parametrize("heat", [1e-3, 0.1, math.inf])
def test_gas_that_is_pressed_out_through_its_vent_has_an_answer_and_says_so(heat):
    # 3 ml, of which 5 are swept within a second: the vent lets it out, and then the wall is what gives.
    bottle = Gas(1e-3, 0.0, 3e-6, 101325.0, 1.4, 1e-10, 1e-5, heat)
    ends = [along(gas, bottle, GasState(0.0), ramp(0.005, n), 1.0 / n) for n in (200, 800, 3200)]
    forces = [max(path_forces) for path_forces, _, _ in ends]
    assert forces[1] == pytest.approx(forces[2], rel=1e-3)
    assert forces[0] == pytest.approx(forces[2], rel=1e-2)
    assert all(state.spent == 1 and abs(state.warmth) < 0.5 for _, _, state in ends)
    assert along(gas, bottle, GasState(0.0), ramp(0.002, 200), 5e-3)[2].spent == 0


def test_a_pressurised_can_pushes_nothing_at_rest_and_more_per_millimetre():
    force, _ = gas(Gas(8e-4, 0.0, 15e-6, 3e5, 1.0, 0.0), GasState(0.0), 0.0, 0.0, 1e-3, 0.0)
    assert force == 0.0
    soft, hard = (
        along(gas, Gas(8e-4, 0.0, 15e-6, pressure_pa, 1.0, 0.0), GasState(0.0), ramp(1e-4, 10), 1e-3)[0][-1]
        for pressure_pa in (1e5, 3e5)
    )
    assert hard / soft == pytest.approx(3.0, rel=0.02)


# ------------------------------------------------------------------------------------- a vent, and heat


def leaking(opening, volume=450e-6, bulge=0.0, heat=math.inf, exponent=1.4):
    return Gas(1.2e-3, 0.0, volume, 101325.0, exponent, bulge, opening, heat)


def follow(params, seconds, depth, steps):
    return along(gas, params, GasState(0.0, 0.0), ramp(depth, steps), seconds / steps)[0]


def test_a_vent_is_viscous_below_a_pascal_and_a_root_far_above():
    quarter = conductance(1e-6, 0.01) / conductance(1e-6, 0.04)
    assert quarter == pytest.approx(1.0, abs=0.02)
    # Bernoulli with a discharge of 0.6: q = 0.6 A sqrt(2 p / rho).
    flow = conductance(1e-6, 1e4) * 1e4
    assert flow == pytest.approx(0.6e-6 * math.sqrt(2.0 * 1e4 / 1.2), rel=0.02)
    assert conductance(1e-6, LAMINAR_BELOW_PA) == pytest.approx(0.83 * conductance(1e-6, 0.0), rel=0.02)


@given(st.floats(-9.0, -3.0).map(lambda e: 10.0**e), st.floats(-6.0, 5.0).map(lambda e: 10.0**e))
def test_the_vents_flow_rises_with_its_area_and_with_pressure(area, pressure):
    assert conductance(1.01 * area, pressure) > conductance(area, pressure)
    assert conductance(area, 1.01 * pressure) * 1.01 * pressure > conductance(area, pressure) * pressure


@given(area=st.floats(1e-10, 1e-3), driven=st.floats(-1e5, 1e5), spent=st.floats(1e-6, 1e12))
def test_what_a_vent_leaves_of_a_pressure_is_what_its_flow_goes_by(area, driven, spent):
    left, through = vented(area, driven, spent)
    assert left + spent * through * left == pytest.approx(driven, rel=1e-12, abs=1e-12)
    assert through == pytest.approx(conductance(area, left), rel=1e-9)


@every_case("opening", [1e-6, 1e-5, 1e-4, 1e-3])
@every_case("steps", [5, 50, 500])
def test_a_fast_vent_is_the_damper_of_its_orifice_whatever_the_step(opening, steps):
    # All that is swept goes out: p = (v A / (C_d A_o))^2 rho / 2, with the viscous part on top.
    speed, area = 0.02, 1.2e-3
    through = speed * area
    inertial = 0.5 * 1.2 / (0.6 * opening) ** 2
    rise = 2.0 * math.sqrt(inertial * LAMINAR_BELOW_PA) * through + inertial * through**2
    small = leaking(opening, volume=5e-6)._replace(area_slope_m=0.0)
    force = follow(small, 0.1, 0.002, steps)[-1]
    if opening >= 1e-5:
        assert force == pytest.approx(area * rise, rel=0.03)
    else:
        # As much pressure as this takes part of the grasp to build up.
        assert 0.0 < force <= 1.01 * area * rise


def test_an_opening_wider_than_another_never_holds_more():
    areas = [0.0, *(10.0 ** (0.25 * k) for k in range(-48, -11))]
    forces = [follow(leaking(area, 1e-4), 0.3, 0.01, 100)[-1] for area in areas]
    assert all(a >= b for a, b in pairwise(forces))
    # No jump anywhere between sealed and open: a step of a quarter decade never takes away a third at once.
    assert all(a - b < 0.34 * forces[0] for a, b in pairwise(forces))


SHELL = Worn(8e3, 1e7, 0.02, 0.5, 1e-3)


@every_case(
    ("law", "params", "state", "path"),
    [
        *(
            (gas, leaking(vent, 5e-5, 1e-10, heat), GasState(0.0), lambda t: 0.006 * math.sin(1.4 * t) ** 2)
            for vent in (0.0, 3e-7)
            for heat in (math.inf, 0.05)
        ),
        (worn, SHELL, WornState(0.0, 0.0), lambda t: 0.003 * t),
    ],
)
def test_gas_vent_heat_and_wear_are_of_second_order_in_their_step(law, params, state, path):
    def end(steps):
        return along(law, params, state, [path(k / steps) for k in range(steps + 1)], 0.3 / steps)[0][-1]

    exact = end(8192)
    errors = [abs(end(n) - exact) for n in (64, 128, 256)]
    assert errors[0] / errors[1] == pytest.approx(4.0, rel=0.2)
    assert errors[1] / errors[2] == pytest.approx(4.0, rel=0.2)


@every_case(("heat", "exponent"), [(1e-9, 1.0), (1e9, 1.4)])
@every_case("bulge", [0.0, 1e-10])
def test_heat_tends_to_isothermal_and_to_adiabatic(heat, exponent, bulge):
    warm = follow(leaking(0.0, 15e-6, bulge, heat), 1.0, 0.005, 500)[-1]
    plain_gas = follow(leaking(0.0, 15e-6, bulge, math.inf, exponent), 1.0, 0.005, 500)[-1]
    assert warm == pytest.approx(plain_gas, rel=1e-5)


# ------------------------------------------------------------------------------------- the other terms


def test_each_squeeze_finds_a_worn_shell_further_gone_by_the_work_of_those_before():
    fresh, state, peaks = Worn(2000.0, 0.0, 0.5, 0.4, 0.002), TERMS["worn"].at_rest, []
    for _ in range(3):
        forces, _, state = along(worn, fresh, state, [*ramp(0.01, 100), *ramp(0.01, 100)[::-1]], 1e-3)
        peaks.append(forces[99])
    assert peaks[0] > peaks[1] > peaks[2]
    assert state.work_j == pytest.approx(3 * 0.5 * 2000.0 * 0.01**2, rel=0.25)


@given(st.floats(-1.0, 5.0).map(lambda e: 10.0**e), st.floats(0.0, 30.0), st.integers(1, 200))
def test_an_oscillators_motion_is_exact_whatever_the_step(w, ratio, steps):
    square, a = w * w, ratio * w
    bend = -0.5 * square
    whole = moved(OscillatorState(1e-3, 0.2), a, square, Forcing(3.0, 40.0, bend), 0.01)
    pieces = OscillatorState(1e-3, 0.2)
    for k in range(steps):
        t = 0.01 * k / steps
        forcing = Forcing(3.0 + 40.0 * t + bend * t * t, 40.0 + 2.0 * bend * t, bend)
        pieces = moved(pieces, a, square, forcing, 0.01 / steps)
    scale = 1e-3 + 3.4 / square + 0.01 * 0.2
    assert pieces.y_m == pytest.approx(whole.y_m, abs=1e-8 * scale)


@every_case("step_s", [1e-12, 1e-9, 1e-6, 1e-4])
@every_case("ratio", [0.0, 0.3, 1.0, 3.0])
def test_an_oscillators_motion_in_a_short_step_is_not_rounding(step_s, ratio):
    # A search for a balance tries rates of compression that change at once. The closed form moved the mass of a contact
    # by 0.1 mm in 1e-11 s, which the contact's stiffness made hundreds of newtons of.
    square, start = 1300.0, OscillatorState(1e-9, 2e-5)
    a = ratio * math.sqrt(square)
    forcing = Forcing(1e-3 / step_s, 0.3 / step_s**2, -0.7 / step_s**3)
    after = moved(start, a, square, forcing, step_s)
    # Without spring and damper, whose share is of the order of (a + w) h.
    free = start.y_m + step_s * (2e-5 + 1e-3 / 2 + 0.3 / 6 - 0.7 / 12)
    share = 0.3 * (4.0 * a + math.sqrt(square)) * step_s
    assert after.y_m == pytest.approx(free, abs=share * step_s + 1e-14 * abs(free))
    assert after.v_m_s == pytest.approx(2e-5 + 1e-3 + 0.3 / 2 - 0.7 / 3, abs=share + 1e-14)


def last_force(law, params, n, h, distance, bend):
    """Return the force after n steps of a compression whose rate changes linearly."""
    state = OscillatorState(0.0, 0.0)
    for k in range(n):
        d0, d1 = (distance * t - bend * t * t for t in (k * h, (k + 1) * h))
        force, state = law(params, state, d0, d1, h, distance - 2.0 * bend * (k + 1) * h)
    return force


@every_case("ratio", [0.0, 1e-200, 0.7, 1.0, 2.5, 1e3, 1e6])
def test_slosh_is_exact_for_a_rate_that_changes_linearly_whatever_its_damping(ratio):
    whole, parts = (last_force(slosh, Slosh(0.5, 5.0, ratio), n, 0.02 / n, 0.02, 0.5) for n in (1, 50))
    assert whole == pytest.approx(parts, rel=1e-8)
    if ratio >= 1e3:
        # The damper carries the mass along: it has the deceleration of the wall, 1 m/s2.
        assert whole == pytest.approx(-0.5, rel=1e-3)


@every_case("stiffness", [1e-6, 300.0, 1e9])
@every_case(
    ("law", "params"),
    [
        (liquid, lambda k: Liquid(1.2e-3, 5e-4, 0.08, 1.2e-3**2 / k, viscosity_pa_s=0.1)),
        (surface, lambda k: Surface(0.2, k, 2.0, 2e4)),
    ],
)
def test_a_mass_on_springs_is_exact_for_a_rate_that_changes_linearly(law, params, stiffness):
    whole, parts = (last_force(law, params(stiffness), n, 2e-3 / n, 0.02, 4.0) for n in (1, 40))
    assert whole == pytest.approx(parts, rel=1e-7)


@every_case("steps", [1, 3, 40])
def test_a_surface_bounces_alike_however_long_the_pieces_are(steps):
    # 10 g on 10 kN/m behind a contact of 1 MN/m: it bounces several times within a millisecond.
    hit = Surface(0.01, 1e4, 0.2, 1e6)
    (force, _, state), (exact, _, end) = (
        along(
            surface, hit, OscillatorState(0.0, 0.0), [2e-4 + 5e-5 * k / n for k in range(3 * n + 1)], 1e-3 / n
        )
        for n in (steps, 2000)
    )
    assert (force[-1], state.y_m) == pytest.approx((exact[-1], end.y_m), rel=2e-3)


SAMPLES = {
    "elastic": Elastic(2000.0, 2e6),
    "rigid": Rigid(1e8, 1e9, 0.0),
    "maxwell": Maxwell(500.0, 0.05),
    "gas": Gas(1.2e-3, 0.02, 3e-5, 101325.0, 1.2, 1e-10),
    "loss": Loss(1000.0),
    "foam": Foam(10.0, 0.01, 1.8, 200.0, 0.02, 100.0, 1.0),
    "snap": Snap(2000.0, 0.004, 5.0, 0.003, 1500.0),
    "worn": Worn(2000.0, 2e6, 0.2, 0.4, 0.002),
    "surface": Surface(0.02, 2000.0, 5.0, 2e4),
    "liquid": Liquid(1.2e-3, 5e-4, 0.08, 1e-10),
    "slosh": Slosh(0.2, 4.0, 0.02),
    "fracture": Fracture(10.0),
}
VARIANTS = {
    **SAMPLES,
    "elastic that softens": Elastic(2000.0, -2e7),
    "gas that leaks": SAMPLES["gas"]._replace(vent_m2=1e-6),
    "gas that leaks fast": SAMPLES["gas"]._replace(vent_m2=1e-4),
    "gas that warms": SAMPLES["gas"]._replace(heat_s=0.1),
    "gas that leaks and warms": SAMPLES["gas"]._replace(vent_m2=1e-6, heat_s=0.1),
}


def test_every_term_has_a_sample_here():
    assert SAMPLES.keys() == TERMS.keys()


@pytest.mark.slow
@every_case("name", sorted(VARIANTS))
@settings(max_examples=10, deadline=None)
@given(st.lists(st.floats(0.0, 0.009), min_size=2, max_size=5), st.sampled_from([1e-5, 1e-3, 0.1]))
def test_no_term_ever_gives_back_more_work_than_was_put_in(name, corners, h):
    params = VARIANTS[name]
    term = TERMS[name.split()[0]]
    # The trapezoid that adds up the work must see the swings.
    rates = term.rates(params, WorkingPoint(0.005, 0.01, 1.0)) if term.rates else ()
    h = min([h, *(0.05 / rate.per_s for rate in rates if rate.what == "swings")])
    state, force, work, most = term.at_rest, term.law(params, term.at_rest, 0.0, 0.0, h, 0.0)[0], 0.0, 1.0
    for a, b in pairwise([0.0, *corners, 0.0]):
        for k in range(150):
            d0, d1 = a + (b - a) * k / 150, a + (b - a) * (k + 1) / 150
            last_force = force
            force, state = term.law(params, state, d0, d1, h, (d1 - d0) / h)
            work += 0.5 * (last_force + force) * (d1 - d0)
            most = max(most, abs(force))
            # From rest on, at every instant; up to what the trapezoid that adds up the work is off.
            assert work >= -1.5e-3 * most * 0.01


@every_case("name", sorted(VARIANTS))
@every_case("h", [0.0, 1e-9, 1e-3, 1.0, 1e6])
def test_every_term_is_finite_and_keeps_its_types_in_pieces_of_any_length(name, h):
    term, state = TERMS[name.split()[0]], TERMS[name.split()[0]].at_rest
    for d0, d1 in pairwise([0.0, 1e-9, 0.005, 0.005, 0.002, -0.001, 0.0]):
        force, after = term.law(VARIANTS[name], state, d0, d1, h, (d1 - d0) / h if h > 0.0 else 0.01)
        assert type(force) is float
        assert math.isfinite(force)
        # int for float is another type, which the compiler would not take.
        assert types_of(after) == types_of(state)
        state = after


def types_of(state):
    return tuple(types_of(part) if isinstance(part, tuple) else type(part) for part in state)


@every_case("name", sorted(VARIANTS))
def test_every_term_stands_still_over_a_hold_of_a_million_seconds(name):
    term = TERMS[name.split()[0]]
    _, _, state = along(term.law, VARIANTS[name], term.at_rest, ramp(0.005, 100), 1e-3)
    force, state = term.law(VARIANTS[name], state, 0.005, 0.005, 1e6, 0.0)
    again, _ = term.law(VARIANTS[name], state, 0.005, 0.005, 1e6, 0.0)
    assert again == pytest.approx(force, rel=1e-6, abs=1e-9)


@every_case("name", sorted(VARIANTS))
def test_every_term_says_how_fast_it_is(name):
    term, point = TERMS[name.split()[0]], WorkingPoint(0.005, 0.01, 2.0)
    rates = term.rates(VARIANTS[name], point) if term.rates else ()
    assert all(math.isfinite(rate.per_s) and rate.per_s > 0.0 for rate in rates)
    if not isinstance(term.at_rest, NoState) and name not in ("rigid", "gas", "snap", "fracture"):
        assert rates


def test_a_term_that_does_not_fit_together_is_refused_where_it_is_declared():
    with pytest.raises(TypeError, match=r"'odd'.*<class 'dict'>"):
        Term(name="odd", summary="", params=dict, law=elastic)
    with pytest.raises(TypeError, match="no field"):
        Term(name="odd", summary="", params=Elastic, law=elastic, positive=("tau_s",))
