"""The simulated gripper as a backend: one grasp in the interpreter, many grasps compiled."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from types import MappingProxyType
from typing import Any, Final, Unpack

from attrs import evolve

from graspsense.gripper_api import no_pads, tare
from graspsense.plugin_api import (
    Channel,
    Command,
    Controller,
    DeviceInfo,
    FeatureSet,
    ObjectKind,
    Pads,
    Reading,
    create,
)
from graspsense.simulator_api import (
    BatchBackend,
    BatchOptions,
    Grasped,
    RunConfig,
    SimulationVariant,
    maker,
)
from graspsense_sim_gripper.config import SimConfig
from graspsense_sim_gripper.plant.fingertip import CELL_OFFSET, CELLS, FIRST_PAD_CELL, fingertips
from graspsense_sim_gripper.plant.sensing import (
    PAD_COUNTS_PER_N,
    PadBuffers,
    apply_tare,
    sense,
    with_listed_cells,
)
from graspsense_sim_gripper.plant.state import PlantReadings, right_of
from graspsense_sim_gripper.run.accuracy.propose import FORCE_N, SPEED_M_S
from graspsense_sim_gripper.run.accuracy.select import select
from graspsense_sim_gripper.run.binding import bind_reachable
from graspsense_sim_gripper.run.build import build, device_info, instantiate
from graspsense_sim_gripper.run.compiled.compose import INTERPRETED, composed_move, composition
from graspsense_sim_gripper.run.model_report import accuracy_report, model_report
from graspsense_sim_gripper.run.problem import IMAGES_PER_BLOCK, GraspController
from graspsense_sim_gripper.run.sampled_loop import instability
from graspsense_sim_gripper.run.term_failure import TermFailed, not_finite_in_tick
from graspsense_sim_gripper.scene.library import kinds_in, object_kinds
from graspsense_sim_gripper.scene.terms.term import LAW_ERRORS
from graspsense_sim_gripper.solve.scheme import PlantState, is_finite

SIDES: Final = ("left", "right")


_sense = bind_reachable(sense, {}, INTERPRETED)
_reading = maker(Reading)
_COMPILED: Final[Mapping[str, bool | None]] = {"worth": None, "always": True, "never": False}


def default_controller() -> GraspController:
    """Return the controller for which a model is selected if none is given: that of the paper."""
    controller = create("controller", "hybrid", probing_force_n=FORCE_N, closing_speed_m_s=SPEED_M_S)
    return GraspController(controller, RunConfig())


class SimBackend(BatchBackend[SimConfig]):
    """A model of a PR2 gripper, its fingertips and an object."""

    ideal_sensors = MappingProxyType({"sensor": "ideal"})

    def __init__(self, config: SimConfig) -> None:
        super().__init__(config)
        self._controller: GraspController | None = None
        self._features: FeatureSet[Any] | None = None

    @property
    def channels(self) -> tuple[Channel, ...]:
        """The channels of a PR2 gripper. Forces and cells have the rate of cell images, others that of frames."""
        frames_hz = self.config.rate_hz
        pads_hz = min(1.0 / self.config.pad_period_s, frames_hz)
        forces = tuple(
            Channel(f"{what}_{side}", "N", pads_hz) for what in ("force", "edge") for side in SIDES
        )
        return (
            Channel("gap", "m", frames_hz),
            Channel("velocity", "m/s", frames_hz),
            Channel("effort", "N", frames_hz),
            *forces,
            fingertips(pads_hz),
        )

    def objects(self) -> tuple[ObjectKind, ...]:
        """Return the objects of the catalogue and of the shipped scenes."""
        return object_kinds()

    def with_object(self, name: str) -> SimBackend:
        """Return this gripper with another object in it: a name, a scene file, or `none`.

        Raises UnknownName for another name, ConfigError for a file that cannot be read as an object.
        """
        kinds_in(name)
        return SimBackend(evolve(self.config, object=name))

    def expect(self, controller: Controller[Any], run: RunConfig) -> None:
        """Set the controller for which the model of the object is selected."""
        self._controller = GraspController(controller, run, self._features)

    def expect_features(self, feature_set: FeatureSet[Any]) -> None:
        """Set the feature set whose features are verified where the model of the object is selected."""
        self._features = feature_set
        if self._controller is not None:
            self._controller = evolve(self._controller, features=feature_set)

    def open(self, seed: int) -> DeviceInfo:
        """Prepare the grasp that the config and the seed describe.

        Raises UnknownName for an unknown object, ConfigError if no model has the accuracy asked for.
        """
        problem = build(self.config, self.config.object)
        self._chosen = None
        if problem.spec is not None:
            self._chosen = select(problem, self._controller or default_controller())
        setup = instantiate(problem, self._chosen, seed)
        self._setup = setup = evolve(setup, sensor=with_listed_cells(setup.sensor))
        self._move = composed_move(composition(setup.kinds, setup.plant))
        self._state, self._sensor = setup.state, setup.sensor_state
        self._ticks = 0
        zero = (CELL_OFFSET[0],) * CELLS
        self._buffers = PadBuffers(zero, zero, [], [])
        self._pads = no_pads(CELLS)
        self._effort_n: float | None = None
        self._explains = self.config.explain
        # Compression and force at each tick since the first contact, where they are to be explained.
        self._compressions: list[tuple[float, float]] = []
        return device_info(self.config)

    def read(self, timeout_s: float) -> Reading:
        """Return the next tick, which is always available."""
        del timeout_s
        setup, effort = self._setup, self._effort_n
        dt = setup.dt_s
        if effort is None:
            effort = 0.0
        else:
            self._move_on(effort)
        buffers = self._buffers
        if self._sensor.cells.images >= len(buffers.images):
            self._draw_noise()
        contact = self._state.contact
        measured = PlantReadings(self._state.motion, contact.left_n, contact.right_n)
        frame, self._sensor = _sense(
            setup.sensor, self._sensor, measured, self._ticks * dt, dt, effort, buffers
        )
        count = self._sensor.cells.images
        if count != self._pads.counter:
            image = buffers.images[count - 1]
            self._pads = Pads(self._sensor.cells.image_t_s, count, tuple(image[0]), tuple(image[1]))
        return _reading(frame, self._pads, ())

    def _move_on(self, effort_n: float) -> None:
        """Move the plant to the next tick. Raises TermFailed."""
        self._state = self._moved(effort_n)
        self._ticks += 1
        contact = self._state.contact
        if self._explains and contact.touched == 1:
            # Of an object that is fixed in place, the half that is pressed harder.
            half = max(contact.left, right_of(contact.left, contact.right), key=lambda half: half.force_n)
            self._compressions.append((half.compression_m, half.force_n))

    def _moved(self, effort_n: float) -> PlantState:
        """Return the plant after a tick. Raises TermFailed."""
        setup, plant = self._setup, self._state
        try:
            after = self._move(setup.plant, plant, effort_n, setup.dt_s)
        except LAW_ERRORS as error:
            raise TermFailed(str(error)) from error
        if not is_finite(after):
            raise TermFailed(not_finite_in_tick(setup.kinds, setup.plant, plant, effort_n, setup.dt_s))
        return after

    def apply(self, command: Command) -> None:
        """Set the effort of the next tick."""
        self._effort_n = command.value

    def tare(self, images: Sequence[Pads]) -> None:
        """Set the zeros of the cells to the mean of these images; an ideal sensor has none."""
        if self.config.sensor == "ideal":
            return
        left, right = tare(images, PAD_COUNTS_PER_N, FIRST_PAD_CELL)
        self._buffers = self._buffers._replace(left_zero=left, right_zero=right)
        self._sensor = apply_tare(self._sensor, self._buffers)

    def close(self) -> None:
        """Do nothing: there is no device to release."""

    def report(self) -> Mapping[str, Any]:
        """Return what only the model knows, such as the true peak force on the pads and whether something broke.

        `selection` describes the steps. With `explain` in the settings, `model` gives the contribution of each term,
        and what each feature would lose without it.
        """
        setup, chosen = self._setup, self._chosen
        report = model_report(self._state, setup.kinds)
        if chosen is not None:
            report["selection"] = {
                "fidelity": self.config.fidelity,
                **chosen.as_values(),
                "steps": self._state.step.n_steps,
                "within": chosen.valid_for(self._state.peak_n),
            }
            controller = self._controller or default_controller()
            report |= accuracy_report(report, chosen, instability(setup, controller, chosen))
        if self.config.explain:
            report["model"] = self._explained()
        return report

    def _explained(self) -> dict[str, Any]:
        """Return what each term contributes, and what each feature would lose without it."""
        # Imported here, since only this needs it.
        from graspsense_sim_gripper.run.explain import explain, without_each_term

        model = explain(self._setup, self._compressions) | {"without": []}
        if self._chosen is not None:
            problem = build(self.config, self.config.object)
            controller = self._controller or default_controller()
            model["without"] = without_each_term(problem, controller, self._chosen)
        return model

    def _draw_noise(self) -> None:
        """Draw the noise of the next images, and extend the buffer of images by as many."""
        noise, images = self._buffers.noise, self._buffers.images
        noise.extend(self._setup.noise(len(noise), IMAGES_PER_BLOCK).tolist())
        images.extend(([0.0] * CELLS, [0.0] * CELLS) for _ in range(len(noise) - len(images)))

    def variants(self) -> tuple[SimulationVariant, ...]:
        """Return the settings that `graspsense tradeoff simulation` compares, see `variants`."""
        from graspsense_sim_gripper.run.variants import variants

        return variants()

    def run_many(
        self,
        controller: Controller[Any],
        scenes: Sequence[str],
        seeds: Sequence[int],
        **options: Unpack[BatchOptions],
    ) -> list[Grasped]:
        """Grasp each object with its seed; compiled, on all cores, where numba is installed and it saves time."""
        # Imported here, since a single grasp needs neither threads nor compiling.
        from graspsense_sim_gripper.run.batch.threads import grasps, job_of

        job = job_of(self.config, controller, options, features=self._features)
        done = grasps(job, scenes, seeds, _COMPILED[self.config.compile], options)
        return [
            Grasped(
                outcome=grasp.outcome,
                reason=grasp.reason,
                extracted=grasp.extracted,
                trace=grasp.trace,
                report=grasp.report(),
            )
            for grasp in done
        ]
