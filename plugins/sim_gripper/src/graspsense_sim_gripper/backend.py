"""The simulated gripper as a backend: one grasp in the interpreter, many compiled."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import Any, Unpack

from attrs import evolve

from graspsense.plugin_api import (
    CELLS,
    NO_PADS,
    BatchBackend,
    BatchOptions,
    Command,
    Controller,
    DeviceInfo,
    Frame,
    Grasped,
    ObjectKind,
    Pads,
    Reading,
    RunConfig,
    SimulationVariant,
    bind,
    maker,
    tare,
)
from graspsense_sim_gripper.checking import Control, checked_choice, standard
from graspsense_sim_gripper.config import SimConfig
from graspsense_sim_gripper.dynamics.state import Contact, ContactState, Motion, PlantState, StepState
from graspsense_sim_gripper.exact.discretise import discretise
from graspsense_sim_gripper.exact.propagate import ExactPlant, bind_move
from graspsense_sim_gripper.explain import explain
from graspsense_sim_gripper.kernel import plant_of
from graspsense_sim_gripper.objects.library import kinds_in, object_kinds
from graspsense_sim_gripper.plant import PlantParams
from graspsense_sim_gripper.sensing import (
    PAD_COUNTS_PER_N,
    Encoder,
    PadBuffers,
    SensorState,
    _read_encoder,
    apply_tare,
    sense,
)
from graspsense_sim_gripper.setting import CELL_OFFSET, device_info, set_scene
from graspsense_sim_gripper.terms.registry import find_term, laws_of

# Where a tick runs in the interpreter, making its tuples is a good part of its cost.
_sense = bind(
    sense,
    Frame=maker(Frame),
    SensorState=maker(SensorState),
    _read_encoder=bind(_read_encoder, Encoder=maker(Encoder)),
)
_reading = maker(Reading)
_COMPILED: Mapping[str, bool | None] = {"worth": None, "always": True, "never": False}
_PLANT_TUPLES = {
    kind.__name__: maker(kind) for kind in (PlantState, Motion, Contact, ContactState, StepState)
}


class SimBackend(BatchBackend[SimConfig]):
    """A PR2 gripper, its fingertips and an object, as a model. Everything it says is simulated."""

    def __init__(self, config: SimConfig) -> None:
        super().__init__(config)
        self._control: Control | None = None

    def objects(self) -> tuple[ObjectKind, ...]:
        """Return the objects of the catalogue and of the shipped scenes."""
        return object_kinds()

    def with_object(self, name: str) -> SimBackend:
        """Return this gripper with another object in it: a name of the catalogue, or a scene file."""
        return SimBackend(evolve(self.config, object=name))

    def expect(self, controller: Controller[Any], run: RunConfig) -> None:
        """Take the controller for which the model of the object is to be chosen."""
        self._control = Control(controller, run)

    def open(self, seed: int) -> DeviceInfo:
        """Set the scene that the config and the seed describe.

        Raises UnknownName for an unknown object, ConfigError where no model is as exact as asked for.
        """
        chooser = partial(checked_choice, control=self._control or standard(self.config))
        self._setting = setting = set_scene(self.config, self.config.object, seed, chooser)
        self._move: Callable[[Any, PlantState, float, float], PlantState] = plant_of(
            laws_of(setting.kinds), settles=setting.plant.steps.settle > 0.0, **_PLANT_TUPLES
        )
        by_maps = discretise(self.config, setting)
        self._plant: PlantParams | ExactPlant = setting.plant
        if by_maps is not None:
            self._plant, shape = by_maps
            self._move = bind_move(setting.kinds, shape, self._move, **_PLANT_TUPLES)
        self._body, self._sensor = setting.body, setting.sensed
        self._ticks = 0
        zero = (CELL_OFFSET[0],) * CELLS
        self._blocks = setting.noise()
        self._buffers = PadBuffers(zero, zero, [], [])
        self._pads = NO_PADS
        self._effort_n: float | None = None
        self._explains = self.config.explain
        # Compression and force at each tick since the first contact, where they are to be explained.
        self._pressed: list[tuple[float, float]] = []
        return device_info(self.config)

    def read(self, timeout_s: float) -> Reading:
        """Return the next tick; it is always there."""
        del timeout_s
        setting, effort = self._setting, self._effort_n
        dt = setting.dt_s
        if effort is None:
            effort = 0.0
        else:
            self._body = self._move(self._plant, self._body, effort, dt)
            self._ticks += 1
            if self._explains and self._body.contact.touched == 1:
                # Of an object that is held fast the half that is pressed harder.
                half = max(self._body.contact.left, self._body.contact.right, key=lambda one: one.force_n)
                self._pressed.append((half.compression_m, half.force_n))
        buffers = self._buffers
        if self._sensor.images >= len(buffers.images):
            self._draw_noise()
        frame, self._sensor = _sense(
            setting.sensor, self._sensor, self._body, self._ticks * dt, dt, effort, buffers
        )
        count = self._sensor.images
        if count != self._pads.counter:
            image = buffers.images[count - 1]
            self._pads = Pads(self._sensor.image_t_s, count, tuple(image[0]), tuple(image[1]))
        return _reading(frame, self._pads)

    def apply(self, command: Command) -> None:
        """Take an effort for the next tick."""
        self._effort_n = command.value

    def tare(self, images: Sequence[Pads]) -> None:
        """Set the cells' zero."""
        if self.config.sensor == "ideal":
            return
        left, right = tare(images, PAD_COUNTS_PER_N)
        self._buffers = self._buffers._replace(left_zero=left, right_zero=right)
        self._sensor = apply_tare(self._sensor, self._buffers)

    def close(self) -> None:
        """Nothing to let go of."""

    def report(self) -> Mapping[str, Any]:
        """Return what only the model knows: the true peak force on the pads, and whether something broke.

        With `explain` in the settings, also how much each term of the object did, under `model`.
        """
        report = _known(self._body, self._setting.kinds)
        choice = self._setting.choice
        if choice is not None:
            if isinstance(self._plant, ExactPlant):
                choice = choice.by_maps()
            report["selection"] = {
                "fidelity": self.config.fidelity,
                **choice.plain(),
                "steps": self._body.step.n_steps,
                "within": choice.covers(self._body.peak_n),
            }
        if self.config.explain:
            setting = self._setting
            path, forces = [d for d, _ in self._pressed], [f for _, f in self._pressed]
            report["model"] = explain(setting.kinds, setting.terms, setting.plant, path, forces, setting.dt_s)
        return report

    def _draw_noise(self) -> None:
        """Draw the noise of the next images, and make room for these."""
        noise, images = self._buffers.noise, self._buffers.images
        noise.extend(next(self._blocks).tolist())
        images.extend(([0.0] * CELLS, [0.0] * CELLS) for _ in range(len(noise) - len(images)))

    def variants(self) -> tuple[SimulationVariant, ...]:
        """Return each scheme at each fidelity, from coarse to fine."""
        from graspsense_sim_gripper.variants import variants

        return variants()

    def run_many(
        self,
        controller: Controller[Any],
        scenes: Sequence[str],
        seeds: Sequence[int],
        **options: Unpack[BatchOptions],
    ) -> list[Grasped]:
        """Grasp each object with its seed; compiled, on all cores, where numba is installed and it pays."""
        # Imported here: one grasp in the terminal needs neither threads nor compiling.
        from graspsense_sim_gripper.batch.threads import grasps

        done = grasps(self.config, controller, scenes, seeds, _COMPILED[self.config.compile], options)
        return [
            Grasped(
                outcome=one.outcome,
                reason=one.reason,
                extracted=one.extracted,
                trace=one.kept,
                report=_known(one.body, kinds_in(scene)),
            )
            for one, scene in zip(done, scenes, strict=True)
        ]


def _known(body: PlantState, kinds: Sequence[str]) -> dict[str, Any]:
    """Return what only the model knows at the end of a grasp."""
    states = (
        (kind, half.states[i])
        for half in (body.contact.left, body.contact.right)
        for i, kind in enumerate(kinds, 1)
    )
    beyond = {f"{kind}: {why}": None for kind, state in states if (why := find_term(kind)[1].beyond(state))}
    return {
        "simulated": True,
        "true_peak_force_n": body.peak_n,
        "resolved": body.step.unresolved == 0,
        "broken": any(getattr(state, "broken", 0) == 1 for state in body.contact.left.states),
        "beyond": "; ".join(beyond),
    }
