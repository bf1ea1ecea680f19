"""How far a grasp by MuJoCo is from the same grasp by graspsense's simulator, for each integrator and step.

    python plugins/mujoco_gripper/benchmarks/truth.py [--short]

Both simulators express this grasp exactly: two fingers on slides with a constant mass and a viscous friction, which
close under the force law of the default controller on two walls on linear springs. The simulator's steps keep its
features to 0.1 %. A row has the largest error of a feature, with its name, and the time that a grasp takes.
"""

from __future__ import annotations

import argparse
import tempfile
import time
from collections.abc import Mapping
from pathlib import Path

from graspsense.plugin_api import create
from graspsense.simulator_api import RunConfig, run_uninterrupted
from graspsense_mujoco_gripper.backend import INTEGRATORS
from graspsense_mujoco_gripper.gripper_file import read_gripper

STIFFNESS_N_M, WIDTH_M = 3000.0, 0.05
MASS_KG, DAMPING_N_S_M = 60.0, 1200.0
"""Of the gap: overdamped, so that the time of rest is well defined."""
OPEN_M = 0.09
STEPS_S = (1e-3, 5e-4, 2e-4, 1e-4)
CONTROLLER = create("controller", "hybrid", closing_speed_m_s=0.02)
FEATURES = create("feature-set", "chitta")


def by_simulator(folder: Path) -> Mapping[str, float]:
    """Return the features of the grasp by graspsense's simulator."""
    scene = folder / "simulator.toml"
    scene.write_text(
        f'summary = "springs"\nwidth_m = {WIDTH_M}\nmass_kg = 0.05\n'
        f'[[terms]]\ntype = "elastic"\nk1_n_m = {STIFFNESS_N_M}\n'
    )
    return _features(
        "sim",
        object=str(scene),
        spread=False,
        sensor="ideal",
        transmission="straight",
        moving_mass_kg=MASS_KG,
        damping_n_s_m=DAMPING_N_S_M,
        coulomb_n=0.0,
        breakaway_n=0.0,
        coulomb_spread_n=0.0,
        load_friction_coefficient=0.0,
        pad_stiffness_n_m=float("inf"),
        open_gap_m=OPEN_M,
        accuracy=1e-3,
    )


def by_mujoco(folder: Path, timestep_s: float, integrator: str = "implicitfast") -> Mapping[str, float]:
    """Return the features of the grasp by MuJoCo.

    Each finger moves by half of the gap, so the motor, which moves both, moves four times the mass of the gap with half
    of its speed: twice the mass of the gap in each joint. The same holds for the friction.
    """
    _, model = read_gripper("")
    text = model.read_text(encoding="utf-8")
    for old, new in (("armature", 2.0 * MASS_KG), ("damping", 2.0 * DAMPING_N_S_M)):
        value = text.partition(f'{old}="')[2].partition('"')[0]
        text = text.replace(f'{old}="{value}"', f'{old}="{new}"')
    (folder / "fingers.xml").write_text(text)
    file = model.with_suffix(".toml").read_text(encoding="utf-8").replace(model.name, "fingers.xml")
    (folder / "gripper.toml").write_text(file)
    scene = folder / "mujoco.toml"
    scene.write_text(
        f'thing = "springs"\n[walls]\nwidth_m = {WIDTH_M}\nstiffness_n_m = {STIFFNESS_N_M}\n'
        "damping_n_s_m = 0.0\nmass_kg = 0.05\narmature_kg = 0.05\n"
    )
    return _features(
        "mujoco",
        object=str(scene),
        file=str(folder / "gripper.toml"),
        spread=False,
        force_noise_n=0.0,
        gap_step_m=0.0,
        timestep_s=timestep_s,
        integrator=integrator,
    )


def _features(gripper: str, **settings: object) -> Mapping[str, float]:
    grasp = run_uninterrupted(create("sensor-backend", gripper, **settings), CONTROLLER, RunConfig())
    if grasp.outcome.words != "steady":
        raise SystemExit(f"the grasp by {gripper} ended {grasp.outcome.words}: {grasp.reason}")
    features = FEATURES.extract(grasp.trace)
    return dict(zip(features.names, features.values, strict=True))


def errors(features: Mapping[str, float], true: Mapping[str, float]) -> dict[str, float]:
    """Return the relative error of each feature."""
    return {name: abs(features[name] / value - 1.0) for name, value in true.items()}


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--short", action="store_true", help="one integrator and one step")
    short = parser.parse_args().short
    print("| integrator | step | largest error | feature | time of a grasp |\n|---|---|---|---|---|")
    with tempfile.TemporaryDirectory() as name:
        true = by_simulator(Path(name))
        for integrator in ("implicitfast",) if short else INTEGRATORS:
            for step_s in STEPS_S[:1] if short else STEPS_S:
                began = time.process_time()
                off = errors(by_mujoco(Path(name), step_s, integrator), true)
                worst = max(off, key=off.__getitem__)
                took = time.process_time() - began
                print(
                    f"| {integrator} | {step_s * 1e3:g} ms | {off[worst]:.2%} | `{worst}` | {took:.1f} s |",
                    flush=True,
                )


if __name__ == "__main__":
    main()
