"""Settings of the simulated gripper."""

from __future__ import annotations

import math
from typing import Literal

from attrs import field, frozen
from attrs.validators import and_, ge, gt, in_, instance_of, le, lt, optional

from graspsense.plugin_api import CHANGES_NO_RESULT, NAMES_INPUT
from graspsense_sim_gripper.drive_models import LINKAGES

FIDELITIES = ("scene", "full", "reference")
NOT_NEGATIVE = and_(ge(0.0), lt(math.inf))
POSITIVE = and_(gt(0.0), lt(math.inf))
SCHEMES = ("auto", "explicit", "implicit")


@frozen(kw_only=True, cache_hash=True)
class SimConfig:
    """A PR2 gripper as a model: what stands in it, its drive, its sensors. SI units."""

    object: str = field(default="odwalla:full_closed", metadata=NAMES_INPUT)
    """Name in the catalogue, with its state: `odwalla:full_closed`, `can:empty_open`, `block`; `none`: nothing.

    Or a scene file, as in `my_bottle.toml`.
    `can:empty_open#3` is one certain can: its width and stiffness are the same in every trial."""
    spread: bool = True
    """Whether instance, placement and friction vary with the seed."""
    sensor: Literal["pads", "ideal"] = field(default="pads", validator=in_(("pads", "ideal")))
    """`pads`: encoder and 22 cells a fingertip every 41 ms. `ideal`: everything exactly, at every tick."""
    accuracy: float = field(default=0.01, validator=and_(ge(1e-4), le(0.5)))
    """Error that features, peak and trace may have, as a share; model and steps follow from it."""
    fidelity: Literal["scene", "full", "reference"] = field(default="scene", validator=in_(FIDELITIES))
    """`scene`: what the scene needs. `full`: every term. `reference`: that in steps halved until all stands still."""
    expected_force_n: float | None = field(
        default=None, validator=optional(POSITIVE), metadata=CHANGES_NO_RESULT
    )
    """The force that the grasp goes up to, and how fast the fingers touch: what the choice of the model rests on.

    Not set: as in a trial grasp under the controller."""
    expected_speed_m_s: float | None = field(
        default=None, validator=optional(POSITIVE), metadata=CHANGES_NO_RESULT
    )
    scheme: Literal["auto", "explicit", "implicit"] = field(default="auto", validator=in_(SCHEMES))
    """Forces the scheme of the steps, for a study."""
    step_s: float | None = field(default=None, validator=optional(gt(0.0)))
    """Forces steps of this length, for a study; not set: as long as the accuracy allows."""
    rate_hz: float = field(default=1000.0, validator=and_(ge(10.0), le(1e5)))
    transmission: Literal["pr2", "pr2_2009", "pr2_paper", "straight"] = field(
        default="pr2", validator=in_(tuple(LINKAGES))
    )
    """A drive of `drive_models`: a published linkage of the PR2, or `straight` (jaws on a screw, constant mass)."""
    moving_mass_kg: float = field(default=100.0, validator=and_(ge(1e-6), le(1e6)))
    """Mass that moves with the gap where the transmission is `straight`; `rotor_kg_m2` then counts for nothing."""
    rotor_kg_m2: float = field(default=4e-7, validator=and_(ge(1e-12), le(1.0)))
    """4 g cm2, an assumption: typical of a 24 mm motor such as the Maxon RE-max 24."""
    coulomb_n: float = field(default=7.0, validator=NOT_NEGATIVE)
    """Sliding friction: fed forward by pr2_gripper_sensor."""
    coulomb_spread_n: float = field(default=0.4, validator=NOT_NEGATIVE)
    """Standard deviation of it between trials."""
    breakaway_n: float = field(default=8.0, validator=NOT_NEGATIVE)
    """Static friction: a little above the sliding one (an assumption)."""
    stribeck_m_s: float = field(default=0.002, validator=POSITIVE)
    """Speed over which static friction gives way to sliding (an assumption)."""
    load_share: float = field(default=0.5, validator=NOT_NEGATIVE)
    """Friction of the loaded screw, per newton on the pads: gives about 20 N on a flat press at 23 N."""
    damping_n_s_m: float = field(default=10.0, validator=NOT_NEGATIVE)
    """On the gap, as in the PR2's description."""
    open_gap_m: float = field(default=0.086, validator=and_(gt(0.0), le(0.09)))
    """Where the fingers stop when they open."""
    skin_n_m: float = field(default=3e4, validator=gt(0.0))
    """Stiffness of one fingertip's cover: 1e4 to 1e5 N/m (an assumption); `inf` for a rigid one."""
    skin_damping_n_s_m: float = field(default=0.0, validator=NOT_NEGATIVE)
    """Damper beside that spring, of one cover."""
    skin_creep_n_m: float = field(default=0.0, validator=NOT_NEGATIVE)
    """Stiffness of a part of one cover that gives way in time, beside that spring."""
    skin_creep_s: float = field(default=0.3, validator=POSITIVE)
    """Time constant with which it does."""
    drive_lag_s: float = field(default=0.0, validator=NOT_NEGATIVE)
    """Time constant with which the effort follows the command; 0: at once."""
    compile: Literal["worth", "always", "never"] = field(
        default="worth", validator=in_(("worth", "always", "never")), metadata=CHANGES_NO_RESULT
    )
    """Many grasps: whether the loop is compiled where that takes less time than it saves, always, or never."""
    explain: bool = field(default=False, metadata=CHANGES_NO_RESULT)
    """Whether the report lists how much each term of the object did (`--explain-model`)."""
    noise_counts: float = field(default=15.0, validator=NOT_NEGATIVE)
    """Noise of a cell, standard deviation: margins of 125 to 225 counts are in use on the robot."""
    pad_period_s: float = field(default=0.041, validator=and_(ge(0.001), le(1.0)))
    """Time between cell images: the PR2's pads report every 41 ms (pr2_gripper_sensor, pressure_observer.cpp)."""
    pad_cells: int = field(default=15, validator=[instance_of(int), ge(1), le(15)])
    """Cells of the gripping face that are there, those nearest its middle; the others read nothing."""
    pad_delay_s: float = field(default=0.0, validator=and_(ge(0.0), le(0.04)))
    """How long after it was taken a cell image arrives: 0.01 as through the PR2 driver's reports."""
