"""A scene: a thing between the fingers, or on a table, an arm that lifts the gripper, and a cord that pulls.

thing = "can"
table = true
arm = [[0.3, 0.0], [0.8, 0.05]]              # seconds after both fingers touch, height of the gripper (m)

[cord]
direction = [0.0, 0.0, -1.0]
force = [[0.8, 0.0], [1.8, 5.0]]             # seconds after both fingers touch, force (N)

[shake]
amplitude_m = 0.008
frequency_hz = 3.0
start_s = 2.0                                # seconds after both fingers touch
cycles = 3.0
"""

from __future__ import annotations

from importlib.resources import files
from itertools import pairwise
from math import cos, isfinite, pi, sin
from pathlib import Path
from typing import Final
from zlib import crc32

import mujoco
import numpy as np
from attrs import evolve, field, frozen
from attrs.validators import ge, gt, le
from numpy.typing import NDArray

from graspsense.plugin_api import ConfigError
from graspsense_mujoco_gripper.bump import Bump, Bumper, add_ball
from graspsense_mujoco_gripper.catalogue import Thing, Walls, thing_named
from graspsense_mujoco_gripper.gripper_file import described
from graspsense_mujoco_gripper.model import compiled

Floats = NDArray[np.float64]
PREFIX: Final = "thing/"
"""Before each name of the thing in the combined model."""
ARM: Final = "arm"
"""Before each name of an upright slide of the arm."""
SHAKE: Final = "shake"
"""Before each name of a slide along the direction of the shake."""
TABLE: Final = "table"
"""The name of the body of the table, which has no joint: it is where it is put."""
TABLE_BIT: Final = 8
"""Of `contype` and `conaffinity`: the table touches things, and not the gripper."""
TABLE_HALF_M: Final = (0.3, 0.3, 0.02)
ARM_KG: Final = 1000.0
"""Inertia of the arm: so heavy that the gripper does not move it."""
ARM_RAD_S: Final = 200.0
"""Natural frequency of the servo of the arm, critically damped."""
SCENES: Final = Path(str(files("graspsense_mujoco_gripper") / "scenes"))
SHIPPED_SCENES: Final = ("tugged", "filled", "placed", "shaken")
"""The scene files of this package."""
LARGEST_BYTES: Final = 64 * 1024
MASS_SPREAD, FRICTION_SPREAD, STIFFNESS_SPREAD, SIZE_SPREAD = 0.1, 0.15, 0.1, 0.01
"""Standard deviations of the logarithms of what instances and seeds draw."""
PLACE_SPREAD_M = 0.001
AFTER_BUMP_S: Final = 0.5
"""For so long after a bump it is watched how far the thing comes down."""
Schedule = tuple[tuple[float, ...], ...]


@frozen(kw_only=True)
class Cord:
    """A cord on the thing: where it pulls (a vector of the world), its force (N) over the time (s) since contact."""

    direction: tuple[float, ...] = (0.0, 0.0, -1.0)
    force: Schedule

    def __attrs_post_init__(self) -> None:
        _check_schedule("force", self.force)
        _unit(self.direction)

    def pull_n(self, t_s: float) -> Floats:
        """Return the force (N, in the world) at a time."""
        return _value(self.force, t_s) * _unit(self.direction)


@frozen(kw_only=True)
class Shake:
    """A shake of the gripper: a sine along a direction of the world, which grows and fades within a period each.

    With n = (t - start_s) frequency_hz periods done, and m = min(n, cycles - n, 1), the gripper is displaced by
    amplitude_m (1 - cos(pi m)) / 2 sin(2 pi n). Times are since both fingers touched.
    """

    amplitude_m: float = field(validator=[gt(0.0), le(0.1)])
    frequency_hz: float = field(validator=[gt(0.0), le(20.0)])
    start_s: float = field(validator=[ge(0.0), le(600.0)])
    cycles: float = field(default=3.0, validator=[ge(2.0), le(1000.0)])
    direction: tuple[float, ...] = (1.0, 0.0, 0.0)

    def __attrs_post_init__(self) -> None:
        _unit(self.direction)

    @property
    def end_s(self) -> float:
        """When it ends."""
        return self.start_s + self.cycles / self.frequency_hz

    def place_m(self, t_s: float) -> float:
        """Return the displacement at a time."""
        periods = (t_s - self.start_s) * self.frequency_hz
        share = min(max(min(periods, self.cycles - periods), 0.0), 1.0)
        return self.amplitude_m * 0.5 * (1.0 - cos(pi * share)) * sin(2.0 * pi * periods)


