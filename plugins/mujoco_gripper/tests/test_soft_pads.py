"""The gripper with soft pads, its accelerometer, and scenes that are filled and put down. Simulated."""

import numpy as np
import pytest
from cases import every_case

from graspsense.plugin_api import POSITION, Command, create
from graspsense_mujoco_gripper.config import MujocoConfig
from graspsense_mujoco_gripper.gripper_file import Finger, PalmSensor
from graspsense_mujoco_gripper.prepared import prepare

pytestmark = pytest.mark.slow
CELL_N_M = 1500.0
STEP_S = 0.00033334
RIGID = 'solref="0.002 1" solimp="0.99 0.999 0.0001"'


def opened(thing, **settings):
    exact = {"timestep_s": STEP_S, "spread": False, "force_noise_n": 0.0}
    backend = create("sensor-backend", "mujoco", file="soft_pads", object=str(thing), **exact, **settings)
    backend.open(0)
    return backend


@pytest.fixture
def scene(scene_file):
    """Opens a gripper around a block on a table, in a scene with these lines besides."""
    return lambda *lines: opened(scene_file('thing = "block"', "table = true", *lines))


def squeezed(backend, gap_m, ticks):
    """Close to a gap and return the last reading."""
    for _ in range(ticks):
        backend.apply(Command(POSITION, gap_m, 50.0, 0.15))
        reading = backend.read(1.0)
    return reading


def thing_file(folder, geom):
    path = folder / "thing.xml"
    path.write_text(
        f'<mujoco><worldbody><body name="thing"><freejoint/><geom {geom} mass="0.05" {RIGID}/></body></worldbody>'
        "</mujoco>"
    )
    return path


def test_a_cell_image_is_the_pressure_of_a_bed_of_springs(tmp_path):
    """A sphere of radius R compresses a spring at the distance r from its centre by r^2 / 2R less (Winkler's bed).

    The tips of the cells are spheres of 1.9 mm, which makes R larger by as much.
    """
    backend = opened(thing_file(tmp_path, 'type="sphere" size="0.02"'))
    reading = squeezed(backend, 0.0395, 600)
    image = np.array(reading.pads.left).reshape(5, 3)
    rows, columns = np.meshgrid([-8, -4, 0, 4, 8], [-4, 0, 4], indexing="ij")
    deeper_m = (rows**2 + columns**2) * 1e-6 / (2.0 * (0.02 + 0.0019))
    expected = np.maximum(image[2, 1] - CELL_N_M * deeper_m, 0.0)
    assert image[2, 1] > 0.3
    assert image == pytest.approx(expected, abs=0.06)
    assert reading.frame.force_left_n == pytest.approx(image.sum())


def test_the_palm_feels_gravity_and_the_motion_of_the_fingers():
    backend = opened("none")
    still = [backend.read(1.0).signals.acceleration for _ in range(200)]
    assert still[-1].new == 3
    assert still[-1].counter == 600
    values = np.concatenate([acceleration.values for acceleration in still[100:]])
    assert values.mean(axis=0) == pytest.approx([0.0, 0.0, 9.81], abs=0.05)
    moving = []
    for _ in range(200):
        backend.apply(Command(POSITION, 0.05, 50.0, 0.1))
        moving.append(backend.read(1.0).signals.acceleration)
    # 0.2 m/s2 of floor noise, and 27 1/s times 0.1 m/s of gear noise.
    assert np.concatenate([samples.values for samples in moving[100:]])[:, 1].std() > 5.0 * values[:, 1].std()


def test_a_thing_that_is_filled_weighs_more(scene):
    backend = scene("fill = [[0.0, 0.0], [0.2, 0.3]]")
    squeezed(backend, 0.035, 700)
    model = backend._model
    masses = [model.body_mass[k] for k in range(model.nbody) if model.body(k).name.startswith("thing/")]
    assert sum(masses) == pytest.approx(0.15 + 0.3)


def test_the_table_rises_as_the_scene_says(scene):
    backend = scene("table_height = [[0.0, 0.0], [0.2, 0.02]]")
    resting_m = float(backend._data.mocap_pos[0, 2])
    squeezed(backend, 0.035, 700)
    assert backend._data.mocap_pos[0, 2] - resting_m == pytest.approx(0.02)


def test_roughness_disturbs_cells_that_slide_and_no_others(scene):
    backend = scene("friction = 0.05", "roughness_m = 4e-5")
    still = [squeezed(backend, 0.0395, 800 if k == 0 else 1).frame.force_left_n for k in range(100)]
    thing = next(k for k in range(backend._model.nbody) if backend._model.body(k).name.startswith("thing/"))
    sliding = []
    for _ in range(100):
        backend._data.xfrc_applied[thing, 1] = 3.0
        sliding.append(squeezed(backend, 0.0395, 1).frame.force_left_n)
    assert np.std(sliding) > 5.0 * np.std(still)


@every_case(
    ("wrong", "said"),
    [
        (lambda: Finger(geoms=("a",), cells=("a", "b"), rows=1, columns=1), "cells"),
        (lambda: Finger(geoms=("a",), cells=("a",)), "rows"),
        (lambda: Finger(geoms=("a",), cells=("a",), sensor="s", rows=1, columns=1), "sensor"),
        (lambda: PalmSensor(sensor="a", floor_m_s2=-1.0), "floor"),
    ],
)
def test_a_gripper_file_that_cannot_be_says_why(wrong, said):
    with pytest.raises(ValueError, match=said):
        wrong()


def bumped(backend):
    """Close on a block that a scene bumps; return the forces on both edges over time."""
    edges = []
    for _ in range(1200):
        frame = squeezed(backend, 0.0395, 1).frame
        edges.append((frame.edge_left_n, frame.edge_right_n))
    return np.array(edges)


def test_a_bump_gives_the_edge_of_the_finger_the_momentum_of_the_ball(scene):
    ball = ("mass_kg = 0.02", "speed_m_s = 0.5", "touch_s = 0.03")
    left, right = bumped(scene("[bump]", "t_s = 0.2", *ball)).T
    # A rigid finger would return exp(-0.1 pi) = 73 % of the speed; one on a wrist that yields returns less.
    assert 1.0 < left.sum() * 1e-3 / (0.02 * 0.5) < 1.75
    assert np.flatnonzero(left).size == pytest.approx(30, abs=5)
    assert not right.any()


def test_edges_do_not_feel_a_bump_into_the_thing(scene):
    assert not bumped(scene("[bump]", "t_s = 0.2", 'at = "thing"', "speed_m_s = 0.5")).any()


def test_walls_have_a_soft_contact_with_cells_and_a_stiff_one_else():
    stiff, soft = (prepare(MujocoConfig(file=file, object="cup"), 1e-3) for file in ("", "soft_pads"))
    for prepared, contact_s in ((stiff, 0.001), (soft, 0.004)):
        model = prepared.with_thing(np.random.default_rng(0))
        walls = [k for k in range(model.ngeom) if model.geom(k).name.endswith(("cup_left", "cup_right"))]
        assert len(walls) == 2
        assert model.geom_solref[walls, 0] == pytest.approx([contact_s, contact_s])
