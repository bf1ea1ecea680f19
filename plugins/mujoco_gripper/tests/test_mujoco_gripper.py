"""Grasps with grippers that MuJoCo models describe, checked against what the mechanics give by hand. Simulated."""

import os
import re
import tomllib

import pytest
from cases import every_case
from commands import graspsense

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


def hinged_file(folder, text=HINGED, **changed):
    """Write the file of the gripper with two fingers that turn."""
    ends = {"open": "[0.3, -0.3]", "closed": "[-0.4, 0.4]", "gap": '{ geoms = ["pa", "pb"] }'}
    fingers = {"actuators": '["ma", "mb"]', "left": '{ geoms = ["pa"] }', "right": '{ geoms = ["pb"] }'}
    return gripper_with(folder, text, **{**ends, **fingers, **changed})


GENTLE = "controller.closing_speed_m_s=0.03"
"""For what a faster finger would break."""


def gripper_file(folder, **changed):
    """Write the file of the parallel gripper with some lines changed."""
    lines = {
        "model": f"'{PARALLEL}'",
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


def gripper_with(folder, text, **changed):
    """Write the file of a gripper whose model has this text."""
    (folder / "changed.xml").write_text(text)
    return gripper_file(folder, **{"model": f"'{folder}/changed.xml'", **changed})


def replaced(*changes):
    """Return the model of the parallel gripper with these texts replaced by others."""
    text = PARALLEL.read_text()
    for old, new in changes:
        assert old in text
        text = text.replace(old, new, 1)
    return text


def opened(file="", thing="block"):
    """Open a gripper of this file around a thing."""
    create("sensor-backend", "mujoco", file=str(file), object=thing).open(0)


def test_a_can_yields_as_its_springs_do(grasped):
    """Two walls of 18 000 N/m in series yield by 20 N / 9000 N/m; the contacts yield by a few hundredths of a mm."""
    trial = grasped(GENTLE, thing="can")
    assert trial.outcome.words == "steady"
    assert trial.features["f_steady"] == pytest.approx(20.0, abs=0.1)
    assert trial.features["p_steady"] == pytest.approx(0.0662 - 20.0 / 9000.0, abs=1e-4)
    assert trial.features["p_first"] == pytest.approx(0.0662, abs=3e-4)


@pytest.mark.parametrize("sends", [pytest.param("effort", marks=pytest.mark.slow), "velocity"])
def test_a_block_is_as_wide_as_it_is_and_both_pads_feel_the_effort(grasped, sends):
    trial = grasped(f"controller.sends={sends}")
    assert trial.outcome.words == "steady"
    assert trial.features["p_steady"] == pytest.approx(0.040, abs=2e-4)
    assert trial.features["f_steady"] == pytest.approx(20.0, abs=0.2)


@pytest.mark.slow
@every_case(("force_n", "outcome"), [(20, "steady"), (60, "crushed")])
def test_an_egg_survives_20_newtons_and_breaks_at_60(grasped, force_n, outcome):
    trial = grasped(GENTLE, f"controller.probing_force_n={force_n}", thing="egg")
    assert (trial.outcome.words, trial.report["broken"]) == (outcome, outcome == "crushed")


@pytest.mark.slow
def test_a_light_gripper_under_gains_for_a_heavy_one_says_so(grasped, tmp_path):
    light = (
        PARALLEL.read_text()
        .replace('armature="20"', 'armature="0.5"')
        .replace('damping="600"', 'damping="20"')
    )
    option = f"gripper.file={gripper_with(tmp_path, light)}"
    assert "controller.sends=velocity" in grasped(option).report["unstable_loop"]
    assert "unstable_loop" not in grasped(option, "controller.sends=velocity").report


@pytest.mark.slow
def test_the_gap_may_come_from_a_joint_or_from_geoms(grasped, tmp_path):
    gaps = ('{ joint = "left", scale = -2.0, offset_m = 0.09 }', '{ geoms = ["left_pad", "right_pad"] }')
    by_joint, by_geoms = (
        grasped(f"gripper.file={gripper_file(tmp_path, gap=gap)}").features["p_steady"] for gap in gaps
    )
    assert by_joint == pytest.approx(by_geoms, abs=2e-4)


def touching(folder, *, kind="touch", cutoff="", sites=("left_zone", "right_zone"), place="0 0 0"):
    """Return the gripper file with a sensor of this kind at each of these sites."""
    zone = f'<site name="{{}}_zone" type="box" size="0.006 0.012 0.012" pos="{place}"/>'
    sensors = "".join(
        f'<{kind} name="{name}" site="{site}" {cutoff}/>'
        for name, site in zip(("lt", "rt"), sites, strict=True)
    )
    faces = {side: f'<site name="{side}_face" pos="0 0 0"/>' for side in ("left", "right")}
    zones = [(face, face + zone.format(side)) for side, face in faces.items()]
    return gripper_with(
        folder,
        replaced(*zones, ("</mujoco>", f"<sensor>{sensors}</sensor></mujoco>")),
        left='{ geoms = ["left_pad"], sensor = "lt" }',
        right='{ geoms = ["right_pad"], sensor = "rt" }',
    )


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["touch", "force"])
def test_a_sensor_of_each_finger_measures_the_force_of_the_contacts(grasped, tmp_path, kind):
    file = touching(tmp_path, kind=kind)
    assert grasped(f"gripper.file={file}", thing="can").features["f_steady"] == pytest.approx(20.0, abs=0.2)


