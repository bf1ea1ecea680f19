"""Drake as an engine of `peers.py`: its own bodies, joints, springs and contact, with the controller closed.

Drake's package has no headers to compile against, so Drake is called from Python once a tick; within a tick it runs its
own machine code. `calls_ms` is what these calls take, without Drake's steps.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from importlib.metadata import version
from importlib.util import find_spec
from typing import Any, Final

import numpy as np
from attrs import frozen
from peer_engines import Engine, empty, settled
from peer_scenes import MODES, SCENES, PeerScene, law
from simulation_scene import KC, LIGHT, TICK, TICKS, X0, B, C, K, M, Run

RADIUS_M: Final = 0.01
MAX_STEP_S: Final = 0.1
CONTINUOUS: Final = (("runge_kutta3", 1e-3), ("radau3", 1e-3), ("cenic", 1e-3), ("cenic", 1e-6))
"""Integrator of Drake and the accuracy that it is asked for. CENIC is its error-controlled integrator for contact
(Kurtz and Castro 2025)."""
INSTALLED: Final = find_spec("pydrake") is not None


@frozen(eq=False)
class Plant:
    """A diagram with a `MultibodyPlant`, whose first joint is driven."""

    diagram: Any
    plant: Any


def _new_plant(step_s: float) -> tuple[Any, Any]:
    """Return a builder and an empty plant without gravity; `step_s` 0: continuous in time."""
    from pydrake.multibody.plant import AddMultibodyPlant, MultibodyPlantConfig
    from pydrake.systems.framework import DiagramBuilder

    builder = DiagramBuilder()
    config = MultibodyPlantConfig(
        time_step=step_s,
        contact_model="point",
        discrete_contact_approximation="lagged",
        use_sampled_output_ports=False,
    )
    plant, _ = AddMultibodyPlant(config, builder)
    # The integrator CENIC finds it by this name.
    plant.set_name("plant")
    plant.mutable_gravity_field().set_gravity_vector(np.zeros(3))
    return builder, plant


def _slider(plant: Any, name: str, mass_kg: float, damping_n_s_m: float) -> tuple[Any, Any]:
    """Add a body that slides along x; return it and its joint."""
    from pydrake.multibody.tree import PrismaticJoint, SpatialInertia, UnitInertia

    body = plant.AddRigidBody(name, SpatialInertia(mass_kg, np.zeros(3), UnitInertia.SolidSphere(RADIUS_M)))
    axis = np.array([1.0, 0.0, 0.0])
    joint = PrismaticJoint(name, plant.world_frame(), body.body_frame(), axis, damping=damping_n_s_m)
    return body, plant.AddJoint(joint)


def contact_plant(step_s: float) -> Plant:
    """Return linear contact in Drake's own terms: a ball on the jaw meets a half-space on the light surface."""
    from pydrake.geometry import AddContactMaterial, HalfSpace, ProximityProperties, Sphere
    from pydrake.math import RigidTransform, RotationMatrix
    from pydrake.multibody.plant import CoulombFriction
    from pydrake.multibody.tree import PrismaticSpring

    builder, plant = _new_plant(step_s)
    jaw, driven = _slider(plant, "jaw", M, B)
    surface, sprung = _slider(plant, "surface", LIGHT, C)
    plant.AddForceElement(PrismaticSpring(sprung, 0.0, K))
    material = ProximityProperties()
    # The stiffnesses of the two bodies are in series.
    AddContactMaterial(
        dissipation=0.0, point_stiffness=2.0 * KC, friction=CoulombFriction(0.0, 0.0), properties=material
    )
    ball = RigidTransform(np.array([-RADIUS_M, 0.0, 0.0]))
    facing = RotationMatrix.MakeFromOneVector(np.array([-1.0, 0.0, 0.0]), 2)
    wall = RigidTransform(facing, np.array([X0, 0.0, 0.0]))
    plant.RegisterCollisionGeometry(jaw, ball, Sphere(RADIUS_M), "ball", material)
    plant.RegisterCollisionGeometry(surface, wall, HalfSpace(), "wall", material)
    plant.AddJointActuator("effort", driven)
    plant.Finalize()
    return Plant(builder.Build(), plant)


def joint_plant(step_s: float, inertia: float) -> Plant:
    """Return a joint with this inertia and nothing else."""
    builder, plant = _new_plant(step_s)
    _, driven = _slider(plant, "jaw", inertia, 0.0)
    plant.AddJointActuator("effort", driven)
    plant.Finalize()
    return Plant(builder.Build(), plant)


