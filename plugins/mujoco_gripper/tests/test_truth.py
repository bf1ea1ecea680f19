"""MuJoCo against graspsense's simulator where both express the same grasp, and grasps at the ends of every range."""

import importlib.util
import math
from pathlib import Path

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from graspsense.gripper_api import Outcome
from graspsense.plugin_api import create
from graspsense.simulator_api import RunConfig, run_uninterrupted

SCRIPT = Path(__file__).parents[1] / "benchmarks/truth.py"


@pytest.fixture(scope="module")
def truth():
    spec = importlib.util.spec_from_file_location("truth", SCRIPT)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.mark.slow
@pytest.mark.parametrize("step_s", [5e-4, pytest.param(1e-4, marks=pytest.mark.long)])
def test_both_simulators_have_the_same_features(truth, tmp_path, step_s):
    off = truth.errors(truth.by_mujoco(tmp_path, step_s), truth.by_simulator(tmp_path))
    assert set(off) >= {"p_first", "p_steady", "f_steady", "delta_t", "dp_dt", "df_dt"}
    assert max(off.values()) < 0.01, off


def extreme(folder, mass_kg, friction, speed_m_s, step_s):
    # Nearly as wide as the opening, so that the slowest fingers have a short way.
    (folder / "wide.xml").write_text(
        '<mujoco><worldbody><body name="wide"><freejoint/><geom type="box" size="0.042 0.02 0.02" mass="1"/></body>'
        "</worldbody></mujoco>"
    )
    scene = folder / "scene.toml"
    scene.write_text(
        f'thing = "wide.xml"\ntable = true\nmass_kg = {mass_kg}\nfriction = {friction}\n'
        "arm = [[0.0, 0.0], [0.3, 0.03]]\n"
    )
    steps = {"timestep_s": step_s, "rate_hz": min(1000.0, 1.0 / step_s)}
    gripper = create("sensor-backend", "mujoco", object=str(scene), spread=False, **steps)
    servo = {"sends": "velocity", "move_timeout_s": 2.0}
    controller = create("controller", "hybrid", closing_speed_m_s=speed_m_s, **servo)
    return run_uninterrupted(gripper, controller, RunConfig(hold_s=0.35))


@pytest.mark.slow
@given(
    mass_kg=st.sampled_from([0.001, 0.1, 10.0]),
    friction=st.sampled_from([0.0, 0.5, 2.0]),
    speed_m_s=st.sampled_from([0.001, 0.05, 0.5]),
    step_s=st.sampled_from([1e-4, 1e-3, 5e-3]),
)
@example(mass_kg=0.001, friction=2.0, speed_m_s=0.5, step_s=5e-3)
@example(mass_kg=10.0, friction=0.0, speed_m_s=0.5, step_s=5e-3)
@settings(max_examples=2, deadline=None)
def test_a_grasp_at_the_ends_of_every_range_is_finite_or_says_why_it_ended(
    tmp_path_factory, mass_kg, friction, speed_m_s, step_s
):
    grasp = extreme(tmp_path_factory.mktemp("extreme"), mass_kg, friction, speed_m_s, step_s)
    if grasp.outcome == Outcome.DEVICE_LOST:
        assert "MuJoCo warns" in grasp.reason
    assert np.isfinite(grasp.trace.force_left_n).all()
    assert np.isfinite(grasp.trace.gap_m).all()
    assert math.isfinite(float(grasp.report["greatest_force_n"]))


def test_the_test_move_finds_the_mass_of_the_gap(truth, tmp_path, monkeypatch):
    """The stop at the open end takes half of the force that opens: a mass from there would be twice the true one."""
    settings = {}
    monkeypatch.setattr(truth, "_features", lambda gripper, **given: settings.update(given))
    truth.by_mujoco(tmp_path, 5e-4)
    gripper = create("sensor-backend", "mujoco", **settings)
    number = gripper.open(0).numbers["moving_mass_kg"]
    gripper.close()
    # Both fingers of 60 g move with half of the speed of the gap.
    assert number == pytest.approx(truth.MASS_KG + 2 * 0.06 / 4, rel=1e-3)
