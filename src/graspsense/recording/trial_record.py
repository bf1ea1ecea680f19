"""What is kept of a trial besides its ticks: one set of texts, the same in the recording and in the store.

The recording gets it as metadata, what is known before the grasp at its beginning and the rest at its end. The
store's row is made from it, so that a row can be made again from a recording alone.
"""

from __future__ import annotations

import json
import struct
from collections.abc import Mapping
from datetime import UTC, datetime
from math import nan
from typing import TYPE_CHECKING, Any, Final, Literal

from attrs import field, frozen

from graspsense.core.config import to_toml
from graspsense.core.errors import DataDamaged
from graspsense.core.json_values import json_text
from graspsense.core.trial import trial_as_json
from graspsense.recording.before_contact import before_contact
from graspsense.recording.layout import DEVICE, START, TRIAL, VERSION
from graspsense.recording.provenance import provenance

if TYPE_CHECKING:
    from graspsense.core.config import Settings
    from graspsense.core.features import Features
    from graspsense.core.json_values import json_text
    from graspsense.core.roles import DeviceInfo
from graspsense.core.trial import Trial

Origin = Literal["run", "collect", "import"]
ORIGINS: Final = ("run", "collect", "import")


@frozen(kw_only=True)
class Beginning:
    """What is known before the grasp.

    `labels` may hold `label` (`class:state`) and `instance` (the one thing that is grasped, `can#3`), and whatever
    else the operator says. `settings` is a complete pipeline file.
    """

    made_at: str
    origin: Origin
    labels: Mapping[str, str]
    settings: str
    provenance: Mapping[str, Any]

    def as_metadata(self) -> dict[str, str]:
        """Return it as the texts of the metadata `START`."""
        return {
            "version": str(VERSION),
            "made_at": self.made_at,
            "origin": self.origin,
            "labels": json_text(self.labels),
            "settings": self.settings,
            "provenance": json_text(self.provenance),
        }


@frozen(kw_only=True)
class Row:
    """The features of a trial, as both a recording's end and the store hold them: names, units, values, reasons."""

    features: tuple[tuple[str, str], ...]
    values: tuple[float | None, ...]
    reasons: Mapping[str, str] = field(factory=dict)

    @classmethod
    def of(cls, features: Features) -> Row:
        """Return the features as a row."""
        return cls(
            features=tuple(zip(features.names, features.units, strict=True)),
            values=tuple(features.as_dict().values()),
            reasons=dict(features.reasons),
        )

    def as_json(self) -> dict[str, Any]:
        """Return it as JSON values."""
        return {
            "features": [list(one) for one in self.features],
            "values": list(self.values),
            "reasons": dict(self.reasons),
        }

    def packed(self) -> bytes:
        """Return the values as little-endian float64, NaN where missing."""
        return struct.pack(f"<{len(self.values)}d", *(nan if one is None else one for one in self.values))

    @classmethod
    def from_json(cls, value: Mapping[str, Any]) -> Row:
        """Return what `as_json` gave. Raises KeyError, TypeError, ValueError."""
        features = tuple((str(name), str(unit)) for name, unit in value["features"])
        values = tuple(None if one is None else float(one) for one in value["values"])
        if len(features) != len(values):
            raise ValueError(f"{len(features)} features and {len(values)} values")
        return cls(
            features=features, values=values, reasons={str(k): str(v) for k, v in value["reasons"].items()}
        )


@frozen(kw_only=True)
class Ending:
    """What came out: the trial as `graspsense run --json` prints it, its features, those from before contact."""

    trial: Mapping[str, Any]
    features: Row
    before: Row

    def as_metadata(self) -> dict[str, str]:
        """Return it as the texts of the metadata `TRIAL`."""
        return {
            "trial": json_text(self.trial),
            "features": json_text(self.features.as_json()),
            "before": json_text(self.before.as_json()),
        }


def beginning(settings: Settings, labels: Mapping[str, str], origin: Origin) -> Beginning:
    """Return what is known before a grasp with these settings, now."""
    return Beginning(
        made_at=datetime.now(UTC).isoformat(timespec="milliseconds"),
        origin=origin,
        labels=dict(labels),
        settings=to_toml(settings),
        provenance=provenance(settings),
    )


def ending(trial: Trial) -> Ending:
    """Return what is kept of a trial at its end."""
    return Ending(
        trial=trial_as_json(trial),
        features=Row.of(trial.features),
        before=Row.of(before_contact(trial.trace)),
    )


def device_metadata(device: DeviceInfo) -> dict[str, str]:
    """Return what is kept of a gripper as the text of the metadata `DEVICE`."""
    return {
        "device": json_text(
            {
                "name": device.name,
                "serial": device.serial,
                "firmware": device.firmware,
                "clock": device.clock,
                "rate_hz": device.rate_hz,
                "calibration": dict(device.calibration),
                "numbers": dict(device.numbers),
                "units": dict(device.units),
                "notes": list(device.notes),
            }
        )
    }


def beginning_in(metadata: Mapping[str, Mapping[str, str]], where: str) -> Beginning:
    """Return the beginning that a recording's metadata hold. Raises DataDamaged."""
    try:
        given = metadata[START]
        labels = json.loads(given["labels"])
        made = json.loads(given["provenance"])
        datetime.fromisoformat(given["made_at"])
        if given["origin"] not in ORIGINS or not isinstance(made, dict):
            raise ValueError(f"origin {given['origin'][:20]!r}")
        return Beginning(
            made_at=given["made_at"],
            origin=given["origin"],  # type: ignore[arg-type]
            labels={str(key): str(value) for key, value in labels.items()},
            settings=given["settings"],
            provenance=made,
        )
    except (KeyError, ValueError, TypeError, AttributeError) as error:
        raise DataDamaged(f"{where} does not say what made it ({type(error).__name__}: {error})") from error


def ending_in(metadata: Mapping[str, Mapping[str, str]], where: str) -> Ending | None:
    """Return the ending that a recording's metadata hold, None where it was not reached. Raises DataDamaged."""
    given = metadata.get(TRIAL)
    if given is None:
        return None
    try:
        trial = json.loads(given["trial"])
        if not isinstance(trial, dict) or not isinstance(trial["outcome"], str):
            raise TypeError("no outcome")
        return Ending(
            trial=trial,
            features=Row.from_json(json.loads(given["features"])),
            before=Row.from_json(json.loads(given["before"])),
        )
    except (KeyError, ValueError, TypeError, AttributeError) as error:
        raise DataDamaged(
            f"what {where} says of its outcome cannot be read ({type(error).__name__}: {error})"
        ) from error


__all__ = [
    "DEVICE",
    "START",
    "TRIAL",
    "Beginning",
    "Ending",
    "Row",
    "beginning",
    "beginning_in",
    "device_metadata",
    "ending",
    "ending_in",
]
