"""Grasps with grippers that MuJoCo models describe, checked against what the mechanics give by hand. Simulated."""

import os

import pytest
from cases import every_case
from commands import graspsense, printed

from graspsense import ConfigError, load_pipeline
from graspsense.plugin_api import EFFORT, Command, DeviceLost, UnknownName, create
from graspsense.testing_api import parametrize_checks
from graspsense_mujoco_gripper.catalogue import FOLDER

PARALLEL = FOLDER.parent / "parallel.xml"


@pytest.mark.slow
@parametrize_checks("graspsense-mujoco-gripper", wheel=False)  # .ci/mujoco runs from the wheel
def test_the_distribution_conforms(check):
    check.run()


HINGED = """<mujoco>
  <compiler angle="radian"/>
  <option impratio="20" cone="elliptic"/>
  <worldbody><body name="palm"><geom type="box" size="0.02 0.04 0.01" mass="1"/>
    <body name="a" pos="0 -0.035 0"><joint name="ja" type="hinge" axis="1 0 0" range="-0.7 0.5" damping="0.02"/>
      <geom name="pa" type="box" size="0.01 0.003 0.02" pos="0 -0.012 0.09" euler="0.2 0 0" mass="0.05"/></body>
    <body name="b" pos="0 0.035 0"><joint name="jb" type="hinge" axis="1 0 0" range="-0.5 0.7" damping="0.02"/>
      <geom name="pb" type="box" size="0.01 0.003 0.02" pos="0 0.012 0.09" euler="-0.2 0 0" mass="0.05"/></body>
  </body></worldbody>
  <actuator>
    <position name="ma" joint="ja" kp="5" ctrlrange="-0.6 0.5"/>
    <position name="mb" joint="jb" kp="5" ctrlrange="-0.5 0.6"/>
  </actuator>
</mujoco>"""
"""Two fingers that turn, each with an actuator of its own."""


def hinged_file(folder, **changed):
    """Write the file of the gripper with two fingers that turn."""
    return gripper_file(
        folder,
        folder / "hinged.xml",
        **{
            "actuators": '["ma", "mb"]',
            "open": "[0.3, -0.3]",
            "closed": "[-0.4, 0.4]",
            "gap": '{ geoms = ["pa", "pb"] }',
            "left": '{ geoms = ["pa"] }',
            "right": '{ geoms = ["pb"] }',
            **changed,
        },
    )


GENTLE = "controller.closing_speed_m_s=0.03"
"""For what a faster finger would break."""


def grasped(*options, thing="can", seed=0):
    pipeline = load_pipeline(
        "default",
        options=[
            "gripper.type=mujoco",
            "classifier.type=none",
            "gripper.spread=false",
            "controller.closing_speed_m_s=0.1",
            *options,
        ],
    )
    return pipeline.grasp(object=thing, seed=seed)


def gripper_file(folder, model=PARALLEL, **changed):
    """Write the file of the parallel gripper with some lines changed."""
    lines = {
        "model": f"'{model}'",
        "actuators": '["close"]',
        "open": "[-20.0]",
        "closed": "[20.0]",
        "gap": '{ sites = ["left_face", "right_face"] }',
        "left": '{ geoms = ["left_pad"] }',
        "right": '{ geoms = ["right_pad"] }',
        **changed,
    }
    path = folder / "gripper.toml"
    path.write_text("".join(f"{key} = {value}\n" for key, value in lines.items()))
    return path


def opened(file="", thing="block"):
    """Open a gripper of this file around a thing."""
    create("sensor-backend", "mujoco", file=str(file), object=thing).open(0)


def test_a_can_yields_as_its_springs_do():
    """Two walls of 18 000 N/m in series yield by 20 N / 9000 N/m; the contacts yield by a few hundredths of a mm."""
    trial = grasped(GENTLE)
    assert trial.outcome.words == "steady"
    assert trial.features["f_steady"] == pytest.approx(20.0, abs=0.1)
    assert trial.features["p_steady"] == pytest.approx(0.0662 - 20.0 / 9000.0, abs=1e-4)
    assert trial.features["p_first"] == pytest.approx(0.0662, abs=3e-4)


