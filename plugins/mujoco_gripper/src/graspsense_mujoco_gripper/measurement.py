"""What is measured in a MuJoCo model: the gap, the force on each finger, cells, and further sensors."""

from __future__ import annotations

from collections.abc import Set

import mujoco
import numpy as np
from attrs import frozen
from numpy.typing import NDArray

from graspsense.plugin_api import ConfigError
from graspsense_mujoco_gripper.gripper_file import Finger, Gap, GripperFile
from graspsense_mujoco_gripper.model import OBJ, POINT, identifier

Floats = NDArray[np.float64]
FARTHEST_M = 10.0
"""Beyond this distance two geoms are not measured."""


class GapGauge:
    """Measures the gap (m) as a gripper file says."""

    def __init__(self, model: mujoco.MjModel, gap: Gap) -> None:
        self._gap = gap
        self._faces = _face_sites(model, gap)
        if self._faces:
            self._ids = []
        elif gap.geoms:
            self._ids = [identifier(model, OBJ.mjOBJ_GEOM, name, "geom") for name in gap.geoms]
        else:
            joint = identifier(model, OBJ.mjOBJ_JOINT, gap.joint, "joint")
            self._ids = [int(model.jnt_qposadr[joint])]
        self._model = model

    @property
    def along_axis(self) -> bool:
        """Whether the gap depends on the closing direction."""
        return bool(self._faces)

    def gap_m(self, data: mujoco.MjData, axis: Floats) -> float:
        """Return the gap."""
        if self._faces:
            left, right = (data.site_xpos[sites].mean(axis=0) for sites in self._faces)
            return float((right - left) @ axis)
        if self._gap.geoms:
            return float(mujoco.mj_geomDistance(self._model, data, *self._ids, FARTHEST_M, None))
        return float(self._gap.offset_m + self._gap.scale * data.qpos[self._ids[0]])


class ForceGauge:
    """Measures the force (N) that closes one finger on a thing; positive where it presses.

    `touched` are the geoms that it can press on: those of things and of the other finger. Contacts with other parts of
    the gripper do not count.
    """

    def __init__(self, model: mujoco.MjModel, finger: Finger, touched: Set[int], side: float) -> None:
        self._touched = touched
        self.geoms = geoms_of(model, finger)
        self._model, self._side = model, side
        self._sensor = -1
        if finger.sensor:
            self._sensor = identifier(model, OBJ.mjOBJ_SENSOR, finger.sensor, "sensor")
            kind = int(model.sensor_type[self._sensor])
            if kind not in (mujoco.mjtSensor.mjSENS_TOUCH, mujoco.mjtSensor.mjSENS_FORCE):
                raise ConfigError(
                    f"gripper.file: the sensor {finger.sensor!r} is neither a touch nor a force sensor"
                )
            self._is_touch = kind == mujoco.mjtSensor.mjSENS_TOUCH
            self._address = int(model.sensor_adr[self._sensor])
            self._site = int(model.sensor_objid[self._sensor])

    def force_n(self, data: mujoco.MjData, axis: Floats) -> float:
        """Return the force on the finger along the closing direction."""
        if self._sensor < 0:
            return self._of_contacts(data, axis)
        if self._is_touch:
            return float(data.sensordata[self._address])
        local = data.sensordata[self._address : self._address + 3]
        world = data.site_xmat[self._site].reshape(3, 3) @ local
        return float(self._side * (world @ axis))

    def _of_contacts(self, data: mujoco.MjData, axis: Floats) -> float:
        total, wrench = 0.0, np.zeros(6)
        for k in range(data.ncon):
            contact = data.contact[k]
            one, other = int(contact.geom[0]), int(contact.geom[1])
            second = other in self.geoms and one in self._touched
            if not second and not (one in self.geoms and other in self._touched):
                continue
            mujoco.mj_contactForce(self._model, data, k, wrench)
            # The frame's first row is the normal, from the first geom to the second; the force acts on the second.
            world = contact.frame.reshape(3, 3).T @ wrench[:3]
            on_finger = world if second else -world
            total += self._side * float(on_finger @ axis)
        return total


