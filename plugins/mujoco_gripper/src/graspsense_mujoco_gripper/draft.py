"""A first gripper file for a model: what can be found without doubt, and what is left to fill in.

The fingers are the last bodies that an actuator moves; a single one is opposed by the body that it is hinged to. The
actuators that close them are those that change their distance.
"""

from __future__ import annotations

import json
import os
from itertools import product
from pathlib import Path

import mujoco
import numpy as np
from attrs import frozen
from numpy.typing import NDArray

from graspsense.plugin_api import ConfigError
from graspsense_mujoco_gripper.drive import LEAST_TURN_RAD, widest_hinge_rad
from graspsense_mujoco_gripper.gripper_file import model_path
from graspsense_mujoco_gripper.model import compiled, exclude_neighbours, read_spec

Floats = NDArray[np.float64]
MOVE_S = 1.0
LEAST_CHANGE_M = 1e-3
FARTHEST_M = 1.0
FURTHER = (
    mujoco.mjtSensor.mjSENS_TOUCH,
    mujoco.mjtSensor.mjSENS_FORCE,
    mujoco.mjtSensor.mjSENS_ACCELEROMETER,
    mujoco.mjtSensor.mjSENS_GYRO,
    mujoco.mjtSensor.mjSENS_TORQUE,
)
"""Sensors that a gripper file can name."""


@frozen
class Draft:
    """The text of a gripper file, what was decided, and what is left to fill in."""

    text: str
    decided: tuple[str, ...]
    left: tuple[str, ...]


@frozen
class _Closing:
    """The actuators that close with their controls (open, closed), and the bodies of both fingers.

    `points` are the nearest of closed fingers; where these have passed each other, of open ones.
    """

    actuators: dict[str, tuple[float, float]]
    fingers: tuple[tuple[int, ...], tuple[int, ...]]
    points: tuple[Floats, ...]
    overlap: str


def drafted(name: str, folder: Path) -> Draft:
    """Return a gripper file for a model, to be put into `folder`. Raises ConfigError where it has no fingers."""
    path = model_path(name, Path.cwd())
    model, radian = _model(path)
    closing = _closing(model)
    written = name if ":" in name else Path(os.path.relpath(path.resolve(), folder.resolve())).as_posix()
    lines = [f'model = "{written}"']
    if radian:
        lines.append('angle = "radian"')
    lines += [
        f"actuators = {json.dumps(list(closing.actuators))}",
        f"open = {[round(pair[0], 6) for pair in closing.actuators.values()]}",
        f"closed = {[round(pair[1], 6) for pair in closing.actuators.values()]}",
        "",
        "# The nearest points of the fingers: correct them if things are held elsewhere.",
        "[gap]",
    ]
    left, right = ([model.body(k).name for k in bodies] for bodies in closing.fingers)
    points, fingers = iter(closing.points), {"left": left, "right": right}
    for side, bodies in fingers.items():
        places = [f'{{ body = "{body}", at = {next(points).round(5).tolist()} }}' for body in bodies]
        lines.append(f"{side} = [{', '.join(places)}]")
    for side, bodies in fingers.items():
        lines += ["", f"[{side}]", f"bodies = {json.dumps(bodies)}"]
    # An enumerated value of MuJoCo equals a number of Python, and none of numpy.
    sensors = [model.sensor(k).name for k, kind in enumerate(model.sensor_type.tolist()) if kind in FURTHER]
    lines += [f"# A sensor of the model: {sensor}" for sensor in sensors]
    unclear = ["speed_limit_m_s, where it is not 0.1 m/s"]
    if not all(
        model.actuator(actuator).forcelimited or model.actuator(actuator).ctrllimited
        for actuator in closing.actuators
    ):
        unclear.append("effort_limit_n: the actuators have no limits")
    if sensors:
        unclear.append("sensor of a finger, or channels: the forces are those of the contacts until then")
    if closing.overlap:
        unclear.append(
            f"the points of the gap: closed, the geoms of the fingers {closing.overlap}. Limit what closes them; where "
            "they are hulls of meshes, name the geoms that touch, with only_fingers = true"
        )
    decided = (
        *(["angles in radians: the ranges of the joints are too small for degrees"] if radian else []),
        f"actuators that close: {', '.join(closing.actuators)}",
        f"left finger: {', '.join(left)}; right finger: {', '.join(right)}",
        f"sensors: {', '.join(sensors) or 'none'}",
    )
    return Draft("\n".join(lines) + "\n", decided, tuple(unclear))


