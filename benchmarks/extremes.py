"""Extreme parameters of the simulator: one row for each case, with the property that must hold. All simulated.

    python benchmarks/extremes.py [--short] [--only NAME ...] > benchmarks/results/extremes.md

The fingers close at a set speed, touch, and squeeze with a constant effort for a while. There is no controller, except
in the rows on the sampled controller and those of whole grasps, so a failure is one of the plant. Whole grasps run
with the model that is selected under the controller, as a user's grasp does. The reference of a case has all
terms, and halves the steps of each tick until the result converges. For the stiff contacts and light masses of the grid
it is compiled if numba is installed; a squeeze there lasts 0.15 s, after which the bouncing has ended. Printed are a
line for each case, and each row that does not hold. `--short` uses fewer values a case, and no tick of 1e-5 s. `--only`
runs the cases of these functions.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from functools import cache
from typing import Any, Final

import numpy as np
from arguments import parser_of
from attrs import evolve, frozen
from numpy.typing import NDArray
from random_scenes import controller_is_stable, error_of, flags_of

from graspsense.experiments.versions import where_measured
from graspsense.plugin_api import ConfigError, create
from graspsense.report.found_table import markdown_table
from graspsense.simulator_api import NotCompilable, RunConfig, bind
from graspsense_sim_gripper.config import SimConfig
from graspsense_sim_gripper.run.accuracy.chosen_steps import ChosenSteps
from graspsense_sim_gripper.run.accuracy.propose import FORCE_N, grip_of, propose
from graspsense_sim_gripper.run.accuracy.select import select
from graspsense_sim_gripper.run.batch.job import FinishedGrasp, Job, grasp_plain
from graspsense_sim_gripper.run.build import Problem, instantiate
from graspsense_sim_gripper.run.compiled.compose import plant_move
from graspsense_sim_gripper.run.compiled.jit import compile_part
from graspsense_sim_gripper.run.problem import GraspController, GraspSetup
from graspsense_sim_gripper.scene.library import find
from graspsense_sim_gripper.scene.spec import ObjectSpec
from graspsense_sim_gripper.scene.terms.registry import laws_of
from graspsense_sim_gripper.solve.scheme import PlantParams, PlantState

Row = dict[str, Any]
FloatArray = NDArray[np.float64]
ERRORS: Final = ("peak_error", "rms_error", "error")
HELD: Final = 0.05
"""Largest relative difference of peak and rms."""
BASE: Final = SimConfig(sensor="ideal", spread=False, transmission="straight", moving_mass_kg=100.0)
SMOOTH: Final = evolve(
    BASE, pad_stiffness_n_m=math.inf, coulomb_n=0.0, breakaway_n=0.0, load_friction_coefficient=0.0
)
"""Rigid pads and no friction."""


def object_of(*terms: tuple[str, dict[str, float]], width_m: float = 0.05, **more: Any) -> ObjectSpec:
    return ObjectSpec(name="extreme", width_m=width_m, friction=0.0, terms=terms, **more)


move: Any = None


def _pressing(params: Any, state: Any, carrying_n: float, effort_n: float, dt: float, forces: Any) -> Any:
    """Fill `forces` with the mean force on the pads after each tick; return the plant at the end."""
    for i in range(len(forces)):
        state = move(params, state, effort_n if state.contact.touched == 1 else carrying_n, dt)
        forces[i] = 0.5 * (state.contact.left_n + state.contact.right_n)
    return state


@frozen(kw_only=True)
class Ready:
    """A plant as a user's run of this config has it."""

    setup: GraspSetup
    chosen: ChosenSteps
    params: PlantParams
    move: Callable[[PlantParams, PlantState, float, float], PlantState]


def ready(config: SimConfig, spec: ObjectSpec, force_n: float = FORCE_N) -> Ready:
    """Return the plant of this scene, as the backend has it where a trial grasp has this peak force (N)."""
    problem = Problem(config, spec)
    chosen = propose(problem, grip_of(problem, force_n))
    setup = instantiate(problem, chosen, 0)
    move = plant_move(laws_of(setup.kinds))
    return Ready(setup=setup, chosen=chosen, params=setup.plant, move=move)


