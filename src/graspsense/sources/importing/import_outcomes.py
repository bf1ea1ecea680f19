"""How recordings end under the settings of an import, tried on some of them before any is stored."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Final

import numpy as np

from graspsense.core.components.caller import set_option
from graspsense.core.components.registry import installed
from graspsense.core.pipeline.pipeline import grasp_with
from graspsense.core.values.errors import ConfigError, GraspsenseError
from graspsense.core.values.signals import Outcome
from graspsense.sources.recordings.dataset_recordings import handed_over
from graspsense.sources.recordings.doubtful_rests import notices_of_rests

if TYPE_CHECKING:
    from graspsense.core.settings.resolved import Settings
    from graspsense.sources.importing.import_sources import ImportedRecording

MOST: Final = 24
"""Number of recordings that are tried."""
FEWEST: Final = 4
"""Number of recordings from which on most of them are not a coincidence."""


def tried(
    recordings: Sequence[ImportedRecording], settings_of: Callable[[str], Settings]
) -> tuple[Counter[Outcome], list[str]]:
    """Return how many of some recordings, evenly spread, end in which way, and what looks wrong in their rests."""
    outcomes: Counter[Outcome] = Counter()
    grasps = []
    for imported in recordings[:: -(-len(recordings) // MOST)]:
        recording = imported.labelled.recording
        with handed_over(imported.name, recording):
            try:
                trial = grasp_with(settings_of(imported.name), installed())
            except GraspsenseError:  # which the import itself reports
                continue
        outcomes[trial.outcome] += 1
        grasps.append((trial.features, recording))
    return outcomes, notices_of_rests(grasps, "controller")


def refuse_useless(
    recordings: Sequence[ImportedRecording], outcomes: Counter[Outcome], settings: Settings
) -> None:
    """Raise ConfigError if most recordings end as too wide, soon after they began, or can have no contact."""
    _refuse_below_zero(recordings)
    wide, total = outcomes[Outcome.TOO_WIDE], outcomes.total()
    if total < FEWEST or 2 * wide <= total:
        return
    given = settings.values["controller"]
    contact, travel = given.get("contact_force_n", 0.0), given.get("too_wide_m", 0.0)
    raise ConfigError(
        f"{wide} of {total} recordings end as too wide, soon after their beginning: both pads feel "
        f"contact_force_n = {contact:g} before the gap has closed by too_wide_m = {travel:g}. If the recordings "
        f"begin close to the object, add {set_option('controller.too_wide_m=0')}. If the force without contact is "
        f"larger than this, add {set_option('controller.contact_force_n=FORCE')}. Or leave both out, so that they "
        "follow from the recordings"
    )


def _refuse_below_zero(recordings: Sequence[ImportedRecording]) -> None:
    """Raise ConfigError if the forces of most recordings are below zero throughout."""
    forces = (
        recording.labelled.recording.columns("force_left_n", "force_right_n") for recording in recordings
    )
    below = sum(bool(pads.min(axis=0).max(initial=-np.inf) < 0.0) for pads in forces)
    if len(recordings) < FEWEST or 2 * below <= len(recordings):
        return
    raise ConfigError(
        f"the force of {below} of {len(recordings)} recordings is below zero throughout, so that no contact can be "
        'found. If the fingers were free at the beginning, write zero = "10 samples" in the manifest; else subtract '
        'the known zero of the sensor: force = "FORCE + OFFSET". If it falls on contact, turn its sign: -FORCE'
    )
