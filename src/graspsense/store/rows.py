"""The rows of the store: a trial record as columns, the hash over them, and the way back."""

from __future__ import annotations

import json
import struct
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Final

from attrs import evolve, field, fields_dict, frozen

from graspsense.core.values.errors import ConfigError
from graspsense.core.values.features import Features
from graspsense.core.values.json_values import json_text
from graspsense.recording.layout import DEVICE, START
from graspsense.recording.provenance import json_sha256, recipe
from graspsense.recording.recording_info import RecordingInfo
from graspsense.recording.trial_record import (
    TrialRecord,
    TrialResult,
    json_table,
    names_text,
    stored_features,
)

TRIAL_COLUMNS: Final = (
    "made_at",
    "origin",
    "label",
    "instance",
    "outcome",
    "complete",
    "device",
    "simulated",
    "recipe",
    "values",
    "before_contact",
    "recording",
    "recording_sha256",
    "recording_bytes",
)
"""Columns of the table `trial` that are hashed, in the order of the hash."""
DETAIL_COLUMNS: Final = (
    "labels",
    "settings",
    "provenance",
    "device",
    "reason",
    "missing",
    "missing_before",
    "details",
    "recorder",
)
"""Columns of the table `detail`, in the order of the hash."""


@frozen(kw_only=True)
class TrialSummary:
    """A trial as a list shows it. `complete` is False if the recorder lost messages or the grasp did not end."""

    id: int
    made_at: str
    origin: str
    label: str | None
    instance: str | None
    outcome: str
    complete: bool = field(converter=bool)
    set_aside: str | None
    """Why the trial was set aside; None if it was not."""
    device: str
    simulated: bool = field(converter=bool)
    recording: str

    @classmethod
    def from_row(cls, row: Sequence[Any]) -> TrialSummary:
        """Return the summary from a row of `SUMMARY_COLUMNS`."""
        return cls(**dict(zip(fields_dict(cls), row, strict=True)))


SUMMARY_COLUMNS: Final = ", ".join(fields_dict(TrialSummary))


@frozen(kw_only=True)
class StoredTrial:
    """A trial of a store: its summary, its record, and its recording."""

    summary: TrialSummary
    record: TrialRecord
    recording: Path
    recording_sha256: str
    recorder: Mapping[str, int]
    """The counters of `RecordingInfo`."""

    @property
    def result(self) -> TrialResult:
        """The result of the record; every trial of a store has one."""
        assert self.record.result is not None
        return self.record.result

    @property
    def recipe(self) -> dict[str, dict[str, Any]]:
        """The settings that the grasps of one experiment share."""
        return recipe(self.record.settings)


@frozen(kw_only=True)
class EncodedRow:
    """A trial as columns: those of `trial` and `detail`, and the texts of its two feature sets."""

    trial: Mapping[str, Any]
    detail: Mapping[str, str]
    feature_set: str
    before_set: str

    @property
    def sha256(self) -> str:
        """The hash over all columns."""
        columns = [
            self.feature_set,
            self.before_set,
            *(self.trial[name] for name in TRIAL_COLUMNS),
            *(self.detail[name] for name in DETAIL_COLUMNS),
        ]
        return json_sha256([column.hex() if isinstance(column, bytes) else column for column in columns])


def encoded(record: TrialRecord, recording: RecordingInfo, *, complete: bool) -> EncodedRow:
    """Return the columns of a trial. Raises ConfigError if the record has no device or no result."""
    result, device = record.result, record.device
    if result is None or device is None:
        raise ConfigError(
            f"the recording {recording.path} has no result or no gripper, so it cannot be stored"
        )
    start = record.section(START)
    return EncodedRow(
        trial={
            "made_at": record.made_at,
            "origin": record.origin,
            "label": record.labels.get("label"),
            "instance": record.labels.get("instance"),
            "outcome": result.outcome,
            "complete": int(complete),
            "device": device.label,
            "simulated": int(record.simulated),
            "recipe": json_sha256(recipe(record.settings)),
            "values": _packed(result.features),
            "before_contact": _packed(result.before_contact),
            "recording": recording.path.name,
            "recording_sha256": recording.sha256,
            "recording_bytes": recording.size,
        },
        detail={
            "labels": start["labels"],
            "settings": start["settings"],
            "provenance": start["provenance"],
            "device": record.section(DEVICE)["device"],
            "reason": result.reason,
            "missing": json_text(result.features.reasons),
            "missing_before": json_text(result.before_contact.reasons),
            "details": json_text(result.details),
            "recorder": json_text(recording.counts),
        },
        feature_set=names_text(result.features),
        before_set=names_text(result.before_contact),
    )


def _packed(features: Features) -> bytes:
    """Return the values as little-endian float64, with NaN for a missing value."""
    return struct.pack(f"<{len(features.values)}d", *features.values)


def _unpacked(names: str, packed: bytes, reasons: Mapping[str, Any]) -> Features:
    """Return the features of these texts and packed values. Raises TypeError, ValueError or struct.error."""
    return stored_features(
        json.loads(names), (value for (value,) in struct.iter_unpack("<d", packed)), reasons
    )


def decoded(summary: TrialSummary, row: EncodedRow, recording: Path) -> StoredTrial:
    """Return the trial of these columns. Raises ValueError, TypeError, KeyError, struct.error or DataDamaged."""
    trial, detail = row.trial, row.detail
    sections = {
        START: {
            "made_at": summary.made_at,
            "origin": summary.origin,
            **{name: detail[name] for name in ("labels", "settings", "provenance")},
        },
        DEVICE: {"device": detail["device"]},
    }
    result = TrialResult(
        outcome=summary.outcome,
        reason=detail["reason"],
        features=_unpacked(row.feature_set, trial["values"], json_table(detail["missing"])),
        before_contact=_unpacked(
            row.before_set, trial["before_contact"], json_table(detail["missing_before"])
        ),
        details=json_table(detail["details"]),
    )
    record = TrialRecord.from_sections(sections, f"trial {summary.id}")
    current = {"label": summary.label, "instance": summary.instance}
    labels = {**record.labels, **current}
    return StoredTrial(
        summary=summary,
        record=evolve(record, result=result, labels={k: v for k, v in labels.items() if v is not None}),
        recording=recording,
        recording_sha256=trial["recording_sha256"],
        recorder=json_table(detail["recorder"]),
    )
