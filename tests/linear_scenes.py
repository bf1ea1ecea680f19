"""Objects and drives that exact discretisation applies to: each kind of state, contact and friction."""

import math

from graspsense_sim_gripper.config import SimConfig
from graspsense_sim_gripper.objects.spec import ObjectSpec

FRICTION = SimConfig(
    spread=False,
    sensor="ideal",
    transmission="straight",
    moving_mass_kg=100.0,
    coulomb_n=7.0,
    breakaway_n=7.0,
    load_friction_coefficient=0.5,
    damping_n_s_m=10.0,
    open_gap_m=0.0505,
    fidelity="full",
)
FREE = {"coulomb_n": 0.0, "breakaway_n": 0.0, "load_friction_coefficient": 0.0}
RIGID = {"pad_stiffness_n_m": math.inf}

ELASTIC = ("elastic", {"k1_n_m": 1e4})
MAXWELL = ("maxwell", {"k_n_m": 3e3, "tau_s": 0.05})
LOSS = ("loss", {"damping_n_s_m": 300.0})
SLOSH = ("slosh", {"mass_kg": 0.3, "frequency_hz": 8.0, "damping_ratio": 0.05})
LIQUID = ("liquid", {"area_m2": 1e-3, "neck_m2": 3e-4, "column_m": 0.03, "bulge_m3_pa": 1e-9})
SURFACE = ("surface", {"mass_kg": 0.02, "k_n_m": 2e3, "damping_n_s_m": 5.0, "contact_n_m": 2e4})
FOAM = ("foam", {"force_n": 20.0, "at_m": 0.01, "exponent": 1.0})


def object_of(*terms, **more):
    return ObjectSpec(name="object", width_m=0.05, **{"friction": 0.0, "terms": terms, **more})


QUICK = ("pads", "rigid", "surface", "table")
SCENES = {
    "pads": ({}, object_of(ELASTIC, MAXWELL, SLOSH)),
    "rigid": (RIGID, object_of(ELASTIC, LOSS)),
    "surface": ({}, object_of(SURFACE, ELASTIC)),
    "elastic": (RIGID, object_of(ELASTIC)),
    "branch alone": ({}, object_of(MAXWELL)),
    "liquid": ({}, object_of(ELASTIC, LOSS, LIQUID)),
    "foam": ({}, object_of(FOAM)),
    "bare surface": (RIGID, object_of(SURFACE)),
    "damped pads": ({"pad_damping_n_s_m": 50.0}, object_of(ELASTIC, MAXWELL)),
    "creeping pads": ({"pad_creep_n_m": 2e4, "pad_creep_s": 0.1}, object_of(ELASTIC, MAXWELL)),
    "both": ({"pad_creep_n_m": 2e4, "pad_damping_n_s_m": 50.0}, object_of(ELASTIC, SLOSH)),
    "lag": ({"drive_lag_s": 0.02}, object_of(ELASTIC, MAXWELL)),
    "constant friction": ({"load_friction_coefficient": 0.0}, object_of(ELASTIC)),
    "friction of the load": ({"coulomb_n": 0.0, "breakaway_n": 0.0}, object_of(ELASTIC, MAXWELL)),
    "no friction": (FREE, object_of(ELASTIC, MAXWELL)),
    "held": ({}, object_of(ELASTIC, MAXWELL, held=True)),
    "table": ({}, object_of(ELASTIC, MAXWELL, friction=0.3, mass_kg=0.5)),
    "off centre": ({}, object_of(ELASTIC, MAXWELL, offset_m=2e-4, friction=0.3, mass_kg=0.5)),
    "nothing": ({}, object_of()),
}
