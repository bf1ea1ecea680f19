"""What is known of a complete recording on the disk: its hash, its size, and the counters of its writer."""

from __future__ import annotations

import hashlib
from pathlib import Path
from typing import Final

from attrs import asdict, frozen

WRITTEN: Final = ("sha256", "size", "ticks", "images")
"""What the process that writes a recording says of it at the end."""


@frozen(kw_only=True)
class RecordingInfo:
    """A complete recording on the disk.

    `deferred` counts the messages that the pipe to the writer process did not take at once, and `dropped` those that
    were given up.
    """

    path: Path
    sha256: str
    size: int
    """Bytes."""
    ticks: int
    images: int
    deferred: int = 0
    dropped: int = 0

    @property
    def counts(self) -> dict[str, int]:
        """The counters, for reports."""
        return {name: value for name, value in asdict(self).items() if name not in ("path", "sha256", "size")}

    @classmethod
    def hashed(cls, path: Path, ticks: int, images: int) -> RecordingInfo:
        """Hash a recording that is already on the disk. Raises OSError."""
        with path.open("rb") as file:
            sha256 = hashlib.file_digest(file, "sha256").hexdigest()
        return cls(path=path, sha256=sha256, size=path.stat().st_size, ticks=ticks, images=images)
