"""The features of several feature sets together.

A classifier that ignores features without information, such as randomised trees, gains from what each set measures. A
feature keeps its name, unless a set before has one of this name: then its set is named in front of it.
"""

from __future__ import annotations

from collections.abc import Container
from functools import cached_property
from typing import Any, Final

from attrs import evolve, fields_dict, frozen

from graspsense.plugin_api import (
    Channel,
    ConfigError,
    Feature,
    Features,
    FeatureSet,
    Trace,
    create,
    setting,
    signal_type,
)
from graspsense.plugins.features.contact_threshold import RestThresholds


@frozen(kw_only=True)
class UnionConfig(RestThresholds):
    """The sets, and the thresholds that those of them get which have such a setting."""

    sets: tuple[str, ...] = setting(
        default=("chitta", "curve", "quantiles"),
        meaning="Names of the feature sets; their other settings are the defaults.",
    )


THRESHOLDS: Final = tuple(name for name in fields_dict(UnionConfig) if name != "sets")


class UnionFeatures(FeatureSet[UnionConfig]):
    """Extracts the features of each set; one that its set does not define is missing with the reason given there."""

    @property
    def requires(self) -> tuple[Channel, ...]:  # type: ignore[override]
        """The channels that all sets need, with the largest rate; a set that lacks others has no features."""
        parts = [{channel.name: channel for channel in part.requires} for part in self._parts.values()]
        common = [name for name in parts[0] if all(name in part for part in parts)]
        return tuple(
            max((part[name] for part in parts), key=lambda channel: channel.rate_hz) for name in common
        )

    @property
    def features(self) -> tuple[Feature, ...]:  # type: ignore[override]
        """The features of all sets; the first width among them is the width."""
        features: dict[str, Feature] = {}
        has_width = False
        for set_name, part in self._parts.items():
            for feature in part.features:
                name = _distinct(feature.name, set_name, features)
                width = feature.width and not has_width
                has_width |= width
                same = (name, width) == (feature.name, feature.width)
                features[name] = feature if same else evolve(feature, name=name, width=width)
        return tuple(features.values())

    def extract(self, trace: Trace) -> Features:
        """Return the features of all sets. One that lacks a further channel is not asked: it may rely on it."""
        names: dict[str, None] = {}
        values: list[float] = []
        units: list[str] = []
        reasons: dict[str, str] = {}
        for set_name, part in self._parts.items():
            further = signal_type(part.requires)._fields  # type: ignore[attr-defined]
            lacking = [name for name in further if name not in trace.signals]
            why = f"no channel {', '.join(lacking)}"
            features = part.undefined(why, trace.units) if lacking else part.extract(trace)
            own = {name: _distinct(name, set_name, names) for name in features.names}
            names |= dict.fromkeys(own.values())
            values += features.values
            units += features.units
            reasons |= {own[name]: why for name, why in features.reasons.items()}
        return Features(names=tuple(names), values=tuple(values), units=tuple(units), reasons=reasons)

    @cached_property
    def _parts(self) -> dict[str, FeatureSet[Any]]:
        """The sets by their names. Raises ConfigError for no set, a set twice, or a union in a union."""
        wanted = self.config.sets
        if not wanted or len(set(wanted)) < len(wanted):
            raise ConfigError(
                f"features.sets is {list(wanted)}: name at least one feature set, and each of them once"
            )
        parts = {name: create("feature-set", name) for name in wanted}
        if any(isinstance(part, UnionFeatures) for part in parts.values()):
            raise ConfigError("features.sets names a union: name the sets that are to be united")
        return {name: self._with_thresholds(part) for name, part in parts.items()}

    def _with_thresholds(self, part: FeatureSet[Any]) -> FeatureSet[Any]:
        """Return a set with those thresholds of this one that it has."""
        shared = [name for name in THRESHOLDS if name in fields_dict(type(part.config))]
        own = {name: getattr(self.config, name) for name in shared}
        return type(part)(evolve(part.config, **own)) if own else part


def _distinct(name: str, set_name: str, taken: Container[str]) -> str:
    """Return the name of a feature, with that of its set in front if the name is taken."""
    if name not in taken:
        return name
    return f"{set_name.rpartition('/')[2].replace('-', '_')}_{name}"
