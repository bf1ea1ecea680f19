"""A scene that shakes the gripper, and bottles with a wave in them. Simulated."""

import math

import numpy as np
import pytest
from cases import every_case
from hypothesis import given
from hypothesis import strategies as st

from graspsense import ConfigError
from graspsense.plugin_api import POSITION, Command, create
from graspsense_mujoco_gripper.catalogue import Contents
from graspsense_mujoco_gripper.scene import Shake, read_scene

STATES = [f"flask_{fill}:{state}" for fill in ("full", "half", "empty") for state in ("closed", "open")]


def backend(**settings):
    return create("sensor-backend", "mujoco", file="soft_pads", timestep_s=0.00033334, **settings)


def mass_kg(model):
    return sum(model.body_mass[k] for k in range(model.nbody) if model.body(k).name.startswith("thing/"))


@given(t_s=st.floats(-1.0, 5.0), cycles=st.floats(2.0, 10.0))
def test_a_shake_begins_and_ends_at_rest_and_stays_within_its_amplitude(t_s, cycles):
    shake = Shake(amplitude_m=0.01, frequency_hz=4.0, start_s=0.5, cycles=cycles)
    assert abs(shake.place_m(t_s)) <= shake.amplitude_m
    if not shake.start_s < t_s < shake.end_s:
        assert shake.place_m(t_s) == 0.0


@pytest.mark.slow
def test_the_gripper_follows_the_shake_and_tells_it(scene_file):
    shake = ("[shake]", "amplitude_m = 0.01", "frequency_hz = 4.0", "start_s = 0.0")
    gripper = backend(object=scene_file('thing = "block"', *shake), spread=False)
    assert gripper.channels[-1].name == "shake"
    assert "shake" not in [channel.name for channel in backend(object="tugged").channels]
    gripper.open(0)
    told, felt = [], []
    for _ in range(1300):
        gripper.apply(Command(POSITION, 0.039, 50.0, 0.1))
        signals = gripper.read(1.0).signals
        told.append(signals.shake)
        felt += [row[0] for row in signals.acceleration.values]
    # Whole in the second of its three periods.
    assert max(told) == pytest.approx(0.01, rel=0.05)
    assert told[-1] == pytest.approx(0.0, abs=1e-4)
    assert max(felt) > 0.01 * (2 * math.pi * 4.0) ** 2


@every_case(("fill", "depth_m"), [(0.5, 0.085), (0.1, 0.017)])
def test_a_wave_has_the_figures_of_a_liquid_in_a_cylinder(fill, depth_m):
    contents = Contents(mass_kg=0.45, fill=fill, radius_m=0.029, height_m=0.17)
    tanh = math.tanh(1.8412 * depth_m / 0.029)
    assert contents.wave_rad_s**2 == pytest.approx(1.8412 * 9.81 / 0.029 * tanh, rel=1e-3)
    share = contents.wave_kg / (fill * 0.45)
    assert share == pytest.approx(2 * 0.029 * tanh / (1.8412 * (1.8412**2 - 1) * depth_m), rel=1e-3)


def test_of_a_shallow_liquid_most_moves_and_of_a_full_bottle_nothing():
    """The share of the first wave in a shallow liquid is 2 / (x^2 - 1) = 0.837."""
    shallow = Contents(mass_kg=1.0, fill=1e-3, radius_m=0.05, height_m=0.1)
    assert shallow.wave_kg / 1e-3 == pytest.approx(0.837, abs=0.002)
    assert Contents(mass_kg=1.0, fill=1.0, radius_m=0.05, height_m=0.1).wave_kg == 0.0


def test_a_liquid_weighs_the_same_with_and_without_a_wave():
    masses = {"flask_full:open": 0.15 + 0.45, "flask_half:closed": 0.15 + 0.225, "flask_empty:open": 0.15}
    assert {name: mass_kg(_opened(name)) for name in masses} == pytest.approx(masses)
    model = _opened("flask_half:open")
    wave = model.joint("thing/flask_half:open_wave_x")
    moving_kg = model.body("thing/flask_half:open_wave").mass[0]
    assert np.ravel(wave.stiffness)[0] / moving_kg == pytest.approx(1.8412 * 9.81 / 0.029, rel=1e-3)


def _opened(name, spread=False):
    """Return the model of a shaken thing."""
    gripper = backend(object=name, scene="shaken", spread=spread)
    gripper.open(0)
    return gripper._model


def test_a_bottle_is_the_same_in_each_of_its_states():
    """Closed and open differ in stiffness; the instance decides by which factor, and of mass and size."""
    closed, opened = (
        [mass_kg(_opened(f"flask_half:{state}#{k}", spread=True)) for k in (1, 2)]
        for state in ("closed", "open")
    )
    assert closed == opened
    assert closed[0] != closed[1]
    assert {name for kind in backend().objects() for name in kind.full_names} >= set(STATES)


def test_a_scene_takes_another_thing():
    scene = read_scene("can", "shaken").scene
    assert scene.thing == "can"
    assert scene.shake == read_scene("shaken").scene.shake


@every_case(
    ("thing", "scene", "said"),
    [("tugged", "shaken", "object"), ("block", "shakn", "shaken"), ("block", "missing.toml", "missing.toml")],
)
def test_a_scene_that_cannot_be_says_why(thing, scene, said):
    with pytest.raises(ConfigError, match=said):
        read_scene(thing, scene)


@every_case(
    ("name", "value"),
    [
        ("amplitude_m", 0.0),
        ("frequency_hz", -1.0),
        ("cycles", 1.0),
        ("direction", (0.0, 0.0, 0.0)),
        ("start_s", math.nan),
    ],
)
def test_a_shake_that_cannot_be_is_refused(name, value):
    with pytest.raises(ValueError, match=name):
        Shake(**{"amplitude_m": 0.01, "frequency_hz": 3.0, "start_s": 1.0, name: value})
