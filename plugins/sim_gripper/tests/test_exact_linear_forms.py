"""The linear forms of terms, and which grasps are discretised exactly."""

import numpy as np
import pytest
from attrs import evolve
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.linalg import expm

from graspsense_sim_gripper.build import unverified_setup
from graspsense_sim_gripper.config import SimConfig
from graspsense_sim_gripper.exact.discretise import discretise, why_not_exact
from graspsense_sim_gripper.objects.spec import ObjectSpec
from graspsense_sim_gripper.terms.registry import TERMS
from graspsense_sim_gripper.terms.term import OwnContact

LINEAR = SimConfig(
    spread=False,
    sensor="ideal",
    transmission="straight",
    moving_mass_kg=100.0,
    coulomb_n=7.0,
    breakaway_n=7.0,
    open_gap_m=0.0505,
    fidelity="full",
)
ELASTIC = ("elastic", {"k1_n_m": 1e4})


def object_of(*terms, **more):
    return ObjectSpec(name="object", width_m=0.05, **{"friction": 0.0, "terms": terms, **more})


NUMBER = st.floats(0.05, 20.0)


LINEAR_WITH = {"elastic": {"k3_n_m3": 0.0}, "foam": {"exponent": 1.0}}


@pytest.mark.parametrize(
    "name", [name for name in TERMS if name not in ("fracture", "gas", "rigid", "snap", "worn")]
)
@settings(max_examples=30, deadline=None)
@given(data=st.data())
def test_a_terms_linear_form_is_its_law(name, data):
    term = TERMS[name]
    fields = {field: data.draw(NUMBER) for field in term.params._fields}
    params = term.params(**fields | LINEAR_WITH.get(name, {}))
    form, state = term.linear(params), term.at_rest
    touching = data.draw(st.booleans())
    d0, way, h = data.draw(NUMBER), data.draw(st.floats(-0.2, 0.2)), data.draw(st.floats(1e-4, 2e-2))
    numbers = [data.draw(st.floats(-1.0, 1.0)) for _ in state]
    if isinstance(form, OwnContact):
        # So far on either side that it stays there.
        numbers[0] = d0 - 5.0 if touching else d0 + 5.0
        form = form.touching if touching else form.parted
    if numbers:
        state = type(state)(*numbers)
    force, after = term.law(params, state, d0, d0 + way, h, way / h)
    n = len(form.rates)
    assert n == len(numbers)
    # (s, d) along a straight path, d' beside them.
    rates = np.zeros((n + 2, n + 2))
    rates[n, n + 1] = 1.0
    if n:
        rates[:n, :n], rates[:n, n], rates[:n, n + 1] = form.rates, form.by_compression, form.by_speed
    end = expm(rates * h) @ [*numbers, d0, way / h]
    expected = form.spring_n_m * end[n] + form.damper_n_s_m * end[n + 1] + np.dot(form.force, end[:n])
    assert force == pytest.approx(expected, rel=1e-7, abs=1e-7 * (1.0 + abs(form.spring_n_m * d0)))
    if n:
        np.testing.assert_allclose(after, end[:n], rtol=1e-7, atol=1e-7)


def reason(change, spec):
    config = evolve(LINEAR, **change)
    setup = unverified_setup(config, spec, 0)
    why = why_not_exact(config, setup)
    assert (discretise(config, setup) is None) == bool(why)
    return why


def test_a_linear_grasp_is_discretised_exactly():
    assert reason({}, object_of(ELASTIC)) == ""
    assert reason({}, object_of(ELASTIC, held=True)) == ""


@pytest.mark.parametrize(
    ("change", "says"),
    [
        ({"breakaway_n": 8.0}, "friction"),
        ({"transmission": "pr2"}, "linkage"),
        ({"fidelity": "reference"}, "prescribed"),
        ({"scheme": "explicit"}, "prescribed"),
        ({"step_s": 1e-4}, "prescribed"),
    ],
)
def test_settings_that_need_time_steps_are_named(change, says):
    assert says in reason(change, object_of(ELASTIC))


@pytest.mark.parametrize(
    ("spec", "says"),
    [
        (object_of(("elastic", {"k1_n_m": 1e4, "k3_n_m3": 1.0})), "elastic"),
        (object_of(ELASTIC, ("rigid", {"hertz_n_m15": 1e7})), "not linear: rigid"),
        (object_of(ELASTIC, ("foam", {"force_n": 20.0, "at_m": 0.01, "exponent": 1.5})), "not linear: foam"),
        (object_of(ELASTIC, held=True, offset_m=1e-4), "centre line"),
    ],
)
def test_objects_that_need_time_steps_are_named(spec, says):
    assert says in reason({}, spec)
