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
    """A model of a PR2 gripper: the object in it, its drive and its sensors. SI units."""

    object: str = field(default="odwalla:full_closed", metadata=NAMES_INPUT)
    """Name in the catalogue with its state: `odwalla:full_closed`, `can:empty_open`, `block`; `none`: no object.

    Or a scene file, as in `my_bottle.toml`.
    `can:empty_open#3` is one particular can: its width and stiffness are the same in every trial."""
    spread: bool = True
    """Whether instance, placement and friction vary with the seed."""
    sensor: Literal["pads", "ideal"] = field(default="pads", validator=in_(("pads", "ideal")))
    """`pads`: encoder, and 22 cells a fingertip every 41 ms. `ideal`: exact values at every tick."""
    accuracy: float = field(default=0.01, validator=and_(ge(1e-4), le(0.5)))
    """Relative error that features, peak force and trace may have; model and steps follow from it."""
    fidelity: Literal["scene", "full", "reference"] = field(default="scene", validator=in_(FIDELITIES))
    """`scene`: the terms that the accuracy needs. `full`: every term. `reference`: every term, in steps that are
    halved until the result no longer changes."""
    expected_force_n: float | None = field(
        default=None, validator=optional(POSITIVE), metadata=CHANGES_NO_RESULT
    )
    """The gripping force, and the speed of the fingers at the contact, for which the model is selected.

    Not set: those of a trial grasp under the controller."""
    expected_speed_m_s: float | None = field(
        default=None, validator=optional(POSITIVE), metadata=CHANGES_NO_RESULT
    )
    scheme: Literal["auto", "explicit", "implicit"] = field(default="auto", validator=in_(SCHEMES))
    """Prescribes the scheme of the steps, for a study."""
    step_s: float | None = field(default=None, validator=optional(gt(0.0)))
    """Prescribes the length of the steps, for a study; not set: as long as the accuracy allows."""
    rate_hz: float = field(default=1000.0, validator=and_(ge(10.0), le(1e5)))
    transmission: Literal["pr2", "pr2_2009", "pr2_paper", "straight"] = field(
        default="pr2", validator=in_(tuple(LINKAGES))
    )
    """A drive of `drive_models`: a published linkage of the PR2, or `straight` (jaws on a screw, constant mass)."""
    moving_mass_kg: float = field(default=100.0, validator=and_(ge(1e-6), le(1e6)))
    """Mass that moves with the gap where the transmission is `straight`; `rotor_kg_m2` is then ignored."""
    rotor_kg_m2: float = field(default=4e-7, validator=and_(ge(1e-12), le(1.0)))
    """4 g cm2, an assumption: typical of a 24 mm motor such as the Maxon RE-max 24."""
    coulomb_n: float = field(default=7.0, validator=NOT_NEGATIVE)
    """Coulomb friction: the value that pr2_gripper_sensor feeds forward."""
    coulomb_spread_n: float = field(default=0.4, validator=NOT_NEGATIVE)
    """Its standard deviation between trials."""
    breakaway_n: float = field(default=8.0, validator=NOT_NEGATIVE)
    """Static friction: a little more than Coulomb friction (an assumption)."""
    stribeck_m_s: float = field(default=0.002, validator=POSITIVE)
    """Speed over which friction falls from static to Coulomb (an assumption)."""
    load_share: float = field(default=0.5, validator=NOT_NEGATIVE)
    """Friction of the loaded screw per newton on the pads: gives about 20 N on a flat surface at 23 N."""
    damping_n_s_m: float = field(default=10.0, validator=NOT_NEGATIVE)
    """Viscous friction on the gap, as in the description of the PR2."""
    open_gap_m: float = field(default=0.086, validator=and_(gt(0.0), le(0.09)))
    """Gap of the open fingers."""
    skin_n_m: float = field(default=3e4, validator=gt(0.0))
    """Stiffness of one fingertip's pad: 1e4 to 1e5 N/m (an assumption); `inf`: rigid."""
    skin_damping_n_s_m: float = field(default=0.0, validator=NOT_NEGATIVE)
    """Damper parallel to that spring."""
    skin_creep_n_m: float = field(default=0.0, validator=NOT_NEGATIVE)
    """Stiffness of a Maxwell branch parallel to that spring, which makes the pad creep."""
    skin_creep_s: float = field(default=0.3, validator=POSITIVE)
    """Time constant of that branch."""
    drive_lag_s: float = field(default=0.0, validator=NOT_NEGATIVE)
    """Time constant with which the effort follows the command; 0: no lag."""
    compile: Literal["worth", "always", "never"] = field(
        default="worth", validator=in_(("worth", "always", "never")), metadata=CHANGES_NO_RESULT
    )
    """Whether batches are compiled: where that saves more time than it takes, always, or never."""
    explain: bool = field(default=False, metadata=CHANGES_NO_RESULT)
    """Whether the report lists the contribution of each term of the object (`--explain-model`)."""
    noise_counts: float = field(default=15.0, validator=NOT_NEGATIVE)
    """Standard deviation of a cell's noise: margins of 125 to 225 counts are in use on the robot."""
    pad_period_s: float = field(default=0.041, validator=and_(ge(0.001), le(1.0)))
    """Time between cell images: the PR2's pads report every 41 ms (pr2_gripper_sensor, pressure_observer.cpp)."""
    pad_cells: int = field(default=15, validator=[instance_of(int), ge(1), le(15)])
    """Number of cells of the gripping face, the ones nearest to its middle; the others read no force."""
    pad_delay_s: float = field(default=0.0, validator=and_(ge(0.0), le(0.04)))
    """Time between the sampling of a cell image and its arrival: 0.01 with the reports of the PR2's driver."""

    @property
    def has_forced_steps(self) -> bool:
        """Whether the settings prescribe the scheme or the length of the steps."""
        return self.scheme != "auto" or self.step_s is not None
