"""Settings of the simulated gripper."""

from __future__ import annotations

from typing import Literal

from attrs import field, frozen
from attrs.validators import and_, ge, gt, in_, le

LINKAGES = ("pr2", "pr2_2009", "pr2_paper")


@frozen(kw_only=True)
class SimConfig:
    """A PR2 gripper as a model: what stands in it, its drive, its sensors. SI units."""

    object: str = "odwalla:full_closed"
    """Name in the catalogue, with its state: `odwalla:full_closed`, `can:empty_open`, `block`; `none`: nothing.

    Or a scene file, as in `my_bottle.toml`.
    `can:empty_open#3` is one certain can: its width and stiffness are the same in every trial."""
    spread: bool = True
    """Whether instance, placement and friction vary with the seed."""
    sensor: Literal["pads", "ideal"] = field(default="pads", validator=in_(("pads", "ideal")))
    """`pads`: encoder and 22 cells a fingertip every 41 ms. `ideal`: everything exactly, at every tick."""
    rate_hz: float = field(default=1000.0, validator=and_(ge(10.0), le(1e5)))
    transmission: Literal["pr2", "pr2_2009", "pr2_paper"] = field(default="pr2", validator=in_(LINKAGES))
    """Which published linkage; see `graspsense.core.transmission`."""
    rotor_kg_m2: float = field(default=4e-7, validator=gt(0.0))
    """4 g cm2, an assumption: typical of a 24 mm motor such as the Maxon RE-max 24."""
    coulomb_n: float = field(default=7.0, validator=ge(0.0))
    """Sliding friction: fed forward by pr2_gripper_sensor."""
    coulomb_spread_n: float = field(default=0.4, validator=ge(0.0))
    """Standard deviation of it between trials."""
    breakaway_n: float = field(default=8.0, validator=ge(0.0))
    """Static friction: a little above the sliding one (an assumption)."""
    stribeck_m_s: float = field(default=0.002, validator=gt(0.0))
    """Speed over which static friction gives way to sliding (an assumption)."""
    load_share: float = field(default=0.5, validator=ge(0.0))
    """Friction of the loaded screw, per newton on the pads: gives about 20 N on a flat press at 23 N."""
    damping_n_s_m: float = field(default=10.0, validator=ge(0.0))
    """On the gap, as in the PR2's description."""
    open_gap_m: float = field(default=0.086, validator=and_(gt(0.0), le(0.09)))
    """Where the fingers stop when they open."""
    skin_n_m: float = field(default=3e4, validator=gt(0.0))
    """Stiffness of one fingertip's cover: 1e4 to 1e5 N/m (an assumption); `inf` for a rigid one."""
    skin_damping_n_s_m: float = field(default=0.0, validator=ge(0.0))
    """Damper beside that spring, of one cover."""
    skin_creep_n_m: float = field(default=0.0, validator=ge(0.0))
    """Stiffness of a part of one cover that gives way in time, beside that spring."""
    skin_creep_s: float = field(default=0.3, validator=gt(0.0))
    """Time constant with which it does."""
    drive_lag_s: float = field(default=0.0, validator=ge(0.0))
    """Time constant with which the effort follows the command; 0: at once."""
    explain: bool = False
    """Whether the report lists how much each term of the object did (`--explain-model`)."""
    noise_counts: float = field(default=15.0, validator=ge(0.0))
    """Noise of a cell, standard deviation: margins of 125 to 225 counts are in use on the robot."""
    pad_delay_s: float = field(default=0.0, validator=and_(ge(0.0), le(0.04)))
    """How long after it was taken a cell image arrives: 0.01 as through the PR2 driver's reports."""