class Driven:
    """A simulation of a plant that is advanced tick by tick under an effort."""

    def __init__(self, made: Plant, integrator: str = "", accuracy: float = 0.0) -> None:
        from pydrake.systems.analysis import ResetIntegratorFromFlags, Simulator

        self._simulator = Simulator(made.diagram)
        if integrator:
            ResetIntegratorFromFlags(self._simulator, integrator, MAX_STEP_S).set_target_accuracy(accuracy)
        self._plant, self._root = made.plant, self._simulator.get_mutable_context()
        self._context = made.plant.GetMyMutableContextFromRoot(self._root)
        self._effort = made.plant.get_actuation_input_port()

    def reset(self, state: Any) -> None:
        """Go back to the beginning, with these positions and then speeds."""
        self._effort.FixValue(self._context, [0.0])
        self._root.SetTime(0.0)
        self.put(state)
        self._simulator.Initialize()

    def put(self, state: Any) -> None:
        """Set the positions and then speeds."""
        self._plant.SetPositionsAndVelocities(self._context, state)

    def state(self) -> Any:
        """Return the positions and then speeds."""
        return self._plant.GetPositionsAndVelocities(self._context)

    def push(self, effort: float) -> None:
        """Set the force on the driven joint."""
        self._effort.FixValue(self._context, [effort])

    def advance(self, tick: int) -> None:
        """Integrate to the end of this tick."""
        self._simulator.AdvanceTo((tick + 1) * TICK)


def in_contact(driven: Driven, *, advances: bool = True) -> Run:
    """Grasp in linear contact in Drake's own terms; not `advances`: only the calls around Drake's steps."""
    driven.reset(np.zeros(4))
    xs, forces, us = empty()
    integral, since = 0.0, -1.0
    for tick in range(TICKS):
        x, y, v, _ = driven.state()
        force = KC * max(x - y - X0, 0.0)
        u, integral, since = law(tick * TICK, x, v, force, integral, since)
        xs[tick], forces[tick], us[tick] = x, force, u
        driven.push(u)
        if advances:
            driven.advance(tick)
    return Run(x=xs, force=forces, u=us)


def forced(scene: PeerScene, driven: Driven) -> Run:
    """Grasp in any scene: Drake steps the joint, under the force that the loop computes at each tick."""
    settle, s, ds = settled(scene), scene.start.copy(), np.zeros_like(scene.start)
    mode, g = np.zeros(MODES, np.int64), np.zeros(scene.n_guards)
    driven.reset(s[:2])
    xs, forces, us = empty()
    integral, since = 0.0, -1.0
    for tick in range(TICKS):
        x, v, force = scene.output(s, mode)
        u, integral, since = law(tick * TICK, x, v, force, integral, since)
        xs[tick], forces[tick], us[tick] = x, force, u
        settle(s, u, mode, g)
        scene.rates(s, u, mode, ds)
        driven.put(s[:2])
        driven.push(scene.inertia * ds[1])
        driven.advance(tick)
        s[:2] = driven.state()
        s[2:] += TICK * ds[2:]
        settle(s, u, mode, g)
    return Run(x=xs, force=forces, u=us)


def drake_engines(scene: PeerScene) -> Iterator[Callable[[], Engine]]:
    """Yield what prepares Drake, if it is installed."""
    if not INSTALLED:
        return
    name = f"Drake {version('drake')}"
    if scene is not SCENES[0]:
        yield lambda: _ready(
            f"{name} discrete, forces applied",
            "1000 us",
            _forced(scene, Driven(joint_plant(TICK, scene.inertia))),
        )
        return
    yield lambda: _ready(f"{name} discrete, own contact", "1000 us", _own(Driven(contact_plant(TICK))))
    for integrator, accuracy in CONTINUOUS:
        yield lambda integrator=integrator, accuracy=accuracy: _ready(
            f"{name} {integrator}, own contact",
            f"accuracy {accuracy:g}",
            _own(Driven(contact_plant(0.0), integrator, accuracy)),
        )


def _own(driven: Driven) -> Callable[[], Run]:
    return lambda: in_contact(driven)


def _forced(scene: PeerScene, driven: Driven) -> Callable[[], Run]:
    return lambda: forced(scene, driven)


def _ready(name: str, setting: str, grasp: Callable[[], Run]) -> Engine:
    grasp()
    return Engine(name=name, setting=setting, grasp=grasp)


def calls_ms() -> float:
    """Return the processor time (ms) of the calls from Python in a grasp, without Drake's own steps."""
    driven = Driven(contact_plant(0.0), *CONTINUOUS[0])
    in_contact(driven, advances=False)
    began = time.thread_time()
    in_contact(driven, advances=False)
    return 1e3 * (time.thread_time() - began)
