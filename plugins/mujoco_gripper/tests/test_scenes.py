"""Scenes: things on a table that are lifted, put down and pulled, against what statics gives by hand. Simulated."""

from importlib.resources import files

import mujoco
import pytest
from cases import every_case

from graspsense import ConfigError, load_pipeline
from graspsense.plugin_api import create
from graspsense.simulator_api import toml_values
from graspsense_mujoco_gripper.catalogue import FOLDER, catalogue
from graspsense_mujoco_gripper.scene import read_scene

LIFT = "arm = [[0.2, 0.0], [0.7, 0.05], [0.8, 0.05]]\n"
LIFT_AND_PUT_DOWN = "arm = [[0.2, 0.0], [0.6, 0.05], [0.7, 0.05], [1.1, 0.0], [1.3, 0.0]]\n"


def scene_file(folder, *lines):
    path = folder / "scene.toml"
    path.write_text("\n".join(lines) + "\n")
    return str(path)


def grasped(thing, *options, hold_s=1.0, seed=0):
    """Grasp with a servo and a fast approach, from a gap a little wider than most things."""
    pipeline = load_pipeline(
        "default",
        options=[
            "gripper.type=mujoco",
            "classifier.type=none",
            "gripper.spread=false",
            "controller.sends=velocity",
            "controller.closing_speed_m_s=0.1",
            f"run.hold_s={hold_s}",
            *options,
        ],
    )
    return pipeline.grasp(object=thing, seed=seed)


def test_a_block_is_lifted_from_the_table_as_far_as_the_arm_moves_and_put_down_again(tmp_path):
    trial = grasped(scene_file(tmp_path, 'thing = "block"', "table = true", LIFT_AND_PUT_DOWN), hold_s=1.4)
    assert trial.outcome.words == "steady"
    assert trial.report["highest_m"] == pytest.approx(0.05, abs=0.002)
    assert trial.report["height_m"] == pytest.approx(0.0, abs=0.001)


@pytest.mark.slow
def test_a_block_that_is_too_heavy_for_the_friction_stays_on_the_table(tmp_path):
    """Two fingers of 20 N hold 2 * 0.6 * 20 N = 24 N; 10 kg weigh 98 N."""
    trial = grasped(scene_file(tmp_path, 'thing = "block"', "table = true", "mass_kg = 10.0", LIFT))
    assert trial.report["highest_m"] < 0.005


@pytest.mark.slow
def test_a_cord_pulls_a_thing_out_where_it_is_stronger_than_the_friction(tmp_path):
    """Two fingers of 20 N hold 2 * 0.6 * 20 N = 24 N."""
    cord = "cord = { direction = [0, 0, -1], force = [[0.2, 0.0], [0.8, %s]] }"
    held = grasped(scene_file(tmp_path, 'thing = "block"', cord % 18.0))
    lost = grasped(scene_file(tmp_path, 'thing = "block"', cord % 30.0))
    assert held.report["height_m"] > -0.005
    assert lost.report["height_m"] < -0.03


@pytest.mark.slow
def test_contents_of_a_bottle_stay_in_it_when_it_is_lifted(tmp_path):
    # Faster fingers crush it.
    gentle = "controller.closing_speed_m_s=0.04"
    trial = grasped(scene_file(tmp_path, 'thing = "bottle"', "table = true", LIFT), gentle)
    assert trial.outcome.words == "steady"
    # Of all its parts together, the loose balls too.
    assert trial.report["highest_m"] == pytest.approx(0.05, abs=0.01)


@pytest.mark.slow
def test_a_sponge_yields_more_than_a_block_and_is_lifted(tmp_path):
    trial = grasped(
        scene_file(tmp_path, 'thing = "sponge"', "table = true", LIFT), "controller.probing_force_n=5"
    )
    assert trial.outcome.words == "steady"
    assert trial.features["p_first"] - trial.features["p_steady"] > 0.002
    assert trial.report["highest_m"] > 0.03


@every_case(
    ("lines", "said"),
    [
        (("table = true",), ("thing",)),
        (('thing = "blok"',), ("block",)),
        (('thing = "block"', "arm = [[0.5, 0.1], [0.2, 0.0]]"), ("arm", "rise")),
        (('thing = "block"', "arm = [[0.5]]"), ("arm", "pairs")),
        (('thing = "block"', "cord = { force = [[0, 1]], direction = [0, 0, 0] }"), ("direction",)),
        (('thing = "block"', "mass_kg = -1.0"), ("mass_kg",)),
        (('thing = "block"', "fill = [[0.0, -1.0]]"), ("fill",)),
        (('thing = "block"', "roughness_m = 1.0"), ("roughness_m",)),
        (('thing = "block"', "table = false", "table_height = [[0.0, 0.0]]"), ("table",)),
        (('thing = "block"', "[bump]", "t_s = 0.2", "speed_m_s = 0.0"), ("speed_m_s",)),
        (('thing = "block"', "[bump]", "t_s = 0.2", "mass_kg = nan"), ("mass_kg",)),
        (('thing = "block"', "[bump]", "t_s = 0.2", "touch_s = 0.2"), ("touch_s",)),
        (('thing = "block"', "[bump]", "t_s = 0.2", 'at = "table"'), ("finger",)),
        (('thing = "block"', "mas = 1.0"), ("mas", "mass_kg")),
        (('thing = "block"', "table = ["), ("line",)),
    ],
)
def test_a_scene_file_that_is_wrong_says_what_is(tmp_path, lines, said):
    with pytest.raises(ConfigError) as error:
        create("sensor-backend", "mujoco", object=scene_file(tmp_path, *lines)).open(0)
    assert all(word in str(error.value) for word in said), error.value


def test_every_thing_compiles_and_says_where_its_figures_are_from():
    assert len(catalogue()) >= 10
    assert {path.stem for path in FOLDER.glob("*.xml")} == {
        n for n, t in catalogue().items() if t.walls is None
    }
    for name, thing in catalogue().items():
        scene = read_scene(name)
        assert isinstance(scene.spec.compile(), mujoco.MjModel)
        assert thing.figures
        if thing.walls is not None:
            contents = {"contents"} if thing.walls.contents else set()
            walls = {"width_m", "stiffness_n_m", "damping_n_s_m", "mass_kg", "friction"}
            assert set(thing.figures) == walls | contents


@pytest.mark.parametrize("name", ["can", "odwalla"])
def test_containers_have_the_width_and_the_stiffness_of_the_simulators_catalogue(name):

    text = (files("graspsense_sim_gripper.scene") / "catalogue.toml").read_text(encoding="utf-8")
    container, walls = toml_values(text)[name], catalogue()[name].walls
    shell = next(term for term in container["terms"] if term["type"] == "elastic")
    assert walls.width_m == container["width_m"]["value"]
    assert walls.stiffness_n_m == shell["k1_n_m"]["value"]
    assert walls.mass_kg == container["states"]["empty_open"]["mass_kg"]["value"]


def test_instances_are_the_same_in_every_trial_and_differ_from_one_another():
    def mass(name, seed):
        backend = create("sensor-backend", "mujoco", object=name)
        backend.open(seed)
        model = backend._model
        return sum(
            model.body_mass[k] for k in range(model.nbody) if backend._model.body(k).name.startswith("thing/")
        )

    assert mass("block#1", 1) == mass("block#1", 2)
    assert mass("block#1", 1) != mass("block#2", 1)
    assert mass("block", 1) != mass("block", 2)