@cache
def _compiled(kinds: tuple[str, ...]) -> Callable[..., Any]:
    """Return the squeeze of an object of these terms in steps, compiled if possible."""
    plain = bind(_pressing, move=plant_move(laws_of(kinds)))
    try:
        return compile_part(plain)
    except NotCompilable:
        return plain


def press(
    config: SimConfig,
    spec: ObjectSpec,
    *,
    speed_m_s: float = 0.01,
    effort_n: float = 20.0,
    seconds: float = 0.3,
    fast: bool = False,
) -> tuple[FloatArray, PlantState, Ready]:
    """Return the force at each tick, the plant at the end, and its set-up. `fast`: steps are compiled."""
    config = evolve(
        config,
        # The contact lies inside a tick of any length used here; at the very end of a tick it would depend on rounding.
        open_gap_m=min(spec.width_m + 2.0 * abs(spec.offset_m) + 0.0537 * speed_m_s, 0.09),
    )
    plant = ready(config, spec, max(effort_n, 1.0))
    drive, state, dt = plant.setup.plant.drive, plant.setup.state, plant.setup.dt_s
    # The fingers start at their speed, so that the result does not depend on the tick of a slow controller.
    motion = state.motion
    state = state._replace(motion=motion._replace(speed_rev_s=-speed_m_s / motion.jacobian_m_rev))
    carrying = drive.friction.coulomb_n + drive.friction.damping_n_s_m * speed_m_s
    forces = np.zeros(max(round(seconds / dt), 1))
    loop = _compiled(plant.setup.kinds) if fast else bind(_pressing, move=plant.move)
    state = loop(plant.params, state, carrying, effort_n, dt, forces)
    return forces, state, plant


def rms_of(forces: FloatArray, expected: FloatArray) -> float:
    """Return the rms of the difference of two traces, relative to that of the expected one (at least 1 N)."""
    return float(np.sqrt(np.mean((forces - expected) ** 2)) / max(np.sqrt(np.mean(expected**2)), 1.0))


def against_reference(config: SimConfig, spec: ObjectSpec, **how: Any) -> Row:
    """Return the errors of peak and trace, whether all is finite, and the verdict of the simulator on the peak."""
    forces, state, plant = press(config, spec, **how)
    expected, wanted, _ = press(evolve(config, fidelity="reference"), spec, **how)
    return {
        **compared(forces, state.peak_n, expected, wanted.peak_n),
        "flagged": is_flagged(plant, state),
    }


def compared(forces: FloatArray, peak_n: float, expected: FloatArray, expected_peak_n: float) -> Row:
    """Return the errors of peak and trace, and whether all is finite."""
    return {
        "peak_error": abs(peak_n - expected_peak_n) / max(expected_peak_n, 1.0),
        "rms_error": rms_of(forces, expected),
        "peak_n": peak_n,
        "finite": bool(np.isfinite(forces).all() and math.isfinite(peak_n)),
    }


def is_flagged(plant: Ready, state: PlantState) -> bool:
    """Return whether the report of this grasp says that its trace is not verified, or that it is not resolved."""
    return bool(plant.chosen.unresolved) or state.step.unresolved + state.contact.unbalanced > 0


def light_surface(stiffness: float, ratio: float, mass_kg: float = 1.0) -> ObjectSpec:
    """Return a mass on a spring behind a contact of this stiffness."""
    mass = ratio * mass_kg
    spring = max(0.1 * stiffness, 1.0)
    damping = 0.2 * math.sqrt(spring * mass)
    return object_of(
        ("surface", {"mass_kg": mass, "k_n_m": spring, "damping_n_s_m": damping, "contact_n_m": stiffness})
    )


