"""Scenes: things on a table that are lifted, put down and pulled, against what statics gives by hand. Simulated."""

from importlib.resources import files

import mujoco
import pytest
from cases import every_case

from graspsense import ConfigError
from graspsense.plugin_api import create
from graspsense.simulator_api import toml_values
from graspsense_mujoco_gripper.catalogue import FOLDER, catalogue
from graspsense_mujoco_gripper.scene import read_scene

LIFT = "arm = [[0.2, 0.0], [0.7, 0.05], [0.8, 0.05]]\n"
LIFT_AND_PUT_DOWN = "arm = [[0.2, 0.0], [0.6, 0.05], [0.7, 0.05], [1.1, 0.0], [1.3, 0.0]]\n"


@pytest.fixture
def in_scene(grasped, scene_file):
    """Grasps in the scene of these lines with a servo, and holds for as long as the arm moves."""

    def grasp(*lines, options=(), hold_s=1.0):
        options = ("controller.sends=velocity", f"run.hold_s={hold_s}", *options)
        return grasped(*options, thing=scene_file(*lines))

    return grasp


@pytest.mark.slow
def test_a_block_is_lifted_from_the_table_as_far_as_the_arm_moves_and_put_down_again(in_scene):
    trial = in_scene('thing = "block"', "table = true", LIFT_AND_PUT_DOWN, hold_s=1.4)
    assert trial.outcome.words == "steady"
    assert trial.report["highest_m"] == pytest.approx(0.05, abs=0.002)
    assert trial.report["height_m"] == pytest.approx(0.0, abs=0.001)


@pytest.mark.slow
def test_a_block_that_is_too_heavy_for_the_friction_stays_on_the_table(in_scene):
    """Two fingers of 20 N hold 2 * 0.6 * 20 N = 24 N; 10 kg weigh 98 N."""
    trial = in_scene('thing = "block"', "table = true", "mass_kg = 10.0", LIFT)
    assert trial.report["highest_m"] < 0.005


@pytest.mark.slow
def test_a_cord_pulls_a_thing_out_where_it_is_stronger_than_the_friction(in_scene):
    """Two fingers of 20 N hold 2 * 0.6 * 20 N = 24 N."""
    cord = "cord = { direction = [0, 0, -1], force = [[0.2, 0.0], [0.8, %s]] }"
    held, lost = (in_scene('thing = "block"', cord % force_n).report["height_m"] for force_n in (18.0, 30.0))
    assert held > -0.005
    assert lost < -0.03


@pytest.mark.slow
def test_contents_of_a_bottle_stay_in_it_when_it_is_lifted(in_scene):
    # Faster fingers crush it.
    gentle = ("controller.closing_speed_m_s=0.04",)
    trial = in_scene('thing = "bottle"', "table = true", LIFT, options=gentle)
    assert trial.outcome.words == "steady"
    # Of all its parts together, the loose balls too.
    assert trial.report["highest_m"] == pytest.approx(0.05, abs=0.01)


@pytest.mark.slow
def test_a_sponge_yields_more_than_a_block_and_is_lifted(in_scene):
    trial = in_scene('thing = "sponge"', "table = true", LIFT, options=("controller.probing_force_n=5",))
    assert trial.outcome.words == "steady"
    assert trial.features["p_first"] - trial.features["p_steady"] > 0.002
    assert trial.report["highest_m"] > 0.03


@every_case(
    ("lines", "said"),
    [
        (("arm = [[0.5, 0.1], [0.2, 0.0]]",), "arm.*rise"),
        (("arm = [[0.5]]",), "arm.*pairs"),
        (("cord = { force = [[0, 1]], direction = [0, 0, 0] }",), "direction"),
        (("mass_kg = -1.0",), "mass_kg"),
        (("fill = [[0.0, -1.0]]",), "fill"),
        (("roughness_m = 1.0",), "roughness_m"),
        (("table = false", "table_height = [[0.0, 0.0]]"), "table"),
        (("[bump]", "t_s = 0.2", "speed_m_s = 0.0"), "speed_m_s"),
        (("[bump]", "t_s = 0.2", "mass_kg = nan"), "mass_kg"),
        (("[bump]", "t_s = 0.2", "touch_s = 0.2"), "touch_s"),
        (("[bump]", "t_s = 0.2", 'at = "table"'), "finger"),
        # The gripper has no sensor at its edge.
        (("table = true", "[bump]", "t_s = 0.2"), "edge"),
        (("mas = 1.0",), "mas.*mass_kg"),
        (("table = [",), "scene.toml:3"),
    ],
)
def test_a_scene_file_that_is_wrong_says_what_is(scene_file, lines, said):
    opens_wrongly(scene_file('thing = "block"', *lines), said)


@every_case(("line", "said"), [("table = true", "thing"), ('thing = "blok"', "block")])
def test_a_scene_without_a_thing_says_so_and_an_unknown_one_proposes_the_nearest(scene_file, line, said):
    opens_wrongly(scene_file(line), said)


def opens_wrongly(scene, said):
    with pytest.raises(ConfigError, match=f"(?s){said}"):
        create("sensor-backend", "mujoco", object=scene).open(0)


def test_every_thing_compiles_and_says_where_its_figures_are_from():
    things = catalogue()
    assert {path.stem for path in FOLDER.glob("*.xml")} == {n for n, t in things.items() if t.walls is None}
    for name, thing in things.items():
        assert isinstance(read_scene(name).spec.compile(), mujoco.MjModel)
        assert thing.figures
        if thing.walls is not None:
            contents = {"contents"} if thing.walls.contents else set()
            walls = {"width_m", "stiffness_n_m", "damping_n_s_m", "mass_kg", "friction"}
            assert set(thing.figures) == walls | contents
    for scene in ("tugged", "filled", "placed", "shaken"):
        assert isinstance(read_scene(scene).spec, mujoco.MjSpec)


@every_case("name", ["can", "odwalla"])
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
        bodies = [backend._model.body(k) for k in range(backend._model.nbody)]
        return sum(body.mass[0] for body in bodies if body.name.startswith("thing/"))

    assert mass("block#1", 1) == mass("block#1", 2)
    assert len({mass("block#1", 1), mass("block#2", 1), mass("block", 1), mass("block", 2)}) == 4
