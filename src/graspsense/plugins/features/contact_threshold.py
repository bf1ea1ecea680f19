"""The setting that feature sets of the contact have in common."""

from __future__ import annotations

from attrs import frozen

from graspsense.plugin_api import CONTACT_FORCE_N, setting


@frozen(kw_only=True)
class ContactThreshold:
    """The threshold of contact."""

    contact_force_n: float = setting(
        default=CONTACT_FORCE_N,
        unit="N",
        above=0.0,
        plausible=(0.01, 20.0),
        meaning="Force on each pad from which on it touches; that of the controller unless it is given here.",
        follows="controller.contact_force_n",
    )
