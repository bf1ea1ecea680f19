"""What is measured in a MuJoCo model: the gap, the force on each finger, cells, and further sensors."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Set
from math import copysign, hypot, inf
from typing import Any, Final

import mujoco
import numpy as np
from attrs import frozen
from numpy.typing import NDArray

from graspsense.plugin_api import ConfigError, Samples
from graspsense_mujoco_gripper.gripper_file import Finger, Gap, GripperFile, PalmSensor
from graspsense_mujoco_gripper.model import POINT, identifier

Floats = NDArray[np.float64]
FARTHEST_M = 10.0
"""Beyond this distance two geoms are not measured."""
SIDES, NOTHING = (-1.0, 1.0), (0.0, 0.0)
"""The closing direction points from the left finger to the right one."""
LEFT, RIGHT, THING, ALL = 1, 2, 4, 7
"""The roles of a geom: part of a finger, or of a thing."""


def plain(values: NDArray[Any]) -> Any:
    """Return a view of an array, row by row, whose numbers are read and set in a fraction of the time of numpy."""
    return memoryview(values.reshape(-1))  # type: ignore[arg-type]


def gap_reader(model: mujoco.MjModel, data: mujoco.MjData, gap: Gap, axis: Floats) -> Callable[[], float]:
    """Return a function that returns the gap (m) in the present state of `data`, as a gripper file says."""
    if gap.geoms:
        left, right = (identifier(model, "geom", name) for name in gap.geoms)
        return lambda: float(mujoco.mj_geomDistance(model, data, left, right, FARTHEST_M, None))
    if gap.joint:
        values, offset_m = plain(data.qpos), gap.offset_m
        terms = [(int(model.jnt_qposadr[identifier(model, "joint", gap.joint)]), gap.scale)]
    else:
        values, offset_m = plain(data.site_xpos), 0.0
        terms = [
            (3 * site + k, sign * float(axis[k]) / len(sites))
            for sign, sites in zip(SIDES, _face_sites(model, gap), strict=True)
            for site in sites
            for k in range(3)
            if axis[k] != 0.0
        ]

    # Sums of a few numbers take less time in the interpreter than in numpy.
    def gap_m() -> float:
        total: float = offset_m
        for k, weight in terms:
            total += weight * values[k]
        return total

    return gap_m


class ForceGauge:
    """Measures the forces (N) that close both fingers on a thing; positive where they press.

    A finger can press on `things` and on the other finger. Contacts with other parts of the gripper do not count.
    """

    def __init__(
        self,
        model: mujoco.MjModel,
        data: mujoco.MjData,
        fingers: tuple[Finger, Finger],
        things: Set[int],
        axis: Floats,
    ) -> None:
        self._model, self._data, self._axis = model, data, axis
        # The last one is that of soft bodies, whose contacts have the geom -1.
        self._roles = [0] * (model.ngeom + 1)
        for role, geoms in zip(
            (LEFT, RIGHT, THING), (*(geoms_of(model, finger) for finger in fingers), things), strict=True
        ):
            for geom in geoms:
                self._roles[geom] |= role
        self._sensors = [self._sensor(finger, side) for finger, side in zip(fingers, SIDES, strict=True)]
        self._by_contacts, self.has_sensors = None in self._sensors, any(self._sensors)
        numbers = [identifier(model, "sensor", finger.sensor) for finger in fingers if finger.sensor]
        bodies = {int(model.site_bodyid[model.sensor_objid[number]]) for number in numbers}
        if len(bodies) < len(numbers):
            raise ConfigError(
                f"gripper.file: the sensors {fingers[0].sensor!r} and {fingers[1].sensor!r} are on the same body, "
                "and each finger needs its own"
            )
        cutoffs = [float(model.sensor_cutoff[number]) for number in numbers]
        self.most_n = min((cutoff for cutoff in cutoffs if cutoff > 0.0), default=inf)
        """From this force on, a sensor of the model shows no larger one."""
        self._wrench = np.zeros(6)
        self._force = plain(self._wrench)

    def _sensor(self, finger: Finger, side: float) -> Callable[[], float] | None:
        """Return a function that reads the sensor of a finger; None for one that is measured by its contacts."""
        if not finger.sensor:
            return None
        model, data = self._model, self._data
        sensor = identifier(model, "sensor", finger.sensor)
        kind, address = int(model.sensor_type[sensor]), int(model.sensor_adr[sensor])
        if kind == mujoco.mjtSensor.mjSENS_TOUCH:
            return lambda: float(data.sensordata[address])
        if kind != mujoco.mjtSensor.mjSENS_FORCE:
            raise ConfigError(
                f"gripper.file: the sensor {finger.sensor!r} is neither a touch nor a force sensor"
            )
        local = data.sensordata[address : address + 3]
        turn = data.site_xmat[int(model.sensor_objid[sensor])].reshape(3, 3)
        # It shows the force that the finger gets from what carries it, against that of the thing.
        return lambda: float(-side * ((turn @ local) @ self._axis))

    def forces_n(self) -> tuple[float, float]:
        """Return the force on the left and on the right finger along the closing direction."""
        left, right = self.borne_n() if self._by_contacts else (0.0, 0.0)
        by_left, by_right = self._sensors
        return left if by_left is None else by_left(), right if by_right is None else by_right()

    def borne_n(self) -> tuple[float, float]:
        """Return the same by the contacts, whatever the sensors show."""
        left = right = 0.0
        if self._data.ncon:
            for _, on_left, on_right in self._contacts():
                left += on_left
                right += on_right
        return left, right

    def _contacts(self) -> Iterator[tuple[int, float, float]]:
        """Yield the number of each contact of a finger, and its force on the left and on the right one."""
        model, data, roles, force = self._model, self._data, self._roles, self._force
        rows = self._along_axis(data.contact.frame)
        for k, pair in enumerate(data.contact.geom.tolist()):
            signs = SIGNS[roles[pair[0]]][roles[pair[1]]]
            if signs == NOTHING:
                continue
            mujoco.mj_contactForce(model, data, k, self._wrench)
            along = rows[3 * k] * force[0] + rows[3 * k + 1] * force[1] + rows[3 * k + 2] * force[2]
            yield k, signs[0] * along, signs[1] * along

    def places_m(self) -> Floats:
        """Return where each finger presses: the thing's surface along the closing direction, x, y and z, a row each.

        There are no rows where one presses on nothing. With a margin, a thing is pressed before it is reached.
        """
        contact, axis, moments = self._data.contact, self._axis, np.zeros((2, 5))
        for k, on_left, on_right in self._contacts():
            surface_m = contact.pos[k] @ axis + copysign(max(contact.dist[k], 0.0) / 2.0, on_left - on_right)
            moments += np.outer((on_left, on_right), (1.0, surface_m, *contact.pos[k]))
        places: Floats = moments[:, 1:] / moments[:, :1] if min(moments[:, 0]) > 0.0 else moments[:0]
        return places

    def squeeze_n(self) -> float:
        """Return the force that squeezes a thing along the closing direction, by whatever parts of the gripper move."""
        model, data, roles, force = self._model, self._data, self._roles, self._force
        rows, closing, opening = self._along_axis(data.contact.frame), 0.0, 0.0
        for k, pair in enumerate(data.contact.geom.tolist()):
            for part, thing, sign in ((*pair, 1.0), (*pair[::-1], -1.0)):
                if roles[thing] & THING and self._moves(part):
                    mujoco.mj_contactForce(model, data, k, self._wrench)
                    along = sign * sum(rows[3 * k + j] * force[j] for j in range(3))
                    closing, opening = closing + max(along, 0.0), opening + max(-along, 0.0)
        return min(closing, opening)

    def _moves(self, geom: int) -> bool:
        """Return whether a geom is a part of the gripper that moves against the palm."""
        body = self._model.body_weldid[self._model.geom_bodyid[geom]]
        moving = self._model.body_dofnum[body] > 0 and self._model.body_parentid[body] != 0
        return bool(moving and not self._roles[geom] & THING)

    def _along_axis(self, frames: Floats) -> list[float]:
        """Return the component along the closing direction of each row of the frames of the contacts."""
        return (frames.reshape(-1, 3) @ self._axis).tolist()  # type: ignore[no-any-return]


def _acting(finger: int, role: int, other_role: int) -> float:
    if other_role & finger and role & (ALL - finger):
        return 1.0
    return -1.0 if role & finger and other_role & (ALL - finger) else 0.0


SIGNS: Final = [
    [(-_acting(LEFT, role, other), _acting(RIGHT, role, other)) for other in range(ALL + 1)]
    for role in range(ALL + 1)
]
"""By the roles of the geoms of a contact: the sign of its force on the left and on the right finger; 0: none.

