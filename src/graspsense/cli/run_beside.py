"""`graspsense run --beside`: two grippers that grasp at the same time."""

from __future__ import annotations

from collections.abc import Sequence
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING, Any

from graspsense.core.components.registry import installed
from graspsense.core.values.signals import Outcome
from graspsense.store.labels import labels_of

if TYPE_CHECKING:
    from graspsense.core.grasp.pair import Member
    from graspsense.core.settings.resolved import Settings
    from graspsense.core.values.trial import Trial

Ended = tuple["Trial", bool, dict[str, Any] | None]
"""A trial of a pair, whether it was interrupted, and what is printed about the stored trial."""


def grasp_beside(
    settings: Settings, other: Settings, save: str | None, label: str | None
) -> tuple[Ended, Ended]:
    """Grasp with two grippers at once, and store both trials if they are to be kept.

    They are not compared with those that are in the store.
    """
    from graspsense.core.grasp.pair import run_pair

    recordings = _reserved(save)

    def grasp(member: Member, own: Settings, place: int) -> tuple[Ended, str]:
        ended = _beside(member, own, save, label, recordings[place:] + recordings[:place])
        trial = ended[0]
        failed = trial.outcome in (Outcome.ABORTED, Outcome.DEVICE_LOST)
        return ended, f"ended as {trial.outcome.words} ({trial.reason})" if failed else ""

    return run_pair(lambda member: grasp(member, settings, 0), lambda member: grasp(member, other, 1))


def _reserved(save: str | None) -> tuple[Path, ...]:
    """Return the paths of the two recordings of a pair; none where nothing is kept."""
    from graspsense.store.store import Store

    if save is None:
        return ()
    with Store.open(save) as store:
        made_at = datetime.now(UTC).isoformat(timespec="milliseconds")
        return store.new_recording(made_at), store.new_recording(made_at)


def _beside(
    member: Member, settings: Settings, save: str | None, label: str | None, recordings: Sequence[Path]
) -> Ended:
    """Grasp as one of a pair, and store the trial if it is to be kept; `recordings`: of this gripper and the other."""
    from graspsense.core.pipeline.pipeline import GraspInterrupted, grasp_with
    from graspsense.store.record_grasp import Beside, record_grasp
    from graspsense.store.store import Store

    if save is None:
        try:
            return grasp_with(settings, installed(), beside=member), False, None
        except GraspInterrupted as error:
            return error.trial, True, None
    own, other = recordings
    labels = {} if label is None else labels_of(label)
    beside = Beside(member=member, recording=own, other=other.name)
    with Store.open(save) as store:
        grasp = record_grasp(store, settings, installed(), labels=labels, origin="run", beside=beside)
    kept = {
        "store": save,
        "trial": grasp.number,
        "recorder": dict(grasp.counts),
        "problem": grasp.problem,
        "beside": other.name,
    }
    return grasp.trial, grasp.interrupted, kept