def stiffness_and_mass(short: bool) -> Iterator[Row]:
    """With static friction above Coulomb friction, and with both equal."""
    stiffnesses = (1e2, 1e4, 1e6, 1e9) if short else (1.0, 1e2, 1e3, 1e4, 1e5, 1e6, 1e7, 1e8, 1e9)
    ratios = (1e-3, 1e3) if short else (1e-6, 1e-3, 1.0, 1e3)
    rubs = evolve(BASE, moving_mass_kg=1.0, pad_stiffness_n_m=math.inf, damping_n_s_m=20.0, coulomb_n=0.5)
    for breakaway_n in (0.6, 0.5):
        config = evolve(rubs, breakaway_n=breakaway_n)
        for stiffness in stiffnesses:
            for ratio in ratios:
                spec = light_surface(stiffness, ratio)
                row = against_reference(config, spec, seconds=0.15, effort_n=10.0, fast=True)
                inside = 1e2 <= stiffness <= 1e6 and 1e-3 <= ratio <= 1e3
                resolved = row["peak_error"] <= HELD and row["rms_error"] <= HELD
                told = resolved or (not inside and row["flagged"])
                above = "above 1e6 N/m" if stiffness > 1e6 else "to 1e6 N/m"
                yield {
                    "case": f"contact stiffness {above}, mass ratio",
                    "value": [stiffness, ratio, breakaway_n],
                    **row,
                    "holds": row["finite"] and told,
                }


def thin_object(short: bool) -> Iterator[Row]:
    """Thin or light objects are not passed through, under the full effort or while they are thrown back."""
    config = evolve(BASE, pad_stiffness_n_m=math.inf)
    for width in (1e-5, 1e-3):
        for speed in (0.01, 0.2):
            spec = object_of(("elastic", {"k1_n_m": 1e6}), width_m=width)
            forces, state, _ = press(config, spec, speed_m_s=speed, seconds=0.1)
            finite = bool(np.isfinite(forces).all())
            # The end of travel stops fingers that flatten the object; otherwise the spring takes up the kinetic energy.
            energy_n = speed * math.sqrt(1e6 * config.moving_mass_kg)
            least = 0.8 * min(energy_n, 1e6 * width)
            yield {
                "case": "no tunnelling",
                "value": [width, speed],
                "peak_n": state.peak_n,
                "finite": finite,
                "holds": finite and state.peak_n > least,
            }
    for ratio in (1e-6, 1e-3):
        light = light_surface(1e6, ratio, config.moving_mass_kg)
        row = against_reference(config, light, seconds=0.1, fast=True)
        yield {
            "case": "no tunnelling",
            "value": [ratio, 0.01],
            **row,
            "holds": row["finite"] and row["peak_n"] > 1.0 and row["rms_error"] <= HELD,
        }


SHELL: Final = ("elastic", {"k1_n_m": 2000.0})
GAS: Final = {"area_m2": 1e-3, "area_slope_m": 0.0, "pressure_pa": 101325.0, "exponent": 1.4}
BULGE: Final = 1e-10


def gas(volume_m3: float, **more: float) -> ObjectSpec:
    return object_of(SHELL, ("gas", {**GAS, "volume_m3": volume_m3, "bulge_m3_pa": BULGE, **more}))


def terms(short: bool) -> Iterator[Row]:
    """The share of air in half a litre, the area of a vent (m2), and the relaxation time (s), from limit to limit."""
    few = slice(None, None, 4 if short else 1)
    shares = (1e-3, 1e-2, 1e-1, 0.5, 1.0)
    areas = (0.0, 1e-10, 1e-9, 1e-8, 1e-7, 1e-6, 1e-5, 1e-4, 1e-3)
    times_s = (1e-9, 1e-6, 1e-4, 1e-3, 1e-2, 1e-1, 1.0, 1e1, 1e3, 1e6, 1e9)
    scenes: dict[str, list[tuple[float, ObjectSpec]]] = {
        "head space": [(share, gas(5e-4 * share)) for share in shares],
        "vent": [(area, gas(5e-5, vent_m2=area)) for area in areas[few]],
        "relaxation time": [
            (tau, object_of(SHELL, ("maxwell", {"k_n_m": 1000.0, "tau_s": tau}))) for tau in times_s[few]
        ],
    }
    for case, values in scenes.items():
        for value, spec in values:
            row = against_reference(BASE, spec)
            yield {"case": case, "value": value, **row, "holds": row["rms_error"] <= 0.01}


def speed_of(state: PlantState) -> float:
    """Return the rate of the gap (m/s)."""
    return state.motion.speed_rev_s * state.motion.jacobian_m_rev