@frozen(kw_only=True)
class Scene:
    """What the gripper grasps, and what happens to it. Without a table the thing has no weight.

    `arm` is the height (m) of the gripper over the time (s) since both fingers touched, `table_height` that of the
    table, which may rise while the thing is in the air, and `fill` the mass (kg) that was filled in by then. `shake`
    moves the gripper to and fro, and `bump` is a ball that comes from the side. `mass_kg` and `friction` replace those
    of the thing. `roughness_m` is the rms height of its surface, which cells on springs feel.
    """

    thing: str
    walls: Walls | None = None
    table: bool = False
    table_height: Schedule = ()
    arm: Schedule = ()
    fill: Schedule = ()
    cord: Cord | None = None
    shake: Shake | None = None
    bump: Bump | None = None
    mass_kg: float | None = field(default=None)
    friction: float | None = field(default=None)
    roughness_m: float = field(default=0.0)

    def __attrs_post_init__(self) -> None:
        for name in ("arm", "table_height", "fill"):
            if getattr(self, name):
                _check_schedule(name, getattr(self, name))
        if self.table_height and not self.table:
            raise ValueError("table_height moves a table: add table = true")
        if any(mass_kg < 0.0 for _, mass_kg in self.fill):
            raise ValueError("fill is a mass (kg), at least 0")
        if not 0.0 <= self.roughness_m <= 1e-3:
            raise ValueError(f"roughness_m is {self.roughness_m}: it is from 0 to 0.001")
        if self.mass_kg is not None and not 0.0 < self.mass_kg < float("inf"):
            raise ValueError(f"mass_kg is {self.mass_kg}: it is above 0")
        if self.friction is not None and not 0.0 <= self.friction < float("inf"):
            raise ValueError(f"friction is {self.friction}: it is at least 0")

    @property
    def needs_friction(self) -> bool:
        """Whether the friction of the thing decides what happens."""
        disturbed = self.arm or self.fill or self.cord or self.shake or self.bump
        return self.table or bool(disturbed) or self.friction is not None


@frozen(eq=False)
class SceneModel:
    """A scene that is read: its thing and the thing's model, not compiled; no model where there is no thing."""

    scene: Scene
    thing: Thing
    spec: mujoco.MjSpec | None
    instance: str


def scene_named(name: str, around: str = "") -> Scene:
    """Return the scene of a name: a scene file, or a thing alone; with `around`, that scene with this thing in it.

    Raises ConfigError.
    """
    path = SCENES / f"{name}.toml" if name in SHIPPED_SCENES else Path(name).expanduser()
    is_scene = path.suffix == ".toml"
    if not around:
        return (
            described(path, f"the scene {path}", LARGEST_BYTES, "scene file", Scene)
            if is_scene
            else Scene(thing=name)
        )
    if is_scene:
        raise ConfigError(
            f"gripper.object names the scene {name}, and gripper.scene the scene {around}: name a thing as the object"
        )
    scene = scene_named(around)
    if scene.thing == around:
        raise ConfigError(
            f"gripper.scene: there is no scene {around!r}. Known: {', '.join(SHIPPED_SCENES)}, or a scene file (.toml)"
        )
    return evolve(scene, thing=name, walls=None)


def read_scene(name: str, around: str = "") -> SceneModel:
    """Return the scene of this name: a thing of the catalogue, an MJCF file, or a scene file (TOML).

    What follows `#` names an instance, which is the same in all states of a thing (`flask_full:open#3`). With
    `around`, the thing is in that scene. Raises UnknownName, ConfigError.
    """
    name, number, instance = name.partition("#")
    scene = scene_named(name, around)
    beside = Path(name).expanduser().parent if name.endswith(".toml") else Path()
    if scene.walls is not None:
        thing, spec = Thing(walls=scene.walls), scene.walls.spec(scene.thing)
    else:
        thing, known = thing_named(scene.thing, beside)
        if known is None:
            return SceneModel(scene, thing, None, "")
        spec = known
    return SceneModel(scene, thing, spec, f"{name.partition(':')[0]}#{instance}" if number else "")


def _check_schedule(name: str, rows: Schedule) -> None:
    if not rows or any(len(row) != 2 or not all(map(isfinite, row)) for row in rows):
        raise ValueError(
            f"{name} is a list of pairs of a time (s) and a value, as in [[0.3, 0.0], [0.8, 0.05]]"
        )
    times = [row[0] for row in rows]
    if any(later_s <= earlier_s for earlier_s, later_s in pairwise(times)):
        raise ValueError(f"the times of {name} rise from pair to pair")