def test_a_sensor_that_shows_a_part_ends_the_grasp_and_one_for_both_fingers_is_refused(grasped, tmp_path):
    file = touching(tmp_path, cutoff='cutoff="5"')
    trial = grasped(f"gripper.file={file}")
    assert "cutoff of 5 N" in trial.reason
    half = grasped(f"gripper.file={touching(tmp_path, place='0 0 0.012')}").reason
    assert re.findall(r"([\d.]+) N", half) == ["20", "9.99"], half
    with pytest.raises(ConfigError) as error:
        opened(touching(tmp_path, sites=("left_zone", "left_zone")))
    assert {"'lt'", "'rt'"} <= set(str(error.value).split())


AT = '{ body = "%s", at = [0, 0, 0] }'


@every_case(
    ("changed", "said"),
    [
        ({"actuators": '["nosuch"]'}, ("actuator", "nosuch", "close")),
        ({"left": '{ geoms = ["nosuch"] }'}, ("geom", "nosuch", "left_pad")),
        ({"left": '{ geoms = ["left_pad"], sensor = "nosuch" }'}, ("sensor", "nosuch")),
        ({"open": "[20.0]", "closed": "[-20.0]"}, ("do not close",)),
        ({"open": "[1.0, 2.0]"}, ("open has 2 values",)),
        ({"gap": '{ joint = "left", scale = -1.0, offset_m = 0.09 }'}, ("scale", "16.1 mm", "32.2 mm")),
        ({"gap": "{ }"}, ("one of sites, geoms and joint",)),
        ({"actuator": '["close"]'}, ("actuator", "actuators")),
        ({"channels": '{ palm = { sensor = "nosuch", unit = "m/s2" } }'}, ("sensor", "nosuch")),
        ({"gap": f"{{ left = [{AT % 'nosuch'}], right = [{AT % 'left'}] }}"}, ("body", "nosuch", "palm")),
        ({"angle": '"turns"'}, ("radian", "degree")),
        ({"impratio": "-1.0"}, ("impratio",)),
        ({"model": "'nosuch.xml'"}, ("nosuch.xml",)),
        ({"model": "'package:nosuchpackage:a.xml'"}, ("pip install nosuchpackage",)),
        # The package is not among those of the tests; .ci/mujoco tries it where it is installed.
        ({"model": "'menagerie:robotiq_2f85'"}, ("menagerie:robotiq_2f85",)),
    ],
)
def test_a_gripper_file_that_is_wrong_says_what_is(tmp_path, changed, said):
    file = gripper_file(tmp_path, **changed)
    with pytest.raises(ConfigError) as error:
        opened(file)
    assert all(word in str(error.value) for word in said), error.value


def test_a_gripper_file_that_is_missing_is_told_as_such():
    with pytest.raises(ConfigError, match="no gripper file") as error:
        load_pipeline("default", options=["gripper.type=mujoco", "gripper.file=nosuch.toml"])
    assert "pip install" not in str(error.value)