def _model(path: Path) -> tuple[mujoco.MjModel, bool]:
    """Return the model, and whether its angles are radians although it does not say so."""
    for radian in (False, True):
        spec = read_spec(path)
        if radian:
            spec.compiler.degree = False
        exclude_neighbours(spec)
        model = compiled(spec, str(path))
        if not 0.0 < widest_hinge_rad(model) < LEAST_TURN_RAD:
            break
    return model, radian


def _closing(model: mujoco.MjModel) -> _Closing:
    """Return how the fingers close. Raises ConfigError where there are no two opposed fingers."""
    if model.nu == 0:
        raise ConfigError("the model has no actuator that could close fingers: add one to its <actuator>")
    ends = [_ends(model, k) for k in range(model.nu)]
    relaxed = [float(np.clip(0.0, low, high)) for low, high in ends]
    low, high = (_moved(model, [pair[k] for pair in ends]) for k in (0, 1))
    tips = _tips(model, low, high)
    if not tips:
        raise ConfigError("no actuator moves a body with geoms that touch: the model has no fingers")
    fingers = _opposed(model, tips, low, high)
    closers: dict[int, tuple[float, float]] = {}
    for k, pair in enumerate(ends):
        gaps = []
        for control in pair:
            controls = [pair_of[0] if j in closers else relaxed[j] for j, pair_of in enumerate(ends)]
            controls[k] = control
            gaps.append(_nearest(model, _moved(model, controls), fingers)[0])
        if abs(gaps[0] - gaps[1]) > LEAST_CHANGE_M:
            closers[k] = pair if gaps[0] > gaps[1] else (pair[1], pair[0])
    if not closers:
        raise ConfigError(
            "no actuator changes the distance of two fingers: the model has no two opposed fingers. Name them in a "
            "gripper file by hand"
        )
    opened, closed = (
        _moved(model, [closers.get(k, (idle, idle))[end] for k, idle in enumerate(relaxed)]) for end in (0, 1)
    )
    total_m, points = _nearest(model, closed, fingers)
    overlap_m = -total_m / len(points)
    overlap = f"overlap by {overlap_m * 1e3:.0f} mm" if overlap_m > LEAST_CHANGE_M else ""
    across = [
        _place(model, data, *fingers[1]) - _place(model, data, *fingers[0]) for data in (opened, closed)
    ]
    if across[0] @ across[1] < 0.0:
        # What was the far side of a finger is now the near one.
        overlap, points = "have passed each other", _nearest(model, opened, fingers)[1]
    return _Closing({model.actuator(k).name: pair for k, pair in closers.items()}, fingers, points, overlap)


def _ends(model: mujoco.MjModel, actuator: int) -> tuple[float, float]:
    if model.actuator_ctrllimited[actuator]:
        low, high = model.actuator_ctrlrange[actuator]
        return float(low), float(high)
    return -1.0, 1.0


def _moved(model: mujoco.MjModel, controls: list[float]) -> mujoco.MjData:
    """Return the state after a second under these controls."""
    data = mujoco.MjData(model)
    data.ctrl[:] = controls
    for _ in range(int(MOVE_S / model.opt.timestep)):
        mujoco.mj_step(model, data)
    mujoco.mj_forward(model, data)
    return data