def _unit(direction: tuple[float, ...]) -> Floats:
    """Return a direction with the length 1. Raises ValueError."""
    if len(direction) != 3 or not 0.0 < float(np.linalg.norm(direction)) < float("inf"):
        raise ValueError("direction is a vector of three numbers, not all zero")
    unit: Floats = np.asarray(direction) / np.linalg.norm(direction)
    return unit


def _value(rows: Schedule, t_s: float) -> float:
    """Return the value at a time: straight between the pairs, the nearest one before and after them."""
    times, values = zip(*rows, strict=True)
    return float(np.interp(t_s, times, values))


def put_on_arm(spec: mujoco.MjSpec, scene: Scene) -> None:
    """Put each body of the gripper that is fixed to the world on slides with a servo, if the scene moves it.

    There is an upright one for `arm`, and one along the direction of `shake`. Raises ConfigError where a body has
    joints of its own.
    """
    slides = [(ARM, np.array([0.0, 0.0, 1.0]))] if scene.arm else []
    if scene.shake is not None:
        slides.append((SHAKE, _unit(scene.shake.direction)))
    if not slides:
        return
    whole = compiled(spec, "the gripper")
    for body in spec.worldbody.bodies:
        if body.joints:
            raise ConfigError(
                f"gripper.object: the scene has an arm, and the body {body.name!r} of the gripper has joints of its own"
            )
        back, axis = np.zeros(4), np.zeros(3)
        mujoco.mju_negQuat(back, whole.body_quat[body.id])
        for kind, direction in slides:
            mujoco.mju_rotVecQuat(axis, direction, back)
            name = f"{kind}/{body.id}"
            body.add_joint(
                name=name,
                type=mujoco.mjtJoint.mjJNT_SLIDE,
                axis=axis,
                armature=ARM_KG,
                damping=[2.0 * ARM_KG * ARM_RAD_S, 0.0, 0.0],
                limited=mujoco.mjtLimited.mjLIMITED_FALSE,
            )
            servo = spec.add_actuator(name=name, target=name, trntype=mujoco.mjtTrn.mjTRN_JOINT)
            servo.set_to_position(kp=ARM_KG * ARM_RAD_S**2)
    for body in spec.bodies:
        body.gravcomp = 1.0


def _light(spec: mujoco.MjSpec) -> None:
    """Light the scene for pictures, on white where the model has no sky of its own."""
    spec.visual.headlight.ambient = [0.4, 0.4, 0.4]
    spec.visual.headlight.diffuse = [0.6, 0.6, 0.6]
    sky = mujoco.mjtTexture.mjTEXTURE_SKYBOX
    if all(texture.type != sky for texture in spec.textures):
        white, flat = [1.0, 1.0, 1.0], mujoco.mjtBuiltin.mjBUILTIN_FLAT
        spec.add_texture(
            name=PREFIX + "sky", type=sky, builtin=flat, rgb1=white, rgb2=white, width=8, height=48
        )


def add_thing(spec: mujoco.MjSpec, model: SceneModel, place: Floats, axis: Floats) -> None:
    """Add the thing at a place, its x axis along the closing direction, and the table under it.

    Raises ConfigError with MuJoCo's message.
    """
    child, scene = model.spec, model.scene
    assert child is not None
    for body in child.bodies:
        body.gravcomp = float(not scene.table)
    _light(spec)
    if scene.needs_friction:
        # MuJoCo would else take the larger friction of thing and finger, and the mean of their stiffness.
        for part in (*child.geoms, *child.flexes):
            part.priority = max(part.priority, 1)
    if scene.friction is not None:
        _scale_friction(child, scene.friction, absolute=True)
    try:
        if scene.mass_kg is not None:
            _scale_mass(child, scene.mass_kg / float(np.sum(child.compile().body_mass)))
        if scene.table:
            lowest_m = _lowest(child.compile())
            _set_bits(child)
            half = TABLE_HALF_M[2]
            position = [float(place[0]), float(place[1]), float(place[2]) + lowest_m - half]
            table = spec.worldbody.add_body(name=TABLE, mocap=True, pos=position)
            table.add_geom(
                name=PREFIX + "table",
                type=mujoco.mjtGeom.mjGEOM_BOX,
                size=list(TABLE_HALF_M),
                contype=TABLE_BIT,
                conaffinity=TABLE_BIT,
                friction=[0.5, 0.005, 0.0001],
                rgba=[0.75, 0.72, 0.65, 1.0],
            )
        frame = spec.worldbody.add_frame(pos=place, quat=turned(axis))
        spec.attach(child, frame=frame, prefix=PREFIX)
        if scene.bump is not None:
            add_ball(spec, scene.bump, place, axis)
    except ValueError as error:
        raise ConfigError(f"MuJoCo refuses to attach {scene.thing} to the gripper: {error}") from error