@every_case("include", ["../secret.xml", "&#46;&#46;/secret.xml", "/etc/hostname"])
def test_a_model_includes_nothing_outside_of_its_folder(tmp_path, include):
    inside = tmp_path / "model"
    inside.mkdir()
    (tmp_path / "secret.xml").write_text("<mujocoinclude/>")
    file = gripper_with(inside, f"<mujoco><include\n file='{include}'/></mujoco>")
    with pytest.raises(ConfigError, match=r"changed\.xml includes (\.\./secret\.xml|/etc/hostname)"):
        opened(file)


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
    file = gripper_with(tmp_path, replaced(("<worldbody>", added + "<worldbody>")))
    if place == "model":
        file = gripper_file(tmp_path, model=f"'{pipe}'")
    elif place == "gripper file":
        file = pipe
    with pytest.raises((ConfigError, UnknownName), match="pipe"):
        opened(file, str(pipe) if place in ("scene", "thing") else "block")


def test_a_thing_that_is_wider_than_the_opening_is_refused(tmp_path):
    (tmp_path / "wide.xml").write_text(
        '<mujoco><worldbody><body name="wide" gravcomp="1"><freejoint/>'
        '<geom type="box" size="0.06 0.02 0.02" mass="1"/></body></worldbody></mujoco>'
    )
    with pytest.raises(ConfigError, match=r"wide\.xml .*90\.0 mm"):
        opened("", str(tmp_path / "wide.xml"))


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
    with pytest.raises(DeviceLost, match="unstable"):
        [backend.apply(Command(EFFORT, 0.0, 1.0, 1.0)) for _ in range(100) if backend.read(0.1)]
    assert [path.name for path in tmp_path.iterdir()] == ["wild.xml"]


@every_case(("left", "right"), [("left_finger", "right_finger"), ("right_pad", "left_pad")])
def test_a_thing_that_is_squeezed_beside_what_measures_ends_the_grasp(grasped, tmp_path, left, right):
    fingers = {"left": f'{{ geoms = ["{left}"] }}', "right": f'{{ geoms = ["{right}"] }}'}
    trial = grasped(f"gripper.file={gripper_file(tmp_path, **fingers)}")
    assert "is not felt" in trial.reason


FAR = "<body name='far' pos='0.5 0 0'><site name='far'/></body>"


@pytest.mark.slow
@every_case(
    ("changed", "added", "widths"),
    [
        # Another offset, a geom with a margin, and sites ahead of the face and on another gripper.
        *(
            (
                {"gap": f'{{ joint = "left", scale = -2.0, offset_m = {0.09 + beyond_m} }}'},
                [('"0 0.045"', '"0 0.038"')] * 2,
                (40 + 1e3 * beyond_m, 40),
            )
            for beyond_m in (0.02, 0.0045, -0.006, -0.02)
        ),
        ({}, [('condim="4"', 'condim="4" margin="0.0035"')], (47, 40)),
        ({}, [('name="left_face" pos="0 0 0"', 'name="left_face" pos="0.0045 0 0"')], (35.5, 40)),
        ({"gap": '{ sites = ["left_face", "far"] }'}, [("<worldbody>", f"<worldbody>{FAR}")], (500, 0)),
    ],
)
def test_a_gap_that_is_not_the_width_of_what_is_held_ends_the_grasp(
    grasped, tmp_path, changed, added, widths
):
    trial = grasped(f"gripper.file={gripper_with(tmp_path, replaced(*added), **changed)}")
    assert trial.outcome.words == "device lost"
    gap_mm, held_mm = map(float, re.findall(r"([\d.]+) mm", trial.reason)[:2])
    assert (gap_mm, held_mm) == (pytest.approx(widths[0], abs=1.0), pytest.approx(widths[1], abs=1.0))


@pytest.mark.parametrize("part", ["contact", "equality", "actuation"])
def test_what_a_grasp_needs_is_there_though_the_model_switches_it_off(grasped, tmp_path, part):
    switched = replaced(('"implicitfast"/>', f'"implicitfast"><flag {part}="disable"/></option>'))
    assert grasped(f"gripper.file={gripper_with(tmp_path, switched)}").outcome.words == "steady"


@pytest.mark.slow
def test_several_actuators_keep_together_and_a_thing_is_put_where_turning_fingers_meet_it(grasped, tmp_path):
    """Two hinged fingers with an actuator each; they press at another place than where the gap is measured."""
    servo = ("controller.sends=velocity", "controller.probing_force_n=5")
    trial = grasped(f"gripper.file={hinged_file(tmp_path)}", *servo, thing="egg")
    assert trial.outcome.words == "steady"
    assert trial.features["f_steady"] == pytest.approx(5.0, rel=0.3)