def _geoms(model: mujoco.MjModel, body: int) -> list[int]:
    """Return the geoms of a body that touch."""
    start = int(model.body_geomadr[body])
    numbers = range(start, start + int(model.body_geomnum[body])) if start >= 0 else range(0)
    return [k for k in numbers if model.geom_contype[k] or model.geom_conaffinity[k]]


def _tips(model: mujoco.MjModel, low: mujoco.MjData, high: mujoco.MjData) -> list[int]:
    """Return the last bodies of each chain that move, and have geoms that touch."""
    moving = [
        k
        for k in range(1, model.nbody)
        if _geoms(model, k)
        and float(np.abs(low.xpos[k] - high.xpos[k]).max() + np.abs(low.xmat[k] - high.xmat[k]).max())
        > LEAST_CHANGE_M
    ]
    above = {j for k in moving for j in _above(model, k)}
    ends = [k for k in moving if k not in above]
    deepest = max((len(_above(model, k)) for k in ends), default=0)
    return [k for k in ends if len(_above(model, k)) == deepest]


def _above(model: mujoco.MjModel, body: int) -> list[int]:
    chain = []
    while body:
        body = int(model.body_parentid[body])
        chain.append(body)
    return chain


def _opposed(
    model: mujoco.MjModel, tips: list[int], low: mujoco.MjData, high: mujoco.MjData
) -> tuple[tuple[int, ...], tuple[int, ...]]:
    """Return the bodies of both fingers: those that move against the first one are opposed to it."""
    if len(tips) == 1:
        opposed = next((k for k in _above(model, tips[0]) if k and _geoms(model, k)), 0)
        if not opposed:
            raise ConfigError(
                f"only {model.body(tips[0]).name!r} moves, and nothing is opposed to it: a gripper has two fingers"
            )
        return (tips[0],), (opposed,)
    if len(tips) == 2:
        return (tips[0],), (tips[1],)
    moves = np.array([_place(model, low, k) - _place(model, high, k) for k in tips])
    left = tuple(k for k, move in zip(tips, moves, strict=True) if move @ moves[0] > 0.0)
    right = tuple(k for k in tips if k not in left)
    if not right:
        raise ConfigError(
            f"the bodies {', '.join(model.body(k).name for k in left)} all move in one direction: the model has no two "
            "opposed fingers"
        )
    return left, right


def _place(model: mujoco.MjModel, data: mujoco.MjData, *bodies: int) -> Floats:
    """Return the mean place of the geoms of these bodies that touch."""
    return np.asarray(np.mean([data.geom_xpos[g] for body in bodies for g in _geoms(model, body)], axis=0))


def _nearest(
    model: mujoco.MjModel, data: mujoco.MjData, fingers: tuple[tuple[int, ...], tuple[int, ...]]
) -> tuple[float, tuple[Floats, ...]]:
    """Return the sum of the distances of each body to the opposed finger, and its nearest point in its own frame."""
    total, points = 0.0, []
    for bodies, opposed in (fingers, fingers[::-1]):
        others = [other for body in opposed for other in _geoms(model, body)]
        for body in bodies:
            best, nearest = FARTHEST_M, np.zeros(3)
            for geom, other in product(_geoms(model, body), others):
                ends = np.zeros(6)
                distance = float(mujoco.mj_geomDistance(model, data, geom, other, FARTHEST_M, ends))
                if distance < best:
                    best, nearest = distance, _level_with(data, geom, other, ends[:3])
            total += best
            points.append(data.xmat[body].reshape(3, 3).T @ (nearest - data.xpos[body]))
    return total, tuple(points)


def _level_with(data: mujoco.MjData, geom: int, opposed: int, point: Floats) -> Floats:
    """Return the point in the middle of a geom that faces the opposed one as near as this one does.

    Of faces that are parallel, any points are the nearest.
    """
    centre = data.geom_xpos[geom]
    axis = data.geom_xpos[opposed] - centre
    length = float(np.linalg.norm(axis))
    if length < LEAST_CHANGE_M:
        return point
    return np.asarray(centre + axis * float((point - centre) @ axis) / length**2)