def _set_bits(child: mujoco.MjSpec) -> None:
    """Let what touches fingers touch the table too."""
    for geom in child.geoms:
        if geom.contype & 1 or geom.conaffinity & 1:
            geom.contype |= TABLE_BIT
            geom.conaffinity |= TABLE_BIT
    for flex in child.flexes:
        flex.contype |= TABLE_BIT
        flex.conaffinity |= TABLE_BIT


def _lowest(model: mujoco.MjModel) -> float:
    """Return the height (m) of the lowest point of a thing above its origin."""
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    lowest = [float(z) - model.flex_radius[0] for z in data.flexvert_xpos[:, 2]]
    for k in range(model.ngeom):
        if model.geom_contype[k] or model.geom_conaffinity[k]:
            centre, half = model.geom_aabb[k, :3], model.geom_aabb[k, 3:]
            turn = data.geom_xmat[k].reshape(3, 3)
            middle = data.geom_xpos[k] + turn @ centre
            lowest.append(float(middle[2] - np.abs(turn[2]) @ half))
    return min(lowest, default=0.0)


def vary(model: SceneModel, generator: np.random.Generator) -> float:
    """Draw mass, friction, stiffness and size of the thing, and return its place along the gap (m).

    An instance has the same mass, stiffness and size in every trial.
    """
    own = np.random.default_rng(crc32(model.instance.encode())) if model.instance else generator
    mass, stiffness, size = np.exp(own.normal(0.0, [MASS_SPREAD, STIFFNESS_SPREAD, SIZE_SPREAD]))
    friction, place_m = np.exp(generator.normal(0.0, FRICTION_SPREAD)), generator.normal(0.0, PLACE_SPREAD_M)
    child = model.spec
    assert child is not None
    _scale_friction(child, float(friction))
    _scale_size(child, float(size))
    _scale_mass(child, float(mass))
    for joint in child.joints:
        joint.stiffness = joint.stiffness * stiffness
    for flex in child.flexes:
        flex.young *= stiffness
    return float(place_m)


def _scale_friction(child: mujoco.MjSpec, factor: float, *, absolute: bool = False) -> None:
    for part in (*child.geoms, *child.flexes):
        friction = np.array(part.friction)
        friction[0] = factor if absolute else friction[0] * factor
        part.friction = friction


def _scale_mass(child: mujoco.MjSpec, factor: float) -> None:
    for geom in child.geoms:
        if isfinite(geom.mass):
            geom.mass *= factor
        else:
            geom.density *= factor
    for body in child.bodies:
        if any(flex for flex in child.flexes) and not body.geoms:
            body.mass *= factor
            body.inertia = np.array(body.inertia) * factor


def _scale_size(child: mujoco.MjSpec, factor: float) -> None:
    """Scale what is rigid; a mesh and a soft body keep their size."""
    if child.flexes or child.meshes:
        return
    for body in child.bodies:
        body.pos = np.array(body.pos) * factor
    for geom in child.geoms:
        geom.size = np.array(geom.size) * factor
        geom.pos = np.array(geom.pos) * factor
        geom.fromto = np.array(geom.fromto) * factor