The first row of the frame of a contact is the normal, from the first geom to the second; the force acts on the second.
"""


class SpringCells:
    """The cells of both fingers that are slides on springs: their forces (N), and the sums of them."""

    def __init__(self, model: mujoco.MjModel, data: mujoco.MjData, gripper: GripperFile) -> None:
        self._positions, self._rests, self._springs = plain(data.qpos), plain(model.qpos_spring), []
        for finger in (gripper.left, gripper.right):
            joints = [identifier(model, "joint", name) for name in finger.cells]
            springs = [(int(model.jnt_qposadr[k]), float(model.jnt_stiffness[k].flat[0])) for k in joints]
            for name, (_, stiffness) in zip(finger.cells, springs, strict=True):
                if stiffness <= 0.0:
                    raise ConfigError(f"gripper.file: the joint {name!r} of a cell has no stiffness")
            self._springs.append(springs)

    def images(self, _data: mujoco.MjData | None) -> tuple[tuple[float, ...], tuple[float, ...]]:
        """Return the cells of the left and the right finger, row by row."""
        values, rests = self._positions, self._rests
        left, right = (tuple((values[k] - rests[k]) * n_m for k, n_m in side) for side in self._springs)
        return left, right

    def forces_n(self) -> tuple[float, float]:
        """Return the force on the left and on the right finger."""
        left, right = self.images(None)
        return sum(left), sum(right)


class Palm:
    """The accelerometer of the palm: a sample of each step of MuJoCo, with noise."""

    def __init__(
        self,
        model: mujoco.MjModel,
        data: mujoco.MjData,
        accelerometer: PalmSensor,
        generator: np.random.Generator,
    ) -> None:
        sensor = identifier(model, "sensor", accelerometer.sensor)
        if model.sensor_type[sensor] != mujoco.mjtSensor.mjSENS_ACCELEROMETER:
            raise ConfigError(f"gripper.file: the sensor {accelerometer.sensor!r} is not an accelerometer")
        address = int(model.sensor_adr[sensor])
        self._values: Floats = data.sensordata[address : address + 3]
        self._floor_m_s2, self._gear_1_s = accelerometer.floor_m_s2, accelerometer.gear_1_s
        self._generator, self._count = generator, 0
        self._rows: list[tuple[float, ...]] = []

    def measure(self, rate_m_s: float) -> None:
        """Take a sample, at this rate of the gap."""
        spread = hypot(self._floor_m_s2, self._gear_1_s * rate_m_s)
        row: Floats = self._values + spread * self._generator.standard_normal(3)
        self._rows.append(tuple(row.tolist()))

    def samples(self, t_s: float) -> Samples:
        """Return the samples since the last tick, the last of them at this time (s)."""
        rows, self._rows = tuple(self._rows), []
        self._count += len(rows)
        return Samples(t_s, self._count, len(rows), rows)


@frozen
class Cells:
    """The sensors of the cells of both fingers: where their values are, and how many."""

    addresses: tuple[int, int]
    count: int

    def images(self, data: mujoco.MjData) -> tuple[tuple[float, ...], tuple[float, ...]]:
        """Return the cells of the left and the right finger, row by row."""
        left, right = (tuple(map(float, data.sensordata[a : a + self.count])) for a in self.addresses)
        return left, right


def cells_of(model: mujoco.MjModel, data: mujoco.MjData, gripper: GripperFile) -> Cells | SpringCells | None:
    """Return the cells of the fingers; None without arrays. Raises ConfigError for another number of values."""
    if gripper.left.cells:
        return SpringCells(model, data, gripper)
    if not gripper.left.array:
        return None
    addresses = []
    for finger in (gripper.left, gripper.right):
        sensor = identifier(model, "sensor", finger.array)
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


def extent(model: mujoco.MjModel, axis: int) -> tuple[float, float]:
    """Return from where to where (m) a thing reaches along an axis: its geoms that touch, and its flexible parts."""
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    ends = [float(end) for end in data.flexvert_xpos[:, axis]] if model.nflexvert else []
    for k in range(model.ngeom):
        if model.geom_contype[k] or model.geom_conaffinity[k]:
            row = data.geom_xmat[k].reshape(3, 3)[axis]
            centre = float(data.geom_xpos[k][axis] + row @ model.geom_aabb[k][:3])
            reach = float(np.abs(row) @ model.geom_aabb[k][3:])
            ends += [centre - reach, centre + reach]
    return min(ends, default=0.0), max(ends, default=0.0)


def _face_sites(model: mujoco.MjModel, gap: Gap) -> tuple[list[int], ...]:
    """Return the sites of the left and the right face; nothing where the gap has neither sites nor points."""
    if gap.sites:
        return tuple([identifier(model, "site", name)] for name in gap.sites)
    if gap.left:
        return tuple(
            [identifier(model, "site", f"{POINT}{side}{k}") for k in range(len(points))]
            for side, points in (("left", gap.left), ("right", gap.right))
        )
    return ()


def faces(model: mujoco.MjModel, data: mujoco.MjData, gripper: GripperFile) -> tuple[Floats, Floats]:
    """Return where the left and the right finger touch things: what the gap is measured between, or their geoms."""
    gap = gripper.gap
    if sites := _face_sites(model, gap):
        left, right = (data.site_xpos[site].mean(axis=0) for site in sites)
    elif gap.geoms:
        left, right = (data.geom_xpos[identifier(model, "geom", name)].copy() for name in gap.geoms)
    else:
        left, right = (
            np.mean([data.geom_xpos[k] for k in geoms_of(model, finger)], axis=0)
            for finger in (gripper.left, gripper.right)
        )
    return left, right


def geoms_of(model: mujoco.MjModel, finger: Finger) -> frozenset[int]:
    """Return the numbers of the geoms of a finger that can touch."""
    geoms = {identifier(model, "geom", name) for name in finger.geoms}
    for name in finger.bodies:
        body = identifier(model, "body", name)
        start = int(model.body_geomadr[body])
        geoms |= set(range(start, start + int(model.body_geomnum[body])))
    return frozenset(geoms)
