"""Settings of the laws, in SI units. The defaults are those that Romano et al. print or ship, unless it is said."""

from __future__ import annotations

from typing import ClassVar, Final, Literal, get_args

from attrs import frozen

from graspsense.plugin_api import setting

PlaceBy = Literal[
    "side-or-acceleration", "slip-and-acceleration", "side-slip-or-acceleration", "slip", "acceleration"
]
PLACE_BY: Final = get_args(PlaceBy)


@frozen(kw_only=True, slots=False)
class FindContactConfig:
    """Settings of every law: how it closes until both pads touch."""

    sends: Literal["effort", "velocity", "position"] = setting(
        default="effort",
        meaning="What is commanded. velocity and position are for a gripper with a servo of its own: the gains of the "
        "position servo then have no effect.",
    )
    close_speed_m_s: float = setting(
        default=0.02, unit="m/s", above=0.0, plausible=(1e-4, 0.2), meaning="Rate at which the gap closes."
    )
    lightest_n: float = setting(
        default=1.2,
        unit="N",
        above=0.25,
        plausible=(0.3, 20.0),
        meaning="Least force of a grip. A pad with more than this less 0.25 N touches.",
    )
    contact_high_n: float = setting(
        default=0.1, unit="N", above=0.0, meaning="High band of a pad above which it touches."
    )
    side_n: float = setting(
        default=0.2,
        unit="N",
        above=0.0,
        meaning="High band of an edge cell above which it was hit from the side.",
    )
    find_timeout_s: float = setting(
        default=10.0,
        unit="s",
        above=0.0,
        plausible=(0.1, 600.0),
        meaning="Longest time until both pads touch. Published is 5 s, which from 90 mm at 20 mm/s is just enough.",
    )
    force_limit_n: float = setting(
        default=20.0,
        unit="N",
        above=0.0,
        plausible=(0.5, 200.0),
        meaning="Greatest force on a pad that is asked for. Published is no limit.",
    )
    closed_gap_m: float = setting(
        default=0.003,
        unit="m",
        plausible=(-0.05, 0.1),
        meaning="Gap at which there is nothing between the fingers.",
    )
    stiffness_n_m: float = setting(
        default=20_000.0, unit="N/m", minimum=0.0, meaning="Position servo: effort per error of the gap."
    )
    damping_n_s_m: float = setting(
        default=5_000.0, unit="N s/m", minimum=0.0, meaning="Position servo: effort per error of the speed."
    )
    friction_n: float = setting(
        default=7.0,
        unit="N",
        minimum=0.0,
        meaning="Position servo: friction of the drive that is fed forward.",
    )

    def __attrs_post_init__(self) -> None:
        force_n = self.force_n if isinstance(self, ForceServoConfig) and self.asks_force else self.lightest_n
        if not self.lightest_n <= force_n <= self.force_limit_n:
            raise ValueError(
                f"the force is {force_n:g} N: it is from lightest_n ({self.lightest_n:g} N) to force_limit_n "
                f"({self.force_limit_n:g} N)"
            )


@frozen(kw_only=True, slots=False)
class ForceServoConfig(FindContactConfig):
    """Settings of the force servo."""

    asks_force: ClassVar[bool] = True
    """Whether `force_n` has an effect."""

    force_n: float = setting(
        default=5.0, unit="N", above=0.0, plausible=(0.3, 200.0), meaning="Force of the weaker finger."
    )
    closing_gain_m_s_per_newton: float = setting(
        default=0.0016, unit="m/s/N", above=0.0, meaning="Rate of closing per newton that is missing."
    )
    opening_gain_m_s_per_newton: float = setting(
        default=0.0008, unit="m/s/N", minimum=0.0, meaning="Rate of opening per newton that is too much."
    )
    force_tolerance_n: float = setting(
        default=0.3, unit="N", above=0.0, meaning="Largest error of a force that is reached."
    )
    speed_tolerance_m_s: float = setting(
        default=0.001,
        unit="m/s",
        above=0.0,
        meaning="Largest speed of the fingers with a force that is reached.",
    )
    settle_s: float = setting(
        default=0.25,
        unit="s",
        minimum=0.0,
        meaning="Time for which force and speed are within their tolerances.",
    )
    force_timeout_s: float = setting(
        default=6.0,
        unit="s",
        above=0.0,
        plausible=(0.1, 600.0),
        meaning="Longest time from contact to the force.",
    )
    deformation_limit_m: float = setting(
        default=0.03, unit="m", above=0.0, meaning="The fingers close no further than this after the contact."
    )


@frozen(kw_only=True, slots=False)
class SlipServoConfig(ForceServoConfig):
    """Settings of the slip servo: `force_n` is the force at which it begins."""

    force_n: float = setting(
        default=1.2, unit="N", above=0.0, plausible=(0.3, 200.0), meaning="Force at which it begins."
    )
    slip_share: float = setting(
        default=0.007,
        above=0.0,
        meaning="Share of the force that its high band exceeds in a slip (at most 0.2 N).",
    )
    slip_least_n: float = setting(
        default=0.048, unit="N", above=0.0, meaning="Least high band of the force in a slip."
    )
    slip_low_n: float = setting(
        default=0.18, unit="N", above=0.0, meaning="Low band that the force does not exceed in a slip."
    )


@frozen(kw_only=True, slots=False)
class GrabConfig(SlipServoConfig):
    """Settings of grab, whose force follows from the contact; `force_n` has no effect."""

    asks_force: ClassVar[bool] = False

    hardness: float = setting(
        default=0.03, unit="m/s", above=0.0, meaning="Force of the grip, for a contact force of 1 N at 1 m/s."
    )


@frozen(kw_only=True, slots=False)
class PlaceConfig(GrabConfig):
    """Settings of the laws that let go when the thing is put down."""

    place_by: PlaceBy = setting(default="slip-and-acceleration", meaning="What counts as being put down.")
    acceleration_m_s2: float = setting(
        default=3.25,
        unit="m/s2",
        above=0.0,
        meaning="Acceleration band above which there was a shock: published are 2 for gentle motion, 5 for fast, 3.25 "
        "for placing.",
    )
    place_share: float = setting(
        default=0.008, above=0.0, meaning="As slip_share, for being put down; the low band is below 0.2 N."
    )
    place_after_s: float = setting(
        default=1.0,
        unit="s",
        minimum=0.0,
        plausible=(0.0, 600.0),
        meaning="Time after the grip was reached before which no shock counts as putting down: that of the lift.",
    )
    place_timeout_s: float = setting(
        default=60.0,
        unit="s",
        above=0.0,
        plausible=(0.1, 3600.0),
        meaning="Longest time until it is put down.",
    )


@frozen(kw_only=True, slots=False)
class ReleaseConfig(PlaceConfig):
    """Settings of release."""

    asks_force: ClassVar[bool] = True

    force_n: float = setting(
        default=5.0,
        unit="N",
        above=0.0,
        plausible=(0.3, 200.0),
        meaning="Force that holds the thing until then.",
    )
