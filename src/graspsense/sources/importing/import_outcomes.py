"""How recordings end under the settings of an import, tried on some of them before any is stored."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Final

import numpy as np
from attrs import field, frozen

from graspsense.core.components.caller import set_option
from graspsense.core.components.registry import installed
from graspsense.core.grasp.gap_resolution import gap_resolution
from graspsense.core.pipeline.pipeline import grasp_with
from graspsense.core.values.errors import ConfigError, GraspsenseError, counted
from graspsense.core.values.signals import Outcome
from graspsense.sources.recordings.dataset_recordings import handed_over

if TYPE_CHECKING:
    from graspsense.core.settings.resolved import Settings
    from graspsense.core.values.features import Features
    from graspsense.recording.replayable import Recording
    from graspsense.sources.importing.import_sources import ImportedRecording

MOST: Final = 24
"""Number of recordings that are tried."""
FEWEST: Final = 4
"""Number of recordings from which on most of them are not a coincidence."""
MOST_TRAVEL: Final = 0.5
"""Share of the travel of a squeeze after a rest, and"""
PRESSED: Final = 2.0
"""ratio of a later force to that of the rest, from which on most of the squeeze comes after it."""
RIGID: Final = 0.01
PRESSED_RIGID: Final = 1.4
LOST: Final = 10.0
"""Share of its range by which the gap closes at most on a rigid object, whose squeeze is that of the force alone, the
same ratio there, and that of the force in the same gap to one that is gone."""
UNCERTAIN: Final = 0.2
"""Share of `delta_t` from which on the time of the last step of the gap makes it uncertain."""


@frozen
class TriedRecordings:
    """How many of the recordings that were tried end in which way, and how many of their rests are doubtful."""

    outcomes: Counter[Outcome] = field(factory=Counter)
    pressing_on: int = 0
    within_a_step: int = 0

    @property
    def notice(self) -> str:
        """What looks wrong in the rests, empty if nothing does."""
        told = {
            "most of a squeeze, or much of its force, comes after the rest that p_steady, f_steady and delta_t are of. "
            "If the fingers only stuck there, or a sensor stopped, ask for a longer rest: "
            f"{set_option('controller.rest_window_s=SECONDS')}": self.pressing_on,
            "the gap has coarse steps, and stays for a large part of delta_t before the last one: the fingers go on "
            "within a step for as long and longer, so delta_t is too small, and cannot be told": self.within_a_step,
        }
        tried = counted(self.outcomes.total(), "grasp")
        return "; ".join(f"{count} of {tried} tried: {what}" for what, count in told.items() if count)


def tried(
    recordings: Sequence[ImportedRecording], settings_of: Callable[[ImportedRecording], Settings]
) -> TriedRecordings:
    """Return how some recordings, evenly spread, end."""
    outcomes: Counter[Outcome] = Counter()
    pressing_on = within_a_step = 0
    for recording in recordings[:: -(-len(recordings) // MOST)]:
        with handed_over(recording.name, recording.labelled.recording):
            try:
                trial = grasp_with(settings_of(recording), installed())
            except GraspsenseError:  # which the import itself reports
                continue
        outcomes[trial.outcome] += 1
        pressing_on += presses_on(trial.features, recording.labelled.recording)
        within_a_step += rests_within_a_step(trial.features, recording.labelled.recording)
    return TriedRecordings(outcomes, pressing_on, within_a_step)


def presses_on(features: Features, recording: Recording) -> bool:
    """Return whether most of a squeeze comes after its rest, as it does if the fingers stick on their way.

    A gap that shows no travel after the rest, nor before it, tells of no rest either. Nor is there one of a squeeze
    where the force is gone, and the gap is what it was.
    """
    known = dict(zip(features.names, features.values, strict=True))
    p_first, p_steady, f_steady = (known.get(name, math.nan) for name in ("p_first", "p_steady", "f_steady"))
    gap, left, right = recording.columns("gap_m", "force_left_n", "force_right_n")
    later, both = gap <= p_steady, (left + right) / 2.0
    if not later.any():  # also without a rest, or without a gap
        return False
    narrowest, force = gap[later].min(), np.fmax.reduce(both[later])
    still = RIGID * (np.fmax.reduce(gap) - narrowest)
    lost = np.fmax.reduce(both[np.abs(gap - p_steady) <= still], initial=0.0) > LOST * max(f_steady, 0.0)
    travels_on = p_steady - narrowest >= MOST_TRAVEL * (p_first - narrowest)
    pressed = PRESSED_RIGID if p_first - narrowest < still else PRESSED if travels_on else math.inf
    return bool(lost or force > pressed * f_steady)


def rests_within_a_step(features: Features, recording: Recording) -> bool:
    """Return whether a coarse gap stays for much of `delta_t` before its last step to the rest.

    Fingers that slow down are then still within the next step for as long as that.
    """
    known = dict(zip(features.names, features.values, strict=True))
    delta_t, p_steady = known.get("delta_t", math.nan), known.get("p_steady", math.nan)
    t_s, gap = recording.columns("t_s", "gap_m")
    reached = gap <= p_steady
    if not (delta_t >= 0.0 and reached.any()) or {"t", "gap"} & recording.units.keys():
        return False
    resting = int(reached.argmax())
    steps = np.flatnonzero(np.diff(gap[:resting])) + 1
    last = int(steps[-1]) if len(steps) else 0
    coarse = resting - last > 1 and gap_resolution(t_s.tolist(), gap.tolist(), resting).step_m > 0.0
    return coarse and min(float(t_s[resting] - t_s[last]), delta_t) >= UNCERTAIN * delta_t


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