def approach(short: bool) -> Iterator[Row]:
    """Against a spring without friction F + sqrt(F^2 + v^2 k m), of which v sqrt(k m) is left without effort.

    With a damper beyond the critical one the peak falls to the static value, F itself, as the speed falls.
    """
    stiffness = 1e5
    spec = object_of(("elastic", {"k1_n_m": stiffness}))
    config = evolve(SMOOTH, damping_n_s_m=0.0, accuracy=1e-3)
    mass = config.moving_mass_kg
    critical = 2.0 * math.sqrt(stiffness * mass)
    speeds = (1e-6, 1e-5, 1e-4, 1e-3, 1e-2, 0.2)
    for effort in (0.0, 20.0):
        for speed in speeds:
            # The effort follows at the tick after the contact; with a tick of 1e-4 s this delay is negligible.
            short = evolve(config, rate_hz=1e4)
            _, state, _ = press(short, spec, speed_m_s=speed, effort_n=effort, seconds=0.15)
            exact = effort + math.sqrt(effort**2 + speed**2 * stiffness * mass)
            error = abs(state.peak_n / exact - 1.0)
            yield {
                "case": "approach speed",
                "value": [speed, effort],
                "peak_error": error,
                "holds": error <= (1e-3 if effort == 0.0 else 0.01),
            }
    last_over = 0.0
    for speed in speeds:
        damped = evolve(config, damping_n_s_m=1.2 * critical)
        _, state, _ = press(damped, spec, speed_m_s=speed, effort_n=20.0, seconds=1.0)
        over = state.peak_n / 20.0 - 1.0
        yield {
            "case": "approach speed, peak over the static force",
            "value": speed,
            "over": over,
            "holds": over >= last_over - 1e-3 and (speed > 1e-3 or abs(over) <= 1e-3),
        }
        last_over = over


def ticks(short: bool) -> Iterator[Row]:
    bottle = find("odwalla:empty_open")
    linear = object_of(SHELL, ("maxwell", {"k_n_m": 1000.0, "tau_s": 0.1}))
    for rate in (1e5, 1e3, 1e2, 10.0):
        if short and rate > 1e4:
            continue
        for spec, friction in ((bottle, 8.0), (linear, BASE.coulomb_n)):
            row = against_reference(evolve(BASE, rate_hz=rate, breakaway_n=friction), spec, seconds=0.5)
            yield {"case": "control tick", "value": 1.0 / rate, **row, "holds": row["rms_error"] <= 0.01}
        yield _looped(rate)