@pytest.mark.parametrize("sends", [pytest.param("effort", marks=pytest.mark.slow), "velocity"])
def test_a_block_is_as_wide_as_it_is_and_both_pads_feel_the_effort(sends):
    trial = grasped(f"controller.sends={sends}", thing="block")
    assert trial.outcome.words == "steady"
    assert trial.features["p_steady"] == pytest.approx(0.040, abs=2e-4)
    assert trial.features["f_steady"] == pytest.approx(20.0, abs=0.2)


@pytest.mark.slow
def test_an_egg_survives_20_newtons_and_breaks_at_60():
    whole, broken = (grasped(GENTLE, f"controller.probing_force_n={n}", thing="egg") for n in (20, 60))
    assert (whole.outcome.words, whole.report["broken"]) == ("steady", False)
    assert (broken.outcome.words, broken.report["broken"]) == ("crushed", True)


@pytest.mark.slow
def test_a_light_gripper_under_gains_for_a_heavy_one_says_so(tmp_path):
    text = (
        PARALLEL.read_text()
        .replace('armature="20"', 'armature="0.5"')
        .replace('damping="600"', 'damping="20"')
    )
    (tmp_path / "light.xml").write_text(text)
    file = gripper_file(tmp_path, tmp_path / "light.xml")
    trial = grasped(f"gripper.file={file}", thing="block")
    assert "controller.sends=velocity" in trial.report["unstable_loop"]
    assert (
        "unstable_loop"
        not in grasped(f"gripper.file={file}", "controller.sends=velocity", thing="block").report
    )


@pytest.mark.slow
def test_the_gap_may_come_from_a_joint_or_from_geoms(tmp_path):
    joint = gripper_file(tmp_path, gap='{ joint = "left", scale = -2.0, offset_m = 0.09 }')
    by_joint = grasped(f"gripper.file={joint}", thing="block")
    geoms = gripper_file(tmp_path, gap='{ geoms = ["left_pad", "right_pad"] }')
    by_geoms = grasped(f"gripper.file={geoms}", thing="block")
    assert by_joint.features["p_steady"] == pytest.approx(by_geoms.features["p_steady"], abs=2e-4)


@pytest.mark.slow
def test_a_touch_sensor_measures_the_force_of_the_contacts(tmp_path):
    text = PARALLEL.read_text()
    for side in ("left", "right"):
        text = text.replace(
            f'<site name="{side}_face" pos="0 0 0"/>',
            f'<site name="{side}_face" pos="0 0 0"/><site name="{side}_zone" type="box" size="0.006 0.012 0.012"/>',
        )
    text = text.replace(
        "</mujoco>",
        '<sensor><touch name="lt" site="left_zone"/><touch name="rt" site="right_zone"/></sensor></mujoco>',
    )
    (tmp_path / "touch.xml").write_text(text)
    file = gripper_file(
        tmp_path,
        tmp_path / "touch.xml",
        left='{ geoms = ["left_pad"], sensor = "lt" }',
        right='{ geoms = ["right_pad"], sensor = "rt" }',
    )
    trial = grasped(f"gripper.file={file}", thing="can")
    assert trial.features["f_steady"] == pytest.approx(20.0, abs=0.2)


@every_case(
    ("changed", "said"),
    [
        ({"actuators": '["nosuch"]'}, ("actuator", "nosuch", "close")),
        ({"left": '{ geoms = ["nosuch"] }'}, ("geom", "nosuch", "left_pad")),
        ({"left": '{ geoms = ["left_pad"], sensor = "nosuch" }'}, ("sensor", "nosuch")),
        ({"open": "[20.0]", "closed": "[-20.0]"}, ("do not close",)),
        ({"open": "[1.0, 2.0]"}, ("open has 2 values",)),
        ({"gap": "{ }"}, ("one of sites, geoms and joint",)),
        ({"actuator": '["close"]'}, ("actuator", "actuators")),
        ({"channels": '{ palm = { sensor = "nosuch", unit = "m/s2" } }'}, ("sensor", "nosuch")),
        (
            {
                "gap": '{ left = [{ body = "nosuch", at = [0, 0, 0] }], right = [{ body = "left", at = [0, 0, 0] }] }'
            },
            ("body", "nosuch", "palm"),
        ),
        ({"angle": '"turns"'}, ("radian", "degree")),
        ({"impratio": "-1.0"}, ("impratio",)),
        ({"model": "nosuch.xml"}, ("nosuch.xml",)),
        ({"model": "package:nosuchpackage:a.xml"}, ("pip install nosuchpackage",)),
        # The package is not among those of the tests; .ci/mujoco tries it where it is installed.
        ({"model": "menagerie:robotiq_2f85"}, ("menagerie:robotiq_2f85",)),
    ],
)
def test_a_gripper_file_that_is_wrong_says_what_is(tmp_path, changed, said):
    file = gripper_file(tmp_path, **changed)
    with pytest.raises(ConfigError) as error:
        opened(file)
    assert all(word in str(error.value) for word in said), error.value