def test_angles_in_radians_are_asked_for_where_hinges_hardly_turn(tmp_path):
    text = HINGED.replace('angle="radian"', "")
    text = text.replace("-0.7 0.5", "-0.3 0.05").replace("-0.5 0.7", "-0.05 0.3")
    with pytest.raises(ConfigError, match='angle = "radian"'):
        opened(hinged_file(tmp_path, text))
    opened(hinged_file(tmp_path, text, angle='"radian"'))


def test_what_is_no_finger_can_be_left_out_of_the_contacts(tmp_path):
    """A box of the palm between the fingers stands for the hull of a mesh that is hollow there."""
    left = '<body name="left"'
    filled = replaced((left, '<geom type="box" size="0.02 0.02 0.02"/>' + left))
    with pytest.raises(ConfigError, match="penetrates"):
        opened(gripper_with(tmp_path, filled))
    opened(gripper_with(tmp_path, filled, only_fingers="true"))


def test_fingers_that_are_not_opposed_are_refused(tmp_path):
    left, right = '{ geoms = ["left_pad"] }', '{ geoms = ["right_pad"] }'
    with pytest.raises(ConfigError, match="left_pad"):
        opened(gripper_file(tmp_path, right=left))
    gap = '{ joint = "left", scale = -2.0, offset_m = 0.09 }'
    with pytest.raises(ConfigError, match="not opposed"):
        opened(gripper_file(tmp_path, gap=gap, left=right, right=left, closing="[0.0, 1.0, 0.0]"))


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
    with pytest.raises(ConfigError, match=said):
        opened(gripper_with(tmp_path, replaced((old, new))))


def new_file(model):
    """Run the command that writes `lab-hand.toml` from a model."""
    return graspsense("plugins", "new", "lab-hand", "--role", "sensor-backend", "--mujoco", model)


def test_a_gripper_file_is_written_from_a_model_and_grasps_as_it_is(grasped, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    told = new_file(PARALLEL).stdout
    assert "close" in told
    assert "to fill in" in told
    trial = grasped("gripper.file=lab-hand.toml")
    assert (trial.outcome.words, trial.features["f_steady"]) == ("steady", pytest.approx(20.0, abs=0.2))
    again = new_file(PARALLEL)
    assert again.returncode == 2
    assert "there already" in again.stderr


def test_a_model_without_opposed_fingers_gets_no_gripper_file(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "arm.xml").write_text(
        '<mujoco><worldbody><body name="arm"><joint name="j" type="slide" axis="1 0 0" range="0 1"/>'
        '<geom size="0.1"/></body></worldbody><actuator>'
        '<position joint="j" ctrlrange="0 1" kp="10"/></actuator></mujoco>'
    )
    made = new_file("arm.xml")
    assert made.returncode == 2
    assert "opposed" in made.stderr
    assert not (tmp_path / "lab-hand.toml").exists()


def test_the_points_of_the_gap_face_each_other_also_where_closed_fingers_pass(tmp_path, monkeypatch):
    """Two jaws whose tips are pads 4 mm thick, with a touch sensor in each, which motors push through each other."""
    monkeypatch.chdir(tmp_path)
    bodies = sensors = motors = ""
    for side, place in (("l", -0.04), ("r", 0.04)):
        axis = -place / abs(place)
        bodies += (
            f'<body name="tip_{side}" pos="{place} 0 0"><joint name="{side}" type="slide" axis="{axis} 0 0" '
            f'range="0 0.045" damping="20"/><geom type="box" size="0.002 0.01 0.01" mass="0.1"/>'
            f'<site name="{side}" type="box" size="0.004 0.01 0.01"/></body>'
        )
        sensors += f'<touch name="touch_{side}" site="{side}"/>'
        motors += f'<motor name="push_{side}" joint="{side}" ctrlrange="-40 40"/>'
    (tmp_path / "jaws.xml").write_text(
        f"<mujoco><worldbody>{bodies}</worldbody><actuator>{motors}</actuator><sensor>{sensors}</sensor></mujoco>"
    )
    assert "passed each other" in new_file("jaws.xml").stdout
    file = tomllib.loads((tmp_path / "lab-hand.toml").read_text())
    assert [file["gap"][side][0]["at"][0] for side in ("left", "right")] == [0.002, -0.002]
    assert "touch_l" in (tmp_path / "lab-hand.toml").read_text()
