"""The settings that feature sets of the contact, or of the contact and the rest, have in common."""

from __future__ import annotations

from attrs import frozen

from graspsense.plugin_api import CONTACT_FORCE_N, REST_SPEED_M_S, REST_WINDOW_S, setting


@frozen(kw_only=True)
class ContactThreshold:
    """The threshold of contact."""

    contact_force_n: float = setting(
        default=CONTACT_FORCE_N,
        unit="N",
        above=0.0,
        plausible=(0.01, 20.0),
        meaning="Force on each pad from which on it touches, tau_1 of the paper; that of the controller unless it is "
        "given here.",
        follows="controller.contact_force_n",
    )


@frozen(kw_only=True)
class RestThresholds(ContactThreshold):
    """The thresholds of contact and rest."""

    rest_speed_m_s: float = setting(
        default=REST_SPEED_M_S,
        unit="m/s",
        above=0.0,
        plausible=(1e-7, 0.05),
        meaning="tau_2 of the paper: at rest, the gap changes by less than this times the window, throughout it; "
        "that of the controller unless it is given here.",
        follows="controller.rest_speed_m_s",
    )
    rest_window_s: float = setting(
        default=REST_WINDOW_S,
        unit="s",
        above=0.0,
        plausible=(0.001, 5.0),
        meaning="Time for which the gap must rest, as rest_speed_m_s says; that of the controller unless it is given "
        "here. Longer where the gap is coarse: a step at this speed must fit into it.",
        follows="controller.rest_window_s",
    )
