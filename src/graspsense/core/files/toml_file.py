"""Files of settings in TOML: read within their limits, and refused with the file, the line and the column."""

from __future__ import annotations

from difflib import get_close_matches
from importlib.resources.abc import Traversable
from pathlib import Path
from typing import Any

from graspsense.core.files.toml_text import TomlError, toml_values
from graspsense.core.files.whole_file import first_bytes
from graspsense.core.values.errors import ConfigError
from graspsense.core.values.limits import SETTINGS_BYTES


def labelled_values(text: str, label: str) -> dict[str, Any]:
    """Return the values of a TOML text, which errors call `label`. Raises ConfigError."""
    try:
        return toml_values(text)
    except TomlError as error:
        line = f":{error.line}" if error.line else ""
        column = f", column {error.column}" if error.column else ""
        raise ConfigError(f"{label}{line}{column}: {error}") from None


def settings_text(source: Traversable, label: str, what: str) -> str:
    """Return the text of a file of settings, which errors call `label`; `what` is its kind. Raises ConfigError."""
    try:
        data = first_bytes(source, SETTINGS_BYTES.most)
    except FileNotFoundError:
        raise ConfigError(f"no {what} file {label!r}{_nearby(source)}") from None
    except OSError as error:
        raise ConfigError(f"cannot read the {what} file {label!r}: {error.strerror or error}") from None
    why = SETTINGS_BYTES.exceeded(len(data))
    if why:
        raise ConfigError(f"{label}: {why}")
    try:
        return data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        line = data.count(b"\n", 0, error.start) + 1
        raise ConfigError(
            f"{label}:{line}: not UTF-8 text (byte 0x{data[error.start]:02x}): "
            "TOML files are UTF-8; is this the right file?"
        ) from None


def _nearby(missing: Traversable) -> str:
    """Return the folder in which a file was sought, and the file there with the most similar name."""
    if not isinstance(missing, Path):
        return ""
    folder = missing.absolute().parent
    if not folder.is_dir():
        return f": there is no folder {str(folder)!r}"
    # Without the ending, which would make all names similar.
    near = get_close_matches(missing.stem, [path.stem for path in folder.glob("*.toml")], n=1)
    return f" in {folder}" + (f". Did you mean {near[0] + '.toml'!r}?" if near else "")
