"""The content of a model file: JSON with a format, a version, and the hash of everything else.

Both kinds of models, of labels and of numbers, are read here. What comes back are plain values of bounded depth. They
have no numbers that are not finite, and no key is there twice. What they mean is checked by `StoredValues`.
"""

from __future__ import annotations

import hashlib
import json
import math
import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Final

from graspsense import __version__
from graspsense.core.files.whole_file import first_bytes, write_whole
from graspsense.core.values.errors import ConfigError, DataDamaged
from graspsense.core.values.limits import MODEL_BYTES

REGRESSION_FORMAT: Final = "graspsense regression model"
"""The `format` of a model that predicts a number (`graspsense.regression`)."""
MOST_DIGITS: Final = 100
"""Largest number of digits of a whole number in a model."""
MOST_NESTED: Final = 100
"""Largest depth of lists and tables within each other."""


def model_bytes(name: str) -> bytes:
    """Return the content of the file of a model. Raises ConfigError if it cannot be read, or is too large."""
    try:
        content = first_bytes(Path(os.path.expanduser(name)), MODEL_BYTES.most)
    except (OSError, ValueError, RuntimeError) as error:
        raise ConfigError(
            f"model {name} cannot be read: {getattr(error, 'strerror', None) or error}"
        ) from error
    if too_large := MODEL_BYTES.exceeded(len(content)):
        raise ConfigError(f"model {name} has {too_large}")
    return content


def parsed(name: str, text: bytes) -> Any:
    """Return the values in the text of a model. Raises DataDamaged if it is not strict JSON."""
    try:
        values = json.loads(
            text,
            object_pairs_hook=_table,
            parse_constant=_refuse_number,
            parse_int=_whole,
            parse_float=_number,
        )
        _refuse_depth(values)
        digest({"all": values})  # text that cannot be encoded
    except RecursionError:
        raise DataDamaged(f"model {name!r} is damaged: lists or tables in it are nested too deeply") from None
    except ValueError as error:
        why = f"is not JSON: {error}" if text.strip() else "is empty"
        raise DataDamaged(f"model {name!r} {why}") from error
    return values


def sealed_content(name: str, values: Any, form: str, versions: Sequence[int], what: str) -> dict[str, Any]:
    """Return the content of a model of this format and one of these versions, whose hash is right.

    `what` names the format in words. Raises DataDamaged.
    """
    if not isinstance(values, dict) or values.get("format") != form:
        raise DataDamaged(f'{name!r} is not a {what}: it lacks "format": "{form}"')
    if values.get("version") not in versions:
        raise DataDamaged(
            f"model {name!r} has version {values.get('version')!r:.40}; this graspsense ({__version__}) reads up to "
            f"{versions[-1]}"
        )
    content = {key: value for key, value in values.items() if key != "sha256"}
    if values.get("sha256") != digest(content):
        raise DataDamaged(f"model {name!r} was changed or damaged: its sha256 does not match")
    return content


def digest(content: Mapping[str, Any]) -> str:
    """Return the hash of the content of a model."""
    text = json.dumps(content, sort_keys=True, ensure_ascii=False, separators=(",", ":"))
    return hashlib.sha256(text.encode()).hexdigest()


def _table(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    table = dict(pairs)
    if len(table) < len(pairs):
        keys = [key for key, _ in pairs]
        twice = next(key for key in keys if keys.count(key) > 1)
        raise ValueError(f"the key {twice[:40]!r} is there twice")
    return table


def _whole(text: str) -> int:
    if len(text) > MOST_DIGITS + 1:
        raise ValueError(f"a whole number has {len(text)} digits, of at most {MOST_DIGITS}")
    return int(text)


def _number(text: str) -> float:
    number = float(text)
    if not math.isfinite(number):
        return float(_refuse_number(text))
    return number


def _refuse_number(text: str) -> Any:
    raise ValueError(f"{text[:40]} is not a finite number")


def _refuse_depth(values: Any) -> None:
    """Raise RecursionError for values that are nested too deeply for what reads them later."""
    level = [values]
    for _ in range(MOST_NESTED):
        level = [
            item
            for value in level
            if isinstance(value, dict | list)
            for item in (value.values() if isinstance(value, dict) else value)
            if isinstance(item, dict | list)
        ]
        if not level:
            return
    raise RecursionError


def write_json_lines(path: Path, content: Mapping[str, Any]) -> None:
    """Write the content of a model atomically, one line for each key. Raises OSError."""
    # Readable, and much shorter than one line for each number.
    lines = (f"{json.dumps(key)}: {_json(value)}" for key, value in content.items())
    write_whole(path, ("{\n" + ",\n".join(lines) + "\n}\n").encode())


def _json(value: Any) -> str:
    return json.dumps(value, ensure_ascii=False, allow_nan=False)
