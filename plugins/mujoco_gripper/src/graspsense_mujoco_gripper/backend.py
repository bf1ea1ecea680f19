"""A gripper that a MuJoCo model describes, as a sensor backend. Simulated."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import lru_cache, partial
from itertools import product
from math import ceil, inf, nan
from pathlib import Path
from typing import Any, Final, Unpack, final

import mujoco
import numpy as np
from attrs import asdict, evolve

from graspsense.plugin_api import (
    EFFORT,
    NO_PADS,
    POSITION,
    Channel,
    Command,
    ConfigError,
    Controller,
    DeviceInfo,
    DeviceLost,
    FastChannel,
    Frame,
    ObjectKind,
    Pads,
    Reading,
    TactileArray,
    signal_type,
)
from graspsense.simulator_api import (
    CHANNELS,
    BatchBackend,
    BatchOptions,
    Grasped,
    GraspProcess,
    HandedGrasp,
    RunConfig,
    SimulationVariant,
    Viewer,
    run_uninterrupted,
)
from graspsense_mujoco_gripper.arm_motion import ArmMotion
from graspsense_mujoco_gripper.batch import grasps
from graspsense_mujoco_gripper.camera import Camera, Window, free_camera, offscreen, require_screen
from graspsense_mujoco_gripper.catalogue import catalogue
from graspsense_mujoco_gripper.config import MujocoConfig
from graspsense_mujoco_gripper.draft import Draft, drafted
from graspsense_mujoco_gripper.drive import ActuatorDrive, Travel, instability
from graspsense_mujoco_gripper.gripper_file import GripperFile, read_gripper
from graspsense_mujoco_gripper.measurement import (
    ForceGauge,
    Palm,
    SpringCells,
    cells_of,
    faces,
    gap_reader,
    geoms_of,
    plain,
)
from graspsense_mujoco_gripper.model import identifier
from graspsense_mujoco_gripper.prepared import Prepared, prepare
from graspsense_mujoco_gripper.roughness import Roughness
from graspsense_mujoco_gripper.scene import read_scene, scene_named
from graspsense_mujoco_gripper.world import PREFIX, is_thing

INTEGRATORS: Final = ("Euler", "implicitfast", "implicit", "RK4", "discrete")
STEPS_S: Final = (1e-3, 5e-4, 2e-4, 1e-4)
REFERENCE: Final = ("implicitfast", 5e-5)
OPENING_M_S: Final = 0.1
SOFT: Final = -1
"""The number of the geom of a contact with a soft body."""
DEEPEST_M: Final = 1e-3
"""A thing that begins deeper in a finger is refused."""
TOUCH_N: Final = 0.1
"""Force on both fingers from which on the motion of the scene begins: less may be the palm that swings."""
UNFELT_N: Final = 1.0
"""A thing that is squeezed by more, before both fingers have felt `TOUCH_N`, is touched beside what measures. When both
fingers feel as much, the gap is compared with the width of the thing between them."""
OTHER_WIDTH: Final = 0.15
"""By more than this share of the opening, the gap is not where fingers hold a thing; of some that tilt by 0.12."""
SIDES: Final = ("left", "right")
SHOWN_SHARE: Final = 0.8
"""A sensor that shows less of the force on a finger does not cover it; so long after the contact, nothing swings."""
SETTLED_S: Final = 0.1
OTHER_WIDTH_M: Final = 3e-3
"""Nor is it by more than this, where fingers press at the points that the gap is measured between."""
TILT: Final = 0.5
"""A finger that presses beside its point may tilt: this is the most of it by which the gap then differs."""
MANY: Final = 256
"""Errors of the forces that are drawn at once."""
MOST_KNOWN: Final = 16
"""Things that a batch keeps prepared."""
SWING, MOST_SWINGS = 0.1, 20
"""The loop counts as unstable if the effort changes its sign above this share of its limit more often than this."""


@final
class MujocoGripper(BatchBackend[MujocoConfig]):
    """Steps the model between two reads, and closes its actuators as commanded."""

    accepts = ("effort", "velocity", "position", "force")
    _data: mujoco.MjData | None = None
    _viewer: Viewer | None = None
    _camera: Camera | None = None
    _window: Window | None = None
    _prepared: Callable[[MujocoConfig, float], Prepared] | None = None

    @property
    def channels(self) -> tuple[Channel, ...]:
        """Gap, velocity, effort and forces; cells and further sensors as the gripper file names them."""
        return self._channels_of(read_gripper(self.config.file)[0])

    def _channels_of(self, gripper: GripperFile) -> tuple[Channel, ...]:
        rate = self.config.rate_hz
        frame = ("gap", "velocity", "effort", "force_left", "force_right")
        channels = [Channel(name, CHANNELS[name], rate) for name in frame]
        if gripper.left.rows:
            left = gripper.left
            channels.append(TactileArray("pads", "N", rate, rows=left.rows, columns=left.columns))
        if gripper.left.edge:
            channels += [Channel("edge_left", "N", rate), Channel("edge_right", "N", rate)]
        channels += [Channel(name, channel.unit, rate) for name, channel in gripper.channels.items()]
        if gripper.accelerometer is not None:
            steps = self._steps_of_a_tick()
            channels.append(
                FastChannel("acceleration", "m/s2", steps * rate, samples=steps, axes=("x", "y", "z"))
            )
        if self._is_shaken():
            channels.append(Channel("shake", "m", rate))
        return tuple(channels)

    def _is_shaken(self) -> bool:
        """Return whether the scene shakes the gripper; its displacement is then a channel."""
        return scene_named(self.config.object.partition("#")[0], self.config.scene).shake is not None

    def _steps_of_a_tick(self) -> int:
        return ceil(1.0 / (self.config.rate_hz * self.config.timestep_s) - 1e-9)

    def objects(self) -> Sequence[ObjectKind]:
        """Return the things of the catalogue."""
        states: dict[str, list[str]] = {}
        for name in catalogue():
            kind, _, state = name.partition(":")
            states.setdefault(kind, []).extend([state] if state else [])
        return [ObjectKind(name=kind, states=tuple(names), default=True) for kind, names in states.items()]

    def with_object(self, name: str) -> MujocoGripper:
        """Return this gripper with another thing between its fingers."""
        return MujocoGripper(evolve(self.config, object=name))

    def variants(self) -> Sequence[SimulationVariant]:
        """Return each integrator of MuJoCo with steps from 0.1 ms to 1 ms; the reference has 0.05 ms."""
        exact = {"force_noise_n": 0.0, "gap_step_m": 0.0}
        return [
            SimulationVariant(
                method=integrator,
                fidelity="fixed step",
                step=f"{step_s * 1e3:g} ms",
                settings={"integrator": integrator, "timestep_s": step_s, **exact},
                role="reference" if (integrator, step_s) == REFERENCE else "curve",
            )
            for integrator, step_s in (REFERENCE, *product(INTEGRATORS, STEPS_S))
        ]

    def run_many(
        self,
        controller: Controller[Any],
        scenes: Sequence[str],
        seeds: Sequence[int],
        **options: Unpack[BatchOptions],
    ) -> list[Grasped]:
        """Grasp each thing with its seed, in a process on each core."""
        for name in dict.fromkeys(scenes):
            read_scene(name, self.config.scene)
        run, common = options.get("run") or RunConfig(), {"config": asdict(self.config)}
        if any(self.with_object(name).makes_signals() for name in set(scenes)):
            # Further channels are not handed over from process to process.
            options = {**options, "workers": 1}
        there = partial(GraspProcess, f"{__name__}:grasps_here", controller, run, common)
        return grasps(grasps_here(controller, run, common), there, scenes, seeds, options)

    def makes_signals(self) -> bool:
        """Return whether there are channels that each tick has besides the frame and the cells."""
        gripper, _ = read_gripper(self.config.file)
        return bool(gripper.channels) or gripper.accelerometer is not None or self._is_shaken()

    def join(self, prepared: Callable[[MujocoConfig, float], Prepared]) -> None:
        """Take part in a batch, whose grasps share what the first one of each thing prepares."""
        self._prepared = prepared

    def see(self, viewer: Viewer) -> None:
        """Make pictures of the next grasp without a screen, or show it in MuJoCo's own viewer."""
        if viewer.frames_hz > 0.0:
            offscreen()
        if viewer.window:
            require_screen()
        self._viewer = viewer

    @staticmethod
    def drafted(model: str, folder: Path) -> Draft:
        """Return a first gripper file for a model, to be put into `folder`. Raises ConfigError."""
        return drafted(model, folder)

    def open(self, seed: int) -> DeviceInfo:
        """Build the model with the thing between the open fingers. Raises ConfigError, UnknownName."""
        self.close()
        config = self.config
        self._steps = self._steps_of_a_tick()
        timestep_s = 1.0 / (config.rate_hz * self._steps)
        prepared = (self._prepared or prepare)(config, timestep_s)
        self._gripper, travel = prepared.gripper, prepared.travel
        self._thing, self._scene = prepared.scene.thing, prepared.scene.scene
        generator = np.random.default_rng(seed)
        model = prepared.with_thing(generator)
        self._begin(model, travel, generator)
        if self._viewer is not None and self._viewer.frames_hz > 0.0:
            self._camera = Camera(model, travel.place, travel.axis, travel.open_m)
            self._next_picture_s = 0.0
        if self._viewer is not None and self._viewer.window:
            self._window = Window(
                model, self._opened(), free_camera(travel.place, travel.axis, travel.open_m)
            )
        return self._described()

    def _begin(self, model: mujoco.MjModel, travel: Travel, generator: np.random.Generator) -> None:
        data = mujoco.MjData(model)
        data.qpos[: len(travel.qpos_open)] = travel.qpos_open
        mujoco.mj_forward(model, data)
        self._model, self._travel, self._generator = model, travel, generator
        self._measured_gap_m = gap_reader(model, data, self._gripper.gap, travel.axis)
        things = {k for k in range(model.ngeom) if self._of_thing(k)}
        if model.nflex:
            things.add(SOFT)
        fingers = self._gripper.left, self._gripper.right
        self._cells = cells_of(model, data, self._gripper)
        self._forces: ForceGauge | SpringCells = (
            self._cells
            if isinstance(self._cells, SpringCells)
            else ForceGauge(model, data, fingers, things, travel.axis)
        )
        self._most_n = self._forces.most_n if isinstance(self._forces, ForceGauge) else inf
        self._sensors, self._edges = (
            [int(model.sensor_adr[identifier(model, "sensor", name)]) for name in names]
            for names in (
                [channel.sensor for channel in self._gripper.channels.values()],
                [finger.edge for finger in fingers if finger.edge],
            )
        )
        self._signals: Any = signal_type(self._channels_of(self._gripper))
        self._shell = [identifier(model, "equality", PREFIX + name) for name in self._thing.shell]
        self._drive = ActuatorDrive(model, data, self._gripper, travel)
        self._motion = ArmMotion(
            model, self._scene, min(geoms_of(model, self._gripper.left)), self._gripper.left.edge
        )
        self._data = data
        self._check_start(data)
        self._kept = kept_steps(self._steps, self._drive.longest_s / model.opt.timestep)
        self._rough: Roughness | None = None
        if self._scene.roughness_m and isinstance(self._cells, SpringCells):
            thing = next(k for k in range(model.nbody) if is_thing(model, k))
            rms_m = self._scene.roughness_m
            self._rough = Roughness(model, data, self._gripper, thing, rms_m, generator)
        self._palm: Palm | None = None
        if self._gripper.accelerometer is not None:
            self._palm, self._kept = (
                Palm(model, data, self._gripper.accelerometer, generator),
                [1] * self._steps,
            )
        self._errors: list[float] = []
        self._tick_s, self._timestep_s = 1.0 / self.config.rate_hz, model.opt.timestep
        self._warnings, self._values = plain(data.warning.number), plain(data.sensordata)
        self._gap_m, self._rate_m_s = self._measured_gap_m(), 0.0
        self._drive.reset(self._gap_m)
        self._command = Command(EFFORT, 0.0, inf, inf)
        self._ticks, self._swings, self._broken, self._felt_n = 0, 0, False, (0.0, 0.0)
        self._unchecked = [] if isinstance(self._forces, SpringCells) else [(0, self._check_gap)]
        if isinstance(self._forces, ForceGauge) and self._forces.has_sensors:
            self._unchecked.append((ceil(SETTLED_S * self.config.rate_hz), self._check_sensors))
        self._held_ticks = 0
        self._measured_m = self._rounded(self._gap_m)

    def _check_start(self, data: mujoco.MjData) -> None:
        """Raise ConfigError where the thing is in the fingers at the start."""
        contacts = [data.contact[k] for k in range(data.ncon)]
        within = [contact.dist for contact in contacts if sum(map(self._of_thing, contact.geom)) == 1]
        deepest = min(within, default=0.0)
        if deepest < -DEEPEST_M:
            raise ConfigError(
                f"{self.config.object} is wider than the opening of {self._travel.open_m * 1e3:.1f} mm: it penetrates "
                f"a finger by {-deepest * 1e3:.1f} mm at the start. Choose a smaller thing"
            )

    def _of_thing(self, geom: int) -> bool:
        return geom == SOFT or is_thing(self._model, int(self._model.geom_bodyid[geom]))

    def _described(self) -> DeviceInfo:
        limit = self._drive.effort_limit_n
        return DeviceInfo(
            name=f"MuJoCo model {self._model.names[: self._model.names.find(0)].decode(errors='replace') or 'gripper'}",
            clock="virtual",
            simulated=True,
            harmless=True,
            rate_hz=self.config.rate_hz,
            channels=self._channels_of(self._gripper),
            effort_limit_n=limit,
            speed_limit_m_s=self._gripper.speed_limit_m_s,
            opening=Command(POSITION, self._travel.open_m, limit, OPENING_M_S),
            relaxed=Command(EFFORT, 0.0, inf, inf),
            tare_images=4 if self._cells is not None else 0,
            numbers={"moving_mass_kg": self._travel.mass_kg, "opening_m": self._travel.open_m},
            notes=("simulated by MuJoCo; its contacts are soft by solref and solimp of the model",),
        )

    def read(self, timeout_s: float) -> Reading | None:
        """Step the model by one tick and measure. Raises DeviceLost where MuJoCo warns that the state is bad."""
        del timeout_s
        data = self._opened()
        self._step(data)
        if any(self._warnings) and (problem := instability(data)):
            raise DeviceLost(f"the simulation became unstable: {problem}. Use a smaller gripper.timestep_s")
        self._ticks += 1
        if self._rough is not None:
            self._rough.set()
        if self._viewer is not None:
            self._show(self._viewer, data, self._ticks / self.config.rate_hz)
        return self._reading(data)

    def _step(self, data: mujoco.MjData) -> None:
        """Make the steps of a tick."""
        model, drive, timestep_s = self._model, self._drive, self._timestep_s
        for steps in self._kept:
            kept_s = steps * timestep_s
            drive.set_controls(self._command, self._gap_m, self._rate_m_s, kept_s)
            mujoco.mj_step(model, data, nstep=steps)
            before_m, self._gap_m = self._gap_m, self._measured_gap_m()
            self._rate_m_s = (self._gap_m - before_m) / kept_s
            if self._palm is not None:
                self._palm.measure(self._rate_m_s)
            if self._shell and not self._broken:
                self._break_shell(data)

    def _show(self, viewer: Viewer, data: mujoco.MjData, t_s: float) -> None:
        if self._camera is not None and t_s >= self._next_picture_s:
            self._next_picture_s += 1.0 / viewer.frames_hz
            viewer.picture(self._camera.image(data))
        if self._window is not None:
            self._window.follow(t_s)

    def _reading(self, data: mujoco.MjData) -> Reading:
        tick_s = self._tick_s
        measured_m = self._rounded(self._gap_m)
        velocity = (measured_m - self._measured_m) / tick_s
        self._measured_m = measured_m
        left, right = self._forces.forces_n()
        felt_left_n, felt_right_n = self._felt_n
        self._felt_n = max(felt_left_n, left), max(felt_right_n, right)
        if data.ncon and not (min(self._felt_n) >= TOUCH_N and max(self._felt_n) < self._most_n):
            self._check_felt()
        if self._unchecked and min(left, right) > UNFELT_N:
            if self._held_ticks >= self._unchecked[0][0]:
                self._unchecked.pop(0)[1]()
            self._held_ticks += 1
        t_s = self._ticks * tick_s
        if self._motion.moves:
            self._motion.set(data, t_s, touched=min(left, right) > TOUCH_N)
        edge_left, edge_right = (self._values[k] for k in self._edges) if self._edges else (nan, nan)
        if self.config.force_noise_n:
            left, right = left + self._noise(), right + self._noise()
            if self._edges:
                edge_left, edge_right = edge_left + self._noise(), edge_right + self._noise()
        effort_n = self._drive.effort_n
        frame = Frame(
            t_s=t_s,
            dt_s=tick_s,
            gap_m=measured_m,
            velocity_m_s=velocity,
            effort_n=effort_n,
            force_left_n=left,
            force_right_n=right,
            edge_left_n=edge_left,
            edge_right_n=edge_right,
        )
        pads = NO_PADS
        if self._cells is not None:
            pads = Pads(t_s, self._ticks, *self._cells.images(data))
        signals: Any = ()
        if self._sensors or self._palm is not None or self._scene.shake is not None:
            palm = () if self._palm is None else (self._palm.samples(t_s),)
            shake = () if self._scene.shake is None else (self._motion.shaken_m(data),)
            signals = self._signals(*(self._values[k] for k in self._sensors), *palm, *shake)
        return Reading(frame, pads, signals)

    def _check_felt(self) -> None:
        """Raise DeviceLost where the thing is squeezed, and a finger does not feel it, or not all of it."""
        if max(self._felt_n) >= self._most_n:
            raise DeviceLost(
                f"a finger feels {max(self._felt_n):.3g} N, and a sensor has a cutoff of {self._most_n:.3g} N "
                "in the model. Raise it, or grasp with less force"
            )
        squeeze_n = self._forces.squeeze_n() if isinstance(self._forces, ForceGauge) else 0.0
        if squeeze_n > UNFELT_N:
            deaf = [side for side, felt_n in zip(SIDES, self._felt_n, strict=True) if felt_n < TOUCH_N]
            raise DeviceLost(
                f"the gripper squeezes {self.config.object} with {squeeze_n:.3g} N, which is not felt on the "
                f"{' and the '.join(deaf)}. Look at the geoms, bodies and sensors of left and right in gripper.file: "
                "do they touch, and on which side?"
            )

    def _check_sensors(self) -> None:
        """Raise DeviceLost where the sensor of a finger shows only a part of the force on its geoms."""
        assert isinstance(self._forces, ForceGauge)
        for side, shown_n, borne_n in zip(
            SIDES, self._forces.forces_n(), self._forces.borne_n(), strict=True
        ):
            if borne_n > UNFELT_N and shown_n < SHOWN_SHARE * borne_n:
                raise DeviceLost(
                    f"the {side} finger bears {borne_n:.3g} N, and its sensor shows {shown_n:.3g} N. Look at the size, "
                    "the place and the body of the site of the sensor in the model: it has to cover the whole finger"
                )

    def _check_gap(self) -> None:
        """Raise DeviceLost where the gap is not the width of what the fingers press on."""
        assert isinstance(self._forces, ForceGauge)
        places_m = self._forces.places_m()
        if not len(places_m):
            return
        axis, held_m = self._travel.axis, float(places_m[1, 0] - places_m[0, 0])
        away = places_m[:, 1:] - faces(self._model, self._opened(), self._gripper)
        aside_m = float(np.linalg.norm(away - np.outer(away @ axis, axis), axis=1).sum())
        most_m = min(OTHER_WIDTH * self._travel.open_m, OTHER_WIDTH_M + TILT * aside_m)
        if abs(self._gap_m - held_m) > most_m:
            raise DeviceLost(
                f"the gap is {self._gap_m * 1e3:.3g} mm where the fingers press on what is {held_m * 1e3:.3g} mm wide "
                "(0: on each other). Look at gap in gripper.file, and at margins of geoms in the model"
            )

    def _break_shell(self, data: mujoco.MjData) -> None:
        if max(self._forces.forces_n()) > self._thing.breaks_at_n:
            self._broken = True
            data.eq_active[self._shell] = 0

    def _noise(self) -> float:
        """Return the next error of a force (N)."""
        if not self._errors:
            self._errors = self._generator.normal(0.0, self.config.force_noise_n, MANY).tolist()[::-1]
        return self._errors.pop()

    def _rounded(self, gap_m: float) -> float:
        step = self.config.gap_step_m
        return round(gap_m / step) * step if step else gap_m

    def _opened(self) -> mujoco.MjData:
        if self._data is None:
            raise DeviceLost("the gripper is not open")
        return self._data

    def apply(self, command: Command) -> None:
        """Keep this command until the next one."""
        self._opened()
        if command.kind == EFFORT and command.value * self._command.value < 0.0:
            swing_n = min(abs(command.value), abs(self._command.value))
            self._swings += swing_n > SWING * self._drive.effort_limit_n
        self._command = command

    def close(self) -> None:
        """Forget the model."""
        for part in (self._camera, self._window):
            if part is not None:
                part.close()
        self._data = self._camera = self._window = None

    def report(self) -> dict[str, float | int | str | bool]:
        """Return what only the model knows: whether the thing broke, and the largest true force on a finger."""
        if not hasattr(self, "_ticks"):
            return {}
        report: dict[str, float | int | str | bool] = {
            "broken": self._broken,
            "greatest_force_n": max(self._felt_n),
            "steps": self._ticks * self._steps,
        }
        if self._motion.moves:
            report |= self._motion.report()
        if self._swings > MOST_SWINGS:
            report["unstable_loop"] = (
                f"the effort changes its sign {self._swings} times: the gains of the controller are too high for a "
                f"moving mass of {self._travel.mass_kg:.3g} kg at {self.config.rate_hz:g} Hz. Try "
                "-o controller.sends=velocity"
            )
        return report


def grasps_here(
    controller: Controller[Any], run: RunConfig, common: Mapping[str, Any]
) -> Callable[[str, int], HandedGrasp]:
    """Return what grasps a thing with a seed in this process, as `GraspProcess` asks for it."""
    config, prepared = MujocoConfig(**common["config"]), lru_cache(MOST_KNOWN)(prepare)

    def grasp(thing: str, seed: int) -> HandedGrasp:
        gripper = MujocoGripper(evolve(config, object=thing))
        gripper.join(prepared)
        done = run_uninterrupted(gripper, controller, evolve(run, seed=int(seed)))
        return HandedGrasp(done.outcome, done.reason, done.trace, done.report)

    return grasp


def kept_steps(steps: int, most: float) -> list[int]:
    """Return the steps of a tick, in parts under the same controls: as many as `most` in each, and at least one."""
    each = max(int(most + 1e-9), 1)
    return [min(each, steps - begun) for begun in range(0, steps, each)]