def _looped(rate_hz: float) -> Row:
    """The sampled velocity loop: its stability follows from its eigenvalues, not from an error of the plant."""
    config = evolve(BASE, rate_hz=rate_hz, breakaway_n=BASE.coulomb_n, open_gap_m=0.09)
    spec = object_of(SHELL, width_m=0.01)
    gain = create("controller", "hybrid").config.velocity_gain_n_s_m
    plant, exact = ready(config, spec), ready(evolve(config, fidelity="reference"), spec)
    state, same, dt = plant.setup.state, exact.setup.state, plant.setup.dt_s
    speeds, expected = [], []
    for _ in range(round(2.0 / dt)):
        effort = min(max(gain * (0.02 + speed_of(state)), -100.0), 100.0)
        state = plant.move(plant.params, state, effort, dt)
        same = exact.move(exact.params, same, effort, dt)
        speeds.append(speed_of(state))
        expected.append(speed_of(same))
    error = max(abs(a - b) for a, b in zip(speeds, expected, strict=True)) / 0.02
    late = speeds[-max(len(speeds) // 5, 5) :]
    unstable = not controller_is_stable(plant.setup, plant.chosen)
    swings = max(late) - min(late) > 0.02
    return {
        "case": "control tick, the sampled controller",
        "value": dt,
        "controller": "unstable" if unstable else "stable",
        "swings": swings,
        "rms_error": error,
        "holds": error <= 0.01 and unstable == swings,
    }


def hertz_energy(short: bool) -> Iterator[Row]:
    """With the drive off, a contact of Hertz returns the kinetic energy: 2/5 k d^2.5 is stored meanwhile."""
    mass, speed = BASE.moving_mass_kg, 0.05
    for hertz in (1e5, 1e7) if short else (1e4, 1e5, 1e6, 1e7, 1e8):
        config = evolve(SMOOTH, damping_n_s_m=0.0, open_gap_m=0.0505)
        plant = ready(config, object_of(("rigid", {"hertz_n_m15": hertz})))
        state = plant.setup.state
        motion = state.motion
        state = state._replace(motion=motion._replace(speed_rev_s=-speed / motion.jacobian_m_rev))
        initial_j = last = 0.5 * mass * speed**2
        most = -math.inf
        for _ in range(400):
            state = plant.move(plant.params, state, 0.0, plant.setup.dt_s)
            # After separation the shape recovers without contact, and is not evaluated in each tick.
            pressed = state.contact.left_n > 0.0
            depth = max(state.contact.left.compression_m, 0.0) if pressed else 0.0
            now = 0.5 * mass * speed_of(state) ** 2 + 0.4 * hertz * depth**2.5
            most, last = max(most, (now - last) / initial_j), now
            if not pressed and speed_of(state) > 0.0:
                # Thrown back: the end of travel would take the energy next.
                break
        yield {
            "case": "stored energy of a Hertz contact",
            "value": hertz,
            "rise": most,
            "lost": 1.0 - last / initial_j,
            "finite": math.isfinite(last),
            "flagged": is_flagged(plant, state),
            # A tenth of the accuracy that is asked for.
            "holds": most <= 1e-3 and abs(1.0 - last / initial_j) <= 1e-3,
        }


def following(
    config: SimConfig, spec: ObjectSpec, efforts_n: FloatArray
) -> tuple[FloatArray, PlantState, Ready]:
    """Return the force at each tick under these efforts, from open fingers; the plant at the end; its setup."""
    plant = ready(config, spec)
    state, forces = plant.setup.state, np.zeros(len(efforts_n))
    for i, effort in enumerate(efforts_n.tolist()):
        state = plant.move(plant.params, state, effort, plant.setup.dt_s)
        forces[i] = 0.5 * (state.contact.left_n + state.contact.right_n)
    return forces, state, plant


def sliding_again(short: bool) -> Iterator[Row]:
    """A gripper that sticks in its hold starts to slide: its effort rises, or the object relaxes under it."""
    near = evolve(BASE, open_gap_m=0.0501, breakaway_n=8.0)
    steps = {
        "the effort rises": np.repeat([20.0, 40.0], 400),
        "the effort rises to just above friction": np.concatenate(
            [np.full(400, 20.0), np.linspace(20.0, 45.0, 600)]
        ),
        "the object relaxes": np.full(1500, 20.0),
    }
    for what, efforts in steps.items():
        spec = object_of(("elastic", {"k1_n_m": 1000.0}), ("maxwell", {"k_n_m": 3000.0, "tau_s": 0.3}))
        forces, state, _ = following(near, spec, efforts)
        expected, wanted, _ = following(evolve(near, fidelity="reference"), spec, efforts)
        row = compared(forces, state.peak_n, expected, wanted.peak_n)
        held = np.ptp(forces[300:400]) if what != "the object relaxes" else 0.0
        yield {
            "case": "a hold that starts to slide",
            "value": what,
            **row,
            "moved_n": float(forces[-1] - forces[399]),
            "holds": row["finite"] and max(row["peak_error"], row["rms_error"]) <= 0.01 and held < 5.0,
        }


def _cycling(params: Any, state: Any, low_n: float, high_n: float, dt: float, ends: Any) -> Any:
    """Load with two efforts in turn, 50 ticks each; fill `ends` with the force at the end of each load."""
    for i in range(len(ends)):
        for k in range(100):
            state = move(params, state, high_n if k < 50 else low_n, dt)
            if k == 49:
                ends[i] = 0.5 * (state.contact.left_n + state.contact.right_n)
    return state


def cyclic(short: bool) -> Iterator[Row]:
    """A million ticks of cyclic load: the force of each cycle stays what it is after the first cycles."""
    cycles = 30 if short else 10_000
    objects = {
        "elastic": object_of(("elastic", {"k1_n_m": 2e3, "k3_n_m3": 1e8})),
        "relaxes": object_of(("elastic", {"k1_n_m": 2e3}), ("maxwell", {"k_n_m": 1e3, "tau_s": 0.05})),
        "sealed gas": gas(5e-5),
    }
    for what, spec in objects.items():
        plant = ready(evolve(BASE, open_gap_m=0.0501, breakaway_n=8.0), spec)
        plain = bind(_cycling, move=plant.move)
        loop: Callable[..., Any] = plain
        if not short:
            try:
                loop = compile_part(plain)
            except NotCompilable:
                loop, cycles = plain, 100
        ends = np.zeros(cycles)
        state = loop(plant.params, plant.setup.state, 12.0, 40.0, plant.setup.dt_s, ends)
        settled = cycles // 3
        drift = float(np.ptp(ends[settled:])) / max(float(ends[-1]), 1.0)
        yield {
            "case": f"cyclic load, {100 * cycles} ticks",
            "value": what,
            "drift": drift,
            "finite": bool(np.isfinite(ends).all()),
            "flagged": is_flagged(plant, state),
            "holds": bool(np.isfinite(ends).all()) and ends[-1] > 1.0 and drift <= 0.01,
        }


def whole_grasp(config: SimConfig, spec: ObjectSpec, controller: Any) -> tuple[FinishedGrasp, list[str]]:
    """Return a grasp in the model that a user gets, and what its report says against it.

    Raises ConfigError if the scene is refused.
    """
    run, problem = RunConfig(grasp_timeout_s=20.0), Problem(config, spec)
    chosen = select(problem, GraspController(controller, run))
    job = Job(config=config, controller=controller, run=run, extract=None, traces=True)
    done = grasp_plain(job, instantiate(problem, chosen, 0))
    return done, flags_of(done, chosen, config)


def grasped(case: str, value: Any, config: SimConfig, spec: ObjectSpec, **controller: Any) -> Row:
    """Return the row of a whole grasp against the reference: within the accuracy, or flagged, or refused."""
    kind = controller.pop("kind", "hybrid")
    law = create("controller", kind, **controller)
    reference, _ = whole_grasp(evolve(config, fidelity="reference", accuracy=1e-3), spec, law)
    try:
        done, said = whole_grasp(config, spec, law)
    except ConfigError as error:
        return {"case": case, "value": value, "refused": str(error), "flagged": True, "holds": True}
    error, quantity = error_of(done, reference, config)
    peak = reference.state.peak_n
    return {
        "case": case,
        "value": value,
        "outcome": done.outcome.name,
        "peak_error": abs(done.state.peak_n - peak) / max(peak, 1.0),
        "error": error,
        "of": quantity,
        "said": ", ".join(said),
        "flagged": bool(said),
        "finite": math.isfinite(done.state.peak_n),
        "holds": error <= config.accuracy or bool(said),
    }


NEAR: Final = SimConfig(sensor="ideal", spread=False, open_gap_m=0.06)


def whole_grasps(short: bool) -> Iterator[Row]:
    """Breaking, stiff contacts, pads, small friction and small Stribeck speeds, in grasps under a controller."""
    crushes = (3.0, 10.0, 15.0)
    for force in crushes[:1] if short else crushes:
        for kind in ("hybrid", "force"):
            spec = object_of(("rigid", {"hertz_n_m15": 1e7, "crush_force_n": force}))
            yield grasped("breaking", [force, kind], NEAR, spec, kind=kind)
    for stiffness in (1e5,) if short else (1e5, 1e6, 1e7, 1e9):
        spec = object_of(("elastic", {"k1_n_m": stiffness}))
        yield grasped("contact stiffness, whole grasp", stiffness, NEAR, spec)
    soft = object_of(("elastic", {"k1_n_m": 5e3}))
    pads: dict[str, dict[str, float]] = {
        "10 N/m": {"pad_stiffness_n_m": 10.0},
        "1e9 N/m": {"pad_stiffness_n_m": 1e9},
        "rigid": {"pad_stiffness_n_m": math.inf},
        "damper 1e5 N s/m": {"pad_damping_n_s_m": 1e5},
        "damper 1e-3 N s/m": {"pad_damping_n_s_m": 1e-3},
        "creeps in 1e-6 s": {"pad_creep_n_m": 1e4, "pad_creep_s": 1e-6},
        "creeps in 1e4 s": {"pad_creep_n_m": 1e4, "pad_creep_s": 1e4},
    }
    for what, changed in list(pads.items())[: 1 if short else None]:
        yield grasped("pads", what, evolve(NEAR, **changed), soft)
    for speed in (1e-9,) if short else (1e-9, 1e-7, 1e-5, 1e-3):
        yield grasped("Stribeck speed", speed, evolve(NEAR, stribeck_m_s=speed), soft)
    for friction in (1e-9,) if short else (1e-9, 1e-6, 1e-3, 1.0):
        config = evolve(NEAR, coulomb_n=friction, breakaway_n=2.0 * friction, load_friction_coefficient=0.0)
        yield grasped("friction of the drive", friction, config, soft)


def masses(short: bool) -> Iterator[Row]:
    """A moving mass of 1e-6 to 1e6 kg, under a constant effort. Light fingers bounce many times within a tick."""
    for mass in (1e-6, 1e6) if short else tuple(10.0**k for k in range(-6, 7)):
        config = evolve(BASE, moving_mass_kg=mass, breakaway_n=8.0)
        spec = object_of(("elastic", {"k1_n_m": 2e3}), ("loss", {"damping_n_s_m": 5.0}))
        # The fingers touch the object after 54 ms.
        row = against_reference(config, spec, seconds=0.06 if short else 0.1, fast=not short)
        within = max(row["peak_error"], row["rms_error"]) <= config.accuracy
        yield {
            "case": "moving mass",
            "value": mass,
            **row,
            "holds": row["finite"] and (within or row["flagged"]),
        }


CASES: Final = (
    stiffness_and_mass,
    hertz_energy,
    sliding_again,
    cyclic,
    whole_grasps,
    masses,
    thin_object,
    terms,
    approach,
    ticks,
)


def table(rows: list[Row]) -> Iterator[str]:
    """Yield Markdown: a line a kind of case, then each row that does not hold with its figures."""
    cases: dict[str, list[Row]] = {}
    for row in rows:
        cases.setdefault(row["case"], []).append(row)
    header = ("case", "rows", "hold", "flagged or refused", "largest error of peak", "of the trace (rms)")
    yield from markdown_table(
        (*header, "of any quantity, unflagged"), [line(*case) for case in cases.items()]
    )
    missed = [row for row in rows if not row["holds"]]
    if missed:
        yield from ("", "Does not hold:", "")
    for row in missed:
        figures = ", ".join(f"{k} {v:.1e}" for k, v in row.items() if isinstance(v, float) and k != "value")
        yield f"- {row['case']}, {row['value']}: {figures}"


def line(case: str, rows: list[Row]) -> list[str]:
    """Return how many rows of a case hold and are flagged, and its largest errors."""

    def largest(names: Sequence[str], rows: list[Row]) -> str:
        return (
            f"{max(figures):.1e}" if (figures := [row[k] for row in rows for k in names if k in row]) else "-"
        )

    counts = (sum(bool(row.get(name)) for row in rows) for name in ("holds", "flagged"))
    silent = [row for row in rows if not row.get("flagged")]
    errors = (largest([name], rows) for name in ("peak_error", "rms_error"))
    return [case, str(len(rows)), *map(str, counts), *errors, largest(ERRORS, silent)]


def main() -> None:
    parser = parser_of(__doc__)
    names = [case.__name__ for case in CASES]
    parser.add_argument(
        "--only", nargs="+", choices=names, default=names, metavar="NAME", help=", ".join(names)
    )
    given = parser.parse_args()
    rows = [row for case in CASES if case.__name__ in given.only for row in case(given.short)]
    print("# Extreme parameters\n")
    print(
        "Made by `python benchmarks/extremes.py`. Simulated. A row holds if it is finite and meets its bound, or if the"
    )
    print("report says that it is not verified. The last three columns are relative to the reference.\n")
    print(f"{where_measured()}.\n")
    print("\n".join(table(rows)))


if __name__ == "__main__":
    main()
