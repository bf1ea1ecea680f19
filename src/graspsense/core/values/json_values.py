"""Values as JSON: the one representation of numbers that JSON does not have.

NaN becomes null, positive infinity `"inf"` and negative infinity `"-inf"`. Everything that graspsense writes as JSON,
settings included, passes through here. `settings_from_json` reads settings back.
"""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from typing import Any, Final, get_args

import attrs

_INFINITE: Final = {"inf": math.inf, "-inf": -math.inf}


def json_ready(value: Any) -> Any:
    """Return this value with mappings as dictionaries with text keys, sequences as lists, and only finite numbers."""
    if isinstance(value, float):
        if math.isfinite(value):
            return value
        return None if math.isnan(value) else str(value)
    if value is None or isinstance(value, str | int):
        return value
    if isinstance(value, Mapping):
        return {str(key): json_ready(member) for key, member in value.items()}
    if isinstance(value, list | tuple):
        return [json_ready(member) for member in value]
    return value


def json_text(value: Any) -> str:
    """Return this value as JSON in a canonical form: sorted keys, no spaces, so that equal values give equal text."""
    return json.dumps(
        json_ready(value), sort_keys=True, separators=(",", ":"), ensure_ascii=False, allow_nan=False
    )


def settings_from_json(values: Mapping[str, Any], config_class: type) -> dict[str, Any]:
    """Return settings read from JSON with each `"inf"` and `"-inf"` as the number where the class has a number.

    A setting that is text keeps these words.
    """
    attrs.resolve_types(config_class)
    types = {field.alias: field.type for field in attrs.fields(config_class)}
    return {key: _read(value, types.get(key)) for key, value in values.items()}


def _read(value: Any, declared: Any) -> Any:
    if isinstance(value, Mapping) and isinstance(declared, type) and attrs.has(declared):
        return settings_from_json(value, declared)
    alternatives = get_args(declared) or (declared,)
    if isinstance(value, str) and float in alternatives and str not in alternatives:
        return _INFINITE.get(value, value)
    if isinstance(value, list):
        return [_read(member, alternatives[0]) for member in value]
    return value
