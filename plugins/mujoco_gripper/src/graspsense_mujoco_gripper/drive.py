"""The drive: from a command to the controls of the actuators, by what a test move of the empty gripper showed.

Effort is a force on the gap: by the principle of virtual work it is the force with which each finger presses. An
actuator of gain g and bias b0 + b1 length + b2 velocity exerts the force g control + bias, solved for the control.
"""

from __future__ import annotations

from bisect import bisect_left
from hashlib import sha256
from math import inf, isfinite, sqrt

import mujoco
import numpy as np
from attrs import frozen
from numpy.typing import NDArray

from graspsense.plugin_api import EFFORT, FORCE, POSITION, VELOCITY, Command, ConfigError
from graspsense_mujoco_gripper.gripper_file import GripperFile
from graspsense_mujoco_gripper.measurement import closing_axis, faces, gap_reader, plain
from graspsense_mujoco_gripper.model import identifier

Floats = NDArray[np.float64]
TEST_S = 1.0
"""Time of each half of the test move: opening, and closing."""
POINTS = 64
MOST_TRAVELS = 64
_TRAVELS: dict[tuple[bytes, str, float | None], Travel] = {}
LEAST_TRAVEL_M = 1e-3
WIDEST_M = 1.0
"""No gripper opens further; a model in millimetres does."""
LEAST_TURN_RAD = 0.1
OTHER_TRAVEL = 1.6
"""By more than this factor, the travel by a joint is not that of the fingers; of those that turn it is not exactly."""
CLEARANCE_M = 0.004
"""A thing is put where the fingers have this much more room than it needs, so that one that stands still is clear."""
MASS_S2 = 1e-6
"""The gap is moved by this much of its acceleration, to see how it accelerates."""
LEAST_MASS_KG = 1e-3
UNKNOWN_MASS_KG = 0.5
"""Assumed where the fingers do not accelerate."""
SERVO_RAD_S, FASTEST_RAD_S = 60.0, 300.0
"""Natural frequency of the servo on the gap, critically damped; and that of the lightest grippers."""
SERVO_SHARE, LONGEST_S = 0.1, 1e-3
"""Controls are kept no longer than this share of the servo's time constant, and than this time."""
SERVO_N_M = 10_000.0
"""Least stiffness of the servo: at a lower one the force of light fingers on a thing grows too slowly."""


@frozen(eq=False)
class Travel:
    """The test move: the gap from closed to open, and the length of each actuator's transmission there."""

    gap_m: Floats
    length: Floats
    mass_kg: float
    """The mass that moves with the gap."""
    axis: Floats
    """The closing direction, where the fingers touch the thing."""
    place: Floats
    """The point in the middle of the fingers, where they touch the thing."""
    qpos_open: Floats

    @property
    def open_m(self) -> float:
        """The gap with the fingers open."""
        return float(self.gap_m[-1])

    def lengths(self, gap_m: float) -> Floats:
        """Return the length of each transmission at a gap."""
        return np.array([np.interp(gap_m, self.gap_m, row) for row in self.length])

    def slopes(self) -> Floats:
        """Return the change of each length with the gap (1, or rad/m) below each of the gaps, a row each."""
        rises = (np.diff(self.length) / np.diff(self.gap_m)).T
        return np.vstack([rises[:1], rises])


def test_move(model: mujoco.MjModel, gripper: GripperFile, width_m: float | None) -> Travel:
    """Open and close the empty gripper. Raises ConfigError where the fingers do not move, or move the wrong way.

    `width_m` is that of the thing to be grasped: fingers that turn are looked at where they touch it. Without a thing
    they are looked at half closed. The move is kept: it follows from the arguments, and takes as long as a short grasp.
    """
    whole = np.empty(mujoco.mj_sizeModel(model), np.uint8)
    mujoco.mj_saveModel(model, None, whole)
    key = (sha256(whole.tobytes()).digest(), repr(gripper), width_m)
    if (travel := _TRAVELS.get(key)) is None:
        if len(_TRAVELS) >= MOST_TRAVELS:
            _TRAVELS.clear()
        travel = _TRAVELS[key] = _moved(model, gripper, width_m)
    return travel