class ArmMotion:
    """Moves the arm and pulls the cord, by the time since both fingers touched."""

    def __init__(self, model: mujoco.MjModel, scene: Scene, finger: int, edge: str) -> None:
        """`finger` is a geom of a finger, with which the height of the thing is compared; `edge` its edge sensor."""
        self._finger = finger
        self._scene, self._contact_s = scene, float("inf")
        self._servos, self._shakers = (
            [k for k in range(model.nu) if _actuator(model, k).startswith(f"{kind}/")]
            for kind in (ARM, SHAKE)
        )
        things = [k for k in range(model.nbody) if is_thing(model, k)]
        heaviest = model.body_mass[things] if things else np.zeros(0)
        self._body = things[0] if things else -1
        self._bodies, self._masses = things, heaviest
        self.moves = bool(things) and (
            bool(scene.cord or scene.bump or scene.shake)
            or bool(scene.arm or scene.table_height or scene.fill)
        )
        self._bumper = Bumper(model, scene.bump, edge, self._body) if things and scene.bump else None
        cord = () if scene.cord is None else scene.cord.force
        schedules = (scene.arm, scene.table_height, scene.fill, cord)
        self._model = model
        self._empty_kg = float(model.body_mass[self._body]) if things else 0.0
        self._table_m = _table_height(model)
        ends_s = [rows[-1][0] for rows in schedules if rows]
        self._end_s = max([*ends_s, 0.0 if scene.shake is None else scene.shake.end_s])
        if scene.bump is not None:
            self._end_s = max(self._end_s, scene.bump.t_s + AFTER_BUMP_S)
        self._start_m: Floats = np.zeros(3)
        self._above_finger_m = 0.0
        self._highest_m, self._height_m, self._slip_m = 0.0, 0.0, 0.0
        self._ended = False

    def set(self, data: mujoco.MjData, t_s: float, *, touched: bool) -> None:
        """Set the servo of the arm and the force of the cord for the time after this tick."""
        if not self.moves:
            return
        if touched and not isfinite(self._contact_s):
            self._contact_s = t_s
            self._start_m = self._centre(data)
            self._above_finger_m = float(self._start_m[2] - data.geom_xpos[self._finger, 2])
        if not isfinite(self._contact_s):
            return
        if self._ended:
            return
        # The last tick may lie behind the end, where everything has its last value.
        since_s = min(t_s - self._contact_s, self._end_s)
        self._ended = since_s == self._end_s
        self._height_m = float((self._centre(data) - self._start_m)[2])
        self._highest_m = max(self._highest_m, self._height_m)
        above_m = float(self._centre(data)[2] - data.geom_xpos[self._finger, 2])
        self._slip_m = max(self._slip_m, self._above_finger_m - above_m)
        if self._servos:
            data.ctrl[self._servos] = _value(self._scene.arm, since_s)
        if self._scene.shake is not None:
            data.ctrl[self._shakers] = self._scene.shake.place_m(since_s)
        if self._scene.cord is not None:
            data.xfrc_applied[self._body, :3] = self._scene.cord.pull_n(since_s)
        if self._bumper is not None:
            self._bumper.set(data, since_s)
        if self._scene.table_height:
            data.mocap_pos[0, 2] = self._table_m + _value(self._scene.table_height, since_s)
        if self._scene.fill:
            self._fill(_value(self._scene.fill, since_s))

    def shaken_m(self, data: mujoco.MjData) -> float:
        """Return how far the shake has displaced the gripper."""
        return float(data.actuator_length[self._shakers[0]])

    def _fill(self, filled_kg: float) -> None:
        """Give the thing this mass more, spread over its first body as its own."""
        model, body = self._model, self._body
        factor = (self._empty_kg + filled_kg) / float(model.body_mass[body])
        model.body_mass[body] *= factor
        model.body_inertia[body] *= factor

    def _centre(self, data: mujoco.MjData) -> Floats:
        """Return the centre of mass of the thing."""
        centre: Floats = self._masses @ data.xipos[self._bodies] / self._masses.sum()
        return centre

    def report(self) -> dict[str, float]:
        """Return how high above where it was touched the thing was lifted, and how high it was at the end (m).

        The end is that of the motion and the pull that the scene gives; the release comes after it. `slip_m` is how far
        the thing came down in the fingers by then.
        """
        return {"highest_m": self._highest_m, "height_m": self._height_m, "slip_m": self._slip_m}


def _table_height(model: mujoco.MjModel) -> float:
    """Return the height (m) of the body of the table; 0 where there is none."""
    body = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_BODY, TABLE)
    return 0.0 if body < 0 else float(model.body_pos[body, 2])


def _actuator(model: mujoco.MjModel, number: int) -> str:
    return mujoco.mj_id2name(model, mujoco.mjtObj.mjOBJ_ACTUATOR, number) or ""


def is_thing(model: mujoco.MjModel, body: int) -> bool:
    """Return whether a body is part of the thing."""
    return (mujoco.mj_id2name(model, mujoco.mjtObj.mjOBJ_BODY, body) or "").startswith(PREFIX)


def turned(axis: Floats) -> Floats:
    """Return the quaternion of the smallest turn of the x axis onto this one."""
    quaternion = np.zeros(4)
    mujoco.mju_quatZ2Vec(quaternion, axis)
    # mju_quatZ2Vec turns the z axis; before it, x is turned onto z.
    x_onto_z = np.array([np.sqrt(0.5), 0.0, -np.sqrt(0.5), 0.0])
    whole = np.zeros(4)
    mujoco.mju_mulQuat(whole, quaternion, x_onto_z)
    return whole