def test_a_gripper_file_that_is_missing_is_told_as_such():
    with pytest.raises(ConfigError, match="cannot be read") as error:
        load_pipeline("default", options=["gripper.type=mujoco", "gripper.file=nosuch.toml"])
    assert "pip install" not in str(error.value)


@every_case("include", ["../secret.xml", "&#46;&#46;/secret.xml", "/etc/hostname"])
def test_a_model_includes_nothing_outside_of_its_folder(tmp_path, include):
    inside = tmp_path / "model"
    inside.mkdir()
    (tmp_path / "secret.xml").write_text("<mujocoinclude/>")
    (inside / "m.xml").write_text(f"<mujoco><include\n file='{include}'/></mujoco>")
    with pytest.raises(ConfigError, match=r"m\.xml includes (\.\./secret\.xml|/etc/hostname)"):
        opened(gripper_file(inside, inside / "m.xml"))


@every_case("place", ["gripper file", "model", "include", "mesh", "picture", "scene", "thing"])
def test_a_pipe_in_the_place_of_a_file_is_refused(tmp_path, place):
    """Whoever opens a pipe without a writer waits for ever; MuJoCo opens meshes and pictures itself."""
    endings = {"gripper file": ".toml", "scene": ".toml", "mesh": ".obj", "picture": ".png"}
    pipe = tmp_path / f"pipe{endings.get(place, '.xml')}"
    os.mkfifo(pipe)
    added = {
        "include": f'<include file="{pipe.name}"/>',
        "mesh": f'<asset><mesh name="m" file="{pipe.name}"/></asset>',
        "picture": f'<asset><texture name="t" type="2d" file="{pipe.name}"/></asset>',
    }.get(place, "")
    (tmp_path / "m.xml").write_text(PARALLEL.read_text().replace("<worldbody>", added + "<worldbody>", 1))
    file = gripper_file(tmp_path, pipe if place == "model" else tmp_path / "m.xml")
    with pytest.raises((ConfigError, UnknownName), match="pipe"):
        opened(
            pipe if place == "gripper file" else file, str(pipe) if place in ("scene", "thing") else "block"
        )


def test_a_thing_that_is_wider_than_the_opening_is_refused(tmp_path):
    (tmp_path / "wide.xml").write_text(
        '<mujoco><worldbody><body name="wide" gravcomp="1"><freejoint/>'
        '<geom type="box" size="0.06 0.02 0.02" mass="1"/></body></worldbody></mujoco>'
    )
    with pytest.raises(ConfigError, match=r"wide\.xml .*90\.0 mm"):
        opened("", str(tmp_path / "wide.xml"))


def test_an_unknown_thing_proposes_the_nearest():
    with pytest.raises(UnknownName, match="block"):
        opened("", "blok")


def test_an_unstable_simulation_ends_with_its_reason_and_writes_nothing(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "wild.xml").write_text(
        '<mujoco><worldbody><body name="wild" gravcomp="1"><freejoint/><geom type="box" size="0.02 0.02 0.02" '
        'mass="0.1"/><body><joint name="j" type="slide" stiffness="-1e9"/><geom size="0.001" mass="1e-6" '
        'contype="0" conaffinity="0"/></body></body></worldbody></mujoco>'
    )
    backend = create("sensor-backend", "mujoco", object=str(tmp_path / "wild.xml"), spread=False)
    backend.open(0)
    backend._data.qpos[-1] = 1e-3

    def simulate():
        for _ in range(100):
            backend.read(0.1)
            backend.apply(Command(EFFORT, 0.0, 1.0, 1.0))

    with pytest.raises(DeviceLost, match="unstable"):
        simulate()
    assert [path.name for path in tmp_path.iterdir()] == ["wild.xml"]


