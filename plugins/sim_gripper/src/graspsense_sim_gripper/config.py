"""Settings of the simulated gripper."""

from __future__ import annotations

import math
from typing import Literal

from attrs import frozen

from graspsense.plugin_api import NAMES_INPUT, setting
from graspsense.simulator_api import CHANGES_NO_RESULT


@frozen(kw_only=True, cache_hash=True)
class SimConfig:
    """Settings of the simulated PR2 gripper: the object in it, its drive and its sensors. SI units."""

    object: str = setting(
        default="odwalla:full_closed",
        effect=NAMES_INPUT,
        meaning="Name in the catalogue with its state, as in odwalla:full_closed or can:empty_open; none: no "
        "object. can:empty_open#3 is one particular can: its width and stiffness are the same in every "
        "trial. Or a scene file, as in my_bottle.toml, or the text of one.",
    )
    spread: bool = setting(
        default=True,
        meaning="Whether instance, placement and friction vary with the seed.",
    )
    sensor: Literal["pads", "ideal"] = setting(
        default="pads",
        meaning="pads: encoder, and 22 cells a fingertip every 41 ms. ideal: exact values at every tick.",
    )
    accuracy: float = setting(
        default=0.01,
        minimum=1e-4,
        maximum=0.5,
        meaning="Relative error that features, peak force and trace may have; the steps follow from it.",
    )
    fidelity: Literal["scene", "reference", "fixed"] = setting(
        default="scene",
        meaning="scene: steps for the accuracy, verified by trial grasps. reference: steps that are halved until the "
        "result no longer changes. fixed: steps for the accuracy, which no trial grasp verifies.",
    )
    step_s: float | None = setting(
        default=None,
        unit="s",
        above=0.0,
        plausible=(1e-5, 0.01),
        meaning="Prescribes the length of the steps, for a study; not set: as long as the accuracy allows. The time"
        " of a grasp grows as the step shrinks.",
    )
    rate_hz: float = setting(
        default=1000.0,
        origin="published elsewhere",
        unit="Hz",
        minimum=10.0,
        maximum=1e5,
        meaning="Rate of the frames.",
    )
    transmission: Literal["pr2", "pr2_2009", "pr2_paper", "straight"] = setting(
        default="pr2",
        origin="published elsewhere",
        meaning="A drive of drive_models: a published linkage of the PR2, or straight (jaws on a screw, constant "
        "mass).",
    )
    moving_mass_kg: float = setting(
        default=100.0,
        origin="assumed",
        unit="kg",
        minimum=1e-6,
        maximum=1e6,
        meaning="Mass that moves with the gap where the transmission is straight; rotor_kg_m2 is then ignored.",
    )
    rotor_kg_m2: float = setting(
        default=4e-7,
        origin="assumed",
        unit="kg m2",
        minimum=1e-12,
        maximum=1.0,
        meaning="Moment of inertia of the rotor: 4 g cm2, an assumption, typical of a 24 mm motor such as the Maxon"
        " RE-max 24.",
    )
    coulomb_n: float = setting(
        default=7.0,
        origin="published elsewhere",
        gives="stiction",
        unit="N",
        minimum=0.0,
        plausible=(0.0, 200.0),
        meaning="Coulomb friction: the value that pr2_gripper_sensor feeds forward.",
    )
    coulomb_spread_n: float = setting(
        default=0.4,
        origin="assumed",
        unit="N",
        minimum=0.0,
        plausible=(0.0, 50.0),
        meaning="Standard deviation of the Coulomb friction between trials.",
    )
    breakaway_n: float = setting(
        default=8.0,
        origin="assumed",
        gives="stiction",
        unit="N",
        minimum=0.0,
        plausible=(0.0, 200.0),
        meaning="Static friction: a little more than Coulomb friction (an assumption).",
    )
    stribeck_m_s: float = setting(
        default=0.002,
        origin="assumed",
        unit="m/s",
        above=0.0,
        plausible=(1e-7, 1.0),
        meaning="Speed over which friction falls from static to Coulomb (an assumption).",
    )
    load_friction_coefficient: float = setting(
        default=0.5,
        origin="published elsewhere",
        minimum=0.0,
        plausible=(0.0, 20.0),
        meaning="Friction of the loaded screw per newton on the pads: gives about 20 N on a flat surface at 23 N.",
    )
    damping_n_s_m: float = setting(
        default=10.0,
        origin="published elsewhere",
        unit="N s/m",
        minimum=0.0,
        plausible=(0.0, 1e6),
        meaning="Viscous friction on the gap, as in the description of the PR2.",
    )
    open_gap_m: float = setting(
        default=0.086,
        origin="published elsewhere",
        unit="m",
        above=0.0,
        maximum=0.09,
        meaning="Gap of the open fingers.",
    )
    pad_stiffness_n_m: float = setting(
        default=3e4,
        origin="assumed",
        unit="N/m",
        above=0.0,
        maximum=math.inf,
        plausible=(10.0, math.inf),
        meaning="Stiffness of one fingertip's pad: 1e4 to 1e5 N/m (an assumption); inf: rigid.",
    )
    pad_hardening_m: float | None = setting(
        default=None,
        unit="m",
        above=0.0,
        plausible=(1e-6, 1.0),
        meaning="Compression of one pad at which its force is twice that of a linear spring: the force is "
        "k u (1 + (u / pad_hardening_m)^pad_exponent); not set: linear.",
    )
    pad_exponent: float = setting(
        default=2.0,
        above=0.0,
        maximum=10.0,
        origin="assumed",
        meaning="Exponent of the hardening of the pad: 2 gives a cubic law; 0.5 a power law with exponent 1.5 where "
        "pad_stiffness_n_m is small.",
    )
    pad_damping_n_s_m: float = setting(
        default=0.0,
        origin="assumed",
        unit="N s/m",
        minimum=0.0,
        meaning="Damper parallel to the spring of the pad.",
    )
    pad_creep_n_m: float = setting(
        default=0.0,
        origin="assumed",
        unit="N/m",
        minimum=0.0,
        meaning="Stiffness of a Maxwell branch parallel to the spring of the pad, which makes it creep.",
    )
    pad_creep_s: float = setting(
        default=0.3,
        origin="assumed",
        unit="s",
        above=0.0,
        plausible=(1e-6, 1e4),
        meaning="Time constant of the Maxwell branch of the pad.",
    )
    drive_lag_s: float = setting(
        default=0.0,
        origin="assumed",
        unit="s",
        minimum=0.0,
        plausible=(0.0, 10.0),
        meaning="Time constant with which the effort follows the command; 0: no lag.",
    )
    compile: Literal["worth", "always", "never"] = setting(
        default="worth",
        effect=CHANGES_NO_RESULT,
        meaning="Whether batches are compiled: where that saves more time than it takes, always, or never.",
    )
    explain: bool = setting(
        default=False,
        effect=CHANGES_NO_RESULT,
        meaning="Whether the report lists what each term contributes, and what features lose without it "
        "(--explain-model).",
    )
    noise_counts: float = setting(
        default=15.0,
        origin="published elsewhere",
        unit="counts",
        minimum=0.0,
        plausible=(0.0, 1e4),
        meaning="Standard deviation of a cell's noise: margins of 125 to 225 counts are in use on the robot.",
    )
    pad_period_s: float = setting(
        default=0.041,
        origin="published elsewhere",
        unit="s",
        minimum=0.001,
        maximum=1.0,
        meaning="Time between cell images: the PR2's pads report every 41 ms (pr2_gripper_sensor, "
        "pressure_observer.cpp).",
    )
    pad_cells: int = setting(
        default=15,
        origin="published elsewhere",
        minimum=1,
        maximum=15,
        meaning="Number of cells of the gripping face, the ones nearest to its middle; the others read no force.",
    )
    pad_delay_s: float = setting(
        default=0.0,
        origin="assumed",
        unit="s",
        minimum=0.0,
        maximum=0.04,
        meaning="Time between the sampling of a cell image and its arrival: 0.01 with the reports of the PR2's driver.",
    )

    @property
    def force_delay_s(self) -> float:
        """Time between the measurement of a force and its arrival: that of the pads, and none with the ideal sensor."""
        return float(self.pad_delay_s) if self.sensor == "pads" else 0.0
