"""How recordings end under the settings of an import, tried on some of them before any is stored."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Final

from graspsense.core.components.caller import set_option
from graspsense.core.components.registry import installed
from graspsense.core.pipeline.pipeline import grasp_with
from graspsense.core.values.errors import ConfigError, GraspsenseError
from graspsense.core.values.signals import Outcome
from graspsense.sources.dataset_recordings import handed_over

if TYPE_CHECKING:
    from graspsense.core.components.config import Settings
    from graspsense.sources.import_sources import ImportedRecording

MOST: Final = 24
"""Number of recordings that are tried."""
FEWEST: Final = 4
"""Number of recordings from which on most of them are not a coincidence."""


def outcomes_of(
    recordings: Sequence[ImportedRecording], settings_of: Callable[[ImportedRecording], Settings]
) -> Counter[Outcome]:
    """Return how many of some recordings, evenly spread, end in which way."""
    outcomes: Counter[Outcome] = Counter()
    for recording in recordings[:: -(-len(recordings) // MOST)]:
        with handed_over(recording.name, recording.labelled.recording):
            try:
                outcomes[grasp_with(settings_of(recording), installed()).outcome] += 1
            except GraspsenseError:  # which the import itself reports
                continue
    return outcomes


def refuse_useless(
    recordings: Sequence[ImportedRecording], outcomes: Counter[Outcome], settings: Settings
) -> None:
    """Raise ConfigError if most recordings end as too wide, soon after they began, or can have no contact."""
    _refuse_below_zero(recordings)
    wide, tried = outcomes[Outcome.TOO_WIDE], outcomes.total()
    if tried < FEWEST or 2 * wide <= tried:
        return
    given = settings.values["controller"]
    contact, travel = given.get("contact_force_n", 0.0), given.get("too_wide_m", 0.0)
    raise ConfigError(
        f"{wide} of {tried} recordings end as too wide, soon after their beginning: both pads feel "
        f"contact_force_n = {contact:g} before the gap has closed by too_wide_m = {travel:g}. If the recordings "
        f"begin close to the object, add {set_option('controller.too_wide_m=0')}. If the force without contact is "
        f"larger than this, add {set_option('controller.contact_force_n=FORCE')}. Or leave both out, so that they "
        "follow from the recordings"
    )


def _refuse_below_zero(recordings: Sequence[ImportedRecording]) -> None:
    """Raise ConfigError if the forces of most recordings are below zero throughout."""
    frames = [
        [reading.frame for reading in recording.labelled.recording.readings] for recording in recordings
    ]
    below = sum(
        max((min(each.force_left_n, each.force_right_n) for each in grasp), default=0.0) < 0.0
        for grasp in frames
    )
    if len(frames) < FEWEST or 2 * below <= len(frames):
        return
    raise ConfigError(
        f"the force of {below} of {len(frames)} recordings is below zero throughout, so that no contact can be found. "
        'If the fingers were free at the beginning, write zero = "10 samples" in the manifest; else subtract the known '
        'zero of the sensor: force = "FORCE + OFFSET". If it falls on contact, turn its sign: -FORCE'
    )