@pytest.mark.slow
def test_several_actuators_keep_together_and_a_thing_is_put_where_turning_fingers_meet_it(tmp_path):
    """Two hinged fingers with an actuator each; they press at another place than where the gap is measured."""
    (tmp_path / "hinged.xml").write_text(HINGED)
    trial = grasped(
        f"gripper.file={hinged_file(tmp_path)}",
        "controller.sends=velocity",
        "controller.probing_force_n=5",
        thing="egg",
    )
    assert trial.outcome.words == "steady"
    assert trial.features["f_steady"] == pytest.approx(5.0, rel=0.3)


def test_angles_in_radians_are_asked_for_where_hinges_hardly_turn(tmp_path):
    text = (
        HINGED.replace('angle="radian"', "").replace("-0.7 0.5", "-0.3 0.05").replace("-0.5 0.7", "-0.05 0.3")
    )
    (tmp_path / "hinged.xml").write_text(text)
    with pytest.raises(ConfigError, match='angle = "radian"'):
        opened(hinged_file(tmp_path))
    opened(hinged_file(tmp_path, angle='"radian"'))


def test_what_is_no_finger_can_be_left_out_of_the_contacts(tmp_path):
    """A box of the palm between the fingers stands for the hull of a mesh that is hollow there."""
    text = PARALLEL.read_text()
    filled = text.replace('<body name="left"', '<geom type="box" size="0.02 0.02 0.02"/><body name="left"', 1)
    assert filled != text
    (tmp_path / "filled.xml").write_text(filled)
    file = gripper_file(tmp_path, tmp_path / "filled.xml")
    with pytest.raises(ConfigError, match="penetrates"):
        opened(file)
    opened(gripper_file(tmp_path, tmp_path / "filled.xml", only_fingers="true"))


def test_fingers_that_are_not_opposed_are_refused(tmp_path):
    both = gripper_file(tmp_path, right='{ geoms = ["left_pad"] }')
    with pytest.raises(ConfigError, match="left_pad"):
        opened(both)
    away = gripper_file(
        tmp_path,
        gap='{ joint = "left", scale = -2.0, offset_m = 0.09 }',
        left='{ geoms = ["right_pad"] }',
        right='{ geoms = ["left_pad"] }',
        closing="[0.0, 1.0, 0.0]",
    )
    with pytest.raises(ConfigError, match="not opposed"):
        opened(away)


@every_case(
    ("old", "new", "said"),
    [
        ('damping="600"', 'damping="a"', "MuJoCo .* refuses"),
        ('damping="600"', 'damping="nan"', "not finite|refuses|nan"),
        ('pos="0.045 0 0"', 'pos="nan 0 0"', "not finite|refuses|nan"),
        # A library comes from the folder of MuJoCo only: the file of another is not opened.
        ("<worldbody>", '<extension><plugin plugin="/tmp/evil.so"/></extension><worldbody>', "refuses.*evil"),
    ],
)
def test_a_model_that_mujoco_does_not_take_is_refused_with_its_message(tmp_path, old, new, said):
    text = PARALLEL.read_text()
    assert old in text
    (tmp_path / "m.xml").write_text(text.replace(old, new))
    with pytest.raises(ConfigError, match=said):
        opened(gripper_file(tmp_path, tmp_path / "m.xml"))


def test_a_gripper_file_is_written_from_a_model_and_grasps_as_it_is(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    told = printed("plugins", "new", "lab-hand", "--role", "sensor-backend", "--mujoco", PARALLEL)
    assert "close" in told
    assert "Left to fill in" in told
    trial = grasped("gripper.file=lab-hand.toml", thing="block")
    assert (trial.outcome.words, trial.features["f_steady"]) == ("steady", pytest.approx(20.0, abs=0.2))
    again = graspsense("plugins", "new", "lab-hand", "--role", "sensor-backend", "--mujoco", PARALLEL)
    assert again.returncode == 2
    assert "there already" in again.stderr


def test_a_model_without_opposed_fingers_gets_no_gripper_file(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "arm.xml").write_text(
        '<mujoco><worldbody><body name="arm"><joint name="j" type="slide" axis="1 0 0" range="0 1"/>'
        '<geom size="0.1"/></body></worldbody><actuator>'
        '<position joint="j" ctrlrange="0 1" kp="10"/></actuator></mujoco>'
    )
    made = graspsense("plugins", "new", "lab-hand", "--role", "sensor-backend", "--mujoco", "arm.xml")
    assert made.returncode == 2
    assert "opposed" in made.stderr
    assert not (tmp_path / "lab-hand.toml").exists()
