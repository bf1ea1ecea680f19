"""A trial as it is stored: everything except its ticks and pad images, in one form with one codec.

A recording holds a record as MCAP metadata, in three sections that are written as they become known: `START` before
the grasp, `DEVICE` once the gripper is open, `RESULT` after the grasp. The store holds the same texts in its columns.
JSON texts are canonical: the same record always gives the same text.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable, Mapping
from datetime import UTC, datetime
from math import isnan, nan
from typing import Any, Final, Literal, TypeVar, get_args

from attrs import evolve, field, frozen

from graspsense import __version__
from graspsense.core.components.channels import as_json, fingertips, from_json, further
from graspsense.core.files.toml_text import toml_lines, toml_values
from graspsense.core.settings.resolved import Settings
from graspsense.core.values.channel import Channel
from graspsense.core.values.device import DeviceInfo
from graspsense.core.values.errors import DataDamaged
from graspsense.core.values.features import Features
from graspsense.core.values.json_values import json_text
from graspsense.core.values.mounting import Mounting, mounting_from_json
from graspsense.core.values.signals import Outcome
from graspsense.core.values.trial import Trial, trial_as_json
from graspsense.recording.before_contact import before_contact, contact_force_of
from graspsense.recording.layout import DEVICE, RESULT, START, VERSION
from graspsense.recording.provenance import provenance

T = TypeVar("T")
Origin = Literal["run", "collect", "import"]
Metadata = Mapping[str, Mapping[str, str]]
"""Section of a recording to its texts."""

DETAILS: Final = (
    *("prediction", "report", "counts", "events", "warnings"),
    *("seconds_simulated", "seconds_wall"),
)
"""Keys of `graspsense run --json` that `TrialResult.details` holds; the others have fields of their own."""
_OUTCOMES: Final = frozenset(outcome.words for outcome in Outcome)


@frozen(kw_only=True)
class DeviceRecord:
    """The gripper of a trial, as `DeviceInfo` described it when it was opened."""

    name: str = field(default="", converter=str)
    serial: str = field(default="", converter=str)
    firmware: str = field(default="", converter=str)
    clock: str = field(default="", converter=str)
    simulated: bool = field(default=False, converter=bool)
    rate_hz: float = field(default=0.0, converter=float)
    calibration: Mapping[str, str] = field(factory=dict, converter=dict)
    numbers: Mapping[str, float | str] = field(factory=dict, converter=dict)
    units: Mapping[str, str] = field(factory=dict)
    notes: tuple[str, ...] = ()
    channels: tuple[Channel, ...] = ()
    """Its tactile arrays, and the channels that are not part of a frame."""
    mounting: Mapping[str, Mounting] = field(factory=dict)

    @classmethod
    def described(cls, device: DeviceInfo) -> DeviceRecord:
        """Return the record of an open gripper."""
        values = {name: getattr(device, name) for name in cls.__annotations__}
        pads = fingertips(device.channels)
        arrays = () if pads is None else (pads,)
        return cls(**{**values, "channels": (*arrays, *further(device.channels))})

    @property
    def label(self) -> str:
        """The serial number, or the name if there is none."""
        return self.serial or self.name

    def to_text(self) -> str:
        """Return canonical JSON."""
        values = {name: getattr(self, name) for name in DeviceRecord.__annotations__}
        values["channels"] = [as_json(channel) for channel in self.channels]
        values["mounting"] = {name: mounting.as_json() for name, mounting in self.mounting.items()}
        if not self.mounting:
            del values["mounting"]
        return json_text(values)

    @classmethod
    def from_text(cls, text: str) -> DeviceRecord:
        """Return the device that `to_text` wrote. Raises KeyError, TypeError or ValueError for any other text."""
        value = json_table(text)
        known = {name: value[name] for name in cls.__annotations__ if name in value}
        units, notes = value.get("units", {}), value.get("notes", [])
        if not isinstance(units, dict) or not all(isinstance(unit, str) for unit in units.values()):
            raise TypeError("the units of the gripper are not a table of texts")
        if not isinstance(notes, list):
            raise TypeError("the notes on the gripper are not a list")
        channels = tuple(map(from_json, value.get("channels", [])))
        mounting = mounting_from_json(value.get("mounting", {}))
        return cls(**{**known, "notes": tuple(map(str, notes)), "channels": channels, "mounting": mounting})


@frozen(kw_only=True)
class TrialResult:
    """The result of a grasp: its outcome, its features, and those from before contact.

    `details` holds the prediction, the gripper's report, the runner's counts, events, warnings and durations, as
    `graspsense run --json` prints them.
    """

    outcome: str
    reason: str = ""
    features: Features
    before_contact: Features
    details: Mapping[str, Any] = field(factory=dict)

    @classmethod
    def finished(cls, trial: Trial) -> TrialResult:
        """Return the result of a trial."""
        printed = trial_as_json(trial)
        return cls(
            outcome=trial.outcome.words,
            reason=trial.reason,
            features=trial.features,
            before_contact=before_contact(trial.trace, contact_force_of(trial.run.settings)),
            details={key: printed[key] for key in DETAILS},
        )


@frozen(kw_only=True)
class TrialRecord:
    """One trial as recordings, the store, exports and replay hold it.

    `made_at` is the start of the grasp in ISO 8601, UTC. `labels` may hold `label` (`class:state`), `instance` (the
    individual object, `can#3`) and other texts of the operator. `settings` are those of a complete pipeline file,
    without keys that are not set. `device` is None if the gripper was not opened, `result` if the grasp did not end.
    """

    made_at: str
    origin: Origin
    labels: Mapping[str, str]
    settings: Mapping[str, Mapping[str, Any]]
    provenance: Mapping[str, Any]
    device: DeviceRecord | None = None
    result: TrialResult | None = None

    @classmethod
    def begin(cls, settings: Settings, labels: Mapping[str, str], origin: Origin) -> TrialRecord:
        """Return the record of a grasp that starts now, with these settings."""
        return cls(
            made_at=datetime.now(UTC).isoformat(timespec="milliseconds"),
            origin=origin,
            labels=dict(labels),
            settings=without_none(settings.values),
            provenance=provenance(settings),
        )

    def with_device(self, device: DeviceInfo) -> TrialRecord:
        """Return the record with its gripper."""
        return evolve(self, device=DeviceRecord.described(device))

    def with_result(self, trial: Trial) -> TrialRecord:
        """Return the record with its result."""
        return evolve(self, result=TrialResult.finished(trial))

    @property
    def simulated(self) -> bool:
        """Whether the gripper declared that its forces and motion come from a model."""
        return self.device is not None and self.device.simulated

    @property
    def recorded_with(self) -> dict[str, Mapping[str, Any]]:
        """The settings of the gripper and the controller that made it, as far as they are known."""
        return {table: self.settings[table] for table in ("gripper", "controller") if table in self.settings}

    @property
    def settings_text(self) -> str:
        """The settings as a pipeline file in TOML."""
        head = f"# Settings of a trial of {self.made_at}, written by graspsense {__version__}."
        return "\n".join([head, *toml_lines(self.settings)]) + "\n"

    def section(self, name: str) -> dict[str, str]:
        """Return the texts of one section: `START`, `DEVICE` or `RESULT`.

        Raises ValueError if the record does not have this section.
        """
        if name == START:
            return {
                "version": str(VERSION),
                "made_at": self.made_at,
                "origin": self.origin,
                "labels": json_text(self.labels),
                "settings": self.settings_text,
                "provenance": json_text(self.provenance),
            }
        if name == DEVICE and self.device is not None:
            return {"device": self.device.to_text()}
        if name == RESULT and self.result is not None:
            return {
                "outcome": self.result.outcome,
                "reason": self.result.reason,
                "features": _features_text(self.result.features),
                "before_contact": _features_text(self.result.before_contact),
                "details": json_text(self.result.details),
            }
        raise ValueError(f"the record has no section {name!r}")

    @classmethod
    def from_sections(cls, metadata: Metadata, where: str) -> TrialRecord:
        """Return the record whose texts these sections hold; `where` names the file in messages.

        Raises DataDamaged if the section `START` is missing, or if any text cannot be read.
        """
        start = _decoded(f"{where} does not say how it was made", lambda: _start(metadata[START]))
        device = result = None
        if DEVICE in metadata:
            device = _decoded(
                f"the description of the gripper in {where} cannot be read",
                lambda: DeviceRecord.from_text(metadata[DEVICE]["device"]),
            )
        if RESULT in metadata:
            result = _decoded(f"the result in {where} cannot be read", lambda: _result(metadata[RESULT]))
        return evolve(start, device=device, result=result)


def json_table(text: str) -> dict[str, Any]:
    """Return a JSON object. Raises TypeError or ValueError if the text is anything else."""
    value = json.loads(text)
    if not isinstance(value, dict):
        raise TypeError("it is not a table")
    return value


def names_text(features: Features) -> str:
    """Return names and units of features as canonical JSON."""
    return json_text([list(pair) for pair in zip(features.names, features.units, strict=True)])


def stored_features(names: Any, values: Iterable[float | None], reasons: Mapping[Any, Any]) -> Features:
    """Return the features of these pairs of name and unit; None and NaN are missing. Raises TypeError, ValueError."""
    pairs = [(str(name), str(unit)) for name, unit in names]
    return Features(
        names=tuple(name for name, _ in pairs),
        values=tuple(nan if value is None or isnan(value) else float(value) for value in values),
        units=tuple(unit for _, unit in pairs),
        reasons={str(name): str(why) for name, why in reasons.items()},
    )


def _features_text(features: Features) -> str:
    values = [None if isnan(value) else value for value in features.values]
    names = list(zip(features.names, features.units, strict=True))
    return json_text({"features": names, "values": values, "reasons": features.reasons})


def _features_of(text: str) -> Features:
    """Return what `_features_text` wrote. Raises KeyError, TypeError or ValueError for any other text."""
    value = json_table(text)
    return stored_features(value["features"], value["values"], value["reasons"])


def _start(texts: Mapping[str, str]) -> TrialRecord:
    datetime.fromisoformat(texts["made_at"])
    if texts["origin"] not in get_args(Origin):
        raise ValueError(f"origin {texts['origin'][:20]!r}")
    settings = toml_values(texts["settings"])
    dict(settings["gripper"])  # every pipeline has this table
    return TrialRecord(
        made_at=texts["made_at"],
        origin=texts["origin"],  # type: ignore[arg-type]
        labels={key: str(value) for key, value in json_table(texts["labels"]).items()},
        settings=settings,
        provenance=json_table(texts["provenance"]),
    )


def _result(texts: Mapping[str, str]) -> TrialResult:
    if texts["outcome"] not in _OUTCOMES:
        raise ValueError(f"outcome {texts['outcome'][:20]!r}")
    return TrialResult(
        outcome=texts["outcome"],
        reason=texts["reason"],
        features=_features_of(texts["features"]),
        before_contact=_features_of(texts["before_contact"]),
        details=json_table(texts["details"]),
    )


def _decoded(problem: str, decode: Callable[[], T]) -> T:
    try:
        return decode()
    except MemoryError:
        raise
    except Exception as error:  # a text can hold any value in any place
        raise DataDamaged(f"{problem} ({type(error).__name__}: {error})") from error


def without_none(value: Any) -> Any:
    """Return a value without the keys whose value is None, which TOML cannot hold; tuples become lists."""
    if isinstance(value, Mapping):
        return {key: without_none(inner) for key, inner in value.items() if inner is not None}
    if isinstance(value, list | tuple):
        return [without_none(inner) for inner in value]
    return value