@frozen
class Cells:
    """The sensors of the cells of both fingers: where their values are, and how many."""

    addresses: tuple[int, int]
    count: int

    def images(self, data: mujoco.MjData) -> tuple[tuple[float, ...], tuple[float, ...]]:
        """Return the cells of the left and the right finger, row by row."""
        left, right = (tuple(map(float, data.sensordata[a : a + self.count])) for a in self.addresses)
        return left, right


def cells_of(model: mujoco.MjModel, gripper: GripperFile) -> Cells | None:
    """Return the cells of the fingers; None without arrays. Raises ConfigError for another number of values."""
    if not gripper.left.array:
        return None
    addresses = []
    for finger in (gripper.left, gripper.right):
        sensor = identifier(model, OBJ.mjOBJ_SENSOR, finger.array, "sensor")
        values, cells = int(model.sensor_dim[sensor]), finger.rows * finger.columns
        if values % cells:
            raise ConfigError(
                f"gripper.file: the sensor {finger.array!r} has {values} values, which are not a multiple of "
                f"{finger.rows} x {finger.columns} cells"
            )
        addresses.append(int(model.sensor_adr[sensor]))
    # The first channel of a touch grid is the normal force.
    return Cells((addresses[0], addresses[1]), gripper.left.rows * gripper.left.columns)


def closing_axis(gripper: GripperFile, left: Floats, right: Floats) -> Floats:
    """Return the unit vector from the left finger to the right one. Raises ConfigError where they coincide."""
    axis = np.asarray(gripper.closing, float) if gripper.closing else right - left
    length = float(np.linalg.norm(axis))
    if not length > 1e-9:
        raise ConfigError(
            "gripper.file: the fingers are at the same place, so their closing direction is not known: give closing"
        )
    return axis / length


def width_m(model: mujoco.MjModel) -> float:
    """Return how wide a thing is along its x axis: from its geoms that touch, and its flexible parts."""
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    ends = [float(x) for x in data.flexvert_xpos[:, 0]] if model.nflexvert else []
    for k in range(model.ngeom):
        if model.geom_contype[k] or model.geom_conaffinity[k]:
            row = data.geom_xmat[k].reshape(3, 3)[0]
            centre = float(data.geom_xpos[k][0] + row @ model.geom_aabb[k][:3])
            reach = float(np.abs(row) @ model.geom_aabb[k][3:])
            ends += [centre - reach, centre + reach]
    return max(ends) - min(ends) if ends else 0.0


def _face_sites(model: mujoco.MjModel, gap: Gap) -> tuple[list[int], ...]:
    """Return the sites of the left and the right face; nothing where the gap has neither sites nor points."""
    if gap.sites:
        return tuple([identifier(model, OBJ.mjOBJ_SITE, name, "site")] for name in gap.sites)
    if gap.left:
        return tuple(
            [identifier(model, OBJ.mjOBJ_SITE, f"{POINT}{side}{k}", "site") for k in range(len(points))]
            for side, points in (("left", gap.left), ("right", gap.right))
        )
    return ()


def faces(model: mujoco.MjModel, data: mujoco.MjData, gripper: GripperFile) -> tuple[Floats, Floats]:
    """Return where the left and the right finger touch things: what the gap is measured between, or their geoms."""
    gap = gripper.gap
    if sites := _face_sites(model, gap):
        left, right = (data.site_xpos[one].mean(axis=0) for one in sites)
    elif gap.geoms:
        left, right = (
            data.geom_xpos[identifier(model, OBJ.mjOBJ_GEOM, name, "geom")].copy() for name in gap.geoms
        )
    else:
        left, right = (
            np.mean([data.geom_xpos[k] for k in geoms_of(model, finger)], axis=0)
            for finger in (gripper.left, gripper.right)
        )
    return left, right


def geoms_of(model: mujoco.MjModel, finger: Finger) -> frozenset[int]:
    """Return the numbers of the geoms of a finger that can touch."""
    geoms = {identifier(model, OBJ.mjOBJ_GEOM, name, "geom") for name in finger.geoms}
    for name in finger.bodies:
        body = identifier(model, OBJ.mjOBJ_BODY, name, "body")
        first = int(model.body_geomadr[body])
        geoms |= set(range(first, first + int(model.body_geomnum[body])))
    return frozenset(geoms)