def _moved(model: mujoco.MjModel, gripper: GripperFile, width_m: float | None) -> Travel:
    _check_angles(model, gripper)
    data = mujoco.MjData(model)
    ids = actuator_ids(model, gripper)
    steps = max(int(TEST_S / model.opt.timestep), 1)
    data.ctrl[ids] = gripper.open
    for _ in range(steps):
        mujoco.mj_step(model, data)
    _check(data)
    axis = closing_axis(gripper, *faces(model, data, gripper))
    qpos_open = data.qpos.copy()
    measured_m = gap_reader(model, data, gripper.gap, axis)
    start_m = measured_m()
    if start_m > WIDEST_M:
        raise ConfigError(
            f"gripper.file: the open fingers are {start_m:.3g} m apart, and {WIDEST_M:g} m are allowed: give the "
            "lengths of the model and of the gap in metres"
        )
    data.ctrl[ids] = gripper.closed
    gaps, lengths, states = [start_m], [data.actuator_length[ids].copy()], [qpos_open]
    for _ in range(steps):
        mujoco.mj_step(model, data)
        gap_m = measured_m()
        if 0.0 <= gap_m < gaps[-1] - 1e-6:
            gaps.append(gap_m)
            lengths.append(data.actuator_length[ids].copy())
            states.append(data.qpos.copy())
    _check(data)
    end_m = max(measured_m(), 0.0)
    if end_m > start_m - LEAST_TRAVEL_M:
        raise ConfigError(
            f"gripper.file: with the controls `closed` the gap goes from {start_m * 1e3:.3g} to {end_m * 1e3:.3g} mm, "
            "so the fingers do not close: look at actuators, open, closed and gap"
        )
    touch_m = (start_m + end_m) / 2.0 if width_m is None else width_m + CLEARANCE_M
    data.qpos[:] = states[int(np.argmin(np.abs(np.array(gaps) - touch_m)))]
    mujoco.mj_kinematics(model, data)
    left, right = faces(model, data, gripper)
    axis = closing_axis(gripper, left, right)
    travel_m = _opposed_travel_m(model, gripper, axis, (states[0], states[-1]))
    _check_scale(gripper.gap.joint, gaps[0] - gaps[-1], travel_m)
    if gripper.gap.sites or gripper.gap.left:
        # The gap depends on the closing direction.
        measured_m = gap_reader(model, data, gripper.gap, axis)
        for k, state in enumerate(states):
            data.qpos[:] = state
            mujoco.mj_kinematics(model, data)
            gaps[k] = measured_m()
    half_m = (gaps[0] + min(gaps)) / 2.0
    half = states[int(np.argmin(np.abs(np.array(gaps) - half_m)))]
    grid = np.linspace(min(gaps), gaps[0], POINTS)
    order = np.argsort(gaps)
    table = np.array(
        [np.interp(grid, np.array(gaps)[order], column) for column in np.array(lengths)[order].T]
    )
    slopes = np.gradient(table, grid, axis=1)[:, POINTS // 2]
    mass_kg = _mass(model, gripper, half, axis, slopes)
    return Travel(grid, table, mass_kg, axis, (left + right) / 2.0, qpos_open)


def _check_scale(joint: str, closed_m: float, travel_m: float) -> None:
    """Raise ConfigError where the gap by a joint does not close as the fingers do."""
    if joint and not 1.0 / OTHER_TRAVEL < closed_m / travel_m < OTHER_TRAVEL:
        raise ConfigError(
            f"gripper.file: by the joint {joint!r} the gap closes by {closed_m * 1e3:.3g} mm, and the fingers by "
            f"{travel_m * 1e3:.3g} mm: look at scale, in metres of the gap for a unit of the joint"
        )


def _check_angles(model: mujoco.MjModel, gripper: GripperFile) -> None:
    """Raise ConfigError for hinges that hardly turn: their ranges are probably radians, read as degrees."""
    widest = widest_hinge_rad(model)
    if not gripper.angle and 0.0 < widest < LEAST_TURN_RAD:
        raise ConfigError(
            f"gripper.file: the hinges of the model turn by {np.degrees(widest):.2g} degrees at most, as if radians "
            'were read as degrees: give angle = "radian", or angle = "degree" where that is right'
        )


def widest_hinge_rad(model: mujoco.MjModel) -> float:
    """Return the range of the limited hinge that turns furthest; 0 without one."""
    hinges = (model.jnt_type == mujoco.mjtJoint.mjJNT_HINGE) & (model.jnt_limited == 1)
    return float(np.ptp(model.jnt_range[hinges], axis=1).max(initial=0.0))


def _opposed_travel_m(
    model: mujoco.MjModel, gripper: GripperFile, axis: Floats, states: tuple[Floats, Floats]
) -> float:
    """Return by how much the faces of the fingers come nearer to each other. Raises ConfigError where they do not."""
    data, apart = mujoco.MjData(model), []
    for state in states:
        data.qpos[:] = state
        mujoco.mj_kinematics(model, data)
        left, right = faces(model, data, gripper)
        apart.append(float((right - left) @ axis))
    if apart[1] > apart[0] - LEAST_TRAVEL_M:
        raise ConfigError(
            f"gripper.file: the left and the right finger are {apart[0] * 1e3:.1f} mm apart while open, and "
            f"{apart[1] * 1e3:.1f} mm while closed: they are not opposed. Look at left, right and gap"
        )
    return apart[0] - apart[1]


def _mass(model: mujoco.MjModel, gripper: GripperFile, qpos: Floats, axis: Floats, slopes: Floats) -> float:
    """Return the mass (kg) that moves with the gap: how much more it accelerates under the controls `closed`.

    At rest, and away from the ends of the joints, no friction and no stop takes a part of the force.
    """
    ids, data = actuator_ids(model, gripper), mujoco.MjData(model)
    accelerations, forces = [], []
    for controls in (gripper.open, gripper.closed):
        data.qpos[:] = qpos
        data.ctrl[ids] = controls
        mujoco.mj_forward(model, data)
        accelerations.append(data.qacc.copy())
        forces.append(data.actuator_force[ids].copy())
    measured_m = gap_reader(model, data, gripper.gap, axis)
    gap_m = measured_m()
    mujoco.mj_integratePos(model, data.qpos, accelerations[1] - accelerations[0], MASS_S2)
    mujoco.mj_kinematics(model, data)
    moved_m = gap_m - measured_m()
    if moved_m <= 0.0:
        return UNKNOWN_MASS_KG
    # The coupling of two fingers gives way a little, so the slope is that of the test move.
    effort_n = float((forces[0] - forces[1]) @ slopes)
    mass = effort_n * MASS_S2 / moved_m
    return mass if isfinite(mass) and mass > LEAST_MASS_KG else UNKNOWN_MASS_KG


def actuator_ids(model: mujoco.MjModel, gripper: GripperFile) -> list[int]:
    """Return the numbers of the closing actuators. Raises ConfigError for one with a state or a nonlinear gain."""
    ids = [identifier(model, "actuator", name) for name in gripper.actuators]
    for k, name in zip(ids, gripper.actuators, strict=True):
        if model.actuator_gaintype[k] != mujoco.mjtGain.mjGAIN_FIXED or model.actuator_gainprm[k][0] == 0.0:
            raise ConfigError(f"gripper.file: actuator {name!r} has no fixed gain: muscles are not supported")
        if model.actuator_dyntype[k] != mujoco.mjtDyn.mjDYN_NONE:
            raise ConfigError(
                f"gripper.file: actuator {name!r} has a state of its own (dyntype): not supported"
            )
    return ids


def _check(data: mujoco.MjData) -> None:
    """Raise ConfigError where MuJoCo warned that the state is bad."""
    if problem := instability(data):
        raise ConfigError(
            f"gripper.file: {problem} while the empty gripper moves: use a smaller gripper.timestep_s"
        )


def instability(data: mujoco.MjData) -> str:
    """Return what MuJoCo warned of; empty if the state is good."""
    counts, singular = data.warning.number, mujoco.mjtWarning.mjWARN_INERTIA
    told = (
        mujoco.mju_warningText(kind, data.warning[kind].lastinfo)
        for kind, count in enumerate(counts)
        if count and kind != singular
    )
    # The advice of MuJoCo follows its first sentence.
    return next((f"MuJoCo warns: {text.partition('.')[0]}" for text in told), "")


class ActuatorDrive:
    """Sets the controls for a command.

    The sums over the actuators are written out: with the few that a gripper has, that is faster than numpy.
    """

    def __init__(
        self, model: mujoco.MjModel, data: mujoco.MjData, gripper: GripperFile, travel: Travel
    ) -> None:
        ids = actuator_ids(model, gripper)
        gain = model.actuator_gainprm[ids, 0]
        affine = model.actuator_biastype[ids] == mujoco.mjtBias.mjBIAS_AFFINE
        bias = np.where(affine[:, None], model.actuator_biasprm[ids, :3], 0.0)
        limited = model.actuator_ctrllimited[ids].astype(bool)
        controls = np.where(limited[:, None], model.actuator_ctrlrange[ids], [-inf, inf])
        forced = model.actuator_forcelimited[ids].astype(bool)
        forces = np.where(forced[:, None], model.actuator_forcerange[ids], [-inf, inf])
        # Gain, bias (3), and the ranges of control and force of each.
        self._actuators = np.column_stack([gain, bias, controls, forces]).tolist()
        self._ids = ids
        self._gaps_m, self._lengths = travel.gap_m.tolist(), travel.length.T.tolist()
        self._slopes = travel.slopes().tolist()
        self._mass_kg = float(travel.mass_kg)
        self._servo_rad_s = min(max(sqrt(SERVO_N_M / travel.mass_kg), SERVO_RAD_S), FASTEST_RAD_S)
        self._control = plain(data.ctrl)
        self._length, self._velocity = plain(data.actuator_length), plain(data.actuator_velocity)
        self.effort_limit_n = float(gripper.effort_limit_n or _greatest(travel, self._actuators))
        self.effort_n = 0.0
        """The effort that the actuators exert (N), positive where it closes."""
        self._target_m = travel.open_m
        self.longest_s = min(SERVO_SHARE / self._servo_rad_s, LONGEST_S)
        """Controls are kept no longer than this."""

    def reset(self, gap_m: float) -> None:
        """Begin at this gap."""
        self._target_m = gap_m

    def set_controls(self, command: Command, gap_m: float, rate_m_s: float, dt_s: float) -> None:
        """Set the controls for the next `dt_s` under a command."""
        effort = self._effort(command, gap_m, rate_m_s, dt_s)
        limit = min(command.effort_limit_n, self.effort_limit_n)
        effort = min(max(effort, -limit), limit)
        row = min(max(bisect_left(self._gaps_m, gap_m), 1), len(self._gaps_m) - 1)
        slopes, count = self._slopes[row], len(self._ids)
        per_slope = effort / sum(map(abs, slopes))
        together_n = self._keeping_together(row, gap_m, rate_m_s) if count > 1 else [0.0]
        exerted_n = 0.0
        for k in range(count):
            number, slope, actuator = self._ids[k], slopes[k], self._actuators[k]
            wanted = (-per_slope if slope > 0.0 else per_slope) if slope != 0.0 else 0.0
            wanted += together_n[k]
            bias = actuator[1] + actuator[2] * self._length[number] + actuator[3] * self._velocity[number]
            control = min(max((wanted - bias) / actuator[0], actuator[4]), actuator[5])
            self._control[number] = control
            exerted_n -= min(max(actuator[0] * control + bias, actuator[6]), actuator[7]) * slope
        self.effort_n = exerted_n

    def _keeping_together(self, row: int, gap_m: float, rate_m_s: float) -> list[float]:
        """Return forces that keep several actuators at the positions of the test move for this gap, without effort."""
        slopes, lower, upper = self._slopes[row], self._lengths[row - 1], self._lengths[row]
        start_m, end_m = self._gaps_m[row - 1], self._gaps_m[row]
        share = min(max((gap_m - start_m) / (end_m - start_m), 0.0), 1.0)
        square = sum(slope * slope for slope in slopes)
        stiffness, frequency = self._mass_kg / square * self._servo_rad_s, self._servo_rad_s
        closing, together_n = 0.0, []
        for k, slope in enumerate(slopes):
            number = self._ids[k]
            away = lower[k] + share * (upper[k] - lower[k]) - self._length[number]
            force = stiffness * (frequency * away + 2.0 * (slope * rate_m_s - self._velocity[number]))
            together_n.append(force)
            closing += slope * force
        return [force - slope * (closing / square) for force, slope in zip(together_n, slopes, strict=True)]

    def _effort(self, command: Command, gap_m: float, rate_m_s: float, dt_s: float) -> float:
        """Return the effort for a command; a servo on the gap keeps the speed, or reaches the position."""
        kind, value, effort_limit, speed_limit = command
        if kind in (EFFORT, FORCE):
            self._target_m = gap_m
            if not isfinite(speed_limit):
                return value
            # From half of the largest speed on, the effort falls, to nothing at the largest.
            closing = -rate_m_s if value > 0.0 else rate_m_s
            return value * min(max(2.0 - 2.0 * closing / speed_limit, 0.0), 1.0)
        if kind == VELOCITY:
            speed = min(max(value, -speed_limit), speed_limit)
        elif kind == POSITION:
            most = speed_limit if isfinite(speed_limit) else 1.0
            speed = min(max((value - self._target_m) / dt_s, -most), most)
        else:
            raise ValueError("no kind of command")
        target_m = self._target_m + speed * dt_s
        stiffness = self._mass_kg * (self._servo_rad_s * self._servo_rad_s)
        # A target that the fingers cannot follow runs away only as far as the limit of the effort can use.
        farthest_m = min(effort_limit, self.effort_limit_n) / stiffness
        self._target_m = min(max(target_m, gap_m - farthest_m), gap_m + farthest_m)
        damping = 2.0 * self._mass_kg * self._servo_rad_s
        return stiffness * (gap_m - self._target_m) + damping * (rate_m_s - speed)


def _greatest(travel: Travel, actuators: list[list[float]]) -> float:
    """Return the largest effort that the ranges of the actuators allow with the fingers half closed."""
    gap_m = float(np.mean(travel.gap_m))
    effort_n = 0.0
    for slope, length, (gain, b0, b1, _, least, most, least_n, most_n) in zip(
        travel.slopes()[int(travel.gap_m.searchsorted(gap_m))], travel.lengths(gap_m), actuators, strict=True
    ):
        ends = sorted(gain * control + b0 + b1 * length for control in (least, most))
        low, high = (min(max(end, least_n), most_n) for end in ends)
        effort_n += abs(slope) * (-low if slope > 0.0 else high)
    return float(effort_n) if isfinite(effort_n) and effort_n > 0.0 else 100.0
